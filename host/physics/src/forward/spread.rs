//! From touches of any shape to conductances at an image's nodes.

use nalgebra::DMatrix;

use super::{ForwardError, ForwardModel, ImageMesh};
use crate::geometry::{self, Point};
use crate::scene::{Contact, Touch};

/// Impedance matrix under touches of any shape (ohm): as discs where all are, else as an image of conductance.
///
/// ```
/// use tactomo_physics::detector::Detector;
/// use tactomo_physics::forward::{Auto, readings_v, touched_impedance_ohm};
/// use tactomo_physics::scene::Contact;
///
/// let detector = Detector::default();
/// let model = Auto::new(&detector, None)?.model;
/// let press = Contact::flat(0.009, -0.006, 0.003, 2e-4);
/// let readings = readings_v(&touched_impedance_ohm(&*model, &[press.into()])?, &detector);
/// assert!(readings.largest_v() > 0.01 && readings.largest_v() < detector.drive_v);
/// # Ok::<(), tactomo_physics::forward::ForwardError>(())
/// ```
///
/// # Errors
/// As for [`ForwardModel::impedance_ohm`] and [`ForwardModel::image_fields`].
pub fn touched_impedance_ohm(model: &dyn ForwardModel, touches: &[Touch]) -> Result<DMatrix<f64>, ForwardError> {
    match touches.iter().map(Touch::disc).collect::<Option<Vec<Contact>>>() {
        Some(discs) => model.impedance_ohm(&discs),
        None => model.image_impedance_ohm(&model.image_mesh().conductances_s(touches)?),
    }
}

impl ImageMesh {
    /// Contact conductance that each node gets from touches (S): the integral of its shape function over them, times their
    /// conductance per area.
    ///
    /// Exact, as touches are polygons and a linear function's integral over a part is its value at the part's centroid. So
    /// the conductance of a touch and its centre are kept on any mesh; what lies beyond the edge touches nothing.
    ///
    /// # Errors
    /// [`ForwardError::Contact`] if the mesh is that of a curved detector, or a touch is off the mesh, or cannot be.
    pub fn conductances_s(&self, touches: &[Touch]) -> Result<Vec<f64>, ForwardError> {
        let mut image_s = vec![0.0; self.nodes_m.len()];
        for (index, touch) in touches.iter().enumerate() {
            let wrong = |what: &str| ForwardError::Contact { index, what: what.to_owned() };
            if !self.places_m.is_empty() {
                return Err(wrong("on a curved detector only discs can touch"));
            }
            let density_s_per_m2 = touch.density_s_per_m2().map_err(wrong)?;
            let mut touches = false;
            for piece in touch.pieces() {
                touches |= self.spread(&piece, density_s_per_m2, &mut image_s);
            }
            if !touches {
                return Err(wrong("it is off the detector"));
            }
        }
        Ok(image_s)
    }

    /// Adds the integral over a counter-clockwise polygon; whether it covers anything.
    fn spread(&self, polygon: &[Point], density_s_per_m2: f64, image_s: &mut [f64]) -> bool {
        let bounds = bounds(polygon);
        let mut covers = false;
        for triangle in &self.triangles {
            let corners = triangle.map(|node| self.nodes_m[node as usize]);
            if are_apart(bounds, corners) {
                continue;
            }
            let Some(integrals_m2) = geometry::shape_integrals_m2(polygon, corners) else { continue };
            for (node, integral_m2) in triangle.iter().zip(integrals_m2) {
                image_s[*node as usize] += density_s_per_m2 * integral_m2;
            }
            covers = true;
        }
        covers
    }
}

/// Smallest and largest x and y.
fn bounds(points: &[Point]) -> [Point; 2] {
    points.iter().fold([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]], |[low, high], p| {
        [[low[0].min(p[0]), low[1].min(p[1])], [high[0].max(p[0]), high[1].max(p[1])]]
    })
}

fn are_apart([low, high]: [Point; 2], corners: [Point; 3]) -> bool {
    (0..2).any(|axis| {
        corners.iter().all(|corner| corner[axis] > high[axis]) || corners.iter().all(|corner| corner[axis] < low[axis])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Detector;
    use crate::forward::readings_v;
    use crate::forward::shell::Shell;
    use crate::forward::slab::Slab;
    use crate::scene::Shape;

    /// A square of 10 mm in 200 triangles.
    fn mesh() -> ImageMesh {
        let node = |i: u32, j: u32| j * 11 + i;
        let nodes_m = (0..121).map(|k| [f64::from(k % 11) * 1e-3, f64::from(k / 11) * 1e-3]).collect();
        let squares = (0..10).flat_map(|j| (0..10).map(move |i| (i, j)));
        let triangles = squares
            .flat_map(|(i, j)| {
                let corners = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
                [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]
            })
            .collect();
        ImageMesh { nodes_m, triangles, ..ImageMesh::default() }
    }

    fn touch(shape: Shape) -> Touch {
        Touch::flat([0.0043, 0.0056], shape, 2e-3)
    }

    #[test]
    fn conductance_and_centre_of_any_shape_are_kept() {
        let concave = vec![[-0.002, -0.002], [0.003, -0.002], [0.0, -0.001], [0.001, 0.003], [-0.002, 0.001]];
        let shapes = [
            Shape::Disc { radius_m: 0.0017 },
            Shape::Ring { radius_m: 0.003, width_m: 0.0002 },
            Shape::Line { length_m: 0.007, width_m: 0.0001, angle_rad: 0.4 },
            Shape::Polygon { corners_m: concave },
        ];
        for touch in shapes.map(touch) {
            let mesh = mesh();
            let image_s = mesh.conductances_s(std::slice::from_ref(&touch)).unwrap();
            assert!((image_s.iter().sum::<f64>() / 2e-3 - 1.0).abs() < 1e-9, "{touch:?}");
            let (mut area_m2, mut moment) = (0.0, [0.0; 2]);
            for (part_m2, middle) in touch.pieces().iter().filter_map(|piece| geometry::area_and_centroid(piece)) {
                area_m2 += part_m2;
                moment = [0, 1].map(|axis| moment[axis] + part_m2 * middle[axis]);
            }
            for axis in 0..2 {
                let mean_m = image_s.iter().zip(&mesh.nodes_m).map(|(s, at)| s * at[axis]).sum::<f64>() / 2e-3;
                assert!((mean_m - moment[axis] / area_m2).abs() < 1e-11, "{touch:?}");
            }
        }
    }

    #[test]
    fn a_disc_as_an_image_of_the_shell_is_the_shells_disc() {
        let shell = Shell::with_nodes(&Detector::preset(Detector::DEFAULT).unwrap(), 800).unwrap();
        let contacts = [Contact::flat(0.004, -0.011, 0.003, 1e-3), Contact::flat(-0.02, 0.029, 0.004, 2e-4)];
        let image_s = shell.image_mesh().conductances_s(&contacts.map(Touch::from)).unwrap();
        let [as_image, as_discs] =
            [shell.image_fields(&image_s).unwrap().impedance_ohm, shell.impedance_ohm(&contacts).unwrap()];
        assert!((as_image - &as_discs).amax() < 1e-9 * as_discs.amax());
    }

    #[test]
    fn a_ring_on_the_slab_is_a_ring_of_small_discs() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let slab = Slab::new(&detector).unwrap();
        let (radius_m, width_m, conductance_s) = (0.012, 0.002, 1.5e-3);
        let ring = Touch::flat([0.003, -0.002], Shape::Ring { radius_m, width_m }, conductance_s);
        let discs: Vec<Contact> = (0..40)
            .map(|i| (std::f64::consts::TAU * f64::from(i) / 40.0).sin_cos())
            .map(|(sin, cos)| [0.003 + radius_m * cos, -0.002 + radius_m * sin])
            .map(|[x_m, y_m]| Contact::flat(x_m, y_m, width_m / 2.0, conductance_s / 40.0))
            .collect();
        let found = readings_v(&touched_impedance_ohm(&slab, &[ring]).unwrap(), &detector);
        let expected = readings_v(&slab.impedance_ohm(&discs).unwrap(), &detector);
        let off = found.volts().iter().zip(expected.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 0.01 * expected.largest_v(), "{}", off / expected.largest_v());
    }

    #[test]
    fn a_ring_leaves_its_middle_free() {
        let image_s = mesh().conductances_s(&[touch(Shape::Ring { radius_m: 0.003, width_m: 0.001 })]).unwrap();
        assert_eq!(image_s[5 * 11 + 4], 0.0);
        assert!(image_s[5 * 11 + 7] > 0.0);
    }

    #[test]
    fn what_overhangs_touches_nothing_and_what_is_off_is_an_error() {
        let half = Touch { centre_m: [0.0, 0.005], ..touch(Shape::Disc { radius_m: 0.002 }) };
        let image_s = mesh().conductances_s(std::slice::from_ref(&half)).unwrap();
        assert!((image_s.iter().sum::<f64>() - 1e-3).abs() < 1e-12);
        let off = Touch { centre_m: [0.02, 0.0], ..half.clone() };
        let error = mesh().conductances_s(&[half, off]).unwrap_err().to_string();
        assert!(error.contains("contact 1 (it is off the detector)"), "{error}");
    }
}
