//! How far known contacts have moved, by how readings have changed along their derivatives.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::solve::fit::dot::dot;

/// Parameters of a contact that are tested together: the place, and the strength with the size.
const TOGETHER: usize = 2;

/// What contacts that are known would change when they move.
pub(super) struct Moves<'a> {
    /// Derivatives of the readings by their parameters (V).
    slopes_v: &'a [Vec<f64>],
    /// Covariance of the parameters by a reading's noise.
    covariance: DMatrix<f64>,
    variance_v2: f64,
}

impl<'a> Moves<'a> {
    /// Of contacts by whose parameters readings have the derivatives `slopes_v` (V); `None` if there are none. No parameter is expected
    /// to change by more than about one, which is a radius, or a factor of e.
    pub fn new(slopes_v: &'a [Vec<f64>], noise_v: f64) -> Option<Self> {
        let size = slopes_v.len();
        let variance_v2 = noise_v * noise_v;
        let mut normal = DMatrix::identity(size, size);
        for i in 0..size {
            for j in 0..=i {
                let product = dot(&slopes_v[i], &slopes_v[j]) / variance_v2;
                normal[(i, j)] += product;
                normal[(j, i)] = normal[(i, j)];
            }
        }
        let covariance = Cholesky::new(normal).filter(|_| size > 0)?.inverse();
        Some(Self { slopes_v, covariance, variance_v2 })
    }

    /// Largest square of the Mahalanobis length of what parameters that belong together have changed by, if the readings have by `change_v`.
    pub fn largest(&self, change_v: &[f64]) -> f64 {
        let along = self.slopes_v.iter().map(|slope| dot(slope, change_v) / self.variance_v2);
        let change = &self.covariance * DVector::from_iterator(self.slopes_v.len(), along);
        let pairs = (0..self.slopes_v.len() / TOGETHER).map(|pair| TOGETHER * pair);
        pairs.map(|start| self.square_length(&change, start)).fold(0.0, f64::max)
    }

    fn square_length(&self, change: &DVector<f64>, start: usize) -> f64 {
        let of = |i: usize, j: usize| self.covariance[(start + i, start + j)];
        let (a, b) = (change[start], change[start + 1]);
        let determinant = of(0, 0) * of(1, 1) - of(0, 1) * of(1, 0);
        (a * a * of(1, 1) - 2.0 * a * b * of(0, 1) + b * b * of(0, 0)) / determinant.max(f64::MIN_POSITIVE)
    }
}
