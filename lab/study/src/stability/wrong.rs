//! Sweeps of what is wrong in the model or in the description of the detector.

use super::sweep::{BENCH, Bench, Maker, NOISE, Sweep};
use crate::experiment::{Experiment, StudyError};
use crate::scenes::SceneKind;
use tactomo_physics::detector::{Adc, Detector, Layer, Tolerances};
use tactomo_physics::forward::ConnectingPoints;
use tactomo_physics::forward::shell::Shell;
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Fault, Noise};

/// True thickness over the one in the model.
const THICKNESSES: [f64; 9] = [0.5, 0.7, 0.85, 0.95, 1.0, 1.05, 1.15, 1.4, 2.0];
/// True conductivity over the one in the model.
const CONDUCTIVITIES: [f64; 7] = [0.5, 0.7, 0.9, 1.0, 1.1, 1.4, 2.0];
/// Standard deviation of the logarithm of contact impedances.
const SPREADS: [f64; 5] = [0.0, 0.05, 0.2, 0.5, 1.0];
/// Contact impedance for its spread (ohm m2): enough to be felt, a tenth of a sheet's resistance on a pad of 4 mm.
const FELT_OHM_M2: f64 = 1e-3;
/// Conductance of what pressed while the baseline was taken (sheet conductances).
const BASELINES: [f64; 6] = [0.0, 0.003, 0.01, 0.03, 0.1, 0.3];
/// Thickness of a detector that is read with the shell model, in radii of a pad.
const SHELL_THICKNESSES: [f64; 7] = [0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];
/// Nodes of the image.
const NODES: [usize; 6] = [2000, 5000, 900, 400, 200, 100];
/// True noise over the one that solvers expect.
const NOISES: [f64; 6] = [1.0, 2.0, 4.0, 8.0, 16.0, 64.0];
/// Voltage at which the converter saturates, as a share of the drive.
const CLIPS: [f64; 6] = [1.0, 0.5, 0.3, 0.2, 0.1, 0.05];

/// Sheet resistance of the driving layer (ohm per square), which no model has.
const SHEETS_OHM: [f64; 7] = [0.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0];
/// Conductance of layers that touch lightly everywhere (sheet conductances).
const LEAKS: [f64; 6] = [0.0, 0.003, 0.01, 0.03, 0.1, 0.3];

/// By how much the offset of each channel changes after the baseline was taken: standard deviation (LSB).
const OFFSETS_LSB: [f64; 6] = [0.0, 0.3, 1.0, 3.0, 10.0, 30.0];

/// All of them.
pub fn sweeps() -> Vec<Maker> {
    vec![
        Maker::new("Wrong thickness", THICKNESSES.len(), thickness),
        Maker::new("Wrong conductivity", CONDUCTIVITIES.len(), conductivity),
        Maker::new("Contact impedances that differ", SPREADS.len(), spread),
        Maker::new("A baseline taken under load", BASELINES.len(), baseline),
        Maker::new("More noise than expected", NOISES.len(), noise),
        Maker::new("A driving sheet that resists", SHEETS_OHM.len(), driving_sheet),
        Maker::new("A detector that leaks", LEAKS.len(), leak),
        Maker::new("Offsets that change after --rest", OFFSETS_LSB.len(), offsets_since),
        Maker::new("A leak that grows after --rest", LEAKS.len(), leak_since),
        Maker::new("Readings that saturate", CLIPS.len(), clip),
        Maker::new("A thick detector read with the thin-shell model", SHELL_THICKNESSES.len(), shell),
        Maker::new("A finer or coarser image", NODES.len(), nodes),
    ]
}

/// A sweep on a firm contact: how bad a value is, and the experiment for it.
fn firm<T: Copy>(
    bench: &Bench,
    note: &str,
    values: &[T],
    label: impl Fn(T) -> String,
    severity: impl Fn(T) -> f64,
    experiment: impl Fn(T) -> Result<Experiment, StudyError>,
) -> Result<Sweep, StudyError> {
    let points = bench
        .some(values)
        .map(|value| bench.point(label(*value), severity(*value), experiment(*value)?, SceneKind::Firm))
        .collect::<Result<_, _>>()?;
    Ok(Sweep::new(note, points))
}

/// A detector whose layers are thicker by a factor, of the same conductivity.
fn thicker(detector: &Detector, factor: f64) -> Detector {
    let layer = |layer: &Layer| Layer { thickness_m: factor * layer.thickness_m, ..*layer };
    Detector { layers: detector.layers.iter().map(layer).collect(), ..detector.clone() }
}

/// A detector of another thickness (m).
fn as_thick(detector: &Detector, thickness_m: f64) -> Detector {
    thicker(detector, thickness_m / detector.thickness_m())
}

fn pad_radius_m(detector: &Detector) -> f64 {
    detector.electrodes.iter().map(|pad| pad.radius_m).fold(f64::INFINITY, f64::min)
}

fn thickness(bench: &Bench) -> Result<Sweep, StudyError> {
    let note = "True thickness over the one in the model, at the same conductivity.";
    let of = |factor| bench.sound.with_truth(&thicker(bench.sound.truth(), factor));
    let sweep =
        firm(bench, note, &THICKNESSES, |factor| format!("x {factor}"), |factor: f64| (factor - 1.0).abs(), of)?;
    let deviation = Tolerances::default().thickness_share;
    let factors: Vec<f64> = bench.some(&THICKNESSES).copied().collect();
    Ok(sweep.in_units(BENCH, deviations(&factors, deviation)))
}

fn conductivity(bench: &Bench) -> Result<Sweep, StudyError> {
    let note = "True conductivity over the one in the model.";
    let of = |factor| bench.sound.with_faults(&[Fault::Conductivity { factor }], 1);
    let sweep =
        firm(bench, note, &CONDUCTIVITIES, |factor| format!("x {factor}"), |factor: f64| (factor - 1.0).abs(), of)?;
    let deviation = Tolerances::default().conductivity_share;
    let factors: Vec<f64> = bench.some(&CONDUCTIVITIES).copied().collect();
    Ok(sweep.in_units(BENCH, deviations(&factors, deviation)))
}

/// Deviations of a factor's logarithm.
fn deviations(factors: &[f64], deviation: f64) -> impl Iterator<Item = f64> {
    factors.iter().map(move |factor| factor.ln().abs() / deviation)
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

fn spread(bench: &Bench) -> Result<Sweep, StudyError> {
    let note = "Standard deviation of their logarithm, where pads have 1e-3 ohm m2, which the model has for all.";
    let felt = Detector { contact_impedance_ohm_m2: FELT_OHM_M2, ..bench.sound.detector.clone() };
    let felt = bench.experiment(&felt)?;
    let of = |deviation| felt.with_faults(&[Fault::ContactSpread { deviation }], bench.plan.seed);
    let sweep = firm(bench, note, &SPREADS, percent, |deviation| deviation, of)?;
    let bench_spread = Tolerances::default().contact_impedance_spread;
    Ok(sweep.in_units(BENCH, bench.some(&SPREADS).map(|deviation| deviation / bench_spread)))
}

fn baseline(bench: &Bench) -> Result<Sweep, StudyError> {
    let note = "Conductance of a contact elsewhere that pressed while the baseline was taken, in sheet conductances, and is lifted afterwards.";
    let sheet_s = bench.sound.detector.sheet_conductance_s();
    let load = bench.contact(SceneKind::Firm, bench.plan.seed.wrapping_add(77));
    let of = |sheets| match sheets > 0.0 {
        true => bench.sound.with_baseline(&[Contact { conductance_s: sheets * sheet_s, ..load }]),
        false => bench.sound.with_faults(&[], 0),
    };
    firm(bench, note, &BASELINES, |sheets| format!("{sheets}"), |sheets| sheets, of)
}

fn noise(bench: &Bench) -> Result<Sweep, StudyError> {
    let note = "True noise over the one that solvers expect.";
    let adc = bench.sound.detector.adc;
    let of = |factor: f64| {
        let noisy = Adc { noise_lsb: factor * adc.noise_lsb, ..adc };
        bench.sound.with_truth(&Detector { adc: noisy, ..bench.sound.truth().clone() })
    };
    let sweep = firm(bench, note, &NOISES, |factor| format!("x {factor}"), |factor| factor, of)?;
    Ok(sweep.in_units(NOISE, bench.some(&NOISES).copied()))
}

fn driving_sheet(bench: &Bench) -> Result<Sweep, StudyError> {
    let note = "Sheet resistance of the driving layer in ohm per square, connected at a corner; the model has none.";
    let of = |ohm| match ohm > 0.0 {
        true => bench.sound.with_faults(&[Fault::DrivingSheet { ohm, points: ConnectingPoints::One }], 1),
        false => bench.sound.with_faults(&[], 0),
    };
    let sweep = firm(bench, note, &SHEETS_OHM, |ohm| format!("{ohm}"), |ohm| ohm, of)?;
    let bench_ohm = Tolerances::default().driving_sheet_ohm;
    Ok(sweep.in_units(BENCH, bench.some(&SHEETS_OHM).map(|ohm| ohm / bench_ohm)))
}

fn leak(bench: &Bench) -> Result<Sweep, StudyError> {
    let note = "Conductance of layers that touch lightly everywhere, in sheet conductances. The baseline is taken off, and the leakage in it.";
    let of = |sheets| match sheets > 0.0 {
        true => bench.sound.with_faults(&[Fault::Leak { sheets }], 1),
        false => bench.sound.with_faults(&[], 0),
    };
    firm(bench, note, &LEAKS, |sheets| format!("{sheets}"), |sheets| sheets, of)
}

/// What the sweeps of changes after the baseline have in common, for their notes.
const SINCE: &str = "The baseline was taken before and is not followed, as by `--rest`.";

fn offsets_since(bench: &Bench) -> Result<Sweep, StudyError> {
    let note = format!("Standard deviation of the change of each channel's offset, in LSB. {SINCE}");
    let lsb_v = bench.sound.detector.adc.lsb_v();
    let of = |deviation_lsb: f64| {
        if deviation_lsb == 0.0 {
            return bench.sound.with_faults(&[], 0);
        }
        let (mut changed, mut random) = (bench.sound.truth().clone(), Noise::new(bench.plan.seed));
        changed.electrodes.iter_mut().for_each(|pad| pad.offset_v += deviation_lsb * lsb_v * random.normal());
        Ok(bench.sound.with_truth(&changed)?.changed_since(&bench.sound))
    };
    firm(bench, &note, &OFFSETS_LSB, |lsb| format!("{lsb} LSB"), |lsb| lsb, of)
}

fn leak_since(bench: &Bench) -> Result<Sweep, StudyError> {
    let what = "Conductance of layers that come to touch lightly everywhere, in sheet conductances";
    let note = format!("{what}; solvers know the detector to its tolerances, as those in use do. {SINCE}");
    let before = &bench.tolerant;
    let of = |sheets| match sheets > 0.0 {
        true => Ok(before.with_faults(&[Fault::Leak { sheets }], 1)?.changed_since(before)),
        false => before.with_faults(&[], 0),
    };
    firm(bench, &note, &LEAKS, |sheets| format!("{sheets}"), |sheets| sheets, of)
}

fn clip(bench: &Bench) -> Result<Sweep, StudyError> {
    let note = "Voltage at which the converter saturates, as a share of the drive.";
    let drive_v = bench.sound.detector.drive_v;
    let of = |share| bench.sound.with_faults(&[Fault::Clip { range_v: [0.0, share * drive_v] }], 1);
    firm(bench, note, &CLIPS, percent, |share: f64| -share, of)
}

fn shell(bench: &Bench) -> Result<Sweep, StudyError> {
    let note = "Thickness in radii of a pad.";
    let detector = &bench.sound.detector;
    let of = |radii| {
        let detector = as_thick(detector, radii * pad_radius_m(detector));
        let experiment = bench.experiment(&detector)?;
        Ok(experiment.inverted_on(Box::new(Shell::new(&detector)?)))
    };
    firm(bench, note, &SHELL_THICKNESSES, |radii| format!("{radii}"), |radii| radii, of)
}

fn nodes(bench: &Bench) -> Result<Sweep, StudyError> {
    let note = "Nodes of the image that is inverted; 2000 are the default.";
    let of = |nodes| Ok(bench.sound.inverted_on(bench.sound.problem.model.on_image_of(nodes)?));
    firm(bench, note, &NODES, |nodes| nodes.to_string(), |nodes| (nodes as f64 - 2000.0).abs(), of)
}
