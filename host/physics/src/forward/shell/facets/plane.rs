//! A facet in its own plane, while it is triangulated.

use std::f64::consts::TAU;

use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

use super::{CLEAR, Cutter, LATTICE, Pad};
use crate::detector::edges_of;
use crate::geometry::{self, Point};
use crate::space::{self, Frame};

/// A circle in a facet's plane.
pub(super) struct Circle {
    pub centre: Point,
    pub radius_m: f64,
    pub segments: usize,
}

impl Circle {
    pub fn at(&self, angle: f64) -> Point {
        let (sin, cos) = angle.sin_cos();
        [self.centre[0] + self.radius_m * cos, self.centre[1] + self.radius_m * sin]
    }

    pub fn angle(&self, at: Point) -> f64 {
        (at[1] - self.centre[1]).atan2(at[0] - self.centre[0])
    }
}

/// A facet in its plane, while it is triangulated.
pub(super) struct Plane {
    pub frame: Frame,
    corners: [Point; 3],
    /// Nodes and where they are; those of the facet's edges come first, counter-clockwise.
    pub nodes: Vec<u32>,
    pub points: Vec<Point>,
    pub border: usize,
    /// Where in `nodes` the three corners are.
    starts: [usize; 3],
    pub edges: Vec<[usize; 2]>,
}

impl Plane {
    pub fn new(cutter: &Cutter, facet: usize) -> Self {
        let frame = Frame::of(cutter.surface.corners(facet));
        let (mut nodes, mut starts) = (Vec::new(), [0; 3]);
        for (start, (a, b)) in starts.iter_mut().zip(edges_of(cutter.surface.triangles[facet])) {
            *start = nodes.len();
            nodes.push(a);
            let within = &cutter.within_edges[&(a.min(b), a.max(b))];
            if a < b { nodes.extend(within) } else { nodes.extend(within.iter().rev()) }
        }
        let points: Vec<_> = nodes.iter().map(|node| frame.flat(cutter.places_m[*node as usize])).collect();
        let border = nodes.len();
        Self {
            corners: starts.map(|start| points[start]),
            edges: (0..border).map(|i| [i, (i + 1) % border]).collect(),
            frame,
            nodes,
            points,
            border,
            starts,
        }
    }

    pub fn add(&mut self, cutter: &mut Cutter, at: Point) -> usize {
        self.nodes.push(cutter.add(self.frame.lift(at)));
        self.points.push(at);
        self.nodes.len() - 1
    }

    /// Distance of a point from the facet's nearest edge (m), below zero outside.
    pub fn clearance_m(&self, at: Point) -> f64 {
        let side = |(a, b): (Point, Point)| geometry::cross(a, b, at) / geometry::distance(a, b);
        geometry::edges(&self.corners).map(side).fold(f64::INFINITY, f64::min)
    }

    /// The border's nodes from one to another along one edge of the facet, if both are on one.
    pub fn border_between(&self, [from, to]: [usize; 2]) -> Option<Vec<usize>> {
        let (low, high) = (from.min(to), from.max(to));
        let along = |side: usize| {
            let first = self.starts[side];
            let last = if side == 2 { self.border } else { self.starts[side + 1] };
            (first <= low && high <= last).then(|| (low..=high).collect::<Vec<_>>())
        };
        let closing = || {
            // The last edge ends in the first node.
            (low == 0 && high >= self.starts[2]).then(|| (high..self.border).chain([0]).collect::<Vec<_>>())
        };
        (0..3).find_map(along).filter(|nodes| nodes.iter().all(|node| *node < self.border)).or_else(closing)
    }

    /// Adds the middle of a pad, unless it is on an edge of the facet.
    pub fn add_centre(&mut self, cutter: &mut Cutter, pad: usize) {
        let at = self.frame.flat(cutter.pads[pad].centre);
        let innermost_m = cutter.pads[pad].levels_m.last().copied().unwrap_or_default();
        if self.clearance_m(at) > 0.1 * innermost_m {
            self.add(cutter, at);
        }
    }

    /// Adds nodes on rings around pads whose triangles grow with the distance, as on a plane.
    pub fn seed(&mut self, cutter: &mut Cutter) {
        for own in 0..cutter.pads.len() {
            let (centre, rings) = (cutter.pads[own].centre, cutter.pads[own].rings);
            let (foot, height_m) = (self.frame.flat(centre), self.frame.height(centre));
            let reach_m = cutter.edge_m / rings.size_at_m(0.0) * rings.radius_m;
            if -self.clearance_m(foot) > reach_m || height_m.abs() > reach_m {
                continue;
            }
            for (radius_m, turn) in rings.outer_radii_m(cutter.edge_m) {
                let radius2 = radius_m * radius_m - height_m * height_m;
                if radius2 <= 0.0 {
                    continue;
                }
                let circle = Circle { centre: foot, radius_m: radius2.sqrt(), segments: rings.segments };
                let size_m = rings.size_at_m(radius_m);
                for i in 0..circle.segments {
                    let at = circle.at(turn + TAU * i as f64 / circle.segments as f64);
                    let place = self.frame.lift(at);
                    let clear_of =
                        |other: &Pad| other.rings.size_at_m(space::distance(place, other.centre)) > 1.15 * size_m;
                    let clear = self.clearance_m(at) > CLEAR * size_m
                        && cutter.pads.iter().enumerate().all(|(i, other)| i == own || clear_of(other));
                    if clear {
                        self.add(cutter, at);
                    }
                }
            }
        }
    }

    /// Adds a lattice of equilateral triangles where no pad asks for smaller ones.
    pub fn seed_bulk(&mut self, cutter: &mut Cutter) {
        let step_m = LATTICE * cutter.edge_m;
        let row_m = step_m * 0.75f64.sqrt();
        let [low, high] = geometry::bounds(&self.corners);
        let count = |axis: usize, step_m: f64| ((high[axis] - low[axis]) / step_m).ceil() as usize;
        for row in 0..=count(1, row_m) {
            let turn = 0.5 * (row % 2) as f64;
            for column in 0..=count(0, step_m) {
                let at = [low[0] + step_m * (column as f64 + turn), low[1] + row_m * row as f64];
                let place = self.frame.lift(at);
                let clear_of = |pad: &Pad| {
                    pad.rings.size_at_m(space::distance(place, pad.centre) - CLEAR * step_m) > cutter.edge_m
                };
                if self.clearance_m(at) > CLEAR * step_m && cutter.pads.iter().all(clear_of) {
                    self.add(cutter, at);
                }
            }
        }
    }

    /// Triangulates what there is.
    pub fn fill(self, cutter: &mut Cutter) -> Result<(), String> {
        if self.nodes.len() == 3 {
            cutter.triangles.push([self.nodes[0], self.nodes[1], self.nodes[2]]);
            return Ok(());
        }
        // One after the other, for bulk loading would settle ties by chance.
        let mut delaunay = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
        let vertices = self.points.iter().map(|[x, y]| delaunay.insert(Point2::new(*x, *y)));
        let vertices = vertices.collect::<Result<Vec<_>, _>>();
        let vertices = vertices.map_err(|error| format!("the surface cannot be triangulated: {error}"))?;
        for [from, to] in self.edges.iter().map(|edge| edge.map(|index| vertices[index])) {
            // Rings of two pads never cross; should rounding make them, the flood through the gap is found.
            if from != to && delaunay.can_add_constraint(from, to) {
                delaunay.add_constraint(from, to);
            }
        }
        for face in delaunay.inner_faces() {
            let corners = face.vertices().map(|vertex| vertex.fix().index());
            let [a, b, c] = corners.map(|index| self.points[index]);
            // Nodes of an edge are on a line but for rounding, which can leave slivers outside of it.
            let longest_m = geometry::distance(a, b).max(geometry::distance(b, c)).max(geometry::distance(c, a));
            if geometry::cross(a, b, c) > 1e-9 * longest_m * longest_m {
                cutter.triangles.push(corners.map(|index| self.nodes[index]));
            }
        }
        Ok(())
    }
}
