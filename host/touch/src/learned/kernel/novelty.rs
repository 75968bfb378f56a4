//! Whether what describes readings is among that of the presses taught.
//!
//! By the variance of a Gaussian process, `1 - k' (K + M)^-1 k`: 0 among what is known, 1 far from everything. Only the nearest presses matter to
//! it, so that a system of their few equations is solved instead of one of all. What variance is usual is what each press has by the others.

use nalgebra::{DMatrix, DVector};

use super::classes::Classes;
use super::points::{Likeness, Points, square};
use super::regression::Regression;

/// Nearest presses that count: with 16 or 32, as many are flagged as with all 1200.
const NEIGHBOURS: usize = 32;

/// Tells what is new.
#[derive(Clone, Debug, PartialEq)]
pub struct Novelty {
    likeness: Likeness,
    /// Of each press.
    ridges: Vec<f64>,
    /// Largest usual variance, by the size of readings.
    pub limits: Vec<f64>,
}

impl Novelty {
    /// For a regression that has learned from presses in such classes; `presses` tells of which one each point is.
    pub fn of(regression: &Regression, points: &Points, classes: &Classes, presses: &[usize]) -> Self {
        let mut novelty = Self::with_limits(regression, points, Vec::new());
        let variance = |press: usize| {
            let [squares, _] = points.squares_to(points.at(press), novelty.likeness.components, 0);
            novelty.variance(points, &squares, points.log_sizes[press], |other| presses[other] != presses[press])
        };
        let variances: Vec<f64> = (0..points.count()).map(variance).collect();
        let sizes_v: Vec<f64> = points.log_sizes.iter().map(|log| log.exp()).collect();
        novelty.limits = classes.limits(&sizes_v, &variances);
        novelty
    }

    /// The same with limits that are known already.
    pub fn with_limits(regression: &Regression, points: &Points, limits: Vec<f64>) -> Self {
        let ridges = points.doubts.iter().map(|doubt| regression.ridge * doubt).collect();
        Self { likeness: regression.likeness, ridges, limits }
    }

    /// Whether readings are new with such squares of the distances to the presses; of such a size and its class.
    pub fn is_new(&self, points: &Points, squares: &[f64], log_size: f64, class: usize) -> bool {
        self.variance(points, squares, log_size, |_| true) > self.limits[class]
    }

    /// The variance by the points that count.
    fn variance(&self, points: &Points, squares: &[f64], log_size: f64, counts: impl Fn(usize) -> bool) -> f64 {
        let kernel = |press: usize| self.likeness.of(squares[press], log_size - points.log_sizes[press]);
        let mut near: Vec<(f64, usize)> =
            squares.iter().copied().zip(0..).filter(|(_, point)| counts(*point)).collect();
        if near.len() > NEIGHBOURS {
            near.select_nth_unstable_by(NEIGHBOURS, |a, b| a.0.total_cmp(&b.0));
            near.truncate(NEIGHBOURS);
        }
        let count = near.len();
        let mut among = DMatrix::zeros(count, count);
        for column in 0..count {
            let at = near[column].1;
            among[(column, column)] = 1.0 + self.ridges[at];
            for row in column + 1..count {
                let other = near[row].1;
                let square =
                    square(&points.at(at)[..self.likeness.components], &points.at(other)[..self.likeness.components]);
                among[(row, column)] = self.likeness.of(square, points.log_sizes[at] - points.log_sizes[other]);
            }
        }
        let kernels = DVector::from_iterator(count, near.iter().map(|(_, press)| kernel(*press)));
        // Presses that are the same to rounding: what is near to them is known.
        let Some(factor) = nalgebra::Cholesky::new(among) else { return 1.0 - kernels.max() };
        let mut whitened = kernels;
        factor.l_dirty().solve_lower_triangular_mut(&mut whitened);
        1.0 - whitened.norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learned::kernel::features::Description;
    use crate::learned::kernel::regression::Lesson;

    #[test]
    fn what_lies_among_the_presses_is_known_and_what_lies_beside_is_new() {
        let coordinates: Vec<f64> = (0..60).map(|i| f64::from(i) / 60.0).collect();
        let targets: Vec<f64> = coordinates.iter().map(|x| (5.0 * x).sin()).collect();
        let points = Points::new(Description::Directions, 1, coordinates, vec![0.0; 60]);
        let presses: Vec<usize> = (0..60).collect();
        let lesson = Lesson { points: &points, targets: &targets, count: 1, size_weight: 0.0, presses: &presses };
        let regression = Regression::learn(&lesson).unwrap();
        let novelty = Novelty::of(&regression, &points, &Classes::of(&[1.0; 60]), &presses);
        let is_new = |at: f64| novelty.is_new(&points, &points.squares_to(&[at], 1, 1)[0], 0.0, 0);
        assert!(!is_new(0.505) && !is_new(0.11));
        assert!(is_new(2.0) && is_new(-0.7));
    }
}
