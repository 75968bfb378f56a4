//! What the network reads of a frame.
//!
//! [Balanced](crate::solve::fit::balance) readings over their size, the logarithms of the rows' scales that balanced them, and the logarithm of the
//! size: together they are the readings again, but place and shape are apart from firmness. Readings scale with the drive, which is divided out.

use crate::solve::fit::balance::balance;
use tactomo_physics::readings::Readings;

/// Smallest size, as a share of the drive.
const SMALLEST: f64 = 1e-6;

/// Means and deviations that features are standardised with.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Features {
    mean: Vec<f32>,
    deviation: Vec<f32>,
}

impl Features {
    /// How many there are of so many electrodes.
    pub fn count(electrodes: usize) -> usize {
        electrodes * electrodes + electrodes + 1
    }

    /// As many means as deviations, all of which are above zero.
    pub fn new(mean: Vec<f32>, deviation: Vec<f32>) -> Self {
        Self { mean, deviation }
    }

    /// The features of a frame, standardised; returns the logarithm of its size.
    pub fn of(&self, readings: &Readings, drive_v: f64, features: &mut Vec<f32>) -> f32 {
        let n = readings.electrodes();
        let mut volts: Vec<f64> = readings.volts().iter().map(|volts| volts.clamp(-drive_v, drive_v)).collect();
        let scales = balance(&mut volts, n, drive_v);
        let mean_v2 = volts.iter().map(|volts| volts * volts).sum::<f64>() / volts.len() as f64;
        let size = (mean_v2.sqrt() / drive_v).max(SMALLEST);
        let directions = volts.iter().map(|volts| volts / (drive_v * size));
        let all = directions.chain(scales.iter().map(|scale| scale.ln())).chain([size.ln()]);
        features.clear();
        let standardise = |((value, mean), deviation): ((f64, &f32), &f32)| (value as f32 - mean) / deviation;
        features.extend(all.zip(&self.mean).zip(&self.deviation).map(standardise));
        size.ln() as f32
    }
}
