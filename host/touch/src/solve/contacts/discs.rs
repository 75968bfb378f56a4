//! Contacts whose radius is found too: the forward model itself, fitted.
//!
//! Only where spots of the usual radius cannot explain the readings: a contact that is wide, or so firm that it conducts better
//! than a perfect one of that radius. Derivatives are differences, for the radius changes all of the model's tables.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::target::{Target, dot};
use crate::solve::Problem;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::spots::SpotFields;
use tactomo_physics::forward::{ForwardModel, readings_v};
use tactomo_physics::scene::Contact;
use tactomo_physics::space;

/// Parameters of a disc: x, y, logarithm of the conductance, logarithm of the radius.
pub(super) const PARAMETERS: usize = 4;
/// Standard deviation of the logarithm of a radius before anything is read: a factor of two or so.
pub(super) const RADIUS_DEVIATION: f64 = 0.7;
/// The same of a conductance around the sheet's: nearly nothing is known.
const CONDUCTANCE_DEVIATION: f64 = 4.0;
/// Differences, in radii for places.
const DIFFERENCE: f64 = 1e-3;
/// Longest change of a logarithm in a step.
const LONGEST_LOG: f64 = 0.7;
/// After so many steps, a fit that still leaves this times what noise and model error make is given up.
const PROBATION: usize = 5;
const HOPELESS: f64 = 30.0;
/// Widest radius, in halves of the side of a square of the detector's area, or of its outline's shorter side: what is wider is an
/// image's business.
const WIDEST: f64 = 0.6;
/// Tries of one step, and the share of the cost below which a step is the last.
const TRIES: usize = 4;
const SMALL: f64 = 1e-4;

/// Discs that fit best.
#[derive(Clone, Debug)]
pub(super) struct DiscFit {
    pub contacts: Vec<Contact>,
    /// Sum of squares of the weighted residuals, without what was known before.
    pub cost: f64,
    /// Of the parameters, [`PARAMETERS`] for each contact.
    pub covariance: Option<DMatrix<f64>>,
    pub settled: bool,
}

/// What disc fits need beside the target.
pub(super) struct DiscFitter<'a> {
    pub model: &'a dyn ForwardModel,
    pub usual_radius_m: f64,
    pub sheet_s: f64,
    /// Where a disc may be.
    pub fields: &'a dyn SpotFields,
    /// Widest radius (m).
    pub widest_m: f64,
    /// The detector as measured.
    pub detector: &'a Detector,
}

/// Widest radius of a disc on a detector (m).
pub(super) fn widest_m(problem: &Problem) -> f64 {
    let area_m2: f64 = problem.jacobian.image_mesh.node_areas_m2.iter().sum();
    let [width_m, height_m] = problem.detector().outline.size_m();
    0.5 * WIDEST * area_m2.sqrt().min(width_m).min(height_m)
}

impl DiscFitter<'_> {
    /// The nearest minimum from a start, in at most so many steps; `None` if the start makes no sense.
    pub fn fit(&self, start: Vec<Contact>, target: &Target, steps: usize) -> Option<DiscFit> {
        let mut at = start;
        let mut residuals = self.residuals(&at, target)?;
        let (mut damping, mut settled, mut normal) = (1e-3, false, None);
        for count in 0..steps {
            if count == PROBATION && dot(&residuals, &residuals) > HOPELESS * target.count() as f64 {
                return None;
            }
            let (matrix, gradient) = self.equations(&at, &residuals, target)?;
            let next = self.step(&at, &residuals, target, (&matrix, &gradient), &mut damping);
            normal = Some(matrix);
            let Some((contacts, left)) = next else {
                settled = true;
                break;
            };
            let (before, after) = (dot(&residuals, &residuals), dot(&left, &left));
            (at, residuals) = (contacts, left);
            if before - after < SMALL * before {
                settled = true;
                break;
            }
        }
        let count = target.volts.len();
        let cost = dot(&residuals[..count], &residuals[..count]);
        let covariance = normal.and_then(Cholesky::new).map(|factor| factor.inverse());
        Some(DiscFit { contacts: at, cost, covariance, settled })
    }

    fn step(
        &self,
        at: &[Contact],
        residuals: &[f64],
        target: &Target,
        (normal, gradient): (&DMatrix<f64>, &DVector<f64>),
        damping: &mut f64,
    ) -> Option<(Vec<Contact>, Vec<f64>)> {
        for _ in 0..TRIES {
            let mut damped = normal.clone();
            (0..damped.nrows()).for_each(|i| damped[(i, i)] *= 1.0 + *damping);
            let moved = Cholesky::new(damped).map(|factor| self.moved(at, factor.solve(gradient).as_slice()));
            if let Some(moved) = moved
                && let Some(left) = self.residuals(&moved, target)
                && dot(&left, &left) < dot(residuals, residuals)
            {
                *damping = (*damping * 0.1).max(1e-6);
                return Some((moved, left));
            }
            *damping *= 10.0;
        }
        None
    }

    /// Contacts after a step in their parameters: places in radii.
    fn moved(&self, at: &[Contact], step: &[f64]) -> Vec<Contact> {
        let (steps, _) = step.as_chunks::<PARAMETERS>();
        let moved = |(contact, [by_x, by_y, by_s, by_m]): (&Contact, &[f64; PARAMETERS])| {
            let shorten = (2.0 / by_x.hypot(*by_y)).min(1.0) * contact.radius_m;
            let limited = |log: f64| log.clamp(-LONGEST_LOG, LONGEST_LOG).exp();
            let place_m = [contact.x_m, contact.y_m, contact.z_m];
            let (place_m, [first, second]) = self.fields.footing(place_m);
            let place_m = space::along(space::along(place_m, shorten * by_x, first), shorten * by_y, second);
            let [x_m, y_m, z_m] = self.fields.footing(place_m).0;
            Contact {
                x_m,
                y_m,
                z_m,
                conductance_s: contact.conductance_s * limited(*by_s),
                radius_m: (contact.radius_m * limited(*by_m)).min(self.widest_m),
            }
        };
        at.iter().zip(steps).map(moved).collect()
    }

    /// Weighted differences of the readings from those of contacts; then those of the parameters from what is usual.
    fn residuals(&self, contacts: &[Contact], target: &Target) -> Option<Vec<f64>> {
        let impedance_ohm = self.model.impedance_ohm(contacts).ok()?;
        let volts = readings_v(&impedance_ohm, self.detector);
        let mut residuals = target.residuals(volts.volts());
        for contact in contacts {
            residuals.push(-(contact.conductance_s / self.sheet_s).ln() / CONDUCTANCE_DEVIATION);
            residuals.push(-(contact.radius_m / self.usual_radius_m).ln() / RADIUS_DEVIATION);
        }
        residuals.iter().all(|residual| residual.is_finite()).then_some(residuals)
    }

    fn equations(&self, at: &[Contact], residuals: &[f64], target: &Target) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let size = PARAMETERS * at.len();
        let slopes = (0..size)
            .map(|parameter| {
                let mut step = vec![0.0; size];
                // Backwards if the edge is in the way.
                step[parameter] = DIFFERENCE;
                let mut moved = self.moved(at, &step);
                if moved == at {
                    step[parameter] = -DIFFERENCE;
                    moved = self.moved(at, &step);
                }
                let left = self.residuals(&moved, target)?;
                Some(left.iter().zip(residuals).map(|(after, before)| (before - after) / step[parameter]).collect())
            })
            .collect::<Option<Vec<Vec<f64>>>>()?;
        let normal = DMatrix::from_fn(size, size, |i, j| dot(&slopes[i], &slopes[j]));
        let gradient = DVector::from_iterator(size, slopes.iter().map(|slope| dot(slope, residuals)));
        Some((normal, gradient))
    }
}
