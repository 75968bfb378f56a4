//! The paper's solver and its metrics: thin shell, uniform conductivity, Tikhonov with lambda^2 = 5000.
//!
//! The shell's Jacobian does not depend on the conductivity ([`Lambda::Paper`] says how 5000 is mapped), so that one solver serves all
//! detectors of the same outline and electrodes, as in the paper.

use tactomo_physics::detector::{Detector, Layer};
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::forward::shell::Shell;
use tactomo_physics::forward::{ForwardError, ImageMesh};
use tactomo_physics::geometry::{self, Point};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_touch::metrics::{PaperFigures, centroid_m};
use tactomo_touch::solve::{Lambda, Tikhonov, Variant};

/// `lambda^2` (V2/S2), section II.C.
const LAMBDA_2: f64 = 5000.0;
/// Nodes of the mesh, and drive (V), there.
const NODES: usize = 2000;
const DRIVE_V: f64 = 2.0;
/// Thickness of the shell that stands for the detector (m), with 1 S/m as there: any does.
const THICKNESS_M: f64 = 1.0;

/// The paper's solver for detectors of one outline and one set of electrodes.
pub struct PaperSolver {
    tikhonov: Tikhonov,
    mesh: ImageMesh,
    width_m: f64,
}

/// What it makes of the readings of one contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imaged {
    /// Spatial resolution (9) and position accuracy (10).
    pub figures: PaperFigures,
    /// Centroid of the image (m).
    pub centroid_m: Point,
    /// Value of the image at its centroid (S/m2 of a sheet of 1 S).
    pub output: f64,
}

impl PaperSolver {
    /// For the outline and the electrodes of a detector.
    ///
    /// # Errors
    /// [`ForwardError`] if there is no thin shell of it.
    pub fn new(detector: &Detector) -> Result<Self, ForwardError> {
        let shell = Shell::with_nodes(
            &Detector { layers: vec![Layer::uniform(THICKNESS_M, 1.0)], drive_v: DRIVE_V, ..detector.taken_as_exact() },
            NODES,
        )?;
        let jacobian = Jacobian::of(&shell);
        let tikhonov = Tikhonov::new(&jacobian, Lambda::Paper(LAMBDA_2), Variant::Paper);
        Ok(Self { tikhonov, mesh: jacobian.image_mesh, width_m: detector.outline.size_m()[0] })
    }

    /// The image of readings (V) of one contact; `None` if it is nowhere above zero.
    pub fn imaged(&self, readings: &Readings, contact: &Contact) -> Option<Imaged> {
        let image = self.image_s_per_m2(readings)?;
        let figures = PaperFigures::of(&self.mesh, &image, contact, self.width_m)?;
        let centroid_m = centroid_m(&self.mesh, &image)?;
        Some(Imaged { figures, centroid_m, output: value_at(&self.mesh, &image, centroid_m)? })
    }

    /// The image along a line through a point (S/m2): from side to side, at so many places.
    pub fn profile(&self, readings: &Readings, through_m: Point, places: usize) -> Option<Vec<[f64; 2]>> {
        let image = self.image_s_per_m2(readings)?;
        let step_m = self.width_m / places as f64;
        let x_m = |index: usize| (index as f64 + 0.5) * step_m - self.width_m / 2.0;
        (0..places).map(|index| Some([x_m(index), value_at(&self.mesh, &image, [x_m(index), through_m[1]])?])).collect()
    }

    fn image_s_per_m2(&self, readings: &Readings) -> Option<Vec<f32>> {
        self.tikhonov.image_s_per_m2(readings).ok()
    }
}

/// Value of an image at a point (m), linear in the triangle around it; of the nearest node beside all triangles.
fn value_at(mesh: &ImageMesh, image: &[f32], at_m: Point) -> Option<f64> {
    let inside = mesh.triangles.iter().find_map(|triangle| {
        let [a, b, c] = triangle.map(|node| mesh.nodes_m[node as usize]);
        let whole = geometry::cross(a, b, c);
        let shares = [geometry::cross(at_m, b, c), geometry::cross(a, at_m, c), geometry::cross(a, b, at_m)]
            .map(|part| part / whole);
        shares.iter().all(|share| *share >= -1e-9).then(|| {
            shares.iter().zip(triangle).map(|(share, node)| share * f64::from(image[*node as usize])).sum::<f64>()
        })
    });
    let nearest = || {
        let distance = |node: &usize| geometry::distance(mesh.nodes_m[*node], at_m);
        (0..mesh.nodes_m.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).map(|node| f64::from(image[node]))
    };
    inside.or_else(nearest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::forward::{ForwardModel, Slab, readings_v};

    #[test]
    fn it_sees_a_contact_pulled_to_the_middle_and_its_output_grows_with_the_contact() {
        let detector = Detector::default();
        let solver = PaperSolver::new(&detector).unwrap();
        let slab = Slab::new(&detector).unwrap();
        let imaged = |conductance_s: f64| {
            let contact = Contact::flat(0.02, 0.0, 0.002, conductance_s);
            let readings = readings_v(&slab.impedance_ohm(&[contact]).unwrap(), &detector);
            solver.imaged(&readings, &contact).unwrap()
        };
        let [light, firm] = [1e-4, 1e-2].map(imaged);
        assert!(firm.output > light.output && light.output > 0.0);
        for found in [light, firm] {
            assert!(
                found.centroid_m[0] > 0.0 && found.centroid_m[0] < 0.02 && found.centroid_m[1].abs() < 1e-3,
                "{found:?}"
            );
            let error_m = 0.06 * (1.0 - found.figures.position_accuracy);
            assert!((geometry::distance(found.centroid_m, [0.02, 0.0]) - error_m).abs() < 1e-9);
        }
    }

    #[test]
    fn values_between_nodes_are_linear() {
        let mesh = ImageMesh {
            nodes_m: vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
            triangles: vec![[0, 1, 2]],
            ..ImageMesh::default()
        };
        assert_eq!(value_at(&mesh, &[1.0, 3.0, 5.0], [0.25, 0.25]), Some(2.5));
        assert_eq!(value_at(&mesh, &[1.0, 3.0, 5.0], [2.0, 0.1]), Some(3.0));
    }
}
