//! A smooth function over the plane from values at some points: regression by a Gaussian process.
//!
//! The prior has mean zero and covariance `deviation^2 exp(-distance^2 / (2 length^2))`; values have independent noise of known variances. Mean,
//! variance, evidence and what leaving one out brings are in closed form (Rasmussen and Williams, *Gaussian Processes for Machine Learning*, 2006,
//! eqs. 2.25, 2.26, 2.30 and 5.12, the last after Sundararajan and Keerthi, *Neural Computation* 13, 2001).

use std::f64::consts::TAU;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// How smooth the function is before any value is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Prior {
    /// Distance over which it changes (m).
    pub length_m: f64,
    /// Its standard deviation, in the unit of the values.
    pub deviation: f64,
}

impl Prior {
    fn covariance(&self, a: [f64; 2], b: [f64; 2]) -> f64 {
        let square = (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
        self.deviation.powi(2) * (-0.5 * square / self.length_m.powi(2)).exp()
    }
}

/// What differs from value to value, besides the function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scatter {
    /// Its standard deviation where nothing is claimed.
    pub noise: f64,
    /// Share of a claimed standard error that adds to it.
    pub share: f64,
}

impl Scatter {
    /// Its variance, of a value with such a claimed standard error.
    pub fn variance(&self, claimed: f64) -> f64 {
        self.noise.powi(2) + (self.share * claimed).powi(2)
    }
}

/// What values at points say of a function.
#[derive(Clone, Debug)]
pub(crate) struct Process {
    prior: Prior,
    points_m: Vec<[f64; 2]>,
    values: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
    /// Inverse covariance of the values, times the values.
    weights: DVector<f64>,
}

/// Mean and variance of what is not known exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Known {
    /// Mean.
    pub mean: f64,
    /// Variance.
    pub variance: f64,
}

impl Process {
    /// Of values with such claimed standard errors; `None` if what differs from value to value is too little for numbers of 64 bits.
    pub fn scattered(
        prior: Prior,
        scatter: Scatter,
        points_m: &[[f64; 2]],
        values: &[f64],
        claimed: &[f64],
    ) -> Option<Self> {
        let noise: Vec<f64> = claimed.iter().map(|claimed| scatter.variance(*claimed)).collect();
        Self::new(prior, points_m, values, &noise)
    }

    /// Of values with such variances of their noise.
    fn new(prior: Prior, points_m: &[[f64; 2]], values: &[f64], noise: &[f64]) -> Option<Self> {
        let mut covariance =
            DMatrix::from_fn(points_m.len(), points_m.len(), |i, j| prior.covariance(points_m[i], points_m[j]));
        noise.iter().enumerate().for_each(|(i, noise)| covariance[(i, i)] += noise);
        let factor = Cholesky::new(covariance)?;
        let values = DVector::from_column_slice(values);
        let weights = factor.solve(&values);
        weights.iter().all(|weight| weight.is_finite()).then(|| Self {
            prior,
            points_m: points_m.to_vec(),
            values,
            factor,
            weights,
        })
    }

    /// The function at a point, without noise. Far from all points that is the prior.
    pub fn at(&self, at_m: [f64; 2]) -> Known {
        let to_points = DVector::from_iterator(
            self.points_m.len(),
            self.points_m.iter().map(|point| self.prior.covariance(*point, at_m)),
        );
        let mean = to_points.dot(&self.weights);
        let explained =
            self.factor.l_dirty().solve_lower_triangular(&to_points).map_or(0.0, |half| half.norm_squared());
        Known { mean, variance: (self.prior.deviation.powi(2) - explained).max(0.0) }
    }

    /// Logarithm of the probability density of the values before they were known.
    pub fn log_evidence(&self) -> f64 {
        let count = self.values.len() as f64;
        -0.5 * self.values.dot(&self.weights) - 0.5 * self.factor.ln_determinant() - 0.5 * count * TAU.ln()
    }

    /// Each value as the others tell it, with its noise.
    pub fn left_out(&self) -> Vec<Known> {
        let inverse = self.factor.inverse();
        let of = |i: usize| Known {
            mean: self.values[i] - self.weights[i] / inverse[(i, i)],
            variance: inverse[(i, i)].recip(),
        };
        (0..self.values.len()).map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRIOR: Prior = Prior { length_m: 0.02, deviation: 1.5 };

    #[test]
    fn two_points_by_hand() {
        let points_m = [[0.0, 0.0], [0.02, 0.0]];
        let process = Process::new(PRIOR, &points_m, &[1.0, -0.5], &[0.25, 0.5]).unwrap();
        // Covariance [[2.5, c], [c, 2.75]] with c = 2.25 exp(-1/2), half way between them k = 2.25 exp(-1/8) to both.
        let (c, k) = (2.25 * f64::exp(-0.5), 2.25 * f64::exp(-0.125));
        let determinant = 2.5 * 2.75 - c * c;
        let weights = [(2.75 + 0.5 * c) / determinant, (-c - 0.5 * 2.5) / determinant];
        let found = process.at([0.01, 0.0]);
        assert!((found.mean - k * (weights[0] + weights[1])).abs() < 1e-12, "{found:?}");
        let explained = k * k * (2.75 + 2.5 - 2.0 * c) / determinant;
        assert!((found.variance - (2.25 - explained)).abs() < 1e-12, "{found:?}");
        let log_evidence = -0.5 * (weights[0] - 0.5 * weights[1]) - 0.5 * determinant.ln() - TAU.ln();
        assert!((process.log_evidence() - log_evidence).abs() < 1e-12);
    }

    #[test]
    fn far_from_all_points_it_is_the_prior() {
        let process = Process::new(PRIOR, &[[0.0, 0.0]], &[1.0], &[0.01]).unwrap();
        let far = process.at([1.0, 0.0]);
        assert!(far.mean.abs() < 1e-12 && (far.variance - 2.25).abs() < 1e-12, "{far:?}");
        let near = process.at([0.0, 0.0]);
        assert!(
            (near.mean - 2.25 / 2.26).abs() < 1e-12 && (near.variance - 2.25 * 0.01 / 2.26).abs() < 1e-12,
            "{near:?}"
        );
    }

    #[test]
    fn leaving_one_out_is_the_process_of_the_others() {
        let mut random = fastrand::Rng::with_seed(3);
        let points_m: Vec<[f64; 2]> = (0..12).map(|_| [0.06 * random.f64(), 0.06 * random.f64()]).collect();
        let values: Vec<f64> = (0..12).map(|_| random.f64() - 0.5).collect();
        let noise: Vec<f64> = (0..12).map(|_| 0.05 + random.f64()).collect();
        let left_out = Process::new(PRIOR, &points_m, &values, &noise).unwrap().left_out();
        for (index, closed) in left_out.iter().enumerate() {
            let others = |all: &[f64]| [&all[..index], &all[index + 1..]].concat();
            let other_points_m = [&points_m[..index], &points_m[index + 1..]].concat();
            let refitted = Process::new(PRIOR, &other_points_m, &others(&values), &others(&noise)).unwrap();
            let found = refitted.at(points_m[index]);
            assert!((closed.mean - found.mean).abs() < 1e-9, "{index}");
            assert!((closed.variance - found.variance - noise[index]).abs() < 1e-9, "{index}");
        }
    }
}
