//! Triangles on an outline, with the electrodes' pads in it.
//!
//! Outside the pads a constrained Delaunay triangulation is refined until its angles and areas are good. It starts with rings
//! around the pads whose triangles grow with the distance from the pad's centre: where the field is a logarithm of that
//! distance, this gives the smallest error for a number of nodes. Inside, a pad has
//! concentric rings of its own: current enters a pad within the depth `sqrt(sigma t z_e)` from its edge (about 0.1 mm where
//! a pad has a radius of 2 mm), and rings at that depth resolve it with a few nodes where triangles of one size would need
//! hundreds.

use std::collections::HashSet;
use std::f64::consts::TAU;

use spade::{AngleLimit, ConstrainedDelaunayTriangulation, Point2, RefinementParameters, Triangulation};

use super::contact::Footing;
use super::facets;
use super::locate::Locator;
use crate::detector::{Detector, Electrode, Outline};
use crate::forward::ForwardError;
use crate::geometry::{self, Point};
use crate::space::{self, Frame, Place};

/// Smallest angle that the refinement aims at (degrees).
const ANGLE_DEG: f64 = 27.0;
/// Bulk edge length over the length of a segment of a pad's edge.
const PAD_REFINEMENT: f64 = 2.6;
/// Fewest segments of a pad's edge.
const FEWEST_SEGMENTS: usize = 12;

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

    /// The centre of a contact moved up or down onto a curved surface, not along it, and the surface's normal there; on a plane
    /// the centre and no normal. `None` farther than `reach_m` from the surface.
    pub(super) fn footing(&self, locator: &Locator, centre: Place, reach_m: f64) -> Option<Footing> {
        if self.places_m.is_empty() {
            return Some((centre, [0.0; 3]));
        }
        let near = locator.near(centre, reach_m);
        let corners = near.into_iter().map(|triangle| self.triangles[triangle as usize].map(|node| self.place_m(node)));
        let away_m = |corners: [Place; 3]| space::distance(space::nearest_on_triangle(centre, corners), centre);
        let (away_m, corners) = corners.map(|corners| (away_m(corners), corners)).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let normal = space::normal(corners);
        let height = space::dot(space::sub(centre, corners[0]), normal) / space::dot(normal, normal);
        (away_m <= reach_m).then(|| (space::along(centre, -height, normal), normal))
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

/// A pad's edge and the rings within.
pub(super) struct PadRings {
    centre: Point,
    pub radius_m: f64,
    pub segments: usize,
    pub inner_radii_m: Vec<f64>,
}

impl PadRings {
    fn new(electrode: &Electrode, edge_depth_m: f64, edge_m: f64) -> Self {
        let radius_m = electrode.radius_m;
        let segments = segments(radius_m, edge_m);
        // Depths where the potential, which falls as exp(-depth / edge_depth_m), is met with equal errors by linear elements.
        let rings = (segments / 8).max(2);
        let scale_m = (2.2 * edge_depth_m).max(0.01 * radius_m).min(0.75 * radius_m / ((rings + 1) as f64).ln());
        let depth_m = |ring: usize| -scale_m * (-(ring as f64) / (rings + 1) as f64).ln_1p();
        let inner_radii_m = (1..=rings).map(|ring| radius_m - depth_m(ring)).collect();
        Self { centre: [electrode.x_m, electrode.y_m], radius_m, segments, inner_radii_m }
    }

    fn edge(&self) -> Vec<Point> {
        geometry::disc(self.centre, self.radius_m, self.segments)
    }

    /// Size of triangles at a place (m): like the segments of the pad's edge, and growing as the distance from its centre.
    fn size_m(&self, at: Point) -> f64 {
        self.size_at_m(geometry::distance(at, self.centre))
    }

    /// The same for a distance from its centre (m).
    pub fn size_at_m(&self, distance_m: f64) -> f64 {
        TAU / self.segments as f64 * distance_m.max(self.radius_m)
    }

    /// Rings around the pad, out to where triangles have the size `edge_m`.
    fn outer_rings(&self, edge_m: f64) -> impl Iterator<Item = Point> + '_ {
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
fn segments(radius_m: f64, edge_m: f64) -> usize {
    let wanted = PAD_REFINEMENT * TAU * radius_m / edge_m;
    (2.0 * (wanted / 2.0).round()).max(FEWEST_SEGMENTS as f64) as usize
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
