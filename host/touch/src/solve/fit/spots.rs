//! Currents and impedances of a few contacts taken as spots: enough to look where one more would explain most.
//!
//! With the fields of the electrodes at the spots `F` (`K x n`), between spots `N` and a resistance `A` for each spot, which is
//! that of its contact and of the crowded current under it:
//!
//! ```text
//! M = [ N + diag(A)  1 ]    Z = E - [F; 1]^T M^-1 [F; 1]    U = M^-1 [F; 1]
//!     [     1^T      0 ]
//! ```
//!
//! (`forward::contact` with one unknown for each contact.) `U` are the currents that each electrode's ampere makes at the spots.

use nalgebra::{Cholesky, DMatrix};

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::spots::{Spot, SpotFields};

/// A contact as a spot.
#[derive(Clone, Debug, Default)]
pub(crate) struct LoadedSpot {
    /// Where, and the fields there.
    pub spot: Spot,
    /// Resistance of the contact with the crowded current under it (ohm).
    pub ohm: f64,
}

/// The model of contacts as spots: what of it does not depend on the contacts.
#[derive(Clone, Debug)]
pub(crate) struct SpotModel {
    /// Fields between the electrodes (ohm).
    pub electrodes_ohm: DMatrix<f64>,
    pub drive_v: f64,
    pub on_resistance_ohm: f64,
}

/// Currents and impedances of some spots.
#[derive(Clone, Debug)]
pub(crate) struct Solved {
    /// Currents at the spots for 1 A into each electrode, last the constant (ohm): row by row, `(K + 1) x n`.
    pub currents: Vec<f64>,
    /// `Z` (ohm), row by row.
    pub impedance_ohm: Vec<f64>,
    /// `Z[g][g]` with the switch (ohm).
    pub loads_ohm: Vec<f64>,
}

impl SpotModel {
    pub fn new(detector: &Detector, electrodes_ohm: &DMatrix<f64>) -> Self {
        let electrodes_ohm = electrodes_ohm.clone();
        Self { electrodes_ohm, drive_v: detector.drive_v, on_resistance_ohm: detector.on_resistance_ohm }
    }

    pub fn electrodes(&self) -> usize {
        self.electrodes_ohm.nrows()
    }

    /// Solves for some spots; `None` if their fields cannot be those of contacts, as when two are at one place.
    pub fn solve(&self, spots: &[LoadedSpot], fields: &dyn SpotFields) -> Option<Solved> {
        let (count, n) = (spots.len(), self.electrodes());
        let mut matrix = DMatrix::from_diagonal_element(count, count, 0.0);
        for k in 0..count {
            matrix[(k, k)] = spots[k].ohm;
            for l in 0..k {
                let ohm = fields.between_ohm(&spots[l].spot, &spots[k].spot);
                (matrix[(k, l)], matrix[(l, k)]) = (ohm, ohm);
            }
        }
        let factor = Cholesky::new(matrix)?;
        let mut right =
            DMatrix::from_fn(count, n + 1, |k, e| spots[k].spot.electrodes_ohm.get(e).copied().unwrap_or(1.0));
        factor.solve_mut(&mut right);
        let conductance_s: f64 = right.column(n).iter().sum();
        let mut currents = vec![0.0; (count + 1) * n];
        for e in 0..n {
            let constant_ohm = (right.column(e).iter().sum::<f64>() - 1.0) / conductance_s;
            (0..count).for_each(|k| currents[k * n + e] = right[(k, e)] - right[(k, n)] * constant_ohm);
            currents[count * n + e] = constant_ohm;
        }
        let impedance_ohm = self.impedance_ohm(spots, &currents);
        let loads_ohm: Vec<_> = (0..n).map(|g| impedance_ohm[g * n + g] + self.on_resistance_ohm).collect();
        let sound = loads_ohm.iter().all(|ohm| *ohm > 0.0 && ohm.is_finite());
        sound.then_some(Solved { currents, impedance_ohm, loads_ohm })
    }

    fn impedance_ohm(&self, spots: &[LoadedSpot], currents: &[f64]) -> Vec<f64> {
        let n = self.electrodes();
        let constant = &currents[spots.len() * n..];
        let mut all = Vec::with_capacity(n * n);
        for i in 0..n {
            let start = all.len();
            all.extend((0..n).map(|j| self.electrodes_ohm[(j, i)] - constant[j]));
            for (k, spot) in spots.iter().enumerate() {
                let field = spot.spot.electrodes_ohm[i];
                let line = &currents[k * n..(k + 1) * n];
                all[start..].iter_mut().zip(line).for_each(|(ohm, current)| *ohm -= field * current);
            }
        }
        all
    }

    /// Potentials under one more spot that carries no current (ohm), for 1 A into each electrode.
    pub fn potentials_ohm(
        &self,
        solved: &Solved,
        spots: &[LoadedSpot],
        at: &Spot,
        fields: &dyn SpotFields,
    ) -> Vec<f64> {
        let n = self.electrodes();
        let mut potentials: Vec<_> =
            at.electrodes_ohm.iter().zip(&solved.currents[spots.len() * n..]).map(|(ohm, c)| ohm - c).collect();
        for (k, other) in spots.iter().enumerate() {
            let ohm = fields.between_ohm(&other.spot, at);
            let line = &solved.currents[k * n..(k + 1) * n];
            potentials.iter_mut().zip(line).for_each(|(sum, current)| *sum -= ohm * current);
        }
        potentials
    }

    /// Derivative of the readings by the conductance of one more spot (V/S) with such potentials under it.
    pub fn volts_per_s(&self, solved: &Solved, potentials_ohm: &[f64], volts_per_s: &mut [f64]) {
        let n = self.electrodes();
        for (g, row) in volts_per_s.chunks_exact_mut(n).enumerate() {
            let share = potentials_ohm[g] / solved.loads_ohm[g];
            let (per_ohm, own) = (self.drive_v * share, share);
            let z = &solved.impedance_ohm[g * n..(g + 1) * n];
            for ((volts, ohm), z) in row.iter_mut().zip(potentials_ohm).zip(z) {
                *volts = per_ohm * (ohm - z * own);
            }
        }
    }
}
