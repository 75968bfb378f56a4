//! Readings of a few spots, and their derivatives by the spots' places and resistances.
//!
//! With the fields of the electrodes at the spots `F` (`K x n`), between spots `N` and a resistance `A` for each spot, which is
//! that of its contact and of the crowded current under it:
//!
//! ```text
//! M = [ N + diag(A)  1 ]    Z = E - [F; 1]^T M^-1 [F; 1]    U = M^-1 [F; 1]
//!     [     1^T      0 ]
//! ```
//!
//! (`forward::contact` with one unknown for each contact.) Each derivative of `Z` is of rank two, as `dZ = U^T dM U -
//! dF^T U - U^T dF`: all cost less than the readings. `U` are the currents that each electrode's ampere makes at the spots.

use nalgebra::{Cholesky, DMatrix};

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::spots::{Between, Spot, SpotFields};

/// A contact as the fit sees it.
#[derive(Clone, Debug, Default)]
pub(super) struct FitSpot {
    /// Where, and the fields there.
    pub spot: Spot,
    /// Resistance of the contact with the crowded current under it (ohm).
    pub ohm: f64,
}

/// What does not depend on the contacts.
#[derive(Clone, Debug)]
pub(super) struct Network {
    /// Fields between the electrodes (ohm).
    pub electrodes_ohm: DMatrix<f64>,
    pub drive_v: f64,
    pub on_resistance_ohm: f64,
}

/// Currents and impedances of some spots.
#[derive(Clone, Debug)]
pub(super) struct Solved {
    /// Fields between different spots, by first and second with the first below.
    between: Vec<Between>,
    /// Currents at the spots for 1 A into each electrode, last the constant (ohm): row by row, `(K + 1) x n`.
    pub currents: Vec<f64>,
    /// `Z` (ohm), row by row.
    pub impedance_ohm: Vec<f64>,
    /// `Z[g][g]` with the switch (ohm).
    pub loads_ohm: Vec<f64>,
}

impl Network {
    pub fn new(detector: &Detector, electrodes_ohm: &DMatrix<f64>) -> Self {
        let electrodes_ohm = electrodes_ohm.clone();
        Self { electrodes_ohm, drive_v: detector.drive_v, on_resistance_ohm: detector.on_resistance_ohm }
    }

    pub fn electrodes(&self) -> usize {
        self.electrodes_ohm.nrows()
    }

    /// Solves for some spots; `None` if their fields cannot be those of contacts, as when two are at one place.
    pub fn solve(&self, spots: &[FitSpot], fields: &dyn SpotFields) -> Option<Solved> {
        let (count, n) = (spots.len(), self.electrodes());
        let mut matrix = DMatrix::from_diagonal_element(count, count, 0.0);
        let mut between = Vec::with_capacity(count * count.saturating_sub(1) / 2);
        for k in 0..count {
            matrix[(k, k)] = spots[k].ohm;
            for l in 0..k {
                let field = fields.between(&spots[l].spot, &spots[k].spot);
                (matrix[(k, l)], matrix[(l, k)]) = (field.ohm, field.ohm);
                between.push(field);
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
        sound.then_some(Solved { between, currents, impedance_ohm, loads_ohm })
    }

    fn impedance_ohm(&self, spots: &[FitSpot], currents: &[f64]) -> Vec<f64> {
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

    /// Readings of a solution (V), row by row.
    pub fn volts(&self, solved: &Solved) -> Vec<f64> {
        let n = self.electrodes();
        let volts = |g: usize, e: usize| self.drive_v * (1.0 - solved.impedance_ohm[g * n + e] / solved.loads_ohm[g]);
        (0..n * n).map(|i| volts(i / n, i % n)).collect()
    }

    /// Derivatives of the readings: for each spot by its place along both directions (V/m), and by the logarithm of its resistance
    /// (V); each as long as the readings.
    pub fn slopes(&self, spots: &[FitSpot], solved: &Solved) -> Vec<Vec<f64>> {
        let n = self.electrodes();
        let mut all = Vec::with_capacity(3 * spots.len());
        for (k, spot) in spots.iter().enumerate() {
            let current = &solved.currents[k * n..(k + 1) * n];
            for axis in 0..2 {
                let field = self.moved_field(spots, solved, k, axis);
                all.push(self.volts_of(solved, |i, j| -(field[i] * current[j] + current[i] * field[j])));
            }
            all.push(self.volts_of(solved, |i, j| spot.ohm * current[i] * current[j]));
        }
        all
    }

    /// Derivative along a direction of the field that a spot is in (ohm/m), for 1 A into each electrode.
    fn moved_field(&self, spots: &[FitSpot], solved: &Solved, k: usize, axis: usize) -> Vec<f64> {
        let n = self.electrodes();
        let mut field = spots[k].spot.slopes_ohm_per_m[axis].clone();
        for l in (0..spots.len()).filter(|l| *l != k) {
            let between = &solved.between[pair(l.min(k), l.max(k))];
            let slope = if k < l { between.by_first[axis] } else { between.by_second[axis] };
            let line = &solved.currents[l * n..(l + 1) * n];
            field.iter_mut().zip(line).for_each(|(ohm, current)| *ohm -= slope * current);
        }
        field
    }

    /// What a change of `Z` does to the readings.
    fn volts_of(&self, solved: &Solved, change_ohm: impl Fn(usize, usize) -> f64) -> Vec<f64> {
        let n = self.electrodes();
        let mut all = Vec::with_capacity(n * n);
        for g in 0..n {
            let per_ohm = -self.drive_v / solved.loads_ohm[g];
            let own = change_ohm(g, g) / solved.loads_ohm[g];
            let row = &solved.impedance_ohm[g * n..(g + 1) * n];
            all.extend((0..n).map(|e| per_ohm * (change_ohm(g, e) - row[e] * own)));
        }
        all
    }

    /// Potentials under one more spot that carries no current (ohm), for 1 A into each electrode.
    pub fn potentials_ohm(&self, solved: &Solved, spots: &[FitSpot], at: &Spot, fields: &dyn SpotFields) -> Vec<f64> {
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

/// Where two different spots' field is in a list with the first below the second.
fn pair(first: usize, second: usize) -> usize {
    second * (second - 1) / 2 + first
}
