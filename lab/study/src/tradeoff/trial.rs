//! One solver on some detectors, each with what touches it.

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use super::{Floor, Group, GroupReport, Heap, Plan, SceneReport, SolverReport, milliseconds};
use crate::bound::{Bound, Errors, cramer_rao};
use crate::experiment::{Experiment, Frame, StudyError};
use crate::scenes::SceneKind;
use crate::score::{Score, Scorer, Spread, Summary};
use crate::stopwatch::timed;
use crate::variant::Variation;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::simulate::Noise;
use tactomo_touch::solve::Solver;

/// Errors drawn for each frame of what noise allows: with six frames, percentiles of 600.
const FLOOR_DRAWS: usize = 100;
const FLOOR_SEED: u64 = 1;

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
    /// With such places of each of some kinds of scenes.
    pub fn new(
        plan: &Plan,
        experiment: Experiment,
        places: Range<u64>,
        kinds: &[SceneKind],
    ) -> Result<Self, StudyError> {
        let places = places.flat_map(|place| kinds.iter().map(move |kind| (place, *kind)));
        let places = places.map(|(place, kind)| {
            let seed = plan.seed.wrapping_mul(1_000_003).wrapping_add(place * 101 + kind as u64);
            let touches = kind.frames(&experiment.detector, seed, plan.frames);
            Ok(Place { kind, frames: experiment.frames(&touches, seed)? })
        });
        let places = places.collect::<Result<_, StudyError>>()?;
        Ok(Self { scorer: Scorer::new(&experiment), experiment, places })
    }
}

/// What noise allows in the groups of contacts, over the frames of all detectors.
///
/// # Errors
/// [`StudyError`] if a contact is off the detector.
pub(super) fn floors(trials: &[Trial]) -> Result<Vec<Floor>, StudyError> {
    [Group::One, Group::Several].map(|group| floor(trials, group)).into_iter().collect()
}

fn floor(trials: &[Trial], group: Group) -> Result<Floor, StudyError> {
    let (mut first_m, mut following_m) = (Vec::new(), Vec::new());
    let mut noise = Noise::new(FLOOR_SEED);
    for Trial { experiment, places, .. } in trials {
        let deviation_v = experiment.detector.adc.deviation_v();
        for place in places.iter().filter(|place| place.kind.group() == group) {
            for (before, frame) in place.frames.iter().enumerate() {
                let contacts = frame.contacts.as_deref().unwrap_or_default();
                // Whoever follows may use all frames until then: their information adds up.
                let errors = Errors::of_noise(&experiment.detector, deviation_v / (1.0 + before as f64).sqrt());
                let Some(bounds) = cramer_rao(&*experiment.problem.model, contacts, &errors)? else { continue };
                let errors_m = if before == 0 { &mut first_m } else { &mut following_m };
                errors_m.extend((0..FLOOR_DRAWS).map(|_| drawn_m(&bounds, &mut noise)));
            }
        }
    }
    let [first_m, following_m] = [first_m, following_m].map(|errors_m| Spread::of(errors_m.into_iter()));
    Ok(Floor { group, first_m, following_m })
}

/// Mean distance of contacts from where they are, with normal errors (m).
fn drawn_m(bounds: &[Bound], noise: &mut Noise) -> f64 {
    let distance_m = |bound: &Bound| {
        let [long_m, short_m] = bound.axes_m.map(|axis_m| axis_m * noise.normal());
        long_m.hypot(short_m)
    };
    bounds.iter().map(distance_m).sum::<f64>() / bounds.len().max(1) as f64
}

/// Lets a solver read all frames of all detectors, and tell what it allocates if that is counted; with a parameter that is not its default at so many
/// places of each kind of scene at most.
///
/// # Errors
/// [`StudyError`] if it cannot be made for the model.
pub(super) fn try_variation(
    heap: Option<Heap>,
    trials: &mut [Trial],
    variation: Variation,
    swept: usize,
) -> Result<SolverReport, StudyError> {
    let mut set_up = Duration::ZERO;
    let mut memory = None;
    let mut scores: Vec<(SceneKind, Vec<Score>)> = Vec::new();
    let mut last: Option<(Arc<Jacobian>, Box<dyn Solver>)> = None;
    for Trial { experiment, scorer, places } in trials.iter_mut() {
        let jacobian = &experiment.problem.jacobian;
        // Those who know of several detectors the same need one solver.
        let (_, solver) = match last.take().filter(|(of, _)| Arc::ptr_eq(of, jacobian)) {
            Some(same) => last.insert(same),
            None => {
                heap.inspect(|heap| (heap.start)());
                let (solver, time) = timed(|| variation.build(&experiment.problem));
                let solver = solver.map(|mut solver| {
                    heap.inspect(|_| see_first(&mut *solver, places));
                    solver
                });
                // The solver is still there, so what it keeps is counted.
                memory = heap.map(|heap| (heap.stop)());
                set_up = time;
                last.insert((Arc::clone(jacobian), solver?))
            }
        };
        let most = if variation.parameter.is_some() { swept } else { usize::MAX };
        for kind in SceneKind::ALL {
            for place in places.iter().filter(|place| place.kind == kind).take(most) {
                scores.push((place.kind, scorer.run(&mut **solver, &place.frames)?));
            }
        }
    }
    Ok(SolverReport {
        solver: variation.method.name().to_owned(),
        family: variation.method.family(),
        parameter: variation.parameter.map(|parameter| parameter.to_string()),
        unknowns: trials.first().and_then(|trial| variation.unknowns(&trial.experiment.problem)),
        set_up_ms: milliseconds(set_up),
        memory,
        all: Summary::of(scores.iter().flat_map(|(_, scores)| scores)),
        groups: Group::ALL.into_iter().map(|group| group_report(&scores, group)).collect(),
        scenes: SceneKind::ALL.into_iter().map(|scene| scene_report(&scores, scene, swept)).collect(),
    })
}

fn group_report(scores: &[(SceneKind, Vec<Score>)], group: Group) -> GroupReport {
    let own = || scores.iter().filter(|(kind, _)| kind.group() == group).map(|(_, scores)| scores);
    GroupReport {
        group,
        summary: Summary::of(own().flatten()),
        first: Summary::of(own().filter_map(|scores| scores.first())),
        following: Summary::of(own().flat_map(|scores| scores.iter().skip(1))),
    }
}

fn scene_report(scores: &[(SceneKind, Vec<Score>)], scene: SceneKind, swept: usize) -> SceneReport {
    let own = || scores.iter().filter(|(kind, _)| *kind == scene).map(|(_, scores)| scores);
    SceneReport { scene, summary: Summary::of(own().flatten()), swept: Summary::of(own().take(swept).flatten()) }
}

/// Lets a solver see the first frame of each kind of scene: a search needs more memory than what follows it.
fn see_first(solver: &mut dyn Solver, places: &[Place]) {
    for frame in places.iter().take(SceneKind::ALL.len()).flat_map(|place| place.frames.first()) {
        solver.reset();
        // Readings that it refuses need no memory.
        drop(solver.solve(&frame.readings));
    }
}
