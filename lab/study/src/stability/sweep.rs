//! Sweeps and how they are run.

use std::cell::RefCell;

use super::bounds::{self, BoundReport};
use super::breakdown::{Break, CellReport, breaks};
use super::errors::{self, ErrorCurve, ErrorRange};
use super::trials::Trials;
use super::{faults, scenes, tolerances, wrong};
use crate::calibrate::Calibrate;
use crate::experiment::{Experiment, Frame, StudyError};
use crate::machine::Machine;
use crate::scenes::SceneKind;
use tactomo_physics::detector::Detector;
use tactomo_physics::scene::{Contact, Hand, Touch};
use tactomo_touch::solve::{Method, ParameterKind};

/// Lambda's sweep, in shares of the largest singular value.
const LAMBDAS: [f64; 7] = [1e-5, 1e-4, 1e-3, 0.01, 0.1, 1.0, 10.0];
/// Of the points of a sweep, a quick study tries every third, and the last.
const QUICK_STEP: usize = 3;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The detector.
    pub detector: Detector,
    /// Solvers.
    pub methods: Vec<Method>,
    /// Places of the contacts at each point.
    pub places: usize,
    /// Frames at each place.
    pub frames: usize,
    /// Where places and noise start.
    pub seed: u64,
    /// Whether only some of the points are tried.
    pub quick: bool,
    /// If given, everything but the sweeps of tolerances is simulated on the detector as it was built with this seed.
    pub as_built: Option<u64>,
    /// If given, sweeps of tolerances are tried after a calibration too.
    pub calibrate: Option<Calibrate>,
}

/// What came out.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Where it ran.
    pub machine: Machine,
    /// How to run it again.
    pub command: String,
    /// Name of the detector.
    pub detector: String,
    /// Mean distance of its electrodes (m): what a contact missed or invented counts.
    pub reach_m: f64,
    /// Seed.
    pub seed: u64,
    /// The seed of the detector as it was built, if everything is simulated on one.
    pub as_built: Option<u64>,
    /// Places of the contacts at each point.
    pub places: usize,
    /// Frames at each place.
    pub frames: usize,
    /// The sweeps.
    pub sweeps: Vec<SweepReport>,
    /// How often each solver is how far off, over the points of all sweeps.
    pub errors: Vec<ErrorCurve>,
    /// What noise allows, beside what solvers reach.
    pub bounds: BoundReport,
}

/// What came out of a sweep.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SweepReport {
    /// What was varied.
    pub title: String,
    /// How.
    pub note: String,
    /// The points.
    pub points: Vec<PointReport>,
    /// A row for each solver.
    pub solvers: Vec<SolverRow>,
    /// The same of detectors that were calibrated before, where that was tried.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub calibrated: Vec<SolverRow>,
}

/// A point of a sweep.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PointReport {
    /// Its value, for people.
    pub label: String,
    /// How bad it is: the larger, the worse; the smallest is the harmless one. Only the order counts.
    pub severity: f64,
}

/// What a solver made of a sweep.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SolverRow {
    /// Its name.
    pub solver: String,
    /// One for each point; `None` where the solver cannot be made for the model.
    pub cells: Vec<Option<CellReport>>,
    /// Its errors, however they compare with each other.
    pub errors: ErrorRange,
    /// The mildest point at which it breaks, if it does.
    pub breaks: Option<Break>,
}

/// Something that is varied.
pub(super) struct Sweep {
    pub title: &'static str,
    pub note: String,
    pub points: Vec<Point>,
}

/// A value of it.
pub(super) struct Point {
    pub label: String,
    pub severity: f64,
    pub experiment: Experiment,
    /// Frames of each place.
    pub places: Vec<Vec<Frame>>,
    /// What solvers know at each place, where that is another detector each time; none if they know the experiment's everywhere.
    pub known: Vec<Experiment>,
    /// What solvers' lambda is set to.
    pub lambda: Option<f64>,
    /// The same after a calibration, where that is tried.
    pub calibrated: Option<Box<Point>>,
}

/// What sweeps are made from.
pub(super) struct Bench<'a> {
    pub plan: &'a Plan,
    /// The sound detector: as it is described, or as it was built where that is asked for.
    pub sound: Experiment,
    progress: RefCell<&'a mut dyn FnMut(&str)>,
}

impl<'a> Bench<'a> {
    /// Of a plan and its sound detector.
    pub fn new(plan: &'a Plan, sound: Experiment, progress: &'a mut dyn FnMut(&str)) -> Self {
        Self { plan, sound, progress: RefCell::new(progress) }
    }

    /// Tells what is tried next.
    pub fn tell(&self, step: &str) {
        (self.progress.borrow_mut())(step);
    }

    /// Another detector, as it is described or as it was built where that is asked for.
    pub fn experiment(&self, detector: &Detector) -> Result<Experiment, StudyError> {
        Experiment::of(detector, self.plan.as_built)
    }

    /// Seeds of the places.
    pub fn seeds(&self) -> Vec<u64> {
        (0..self.plan.places as u64).map(|place| self.plan.seed.wrapping_mul(1_000_003).wrapping_add(place)).collect()
    }

    /// Of the values of a sweep, those that are tried.
    pub fn some<'v, T>(&self, values: &'v [T]) -> impl Iterator<Item = &'v T> {
        let quick = self.plan.quick;
        let last = values.len().saturating_sub(1);
        let kept = move |(index, _): &(usize, &T)| !quick || index % QUICK_STEP == 0 || *index == last;
        values.iter().enumerate().filter(kept).map(|(_, value)| value)
    }

    /// A point at which a kind of scene touches.
    pub fn point(
        &self,
        label: String,
        severity: f64,
        experiment: Experiment,
        kind: SceneKind,
    ) -> Result<Point, StudyError> {
        let detector = self.sound.detector.clone();
        self.touched(label, severity, experiment, |seed| kind.frames(&detector, seed, 1).remove(0))
    }

    /// A point at which something touches that a seed chooses.
    pub fn touched(
        &self,
        label: String,
        severity: f64,
        experiment: Experiment,
        touches: impl Fn(u64) -> Vec<Touch>,
    ) -> Result<Point, StudyError> {
        let places = self
            .seeds()
            .into_iter()
            .map(|seed| experiment.frames(&vec![touches(seed); self.plan.frames], seed))
            .collect::<Result<_, _>>()?;
        Ok(Point { label, severity, experiment, places, known: Vec::new(), lambda: None, calibrated: None })
    }

    /// The one contact of a kind of scene at a seed.
    pub fn contact(&self, kind: SceneKind, seed: u64) -> Contact {
        let touches = kind.frames(&self.sound.detector, seed, 1).remove(0);
        let centre = || Hand::relative(&self.sound.detector).tip([0.0; 2], 1.0, 1.0);
        let disc = touches.into_iter().next().unwrap_or_else(centre).disc();
        disc.unwrap_or(Contact::flat(0.0, 0.0, 0.0, 0.0))
    }
}

/// Makes some sweeps.
type Maker = fn(&Bench) -> Result<Vec<Sweep>, StudyError>;

/// Runs all sweeps. `progress` is called with what is tried next.
///
/// # Errors
/// [`StudyError`] if the detector cannot be modelled or is curved.
pub fn run(plan: &Plan, command: &str, progress: &mut dyn FnMut(&str)) -> Result<Report, StudyError> {
    let bench = Bench::new(plan, Experiment::of(&plan.detector, plan.as_built)?, progress);
    let makers: [Maker; 5] = [scenes::sweeps, wrong::sweeps, tolerances::sweeps, lambda, faults::sweeps];
    let mut trials = Trials::default();
    let mut sweeps = Vec::new();
    for make in makers {
        for sweep in make(&bench)? {
            bench.tell(sweep.title);
            sweeps.push(try_sweep(plan, sweep, &mut trials)?);
        }
    }
    bench.tell("bounds");
    let bounds = bounds::report(&bench, &mut trials)?;
    Ok(Report {
        machine: Machine::this(),
        command: command.to_owned(),
        detector: plan.detector.name.clone(),
        reach_m: bench.sound.reach_m(),
        seed: plan.seed,
        as_built: plan.as_built,
        places: plan.places,
        frames: plan.frames,
        errors: errors::curves(&sweeps),
        sweeps,
        bounds,
    })
}

fn lambda(bench: &Bench) -> Result<Vec<Sweep>, StudyError> {
    let points = bench
        .some(&LAMBDAS)
        .map(|lambda| {
            let experiment = bench.sound.with_faults(&[], 0)?;
            // Distance from the default, 0.03.
            let severity = (lambda / 0.03).log10().abs();
            let point = bench.point(format!("{lambda}"), severity, experiment, SceneKind::Firm)?;
            Ok(Point { lambda: Some(*lambda), ..point })
        })
        .collect::<Result<_, StudyError>>()?;
    let note = "Of a firm contact; in shares of the largest singular value. Only of solvers that have one.";
    Ok(vec![Sweep { title: "Lambda", note: note.to_owned(), points }])
}

fn try_sweep(plan: &Plan, sweep: Sweep, trials: &mut Trials) -> Result<SweepReport, StudyError> {
    let sweeps_lambda = sweep.points.iter().any(|point| point.lambda.is_some());
    let methods =
        plan.methods.iter().filter(|method| !sweeps_lambda || method.parameter() == Some(ParameterKind::Lambda));
    let before: Vec<&Point> = sweep.points.iter().collect();
    let after: Vec<&Point> = sweep.points.iter().filter_map(|point| point.calibrated.as_deref()).collect();
    let (mut solvers, mut calibrated) = (Vec::new(), Vec::new());
    for method in methods {
        solvers.push(row(*method, &before, trials)?);
        if !after.is_empty() {
            calibrated.push(row(*method, &after, trials)?);
        }
    }
    let point = |point: Point| PointReport { label: point.label, severity: point.severity };
    Ok(SweepReport {
        title: sweep.title.to_owned(),
        note: sweep.note,
        points: sweep.points.into_iter().map(point).collect(),
        solvers,
        calibrated,
    })
}

fn row(method: Method, points: &[&Point], trials: &mut Trials) -> Result<SolverRow, StudyError> {
    let cell = |point: &&Point| {
        let summary = trials.summary(method, point)?;
        Ok(summary.map(|summary| CellReport::of(&summary, point.experiment.reach_m())))
    };
    let mut cells = points.iter().map(cell).collect::<Result<Vec<_>, StudyError>>()?;
    let severities: Vec<f64> = points.iter().map(|point| point.severity).collect();
    let labels: Vec<&str> = points.iter().map(|point| point.label.as_str()).collect();
    let breaks = breaks(&labels, &severities, &mut cells);
    let errors = ErrorRange::of(&severities, &cells);
    Ok(SolverRow { solver: method.name().to_owned(), cells, errors, breaks })
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use super::super::{page, table};
    use super::*;

    /// One run for all tests.
    static REPORT: LazyLock<Report> = LazyLock::new(|| {
        let plan = Plan {
            detector: Detector::preset(Detector::DEFAULT).unwrap(),
            methods: vec![Method::Tikhonov, Method::TikhonovPaper],
            places: 1,
            frames: 1,
            seed: 2,
            quick: true,
            as_built: None,
            calibrate: Some(Calibrate::Perfect),
        };
        run(&plan, "tactomo <stability>", &mut |_| {}).unwrap()
    });

    #[test]
    fn every_sweep_has_a_harmless_point_and_a_cell_for_each_solver_and_point() {
        let report = &*REPORT;
        assert!(report.sweeps.len() > 20);
        for sweep in &report.sweeps {
            let least = sweep.points.iter().map(|point| point.severity).fold(f64::INFINITY, f64::min);
            assert_eq!(sweep.points.iter().filter(|point| point.severity == least).count(), 1, "{}", sweep.title);
            assert!(sweep.points.len() > 2 && sweep.solvers.len() == 2, "{}", sweep.title);
            for row in &sweep.solvers {
                assert_eq!(row.cells.len(), sweep.points.len(), "{}", sweep.title);
                assert!(
                    row.cells.iter().flatten().all(|cell| cell.not_finite == 0.0 && cell.failed == 0.0),
                    "{}",
                    sweep.title
                );
            }
        }
        let breaks = |title: &str| {
            let sweep = report.sweeps.iter().find(|sweep| sweep.title == title).unwrap();
            sweep.solvers[0].breaks.clone()
        };
        assert!(breaks("Noise").is_some(), "nothing is found at 0 dB");
        assert!(breaks("Contact impedances that differ").is_none(), "a linear image does not feel them");
    }

    #[test]
    fn tolerances_of_nothing_are_the_description_and_a_calibration_shows_beyond() {
        let sweep = |title: &str| REPORT.sweeps.iter().find(|sweep| sweep.title == title).unwrap();
        let errors_m = |rows: &[SolverRow]| {
            let cells = rows[0].cells.iter().map(|cell| cell.as_ref().unwrap().error_m.unwrap());
            cells.collect::<Vec<_>>()
        };
        let all = sweep("All tolerances");
        let (before, after) = (errors_m(&all.solvers), errors_m(&all.calibrated));
        assert_eq!(before[0], after[0]);
        assert_ne!(before.last(), after.last());
        assert_eq!(before[0], errors_m(&sweep("Unevenness").solvers)[0]);
        assert!(sweep("Noise").calibrated.is_empty());
        let (page, table) = (page(&REPORT), table(&REPORT));
        assert!(page.contains("All tolerances, calibrated") && page.contains("tikhonov, calibrated"));
        assert_eq!(table.matches("    calibrated ").count(), 2 * 11, "{table}");
    }

    #[test]
    fn the_bound_is_below_what_a_linear_image_reaches() {
        let report = &*REPORT;
        for chart in &report.bounds.charts {
            let (bound, solver) = (&chart.curves[0], &chart.curves[1]);
            assert!(!bound.points.is_empty() && bound.solver.is_none(), "{}", chart.title);
            // Of contacts that cannot be separated in the noise, any guess on the detector is nearer than the bound.
            for [value, bound_m] in bound.points.iter().filter(|[_, bound_m]| *bound_m < 0.1 * report.reach_m) {
                let reached = solver.points.iter().find(|point| point[0] == *value).unwrap();
                assert!(*bound_m > 0.0 && *bound_m < reached[1], "{}: {bound_m} {reached:?}", chart.title);
            }
        }
    }

    #[test]
    fn page_and_table_show_every_sweep() {
        let report = &*REPORT;
        let (page, table) = (page(report), table(report));
        for sweep in &report.sweeps {
            assert!(page.contains(&sweep.title) && table.contains(&sweep.title), "{}", sweep.title);
        }
        for (part, of) in [("How often which error is exceeded", &page), ("Error up to, mm", &table)] {
            assert!(of.contains(part), "{part}");
        }
        let row = |row: &SolverRow| row.errors.median_m.zip(row.errors.largest_m);
        let errors: Vec<_> = report.sweeps.iter().flat_map(|sweep| &sweep.solvers).filter_map(row).collect();
        assert!(errors.len() > 20 && errors.iter().all(|(median_m, largest_m)| median_m <= largest_m));
        let fits = page.find("heat whole").is_some_and(|at| at < page.find("Against what noise allows").unwrap());
        assert!(fits, "the overview takes the width of the page, whatever its columns");
        assert!(page.contains("tactomo &lt;stability&gt;") && page.contains("noise limit"));
    }
}
