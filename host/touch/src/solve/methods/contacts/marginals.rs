//! Marginal distributions of a contact's conductance and radius: what readings say of each apart from the other.
//!
//! Of a firm contact they give the resistance of the contact with that of the crowded current under it, `1/C + S`, far better than
//! either: `C` may be anything from some value on, the better the narrower the contact. So its logarithm is not normally
//! distributed, and its mean and deviation are sums over a grid of the fit's two parameters: the likelihood's parabola times the
//! prior of both logarithms. The readings are nearly linear in the first, and in the square of the radius, as what a disc does
//! beyond a spot are its second moments: against the finest slab, the sum of squares of a contact of 2.5 mm and 3 sheet conductances
//! on `square-60` is 0.2 to 0.35 times the square of the change of that square (mm2) from 2 to 4.6 mm.

use super::discs::{DiscFit, PARAMETERS, by_parameters};
use nalgebra::{DMatrix, Matrix2, Vector2};

/// Points along each parameter, and how far they reach (standard deviations).
const POINTS: [usize; 2] = [9, 33];
const REACH: f64 = 3.5;

/// Mean and standard deviation of two logarithms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Logs {
    /// Of the conductance (S).
    pub conductance: [f64; 2],
    /// Of the radius (m).
    pub radius: [f64; 2],
}

/// What is known of both before anything is read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Usual {
    pub conductance_s: f64,
    /// Standard deviation of its logarithm.
    pub conductance_deviation: f64,
    pub most_s: f64,
    pub radius_m: f64,
    pub radius_deviation: f64,
}

impl Usual {
    /// Logarithms of a contact's conductance and radius, from the fit and its covariance; `None` where they are not determined.
    pub fn logs(&self, fit: &DiscFit, k: usize, covariance: &DMatrix<f64>) -> Option<Logs> {
        let contact = fit.contacts[k];
        let start = PARAMETERS * k + 2;
        let of = |i: usize, j: usize| covariance[(start + i, start + j)];
        let posterior = Matrix2::new(of(0, 0), of(0, 1), of(1, 0), of(1, 1));
        let constriction = fit.constriction(k);
        let weights = [self.conductance_deviation.powi(-2), self.radius_deviation.powi(-2)];
        // Of the likelihood alone: without the prior's curvature, and with what pulls against the prior's slope.
        let by_conductance = Vector2::from(by_parameters(constriction));
        let by_radius = Vector2::new(0.0, 1.0);
        let prior =
            by_conductance * by_conductance.transpose() * weights[0] + by_radius * by_radius.transpose() * weights[1];
        let likelihood = posterior.try_inverse()? - prior;
        let at = [(contact.conductance_s / self.conductance_s).ln(), (contact.radius_m / self.radius_m).ln()];
        let pull = by_conductance * (at[0] * weights[0]) + by_radius * (at[1] * weights[1]);
        // Along the first parameter about its mean for each of the second's.
        let deviations =
            [(of(0, 0) - of(0, 1) * of(0, 1) / of(1, 1)).max(0.0).sqrt(), of(1, 1).sqrt().min(self.radius_deviation)];
        let slope = of(0, 1) / of(1, 1);
        let mut points = Vec::with_capacity(POINTS[0] * POINTS[1]);
        let narrowest = -REACH * self.radius_deviation;
        let [low, high] =
            [-1.0, 1.0].map(|side| (1.0 + side * 2.0 * REACH * deviations[1]).max((2.0 * narrowest).exp()).ln() / 2.0);
        for j in 0..POINTS[1] {
            let wider = low + (high - low) * j as f64 / (POINTS[1] - 1) as f64;
            let square = 0.5 * ((2.0 * wider).exp() - 1.0);
            for i in 0..POINTS[0] {
                let more = slope * square + REACH * deviations[0] * spread(i, POINTS[0]);
                // Resistance of all and of the contact alone, in what that is at the fit.
                let all = (1.0 + constriction) * (-more).exp();
                let own = all - constriction * (-wider).exp();
                if own <= contact.conductance_s / self.most_s {
                    continue;
                }
                let step = Vector2::new(more, square);
                let logs = [at[0] - own.ln(), at[1] + wider];
                let ln_weight = pull.dot(&step) - 0.5 * step.dot(&(likelihood * step))
                    - 0.5 * (logs[0] * logs[0] * weights[0] + logs[1] * logs[1] * weights[1])
                    // From the step to the logarithm of the conductance.
                    + (all / own).ln();
                points.push((ln_weight, logs));
            }
        }
        let highest = points.iter().map(|(weight, _)| *weight).fold(f64::NEG_INFINITY, f64::max);
        let mean = |of: &dyn Fn(&[f64; 2]) -> f64| {
            let sums = points.iter().map(|(weight, logs)| ((weight - highest).exp(), of(logs)));
            let (all, sum) = sums.fold((0.0, 0.0), |(all, sum), (weight, value)| (all + weight, sum + weight * value));
            sum / all
        };
        let of = |log: usize| {
            let middle = mean(&|logs| logs[log]);
            [middle, mean(&|logs| (logs[log] - middle).powi(2)).sqrt()]
        };
        let ([conductance, conductance_deviation], [radius, radius_deviation]) = (of(0), of(1));
        let found = Logs {
            conductance: [conductance + self.conductance_s.ln(), conductance_deviation],
            radius: [radius + self.radius_m.ln(), radius_deviation],
        };
        (found.conductance.iter().chain(&found.radius).all(|value| value.is_finite())).then_some(found)
    }
}

/// Points from -1 to 1.
fn spread(i: usize, count: usize) -> f64 {
    2.0 * i as f64 / (count - 1) as f64 - 1.0
}
