//! Whether readings are like those of the presses taught.
//!
//! By the variance of a Gaussian process, `1 - k' (K + m)^-1 k`, on some of the presses, the judges: 0 at what they know, 1 far from
//! everything. The other presses say what variance is usual. The noise of light presses makes theirs larger, so usual is what others
//! of about the same size have.

use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Side};

use super::regression::Regression;

/// Most judges, and at most half of all presses: their cost in a frame is the square of their number.
const JUDGES: usize = 128;
/// Classes of presses by the size of their readings, of as many presses each.
const CLASSES: usize = 6;
/// Readings are new if their variance is more than so many times the largest in their class.
const NEWER: f64 = 3.0;

/// Tells what is new.
#[derive(Clone, Debug)]
pub struct Novelty {
    /// Every so many presses, one is a judge.
    step: usize,
    /// `judges x judges`, row by row.
    inverse: Vec<f64>,
    /// Smallest size, and largest variance, of each class; sizes rise.
    classes: Vec<(f64, f64)>,
}

impl Novelty {
    /// For a regression that has learned from presses of these sizes; `None` if too few are left to judge.
    pub fn of(regression: &Regression, sizes_v: &[f64]) -> Option<Self> {
        let count = sizes_v.len();
        let step = count.div_ceil(JUDGES).max(2);
        let kernels: Vec<Vec<f64>> = regression.points.iter().map(|point| regression.kernels(point)).collect();
        let judges = count.div_ceil(step);
        let ridge = regression.chosen.ridge;
        let among = Mat::from_fn(judges, judges, |i, j| kernels[i * step][j * step] + if i == j { ridge } else { 0.0 });
        let inverse = among.llt(Side::Lower).ok()?.inverse();
        let inverse = (0..judges * judges).map(|index| inverse[(index / judges, index % judges)]).collect();
        let mut novelty = Self { step, inverse, classes: Vec::new() };
        let others = (0..count).filter(|press| press % step != 0);
        let mut usual: Vec<(f64, f64)> =
            others.map(|press| (sizes_v[press], novelty.variance(&kernels[press]).max(ridge))).collect();
        usual.sort_by(|a, b| a.0.total_cmp(&b.0));
        let classes = usual.chunks(usual.len().div_ceil(CLASSES).max(1));
        novelty.classes =
            classes.map(|class| (class[0].0, class.iter().map(|press| press.1).fold(0.0, f64::max))).collect();
        (!novelty.classes.is_empty()).then_some(novelty)
    }

    /// Whether readings of such kernels with all presses, and of such a size, are new.
    pub fn is_new(&self, kernels: &[f64], size_v: f64) -> bool {
        let above = self.classes.partition_point(|(smallest_v, _)| *smallest_v <= size_v);
        let (_, usual) = self.classes[above.saturating_sub(1)];
        self.variance(kernels) > NEWER * usual
    }

    fn variance(&self, kernels: &[f64]) -> f64 {
        let of_judges: Vec<f64> = kernels.iter().copied().step_by(self.step).collect();
        let rows = self.inverse.chunks_exact(of_judges.len());
        let dot = |row: &[f64]| row.iter().zip(&of_judges).map(|(a, b)| a * b).sum::<f64>();
        1.0 - rows.zip(&of_judges).map(|(row, kernel)| dot(row) * kernel).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::kernel::regression::Points;

    #[test]
    fn what_lies_among_the_presses_is_known_and_what_lies_beside_is_new() {
        let points = Points { dimensions: 1, values: (0..60).map(|i| f64::from(i) / 60.0).collect() };
        let targets: Vec<f64> = points.values.iter().map(|x| (5.0 * x).sin()).collect();
        let regression = Regression::learn(points, &targets, 1).unwrap();
        let novelty = Novelty::of(&regression, &[1.0; 60]).unwrap();
        let is_new = |at: f64, size_v: f64| novelty.is_new(&regression.kernels(&[at]), size_v);
        for size_v in [0.1, 1.0, 10.0] {
            assert!(!is_new(0.505, size_v) && !is_new(0.11, size_v));
            assert!(is_new(2.0, size_v) && is_new(-0.7, size_v));
        }
    }
}
