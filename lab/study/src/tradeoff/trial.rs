//! One solver on some detectors, each with what touches it.

use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::{Group, GroupReport, Heap, Memory, Plan, SceneReport, SolverReport, milliseconds};
use crate::experiment::{Experiment, Frame, StudyError};
use crate::scenes::SceneKind;
use crate::score::{Score, Scorer, Summary};
use crate::variant::Variation;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_touch::solve::Solver;

/// A detector, and what touches it.
pub(super) struct Trial {
    pub experiment: Experiment,
    scorer: Scorer,
    places: Vec<Place>,
}

/// Frames of a place.
struct Place {
    kind: SceneKind,
    frames: Vec<Frame>,
}

impl Trial {
    /// With such places of each kind of scene.
    pub fn new(plan: &Plan, experiment: Experiment, places: Range<u64>) -> Result<Self, StudyError> {
        let places = places.flat_map(|place| SceneKind::ALL.map(|kind| (place, kind)));
        let places = places.map(|(place, kind)| {
            let seed = plan.seed.wrapping_mul(1_000_003).wrapping_add(place * 101 + kind as u64);
            let touches = kind.frames(&experiment.detector, seed, plan.frames);
            Ok(Place { kind, frames: experiment.frames(&touches, seed)? })
        });
        let places = places.collect::<Result<_, StudyError>>()?;
        Ok(Self { scorer: Scorer::new(&experiment), experiment, places })
    }
}

/// Lets a solver read all frames of all detectors.
///
/// # Errors
/// [`StudyError`] if it cannot be made for the model.
pub(super) fn try_variation(
    heap: Option<Heap>,
    trials: &mut [Trial],
    variation: Variation,
) -> Result<SolverReport, StudyError> {
    let mut set_up = Duration::ZERO;
    let mut scores: Vec<(SceneKind, Vec<Score>)> = Vec::new();
    let mut last: Option<(Arc<Jacobian>, Box<dyn Solver>)> = None;
    for Trial { experiment, scorer, places } in trials.iter_mut() {
        let jacobian = &experiment.problem.jacobian;
        // Those who know of several detectors the same need one solver.
        let (_, solver) = match last.take().filter(|(of, _)| Arc::ptr_eq(of, jacobian)) {
            Some(same) => last.insert(same),
            None => {
                let start = Instant::now();
                let solver = variation.build(&experiment.problem)?;
                set_up = start.elapsed();
                last.insert((Arc::clone(jacobian), solver))
            }
        };
        for place in places {
            scores.push((place.kind, scorer.run(&mut **solver, &place.frames)?));
        }
    }
    drop(last);
    let counted = heap.zip(trials.first());
    let memory = counted.map(|(heap, trial)| memory(heap, &trial.experiment, &trial.places, variation)).transpose()?;
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
