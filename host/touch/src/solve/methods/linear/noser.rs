//! Linear image whose prior makes up for sensitivity: Newton's one-step error reconstructor.
//!
//! The prior is `int w c^2 dA` with `w` a power of the sum of squares of what a node does to the readings, so that the places that
//! readings hear least, far from all electrodes, are held down less (Cheney, Isaacson, Newell, Simske and Goble, "NOSER: an
//! algorithm for solving the inverse conductivity problem", 1990; the power as in EIDORS and pyEIT).

use nalgebra::DMatrix;

use super::{Tikhonov, Variant};
use crate::solve::fit::lambda::Lambda;
use crate::solve::fit::linear::Decomposition;
use tactomo_physics::forward::jacobian::Jacobian;

/// Power of the sum of squares.
const POWER: f64 = 0.5;

impl Tikhonov {
    /// `noser`: with a prior that makes up for sensitivity.
    pub fn noser(jacobian: &Jacobian, lambda: Lambda) -> Self {
        let weights_m2 = weights_m2(jacobian);
        let decomposition = Decomposition::with_prior(jacobian, |sources| {
            DMatrix::from_fn(sources.nrows(), sources.ncols(), |node, source| {
                sources[(node, source)] / weights_m2[node]
            })
        });
        Self::with_prior("noser", jacobian, decomposition, lambda, Variant::Balanced)
    }
}

/// `w A` for each node (m2), with `w` of mean 1 over the area.
fn weights_m2(jacobian: &Jacobian) -> Vec<f64> {
    let areas_m2 = &jacobian.image_mesh.node_areas_m2;
    let powers: Vec<f64> = squares(jacobian).iter().map(|square| square.powf(POWER)).collect();
    let sum: f64 = powers.iter().zip(areas_m2).map(|(power, area_m2)| power * area_m2).sum();
    let mean = sum / areas_m2.iter().sum::<f64>();
    powers.iter().zip(areas_m2).map(|(power, area_m2)| power / mean * area_m2).collect()
}

/// Sum over the readings of the squares of what each node does to them (V2/S2).
fn squares(jacobian: &Jacobian) -> Vec<f64> {
    let Decomposition { singular_values, images, .. } = Decomposition::of(jacobian);
    let square = |row: usize| {
        let parts = singular_values.iter().enumerate().map(|(i, value)| value * images[(row, i)]);
        parts.map(|part| part * part).sum()
    };
    (0..images.nrows()).map(square).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::samples::{CONTACT, jacobian, readings};
    use crate::solve::solver::Solver;

    #[test]
    fn squares_are_those_of_the_dense_jacobian() {
        let jacobian = jacobian(300);
        let dense = jacobian.dense();
        for (node, square) in squares(&jacobian).iter().enumerate() {
            assert!((square / dense.column(node).norm_squared() - 1.0).abs() < 1e-9, "{node}");
        }
    }

    #[test]
    fn finds_a_contact_where_it_is() {
        let solution = Tikhonov::noser(&jacobian(2000), Lambda::default()).solve(&readings(CONTACT)).unwrap();
        let found = solution.contacts.first().copied().unwrap_or_default();
        assert!((found.x_m - 0.009).hypot(found.y_m + 0.006) < 0.005, "{:?}", solution.contacts);
    }
}
