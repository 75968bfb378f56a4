//! Triangles on an outline, with the electrodes' pads in it.
//!
//! Outside the pads a constrained Delaunay triangulation is refined until its angles and areas are good. It starts with rings
//! around the pads whose triangles grow with the distance from the pad's centre: where the field is a logarithm of that
//! distance, this gives the smallest error for a number of nodes. Inside, a pad has
//! concentric rings of its own: current enters a pad within the depth `sqrt(sigma t z_e)` from its edge (about 0.1 mm where
//! a pad has a radius of 2 mm), and rings at that depth resolve it with a few nodes where triangles of one size would need
//! hundreds.

use std::collections::HashSet;

use spade::{AngleLimit, ConstrainedDelaunayTriangulation, Point2, RefinementParameters, Triangulation};

use super::facets;
use super::mesh::Mesh;
use super::rings::{PadRings, segments};
use crate::detector::{Detector, Electrode, Outline};
use crate::forward::ForwardError;
use crate::geometry::{self, Point};

/// Smallest angle that the refinement aims at (degrees).
const ANGLE_DEG: f64 = 27.0;

impl Mesh {
    /// Triangulates a detector with about `target_nodes` nodes.
    ///
    /// The same detector gives the same mesh.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if an electrode does not lie on the outline, or overlaps with another.
    pub fn new(detector: &Detector, target_nodes: usize) -> Result<Self, ForwardError> {
        if detector.surface.is_none() {
            check(detector)?;
        }
        let mut edge_m = first_edge_m(detector, target_nodes);
        let mut mesh = Self::with_edge(detector, edge_m)?;
        // The first guess is for squares with a grid of pads; an odd outline may need another try.
        for _ in 0..3 {
            let excess = mesh.nodes_m.len() as f64 / target_nodes as f64;
            if (0.87..1.15).contains(&excess) {
                break;
            }
            edge_m *= excess.sqrt();
            mesh = Self::with_edge(detector, edge_m)?;
        }
        Ok(mesh)
    }

    /// Triangulates a detector with edges of about `edge_m` away from the pads.
    fn with_edge(detector: &Detector, edge_m: f64) -> Result<Self, ForwardError> {
        let sheet_s = detector.sheet_conductance_s();
        let edge_depth_m = |pad| (sheet_s * detector.pad_impedance_ohm_m2(pad)).sqrt();
        let pads: Vec<_> =
            detector.electrodes.iter().map(|pad| PadRings::new(pad, edge_depth_m(pad), edge_m)).collect();
        let error = |what| ForwardError::Detector { detector: detector.name.clone(), what };
        if let Some(surface) = &detector.surface {
            return facets::mesh(surface, &detector.electrodes, &pads, edge_m).map_err(error);
        }
        let (nodes_m, triangles) = triangulate(&detector.outline, &pads, edge_m).map_err(error)?;
        let mut mesh = Self { nodes_m, places_m: Vec::new(), triangles, pad_triangles: Vec::with_capacity(pads.len()) };
        let mut first = 0;
        for pad in &pads {
            mesh.fill_pad(pad, first);
            first += pad.segments as u32;
        }
        mesh.drop_unused_nodes();
        Ok(mesh)
    }

    /// Adds the inside of a pad whose edge starts at node `first`.
    fn fill_pad(&mut self, pad: &PadRings, first: u32) {
        let start = self.triangles.len();
        let segments = pad.segments as u32;
        let mut outer = first;
        let (&last_m, rings_m) = pad.inner_radii_m.split_last().unwrap_or((&pad.radius_m, &[]));
        for &radius_m in rings_m {
            let inner = self.add_ring(pad, radius_m, 1);
            for i in 0..segments {
                let next = (i + 1) % segments;
                self.triangles.push([outer + i, outer + next, inner + i]);
                self.triangles.push([inner + i, outer + next, inner + next]);
            }
            outer = inner;
        }
        // Almost nothing happens within the last ring: it has half the nodes.
        let inner = self.add_ring(pad, last_m, 2);
        for i in 0..segments / 2 {
            let (next, odd, even) = ((i + 1) % (segments / 2), outer + 2 * i + 1, outer + (2 * i + 2) % segments);
            self.triangles.push([outer + 2 * i, odd, inner + i]);
            self.triangles.push([inner + i, odd, inner + next]);
            self.triangles.push([odd, even, inner + next]);
        }
        let centre = self.nodes_m.len() as u32;
        self.nodes_m.push(pad.centre);
        let half = segments / 2;
        self.triangles.extend((0..half).map(|i| [inner + i, inner + (i + 1) % half, centre]));
        self.pad_triangles.push(start..self.triangles.len());
    }

    /// Adds every `step`th node of a ring and gives the number of the first.
    fn add_ring(&mut self, pad: &PadRings, radius_m: f64, step: usize) -> u32 {
        let first = self.nodes_m.len() as u32;
        self.nodes_m.extend(geometry::disc(pad.centre, radius_m, pad.segments).into_iter().step_by(step));
        first
    }

    /// Drops nodes without a triangle, which lie beyond an outline that is not convex.
    fn drop_unused_nodes(&mut self) {
        let mut number = vec![u32::MAX; self.nodes_m.len()];
        for &node in self.triangles.iter().flatten() {
            number[node as usize] = 0;
        }
        for (used, slot) in (0..).zip(number.iter_mut().filter(|slot| **slot == 0)) {
            *slot = used;
        }
        let mut old = 0;
        self.nodes_m.retain(|_| {
            old += 1;
            number[old - 1] != u32::MAX
        });
        for node in self.triangles.iter_mut().flatten() {
            *node = number[*node as usize];
        }
    }
}

/// Edge length that gives about `target_nodes` nodes (m), by bisection of a count from areas.
fn first_edge_m(detector: &Detector, target_nodes: usize) -> f64 {
    let outline_m2 = match &detector.surface {
        Some(surface) => surface.area_m2(),
        None => {
            std::iter::once(&detector.outline.outer).chain(&detector.outline.holes).map(|p| geometry::area(p)).sum()
        }
    };
    let count = |edge_m: f64| {
        let mut nodes = outline_m2 / (0.62 * edge_m * edge_m);
        for electrode in &detector.electrodes {
            let segments = segments(electrode.radius_m, edge_m) as f64;
            nodes += segments * ((segments / 8.0).floor().max(2.0) + 0.5);
        }
        nodes
    };
    let (mut low, mut high) = (1e-4 * outline_m2.sqrt(), outline_m2.sqrt());
    for _ in 0..60 {
        let middle = (low * high).sqrt();
        if count(middle) > target_nodes as f64 { low = middle } else { high = middle }
    }
    high
}

type Triangles = (Vec<Point>, Vec<[u32; 3]>);

/// Triangulates the outline outside the pads; the pads' edges come first, in order.
fn triangulate(outline: &Outline, pads: &[PadRings], edge_m: f64) -> Result<Triangles, String> {
    let mut input = Constraints::default();
    for pad in pads {
        input.add(pad.edge());
    }
    for polygon in std::iter::once(&outline.outer).chain(&outline.holes) {
        input.add(subdivide(polygon, &|at| size_m(pads, edge_m, at)));
    }
    seed(&mut input, outline, pads, edge_m);
    let mut crossing = 0;
    let mut delaunay =
        ConstrainedDelaunayTriangulation::<Point2<f64>>::try_bulk_load_cdt(input.points, input.edges, |_| {
            crossing += 1
        })
        .map_err(|error| format!("cannot be triangulated: {error}"))?;
    if crossing > 0 {
        return Err("the outline, its holes and the electrodes must not cross each other".to_owned());
    }
    let refined = delaunay.refine(
        RefinementParameters::new()
            .exclude_outer_faces(true)
            .keep_constraint_edges()
            .with_angle_limit(AngleLimit::from_deg(ANGLE_DEG))
            .with_max_allowed_area(0.5 * edge_m * edge_m)
            .with_max_additional_vertices(10_000_000),
    );
    let outside: HashSet<_> = refined.excluded_faces.into_iter().collect();
    let triangles = delaunay
        .inner_faces()
        .filter(|face| !outside.contains(&face.fix()))
        .map(|face| face.vertices().map(|vertex| vertex.fix().index() as u32))
        .collect();
    Ok((delaunay.vertices().map(|vertex| vertex.position().into()).collect(), triangles))
}

/// Size of triangles at a place (m).
fn size_m(pads: &[PadRings], edge_m: f64, at: Point) -> f64 {
    pads.iter().map(|pad| pad.size_m(at)).fold(edge_m, f64::min)
}

/// Adds the points of the pads' outer rings, save those that come too near to an edge or to the next pad's rings.
fn seed(input: &mut Constraints, outline: &Outline, pads: &[PadRings], edge_m: f64) {
    let edges: Vec<_> =
        std::iter::once(&outline.outer).chain(&outline.holes).flat_map(|polygon| geometry::edges(polygon)).collect();
    for (own, pad) in pads.iter().enumerate() {
        for at in pad.outer_rings(edge_m) {
            let size_m = pad.size_m(at);
            let clear_of = |other: &PadRings| other.size_m(at) > size_m * 1.15;
            let clear = pads.iter().enumerate().all(|(i, other)| i == own || clear_of(other))
                && geometry::is_inside(at, &outline.outer)
                && !outline.holes.iter().any(|hole| geometry::is_inside(at, hole))
                && edges.iter().all(|&edge| geometry::segment_distance(at, edge) > 0.6 * size_m);
            if clear {
                input.points.push(Point2::new(at[0], at[1]));
            }
        }
    }
}

/// Points and edges that a triangulation has to keep.
#[derive(Default)]
struct Constraints {
    points: Vec<Point2<f64>>,
    edges: Vec<[usize; 2]>,
}

impl Constraints {
    fn add(&mut self, polygon: Vec<Point>) {
        let (first, count) = (self.points.len(), polygon.len());
        self.edges.extend((0..count).map(|i| [first + i, first + (i + 1) % count]));
        self.points.extend(polygon.into_iter().map(|[x, y]| Point2::new(x, y)));
    }
}

/// Halves the edges of a polygon until none is longer than `size_m` at its middle.
fn subdivide(polygon: &[Point], size_m: &dyn Fn(Point) -> f64) -> Vec<Point> {
    fn halve(a: Point, b: Point, size_m: &dyn Fn(Point) -> f64, points: &mut Vec<Point>) {
        let middle = [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0];
        if geometry::distance(a, b) > size_m(middle) {
            halve(a, middle, size_m, points);
            halve(middle, b, size_m, points);
        } else {
            points.push(a);
        }
    }
    let mut points = Vec::new();
    for (a, b) in geometry::edges(polygon) {
        halve(a, b, size_m, &mut points);
    }
    points
}

/// Checks that every electrode lies on the outline, clear of edges and of other electrodes.
fn check(detector: &Detector) -> Result<(), ForwardError> {
    let error = |what: String| Err(ForwardError::Detector { detector: detector.name.clone(), what });
    let outline = &detector.outline;
    let polygons = || std::iter::once(&outline.outer).chain(&outline.holes);
    if polygons().any(|polygon| polygon.len() < 3) {
        return error("the outline and each hole need three corners or more".to_owned());
    }
    for (i, electrode) in detector.electrodes.iter().enumerate() {
        let centre = [electrode.x_m, electrode.y_m];
        let on_layer = geometry::is_inside(centre, &outline.outer)
            && !outline.holes.iter().any(|hole| geometry::is_inside(centre, hole));
        let clear_m = polygons()
            .flat_map(|polygon| geometry::edges(polygon))
            .map(|edge| geometry::segment_distance(centre, edge))
            .fold(f64::INFINITY, f64::min);
        if !on_layer || clear_m < 1.05 * electrode.radius_m {
            return error(format!("electrode {i} has to lie on the layer with its whole pad, clear of edges"));
        }
        let overlaps = |other: &Electrode| {
            geometry::distance(centre, [other.x_m, other.y_m]) < 1.05 * (electrode.radius_m + other.radius_m)
        };
        if let Some(other) = detector.electrodes[..i].iter().position(overlaps) {
            return error(format!("electrodes {other} and {i} overlap or touch"));
        }
    }
    Ok(())
}
