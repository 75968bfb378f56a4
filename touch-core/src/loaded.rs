//! One contact in the circuit.

use crate::answer::Contact;
use crate::detector::Detector;
use crate::disc::Disc;
use crate::fields::Sample;
use crate::head::Head;
use crate::real::Real;
use crate::table::{LEAST_SHARE, MAX_ELECTRODES, Table};
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
    /// How far its current spreads, and its radius (m).
    spread_m: T,
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
    pub const NONE: Self = Self {
        spot: Spot::NONE,
        sample: Sample::NONE,
        by_radius_ohm: [T::ZERO; MAX_ELECTRODES],
        described_ohm: [T::ZERO; MAX_ELECTRODES],
        walls_ohm: [T::ZERO; MAX_ELECTRODES + 1],
        ohm: T::ZERO,
        share: T::ONE,
        spread_m: T::ZERO,
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
    pub fn place(&mut self, detector: &Detector<'_, T>, spot: Spot<T>) {
        let (head, n) = (detector.table.head(), detector.table.electrodes());
        self.spread_m = T::of(head.radius_m) * spot.ln_radius.exp();
        let square_m2 = self.spread_m * self.spread_m;
        let [small_m2, wide_m2] = head.radii_m.map(|radius_m| T::of(radius_m) * T::of(radius_m));
        let per_m2 = T::ONE / (wide_m2 - small_m2);
        self.per_ln_radius = T::of(2.0) * per_m2 * square_m2;
        let [wide, bent] = [T::ONE, T::of(BENT)].map(|share| per_m2 * (share * square_m2 - small_m2));
        self.spot = spot;
        detector.table.sample(spot.at_m, wide, bent, &mut self.sample);
        self.described_ohm[..n].copy_from_slice(&self.sample.value[..n]);
        detector.by_walls(&self.described_ohm[..n], &mut self.walls_ohm);
    }

    /// Takes it to the detector as it is.
    #[inline(always)]
    pub fn load(&mut self, detector: &Detector<'_, T>) {
        let (head, n) = (detector.table.head(), detector.table.electrodes());
        let spread_m = self.spread_m;
        detector.take(self.spot.at_m, &mut self.sample);
        self.share = self.sample.value[n + 1].clamp(T::of(LEAST_SHARE), T::ONE);
        self.ohm = self.spot.ln_ohm.exp().max(T::of(LEAST_OHM) * (self.sample.value[n] + head.even_ohm(spread_m)));
        let disc = Disc::of(head, self.share, spread_m, self.sample.value[n], self.ohm);
        (self.radius_m, self.rest_ohm, self.even_ohm) = (disc.radius_m, disc.rest_ohm, head.even_ohm(disc.radius_m));
        (self.moment_s_m2, self.quadrupole_s_m4) = (disc.couple_s_m2, disc.quadrupole_s_m4);
        self.driving_share = disc.driving_m2 / (spread_m * spread_m);
        self.driving_wide = T::of(0.5) * self.per_ln_radius * (self.driving_share - T::ONE);
    }

    /// Finds how the moments change, and fields with the radius.
    #[inline(always)]
    pub fn derive(&mut self, head: &Head, n: usize) {
        let (ohm, own_ohm) = (self.ohm, self.sample.value[n]);
        let spread_m = self.spread_m;
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
    pub fn bends(&self, values: impl Fn(&[T]) -> T) -> [T; 2] {
        let [xx, xy, yy] = [0, 1, 2].map(|which| values(&self.sample.turning[which]));
        [T::of(0.5) * (xx - yy), xy]
    }

    /// Finds what drives the couples of currents at an electrode.
    #[inline(always)]
    pub fn drive(&mut self, n: usize, e: usize) {
        let half = T::of(0.5) * self.currents[e];
        for d in 0..2 {
            let over_disc = self.slopes_ohm_per_m[d][e] + self.driving_wide * self.sample.turning[3 + d][e];
            self.driving_ohm_per_m[d][e] = over_disc - half * self.sample.slope[d][n];
        }
    }

    /// Finds how that changes.
    #[inline(always)]
    pub fn turn(&mut self, head: &Head, n: usize) {
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
