//! Sweeps of the tolerances: how far the detector that was built may be from the one described.

use super::sweep::{Bench, Point, Sweep};
use crate::calibrate::{Calibrate, Calibrated};
use crate::experiment::{Experiment, StudyError};
use crate::scenes::SceneKind;
use tactomo_physics::detector::{Detector, Tolerances};

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

/// All of them: with what solvers know from the description, and after a calibration if there is one.
pub fn sweeps(bench: &Bench) -> Result<Vec<Sweep>, StudyError> {
    let mut calibrated = CalibratedBench { bench, done: Vec::new() };
    KINDS.into_iter().map(|kind| sweep(&mut calibrated, kind)).collect()
}

fn sweep(calibrated: &mut CalibratedBench, (title, only): Kind) -> Result<Sweep, StudyError> {
    let bench = calibrated.bench;
    let mut note = "At so many times that of a hobbyist's bench, docs/detector.md. A firm contact, each place on another detector as built.".to_owned();
    let (mut points, mut refused) = (Vec::new(), 0);
    for (index, times) in bench.some(if title == ALL { &ALL_TIMES } else { &TIMES }).enumerate() {
        let (label, severity) = (format!("x {times}"), index as f64);
        let tolerances = only(Tolerances::default().times(*times));
        let built = as_built(bench, tolerances)?;
        let mut point = point(bench, label.clone(), severity, &built)?;
        if let Some(calibrate) = bench.plan.calibrate {
            bench.tell(&format!("{title}, {label}: calibrating {} detectors", built.len()));
            let (known, more) = calibrated.known(calibrate, tolerances, &built)?;
            refused += more;
            point.calibrated = Some(Box::new(self::point(bench, label, severity, &known)?));
        }
        points.push(point);
    }
    if let Some(calibrate) = bench.plan.calibrate {
        note += &format!(" Below each solver: {}.", calibrate.name());
    }
    if refused > 0 {
        note += &format!(" {refused} calibrations were refused; solvers know the description there.");
    }
    Ok(Sweep { title, note, points })
}

/// The detector as it was built at each place, within tolerances of which solvers know nothing.
fn as_built(bench: &Bench, tolerances: Tolerances) -> Result<Vec<Experiment>, StudyError> {
    bench.seeds().into_iter().map(|seed| bench.sound.as_built_within(tolerances, seed)).collect()
}

/// Calibrations of the detectors as built within some tolerances, each done once: no tolerances are the same ones in every sweep.
struct CalibratedBench<'a, 'plan> {
    bench: &'a Bench<'plan>,
    done: Vec<(Tolerances, Vec<Detector>, usize)>,
}

impl CalibratedBench<'_, '_> {
    /// The same detectors as solvers know them after a calibration, and how many of those were refused.
    fn known(
        &mut self,
        calibrate: Calibrate,
        tolerances: Tolerances,
        built: &[Experiment],
    ) -> Result<(Vec<Experiment>, usize), StudyError> {
        let index = match self.done.iter().position(|(done, ..)| *done == tolerances) {
            Some(index) => index,
            None => {
                let places = built.iter().zip(self.bench.seeds());
                let found = places.map(|(place, seed)| calibrate.find(place, seed)).collect::<Result<Vec<_>, _>>()?;
                let refused = found.iter().filter(|found| found.refused.is_some()).count();
                let detectors = found.into_iter().map(|Calibrated { detector, .. }| detector).collect();
                self.done.push((tolerances, detectors, refused));
                self.done.len() - 1
            }
        };
        let (_, detectors, refused) = &self.done[index];
        let known = built.iter().zip(detectors).map(|(place, detector)| place.known_as(detector));
        Ok((known.collect::<Result<_, _>>()?, *refused))
    }
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
        experiment: bench.sound.with_faults(&[], 0)?,
        places: places.iter().zip(bench.seeds()).map(frames).collect::<Result<_, _>>()?,
        known: places.iter().map(|place| place.with_faults(&[], 0)).collect::<Result<_, _>>()?,
        lambda: None,
        calibrated: None,
    })
}
