//! Speed against accuracy: every solver, over scenes that span the use.
//!
//! Times are processor times of one thread with nothing else of this program running. Memory is what is allocated beyond what was before, as a
//! [`Heap`] counts it.

mod report;
mod trial;
mod view;

use std::time::Duration;

use super::calibrate::Calibrate;
use super::experiment::{Experiment, StudyError};
use super::machine::Machine;
use super::progress::Progress;
use super::scenes::{Group, SceneKind};
use super::variant::Variation;
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;
use tactomo_touch::solve::Method;

use self::trial::{Trial, floors, try_variation};

pub use self::report::{
    AsBuiltReport, Course, DetectorReport, Floor, GroupReport, Known, Memory, Report, SceneReport, SolverReport,
};
pub use self::view::view;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Detectors.
    pub detectors: Vec<Detector>,
    /// Solvers.
    pub methods: Vec<Method>,
    /// Places of each kind of scene at which other values of main parameters are tried; none where they are not swept.
    pub swept: usize,
    /// Places of each kind of scene.
    pub places: usize,
    /// Frames at each place, with new noise each.
    pub frames: usize,
    /// Where places and noise start.
    pub seed: u64,
    /// How memory is counted, if it is.
    pub heap: Option<Heap>,
    /// If given, all is simulated on detectors as they were built with this seed.
    pub as_built: Option<u64>,
    /// Else solvers are tried once more, with their defaults, on so many detectors drawn from the tolerances.
    pub drawn: usize,
    /// A place of each of these kinds of scenes is on each of those.
    pub drawn_scenes: Vec<SceneKind>,
    /// If given, and on those once more after a calibration.
    pub calibrate: Option<Calibrate>,
}

/// An allocator that can count.
#[derive(Clone, Copy, Debug)]
pub struct Heap {
    /// Begins to count, from zero.
    pub start: fn(),
    /// What is allocated since the start, and the most that was; ends counting.
    pub stop: fn() -> Memory,
}

/// Tries all solvers on all detectors, until that is done or it is stopped: then what is missing is in the report.
///
/// # Errors
/// [`StudyError`] if a detector cannot be modelled or is curved.
pub fn run(plan: &Plan, command: &str, progress: Progress) -> Result<Report, StudyError> {
    let progress = progress.part(0, plan.work());
    let mut run = Run { progress, swept: plan.swept, done: 0, missing: Vec::new() };
    let mut detectors = Vec::new();
    for detector in &plan.detectors {
        match run.goes_on(&detector.name) {
            true => detectors.push(on_detector(plan, detector, &mut run)?),
            false => run.missing.push(detector.name.clone()),
        }
    }
    Ok(Report {
        machine: Machine::this(),
        command: command.to_owned(),
        seed: plan.seed,
        as_built: plan.as_built,
        places: plan.places,
        frames: plan.frames,
        detectors,
        missing: run.missing,
    })
}

impl Plan {
    /// Solvers with their defaults and, where that is asked for, with other values of their main parameters.
    fn variations(&self) -> Vec<Variation> {
        let sweep = |method: &Method| match self.swept {
            0 => vec![Variation::default_of(*method)],
            _ => Variation::sweep(*method),
        };
        self.methods.iter().flat_map(sweep).collect()
    }

    /// What solvers know of detectors that are drawn from tolerances, one after the other.
    fn known(&self) -> Vec<(Known, Option<Calibrate>)> {
        let is_drawn = self.as_built.is_none() && self.drawn > 0;
        let described = is_drawn.then_some((Known::Described, None));
        let calibrated = self.calibrate.filter(|_| is_drawn).map(|calibrate| (Known::Calibrated, Some(calibrate)));
        described.into_iter().chain(calibrated).collect()
    }

    /// How many solvers are tried.
    fn work(&self) -> usize {
        self.detectors.len() * (self.variations().len() + self.known().len() * self.methods.len())
    }
}

/// How far the study is.
struct Run<'a> {
    progress: Progress<'a>,
    /// Places at which values of parameters are tried that are not the defaults.
    swept: usize,
    done: usize,
    missing: Vec<String>,
}

impl Run<'_> {
    /// Tells what is tried next, unless it was stopped.
    fn goes_on(&self, next: &str) -> bool {
        self.progress.tell(next, self.done);
        !self.progress.is_stopped()
    }

    /// What a solver reaches, as long as it was not stopped; `None` if it cannot be made for the model, which is added to `unavailable`.
    fn tried(
        &mut self,
        whose: &str,
        heap: Option<Heap>,
        trials: &mut [Trial],
        variation: Variation,
        unavailable: &mut Vec<String>,
    ) -> Option<SolverReport> {
        let name = format!("{whose}: {}", variation.label());
        let goes_on = self.goes_on(&name);
        self.done += 1;
        if !goes_on {
            self.missing.push(name);
            return None;
        }
        let tried = try_variation(heap, trials, variation, self.swept);
        tried.map_err(|error| unavailable.push(format!("{}: {}", variation.label(), with_causes(&error)))).ok()
    }
}

fn on_detector(plan: &Plan, detector: &Detector, run: &mut Run) -> Result<DetectorReport, StudyError> {
    let described = Experiment::new(detector)?;
    let experiment = match plan.as_built {
        Some(seed) => described.as_built(seed)?,
        None => described,
    };
    let mut trials = [Trial::new(plan, experiment, 0..plan.places as u64, &SceneKind::ALL)?];
    let floors = floors(&trials)?;
    let (mut solvers, mut unavailable) = (Vec::new(), Vec::new());
    for variation in plan.variations() {
        // With another value of its parameter a solver needs about the same memory.
        let heap = plan.heap.filter(|_| variation.parameter.is_none());
        solvers.extend(run.tried(&detector.name, heap, &mut trials, variation, &mut unavailable));
    }
    let [Trial { experiment, .. }] = trials;
    Ok(DetectorReport {
        detector: detector.name.clone(),
        size_m: detector.outline.size_m(),
        model: experiment.model.clone(),
        model_ms: milliseconds(experiment.model_time),
        reach_m: experiment.reach_m(),
        unavailable,
        floors,
        solvers,
        as_built: as_built(plan, &experiment, run)?,
    })
}

/// Solvers on detectors drawn from the tolerances of a sound one: knowing the description, and calibrated if there is a way.
fn as_built(plan: &Plan, sound: &Experiment, run: &mut Run) -> Result<Vec<AsBuiltReport>, StudyError> {
    let name = &sound.detector.name;
    if sound.detector.tolerances.is_exact() {
        return Ok(Vec::new());
    }
    let seeds = || (0..plan.drawn as u64).map(|index| (index, plan.seed.wrapping_add(index)));
    let mut reports = Vec::new();
    for (known, calibrate) in plan.known() {
        let whose = format!("{name}: {} detectors as built, {}", plan.drawn, known.name());
        if !run.goes_on(&whose) {
            run.missing.push(whose);
            continue;
        }
        // What solvers make of the tolerances is made once.
        let tolerant = sound.tolerant();
        let mut refused = 0;
        let trial = |(index, seed)| {
            let built = tolerant.as_built(seed)?;
            let known = match calibrate {
                Some(calibrate) => {
                    let found = calibrate.find(&built, seed)?;
                    refused += usize::from(found.refused.is_some());
                    found.refused.iter().for_each(|why| tracing::warn!("{name}: {}", with_causes(why)));
                    built.known_as(&found.detector)?
                }
                None => built,
            };
            Trial::new(plan, known, index..index + 1, &plan.drawn_scenes)
        };
        let mut trials = seeds().map(trial).collect::<Result<Vec<_>, StudyError>>()?;
        let floors = floors(&trials)?;
        // What cannot be made for the model was told before.
        let untold = &mut Vec::new();
        let variations = plan.methods.iter().map(|method| Variation::default_of(*method));
        let solvers =
            variations.filter_map(|variation| run.tried(&whose, None, &mut trials, variation, untold)).collect();
        let calibration = calibrate.map(Calibrate::name);
        let (detectors, scenes) = (plan.drawn, plan.drawn_scenes.clone());
        reports.push(AsBuiltReport { known, calibration, refused, detectors, scenes, floors, solvers });
    }
    Ok(reports)
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;
    use crate::view::text;

    fn report() -> Report {
        let plan = Plan {
            detectors: vec![Detector::preset(Detector::DEFAULT).unwrap()],
            methods: vec![Method::Tikhonov, Method::TikhonovPaper],
            swept: 1,
            places: 1,
            frames: 2,
            seed: 3,
            heap: None,
            as_built: None,
            drawn: 2,
            drawn_scenes: SceneKind::ALL.into(),
            calibrate: Some(Calibrate::Perfect),
        };
        run(&plan, "tactomo <tradeoff>", Progress::new(&AtomicBool::new(false), &|_| {})).unwrap()
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
    fn detectors_as_built_are_tried_with_what_solvers_know_of_them() {
        // The converter cuts off offsets below zero, which no calibration brings back.
        let mut detector = Detector::default();
        detector.tolerances.offset_lsb = 0.0;
        let plan = |as_built| Plan {
            detectors: vec![detector.clone()],
            // Trained on readings of the detector that it knows, and knows no tolerances.
            methods: vec![Method::Kernel],
            swept: 0,
            places: 1,
            frames: 1,
            seed: 3,
            heap: None,
            as_built,
            drawn: 2,
            drawn_scenes: SceneKind::ALL.into(),
            calibrate: Some(Calibrate::Perfect),
        };
        let run = |as_built| {
            run(&plan(as_built), "", Progress::new(&AtomicBool::new(false), &|_| {})).unwrap().detectors.remove(0)
        };
        let one_m = |solvers: &[SolverReport]| solvers[0].group(Group::One).unwrap().error_m.unwrap();
        let paper = run(None);
        let [described, calibrated] = &paper.as_built[..] else { panic!("{:?}", paper.as_built) };
        assert_eq!((described.known, calibrated.known), (Known::Described, Known::Calibrated));
        assert_eq!(described.solvers[0].all.frames, 2 * SceneKind::ALL.len());
        let errors_m = [&paper.solvers, &described.solvers, &calibrated.solvers].map(|solvers| one_m(solvers));
        assert!(errors_m[1] > 3.0 * errors_m[0] && errors_m[1] > 3.0 * errors_m[2], "{errors_m:?}");
        let bench = run(Some(3));
        assert!(bench.as_built.is_empty() && one_m(&bench.solvers) > 1.5 * errors_m[0]);
    }

    #[test]
    fn page_and_text_show_every_solver_and_how_to_run_it_again() {
        let report = report();
        let views = [view(&report)];
        let (page, text) = (crate::view::page(&views, &report.command), text(&views));
        assert!(page.contains("2 detectors as built") && page.contains("calibrated without an error"));
        assert_eq!(text.matches("- 2 detectors as built, ").count(), 2, "{text}");
        assert!(page.contains(": by their description: tikhonov: of") && page.contains(": calibrated: tikhonov: of"));
        for solver in ["tikhonov", "tikhonov-paper", "tikhonov lambda 0.1"] {
            assert!(page.contains(solver) && text.contains(solver), "{solver}");
        }
        assert!(page.contains("tactomo &lt;tradeoff&gt;") && page.contains(&report.machine.version));
        assert!(!page.contains("NaN") && crate::view::picture(&views[0]).contains("<svg"));
    }
}
