//! Detectors that are not flat: a surface of triangles in space, and the flat map that it is drawn on.

mod map;
mod read;
#[cfg(test)]
pub mod shapes;
#[cfg(test)]
mod tests;
mod topology;
mod weld;

use std::fmt::Write as _;
use std::io;
use std::path::Path;

use tactomo_table::file::{self, Format};

use self::map::Map;
pub use self::read::FormatError;
pub use self::topology::edges_of;
use super::Outline;
use crate::space::{self, Place};

/// A surface's file.
const FORMAT: Format = Format::new("a detector's surface", 64 << 20);
/// Units that a file may be in, and their lengths (m).
const UNITS: [(&str, f64); 4] = [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("in", 0.0254)];

/// Triangles of a detector's surface, each counter-clockwise seen from the side that is touched.
///
/// Every edge has one or two triangles and all hang together. Coordinates as of the detector: x and y from the middle of the
/// bounding box, z as in the file; metres.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Surface {
    /// The file, as the detector names it.
    pub file: String,
    /// The file's unit of length.
    pub unit: String,
    /// How far it was moved in x and y (m) to have its middle at the origin.
    pub moved_m: [f64; 2],
    /// Corners (m).
    pub nodes_m: Vec<Place>,
    /// Corners of each triangle.
    pub triangles: Vec<[u32; 3]>,
    map: Map,
}

/// Why a file is no surface.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] io::Error),
    /// A unit that is none.
    #[error("a unit of {0:?}, but it has to be one of mm, cm, m, in")]
    Unit(String),
    /// It is not of its format.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// What it holds is no surface that a detector could have.
    #[error("{0}")]
    Shape(String),
}

/// A place of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// Where (m).
    pub place_m: Place,
    /// On which triangle.
    pub triangle: usize,
}

impl Surface {
    /// Reads an OBJ or STL file; `named` as the detector does, in a unit of `mm`, `cm`, `m` or `in`.
    ///
    /// # Errors
    /// [`SurfaceError`], which says where in the file and what is allowed.
    pub fn read(path: &Path, named: &str, unit: &str) -> Result<Self, SurfaceError> {
        file::check_regular(path)?;
        Self::parse(&FORMAT.read(path)?, named, unit)
    }

    /// Reads a surface from a file's bytes; `named` is the file, `unit` that of its lengths.
    ///
    /// # Errors
    /// [`SurfaceError`], which says where in the file and what is allowed.
    pub fn parse(bytes: &[u8], named: &str, unit: &str) -> Result<Self, SurfaceError> {
        let unit_m = UNITS.iter().find(|(name, _)| *name == unit).map(|(_, unit_m)| *unit_m);
        let unit_m = unit_m.ok_or_else(|| SurfaceError::Unit(unit.to_owned()))?;
        let raw = read::parse(bytes, named)?;
        let (mut nodes_m, triangles) = weld::weld(&raw, unit_m).map_err(SurfaceError::Shape)?;
        let moved_m = centre(&mut nodes_m);
        let (file, unit) = (named.to_owned(), unit.to_owned());
        let mut surface = Self { file, unit, moved_m, nodes_m, triangles, map: Map::Above };
        surface.check().map_err(SurfaceError::Shape)?;
        surface.map = Map::of(&mut surface).map_err(SurfaceError::Shape)?;
        Ok(surface)
    }

    /// The text of an OBJ file in its [unit](Self::unit), where it was drawn: what [`parse`](Self::parse) makes this surface of, to
    /// rounding.
    pub fn to_obj(&self) -> String {
        let unit_m = UNITS.iter().find(|(name, _)| *name == self.unit).map_or(1.0, |(_, unit_m)| *unit_m);
        let [x_m, y_m] = self.moved_m;
        let mut text = String::new();
        for [x, y, z] in &self.nodes_m {
            let [x, y, z] = [x - x_m, y - y_m, *z].map(|at_m| at_m / unit_m);
            // Writing to a string cannot fail.
            let _ = writeln!(text, "v {x:?} {y:?} {z:?}");
        }
        for [a, b, c] in &self.triangles {
            let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
        }
        text
    }

    /// Nodes and triangles: all that matters to a model.
    pub fn shape(&self) -> (&[Place], &[[u32; 3]]) {
        (&self.nodes_m, &self.triangles)
    }

    /// Corners of a triangle (m).
    pub fn corners(&self, triangle: usize) -> [Place; 3] {
        self.triangles[triangle].map(|node| self.nodes_m[node as usize])
    }

    /// Its area (m2).
    pub fn area_m2(&self) -> f64 {
        (0..self.triangles.len()).map(|triangle| space::length(space::normal(self.corners(triangle))) / 2.0).sum()
    }

    /// The place of the surface that is nearest to another.
    pub fn nearest(&self, at: Place) -> Foot {
        let mut nearest = Foot { place_m: [f64::INFINITY; 3], triangle: 0 };
        for triangle in 0..self.triangles.len() {
            let place_m = space::nearest_on_triangle(at, self.corners(triangle));
            if space::distance(at, place_m) < space::distance(at, nearest.place_m) {
                nearest = Foot { place_m, triangle };
            }
        }
        nearest
    }

    /// Where a place is drawn (m).
    pub fn map_m(&self, at: Place) -> [f64; 2] {
        self.map.flat(at)
    }

    /// The place that is drawn at a point of the map; `None` beside the surface.
    pub fn place_m(&self, map_m: [f64; 2]) -> Option<Place> {
        if !self.map.shows(map_m) {
            return None;
        }
        let (from, direction) = self.map.ray(map_m, &self.nodes_m);
        let hits = (0..self.triangles.len())
            .filter_map(|triangle| space::ray_to_triangle(from, direction, self.corners(triangle)));
        // From above the uppermost is seen; from within there is only one.
        hits.min_by(f64::total_cmp).map(|share| space::along(from, share, direction))
    }

    /// Whether a point of the map is drawn: all but what lies about the far end of a map all around.
    pub fn shows(&self, map_m: [f64; 2]) -> bool {
        self.map.shows(map_m)
    }

    /// The edge of the map: outer edge and holes.
    pub fn outline(&self) -> Outline {
        let places = |rim: Vec<u32>| rim.into_iter().map(|node| self.nodes_m[node as usize]).collect();
        self.map.outline(&self.rims().into_iter().map(places).collect::<Vec<_>>())
    }

    /// Distance of a place from the nearest rim (m): infinite on a closed surface.
    pub fn clearance_m(&self, at: Place) -> f64 {
        let edges = self.rim_edges().into_iter().map(|(a, b)| [a, b].map(|node| self.nodes_m[node as usize]));
        edges.map(|[a, b]| space::distance(at, space::nearest_on_segment(at, a, b))).fold(f64::INFINITY, f64::min)
    }
}

/// Moves nodes so that the middle of their bounding box has x and y zero; returns how far (m).
fn centre(nodes_m: &mut [Place]) -> [f64; 2] {
    let shift_m = [0, 1].map(|axis| {
        let low = nodes_m.iter().map(|node| node[axis]).fold(f64::INFINITY, f64::min);
        let high = nodes_m.iter().map(|node| node[axis]).fold(f64::NEG_INFINITY, f64::max);
        let shift_m = -(low + high) / 2.0;
        if shift_m.abs() < super::file::CENTRED_M { 0.0 } else { shift_m }
    });
    nodes_m.iter_mut().for_each(|node| (0..2).for_each(|axis| node[axis] += shift_m[axis]));
    shift_m
}
