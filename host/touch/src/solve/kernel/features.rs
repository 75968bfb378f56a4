//! What of readings tells the place of a press: their direction, in the few dimensions that presses take up, and their size.

use faer::Mat;

use super::presses::Presses;
use crate::solve::balance::balance;

/// Most dimensions that directions are described in.
const MOST_DIMENSIONS: usize = 24;
/// Dimensions that hold less of the directions' variance than this share are left out.
const LEAST_SHARE: f64 = 1e-7;

/// Variance that rounding makes of directions that are all alike.
const ROUNDING: f64 = 1e-28;

/// From readings to features.
#[derive(Clone, Debug)]
pub struct Features {
    /// Drive voltage (V), if readings are those of a detector, out of which the force is taken.
    drive_v: Option<f64>,
    mean: Vec<f64>,
    /// Dimensions of directions, one after the other.
    axes: Vec<Vec<f64>>,
}

/// Features of readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Described {
    /// Coordinates of the direction.
    pub direction: Vec<f64>,
    /// Root of the sum of squares of the readings (V).
    pub size_v: f64,
    /// How far the direction is from all directions that were taught: 0 to about 1.
    pub beside: f64,
}

impl Described {
    /// The direction, and the size's logarithm times a weight: how far apart readings are whose sizes differ by a factor e.
    pub fn point(&self, size_weight: f64) -> Vec<f64> {
        let size = size_weight * self.size_v.ln();
        self.direction.iter().copied().chain([size]).collect()
    }
}

impl Features {
    /// Those in which presses differ; `None` if they do not.
    pub fn of(presses: &Presses) -> Option<Self> {
        let drive_v = presses.drive_v;
        let directions: Vec<Vec<f64>> = presses.readings().map(|readings_v| direction(readings_v, drive_v)).collect();
        let count = directions.len();
        let mean: Vec<f64> = (0..presses.channels)
            .map(|channel| directions.iter().map(|direction| direction[channel]).sum::<f64>() / count as f64)
            .collect();
        let centred =
            Mat::from_fn(count, presses.channels, |press, channel| directions[press][channel] - mean[channel]);
        let decomposed = centred.thin_svd().ok()?;
        let squares: Vec<f64> = decomposed.S().column_vector().iter().map(|value| value * value).collect();
        let least = (LEAST_SHARE * squares.iter().sum::<f64>()).max(ROUNDING * count as f64);
        let kept = squares.iter().take_while(|square| **square > least).count().min(MOST_DIMENSIONS);
        let axes = (0..kept).map(|axis| decomposed.V().col(axis).iter().copied().collect()).collect();
        (kept > 0).then_some(Self { drive_v, mean, axes })
    }

    /// Describes readings (V), not all of them zero.
    pub fn describe(&self, readings_v: &[f64]) -> Described {
        let mut from_mean = direction(readings_v, self.drive_v);
        from_mean.iter_mut().zip(&self.mean).for_each(|(value, mean)| *value -= mean);
        let direction: Vec<f64> = self.axes.iter().map(|axis| dot(axis, &from_mean)).collect();
        let beside = (dot(&from_mean, &from_mean) - dot(&direction, &direction)).max(0.0).sqrt();
        Described { direction, size_v: size(readings_v), beside }
    }
}

/// Readings, of a detector less the force, over their size.
fn direction(readings_v: &[f64], drive_v: Option<f64>) -> Vec<f64> {
    let mut volts = readings_v.to_vec();
    if let Some(drive_v) = drive_v {
        balance(&mut volts, readings_v.len().isqrt(), drive_v);
    }
    let size_v = size(&volts);
    volts.iter_mut().for_each(|volts| *volts /= size_v);
    volts
}

/// Root of the sum of squares; above zero.
fn size(readings_v: &[f64]) -> f64 {
    dot(readings_v, readings_v).sqrt().max(f64::MIN_POSITIVE)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
