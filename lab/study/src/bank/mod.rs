//! How right, how sure and how fast solvers are: one grid of scenes, detectors as they are known, and solvers, each scene from a cold start.

mod cases;
mod judge;
mod patches;
mod places;
mod rows;
mod scenes;
mod view;

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use self::scenes::TriedScene;
use super::bound::{Errors, cramer_rao};
use super::experiment::{Experiment, StudyError};
use super::machine::Machine;
use super::stopwatch::timed;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::{Contact, Touch};
use tactomo_touch::solve::{Method, Solution, Solver};

pub use self::cases::{Case, Touching, detectors};
pub use self::judge::{Judged, Match, Place, TrueContact};
pub use self::patches::{Grip, OnPatches};
pub use self::rows::{Claims, ContactFigures, Quantiles, Row, SceneFigures};
pub use self::scenes::Scenes;
pub use self::view::view;

/// Frames a scene has at least: the first is a cold start, and the time to follow is that of the third and those after it, as a solver that
/// averages still frames searches their mean again when it has twice as many of them.
const MIN_FRAMES: usize = 3;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Scenes on detectors.
    pub cases: Vec<Case>,
    /// The solvers.
    pub methods: Vec<Method>,
    /// How many scenes of each case.
    pub scenes: usize,
    /// Frames of each scene, with new noise each; the answer to the last one is judged.
    pub frames: usize,
    /// Threads that try scenes; times are right with one only.
    pub threads: usize,
    /// How many of the worst scenes are kept.
    pub worst: usize,
    /// Where scenes and noise start.
    pub seed: u64,
}

/// What came out.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Where it ran.
    pub machine: Machine,
    /// How to run it again.
    pub command: String,
    /// Names of the solvers.
    pub solvers: Vec<String>,
    /// The cases.
    pub cases: Vec<Case>,
    /// How many scenes each has.
    pub scenes: usize,
    /// Frames of each; the last answer is judged.
    pub frames: usize,
    /// Threads that tried them.
    pub threads: usize,
    /// Seed.
    pub seed: u64,
    /// A row for each case, solver, and class of scenes or contacts.
    pub rows: Vec<Row>,
    /// How often what the answers claim is right.
    pub claims: Vec<Claims>,
    /// The worst scenes, the worst first.
    pub worst: Vec<Trial>,
}

/// A scene and what was found of it.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Trial {
    /// Name of the case.
    pub case: String,
    /// Name of the solver.
    pub solver: String,
    /// Number of the scene.
    pub scene: usize,
    /// Of which kind it is, where a case has several.
    pub kind: Option<&'static str>,
    /// Name of the detector.
    pub detector: String,
    /// The last answer against the truth.
    #[serde(flatten)]
    pub judged: Judged,
    /// By how much of the logarithm of the evidence what touches explains the readings better than an answer that is wrong (nats), by the solver's own evidence; none of
    /// one that is right, or if the solver has no evidence for what it has not searched.
    pub behind_nats: Option<f64>,
    /// Time of the first frame (us).
    pub cold_us: f64,
    /// Times of the next frames (us).
    pub next_us: Vec<f64>,
    /// Median time of `tikhonov` on the same frames, which it reads right after the solver (us).
    pub tikhonov_us: f64,
}

/// Tries solvers on all cases. `progress` is called with what is done next.
///
/// # Errors
/// [`StudyError`] if a detector cannot be drawn or modelled or is curved, or a solver refuses its readings.
pub fn run(plan: &Plan, command: &str, progress: &mut dyn FnMut(&str)) -> Result<Report, StudyError> {
    let (mut rows, mut claims, mut trials) = (Vec::new(), Vec::new(), Vec::new());
    for case in &plan.cases {
        progress(&format!("{}: models", case.name));
        let experiments = case.experiments(plan.seed, progress)?;
        let scenes = case.tried(plan.scenes, plan.seed)?;
        progress(&format!("{}: {} scenes", case.name, scenes.len()));
        let all = try_all(plan, case, &experiments, &scenes)?;
        for method in &plan.methods {
            let of: Vec<&Trial> = all.iter().filter(|trial| trial.solver == method.name()).collect();
            rows.extend(rows::rows(case, method.name(), &of));
            claims.extend(rows::claims(case, method.name(), &of));
        }
        trials.extend(all);
    }
    Ok(Report {
        machine: Machine::this(),
        command: command.to_owned(),
        solvers: plan.methods.iter().map(|method| method.name().to_owned()).collect(),
        cases: plan.cases.clone(),
        scenes: plan.scenes,
        frames: plan.frames,
        threads: plan.threads,
        seed: plan.seed,
        rows,
        claims,
        worst: worst(trials, plan.worst),
    })
}

/// Trials of all scenes, in their order.
fn try_all(
    plan: &Plan,
    case: &Case,
    experiments: &[Experiment],
    scenes: &[TriedScene],
) -> Result<Vec<Trial>, StudyError> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut tried = experiments.iter().map(|one| Tried::new(plan, case, one)).collect::<Result<Vec<_>, _>>()?;
        let mut trials = Vec::new();
        while let Some(scene) = scenes.get(next.fetch_add(1, Ordering::Relaxed)) {
            trials.extend(tried[scene.detector].scene(scene)?);
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

/// A detector, and the solvers that are tried on it side by side.
struct Tried<'a> {
    case: &'a Case,
    experiment: &'a Experiment,
    frames: usize,
    solvers: Vec<Box<dyn Solver>>,
    /// What times are given in.
    tikhonov: Box<dyn Solver>,
}

impl<'a> Tried<'a> {
    fn new(plan: &Plan, case: &'a Case, experiment: &'a Experiment) -> Result<Self, StudyError> {
        let build = |method: &Method| method.build(&experiment.problem);
        let solvers = plan.methods.iter().map(build).collect::<Result<_, _>>()?;
        Ok(Self { case, experiment, frames: plan.frames.max(1), solvers, tikhonov: build(&Method::Tikhonov)? })
    }

    /// Lets solvers that know nothing of the scene read its frames, each all of them.
    fn scene(&mut self, scene: &TriedScene) -> Result<Vec<Trial>, StudyError> {
        let Experiment { detector, problem, .. } = self.experiment;
        let read =
            self.experiment.frames(&vec![scene.touches.clone(); self.frames.max(MIN_FRAMES)], scene.noise_seed)?;
        let readings: Vec<Readings> = read.into_iter().map(|frame| frame.readings).collect();
        let discs: Option<Vec<Contact>> = scene.touches.iter().map(Touch::disc).collect();
        let errors = Errors::of_noise(detector, detector.adc.deviation_v());
        let bounds = discs.map(|discs| cramer_rao(&*problem.model, &discs, &errors)).transpose()?.flatten();
        let mut trials = Vec::with_capacity(self.solvers.len());
        for solver in &mut self.solvers {
            let (solutions, mut times_us) = answered(&mut **solver, &readings)?;
            let judged = Judged::new(detector, &scene.touches, bounds.as_deref(), &solutions[self.frames - 1]);
            let behind_nats = behind_nats(&mut **solver, &readings[..self.frames], &judged)?;
            let (_, mut tikhonov_us) = answered(&mut *self.tikhonov, &readings)?;
            tikhonov_us.sort_by(f64::total_cmp);
            trials.push(Trial {
                case: self.case.name.clone(),
                solver: solver.name().to_owned(),
                scene: scene.index,
                kind: scene.kind,
                detector: detector.name.clone(),
                judged,
                behind_nats,
                cold_us: times_us.remove(0),
                next_us: times_us.split_off(1),
                tikhonov_us: tikhonov_us[tikhonov_us.len() / 2],
            });
        }
        Ok(trials)
    }
}

/// By how much of the logarithm of the evidence what touches, or what is visible of it, explains the last of some frames better than a solver's answer to it, if that is wrong.
fn behind_nats(solver: &mut dyn Solver, frames: &[Readings], judged: &Judged) -> Result<Option<f64>, StudyError> {
    if !judged.is_kind_right || judged.faults() == 0 {
        return Ok(None);
    }
    let name = solver.name();
    let truth = judged.truth.iter().map(|truth| truth.contact).collect();
    let visible = judged.visible().map(|truth| truth.contact).collect();
    answered(solver, frames)?;
    let Some(readings) = frames.last() else { return Ok(None) };
    let nats = solver.explained_better(readings, &[truth, visible]);
    nats.map_err(|error| StudyError::Solve { solver: name.to_owned(), error })
}

/// What a solver answers from a cold start, and how long each frame took (us).
fn answered(solver: &mut dyn Solver, readings: &[Readings]) -> Result<(Vec<Solution>, Vec<f64>), StudyError> {
    solver.reset();
    let (mut solutions, mut times_us) = (Vec::with_capacity(readings.len()), Vec::with_capacity(readings.len()));
    for readings in readings {
        let (solution, time) = timed(|| solver.solve(readings));
        solutions.push(solution.map_err(|error| StudyError::Solve { solver: solver.name().to_owned(), error })?);
        times_us.push(1e6 * time.as_secs_f64());
    }
    Ok((solutions, times_us))
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
    use crate::independent::tests::Contents;
    use tactomo_physics::detector::Detector;

    fn plan(threads: usize) -> Plan {
        let cases = vec![Case::of("exact", Scenes::Random, vec![Detector::default()])];
        Plan { cases, methods: vec![Method::Contacts], scenes: 5, frames: 1, threads, worst: 2, seed: 3 }
    }

    fn judged(report: &Report) -> Vec<Judged> {
        report.worst.iter().map(|trial| trial.judged.clone()).collect()
    }

    #[test]
    fn single_contacts_are_found_and_what_is_worst_is_kept() {
        let report = run(&plan(1), "tactomo-lab bank", &mut |_| ()).unwrap();
        let all = report.rows.iter().find(|row| row.class == "all").unwrap();
        assert_eq!(all.scenes.as_ref().map(|figures| figures.scenes), Some(5));
        assert!(all.contacts.visible > 0 && all.contacts.error_m.is_some());
        assert_eq!(report.worst.len(), 2);
        assert!(report.worst.iter().all(|trial| trial.cold_us > 0.0 && trial.next_us.len() == 1));
        let text = crate::view::text(&[view(&report)]);
        assert!(report.rows.iter().all(|row| text.contains(row.class)) && !text.contains("NaN"), "{text}");
    }

    /// A part of the bank: every case has a figure for every solver that is tried, on the same readings.
    #[test]
    fn solvers_stand_side_by_side_in_every_case() {
        let parts = ["exact", "built, top over bottom", "built, near", "built, shapes"];
        let cases = Case::bank(1, 1).into_iter().filter(|case| parts.contains(&&*case.name)).collect();
        let methods = vec![Method::Core, Method::Tikhonov];
        let plan = Plan { cases, methods, scenes: 7, worst: 0, ..plan(2) };
        assert_eq!(plan.cases.len(), parts.len());
        let report = run(&plan, "", &mut |_| ()).unwrap();
        for case in &plan.cases {
            let all: Vec<_> = report.rows.iter().filter(|row| row.case == case.name && row.class == "all").collect();
            assert_eq!(all.iter().map(|row| &*row.solver).collect::<Vec<_>>(), ["core", "tikhonov"], "{}", case.name);
            assert!(
                all.iter().all(|row| row.scenes.as_ref().is_some_and(|figures| figures.scenes == 7)),
                "{}",
                case.name
            );
            assert_eq!(all[0].contacts.visible, all[1].contacts.visible, "{}", case.name);
        }
        let exact =
            report.rows.iter().find(|row| row.case == "exact" && row.solver == "core" && row.class == "1 contact");
        assert!(exact.and_then(|row| row.contacts.over_bound).is_some_and(|over| over.median < 3.0), "{exact:?}");
        let text = crate::view::text(&[view(&report)]);
        assert!(plan.cases.iter().all(|case| text.contains(&case.name)) && !text.contains("NaN"), "{text}");
    }

    /// A network of resistors, which is no more than alike to the detector: each case has its figures all the same.
    #[test]
    fn scenes_of_an_independent_solution_are_tried_as_others_are() {
        let solution = || Contents::of_network().read().unwrap();
        let cases = Case::independent(solution(), &Detector::default());
        let names: Vec<_> = cases.iter().map(|case| case.name.clone()).collect();
        assert_eq!(names, ["singles", "pairs", "triples", "hands"].map(|grip| format!("network, {grip}")));
        let plan = Plan { cases, methods: vec![Method::Tikhonov, Method::Core], scenes: 3, ..plan(1) };
        let report = run(&plan, "", &mut |_| ()).unwrap();
        let all: Vec<_> = report.rows.iter().filter(|row| row.class == "all").collect();
        assert_eq!(all.len(), 8);
        assert!(all.iter().all(|row| row.contacts.visible > 0 && row.scenes.is_some()));
        let json = serde_json::to_value(&report.cases[1].scenes).unwrap();
        assert_eq!(json, serde_json::json!({"independent": "network", "grip": "pair"}));
        let other = Detector::preset("display-140x70").unwrap();
        let refused = run(&Plan { cases: Case::independent(solution(), &other), ..plan }, "", &mut |_| ()).unwrap_err();
        assert_eq!(refused.to_string(), "network: it has 16 electrodes, but display-140x70 has 32");
    }

    #[test]
    fn answers_do_not_depend_on_threads_but_on_the_seed() {
        let run = |plan: &Plan| judged(&run(plan, "", &mut |_| ()).unwrap());
        let one = run(&plan(1));
        assert_eq!(one, run(&plan(3)));
        assert_ne!(one, run(&Plan { seed: 4, ..plan(1) }));
        let built = plan(1).cases.into_iter().map(|case| Case { built: vec![4], ..case }).collect();
        assert_ne!(one, run(&Plan { cases: built, ..plan(1) }));
    }

    #[test]
    fn the_detectors_are_three_that_the_slab_models() {
        let models: Vec<_> =
            detectors().iter().map(|detector| Experiment::new(detector).map(|experiment| experiment.model)).collect();
        assert_eq!(models, vec![Ok("slab".to_owned()); 3]);
    }
}
