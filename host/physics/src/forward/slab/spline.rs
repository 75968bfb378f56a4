//! Even, periodic tables on a rectangle: cosine modes summed by a fast transform, read by cubic B-splines.

use realfft::RealFftPlanner;

/// A grid over `[0, size]` in both directions, with one cell more around it, so that a look-up never meets an edge.
#[derive(Clone, Debug, Default)]
pub(super) struct Grid {
    size_m: [f64; 2],
    cells: [usize; 2],
    cells_per_m: [f64; 2],
}

/// Four weights along one direction, and the first node that they belong to.
pub(super) type Taps = (usize, [f64; 4]);

impl Grid {
    /// Cells of at most `step_m`.
    pub fn new(size_m: [f64; 2], step_m: f64) -> Self {
        // Even, and never so few that the lowest modes are missed.
        let cells = size_m.map(|size_m| ((size_m / step_m / 2.0).ceil() as usize * 2).max(8));
        let cells_per_m = [0, 1].map(|axis| cells[axis] as f64 / size_m[axis]);
        Self { size_m, cells, cells_per_m }
    }

    /// Nodes along a direction, with those around the rectangle.
    pub fn nodes(&self, axis: usize) -> usize {
        self.cells[axis] + 3
    }

    /// Highest mode that the grid can carry along a direction.
    pub fn modes(&self, axis: usize) -> usize {
        self.cells[axis]
    }

    /// Wave number of a mode along a direction (1/m).
    pub fn wave_number(&self, axis: usize, mode: usize) -> f64 {
        mode as f64 * std::f64::consts::PI / self.size_m[axis]
    }

    /// Weights at `u_m`, which is first folded back into the rectangle: the table is even about both of its edges.
    #[inline]
    pub fn taps(&self, axis: usize, u_m: f64) -> Taps {
        let size_m = self.size_m[axis];
        let folded_m = if u_m.abs() > size_m { (2.0 * size_m - u_m.abs()).abs() } else { u_m.abs() };
        let at = folded_m * self.cells_per_m[axis];
        let cell = (at as usize).min(self.cells[axis] - 1);
        (cell, cubic_weights(at - cell as f64))
    }

    /// Values at the cells' corners, `x` running slowest, of a function of the place (m).
    pub fn values(&self, function: impl Fn([f64; 2]) -> f64) -> Vec<f64> {
        let [nx, ny] = self.cells;
        let at_m = |axis: usize, node: usize| node as f64 / self.cells_per_m[axis];
        (0..=nx).flat_map(|i| (0..=ny).map(move |j| [i, j])).map(|[i, j]| function([at_m(0, i), at_m(1, j)])).collect()
    }

    /// Amplitudes of the cosine series with amplitudes given as for [`synthesise`](Self::synthesise), times [`values`](Self::values).
    pub fn multiply(&self, planner: &mut RealFftPlanner<f64>, mut amplitude: Vec<f64>, values: &[f64]) -> Vec<f64> {
        let [nx, ny] = self.cells;
        cosine_transform_rows(planner, &mut amplitude, ny);
        let mut turned = transpose(&amplitude, nx + 1, ny + 1);
        cosine_transform_rows(planner, &mut turned, nx);
        let mut products = transpose(&turned, ny + 1, nx + 1);
        products.iter_mut().zip(values).for_each(|(product, value)| *product *= value);
        analyse_rows(planner, &mut products, ny);
        let mut turned = transpose(&products, nx + 1, ny + 1);
        analyse_rows(planner, &mut turned, nx);
        transpose(&turned, ny + 1, nx + 1)
    }

    /// Spline coefficients at all nodes, `x` running slowest, of the cosine series with `amplitude[m * (ny + 1) + n]`.
    pub fn synthesise(&self, planner: &mut RealFftPlanner<f64>, mut amplitude: Vec<f64>) -> Vec<f64> {
        let [nx, ny] = self.cells;
        for (m, row) in amplitude.chunks_exact_mut(ny + 1).enumerate() {
            let x_symbol = spline_symbol(m, nx);
            row.iter_mut().enumerate().for_each(|(n, a)| *a /= x_symbol * spline_symbol(n, ny));
        }
        cosine_transform_rows(planner, &mut amplitude, ny);
        let mut turned = transpose(&amplitude, nx + 1, ny + 1);
        cosine_transform_rows(planner, &mut turned, nx);
        let (wide_x, wide_y) = (self.nodes(0), self.nodes(1));
        let reflect = |node: usize, cells: usize| {
            let from_edge = node.abs_diff(1);
            if from_edge > cells { 2 * cells - from_edge } else { from_edge }
        };
        (0..wide_x * wide_y).map(|i| turned[reflect(i % wide_y, ny) * (nx + 1) + reflect(i / wide_y, nx)]).collect()
    }
}

/// Cubic B-spline weights of the four nodes around a point, `t` of the way from the second to the third.
#[inline]
fn cubic_weights(t: f64) -> [f64; 4] {
    const SIXTH: f64 = 1.0 / 6.0;
    let s = 1.0 - t;
    let (t_cubed, s_cubed) = (SIXTH * t * t * t, SIXTH * s * s * s);
    [s_cubed, 4.0 * SIXTH - t * t + 3.0 * t_cubed, 4.0 * SIXTH - s * s + 3.0 * s_cubed, t_cubed]
}

/// Factor from the coefficients of a B-spline to its values at the nodes, for one mode.
fn spline_symbol(mode: usize, cells: usize) -> f64 {
    (2.0 + (std::f64::consts::PI * mode as f64 / cells as f64).cos()) / 3.0
}

/// The reverse of [`cosine_transform_rows`]: amplitudes of each row of values at the nodes, in place. Both are the same sum but for weights.
fn analyse_rows(planner: &mut RealFftPlanner<f64>, rows: &mut [f64], cells: usize) {
    let halve_ends = |rows: &mut [f64]| {
        for row in rows.chunks_exact_mut(cells + 1) {
            row[0] *= 0.5;
            row[cells] *= 0.5;
        }
    };
    halve_ends(rows);
    cosine_transform_rows(planner, rows, cells);
    halve_ends(rows);
    rows.iter_mut().for_each(|value| *value *= 2.0 / cells as f64);
}

/// Sums each row's cosine series at its nodes: `a_m -> sum a_m cos(pi m j / cells)`, in place.
fn cosine_transform_rows(planner: &mut RealFftPlanner<f64>, rows: &mut [f64], cells: usize) {
    let transform = planner.plan_fft_forward(2 * cells);
    let (mut input, mut output) = (transform.make_input_vec(), transform.make_output_vec());
    for row in rows.chunks_exact_mut(cells + 1) {
        if row.iter().all(|&a| a == 0.0) {
            continue;
        }
        input[..=cells].copy_from_slice(row);
        for (m, a) in row.iter().enumerate().take(cells).skip(1) {
            input[m] = 0.5 * a;
            input[2 * cells - m] = 0.5 * a;
        }
        // The buffers were made by the plan itself, so their lengths fit.
        if transform.process(&mut input, &mut output).is_ok() {
            row.iter_mut().zip(&output).for_each(|(value, sum)| *value = sum.re);
        }
    }
}

fn transpose(matrix: &[f64], rows: usize, columns: usize) -> Vec<f64> {
    (0..rows * columns).map(|i| matrix[(i % rows) * columns + i / rows]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_gives_back_the_series_it_was_made_of() {
        let grid = Grid::new([0.05, 0.03], 0.0012);
        let (kx, ky) = (grid.wave_number(0, 5), grid.wave_number(1, 3));
        let mut amplitude = vec![0.0; (grid.modes(0) + 1) * (grid.modes(1) + 1)];
        amplitude[5 * (grid.modes(1) + 1) + 3] = 2.0;
        let table = grid.synthesise(&mut RealFftPlanner::new(), amplitude);
        for (x, y) in [(0.0, 0.0), (0.0123, 0.0271), (0.05, 0.03), (-0.017, 0.041), (0.0999, 0.0)] {
            let ((i, wx), (j, wy)) = (grid.taps(0, x), grid.taps(1, y));
            let value: f64 =
                (0..16).map(|tap| wx[tap / 4] * wy[tap % 4] * table[(i + tap / 4) * grid.nodes(1) + j + tap % 4]).sum();
            assert!((value - 2.0 * (kx * x).cos() * (ky * y).cos()).abs() < 2e-4, "at {x} {y}: {value}");
        }
    }
}
