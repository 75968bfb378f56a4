//! Triangles with the electrodes' pads among them, on a plane or on a surface in space.

use crate::geometry::{self, Point};
use crate::space::{self, Frame, Place};

/// A triangulated detector.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// Positions (m); on a curved detector those of its map.
    pub nodes_m: Vec<Point>,
    /// Positions in space (m) on a curved detector, else none.
    pub places_m: Vec<Place>,
    /// Corners of each triangle, counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
    /// Which of the triangles are each electrode's pad.
    pub pad_triangles: Vec<std::ops::Range<usize>>,
}

impl Mesh {
    /// Middle of a triangle (m).
    pub fn centroid_m(&self, triangle: [u32; 3]) -> Place {
        let [a, b, c] = triangle.map(|node| self.place_m(node));
        [0, 1, 2].map(|axis| (a[axis] + b[axis] + c[axis]) / 3.0)
    }

    /// Corners of a triangle (m), in a plane of its own on a curved detector.
    pub fn corners(&self, triangle: [u32; 3]) -> [Point; 3] {
        self.seen_from(triangle, [0.0; 3]).0
    }

    /// Corners of a triangle (m), the foot of a place in the same plane, and how high above it the place is.
    pub fn seen_from(&self, triangle: [u32; 3], place_m: Place) -> ([Point; 3], Point, f64) {
        if self.places_m.is_empty() {
            return (triangle.map(|node| self.nodes_m[node as usize]), [place_m[0], place_m[1]], 0.0);
        }
        let corners = triangle.map(|node| self.places_m[node as usize]);
        let frame = Frame::of(corners);
        (corners.map(|corner| frame.flat(corner)), frame.flat(place_m), frame.height(place_m))
    }

    /// Whether a triangle faces the side that a normal points to.
    pub fn faces(&self, triangle: [u32; 3], side: Place) -> bool {
        self.places_m.is_empty()
            || space::dot(space::normal(triangle.map(|node| self.places_m[node as usize])), side) > 0.0
    }

    /// Whether the bounding boxes of a triangle and of a ball are apart.
    pub fn is_apart(&self, triangle: [u32; 3], centre: Place, radius_m: f64) -> bool {
        let apart = |axis: usize, of: &dyn Fn(u32) -> f64| {
            triangle.iter().all(|&node| of(node) > centre[axis] + radius_m)
                || triangle.iter().all(|&node| of(node) < centre[axis] - radius_m)
        };
        if self.places_m.is_empty() {
            (0..2).any(|axis| apart(axis, &|node| self.nodes_m[node as usize][axis]))
        } else {
            (0..3).any(|axis| apart(axis, &|node| self.places_m[node as usize][axis]))
        }
    }

    /// Area that belongs to each node (m2): a third of its triangles'.
    pub fn node_areas_m2(&self) -> Vec<f64> {
        let mut areas_m2 = vec![0.0; self.nodes_m.len()];
        for &triangle in &self.triangles {
            let [a, b, c] = self.corners(triangle);
            for node in triangle {
                areas_m2[node as usize] += geometry::cross(a, b, c) / 6.0;
            }
        }
        areas_m2
    }
}
