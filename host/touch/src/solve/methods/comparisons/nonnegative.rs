//! Linear image in which no conductance is negative.
//!
//! It minimises `|dV - J A c|^2 + lambda^2 int c^2 dA` over `c >= 0`. With the decomposition `J A = U S V' A` and
//! `b = U' dV` the answer is `c = max(0, V S p) / lambda^2`, `p = b - S V' A c` what is left of the readings: so the unknown is
//! `p`, of 16 numbers, whatever the mesh. It is the minimum of the convex dual
//!
//! ```text
//! 1/2 |p|^2 + 1/2 int max(0, V S p)^2 dA / lambda^2 - b' p,
//! ```
//!
//! found by Newton's steps, each with the nodes that now conduct (semismooth; the minimum is exact once these no longer change:
//! Qi and Sun, "A nonsmooth version of Newton's method", 1993).

use nalgebra::{DMatrix, DVector};

use crate::solve::answer::{Flags, Solution, SolveError};
use crate::solve::fit::linear::{Decomposition, Force, LinearImage};
use crate::solve::fit::locate::Locator;
use crate::solve::solver::Solver;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::readings::Readings;

/// Newton's steps at most; a handful is usual.
const STEPS: usize = 40;
/// Halvings of a step at most.
const HALVINGS: usize = 20;
/// A gradient this small against the readings is none.
const SETTLED_GRADIENT: f64 = 1e-9;

/// Linear image in which no conductance is negative.
pub struct Nonnegative {
    linear: LinearImage,
    /// `V S`: nodes x rank (S/m2 for each volt).
    operator: DMatrix<f64>,
    areas_m2: Vec<f64>,
    /// `lambda^2`.
    lambda2: f64,
    locator: Locator,
}

/// The dual at some `p`.
struct Dual {
    value: f64,
    /// `max(0, V S p) / lambda^2` (S/m2).
    image: DVector<f64>,
    /// Of the value by `p`.
    gradient: DVector<f64>,
}

impl Nonnegative {
    /// The lambda, in largest singular values, whose images are most like the truth: `examples/images.rs`.
    pub const SHARE: f64 = 0.003;

    /// Makes it ready for a detector, with lambda at a share of the largest singular value.
    pub fn new(jacobian: &Jacobian, share: f64) -> Self {
        let decomposition = Decomposition::of(jacobian);
        let mut operator = decomposition.images.clone();
        for (mut column, value) in operator.column_iter_mut().zip(&decomposition.singular_values) {
            column *= *value;
        }
        let lambda2 = (share * decomposition.singular_values[0]).powi(2);
        Self {
            linear: LinearImage::new(jacobian, decomposition),
            operator,
            areas_m2: jacobian.image_mesh.node_areas_m2.clone(),
            lambda2,
            locator: Locator::new(&jacobian.image_mesh, &jacobian.detector),
        }
    }

    fn dual(&self, p: DVector<f64>, b: &DVector<f64>) -> Dual {
        let mut image = &self.operator * &p;
        image.iter_mut().for_each(|density| *density = density.max(0.0) / self.lambda2);
        let weighted = DVector::from_iterator(image.len(), image.iter().zip(&self.areas_m2).map(|(c, area)| c * area));
        let value = 0.5 * p.norm_squared() + 0.5 * self.lambda2 * image.dot(&weighted) - b.dot(&p);
        let gradient = &p + self.operator.tr_mul(&weighted) - b;
        Dual { value, image, gradient }
    }

    /// Newton's step from a gradient, with the nodes of an image that conduct.
    fn step(&self, dual: &Dual) -> Option<DVector<f64>> {
        let rank = self.operator.ncols();
        let active: Vec<_> = (0..dual.image.len()).filter(|&node| dual.image[node] > 0.0).collect();
        let rows = self.operator.select_rows(&active);
        let mut weighted = rows.clone();
        for (mut row, &node) in weighted.row_iter_mut().zip(&active) {
            row *= self.areas_m2[node] / self.lambda2;
        }
        let curvature = DMatrix::identity(rank, rank) + rows.tr_mul(&weighted);
        Some(curvature.cholesky()?.solve(&-&dual.gradient))
    }

    /// Minimises the dual; whether the end was reached.
    fn minimise(&self, b: &DVector<f64>) -> (Dual, bool) {
        let mut p = b.clone();
        let mut dual = self.dual(p.clone(), b);
        let enough = SETTLED_GRADIENT * b.norm();
        for _ in 0..STEPS {
            if dual.gradient.norm() <= enough {
                return (dual, true);
            }
            let Some(step) = self.step(&dual) else { break };
            let slope = dual.gradient.dot(&step);
            let shorter = |halving: i32| {
                let share = 0.5f64.powi(halving);
                let to = &p + &step * share;
                let next = self.dual(to.clone(), b);
                (next.value <= dual.value + 1e-4 * share * slope).then_some((to, next))
            };
            // At the end the value changes by less than its rounding.
            let Some((to, next)) = (0..HALVINGS as i32).find_map(shorter) else { return (dual, true) };
            (p, dual) = (to, next);
        }
        (dual, false)
    }
}

impl Solver for Nonnegative {
    fn name(&self) -> &'static str {
        "nonnegative"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let spectrum = self.linear.spectrum(readings, Force::Balanced)?;
        let b = DVector::from_column_slice(&spectrum.coefficients_v);
        let (dual, settled) = self.minimise(&b);
        let left =
            &b - self.operator.tr_mul(&DVector::from_fn(dual.image.len(), |i, _| dual.image[i] * self.areas_m2[i]));
        let image: Vec<f32> = dual.image.iter().map(|&density| density as f32).collect();
        let contacts = if self.locator.is_rest(readings) { Vec::new() } else { self.locator.peaks(&image) };
        Ok(Solution {
            contacts,
            image_s_per_m2: Some(image),
            residual: Some(spectrum.deviations(left.norm_squared() + spectrum.outside_v2)),
            flags: Flags { unfinished: !settled, ..Flags::default() },
            ..Solution::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::samples::{CONTACT, jacobian, readings};
    use proptest::prelude::*;

    /// Derivative of the sum minimised by each node's density, over its area.
    fn slopes(solver: &Nonnegative, image: &DVector<f64>, b: &DVector<f64>) -> DVector<f64> {
        let weighted = DVector::from_fn(image.len(), |i, _| image[i] * solver.areas_m2[i]);
        let left = b - solver.operator.tr_mul(&weighted);
        image * solver.lambda2 - &solver.operator * left
    }

    #[test]
    fn it_is_the_minimum_under_its_bound() {
        let solver = Nonnegative::new(&jacobian(600), 0.01);
        let spectrum = solver.linear.spectrum(&readings(CONTACT), Force::Balanced).unwrap();
        let b = DVector::from_column_slice(&spectrum.coefficients_v);
        let (dual, settled) = solver.minimise(&b);
        assert!(settled && dual.image.iter().any(|&density| density == 0.0));
        let slopes = slopes(&solver, &dual.image, &b);
        let scale = (&solver.operator * &b).amax();
        for (slope, &density) in slopes.iter().zip(&dual.image) {
            // Flat where it conducts, rising where it does not: Karush, Kuhn and Tucker.
            assert!(*slope > -1e-6 * scale && (density == 0.0 || *slope < 1e-6 * scale), "{slope} at {density}");
        }
    }

    #[test]
    fn a_contact_is_where_it_is() {
        let mut solver = Nonnegative::new(&jacobian(2000), Nonnegative::SHARE);
        let solution = solver.solve(&readings(CONTACT)).unwrap();
        let found = solution.contacts[0];
        assert!((found.x_m - CONTACT.x_m).hypot(found.y_m - CONTACT.y_m) < 0.003, "{found:?}");
        assert!(!solution.flags.unfinished);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn any_readings_end_in_few_steps(volts in prop::collection::vec(-2.0..2.0, 256)) {
            let mut solver = Nonnegative::new(&jacobian(400), Nonnegative::SHARE);
            let solution = solver.solve(&Readings::new(16, volts).unwrap()).unwrap();
            prop_assert!(!solution.flags.unfinished);
            prop_assert!(solution.image_s_per_m2.unwrap().iter().all(|&density| density >= 0.0 && density.is_finite()));
        }
    }
}
