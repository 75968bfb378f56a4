//! Sweeps of the tolerances: how far the detector that was built may be from the one described.

use super::sweep::{Bench, Point, Sweep};
use crate::calibrate::{Calibrate, Calibrated};
use crate::experiment::{Experiment, StudyError};
use crate::scenes::SceneKind;
use tactomo_physics::detector::{Detector, Tolerances};

/// A tolerance, from nothing to hopeless. Of the tolerances at hand all others are nothing.
struct Kind {
    title: &'static str,
    note: &'static str,
    values: &'static [f64],
    label: fn(f64) -> String,
    of: fn(f64) -> Tolerances,
}

const EXACT: Tolerances = Tolerances::EXACT;

const KINDS: [Kind; 11] = [
    Kind {
        title: "All tolerances",
        note: "Every tolerance at so many times that of a hobbyist's bench.",
        values: &[0.0, 0.03, 0.1, 0.3, 1.0, 2.0],
        label: times,
        of: |factor| Tolerances::default().times(factor),
    },
    Kind {
        title: "Tolerance of thickness",
        note: "Standard deviation of its logarithm, at the same conductivity.",
        values: &[0.0, 0.02, 0.05, 0.1, 0.2, 0.4],
        label: percent,
        of: |thickness_share| Tolerances { thickness_share, ..EXACT },
    },
    Kind {
        title: "Tolerance of conductivity",
        note: "Standard deviation of its logarithm.",
        values: &[0.0, 0.05, 0.1, 0.2, 0.5, 1.0],
        label: percent,
        of: |conductivity_share| Tolerances { conductivity_share, ..EXACT },
    },
    Kind {
        title: "Tolerance of top over bottom",
        note: "Of the conductivities of both: a factor, by its standard deviation.",
        values: &[1.0, 1.1, 1.3, 2.0, 4.0, 10.0],
        label: times,
        of: |top_over_bottom_factor| Tolerances { top_over_bottom_factor, ..EXACT },
    },
    Kind {
        title: "Unevenness",
        note: "Standard deviation of the logarithm of the conductivity from place to place, over a quarter of the shorter side.",
        values: &[0.0, 0.01, 0.03, 0.06, 0.12, 0.25],
        label: percent,
        of: |uneven_share| Tolerances { uneven_share, ..EXACT },
    },
    Kind {
        title: "Tolerance of electrodes' places",
        note: "Standard deviation of their x and y.",
        values: &[0.0, 5e-5, 1e-4, 3e-4, 1e-3, 3e-3],
        label: |metres| format!("{} mm", metres * 1e3),
        of: |electrodes_m| Tolerances { electrodes_m, ..EXACT },
    },
    Kind {
        title: "Tolerance of pads' contact impedance",
        note: "Of all pads alike: a factor, by its standard deviation.",
        values: &[1.0, 1.5, 3.0, 10.0, 30.0, 100.0],
        label: times,
        of: |contact_impedance_factor| Tolerances { contact_impedance_factor, ..EXACT },
    },
    Kind {
        title: "Spread of pads' contact impedance",
        note: "Standard deviation of its logarithm from pad to pad.",
        values: &[0.0, 0.1, 0.2, 0.3, 0.6, 1.0],
        label: percent,
        of: |contact_impedance_spread| Tolerances { contact_impedance_spread, ..EXACT },
    },
    Kind {
        title: "Tolerance of channel gains",
        note: "Standard deviation of their logarithm.",
        values: &[0.0, 0.001, 0.003, 0.01, 0.03, 0.1],
        label: |share| format!("{} %", (1e3 * share).round() / 10.0),
        of: |gain_share| Tolerances { gain_share, ..EXACT },
    },
    Kind {
        title: "Offsets of channels",
        note: "Standard deviation, in codes. The baseline takes them away, but for those below zero, which no converter reads.",
        values: &[0.0, 1.0, 2.0, 5.0, 20.0, 100.0],
        label: |codes| format!("{codes} LSB"),
        of: |offset_lsb| Tolerances { offset_lsb, ..EXACT },
    },
    Kind {
        title: "Tolerance of the on-resistance",
        note: "Standard deviation of its logarithm.",
        values: &[0.0, 0.1, 0.25, 0.5, 0.7, 1.0],
        label: percent,
        of: |on_resistance_share| Tolerances { on_resistance_share, ..EXACT },
    },
];

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

fn times(factor: f64) -> String {
    format!("x {factor}")
}

/// All of them: with what solvers know from the description, and after a calibration if there is one.
pub fn sweeps(bench: &Bench) -> Result<Vec<Sweep>, StudyError> {
    let mut calibrated = CalibratedBench { bench, done: Vec::new() };
    KINDS.iter().map(|kind| sweep(&mut calibrated, kind)).collect()
}

fn sweep(calibrated: &mut CalibratedBench, kind: &Kind) -> Result<Sweep, StudyError> {
    let bench = calibrated.bench;
    let mut note = format!("{} A firm contact, each place on another detector as built.", kind.note);
    let (mut points, mut refused) = (Vec::new(), 0);
    for (index, value) in bench.some(kind.values).copied().enumerate() {
        let (label, severity) = ((kind.label)(value), index as f64);
        let tolerances = (kind.of)(value);
        let built = as_built(bench, tolerances)?;
        let mut point = point(bench, label.clone(), severity, &built)?;
        if let Some(calibrate) = bench.plan.calibrate {
            bench.tell(&format!("{}, {label}: calibrating {} detectors", kind.title, built.len()));
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
    Ok(Sweep { title: kind.title, note, points })
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
