//! How much readings speak for some contacts, against others or more of them.
//!
//! The marginal likelihood is the integral of likelihood times prior over places, conductances and radii, and over what is not known of the detector. By Laplace's
//! approximation about the best fit (Kass and Raftery, Bayes factors, 1995), with `S` the sum of squares of residuals and priors and `H` half its second derivative,
//!
//! ```text
//! ln p = -S / 2 + sum of ln(prior densities' peaks) + P / 2 ln(2 pi) - 1/2 ln det H + ln K!
//! ```
//!
//! and, as the prior is of the logarithm of a conductance and what is fitted is that of a resistance with the crowded current's, the logarithms of what the one changes with
//! the other. Places are alike likely all over the detector; contacts have no order, so that `K!` fits are the same.

use crate::circuit::Circuit;
use crate::normal::{ANY_RADIUS, Normal};
use crate::real::Real;
use crate::table::Table;

/// Standard deviation of the logarithm of a conductance before anything is read: nearly nothing is known.
const CONDUCTANCE_DEVIATION: f32 = 4.0;
/// One more contact is less likely than one fewer by so many nats before anything is read: scenes of few contacts are more common.
const FEWER_NATS: f32 = 1.5;

/// Logarithm of the evidence for contacts but for the sum of squares: of the share of what could be before that the readings leave (nats).
pub(crate) fn ln_volume<T: Real, const K: usize>(
    table: &Table<'_>,
    circuit: &Circuit<T, K>,
    normal: &Normal<T, K>,
) -> T {
    let [low_m, high_m] = table.bounds_m();
    let sides = [0, 1].map(|d| T::of((high_m[d] - low_m[d]) / table.head().radius_m));
    let strength = T::of(CONDUCTANCE_DEVIATION);
    // Of a place that is even over a side the variance is its square over 12.
    let [x, y] = sides.map(|side| T::of(12.0) / (side * side));
    let known = [x, y, T::ONE / (strength * strength), T::ZERO];
    let Some(ln_determinant) = normal.ln_determinant(known) else { return -T::max_value().sqrt() };
    // Four times half of ln(2 pi), of which the peaks of two normal densities take two.
    let peaks = T::of(core::f64::consts::TAU).ln() - (strength * T::of(ANY_RADIUS)).ln();
    let of_one = peaks - (sides[0] * sides[1]).ln() - T::of(FEWER_NATS);
    let all = (0..circuit.count).map(|k| of_one + T::of(k as u32 + 1).ln() + circuit.loaded[k].ln_over_contact());
    all.sum::<T>() - T::of(0.5) * ln_determinant
}
