//! Where fingers and shapes of a bank are.

use std::f64::consts::TAU;
use std::ops::Range;

use super::scenes::{TRIES, log_uniform, margin_m, scale};
use tactomo_physics::detector::Detector;
use tactomo_physics::geometry::Point;
use tactomo_physics::scene::{Contact, Hand, Scene, SceneName, Shape, Touch};

/// Fingertips: radii (m), conductances (sheet conductances), and how far their centres are from walls at least (m).
const FINGER_RADII_M: Range<f64> = 2e-3..3e-3;
const FINGER_SHEETS: Range<f64> = 0.03..3.0;
const FINGER_MARGIN_M: f64 = 6e-3;
/// Fingers in a row are so far apart (m): those of a hand that are held together are not nearer.
const IN_A_ROW_M: f64 = 12e-3;
/// Two fingers that are pinched (m).
const NEAR_M: Range<f64> = 5e-3..9e-3;
/// Two discs that an edge may be taken for, or the other way round (m).
const PAIR_M: Range<f64> = 10e-3..15e-3;
/// In corners: as far from both walls (m), and conductances (sheet conductances), beside nothing or a firm contact.
const CORNER_M: Range<f64> = 3e-3..6e-3;
const CORNER_SHEETS: Range<f64> = 0.05..0.5;
const FIRM_SHEETS: f64 = 2.0;
const BESIDE_M: Range<f64> = 10e-3..20e-3;
/// A hand is read at some moment of so many seconds, in which each finger presses most once.
const HAND_S: f64 = 5.0;
/// Shapes: longest extent (m), width of strips (m), conductances (sheet conductances).
const EXTENT_M: Range<f64> = 16e-3..24e-3;
const STRIP_M: f64 = 4e-3;
const SHAPE_SHEETS: Range<f64> = 0.3..3.0;
/// A wide disc's radius (m).
const WIDE_M: f64 = 6e-3;

/// Kinds of [`Scenes::Shape`](super::Scenes::Shape).
pub(super) const SHAPES: [&str; 7] = ["two discs", "wide disc", "line", "ring", "cross", "triangle", "L"];

/// Where fingers and shapes are; lengths are in proportion to the detector's.
pub(super) struct Places<'a> {
    detector: &'a Detector,
    scale: f64,
    pub random: &'a mut fastrand::Rng,
}

impl<'a> Places<'a> {
    pub fn new(detector: &'a Detector, random: &'a mut fastrand::Rng) -> Self {
        Self { detector, scale: scale(detector), random }
    }

    fn conductance_s(&mut self, sheets: Range<f64>) -> f64 {
        log_uniform(sheets, self.random) * self.detector.sheet_conductance_s()
    }

    fn length_m(&mut self, range_m: Range<f64>) -> f64 {
        self.scale * (range_m.start + (range_m.end - range_m.start) * self.random.f64())
    }

    /// A place and a direction at which points (m) about it, turned that way, are far enough from walls.
    fn place(&mut self, about_m: &[Point]) -> Option<(Point, Point)> {
        let (outline, least_m) = (&self.detector.outline, self.scale * FINGER_MARGIN_M);
        let size_m = outline.size_m();
        (0..TRIES).find_map(|_| {
            let at_m = size_m.map(|side_m| side_m * (self.random.f64() - 0.5));
            let (sin, cos) = (TAU * self.random.f64()).sin_cos();
            let is_free = |by_m: &Point| margin_m(outline, moved(at_m, turned(*by_m, [cos, sin]))) >= least_m;
            about_m.iter().all(is_free).then_some((at_m, [cos, sin]))
        })
    }

    fn fingertip(&mut self, [x_m, y_m]: Point) -> Contact {
        Contact::flat(x_m, y_m, self.length_m(FINGER_RADII_M), self.conductance_s(FINGER_SHEETS))
    }

    /// So many fingertips in a row, this far apart (m); fewer where the detector has no room.
    pub fn row(&mut self, count: usize, apart_m: f64) -> Vec<Contact> {
        let along = |count: usize| -> Vec<Point> {
            (0..count).map(|i| [apart_m * (i as f64 - 0.5 * (count as f64 - 1.0)), 0.0]).collect()
        };
        let placed = (1..=count).rev().find_map(|count| self.place(&along(count)).map(|placed| (count, placed)));
        let (count, (at_m, direction)) = placed.unwrap_or((1, ([0.0; 2], [1.0, 0.0])));
        along(count).into_iter().map(|by_m| self.fingertip(moved(at_m, turned(by_m, direction)))).collect()
    }

    /// So many fingers side by side.
    pub fn in_a_row(&mut self, count: usize) -> Vec<Contact> {
        self.row(count, self.scale * IN_A_ROW_M)
    }

    /// Two that are pinched.
    pub fn near(&mut self) -> Vec<Contact> {
        let apart_m = self.length_m(NEAR_M);
        self.row(2, apart_m)
    }

    /// A light contact in a corner, alone or beside a firm one.
    pub fn in_corner(&mut self, is_beside: bool) -> Vec<Contact> {
        let from_walls_m = self.length_m(CORNER_M);
        let half_m = self.detector.outline.size_m().map(|side_m| 0.5 * side_m - from_walls_m);
        let [x_m, y_m] = half_m.map(|side_m| if self.random.bool() { side_m } else { -side_m });
        let light = Contact::flat(x_m, y_m, self.length_m(FINGER_RADII_M), self.conductance_s(CORNER_SHEETS));
        let (far_m, firm_s) = (self.length_m(BESIDE_M), FIRM_SHEETS * self.detector.sheet_conductance_s());
        // Towards the middle along one wall or the other.
        let [x_m, y_m] =
            if self.random.bool() { [x_m - far_m.copysign(x_m), y_m] } else { [x_m, y_m - far_m.copysign(y_m)] };
        let firm = Contact::flat(x_m, y_m, self.length_m(FINGER_RADII_M), firm_s);
        std::iter::once(light).chain(is_beside.then_some(firm)).collect()
    }

    /// The fingers of a hand at some moment.
    pub fn hand(&mut self) -> Vec<Touch> {
        let (seed, time_s) = (self.random.u64(..), HAND_S * self.random.f64());
        Scene::new(SceneName::FiveFingers, self.detector, Hand::relative(self.detector), seed).at(time_s)
    }

    /// A touch of a kind of [`SHAPES`].
    pub fn shape(&mut self, kind: usize) -> Vec<Touch> {
        let (extent_m, width_m) = (self.length_m(EXTENT_M), self.scale * STRIP_M);
        let (half_m, strip_m) = (0.5 * extent_m, 0.5 * width_m);
        let square_m = [[half_m, half_m], [-half_m, half_m], [-half_m, -half_m], [half_m, -half_m]];
        let (centre_m, direction) = self.place(&square_m).unwrap_or(([0.0; 2], [1.0, 0.0]));
        let polygon = |corners_m: &[Point]| Shape::Polygon {
            corners_m: corners_m.iter().map(|corner_m| turned(*corner_m, direction)).collect(),
        };
        let shape = match SHAPES[kind] {
            "two discs" => {
                let apart_m = self.length_m(PAIR_M);
                return self.row(2, apart_m).into_iter().map(Touch::from).collect();
            }
            "wide disc" => Shape::Disc { radius_m: self.scale * WIDE_M },
            "line" => Shape::Line { length_m: extent_m, width_m, angle_rad: direction[1].atan2(direction[0]) },
            "ring" => Shape::Ring { radius_m: half_m - strip_m, width_m },
            "cross" => {
                let (h, w) = (half_m, strip_m);
                polygon(&[
                    [h, -w],
                    [h, w],
                    [w, w],
                    [w, h],
                    [-w, h],
                    [-w, w],
                    [-h, w],
                    [-h, -w],
                    [-w, -w],
                    [-w, -h],
                    [w, -h],
                    [w, -w],
                ])
            }
            "triangle" => polygon(&[[half_m, -half_m], [0.0, half_m], [-half_m, -half_m]]),
            _ => {
                let (h, w) = (half_m, half_m - width_m);
                polygon(&[[-h, -h], [h, -h], [h, -w], [-w, -w], [-w, h], [-h, h]])
            }
        };
        vec![Touch::flat(centre_m, shape, self.conductance_s(SHAPE_SHEETS))]
    }
}

fn moved(at_m: Point, by_m: Point) -> Point {
    [0, 1].map(|axis| at_m[axis] + by_m[axis])
}

fn turned([x, y]: Point, [cos, sin]: Point) -> Point {
    [cos * x - sin * y, sin * x + cos * y]
}
