//! Linear image with a smoothness prior.
//!
//! The prior is `int (c - l^2 laplacian c)^2 dA`: images are held down that bend within the length `l`. On the image's triangles
//! that is `H A^-1 H` with `H = A + l^2 K`, nodes' areas `A` and the stiffness matrix `K` of linear elements; images drawn
//! from it have Matern's covariance of smoothness 1 (Lindgren, Rue and Lindstrom, "An explicit link between Gaussian fields and
//! Gaussian Markov random fields", 2011). Nothing flows over the edge, so images need not vanish there.

use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::Llt;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};
use nalgebra::DMatrix;

use super::{Tikhonov, Variant};
use crate::solve::fit::lambda::Lambda;
use crate::solve::fit::linear::Decomposition;
use crate::solve::fit::stiffness::stiffness;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::forward::{ForwardError, ImageMesh};

/// The length `l` in mean distances of electrodes.
const LENGTH: f64 = 0.3;

/// The best lambda, in largest singular values, for shell and slab together: `examples/lambda.rs`.
const SHARE: f64 = 0.015;

impl Tikhonov {
    /// `laplace` with the lambda that is best for most.
    ///
    /// # Errors
    /// As for [`laplace_with`](Self::laplace_with).
    pub fn laplace(jacobian: &Jacobian) -> Result<Self, ForwardError> {
        Self::laplace_with(jacobian, Lambda::Relative(SHARE))
    }

    /// `laplace`: with a prior of smoothness.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if triangles of the image's mesh have no area, so that smoothness has no meaning on it.
    pub fn laplace_with(jacobian: &Jacobian, lambda: Lambda) -> Result<Self, ForwardError> {
        let mesh = &jacobian.image_mesh;
        let area_m2: f64 = mesh.node_areas_m2.iter().sum();
        let length2_m2 = LENGTH * LENGTH * area_m2 / jacobian.electrodes() as f64;
        let factor = factorise(mesh, length2_m2).ok_or_else(|| ForwardError::Detector {
            detector: jacobian.detector.name.clone(),
            what: "the image's mesh has triangles without area; use solver tikhonov".to_owned(),
        })?;
        let decomposition = Decomposition::with_prior(jacobian, |sources| smoothed(&factor, mesh, sources));
        Ok(Self::with_prior("laplace", jacobian, decomposition, lambda, Variant::Balanced))
    }
}

/// `H^-1 A H^-1` times columns.
fn smoothed(factor: &Llt<u32, f64>, mesh: &ImageMesh, sources: &DMatrix<f64>) -> DMatrix<f64> {
    let mut columns = Mat::from_fn(sources.nrows(), sources.ncols(), |node, source| sources[(node, source)]);
    factor.solve_in_place(&mut columns);
    let mut columns = Mat::from_fn(columns.nrows(), columns.ncols(), |node, source| {
        mesh.node_areas_m2[node] * columns[(node, source)]
    });
    factor.solve_in_place(&mut columns);
    DMatrix::from_fn(columns.nrows(), columns.ncols(), |node, source| columns[(node, source)])
}

/// The factorised `H`.
fn factorise(mesh: &ImageMesh, length2_m2: f64) -> Option<Llt<u32, f64>> {
    let mut elements: Vec<_> =
        mesh.node_areas_m2.iter().enumerate().map(|(i, &area_m2)| Triplet::new(i as u32, i as u32, area_m2)).collect();
    for &triangle in &mesh.triangles {
        let stiffness = stiffness(triangle.map(|node| mesh.place_m(node as usize)));
        for (i, row) in stiffness.iter().enumerate() {
            let of_row = |j: usize| Triplet::new(triangle[i], triangle[j], length2_m2 * row[j]);
            elements.extend((0..3).map(of_row));
        }
    }
    let nodes = mesh.nodes_m.len();
    SparseColMat::try_new_from_triplets(nodes, nodes, &elements).ok()?.sp_cholesky(Side::Lower).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::samples::{CONTACT, jacobian, readings};
    use crate::solve::solver::Solver;
    use std::f64::consts::PI;

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

    #[test]
    fn the_image_is_smoother_than_tikhonovs() {
        let (jacobian, readings) = (jacobian(2000), readings(CONTACT));
        let roughness = |solver: &mut Tikhonov| {
            let image = solver.solve(&readings).unwrap().image_s_per_m2.unwrap();
            let mesh = &jacobian.image_mesh;
            let energy: f64 = mesh
                .triangles
                .iter()
                .map(|&triangle| {
                    let stiffness = stiffness(triangle.map(|node| mesh.place_m(node as usize)));
                    let values = triangle.map(|node| f64::from(image[node as usize]));
                    (0..9).map(|k| stiffness[k / 3][k % 3] * values[k / 3] * values[k % 3]).sum::<f64>()
                })
                .sum();
            let squares: f64 = image.iter().zip(&mesh.node_areas_m2).map(|(c, a)| f64::from(*c).powi(2) * a).sum();
            energy / squares
        };
        let tikhonov = roughness(&mut Tikhonov::new(&jacobian, Lambda::default(), Variant::Balanced));
        let laplace = roughness(&mut Tikhonov::laplace(&jacobian).unwrap());
        assert!(laplace < 0.7 * tikhonov, "{laplace} {tikhonov}");
    }

    #[test]
    fn finds_a_contact_where_it_is() {
        let solution = Tikhonov::laplace(&jacobian(2000)).unwrap().solve(&readings(CONTACT)).unwrap();
        let found = solution.contacts.first().copied().unwrap_or_default();
        assert!((found.x_m - 0.009).hypot(found.y_m + 0.006) < 0.005, "{:?}", solution.contacts);
    }
}
