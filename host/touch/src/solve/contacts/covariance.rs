//! Errors of readings that go together: what the detector, and the model of its pads, may be wrong by.
//!
//! With patterns `P` of one standard deviation each, readings have the covariance `s^2 I + P P^T`: noise, and what the patterns can make.
//! With orthonormal `q_i` and squares `a_i` from the eigendecomposition of `P^T P`, `I - sum k_i q_i q_i^T` over `s` makes their errors
//! alike and independent, with `k_i = 1 - (1 + a_i / s^2)^(-1/2)`. The directions do not depend on `s`, so that they serve for
//! any mean of frames.

use nalgebra::{DMatrix, SymmetricEigen};

use super::target::dot;

/// Share of the variance of noise below which a direction is left out.
const LEAST: f64 = 0.01;
/// Share of the readings, in the root of the sum of squares, by which they may differ from those that the patterns were made for.
const STALE: f64 = 0.25;

/// Orthogonal directions in which readings may be off together.
#[derive(Clone, Debug, Default)]
pub(in crate::solve) struct Covariance {
    pub(super) directions: Vec<Direction>,
    /// Readings that the patterns are of (V); none if they were made from the readings themselves.
    made_for: Vec<f64>,
}

/// A direction, in the readings from some one on.
#[derive(Clone, Debug)]
pub(super) struct Direction {
    pub start: usize,
    pub unit: Vec<f64>,
    /// Variance along it (V2).
    pub variance_v2: f64,
}

impl Direction {
    /// Takes a share of volts along this direction away.
    pub fn shrink(&self, volts: &mut [f64], share: f64) {
        let part = &mut volts[self.start..self.start + self.unit.len()];
        let along = share * dot(part, &self.unit);
        part.iter_mut().zip(&self.unit).for_each(|(volts, unit)| *volts -= along * unit);
    }
}

impl Covariance {
    /// Of patterns of one ground each (V), row by row.
    pub fn of_rows(patterns_v: &[f64], electrodes: usize) -> Self {
        let direction = |(g, row): (usize, &[f64])| {
            let variance_v2 = dot(row, row);
            let scale = if variance_v2 > 0.0 { 1.0 / variance_v2.sqrt() } else { 0.0 };
            let unit = row.iter().map(|volts| scale * volts).collect();
            Direction { start: g * electrodes, unit, variance_v2 }
        };
        Self {
            directions: patterns_v.chunks_exact(electrodes).enumerate().map(direction).collect(),
            made_for: Vec::new(),
        }
    }

    /// Of any patterns (V), a column each, for readings `made_for` (V) with noise of at least `least_v`.
    pub fn of(patterns_v: &DMatrix<f64>, made_for: Vec<f64>, least_v: f64) -> Self {
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(patterns_v.tr_mul(patterns_v));
        let least_v2 = LEAST * least_v * least_v;
        let kept: Vec<_> = (0..eigenvalues.len()).filter(|i| eigenvalues[*i] > least_v2).collect();
        let units = patterns_v * eigenvectors.select_columns(&kept);
        let direction = |(column, i): (usize, &usize)| {
            let variance_v2 = eigenvalues[*i];
            let scale = 1.0 / variance_v2.sqrt();
            Direction { start: 0, unit: units.column(column).iter().map(|volts| scale * volts).collect(), variance_v2 }
        };
        Self { directions: kept.iter().enumerate().map(direction).collect(), made_for }
    }

    /// `k` of each direction, at a standard deviation of noise (V).
    pub fn shares(&self, deviation_v: f64) -> Vec<f64> {
        let share = |variance_v2: f64| 1.0 - 1.0 / (1.0 + variance_v2 / (deviation_v * deviation_v)).sqrt();
        self.directions.iter().map(|direction| share(direction.variance_v2)).collect()
    }

    /// Whether other readings (V) would have other patterns.
    pub fn is_stale(&self, volts: &[f64]) -> bool {
        let square = |all: &mut dyn Iterator<Item = f64>| all.map(|volts| volts * volts).sum::<f64>();
        let moved = square(&mut self.made_for.iter().zip(volts).map(|(a, b)| a - b));
        moved > STALE * STALE * square(&mut self.made_for.iter().copied())
    }
}
