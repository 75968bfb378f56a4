//! What of readings no press had: the part of their description that is in none of the dimensions in which most presses are.
//!
//! A channel that is dead, at an end of its range, or exchanged with another leaves that to itself or to a few; noise and readings of something
//! else leave it to all. So both are looked at: the whole, and each channel in what is usual for it.

use super::classes::Classes;
use super::features::{Described, Features};

/// Most dimensions in which presses are: with 24, dead channels are seen less often.
const MOST_DIMENSIONS: usize = 60;
/// Presses, and channels, for each dimension at least: else what is left over of a press is what it has in common with no other.
const PRESSES_EACH: usize = 5;
const CHANNELS_EACH: usize = 3;
/// Smallest usual part of a description: rounding.
const SMALLEST: f64 = 1e-9;
/// Most of a press that it makes of the dimensions by itself.
const MOST_LEVERAGE: f64 = 0.9;

/// Tells what no press had.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOver {
    /// Dimensions that presses are in.
    pub dimensions: usize,
    /// Root mean square of what is left over of presses, a class after the other, a number a channel.
    pub deviations: Vec<f64>,
    /// Largest usual length of what is left over, in each class.
    pub lengths: Vec<f64>,
    /// Largest usual deviation of a channel, in root mean squares, in each class.
    pub channels: Vec<f64>,
}

impl LeftOver {
    /// For presses in such classes; `presses` tells of which one each description is.
    pub fn of(features: &Features, described: &[Described], classes: &Classes, presses: &[usize]) -> Self {
        let channels = features.mean.len();
        let count = presses.iter().max().map_or(0, |last| last + 1);
        let most = MOST_DIMENSIONS.min(count / PRESSES_EACH).min(channels / CHANNELS_EACH).max(1);
        let dimensions = most.min(features.dimensions());
        let left: Vec<Vec<f64>> =
            left_out(features, described, dimensions, described.len() as f64 / count.max(1) as f64);
        let sizes_v: Vec<f64> = described.iter().map(|described| described.size_v).collect();
        let mut this = Self { dimensions, deviations: Vec::new(), lengths: Vec::new(), channels: Vec::new() };
        for class in 0..classes.count() {
            let of_class: Vec<&Vec<f64>> = left
                .iter()
                .zip(&sizes_v)
                .filter(|(_, size_v)| classes.class(**size_v) == class)
                .map(|(left, _)| left)
                .collect();
            let mean_square =
                |channel: usize| of_class.iter().map(|left| left[channel].powi(2)).sum::<f64>() / of_class.len() as f64;
            this.deviations.extend((0..channels).map(|channel| mean_square(channel).sqrt().max(SMALLEST)));
        }
        let figures: Vec<[f64; 2]> =
            left.iter().zip(&sizes_v).map(|(left, size_v)| this.figures(left, classes.class(*size_v))).collect();
        let limits =
            |which: usize| classes.limits(&sizes_v, &figures.iter().map(|figures| figures[which]).collect::<Vec<_>>());
        (this.lengths, this.channels) = (limits(0), limits(1));
        this
    }

    /// Whether readings of a class have more of what no press had than presses do.
    pub fn is_new(&self, features: &Features, described: &Described, class: usize) -> bool {
        let [length, channel] = self.figures(&features.left_over(described, self.dimensions), class);
        length > self.lengths[class] || channel > self.channels[class]
    }

    /// Length of what is left over, and the largest of it in a channel's root mean squares.
    fn figures(&self, left: &[f64], class: usize) -> [f64; 2] {
        let deviations = &self.deviations[class * left.len()..][..left.len()];
        let length = super::points::dot(left, left).sqrt().max(SMALLEST);
        let largest = left.iter().zip(deviations).map(|(left, deviation)| left.abs() / deviation).fold(0.0, f64::max);
        [length, largest]
    }
}

/// What is left over of each press if the dimensions are those of the others: by its leverage, which is exact for a regression on the
/// coordinates and nearly so for the dimensions themselves. A press of several rows has as many times the leverage of one.
fn left_out(features: &Features, described: &[Described], dimensions: usize, rows_each: f64) -> Vec<Vec<f64>> {
    let sum = |axis: usize| described.iter().map(|described| described.coordinates[axis].powi(2)).sum::<f64>();
    let sums: Vec<f64> = (0..dimensions).map(sum).collect();
    let left = |described_one: &Described| {
        let along = described_one.coordinates.iter().zip(&sums).map(|(along, sum)| along * along / sum).sum::<f64>();
        let leverage = (rows_each * (along + 1.0 / described.len() as f64)).min(MOST_LEVERAGE);
        features.left_over(described_one, dimensions).iter().map(|left| left / (1.0 - leverage)).collect()
    };
    described.iter().map(left).collect()
}
