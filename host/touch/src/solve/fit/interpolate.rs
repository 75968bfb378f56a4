//! From a coarse mesh to the mesh that images are shown on.

use tactomo_physics::forward::ImageMesh;
use tactomo_physics::geometry::{Point, cross};

/// A place this far beyond a triangle's edge, in shares of the triangle, still counts as inside: rounding, and edges that cut corners
/// of a round outline.
const SLACK: f64 = 1e-9;

/// Linear interpolation between two meshes of one detector.
#[derive(Clone, Debug)]
pub struct Interpolation {
    /// For each node of the fine mesh, three of the coarse one and their weights, which add up to one.
    corners: Vec<[(u32, f32); 3]>,
}

impl Interpolation {
    /// Prepares it, with a look at every triangle for each node.
    pub fn new(coarse: &ImageMesh, fine: &ImageMesh) -> Self {
        Self { corners: fine.nodes_m.iter().map(|&at| corners(coarse, at)).collect() }
    }

    /// Values at the fine mesh's nodes from those at the coarse one's.
    ///
    /// # Panics
    /// If there are too few values.
    pub fn apply(&self, values: &[f32]) -> Vec<f32> {
        self.corners
            .iter()
            .map(|three| three.iter().map(|&(node, share)| share * values[node as usize]).sum())
            .collect()
    }
}

/// The corners of the triangle that a place is in, with its shares; beyond all triangles the nearest node.
fn corners(mesh: &ImageMesh, at: Point) -> [(u32, f32); 3] {
    let within = mesh.triangles.iter().find_map(|&triangle| {
        let shares = shares(triangle.map(|node| mesh.nodes_m[node as usize]), at)?;
        Some([0, 1, 2].map(|i| (triangle[i], shares[i] as f32)))
    });
    within.unwrap_or_else(|| {
        let distance_m = |node: &usize| (mesh.nodes_m[*node][0] - at[0]).hypot(mesh.nodes_m[*node][1] - at[1]);
        let nearest =
            (0..mesh.nodes_m.len()).min_by(|a, b| distance_m(a).total_cmp(&distance_m(b))).unwrap_or(0) as u32;
        [(nearest, 1.0), (nearest, 0.0), (nearest, 0.0)]
    })
}

/// Barycentric coordinates, if the place is inside.
fn shares([a, b, c]: [Point; 3], at: Point) -> Option<[f64; 3]> {
    let whole = cross(a, b, c);
    let shares = [cross(at, b, c), cross(a, at, c), cross(a, b, at)].map(|part| part / whole);
    shares.iter().all(|&share| share >= -SLACK).then_some(shares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::shell::Shell;
    use tactomo_physics::forward::{ForwardModel, Slab};

    #[test]
    fn a_linear_image_stays_linear_on_any_two_meshes() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let slab = Slab::new(&detector).unwrap().on_image(100);
        let shell = Shell::with_nodes(&detector, 600).unwrap();
        let meshes = [slab.image_mesh(), shell.image_mesh()];
        for (from, to) in [(0, 1), (1, 0)] {
            let plane = |at: &Point| (3.0 + 40.0 * at[0] - 25.0 * at[1]) as f32;
            let values: Vec<f32> = meshes[from].nodes_m.iter().map(plane).collect();
            let found = Interpolation::new(meshes[from], meshes[to]).apply(&values);
            assert_eq!(found.len(), meshes[to].nodes_m.len());
            for (value, at) in found.iter().zip(&meshes[to].nodes_m) {
                assert!((value - plane(at)).abs() < 1e-5, "{value} at {at:?}");
            }
        }
    }

    #[test]
    fn beyond_the_mesh_the_nearest_node_counts() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let coarse = Slab::new(&detector).unwrap().on_image(9);
        let beyond = ImageMesh { nodes_m: vec![[0.031, 0.0301], [-0.04, 0.001]], ..ImageMesh::default() };
        let values: Vec<f32> = (0..9u8).map(f32::from).collect();
        assert_eq!(Interpolation::new(coarse.image_mesh(), &beyond).apply(&values), [8.0, 3.0]);
    }
}
