//! Radii of contacts that spots explain.
//!
//! A spot has no radius, but what the forward model's readings are over the spots' depends on one, so it is one more parameter:
//! its derivative is a difference of two answers of the forward model. Known before is that it is usual, within a factor of two or
//! so. Where the readings say little more, the usual radius is kept and none is reported; what not knowing it adds to the
//! covariance of the others is kept and added, frame after frame.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::discs::RADIUS_DEVIATION;
use super::fit::Fit;
use super::network::FitSpot;
use super::target::{Target, dot};
use super::{ContactFinder, Explanation};
use crate::solve::Uncertainty;
use tactomo_physics::forward::readings_v;
use tactomo_physics::scene::Contact;

/// Standard error of the logarithm of a radius up to which it is known from the readings: a fifth of it.
const KNOWN: f64 = 0.2;
/// Difference of the logarithm that derivatives are taken over.
const DIFFERENCE: f64 = 0.02;
/// Longest change of the logarithm at once, and how often radii are fitted.
const LONGEST: f64 = 0.3;
const TIMES: usize = 5;
/// A change of the logarithm that is not worth another fit, in standard errors.
const SMALL: f64 = 0.3;

/// Radii of some contacts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Radii {
    /// Of each contact (m), and whether the readings say so.
    all: Vec<(f64, bool)>,
    /// What they add to the covariance of the spots' parameters; none before it has been looked at.
    added: Option<Box<DMatrix<f64>>>,
    /// That is taken where the readings do not say (m).
    usual_m: f64,
}

/// What a look at the readings says of radii.
struct Looked {
    /// Changes of the logarithms, and their standard errors.
    steps: Vec<(f64, f64)>,
    added: DMatrix<f64>,
}

impl Radii {
    /// One radius (m) for so many contacts, as is usual.
    pub fn usual(radius_m: f64, count: usize) -> Self {
        Self { all: vec![(radius_m, false); count], added: None, usual_m: radius_m }
    }

    /// Those of some of the contacts.
    pub fn of(&self, contacts: &[usize]) -> Self {
        Self { all: contacts.iter().map(|k| self.all[*k]).collect(), added: None, usual_m: self.usual_m }
    }

    /// The radius that a contact is taken to have (m).
    pub fn radius_m(&self, k: usize) -> f64 {
        self.all[k].0
    }

    /// The radius of a contact (m), where the readings say it.
    pub fn known_m(&self, k: usize) -> Option<f64> {
        self.all[k].1.then_some(self.all[k].0)
    }

    /// A covariance of the spots' parameters with what radii add to it.
    pub fn widened(&self, covariance: &DMatrix<f64>) -> DMatrix<f64> {
        match &self.added {
            Some(added) if added.shape() == covariance.shape() => covariance + &**added,
            _ => covariance.clone(),
        }
    }

    /// The radii after a look, those that the readings say changed; and whether any changed by much.
    fn moved(&self, looked: Looked) -> (Self, bool) {
        let mut changed = false;
        let moved = |(&(radius_m, _), (step, error)): (&(f64, bool), &(f64, f64))| {
            let known = *error < KNOWN;
            if !known {
                changed |= radius_m != self.usual_m;
                return (self.usual_m, false);
            }
            let step = step.clamp(-LONGEST, LONGEST);
            changed |= step.abs() > SMALL * error;
            (radius_m * step.exp(), true)
        };
        let all = self.all.iter().zip(&looked.steps).map(moved).collect();
        (Self { all, added: Some(Box::new(looked.added)), usual_m: self.usual_m }, changed)
    }
}

impl ContactFinder {
    /// An explanation by spots with the radii that the readings say.
    pub(super) fn with_radii(&self, found: Explanation, target: &Target) -> Explanation {
        let mut best = found;
        for _ in 0..TIMES {
            let Explanation::Spots(fit, _, radii) = &best else { return best };
            let Some(looked) = self.look(fit, radii, target) else { return best };
            let (moved, changed) = radii.moved(looked);
            if !changed {
                let Explanation::Spots(fit, correction_v, _) = best else { return best };
                return Explanation::Spots(fit, correction_v, moved);
            }
            let next = self.correct(fit.clone(), &moved, target, 2);
            // A step too far, or of a fit that the model is no good for.
            if next.cost() > best.cost() {
                let Explanation::Spots(fit, correction_v, before) = best else { return best };
                let radii = Radii { added: moved.added, ..before };
                return Explanation::Spots(fit, correction_v, radii);
            }
            best = next;
        }
        best
    }

    /// One step of least squares in the spots' parameters and the logarithms of the radii.
    fn look(&self, fit: &Fit, radii: &Radii, target: &Target) -> Option<Looked> {
        let count = fit.spots.len();
        let contacts: Vec<_> =
            fit.spots.iter().enumerate().map(|(k, spot)| self.contact(spot, radii.radius_m(k))).collect();
        let exact_v = self.exact_v(&contacts)?;
        let residuals = target.residuals(&exact_v);
        let mut slopes = self.network.slopes(&fit.spots, &fit.solved);
        for k in 0..count {
            let mut wider = contacts.clone();
            wider[k].radius_m *= DIFFERENCE.exp();
            let wider_v = self.exact_v(&wider)?;
            slopes.push(wider_v.iter().zip(&exact_v).map(|(a, b)| (a - b) / DIFFERENCE).collect());
        }
        slopes.iter_mut().for_each(|slope| target.whiten(slope));
        // Places in metres and logarithms are of different size: scaled, the matrix is well conditioned.
        let scale: Vec<_> =
            slopes.iter().take(3 * count).map(|slope| 1.0 / dot(slope, slope).sqrt().max(f64::MIN_POSITIVE)).collect();
        let scale_of = |i: usize| scale.get(i).copied().unwrap_or(1.0);
        let mut normal =
            DMatrix::from_fn(4 * count, 4 * count, |i, j| scale_of(i) * scale_of(j) * dot(&slopes[i], &slopes[j]));
        let mut gradient = DVector::from_fn(4 * count, |i, _| scale_of(i) * dot(&slopes[i], &residuals));
        for k in 0..count {
            let i = 3 * count + k;
            normal[(i, i)] += RADIUS_DEVIATION.powi(-2);
            gradient[i] -= (radii.radius_m(k) / self.settings.radius_m).ln() * RADIUS_DEVIATION.powi(-2);
        }
        let alone = Cholesky::new(normal.view((0, 0), (3 * count, 3 * count)).into_owned())?.inverse();
        let factor = Cholesky::new(normal)?;
        let (step, covariance) = (factor.solve(&gradient), factor.inverse());
        let steps = (0..count).map(|k| 3 * count + k).map(|i| (step[i], covariance[(i, i)].sqrt())).collect();
        let added = DMatrix::from_fn(3 * count, 3 * count, |i, j| {
            (covariance[(i, j)] - alone[(i, j)]) * scale_of(i) * scale_of(j)
        });
        Some(Looked { steps, added })
    }

    /// Readings of the forward model (V).
    pub(super) fn exact_v(&self, contacts: &[Contact]) -> Option<Vec<f64>> {
        let impedance_ohm = self.problem.model.impedance_ohm(contacts).ok()?;
        Some(readings_v(&impedance_ohm, self.problem.detector()).volts().to_vec())
    }
}

/// Standard errors of the contact of a spot from the covariance of all spots' parameters.
pub(super) fn uncertainty(covariance: &DMatrix<f64>, k: usize, spot: &FitSpot, conductance_s: f64) -> Uncertainty {
    let of = |i: usize, j: usize| covariance[(3 * k + i, 3 * k + j)];
    // Directions along the surface to x and y.
    let along = |axis: usize| [0, 1].map(|direction| spot.spot.along[direction][axis]);
    let between = |a: [f64; 2], b: [f64; 2]| {
        (0..4).map(|index| (index / 2, index % 2)).map(|(i, j)| a[i] * b[j] * of(i, j)).sum::<f64>()
    };
    let [x, y] = [0, 1].map(|axis| between(along(axis), along(axis)).max(0.0).sqrt());
    let correlation = (between(along(0), along(1)) / (x * y).max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0);
    // `C = 1 / ((A - own) share)`, so `dC / C = -A C share d(ln A) - d(share) / share`.
    let share = spot.spot.share;
    let [first, second] = spot.spot.share_slopes_per_m;
    let slopes = [-first / share, -second / share, -conductance_s * share * spot.ohm];
    let square: f64 = (0..9).map(|index| (index / 3, index % 3)).map(|(i, j)| slopes[i] * slopes[j] * of(i, j)).sum();
    Uncertainty { x_m: x, y_m: y, correlation, conductance_s: conductance_s * square.max(0.0).sqrt() }
}
