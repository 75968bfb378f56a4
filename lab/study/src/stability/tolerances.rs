//! Sweeps of the tolerances: how far the detector that was built may be from the one described.

use super::sweep::{BENCH, Bench, Maker, Plan, Point, Sweep};
use crate::calibrate::{Calibrate, Calibrated};
use crate::experiment::{Experiment, StudyError};
use crate::scenes::SceneKind;
use tactomo_physics::detector::Tolerances;

/// Times a hobbyist's bench: from nothing to hopeless.
const TIMES: [f64; 6] = [0.0, 0.1, 0.3, 1.0, 2.0, 4.0];
/// The same of all at once, which are hopeless sooner.
const ALL_TIMES: [f64; 6] = [0.0, 0.03, 0.1, 0.3, 1.0, 2.0];
const EXACT: Tolerances = Tolerances::EXACT;

/// A tolerance: what it is called, and a detector's tolerances with all others taken away.
type Kind = (&'static str, fn(Tolerances) -> Tolerances);

const KINDS: [Kind; 11] = [
    (ALL, |all| all),
    ("Tolerance of thickness", |all| Tolerances { thickness_share: all.thickness_share, ..EXACT }),
    ("Tolerance of conductivity", |all| Tolerances { conductivity_share: all.conductivity_share, ..EXACT }),
    ("Tolerance of top over bottom", |all| Tolerances { top_over_bottom_factor: all.top_over_bottom_factor, ..EXACT }),
    ("Unevenness", |all| Tolerances { uneven_share: all.uneven_share, ..EXACT }),
    ("Tolerance of electrodes' places", |all| Tolerances { electrodes_m: all.electrodes_m, ..EXACT }),
    ("Tolerance of pads' contact impedance", |all| Tolerances {
        contact_impedance_factor: all.contact_impedance_factor,
        ..EXACT
    }),
    ("Spread of pads' contact impedance", |all| Tolerances {
        contact_impedance_spread: all.contact_impedance_spread,
        ..EXACT
    }),
    ("Tolerance of channel gains", |all| Tolerances { gain_share: all.gain_share, ..EXACT }),
    ("Offsets of channels", |all| Tolerances { offset_lsb: all.offset_lsb, ..EXACT }),
    ("Tolerance of the on-resistance", |all| Tolerances { on_resistance_share: all.on_resistance_share, ..EXACT }),
];
const ALL: &str = "All tolerances";

/// How much longer a point takes that is tried after a calibration too.
const CALIBRATED_WORK: usize = 4;

/// All of them: with what solvers know from the description, and after a calibration if there is one. A quick study calibrates for all
/// tolerances at once alone.
pub fn sweeps(plan: &Plan) -> Vec<Maker> {
    let maker = |(title, only): Kind| {
        let calibrate = plan.calibrate.filter(|_| !plan.quick || title == ALL);
        let times = if title == ALL { &ALL_TIMES } else { &TIMES };
        let work = times.len() * if calibrate.is_some() { CALIBRATED_WORK } else { 1 };
        Maker::new(title, work, move |bench| sweep(bench, times, only, calibrate))
    };
    KINDS.into_iter().map(maker).collect()
}

fn sweep(
    bench: &Bench,
    all_times: &[f64],
    only: fn(Tolerances) -> Tolerances,
    calibrate: Option<Calibrate>,
) -> Result<Sweep, StudyError> {
    let mut note = "At so many times that of a hobbyist's bench, docs/detector.md. A firm contact, each place on another detector as built.".to_owned();
    let (mut points, mut refused) = (Vec::new(), 0);
    for (index, times) in bench.some(all_times).enumerate() {
        let (label, severity) = (format!("x {times}"), index as f64);
        let tolerances = only(Tolerances::default().times(*times));
        let built = as_built(bench, tolerances)?;
        let mut point = point(bench, label.clone(), severity, &built)?;
        if let Some(calibrate) = calibrate {
            let find = if tolerances.is_exact() { known_of_exact } else { known };
            let (known, more) = find(bench, calibrate, &built)?;
            refused += more;
            point.calibrated = Some(Box::new(self::point(bench, label, severity, &known)?));
        }
        points.push(point);
    }
    if let Some(calibrate) = calibrate {
        note += &format!(" Below each solver: {}.", calibrate.name());
    }
    if refused > 0 {
        note += &format!(" {refused} calibrations were refused; solvers know the description there.");
    }
    Ok(Sweep::new(note, points).in_units(BENCH, bench.some(all_times).copied()))
}

/// The detector as it was built at each place, within tolerances of which solvers know nothing.
fn as_built(bench: &Bench, tolerances: Tolerances) -> Result<Vec<Experiment>, StudyError> {
    bench.seeds().into_iter().map(|seed| bench.tolerant.as_built_within(tolerances, seed)).collect()
}

/// The detector as it was built at each place as solvers know it after a calibration, and how many of those were refused.
pub(super) type Known = (Vec<Experiment>, usize);

fn known(bench: &Bench, calibrate: Calibrate, built: &[Experiment]) -> Result<Known, StudyError> {
    let places = built.iter().zip(bench.seeds());
    let found = places.clone().map(|(place, seed)| calibrate.find(place, seed));
    let found = found.collect::<Result<Vec<Calibrated>, _>>()?;
    let refused = found.iter().filter(|found| found.refused.is_some()).count();
    let known = places.zip(&found).map(|((place, _), found)| place.known_as(&found.detector));
    Ok((known.collect::<Result<_, _>>()?, refused))
}

/// The same without any tolerances, which are the same detectors in every sweep: they are calibrated once.
fn known_of_exact(bench: &Bench, calibrate: Calibrate, built: &[Experiment]) -> Result<Known, StudyError> {
    let mut kept = bench.exact.borrow_mut();
    let (places, refused) = match &*kept {
        Some(known) => known,
        None => kept.insert(known(bench, calibrate, built)?),
    };
    Ok((places.iter().map(|place| place.with_faults(&[], 0)).collect::<Result<_, _>>()?, *refused))
}

/// A point at which each place has a detector of its own.
fn point(bench: &Bench, label: String, severity: f64, places: &[Experiment]) -> Result<Point, StudyError> {
    let frames = |(experiment, seed): (&Experiment, u64)| {
        let touches = SceneKind::Firm.frames(&bench.sound.detector, seed, 1).remove(0);
        experiment.frames(&vec![touches; bench.plan.frames], seed)
    };
    Ok(Point {
        label,
        severity,
        amount: None,
        experiment: bench.sound.with_faults(&[], 0)?,
        places: places.iter().zip(bench.seeds()).map(frames).collect::<Result<_, _>>()?,
        lead: 0,
        known: places.iter().map(|place| place.with_faults(&[], 0)).collect::<Result<_, _>>()?,
        lambda: None,
        calibrated: None,
    })
}
