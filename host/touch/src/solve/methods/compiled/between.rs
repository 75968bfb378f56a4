//! Fields between places: a part that goes by their distance, and one that walls and pads make.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::table::{CompileError, Grid, failed};
use crate::solve::problem::Problem;
use tactomo_physics::forward::spots::Spot;
use tactomo_touch_core::spline::{interval, weights};

/// Coefficients over distances.
const KNOTS: usize = 16;
/// Places whose fields at each other are fitted, about, and every so many pairs that are.
const PAIRED: usize = 400;
const PAIR_STRIDE: usize = 5;
/// Share of the diagonal that is added to it where a fit is not determined.
const RIDGE: f64 = 1e-9;

/// Fields between places.
pub(super) struct Between {
    /// Distance that the spline begins at (m).
    pub near_m: f64,
    /// Step of `ln r`.
    pub ln_step: f64,
    /// Coefficients of the spline over distances (ohm).
    pub distances: Vec<f64>,
    /// `Q`: lower triangle.
    pub walls: Vec<f64>,
}

impl Between {
    /// Fits both parts to fields between pairs of places on the detector, by least squares.
    pub fn of(problem: &Problem, grid: &Grid) -> Result<Self, CompileError> {
        let radius_m = problem.usual_radius_m();
        let fields = problem.model.spots(radius_m).ok_or_else(|| failed(problem, "the model has no small contacts"))?;
        let places_m = grid.places_m(problem, 1);
        let stride = places_m.len().div_ceil(PAIRED);
        let spots: Vec<_> = places_m.iter().step_by(stride).map(|[x, y]| fields.spot([*x, *y, 0.0])).collect();
        let n = problem.detector().electrodes.len();
        let means: Vec<_> = spots.iter().map(|spot| spot.electrodes_ohm.iter().sum::<f64>() / n as f64).collect();
        let [low_m, high_m] = problem.detector().outline.bounds();
        let far_m = (high_m[0] - low_m[0]).hypot(high_m[1] - low_m[1]);
        let ln_step = (far_m / radius_m).ln() / (KNOTS - 3) as f64;
        let scale_ohm =
            spots.iter().zip(&means).map(|(spot, mean)| largest(&spot.electrodes_ohm, *mean)).fold(0.0, f64::max);
        let basis = |spot: &Spot, mean: f64| {
            let fields = spot.electrodes_ohm.iter().map(move |ohm| (ohm - mean) / scale_ohm);
            fields.chain([1.0]).collect::<Vec<_>>()
        };
        let bases: Vec<_> = spots.iter().zip(&means).map(|(spot, mean)| basis(spot, *mean)).collect();
        let count = KNOTS + (n + 1) * (n + 2) / 2;
        let (mut matrix, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
        let pairs = (0..spots.len()).flat_map(|k| (0..k).map(move |l| (k, l)));
        let mut row = vec![0.0; count];
        for (k, l) in pairs.step_by(PAIR_STRIDE) {
            let [a, b] = [spots[k].place_m, spots[l].place_m];
            let distance_m = (a[0] - b[0]).hypot(a[1] - b[1]);
            if distance_m < radius_m {
                continue;
            }
            let ohm = fields.between_ohm(&spots[k], &spots[l]) - means[k] - means[l];
            equation((distance_m / radius_m).ln() / ln_step, [&bases[k], &bases[l]], &mut row);
            add(&mut matrix, &mut right, &row, ohm);
        }
        (0..count).for_each(|i| matrix[(i, i)] += RIDGE * (1.0 + matrix[(i, i)]));
        matrix.fill_upper_triangle_with_lower_triangle();
        let factor =
            Cholesky::new(matrix).ok_or_else(|| failed(problem, "places do not determine what is between them"))?;
        let found = factor.solve(&right);
        let units = |s: usize| if s == n { 1.0 } else { scale_ohm };
        let indices = (0..=n).flat_map(|s| (0..=s).map(move |t| (s, t)));
        let walls = indices.zip(found.iter().skip(KNOTS)).map(|((s, t), q)| q / (units(s) * units(t))).collect();
        Ok(Self { near_m: radius_m, ln_step, distances: found.iter().take(KNOTS).copied().collect(), walls })
    }
}

/// Factors of the unknowns, coefficients over distances and then of the form, in the field between two places so many steps of `ln r` apart.
fn equation(steps: f64, [a, b]: [&[f64]; 2], row: &mut [f64]) {
    row.fill(0.0);
    let (first, t) = interval(steps as f32, KNOTS - 3);
    weights(t).value.iter().enumerate().for_each(|(i, weight)| row[first + i] = f64::from(*weight));
    let pairs = (0..a.len()).flat_map(|s| (0..=s).map(move |t| (s, t)));
    for (factor, (s, t)) in row.iter_mut().skip(KNOTS).zip(pairs) {
        let product = a[s] * b[t] + a[t] * b[s];
        *factor = if s == t { 0.5 * product } else { product };
    }
}

fn largest(fields_ohm: &[f64], mean: f64) -> f64 {
    fields_ohm.iter().map(|ohm| (ohm - mean).abs()).fold(0.0, f64::max)
}

/// Adds an equation to the lower triangle of the normal ones.
fn add(matrix: &mut DMatrix<f64>, right: &mut DVector<f64>, row: &[f64], value: f64) {
    for (j, second) in row.iter().enumerate().filter(|(_, second)| **second != 0.0) {
        let mut column = matrix.column_mut(j);
        column.iter_mut().zip(row).skip(j).for_each(|(sum, first)| *sum += first * second);
        right[j] += second * value;
    }
}
