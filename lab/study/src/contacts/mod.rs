//! How well contacts of any size, strength and number are found: random scenes, each from a cold start, against the Cramer-Rao bound.

mod judge;
mod rows;
mod scenes;
mod view;

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use self::scenes::RandomScene;
use super::bound::{Errors, cramer_rao};
use super::calibrate::{Calibrate, Calibrated};
use super::experiment::{Experiment, StudyError};
use super::machine::Machine;
use super::stopwatch::timed;
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::{Detector, FOAMS, Layer};
use tactomo_physics::scene::Touch;
use tactomo_touch::solve::{Method, SolveError, Solver};

pub use self::judge::{Judged, Match, Place, TrueContact};
pub use self::rows::{Claims, ContactFigures, Quantiles, Row, SceneFigures};
pub use self::view::view;

/// Frames a scene has at least: the first is a cold start, and the time to follow is that of the third and those after it, as a solver that
/// averages still frames searches their mean again when it has twice as many of them.
const MIN_FRAMES: usize = 3;
/// How much better the graded detector conducts at the bottom than at the top: as much as the paper's samples differ, and more.
const GRADING: f64 = 10.0;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Detectors, which scenes have in turns.
    pub detectors: Vec<Detector>,
    /// The solver.
    pub method: Method,
    /// How many scenes, of one to five contacts in turns.
    pub scenes: usize,
    /// Frames of each scene, with new noise each; the answer to the last one is judged.
    pub frames: usize,
    /// Threads that try scenes; times are right with one only.
    pub threads: usize,
    /// How many of the worst scenes are kept.
    pub worst: usize,
    /// Where scenes and noise start.
    pub seed: u64,
    /// If given, readings are those of detectors as they were built with this seed; bounds are of the detectors on paper.
    pub as_built: Option<u64>,
    /// Single presses at unknown places that each detector as built is calibrated with before; none leaves it as described.
    pub rub: usize,
}

/// What came out.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Where it ran.
    pub machine: Machine,
    /// How to run it again.
    pub command: String,
    /// Name of the solver.
    pub solver: String,
    /// Names of the detectors.
    pub detectors: Vec<String>,
    /// How many scenes.
    pub scenes: usize,
    /// Frames of each; the last answer is judged.
    pub frames: usize,
    /// Threads that tried them.
    pub threads: usize,
    /// Seed.
    pub seed: u64,
    /// The seed of the detectors as they were built, if readings are of such.
    pub as_built: Option<u64>,
    /// Presses that these were calibrated with.
    pub rub: usize,
    /// A row for each class of scenes or contacts.
    pub rows: Vec<Row>,
    /// How often what the answers claim is right.
    pub claims: Vec<Claims>,
    /// The worst scenes, the worst first.
    pub worst: Vec<Trial>,
}

/// A scene and what was found of it.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Trial {
    /// Number of the scene.
    pub scene: usize,
    /// Name of the detector.
    pub detector: String,
    /// The last answer against the truth.
    #[serde(flatten)]
    pub judged: Judged,
    /// Time of the first frame (us).
    pub cold_us: f64,
    /// Times of the next frames (us).
    pub next_us: Vec<f64>,
}

/// Three detectors that the slab models, of different sizes, foams and numbers of electrodes: `square-60`, 16 electrodes on foam A; the same
/// with foam B at the bottom and a tenth of its conductivity at the top; and `display-140x70`, 32 electrodes on a thinner layer.
pub fn detectors() -> Vec<Detector> {
    let square = Detector::default();
    let bottom_s_per_m = FOAMS[1].conductivity_s_per_m;
    let layer = Layer { bottom_s_per_m, top_s_per_m: bottom_s_per_m / GRADING, ..square.layers[0] };
    let graded = Detector { name: format!("{} graded", square.name), layers: vec![layer], ..square.clone() };
    [Some(square), Some(graded), Detector::preset("display-140x70")].into_iter().flatten().collect()
}

/// Tries a solver on all scenes. `progress` is called with what is done next.
///
/// # Errors
/// [`StudyError`] if a detector cannot be modelled or is curved, or the solver refuses its readings.
pub fn run(plan: &Plan, command: &str, progress: &mut dyn FnMut(&str)) -> Result<Report, StudyError> {
    let mut experiments = Vec::with_capacity(plan.detectors.len());
    for detector in &plan.detectors {
        progress(&format!("{}: model", detector.name));
        let experiment = Experiment::of(detector, plan.as_built)?;
        experiments.push(match plan.rub {
            0 => experiment,
            presses => {
                let Calibrated { detector, refused } = Calibrate::Rub(presses).find(&experiment, plan.seed)?;
                refused.iter().for_each(|why| progress(&with_causes(why)));
                experiment.known_as(&detector)?
            }
        });
    }
    progress(&format!("{} scenes", plan.scenes));
    let trials = try_all(plan, &experiments, &scenes::random(&plan.detectors, plan.scenes, plan.seed))?;
    Ok(Report {
        machine: Machine::this(),
        command: command.to_owned(),
        solver: plan.method.name().to_owned(),
        detectors: plan.detectors.iter().map(|detector| detector.name.clone()).collect(),
        scenes: plan.scenes,
        frames: plan.frames,
        threads: plan.threads,
        seed: plan.seed,
        as_built: plan.as_built,
        rub: plan.rub,
        rows: rows::rows(&trials),
        claims: rows::claims(&trials),
        worst: worst(trials, plan.worst),
    })
}

/// Trials of all scenes, in their order.
fn try_all(plan: &Plan, experiments: &[Experiment], scenes: &[RandomScene]) -> Result<Vec<Trial>, StudyError> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut solvers: Vec<Box<dyn Solver>> =
            experiments.iter().map(|experiment| plan.method.build(&experiment.problem)).collect::<Result<_, _>>()?;
        let mut trials = Vec::new();
        while let Some(scene) = scenes.get(next.fetch_add(1, Ordering::Relaxed)) {
            let solver = &mut *solvers[scene.detector];
            trials.push(try_scene(&experiments[scene.detector], scene, solver, plan.frames)?);
        }
        Ok(trials)
    };
    let parts: Vec<Result<Vec<Trial>, StudyError>> = thread::scope(|scope| {
        let threads: Vec<_> = (0..plan.threads.max(1)).map(|_| scope.spawn(work)).collect();
        threads.into_iter().map(|thread| thread.join().unwrap_or_else(|panic| resume_unwind(panic))).collect()
    });
    let mut trials: Vec<Trial> = parts.into_iter().collect::<Result<Vec<_>, _>>()?.concat();
    trials.sort_by_key(|trial| trial.scene);
    Ok(trials)
}

/// Lets a solver that knows nothing of the scene read its frames.
fn try_scene(
    experiment: &Experiment,
    scene: &RandomScene,
    solver: &mut dyn Solver,
    frames: usize,
) -> Result<Trial, StudyError> {
    let touches: Vec<Touch> = scene.contacts.iter().copied().map(Touch::from).collect();
    let read = experiment.frames(&vec![touches; frames.max(MIN_FRAMES)], scene.noise_seed)?;
    let mut times_us = Vec::with_capacity(read.len());
    let mut solutions = Vec::with_capacity(read.len());
    solver.reset();
    for frame in &read {
        let (solution, time) = timed(|| solver.solve(&frame.readings));
        times_us.push(1e6 * time.as_secs_f64());
        solutions.push(solution.map_err(|error| refused(solver, error))?);
    }
    let detector = &experiment.detector;
    let errors = Errors::of_noise(detector, detector.adc.deviation_v());
    let bounds = cramer_rao(&*experiment.problem.model, &scene.contacts, &errors)?;
    let solution = &solutions[frames.max(1) - 1];
    Ok(Trial {
        scene: scene.index,
        detector: detector.name.clone(),
        judged: Judged::new(detector, &scene.contacts, bounds.as_deref(), solution),
        cold_us: times_us.remove(0),
        next_us: times_us.split_off(1),
    })
}

fn refused(solver: &dyn Solver, error: SolveError) -> StudyError {
    StudyError::Solve { solver: solver.name().to_owned(), error }
}

/// The worst trials: first those with most contacts missed and invented, then those furthest from the bound.
fn worst(mut trials: Vec<Trial>, count: usize) -> Vec<Trial> {
    trials.sort_by(|a, b| {
        let by_count = b.judged.faults().cmp(&a.judged.faults());
        by_count.then_with(|| b.judged.largest_over_bound().total_cmp(&a.judged.largest_over_bound()))
    });
    trials.truncate(count);
    trials
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(threads: usize) -> Plan {
        Plan {
            detectors: vec![Detector::default()],
            method: Method::Contacts,
            scenes: 5,
            frames: 1,
            threads,
            worst: 2,
            seed: 3,
            as_built: None,
            rub: 0,
        }
    }

    fn judged(report: &Report) -> Vec<Judged> {
        report.worst.iter().map(|trial| trial.judged.clone()).collect()
    }

    #[test]
    fn single_contacts_are_found_and_what_is_worst_is_kept() {
        let report = run(&plan(1), "tactomo-lab study contacts", &mut |_| ()).unwrap();
        let all = report.rows.iter().find(|row| row.class == "all").unwrap();
        assert_eq!(all.scenes.as_ref().map(|figures| figures.scenes), Some(5));
        assert!(all.contacts.visible > 0 && all.contacts.error_m.is_some());
        assert_eq!(report.worst.len(), 2);
        assert!(report.worst.iter().all(|trial| trial.cold_us > 0.0 && trial.next_us.len() == 1));
        let text = crate::view::text(&[view(&report)]);
        assert!(report.rows.iter().all(|row| text.contains(row.class)) && !text.contains("NaN"), "{text}");
    }

    #[test]
    fn answers_do_not_depend_on_threads_but_on_the_seed() {
        let run = |plan: &Plan| judged(&run(plan, "", &mut |_| ()).unwrap());
        let one = run(&plan(1));
        assert_eq!(one, run(&plan(3)));
        assert_ne!(one, run(&Plan { seed: 4, ..plan(1) }));
        assert_ne!(one, run(&Plan { as_built: Some(4), ..plan(1) }));
    }

    #[test]
    fn the_detectors_are_three_that_the_slab_models() {
        let models: Vec<_> =
            detectors().iter().map(|detector| Experiment::new(detector).map(|experiment| experiment.model)).collect();
        assert_eq!(models, vec![Ok("slab".to_owned()); 3]);
    }
}
