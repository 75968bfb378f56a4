//! How much the readings speak for a strip, on the scale of those for contacts and images.
//!
//! The marginal likelihood by Laplace's approximation about the best fit, with `S` the sum of squares of residuals and priors and `H` half its
//! second derivative by the `P` parameters:
//!
//! ```text
//! ln p = -S / 2 + sum of ln(prior densities' peaks) + P / 2 ln(2 pi) - 1/2 ln det H
//! ```
//!
//! (Kass and Raftery, Bayes factors, 1995.) A line's ends and a circle's middle are alike likely all over the detector, and ends have no order;
//! so are radii up to the largest, whose logarithm is fitted. Logarithms of width and conductance are normal.

use std::f64::consts::TAU;

use nalgebra::{Cholesky, DMatrix};

use super::fit::Usual;
use super::strip::{Course, Strip};
use crate::solve::fit::policy;

impl Usual {
    /// Logarithm of the density of a strip's parameters before anything is read, but for what its residuals have of it.
    fn ln_peak(&self, strip: &Strip) -> f64 {
        let normal = |deviation: f64| -(deviation * TAU.sqrt()).ln();
        let course = match strip.course {
            Course::Line(_) => 2.0_f64.ln() - 2.0 * self.area_m2.ln(),
            Course::Ring { radius_m, .. } => (radius_m / self.largest_radius_m()).ln() - self.area_m2.ln(),
        };
        course + normal(self.width_deviation) + normal(self.conductance_deviation) - policy::SHAPE_NATS
    }

    /// What it takes to say a strip, in squares of deviations; `matrix` is that of the normal equations, and `known` the squares of what is
    /// known before. One that is not determined is worth nothing.
    pub(super) fn price(&self, strip: &Strip, known: f64, matrix: Option<&DMatrix<f64>>) -> f64 {
        let Some(factor) = matrix.and_then(|matrix| Cholesky::new(matrix.clone())) else { return f64::INFINITY };
        known - 2.0 * self.ln_peak(strip) - strip.parameters() as f64 * TAU.ln() + factor.ln_determinant()
    }
}
