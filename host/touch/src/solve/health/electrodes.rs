//! Electrodes that cannot be right, by the readings alone.
//!
//! While `g` is grounded, `r[g][e] = 1 - V[g][e] / Vcc = Z[e][g] / D[g]` with one load `D[g]` for all `e`, and `Z` is symmetric.
//! So the logarithms of `r[g][e] / r[e][g]` are differences of those of the loads: of 120 numbers 105 are a check that needs
//! no model and no knowledge of what presses. A gain, a sign, an input that floats: each breaks the 15 numbers of its electrode.
//! Two things do not break them and are seen otherwise: a broken wire lets everything rise to the drive when it should be
//! grounded, and two wires that touch read the same.

use nalgebra::{Matrix2, Vector2};

use crate::solve::answer::ElectrodeFault;
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::{Readings, Says};

/// Smallest `1 - V / Vcc` that a logarithm is taken of: noise of 1.5 LSB is 3 % of it.
const SMALLEST: f64 = 0.02;
/// Sweeps for the loads: a test holds them against healthy boards under firm presses.
const SWEEPS: usize = 8;
/// Readings have to be this many deviations of the noise large before they say anything of a short or a broken wire.
pub(crate) const TOUCHED: f64 = 40.0;
/// Share of the drive that everything reaches when a broken wire is to be grounded.
const UNGROUNDED: f64 = 0.97;
/// Standard deviations within which two electrodes read the same: of the difference of two readings, which is the noise of both, and of what
/// parts their converters. Of 16 rows, noise alone takes one this far in one frame of 3000.
const SAME: f64 = 4.25;
/// An electrode is wrong if the mean square of its numbers, in what noise makes of them, is above this ...
pub(super) const WRONG: f64 = 8.0;
/// ... and without it that of the others is at most this share of it.
const ALONE: f64 = 0.2;
/// Error of the numbers besides noise: of a converter that is not quite even.
const UNEVEN: f64 = 0.004;

/// Electrodes that are wrong in a frame (V) of a detector, as measured, each with what is wrong. `None` where readings are too small to show
/// anything.
pub fn faulty_electrodes(readings: &Readings, detector: &Detector) -> Option<Vec<(usize, ElectrodeFault)>> {
    let [drive_v, noise_v] = [detector.drive_v, detector.adc.deviation_v()];
    let n = readings.electrodes();
    if readings.largest_v() < TOUCHED * noise_v {
        return None;
    }
    let open: Vec<_> = (0..n).filter(|g| is_open(readings, *g, drive_v)).collect();
    // Where everything is at the drive's potential, nothing is grounded: that is no electrode's fault alone.
    if 2 * open.len() > n {
        return None;
    }
    let sound: Vec<_> = (0..n).filter(|e| !open.contains(e)).collect();
    let shorted = shorted(readings, &sound, detector);
    let sound: Vec<_> = sound.into_iter().filter(|e| !shorted.contains(e)).collect();
    let contradicting = contradicting(readings, sound, drive_v, noise_v);
    let all = [
        (open, ElectrodeFault::Open),
        (shorted, ElectrodeFault::Shorted),
        (contradicting, ElectrodeFault::Contradicting),
    ];
    let mut all: Vec<_> = all.into_iter().flat_map(|(list, fault)| list.into_iter().map(move |e| (e, fault))).collect();
    all.sort_unstable();
    Some(all)
}

/// Whether most others rise to the drive when `g` is to be grounded.
fn is_open(readings: &Readings, g: usize, drive_v: f64) -> bool {
    let n = readings.electrodes();
    let risen = (0..n).filter(|e| *e != g && readings.touch_v(g, *e) > UNGROUNDED * drive_v).count();
    4 * risen > 3 * (n - 1)
}

/// Electrodes that read what another reads, whatever is grounded, though the others differ.
fn shorted(readings: &Readings, sound: &[usize], detector: &Detector) -> Vec<usize> {
    let noise_v = detector.adc.deviation_v();
    let same_v = SAME * std::f64::consts::SQRT_2 * noise_v;
    // Two that are below the converter's floor read the same whatever they are.
    let is_read = |e: usize, f: usize| {
        let both = |g: &&usize| [e, f].iter().all(|e| readings.says(**g, *e) == Says::Voltage);
        2 * sound.iter().filter(both).count() > sound.len()
    };
    let mut found = Vec::new();
    for (i, e) in sound.iter().enumerate() {
        for f in &sound[..i] {
            // With one of them grounded the other is too, which no two pads apart ever are.
            let grounded_v = readings.touch_v(*e, *f).max(readings.touch_v(*f, *e));
            // Both rise while others are grounded: where nothing touches all read the same, but for a wire that floats.
            let risen_v = sound.iter().map(|g| readings.touch_v(*g, *e)).fold(0.0, f64::max);
            let row_v = sound.iter().map(|other| readings.touch_v(*e, *other)).fold(0.0, f64::max);
            let is_touched = row_v.min(risen_v) > TOUCHED * noise_v && is_read(*e, *f);
            if is_touched && grounded_v < same_v && read_the_same(readings, [*e, *f], sound, detector) {
                found.extend([*e, *f]);
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

/// Whether two electrodes read the same while any of some is grounded, but for noise and for what their converters' gains and bows differ by.
///
/// Between two converters `d[g] = V[g][e] - V[g][f]` is `a u[g] + b w[g]` and noise, where `u` and `w` are what one standard deviation of
/// the difference of their gains and of their bows makes of such voltages, and `a` and `b` are some deviations, the same in all rows. The
/// likeliest `a` and `b` have to be [`SAME`] at most, and so has what they leave of each `d`: to allow each row by itself as much would call
/// healthy neighbours the same. On one converter `u` and `w` are zero.
fn read_the_same(readings: &Readings, [e, f]: [usize; 2], grounds: &[usize], detector: &Detector) -> bool {
    let deviation_v = std::f64::consts::SQRT_2 * detector.adc.deviation_v();
    let row = |g: &usize| {
        // Below a floor zero stands for both: to compare bounds would call pads alike that are both near the floor under a light press.
        let off = (readings.touch_v(*g, e) - readings.touch_v(*g, f)) / deviation_v;
        (off, Vector2::from(converters_apart_v(readings, *g, [e, f], detector)) / deviation_v)
    };
    let rows: Vec<_> = grounds.iter().map(row).collect();
    let normal = rows.iter().fold(Matrix2::identity(), |sum, (_, made)| sum + made * made.transpose());
    let moments = rows.iter().fold(Vector2::zeros(), |sum: Vector2<f64>, (off, made)| sum + made * *off);
    // An identity and squares: never singular, but where a reading is no number.
    let Some(errors) = normal.try_inverse().map(|inverse| inverse * moments) else { return false };
    errors.amax() < SAME && rows.iter().all(|(off, made)| (off - made.dot(&errors)).abs() < SAME)
}

/// Standard deviation of what the gains, and the bows, of two electrodes' converters part their readings by (V); none where they share one or
/// where a reading is a bound.
fn converters_apart_v(readings: &Readings, g: usize, pads: [usize; 2], detector: &Detector) -> [f64; 2] {
    let on = pads.map(|pad| detector.electrodes.get(pad).map(|pad| pad.converter));
    if on[0] == on[1] || pads.iter().any(|pad| readings.says(g, *pad) != Says::Voltage) {
        return [0.0; 2];
    }
    let changes_v = |place: usize| {
        let converter = on[place].and_then(|index| detector.converters.get(index));
        converter.map_or([0.0; 2], |converter| converter.changes_v(readings.at(g, pads[place])))
    };
    let [one, other] = [changes_v(0), changes_v(1)];
    [one[0].hypot(other[0]), one[1].hypot(other[1])]
}

/// Electrodes without which the others agree: the worst first, as long as leaving it out helps.
fn contradicting(readings: &Readings, mut sound: Vec<usize>, drive_v: f64, noise_v: f64) -> Vec<usize> {
    let mut found = Vec::new();
    while sound.len() > 4 && 4 * found.len() < readings.electrodes() {
        let before = disagreement(readings, &sound, drive_v, noise_v);
        if before < WRONG {
            return found;
        }
        let without = |e: usize| sound.iter().copied().filter(|other| *other != e).collect::<Vec<_>>();
        let scored = sound.iter().map(|e| (*e, disagreement(readings, &without(*e), drive_v, noise_v)));
        let Some((worst, after)) = scored.min_by(|a, b| a.1.total_cmp(&b.1)) else { return found };
        found.push(worst);
        sound = without(worst);
        if after < WRONG {
            return if after < ALONE * before { found } else { Vec::new() };
        }
    }
    // Nearly all contradict each other: that is no single electrode's fault.
    Vec::new()
}

/// Logarithms of two electrodes' ratios, and how much they count.
#[derive(Clone, Copy, Default)]
pub(crate) struct Pair {
    pub log: f64,
    /// One over the square of its deviation; zero where a reading at the drive makes it say nothing.
    pub weight: f64,
}

/// What the readings of all pairs of some electrodes say, row by row.
pub(super) fn pairs(readings: &Readings, electrodes: &[usize], drive_v: f64, noise_v: f64) -> Vec<Pair> {
    let n = electrodes.len();
    let mut pairs = vec![Pair::default(); n * n];
    for i in 0..n {
        for j in 0..i {
            let pair = pair(readings, electrodes[i], electrodes[j], drive_v, noise_v);
            pairs[i * n + j] = pair;
            pairs[j * n + i] = Pair { log: -pair.log, ..pair };
        }
    }
    pairs
}

/// Mean square of what the logarithms are off, in what noise makes of them.
pub(super) fn disagreement(readings: &Readings, electrodes: &[usize], drive_v: f64, noise_v: f64) -> f64 {
    let n = electrodes.len();
    let pairs = pairs(readings, electrodes, drive_v, noise_v);
    let loads = loads(&pairs, n);
    let (mut sum, mut counted) = (0.0, 0_usize);
    for i in 0..n {
        for j in 0..i {
            let pair = pairs[i * n + j];
            sum += pair.weight * (pair.log - (loads[j] - loads[i])).powi(2);
            counted += usize::from(pair.weight > 0.0);
        }
    }
    sum / counted.saturating_sub(n - 1).max(1) as f64
}

/// What the readings of two electrodes say.
fn pair(readings: &Readings, g: usize, e: usize, drive_v: f64, noise_v: f64) -> Pair {
    if [readings.says(g, e), readings.says(e, g)] != [Says::Voltage; 2] {
        return Pair::default();
    }
    let ratios = [readings.at(g, e), readings.at(e, g)].map(|volts| 1.0 - volts / drive_v);
    // A pad all but at the drive's potential says only that something conducts well; one above it cannot be.
    if ratios.iter().any(|ratio| ratio.abs() < SMALLEST) {
        return Pair::default();
    }
    let [there, back] = ratios.map(|ratio| ratio.max(SMALLEST));
    let log = (there / back).ln();
    let noise = noise_v / drive_v * there.recip().hypot(back.recip());
    Pair { log, weight: noise.hypot(UNEVEN * log.abs()).powi(-2) }
}

/// Logarithm of each electrode's load but for a common constant: where all pairs count, means are the least squares; else some sweeps of
/// means over those that do are near enough.
pub(crate) fn loads(pairs: &[Pair], n: usize) -> Vec<f64> {
    let row = |i: usize| &pairs[i * n..(i + 1) * n];
    let mut loads: Vec<_> = (0..n).map(|i| -row(i).iter().map(|pair| pair.log).sum::<f64>() / n as f64).collect();
    // Those on the diagonal never count.
    if pairs.iter().filter(|pair| pair.weight == 0.0).count() == n {
        return loads;
    }
    for _ in 0..SWEEPS {
        for i in 0..n {
            let counted = row(i).iter().zip(&loads).filter(|(pair, _)| pair.weight > 0.0);
            let (sum, count) =
                counted.fold((0.0, 0.0), |(sum, count), (pair, load)| (sum + load - pair.log, count + 1.0));
            if count > 0.0 {
                loads[i] = sum / count;
            }
        }
    }
    loads
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::{Adc, ConverterErrors};
    use tactomo_physics::forward::{ForwardModel, Resolution, Slab};
    use tactomo_physics::readings::Range;
    use tactomo_physics::scene::Contact;
    use tactomo_physics::simulate::{Measurement, Noise, drawn};

    /// The default detector with a converter of such noise (V).
    fn measured(noise_v: f64) -> Detector {
        let mut detector = Detector { drive_v: 1.2, ..Detector::default().taken_as_exact() };
        detector.adc.noise_lsb = noise_v / detector.adc.lsb_v();
        detector
    }

    #[test]
    fn where_nothing_touches_a_wire_that_floats_makes_no_shorts_of_the_others() {
        let noise_v = 1e-3;
        let rest = |g: usize, e: usize| noise_v * ((7 * g + 3 * e) % 5) as f64;
        let floating = Readings::from_fn(16, |g, e| if e == 3 { 0.4 + 0.02 * g as f64 } else { rest(g, e) });
        let found = faulty_electrodes(&floating, &measured(noise_v)).unwrap();
        assert!(found.iter().all(|(e, _)| *e == 3), "{found:?}");
    }

    #[test]
    fn two_wires_that_touch_are_found() {
        let rises = |g: usize, e: usize| if g == e { 0.0 } else { 0.3 + 0.02 * e as f64 };
        let joined = |e: usize| if e == 6 { 5 } else { e };
        let shorted = Readings::from_fn(16, |g, e| rises(joined(g), joined(e)));
        let found = faulty_electrodes(&shorted, &measured(1e-3)).unwrap();
        assert_eq!(found, [(5, ElectrodeFault::Shorted), (6, ElectrodeFault::Shorted)]);
    }

    /// A detector on the two converters of an ESP32, whose errors are those of its data sheet: electrodes 0 to 5 are on one, 6 to 15 on the other.
    fn on_two_converters(mut detector: Detector) -> Detector {
        detector.adc = Adc { bits: 12, full_scale_v: 4.096, noise_lsb: 5.0 };
        let converter = |floor_v: f64| ConverterErrors { gain_share: 0.01, bow_v: 0.012, range_v: [floor_v, 3.1] };
        detector.converters = [0.142, 0.128].map(converter).into();
        detector.electrodes.iter_mut().skip(6).for_each(|pad| pad.converter = 1);
        detector
    }

    /// What a chip of its own makes of readings (V).
    fn read_by_a_chip(pads_v: &Readings, detector: &Detector, seed: u64) -> Readings {
        let mut noise = Noise::new(seed);
        let errors: Vec<_> = detector.converters.iter().map(|_| [noise.normal(), noise.normal()]).collect();
        let deviation_v = detector.adc.deviation_v();
        let readings = Readings::from_fn(pads_v.electrodes(), |g, e| {
            let index = detector.electrodes[e].converter;
            let [gain_v, bow_v] = detector.converters[index].changes_v(pads_v.at(g, e));
            let [gain, bow] = errors[index];
            pads_v.at(g, e) + gain * gain_v + bow * bow_v + deviation_v * noise.normal()
        });
        let range = |pad: usize| {
            let [floor_v, ceiling_v] = detector.converters[detector.electrodes[pad].converter].range_v;
            Range { floor_v: floor_v + 2.0 * deviation_v, ceiling_v: ceiling_v - 2.0 * deviation_v }
        };
        let ranges: Vec<_> = (0..pads_v.electrodes()).map(range).collect();
        readings.within(&ranges)
    }

    /// Presses of one finger to three, each read by a chip of its own.
    fn presses(built: Detector, fault: Option<&str>, count: u64, seed: u64) -> Vec<Vec<(usize, ElectrodeFault)>> {
        let detector = on_two_converters(built);
        let fine = Slab::with_resolution(&detector, Resolution::FINE).unwrap();
        let faults: Vec<_> = fault.map(|fault| fault.parse().unwrap()).into_iter().collect();
        let mut wires = Measurement::new(&detector, &faults, 1).unwrap();
        let mut random = fastrand::Rng::with_seed(seed);
        let mut finger = || {
            let [x_m, y_m] = [0, 1].map(|_| 0.05 * (random.f64() - 0.5));
            Contact::flat(x_m, y_m, 0.002 + 0.002 * random.f64(), 1e-4 * 30f64.powf(random.f64()))
        };
        let mut found = Vec::new();
        while (found.len() as u64) < count {
            let fingers: Vec<_> = (0..=found.len() % 3).map(|_| finger()).collect();
            // Discs that overlap are no contacts of the model.
            let Ok(impedance_ohm) = fine.impedance_ohm(&fingers) else { continue };
            let pads_v = wires.pad_voltages(Some(&impedance_ohm));
            let readings = read_by_a_chip(&pads_v, &detector, 1000 * seed + found.len() as u64);
            found.push(faulty_electrodes(&readings, &detector).unwrap_or_default());
        }
        found
    }

    #[test]
    fn wires_of_two_converters_that_touch_are_found_whatever_the_chip() {
        for (seed, [a, b]) in (1..).zip([[5, 6], [0, 15], [2, 9], [4, 7], [1, 12], [3, 6]]) {
            let found = presses(Detector::default().taken_as_exact(), Some(&format!("short:{a},{b}")), 60, seed);
            let found_pair =
                found.iter().filter(|found| **found == [a, b].map(|e| (e, ElectrodeFault::Shorted))).count();
            // The others are too light to say anything.
            assert!(found_pair >= 50, "{a},{b}: {found_pair} of {}", found.len());
            let others = found.iter().filter(|found| !found.is_empty()).count() - found_pair;
            assert_eq!(others, 0, "{a},{b}: {found:?}");
        }
    }

    #[test]
    fn healthy_wires_of_two_converters_never_touch() {
        for seed in 0..40 {
            for found in presses(drawn(&Detector::default(), seed), None, 60, 100 + seed) {
                let shorted = found.iter().any(|(_, fault)| *fault == ElectrodeFault::Shorted);
                assert!(!shorted, "seed {seed}: {found:?}");
            }
        }
    }
}
