//! Least squares of a few contacts: Levenberg and Marquardt's method on the spots' places and the logarithms of their
//! resistances.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::network::{FitSpot, Network, Solved};
use super::target::{Target, dot};
use tactomo_physics::forward::spots::SpotFields;
use tactomo_physics::space;

/// Damping at the start, as a share of the diagonal.
const FIRST_DAMPING: f64 = 1e-3;
/// Tries of one step, each damped ten times more.
const TRIES: usize = 4;
/// A step is the last one if it moves no parameter by more than this share of its standard error.
const SMALL: f64 = 0.05;
/// Longest change of the logarithm of a resistance in a step.
const LONGEST_LOG: f64 = 1.5;
/// Resistance of a spot over that of its own field, at least: below, the contact would be better than perfect.
const LEAST_OHM: f64 = 0.6;
/// And at most, over the sheet's resistance: such a contact is nothing.
const MOST_SHEETS: f64 = 1e6;

/// Contacts that fit best.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub spots: Vec<FitSpot>,
    pub solved: Solved,
    /// Readings that the spots predict (V).
    pub volts: Vec<f64>,
    /// Sum of squares of the weighted residuals.
    pub cost: f64,
    /// Covariance of the parameters, three for each spot, for weights that are right; `None` where they are not determined.
    pub covariance: Option<DMatrix<f64>>,
    /// Whether the last step was small.
    pub settled: bool,
}

/// What fits need beside the target.
pub(super) struct Fitter<'a> {
    pub network: &'a Network,
    pub fields: &'a dyn SpotFields,
    /// Longest way of a spot in a step (m).
    pub longest_m: f64,
    /// Resistance of a square of the sheet (ohm).
    pub sheet_ohm: f64,
}

impl Fitter<'_> {
    /// The nearest minimum from a start, in at most so many steps; `None` if the start makes no sense.
    pub fn fit(&self, start: Vec<FitSpot>, target: &Target, steps: usize) -> Option<Fit> {
        let mut fit = self.at(start, target)?;
        let mut damping = FIRST_DAMPING;
        for _ in 0..steps {
            let (normal, gradient) = self.equations(&fit, target);
            fit.covariance = covariance(&normal);
            match self.step(&fit, target, &normal, &gradient, &mut damping) {
                Some((next, small)) => {
                    let covariance = fit.covariance.take();
                    fit = Fit { covariance, ..next };
                    if small {
                        fit.settled = true;
                        break;
                    }
                }
                None => {
                    fit.settled = true;
                    break;
                }
            }
        }
        Some(fit)
    }

    /// The readings of some spots, unfitted.
    pub fn at(&self, spots: Vec<FitSpot>, target: &Target) -> Option<Fit> {
        let solved = self.network.solve(&spots, self.fields)?;
        let volts = self.network.volts(&solved);
        let cost = target.cost(&volts);
        cost.is_finite().then_some(Fit { spots, solved, volts, cost, covariance: None, settled: false })
    }

    /// A step that lowers the cost, and whether it is small; `None` if there is none.
    fn step(
        &self,
        fit: &Fit,
        target: &Target,
        normal: &DMatrix<f64>,
        gradient: &DVector<f64>,
        damping: &mut f64,
    ) -> Option<(Fit, bool)> {
        for _ in 0..TRIES {
            let mut damped = normal.clone();
            for i in 0..damped.nrows() {
                damped[(i, i)] += *damping * normal[(i, i)].max(f64::MIN_POSITIVE);
            }
            let step = Cholesky::new(damped).map(|factor| factor.solve(gradient));
            let next = step.as_ref().and_then(|step| self.at(self.moved(&fit.spots, step), target));
            if let (Some(step), Some(next)) = (step, next)
                && next.cost <= fit.cost
            {
                *damping = (*damping * 0.1).max(1e-9);
                let small =
                    (0..step.len()).all(|i| step[i].abs() < SMALL / normal[(i, i)].max(f64::MIN_POSITIVE).sqrt());
                return Some((next, small));
            }
            *damping *= 10.0;
        }
        None
    }

    fn moved(&self, spots: &[FitSpot], step: &DVector<f64>) -> Vec<FitSpot> {
        let moved = |(k, spot): (usize, &FitSpot)| {
            let [by_first, by_second, log] = [step[3 * k], step[3 * k + 1], step[3 * k + 2]];
            let shorten = (self.longest_m / by_first.hypot(by_second)).min(1.0);
            let place_m = space::along(spot.spot.place_m, shorten * by_first, spot.spot.along[0]);
            let place_m = space::along(place_m, shorten * by_second, spot.spot.along[1]);
            let ohm = spot.ohm * log.clamp(-LONGEST_LOG, LONGEST_LOG).exp();
            self.spot(self.fields.spot(place_m), ohm)
        };
        spots.iter().enumerate().map(moved).collect()
    }

    /// A spot with a resistance that is held within what makes sense.
    pub fn spot(&self, spot: tactomo_physics::forward::spots::Spot, ohm: f64) -> FitSpot {
        let least = LEAST_OHM * spot.own_ohm;
        FitSpot { ohm: ohm.clamp(least, least.max(MOST_SHEETS * self.sheet_ohm)), spot }
    }

    /// Normal equations: `J^T W^2 J` and `J^T W^2 r`.
    fn equations(&self, fit: &Fit, target: &Target) -> (DMatrix<f64>, DVector<f64>) {
        let mut slopes = self.network.slopes(&fit.spots, &fit.solved);
        for slope in &mut slopes {
            target.whiten(slope);
        }
        let residuals = target.residuals(&fit.volts);
        let size = slopes.len();
        let mut normal = DMatrix::zeros(size, size);
        for i in 0..size {
            for j in 0..=i {
                let product = dot(&slopes[i], &slopes[j]);
                (normal[(i, j)], normal[(j, i)]) = (product, product);
            }
        }
        (normal, DVector::from_iterator(size, slopes.iter().map(|slope| dot(slope, &residuals))))
    }
}

fn covariance(normal: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    // Places in metres and logarithms are of different size: scaled, the matrix is well conditioned.
    let scale: Vec<_> = (0..normal.nrows()).map(|i| 1.0 / normal[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
    let scaled = DMatrix::from_fn(normal.nrows(), normal.ncols(), |i, j| normal[(i, j)] * scale[i] * scale[j]);
    let inverse = Cholesky::new(scaled)?.inverse();
    Some(DMatrix::from_fn(normal.nrows(), normal.ncols(), |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}
