//! Flat maps of a surface, to draw it and to point at it.
//!
//! Two maps do for what detectors are: from above where nothing turns away, so that a plate is drawn as it is; else Lambert's
//! azimuthal equal-area map of the direction in which a place is seen from the surface's middle, which shows a ball, a
//! fingertip or a dome without overlap and, where it is a sphere, with true areas. Only drawing and pointing use it: nothing
//! is computed on a map.

use std::f64::consts::{PI, TAU};

use super::Surface;
use super::weld::millimetres;
use crate::detector::Outline;
use crate::geometry::{self, Point};
use crate::space::{self, Place};

/// Least height of a triangle's unit normal for a map from above: beyond, foreshortening would hide it.
const LEAST_UP: f64 = 0.25;
/// Triangles of which it is checked that nothing hides them.
const PROBES: usize = 200;
/// How far from the top a closed surface is drawn (rad): about the lowest point a map is torn apart.
const FARTHEST_RAD: f64 = 168.0 / 180.0 * PI;
/// Corners of the circle that is the edge of such a map.
const CORNERS: usize = 120;

/// How places become points of a plane.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) enum Map {
    /// Leaves z out.
    Above,
    /// Directions from the middle (m), on a sphere of this radius (m), the top in the middle of the map.
    Around { middle_m: Place, radius_m: f64, is_closed: bool },
}

impl Map {
    /// The map for a surface, which is turned over if it faces down or inwards.
    pub fn of(surface: &mut Surface) -> Result<Self, String> {
        let ups = |surface: &Surface| -> Vec<f64> {
            let normals = (0..surface.triangles.len()).map(|triangle| space::normal(surface.corners(triangle)));
            normals.map(|normal| normal[2] / space::length(normal)).collect()
        };
        if ups(surface).iter().all(|up| *up < -LEAST_UP) {
            surface.turn_over();
        }
        if ups(surface).iter().all(|up| *up > LEAST_UP) {
            return Ok(Self::Above);
        }
        Self::around(surface)
    }

    fn around(surface: &mut Surface) -> Result<Self, String> {
        let (middle_m, radius_m) = middle(surface);
        if facing(surface, middle_m).sum::<f64>() < 0.0 {
            surface.turn_over();
        }
        let turned = facing(surface, middle_m).position(|facing| facing <= 0.0);
        if let Some(triangle) = turned.or_else(|| hidden(surface, middle_m)) {
            let at = millimetres(space::middle(surface.corners(triangle)));
            return Err(format!(
                "cannot be drawn flat: what is at {at} mm is not to be seen from its middle at {} mm; every place of a surface \
                 has to be visible from above, or from the middle",
                millimetres(middle_m)
            ));
        }
        let down = [0.0, 0.0, -1.0];
        let is_closed = (0..surface.triangles.len())
            .any(|triangle| space::ray_to_triangle(middle_m, down, surface.corners(triangle)).is_some());
        Ok(Self::Around { middle_m, radius_m, is_closed })
    }

    /// The point of a place.
    pub fn flat(&self, at: Place) -> Point {
        let Self::Around { middle_m, radius_m, .. } = self else { return [at[0], at[1]] };
        let [x, y, z] = space::sub(at, *middle_m);
        let across = x.hypot(y);
        let angle = across.atan2(z);
        let out = if across > 0.0 { 2.0 * radius_m * (angle / 2.0).sin() / across } else { 0.0 };
        [x * out, y * out]
    }

    /// The ray whose nearest hit is drawn at a point.
    pub fn ray(&self, [x, y]: Point, nodes_m: &[Place]) -> (Place, Place) {
        match self {
            Self::Above => {
                let high = nodes_m.iter().map(|node| node[2]).fold(f64::NEG_INFINITY, f64::max);
                ([x, y, high + 1.0], [0.0, 0.0, -1.0])
            }
            Self::Around { middle_m, radius_m, .. } => {
                let out = x.hypot(y);
                let angle = 2.0 * (out / (2.0 * radius_m)).clamp(0.0, 1.0).asin();
                let (sin, cos) = angle.sin_cos();
                let share = if out > 0.0 { sin / out } else { 0.0 };
                (*middle_m, [x * share, y * share, cos])
            }
        }
    }

    /// Whether a point is within what is drawn.
    pub fn shows(&self, [x, y]: Point) -> bool {
        match self {
            Self::Above => true,
            Self::Around { radius_m, .. } => x.hypot(y) <= self.farthest(*radius_m),
        }
    }

    fn farthest(&self, radius_m: f64) -> f64 {
        let is_open = matches!(self, Self::Around { is_closed: false, .. });
        let angle = if is_open { PI } else { FARTHEST_RAD };
        2.0 * radius_m * (angle / 2.0).sin()
    }

    /// The map's edge for the rims of a surface.
    pub fn outline(&self, rims: &[Vec<Place>]) -> Outline {
        let mut loops: Vec<Vec<Point>> = rims.iter().map(|rim| with_middles(&self.flat_loop(rim))).collect();
        if let Self::Around { radius_m, is_closed: true, .. } = self {
            let circle = |i: usize| (TAU * i as f64 / CORNERS as f64).sin_cos();
            let radius_m = self.farthest(*radius_m);
            loops.push((0..CORNERS).map(circle).map(|(sin, cos)| [radius_m * cos, radius_m * sin]).collect());
        }
        loops.sort_by(|a, b| geometry::area(b).abs().total_cmp(&geometry::area(a).abs()));
        let mut loops = loops.into_iter();
        let turned = |mut polygon: Vec<Point>, sign: f64| {
            if geometry::area(&polygon) * sign < 0.0 {
                polygon.reverse();
            }
            polygon
        };
        let outer = turned(loops.next().unwrap_or_default(), 1.0);
        Outline { outer, holes: loops.map(|hole| turned(hole, -1.0)).collect() }
    }

    fn flat_loop(&self, rim: &[Place]) -> Vec<Point> {
        rim.iter().map(|at| self.flat(*at)).collect()
    }
}

/// A polygon with the middle of each edge as a corner: so that no map is taken for a rectangle, which is flat.
fn with_middles(polygon: &[Point]) -> Vec<Point> {
    geometry::edges(polygon).flat_map(|(a, b)| [a, [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0]]).collect()
}

/// The surface's middle, and how far away it is on average.
fn middle(surface: &Surface) -> (Place, f64) {
    let parts = || {
        let corners = (0..surface.triangles.len()).map(|triangle| surface.corners(triangle));
        corners.map(|corners| (space::length(space::normal(corners)), space::middle(corners)))
    };
    let twice_m2: f64 = parts().map(|(part, _)| part).sum();
    let middle_m = parts().fold([0.0; 3], |sum, (part, at)| space::along(sum, part / twice_m2, at));
    let radius_m = parts().map(|(part, at)| part / twice_m2 * space::distance(at, middle_m)).sum();
    (middle_m, radius_m)
}

/// For each triangle, above zero if it faces away from a place.
fn facing(surface: &Surface, from: Place) -> impl Iterator<Item = f64> + '_ {
    let corners = (0..surface.triangles.len()).map(|triangle| surface.corners(triangle));
    corners.map(move |corners| space::dot(space::normal(corners), space::sub(corners[0], from)))
}

/// A triangle that is behind others, seen from a place; only some are looked at.
fn hidden(surface: &Surface, from: Place) -> Option<usize> {
    let count = surface.triangles.len();
    (0..count).step_by(count.div_ceil(PROBES)).find(|&triangle| {
        let direction = space::sub(space::middle(surface.corners(triangle)), from);
        let mut hits = (0..count).filter_map(|other| space::ray_to_triangle(from, direction, surface.corners(other)));
        hits.any(|share| share < 1.0 - 1e-6)
    })
}

impl Surface {
    fn turn_over(&mut self) {
        self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
}
