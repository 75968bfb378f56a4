//! What no number of rows takes away of the errors of contacts: what is the same in every frame.
//!
//! With whitened derivatives the rows' estimate is linear in the readings: what readings are off by, `e`, takes the parameters off by
//! `M^-1 A e`, where `M = sum J^T W J` and `A = sum J^T W` over rows of late, of derivatives `J` and inverse covariances `W` of a frame's
//! readings. So errors that stay, of the covariance `E`, leave the parameters' covariance `M^-1 A E A^T M^-1` however many rows come. `E`
//! has the patterns of pads and converters, and of each reading by itself the model's error and rounding.
//!
//! Of a detector that is not known exactly, what readings are off by was found with the contacts in all readings, and is taken off rows: `E` is of
//! what is [not known](super::discrepancy) of that.

use nalgebra::{Cholesky, DMatrix};

use super::discrepancy::Discrepancy;
use super::discs::{DiscFit, PARAMETERS};
use crate::solve::fit::target::{Errors, Target};
use tactomo_physics::readings::Readings;

/// Every so many frames it is reckoned, so that each row of a plan of 32 frames has its turn; and what is left of that after each: about the
/// time over which a still contact is averaged.
const LOOKED_AT: u32 = 7;
const KEPT_SHARE: f64 = 0.97;
/// Share of a model's own error that each reading has by itself. Of `square-60` the slab that is inverted and the finest are apart by
/// 0.00002 to 0.00006 of the largest reading, but for pads and contact; taken as 0.0003 for any detector.
const OWN_SHARE: f64 = 0.3;
/// The part of the contacts' covariance that frames do not average out. Places are in m, whatever the units of a fit's parameters.
#[derive(Clone, Debug)]
pub(super) struct SystematicError {
    information: DMatrix<f64>,
    /// `A` (1/V): a row for each parameter.
    pulls: DMatrix<f64>,
    covariance: DMatrix<f64>,
    frames: u32,
}

impl SystematicError {
    /// Of contacts that were found in the readings of `target`.
    pub fn new(fit: &DiscFit, target: &Target) -> Self {
        let units = units(fit);
        let per_m = |normal: &DMatrix<f64>| scaled(normal, |i, j| 1.0 / (units[i] * units[j]));
        Self {
            information: per_m(&fit.normal),
            pulls: pulls(fit, target, &units),
            covariance: DMatrix::zeros(units.len(), units.len()),
            frames: 0,
        }
    }

    /// Takes the rows of a target into account, less what all readings are off by.
    pub fn add(&mut self, fit: &DiscFit, target: &Target, errors: &Errors, discrepancy: &Discrepancy) {
        let is_looked_at = self.frames.is_multiple_of(LOOKED_AT);
        self.frames += 1;
        if !is_looked_at {
            return;
        }
        let units = units(fit);
        let pulls = pulls(fit, target, &units);
        let slopes = DMatrix::from_fn(pulls.ncols(), units.len(), |reading, i| fit.slopes_v()[i][reading] / units[i]);
        let frames = f64::from(LOOKED_AT);
        self.information = KEPT_SHARE * &self.information + frames * &pulls * slopes;
        self.pulls = KEPT_SHARE * &self.pulls + frames * pulls;
        if let Some(covariance) = self.reckoned(fit, target, errors, discrepancy) {
            self.covariance = covariance;
        }
    }

    fn reckoned(
        &self,
        fit: &DiscFit,
        target: &Target,
        errors: &Errors,
        discrepancy: &Discrepancy,
    ) -> Option<DMatrix<f64>> {
        let gains = Cholesky::new(self.information.clone())?.solve(&self.pulls);
        if !discrepancy.is_nothing() {
            let by_patterns = &gains * &discrepancy.patterns_v;
            return Some(&by_patterns * by_patterns.transpose());
        }
        let n = fit.volts.len().isqrt();
        let by_patterns = &gains * errors.patterns_v(&Readings::from_fn(n, |g, e| fit.volts[g * n + e]));
        let own = if target.is_provisional() { 1.0 } else { OWN_SHARE };
        let by_each = (own * target.fixed_v()).powi(2) * &gains * gains.transpose();
        Some(by_each + &by_patterns * by_patterns.transpose())
    }

    /// Covariance of a fit's parameters that stays.
    pub fn covariance(&self, fit: &DiscFit) -> DMatrix<f64> {
        let units = units(fit);
        scaled(&self.covariance, |i, j| 1.0 / (units[i] * units[j]))
    }
}

/// Units of a fit's parameters: of places in m.
fn units(fit: &DiscFit) -> Vec<f64> {
    fit.units_m().iter().flat_map(|unit_m| (0..PARAMETERS).map(|i| if i < 2 { *unit_m } else { 1.0 })).collect()
}

fn scaled(matrix: &DMatrix<f64>, scale: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| scale(i, j) * matrix[(i, j)])
}

/// `J^T W` of the readings of a target (1/V), in such units of the parameters.
pub(super) fn pulls(fit: &DiscFit, target: &Target, units: &[f64]) -> DMatrix<f64> {
    let active = target.at(&fit.volts);
    let mut pulls = DMatrix::zeros(units.len(), fit.volts.len());
    for ((mut row, slope), unit) in pulls.row_iter_mut().zip(fit.slopes_v()).zip(units) {
        let mut pull = active.whitened(slope);
        active.whiten_transposed(&mut pull);
        row.iter_mut().zip(pull).for_each(|(all, pull)| *all = pull / unit);
    }
    pulls
}
