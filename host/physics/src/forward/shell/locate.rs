//! Triangles near a place, without a look at all of them.

use super::mesh::Mesh;
use crate::space::{self, Frame, Place};

/// Cells along an edge of the grid, at most: so that a curved surface's box does not fill the memory.
const MOST_CELLS: f64 = 96.0;
/// Cells of the grid are as wide as this many triangles of mean size.
const CELL_TRIANGLES: f64 = 1.5;

/// Which triangles of a mesh touch each cell of a grid of cubes.
#[derive(Clone, Debug)]
pub(super) struct Locator {
    low: Place,
    cell_m: f64,
    counts: [usize; 3],
    /// Where each cell's triangles start in `triangles`; one more than cells.
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

/// A place of a mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foot {
    pub triangle: u32,
    pub place_m: Place,
}

impl Locator {
    pub fn new(mesh: &Mesh) -> Self {
        let all = (0..mesh.nodes_m.len()).map(|node| mesh.place_m(node as u32));
        let [low, high] = all.fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[low, high], at| {
            [0, 1].map(|end| {
                [0, 1, 2].map(|axis| if end == 0 { low[axis].min(at[axis]) } else { high[axis].max(at[axis]) })
            })
        });
        let area_m2: f64 = mesh.node_areas_m2().iter().sum();
        let longest_m = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
        let cell_m =
            (CELL_TRIANGLES * (area_m2 / mesh.triangles.len().max(1) as f64).sqrt()).max(longest_m / MOST_CELLS);
        let counts = [0, 1, 2].map(|axis| ((high[axis] - low[axis]) / cell_m) as usize + 1);
        let mut locator = Self { low, cell_m, counts, starts: Vec::new(), triangles: Vec::new() };
        let mut cells = vec![Vec::new(); counts.iter().product()];
        for (index, triangle) in (0u32..).zip(&mesh.triangles) {
            let corners = triangle.map(|node| mesh.place_m(node));
            let [low, high] = [f64::min as fn(f64, f64) -> f64, f64::max]
                .map(|of| [0, 1, 2].map(|axis| of(of(corners[0][axis], corners[1][axis]), corners[2][axis])));
            locator.each_cell(low, high, |cell| cells[cell].push(index));
        }
        locator.starts.push(0);
        for cell in cells {
            locator.triangles.extend(cell);
            locator.starts.push(locator.triangles.len() as u32);
        }
        locator
    }

    fn each_cell(&self, low: Place, high: Place, mut visit: impl FnMut(usize)) {
        let index = |at: Place, axis: usize| {
            let cell = (at[axis] - self.low[axis]) / self.cell_m;
            (cell.max(0.0) as usize).min(self.counts[axis] - 1)
        };
        let range = |axis: usize| index(low, axis)..=index(high, axis);
        for x in range(0) {
            for y in range(1) {
                range(2).for_each(|z| visit((x * self.counts[1] + y) * self.counts[2] + z));
            }
        }
    }

    /// Triangles whose boxes may touch a ball, each once, in their order.
    pub fn near(&self, centre: Place, radius_m: f64) -> Vec<u32> {
        let end = |sign: f64| centre.map(|at| at + sign * radius_m);
        let mut found = Vec::new();
        self.each_cell(end(-1.0), end(1.0), |cell| {
            found.extend_from_slice(&self.triangles[self.starts[cell] as usize..self.starts[cell + 1] as usize]);
        });
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The place of the mesh that is nearest to another.
    pub fn nearest(&self, mesh: &Mesh, at: Place) -> Foot {
        let mut reach_m = 0.0;
        loop {
            let mut best: Option<(f64, Foot)> = None;
            for triangle in self.near(at, reach_m) {
                let corners = mesh.triangles[triangle as usize].map(|node| mesh.place_m(node));
                let place_m = space::nearest_on_triangle(at, corners);
                let away_m = space::distance(at, place_m);
                if best.as_ref().is_none_or(|(least_m, _)| away_m < *least_m) {
                    best = Some((away_m, Foot { triangle, place_m }));
                }
            }
            // What is nearer than the reach has been looked at; a reach beyond the whole box looks at all.
            let has_all = reach_m > 4.0 * self.cell_m * self.counts.iter().sum::<usize>() as f64;
            match best {
                Some((away_m, foot)) if away_m <= reach_m || away_m < 1e-12 || has_all => return foot,
                None if has_all => return Foot { triangle: 0, place_m: mesh.place_m(0) },
                Some((away_m, _)) if away_m < 2.0 * self.cell_m => reach_m = 1.001 * away_m,
                _ => reach_m = (2.0 * reach_m).max(self.cell_m),
            }
        }
    }
}

impl Mesh {
    /// Where a node is (m), with height zero on a flat detector.
    pub(super) fn place_m(&self, node: u32) -> Place {
        let [x, y] = self.nodes_m[node as usize];
        self.places_m.get(node as usize).copied().unwrap_or([x, y, 0.0])
    }

    /// Two unit vectors along the surface: on a plane those of the coordinates, else of the triangle.
    pub(super) fn tangents(&self, triangle: u32) -> [Place; 2] {
        if self.places_m.is_empty() {
            return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        }
        Frame::of(self.triangles[triangle as usize].map(|node| self.place_m(node))).axes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Detector;

    #[test]
    fn the_nearest_place_is_that_of_a_look_at_all_triangles() {
        let detector = Detector::preset("square-60").unwrap();
        let mesh = Mesh::new(&detector, 700).unwrap();
        let locator = Locator::new(&mesh);
        let mut rng = fastrand::Rng::with_seed(4);
        for _ in 0..200 {
            // Some are beside the detector.
            let at = [0.08 * (rng.f64() - 0.5), 0.08 * (rng.f64() - 0.5), 0.0];
            let corners = |triangle: &[u32; 3]| triangle.map(|node| mesh.place_m(node));
            let away_m = |triangle| space::distance(at, space::nearest_on_triangle(at, corners(triangle)));
            let expected_m = mesh.triangles.iter().map(away_m).fold(f64::INFINITY, f64::min);
            let found_m = space::distance(at, locator.nearest(&mesh, at).place_m);
            assert!((found_m - expected_m).abs() < 1e-12, "{at:?}: {found_m} {expected_m}");
        }
        let far = locator.nearest(&mesh, [3.0, 0.0, 0.0]).place_m;
        assert!((far[0] - 0.03).abs() < 1e-9 && far[1].abs() < 1e-9, "{far:?}");
    }
}
