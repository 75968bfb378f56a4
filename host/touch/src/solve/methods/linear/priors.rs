//! Priors of linear images, other than the integral of their square.
//!
//! Sensitivity (`noser`, Newton's one-step error reconstructor): `int w c^2 dA` with `w` a power of the sum of squares of what a node does to the
//! readings, so that the places that readings hear least, far from all electrodes, are held down less (Cheney, Isaacson, Newell, Simske and Goble,
//! "NOSER: an algorithm for solving the inverse conductivity problem", 1990; the power as in EIDORS and pyEIT).
//!
//! Smoothness (`laplace`): `int (c - l^2 laplacian c)^2 dA`, so that images are held down that bend within the length `l`. On the image's triangles
//! that is `H A^-1 H` with `H = A + l^2 K`, nodes' areas `A` and the stiffness matrix `K` of linear elements; images drawn
//! from it have Matern's covariance of smoothness 1 (Lindgren, Rue and Lindstrom, "An explicit link between Gaussian fields and
//! Gaussian Markov random fields", 2011). Nothing flows over the edge, so images need not vanish there.

use nalgebra::DMatrix;

use crate::solve::fit::linear::Decomposition;
use crate::solve::fit::stiffness::stiffness;
use tactomo_physics::algebra::{Factor, NotPositive, Plan};
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::forward::{ForwardError, ImageMesh};

/// Power of the sum of squares, for sensitivity.
const POWER: f64 = 0.5;
/// The length `l` of smoothness, in mean distances of electrodes.
const LENGTH: f64 = 0.3;

/// The decomposition for images measured by sensitivity.
pub(super) fn sensitivity(jacobian: &Jacobian) -> Decomposition {
    let weights_m2 = weights_m2(jacobian);
    Decomposition::with_prior(jacobian, |sources| {
        DMatrix::from_fn(sources.nrows(), sources.ncols(), |node, source| sources[(node, source)] / weights_m2[node])
    })
}

/// The decomposition for images measured by smoothness.
///
/// # Errors
/// [`ForwardError::Detector`] if triangles of the image's mesh have no area, so that smoothness has no meaning on it.
pub(super) fn smoothness(jacobian: &Jacobian) -> Result<Decomposition, ForwardError> {
    let mesh = &jacobian.image_mesh;
    let area_m2: f64 = mesh.node_areas_m2.iter().sum();
    let length2_m2 = LENGTH * LENGTH * area_m2 / jacobian.electrodes() as f64;
    let factor = factorise(mesh, length2_m2).map_err(|_| ForwardError::Detector {
        detector: jacobian.detector.name.clone(),
        what: "the image's mesh has triangles without area; use solver tikhonov".to_owned(),
    })?;
    Ok(Decomposition::with_prior(jacobian, |sources| smoothed(&factor, mesh, sources)))
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

/// `H^-1 A H^-1` times columns.
fn smoothed(factor: &Factor, mesh: &ImageMesh, sources: &DMatrix<f64>) -> DMatrix<f64> {
    let mut columns = sources.clone();
    factor.solve(&mut columns);
    for (mut row, area_m2) in columns.row_iter_mut().zip(&mesh.node_areas_m2) {
        row *= *area_m2;
    }
    factor.solve(&mut columns);
    columns
}

/// The factorised `H`.
fn factorise(mesh: &ImageMesh, length2_m2: f64) -> Result<Factor, NotPositive> {
    let on_nodes = mesh.node_areas_m2.iter().enumerate().map(|(node, area_m2)| ([node as u32; 2], *area_m2));
    let on_triangle = |&nodes: &[u32; 3]| {
        let stiffness = stiffness(nodes.map(|node| mesh.place_m(node as usize)));
        let lower = (0..9).map(|at| (at / 3, at % 3)).filter(|(i, j)| i >= j);
        lower.map(move |(i, j)| ([nodes[i], nodes[j]], length2_m2 * stiffness[i][j]))
    };
    let (places, elements): (Vec<_>, Vec<_>) = on_nodes.chain(mesh.triangles.iter().flat_map(on_triangle)).unzip();
    Plan::new(mesh.nodes_m.len(), &places).factorise(&elements)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::samples::jacobian;
    use std::f64::consts::PI;

    #[test]
    fn squares_are_those_of_the_dense_jacobian() {
        let jacobian = jacobian(300);
        let dense = jacobian.dense();
        for (node, square) in squares(&jacobian).iter().enumerate() {
            assert!((square / dense.column(node).norm_squared() - 1.0).abs() < 1e-9, "{node}");
        }
    }

    #[test]
    fn a_cosine_is_smoothed_as_its_eigenvalue_says() {
        let jacobian = jacobian(3000);
        let mesh = &jacobian.image_mesh;
        let length_m = 0.006_f64;
        let factor = factorise(mesh, length_m * length_m).unwrap();
        let wave = PI / 0.06;
        let cosine: Vec<f64> = mesh.nodes_m.iter().map(|[x, _]| (wave * (x + 0.03)).cos()).collect();
        let sources = DMatrix::from_fn(cosine.len(), 1, |node, _| mesh.node_areas_m2[node] * cosine[node]);
        let smooth = smoothed(&factor, mesh, &sources);
        let share = (1.0 + (length_m * wave).powi(2)).powi(-2);
        for (found, cosine) in smooth.iter().zip(&cosine) {
            assert!((found - share * cosine).abs() < 0.01, "{found} {}", share * cosine);
        }
    }
}
