//! How the triangles of a surface hang together.

use std::collections::HashMap;

use super::Surface;
use super::weld::millimetres;

impl Surface {
    /// Checks that every edge has one or two triangles that turn the same way, and that all triangles hang together.
    pub(super) fn check(&self) -> Result<(), String> {
        let mut edges = HashMap::new();
        for (index, triangle) in self.triangles.iter().enumerate() {
            for (from, to) in edges_of(*triangle) {
                if edges.insert((from, to), index).is_some() {
                    let at = millimetres(self.nodes_m[from as usize]);
                    return Err(format!(
                        "the edge at {at} mm has more than two triangles, or two that turn in opposite ways: repair the mesh"
                    ));
                }
            }
        }
        let mut reached = vec![false; self.triangles.len()];
        let mut waiting = vec![0];
        while let Some(index) = waiting.pop() {
            if !std::mem::replace(&mut reached[index], true) {
                waiting.extend(edges_of(self.triangles[index]).iter().filter_map(|&(a, b)| edges.get(&(b, a))));
            }
        }
        match reached.iter().position(|reached| !reached) {
            Some(index) => {
                let at = millimetres(self.nodes_m[self.triangles[index][0] as usize]);
                Err(format!(
                    "is in more than one piece: what is at {at} mm does not hang together with the first triangle"
                ))
            }
            None => Ok(()),
        }
    }

    /// The triangles beyond each triangle's edges, in the order of its corners; `None` at a rim.
    pub fn neighbours(&self) -> Vec<[Option<usize>; 3]> {
        let owner: HashMap<_, _> = self.directed_edges().collect();
        let beyond = |triangle: &[u32; 3]| edges_of(*triangle).map(|(a, b)| owner.get(&(b, a)).copied());
        self.triangles.iter().map(beyond).collect()
    }

    /// Edges of one triangle only, each with the nodes in the order of its triangle.
    pub(super) fn rim_edges(&self) -> Vec<(u32, u32)> {
        let owner: HashMap<_, _> = self.directed_edges().collect();
        self.directed_edges().map(|(edge, _)| edge).filter(|&(a, b)| !owner.contains_key(&(b, a))).collect()
    }

    /// Loops of rim, each as its nodes; none on a closed surface.
    pub(super) fn rims(&self) -> Vec<Vec<u32>> {
        let mut next: HashMap<u32, Vec<u32>> = HashMap::new();
        let edges = self.rim_edges();
        edges.iter().for_each(|&(from, to)| next.entry(from).or_default().push(to));
        let mut rims = Vec::new();
        for (start, _) in edges {
            let (mut rim, mut at) = (Vec::new(), start);
            while let Some(to) = next.get_mut(&at).and_then(Vec::pop) {
                rim.push(at);
                at = to;
            }
            if !rim.is_empty() {
                rims.push(rim);
            }
        }
        rims
    }

    fn directed_edges(&self) -> impl Iterator<Item = ((u32, u32), usize)> + '_ {
        let of = |(index, triangle): (usize, &[u32; 3])| edges_of(*triangle).map(|edge| (edge, index));
        self.triangles.iter().enumerate().flat_map(of)
    }
}

/// Edges of a triangle, in its order.
pub fn edges_of([a, b, c]: [u32; 3]) -> [(u32, u32); 3] {
    [(a, b), (b, c), (c, a)]
}
