//! How current crowds under a disc, and what moments of it slopes and bends of the potential drive.
//!
//! Under a light disc the current is as even as the potential is; under a perfect one it crowds at the rim. A slope of the potential `w` along x drives a couple `p = a w`, a bend `g`
//! (of which the potential is `g (x2 - y2) / 2`, and as much of the other kind, of which it is `h x y`) a quadrupole, and both take `a w2` and `b (g2 + h2)` of the impedances:
//!
//! | of a disc of radius `R` | `1 / a` | `1 / b` |
//! |---|---|---|
//! | light, of conductance `C` | `4 / (C R2)` | `24 / (C R4)` |
//! | perfect, on a deep layer of conductivity `s` | `3 / (8 s R3)` | `45 / (32 s R5)` |
//! | perfect, on a thin sheet of conductance `S` | `1 / (2 pi S R2)` | `1 / (pi S R4)` |
//! | of even current, on a deep layer | `64 / (15 pi2 s R3)` | 1.667 `/ (s R5)` |
//!
//! (a conducting disc in a field along it: Landau and Lifshitz, Electrodynamics of Continuous Media, paragraph 4, of which a layer sees one side; a conducting cylinder across a
//! sheet; and Hankel transforms of currents that go with `r` and `r2`.) Deep and thin are added in squares: where the layer is thicker than six tenths of the radius that is right to 3 %.
//! In between, what a layer has of even current goes over to what it has of crowded current with the square of the layer's share of both, and for the one current with its
//! cube: the least energy of currents that are sums of powers of `1 - r2` is that to 0.02 of `1 / a`, and to 0.01 of the resistance.
//!
//! What drives a couple is the mean of the slopes with weights that go with its current: that of a disc of even current whose radius' square is 2/3 of the contact's, or 4/5 where the
//! current is crowded. Fitted to single discs of 3 and 5 mm by the finest model, `a` and `b` are these to 3 and 15 %.

use crate::head::Head;
use crate::real::Real;

/// By what share that of a disc of even potential, `1 / (4 s R)`, is less.
const CROWDED_LESS: f32 = 0.074_7;
/// By what share the mean square of the distance from the middle is more where all current is crowded, as `1 / sqrt(1 - (r / R)^2)`: it is `2/3 R^2`, of
/// even current `1/2 R^2`.
const CROWDED_WIDER: f32 = 1.0 / 3.0;
/// By how much more a layer resists a couple and a quadrupole of even current than of crowded current: `64 / (15 pi2)` over `3 / 8`, and 1.667 over `45 / 32`, less one.
const EVEN_COUPLE_MORE: f32 = 0.153;
const EVEN_QUADRUPOLE_MORE: f32 = 0.186;
/// Squares of the radii of discs of even current over which slopes drive a couple, in those of the disc: where its current is even, and by how much more where it is crowded.
const COUPLE_EVEN: f32 = 2.0 / 3.0;
const COUPLE_CROWDED_MORE: f32 = 2.0 / 15.0;
/// Steps in which crowding and radius are found, each of the other.
const CROWDING_STEPS: usize = 3;
/// Largest conductance of a contact (sheet conductances): what is firmer makes no difference.
const FIRMEST_SHEETS: f32 = 300.0;

/// How the current of a disc crowds.
pub(crate) struct Disc<T> {
    pub radius_m: T,
    /// Resistance without that of the crowded current (ohm).
    pub rest_ohm: T,
    /// Couple of currents that a slope of the potential drives (S m2), and quadrupole that a bend does (S m4).
    pub couple_s_m2: T,
    pub quadrupole_s_m4: T,
    /// Square of the radius of a disc of even current over which slopes drive a couple (m2).
    pub driving_m2: T,
}

impl<T: Real> Disc<T> {
    /// Of a disc such a share of which is on the detector, whose current spreads so far, with an own field but for that on a deep layer, and a resistance with that of the crowded current.
    pub fn of(head: &Head, share: T, spread_m: T, field_ohm: T, ohm: T) -> Self {
        let least_ohm = T::ONE / (T::of(FIRMEST_SHEETS) * T::of(head.sheet_s));
        let (mut crowded, mut radius_m, mut rest_ohm) = (T::of(0.5), spread_m, least_ohm);
        for _ in 0..CROWDING_STEPS {
            radius_m = spread_m / (T::ONE + T::of(CROWDED_WIDER) * crowded).sqrt();
            let even_ohm = head.even_ohm(radius_m);
            rest_ohm = (ohm - field_ohm - even_ohm * (T::ONE - T::of(CROWDED_LESS) * crowded / share)).max(least_ohm);
            let of_layer = even_ohm / (even_ohm + share * rest_ohm);
            crowded = of_layer * of_layer * of_layer;
        }
        let deep = T::ONE / (T::of(head.top_s_per_m) * radius_m);
        let thin = T::ONE / (T::of(core::f64::consts::PI) * T::of(head.sheet_s));
        let perfect = |of_deep: f32, of_thin: f32| {
            let (deep, thin) = (T::of(of_deep) * deep, T::of(of_thin) * thin);
            // Of a disc that a wall cuts there is the other part in the mirror.
            (deep * deep + thin * thin).sqrt() / share
        };
        let with_light = |light_ohm: T, perfect_ohm: T, even_more: f32| {
            let of_layer = perfect_ohm / (perfect_ohm + light_ohm);
            let crowded = of_layer * of_layer;
            (light_ohm + perfect_ohm * (T::ONE + T::of(even_more) * (T::ONE - crowded)), crowded)
        };
        let square_m2 = radius_m * radius_m;
        let (couple, crowded) = with_light(T::of(4.0) * rest_ohm, perfect(3.0 / 8.0, 0.5), EVEN_COUPLE_MORE);
        let (quadrupole, _) = with_light(T::of(24.0) * rest_ohm, perfect(45.0 / 32.0, 1.0), EVEN_QUADRUPOLE_MORE);
        Self {
            radius_m,
            rest_ohm,
            couple_s_m2: square_m2 / couple,
            quadrupole_s_m4: square_m2 * square_m2 / quadrupole,
            driving_m2: square_m2 * (T::of(COUPLE_EVEN) + T::of(COUPLE_CROWDED_MORE) * crowded),
        }
    }
}
