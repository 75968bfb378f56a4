//! The square grid that a network's images and maps are on, edges included.

/// A grid over a rectangle about the origin.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Nodes along each side.
    pub side: usize,
    size_m: [f64; 2],
    /// Of the cell of each node.
    areas_m2: Vec<f64>,
}

impl Grid {
    /// A grid of so many nodes, a square number.
    pub fn new(nodes: usize, size_m: [f64; 2]) -> Self {
        let side = nodes.isqrt();
        let cell_m2 = size_m[0] * size_m[1] / (side - 1).pow(2) as f64;
        let share = |index: usize| if index == 0 || index + 1 == side { 0.5 } else { 1.0 };
        let areas_m2 = (0..nodes).map(|node| share(node % side) * share(node / side) * cell_m2).collect();
        Self { side, size_m, areas_m2 }
    }

    /// A place (m) by its indices along x and y, which may be between nodes.
    pub fn place_m(&self, indices: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| self.size_m[axis] * (indices[axis] / (self.side - 1) as f64 - 0.5))
    }

    /// Turns logarithms of conductance per area, up to a constant, into an image of such a total conductance (S/m2).
    pub fn scale(&self, image: &mut [f32], total_s: f64) {
        let highest = image.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        image.iter_mut().for_each(|value| *value = (*value - highest).exp());
        let sum_m2: f64 = image.iter().zip(&self.areas_m2).map(|(value, area_m2)| f64::from(*value) * area_m2).sum();
        let scale = (total_s / sum_m2) as f32;
        image.iter_mut().for_each(|value| *value *= scale);
    }

    /// Conductance (S) of the parts of an image (S/m2) that are nearest to each place (m).
    pub fn conductances_s(&self, image: &[f32], places_m: &[[f64; 2]]) -> Vec<f64> {
        let mut sums_s = vec![0.0; places_m.len()];
        for (node, (value, area_m2)) in image.iter().zip(&self.areas_m2).enumerate() {
            let [x_m, y_m] = self.place_m([(node % self.side) as f64, (node / self.side) as f64]);
            let distance_m2 = |place: &usize| (places_m[*place][0] - x_m).powi(2) + (places_m[*place][1] - y_m).powi(2);
            let nearest = (0..places_m.len()).min_by(|a, b| distance_m2(a).total_cmp(&distance_m2(b)));
            if let Some(nearest) = nearest {
                sums_s[nearest] += f64::from(*value) * area_m2;
            }
        }
        sums_s
    }
}

/// Values at places between a grid's nodes: bilinear.
#[derive(Clone, Debug)]
pub(super) struct Spread {
    /// For each place the lowest of the four nodes around it, and how far it is towards the next ones.
    corners: Vec<(u32, [f32; 2])>,
    side: usize,
}

impl Spread {
    /// For places (m); those beside the grid have the values of its edge.
    pub fn new(grid: &Grid, places_m: &[[f64; 2]]) -> Self {
        let last = grid.side - 1;
        let corner = |place_m: &[f64; 2]| {
            let at =
                [0, 1].map(|axis| ((place_m[axis] / grid.size_m[axis] + 0.5) * last as f64).clamp(0.0, last as f64));
            let [i, j] = at.map(|at| (at as usize).min(last - 1));
            ((j * grid.side + i) as u32, [(at[0] - i as f64) as f32, (at[1] - j as f64) as f32])
        };
        Self { corners: places_m.iter().map(corner).collect(), side: grid.side }
    }

    /// The image at the places.
    pub fn image(&self, values: &[f32]) -> Vec<f32> {
        let between = |(corner, [x, y]): &(u32, [f32; 2])| {
            let at = |offset: usize| values[*corner as usize + offset];
            let lower = at(0) + x * (at(1) - at(0));
            let upper = at(self.side) + x * (at(self.side + 1) - at(self.side));
            lower + y * (upper - lower)
        };
        self.corners.iter().map(between).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_linear_between_nodes_is_kept_and_the_edge_goes_on() {
        let grid = Grid::new(25, [0.06, 0.04]);
        let plane = |[x, y]: [f64; 2]| (100.0 * x - 30.0 * y + 1.0) as f32;
        let values: Vec<f32> =
            (0..25).map(|node| plane(grid.place_m([(node % 5) as f64, (node / 5) as f64]))).collect();
        let places = [[0.011, -0.017], [0.03, 0.02], [-0.03, 0.0], [0.05, 0.0]];
        let found = Spread::new(&grid, &places).image(&values);
        let expected = [[0.011, -0.017], [0.03, 0.02], [-0.03, 0.0], [0.03, 0.0]].map(plane);
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?} {expected:?}");
    }

    #[test]
    fn an_image_has_the_conductance_asked_for_and_each_place_its_part() {
        let grid = Grid::new(1024, [0.06, 0.06]);
        let bump = |node: usize, at: [f64; 2]| {
            let [x, y] = grid.place_m([(node % 32) as f64, (node / 32) as f64]);
            (-((x - at[0]).powi(2) + (y - at[1]).powi(2)) / 2e-5).exp()
        };
        let places = [[0.015, 0.0], [-0.015, 0.01]];
        let mut image: Vec<f32> =
            (0..1024).map(|k| (3.0 * bump(k, places[0]) + bump(k, places[1])).max(1e-9).ln() as f32).collect();
        grid.scale(&mut image, 2e-3);
        let parts_s = grid.conductances_s(&image, &places);
        assert!((parts_s[0] - 1.5e-3).abs() < 2e-5 && (parts_s[1] - 5e-4).abs() < 2e-5, "{parts_s:?}");
    }
}
