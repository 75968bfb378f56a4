//! What is known of contacts' parameters once a frame is read.

use crate::normal::{Normal, STRENGTH};
use crate::real::Real;
use crate::vector::{Matrix, PARAMETERS, Vector};

/// Damping that keeps rounding from having the say.
const ROUNDING: f32 = 1e-6;

/// Normal distribution of the parameters.
#[derive(Clone, Debug)]
pub(crate) struct Posterior<T, const K: usize> {
    pub covariance: Matrix<T, K>,
    /// From where the normal equations were summed up to the mean.
    pub step: Vector<T, K>,
    /// Logarithm of the determinant of the inverse of the covariance.
    pub ln_determinant: T,
}

impl<T: Real, const K: usize> Posterior<T, K> {
    /// By normal equations, with a prior of these weights; `None` where parameters are not determined.
    pub fn of(normal: &Normal<T, K>, weights: &Vector<T, K>) -> Option<Self> {
        let mut all = *normal;
        (0..all.count).for_each(|i| all.matrix[i][i] += weights[i]);
        let factor = Factor::of(&all, T::of(ROUNDING))?;
        let mut covariance = Matrix::<T, K>::ZERO;
        for (i, column) in covariance.iter_mut().enumerate().take(all.count) {
            column[i] = T::ONE;
            factor.solve(column);
        }
        let mut step = all.pull;
        factor.solve(&mut step);
        Some(Self { covariance, step, ln_determinant: factor.ln_determinant() })
    }

    /// What the readings say for each contact (squared deviations): of a light one, whose readings are in proportion to its conductance, the square of them is that
    /// of the derivative by its logarithm, or what others leave of that. Where it is does not count: that one is there may be told where its place is not.
    pub fn information(&self, normal: &Normal<T, K>) -> [T; K] {
        core::array::from_fn(|k| {
            let first = PARAMETERS * k;
            let left = inverse_diagonal(core::array::from_fn(|i| {
                core::array::from_fn(|j| self.covariance[first + i][first + j])
            }));
            normal.matrix[first + STRENGTH][first + STRENGTH].min(left).min(normal.said[k])
        })
    }
}

/// The element of the inverse of a contact's covariance that is that of its strength: one over the variance if the rest were known.
fn inverse_diagonal<T: Real>(mut covariance: [[T; PARAMETERS]; PARAMETERS]) -> T {
    for pivot in (0..PARAMETERS).filter(|pivot| *pivot != STRENGTH) {
        let row = covariance[pivot];
        for other in covariance.iter_mut().enumerate().filter(|(i, _)| *i != pivot).map(|(_, other)| other) {
            let factor = other[pivot] / row[pivot];
            other.iter_mut().zip(row).for_each(|(value, of_pivot)| *value -= factor * of_pivot);
        }
    }
    T::ONE / covariance[STRENGTH][STRENGTH].max(T::min_positive_value())
}

/// Cholesky factor of a damped normal matrix whose diagonal is scaled to one.
pub(crate) struct Factor<T, const K: usize> {
    count: usize,
    rows: Matrix<T, K>,
    scale: Vector<T, K>,
}

impl<T: Real, const K: usize> Factor<T, K> {
    /// Of a normal matrix; `None` where that is not positive definite.
    pub fn of(normal: &Normal<T, K>, damping: T) -> Option<Self> {
        let count = normal.count;
        let mut scale = Vector::<T, K>::ZERO;
        for i in 0..count {
            let own = normal.matrix[i][i];
            if !(own > T::ZERO && own.is_finite()) {
                return None;
            }
            scale[i] = T::ONE / own.sqrt();
        }
        let mut rows = Matrix::<T, K>::ZERO;
        for i in 0..count {
            for j in 0..=i {
                let own = if i == j { T::ONE + damping } else { normal.matrix[i][j] * scale[i] * scale[j] };
                let sum: T = own - (0..j).map(|k| rows[i][k] * rows[j][k]).sum::<T>();
                rows[i][j] = match i == j {
                    // Below that, rounding has the say.
                    true if sum > T::of(1e-6) => sum.sqrt(),
                    true => return None,
                    false => sum / rows[j][j],
                };
            }
        }
        Some(Self { count, rows, scale })
    }

    /// Square of a vector in the metric of the matrix's inverse.
    pub fn square(&self, mut right: Vector<T, K>) -> T {
        self.forward(&mut right);
        right.iter().take(self.count).map(|value| *value * *value).sum()
    }

    pub fn forward(&self, right: &mut Vector<T, K>) {
        for i in 0..self.count {
            let sum: T = (0..i).map(|j| self.rows[i][j] * right[j]).sum();
            right[i] = (right[i] * self.scale[i] - sum) / self.rows[i][i];
        }
    }

    /// Logarithm of the determinant of the matrix.
    pub fn ln_determinant(&self) -> T {
        T::of(2.0) * (0..self.count).map(|i| (self.rows[i][i] / self.scale[i]).ln()).sum::<T>()
    }

    /// Solves the equations for a right side.
    pub fn solve(&self, right: &mut Vector<T, K>) {
        self.forward(right);
        for i in (0..self.count).rev() {
            let sum: T = (i + 1..self.count).map(|j| self.rows[j][i] * right[j]).sum();
            right[i] = (right[i] - sum) / self.rows[i][i];
        }
        (0..self.count).for_each(|i| right[i] *= self.scale[i]);
    }
}
