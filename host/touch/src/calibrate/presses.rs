//! From the frames of a rub to a few hundred presses of one contact each, spread over the detector.

use nalgebra::DMatrix;
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::{Readings, Says};

use super::centred::{Agreement, Shown, tells_enough};
use super::{CalibrateError, Frame};
use crate::solve::{faulty_electrodes, rounding_v};

/// Deviations of the noise that the largest reading of a touch has at least.
const TOUCHED: f64 = 20.0;
/// Deviations of the noise, in the root of the mean square, within which frames are the same press.
const STILL: f64 = 1.3;
/// Most frames that are averaged.
const MOST_AVERAGED: usize = 64;
/// Most means that are looked at.
const MOST_MEANS: usize = 6000;
/// Share of the touched frames in which an electrode has to be wrong to be left out.
const FAULTY: f64 = 0.3;
/// Share of the drive above which a reading has risen to it, and of the other electrodes that do so where nothing is grounded: those of them
/// that are not broken too, down to four of sixteen. Where 5 sheet conductances press, a quarter of the sound ones read 0.75 of the drive at most.
const RISEN: f64 = 0.97;
const RISE_TOGETHER: f64 = 0.25;
/// Fewest presses that a detector is fitted to.
pub(super) const FEWEST: usize = 4;
/// Share of the touched frames that has to be of one contact: below, agreement may be chance.
const SINGLE: f64 = 0.3;

/// Mean readings of frames that stood still, and what each says: a bound in one of them is a bound in the mean.
#[derive(Clone, Debug)]
pub(super) struct Mean {
    pub readings: Readings,
    pub frames: usize,
    /// Standard deviation of a reading (V).
    pub noise_v: f64,
    pub known_m: Option<[f64; 2]>,
}

/// What a rub has.
pub(super) struct Chosen {
    /// Electrodes that can be used.
    pub kept: Vec<usize>,
    /// Means of single contacts, through the electrodes that are kept.
    pub singles: Vec<Mean>,
    /// Frames that something touched in.
    pub touched: usize,
    /// Their common centred matrix, of norm one.
    pub centred: DMatrix<f64>,
}

impl Chosen {
    /// Finds them.
    pub fn among(frames: &[Frame], detector: &Detector) -> Result<Self, CalibrateError> {
        let noise_v = detector.adc.deviation_v();
        let touches = |frame: &&Frame| frame.readings.largest_v() > TOUCHED * noise_v && tells_enough(&frame.readings);
        let touched: Vec<_> = frames.iter().filter(touches).collect();
        if touched.is_empty() {
            return Err(CalibrateError::NoPress { frames: frames.len() });
        }
        let kept = kept(&touched, detector);
        if 2 * kept.len() <= detector.electrodes.len() {
            let all = 0..detector.electrodes.len();
            return Err(CalibrateError::Electrodes { faulty: all.filter(|e| !kept.contains(e)).collect() });
        }
        let means = means(&touched, &kept, detector);
        let shown =
            |(index, mean): (usize, &Mean)| Some((index, Shown::of(&mean.readings, detector.drive_v, mean.noise_v)?));
        let shown: Vec<_> = means.iter().enumerate().filter_map(shown).collect();
        let frames_of = |indices: &[usize]| indices.iter().map(|index| means[*index].frames).sum::<usize>();
        let all: Vec<usize> = (0..means.len()).collect();
        let counted = frames_of(&all);
        let not_single = |single: usize| match ungrounded(&touched, detector) {
            broken if broken.is_empty() => CalibrateError::NotSingle { touched: counted, single },
            faulty => CalibrateError::Electrodes { faulty },
        };
        let agreement = Agreement::among(&shown).ok_or_else(|| match shown.is_empty() {
            true => not_single(0),
            false => CalibrateError::Light { touched: counted },
        })?;
        let single = frames_of(&agreement.agree);
        if agreement.agree.len() < FEWEST || (single as f64) < SINGLE * counted as f64 {
            return Err(not_single(single));
        }
        let singles = agreement.agree.iter().map(|index| means[*index].clone()).collect();
        Ok(Self { kept, singles, touched: counted, centred: agreement.mean.matrix })
    }

    /// At most so many of the single contacts, spread over places and firmness; those at known places are all among them.
    /// None of `without`.
    pub fn spread(&self, most: usize, without: &[usize], detector: &Detector) -> Vec<Mean> {
        let features: Vec<_> = self.singles.iter().map(|mean| feature(&mean.readings, detector)).collect();
        let mut chosen: Vec<usize> =
            (0..self.singles.len()).filter(|index| self.singles[*index].known_m.is_some()).collect();
        if chosen.is_empty() {
            chosen.extend((0..self.singles.len()).find(|index| !without.contains(index)));
        }
        let apart = |a: usize, b: usize| (0..3).map(|k| (features[a][k] - features[b][k]).powi(2)).sum::<f64>();
        let mut nearest: Vec<f64> = (0..features.len())
            .map(|index| chosen.iter().map(|other| apart(index, *other)).fold(f64::INFINITY, f64::min))
            .collect();
        without.iter().for_each(|index| nearest[*index] = 0.0);
        while chosen.len() < most.min(features.len()) {
            let farthest = (0..nearest.len()).max_by(|a, b| nearest[*a].total_cmp(&nearest[*b])).unwrap_or(0);
            if nearest[farthest] <= 0.0 {
                break;
            }
            chosen.push(farthest);
            nearest.iter_mut().enumerate().for_each(|(index, least)| *least = least.min(apart(index, farthest)));
        }
        chosen.iter().map(|index| self.singles[*index].clone()).collect()
    }
}

/// About where and how firm a press is: place in shares of the detector, and the logarithm of the largest reading, in which a factor of ten is as
/// much as half of the detector.
fn feature(readings: &Readings, detector: &Detector) -> [f64; 3] {
    let n = readings.electrodes();
    let (mut sum, mut at) = (f64::MIN_POSITIVE, [0.0; 2]);
    for e in 0..n {
        let column = (0..n).map(|g| readings.touch_v(g, e).max(0.0)).sum::<f64>().powi(3);
        sum += column;
        at[0] += column * detector.electrodes[e].x_m;
        at[1] += column * detector.electrodes[e].y_m;
    }
    let size_m = detector.outline.size_m();
    [at[0] / sum / size_m[0], at[1] / sum / size_m[1], 0.2 * readings.largest_v().max(f64::MIN_POSITIVE).ln()]
}

/// Electrodes that are not wrong in many of the frames.
fn kept(touched: &[&Frame], detector: &Detector) -> Vec<usize> {
    let n = detector.electrodes.len();
    let step = touched.len().div_ceil(200);
    let looked: Vec<_> =
        touched.iter().step_by(step).filter_map(|frame| faulty_electrodes(&frame.readings, detector)).collect();
    let wrong = |e: &usize| looked.iter().filter(|faulty| faulty.iter().any(|(other, _)| other == e)).count();
    (0..n).filter(|e| (wrong(e) as f64) <= FAULTY * looked.len().max(1) as f64).collect()
}

/// Electrodes that ground nothing in most of the frames, however many they are: [`faulty_electrodes`] knows a few among many that are sound.
fn ungrounded(touched: &[&Frame], detector: &Detector) -> Vec<usize> {
    let n = detector.electrodes.len();
    let rises = |frame: &Frame, g: usize| {
        let risen = (0..n).filter(|e| *e != g && frame.readings.touch_v(g, *e) > RISEN * detector.drive_v).count();
        risen as f64 >= RISE_TOGETHER * (n - 1) as f64
    };
    (0..n).filter(|g| 2 * touched.iter().filter(|frame| rises(frame, *g)).count() > touched.len()).collect()
}

/// Means of frames that follow each other and stand still, through the electrodes that are kept.
fn means(touched: &[&Frame], kept: &[usize], detector: &Detector) -> Vec<Mean> {
    let [noise_v, rounding_v] = [detector.adc.deviation_v(), rounding_v(&detector.adc)];
    let of_group = |group: &[&Frame]| {
        let count = group.len() as f64;
        let readings = mean_of(group).of(kept);
        let random_v2 = (noise_v * noise_v - rounding_v * rounding_v).max(0.0);
        let noise_v = (rounding_v * rounding_v + random_v2 / count).sqrt();
        Mean { readings, frames: group.len(), noise_v, known_m: group[0].known_m }
    };
    let is_same = |a: &Frame, b: &Frame| {
        a.known_m == b.known_m && root_off_v(&a.readings, &b.readings) < STILL * std::f64::consts::SQRT_2 * noise_v
    };
    let mut groups: Vec<&[&Frame]> = Vec::new();
    let mut from = 0;
    for index in 1..=touched.len() {
        let ends = index == touched.len() || index - from == MOST_AVERAGED || !is_same(touched[from], touched[index]);
        if ends {
            groups.push(&touched[from..index]);
            from = index;
        }
    }
    let step = groups.len().div_ceil(MOST_MEANS);
    let is_taken = |(index, group): &(usize, &&[&Frame])| index % step == 0 || group[0].known_m.is_some();
    groups.iter().enumerate().filter(is_taken).map(|(_, group)| of_group(group)).collect()
}

/// Mean readings (V). A bound stands for what is beyond it, so that the mean of bounds and of voltages is a bound.
fn mean_of(group: &[&Frame]) -> Readings {
    let n = group[0].readings.electrodes();
    let mean_v = |g, e| group.iter().map(|frame| frame.readings.at(g, e)).sum::<f64>() / group.len() as f64;
    let says = |g, e| {
        let all = group.iter().map(|frame| frame.readings.says(g, e));
        all.reduce(Says::of_mean)
    };
    Readings::from_fn(n, mean_v).saying(|g, e| says(g, e).unwrap_or_default())
}

/// Root of the mean square of what the readings of two frames differ by (V), of those that are voltages in either.
fn root_off_v(a: &Readings, b: &Readings) -> f64 {
    let n = a.electrodes();
    let is_voltage = |index: &usize| [a, b].iter().any(|one| one.says(index / n, index % n) == Says::Voltage);
    let (sum_v2, count) = (0..n * n)
        .filter(is_voltage)
        .fold((0.0, 0), |(sum_v2, count), index| (sum_v2 + (a.volts()[index] - b.volts()[index]).powi(2), count + 1));
    (sum_v2 / f64::from(count.max(1))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_in_one_frame_is_a_bound_in_the_mean() {
        use Says::{AtLeast, AtMost, Nothing, Voltage};
        let of = |says: [Says; 4], volts: [f64; 4]| Frame {
            readings: Readings::from_fn(2, |g, e| volts[2 * g + e]).saying(|g, e| says[2 * g + e]),
            known_m: None,
        };
        let frames = [
            of([Voltage, AtMost, Voltage, AtLeast], [0.5, 0.25, 1.0, 3.0]),
            of([Voltage, Voltage, AtLeast, AtMost], [0.75, 0.5, 3.0, 0.25]),
        ];
        let mean = mean_of(&frames.iter().collect::<Vec<_>>());
        assert_eq!(mean.all_say(), [Voltage, AtMost, AtLeast, Nothing]);
        assert_eq!(mean.volts()[..3], [0.625, 0.375, 2.0]);
        // Two of a kind are not compared.
        let [a, b] = [0.0, 1.0].map(|volts| of([Voltage, AtMost, AtMost, AtMost], [0.5 + volts, 0.25, 0.25, 0.25]));
        assert_eq!(root_off_v(&a.readings, &b.readings), 1.0);
    }
}
