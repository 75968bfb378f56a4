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

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::dot::dot;
use crate::solve::fit::policy;
use tactomo_physics::forward::Similar;

/// Share of the variance of noise below which a direction is left out.
const LEAST_VARIANCE: f64 = 0.01;
/// Share of the noise, in the root of the sum of squares, that may be left out by taking readings as linear. With 0.03, places on detectors as
/// built are no better, and searches take an eighth longer; with 0.3, they are worse on one of six.
const CURVED: f64 = 0.1;

/// A detector near which readings are taken as linear in its parameters.
pub(crate) struct Linearised {
    /// From the described one, in each direction, in standard deviations.
    pub steps: Vec<f64>,
    pub detector: Similar,
}

impl Linearised {
    /// What the readings of a scene are off by in the mean (V), where the detector reads `volts` (V), the described one `described` (V), and
    /// steps have such patterns (V), a column each.
    pub fn mean_v(&self, volts: &[f64], described: &[f64], patterns_v: &DMatrix<f64>) -> Vec<f64> {
        let linear = patterns_v.columns(0, self.steps.len()) * DVector::from_column_slice(&self.steps);
        volts.iter().zip(described).zip(&linear).map(|((at, before), linear)| at - before - linear).collect()
    }
}

/// What readings so far make of a detector.
#[derive(Clone)]
pub(crate) struct About {
    /// The detector near which readings are taken as linear, if not the described one.
    pub near: Option<Arc<Linearised>>,
    /// Standard deviation of leakage since the baseline was taken (sheet conductances).
    pub leakage_sheets: f64,
}

impl Default for About {
    fn default() -> Self {
        Self { near: None, leakage_sheets: policy::LEAKAGE_SHEETS }
    }
}

/// Mean and covariance of what readings are off by.
#[derive(Clone, Default)]
pub(crate) struct ApproximationError {
    directions: Directions,
    /// Mean (V); none if it is zero.
    pub(crate) mean_v: Vec<f64>,
    /// Patterns of steps of the detector (V).
    patterns_v: DMatrix<f64>,
    /// Pattern of leakage (V).
    leakage_v: Vec<f64>,
    pub(crate) about: About,
    /// Readings that the patterns are of (V); none if they were made from the readings themselves.
    made_for: Vec<f64>,
}

impl std::fmt::Debug for ApproximationError {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let directions = self.directions.variances_v2().len();
        formatter.debug_struct("ApproximationError").field("directions", &directions).finish_non_exhaustive()
    }
}

/// Orthonormal directions of readings, with the variance along each (V2).
#[derive(Clone)]
enum Directions {
    /// One in the readings of each ground, row by row.
    Rows { units: Vec<f64>, variances_v2: Vec<f64> },
    /// Any, a column each, and the same a row each.
    Any { units: DMatrix<f64>, transposed: DMatrix<f64>, variances_v2: Vec<f64> },
}

impl Default for Directions {
    fn default() -> Self {
        Self::Rows { units: Vec::new(), variances_v2: Vec::new() }
    }
}

impl Directions {
    fn variances_v2(&self) -> &[f64] {
        match self {
            Self::Rows { variances_v2, .. } | Self::Any { variances_v2, .. } => variances_v2,
        }
    }

    /// Visits each: its number, the readings that it is in, and what it is there.
    fn each(&self, mut visit: impl FnMut(usize, Range<usize>, &[f64])) {
        match self {
            Self::Rows { units, variances_v2 } => {
                let electrodes = (units.len() / variances_v2.len().max(1)).max(1);
                let rows = units.chunks_exact(electrodes).enumerate();
                rows.for_each(|(g, unit)| visit(g, g * electrodes..(g + 1) * electrodes, unit));
            }
            Self::Any { units, .. } => {
                units.column_iter().enumerate().for_each(|(i, unit)| visit(i, 0..units.nrows(), unit.as_slice()));
            }
        }
    }
}

impl ApproximationError {
    /// Of patterns of one ground each (V), row by row.
    pub fn of_rows(patterns_v: &[f64], electrodes: usize) -> Self {
        let variances_v2: Vec<_> = patterns_v.chunks_exact(electrodes).map(|row| dot(row, row)).collect();
        let unit = |(i, volts): (usize, &f64)| match variances_v2[i / electrodes] {
            variance_v2 if variance_v2 > 0.0 => (1.0 / variance_v2.sqrt()) * volts,
            _ => 0.0,
        };
        let units = patterns_v.iter().enumerate().map(unit).collect();
        Self { directions: Directions::Rows { units, variances_v2 }, ..Self::default() }
    }

    /// Of any patterns (V), a column each, the first of which are steps of the detector, for readings `made_for` (V) with noise of at least
    /// `least_v`.
    pub fn of(patterns_v: &DMatrix<f64>, steps: usize, made_for: Vec<f64>, least_v: f64) -> Self {
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(patterns_v.tr_mul(patterns_v));
        let least_v2 = LEAST_VARIANCE * least_v * least_v;
        let kept: Vec<_> = (0..eigenvalues.len()).filter(|i| eigenvalues[*i] > least_v2).collect();
        let variances_v2: Vec<_> = kept.iter().map(|i| eigenvalues[*i]).collect();
        let mut units = patterns_v * eigenvectors.select_columns(&kept);
        units.column_iter_mut().zip(&variances_v2).for_each(|(mut unit, variance_v2)| unit /= variance_v2.sqrt());
        let directions = Directions::Any { transposed: units.transpose(), units, variances_v2 };
        let patterns_v = patterns_v.columns(0, steps).into_owned();
        Self { directions, patterns_v, made_for, ..Self::default() }
    }

    /// Takes the share `k` of what volts have along each direction away.
    pub fn shrink(&self, volts: &mut [f64], shares: &[f64]) {
        self.directions.each(|i, readings, unit| {
            let part = &mut volts[readings];
            let along = shares[i] * dot(part, unit);
            part.iter_mut().zip(unit).for_each(|(volts, unit)| *volts -= along * unit);
        });
    }

    /// The same for each column.
    pub fn shrink_columns(&self, columns_v: &mut DMatrix<f64>, shares: &[f64]) {
        match &self.directions {
            Directions::Rows { .. } => {
                columns_v.column_iter_mut().for_each(|mut column| self.shrink(column.as_mut_slice(), shares));
            }
            Directions::Any { units, transposed, .. } => {
                let mut along = transposed * &*columns_v;
                along.row_iter_mut().zip(shares).for_each(|(mut row, share)| row *= *share);
                columns_v.gemm(-1.0, units, &along, 1.0);
            }
        }
    }

    /// This error about what is known of a detector, of which leakage has such a pattern (V), and which has such readings of the scene (V), if
    /// that is not the described one.
    pub fn about(self, about: &About, leakage_v: Vec<f64>, volts: Option<&[f64]>) -> Self {
        let near = about.near.as_ref().zip(volts);
        let mean_v = near.map_or_else(Vec::new, |(near, volts)| near.mean_v(volts, &self.made_for, &self.patterns_v));
        Self { mean_v, leakage_v, about: about.clone(), ..self }
    }

    /// Pattern of leakage of one standard deviation (V); none of a detector that is known exactly.
    pub fn leakage_v(&self) -> &[f64] {
        &self.leakage_v
    }

    /// Of a mean (V) alone.
    pub fn of_mean(mean_v: Vec<f64>) -> Self {
        Self { mean_v, ..Self::default() }
    }

    /// Steps of the detector that are most likely, from residuals times the inverse of their covariance (1/V).
    pub fn steps(&self, pulls: &[f64]) -> Vec<f64> {
        self.patterns_v.tr_mul(&DVector::from_column_slice(pulls)).as_slice().to_vec()
    }

    /// Whether steps of the detector are far from where it was made linear, for readings with noise of `deviation_v`: a change by some share of
    /// the readings is not linear by about the square of that share.
    pub fn is_far(&self, steps: &[f64], deviation_v: f64) -> bool {
        let from = self.about.near.as_ref();
        let way = DVector::from_fn(steps.len(), |i, _| steps[i] - from.map_or(0.0, |from| from.steps[i]));
        let curved_v = CURVED * deviation_v * (self.made_for.len() as f64).sqrt();
        (&self.patterns_v * way).norm_squared() > curved_v * dot(&self.made_for, &self.made_for).sqrt()
    }

    /// `k` of each direction, at a standard deviation of noise (V).
    pub fn shares(&self, deviation_v: f64) -> Vec<f64> {
        let share = |variance_v2: f64| 1.0 - 1.0 / (1.0 + variance_v2 / (deviation_v * deviation_v)).sqrt();
        self.directions.variances_v2().iter().map(|variance_v2| share(*variance_v2)).collect()
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
