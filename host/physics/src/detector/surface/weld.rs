//! One node where several corners lie.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::read::Raw;
use crate::space::{self, Place};

/// Most triangles of a surface.
const MAX_TRIANGLES: usize = 200_000;
/// Largest coordinate (m).
const FARTHEST_M: f64 = 10.0;
/// Corners nearer than this share of the surface's size are one: an STL names each corner once for each triangle.
const WELD_SHARE: f64 = 1e-6;
/// Least area of a triangle, as a share of its longest edge squared.
const LEAST_AREA: f64 = 1e-6;

/// Nodes (m) and triangles of a file.
pub(super) fn weld(raw: &Raw, unit_m: f64) -> Result<(Vec<Place>, Vec<[u32; 3]>), String> {
    if !(1..=MAX_TRIANGLES).contains(&raw.triangles.len()) {
        return Err(format!("has {} triangles, but has to have 1 to {MAX_TRIANGLES}", raw.triangles.len()));
    }
    let used = || raw.triangles.iter().flatten().map(|corner| raw.places[*corner].map(|at| at * unit_m));
    if let Some(at) = used().find(|at| at.iter().any(|at_m| at_m.is_nan() || at_m.abs() > FARTHEST_M)) {
        return Err(format!(
            "has a corner at {at:?} m, but has to lie within {FARTHEST_M} m of its origin: see the unit"
        ));
    }
    let mut welder = Welder::new(WELD_SHARE * size_m(used()));
    let mut numbers = used().map(|at| welder.number(at));
    let triangles = std::iter::from_fn(|| Some([numbers.next()?, numbers.next()?, numbers.next()?]));
    let triangles: Vec<_> = triangles.collect();
    drop(numbers);
    let nodes_m = welder.nodes_m;
    match triangles.iter().position(|triangle| is_degenerate(triangle.map(|node| nodes_m[node as usize]))) {
        Some(index) => {
            let at = nodes_m[triangles[index][0] as usize];
            Err(format!("triangle {index} at {} mm has no area: repair the mesh", millimetres(at)))
        }
        None => Ok((nodes_m, triangles)),
    }
}

/// Diagonal of the bounding box.
fn size_m(places: impl Iterator<Item = Place>) -> f64 {
    let bounds = places.fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[low, high], at| {
        [[0, 1, 2].map(|axis| low[axis].min(at[axis])), [0, 1, 2].map(|axis| high[axis].max(at[axis]))]
    });
    space::distance(bounds[0], bounds[1])
}

fn is_degenerate(corners: [Place; 3]) -> bool {
    let [a, b, c] = corners;
    let longest_m = space::distance(a, b).max(space::distance(b, c)).max(space::distance(c, a));
    let area_m2 = space::length(space::normal(corners)) / 2.0;
    area_m2 <= LEAST_AREA * longest_m * longest_m
}

/// Millimetres, for messages.
pub(super) fn millimetres(at: Place) -> String {
    format!("({:.3}, {:.3}, {:.3})", at[0] * 1e3, at[1] * 1e3, at[2] * 1e3)
}

/// Numbers places, equal ones alike, by cells of the size within which places are equal.
struct Welder {
    apart_m: f64,
    cells: HashMap<[i64; 3], u32>,
    nodes_m: Vec<Place>,
}

impl Welder {
    fn new(apart_m: f64) -> Self {
        Self { apart_m: apart_m.max(f64::MIN_POSITIVE), cells: HashMap::new(), nodes_m: Vec::new() }
    }

    fn number(&mut self, at: Place) -> u32 {
        // The nearest of an equal place's cells may be the next one.
        let cell = at.map(|at_m| (at_m / self.apart_m).round() as i64);
        let around = (0..27).map(|i| [cell[0] + i % 3 - 1, cell[1] + i / 3 % 3 - 1, cell[2] + i / 9 - 1]);
        let is_here = |node: &u32| space::distance(self.nodes_m[*node as usize], at) < self.apart_m;
        if let Some(node) = around.filter_map(|cell| self.cells.get(&cell).copied()).find(is_here) {
            return node;
        }
        let node = self.nodes_m.len() as u32;
        self.nodes_m.push(at);
        if let Entry::Vacant(vacant) = self.cells.entry(cell) {
            vacant.insert(node);
        }
        node
    }
}
