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
use crate::normal::PARAMETERS;
use crate::table::{LEAST_SHARE, MAX_ELECTRODES, Table};

/// Most contacts.
pub const MAX_CONTACTS: usize = 3;

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
pub(crate) struct Spot {
    /// Where (m).
    pub at_m: [f32; 2],
    /// Logarithm of its resistance with that of the crowded current (ohm).
    pub ln_ohm: f32,
    /// Logarithm of its spread over the usual radius: the radius of the disc of even current whose fields it has.
    pub ln_radius: f32,
}

/// A vector over electrodes.
pub(crate) type PerElectrode = [f32; MAX_ELECTRODES];

/// How the current of a disc crowds.
struct Disc {
    radius_m: f32,
    rest_ohm: f32,
    moment_s_m2: f32,
}

impl Disc {
    /// Of a disc whose current spreads so far, with an own field but for that on a deep layer, and a resistance with that of the crowded current.
    fn of(head: &Head, spread_m: f32, field_ohm: f32, ohm: f32) -> Self {
        let least_ohm = 1.0 / (FIRMEST_SHEETS * head.sheet_s);
        let (mut crowded, mut radius_m, mut rest_ohm) = (0.5, spread_m, least_ohm);
        for _ in 0..CROWDING_STEPS {
            radius_m = spread_m / libm::sqrtf(1.0 + CROWDED_WIDER * crowded);
            let even_ohm = head.even_ohm(radius_m);
            rest_ohm = (ohm - field_ohm - even_ohm * (1.0 - CROWDED_LESS * crowded)).max(least_ohm);
            // Crowded is so much of the current as the layer's resistance has of that of both.
            crowded = even_ohm / (even_ohm + rest_ohm);
        }
        let (deep, thin) = (3.0 / (8.0 * head.top_s_per_m * radius_m), 1.0 / (core::f32::consts::TAU * head.sheet_s));
        let of_layer = libm::sqrtf(deep * deep + thin * thin);
        Self { radius_m, rest_ohm, moment_s_m2: radius_m * radius_m / (4.0 * rest_ohm + of_layer) }
    }
}

/// One contact in the circuit.
#[derive(Clone, Debug)]
pub(crate) struct Loaded {
    pub spot: Spot,
    /// Of its place. Once currents are known, what turns its slopes is, of electrodes, the moment times the derivatives of what drives the couples: of that along x by x,
    /// by y (or of that along y by x), of that along y by y, in usual radii; then of both by the radius' logarithm.
    pub sample: Sample,
    /// Derivatives of the electrodes' fields by the logarithm of the radius (ohm).
    pub by_radius_ohm: PerElectrode,
    /// `Q b` of its place.
    walls_ohm: [f32; MAX_ELECTRODES + 1],
    /// Resistance with that of the crowded current (ohm).
    pub ohm: f32,
    /// Part of it that is on the detector.
    pub share: f32,
    /// Its radius (m).
    pub radius_m: f32,
    /// Resistance without that of the crowded current (ohm).
    rest_ohm: f32,
    /// Own field of a disc of even current of its radius on a deep layer (ohm).
    even_ohm: f32,
    /// Change of the way from the small to the wide disc with the logarithm of the spread.
    per_ln_radius: f32,
    /// Moment of current that a slope of potential drives (S m2).
    pub moment_s_m2: f32,
    /// Half of its derivatives by the parameters.
    pub half_moment_by: [f32; PARAMETERS],
    /// Currents for 1 A into each electrode.
    pub currents: PerElectrode,
    /// Slopes of the potential along x and y (ohm/m), likewise.
    pub slopes_ohm_per_m: [PerElectrode; 2],
    /// Slopes that drive the couples of currents (ohm/m): those less half of the slope of the contact's own field.
    pub driving_ohm_per_m: [PerElectrode; 2],
}

impl Loaded {
    const NONE: Self = Self {
        spot: Spot { at_m: [0.0; 2], ln_ohm: 0.0, ln_radius: 0.0 },
        sample: Sample::NONE,
        by_radius_ohm: [0.0; MAX_ELECTRODES],
        walls_ohm: [0.0; MAX_ELECTRODES + 1],
        ohm: 0.0,
        share: 1.0,
        radius_m: 0.0,
        rest_ohm: 0.0,
        even_ohm: 0.0,
        per_ln_radius: 0.0,
        moment_s_m2: 0.0,
        half_moment_by: [0.0; PARAMETERS],
        currents: [0.0; MAX_ELECTRODES],
        slopes_ohm_per_m: [[0.0; MAX_ELECTRODES]; 2],
        driving_ohm_per_m: [[0.0; MAX_ELECTRODES]; 2],
    };

    /// Puts a contact there.
    fn load(&mut self, table: &Table<'_>, spot: Spot) {
        let (head, n) = (table.head(), table.electrodes());
        let spread_m = head.radius_m * libm::expf(spot.ln_radius);
        let [small_m2, wide_m2] = head.radii_m.map(|radius_m| radius_m * radius_m);
        let per_m2 = 1.0 / (wide_m2 - small_m2);
        self.spot = spot;
        table.sample(spot.at_m, per_m2 * (spread_m * spread_m - small_m2), &mut self.sample);
        self.share = self.sample.value[n + 1].clamp(LEAST_SHARE, 1.0);
        self.ohm = libm::expf(spot.ln_ohm).max(LEAST_OHM * (self.sample.value[n] + head.even_ohm(spread_m)));
        self.per_ln_radius = 2.0 * per_m2 * spread_m * spread_m;
        self.crowd(head, spread_m, n);
        for e in 0..n {
            self.by_radius_ohm[e] = self.per_ln_radius * self.sample.wider[e];
        }
        table.by_walls(&self.sample.value[..n], &mut self.walls_ohm);
    }

    /// Finds how the current crowds, and what moment a slope drives.
    fn crowd(&mut self, head: &Head, spread_m: f32, n: usize) {
        let (ohm, own_ohm) = (self.ohm, self.sample.value[n]);
        let disc = Disc::of(head, spread_m, own_ohm, ohm);
        (self.radius_m, self.rest_ohm, self.even_ohm) = (disc.radius_m, disc.rest_ohm, head.even_ohm(disc.radius_m));
        self.moment_s_m2 = disc.moment_s_m2;
        let half_by = |other: Disc, step: f32| 0.5 * (other.moment_s_m2 - disc.moment_s_m2) / step;
        let by_ln_ohm = half_by(Disc::of(head, spread_m, own_ohm, ohm * (1.0 + STEP)), STEP);
        let by_own = half_by(Disc::of(head, spread_m, own_ohm - STEP * ohm, ohm), -STEP * ohm);
        let by_ln_radius = half_by(Disc::of(head, spread_m * (1.0 + STEP), own_ohm, ohm), STEP);
        let by_place = |d: usize| by_own * head.radius_m * self.sample.slope[d][n];
        let by_wider = by_own * self.per_ln_radius * self.sample.wider[n];
        self.half_moment_by = [by_place(0), by_place(1), by_ln_ohm, by_ln_radius + by_wider];
    }

    /// Finds what drives the couples of currents at an electrode, and how that changes.
    fn drive(&mut self, head: &Head, n: usize, e: usize) {
        let half = 0.5 * self.currents[e];
        for d in 0..2 {
            self.driving_ohm_per_m[d][e] = self.slopes_ohm_per_m[d][e] - half * self.sample.slope[d][n];
        }
        let by_place = self.moment_s_m2 * head.radius_m;
        let by_radius = self.moment_s_m2 * self.per_ln_radius;
        let units = [by_place, by_place, by_place, by_radius, by_radius];
        for (turning, unit) in self.sample.turning.iter_mut().zip(units) {
            turning[e] = unit * (turning[e] - half * turning[n]);
        }
    }

    /// Conductance (S), with that of the part that is not on the detector.
    pub fn conductance_s(&self) -> f32 {
        1.0 / (self.share * self.rest_ohm)
    }

    /// Variance of the conductance's logarithm, from the covariance of the contact's parameters with places in so many metres.
    pub fn conductance_variance(
        &self,
        table: &Table<'_>,
        unit_m: f32,
        covariance: impl Fn(usize, usize) -> f32,
    ) -> f32 {
        let n = table.electrodes();
        let is_cut = self.share > LEAST_SHARE && self.share < 1.0;
        let by_place = |d: usize| {
            let of_share = if is_cut { self.sample.slope[d][n + 1] / self.share } else { 0.0 };
            unit_m * (self.sample.slope[d][n] / self.rest_ohm - of_share)
        };
        let by_radius_ohm = self.per_ln_radius * self.sample.wider[n] - self.even_ohm;
        let slopes = [by_place(0), by_place(1), -self.ohm / self.rest_ohm, by_radius_ohm / self.rest_ohm];
        let own = OWN_ERROR * self.even_ohm / self.rest_ohm;
        let pairs = (0..PARAMETERS).flat_map(|i| (0..PARAMETERS).map(move |j| (i, j)));
        pairs.fold(own * own, |sum, (i, j)| sum + slopes[i] * slopes[j] * covariance(i, j)).max(0.0)
    }
}

/// Contacts, with all that the readings follow from.
#[derive(Clone, Debug)]
pub(crate) struct Circuit {
    pub count: usize,
    pub loaded: [Loaded; MAX_CONTACTS],
    /// The constant of each electrode's ampere (ohm).
    pub constant_ohm: PerElectrode,
    /// `Z[g][g]` with the switch (ohm).
    pub loads_ohm: PerElectrode,
}

impl Circuit {
    pub const EMPTY: Self = Self {
        count: 0,
        loaded: [Loaded::NONE; MAX_CONTACTS],
        constant_ohm: [0.0; MAX_ELECTRODES],
        loads_ohm: [0.0; MAX_ELECTRODES],
    };

    /// Solves for some contacts, [`MAX_CONTACTS`] at most; `false` if their fields cannot be those of contacts, as when two are at one place.
    pub fn solve(&mut self, table: &Table<'_>, spots: &[Spot]) -> bool {
        self.count = spots.len().min(MAX_CONTACTS);
        for (loaded, spot) in self.loaded.iter_mut().zip(spots) {
            loaded.load(table, *spot);
        }
        let mut matrix = [[0.0; MAX_CONTACTS]; MAX_CONTACTS];
        // Derivatives of the field at contact k from contact l, by the place of k.
        let mut slopes = [[[0.0; 2]; MAX_CONTACTS]; MAX_CONTACTS];
        for k in 0..self.count {
            matrix[k][k] = self.loaded[k].ohm;
            for l in (0..self.count).filter(|l| *l != k) {
                let (ohm, slope) = self.between(table, k, l);
                (matrix[k][l], slopes[k][l]) = (ohm, slope);
            }
        }
        self.find_currents(table, &matrix) && {
            self.find_slopes(table, &slopes);
            self.find_loads(table)
        }
    }

    /// Field of contact `l` at contact `k` (ohm), and its derivatives by the place of `k` (ohm/m).
    fn between(&self, table: &Table<'_>, k: usize, l: usize) -> (f32, [f32; 2]) {
        let (at, from) = (&self.loaded[k], &self.loaded[l]);
        let n = table.electrodes();
        let way_m = [0, 1].map(|d| at.spot.at_m[d] - from.spot.at_m[d]);
        let distance_m = libm::sqrtf(way_m[0] * way_m[0] + way_m[1] * way_m[1]).max(1e-9);
        let (mut ohm, per_m) = table.by_distance_ohm(distance_m);
        let mut slope = way_m.map(|way_m| per_m * way_m / distance_m);
        ohm += from.walls_ohm[n];
        for e in 0..n {
            ohm += from.walls_ohm[e] * at.sample.value[e];
            (0..2).for_each(|d| slope[d] += from.walls_ohm[e] * at.sample.slope[d][e]);
        }
        (ohm, slope)
    }

    fn find_currents(&mut self, table: &Table<'_>, matrix: &[[f32; MAX_CONTACTS]; MAX_CONTACTS]) -> bool {
        let count = self.count;
        let mut factor = [[0.0; MAX_CONTACTS]; MAX_CONTACTS];
        for i in 0..count {
            for j in 0..=i {
                let sum: f32 = matrix[i][j] - (0..j).map(|k| factor[i][k] * factor[j][k]).sum::<f32>();
                if i != j {
                    factor[i][j] = sum / factor[j][j];
                } else if sum > 1e-3 * matrix[i][i] {
                    factor[i][i] = libm::sqrtf(sum);
                } else {
                    return false;
                }
            }
        }
        let solve = |mut right: [f32; MAX_CONTACTS]| {
            for i in 0..count {
                let sum: f32 = (0..i).map(|j| factor[i][j] * right[j]).sum();
                right[i] = (right[i] - sum) / factor[i][i];
            }
            for i in (0..count).rev() {
                let sum: f32 = (i + 1..count).map(|j| factor[j][i] * right[j]).sum();
                right[i] = (right[i] - sum) / factor[i][i];
            }
            right
        };
        let of_one = solve([1.0; MAX_CONTACTS]);
        let conductance_s: f32 = of_one.iter().take(count).sum();
        if !(conductance_s > 0.0 && conductance_s.is_finite()) {
            return false;
        }
        for e in 0..table.electrodes() {
            let mut right = [0.0; MAX_CONTACTS];
            (0..count).for_each(|k| right[k] = self.loaded[k].sample.value[e]);
            let of_fields = solve(right);
            let constant_ohm = (of_fields.iter().take(count).sum::<f32>() - 1.0) / conductance_s;
            self.constant_ohm[e] = constant_ohm;
            (0..count).for_each(|k| self.loaded[k].currents[e] = of_fields[k] - of_one[k] * constant_ohm);
        }
        true
    }

    fn find_slopes(&mut self, table: &Table<'_>, slopes: &[[[f32; 2]; MAX_CONTACTS]; MAX_CONTACTS]) {
        for k in 0..self.count {
            for d in 0..2 {
                for e in 0..table.electrodes() {
                    let others = (0..self.count).filter(|l| *l != k);
                    let by_others: f32 = others.map(|l| slopes[k][l][d] * self.loaded[l].currents[e]).sum();
                    self.loaded[k].slopes_ohm_per_m[d][e] = self.loaded[k].sample.slope[d][e] - by_others;
                }
            }
            let n = table.electrodes();
            (0..n).for_each(|e| self.loaded[k].drive(table.head(), n, e));
        }
    }

    fn find_loads(&mut self, table: &Table<'_>) -> bool {
        for g in 0..table.electrodes() {
            let mut ohm = table.pads_ohm(g, g) - self.constant_ohm[g] + table.head().on_resistance_ohm;
            for one in &self.loaded[..self.count] {
                let [x, y] = [0, 1].map(|d| one.driving_ohm_per_m[d][g]);
                ohm -= one.sample.value[g] * one.currents[g] + one.moment_s_m2 * (x * x + y * y);
            }
            if !(ohm > 0.0 && ohm.is_finite()) {
                return false;
            }
            self.loads_ohm[g] = ohm;
        }
        true
    }

    /// The readings with one electrode grounded (V).
    pub fn row_v(&self, table: &Table<'_>, g: usize, volts: &mut PerElectrode) {
        let head = table.head();
        let (own_ohm, per_ohm) = (table.pads_ohm(g, g) + head.on_resistance_ohm, head.drive_v / self.loads_ohm[g]);
        // Differences, so that the resistance of a light contact, thousands of times as much, does not take their digits.
        for (e, volts) in volts.iter_mut().enumerate().take(table.electrodes()) {
            let mut ohm = own_ohm - table.pads_ohm(e, g);
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
        table: &Table<'_>,
        at_m: [f32; 2],
        fields_ohm: &PerElectrode,
        all_ohm: &mut PerElectrode,
    ) {
        let n = table.electrodes();
        for e in 0..n {
            all_ohm[e] = fields_ohm[e] - self.constant_ohm[e];
        }
        for one in &self.loaded[..self.count] {
            let way_m = [0, 1].map(|d| at_m[d] - one.spot.at_m[d]);
            let distance_m = libm::sqrtf(way_m[0] * way_m[0] + way_m[1] * way_m[1]);
            let by_walls: f32 = (0..n).map(|e| one.walls_ohm[e] * fields_ohm[e]).sum();
            let ohm = table.by_distance_ohm(distance_m).0 + by_walls + one.walls_ohm[n];
            (0..n).for_each(|e| all_ohm[e] -= ohm * one.currents[e]);
        }
    }
}
