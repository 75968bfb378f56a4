//! The paper's study of thickness, its figure 4: how far a thick detector is from the thin shell that its solver takes it for; and where
//! each solver starts to fail because of that.

mod view;

use std::time::Instant;

use tactomo_physics::detector::{Detector, Layer};
use tactomo_physics::forward::shell::Shell;
use tactomo_physics::forward::{ForwardError, ForwardModel, Slab, readings_v};
use tactomo_physics::scene::{Contact, Touch};
use tactomo_study::judge::{answered, wrong_m};
use tactomo_study::{Experiment, Frame, StudyError};
use tactomo_touch::metrics::Matching;
use tactomo_touch::solve::Method;

use super::claim::{Basis, Found, Trend, Verdict};
use super::press::{COMPARED_S_PER_M, nine_places};
use super::rank::mean;
use super::{Claim, Course, DesignError, Press, Progress};

pub use self::view::view;

/// Thicknesses (m), and conductivity (S/m), section III.B.
const THICKNESSES_M: [f64; 5] = [1e-3, 2e-3, 4e-3, 8e-3, 16e-3];
const CONDUCTIVITY_S_PER_M: f64 = 1.0;
/// Correlation above which vectors count as strongly correlated.
const STRONG: f64 = 0.9;

/// Of the nine places, the one whose readings are drawn: a side.
const DRAWN: usize = 5;
/// Of the nine places, those that solvers are tried at: the middle, a side and a corner. The others are these again, turned or mirrored.
const TRIED: [usize; 3] = [4, 5, 8];

/// What to compute.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Solvers that are tried.
    pub methods: Vec<Method>,
    /// Of noise.
    pub seed: u64,
}

/// Solvers that are tried unless others are asked for: all but [`Method::Auto`], which makes of single contacts what [`Method::Contacts`] does, and
/// [`Method::Network`], which is trained for one thickness.
pub fn methods() -> Vec<Method> {
    Method::ALL.into_iter().filter(|method| !matches!(method, Method::Auto | Method::Network)).collect()
}

/// Models compared at one thickness.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Row {
    /// Thickness of the detector (m).
    pub thickness_m: f64,
    /// Correlation of the slab's readings with those of the thin shell of the same sheet conductance, over nine places.
    pub correlation: f64,
    /// Largest reading of the slab (V).
    pub largest_v: f64,
    /// The same of the shell (V).
    pub shell_largest_v: f64,
    /// Mean absolute error of the readings, each over the largest of its model.
    pub mean_absolute_error: f64,
    /// Readings of one contact at a side over the largest of them, but for those of grounded electrodes: of the slab, and of the shell.
    pub normalised: [Vec<f64>; 2],
    /// What solvers make of the slab's readings.
    pub solvers: Vec<SolverRow>,
}

/// A solver at one thickness.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SolverRow {
    /// Its name.
    pub solver: &'static str,
    /// Its family, for colours.
    pub family: &'static str,
    /// Mean error (m) where it takes the detector for a thin shell; a contact missed or invented counts the distance of electrodes.
    pub on_shell_m: f64,
    /// The same where it inverts the slab.
    pub on_slab_m: f64,
}

/// All of the study.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// From the thinnest.
    pub rows: Vec<Row>,
    /// Error from which on a solver counts as failing (m).
    pub fails_from_m: f64,
    /// What was concluded, and how the study went.
    #[serde(flatten)]
    pub course: Course,
}

/// Runs the study.
///
/// # Errors
/// [`DesignError`] if there is no model of a detector.
pub fn run(plan: &Plan, progress: Progress) -> Result<Report, DesignError> {
    let start = Instant::now();
    // The thickest first: it takes longest.
    let thicknesses_m: Vec<f64> = THICKNESSES_M.into_iter().rev().collect();
    let computed = progress.map("thicknesses", &thicknesses_m, |thickness_m| row(plan, *thickness_m));
    let is_stopped = computed.iter().any(Option::is_none);
    let mut rows: Vec<Row> = computed.into_iter().flatten().collect::<Result<_, _>>()?;
    rows.reverse();
    let course = Course::since(start, is_stopped, claims(&rows));
    Ok(Report { rows, fails_from_m: wrong_m(&Detector::default()), course })
}

fn row(plan: &Plan, thickness_m: f64) -> Result<Row, DesignError> {
    let layers = vec![Layer::uniform(thickness_m, CONDUCTIVITY_S_PER_M)];
    let detector = Detector { layers, ..Detector::default().taken_as_exact() };
    let slab = Slab::new(&detector)?;
    let shell = Shell::new(&detector)?;
    let contacts = nine_places(&detector).map(|place| Press::PAPER.at(place, COMPARED_S_PER_M));
    let [thick, thin] = [&slab as &dyn ForwardModel, &shell].map(|model| vector_v(model, &contacts));
    let (thick, thin) = (thick?, thin?);
    let [largest_v, shell_largest_v] = [&thick, &thin].map(|vector| vector.iter().copied().fold(0.0, f64::max));
    let apart = |(a, b): (&f64, &f64)| (a / largest_v - b / shell_largest_v).abs();
    Ok(Row {
        thickness_m,
        correlation: correlation(&thick, &thin),
        largest_v,
        shell_largest_v,
        mean_absolute_error: thick.iter().zip(&thin).map(apart).sum::<f64>() / thick.len() as f64,
        normalised: [&thick, &thin].map(|vector| drawn(vector, contacts.len())),
        solvers: solvers(plan, &detector, shell, slab, &contacts)?,
    })
}

/// The part of a vector over several contacts that is of the one that is drawn, over its largest reading.
fn drawn(vector: &[f64], contacts: usize) -> Vec<f64> {
    let one = vector.chunks(vector.len() / contacts).nth(DRAWN).unwrap_or_default();
    let largest_v = one.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    one.iter().map(|volt| volt / largest_v).collect()
}

/// Readings of each contact alone, but for those of grounded electrodes (V).
fn vector_v(model: &dyn ForwardModel, contacts: &[Contact]) -> Result<Vec<f64>, ForwardError> {
    let mut vector = Vec::new();
    for contact in contacts {
        let readings = readings_v(&model.impedance_ohm(&[*contact])?, model.detector());
        let electrodes = readings.electrodes();
        let pairs = (0..electrodes).flat_map(|g| (0..electrodes).map(move |e| (g, e))).filter(|(g, e)| g != e);
        vector.extend(pairs.map(|(g, e)| readings.at(g, e)));
    }
    Ok(vector)
}

/// Pearson's.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let centred = |all: &[f64]| {
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        all.iter().map(|value| value - mean).collect::<Vec<_>>()
    };
    let (a, b) = (centred(a), centred(b));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    product(&a, &b) / (product(&a, &a) * product(&b, &b)).sqrt()
}

/// What solvers make of readings of a slab finer than the one that is inverted.
fn solvers(
    plan: &Plan,
    detector: &Detector,
    shell: Shell,
    slab: Slab,
    contacts: &[Contact],
) -> Result<Vec<SolverRow>, StudyError> {
    let experiment = Experiment::new(detector)?;
    let touches: Vec<_> = TRIED.iter().map(|place| vec![Touch::from(contacts[*place])]).collect();
    let frames = experiment.frames(&touches, plan.seed)?;
    let (on_shell, on_slab) = (experiment.inverted_on(Box::new(shell)), experiment.inverted_on(Box::new(slab)));
    let of = |method: &Method| {
        Ok(SolverRow {
            solver: method.name(),
            family: method.family().class(),
            on_shell_m: error_m(*method, &on_shell, &frames)?,
            on_slab_m: error_m(*method, &on_slab, &frames)?,
        })
    };
    plan.methods.iter().map(of).collect()
}

/// Mean error of cold starts (m).
fn error_m(method: Method, experiment: &Experiment, frames: &[Frame]) -> Result<f64, StudyError> {
    let reach_m = experiment.reach_m();
    let mut solver = method.build(&experiment.problem)?;
    let mut errors_m = Vec::new();
    for frame in frames {
        solver.reset();
        let solution = solver
            .solve(&frame.readings)
            .map_err(|error| StudyError::Solve { solver: method.name().to_owned(), error })?;
        let truth = frame.contacts.as_deref().unwrap_or_default();
        errors_m.push(Matching::within(reach_m, truth, answered(&solution)).ospa_m(reach_m));
    }
    Ok(mean(&errors_m).unwrap_or(0.0))
}

fn claims(rows: &[Row]) -> Vec<Claim> {
    let [Some(first), Some(last)] = [rows.first(), rows.last()] else { return Vec::new() };
    let mm = |row: &Row| row.thickness_m * 1e3;
    let contacts = |row: &Row| row.solvers.iter().find(|row| row.solver == Method::Contacts.name()).cloned();
    let correlated = rows.iter().all(|row| row.correlation > STRONG);
    let off = |of: fn(&SolverRow) -> f64| {
        let all =
            rows.iter().filter_map(|row| Some(format!("{:.2} mm at {:.0} mm", of(&contacts(row)?) * 1e3, mm(row))));
        all.collect::<Vec<_>>().join(", ")
    };
    let errors: Vec<_> = rows.iter().map(|row| [row.thickness_m, row.mean_absolute_error]).collect();
    let grows = Trend::of("mean absolute error with thickness", &errors);
    // Of the sensor it would be that a solver with the right model got worse as well.
    let right = rows.iter().filter_map(|row| Some([row.thickness_m, contacts(row)?.on_slab_m])).collect::<Vec<_>>();
    let worse = right.first().zip(right.last()).map(|(thin, thick)| thick[1] > 2.0 * thin[1]);
    let correlations = format!(
        "correlation {:.3} at {:.0} mm, {:.3} at {:.0} mm",
        first.correlation,
        mm(first),
        last.correlation,
        mm(last)
    );
    let [least, most] = [first, last].map(|row| row.mean_absolute_error);
    let growth = format!("{}: {least:.3} to {most:.3} of the largest reading", grows.text());
    vec![
        Claim::new(
            "readings of thick detectors correlate strongly with those of the thin shell",
            Basis::Readings,
            [
                correlations,
                format!("yet `contacts` that takes them for a shell is off by {}", off(|row| row.on_shell_m)),
            ]
            .map(|text| Found::new(Verdict::of(Some(correlated)), text)),
        ),
        Claim::new(
            "the error grows with the detector's thickness",
            Basis::Readings,
            [
                Found::new(grows.verdict(), growth),
                Found::new(
                    Verdict::of(worse),
                    format!("`contacts` with the slab is off by {}", off(|row| row.on_slab_m)),
                ),
            ],
        ),
    ]
}

impl Report {
    /// The thinnest detector (m) on which a solver fails that takes it for a shell; `None` if it fails on none.
    pub fn fails_at_m(&self, solver: &str, error_m: fn(&SolverRow) -> f64) -> Option<f64> {
        let fails = |row: &&Row| row.solvers.iter().any(|row| row.solver == solver && error_m(row) > self.fails_from_m);
        self.rows.iter().find(fails).map(|row| row.thickness_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicBool;

    #[test]
    fn shells_are_right_for_thin_detectors_and_correlate_less_with_thick_ones() {
        let stop = AtomicBool::new(false);
        let plan = Plan { methods: vec![Method::Contacts, Method::TikhonovPaper], seed: 1 };
        let report = run(&plan, Progress::new(&stop, &|_| {})).unwrap();
        let rows = &report.rows;
        assert_eq!(rows.iter().map(|row| row.thickness_m).collect::<Vec<_>>(), THICKNESSES_M);
        assert!(rows[0].correlation > 0.9 && rows.windows(2).all(|pair| pair[1].correlation < pair[0].correlation));
        assert!(rows.windows(2).all(|pair| pair[1].mean_absolute_error > pair[0].mean_absolute_error));
        let contacts = |row: &Row| row.solvers[0].clone();
        assert!(contacts(&rows[4]).on_slab_m < 1e-3 && contacts(&rows[4]).on_shell_m > contacts(&rows[4]).on_slab_m);
        for row in rows {
            let [slab, shell] = &row.normalised;
            let largest = slab.iter().copied().fold(0.0, f64::max);
            assert!(slab.len() == 240 && shell.len() == 240 && (largest - 1.0).abs() < 1e-12);
        }
        let apart =
            |row: &Row| row.normalised[0].iter().zip(&row.normalised[1]).map(|(a, b)| (a - b).abs()).sum::<f64>();
        assert!(apart(&rows[4]) > 5.0 * apart(&rows[0]));
        assert_eq!(report.fails_at_m("contacts", |row| row.on_slab_m), None);
        let view = [view(&report)];
        let text = tactomo_study::view::text(&view);
        assert!(text.contains("contacts") && text.contains("16 mm"), "{text}");
        assert_eq!(tactomo_study::view::csv(&view).lines().count(), 6);
    }

    #[test]
    fn correlation_is_pearsons() {
        assert!((correlation(&[1.0, 2.0, 3.0], &[2.0, 4.0, 6.0]) - 1.0).abs() < 1e-12);
        // By hand: deviations (-1, 0, 1) and (-4/3, 5/3, -1/3): 1 / sqrt(2 x 42 / 9).
        assert!((correlation(&[1.0, 2.0, 3.0], &[0.0, 3.0, 1.0]) - 0.327_326_8).abs() < 1e-6);
    }
}
