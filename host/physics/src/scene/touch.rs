//! Contacts of any shape.

use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;

use super::Contact;
use crate::detector::LENGTH_M;
use crate::geometry::{self, Point};

/// Conductances of a touch (S): from an insulator's to a bar of copper's.
pub const CONDUCTANCE_S: RangeInclusive<f64> = 1e-12..=1e6;
/// Farthest from the middle of a detector (m).
const FAR_M: f64 = 10.0;

/// A number of a touch that nothing has which touches.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name} is {value:?}, but has to be from {lowest:?} to {highest:?}")]
pub struct TouchError {
    /// Name of the number, with its unit.
    pub name: &'static str,
    /// What it is.
    pub value: f64,
    /// The least that it may be.
    pub lowest: f64,
    /// The most that it may be.
    pub highest: f64,
}

/// Corners of the polygon that stands for a disc, and of the pieces of a ring.
const CORNERS: usize = 64;

/// Where driving layer and detector touch, and how well.
///
/// ```
/// use tactomo_physics::scene::{Shape, Touch};
///
/// let ring = Touch::flat([0.0, 0.0], Shape::Ring { radius_m: 0.01, width_m: 0.002 }, 1e-3);
/// // 1 mS over a ring's area of 2 pi 10 mm 2 mm, which is drawn with corners.
/// assert!((ring.density_s_per_m2()? / 7.96 - 1.0).abs() < 0.01);
/// # Ok::<(), &'static str>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Touch {
    /// Middle of the shape (m).
    pub centre_m: Point,
    /// Its height (m): on a curved detector; zero on a flat one.
    #[serde(default, skip_serializing_if = "geometry::is_zero")]
    pub z_m: f64,
    /// Its outline.
    pub shape: Shape,
    /// Conductance of the whole shape (S), spread evenly over its area.
    pub conductance_s: f64,
}

/// Outline of a touch about its middle.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// A disc.
    Disc {
        /// Radius (m).
        radius_m: f64,
    },
    /// What lies between two circles.
    Ring {
        /// Radius half way between them (m).
        radius_m: f64,
        /// Distance between them (m), at most twice the radius.
        width_m: f64,
    },
    /// A straight strip.
    Line {
        /// Length (m).
        length_m: f64,
        /// Width (m).
        width_m: f64,
        /// Direction, counter-clockwise from x (rad).
        angle_rad: f64,
    },
    /// Any mask: a counter-clockwise polygon that does not cross itself.
    Polygon {
        /// Corners (m), from the middle of the touch.
        corners_m: Vec<Point>,
    },
}

impl Touch {
    /// A touch on a flat detector.
    pub fn flat(centre_m: Point, shape: Shape, conductance_s: f64) -> Self {
        Self { centre_m, z_m: 0.0, shape, conductance_s }
    }

    /// This touch as a disc of contact, if it is one.
    pub fn disc(&self) -> Option<Contact> {
        let Shape::Disc { radius_m } = self.shape else { return None };
        let [x_m, y_m] = self.centre_m;
        Some(Contact { x_m, y_m, z_m: self.z_m, radius_m, conductance_s: self.conductance_s })
    }

    /// Checks that its numbers can be those of something that touches. Whether it lies on a detector is the model's matter.
    ///
    /// # Errors
    /// The first number that cannot be.
    pub fn check(&self) -> Result<(), TouchError> {
        let [x_m, y_m] = self.centre_m;
        let far = [("x_m", x_m), ("y_m", y_m), ("z_m", self.z_m)].map(|(name, value)| (name, value, -FAR_M..=FAR_M));
        let sizes = match self.shape {
            Shape::Disc { radius_m } => vec![("radius_m", radius_m)],
            Shape::Ring { radius_m, width_m } => vec![("radius_m", radius_m), ("width_m", width_m)],
            Shape::Line { length_m, width_m, .. } => vec![("length_m", length_m), ("width_m", width_m)],
            Shape::Polygon { .. } => Vec::new(),
        };
        let sizes = sizes.into_iter().map(|(name, value)| (name, value, LENGTH_M));
        let all = far.into_iter().chain(sizes).chain([("conductance_s", self.conductance_s, CONDUCTANCE_S)]);
        match all.into_iter().find(|(_, value, range)| !range.contains(value)) {
            Some((name, value, range)) => {
                Err(TouchError { name, value, lowest: *range.start(), highest: *range.end() })
            }
            None => Ok(()),
        }
    }

    /// Conductance per area (S/m2), or what is wrong with the touch.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn density_s_per_m2(&self) -> Result<f64, &'static str> {
        if let Shape::Ring { radius_m, width_m } = self.shape
            && width_m > 2.0 * radius_m
        {
            return Err("its ring is wider than its radius allows");
        }
        let positive = |value: f64| value > 0.0 && value.is_finite();
        if !self.centre_m.iter().all(|at_m| at_m.is_finite()) {
            return Err("its middle is not a place");
        }
        if !positive(self.area_m2()) {
            return Err("its area is not above zero (a polygon's corners go counter-clockwise)");
        }
        let density_s_per_m2 = self.conductance_s / self.area_m2();
        if positive(density_s_per_m2) { Ok(density_s_per_m2) } else { Err("its conductance is not above zero") }
    }

    /// Area (m2).
    pub fn area_m2(&self) -> f64 {
        match &self.shape {
            Shape::Disc { radius_m } => PI * radius_m * radius_m,
            Shape::Ring { radius_m, width_m } => TAU * radius_m * width_m,
            Shape::Line { length_m, width_m, .. } => length_m * width_m,
            Shape::Polygon { corners_m } => geometry::area(corners_m),
        }
    }

    /// Polygons, counter-clockwise, that make it up without overlap; their area is that of the touch.
    pub fn pieces(&self) -> Vec<Vec<Point>> {
        let [x, y] = self.centre_m;
        let moved = |corners: Vec<Point>| corners.into_iter().map(|[dx, dy]| [x + dx, y + dy]).collect();
        match &self.shape {
            Shape::Disc { radius_m } => vec![geometry::disc(self.centre_m, *radius_m, CORNERS)],
            Shape::Ring { radius_m, width_m } => ring(*radius_m, *width_m).map(moved).collect(),
            Shape::Line { length_m, width_m, angle_rad } => vec![moved(strip(*length_m, *width_m, *angle_rad))],
            Shape::Polygon { corners_m } => vec![moved(corners_m.clone())],
        }
    }
}

impl From<Contact> for Touch {
    fn from(contact: Contact) -> Self {
        Self {
            centre_m: [contact.x_m, contact.y_m],
            z_m: contact.z_m,
            shape: Shape::Disc { radius_m: contact.radius_m },
            conductance_s: contact.conductance_s,
        }
    }
}

/// Quadrilaterals between two regular polygons that have the areas of the circles.
fn ring(radius_m: f64, width_m: f64) -> impl Iterator<Item = Vec<Point>> {
    let circle = |radius_m: f64| geometry::disc([0.0; 2], radius_m, CORNERS);
    let (inner, outer) = (circle(radius_m - width_m / 2.0), circle(radius_m + width_m / 2.0));
    (0..CORNERS).map(move |i| {
        let next = (i + 1) % CORNERS;
        vec![outer[i], outer[next], inner[next], inner[i]]
    })
}

fn strip(length_m: f64, width_m: f64, angle_rad: f64) -> Vec<Point> {
    let (sin, cos) = angle_rad.sin_cos();
    let corner = |along: f64, across: f64| {
        let (u, v) = (along * length_m / 2.0, across * width_m / 2.0);
        [u * cos - v * sin, u * sin + v * cos]
    };
    vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_nothing_has_which_touches_are_told_by_name_and_range() {
        let disc = |x_m, radius_m, conductance_s| Touch::flat([x_m, 0.0], Shape::Disc { radius_m }, conductance_s);
        assert_eq!(disc(0.0, 0.003, 1e-3).check(), Ok(()));
        for (touch, told) in [
            (disc(1e308, 0.003, 1e-3), "x_m is 1e308, but has to be from -10.0 to 10.0"),
            (disc(f64::NAN, 0.003, 1e-3), "x_m is NaN"),
            (disc(0.0, 1e308, 1e-3), "radius_m is 1e308, but has to be from 1e-6 to 10.0"),
            (disc(0.0, 0.003, -1.0), "conductance_s is -1.0, but has to be from 1e-12 to 1000000.0"),
            (disc(0.0, 0.003, 1e308), "conductance_s is 1e308"),
            (
                Touch::flat([0.0; 2], Shape::Line { length_m: 0.02, width_m: 0.0, angle_rad: 0.0 }, 1e-3),
                "width_m is 0.0",
            ),
        ] {
            let error = touch.check().unwrap_err().to_string();
            assert!(error.starts_with(told), "{error}");
        }
    }

    #[test]
    fn pieces_have_the_area_of_the_shape_and_its_middle() {
        let shapes = [
            Shape::Disc { radius_m: 0.004 },
            Shape::Ring { radius_m: 0.01, width_m: 0.003 },
            Shape::Line { length_m: 0.03, width_m: 0.002, angle_rad: 0.7 },
            Shape::Polygon { corners_m: vec![[-0.002, -0.001], [0.002, -0.001], [0.0, 0.002]] },
        ];
        for shape in shapes {
            let touch = Touch::flat([0.003, -0.005], shape, 1e-3);
            let parts: Vec<_> = touch.pieces().iter().filter_map(|piece| geometry::area_and_centroid(piece)).collect();
            let area_m2: f64 = parts.iter().map(|(area_m2, _)| area_m2).sum();
            assert!((area_m2 / touch.area_m2() - 1.0).abs() < 1e-9, "{touch:?}");
            for (axis, middle_m) in touch.centre_m.iter().enumerate() {
                let mean_m = parts.iter().map(|(area, centroid)| area * centroid[axis]).sum::<f64>() / area_m2;
                assert!((mean_m - middle_m).abs() < 1e-12, "{touch:?}");
            }
        }
    }

    #[test]
    fn touches_that_cannot_be_say_why() {
        let polygon = |corners_m: &[Point]| Shape::Polygon { corners_m: corners_m.to_vec() };
        for (shape, conductance_s, what) in [
            (Shape::Disc { radius_m: 0.0 }, 1e-3, "area"),
            (Shape::Disc { radius_m: 0.1 }, -1e-3, "conductance"),
            (Shape::Disc { radius_m: 0.1 }, f64::INFINITY, "conductance"),
            (Shape::Ring { radius_m: 0.01, width_m: 0.021 }, 1e-3, "wider than"),
            (polygon(&[[0.0, 0.0], [0.0, 1e-3], [1e-3, 0.0]]), 1e-3, "counter-clockwise"),
            (polygon(&[]), 1e-3, "area"),
        ] {
            let error = Touch::flat([0.0; 2], shape, conductance_s).density_s_per_m2().unwrap_err();
            assert!(error.contains(what), "{error}");
        }
        let nowhere = Touch::flat([f64::NAN, 0.0], Shape::Disc { radius_m: 0.1 }, 1e-3);
        assert_eq!(nowhere.density_s_per_m2(), Err("its middle is not a place"));
    }

    #[test]
    fn touches_are_read_back_as_they_were_written() {
        for shape in [
            Shape::Ring { radius_m: 0.01, width_m: 0.003 },
            Shape::Polygon { corners_m: vec![[0.0, 0.0], [0.001, 0.0], [0.0, 0.001]] },
        ] {
            let touch = Touch { z_m: 0.002, ..Touch::flat([0.003, -0.005], shape, 1e-3) };
            let text = serde_json::to_string(&touch).unwrap();
            assert_eq!(serde_json::from_str::<Touch>(&text).unwrap(), touch);
        }
    }

    #[test]
    fn only_a_disc_is_a_contact() {
        let contact = Contact { z_m: 0.004, ..Contact::flat(0.001, 0.002, 0.003, 1e-3) };
        assert_eq!(Touch::from(contact).disc(), Some(contact));
        let ring = Shape::Ring { radius_m: 0.01, width_m: 0.003 };
        assert_eq!(Touch { shape: ring, ..Touch::from(contact) }.disc(), None);
    }
}
