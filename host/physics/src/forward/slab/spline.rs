//! Even, periodic tables on a rectangle: cosine modes summed side by side, read by cubic B-splines.
//!
//! The sums are products of matrices: along the fifty steps of a usual side they are quicker than fast transforms, and all tables of a detector
//! are summed at once.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DMatrixViewMut};

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

    /// Of the rectangle (m).
    pub fn size_m(&self) -> [f64; 2] {
        self.size_m
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

    /// Half waves along both sides of all modes with a wave number below `end` (1/m), in the order of [`synthesise`](Self::synthesise).
    pub fn modes_within(&self, end: f64) -> Vec<[usize; 2]> {
        let all = (0..=self.modes(0)).flat_map(|m| (0..=self.modes(1)).map(move |n| [m, n]));
        all.filter(|[m, n]| self.wave_number(0, *m).hypot(self.wave_number(1, *n)) < end).collect()
    }

    /// Weights at `u_m`, which is first folded back into the rectangle: the table is even about both of its edges.
    #[inline]
    pub fn taps(&self, axis: usize, u_m: f64) -> Taps {
        let (cell, t, _) = self.cell(axis, u_m);
        (cell, cubic_weights(t))
    }

    /// The same with their derivatives by `u_m` (1/m).
    #[inline]
    pub fn taps_with_slopes(&self, axis: usize, u_m: f64) -> (Taps, [f64; 4]) {
        let (cell, t, sign) = self.cell(axis, u_m);
        ((cell, cubic_weights(t)), cubic_slopes(t).map(|slope| sign * self.cells_per_m[axis] * slope))
    }

    /// The cell that a place is folded into, how far into it, in cells, and the sign of the direction there.
    #[inline]
    fn cell(&self, axis: usize, u_m: f64) -> (usize, f64, f64) {
        let size_m = self.size_m[axis];
        let is_beyond = u_m.abs() > size_m;
        let folded_m = if is_beyond { (2.0 * size_m - u_m.abs()).abs() } else { u_m.abs() };
        let at = folded_m * self.cells_per_m[axis];
        let cell = (at as usize).min(self.cells[axis] - 1);
        (cell, at - cell as f64, if is_beyond != (u_m < 0.0) { -1.0 } else { 1.0 })
    }

    /// Spline coefficients of sums of cosine modes, given by half waves along both sides and `columns x modes` amplitudes; modes of as many half
    /// waves along `x` follow each other. Of all nodes, `x` running slowest and columns fastest.
    pub fn synthesise(&self, modes: &[[usize; 2]], amplitudes: &DMatrix<f64>) -> Vec<f64> {
        let (columns, wide) = (amplitudes.nrows(), self.nodes(1));
        let alike: Vec<_> = modes.chunk_by(|a, b| a[0] == b[0]).collect();
        let y = self.cosines(1);
        // For each number of half waves along x, the sum of those along y: `columns x nodes`.
        let mut lines = DMatrix::zeros(columns * wide, alike.len());
        let mut first = 0;
        for (line, of) in lines.as_mut_slice().chunks_exact_mut((columns * wide).max(1)).zip(&alike) {
            let mut line = DMatrixViewMut::from_slice(line, columns, wide);
            line.gemm(1.0, &amplitudes.columns(first, of.len()), &y.rows(of[0][1], of.len()), 0.0);
            first += of.len();
        }
        let x = self.cosines(0);
        let waves = DMatrix::from_fn(alike.len(), self.nodes(0), |i, node| x[(alike[i][0][0], node)]);
        (lines * waves).data.into()
    }

    /// Spline coefficients of one sum of cosine modes, by the amplitudes of the lowest: `half waves along y x half waves along x`. In the order of
    /// [`synthesise`](Self::synthesise).
    pub fn series(&self, amplitudes: &DMatrix<f64>) -> Vec<f64> {
        let [x, y] = [0, 1].map(|axis| self.cosines(axis));
        let lines = y.rows(0, amplitudes.nrows()).transpose() * amplitudes;
        (lines * x.rows(0, amplitudes.ncols())).data.into()
    }

    /// Spline coefficients through the values of a function of the place (m): as [`synthesise`](Self::synthesise).
    pub fn through(&self, function: impl Fn([f64; 2]) -> f64) -> Vec<f64> {
        let at_m = |axis: usize, node: usize| node as f64 / self.cells_per_m[axis];
        let [nx, ny] = self.cells;
        let values = DMatrix::from_fn(ny + 1, nx + 1, |j, i| function([at_m(0, i), at_m(1, j)]));
        let [x, y] = [0, 1].map(|axis| analysis(self.cells[axis]).tr_mul(&self.cosines(axis)));
        (y.tr_mul(&values) * x).data.into()
    }

    /// What each mode adds to the spline coefficients of each node along a direction: `modes x nodes`.
    fn cosines(&self, axis: usize) -> DMatrix<f64> {
        let cells = self.cells[axis];
        let period: Vec<f64> = (0..2 * cells).map(|phase| (PI * phase as f64 / cells as f64).cos()).collect();
        let cosine = |phase: usize| period[phase % period.len()];
        let symbol: Vec<f64> = (0..=cells).map(|mode| (2.0 + cosine(mode)) / 3.0).collect();
        DMatrix::from_fn(cells + 1, self.nodes(axis), |mode, node| cosine(mode * node.abs_diff(1)) / symbol[mode])
    }
}

/// Derivatives of [`cubic_weights`] by `t`.
#[inline]
fn cubic_slopes(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-0.5 * s * s, 1.5 * t * t - 2.0 * t, 2.0 * s - 1.5 * s * s, 0.5 * t * t]
}

/// In how many ways a mode's wave numbers can be signed: what it is weighted by in a sum over all modes.
pub(super) fn signs(mode: [usize; 2]) -> f64 {
    mode.iter().map(|waves| if *waves == 0 { 1.0 } else { 2.0 }).product()
}

/// Cubic B-spline weights of the four nodes around a point, `t` of the way from the second to the third.
#[inline]
fn cubic_weights(t: f64) -> [f64; 4] {
    const SIXTH: f64 = 1.0 / 6.0;
    let s = 1.0 - t;
    let (t_cubed, s_cubed) = (SIXTH * t * t * t, SIXTH * s * s * s);
    [s_cubed, 4.0 * SIXTH - t * t + 3.0 * t_cubed, 4.0 * SIXTH - s * s + 3.0 * s_cubed, t_cubed]
}

/// Amplitudes of cosine modes from values at the corners of so many cells: `modes x corners`.
fn analysis(cells: usize) -> DMatrix<f64> {
    let half_at_ends = |at: usize| if at == 0 || at == cells { 0.5 } else { 1.0 };
    DMatrix::from_fn(cells + 1, cells + 1, |mode, corner| {
        let cosine = (PI * (mode * corner % (2 * cells)) as f64 / cells as f64).cos();
        2.0 / cells as f64 * half_at_ends(mode) * half_at_ends(corner) * cosine
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_gives_back_the_series_it_was_made_of() {
        let grid = Grid::new([0.05, 0.03], 0.0012);
        let (kx, ky) = (grid.wave_number(0, 5), grid.wave_number(1, 3));
        let wave = |[x, y]: [f64; 2]| 2.0 * (kx * x).cos() * (ky * y).cos();
        let of_series = grid.synthesise(&[[0, 1], [5, 2], [5, 3]], &DMatrix::from_row_slice(1, 3, &[0.0, 0.0, 2.0]));
        let mut amplitudes = DMatrix::zeros(4, 6);
        amplitudes[(3, 5)] = 2.0;
        for (one, other) in grid.series(&amplitudes).iter().zip(&of_series) {
            assert!((one - other).abs() < 1e-12);
        }
        for table in [of_series, grid.through(wave)] {
            for at in [[0.0, 0.0], [0.0123, 0.0271], [0.05, 0.03], [-0.017, 0.041], [0.0999, 0.0]] {
                let ((x, x_slopes), (y, _)) = (grid.taps_with_slopes(0, at[0]), grid.taps_with_slopes(1, at[1]));
                assert_eq!((x, y), (grid.taps(0, at[0]), grid.taps(1, at[1])));
                let sum = |x_weights: [f64; 4]| -> f64 {
                    let at = |tap: usize| table[(x.0 + tap / 4) * grid.nodes(1) + y.0 + tap % 4];
                    (0..16).map(|tap| x_weights[tap / 4] * y.1[tap % 4] * at(tap)).sum()
                };
                let [value, slope] = [sum(x.1), sum(x_slopes)];
                assert!((value - wave(at)).abs() < 2e-4, "at {at:?}: {value}");
                let expected = -2.0 * kx * (kx * at[0]).sin() * (ky * at[1]).cos();
                assert!((slope - expected).abs() < 1e-3 * kx, "at {at:?}: {slope} {expected}");
            }
        }
    }
}
