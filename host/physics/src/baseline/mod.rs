//! What a detector reads while nothing touches it: offsets of its converter and leakage, and how they are taken off.
//!
//! At rest a converter cuts off what noise and offset are below zero, under load it does not. [`Baseline`] therefore knows two numbers of each
//! reading, its mean at rest and the offset behind it. Leakage is a conductance in parallel to every contact, of which [`Leakage`] takes off
//! what is left when its voltages at rest are. [`BaselinePatterns`] tells offsets, leakage and contacts apart.

mod clipping;
mod leakage;
mod patterns;

pub use self::clipping::Clipping;
pub use self::leakage::Leakage;
pub use self::patterns::{BaselineChange, BaselinePatterns};
use crate::detector::Adc;
use crate::forward::jacobian::Jacobian;

/// Readings at which noise is no longer cut off (standard deviations of a conversion's noise): at two, 0.4 % of one is.
const KNEE: f64 = 2.0;
/// Mean readings from here on are the offset itself.
const CLEAR: f64 = 1.75;

/// Variance of a channel, in that of one of the noisier quarter, from which it floats. The same noise is a tenth as large where half of it
/// and more is cut off; a broken wire's is ten thousand times larger.
const FLOATING: f64 = 30.0;

/// Sum of frames that nothing touches in.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BaselineSum {
    sum_v: Vec<f64>,
    /// Squares of readings (V2), each as often as its frames.
    squares_v2: Vec<f64>,
    frames: u32,
    /// How many means were added.
    means: u32,
    /// The lowest reading in them (V).
    lowest_v: f64,
}

/// The baseline: what a detector reads at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Baseline {
    lsb_v: f64,
    /// The converter's zero (V): where the ground is lifted, below that of the readings.
    zero_v: f64,
    clipping: Clipping,
    mean_v: Vec<f64>,
    offset_v: Vec<f64>,
}

impl BaselineSum {
    /// Means that are needed to see how much noise there is.
    const FEWEST: u32 = 8;

    /// Adds the mean readings of some frames (V).
    pub fn add(&mut self, readings_v: &[f64], frames: u32) {
        self.sum_v.resize(readings_v.len(), 0.0);
        self.squares_v2.resize(readings_v.len(), 0.0);
        let weight = f64::from(frames);
        for ((sum, square), volts) in self.sum_v.iter_mut().zip(&mut self.squares_v2).zip(readings_v) {
            *sum += weight * volts;
            *square += weight * volts * volts;
        }
        self.frames += frames;
        self.means += 1;
        self.lowest_v = readings_v.iter().copied().fold(self.lowest_v, f64::min);
    }

    /// Frames in it.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Their mean (V); nothing of none.
    pub fn mean_v(&self) -> Vec<f64> {
        self.sum_v.iter().map(|sum| sum / f64::from(self.frames.max(1))).collect()
    }

    /// The baseline of a converter whose readings are means of so many conversions each, above a ground of `ground_v` above its zero (V). How much
    /// noise there is, the frames tell; of
    /// few means it is what the converter's description says.
    pub fn baseline(&self, adc: &Adc, ground_v: f64, conversions: u32) -> Baseline {
        let (mean_v, lsb_v) = (self.mean_v(), adc.lsb_v());
        // Noise that is cut off shows in some of the readings. Where it shows in none they are below the converter's floor, and nothing is known of them.
        let is_hidden = ground_v == 0.0 && self.squares_v2.iter().all(|square_v2| *square_v2 == 0.0);
        // Where there are readings below the converter's zero, no converter has cut them off: something was taken off them already.
        let is_whole = self.lowest_v < -ground_v - lsb_v;
        let clipping = match self.noise_of(&mean_v) {
            _ if is_hidden || is_whole => Clipping::new(0.0),
            None => Clipping::new(adc.noise_lsb),
            Some((means_v, variance_v2)) => {
                let means: Vec<f64> = means_v.iter().map(|volts| (volts + ground_v) / lsb_v).collect();
                Clipping::of_variance(&means, variance_v2 * f64::from(conversions) / (lsb_v * lsb_v))
            }
        };
        let mut baseline = Baseline { lsb_v, zero_v: -ground_v, clipping, mean_v: Vec::new(), offset_v: Vec::new() };
        baseline.set(mean_v, f64::from(self.frames) * f64::from(conversions));
        baseline
    }

    /// Means of the readings that show the converter's noise (V) and the mean variance of one of a frame (V2), if there are enough to tell.
    /// A channel that floats, since its wire is broken, shows other noise.
    fn noise_of(&self, mean_v: &[f64]) -> Option<(Vec<f64>, f64)> {
        if self.means < Self::FEWEST || mean_v.is_empty() {
            return None;
        }
        let frames = f64::from(self.frames);
        let of = |(square, mean): (&f64, &f64)| (square - frames * mean * mean).max(0.0) / f64::from(self.means - 1);
        let variances_v2: Vec<f64> = self.squares_v2.iter().zip(mean_v).map(of).collect();
        let channels = mean_v.len().isqrt().max(1);
        let of_channel = |e: usize| variances_v2.iter().skip(e).step_by(channels).sum::<f64>();
        let mut sorted: Vec<f64> = (0..channels).map(of_channel).collect();
        sorted.sort_by(f64::total_cmp);
        let most_v2 = FLOATING * sorted[channels * 3 / 4];
        let kept: Vec<usize> = (0..mean_v.len()).filter(|index| of_channel(index % channels) <= most_v2).collect();
        let variance_v2 = kept.iter().map(|index| variances_v2[*index]).sum::<f64>() / kept.len().max(1) as f64;
        Some((kept.iter().map(|index| mean_v[*index]).collect(), variance_v2))
    }
}

impl Baseline {
    /// Readings that are all zero at rest, of a converter whose noise nothing is known of.
    pub fn zero(readings: usize) -> Self {
        let zeros = || vec![0.0; readings];
        Self { lsb_v: 1.0, zero_v: 0.0, clipping: Clipping::new(0.0), mean_v: zeros(), offset_v: zeros() }
    }

    /// Takes other mean readings (V), of so many conversions each, with the noise as it was.
    pub fn set(&mut self, mean_v: Vec<f64>, conversions: f64) {
        let clear_v = self.zero_v + CLEAR * self.clipping.deviation() * self.lsb_v;
        let offset_v = |mean_v: &f64| match *mean_v < clear_v {
            true => self.zero_v + self.lsb_v * self.clipping.level((mean_v - self.zero_v) / self.lsb_v, conversions),
            false => *mean_v,
        };
        self.offset_v = mean_v.iter().map(offset_v).collect();
        self.mean_v = mean_v;
    }

    /// Mean readings at rest (V).
    pub fn mean_v(&self) -> &[f64] {
        &self.mean_v
    }

    /// What is in readings that are too large for their noise to be cut off (V).
    pub fn offset_v(&self) -> &[f64] {
        &self.offset_v
    }

    /// Puts `readings_v` less what they are at rest into `touch_v` (V).
    ///
    /// At rest that is the mean, and from two standard deviations on the offset. Between them it goes from one to the other on a straight
    /// line, so that the mean of frames has the same taken off as the frames have in the mean.
    pub fn subtract(&self, readings_v: &[f64], touch_v: &mut [f64]) {
        let knee_v = self.zero_v + KNEE * self.clipping.deviation() * self.lsb_v;
        let rest = self.mean_v.iter().zip(&self.offset_v);
        for ((touch, volts), (mean, offset)) in touch_v.iter_mut().zip(readings_v).zip(rest) {
            let cut_v = mean - offset;
            let share = if cut_v > 0.0 { ((knee_v - volts) / (knee_v - mean)).max(0.0) } else { 0.0 };
            *touch = volts - offset - share * cut_v;
        }
    }
}

/// Means of the bare detector's fields over its surface (ohm), an electrode each: those of a current that is spread over it.
fn mean_fields_ohm(jacobian: &Jacobian) -> Vec<f64> {
    let areas_m2 = &jacobian.image_mesh.node_areas_m2;
    let area_m2: f64 = areas_m2.iter().sum();
    let columns = jacobian.fields_ohm.column_iter();
    columns.map(|fields| fields.iter().zip(areas_m2).map(|(ohm, m2)| ohm * m2).sum::<f64>() / area_m2).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::readings::Readings;
    use crate::simulate::{Noise, measured};

    /// Means that are off by so many codes at rest, after `frames` frames, with what is then taken off under a load (V).
    fn errors_lsb(offset_lsb: f64, load_lsb: f64, frames: u32, average: bool) -> f64 {
        let adc = Adc { bits: 12, full_scale_v: 4.096, noise_lsb: 1.5 };
        let mut noise = Noise::new(5);
        let at = |level_lsb: f64| Readings::from_fn(16, |_, _| level_lsb * 1e-3);
        let mut sum = BaselineSum::default();
        (0..frames).for_each(|_| sum.add(measured(&at(offset_lsb), &adc, &mut noise).volts(), 1));
        // What the description says of the noise is not needed.
        let rest = sum.baseline(&Adc { noise_lsb: 9.0, ..adc }, 0.0, 1);
        let (mut touch_v, mut all, loaded) = (vec![0.0; 256], vec![0.0; 256], at(offset_lsb + load_lsb));
        for _ in 0..400 {
            let frame = measured(&loaded, &adc, &mut noise);
            if average {
                all.iter_mut().zip(frame.volts()).for_each(|(sum, volts)| *sum += volts / 400.0);
            } else {
                rest.subtract(frame.volts(), &mut touch_v);
                all.iter_mut().zip(&touch_v).for_each(|(sum, volts)| *sum += volts / 400.0);
            }
        }
        if average {
            rest.subtract(&all.clone(), &mut all);
        }
        all.iter().sum::<f64>() / 256.0 / 1e-3 - load_lsb
    }

    #[test]
    fn of_a_converter_that_sees_nothing_at_rest_nothing_is_taken_off() {
        let mut sum = BaselineSum::default();
        (0..32).for_each(|_| sum.add(&[0.0; 16], 1));
        let rest = sum.baseline(&Adc { bits: 12, full_scale_v: 4.096, noise_lsb: 5.0 }, 0.0, 1);
        let mut touch_v = [0.0; 16];
        rest.subtract(&[0.5; 16], &mut touch_v);
        assert!(touch_v.iter().all(|volts| (volts - 0.5).abs() < 1e-3), "{touch_v:?}");
    }

    #[test]
    fn what_is_taken_off_is_right_at_rest_and_under_load_although_noise_is_cut_off() {
        for offset_lsb in [-2.0, -1.0, 0.0, 1.0, 3.0, 30.0] {
            for average in [false, true] {
                let rest = errors_lsb(offset_lsb, 0.0, 256, average);
                assert!(rest.abs() < 0.05, "offset {offset_lsb}, at rest: {rest}");
                let load = errors_lsb(offset_lsb, 50.0, 256, average);
                assert!(load.abs() < 0.1, "offset {offset_lsb}, under load: {load}");
            }
        }
    }

    #[test]
    fn between_rest_and_load_no_less_of_a_touch_is_seen_than_with_the_mean_taken_off() {
        for offset_lsb in [-2.0, 0.0, 1.0] {
            for load_lsb in [1.0, 2.0, 4.0] {
                let error = errors_lsb(offset_lsb, load_lsb, 256, false);
                let [rest, loaded] = [offset_lsb, offset_lsb + load_lsb].map(|level| Clipping::new(1.5).mean_of(level));
                let plain = loaded - rest - load_lsb;
                assert!(
                    (plain - 0.05..0.25).contains(&error),
                    "{offset_lsb} {load_lsb}: {error}, with the mean {plain}"
                );
            }
        }
    }

    #[test]
    fn a_wire_that_floats_does_not_make_the_others_noisy() {
        let adc = Adc { bits: 12, full_scale_v: 4.096, noise_lsb: 1.5 };
        let (mut noise, mut floating) = (Noise::new(5), Noise::new(6));
        let rest = |floats: bool, noise: &mut Noise, floating: &mut Noise| {
            let mut sum = BaselineSum::default();
            for _ in 0..64 {
                let mut frame = measured(&Readings::from_fn(16, |_, _| 0.0), &adc, noise);
                let of_channel = frame.volts_mut().iter_mut().skip(3).step_by(16);
                of_channel.filter(|_| floats).for_each(|volts| *volts = 2.0 + 0.3 * floating.normal());
                sum.add(frame.volts(), 1);
            }
            sum.baseline(&adc, 0.0, 1)
        };
        let [sound, broken] = [false, true].map(|floats| rest(floats, &mut noise, &mut floating));
        let others = |rest: &Baseline| {
            rest.offset_v().iter().enumerate().filter(|(i, _)| i % 16 != 3).map(|(_, v)| *v).sum::<f64>() / 240.0
        };
        let [sound_v, broken_v] = [sound, broken].map(|rest| others(&rest));
        assert!((sound_v - broken_v).abs() < 0.1e-3, "{sound_v} {broken_v}");
    }

    #[test]
    fn a_mean_alone_is_read_with_the_noise_of_the_description() {
        let mut sum = BaselineSum::default();
        sum.add(&[0.6e-3; 4], 64);
        let rest = sum.baseline(&Adc { bits: 12, full_scale_v: 4.096, noise_lsb: 1.5 }, 0.0, 1);
        assert!(rest.offset_v()[2].abs() < 0.03e-3 && rest.mean_v()[2] == 0.6e-3, "{:?}", rest.offset_v());
        assert_eq!(Baseline::zero(2).offset_v(), [0.0; 2]);
    }

    #[test]
    fn nothing_is_cut_off_where_the_ground_is_lifted() {
        let adc = Adc { bits: 12, full_scale_v: 4.096, noise_lsb: 1.5 };
        let (mut noise, mut sum) = (Noise::new(8), BaselineSum::default());
        for _ in 0..64 {
            let frame = measured(&Readings::from_fn(16, |_, _| 0.2495), &adc, &mut noise);
            let above_ground: Vec<f64> = frame.volts().iter().map(|volts| volts - 0.25).collect();
            sum.add(&above_ground, 1);
        }
        let rest = sum.baseline(&adc, 0.25, 1);
        let offset_v = rest.offset_v().iter().sum::<f64>() / 256.0;
        assert!((offset_v + 0.5e-3).abs() < 0.1e-3 && rest.offset_v() == rest.mean_v(), "{offset_v}");
    }

    #[test]
    fn means_of_several_conversions_are_cut_off_as_each_is() {
        // 16 conversions about -1 code.
        let adc = Adc { bits: 12, full_scale_v: 4.096, noise_lsb: 1.5 };
        let (mut noise, mut sum) = (Noise::new(8), BaselineSum::default());
        let low = Readings::from_fn(16, |_, _| -1e-3);
        for _ in 0..64 {
            let mut mean_v = vec![0.0; 256];
            for _ in 0..16 {
                let codes = measured(&low, &adc, &mut noise);
                mean_v.iter_mut().zip(codes.volts()).for_each(|(sum, volts)| *sum += volts / 16.0);
            }
            sum.add(&mean_v, 1);
        }
        let offsets = sum.baseline(&adc, 0.0, 16).offset_v().iter().sum::<f64>() / 256.0;
        assert!((offsets + 1e-3).abs() < 0.1e-3, "{offsets}");
    }
}
