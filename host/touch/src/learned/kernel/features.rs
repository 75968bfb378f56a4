//! What of readings tells the place of a press: a description of them, in the dimensions that presses take up, and their size.

use nalgebra::DMatrix;
use tactomo_physics::algebra::gram;

use super::points::{Points, dot};
use super::presses::Presses;
use crate::solve::fit::balance::balance;

/// Dimensions that hold less of the directions' variance than this share are left out.
const LEAST_SHARE: f64 = 1e-7;
/// Steps of the eigenvalues' iteration for each channel, of which it needs a few: without a limit, numbers that are not finite would not end.
const MOST_STEPS: usize = 100;
/// Variance that rounding makes of what is all alike, in its square.
const ROUNDING: f64 = 1e-28;

/// How readings are described.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Description {
    /// By their direction, readings over their size: the same for presses that differ in strength alone, if readings are in proportion to it.
    Directions,
    /// By standardised channels, each less its mean over its standard deviation: a channel that varies little counts as one that varies much.
    Channels,
}

impl Description {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Directions, Self::Channels];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Directions => "directions",
            Self::Channels => "channels",
        }
    }

    /// What it is, in a sentence.
    pub fn words(self) -> &'static str {
        match self {
            Self::Directions => "the readings' direction",
            Self::Channels => "standardised channels",
        }
    }
}

/// From readings to features.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// How readings are described.
    pub description: Description,
    /// Drive voltage (V), if readings are those of a detector, out of which the force is taken.
    pub drive_v: Option<f64>,
    /// Mean of what describes readings, a number a channel: of directions, or of readings (V).
    pub mean: Vec<f64>,
    /// What each channel is divided by then: 1 for directions, its standard deviation (V) for channels.
    pub scale: Vec<f64>,
    /// Dimensions of described readings, one after the other, a number a channel each; those in which presses differ most first.
    pub axes: Vec<f64>,
}

/// Features of readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Described {
    /// The described readings less the mean ones, over the scale, a number a channel.
    pub from_mean: Vec<f64>,
    /// The same in the dimensions that presses take up.
    pub coordinates: Vec<f64>,
    /// Root of the sum of squares of the readings (V).
    pub size_v: f64,
}

impl Features {
    /// Those in which presses differ, with each press; `None` if they do not.
    pub fn of(presses: &Presses, description: Description) -> Option<(Self, Vec<Described>)> {
        let drive_v = presses.drive_v;
        let rows: Vec<Vec<f64>> =
            presses.readings().map(|readings_v| described(readings_v, description, drive_v)).collect();
        let count = rows.len();
        let mean: Vec<f64> = (0..presses.channels)
            .map(|channel| rows.iter().map(|row| row[channel]).sum::<f64>() / count as f64)
            .collect();
        let scale = match description {
            Description::Directions => vec![1.0; presses.channels],
            Description::Channels => deviations(&rows, &mean)?,
        };
        let centred = DMatrix::from_fn(count, presses.channels, |press, channel| {
            (rows[press][channel] - mean[channel]) / scale[channel]
        });
        let decomposed = gram(&centred).try_symmetric_eigen(f64::EPSILON, MOST_STEPS * presses.channels)?;
        let mut squares: Vec<_> = decomposed.eigenvalues.iter().zip(decomposed.eigenvectors.column_iter()).collect();
        squares.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let least = (LEAST_SHARE * decomposed.eigenvalues.sum()).max(ROUNDING * count as f64);
        let kept = squares.iter().take_while(|(square, _)| **square > least);
        let axes: Vec<f64> = kept.flat_map(|(_, axis)| axis.iter().copied()).collect();
        let differ = !axes.is_empty();
        let features = Self { description, drive_v, mean, scale, axes };
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
        let mut from_mean = described(readings_v, self.description, self.drive_v);
        let known = self.mean.iter().zip(&self.scale);
        from_mean.iter_mut().zip(known).for_each(|(value, (mean, scale))| *value = (*value - mean) / scale);
        let coordinates = self.axes.chunks_exact(self.mean.len()).map(|axis| dot(axis, &from_mean)).collect();
        Described { from_mean, coordinates, size_v: size(readings_v) }
    }

    /// What of described readings is in none of the first dimensions, a number a channel.
    pub fn left_over(&self, described: &Described, dimensions: usize) -> Vec<f64> {
        let mut left = described.from_mean.clone();
        let axes = self.axes.chunks_exact(self.mean.len()).take(dimensions);
        for (axis, along) in axes.zip(&described.coordinates) {
            left.iter_mut().zip(axis).for_each(|(left, axis)| *left -= along * axis);
        }
        left
    }
}

impl Points {
    /// Of presses.
    pub fn of(features: &Features, described: &[Described]) -> Self {
        let coordinates = described.iter().flat_map(|described| described.coordinates.iter().copied()).collect();
        let log_sizes = described.iter().map(|described| described.size_v.ln()).collect();
        Self::new(features.description, features.dimensions(), coordinates, log_sizes)
    }
}

/// Readings, of a detector less the force; as directions over their size.
fn described(readings_v: &[f64], description: Description, drive_v: Option<f64>) -> Vec<f64> {
    let mut volts = readings_v.to_vec();
    if let Some(drive_v) = drive_v {
        balance(&mut volts, readings_v.len().isqrt(), drive_v);
    }
    if description == Description::Directions {
        let size_v = size(&volts);
        volts.iter_mut().for_each(|volts| *volts /= size_v);
    }
    volts
}

/// Standard deviation of each channel (V); of one that does not vary the root mean square of all. `None` if none varies.
fn deviations(rows: &[Vec<f64>], mean: &[f64]) -> Option<Vec<f64>> {
    let count = rows.len() as f64;
    let variance = |channel: usize| rows.iter().map(|row| (row[channel] - mean[channel]).powi(2)).sum::<f64>() / count;
    let variances: Vec<f64> = (0..mean.len()).map(variance).collect();
    let mean_variance = variances.iter().sum::<f64>() / mean.len() as f64;
    let mean_square = mean_variance + dot(mean, mean) / mean.len() as f64;
    let least = ROUNDING * mean_square;
    let varying = |variance: f64| if variance > least { variance } else { mean_variance };
    (mean_variance > least).then(|| variances.into_iter().map(|variance| varying(variance).sqrt()).collect())
}

/// Root of the sum of squares; above zero.
fn size(readings_v: &[f64]) -> f64 {
    dot(readings_v, readings_v).sqrt().max(f64::MIN_POSITIVE)
}
