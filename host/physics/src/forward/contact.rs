//! Contact physics: from the fields of a bare detector and the contacts on it to its impedance matrix.
//!
//! A bare detector floats, so its potentials are known up to a constant. Contacts carry currents `J` to the driving layer,
//! which is the reference. Per unit current into an electrode:
//!
//! ```text
//! [ N_SS + diag(1/C)   1 ] [ J  ]   [ -N_Se ]
//! [      1^T           0 ] [ c0 ] = [  -1   ]
//! ```
//!
//! with `c0` the constant. Nothing here knows where the fields come from: triangles, modes or a measurement.
//!
//! Where the layers touch lightly everywhere, the fields are those of a detector that leaks, and only the mean potential is still open. In
//! the gauge in which the fields' mean under the driving layer is zero, `c0` is that mean, and `-G` with the total conductance `G` of the leak
//! takes the place of the zero.

use nalgebra::{DMatrix, DVector};

use crate::algebra::{Cholesky, gram_of_rows};
use crate::detector::Detector;

/// Contact unknowns of a detector, in any basis and any scaling of its unknowns.
#[derive(Clone, Debug)]
pub struct ContactSystem<'a> {
    /// Fields between the electrodes (ohm): `n x n`.
    pub electrodes: &'a DMatrix<f64>,
    /// Fields between the unknowns, with the resistance of the contacts: `K x K`, symmetric, positive definite; only its lower
    /// triangle is used.
    pub contacts: DMatrix<f64>,
    /// Fields of the unknowns at the electrodes, and the current to the driving layer that one unit of each carries:
    /// `(n + 1) x K`.
    pub cross_and_current: DMatrix<f64>,
    /// Conductance that is spread evenly over the whole surface (S), and of which the fields know already; zero if there is none.
    pub leak_s: f64,
}

/// What a [`ContactSystem`] gives.
#[derive(Clone, Debug)]
pub struct Contacted {
    /// Impedance matrix (ohm): `n x n`, driving layer as reference.
    pub impedance_ohm: DMatrix<f64>,
    /// The unknowns for 1 A into each electrode: `K x n`.
    pub unknowns: DMatrix<f64>,
    /// The constant that takes the bare detector's potentials to the driving layer's reference (ohm): `n`.
    pub constant_ohm: DVector<f64>,
}

impl ContactSystem<'_> {
    /// The impedance matrix (ohm) by the Cholesky factor `L` of the large block; `None` if that is not positive definite or nothing
    /// leads to the driving layer.
    pub fn impedance_ohm(self) -> Option<DMatrix<f64>> {
        Some(self.eliminate()?.impedance_ohm)
    }

    /// The impedance matrix and the unknowns; `None` as for [`impedance_ohm`](Self::impedance_ohm).
    pub fn solve(self) -> Option<Contacted> {
        let Eliminated { factor, mut rows, impedance_ohm, constant_ohm } = self.eliminate()?;
        factor.backward(&mut rows);
        let unit = constant_ohm.len();
        let unknowns = DMatrix::from_fn(rows.ncols(), unit, |k, e| -rows[(e, k)] - rows[(unit, k)] * constant_ohm[e]);
        Some(Contacted { impedance_ohm, unknowns, constant_ohm })
    }

    /// Impedances and the potentials under patches whose unknowns are currents over the roots of their conductances (S), as
    /// [`conducting_patches`] makes them: by Ohm's law at each. `None` as for [`impedance_ohm`](Self::impedance_ohm).
    pub fn fields(self, conductance_s: &[f64]) -> Option<ContactFields> {
        let Contacted { impedance_ohm, unknowns: mut nodes_ohm, .. } = self.solve()?;
        nodes_ohm.row_iter_mut().zip(conductance_s).for_each(|(mut row, s)| row /= -s.sqrt());
        Some(ContactFields { impedance_ohm, nodes_ohm })
    }

    /// Factorises; gives impedances and constants.
    fn eliminate(self) -> Option<Eliminated> {
        let electrodes = self.electrodes.nrows();
        let (factor, mut rows) = (Cholesky::new(self.contacts).ok()?, self.cross_and_current);
        factor.forward(0, &mut rows);
        let products = gram_of_rows(&rows);
        let conductance = products[(electrodes, electrodes)] + self.leak_s;
        if !(conductance.is_finite() && conductance > 0.0) {
            return None;
        }
        // What of each electrode's ampere the contacts do not take up while their potential is held at the bare one.
        let missing = DVector::from_fn(electrodes, |e, _| 1.0 - products[(electrodes, e)]);
        let constant_ohm = &missing / conductance;
        let impedance_ohm = DMatrix::from_fn(electrodes, electrodes, |i, j| {
            self.electrodes[(i, j)] - products[(i.max(j), i.min(j))] + missing[i] * constant_ohm[j]
        });
        Some(Eliminated { factor, rows, impedance_ohm, constant_ohm })
    }
}

/// A system whose unknowns are eliminated.
struct Eliminated {
    factor: Cholesky,
    /// `L^-1` times each right side, as a row.
    rows: DMatrix<f64>,
    impedance_ohm: DMatrix<f64>,
    constant_ohm: DVector<f64>,
}

/// The system of patches of surface that conduct (S, above zero), from the fields between them in any common gauge: between
/// electrodes (`n x n`), of the electrodes at the patches (`K x n`) and between patches, mean over each (`K x K`).
///
/// Its unknowns are currents divided by the square roots of the conductances: so `N + diag(1/C)` becomes a matrix that a small
/// `C` leaves well conditioned.
pub fn conducting_patches<'a>(
    electrodes: &'a DMatrix<f64>,
    cross: &DMatrix<f64>,
    mut patches: DMatrix<f64>,
    conductance_s: &[f64],
) -> ContactSystem<'a> {
    let scale = DVector::from_iterator(conductance_s.len(), conductance_s.iter().map(|c| c.sqrt()));
    for (mut column, scale_j) in patches.column_iter_mut().zip(scale.iter()) {
        column.zip_apply(&scale, |value, scale_i| *value *= scale_i * scale_j);
    }
    for i in 0..scale.len() {
        patches[(i, i)] += 1.0;
    }
    let current = cross.ncols();
    let cross_and_current =
        DMatrix::from_fn(current + 1, scale.len(), |e, k| scale[k] * if e == current { 1.0 } else { cross[(k, e)] });
    ContactSystem { electrodes, contacts: patches, cross_and_current, leak_s: 0.0 }
}

/// Potentials for 1 A into each electrode while contacts lead it off to the driving layer.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactFields {
    /// At the electrodes (ohm): the impedance matrix `Z`, `electrodes x electrodes`.
    pub impedance_ohm: DMatrix<f64>,
    /// Under the nodes of the image, or those of them that conduct (ohm): `nodes x electrodes`.
    pub nodes_ohm: DMatrix<f64>,
}

impl ContactFields {
    /// Those of the nodes of an image (S) that conduct, in their order.
    pub(super) fn of_touched(self, image_s: &[f64]) -> Self {
        let touched: Vec<_> = (0..image_s.len()).filter(|node| image_s[*node] > 0.0).collect();
        Self { nodes_ohm: self.nodes_ohm.select_rows(&touched), ..self }
    }

    /// Derivative of the impedance by the conductance of a node (ohm per S): `dZ[e][g] / dC[k] = -Z[e][k] Z[k][g]`.
    ///
    /// # Panics
    /// If there is no such electrode or node.
    pub fn ohm_per_s(&self, e: usize, g: usize, node: usize) -> f64 {
        -self.nodes_ohm[(node, e)] * self.nodes_ohm[(node, g)]
    }

    /// Jacobian of the readings of `detector` at these contacts (V/S): row `g * electrodes + e`, a column for each node.
    ///
    /// With `h = Z[k][g] / (Z[g][g] + R_on)`, `dV[g][e] / dC[k] = Vcc h (Z[k][e] - Z[e][g] h)`.
    pub fn readings_jacobian_v_per_s(&self, detector: &Detector) -> DMatrix<f64> {
        let (nodes, electrodes) = self.nodes_ohm.shape();
        let mut jacobian = DMatrix::zeros(electrodes * electrodes, nodes);
        for (node, mut column) in jacobian.column_iter_mut().enumerate() {
            let at_node = self.nodes_ohm.row(node);
            for g in 0..electrodes {
                let share = at_node[g] / (self.impedance_ohm[(g, g)] + detector.on_resistance_ohm);
                for e in 0..electrodes {
                    column[g * electrodes + e] =
                        detector.drive_v * share * (at_node[e] - self.impedance_ohm[(e, g)] * share);
                }
            }
        }
        jacobian
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forward::readings_v;

    /// Fields of two electrodes and two patches joined to one node by 1, 2, 3 and 4 ohm: plain sums, in a gauge.
    fn star(conductance_s: [f64; 2], gauge_ohm: f64) -> Option<Contacted> {
        let diagonal = |a: f64, b: f64| DMatrix::from_row_slice(2, 2, &[a, 0.0, 0.0, b]).add_scalar(gauge_ohm);
        let mut found =
            conducting_patches(&diagonal(1.0, 2.0), &diagonal(0.0, 0.0), diagonal(3.0, 4.0), &conductance_s).solve()?;
        found.unknowns.row_iter_mut().zip(conductance_s).for_each(|(mut row, s)| row *= s.sqrt());
        Some(found)
    }

    #[test]
    fn a_star_of_resistors_has_its_textbook_impedance() {
        let found = star([1.0, 0.5], 0.0).unwrap();
        let branches = [1.0 / (3.0 + 1.0), 1.0 / (4.0 + 2.0)];
        let to_drive = 1.0 / (branches[0] + branches[1]);
        let expected = DMatrix::from_row_slice(2, 2, &[1.0 + to_drive, to_drive, to_drive, 2.0 + to_drive]);
        assert!((found.impedance_ohm - expected).amax() < 1e-12);
        let currents = DMatrix::from_fn(2, 2, |patch, _| -branches[patch] * to_drive);
        assert!((found.unknowns - currents).amax() < 1e-12);
    }

    #[test]
    fn the_gauge_of_the_fields_does_not_matter() {
        let [a, b] = [0.0, 7.0].map(|gauge_ohm| star([0.3, 2e-6], gauge_ohm).unwrap());
        assert!((a.impedance_ohm - b.impedance_ohm).amax() < 1e-11);
        assert!((a.unknowns - b.unknowns).amax() < 1e-11);
    }

    #[test]
    fn the_readings_follow_their_jacobian() {
        let mut detector = Detector::preset(Detector::DEFAULT).unwrap();
        detector.on_resistance_ohm = 0.7;
        let conductance_s = [0.4, 0.2];
        let at = star(conductance_s, 0.0).unwrap();
        // Contact: the current into the detector is minus the conductance times the potential.
        let nodes_ohm = DMatrix::from_fn(2, 2, |k, e| -at.unknowns[(k, e)] / conductance_s[k]);
        let fields = ContactFields { impedance_ohm: at.impedance_ohm, nodes_ohm };
        let jacobian = fields.readings_jacobian_v_per_s(&detector);
        for k in 0..2 {
            let mut stepped_s = conductance_s;
            stepped_s[k] += 1e-7;
            let stepped = star(stepped_s, 0.0).unwrap().impedance_ohm;
            let [before, after] = [&fields.impedance_ohm, &stepped].map(|z| readings_v(z, &detector));
            for (g, e) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let step = (after.at(g, e) - before.at(g, e)) / 1e-7;
                assert!((step - jacobian[(2 * g + e, k)]).abs() < 1e-5, "patch {k}, ground {g}, electrode {e}");
                let step = (stepped[(e, g)] - fields.impedance_ohm[(e, g)]) / 1e-7;
                assert!((step - fields.ohm_per_s(e, g, k)).abs() < 1e-5, "patch {k}, ground {g}, electrode {e}");
            }
        }
    }
}
