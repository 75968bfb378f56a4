//! A few contacts on a detector as a small circuit: the readings that they give, and how these change with them.
//!
//! Each contact is a disc that carries one current, and a couple of opposed ones along x and along y that a slope of the potential under it drives. With
//! the fields of the electrodes at the contacts `F` (`K x n`), those between contacts `N`, and a resistance `A` for each, of the contact with
//! the current that crowds under it,
//!
//! ```text
//! M = [ N + diag(A)  1 ]    U = M^-1 [F; 1]    Z = E - [F; 1]' U - sum over k, d of a_k w_kd w_kd'
//!     [     1'       0 ]    w_kd = dF_k/dx_d - sum over l of dN_kl/dx_d U_l
//! ```
//!
//! `U` are the currents that an electrode's ampere makes at the contacts, `w` the slopes of the potential under them (in the couples' term less `dA_k/dx_d U_k / 2`,
//! the contact's own field), and `a` (S m2) what moment a slope drives:
//! `C R^2 / 4` of a light disc whose current is even, `8/3 s R^3` of a perfect one on a deep layer of conductivity `s` (a conducting disc
//! in a field along it: Landau and Lifshitz, Electrodynamics of Continuous Media, paragraph 4, of which a layer sees one side), `2 pi R^2 s t` on a thin one (a
//! conducting cylinder across it). Between the two of a perfect one it is taken as if squares of their reciprocals added, and of a light and a perfect one as if both
//! were in series. The same `w` are the derivatives by a contact's place: `dZ = -(w U_k' + U_k w')`, and by its resistance `dZ = A U_k U_k'` in logarithms.
//! Beside those the couples change: `-(a (dw w' + w dw') + da w w')`, with `dw` from second derivatives of the fields, which are large at walls, where the slope across
//! them vanishes. What `dw` owes to other contacts is left out.
//!
//! A current that crowds at the rim has the fields of an even one on a wider disc. What is fitted is the radius of that disc, the spread.

use crate::fields::Sample;
use crate::head::Head;
use crate::real::Real;
use crate::table::{LEAST_SHARE, MAX_ELECTRODES, Table};
use crate::unknown::Detector;
use crate::vector::PARAMETERS;

/// By what share that of a disc of even potential, `1 / (4 s R)`, is less.
const CROWDED_LESS: f32 = 0.074_7;
/// By what share the mean square of the distance from the middle is more where all current is crowded, as `1 / sqrt(1 - (r / R)^2)`: it is `2/3 R^2`, of
/// even current `1/2 R^2`.
const CROWDED_WIDER: f32 = 1.0 / 3.0;
/// Error of a contact's own field, as a share of that of even current: of firm discs in random scenes on `square-60` and `display-140x70`, found with the radius to
/// 8 %, it is 0.02 in the middle.
const OWN_ERROR: f32 = 0.03;
/// Steps in which crowding and radius are found, each of the other.
const CROWDING_STEPS: usize = 3;
/// Share of a number by which it is changed for a derivative.
const STEP: f32 = 0.01;
/// Changes of what drives the couples of currents: of its two parts by a place's two and by the radius, less one that two have in common.
pub(crate) const TURNED: usize = 5;
/// Largest conductance of a contact (sheet conductances): what is firmer makes no difference.
const FIRMEST_SHEETS: f32 = 300.0;
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
}

/// A vector over electrodes.
pub(crate) type PerElectrode<T> = [T; MAX_ELECTRODES];

/// How the current of a disc crowds.
struct Disc<T> {
    radius_m: T,
    rest_ohm: T,
    moment_s_m2: T,
}

impl<T: Real> Disc<T> {
    /// Of a disc whose current spreads so far, with an own field but for that on a deep layer, and a resistance with that of the crowded current.
    fn of(head: &Head, spread_m: T, field_ohm: T, ohm: T) -> Self {
        let least_ohm = T::ONE / (T::of(FIRMEST_SHEETS) * T::of(head.sheet_s));
        let (mut crowded, mut radius_m, mut rest_ohm) = (T::of(0.5), spread_m, least_ohm);
        for _ in 0..CROWDING_STEPS {
            radius_m = spread_m / (T::ONE + T::of(CROWDED_WIDER) * crowded).sqrt();
            let even_ohm = head.even_ohm(radius_m);
            rest_ohm = (ohm - field_ohm - even_ohm * (T::ONE - T::of(CROWDED_LESS) * crowded)).max(least_ohm);
            // Crowded is so much of the current as the layer's resistance has of that of both.
            crowded = even_ohm / (even_ohm + rest_ohm);
        }
        let (deep, thin) = (
            T::of(3.0) / (T::of(8.0) * T::of(head.top_s_per_m) * radius_m),
            T::ONE / (T::of(core::f64::consts::TAU) * T::of(head.sheet_s)),
        );
        let of_layer = (deep * deep + thin * thin).sqrt();
        Self { radius_m, rest_ohm, moment_s_m2: radius_m * radius_m / (T::of(4.0) * rest_ohm + of_layer) }
    }
}

/// One contact in the circuit.
#[derive(Clone, Debug)]
pub(crate) struct Loaded<T> {
    pub spot: Spot<T>,
    /// Of its place. Once currents are known, what turns its slopes is, of electrodes, the moment times the derivatives of what drives the couples: of that along x by x,
    /// by y (or of that along y by x), of that along y by y, in usual radii; then of both by the radius' logarithm.
    pub sample: Sample<T>,
    /// Derivatives by the logarithm of the radius of the electrodes' fields, and once currents are known of what these make of them (ohm).
    pub by_radius_ohm: PerElectrode<T>,
    /// `Q b` of its place.
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
    /// Moment of current that a slope of potential drives (S m2).
    pub moment_s_m2: T,
    /// Its derivative by the contact's own field (S m2/ohm).
    pub moment_by_own: T,
    /// Half of its derivatives by the parameters.
    pub half_moment_by: [T; PARAMETERS],
    /// Currents for 1 A into each electrode.
    pub currents: PerElectrode<T>,
    /// Slopes of the potential along x and y (ohm/m), likewise.
    pub slopes_ohm_per_m: [PerElectrode<T>; 2],
    /// Slopes that drive the couples of currents (ohm/m): those less half of the slope of the contact's own field.
    pub driving_ohm_per_m: [PerElectrode<T>; 2],
}

impl<T: Real> Loaded<T> {
    const NONE: Self = Self {
        spot: Spot::NONE,
        sample: Sample::NONE,
        by_radius_ohm: [T::ZERO; MAX_ELECTRODES],
        walls_ohm: [T::ZERO; MAX_ELECTRODES + 1],
        ohm: T::ZERO,
        share: T::ONE,
        radius_m: T::ZERO,
        rest_ohm: T::ZERO,
        even_ohm: T::ZERO,
        per_ln_radius: T::ZERO,
        moment_s_m2: T::ZERO,
        moment_by_own: T::ZERO,
        half_moment_by: [T::ZERO; PARAMETERS],
        currents: [T::ZERO; MAX_ELECTRODES],
        slopes_ohm_per_m: [[T::ZERO; MAX_ELECTRODES]; 2],
        driving_ohm_per_m: [[T::ZERO; MAX_ELECTRODES]; 2],
    };

    /// Puts a contact there.
    fn load(&mut self, detector: &Detector<'_, T>, spot: Spot<T>) {
        let (head, n) = (detector.table.head(), detector.table.electrodes());
        let spread_m = T::of(head.radius_m) * spot.ln_radius.exp();
        let [small_m2, wide_m2] = head.radii_m.map(|radius_m| T::of(radius_m) * T::of(radius_m));
        let per_m2 = T::ONE / (wide_m2 - small_m2);
        self.spot = spot;
        detector.sample(spot.at_m, per_m2 * (spread_m * spread_m - small_m2), &mut self.sample);
        self.share = self.sample.value[n + 1].clamp(T::of(LEAST_SHARE), T::ONE);
        self.ohm = spot.ln_ohm.exp().max(T::of(LEAST_OHM) * (self.sample.value[n] + head.even_ohm(spread_m)));
        self.per_ln_radius = T::of(2.0) * per_m2 * spread_m * spread_m;
        self.crowd(head, spread_m, n);
        for e in 0..n {
            self.by_radius_ohm[e] = self.per_ln_radius * self.sample.wider[e];
        }
        detector.by_walls(&self.sample.value[..n], &mut self.walls_ohm);
    }

    /// Finds how the current crowds, and what moment a slope drives.
    fn crowd(&mut self, head: &Head, spread_m: T, n: usize) {
        let (ohm, own_ohm) = (self.ohm, self.sample.value[n]);
        let disc = Disc::of(head, spread_m, own_ohm, ohm);
        (self.radius_m, self.rest_ohm, self.even_ohm) = (disc.radius_m, disc.rest_ohm, head.even_ohm(disc.radius_m));
        self.moment_s_m2 = disc.moment_s_m2;
        let half_by = |other: Disc<T>, step: T| T::of(0.5) * (other.moment_s_m2 - disc.moment_s_m2) / step;
        let by_ln_ohm = half_by(Disc::of(head, spread_m, own_ohm, ohm * (T::ONE + T::of(STEP))), T::of(STEP));
        let by_own = half_by(Disc::of(head, spread_m, own_ohm - T::of(STEP) * ohm, ohm), -T::of(STEP) * ohm);
        let by_ln_radius = half_by(Disc::of(head, spread_m * (T::ONE + T::of(STEP)), own_ohm, ohm), T::of(STEP));
        let by_place = |d: usize| by_own * T::of(head.radius_m) * self.sample.slope[d][n];
        let by_wider = by_own * self.per_ln_radius * self.sample.wider[n];
        self.moment_by_own = T::of(2.0) * by_own;
        self.half_moment_by = [by_place(0), by_place(1), by_ln_ohm, by_ln_radius + by_wider];
    }

    /// Finds what drives the couples of currents at an electrode, and how that changes.
    fn drive(&mut self, head: &Head, n: usize, e: usize) {
        let half = T::of(0.5) * self.currents[e];
        for d in 0..2 {
            self.driving_ohm_per_m[d][e] = self.slopes_ohm_per_m[d][e] - half * self.sample.slope[d][n];
        }
        let by_place = self.moment_s_m2 * T::of(head.radius_m);
        let by_radius = self.moment_s_m2 * self.per_ln_radius;
        let units = [by_place, by_place, by_place, by_radius, by_radius];
        for (turning, unit) in self.sample.turning.iter_mut().zip(units) {
            turning[e] = unit * (turning[e] - half * turning[n]);
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
        let is_cut = self.share > T::of(LEAST_SHARE) && self.share < T::ONE;
        let by_place = |d: usize| {
            let of_share = if is_cut { self.sample.slope[d][n + 1] / self.share } else { T::ZERO };
            unit_m * (self.sample.slope[d][n] / self.rest_ohm - of_share)
        };
        let by_radius_ohm = self.per_ln_radius * self.sample.wider[n] - self.even_ohm;
        let slopes = [by_place(0), by_place(1), -self.ohm / self.rest_ohm, by_radius_ohm / self.rest_ohm];
        let own = T::of(OWN_ERROR) * self.even_ohm / self.rest_ohm;
        let pairs = (0..PARAMETERS).flat_map(|i| (0..PARAMETERS).map(move |j| (i, j)));
        pairs.fold(own * own, |sum, (i, j)| sum + slopes[i] * slopes[j] * covariance(i, j)).max(T::ZERO)
    }
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
    /// Slopes of the field at a contact from another one (ohm/m), by the place of the first.
    pub slopes_ohm_per_m: [[[T; 2]; K]; K],
}

impl<T: Real, const K: usize> Circuit<T, K> {
    pub const EMPTY: Self = Self {
        count: 0,
        loaded: [Loaded::NONE; K],
        constant_ohm: [T::ZERO; MAX_ELECTRODES],
        loads_ohm: [T::ZERO; MAX_ELECTRODES],
        inverse_s: [[T::ZERO; K]; K],
        slopes_ohm_per_m: [[[T::ZERO; 2]; K]; K],
    };

    /// Solves for some contacts, `K` at most; `false` if their fields cannot be those of contacts, as when two are at one place.
    pub fn solve(&mut self, detector: &Detector<'_, T>, spots: &[Spot<T>]) -> bool {
        self.count = spots.len().min(K);
        for (loaded, spot) in self.loaded.iter_mut().zip(spots) {
            loaded.load(detector, *spot);
        }
        let mut matrix = [[T::ZERO; K]; K];
        for k in 0..self.count {
            matrix[k][k] = self.loaded[k].ohm;
            for l in 0..k {
                let (ohm, [at_k, at_l]) = self.between(detector, k, l);
                (matrix[k][l], matrix[l][k]) = (ohm, ohm);
                (self.slopes_ohm_per_m[k][l], self.slopes_ohm_per_m[l][k]) = (at_k, at_l);
            }
        }
        self.find_currents(detector.table, &matrix) && {
            self.find_slopes(detector.table);
            self.find_loads(detector)
        }
    }

    /// Field between two contacts (ohm), and its derivatives by the place of each of both (ohm/m).
    fn between(&self, detector: &Detector<'_, T>, k: usize, l: usize) -> (T, [[T; 2]; 2]) {
        let (one, other) = (&self.loaded[k], &self.loaded[l]);
        let n = detector.table.electrodes();
        let (mut ohm, mut slopes) = detector.by_ways_ohm(one.spot.at_m, other.spot.at_m);
        ohm += other.walls_ohm[n];
        for e in 0..n {
            ohm += other.walls_ohm[e] * one.sample.value[e];
            for d in 0..2 {
                slopes[0][d] += other.walls_ohm[e] * one.sample.slope[d][e];
                slopes[1][d] += one.walls_ohm[e] * other.sample.slope[d][e];
            }
        }
        (ohm, slopes)
    }

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
            self.take_widened(table, k);
            let n = table.electrodes();
            (0..n).for_each(|e| self.loaded[k].drive(table.head(), n, e));
        }
    }

    /// Takes what other contacts' currents change of the field at a contact with its radius from what electrodes do.
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

    fn find_loads(&mut self, detector: &Detector<'_, T>) -> bool {
        for g in 0..detector.table.electrodes() {
            let mut ohm = detector.pads_ohm(g, g) - self.constant_ohm[g] + detector.switch_ohm();
            for one in &self.loaded[..self.count] {
                let [x, y] = [0, 1].map(|d| one.driving_ohm_per_m[d][g]);
                ohm -= one.sample.value[g] * one.currents[g] + one.moment_s_m2 * (x * x + y * y);
            }
            if !(ohm > T::ZERO && ohm.is_finite()) {
                return false;
            }
            self.loads_ohm[g] = ohm;
        }
        true
    }

    /// What is there to be read while an electrode is grounded (V).
    pub fn row_v(&self, detector: &Detector<'_, T>, g: usize, volts: &mut [T]) {
        let own_ohm = detector.pads_ohm(g, g) + detector.switch_ohm();
        let per_ohm = T::of(detector.table.head().drive_v) / self.loads_ohm[g];
        // Differences, so that the resistance of a light contact, thousands of times as much, does not take their digits.
        for (e, volts) in volts.iter_mut().enumerate().take(detector.table.electrodes()) {
            let mut ohm = own_ohm - detector.pads_ohm(e, g);
            for one in &self.loaded[..self.count] {
                let along = |d: usize| {
                    let here = one.driving_ohm_per_m[d][g];
                    here * (here - one.driving_ohm_per_m[d][e])
                };
                ohm -= (one.sample.value[g] - one.sample.value[e]) * one.currents[g]
                    + one.moment_s_m2 * (along(0) + along(1));
            }
            *volts = per_ohm * ohm;
        }
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
            let ohm = detector.by_ways_ohm(at_m, one.spot.at_m).0 + by_walls + one.walls_ohm[n];
            (0..n).for_each(|e| all_ohm[e] -= ohm * one.currents[e]);
        }
    }
}
