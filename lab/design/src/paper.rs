//! The paper's solver: thin shell, Tikhonov with lambda^2 = 5000, and its image of one contact.
//!
//! It is what [`Method::TikhonovPaper`](tactomo_touch::solve::Method::TikhonovPaper) is on a thin shell. Where conductivity, pads, switch and contacts
//! conduct more by one factor, readings stay as they are; so its images, over the sheet's conductance, do not depend on that factor, and one solver
//! serves all materials of the same outline and electrodes, as in the paper.

use tactomo_physics::detector::{Detector, Layer};
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::forward::shell::Shell;
use tactomo_physics::forward::{ForwardError, ImageMesh};
use tactomo_physics::geometry::{self, Point};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_touch::metrics::{PaperFigures, centroid_m};
use tactomo_touch::solve::{Lambda, Tikhonov, Variant};

/// Thickness of the shell that stands for the detector (m): only the sheet's conductance counts.
const THICKNESS_M: f64 = 1.0;

/// The paper's solver for detectors of one outline and one set of electrodes.
pub struct PaperSolver {
    tikhonov: Tikhonov,
    mesh: ImageMesh,
    sheet_s: f64,
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
    /// For the outline and the electrodes of a detector. Layers are taken for one sheet, also where they are joined by dots.
    ///
    /// # Errors
    /// [`ForwardError`] if there is no thin shell of it.
    pub fn new(detector: &Detector) -> Result<Self, ForwardError> {
        Self::with_lambda(detector, Lambda::PAPER)
    }

    /// The same with another lambda.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn with_lambda(detector: &Detector, lambda: Lambda) -> Result<Self, ForwardError> {
        let sheet_s = detector.sheet_conductance_s();
        let layers = vec![Layer::uniform(THICKNESS_M, sheet_s / THICKNESS_M)];
        let jacobian = Jacobian::of(&Shell::new(&Detector { layers, ..detector.taken_as_exact() })?);
        let tikhonov = Tikhonov::new(&jacobian, lambda, Variant::Paper);
        Ok(Self { tikhonov, mesh: jacobian.image_mesh, sheet_s, width_m: detector.outline.size_m()[0] })
    }

    /// The image of readings (V) of one contact; `None` if it is nowhere above zero.
    pub fn imaged(&self, readings: &Readings, contact: &Contact) -> Option<Imaged> {
        let image = self.image_s_per_m2(readings)?;
        let figures = PaperFigures::of(&self.mesh, &image, contact, self.width_m)?;
        let centroid_m = centroid_m(&self.mesh, &image)?;
        Some(Imaged { figures, centroid_m, output: value_at(&self.mesh, &image, centroid_m)? })
    }

    /// The detector's width (m), which SR and PA are shares of.
    pub fn width_m(&self) -> f64 {
        self.width_m
    }

    /// The image along a line through a point (S/m2 of a sheet of 1 S): from side to side, at so many places.
    pub fn profile(&self, readings: &Readings, through_m: Point, places: usize) -> Option<Vec<[f64; 2]>> {
        let image = self.image_s_per_m2(readings)?;
        let step_m = self.width_m / places as f64;
        let x_m = |index: usize| (index as f64 + 0.5) * step_m - self.width_m / 2.0;
        (0..places).map(|index| Some([x_m(index), value_at(&self.mesh, &image, [x_m(index), through_m[1]])?])).collect()
    }

    /// The image (S/m2 of a sheet of 1 S).
    fn image_s_per_m2(&self, readings: &Readings) -> Option<Vec<f32>> {
        let image = self.tikhonov.image_s_per_m2(readings).ok()?;
        Some(image.into_iter().map(|value| (f64::from(value) / self.sheet_s) as f32).collect())
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
    use tactomo_touch::solve::{Method, Problem};

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

    fn readings(detector: &Detector, contact: &Contact) -> Readings {
        readings_v(&Slab::new(detector).unwrap().impedance_ohm(&[*contact]).unwrap(), detector)
    }

    /// What `reconstruct --solver tikhonov-paper --model shell` finds in readings.
    fn reconstructed_m(detector: &Detector, readings: &Readings) -> Point {
        let problem = Problem::new(Box::new(Shell::new(detector).unwrap()) as Box<dyn ForwardModel>);
        let found = Method::TikhonovPaper.build(&problem).unwrap().solve(readings).unwrap();
        let [contact] = found.contacts[..] else { panic!("{:?}", found.contacts) };
        [contact.x_m, contact.y_m]
    }

    #[test]
    fn it_sees_what_reconstruct_sees_in_the_same_readings() {
        for name in ["square-60", "strip-13x60"] {
            let detector = Detector { drive_v: 2.4, ..Detector::preset(name).unwrap().taken_as_exact() };
            let [width_m, height_m] = detector.outline.size_m();
            let contact = Contact::flat(width_m / 3.0, height_m / 3.0, 0.002, 0.0251);
            let readings = readings(&detector, &contact);
            let found_m = PaperSolver::new(&detector).unwrap().imaged(&readings, &contact).unwrap().centroid_m;
            let expected_m = reconstructed_m(&detector, &readings);
            assert!(geometry::distance(found_m, expected_m) < 1e-6, "{name}: {found_m:?} {expected_m:?}");
        }
    }

    #[test]
    fn a_firm_contact_at_a_third_of_the_sides_is_pulled_nearly_to_the_middle() {
        let detector = Detector::preset("square-60").unwrap().taken_as_exact();
        let contact = Contact::flat(0.02, 0.02, 0.002, 0.0251);
        let solver = PaperSolver::new(&detector).unwrap();
        let [x_m, y_m] = solver.imaged(&readings(&detector, &contact), &contact).unwrap().centroid_m;
        assert!((0.004..0.006).contains(&x_m) && (x_m - y_m).abs() < 3e-4, "{x_m} {y_m}");
    }

    #[test]
    fn what_conducts_more_by_one_factor_everywhere_looks_the_same() {
        let detector = Detector::preset("square-60").unwrap().taken_as_exact();
        let factor = 880.0;
        let mut better = detector.clone();
        for layer in &mut better.layers {
            (layer.bottom_s_per_m, layer.top_s_per_m) = (layer.bottom_s_per_m * factor, layer.top_s_per_m * factor);
        }
        better.contact_impedance_ohm_m2 /= factor;
        better.on_resistance_ohm /= factor;
        let contact = Contact::flat(0.015, -0.01, 0.002, 1e-3);
        let readings = readings(&detector, &contact);
        let [a, b] = [&detector, &better]
            .map(|detector| PaperSolver::new(detector).unwrap().imaged(&readings, &contact).unwrap());
        assert!(geometry::distance(a.centroid_m, b.centroid_m) < 1e-7, "{a:?} {b:?}");
        assert!((a.output / b.output - 1.0).abs() < 1e-4, "{a:?} {b:?}");
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
