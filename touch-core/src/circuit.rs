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

use crate::answer::Contact;
use crate::disc::Disc;
use crate::fields::Sample;
use crate::head::Head;
use crate::lanes::at_once;
use crate::real::Real;
use crate::table::{LEAST_SHARE, MAX_ELECTRODES, Table};
use crate::unknown::Detector;
use crate::vector::PARAMETERS;

/// Error of a contact's own field, as a share of that of even current: of firm discs in random scenes on `square-60` and `display-140x70`, found with the radius to
/// 8 %, it is 0.02 in the middle.
const OWN_ERROR: f32 = 0.03;
/// Square of the radius of the disc over which bends are taken, in those of the spread: between that of couples, 0.6 to 0.67, and that of quadrupoles, 0.43 to 0.5.
pub(crate) const BENT: f32 = 0.55;
/// Share of a number by which it is changed for a derivative.
const STEP: f32 = 0.01;
/// Changes of what drives the couples of currents: of its two parts by a place's two and by the radius, less one that two have in common.
pub(crate) const TURNED: usize = 5;
/// Smallest resistance of a contact with its own field, in those of even current: with less, fields are no longer those of contacts.
const LEAST_OHM: f32 = 0.8;

/// What is fitted of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Spot<T> {
    /// Where (m).
    pub at_m: [T; 2],
    /// Logarithm of its resistance with that of the crowded current (ohm).
    pub ln_ohm: T,
    /// Logarithm of its spread over the usual radius: the radius of the disc of even current whose fields it has.
    pub ln_radius: T,
}

impl<T: Real> Spot<T> {
    /// None.
    pub const NONE: Self = Self { at_m: [T::ZERO; 2], ln_ohm: T::ZERO, ln_radius: T::ZERO };

    /// About what is fitted of a contact: as if its current were even.
    pub fn of(contact: &Contact<T>, table: &Table<'_>) -> Self {
        let at_m = [contact.x_m, contact.y_m];
        let mut sample = Sample::NONE;
        table.sample(at_m, T::ZERO, T::ZERO, &mut sample);
        let own_ohm = sample.value[table.electrodes()] + table.head().even_ohm(contact.radius_m);
        let ln_radius = (contact.radius_m / T::of(table.head().radius_m)).ln();
        Self { at_m, ln_ohm: (own_ohm + T::ONE / contact.conductance_s).ln(), ln_radius }
    }
}

/// A vector over electrodes.
pub(crate) type PerElectrode<T> = [T; MAX_ELECTRODES];

/// One contact in the circuit.
#[derive(Clone, Debug)]
pub(crate) struct Loaded<T> {
    pub spot: Spot<T>,
    /// Of its place. Once derived, what turns its slopes is, of electrodes, the moment times the derivatives of what drives the couples: of that along x by x,
    /// by y (or of that along y by x), of that along y by y, in usual radii; then of both by the radius' logarithm.
    pub sample: Sample<T>,
    /// Once derived: derivatives by the logarithm of the radius of the electrodes' fields and of what currents make of them (ohm).
    pub by_radius_ohm: PerElectrode<T>,
    /// Fields of the electrodes at its place on the detector as its table says, and `Q b` of them (ohm).
    pub described_ohm: PerElectrode<T>,
    pub walls_ohm: [T; MAX_ELECTRODES + 1],
    /// Resistance with that of the crowded current (ohm).
    pub ohm: T,
    /// Part of it that is on the detector.
    pub share: T,
    /// Its radius (m).
    pub radius_m: T,
    /// Resistance without that of the crowded current (ohm).
    rest_ohm: T,
    /// Own field of a disc of even current of its radius on a deep layer (ohm).
    even_ohm: T,
    /// Change of the way from the small to the wide disc with the logarithm of the spread.
    per_ln_radius: T,
    /// Couple of currents that a slope of potential drives (S m2), and quadrupole that a bend does (S m4).
    pub moment_s_m2: T,
    pub quadrupole_s_m4: T,
    /// Once derived: its derivative by the contact's own field (S m2/ohm).
    pub moment_by_own: T,
    /// Once derived: half of their derivatives by the parameters.
    pub half_moment_by: [T; PARAMETERS],
    pub half_quadrupole_by: [T; PARAMETERS],
    /// How far the slopes that drive couples are from those of the spread's disc to the wide one's, and what of a change of the spread they change.
    driving_wide: T,
    pub driving_share: T,
    /// Currents for 1 A into each electrode.
    pub currents: PerElectrode<T>,
    /// Slopes of the potential along x and y (ohm/m), likewise.
    pub slopes_ohm_per_m: [PerElectrode<T>; 2],
    /// Slopes that drive the couples of currents (ohm/m): those, over the couples' disc, less half of the slope of the contact's own field.
    pub driving_ohm_per_m: [PerElectrode<T>; 2],
    /// Bends that drive the quadrupoles (ohm/m2): half of that along x less that along y, and that along both.
    pub bending_ohm_per_m2: [PerElectrode<T>; 2],
}

impl<T: Real> Loaded<T> {
    const NONE: Self = Self {
        spot: Spot::NONE,
        sample: Sample::NONE,
        by_radius_ohm: [T::ZERO; MAX_ELECTRODES],
        described_ohm: [T::ZERO; MAX_ELECTRODES],
        walls_ohm: [T::ZERO; MAX_ELECTRODES + 1],
        ohm: T::ZERO,
        share: T::ONE,
        radius_m: T::ZERO,
        rest_ohm: T::ZERO,
        even_ohm: T::ZERO,
        per_ln_radius: T::ZERO,
        moment_s_m2: T::ZERO,
        quadrupole_s_m4: T::ZERO,
        moment_by_own: T::ZERO,
        half_moment_by: [T::ZERO; PARAMETERS],
        half_quadrupole_by: [T::ZERO; PARAMETERS],
        driving_wide: T::ZERO,
        driving_share: T::ZERO,
        currents: [T::ZERO; MAX_ELECTRODES],
        slopes_ohm_per_m: [[T::ZERO; MAX_ELECTRODES]; 2],
        driving_ohm_per_m: [[T::ZERO; MAX_ELECTRODES]; 2],
        bending_ohm_per_m2: [[T::ZERO; MAX_ELECTRODES]; 2],
    };

    /// Puts a contact there, on the detector as its table says: fields between places are made of these.
    #[inline(always)]
    fn place(&mut self, detector: &Detector<'_, T>, spot: Spot<T>) {
        let (head, n) = (detector.table.head(), detector.table.electrodes());
        let [wide, bent] = [T::ONE, T::of(BENT)].map(|share| way_to_wide(head, share, spread_m(head, &spot)));
        self.spot = spot;
        detector.table.sample(spot.at_m, wide, bent, &mut self.sample);
        self.described_ohm[..n].copy_from_slice(&self.sample.value[..n]);
        detector.by_walls(&self.described_ohm[..n], &mut self.walls_ohm);
    }

    /// Takes it to the detector as it is.
    #[inline(always)]
    fn load(&mut self, detector: &Detector<'_, T>) {
        let (head, n) = (detector.table.head(), detector.table.electrodes());
        let spread_m = spread_m(head, &self.spot);
        detector.take(self.spot.at_m, &mut self.sample);
        self.share = self.sample.value[n + 1].clamp(T::of(LEAST_SHARE), T::ONE);
        self.ohm = self.spot.ln_ohm.exp().max(T::of(LEAST_OHM) * (self.sample.value[n] + head.even_ohm(spread_m)));
        self.per_ln_radius = T::of(2.0) * (way_to_wide(head, T::ONE, spread_m) - way_to_wide(head, T::ZERO, spread_m));
        let disc = Disc::of(head, self.share, spread_m, self.sample.value[n], self.ohm);
        (self.radius_m, self.rest_ohm, self.even_ohm) = (disc.radius_m, disc.rest_ohm, head.even_ohm(disc.radius_m));
        (self.moment_s_m2, self.quadrupole_s_m4) = (disc.couple_s_m2, disc.quadrupole_s_m4);
        self.driving_share = disc.driving_m2 / (spread_m * spread_m);
        self.driving_wide = T::of(0.5) * self.per_ln_radius * (self.driving_share - T::ONE);
    }

    /// Finds how the moments change, and fields with the radius.
    #[inline(always)]
    fn derive(&mut self, head: &Head, n: usize) {
        let (ohm, own_ohm) = (self.ohm, self.sample.value[n]);
        let spread_m = spread_m(head, &self.spot);
        let moments = [self.moment_s_m2, self.quadrupole_s_m4];
        let half_by = |other: Disc<T>, step: T| {
            let half = T::of(0.5) / step;
            [half * (other.couple_s_m2 - moments[0]), half * (other.quadrupole_s_m4 - moments[1])]
        };
        let by_ln_ohm =
            half_by(Disc::of(head, self.share, spread_m, own_ohm, ohm * (T::ONE + T::of(STEP))), T::of(STEP));
        let by_own =
            half_by(Disc::of(head, self.share, spread_m, own_ohm - T::of(STEP) * ohm, ohm), -T::of(STEP) * ohm);
        let by_ln_radius =
            half_by(Disc::of(head, self.share, spread_m * (T::ONE + T::of(STEP)), own_ohm, ohm), T::of(STEP));
        let by_share = match self.is_cut() {
            true => half_by(Disc::of(head, self.share - T::of(STEP), spread_m, own_ohm, ohm), -T::of(STEP)),
            false => [T::ZERO; 2],
        };
        let along = |values: [T; 2], i: usize| by_own[i] * values[0] + by_share[i] * values[1];
        let place =
            |d: usize, i: usize| T::of(head.radius_m) * along([0, 1].map(|which| self.sample.slope[d][n + which]), i);
        let wider = |i: usize| self.per_ln_radius * along([0, 1].map(|which| self.sample.wider[n + which]), i);
        let all = |i: usize| [place(0, i), place(1, i), by_ln_ohm[i], by_ln_radius[i] + wider(i)];
        self.moment_by_own = T::of(2.0) * by_own[0];
        (self.half_moment_by, self.half_quadrupole_by) = (all(0), all(1));
        for e in 0..n {
            self.by_radius_ohm[e] = self.per_ln_radius * self.sample.wider[e];
        }
    }

    /// Whether a wall cuts it, and leaves so much that its share changes with its place.
    fn is_cut(&self) -> bool {
        self.share > T::of(LEAST_SHARE) && self.share < T::ONE
    }

    /// Half of the bend along x less that along y, and that along both, of what is picked of all fields at the contact.
    #[inline(always)]
    fn bends(&self, values: impl Fn(&[T]) -> T) -> [T; 2] {
        let [xx, xy, yy] = [0, 1, 2].map(|which| values(&self.sample.turning[which]));
        [T::of(0.5) * (xx - yy), xy]
    }

    /// Finds what drives the couples of currents at an electrode.
    #[inline(always)]
    fn drive(&mut self, n: usize, e: usize) {
        let half = T::of(0.5) * self.currents[e];
        for d in 0..2 {
            let over_disc = self.slopes_ohm_per_m[d][e] + self.driving_wide * self.sample.turning[3 + d][e];
            self.driving_ohm_per_m[d][e] = over_disc - half * self.sample.slope[d][n];
        }
    }

    /// Finds how that changes.
    #[inline(always)]
    fn turn(&mut self, head: &Head, n: usize) {
        let by_place = self.moment_s_m2 * T::of(head.radius_m);
        let by_radius = self.moment_s_m2 * self.driving_share * self.per_ln_radius;
        let units = [by_place, by_place, by_place, by_radius, by_radius];
        for (turning, unit) in self.sample.turning.iter_mut().zip(units) {
            let own = T::of(0.5) * turning[n];
            let all = turning[..n].iter_mut().zip(&self.currents);
            all.for_each(|(turning, current)| *turning = unit * (*turning - own * *current));
        }
    }

    /// Conductance (S), with that of the part that is not on the detector.
    pub fn conductance_s(&self) -> T {
        T::ONE / (self.share * self.rest_ohm)
    }

    /// Logarithm of the resistance with that of the crowded current over that without it.
    pub fn ln_over_contact(&self) -> T {
        (self.ohm / self.rest_ohm).ln()
    }

    /// Variance of the conductance's logarithm, from the covariance of the contact's parameters with places in so many metres.
    pub fn conductance_variance(&self, table: &Table<'_>, unit_m: T, covariance: impl Fn(usize, usize) -> T) -> T {
        let n = table.electrodes();
        let by_place = |d: usize| {
            let of_share = if self.is_cut() { self.sample.slope[d][n + 1] / self.share } else { T::ZERO };
            unit_m * (self.sample.slope[d][n] / self.rest_ohm - of_share)
        };
        let by_radius_ohm = self.per_ln_radius * self.sample.wider[n] - self.even_ohm;
        let slopes = [by_place(0), by_place(1), -self.ohm / self.rest_ohm, by_radius_ohm / self.rest_ohm];
        let own = T::of(OWN_ERROR) * self.even_ohm / self.rest_ohm;
        let pairs = (0..PARAMETERS).flat_map(|i| (0..PARAMETERS).map(move |j| (i, j)));
        pairs.fold(own * own, |sum, (i, j)| sum + slopes[i] * slopes[j] * covariance(i, j)).max(T::ZERO)
    }
}

/// How far a contact's current spreads (m).
fn spread_m<T: Real>(head: &Head, spot: &Spot<T>) -> T {
    T::of(head.radius_m) * spot.ln_radius.exp()
}

/// How far a disc whose radius' square is such a share of that of a spread is from the small to the wide one.
fn way_to_wide<T: Real>(head: &Head, share: T, spread_m: T) -> T {
    let [small_m2, wide_m2] = head.radii_m.map(|radius_m| T::of(radius_m) * T::of(radius_m));
    (share * spread_m * spread_m - small_m2) / (wide_m2 - small_m2)
}

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
    is_derived: bool,
}

impl<T: Real, const K: usize> Circuit<T, K> {
    pub const EMPTY: Self = Self {
        count: 0,
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
        at_once(
            #[inline(always)]
            || self.solve_all(detector, spots),
        )
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
