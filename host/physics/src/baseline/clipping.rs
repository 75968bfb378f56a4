//! The mean of noise that is cut off below zero, and back from it.
//!
//! A converter tells no voltage below zero. Near zero the mean of its codes is therefore above the true level: 1.5 codes of noise about
//! zero read 0.6 codes in the mean. With `Q` the upper tail of the normal distribution, level `l` and deviation `s` in codes, a code is
//! `k` or more with the probability `Q((k - 1/2 - l) / s)`, whose sum over all `k` from 1 on is the mean code, and with the weights
//! `2 k - 1` the mean square.

use std::f64::consts::SQRT_2;

/// Levels of the table for each standard deviation.
const STEPS: f64 = 16.0;
/// Standard deviations from zero up to which levels are in the table: what noise does beyond is less than 1e-4 codes.
const REACH: f64 = 4.0;
/// Noise below which rounding hides the level (codes): then the mean is all there is to know of it.
const LEAST: f64 = 0.15;
/// Most noise that is looked for (codes), and halvings of the interval of noise: to 0.1 %.
const MOST: f64 = 256.0;
const HALVINGS: usize = 28;

/// What a converter that tells no voltage below zero makes of levels with noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Clipping {
    /// Standard deviation of a conversion's noise (codes).
    deviation: f64,
    /// Levels that are equally far apart.
    table: Vec<Moments>,
}

/// A level, and the mean and the variance of its codes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Moments {
    level: f64,
    mean: f64,
    variance: f64,
}

impl Clipping {
    /// By noise of a standard deviation (codes).
    pub fn new(deviation: f64) -> Self {
        if deviation.is_nan() || deviation < LEAST {
            return Self { deviation: deviation.max(0.0), table: Vec::new() };
        }
        let count = (2.0 * REACH * STEPS) as i32;
        let level = |i: i32| deviation * (f64::from(i) / STEPS - REACH);
        Self { deviation, table: (0..=count).map(|i| moments(level(i), deviation)).collect() }
    }

    /// By as much noise as makes codes with these means vary by `variance` in the mean (codes squared).
    pub fn of_variance(means: &[f64], variance: f64) -> Self {
        let mut ends = [0.0, MOST];
        for _ in 0..HALVINGS {
            let middle = 0.5 * (ends[0] + ends[1]);
            let is_more = Self::new(middle).variance(means) > variance;
            ends[usize::from(is_more)] = middle;
        }
        Self::new(ends[0])
    }

    /// Standard deviation of a conversion's noise (codes).
    pub fn deviation(&self) -> f64 {
        self.deviation
    }

    /// The level (codes) at which `samples` codes have such a mean. A level so low that none of them is above zero reads as the highest
    /// at which that is likely.
    pub fn level(&self, mean: f64, samples: f64) -> f64 {
        let mean = mean.max(0.5 / samples.max(1.0));
        let Some((low, high)) = self.around(mean) else { return mean };
        low.level + (high.level - low.level) * (mean - low.mean) / (high.mean - low.mean)
    }

    /// Mean code of a level (codes).
    #[cfg(test)]
    pub(super) fn mean_of(&self, level: f64) -> f64 {
        moments(level, self.deviation).mean
    }

    /// Mean variance of codes with these means (codes squared).
    fn variance(&self, means: &[f64]) -> f64 {
        let unclipped = self.deviation * self.deviation + if self.table.is_empty() { 0.0 } else { 1.0 / 12.0 };
        let of = |mean: &f64| match self.around(*mean) {
            None => unclipped,
            Some((low, high)) => {
                low.variance + (high.variance - low.variance) * (mean - low.mean) / (high.mean - low.mean)
            }
        };
        means.iter().map(of).sum::<f64>() / means.len().max(1) as f64
    }

    /// The entries around a mean; `None` if nothing of it is cut off. Below all of them there is none that is lower.
    fn around(&self, mean: f64) -> Option<(Moments, Moments)> {
        let above = self.table.partition_point(|moments| moments.mean < mean).max(1);
        Some((self.table[..above.min(self.table.len())].last().copied()?, *self.table.get(above)?))
    }
}

/// Of the codes of a level with noise.
fn moments(level: f64, deviation: f64) -> Moments {
    let highest = (level + (REACH + 2.0) * deviation + 1.0).max(1.0) as u32;
    let (mut mean, mut square) = (0.0, 0.0);
    for code in (1..=highest).map(f64::from) {
        let share = 0.5 * libm::erfc((code - 0.5 - level) / (SQRT_2 * deviation));
        mean += share;
        square += (2.0 * code - 1.0) * share;
    }
    Moments { level, mean, variance: square - mean * mean }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Adc;
    use crate::simulate::{Noise, code};

    /// Mean and variance of codes that the simulated converter gives for a level.
    fn simulated(level: f64, deviation: f64, count: u32) -> [f64; 2] {
        let adc = Adc { bits: 12, full_scale_v: 4096.0, noise_lsb: deviation };
        let mut noise = Noise::new(11);
        let codes: Vec<f64> = (0..count).map(|_| f64::from(code(level, &adc, &mut noise))).collect();
        let mean = codes.iter().sum::<f64>() / f64::from(count);
        [mean, codes.iter().map(|code| (code - mean).powi(2)).sum::<f64>() / f64::from(count)]
    }

    #[test]
    fn the_level_is_found_from_codes_that_were_cut_off() {
        for deviation in [0.3, 0.7, 1.5, 5.0] {
            let clipping = Clipping::new(deviation);
            for level in [-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 3.0, 6.0].map(|deviations: f64| deviations * deviation) {
                let [mean, variance] = simulated(level, deviation, 40_000);
                let error = clipping.level(mean, 40_000.0) - level;
                // What 40 000 codes tell of their mean, times how the level goes with it; little noise leaves rounding besides.
                let slope = clipping.level(mean + 1e-3, 40_000.0) - clipping.level(mean, 40_000.0);
                let chance = 4.0 * (variance / 40_000.0).sqrt() * slope / 1e-3;
                assert!(error.abs() < chance + if deviation < 0.5 { 0.1 } else { 0.0 }, "{deviation} {level}: {error}");
            }
        }
    }

    #[test]
    fn noise_about_zero_reads_more_than_zero() {
        let [mean, variance] = simulated(0.0, 1.5, 100_000);
        assert!((mean - 0.6).abs() < 0.02 && (variance.sqrt() - 0.9).abs() < 0.02, "{mean} {variance}");
    }

    #[test]
    fn the_noise_is_found_from_what_is_left_of_it() {
        for deviation in [0.7, 1.5, 4.0] {
            let both: Vec<_> = [-1.0, 0.0, 0.3, 2.0, 20.0].map(|level| simulated(level, deviation, 40_000)).to_vec();
            let means: Vec<f64> = both.iter().map(|[mean, _]| *mean).collect();
            let variance = both.iter().map(|[_, variance]| variance).sum::<f64>() / 5.0;
            let found = Clipping::of_variance(&means, variance).deviation();
            assert!((found / deviation - 1.0).abs() < 0.02, "{found} of {deviation}");
        }
    }

    #[test]
    fn without_noise_the_mean_is_the_level() {
        let still = Clipping::of_variance(&[0.0, 3.0], 0.0);
        assert!(still.deviation() < LEAST, "{}", still.deviation());
        assert_eq!([still.level(3.0, 32.0), Clipping::new(0.0).level(7.0, 32.0)], [3.0, 7.0]);
        // Codes that are all zero say that the level is below zero, and no more.
        let silent = Clipping::new(1.5).level(0.0, 32.0);
        assert!((-4.0..-1.5).contains(&silent), "{silent}");
    }
}
