//! The sparse equations of the shell: linear elements, pads by the complete electrode model.
//!
//! Unknowns: the potential at each node, then of each pad. With sheet conductance `s` and contact impedance `z`, the energy is
//! `1/2 int s |grad phi|^2 + 1/2 sum_pads int_pad (phi - U)^2 / z`, hence a symmetric matrix whose only null vector is the constant.

use faer::Side;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use nalgebra::DMatrix;

use super::inverse::{Inverse, Singular};
use super::mesh::Mesh;
use crate::geometry::cross;

/// The matrix of a bare, floating detector, and the plan of its factorisation.
pub struct System {
    nodes: usize,
    pads: usize,
    matrix: SparseColMat<u32, f64>,
    /// Where each unknown's diagonal element is among the matrix's values.
    diagonal: Vec<usize>,
    symbolic: SymbolicLlt<u32>,
}

/// A factorised system: potentials for currents.
pub struct Factor {
    nodes: usize,
    factor: Llt<u32, f64>,
}

impl System {
    /// Assembles the matrix; `sheet_s` gives the sheet conductance (S) of a triangle, `pad_impedance_ohm_m2`
    /// that of each pad.
    pub fn new(mesh: &Mesh, sheet_s: impl Fn([u32; 3]) -> f64, pad_impedance_ohm_m2: &[f64]) -> Result<Self, Singular> {
        let (nodes, pads) = (mesh.nodes_m.len(), mesh.pad_triangles.len());
        let mut entries = Vec::with_capacity(7 * mesh.triangles.len());
        for &triangle in &mesh.triangles {
            add_sheet(&mut entries, triangle, mesh.corners(triangle), sheet_s(triangle));
        }
        for (pad, range) in mesh.pad_triangles.iter().enumerate() {
            for &triangle in &mesh.triangles[range.clone()] {
                let [a, b, c] = mesh.corners(triangle);
                let conductance_s = cross(a, b, c) / 2.0 / pad_impedance_ohm_m2[pad];
                add_pad(&mut entries, triangle, (nodes + pad) as u32, conductance_s);
            }
        }
        let (matrix, diagonal) = compress(entries, nodes + pads);
        let symbolic = SymbolicLlt::try_new(matrix.symbolic(), Side::Lower).map_err(|_| Singular)?;
        Ok(Self { nodes, pads, matrix, diagonal, symbolic })
    }

    /// Factorises the matrix with conductances to ground (S) added to some unknowns: nodes first, then pads.
    pub fn factorise(&self, to_ground_s: impl IntoIterator<Item = (usize, f64)>) -> Result<Factor, Singular> {
        let mut matrix = self.matrix.clone();
        let values = matrix.val_mut();
        for (unknown, conductance_s) in to_ground_s {
            values[self.diagonal[unknown]] += conductance_s;
        }
        let factor =
            Llt::try_new_with_symbolic(self.symbolic.clone(), matrix.as_ref(), Side::Lower).map_err(|_| Singular)?;
        Ok(Factor { nodes: self.nodes, factor })
    }

    /// Elements of the matrix's inverse, with a conductance to ground (S) added to one unknown.
    pub fn inverse(&self, (unknown, conductance_s): (usize, f64)) -> Result<Inverse, Singular> {
        let mut matrix = self.matrix.clone();
        matrix.val_mut()[self.diagonal[unknown]] += conductance_s;
        Inverse::new(matrix.as_ref())
    }

    /// Number of the unknown that is a pad's potential.
    pub fn pad(&self, pad: usize) -> usize {
        self.nodes + pad
    }

    /// Number of pads.
    pub fn pads(&self) -> usize {
        self.pads
    }
}

impl Factor {
    /// Potentials at nodes (`nodes x columns`) and at pads (`pads x columns`) for the currents in each column of
    /// `currents_a` (`nodes + pads` rows).
    pub fn solve(&self, mut currents_a: faer::Mat<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        self.factor.solve_in_place(&mut currents_a);
        let (nodes, columns) = (self.nodes, currents_a.ncols());
        let pads = currents_a.nrows() - nodes;
        (
            DMatrix::from_fn(nodes, columns, |i, j| currents_a[(i, j)]),
            DMatrix::from_fn(pads, columns, |i, j| currents_a[(nodes + i, j)]),
        )
    }
}

/// An element of the lower triangle: column, row, value.
type Entry = (u32, u32, f64);

fn add(entries: &mut Vec<Entry>, i: u32, j: u32, value: f64) {
    entries.push((i.min(j), i.max(j), value));
}

/// Adds a triangle's `s int grad phi_i . grad phi_j`: the gradient of a linear shape function is its opposite edge, turned.
fn add_sheet(entries: &mut Vec<Entry>, nodes: [u32; 3], corners: [[f64; 2]; 3], sheet_conductance_s: f64) {
    let [a, b, c] = corners;
    let opposite = [[c[0] - b[0], c[1] - b[1]], [a[0] - c[0], a[1] - c[1]], [b[0] - a[0], b[1] - a[1]]];
    let scale = sheet_conductance_s / (2.0 * cross(a, b, c));
    for i in 0..3 {
        for j in 0..=i {
            let dot = opposite[i][0] * opposite[j][0] + opposite[i][1] * opposite[j][1];
            add(entries, nodes[i], nodes[j], scale * dot);
        }
    }
}

/// Adds a triangle's `int (phi_i - U)(phi_j - U) / z`; `conductance_s` is its area over the contact impedance.
fn add_pad(entries: &mut Vec<Entry>, nodes: [u32; 3], pad: u32, conductance_s: f64) {
    for i in 0..3 {
        for j in 0..=i {
            let share = if i == j { 1.0 / 6.0 } else { 1.0 / 12.0 };
            add(entries, nodes[i], nodes[j], share * conductance_s);
        }
        add(entries, nodes[i], pad, -conductance_s / 3.0);
    }
    add(entries, pad, pad, conductance_s);
}

/// Sums elements at equal places into a compressed lower triangle; also where its diagonal is.
fn compress(entries: Vec<Entry>, unknowns: usize) -> (SparseColMat<u32, f64>, Vec<usize>) {
    let mut columns = vec![0usize; unknowns + 1];
    for &(column, ..) in &entries {
        columns[column as usize + 1] += 1;
    }
    for column in 0..unknowns {
        columns[column + 1] += columns[column];
    }
    let mut sorted = vec![(0u32, 0.0); entries.len()];
    let mut next = columns.clone();
    for (column, row, value) in entries {
        sorted[next[column as usize]] = (row, value);
        next[column as usize] += 1;
    }
    let (mut starts, mut rows, mut values) = (vec![0u32], Vec::new(), Vec::new());
    let mut diagonal = Vec::with_capacity(unknowns);
    for column in 0..unknowns {
        let part = &mut sorted[columns[column]..columns[column + 1]];
        part.sort_unstable_by_key(|&(row, _)| row);
        diagonal.push(rows.len());
        for same in part.chunk_by(|a, b| a.0 == b.0) {
            rows.push(same[0].0);
            values.push(same.iter().map(|&(_, value)| value).sum());
        }
        starts.push(rows.len() as u32);
    }
    let pattern = SymbolicSparseColMat::new_checked(unknowns, unknowns, starts, None, rows);
    (SparseColMat::new(pattern, values), diagonal)
}
