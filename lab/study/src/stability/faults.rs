//! Sweeps of a fault over all electrodes.

use super::sweep::{Bench, Maker, Point, Sweep};
use crate::experiment::StudyError;
use crate::scenes::SceneKind;
use tactomo_physics::simulate::Fault;
use tactomo_touch::solve::{FaultTolerant, Method, Solver};

/// A kind of fault: what is wrong with an electrode, and the next one.
type Kind = (&'static str, &'static str, fn(usize, usize) -> Fault);

const KINDS: [Kind; 5] = [
    ("A dead electrode", "Its wire is broken.", |electrode, _| Fault::Open { electrode }),
    ("Two electrodes shorted", "With the next one.", |electrode, next| Fault::Short {
        electrodes: [electrode, next],
        ohm: 0.0,
    }),
    ("Two electrodes exchanged", "With the next one.", |electrode, next| Fault::Swap { channels: [electrode, next] }),
    ("A channel of the wrong sign", "Full scale less the voltage.", |channel, _| Fault::Invert { channel }),
    ("A channel of the wrong gain", "0.8 of the voltage.", |channel, _| Fault::Gain { channel, factor: 0.8 }),
];

/// A quick study tries every seventh electrode: a corner and edges.
const QUICK_STEP: usize = 7;
/// Frames that the guard has seen before electrodes are left out as it says.
const SEEN: usize = 48;
/// The kinds, from the first, that are also tried with what the guard finds left out, and the solver that it guards meanwhile: an exchange is looked
/// for where that keeps flagging a misfit, which `kernel` does soon; all others show in the readings alone.
const GUARDED: [(&str, Method); 3] = [
    ("A dead electrode, left out", Method::TikhonovPaper),
    ("Two electrodes shorted, left out", Method::TikhonovPaper),
    ("Two electrodes exchanged, left out", Method::Kernel),
];

/// All of them, of so many electrodes.
pub fn sweeps(electrodes: usize) -> Vec<Maker> {
    let bare = KINDS.map(|kind| Maker::new(kind.0, electrodes, move |bench| sweep(bench, kind)));
    let guarded = KINDS.into_iter().zip(GUARDED).map(|(kind, (title, method))| {
        Maker::new(title, electrodes, move |bench| left_out(sweep(bench, kind)?, method))
    });
    bare.into_iter().chain(guarded).collect()
}

fn sweep(bench: &Bench, (_, note, fault): Kind) -> Result<Sweep, StudyError> {
    let count = bench.sound.detector.electrodes.len();
    let point = |label: String, severity: f64, faults: &[Fault]| -> Result<Point, StudyError> {
        bench.point(label, severity, bench.sound.with_faults(faults, bench.plan.seed)?, SceneKind::Firm)
    };
    let mut points = vec![point("none".to_owned(), 0.0, &[])?];
    for electrode in (0..count).step_by(if bench.plan.quick { QUICK_STEP } else { 1 }) {
        points.push(point(format!("no. {electrode}"), 1.0, &[fault(electrode, (electrode + 1) % count)])?);
    }
    let note = format!("{note} On a firm contact, each electrode in turn, counted from 0.");
    Ok(Sweep::new(note, points))
}

/// The same sweep, solved without the electrodes that the guard finds wrong.
fn left_out(sweep: Sweep, method: Method) -> Result<Sweep, StudyError> {
    let note = format!(
        "{} Solved without the electrodes that the guard of live finds wrong in {SEEN} frames: they stand behind the arrow.",
        sweep.note
    );
    let points = sweep.points.into_iter().map(|point| without_wrong(point, method)).collect::<Result<_, _>>()?;
    Ok(Sweep::new(note, points))
}

fn without_wrong(mut point: Point, method: Method) -> Result<Point, StudyError> {
    let wrong = found_wrong(&point, method)?;
    if wrong.is_empty() {
        return Ok(point);
    }
    let electrodes = point.experiment.detector.electrodes.len();
    let kept: Vec<usize> = (0..electrodes).filter(|electrode| !wrong.contains(electrode)).collect();
    for frame in point.places.iter_mut().flatten() {
        frame.readings = frame.readings.of(&kept);
    }
    let names: Vec<_> = wrong.iter().map(usize::to_string).collect();
    point.label = format!("{} → {}", point.label, names.join(", "));
    point.experiment = point.experiment.inverted_with(&kept);
    Ok(point)
}

/// Electrodes that the guard finds wrong in frames of a point's first place.
fn found_wrong(point: &Point, method: Method) -> Result<Vec<usize>, StudyError> {
    let Some(frame) = point.places.first().and_then(|frames| frames.first()) else { return Ok(Vec::new()) };
    let mut guard = FaultTolerant::new(method, &point.experiment.problem)?;
    for frame in point.experiment.frames(&vec![frame.touches.clone(); SEEN], 1)? {
        // It learns nothing from readings that it refuses.
        drop(guard.solve(&frame.readings));
    }
    Ok(guard.excluded().iter().map(|(electrode, _)| *electrode).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::Experiment;
    use crate::stability::Plan;
    use tactomo_physics::detector::Detector;

    #[test]
    fn a_dead_electrode_is_left_out_and_the_rest_solves_well() {
        let plan = Plan {
            detector: Detector::preset(Detector::DEFAULT).unwrap(),
            methods: vec![Method::Contacts],
            places: 1,
            frames: 2,
            seed: 1,
            quick: true,
            as_built: None,
            calibrate: None,
        };
        let bench = Bench::new(&plan, Experiment::new(&plan.detector).unwrap());
        let Sweep { points, .. } = left_out(sweep(&bench, KINDS[0]).unwrap(), GUARDED[0].1).unwrap();
        assert_eq!((points[0].label.as_str(), points[2].label.as_str()), ("none", "no. 7 → 7"));
        assert_eq!(points[2].places[0][0].readings.electrodes(), 15);
        let mut solver = Method::Contacts.build(&points[2].experiment.problem).unwrap();
        let frame = &points[2].places[0][0];
        let found = solver.solve(&frame.readings).unwrap().contacts;
        let truth = frame.contacts.as_deref().unwrap();
        assert!(found.len() == 1 && tactomo_touch::metrics::position_error_m(truth, &found).is_some_and(|m| m < 5e-4));
    }
}
