//! Linear image that keeps edges: total variation.
//!
//! It minimises `|dV - J A c|^2 + lambda^2 l g int sqrt(|grad c|^2 + (g / 10)^2) dA` on a coarse mesh, with `l` a length and `g` the
//! root mean square slope of the smooth image that it begins with, so that an image twice as high is the same but for its height.
//! By lagged diffusivity (Vogel and Oman, "Iterative methods for total variation denoising", 1996): each step is a linear image with
//! the smoothness prior `int w |grad c|^2 dA`, `w = 1 / sqrt(...)` of the step before. What was below zero is held at zero
//! by a weight of its own. A step solves with one sparse matrix for 16 right sides, since readings have no more dimensions
//! ([`crate::solve::fit::linear`]).

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::solve::answer::{Flags, Solution, SolveError};
use crate::solve::fit::interpolate::Interpolation;
use crate::solve::fit::linear::{Decomposition, Force, LinearImage};
use crate::solve::fit::locate::Locator;
use crate::solve::fit::stiffness::stiffness;
use crate::solve::problem::Problem;
use crate::solve::solver::Solver;
use tactomo_physics::algebra::Plan;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::forward::{ForwardError, ImageMesh};
use tactomo_physics::readings::Readings;

/// Nodes of the coarse mesh, about.
const NODES: usize = 700;
/// Lambda in largest singular values, and the length `l` in mean distances of electrodes: the most like the truth by
/// `examples/images.rs`.
const SHARE: f64 = 0.005;
const LENGTH: f64 = 0.3;
/// Slopes below this share of `g` are smoothed as slopes, not as edges.
const EVEN: f64 = 0.1;
/// Weight of what was below zero, against `lambda^2`.
const BELOW_ZERO: f64 = 300.0;
/// What holds down the mean of an image, which no slope does, against `lambda^2`.
const MEAN: f64 = 0.01;
/// Steps of a frame, the smooth image among them.
const STEPS: usize = 8;
/// A step that changes no node by more than this share of the highest is the last.
const SETTLED: f64 = 0.02;

/// Linear image that keeps edges.
pub struct Tv {
    linear: LinearImage,
    /// `S V' A`: rank x nodes.
    operator: DMatrix<f64>,
    lambda2: f64,
    length2_m2: f64,
    areas_m2: Vec<f64>,
    /// Nodes and stiffness of each triangle.
    triangles: Vec<([usize; 3], [[f64; 3]; 3])>,
    triangle_areas_m2: Vec<f64>,
    plan: Arc<Plan>,
    to_image: Interpolation,
    locator: Locator,
}

impl Tv {
    /// Makes it ready for a problem.
    ///
    /// # Errors
    /// [`ForwardError`] if the model cannot give a coarse image.
    pub fn new(problem: &Problem) -> Result<Self, ForwardError> {
        let coarse = problem.model.on_image_of(NODES)?;
        let jacobian = Jacobian { detector: problem.detector().clone(), ..Jacobian::of(&*coarse) };
        let mesh = &jacobian.image_mesh;
        let decomposition = Decomposition::of(&jacobian);
        let mut operator = decomposition.images.transpose();
        for (mut row, value) in operator.row_iter_mut().zip(&decomposition.singular_values) {
            row *= *value;
        }
        for (mut column, area_m2) in operator.column_iter_mut().zip(&mesh.node_areas_m2) {
            column *= *area_m2;
        }
        let triangle = |nodes: &[u32; 3]| {
            (nodes.map(|node| node as usize), stiffness(nodes.map(|node| mesh.place_m(node as usize))))
        };
        let shown = &problem.jacobian.image_mesh;
        Ok(Self {
            lambda2: (SHARE * decomposition.singular_values[0]).powi(2),
            length2_m2: (LENGTH * problem.spacing_m()).powi(2),
            linear: LinearImage::new(&jacobian, decomposition),
            operator,
            areas_m2: mesh.node_areas_m2.clone(),
            triangles: mesh.triangles.iter().map(triangle).collect(),
            triangle_areas_m2: mesh.triangle_areas_m2(),
            plan: plan(mesh),
            to_image: Interpolation::new(mesh, shown),
            locator: Locator::new(shown, &jacobian.detector),
        })
    }

    /// `int |grad c|^2` of each triangle.
    fn energies(&self, image: &DVector<f64>) -> Vec<f64> {
        let energy = |(nodes, stiffness): &([usize; 3], [[f64; 3]; 3])| {
            let values = nodes.map(|node| image[node]);
            let pairs = (0..9).map(|at| stiffness[at / 3][at % 3] * values[at / 3] * values[at % 3]);
            pairs.sum::<f64>().max(0.0)
        };
        self.triangles.iter().map(energy).collect()
    }

    /// `w g` of each triangle: how smooth it has to be.
    fn smoothness(&self, image: &DVector<f64>, slope: f64) -> Vec<f64> {
        let weight = |(energy, area_m2): (f64, &f64)| (energy / area_m2 / (slope * slope) + EVEN * EVEN).sqrt().recip();
        self.energies(image).into_iter().zip(&self.triangle_areas_m2).map(weight).collect()
    }

    /// Root mean square slope (S/m3).
    fn slope(&self, image: &DVector<f64>) -> f64 {
        (self.energies(image).iter().sum::<f64>() / self.areas_m2.iter().sum::<f64>()).sqrt()
    }

    /// The linear image under a prior `W` of smoothness weights and weights on nodes: `W^-1 B' (B W^-1 B' + lambda^2)^-1 b`.
    fn image(&self, b: &DVector<f64>, smoothness: &[f64], own: impl Fn(usize) -> f64) -> Option<DVector<f64>> {
        let on_nodes = self.areas_m2.iter().enumerate().map(|(node, area_m2)| own(node) * area_m2);
        let on_triangles = self.triangles.iter().zip(smoothness).flat_map(|((_, stiffness), weight)| {
            (0..9).filter(|at| at / 3 >= at % 3).map(move |at| self.length2_m2 * weight * stiffness[at / 3][at % 3])
        });
        let factor = self.plan.factorise(&on_nodes.chain(on_triangles).collect::<Vec<_>>()).ok()?;
        let mut smoothed = self.operator.transpose();
        factor.solve(&mut smoothed);
        let rank = self.operator.nrows();
        let normal = &self.operator * &smoothed + DMatrix::identity(rank, rank) * self.lambda2;
        let image = smoothed * normal.cholesky()?.solve(b);
        image.iter().all(|value| value.is_finite()).then_some(image)
    }

    /// Steps to the image; whether it settled.
    fn solve_for(&self, b: &DVector<f64>) -> Option<(DVector<f64>, bool)> {
        let mut image = self.image(b, &vec![1.0; self.triangles.len()], |_| MEAN)?;
        let slope = self.slope(&image);
        if slope <= f64::MIN_POSITIVE {
            return Some((image, true));
        }
        for _ in 1..STEPS {
            let smoothness = self.smoothness(&image, slope);
            let own = |node: usize| if image[node] < 0.0 { BELOW_ZERO } else { MEAN };
            let next = self.image(b, &smoothness, own)?;
            let change = (&next - &image).amax();
            image = next;
            if change < SETTLED * image.amax() {
                return Some((image, true));
            }
        }
        Some((image, false))
    }
}

impl Solver for Tv {
    fn name(&self) -> &'static str {
        "tv"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let spectrum = self.linear.spectrum(readings, Force::Balanced)?;
        let b = DVector::from_column_slice(&spectrum.coefficients_v);
        let found = self.solve_for(&b);
        let (image, settled) = found.unwrap_or_else(|| (DVector::zeros(self.areas_m2.len()), false));
        let left_v2 = (&b - &self.operator * &image).norm_squared() + spectrum.outside_v2;
        let densities: Vec<f32> = image.iter().map(|&density| density.max(0.0) as f32).collect();
        let image = self.to_image.apply(&densities);
        let contacts = if self.locator.is_rest(readings) { Vec::new() } else { self.locator.peaks(&image) };
        Ok(Solution {
            contacts,
            image_s_per_m2: Some(image),
            residual: Some(spectrum.deviations(left_v2)),
            flags: Flags { unfinished: !settled, ..Flags::default() },
            ..Solution::default()
        })
    }
}

/// For a diagonal, then the lower triangles of a mesh's triangles.
fn plan(mesh: &ImageMesh) -> Arc<Plan> {
    let nodes = mesh.nodes_m.len();
    let diagonal = (0..nodes as u32).map(|node| [node; 2]);
    let of = |nodes: &[u32; 3]| {
        let nodes = *nodes;
        (0..9).filter(|at| at / 3 >= at % 3).map(move |at| [nodes[at / 3], nodes[at % 3]])
    };
    Plan::new(nodes, &diagonal.chain(mesh.triangles.iter().flat_map(of)).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::{ForwardModel, Resolution, Slab, readings_v};
    use tactomo_physics::scene::Contact;

    fn problem() -> Problem {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        Problem::new(Box::new(Slab::new(&detector).unwrap()) as Box<dyn ForwardModel>)
    }

    fn wide() -> Readings {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let slab = Slab::with_resolution(&detector, Resolution::FINE).unwrap();
        let wide = Contact::flat(0.003, -0.002, 0.011, 0.05 * detector.sheet_conductance_s());
        readings_v(&slab.impedance_ohm(&[wide]).unwrap(), &detector)
    }

    #[test]
    fn a_wide_contact_is_as_wide_as_it_is() {
        let problem = problem();
        let solution = Tv::new(&problem).unwrap().solve(&wide()).unwrap();
        let image = solution.image_s_per_m2.unwrap();
        let highest = image.iter().copied().fold(0.0, f32::max);
        let areas_m2 = &problem.jacobian.image_mesh.node_areas_m2;
        let half_m2: f64 =
            image.iter().zip(areas_m2).filter(|(c, _)| **c > 0.5 * highest).map(|(_, area_m2)| area_m2).sum();
        let radius_m = (half_m2 / std::f64::consts::PI).sqrt();
        assert!((radius_m - 0.011).abs() < 0.0025, "{radius_m}");
    }

    #[test]
    fn an_image_twice_as_high_is_the_same_but_for_its_height() {
        let solver = Tv::new(&problem()).unwrap();
        let spectrum = solver.linear.spectrum(&wide(), Force::Balanced).unwrap();
        let b = DVector::from_column_slice(&spectrum.coefficients_v);
        let (once, twice) = (solver.solve_for(&b).unwrap().0, solver.solve_for(&(b * 2.0)).unwrap().0);
        assert!((&once * 2.0 - twice).amax() < 1e-6 * once.amax());
    }
}
