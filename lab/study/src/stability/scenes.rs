//! Sweeps of what touches and of what the converter makes of it.

use std::f64::consts::TAU;

use super::sweep::{Bench, Maker, NOISE, Sweep};
use crate::experiment::{Experiment, StudyError};
use crate::scenes::SceneKind;
use tactomo_physics::detector::{Adc, Detector};
use tactomo_physics::forward::readings_v;
use tactomo_physics::geometry;
use tactomo_physics::scene::{Contact, Touch};

/// Signal over noise (dB).
const SNR_DB: [f64; 9] = [80.0, 70.0, 60.0, 50.0, 40.0, 30.0, 20.0, 10.0, 0.0];
/// Bits of a converter whose noise is that of the default, 1.5 LSB.
const BITS: [u8; 5] = [16, 14, 12, 10, 8];
/// Conductance (sheet conductances).
const CONDUCTANCES: [f64; 10] = [0.003, 0.01, 0.03, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 1000.0];
/// Distances (mean distances of electrodes).
pub(super) const APART: [f64; 9] = [1.6, 1.2, 0.9, 0.7, 0.55, 0.4, 0.27, 0.2, 0.13];
/// Distance to which two contacts part, each of which is shown alike when they begin on one spot (mean distances of electrodes).
const PARTED: [f64; 6] = [1.6, 1.0, 2.0 / 3.0, 7.0 / 15.0, 1.0 / 3.0, 0.2];
/// Distance of two contacts that keep still (mean distances of electrodes).
const STILL: [f64; 5] = [1.0, 2.0 / 3.0, 7.0 / 15.0, 1.0 / 3.0, 0.2];
/// Frames in which they do: a third of a second at 100 frames a second.
const KEPT: usize = 32;
/// Frames in which they part: a tenth of a second at 100 frames a second.
const PARTING: usize = 10;
const FROM_EDGE: [f64; 6] = [0.5, 0.3, 0.2, 0.15, 0.12, 0.1];
const FROM_PAD: [f64; 6] = [0.5, 0.3, 0.2, 0.13, 0.07, 0.0];
/// Radius of a wide contact (mean distances of electrodes).
const RADII: [f64; 7] = [0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0];
/// Places of a second press that are looked at for the one that lowers the signal most.
const TRIED: usize = 200;
const LOWERED: [usize; 5] = [199, 60, 20, 5, 0];

/// All of them.
pub fn sweeps() -> Vec<Maker> {
    vec![
        Maker::new("Noise", SNR_DB.len(), noise),
        Maker::new("Noise where nothing touches", SNR_DB.len(), noise_at_rest),
        Maker::new("Bits of the converter", BITS.len(), bits),
        Maker::new("Force, from nothing to saturation", CONDUCTANCES.len(), conductance),
        Maker::new("Distance of two firm contacts", APART.len(), apart_firm),
        Maker::new("Distance of two light contacts", APART.len(), apart_light),
        Maker::new("Two contacts that part while they are followed", PARTED.len(), parting),
        Maker::new("Two contacts that keep still while they are followed", STILL.len(), still),
        Maker::new("Distance to the edge", FROM_EDGE.len(), edge),
        Maker::new("Distance to an electrode's middle", FROM_PAD.len(), pad),
        Maker::new("Radius of a wide contact", RADII.len(), width),
        Maker::new("Two presses that give less signal than one", LOWERED.len(), lowered),
    ]
}

/// The converter of the sweep of noise: fine enough that noise alone counts.
fn noisy(detector: &Detector, snr_db: f64, signal_v: f64) -> Detector {
    let adc = Adc { bits: 16, ..detector.adc };
    let noise_lsb = signal_v * 10f64.powf(-snr_db / 20.0) / adc.lsb_v();
    Detector { adc: Adc { noise_lsb, ..adc }, ..detector.clone() }
}

/// Root mean square of the readings of a firm contact (V).
fn signal_v(bench: &Bench) -> Result<f64, StudyError> {
    let contact = bench.contact(SceneKind::Firm, 1);
    let readings = readings_v(&bench.sound.problem.model.impedance_ohm(&[contact])?, &bench.sound.detector);
    Ok((readings.volts().iter().map(|volts| volts * volts).sum::<f64>() / readings.volts().len() as f64).sqrt())
}

fn noise_of(bench: &Bench, kind: SceneKind, note: &str) -> Result<Sweep, StudyError> {
    let signal_v = signal_v(bench)?;
    let points = bench
        .some(&SNR_DB)
        .map(|snr_db| {
            let experiment = bench.sound.measured_as(&noisy(&bench.sound.detector, *snr_db, signal_v));
            bench.point(format!("{snr_db} dB"), -snr_db, experiment, kind)
        })
        .collect::<Result<_, _>>()?;
    let described_v = bench.sound.detector.adc.deviation_v();
    let noise_v = |snr_db: &f64| signal_v * 10f64.powf(-snr_db / 20.0);
    Ok(Sweep::new(note, points).in_units(NOISE, bench.some(&SNR_DB).map(|snr_db| noise_v(snr_db) / described_v)))
}

fn noise(bench: &Bench) -> Result<Sweep, StudyError> {
    noise_of(
        bench,
        SceneKind::Firm,
        "On a firm contact; root mean square of its readings over the standard deviation of noise, which solvers know, at 16 bits.",
    )
}

fn noise_at_rest(bench: &Bench) -> Result<Sweep, StudyError> {
    noise_of(bench, SceneKind::None, "The same noise, as if the firm contact were there. Right is: no contact.")
}

fn bits(bench: &Bench) -> Result<Sweep, StudyError> {
    let points = bench
        .some(&BITS)
        .map(|bits| {
            let adc = Adc { bits: *bits, ..bench.sound.detector.adc };
            let experiment = bench.sound.measured_as(&Detector { adc, ..bench.sound.detector.clone() });
            bench.point(format!("{bits} bits"), -f64::from(*bits), experiment, SceneKind::Light)
        })
        .collect::<Result<_, _>>()?;
    let note = format!(
        "On a light contact (0.03 sheet conductances), with {} LSB of noise.",
        bench.sound.detector.adc.noise_lsb
    );
    Ok(Sweep::new(note, points))
}

/// The sound experiment once more.
fn sound(bench: &Bench) -> Result<Experiment, StudyError> {
    bench.sound.with_faults(&[], 0)
}

/// A sweep of what touches, on the sound detector, from the harmless to the worst.
pub(super) fn touched<T: Copy>(
    bench: &Bench,
    note: &str,
    values: &[T],
    label: impl Fn(T) -> String,
    touches: impl Fn(T, u64) -> Vec<Touch>,
) -> Result<Sweep, StudyError> {
    let points = bench
        .some(values)
        .enumerate()
        .map(|(index, value)| bench.touched(label(*value), index as f64, sound(bench)?, |seed| touches(*value, seed)))
        .collect::<Result<_, _>>()?;
    Ok(Sweep::new(note, points))
}

fn conductance(bench: &Bench) -> Result<Sweep, StudyError> {
    let sheet_s = bench.sound.detector.sheet_conductance_s();
    let touches = |sheets: f64, seed| {
        let contact = bench.contact(SceneKind::Firm, seed);
        vec![Touch::from(Contact { conductance_s: sheets * sheet_s, ..contact })]
    };
    let mut sweep = touched(
        bench,
        "Of one contact, in sheet conductances; its radius stays.",
        &CONDUCTANCES,
        |sheets| format!("{sheets}"),
        touches,
    )?;
    // Harmless is in the middle.
    for (point, sheets) in sweep.points.iter_mut().zip(bench.some(&CONDUCTANCES)) {
        point.severity = (sheets / 0.3).log10().abs();
    }
    Ok(sweep)
}

/// Two contacts of a kind so many mean distances of electrodes apart, wherever a seed says.
pub(super) fn pair(bench: &Bench, kind: SceneKind, apart: f64, seed: u64) -> [Contact; 2] {
    let contact = bench.contact(kind, seed);
    let apart_m = apart * bench.sound.reach_m();
    let half_m = bench.sound.detector.outline.size_m().map(|side_m| 0.5 * side_m);
    let mut random = fastrand::Rng::with_seed(seed);
    // The second one lies towards the middle half, in a direction of its own, as long as that is on the detector.
    let middle_m = half_m.map(|half_m| 0.3 * half_m * (2.0 * random.f64() - 1.0));
    let start = random.f64();
    let ends = (0..64).map(|step| {
        let (sin, cos) = (TAU * (start + f64::from(step) / 64.0)).sin_cos();
        [-0.5, 0.5].map(|share| [middle_m[0] + share * apart_m * cos, middle_m[1] + share * apart_m * sin])
    });
    let inside = |ends: &[[f64; 2]; 2]| ends.iter().all(|at| (0..2).all(|axis| at[axis].abs() < 0.9 * half_m[axis]));
    let longways = if half_m[0] >= half_m[1] { [0.5 * apart_m, 0.0] } else { [0.0, 0.5 * apart_m] };
    let ends = ends.clone().find(inside).unwrap_or([longways.map(|x| -x), longways]);
    ends.map(|[x_m, y_m]| Contact { x_m, y_m, ..contact })
}

fn apart(bench: &Bench, kind: SceneKind, note: &str) -> Result<Sweep, StudyError> {
    let touches = |share, seed| pair(bench, kind, share, seed).map(Touch::from).to_vec();
    touched(bench, note, &APART, |share| millimetres(bench, share), touches)
}

fn apart_firm(bench: &Bench) -> Result<Sweep, StudyError> {
    apart(bench, SceneKind::Firm, "0.3 sheet conductances each. Two that are found as one count as one missed.")
}

fn apart_light(bench: &Bench) -> Result<Sweep, StudyError> {
    apart(bench, SceneKind::Light, "0.03 sheet conductances each.")
}

/// Two that begin on one spot and part, which solvers follow from one contact to two.
fn parting(bench: &Bench) -> Result<Sweep, StudyError> {
    let note = format!(
        "Two firm contacts of 0.3 sheet conductances that begin on one spot and part to this distance in {PARTING} frames. What counts is what is found there."
    );
    followed(bench, note, &PARTED, PARTING, |parted, share| share * parted)
}

/// Two that keep still, which frames tell better the longer they do.
fn still(bench: &Bench) -> Result<Sweep, StudyError> {
    let note = format!(
        "Two firm contacts of 0.3 sheet conductances at this distance for {KEPT} frames. What counts is what is found then."
    );
    followed(bench, note, &STILL, KEPT, |apart, _| apart)
}

/// Two firm contacts over so many frames, at a distance (mean distances of electrodes) that is a value's when a share of the frames is over.
fn followed(
    bench: &Bench,
    note: String,
    values: &[f64],
    lead: usize,
    apart: impl Fn(f64, f64) -> f64,
) -> Result<Sweep, StudyError> {
    let point = |(index, value): (usize, &f64)| {
        let touches =
            |seed, share: f64| pair(bench, SceneKind::Firm, apart(*value, share), seed).map(Touch::from).to_vec();
        bench.followed(millimetres(bench, *value), index as f64, sound(bench)?, lead, touches)
    };
    let points = bench.some(values).enumerate().map(point).collect::<Result<_, _>>()?;
    Ok(Sweep::new(note, points))
}

/// Mean distances of electrodes, for people.
pub(super) fn millimetres(bench: &Bench, share: f64) -> String {
    format!("{:.1} mm", share * bench.sound.reach_m() * 1e3)
}

fn edge(bench: &Bench) -> Result<Sweep, StudyError> {
    let [width_m, _] = bench.sound.detector.outline.size_m();
    let distance_m = |share: f64| share * bench.sound.reach_m();
    let touches = |share: f64, seed| {
        let contact = bench.contact(SceneKind::Firm, seed);
        vec![Touch::from(Contact { x_m: 0.5 * width_m - distance_m(share), ..contact })]
    };
    touched(bench, "Of the middle of a firm contact.", &FROM_EDGE, |share| millimetres(bench, share), touches)
}

fn pad(bench: &Bench) -> Result<Sweep, StudyError> {
    let pads = &bench.sound.detector.electrodes;
    let touches = |share: f64, seed: u64| {
        let contact = bench.contact(SceneKind::Light, seed);
        let mut random = fastrand::Rng::with_seed(seed);
        let pad = pads[random.usize(..pads.len())];
        // Towards the middle, so that it stays on the detector.
        let to_middle_m = pad.x_m.hypot(pad.y_m).max(f64::MIN_POSITIVE);
        let at = |pad_m: f64| pad_m * (1.0 - share * bench.sound.reach_m() / to_middle_m);
        vec![Touch::from(Contact { x_m: at(pad.x_m), y_m: at(pad.y_m), ..contact })]
    };
    touched(bench, "Of a light contact, smaller than a pad.", &FROM_PAD, |share| millimetres(bench, share), touches)
}

fn width(bench: &Bench) -> Result<Sweep, StudyError> {
    let half_m = bench.sound.detector.outline.size_m().map(|side_m| 0.5 * side_m);
    let touches = |share: f64, seed| {
        let contact = bench.contact(SceneKind::Firm, seed);
        let radius_m = share * bench.sound.reach_m();
        // Wide ones have to stay on the detector.
        let within = |axis: usize, at: f64| {
            at.clamp(radius_m.min(half_m[axis]) - half_m[axis], (half_m[axis] - radius_m).max(0.0))
        };
        vec![Touch::from(Contact { radius_m, x_m: within(0, contact.x_m), y_m: within(1, contact.y_m), ..contact })]
    };
    touched(bench, "Of 0.3 sheet conductances in all.", &RADII, |share| millimetres(bench, share), touches)
}

/// A second press that lowers the signal of the first: nearer to where the current leaves than to where it is measured.
fn lowered(bench: &Bench) -> Result<Sweep, StudyError> {
    let seeds = bench.seeds();
    let ranked = seeds.iter().map(|seed| by_signal(bench, *seed)).collect::<Result<Vec<_>, _>>()?;
    let at = |place: usize, rank: usize| ranked[place][rank * (ranked[place].len() - 1) / (TRIED - 1)];
    let points = bench
        .some(&LOWERED)
        .enumerate()
        .map(|(index, rank)| {
            let place = |seed| seeds.iter().position(|other| *other == seed).unwrap_or(0);
            let touches = |seed| at(place(seed), *rank).1.map(Touch::from).to_vec();
            bench.touched(format!("{:.2}", at(0, *rank).0), index as f64, sound(bench)?, touches)
        })
        .collect::<Result<_, StudyError>>()?;
    let note = "A second press of the same conductance, at places that raise the signal or lower it: root mean square of both presses' \
                readings over that of the first alone, at the first place.";
    Ok(Sweep::new(note, points))
}

/// Pairs of presses, the first always the same, with their signal over that of the first alone: the lowest first.
fn by_signal(bench: &Bench, seed: u64) -> Result<Vec<(f64, [Contact; 2])>, StudyError> {
    let signal = |contacts: &[Contact]| -> Result<f64, StudyError> {
        let readings = readings_v(&bench.sound.problem.model.impedance_ohm(contacts)?, &bench.sound.detector);
        Ok(readings.volts().iter().map(|volts| volts * volts).sum::<f64>().sqrt())
    };
    let first = bench.contact(SceneKind::Firm, seed);
    let alone = signal(&[first])?;
    // Near ones are another sweep's.
    let is_apart = |other: &Contact| {
        geometry::distance([first.x_m, first.y_m], [other.x_m, other.y_m]) > 0.6 * bench.sound.reach_m()
    };
    let mut pairs = (1..)
        .map(|tried| bench.contact(SceneKind::Firm, seed.wrapping_add(tried)))
        .filter(is_apart)
        .take(TRIED)
        .map(|second| Ok((signal(&[first, second])? / alone, [first, second])))
        .collect::<Result<Vec<_>, StudyError>>()?;
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(pairs)
}
