//! Linear images by Tikhonov's method, through the few dimensions that readings have.
//!
//! The image is contact conductance per area `c`. It minimises `|dV - J A c|^2 + lambda^2 int c^2 dA`, with the nodes' areas
//! `A` on the diagonal: both terms are integrals, so the image does not depend on the mesh. With `u = A^(1/2) c` and
//! `B = J A^(1/2)` this is `u = (B'B + lambda^2)^-1 B' dV`. `J` factors into `256 x 16` (differences of readings) times
//! `16 x nodes` (fields, and one row for the total conductance), so two thin QR and the SVD of a `16 x 16` matrix give the
//! whole SVD of `B`. Exact, for any lambda; a frame then costs 256 x 16 and 16 x nodes products rather than 256 x nodes.

use nalgebra::{DMatrix, DVector};

use super::balance;
use super::locate::Locator;
use super::{Solution, SolveError, Solver};
use crate::forward::jacobian::Jacobian;
use crate::readings::Readings;

/// How strongly an image is held down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lambda {
    /// A share of the largest singular value: the same meaning for every detector, mesh and drive voltage.
    Relative(f64),
    /// In V m / S, the unit of the singular values of `B`.
    Absolute(f64),
    /// `lambda^2` under the paper's scaling: the conductance of each node (S) as unknown, on a mesh of as many nodes, of equal
    /// areas, with a sheet of 1 S and a drive of 2 V; so in V2/S2.
    Paper(f64),
}

impl Default for Lambda {
    /// Smallest position error over light and firm contacts with 1.5 LSB of noise, on shell and slab together:
    /// `examples/lambda.rs`.
    fn default() -> Self {
        Self::Relative(0.03)
    }
}

/// What is done before and after the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// The force is taken out of the readings first, so that a firm contact is where a light one is; contacts are the image's
    /// peaks. The image of one contact then has the conductance of contact and detector in series.
    Balanced,
    /// As in the paper: readings as they are; one contact, at the centroid of all of the image above zero. A firm contact
    /// is misplaced, and every contact pulled to the middle.
    Paper,
}

/// Tikhonov's linear image.
pub struct Tikhonov {
    electrodes: usize,
    drive_v: f64,
    variant: Variant,
    /// Singular values of `B` (V m / S), falling.
    singular_values: Vec<f64>,
    lambda: f64,
    /// `rank x electrodes^2`, row by row: from readings to coefficients.
    to_coefficients: Vec<f32>,
    /// `nodes x rank`, column by column: from coefficients to the image (S/m2).
    to_image: Vec<f32>,
    locator: Locator,
}

impl Tikhonov {
    /// Makes it ready for a detector.
    ///
    /// Takes about a millisecond for 2000 nodes.
    pub fn new(jacobian: &Jacobian, lambda: Lambda, variant: Variant) -> Self {
        let Decomposition { left, singular_values, right } = Decomposition::of(jacobian);
        let lambda = lambda.absolute(jacobian, singular_values[0]);
        let mut to_coefficients = Vec::with_capacity(left.len());
        for (column, &value) in left.column_iter().zip(&singular_values) {
            let filter = value / (value * value + lambda * lambda);
            to_coefficients.extend(column.iter().map(|&u| (filter * u) as f32));
        }
        let mut to_image = right;
        for (mut row, &area_m2) in to_image.row_iter_mut().zip(&jacobian.image_mesh.node_areas_m2) {
            row /= area_m2.sqrt();
        }
        Self {
            electrodes: jacobian.electrodes(),
            drive_v: jacobian.detector.drive_v,
            variant,
            singular_values,
            lambda,
            to_coefficients,
            to_image: to_image.iter().map(|&value| value as f32).collect(),
            locator: Locator::new(&jacobian.image_mesh, &jacobian.detector),
        }
    }

    /// Singular values of the Jacobian weighted by the roots of the nodes' areas (V m / S), falling.
    pub fn singular_values(&self) -> &[f64] {
        &self.singular_values
    }

    /// Lambda (V m / S).
    pub fn lambda(&self) -> f64 {
        self.lambda
    }

    /// The image alone: contact conductance per area at each node (S/m2). A linear image can be below zero.
    ///
    /// # Errors
    /// [`SolveError`] if the readings are of another number of electrodes or not finite.
    pub fn image_s_per_m2(&self, readings: &Readings) -> Result<Vec<f32>, SolveError> {
        readings.check(self.electrodes)?;
        let volts: Vec<f32> = match self.variant {
            Variant::Balanced => balance::balanced(readings, self.drive_v).iter().map(|&volts| volts as f32).collect(),
            Variant::Paper => readings.volts().iter().map(|&volts| volts as f32).collect(),
        };
        let nodes = self.to_image.len() / self.singular_values.len();
        let mut image = vec![0.0f32; nodes];
        let columns = self.to_image.chunks_exact(nodes);
        for (row, column) in self.to_coefficients.chunks_exact(volts.len()).zip(columns) {
            let coefficient = dot(row, &volts);
            for (value, part) in image.iter_mut().zip(column) {
                *value += coefficient * part;
            }
        }
        Ok(image)
    }
}

impl Solver for Tikhonov {
    fn name(&self) -> &'static str {
        match self.variant {
            Variant::Balanced => "tikhonov",
            Variant::Paper => "tikhonov-paper",
        }
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let image = self.image_s_per_m2(readings)?;
        let contacts = match self.variant {
            _ if self.locator.is_rest(readings) => Vec::new(),
            Variant::Balanced => self.locator.peaks(&image),
            Variant::Paper => self.locator.whole(&image).into_iter().collect(),
        };
        Ok(Solution { image_s_per_m2: Some(image), contacts, ..Solution::default() })
    }
}

impl Lambda {
    /// In V m / S.
    fn absolute(self, jacobian: &Jacobian, largest: f64) -> f64 {
        match self {
            Self::Relative(share) => share * largest,
            Self::Absolute(lambda) => lambda,
            Self::Paper(squared) => squared.sqrt() * paper_unit(jacobian),
        }
    }
}

/// What 1 V/S of the paper is here (V m / S): its unknowns are conductances `a c` of nodes with equal areas `a`, so its
/// singular values are ours over `sqrt(a)`; and they are proportional to the drive over the sheet conductance.
fn paper_unit(jacobian: &Jacobian) -> f64 {
    let areas_m2 = &jacobian.image_mesh.node_areas_m2;
    let mean_m2 = areas_m2.iter().sum::<f64>() / areas_m2.len() as f64;
    mean_m2.sqrt() * (jacobian.detector.drive_v / 2.0) / jacobian.detector.sheet_conductance_s()
}

/// Singular value decomposition of `B = J A^(1/2)`.
struct Decomposition {
    /// `electrodes^2 x rank`.
    left: DMatrix<f64>,
    singular_values: Vec<f64>,
    /// `nodes x rank`.
    right: DMatrix<f64>,
}

impl Decomposition {
    fn of(jacobian: &Jacobian) -> Self {
        let readings = readings_of_sources(jacobian).qr();
        let sources = sources_of_nodes(jacobian).qr();
        let mut core = (readings.r() * sources.r().transpose()).svd(true, true);
        core.sort_by_singular_values();
        let identity = || DMatrix::zeros(0, 0);
        let (u, v_t) = (core.u.unwrap_or_else(identity), core.v_t.unwrap_or_else(identity));
        Self {
            left: readings.q() * u,
            singular_values: core.singular_values.iter().copied().collect(),
            right: sources.q() * v_t.transpose(),
        }
    }
}

/// `electrodes^2 x electrodes`: readings (V) for each source. Source `i` is the field at electrode `i` less that at the last,
/// summed over all conductance (A/V of contact times ohm); the last source is the total conductance (S).
fn readings_of_sources(jacobian: &Jacobian) -> DMatrix<f64> {
    let electrodes = jacobian.electrodes();
    let drive_v = jacobian.detector.drive_v;
    DMatrix::from_fn(electrodes * electrodes, electrodes, |row, source| {
        let (g, e) = (row / electrodes, row % electrodes);
        if source == electrodes - 1 {
            drive_v * jacobian.total_ohm(g, e)
        } else {
            drive_v * (f64::from(u8::from(source == e)) - f64::from(u8::from(source == g)))
        }
    })
}

/// `nodes x electrodes`: what each node's `u` gives to each source, with the root of its area.
fn sources_of_nodes(jacobian: &Jacobian) -> DMatrix<f64> {
    let electrodes = jacobian.electrodes();
    let fields = &jacobian.fields_ohm;
    let roots_m =
        DVector::from_iterator(fields.nrows(), jacobian.image_mesh.node_areas_m2.iter().map(|area_m2| area_m2.sqrt()));
    DMatrix::from_fn(fields.nrows(), electrodes, |node, source| {
        let ohm = if source == electrodes - 1 { 1.0 } else { fields[(node, source)] - fields[(node, electrodes - 1)] };
        ohm * roots_m[node]
    })
}

/// Sum of products, in eight lanes so that the processor's vector units can take it.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let (a_lanes, a_rest) = a.as_chunks::<8>();
    let (b_lanes, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0f32; 8];
    for (a, b) in a_lanes.iter().zip(b_lanes) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum::<f32>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f32>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::{Detector, Layer};
    use crate::forward::shell::Shell;
    use crate::forward::{ForwardModel, readings_v};
    use crate::scene::Contact;

    fn jacobian(nodes: usize) -> Jacobian {
        match Detector::preset("square-60").map(|detector| Shell::with_nodes(&detector, nodes)) {
            Some(Ok(shell)) => Jacobian::of(&shell),
            _ => panic!("no shell"),
        }
    }

    /// Readings of a contact by a finer mesh than the one that is inverted.
    fn readings(contact: Contact) -> Readings {
        let model = Detector::preset("square-60").and_then(|detector| Shell::with_nodes(&detector, 5000).ok());
        let Some(model) = model else { panic!("no shell") };
        match model.impedance_ohm(&[contact]) {
            Ok(impedance_ohm) => readings_v(&impedance_ohm, model.detector()),
            Err(error) => panic!("{error}"),
        }
    }

    const CONTACT: Contact = Contact::flat(0.009, -0.006, 0.003, 2e-4);

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
                + DMatrix::identity(roots_m.len(), roots_m.len()) * tikhonov.lambda().powi(2);
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
    fn finds_a_contact_where_it_is() {
        let mut tikhonov = Tikhonov::new(&jacobian(2000), Lambda::default(), Variant::Balanced);
        let solution = tikhonov.solve(&readings(CONTACT)).unwrap_or_default();
        let [found] = solution.contacts[..] else { panic!("{:?}", solution.contacts) };
        assert!((found.x_m - 0.009).hypot(found.y_m + 0.006) < 0.003, "{found:?}");
        let rest = tikhonov.solve(&Readings::from_fn(16, |g, e| if (g + e) % 2 == 0 { 1e-3 } else { -1e-3 }));
        assert_eq!(rest.unwrap_or_default().contacts, [], "noise is no contact");
    }
}
