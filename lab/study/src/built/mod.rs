//! Detectors as they are built: solvers get the description, readings come from what was made of it.
//!
//! Detectors are [drawn](tactomo_physics::simulate::drawn) from the tolerances of a description, or come from a file that another program solved ([`file`]).

mod figures;
mod file;
mod view;

use std::path::PathBuf;

use super::calibrate::{Calibrated, Scene, read, rubbed};
use super::experiment::{Experiment, StudyError};
use super::judge::{Judged, wrong_m};
use super::presses;
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;
use tactomo_physics::scene::{Contact, Touch};
use tactomo_physics::simulate::{Noise, measured};
use tactomo_physics::threads::map_on;
use tactomo_touch::solve::{Method, Problem, Solution};

pub use self::figures::{Figures, Row};
pub use self::file::{BuiltFile, BuiltFileError};
pub use self::view::view;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The description; its tolerances are what detectors are drawn from.
    pub detector: Detector,
    /// Files of detectors as built, instead of drawn ones.
    pub files: Vec<PathBuf>,
    /// Solvers to compare.
    pub methods: Vec<Method>,
    /// How many detectors are drawn.
    pub detectors: usize,
    /// Single presses on each; a quarter as many scenes of two.
    pub presses: usize,
    /// Presses at unknown places, each on its own, that the detector is calibrated with before; none leaves it as described. Of a file the
    /// first ones, which are then not tried.
    pub rub: usize,
    /// How many of those are at known places.
    pub known: usize,
    /// Detectors tried at a time.
    pub threads: usize,
    /// First of the seeds that detectors, scenes and noise are drawn with.
    pub seed: u64,
}

/// Why it cannot be tried.
#[derive(Debug, thiserror::Error)]
pub enum BuiltError {
    /// A detector cannot be modelled, or a solver refuses its readings.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A file cannot be used.
    #[error(transparent)]
    File(#[from] BuiltFileError),
}

/// What came out.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// How to run it again.
    pub command: String,
    /// Names of the detectors.
    pub detectors: Vec<String>,
    /// Detectors whose calibration was refused, and why: solvers know their description.
    pub refused: Vec<String>,
    /// Figures of each solver, for each detector that comes from a file, and over all.
    pub rows: Vec<Row>,
    /// Every scene of every solver.
    pub trials: Vec<Trial>,
}

/// One scene as one solver saw it.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Trial {
    /// Which detector.
    pub detector: usize,
    /// Which scene of it.
    pub scene: usize,
    /// Name of the solver.
    pub solver: &'static str,
    /// What touched.
    pub truth: Vec<Contact>,
    /// Contacts found: none where the answer is a shape or an image.
    pub found: Vec<[f64; 2]>,
    /// What the solver chose and why, if it says so.
    pub choice: Option<String>,
    /// Distances of the true contacts from those found for them (m).
    pub errors_m: Vec<f64>,
    /// Whether as many contacts were found as touched.
    pub is_count_right: bool,
    /// Whether the solver says that its answer does not explain the readings.
    pub misfit: bool,
    /// Errors of x and y in standard errors as claimed.
    pub sigmas: Vec<[f64; 2]>,
    /// Errors of the logarithms of conductances, each with the standard error that is claimed.
    pub ln_conductances: Vec<[f64; 2]>,
    /// Claimed standard errors of places (m): the root of the mean square of both axes.
    pub claimed_m: Vec<f64>,
    /// Time of the frame (s).
    pub time_s: f64,
}

/// A detector as built, with what was read of it.
struct Built {
    name: String,
    /// What solvers get.
    problem: Problem,
    scenes: Vec<Scene>,
    /// Why its calibration was refused, if it was.
    refused: Option<String>,
}

/// Tries all solvers on all detectors. `progress` is called with what is done next.
///
/// # Errors
/// [`BuiltError`] if a file, a detector or a solver cannot be used.
pub fn run(plan: &Plan, command: &str, progress: &(dyn Fn(&str) + Sync)) -> Result<Report, BuiltError> {
    let count = if plan.files.is_empty() { plan.detectors } else { plan.files.len() };
    let nominal = match plan.files[..] {
        [] => Some(Experiment::new(&plan.detector)?),
        _ => None,
    };
    let one = |index: &usize| {
        let built = match &nominal {
            Some(nominal) => from_tolerances(plan, nominal, *index)?,
            None => from_file(plan, *index)?,
        };
        built.refused.iter().for_each(|why| progress(why));
        progress(&format!("{}: {} scenes", built.name, built.scenes.len()));
        let trials = try_all(plan, *index, &built)?;
        Ok(Tried { name: built.name, refused: built.refused, trials })
    };
    let indices: Vec<usize> = (0..count).collect();
    let parts: Vec<Tried> =
        map_on(plan.threads.max(1), &indices, one).into_iter().collect::<Result<_, BuiltError>>()?;
    let detectors: Vec<_> = parts.iter().map(|tried| tried.name.clone()).collect();
    let refused = parts.iter().filter_map(|tried| tried.refused.clone()).collect();
    let trials: Vec<_> = parts.into_iter().flat_map(|tried| tried.trials).collect();
    let rows = figures::rows(&plan.methods, &trials, if plan.files.is_empty() { &[] } else { &detectors });
    Ok(Report { command: command.to_owned(), detectors, refused, rows, trials })
}

/// A detector that was tried.
struct Tried {
    name: String,
    refused: Option<String>,
    trials: Vec<Trial>,
}

fn from_tolerances(plan: &Plan, nominal: &Experiment, index: usize) -> Result<Built, BuiltError> {
    let seed = plan.seed.wrapping_add(index as u64);
    let experiment = nominal.as_built(seed)?;
    let rubbed = rubbed(&experiment, plan.rub, seed)?;
    let scenes = read(&experiment, presses::random(&plan.detector, plan.presses, seed), seed)?;
    let name = format!("{} as built {seed}", plan.detector.name);
    Built { name, problem: experiment.problem, scenes, refused: None }.calibrated(plan, &rubbed)
}

impl Built {
    /// The same for solvers that know the detector by a rub.
    fn calibrated(self, plan: &Plan, rubbed: &[Scene]) -> Result<Self, BuiltError> {
        if rubbed.is_empty() {
            return Ok(self);
        }
        let Calibrated { detector, refused } = Calibrated::of(self.problem.detector(), rubbed, plan.known);
        if let Some(error) = refused {
            return Ok(Self { refused: Some(format!("{}: {}", self.name, with_causes(&error))), ..self });
        }
        let problem = Problem::of(&detector).map_err(StudyError::from)?;
        let corrected = |(contacts, mut readings): Scene| {
            readings.correct_channels(&detector);
            (contacts, readings)
        };
        Ok(Self { problem, scenes: self.scenes.into_iter().map(corrected).collect(), ..self })
    }
}

fn from_file(plan: &Plan, index: usize) -> Result<Built, BuiltError> {
    let BuiltFile { nominal, scenes } = BuiltFile::read(&plan.files[index])?;
    let mut noise = Noise::new(plan.seed);
    let adc = nominal.adc;
    let read = scenes.into_iter().map(|(contacts, exact)| (contacts, measured(&exact, &adc, &mut noise)));
    let mut rubbed: Vec<Scene> = read.collect();
    let tried = rubbed.split_off(plan.rub.min(rubbed.len()));
    let problem = Problem::of(&nominal).map_err(StudyError::from)?;
    Built { name: nominal.name, problem, scenes: tried, refused: None }.calibrated(plan, &rubbed)
}

fn try_all(plan: &Plan, detector: usize, built: &Built) -> Result<Vec<Trial>, StudyError> {
    let mut trials = Vec::with_capacity(plan.methods.len() * built.scenes.len());
    for method in &plan.methods {
        let mut solver = method.build(&built.problem)?;
        for (scene, (contacts, readings)) in built.scenes.iter().enumerate() {
            solver.reset();
            let (solution, time) = super::stopwatch::timed(|| solver.solve(readings));
            let solution = solution.map_err(|error| StudyError::Solve { solver: method.name().to_owned(), error })?;
            let touches: Vec<Touch> = contacts.iter().copied().map(Touch::from).collect();
            let judged = Judged::of(wrong_m(built.problem.detector()), &touches, &solution);
            trials.push(Trial::new([detector, scene], *method, judged, &solution, time.as_secs_f64()));
        }
    }
    Ok(trials)
}

impl Trial {
    fn new([detector, scene]: [usize; 2], method: Method, judged: Judged, solution: &Solution, time_s: f64) -> Self {
        let (matching, is_count_right) = (judged.pairs(), judged.is_number_right());
        let Judged { found, truth, .. } = judged;
        let mut sigmas = Vec::new();
        let (mut claimed_m, mut ln_conductances) = (Vec::new(), Vec::new());
        for pair in &matching.pairs {
            let (truth, found) = (&truth[pair.truth], &found[pair.found]);
            if let Some(claimed) = found.uncertainty {
                let off = (found.conductance_s / truth.conductance_s).ln();
                ln_conductances.push([off, claimed.conductance_s / found.conductance_s]);
                sigmas.push([(found.x_m - truth.x_m) / claimed.x_m, (found.y_m - truth.y_m) / claimed.y_m]);
                claimed_m.push((0.5 * (claimed.x_m.powi(2) + claimed.y_m.powi(2))).sqrt());
            }
        }
        Self {
            detector,
            scene,
            solver: method.name(),
            truth,
            found: found.iter().map(|contact| [contact.x_m, contact.y_m]).collect(),
            choice: solution.choice.as_ref().map(|choice| format!("{}: {}", choice.what, choice.why)),
            errors_m: matching.pairs.iter().map(|pair| pair.distance_m).collect(),
            is_count_right,
            misfit: solution.flags.misfit,
            sigmas,
            ln_conductances,
            claimed_m,
            time_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Tolerances;

    fn plan(detector: Detector) -> Plan {
        Plan {
            detector,
            files: vec![],
            methods: vec![Method::Contacts],
            detectors: 2,
            presses: 4,
            rub: 0,
            known: 0,
            threads: 1,
            seed: 7,
        }
    }

    #[test]
    fn presses_on_exact_detectors_are_found_to_two_tenths_of_a_millimetre_and_rough_ones_say_that_they_are_not() {
        let run = |tolerances| {
            let report = run(&plan(Detector { tolerances, ..Detector::default() }), "", &|_| ()).unwrap();
            assert_eq!((report.detectors.len(), report.trials.len()), (2, 10));
            assert!(crate::view::text(&[view(&report)]).contains("contacts"));
            report.rows.into_iter().find(|row| row.contacts == 1).unwrap().figures
        };
        let exact = run(Tolerances::EXACT);
        assert!(exact.error_m.unwrap() < 2e-4 && exact.count_right == 1.0, "{exact:?}");
        let rough = run(Tolerances::default());
        assert!(rough.claimed_m.unwrap() > 3.0 * exact.claimed_m.unwrap(), "{rough:?}");
    }
}
