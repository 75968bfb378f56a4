//! A few contacts on a detector as a small circuit: the readings that they give, and how these change with them.
//!
//! Each contact is a [disc](crate::disc) that carries one current, couples of opposed ones along x and along y that a slope of the potential under it drives, and two quadrupoles that its
//! bends drive. With the fields of the electrodes at the contacts `F` (`K x n`), those between contacts `N`, and a resistance `A` for each, of the contact with the current that
//! crowds under it,
//!
//! ```text
//! M = [ N + diag(A)  1 ]    U = M^-1 [F; 1]    Z = E - [F; 1]' U - sum over k of a_k (w_kx w_kx' + w_ky w_ky') + b_k (g_k g_k' + h_k h_k')
//!     [     1'       0 ]    w_kd = dF_k/dx_d - sum over l of dN_kl/dx_d U_l
//! ```
//!
//! `U` are the currents that an electrode's ampere makes at the contacts, `w` the slopes of the potential under them, `g` half of its bend along x less that along y and `h` that along both,
//! `a` (S m2) and `b` (S m4) what moments these drive. Slopes and bends are taken over discs of the moments' own currents, and less what of them the contact's own field makes: half of
//! its slope, and of its bend a quarter, as at a mirror. Without the quadrupoles a firm disc of a third of the electrodes' distance is told as two.
//!
//! The same `w`, over the disc of the current, are the derivatives by a contact's place: `dZ = -(w U_k' + U_k w')`, and by its resistance `dZ = A U_k U_k'` in logarithms.
//! Beside those the couples change: `-(a (dw w' + w dw') + da w w')`, with `dw` from second derivatives of the fields, which are large at walls, where the slope across
//! them vanishes. What `dw` owes to other contacts is left out, and of the quadrupoles all but `db`.
//!
//! A current that crowds at the rim has the fields of an even one on a wider disc. What is fitted is the radius of that disc, the spread.

use crate::detector::Detector;
use crate::lanes::at_once;
use crate::loaded::{Loaded, PerElectrode, Spot};
use crate::real::Real;
use crate::table::{MAX_ELECTRODES, Table};

/// Contacts, with all that the readings follow from.
#[derive(Clone, Debug)]
pub(crate) struct Circuit<T, const K: usize> {
    pub count: usize,
    pub loaded: [Loaded<T>; K],
    /// The constant of each electrode's ampere (ohm).
    pub constant_ohm: PerElectrode<T>,
    /// `Z[g][g]` with the switch (ohm).
    pub loads_ohm: PerElectrode<T>,
    /// Currents that flow for potentials at the contacts besides (S): symmetric.
    pub inverse_s: [[T; K]; K],
    /// Slopes (ohm/m) and bends (ohm/m2) of the field at a contact from another one, by the place of the first.
    pub slopes_ohm_per_m: [[[T; 2]; K]; K],
    bends_ohm_per_m2: [[[T; 2]; K]; K],
    /// Whether it is solved for the contacts that it has, and whether all that only derivatives need is found too.
    pub is_solved: bool,
    is_derived: bool,
}

impl<T: Real, const K: usize> Circuit<T, K> {
    pub const EMPTY: Self = Self {
        count: 0,
        is_solved: false,
        is_derived: false,
        loaded: [Loaded::NONE; K],
        constant_ohm: [T::ZERO; MAX_ELECTRODES],
        loads_ohm: [T::ZERO; MAX_ELECTRODES],
        inverse_s: [[T::ZERO; K]; K],
        slopes_ohm_per_m: [[[T::ZERO; 2]; K]; K],
        bends_ohm_per_m2: [[[T::ZERO; 2]; K]; K],
    };

    /// Solves for some contacts, `K` at most; `false` if their fields cannot be those of contacts, as when two are at one place.
    pub fn solve(&mut self, detector: &Detector<'_, T>, spots: &[Spot<T>]) -> bool {
        self.is_solved = at_once(
            #[inline(always)]
            || self.solve_all(detector, spots),
        );
        self.is_solved
    }

    /// Whether it is solved for these contacts, on some detector.
    pub fn is_solved_for(&self, spots: &[Spot<T>]) -> bool {
        let there = self.loaded.iter().take(self.count).map(|one| &one.spot);
        self.is_solved && there.eq(spots)
    }

    #[inline(always)]
    fn solve_all(&mut self, detector: &Detector<'_, T>, spots: &[Spot<T>]) -> bool {
        (self.count, self.is_derived) = (spots.len().min(K), false);
        for (loaded, spot) in self.loaded.iter_mut().zip(spots) {
            loaded.place(detector, *spot);
        }
        let mut matrix = [[T::ZERO; K]; K];
        for k in 0..self.count {
            for l in 0..k {
                let (ohm, [at_k, at_l], [bends_k, bends_l]) = self.between(detector, k, l);
                (matrix[k][l], matrix[l][k]) = (ohm, ohm);
                (self.slopes_ohm_per_m[k][l], self.slopes_ohm_per_m[l][k]) = (at_k, at_l);
                (self.bends_ohm_per_m2[k][l], self.bends_ohm_per_m2[l][k]) = (bends_k, bends_l);
            }
        }
        for (k, one) in self.loaded.iter_mut().enumerate().take(self.count) {
            one.load(detector);
            matrix[k][k] = one.ohm;
        }
        self.find_currents(detector.table, &matrix) && {
            self.find_slopes(detector.table);
            self.find_loads(detector)
        }
    }

    /// Field between two contacts (ohm), its derivatives by the place of each of both (ohm/m), and its bends there (ohm/m2).
    #[inline(always)]
    fn between(&self, detector: &Detector<'_, T>, k: usize, l: usize) -> (T, [[T; 2]; 2], [[T; 2]; 2]) {
        let (one, other) = (&self.loaded[k], &self.loaded[l]);
        let n = detector.table.electrodes();
        let (mut ohm, mut slopes, mut bends) = detector.by_ways_ohm(one.spot.at_m, other.spot.at_m);
        ohm += other.walls_ohm[n];
        for e in 0..n {
            ohm += other.walls_ohm[e] * one.sample.value[e];
            for d in 0..2 {
                slopes[0][d] += other.walls_ohm[e] * one.sample.slope[d][e];
                slopes[1][d] += one.walls_ohm[e] * other.sample.slope[d][e];
            }
            for (bends, (here, there)) in bends.iter_mut().zip([(one, other), (other, one)]) {
                let of_fields = here.bends(|values| values[e]);
                bends.iter_mut().zip(of_fields).for_each(|(sum, bend)| *sum += there.walls_ohm[e] * bend);
            }
        }
        (ohm, slopes, bends)
    }

    #[inline(always)]
    fn find_currents(&mut self, table: &Table<'_>, matrix: &[[T; K]; K]) -> bool {
        let count = self.count;
        let mut factor = [[T::ZERO; K]; K];
        for i in 0..count {
            for j in 0..=i {
                let sum: T = matrix[i][j] - (0..j).map(|k| factor[i][k] * factor[j][k]).sum::<T>();
                if i != j {
                    factor[i][j] = sum / factor[j][j];
                } else if sum > T::of(1e-3) * matrix[i][i] {
                    factor[i][i] = sum.sqrt();
                } else {
                    return false;
                }
            }
        }
        let solve = |mut right: [T; K]| {
            for i in 0..count {
                let sum: T = (0..i).map(|j| factor[i][j] * right[j]).sum();
                right[i] = (right[i] - sum) / factor[i][i];
            }
            for i in (0..count).rev() {
                let sum: T = (i + 1..count).map(|j| factor[j][i] * right[j]).sum();
                right[i] = (right[i] - sum) / factor[i][i];
            }
            right
        };
        let of_one = solve([T::ONE; K]);
        let conductance_s: T = of_one.iter().copied().take(count).sum();
        if !(conductance_s > T::ZERO && conductance_s.is_finite()) {
            return false;
        }
        for k in 0..count {
            let mut right = [T::ZERO; K];
            right[k] = T::ONE;
            let potential = solve(right);
            let share = of_one[k] / conductance_s;
            (0..count).for_each(|l| self.inverse_s[k][l] = potential[l] - share * of_one[l]);
        }
        for e in 0..table.electrodes() {
            let mut right = [T::ZERO; K];
            (0..count).for_each(|k| right[k] = self.loaded[k].sample.value[e]);
            let of_fields = solve(right);
            let constant_ohm = (of_fields.iter().copied().take(count).sum::<T>() - T::ONE) / conductance_s;
            self.constant_ohm[e] = constant_ohm;
            (0..count).for_each(|k| self.loaded[k].currents[e] = of_fields[k] - of_one[k] * constant_ohm);
        }
        true
    }

    #[inline(always)]
    fn find_slopes(&mut self, table: &Table<'_>) {
        for k in 0..self.count {
            for d in 0..2 {
                for e in 0..table.electrodes() {
                    let others = (0..self.count).filter(|l| *l != k);
                    let by_others: T =
                        others.map(|l| self.slopes_ohm_per_m[k][l][d] * self.loaded[l].currents[e]).sum();
                    self.loaded[k].slopes_ohm_per_m[d][e] = self.loaded[k].sample.slope[d][e] - by_others;
                }
            }
            let n = table.electrodes();
            (0..n).for_each(|e| self.find_bends(n, k, e));
            (0..n).for_each(|e| self.loaded[k].drive(n, e));
        }
    }

    /// Finds all that only derivatives need, once.
    pub fn derive(&mut self, table: &Table<'_>) {
        if core::mem::replace(&mut self.is_derived, true) {
            return;
        }
        let n = table.electrodes();
        at_once(
            #[inline(always)]
            || {
                for k in 0..self.count {
                    self.loaded[k].derive(table.head(), n);
                    self.take_widened(table, k);
                    self.loaded[k].turn(table.head(), n);
                }
            },
        );
    }

    /// Finds what drives the quadrupoles at an electrode.
    #[inline(always)]
    fn find_bends(&mut self, n: usize, k: usize, e: usize) {
        // Of the bend of the contact's own field that of a mirror's is a quarter.
        let quarter = T::of(0.25) * self.loaded[k].currents[e];
        let mut bends = self.loaded[k].bends(|values| values[e] - quarter * values[n]);
        for l in (0..self.count).filter(|l| *l != k) {
            let of_other = self.bends_ohm_per_m2[k][l];
            bends.iter_mut().zip(of_other).for_each(|(sum, bend)| *sum -= bend * self.loaded[l].currents[e]);
        }
        (0..2).for_each(|which| self.loaded[k].bending_ohm_per_m2[which][e] = bends[which]);
    }

    /// Takes what other contacts' currents change of the field at a contact with its radius from what electrodes do.
    #[inline(always)]
    fn take_widened(&mut self, table: &Table<'_>, k: usize) {
        let n = table.electrodes();
        let by_radius_ohm = self.loaded[k].by_radius_ohm;
        for l in (0..self.count).filter(|l| *l != k) {
            let ohm: T = (0..n).map(|e| by_radius_ohm[e] * self.loaded[l].walls_ohm[e]).sum();
            for e in 0..n {
                let current = self.loaded[l].currents[e];
                self.loaded[k].by_radius_ohm[e] -= ohm * current;
            }
        }
    }

    #[inline(always)]
    fn find_loads(&mut self, detector: &Detector<'_, T>) -> bool {
        for g in 0..detector.table.electrodes() {
            let mut ohm = detector.pad_ohm(g) - self.constant_ohm[g] + detector.switch_ohm();
            for one in &self.loaded[..self.count] {
                let square = |two: &[PerElectrode<T>; 2]| two[0][g] * two[0][g] + two[1][g] * two[1][g];
                ohm -= one.sample.value[g] * one.currents[g]
                    + one.moment_s_m2 * square(&one.driving_ohm_per_m)
                    + one.quadrupole_s_m4 * square(&one.bending_ohm_per_m2);
            }
            if !(ohm > T::ZERO && ohm.is_finite()) {
                return false;
            }
            self.loads_ohm[g] = ohm;
        }
        true
    }

    /// What is there to be read while an electrode is grounded (V).
    #[inline(always)]
    pub fn row_v(&self, detector: &Detector<'_, T>, g: usize, volts: &mut [T]) {
        let volts = &mut volts[..detector.table.electrodes()];
        let pads_ohm = detector.pads_ohm(g);
        let own_ohm = pads_ohm[g] + detector.switch_ohm();
        volts.iter_mut().zip(&pads_ohm).for_each(|(volts, ohm)| *volts = own_ohm - *ohm);
        for one in &self.loaded[..self.count] {
            let [driving, bending] = [&one.driving_ohm_per_m, &one.bending_ohm_per_m2];
            let two = |two: &[PerElectrode<T>; 2], per: T| [per * two[0][g], per * two[1][g]];
            let (by_slopes, by_bends) = (two(driving, one.moment_s_m2), two(bending, one.quadrupole_s_m4));
            // Differences, so that the resistance of a light contact, thousands of times as much, does not take their digits.
            for (e, volts) in volts.iter_mut().enumerate() {
                let less = |values: &PerElectrode<T>| values[g] - values[e];
                *volts -= one.currents[g] * (one.sample.value[g] - one.sample.value[e])
                    + by_slopes[0] * less(&driving[0])
                    + by_slopes[1] * less(&driving[1])
                    + by_bends[0] * less(&bending[0])
                    + by_bends[1] * less(&bending[1]);
            }
        }
        let per_ohm = T::of(detector.table.head().drive_v) / self.loads_ohm[g];
        volts.iter_mut().for_each(|volts| *volts *= per_ohm);
    }

    /// Potentials under a place without a contact, for 1 A into each electrode (ohm), from the fields there.
    #[inline(always)]
    pub fn potentials_ohm(
        &self,
        detector: &Detector<'_, T>,
        at_m: [T; 2],
        fields_ohm: &PerElectrode<T>,
        all_ohm: &mut PerElectrode<T>,
    ) {
        let n = detector.table.electrodes();
        for e in 0..n {
            all_ohm[e] = fields_ohm[e] - self.constant_ohm[e];
        }
        for one in &self.loaded[..self.count] {
            let by_walls: T = (0..n).map(|e| one.walls_ohm[e] * fields_ohm[e]).sum();
            let ohm = detector.rough_by_ways_ohm(at_m, one.spot.at_m) + by_walls + one.walls_ohm[n];
            (0..n).for_each(|e| all_ohm[e] -= ohm * one.currents[e]);
        }
    }
}
