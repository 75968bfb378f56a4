//! Gauss-Legendre quadrature.

use std::f64::consts::PI;

/// Nodes and weights of `count` points on `[0, 1]`.
pub(super) fn gauss_legendre(count: usize) -> Vec<[f64; 2]> {
    (0..count)
        .map(|i| {
            let mut x = (PI * (i as f64 + 0.75) / (count as f64 + 0.5)).cos();
            let mut slope = 1.0;
            // Newton's iteration from this start doubles its digits five times.
            for _ in 0..6 {
                let value;
                [value, slope] = legendre(count, x);
                x -= value / slope;
            }
            [0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope)]
        })
        .collect()
}

/// `count` points on each interval between neighbouring `edges`.
pub(super) fn panels(edges: &[f64], count: usize) -> Vec<[f64; 2]> {
    let rule = gauss_legendre(count);
    edges
        .windows(2)
        .flat_map(|edge| rule.iter().map(|[x, w]| [edge[0] + (edge[1] - edge[0]) * x, (edge[1] - edge[0]) * w]))
        .collect()
}

/// Legendre polynomial of a degree and its slope.
fn legendre(degree: usize, x: f64) -> [f64; 2] {
    let (mut before, mut value) = (1.0, x);
    for n in 2..=degree {
        let n = n as f64;
        (before, value) = (value, ((2.0 * n - 1.0) * x * value - (n - 1.0) * before) / n);
    }
    [value, degree as f64 * (x * value - before) / (x * x - 1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn n_points_integrate_degree_2n_minus_1_exactly() {
        for count in 1..12 {
            for degree in 0..2 * count as i32 {
                let sum: f64 = gauss_legendre(count).iter().map(|[x, w]| w * x.powi(degree)).sum();
                assert!((sum * f64::from(degree + 1) - 1.0).abs() < 1e-13, "{count} points, degree {degree}");
            }
        }
    }
}
