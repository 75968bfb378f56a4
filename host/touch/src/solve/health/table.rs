//! Whether frames can be readings of a detector at all, by themselves: which way round their rows are, and which drive they tell.
//!
//! Two laws hold for whatever presses. `Z` is symmetric, so the logarithms of pairs of readings are differences of loads: with another drive
//! voltage, which is another unit, they are not. And no current leaves a detector through a contact while all electrodes are held at one
//! potential above the driving layer, so the sums of the rows of the inverse of `Z` are not negative: with rows and columns exchanged, some are.

use nalgebra::{DMatrix, DVector};

use super::electrodes::{TOUCHED, WRONG, disagreement, faulty_electrodes, loads, pairs};
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;

/// Frames that are looked at, the firmest.
const FRAMES: usize = 32;
/// Rows are exchanged if the squares of what is negative, in deviations of the noise, are this many times those the other way round, of which each
/// electrode has one by noise. Of 96 presses on four detectors as built, from 0.01 to 4 sheet conductances, 95 are told so, and none that is right.
const EXCHANGED: f64 = 2.0;
/// Drives are tried from an eighth to eight times the detector's, in steps of this share: the best is known to a hundredth at 0.4 sheet conductances.
const STEP: f64 = 0.05;
/// The drive is another one if that is likelier by so many nats, ...
const NATS: f64 = 30.0;
/// ... leaves at most this share of the mean square, ...
const LEFT: f64 = 0.5;
/// ... and is off by more than this share: supplies are off by 5 %, and converters by less.
const OFF: f64 = 0.25;
/// Largest reading, as a share of the drive, at which all pairs still count.
const LARGEST: f64 = 0.9;

/// What is wrong with a table as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TableDoubt {
    /// Rows and columns are exchanged.
    Exchanged,
    /// The readings are those of a detector that is driven with another voltage.
    Drive {
        /// That voltage (V), in the unit of the readings.
        fits_v: f64,
    },
}

/// What is wrong with frames, less the baseline, of one detector as measured, if their readings show it.
pub fn table_doubt<'a>(frames: impl IntoIterator<Item = &'a Readings>, detector: &Detector) -> Option<TableDoubt> {
    let [drive_v, noise_v] = [detector.drive_v, detector.adc.deviation_v()];
    let is_sound = |frame: &&Readings| faulty_electrodes(frame, detector).is_some_and(|faulty| faulty.is_empty());
    let is_firm = |frame: &&Readings| frame.all_say().is_empty() && frame.largest_v() > TOUCHED * noise_v;
    let mut firm: Vec<&Readings> = frames.into_iter().filter(is_firm).collect();
    firm.sort_by(|a, b| b.largest_v().total_cmp(&a.largest_v()));
    let firm: Vec<&Readings> = firm.into_iter().filter(is_sound).take(FRAMES).collect();
    other_drive(&firm, drive_v, noise_v).or_else(|| {
        // What contradicts itself either way shows nothing.
        let counted: Vec<_> = firm.into_iter().filter(|frame| disagrees(frame, drive_v, noise_v) < WRONG).collect();
        is_exchanged(&counted, drive_v, noise_v).then_some(TableDoubt::Exchanged)
    })
}

fn disagrees(frame: &Readings, drive_v: f64, noise_v: f64) -> f64 {
    let all: Vec<usize> = (0..frame.electrodes()).collect();
    disagreement(frame, &all, drive_v, noise_v)
}

/// Another drive, if the readings agree with each other by that alone.
fn other_drive(frames: &[&Readings], drive_v: f64, noise_v: f64) -> Option<TableDoubt> {
    let left = |drive_v: f64| frames.iter().map(|frame| disagrees(frame, drive_v, noise_v)).sum::<f64>();
    let least_v = (frames.first()?.largest_v() / LARGEST).max(drive_v / 8.0);
    let steps = ((8.0 * drive_v / least_v).ln() / STEP) as u32;
    let tried = (0..=steps).map(|step| least_v * (STEP * f64::from(step)).exp()).map(|volts| (left(volts), volts));
    let (least, fits_v) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let numbers: usize = frames.iter().map(|frame| (frame.electrodes() - 1) * (frame.electrodes() - 2) / 2).sum();
    let given = left(drive_v);
    let nats = 0.5 * numbers as f64 * (given / least).ln();
    let is_other = nats > NATS && least < LEFT * given && (fits_v / drive_v).ln().abs() > OFF.ln_1p();
    is_other.then_some(TableDoubt::Drive { fits_v })
}

/// Whether columns are grounded and rows are read.
fn is_exchanged(frames: &[&Readings], drive_v: f64, noise_v: f64) -> bool {
    let of_all =
        |turned: bool| frames.iter().filter_map(|frame| negative(frame, turned, drive_v, noise_v)).sum::<f64>();
    let by_noise: usize = frames.iter().map(|frame| frame.electrodes()).sum();
    of_all(false) > EXCHANGED * (of_all(true) + by_noise as f64)
}

/// Squares of the sums of rows of the inverse of `Z` that are negative, in deviations of the noise; of readings with rows and columns exchanged if
/// they are to be `turned`.
fn negative(frame: &Readings, turned: bool, drive_v: f64, noise_v: f64) -> Option<f64> {
    let n = frame.electrodes();
    let at = |g: usize, e: usize| if turned { frame.at(e, g) } else { frame.at(g, e) };
    let right = Readings::from_fn(n, at);
    let all: Vec<usize> = (0..n).collect();
    let loads = loads(&pairs(&right, &all, drive_v, noise_v), n);
    // `r = Z / D` row by row, so `1 / Z` times ones is `1 / r` times one over the loads.
    let ratios = DMatrix::from_fn(n, n, |g, e| 1.0 - right.at(g, e) / drive_v);
    let inverse = ratios.try_inverse()?;
    let sums = &inverse * DVector::from_fn(n, |g, _| (-loads[g]).exp());
    let size = sums.norm();
    let deviation = |e: usize| noise_v / drive_v * inverse.row(e).norm() * size;
    Some(sums.iter().enumerate().map(|(e, sum)| (sum.min(0.0) / deviation(e)).powi(2)).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::forward::{ForwardModel, Resolution, Slab};
    use tactomo_physics::scene::Contact;
    use tactomo_physics::simulate::{Measurement, drawn};

    /// Presses of a finger or two from `lightest_s` on, on the default detector as built.
    fn presses(seed: u64, lightest_s: f64) -> Vec<Readings> {
        let built = drawn(&Detector::default(), seed);
        let model = Slab::with_resolution(&built, Resolution::FINE).unwrap();
        let mut measurement = Measurement::new(&built, &[], seed).unwrap();
        let press = |i: u32| {
            let conductance_s = lightest_s * f64::from(i).exp();
            let [x_m, y_m] = [(0.012, -0.008), (-0.02, 0.015), (0.02, 0.019)][i as usize % 3].into();
            let fingers =
                [Contact::flat(x_m, y_m, 0.004, conductance_s), Contact::flat(-x_m, 0.0, 0.004, conductance_s)];
            let impedance_ohm = model.impedance_ohm(&fingers[..1 + i as usize % 2]).unwrap();
            measurement.readings_v(Some(&impedance_ohm))
        };
        (0..4).map(press).collect()
    }

    #[test]
    fn rows_and_columns_are_told_apart_by_light_and_by_firm_presses() {
        for seed in 0..6 {
            for press in presses(seed, 4e-5) {
                let detector = Detector::default();
                let turned = Readings::from_fn(16, |g, e| press.at(e, g));
                assert_eq!(table_doubt([&press], &detector), None, "{seed}: {}", press.largest_v());
                let doubt = table_doubt([&turned], &detector);
                assert_eq!(doubt, Some(TableDoubt::Exchanged), "{seed}: {}", press.largest_v());
            }
        }
    }

    #[test]
    fn firm_presses_tell_the_drive_that_their_unit_is_of() {
        for seed in 0..4 {
            let presses = presses(seed, 6e-4);
            for share in [5.0 / 1024.0 * 1e-3_f64.recip(), 2.0, 0.5] {
                let scaled: Vec<Readings> =
                    presses.iter().map(|press| Readings::from_fn(16, |g, e| press.at(g, e) / share)).collect();
                let Some(TableDoubt::Drive { fits_v }) = table_doubt(&scaled, &Detector::default()) else {
                    panic!("{seed}, {share}: no doubt")
                };
                assert!((fits_v * share / 2.0).ln().abs() < 0.1, "{seed}: {fits_v} {share}");
            }
        }
    }
}
