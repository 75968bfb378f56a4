//! Speed against accuracy: every solver, over scenes that span the use.
//!
//! Times are processor times of one thread with nothing else of this program running. Memory is what is allocated beyond what was before, as a
//! [`Heap`] counts it.

mod page;
mod table;

use std::time::{Duration, Instant};

use super::experiment::{Experiment, Frame, StudyError};
use super::machine::Machine;
use super::scenes::{Group, SceneKind};
use super::score::{Score, Scorer, Summary};
use super::variant::Variation;
use tactomo_physics::detector::Detector;
use tactomo_touch::solve::{Family, Method};

pub use self::page::{page, picture};
pub use self::table::table;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Detectors.
    pub detectors: Vec<Detector>,
    /// Solvers.
    pub methods: Vec<Method>,
    /// Whether main parameters are swept.
    pub sweep: bool,
    /// Places of each kind of scene.
    pub places: usize,
    /// Frames at each place, with new noise each.
    pub frames: usize,
    /// Where places and noise start.
    pub seed: u64,
    /// How memory is counted, if it is.
    pub heap: Option<Heap>,
}

/// An allocator that can count.
#[derive(Clone, Copy, Debug)]
pub struct Heap {
    /// Begins to count, from zero.
    pub start: fn(),
    /// What is allocated since the start, and the most that was; ends counting.
    pub stop: fn() -> Memory,
}

/// What came out.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Where it ran.
    pub machine: Machine,
    /// How to run it again.
    pub command: String,
    /// Seed.
    pub seed: u64,
    /// Places of each kind of scene.
    pub places: usize,
    /// Frames at each place.
    pub frames: usize,
    /// One for each detector.
    pub detectors: Vec<DetectorReport>,
}

/// What came out on one detector.
#[derive(Clone, Debug, serde::Serialize)]
pub struct DetectorReport {
    /// Its name.
    pub detector: String,
    /// Width and height (m).
    pub size_m: [f64; 2],
    /// Model that was inverted.
    pub model: String,
    /// Time to make that model and its Jacobian (ms).
    pub model_ms: f64,
    /// What a contact missed or invented counts (m).
    pub reach_m: f64,
    /// Solvers that cannot be made for this model, and why.
    pub unavailable: Vec<String>,
    /// One for each solver and parameter.
    pub solvers: Vec<SolverReport>,
}

/// What came out for one solver.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SolverReport {
    /// Its name.
    pub solver: String,
    /// What it is made of.
    pub family: Family,
    /// Its main parameter, where that is not the default.
    pub parameter: Option<String>,
    /// Time to make it (ms).
    pub set_up_ms: f64,
    /// Memory, if it was counted.
    pub memory: Option<Memory>,
    /// Over all scenes.
    pub all: Summary,
    /// Over the scenes of each group.
    pub groups: Vec<GroupReport>,
    /// Over each kind of scene.
    pub scenes: Vec<SceneReport>,
}

/// What a solver allocates beyond the model (bytes).
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Memory {
    /// Kept after all frames.
    pub kept_bytes: usize,
    /// At most, while it was made or solved.
    pub peak_bytes: usize,
}

/// A group's means.
#[derive(Clone, Debug, serde::Serialize)]
pub struct GroupReport {
    /// The group.
    pub group: Group,
    /// Its means.
    pub summary: Summary,
}

/// A kind's means.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SceneReport {
    /// The kind.
    pub scene: SceneKind,
    /// Its means.
    pub summary: Summary,
}

impl SolverReport {
    /// Means of a group.
    pub fn group(&self, group: Group) -> Option<&Summary> {
        Some(&self.groups.iter().find(|report| report.group == group)?.summary)
    }

    /// Means of a kind.
    pub fn scene(&self, kind: SceneKind) -> Option<&Summary> {
        Some(&self.scenes.iter().find(|report| report.scene == kind)?.summary)
    }
}

/// Tries all solvers on all detectors. `progress` is called with what is tried next.
///
/// # Errors
/// [`StudyError`] if a detector cannot be modelled or is curved.
pub fn run(plan: &Plan, command: &str, progress: &mut dyn FnMut(&str)) -> Result<Report, StudyError> {
    let detectors =
        plan.detectors.iter().map(|detector| on_detector(plan, detector, progress)).collect::<Result<_, _>>()?;
    Ok(Report {
        machine: Machine::this(),
        command: command.to_owned(),
        seed: plan.seed,
        places: plan.places,
        frames: plan.frames,
        detectors,
    })
}

fn on_detector(plan: &Plan, detector: &Detector, progress: &mut dyn FnMut(&str)) -> Result<DetectorReport, StudyError> {
    progress(&format!("{}: data", detector.name));
    let experiment = Experiment::new(detector)?;
    let scenes = scenes(plan, &experiment)?;
    let sweep = |method: &Method| match plan.sweep {
        true => Variation::sweep(*method),
        false => vec![Variation::default_of(*method)],
    };
    let mut scorer = Scorer::new(&experiment);
    let (mut solvers, mut unavailable) = (Vec::new(), Vec::new());
    for variation in plan.methods.iter().flat_map(sweep) {
        progress(&format!("{}: {}", detector.name, variation.label()));
        match try_variation(plan, &experiment, &scenes, &mut scorer, variation) {
            Ok(report) => solvers.push(report),
            Err(error) => unavailable.push(format!("{}: {error}", variation.label())),
        }
    }
    Ok(DetectorReport {
        detector: detector.name.clone(),
        size_m: detector.outline.size_m(),
        model: experiment.model.clone(),
        model_ms: milliseconds(experiment.model_time),
        reach_m: experiment.reach_m(),
        unavailable,
        solvers,
    })
}

/// Frames of a place.
struct Place {
    kind: SceneKind,
    frames: Vec<Frame>,
}

fn scenes(plan: &Plan, experiment: &Experiment) -> Result<Vec<Place>, StudyError> {
    let places = (0..plan.places as u64).flat_map(|place| SceneKind::ALL.map(|kind| (place, kind)));
    places
        .map(|(place, kind)| {
            let seed = plan.seed.wrapping_mul(1_000_003).wrapping_add(place * 101 + kind as u64);
            let touches = kind.frames(&experiment.detector, seed, plan.frames);
            Ok(Place { kind, frames: experiment.frames(&touches, seed)? })
        })
        .collect()
}

fn try_variation(
    plan: &Plan,
    experiment: &Experiment,
    scenes: &[Place],
    scorer: &mut Scorer,
    variation: Variation,
) -> Result<SolverReport, StudyError> {
    let start = Instant::now();
    let mut solver = variation.build(&experiment.problem)?;
    let set_up = start.elapsed();
    let mut scores: Vec<(SceneKind, Vec<Score>)> = Vec::with_capacity(scenes.len());
    for place in scenes {
        scores.push((place.kind, scorer.run(&mut *solver, &place.frames)?));
    }
    drop(solver);
    let memory = plan.heap.map(|heap| memory(heap, experiment, scenes, variation)).transpose()?;
    let over = |is: &dyn Fn(SceneKind) -> bool| {
        Summary::of(scores.iter().filter(|(kind, _)| is(*kind)).flat_map(|(_, scores)| scores))
    };
    Ok(SolverReport {
        solver: variation.method.name().to_owned(),
        family: variation.method.family(),
        parameter: variation.parameter.map(|parameter| parameter.to_string()),
        set_up_ms: milliseconds(set_up),
        memory,
        all: over(&|_| true),
        groups: Group::ALL
            .into_iter()
            .map(|group| GroupReport { group, summary: over(&|kind| kind.group() == group) })
            .collect(),
        scenes: SceneKind::ALL
            .into_iter()
            .map(|scene| SceneReport { scene, summary: over(&|kind| kind == scene) })
            .collect(),
    })
}

/// Makes the solver again and lets it solve the first place of each kind, with nothing else allocated meanwhile.
fn memory(heap: Heap, experiment: &Experiment, scenes: &[Place], variation: Variation) -> Result<Memory, StudyError> {
    (heap.start)();
    let built = variation.build(&experiment.problem).map(|mut solver| {
        for frame in scenes.iter().take(SceneKind::ALL.len()).flat_map(|place| &place.frames) {
            // Readings that it refuses need no memory.
            drop(solver.solve(&frame.readings));
        }
        solver
    });
    // The solver is still there, so what it keeps is counted.
    let memory = (heap.stop)();
    built?;
    Ok(memory)
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report() -> Report {
        let plan = Plan {
            detectors: vec![Detector::preset(Detector::DEFAULT).unwrap()],
            methods: vec![Method::Tikhonov, Method::TikhonovPaper],
            sweep: true,
            places: 1,
            frames: 2,
            seed: 3,
            heap: None,
        };
        run(&plan, "tactomo <tradeoff>", &mut |_| {}).unwrap()
    }

    #[test]
    fn every_scene_is_judged_by_what_it_is() {
        let report = report();
        let solver = &report.detectors[0].solvers[0];
        assert_eq!((solver.solver.as_str(), solver.all.frames), ("tikhonov", 2 * SceneKind::ALL.len()));
        for kind in SceneKind::ALL {
            let summary = solver.scene(kind).unwrap();
            assert_eq!(summary.correlation.is_some(), kind != SceneKind::None, "{kind:?}");
            assert_eq!(summary.error_m.is_some(), !matches!(kind, SceneKind::Ring | SceneKind::Line), "{kind:?}");
            let one_image = matches!(kind.group(), Group::One) || kind == SceneKind::Wide;
            assert_eq!(summary.ringing.is_some(), one_image, "{kind:?}");
            assert_eq!((summary.failed, summary.not_finite), (0.0, 0.0), "{kind:?}");
        }
        let light = solver.scene(SceneKind::Light).unwrap();
        assert!(light.error_m.is_some_and(|error_m| error_m > 0.0 && error_m < 0.015), "{light:?}");
        let again = super::tests::report();
        let figures = |report: &Report| report.detectors[0].solvers[1].scene(SceneKind::Firm).unwrap().error_m;
        assert_eq!(figures(&report), figures(&again), "a seed repeats everything but time");
    }

    #[test]
    fn page_and_table_show_every_solver_and_how_to_run_it_again() {
        let report = report();
        let (page, table) = (page(&report), table(&report));
        for solver in ["tikhonov", "tikhonov-paper", "tikhonov lambda 0.1"] {
            assert!(page.contains(solver) && table.contains(solver), "{solver}");
        }
        assert!(page.contains("tactomo &lt;tradeoff&gt;") && page.contains(&report.machine.version));
        assert!(!page.contains("NaN") && picture(&report).contains("<svg"));
    }
}
