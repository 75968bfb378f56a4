//! The image of a slab: a grid of nodes on its top, each with a cell of surface around it.
//!
//! A cell carries a current of uniform density. Its mean of a mode is the mode at its node times two `sinc`s, so that the
//! impedance between two cells is four look-ups in a table of differences and sums of their indices, without interpolation.
//! Nodes lie on the edges too: half a cell and its mirror image in the wall are a whole one.

use nalgebra::DMatrix;

use super::pads::PadFields;
use super::uneven::{Uneven, uneven_ohm};
use crate::algebra::gram;
use crate::forward::ImageMesh;
use crate::forward::uneven_place::UnevenPlace;

/// Modes summed along a side, for each cell of it: what is left out is below 1e-3 of a cell's own impedance.
const MODES_PER_CELL: usize = 16;

/// Where two points integrate over `[-1, 1]`.
const GAUSS: [f64; 2] = [-0.577_350_269_189_625_8, 0.577_350_269_189_625_8];

/// A regular grid over a rectangle, edges included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ImageGrid {
    size_m: [f64; 2],
    cells: [usize; 2],
}

/// Impedances between the cells of a grid.
#[derive(Clone, Debug)]
pub(super) struct CellFields {
    grid: ImageGrid,
    table: Vec<f64>,
    /// Of the pads' correction, mean over each cell: `columns x nodes`.
    corrections: DMatrix<f64>,
    /// Of each node, where conductivity is uneven.
    uneven: Option<Vec<UnevenPlace>>,
}

impl ImageGrid {
    /// A grid of about `nodes` nodes.
    pub fn new(size_m: [f64; 2], nodes: usize) -> Self {
        let step_m = (size_m[0] * size_m[1] / nodes as f64).sqrt();
        Self { size_m, cells: size_m.map(|size_m| ((size_m / step_m).round() as usize).max(3) - 1) }
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        (self.cells[0] + 1) * (self.cells[1] + 1)
    }

    /// Indices of a node along both directions.
    fn indices(&self, node: usize) -> [usize; 2] {
        [node % (self.cells[0] + 1), node / (self.cells[0] + 1)]
    }

    /// Where a node is, from the corner (m).
    fn node_from_corner_m(&self, node: usize) -> [f64; 2] {
        let indices = self.indices(node);
        [0, 1].map(|axis| self.step_m(axis) * indices[axis] as f64)
    }

    fn step_m(&self, axis: usize) -> f64 {
        self.size_m[axis] / self.cells[axis] as f64
    }

    /// Nodes and areas, and two triangles between each four nodes.
    pub fn mesh(&self) -> ImageMesh {
        let [nx, ny] = self.cells;
        let place = |axis: usize, i: usize| self.step_m(axis) * i as f64 - self.size_m[axis] / 2.0;
        let share = |axis: usize, i: usize| self.step_m(axis) * if i == 0 || i == self.cells[axis] { 0.5 } else { 1.0 };
        let at = |i: usize, j: usize| (j * (nx + 1) + i) as u32;
        let nodes = || (0..self.nodes()).map(|node| self.indices(node));
        ImageMesh {
            places_m: Vec::new(),
            nodes_m: nodes().map(|[i, j]| [place(0, i), place(1, j)]).collect(),
            node_areas_m2: nodes().map(|[i, j]| share(0, i) * share(1, j)).collect(),
            triangles: (0..ny)
                .flat_map(|j| (0..nx).map(move |i| (i, j)))
                .flat_map(|(i, j)| {
                    [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
                })
                .collect(),
        }
    }

    /// Means over each cell of the first `columns` columns of the pads' fields: `columns x nodes`.
    pub fn means(&self, pads: &PadFields, columns: usize) -> DMatrix<f64> {
        let mut means = DMatrix::zeros(columns, self.nodes());
        let mut sample = vec![0.0_f32; columns];
        for (node, mut mean) in means.column_iter_mut().enumerate() {
            let indices = self.indices(node);
            for [gx, gy] in GAUSS.iter().flat_map(|gx| GAUSS.map(|gy| [*gx, gy])) {
                let at_m = |axis: usize, part: f64| self.step_m(axis) * (indices[axis] as f64 + 0.5 * part);
                pads.sample([at_m(0, gx), at_m(1, gy)], &mut sample);
                mean.iter_mut().zip(&sample).for_each(|(sum, value)| *sum += 0.25 * f64::from(*value));
            }
        }
        means
    }
}

impl CellFields {
    /// Sums the modes; `response` is the top's potential per normal current density for a wave number, `floating` what is left of
    /// it at zero.
    pub fn new(
        grid: ImageGrid,
        pads: &PadFields,
        uneven: Option<&Uneven>,
        response: impl Fn(f64) -> f64,
        floating: f64,
    ) -> Self {
        let all = grid.means(pads, pads.columns());
        let corrections = all.rows(pads.electrodes(), pads.columns() - pads.electrodes()).into_owned();
        let uneven =
            uneven.map(|uneven| (0..grid.nodes()).map(|node| uneven.place(grid.node_from_corner_m(node))).collect());
        Self { grid, table: table(&grid, response, floating), corrections, uneven }
    }

    /// Impedances (ohm) between some of the cells, with the floating pads below them: `rows x columns`.
    pub fn between(&self, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
        let correction = |nodes: &[usize]| self.corrections.select_columns(nodes);
        let mut all = correction(rows).transpose() * correction(columns);
        for (mut column, node) in all.column_iter_mut().zip(columns) {
            for (value, row) in column.iter_mut().zip(rows) {
                *value = self.without_pads(*node, *row) - *value;
            }
        }
        all
    }

    /// The lower triangle of the impedances (ohm) between some of the cells and themselves.
    pub fn within(&self, nodes: &[usize]) -> DMatrix<f64> {
        let mut fields = gram(&self.corrections.select_columns(nodes));
        for (column, node) in nodes.iter().enumerate() {
            for (row, other) in nodes.iter().enumerate().skip(column) {
                fields[(row, column)] = self.without_pads(*node, *other) - fields[(row, column)];
            }
        }
        fields
    }

    /// Impedance between two cells of the slab without pads.
    fn without_pads(&self, node: usize, other: usize) -> f64 {
        let even_ohm = self.even(self.grid.indices(node), self.grid.indices(other));
        let place = |node: usize| self.uneven.as_ref().map(|all| &all[node]);
        uneven_ohm(even_ohm, place(node), place(other))
    }

    /// The same of an even slab.
    fn even(&self, [i, j]: [usize; 2], [k, l]: [usize; 2]) -> f64 {
        let [nx, ny] = self.grid.cells;
        let folded = |sum: usize, cells: usize| if sum > cells { 2 * cells - sum } else { sum };
        let (x, y) = ([i.abs_diff(k), folded(i + k, nx)], [j.abs_diff(l), folded(j + l, ny)]);
        let at = |x: usize, y: usize| self.table[x * (ny + 1) + y];
        0.25 * (at(x[0], y[0]) + at(x[0], y[1]) + at(x[1], y[0]) + at(x[1], y[1]))
    }
}

/// The sum over all modes at whole steps of the grid. At these, modes beyond the grid's look like lower ones, to which they are
/// added first.
fn table(grid: &ImageGrid, response: impl Fn(f64) -> f64, floating: f64) -> Vec<f64> {
    let [nx, ny] = grid.cells;
    let area_m2 = grid.size_m[0] * grid.size_m[1];
    let axis = |axis: usize| -> Vec<[f64; 2]> {
        (0..=MODES_PER_CELL * grid.cells[axis])
            .map(|mode| {
                let angle = std::f64::consts::FRAC_PI_2 * mode as f64 / grid.cells[axis] as f64;
                let sinc = if mode == 0 { 1.0 } else { angle.sin() / angle };
                let count = if mode == 0 { 1.0 } else { 2.0 };
                [mode as f64 * std::f64::consts::PI / grid.size_m[axis], count * sinc * sinc]
            })
            .collect()
    };
    let (x, y) = (axis(0), axis(1));
    let mut amplitudes = DMatrix::zeros(nx + 1, ny + 1);
    for (m, [kx, wx]) in x.iter().enumerate() {
        for (n, [ky, wy]) in y.iter().enumerate() {
            let value = if m + n == 0 { floating } else { response(kx.hypot(*ky)) };
            amplitudes[(alias(m, nx), alias(n, ny))] += wx * wy * value / area_m2;
        }
    }
    let values = cosines(nx) * amplitudes * cosines(ny);
    (0..=nx).flat_map(|i| (0..=ny).map(move |j| (i, j))).map(|at| values[at]).collect()
}

/// The mode of at most `cells` half waves that a mode looks like on the nodes.
fn alias(mode: usize, cells: usize) -> usize {
    let within = mode % (2 * cells);
    within.min(2 * cells - within)
}

fn cosines(cells: usize) -> DMatrix<f64> {
    DMatrix::from_fn(cells + 1, cells + 1, |i, m| (std::f64::consts::PI * (i * m) as f64 / cells as f64).cos())
}
