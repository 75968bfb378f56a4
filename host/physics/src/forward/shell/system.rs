//! The sparse equations of the shell: linear elements, pads by the complete electrode model.
//!
//! Unknowns: the potential at each node, then of each pad. With sheet conductance `s` and contact impedance `z`, the energy is
//! `1/2 int s |grad phi|^2 + 1/2 sum_pads int_pad (phi - U)^2 / z`, hence a symmetric matrix whose only null vector is the constant.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::inverse::Inverse;
use super::mesh::Mesh;
use crate::algebra::{self, NotPositive, Plan};
use crate::geometry::cross;

/// The matrix of a bare, floating detector, and the plan of its factorisation.
pub struct System {
    nodes: usize,
    pads: usize,
    plan: Arc<Plan>,
    /// Elements of the matrix, those of the diagonal first, a zero for each unknown.
    values: Vec<f64>,
}

/// A factorised system: potentials for currents.
pub struct Factor {
    nodes: usize,
    factor: algebra::Factor,
}

impl System {
    /// Assembles the matrix; `sheet_s` gives the sheet conductance (S) of a triangle, `pad_impedance_ohm_m2`
    /// that of each pad.
    pub fn new(mesh: &Mesh, sheet_s: impl Fn([u32; 3]) -> f64, pad_impedance_ohm_m2: &[f64]) -> Self {
        let (nodes, pads) = (mesh.nodes_m.len(), mesh.pad_triangles.len());
        let mut entries: Vec<Entry> = (0..(nodes + pads) as u32).map(|unknown| ([unknown; 2], 0.0)).collect();
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
        let (places, values): (Vec<_>, _) = entries.into_iter().unzip();
        Self { nodes, pads, plan: Plan::new(nodes + pads, &places), values }
    }

    /// Factorises the matrix with conductances to ground (S) added to some unknowns: nodes first, then pads.
    pub fn factorise(&self, to_ground_s: impl IntoIterator<Item = (usize, f64)>) -> Result<Factor, NotPositive> {
        let mut values = self.values.clone();
        to_ground_s.into_iter().for_each(|(unknown, conductance_s)| values[unknown] += conductance_s);
        Ok(Factor { nodes: self.nodes, factor: self.plan.factorise(&values)? })
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
    pub fn solve(&self, mut currents_a: DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        self.factor.solve(&mut currents_a);
        let pads = currents_a.nrows() - self.nodes;
        (currents_a.rows(0, self.nodes).into_owned(), currents_a.rows(self.nodes, pads).into_owned())
    }

    /// Elements of the inverse.
    pub fn inverse(self) -> Inverse {
        Inverse::new(self.factor)
    }
}

/// An element of the matrix, of one of both triangles: where it is, and its value.
type Entry = ([u32; 2], f64);

fn add(entries: &mut Vec<Entry>, i: u32, j: u32, value: f64) {
    entries.push(([i, j], value));
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
