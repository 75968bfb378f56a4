//! What of readings tells the place of a press: their direction, in the dimensions that presses take up, and their size.

use nalgebra::DMatrix;
use tactomo_physics::algebra::gram;

use super::points::{Points, dot};
use super::presses::Presses;
use crate::solve::fit::balance::balance;

/// Dimensions that hold less of the directions' variance than this share are left out.
const LEAST_SHARE: f64 = 1e-7;
/// Steps of the eigenvalues' iteration for each channel, of which it needs a few: without a limit, numbers that are not finite would not end.
const MOST_STEPS: usize = 100;
/// Variance that rounding makes of directions that are all alike.
const ROUNDING: f64 = 1e-28;

/// From readings to features.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// Drive voltage (V), if readings are those of a detector, out of which the force is taken.
    pub drive_v: Option<f64>,
    /// Mean direction, a number a channel.
    pub mean: Vec<f64>,
    /// Dimensions of directions, one after the other, a number a channel each; those in which presses differ most first.
    pub axes: Vec<f64>,
}

/// Features of readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Described {
    /// The direction less the mean one, a number a channel.
    pub from_mean: Vec<f64>,
    /// The same in the dimensions that presses take up.
    pub direction: Vec<f64>,
    /// Root of the sum of squares of the readings (V).
    pub size_v: f64,
}

impl Features {
    /// Those in which presses differ, with each press; `None` if they do not.
    pub fn of(presses: &Presses) -> Option<(Self, Vec<Described>)> {
        let drive_v = presses.drive_v;
        let directions: Vec<Vec<f64>> = presses.readings().map(|readings_v| direction(readings_v, drive_v)).collect();
        let count = directions.len();
        let mean: Vec<f64> = (0..presses.channels)
            .map(|channel| directions.iter().map(|direction| direction[channel]).sum::<f64>() / count as f64)
            .collect();
        let centred =
            DMatrix::from_fn(count, presses.channels, |press, channel| directions[press][channel] - mean[channel]);
        let decomposed = gram(&centred).try_symmetric_eigen(f64::EPSILON, MOST_STEPS * presses.channels)?;
        let mut squares: Vec<_> = decomposed.eigenvalues.iter().zip(decomposed.eigenvectors.column_iter()).collect();
        squares.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let least = (LEAST_SHARE * decomposed.eigenvalues.sum()).max(ROUNDING * count as f64);
        let kept = squares.iter().take_while(|(square, _)| **square > least);
        let axes: Vec<f64> = kept.flat_map(|(_, axis)| axis.iter().copied()).collect();
        let differ = !axes.is_empty();
        let features = Self { drive_v, mean, axes };
        let described = presses.readings().map(|readings_v| features.describe(readings_v)).collect();
        differ.then_some((features, described))
    }

    /// Number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.axes.len() / self.mean.len().max(1)
    }

    /// The same with no more dimensions than are used.
    pub fn keeping(mut self, dimensions: usize) -> Self {
        self.axes.truncate(dimensions * self.mean.len());
        self
    }

    /// Describes readings (V), not all of them zero.
    pub fn describe(&self, readings_v: &[f64]) -> Described {
        let mut from_mean = direction(readings_v, self.drive_v);
        from_mean.iter_mut().zip(&self.mean).for_each(|(value, mean)| *value -= mean);
        let direction = self.axes.chunks_exact(self.mean.len()).map(|axis| dot(axis, &from_mean)).collect();
        Described { from_mean, direction, size_v: size(readings_v) }
    }

    /// What of a direction is in none of the first dimensions, a number a channel.
    pub fn left_over(&self, described: &Described, dimensions: usize) -> Vec<f64> {
        let mut left = described.from_mean.clone();
        let axes = self.axes.chunks_exact(self.mean.len()).take(dimensions);
        for (axis, along) in axes.zip(&described.direction) {
            left.iter_mut().zip(axis).for_each(|(left, axis)| *left -= along * axis);
        }
        left
    }
}

impl Points {
    /// Of presses.
    pub fn of(described: &[Described]) -> Self {
        Self {
            dimensions: described.first().map_or(0, |described| described.direction.len()),
            coordinates: described.iter().flat_map(|described| described.direction.iter().copied()).collect(),
            log_sizes: described.iter().map(|described| described.size_v.ln()).collect(),
        }
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
