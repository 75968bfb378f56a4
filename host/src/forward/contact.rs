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

use nalgebra::{Cholesky, DMatrix, DVector};

/// Contact unknowns of a detector, in any basis and any scaling of its unknowns.
#[derive(Clone, Debug)]
pub struct ContactSystem {
    /// Fields between the electrodes (ohm): `n x n`.
    pub electrodes: DMatrix<f64>,
    /// Fields of the unknowns at the electrodes: `K x n`.
    pub cross: DMatrix<f64>,
    /// Fields between the unknowns, with the resistance of the contacts: `K x K`, symmetric, positive definite.
    pub contacts: DMatrix<f64>,
    /// Current to the driving layer that one unit of each unknown carries: `K`.
    pub current: DVector<f64>,
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

impl ContactSystem {
    /// Solves the bordered system by the Cholesky factor of its large block; `None` if that is not positive definite or no
    /// unknown carries current.
    pub fn solve(&self) -> Option<Contacted> {
        let factor = Cholesky::new(self.contacts.clone())?;
        let response = factor.solve(&self.cross);
        let unit = factor.solve(&self.current);
        let conductance = self.current.dot(&unit);
        if !(conductance.is_finite() && conductance > 0.0) {
            return None;
        }
        // What of each electrode's ampere the contacts do not take up while their potential is held at the bare one.
        let missing = DVector::from_element(self.electrodes.nrows(), 1.0) - response.tr_mul(&self.current);
        let constant_ohm = &missing / conductance;
        let impedance_ohm =
            &self.electrodes - self.cross.tr_mul(&response) + &missing * missing.transpose() / conductance;
        let unknowns = -response - unit * constant_ohm.transpose();
        Some(Contacted { impedance_ohm, unknowns, constant_ohm })
    }
}

/// A bare detector seen from its electrodes and from patches of its surface, in any gauge common to all three.
#[derive(Clone, Debug)]
pub struct PatchFields {
    /// Between electrodes (ohm): `n x n`.
    pub electrodes: DMatrix<f64>,
    /// Of the electrodes at the patches (ohm): `K x n`.
    pub cross: DMatrix<f64>,
    /// Between patches, mean over each patch (ohm): `K x K`.
    pub patches: DMatrix<f64>,
}

/// Impedance of a detector with conducting patches, and what its derivative is made of.
#[derive(Clone, Debug)]
pub struct PatchImpedance {
    /// Between electrodes (ohm): `n x n`.
    pub impedance_ohm: DMatrix<f64>,
    /// From electrodes to patches (ohm): `K x n`, the potential of the detector under each patch for 1 A into each electrode.
    pub patch_impedance_ohm: DMatrix<f64>,
}

impl PatchFields {
    /// Impedance for contact conductances of the patches (S); zero is allowed. `None` if none conducts.
    pub fn impedance(&self, conductance_s: &[f64]) -> Option<PatchImpedance> {
        // Scaled by the square roots on both sides, N + diag(1/C) becomes a matrix that a small C leaves well conditioned.
        let scale = DVector::from_iterator(conductance_s.len(), conductance_s.iter().map(|c| c.sqrt()));
        let mut contacts =
            DMatrix::from_fn(scale.len(), scale.len(), |i, j| scale[i] * self.patches[(i, j)] * scale[j]);
        for i in 0..scale.len() {
            contacts[(i, i)] += 1.0;
        }
        let cross = DMatrix::from_fn(scale.len(), self.cross.ncols(), |i, e| scale[i] * self.cross[(i, e)]);
        let system = ContactSystem { electrodes: self.electrodes.clone(), cross, contacts, current: scale.clone() };
        let solved = system.solve()?;
        let mut currents = solved.unknowns;
        currents.row_iter_mut().zip(scale.iter()).for_each(|(mut row, &scale)| row *= scale);
        let mut potentials = &self.cross + &self.patches * currents;
        potentials
            .column_iter_mut()
            .zip(solved.constant_ohm.iter())
            .for_each(|(mut column, c)| column.add_scalar_mut(*c));
        Some(PatchImpedance { impedance_ohm: solved.impedance_ohm, patch_impedance_ohm: potentials })
    }
}

impl PatchImpedance {
    /// Derivative of the impedance by the conductance of patch `k` (ohm per S): `dZ[e][g] / dC_k = -Z[e][k] Z[k][g]`.
    ///
    /// # Panics
    /// If there is no patch `k`.
    pub fn derivative(&self, k: usize) -> DMatrix<f64> {
        let row = self.patch_impedance_ohm.row(k);
        -(row.transpose() * row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two electrodes and two patches joined to one node by 1, 2, 3 and 4 ohm: every field is a plain sum.
    fn star() -> PatchFields {
        PatchFields {
            electrodes: DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 2.0]),
            cross: DMatrix::zeros(2, 2),
            patches: DMatrix::from_row_slice(2, 2, &[3.0, 0.0, 0.0, 4.0]),
        }
    }

    #[test]
    fn a_star_of_resistors_has_its_textbook_impedance() {
        let z = star().impedance(&[1.0, 0.5]).unwrap().impedance_ohm;
        let to_drive = 1.0 / (1.0 / (3.0 + 1.0) + 1.0 / (4.0 + 2.0));
        let expected = DMatrix::from_row_slice(2, 2, &[1.0 + to_drive, to_drive, to_drive, 2.0 + to_drive]);
        assert!((z - expected).amax() < 1e-12);
    }

    #[test]
    fn the_gauge_of_the_fields_does_not_matter() {
        let (plain, mut shifted) = (star(), star());
        shifted.electrodes.add_scalar_mut(7.0);
        shifted.cross.add_scalar_mut(7.0);
        shifted.patches.add_scalar_mut(7.0);
        let [a, b] = [plain, shifted].map(|fields| fields.impedance(&[0.3, 2e-6]).unwrap());
        assert!((a.impedance_ohm - b.impedance_ohm).amax() < 1e-11);
        assert!((a.patch_impedance_ohm - b.patch_impedance_ohm).amax() < 1e-11);
    }

    #[test]
    fn the_derivative_is_that_of_a_small_step_at_zero_conductance_too() {
        let fields = star();
        for (k, conductance) in [(0, [0.4, 0.2]), (1, [0.4, 0.0])] {
            let mut stepped = conductance;
            stepped[k] += 1e-8;
            let [at, beyond] = [conductance, stepped].map(|c| fields.impedance(&c).unwrap());
            let step = (beyond.impedance_ohm - &at.impedance_ohm) / 1e-8;
            assert!((step - at.derivative(k)).amax() < 1e-4, "patch {k}");
        }
    }

    #[test]
    fn without_a_conducting_patch_there_is_no_impedance() {
        assert!(star().impedance(&[0.0, 0.0]).is_none());
    }
}
