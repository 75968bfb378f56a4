//! Regression with a Gaussian kernel, its width and its ridge chosen by leaving one out.
//!
//! With `K[i][j] = exp(-|p_i - p_j|^2 / (2 w^2))` between points and the ridge `m`, a value at `p` is
//! `mean + sum_i K(p, p_i) a_i`, `a = (K + m)^-1 (y - mean)`. Left out, point `i` is missed by `a_i / ((K + m)^-1)_ii`: in closed form, so
//! that parameters are judged without fitting anew (Rasmussen and Williams, "Gaussian Processes for Machine Learning", 2006, eq. 5.12).

use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Side};

/// Widths that are tried, in medians of the distance between points.
const WIDTHS: [f64; 5] = [0.15, 0.3, 0.6, 1.2, 2.4];
/// Ridges that are tried.
const RIDGES: [f64; 6] = [1e-8, 1e-6, 1e-5, 1e-4, 1e-2, 0.1];
/// Ridge with which widths are compared.
const USUAL_RIDGE: f64 = 1e-3;
/// Points of a space of some dimensions, one after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Points {
    /// Coordinates of each.
    pub dimensions: usize,
    /// All of them.
    pub values: Vec<f64>,
}

impl Points {
    /// One after the other.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks_exact(self.dimensions)
    }

    /// Number of points.
    pub fn count(&self) -> usize {
        self.iter().len()
    }
}

fn square(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// A regression that has learned.
#[derive(Clone, Debug)]
pub struct Regression {
    /// What it has learned from.
    pub points: Points,
    /// `1 / (2 w^2)`.
    narrowness: f64,
    /// Means of the targets.
    means: Vec<f64>,
    /// `points x targets`, row by row.
    weights: Vec<f64>,
    /// What was chosen, and how good it is.
    pub chosen: Chosen,
}

/// Parameters, and what leaving one out says of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// Width of the kernel.
    pub width: f64,
    /// Ridge.
    pub ridge: f64,
    /// Root mean square of what is missed when a point is left out, for each target.
    pub left_out: Vec<f64>,
    /// Mean over the targets of its square in variances.
    score: f64,
}

/// What is learned from.
struct Lesson<'a> {
    points: &'a Points,
    squares: Mat<f64>,
    /// `points x targets`, less their means.
    targets: Mat<f64>,
    variances: Vec<f64>,
}

impl Regression {
    /// Learns targets (`points x targets`, row by row) at points; `None` if these are all alike, or no parameters serve.
    pub fn learn(points: Points, targets: &[f64], count: usize) -> Option<Self> {
        let rows = points.count();
        let mean = |target: usize| (0..rows).map(|row| targets[row * count + target]).sum::<f64>() / rows as f64;
        let means: Vec<f64> = (0..count).map(mean).collect();
        let targets = Mat::from_fn(rows, count, |row, target| targets[row * count + target] - means[target]);
        let lesson = Lesson::new(&points, targets);
        let chosen = lesson.choose()?;
        let (weights, _) = lesson.weights(chosen.width, chosen.ridge)?;
        let weights = (0..rows * count).map(|index| weights[(index / count, index % count)]).collect();
        Some(Self { narrowness: 0.5 / chosen.width.powi(2), points, means, weights, chosen })
    }

    /// Kernels of a point with all that were learned from.
    pub fn kernels(&self, point: &[f64]) -> Vec<f64> {
        self.points.iter().map(|known| (-self.narrowness * square(known, point)).exp()).collect()
    }

    /// The targets at a point of such kernels.
    pub fn values(&self, kernels: &[f64]) -> Vec<f64> {
        let mut values = self.means.clone();
        for (kernel, weights) in kernels.iter().zip(self.weights.chunks_exact(self.means.len())) {
            values.iter_mut().zip(weights).for_each(|(value, weight)| *value += kernel * weight);
        }
        values
    }
}

impl<'a> Lesson<'a> {
    fn new(points: &'a Points, targets: Mat<f64>) -> Self {
        let all: Vec<&[f64]> = points.iter().collect();
        let squares = Mat::from_fn(all.len(), all.len(), |i, j| square(all[i], all[j]));
        let variance =
            |target: usize| targets.col(target).iter().map(|value| value * value).sum::<f64>() / all.len() as f64;
        let variances = (0..targets.ncols()).map(variance).collect();
        Self { points, squares, targets, variances }
    }

    /// The best width with the usual ridge, then the best ridge with it.
    fn choose(&self) -> Option<Chosen> {
        let median = self.median_distance()?;
        let best = |tried: Vec<Chosen>| tried.into_iter().min_by(|a, b| a.score.total_cmp(&b.score));
        let widths = WIDTHS.iter().filter_map(|share| self.judge(share * median, USUAL_RIDGE)).collect();
        let with_width = best(widths)?;
        let ridges = RIDGES.iter().filter_map(|&ridge| self.judge(with_width.width, ridge));
        best(ridges.chain([with_width.clone()]).collect())
    }

    fn median_distance(&self) -> Option<f64> {
        let rows = self.points.count();
        let mut squares: Vec<f64> = (1..rows).map(|row| self.squares[(row, row / 2)]).collect();
        squares.sort_by(f64::total_cmp);
        squares.get(rows / 2).map(|square| square.sqrt()).filter(|distance| *distance > 0.0)
    }

    /// What leaving one out says of parameters; `None` if they cannot be used.
    fn judge(&self, width: f64, ridge: f64) -> Option<Chosen> {
        let (weights, diagonal) = self.weights(width, ridge)?;
        let rows = diagonal.len();
        let missed = |target: usize| {
            let square: f64 = (0..rows).map(|row| (weights[(row, target)] / diagonal[row]).powi(2)).sum();
            square / rows as f64
        };
        let squares: Vec<f64> = (0..self.targets.ncols()).map(missed).collect();
        let shares =
            squares.iter().zip(&self.variances).map(|(square, variance)| square / variance.max(f64::MIN_POSITIVE));
        let score = shares.sum::<f64>() / squares.len() as f64;
        let left_out = squares.iter().map(|square| square.sqrt()).collect();
        score.is_finite().then_some(Chosen { width, ridge, left_out, score })
    }

    fn kernel(&self, width: f64, ridge: f64) -> Mat<f64> {
        let narrowness = 0.5 / (width * width);
        let rows = self.squares.nrows();
        Mat::from_fn(rows, rows, |i, j| (-narrowness * self.squares[(i, j)]).exp() + if i == j { ridge } else { 0.0 })
    }

    /// `(K + m)^-1` times the targets, and its diagonal; `None` if it is singular to rounding.
    fn weights(&self, width: f64, ridge: f64) -> Option<(Mat<f64>, Vec<f64>)> {
        let inverse = self.kernel(width, ridge).llt(Side::Lower).ok()?.inverse();
        let rows = inverse.nrows();
        let diagonal: Vec<f64> = (0..rows).map(|row| inverse[(row, row)]).collect();
        let usable = diagonal.iter().all(|value| value.is_finite() && *value > 0.0);
        usable.then(|| (&inverse * &self.targets, diagonal))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Points {
        let even = |i: u32| [0.754_877_666, 0.569_840_291].map(|step| (f64::from(i) * step).fract());
        Points { dimensions: 2, values: (0..60).flat_map(even).collect() }
    }

    fn targets(points: &Points, noise: f64) -> Vec<f64> {
        let of = |(index, point): (usize, &[f64])| {
            let wiggle = noise * if index % 2 == 0 { 1.0 } else { -1.0 };
            [(3.0 * point[0]).sin() + point[1] + wiggle, point[0] * point[1]]
        };
        points.iter().enumerate().flat_map(of).collect()
    }

    #[test]
    fn a_smooth_function_is_learned() {
        let points = points();
        let regression = Regression::learn(points.clone(), &targets(&points, 0.0), 2).unwrap();
        let values = regression.values(&regression.kernels(&[0.4, 0.55]));
        assert!((values[0] - (1.2f64.sin() + 0.55)).abs() < 0.01 && (values[1] - 0.22).abs() < 0.01, "{values:?}");
    }

    #[test]
    fn leaving_one_out_in_closed_form_is_leaving_one_out() {
        let points = points();
        let all = targets(&points, 0.05);
        let lesson = |points: &Points, targets: &[f64]| {
            let rows = points.count();
            let targets = Mat::from_fn(rows, 2, |row, target| targets[row * 2 + target]);
            let (weights, diagonal) = Lesson::new(points, targets).weights(0.4, 1e-3).unwrap();
            (weights, diagonal)
        };
        let (weights, diagonal) = lesson(&points, &all);
        for left_out in [0, 7, 29] {
            let others = |values: &[f64]| {
                let rows = values.chunks_exact(2).enumerate().filter(|(row, _)| *row != left_out);
                rows.flat_map(|(_, values)| values.to_vec()).collect::<Vec<f64>>()
            };
            let rest = Points { dimensions: 2, values: others(&points.values) };
            let (fewer, _) = lesson(&rest, &others(&all));
            let at = &points.values[2 * left_out..][..2];
            let predicted: f64 =
                rest.iter().enumerate().map(|(i, point)| (-square(point, at) / 0.32).exp() * fewer[(i, 0)]).sum();
            let missed = all[2 * left_out] - predicted;
            assert!((missed - weights[(left_out, 0)] / diagonal[left_out]).abs() < 1e-8, "{left_out}");
        }
    }

    #[test]
    fn noise_asks_for_a_ridge_and_what_is_left_out_tells_of_it() {
        let points = points();
        let chosen = |noise| Regression::learn(points.clone(), &targets(&points, noise), 2).unwrap().chosen;
        let (clean, noisy) = (chosen(0.0), chosen(0.2));
        assert!(noisy.ridge > clean.ridge, "{noisy:?} {clean:?}");
        assert!(clean.left_out[0] < 0.02 && noisy.left_out[0] > 0.1, "{noisy:?} {clean:?}");
    }

    #[test]
    fn points_that_are_all_alike_teach_nothing() {
        let points = Points { dimensions: 1, values: vec![0.5; 20] };
        assert!(Regression::learn(points, &[1.0; 20], 1).is_none());
    }
}
