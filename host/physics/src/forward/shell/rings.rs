//! Rings of triangles in and around an electrode's pad.

use std::f64::consts::TAU;

use crate::detector::Electrode;
use crate::geometry::{self, Point};

/// Bulk edge length over the length of a segment of a pad's edge.
const PAD_REFINEMENT: f64 = 2.6;
/// Fewest segments of a pad's edge.
const FEWEST_SEGMENTS: usize = 12;

/// A pad's edge and the rings within.
pub(super) struct PadRings {
    pub centre: Point,
    pub radius_m: f64,
    pub segments: usize,
    pub inner_radii_m: Vec<f64>,
}

impl PadRings {
    pub fn new(electrode: &Electrode, edge_depth_m: f64, edge_m: f64) -> Self {
        let radius_m = electrode.radius_m;
        let segments = segments(radius_m, edge_m);
        // Depths where the potential, which falls as exp(-depth / edge_depth_m), is met with equal errors by linear elements.
        let rings = (segments / 8).max(2);
        let scale_m = (2.2 * edge_depth_m).max(0.01 * radius_m).min(0.75 * radius_m / ((rings + 1) as f64).ln());
        let depth_m = |ring: usize| -scale_m * (-(ring as f64) / (rings + 1) as f64).ln_1p();
        let inner_radii_m = (1..=rings).map(|ring| radius_m - depth_m(ring)).collect();
        Self { centre: [electrode.x_m, electrode.y_m], radius_m, segments, inner_radii_m }
    }

    pub fn edge(&self) -> Vec<Point> {
        geometry::disc(self.centre, self.radius_m, self.segments)
    }

    /// Size of triangles at a place (m): like the segments of the pad's edge, and growing as the distance from its centre.
    pub fn size_m(&self, at: Point) -> f64 {
        self.size_at_m(geometry::distance(at, self.centre))
    }

    /// Size of triangles at a distance from its centre (m).
    pub fn size_at_m(&self, distance_m: f64) -> f64 {
        TAU / self.segments as f64 * distance_m.max(self.radius_m)
    }

    /// Rings around the pad, out to where triangles have the size `edge_m`.
    pub fn outer_rings(&self, edge_m: f64) -> impl Iterator<Item = Point> + '_ {
        self.outer_radii_m(edge_m)
            .flat_map(|(radius_m, turn)| geometry::turned_disc(self.centre, radius_m, self.segments, turn))
    }

    /// Radii of these rings (m), and by which angle they are turned.
    pub fn outer_radii_m(&self, edge_m: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
        // Equilateral triangles are as high as 0.87 of their edge; every second ring is turned by half a step.
        let ratio = 1.0 + 0.87 * TAU / self.segments as f64;
        let rings = (edge_m * self.segments as f64 / TAU / self.radius_m).ln() / ratio.ln();
        (1..=rings.floor().max(0.0) as i32).map(move |ring| {
            let turn = TAU / self.segments as f64 * 0.5 * f64::from(ring % 2);
            (self.radius_m * ratio.powi(ring), turn)
        })
    }
}

/// Segments of a pad's edge.
pub(super) fn segments(radius_m: f64, edge_m: f64) -> usize {
    let wanted = PAD_REFINEMENT * TAU * radius_m / edge_m;
    (2.0 * (wanted / 2.0).round()).max(FEWEST_SEGMENTS as f64) as usize
}
