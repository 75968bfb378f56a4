//! What no number of rows takes away of the errors of contacts: what is the same in every frame.
//!
//! With whitened derivatives the rows' estimate is linear in the readings: what readings are off by, `e`, takes the parameters off by
//! `M^-1 A e`, where `M = sum J^T W J` and `A = sum J^T W` over rows of late, of derivatives `J` and inverse covariances `W` of a frame's
//! readings. So errors that stay, of the covariance `E`, leave the parameters' covariance `M^-1 A E A^T M^-1` however many rows come. `E`
//! has the patterns of pads and converters, and of each reading by itself the model's error and rounding.
//!
//! Of a detector that is not known exactly, what readings are off by was found with the contacts in all readings, and is taken off rows: they
//! tell how contacts move from there, not where that was, so that all of the search's error stays. The farther contacts go, the less of what
//! readings are off by is what was found.

use nalgebra::{Cholesky, DMatrix};

use super::discs::{DiscFit, PARAMETERS};
use crate::solve::fit::target::{Errors, Target};
use tactomo_physics::readings::Readings;
use tactomo_physics::space::{Place, distance};

/// Every so many frames it is reckoned, so that each row of a plan of 32 frames has its turn; and what is left of that after each: about the
/// time over which a still contact is averaged.
const LOOKED_AT: u32 = 7;
const KEPT_SHARE: f64 = 0.97;
/// Share of a model's own error that each reading has by itself. Of `square-60` the slab that is inverted and the finest are apart by
/// 0.00002 to 0.00006 of the largest reading, but for pads and contact; taken as 0.0003 for any detector.
const OWN_SHARE: f64 = 0.3;
/// Way, in distances of electrodes, after which what readings are off by is no longer what was found. On detectors as built places are off by
/// 0.12 mm where they were found, and by 0.3 and 0.5 mm a sixth and a third of a distance from there.
const MOVED_ON: f64 = 0.2;

/// The part of the contacts' covariance that frames do not average out. Places are in m, whatever the units of a fit's parameters.
#[derive(Clone, Debug)]
pub(super) struct SystematicError {
    information: DMatrix<f64>,
    /// `A` (1/V): a row for each parameter.
    pulls: DMatrix<f64>,
    /// What the search left, of a detector that is not known exactly.
    searched: Option<Searched>,
    covariance: DMatrix<f64>,
    frames: u32,
}

/// Where contacts were found, and the covariance of that.
#[derive(Clone, Debug)]
struct Searched {
    places_m: Vec<Place>,
    covariance: DMatrix<f64>,
}

impl SystematicError {
    /// Of contacts that were found in the readings of `target`.
    pub fn new(fit: &DiscFit, target: &Target) -> Self {
        let units = units(fit);
        let per_m = |normal: &DMatrix<f64>| scaled(normal, |i, j| 1.0 / (units[i] * units[j]));
        let searched = |covariance: DMatrix<f64>| Searched {
            places_m: places_m(fit),
            covariance: scaled(&covariance, |i, j| units[i] * units[j]),
        };
        Self {
            information: per_m(&fit.normal),
            pulls: pulls(fit, target, &units),
            searched: target.error().and_then(|_| fit.covariance()).map(searched),
            covariance: DMatrix::zeros(units.len(), units.len()),
            frames: 0,
        }
    }

    /// Takes the rows of a target into account, on a detector whose electrodes are `spacing_m` (m) apart.
    pub fn add(&mut self, fit: &DiscFit, target: &Target, errors: &Errors, spacing_m: f64) {
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
        if let Some(covariance) = self.reckoned(fit, target, errors, spacing_m) {
            self.covariance = covariance;
        }
    }

    fn reckoned(&self, fit: &DiscFit, target: &Target, errors: &Errors, spacing_m: f64) -> Option<DMatrix<f64>> {
        let gains = Cholesky::new(self.information.clone())?.solve(&self.pulls);
        let by_each = |share: f64| (share * target.fixed_v()).powi(2) * &gains * gains.transpose();
        if let Some(searched) = &self.searched {
            let ways_m = places_m(fit).into_iter().zip(&searched.places_m).map(|(now, then)| distance(now, *then));
            let moved = ways_m.fold(0.0, f64::max) / (MOVED_ON * spacing_m);
            return Some(&searched.covariance + by_each(moved.min(1.0)));
        }
        let n = fit.volts.len().isqrt();
        let by_patterns = &gains * errors.patterns_v(&Readings::from_fn(n, |g, e| fit.volts[g * n + e]));
        let own = if target.is_provisional() { 1.0 } else { OWN_SHARE };
        Some(by_each(own) + &by_patterns * by_patterns.transpose())
    }

    /// Covariance of a fit's parameters that stays.
    pub fn covariance(&self, fit: &DiscFit) -> DMatrix<f64> {
        let units = units(fit);
        scaled(&self.covariance, |i, j| 1.0 / (units[i] * units[j]))
    }
}

fn places_m(fit: &DiscFit) -> Vec<Place> {
    fit.contacts.iter().map(|contact| [contact.x_m, contact.y_m, contact.z_m]).collect()
}

/// Units of a fit's parameters: of places in m.
fn units(fit: &DiscFit) -> Vec<f64> {
    fit.units_m().iter().flat_map(|unit_m| (0..PARAMETERS).map(|i| if i < 2 { *unit_m } else { 1.0 })).collect()
}

fn scaled(matrix: &DMatrix<f64>, scale: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| scale(i, j) * matrix[(i, j)])
}

/// `J^T W` of the readings of a target (1/V), in units of m.
fn pulls(fit: &DiscFit, target: &Target, units: &[f64]) -> DMatrix<f64> {
    let active = target.at(&fit.volts);
    let mut pulls = DMatrix::zeros(units.len(), fit.volts.len());
    for ((mut row, slope), unit) in pulls.row_iter_mut().zip(fit.slopes_v()).zip(units) {
        let mut pull = active.whitened(slope);
        active.whiten_transposed(&mut pull);
        row.iter_mut().zip(pull).for_each(|(all, pull)| *all = pull / unit);
    }
    pulls
}
