//! Linear images: `tikhonov`, and those that differ from it in the prior or in what they keep of the readings.
//!
//! Tikhonov's minimises `|dV - J A c|^2 + lambda^2 int c^2 dA`, with the nodes' areas `A` on the diagonal: both terms are integrals, so
//! the image does not depend on the mesh. `noser` and `laplace` have other [priors] than the integral of the square. What Tikhonov's image holds down
//! step by step, `tsvd` keeps whole or leaves out: the singular images whose value is at least a share of the largest are kept (Hansen,
//! "Rank-Deficient and Discrete Ill-Posed Problems", 1998, ch. 3).

mod priors;

use crate::solve::answer::{Solution, SolveError};
use crate::solve::fit::lambda::{Lambda, Rule};
use crate::solve::fit::linear::{Decomposition, Force, LinearImage};
use crate::solve::fit::locate::Locator;
use crate::solve::solver::Solver;
use tactomo_physics::forward::ForwardError;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::readings::Readings;

/// The best lambda of `laplace`, in largest singular values, for shell and slab together: `examples/lambda.rs`.
const SMOOTH_SHARE: f64 = 0.015;

/// What is done before and after the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Variant {
    /// The force is taken out of the readings first, so that a firm contact is where a light one is; contacts are the image's
    /// peaks. The image of one contact then has the conductance of contact and detector in series.
    Balanced,
    /// As in the paper: readings as they are; one contact, at the centroid of all of the image above zero. A firm contact
    /// is misplaced, and every contact pulled to the middle.
    Paper,
}

/// A linear image.
pub struct Tikhonov {
    name: &'static str,
    variant: Variant,
    linear: LinearImage,
    rule: Rule,
    locator: Locator,
}

impl Tikhonov {
    /// Makes it ready for a detector.
    ///
    /// Takes about two milliseconds for 2000 nodes.
    pub fn new(jacobian: &Jacobian, lambda: Lambda, variant: Variant) -> Self {
        let name = match variant {
            Variant::Balanced => "tikhonov",
            Variant::Paper => "tikhonov-paper",
        };
        Self::with_prior(name, jacobian, Decomposition::of(jacobian), lambda, variant)
    }

    /// `noser`: with a prior that makes up for sensitivity.
    pub fn noser(jacobian: &Jacobian, lambda: Lambda) -> Self {
        Self::with_prior("noser", jacobian, priors::sensitivity(jacobian), lambda, Variant::Balanced)
    }

    /// `laplace` with the lambda that is best for most.
    ///
    /// # Errors
    /// As for [`laplace_with`](Self::laplace_with).
    pub fn laplace(jacobian: &Jacobian) -> Result<Self, ForwardError> {
        Self::laplace_with(jacobian, Lambda::Relative(SMOOTH_SHARE))
    }

    /// `laplace`: with a prior of smoothness.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if triangles of the image's mesh have no area, so that smoothness has no meaning on it.
    pub fn laplace_with(jacobian: &Jacobian, lambda: Lambda) -> Result<Self, ForwardError> {
        Ok(Self::with_prior("laplace", jacobian, priors::smoothness(jacobian)?, lambda, Variant::Balanced))
    }

    /// The share for [`truncated`](Self::truncated) with the smallest position error on the slab: `examples/lambda.rs`.
    pub const SINGULAR_SHARE: f64 = 0.015;

    /// `tsvd`: from the singular images alone whose value is at least `share` of the largest.
    pub fn truncated(jacobian: &Jacobian, share: f64) -> Self {
        let lambda = Lambda::Relative(share);
        let kept = Self::with_prior("tsvd", jacobian, Decomposition::of(jacobian), lambda, Variant::Balanced);
        Self { rule: Rule::Truncated(share * kept.singular_values()[0]), ..kept }
    }

    fn with_prior(
        name: &'static str,
        jacobian: &Jacobian,
        decomposition: Decomposition,
        lambda: Lambda,
        variant: Variant,
    ) -> Self {
        let linear = LinearImage::new(jacobian, decomposition);
        let rule = lambda.rule(jacobian, linear.singular_values()[0]);
        Self { name, variant, linear, rule, locator: Locator::new(&jacobian.image_mesh, &jacobian.detector) }
    }

    /// Singular values of the Jacobian weighted by the roots of the nodes' areas (V m / S), falling.
    pub fn singular_values(&self) -> &[f64] {
        self.linear.singular_values()
    }

    /// Lambda (V m / S); `None` if each frame chooses its own, or there is none.
    pub fn lambda(&self) -> Option<f64> {
        match self.rule {
            Rule::Given(lambda) => Some(lambda),
            _ => None,
        }
    }

    /// The image alone: contact conductance per area at each node (S/m2). A linear image can be below zero.
    ///
    /// # Errors
    /// [`SolveError`] if the readings are of another number of electrodes or not finite.
    pub fn image_s_per_m2(&self, readings: &Readings) -> Result<Vec<f32>, SolveError> {
        Ok(self.imaged(readings)?.image_s_per_m2.unwrap_or_default())
    }

    /// The image and what is known of it, without contacts.
    fn imaged(&self, readings: &Readings) -> Result<Solution, SolveError> {
        let force = match self.variant {
            Variant::Balanced => Force::Balanced,
            Variant::Paper => Force::AsRead,
        };
        let spectrum = self.linear.spectrum(readings, force)?;
        let lambda = self.rule.lambda(&spectrum);
        let (shares, left_v2) = spectrum.filtered(|value| self.rule.kept(value, lambda));
        Ok(Solution {
            image_s_per_m2: Some(self.linear.image_s_per_m2(&shares)),
            residual: Some(spectrum.deviations(left_v2)),
            flags: self.linear.flags(readings, &spectrum),
            choice: self.rule.choice(&spectrum, lambda, left_v2),
            ..Solution::default()
        })
    }
}

impl Solver for Tikhonov {
    fn name(&self) -> &'static str {
        self.name
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let solution = self.imaged(readings)?;
        let image = solution.image_s_per_m2.as_deref().unwrap_or_default();
        let contacts = match self.variant {
            _ if self.locator.is_rest(readings) => Vec::new(),
            Variant::Balanced => self.locator.peaks(image),
            Variant::Paper => self.locator.whole(image).into_iter().collect(),
        };
        Ok(Solution { contacts, ..solution })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::fit::stiffness::stiffness;
    use crate::solve::samples::{CONTACT, jacobian, readings};
    use nalgebra::{DMatrix, DVector};
    use tactomo_physics::detector::{Detector, Layer};
    use tactomo_physics::forward::shell::Shell;

    #[test]
    fn equals_the_dense_solution() {
        let jacobian = jacobian(500);
        let readings = readings(CONTACT);
        for share in [1e-3, 0.02, 0.5] {
            let tikhonov = Tikhonov::new(&jacobian, Lambda::Relative(share), Variant::Paper);
            let roots_m = DVector::from_iterator(
                jacobian.fields_ohm.nrows(),
                jacobian.image_mesh.node_areas_m2.iter().map(|a| a.sqrt()),
            );
            let weighted = jacobian.dense() * DMatrix::from_diagonal(&roots_m);
            let normal = weighted.transpose() * &weighted
                + DMatrix::identity(roots_m.len(), roots_m.len()) * tikhonov.lambda().unwrap_or(f64::NAN).powi(2);
            let right = weighted.transpose() * DVector::from_column_slice(readings.volts());
            let dense =
                normal.cholesky().map(|factor| factor.solve(&right).component_div(&roots_m)).unwrap_or_default();
            let image = tikhonov.image_s_per_m2(&readings).unwrap_or_default();
            let apart = dense.iter().zip(&image).map(|(a, &b)| (a - f64::from(b)).abs()).fold(0.0, f64::max);
            assert!(image.len() == dense.len() && apart < 1e-4 * dense.amax(), "{share}: {apart} of {}", dense.amax());
        }
    }

    #[test]
    fn singular_values_are_those_of_the_dense_jacobian() {
        let jacobian = jacobian(400);
        let mut weighted = jacobian.dense();
        for (mut column, area_m2) in weighted.column_iter_mut().zip(&jacobian.image_mesh.node_areas_m2) {
            column *= area_m2.sqrt();
        }
        let dense = weighted.singular_values();
        let tikhonov = Tikhonov::new(&jacobian, Lambda::default(), Variant::Balanced);
        assert_eq!(tikhonov.singular_values().len(), 16);
        for (thin, dense) in tikhonov.singular_values().iter().zip(&dense) {
            assert!((thin / dense - 1.0).abs() < 1e-9, "{thin} {dense}");
        }
    }

    #[test]
    fn the_papers_lambda_is_that_of_a_sheet_of_1_s_at_2_v_with_conductances_of_nodes_for_unknowns() {
        let Some(mut ours) = Detector::preset("square-60") else { panic!("no preset") };
        (ours.drive_v, ours.on_resistance_ohm) = (3.0, 0.0);
        let sheet_s = ours.sheet_conductance_s();
        let mut papers = Detector { drive_v: 2.0, ..ours.clone() };
        papers.layers = vec![Layer::uniform(0.005, 1.0 / 0.005)];
        papers.contact_impedance_ohm_m2 *= sheet_s;
        let [ours, papers] = [ours, papers].map(|detector| {
            let Ok(shell) = Shell::with_nodes(&detector, 400) else { panic!("no shell") };
            let mut jacobian = Jacobian::of(&shell);
            let areas_m2 = &mut jacobian.image_mesh.node_areas_m2;
            let each_m2 = 0.06 * 0.06 / areas_m2.len() as f64;
            areas_m2.fill(each_m2);
            jacobian
        });
        let readings = readings(CONTACT);
        let dense = papers.dense();
        let normal = dense.transpose() * &dense + DMatrix::identity(dense.ncols(), dense.ncols()) * 5000.0;
        let right = dense.transpose() * DVector::from_column_slice(readings.volts()) * (2.0 / 3.0);
        // Conductances in sheet conductances.
        let conductances = normal.cholesky().map(|factor| factor.solve(&right)).unwrap_or_default();
        let image =
            Tikhonov::new(&ours, Lambda::Paper(5000.0), Variant::Paper).image_s_per_m2(&readings).unwrap_or_default();
        assert_eq!(image.len(), conductances.len());
        let largest = conductances.amax();
        for ((density, area_m2), expected) in image.iter().zip(&ours.image_mesh.node_areas_m2).zip(&conductances) {
            let found = f64::from(*density) * area_m2 / sheet_s;
            assert!((found - expected).abs() < 1e-4 * largest, "{found} {expected}");
        }
    }

    #[test]
    fn the_image_does_not_depend_on_the_mesh() {
        let readings = readings(CONTACT);
        let at = |nodes: usize| {
            let jacobian = jacobian(nodes);
            let image = Tikhonov::new(&jacobian, Lambda::default(), Variant::Balanced)
                .image_s_per_m2(&readings)
                .unwrap_or_default();
            let near = |node: &[f64; 2]| (node[0] - 0.009).hypot(node[1] + 0.006);
            let nodes_m = &jacobian.image_mesh.nodes_m;
            (0..image.len())
                .min_by(|&i, &j| near(&nodes_m[i]).total_cmp(&near(&nodes_m[j])))
                .map(|i| image[i])
                .unwrap_or_default()
        };
        let (coarse, fine) = (at(1000), at(8000));
        assert!((coarse / fine - 1.0).abs() < 0.1, "{coarse} {fine} S/m2");
    }

    #[test]
    fn refuses_readings_of_another_detector_and_no_numbers() {
        let mut tikhonov = Tikhonov::new(&jacobian(400), Lambda::default(), Variant::Balanced);
        let few = tikhonov.solve(&Readings::from_fn(4, |_, _| 0.0));
        assert_eq!(few, Err(SolveError::Electrodes { found: 4, expected: 16 }));
        let nan = tikhonov.solve(&Readings::from_fn(16, |g, e| if (g, e) == (3, 5) { f64::NAN } else { 0.0 }));
        assert_eq!(nan, Err(SolveError::NotFinite { g: 3, e: 5 }));
    }

    #[test]
    fn all_singular_images_are_tikhonovs_without_lambda() {
        let (jacobian, readings) = (jacobian(500), readings(CONTACT));
        let mut all = Tikhonov::truncated(&jacobian, 1e-9);
        let solution = all.solve(&readings).unwrap();
        let tikhonov = Tikhonov::new(&jacobian, Lambda::Relative(1e-6), Variant::Balanced);
        let (image, same) = (solution.image_s_per_m2.unwrap(), tikhonov.image_s_per_m2(&readings).unwrap());
        let largest = same.iter().fold(0.0f32, |largest, value| largest.max(value.abs()));
        assert!(image.iter().zip(&same).all(|(a, b)| (a - b).abs() < 1e-3 * largest));
    }

    #[test]
    fn fewer_singular_images_leave_more_of_the_readings() {
        let (jacobian, readings) = (jacobian(500), readings(CONTACT));
        let left = |share| Tikhonov::truncated(&jacobian, share).solve(&readings).unwrap().residual.unwrap();
        let [few, some, all] = [0.5, 0.05, 1e-9].map(left);
        assert!(few > 1.5 * some && some > all, "{few} {some} {all}");
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
    fn others_find_a_contact_where_it_is() {
        let (jacobian, readings) = (jacobian(2000), readings(CONTACT));
        let others = [
            Tikhonov::noser(&jacobian, Lambda::default()),
            Tikhonov::laplace(&jacobian).unwrap(),
            Tikhonov::truncated(&jacobian, Tikhonov::SINGULAR_SHARE),
        ];
        for mut other in others {
            let contacts = other.solve(&readings).unwrap().contacts;
            let found = contacts.first().copied().unwrap_or_default();
            assert!((found.x_m - 0.009).hypot(found.y_m + 0.006) < 0.005, "{}: {contacts:?}", other.name());
        }
    }

    #[test]
    fn finds_a_contact_where_it_is() {
        let mut tikhonov = Tikhonov::new(&jacobian(2000), Lambda::default(), Variant::Balanced);
        let solution = tikhonov.solve(&readings(CONTACT)).unwrap_or_default();
        let [found] = solution.contacts[..] else { panic!("{:?}", solution.contacts) };
        assert!((found.x_m - 0.009).hypot(found.y_m + 0.006) < 0.003, "{found:?}");
        let rest = tikhonov.solve(&Readings::from_fn(16, |g, e| if (g + e) % 2 == 0 { 1e-3 } else { -1e-3 }));
        assert_eq!(rest.unwrap_or_default().contacts, [], "noise is no contact");
    }
}
