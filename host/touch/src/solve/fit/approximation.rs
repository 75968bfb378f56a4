//! What a model of the described detector is wrong by in the readings of a scene: its mean, and which errors go together.
//!
//! With patterns `P` of one standard deviation each ([`Nuisance`](tactomo_physics::forward::Nuisance)), readings have the covariance
//! `s^2 I + P P^T`: noise, and what the patterns can make (the approximation error of Kaipio and Somersalo). With orthonormal `q_i` and
//! squares `a_i` from the eigendecomposition of `P^T P`, `I - sum k_i q_i q_i^T` over `s` makes their errors alike and independent, with
//! `k_i = 1 - (1 + a_i / s^2)^(-1/2)`. The directions do not depend on `s`, so that they serve for any mean of frames.
//!
//! Ten per cent of thickness are far from linear. The steps `t` that the readings make most likely, `P^T (s^2 I + P P^T)^-1 r` of the
//! residuals `r`, give a detector that is nearer to the true one. About that one readings are
//! `V(t) + P (s - t)`, so that the nominal model is wrong by `V(t) - V(0) - P t` in the mean: no more is said of the detector than before,
//! but its square is right.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::dot::dot;
use crate::solve::fit::policy;
use tactomo_physics::forward::Similar;

/// Share of the variance of noise below which a direction is left out.
const LEAST_VARIANCE: f64 = 0.01;
/// Share of the noise, in the root of the sum of squares, that may be left out by taking readings as linear.
const CURVED: f64 = 0.03;

/// A detector near which readings are taken as linear in its parameters.
pub(crate) struct Linearised {
    /// From the described one, in each direction, in standard deviations.
    pub steps: Vec<f64>,
    pub detector: Similar,
}

/// Mean and covariance of what readings are off by.
#[derive(Clone, Default)]
pub(crate) struct ApproximationError {
    pub(crate) directions: Vec<Direction>,
    /// Mean (V); none if it is zero.
    pub(crate) mean_v: Vec<f64>,
    /// Patterns of steps of the detector (V).
    patterns_v: DMatrix<f64>,
    pub(crate) linearised: Option<Arc<Linearised>>,
    /// Readings that the patterns are of (V); none if they were made from the readings themselves.
    made_for: Vec<f64>,
}

impl std::fmt::Debug for ApproximationError {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("ApproximationError").field("directions", &self.directions.len()).finish_non_exhaustive()
    }
}

/// A direction, in the readings from some one on.
#[derive(Clone, Debug)]
pub(crate) struct Direction {
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

impl ApproximationError {
    /// Of patterns of one ground each (V), row by row.
    pub fn of_rows(patterns_v: &[f64], electrodes: usize) -> Self {
        let direction = |(g, row): (usize, &[f64])| {
            let variance_v2 = dot(row, row);
            let scale = if variance_v2 > 0.0 { 1.0 / variance_v2.sqrt() } else { 0.0 };
            let unit = row.iter().map(|volts| scale * volts).collect();
            Direction { start: g * electrodes, unit, variance_v2 }
        };
        let directions = patterns_v.chunks_exact(electrodes).enumerate().map(direction).collect();
        Self { directions, ..Self::default() }
    }

    /// Of any patterns (V), a column each, the first of which are steps of the detector, for readings `made_for` (V) with noise of at least
    /// `least_v`.
    pub fn of(patterns_v: &DMatrix<f64>, steps: usize, made_for: Vec<f64>, least_v: f64) -> Self {
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(patterns_v.tr_mul(patterns_v));
        let least_v2 = LEAST_VARIANCE * least_v * least_v;
        let kept: Vec<_> = (0..eigenvalues.len()).filter(|i| eigenvalues[*i] > least_v2).collect();
        let units = patterns_v * eigenvectors.select_columns(&kept);
        let direction = |(column, i): (usize, &usize)| {
            let variance_v2 = eigenvalues[*i];
            let scale = 1.0 / variance_v2.sqrt();
            Direction { start: 0, unit: units.column(column).iter().map(|volts| scale * volts).collect(), variance_v2 }
        };
        let directions = kept.iter().enumerate().map(direction).collect();
        let patterns_v = patterns_v.columns(0, steps).into_owned();
        Self { directions, mean_v: Vec::new(), patterns_v, linearised: None, made_for }
    }

    /// This error, about a detector with such readings of the scene (V).
    pub fn about(self, linearised: &Arc<Linearised>, volts: &[f64]) -> Self {
        let linear = &self.patterns_v * DVector::from_column_slice(&linearised.steps);
        let mean_v = volts.iter().zip(&self.made_for).zip(&linear).map(|((at, before), linear)| at - before - linear);
        Self { mean_v: mean_v.collect(), linearised: Some(Arc::clone(linearised)), ..self }
    }

    /// Steps of the detector that are most likely, from residuals times the inverse of their covariance (1/V).
    pub fn steps(&self, pulls: &[f64]) -> Vec<f64> {
        self.patterns_v.tr_mul(&DVector::from_column_slice(pulls)).as_slice().to_vec()
    }

    /// What readings are most likely off by (V), from residuals times the inverse of their covariance (1/V).
    pub fn likely_v(&self, pulls: &[f64]) -> Vec<f64> {
        let mut off_v = self.mean_v.clone();
        off_v.resize(pulls.len(), 0.0);
        for direction in &self.directions {
            let part = direction.start..direction.start + direction.unit.len();
            let along = direction.variance_v2 * dot(&direction.unit, &pulls[part.clone()]);
            off_v[part].iter_mut().zip(&direction.unit).for_each(|(off, unit)| *off += along * unit);
        }
        off_v
    }

    /// Whether steps of the detector are far from where it was made linear, for readings with noise of `deviation_v`: a change by some share of
    /// the readings is not linear by about the square of that share.
    pub fn is_far(&self, steps: &[f64], deviation_v: f64) -> bool {
        let from = self.linearised.as_ref();
        let way = DVector::from_fn(steps.len(), |i, _| steps[i] - from.map_or(0.0, |from| from.steps[i]));
        let curved_v = CURVED * deviation_v * (self.made_for.len() as f64).sqrt();
        (&self.patterns_v * way).norm_squared() > curved_v * dot(&self.made_for, &self.made_for).sqrt()
    }

    /// `k` of each direction, at a standard deviation of noise (V).
    pub fn shares(&self, deviation_v: f64) -> Vec<f64> {
        let share = |variance_v2: f64| 1.0 - 1.0 / (1.0 + variance_v2 / (deviation_v * deviation_v)).sqrt();
        self.directions.iter().map(|direction| share(direction.variance_v2)).collect()
    }

    /// Whether other readings (V) would have other patterns.
    pub fn is_stale(&self, volts: &[f64]) -> bool {
        self.is_moved(volts, policy::STALE_SHARE)
    }

    /// Whether other readings (V) are those that the patterns are of, as near as a search needs.
    pub fn is_settled(&self, volts: &[f64]) -> bool {
        !self.is_moved(volts, policy::SETTLED_SHARE)
    }

    fn is_moved(&self, volts: &[f64], share: f64) -> bool {
        let square = |all: &mut dyn Iterator<Item = f64>| all.map(|volts| volts * volts).sum::<f64>();
        let moved = square(&mut self.made_for.iter().zip(volts).map(|(a, b)| a - b));
        moved > share * share * square(&mut self.made_for.iter().copied())
    }
}
