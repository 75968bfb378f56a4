//! Triangles on a curved surface, with the electrodes' pads in it.
//!
//! The surface is taken as what its file says: flat facets. So its area is kept, and each facet is triangulated in its own
//! plane, with the rules of [`super::mesh`]: a pad's edge, and the rings within that resolve how current enters it, are where
//! spheres about the pad's centre cut the facet; outside, triangles grow with the distance from the pad. Edges of facets are
//! divided once for both their facets, so everything fits together. A file finer than the mesh that is asked for is kept as fine.

mod plane;

use std::collections::{HashMap, HashSet};
use std::f64::consts::{PI, TAU};

use self::plane::{Circle, Plane};
use super::mesh::Mesh;
use super::rings::PadRings;
use crate::detector::{Electrode, Surface, edges_of};
use crate::space::{self, Place};

/// Crossings nearer to a corner than this share of its shortest edge are in the corner.
const SNAP_SHARE: f64 = 0.02;
/// The same for the gap to the next ring.
const SNAP_RING: f64 = 0.1;

/// Spacing of nodes where no pad is near, as a share of the bulk edge: as many as the refinement of flat meshes gives.
const LATTICE: f64 = 0.85;
/// Free space about a node, as a share of the size there.
const CLEAR: f64 = 0.6;

/// Which ring: pad, and level from the pad's edge inwards.
type Ring = (usize, usize);

/// Triangulates a surface with edges of about `edge_m` away from the pads.
pub(super) fn mesh(
    surface: &Surface,
    electrodes: &[Electrode],
    rings: &[PadRings],
    edge_m: f64,
) -> Result<Mesh, String> {
    let neighbours = surface.neighbours();
    let pads = electrodes.iter().zip(rings).map(|(electrode, rings)| Pad::new(surface, &neighbours, electrode, rings));
    let mut cutter = Cutter::new(surface, pads.collect(), edge_m);
    cutter.divide_edges();
    for facet in 0..surface.triangles.len() {
        cutter.triangulate(facet)?;
    }
    cutter.finish()
}

/// A pad on a surface.
struct Pad<'a> {
    centre: Place,
    rings: &'a PadRings,
    /// Radii of its edge and of the rings within, as spheres that cut off polygons with a disc's area.
    levels_m: Vec<f64>,
    /// The facets that hang together within reach: not those of another side that is as near.
    facets: HashSet<usize>,
    foot: usize,
}

impl<'a> Pad<'a> {
    fn new(surface: &Surface, neighbours: &[[Option<usize>; 3]], electrode: &Electrode, rings: &'a PadRings) -> Self {
        let step = TAU / rings.segments as f64;
        let to_corner = (step / step.sin()).sqrt();
        let levels_m: Vec<_> =
            std::iter::once(&rings.radius_m).chain(&rings.inner_radii_m).map(|radius_m| to_corner * radius_m).collect();
        let centre = electrode.place_m();
        let foot = surface.nearest(centre).triangle;
        let is_near = |facet: usize| {
            let nearest = space::nearest_on_triangle(centre, surface.corners(facet));
            space::distance(nearest, centre) < 1.1 * levels_m[0]
        };
        let (mut facets, mut waiting) = (HashSet::from([foot]), vec![foot]);
        while let Some(facet) = waiting.pop() {
            let beyond = neighbours[facet].iter().flatten().copied().filter(|next| is_near(*next));
            waiting.extend(beyond.filter(|next| facets.insert(*next)));
        }
        Self { centre, rings, levels_m, facets, foot }
    }

    /// How near to a ring a corner counts as on it.
    fn snap_m(&self) -> f64 {
        let gaps = self.levels_m.windows(2).map(|pair| pair[0] - pair[1]);
        SNAP_RING * gaps.fold(self.levels_m[0], f64::min)
    }
}

struct Cutter<'a> {
    surface: &'a Surface,
    pads: Vec<Pad<'a>>,
    edge_m: f64,
    places_m: Vec<Place>,
    triangles: Vec<[u32; 3]>,
    /// Nodes within each edge of the surface, from its lower to its higher end.
    within_edges: HashMap<(u32, u32), Vec<u32>>,
    /// Rings that go through nodes of the surface's edges.
    rings_at: HashMap<u32, Vec<Ring>>,
    /// Edges that bound pads, both ways round.
    pad_edges: HashSet<(u32, u32)>,
}

impl<'a> Cutter<'a> {
    fn new(surface: &'a Surface, pads: Vec<Pad<'a>>, edge_m: f64) -> Self {
        Self {
            surface,
            pads,
            edge_m,
            places_m: surface.nodes_m.clone(),
            triangles: Vec::new(),
            within_edges: HashMap::new(),
            rings_at: HashMap::new(),
            pad_edges: HashSet::new(),
        }
    }

    /// Size of triangles at a place (m).
    fn size_m(&self, at: Place) -> f64 {
        let sizes = self.pads.iter().map(|pad| pad.rings.size_at_m(space::distance(at, pad.centre)));
        sizes.fold(self.edge_m, f64::min)
    }

    fn add(&mut self, at: Place) -> u32 {
        self.places_m.push(at);
        (self.places_m.len() - 1) as u32
    }

    /// Divides every edge of the surface where rings cross it, and between into pieces of the size asked for there.
    fn divide_edges(&mut self) {
        self.find_corners_on_rings();
        let mut rings_of: HashMap<(u32, u32), Vec<usize>> = HashMap::new();
        for (index, pad) in self.pads.iter().enumerate() {
            for (a, b) in pad.facets.iter().flat_map(|facet| edges_of(self.surface.triangles[*facet])) {
                let pads = rings_of.entry((a.min(b), a.max(b))).or_default();
                if !pads.contains(&index) {
                    pads.push(index);
                }
            }
        }
        let surface = self.surface;
        for (a, b) in surface.triangles.iter().flat_map(|triangle| edges_of(*triangle)) {
            let edge = (a.min(b), a.max(b));
            if !self.within_edges.contains_key(&edge) {
                let crossings = self.crossings(edge, rings_of.get(&edge).map_or(&[], Vec::as_slice));
                let nodes = self.divide(edge, crossings);
                self.within_edges.insert(edge, nodes);
            }
        }
    }

    /// Finds the corners of the surface that are on a ring.
    fn find_corners_on_rings(&mut self) {
        let mut shortest_m = vec![f64::INFINITY; self.surface.nodes_m.len()];
        for (a, b) in self.surface.triangles.iter().flat_map(|triangle| edges_of(*triangle)) {
            let length_m = space::distance(self.places_m[a as usize], self.places_m[b as usize]);
            for end in [a, b] {
                shortest_m[end as usize] = shortest_m[end as usize].min(length_m);
            }
        }
        for (index, pad) in self.pads.iter().enumerate() {
            let corners: HashSet<_> = pad.facets.iter().flat_map(|facet| self.surface.triangles[*facet]).collect();
            for corner in corners {
                let distance_m = space::distance(self.places_m[corner as usize], pad.centre);
                let snap_m = pad.snap_m().min(SNAP_SHARE * shortest_m[corner as usize]);
                let level = pad.levels_m.iter().position(|level_m| (level_m - distance_m).abs() < snap_m);
                if let Some(level) = level {
                    self.rings_at.entry(corner).or_default().push((index, level));
                }
            }
        }
    }

    /// Where along an edge (0 to 1, in order) rings of some pads cross it, away from ends that are on the ring.
    fn crossings(&self, (a, b): (u32, u32), pads: &[usize]) -> Vec<(f64, Ring)> {
        let (from, edge) =
            (self.places_m[a as usize], space::sub(self.places_m[b as usize], self.places_m[a as usize]));
        let length_m = space::length(edge);
        let mut crossings = Vec::new();
        for &pad in pads {
            let Pad { centre, levels_m, .. } = &self.pads[pad];
            let snap = self.pads[pad].snap_m().min(SNAP_SHARE * length_m) / length_m;
            let middle = space::dot(space::sub(*centre, from), edge) / (length_m * length_m);
            let aside_m = space::distance(space::along(from, middle, edge), *centre);
            for (level, level_m) in levels_m.iter().enumerate() {
                let half2 = (level_m * level_m - aside_m * aside_m) / (length_m * length_m);
                if half2 <= 0.0 {
                    continue;
                }
                for share in [middle - half2.sqrt(), middle + half2.sqrt()] {
                    let at_end = |end: u32, away: f64| away < snap && self.is_on(end, (pad, level));
                    if share > 1e-9 && share < 1.0 - 1e-9 && !at_end(a, share) && !at_end(b, 1.0 - share) {
                        crossings.push((share, (pad, level)));
                    }
                }
            }
        }
        crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
        crossings
    }

    fn is_on(&self, node: u32, ring: Ring) -> bool {
        self.rings_at.get(&node).is_some_and(|rings| rings.contains(&ring))
    }

    /// Nodes within an edge: its crossings, and what is needed between.
    fn divide(&mut self, (a, b): (u32, u32), crossings: Vec<(f64, Ring)>) -> Vec<u32> {
        let [from, to] = [a, b].map(|end| self.places_m[end as usize]);
        let edge = space::sub(to, from);
        let (mut nodes, mut last) = (Vec::new(), 0.0);
        for (share, ring) in crossings {
            match nodes.last() {
                // Two crossings in one place share its node.
                Some(&node) if share - last < 1e-9 => self.rings_at.entry(node).or_default().push(ring),
                _ => {
                    self.halve(from, edge, [last, share], &mut nodes);
                    let node = self.add(space::along(from, share, edge));
                    self.rings_at.entry(node).or_default().push(ring);
                    nodes.push(node);
                    last = share;
                }
            }
        }
        self.halve(from, edge, [last, 1.0], &mut nodes);
        nodes
    }

    /// Halves a piece of an edge until it is no longer than the size asked for in its middle.
    fn halve(&mut self, from: Place, edge: Place, [low, high]: [f64; 2], nodes: &mut Vec<u32>) {
        let middle = (low + high) / 2.0;
        let at = space::along(from, middle, edge);
        if (high - low) * space::length(edge) > self.size_m(at) {
            self.halve(from, edge, [low, middle], nodes);
            let node = self.add(at);
            nodes.push(node);
            self.halve(from, edge, [middle, high], nodes);
        }
    }

    /// Triangulates a facet within its edges.
    fn triangulate(&mut self, facet: usize) -> Result<(), String> {
        let mut plane = Plane::new(self, facet);
        let pads: Vec<_> = (0..self.pads.len()).filter(|pad| self.pads[*pad].facets.contains(&facet)).collect();
        for &pad in &pads {
            self.add_rings(&mut plane, pad);
            if self.pads[pad].foot == facet {
                plane.add_centre(self, pad);
            }
        }
        plane.seed(self);
        plane.seed_bulk(self);
        plane.fill(self)
    }

    /// Adds the arcs in which a pad's rings cross a facet.
    fn add_rings(&mut self, plane: &mut Plane, pad: usize) {
        let (centre, segments) = (self.pads[pad].centre, self.pads[pad].rings.segments);
        let (foot, height_m) = (plane.frame.flat(centre), plane.frame.height(centre));
        for level in 0..self.pads[pad].levels_m.len() {
            let level_m = self.pads[pad].levels_m[level];
            let radius2 = level_m * level_m - height_m * height_m;
            if radius2 > 0.0 {
                let circle = Circle { centre: foot, radius_m: radius2.sqrt(), segments };
                self.add_ring(plane, (pad, level), &circle);
            }
        }
    }

    fn add_ring(&mut self, plane: &mut Plane, ring: Ring, circle: &Circle) {
        let mut crossings: Vec<_> = (0..plane.border)
            .filter(|&index| self.is_on(plane.nodes[index], ring))
            .map(|index| (circle.angle(plane.points[index]), index))
            .collect();
        crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
        if crossings.is_empty() {
            if plane.clearance_m(circle.at(0.0)) > 0.0 {
                let nodes: Vec<_> =
                    (0..circle.segments).map(|i| circle.at(TAU * i as f64 / circle.segments as f64)).collect();
                let indices: Vec<_> = nodes.into_iter().map(|at| plane.add(self, at)).collect();
                (0..indices.len()).for_each(|i| self.keep(plane, indices[i], indices[(i + 1) % indices.len()], ring));
            }
            return;
        }
        for i in 0..crossings.len() {
            let (from, start) = crossings[i];
            let (to, end) = crossings[(i + 1) % crossings.len()];
            let turn = if i + 1 == crossings.len() { to + TAU - from } else { to - from };
            self.add_arc(plane, ring, circle, (from, turn), [start, end]);
        }
    }

    /// Adds the arc between two neighbouring crossings, if it is that within the facet.
    fn add_arc(&mut self, plane: &mut Plane, ring: Ring, circle: &Circle, (from, turn): (f64, f64), ends: [usize; 2]) {
        let pieces = (turn * circle.segments as f64 / TAU).ceil().max(1.0);
        let inward_m = plane.clearance_m(circle.at(from + turn / 2.0));
        let piece_m = circle.radius_m * turn / pieces;
        let border = plane.border_between(ends);
        if inward_m < -1e-9 * circle.radius_m {
            return;
        }
        // An arc that hardly leaves an edge goes along it.
        if let Some(border) = border.filter(|_| inward_m < 0.1 * piece_m) {
            border.windows(2).for_each(|pair| self.keep(plane, pair[0], pair[1], ring));
            return;
        }
        let mut last = ends[0];
        for piece in 1..pieces as usize {
            let index = plane.add(self, circle.at(from + turn * piece as f64 / pieces));
            self.keep(plane, last, index, ring);
            last = index;
        }
        self.keep(plane, last, ends[1], ring);
    }

    /// Makes a piece of a ring an edge of the triangulation.
    fn keep(&mut self, plane: &mut Plane, from: usize, to: usize, (_, level): Ring) {
        plane.edges.push([from, to]);
        if level == 0 {
            let (a, b) = (plane.nodes[from], plane.nodes[to]);
            self.pad_edges.extend([(a, b), (b, a)]);
        }
    }

    /// The mesh: what belongs to each pad comes last.
    fn finish(self) -> Result<Mesh, String> {
        let owner: HashMap<_, _> = (self.triangles.iter().enumerate())
            .flat_map(|(index, triangle)| edges_of(*triangle).map(|edge| (edge, index)))
            .collect();
        let mut pad_of = vec![usize::MAX; self.triangles.len()];
        for pad in 0..self.pads.len() {
            self.flood(pad, &owner, &mut pad_of)?;
        }
        let mut order: Vec<_> = (0..pad_of.len()).filter(|index| pad_of[*index] == usize::MAX).collect();
        let mut pad_triangles = Vec::new();
        for pad in 0..self.pads.len() {
            let start = order.len();
            order.extend((0..pad_of.len()).filter(|index| pad_of[*index] == pad));
            pad_triangles.push(start..order.len());
        }
        Ok(Mesh {
            nodes_m: self.places_m.iter().map(|at| self.surface.map_m(*at)).collect(),
            triangles: order.into_iter().map(|index| self.triangles[index]).collect(),
            places_m: self.places_m,
            pad_triangles,
        })
    }

    /// Marks the triangles within a pad's edge.
    fn flood(&self, pad: usize, owner: &HashMap<(u32, u32), usize>, pad_of: &mut [usize]) -> Result<(), String> {
        let Pad { centre, rings, .. } = &self.pads[pad];
        let corners = |index: usize| self.triangles[index].map(|node| self.places_m[node as usize]);
        let away_m = |index: &usize| space::distance(space::nearest_on_triangle(*centre, corners(*index)), *centre);
        let start = (0..self.triangles.len()).min_by(|a, b| away_m(a).total_cmp(&away_m(b)));
        let (mut waiting, mut area_m2) = (Vec::from_iter(start), 0.0);
        while let Some(index) = waiting.pop() {
            if pad_of[index] == usize::MAX {
                pad_of[index] = pad;
                area_m2 += space::length(space::normal(corners(index))) / 2.0;
                let free = edges_of(self.triangles[index]).into_iter().filter(|edge| !self.pad_edges.contains(edge));
                waiting.extend(free.filter_map(|(a, b)| owner.get(&(b, a))));
            }
        }
        let share = area_m2 / (PI * rings.radius_m * rings.radius_m);
        if (0.6..1.7).contains(&share) {
            return Ok(());
        }
        Err(format!(
            "electrode {pad} would have {:.0} % of its pad's area on the surface: it lies on an edge or fold too sharp for it",
            100.0 * share
        ))
    }
}
