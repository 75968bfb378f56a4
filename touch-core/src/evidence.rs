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
use crate::fit::Fit;
use crate::normal::{ANY_RADIUS, Normal};
use crate::posterior::Posterior;
use crate::real::Real;
use crate::table::Table;
use crate::vector::{PARAMETERS, Vector};
use crate::walls::{Across, along_tangents};

/// Standard deviation of the logarithm of a conductance before anything is read: nearly nothing is known.
const CONDUCTANCE_DEVIATION: f32 = 4.0;
/// One more contact is less likely than one fewer by so many nats before anything is read: scenes of few contacts are more common. With two and with five
/// as many of 880 scenes are right; with two the model's own error is taken for a light contact beside a wide one in 4 of 112.
const FEWER_NATS: f32 = 3.0;

/// What readings have to say for a contact (squared deviations), else it is tried whether the others do as well without it: seven for each number that they determine.
const PRICE: f32 = 7.0 * PAID;
/// What readings say for one that is none (squared deviations).
const NOTHING: f32 = 2.0;
/// Numbers of a contact that readings determine: a radius that they do not tell says nothing.
const PAID: f32 = 3.0;
/// Standard error of a place from which on it is loose (usual radii). Of 800 scenes on a detector that is known and 150 on ones as built as many are right with 0.1 and with 0.5, in the
/// same time to a tenth; with 0.5 a light press at the rim of a pad in a corner of a thin layer is found 4 mm off.
const LOOSE: f32 = 0.3;
/// Standard deviations of the sum of squares beyond which readings do not fit: the host's.
const MISFIT_DEVIATIONS: f32 = 5.0;

/// Sides of the detector, in usual radii.
fn sides<T: Real>(table: &Table<'_>) -> [T; 2] {
    let [low_m, high_m] = table.bounds_m();
    [0, 1].map(|d| T::of((high_m[d] - low_m[d]) / table.head().radius_m))
}

/// What is known of a contact's parameters before anything is read, but for its radius: one over their variances.
pub(crate) fn known<T: Real, const K: usize>(table: &Table<'_>, circuit: &Circuit<T, K>) -> Vector<T, K> {
    // Of a place that is even over a side the variance is its square over 12.
    let [x, y] = sides(table).map(|side: T| T::of(12.0) / (side * side));
    let of_one = [x, y, T::ONE / (T::of(CONDUCTANCE_DEVIATION) * T::of(CONDUCTANCE_DEVIATION)), T::ZERO];
    along_tangents(table, circuit.loaded.iter().take(circuit.count).map(|one| one.spot.at_m), of_one)
}

/// Logarithm of the evidence for contacts but for the sum of squares: of the share of what could be before that the readings leave (nats); `None` is where parameters are not
/// determined.
pub(crate) fn ln_volume<T: Real, const K: usize>(
    table: &Table<'_>,
    circuit: &Circuit<T, K>,
    posterior: Option<&Posterior<T, K>>,
) -> T {
    let sides: [T; 2] = sides(table);
    let strength = T::of(CONDUCTANCE_DEVIATION);
    let Some(posterior) = posterior else { return -T::max_value().sqrt() };
    // Four times half of ln(2 pi), of which the peaks of two normal densities take two.
    let peaks = T::of(core::f64::consts::TAU).ln() - (strength * T::of(ANY_RADIUS)).ln();
    let of_one = peaks - (sides[0] * sides[1]).ln() - T::of(FEWER_NATS);
    let all = (0..circuit.count).map(|k| of_one + T::of(k as u32 + 1).ln() + circuit.loaded[k].ln_over_contact());
    all.sum::<T>() - T::of(0.5) * posterior.ln_determinant + ln_at_walls(table, circuit, posterior)
}

/// What walls make of that: where they are near, what is left is not normal along places.
fn ln_at_walls<T: Real, const K: usize>(
    table: &Table<'_>,
    circuit: &Circuit<T, K>,
    Posterior { covariance, step, .. }: &Posterior<T, K>,
) -> T {
    let across = Across::both(table);
    let radius_m = T::of(table.head().radius_m);
    let of_axis = |k: usize, axis: usize| {
        let i = PARAMETERS * k + axis;
        let error_m = radius_m * covariance[i][i].sqrt();
        let told = across[axis].told(circuit.loaded[k].spot.at_m[axis], radius_m * step[i], error_m);
        told.map_or(T::ZERO, |told| told.ln_share)
    };
    (0..circuit.count).map(|k| of_axis(k, 0) + of_axis(k, 1)).sum()
}

/// Contacts that readings place so badly that they may be elsewhere, a bit each; all where parameters are not determined.
pub(crate) fn loose<T: Real, const K: usize>(posterior: Option<&Posterior<T, K>>, count: usize) -> u32 {
    let Some(Posterior { covariance, .. }) = posterior else { return u32::MAX };
    let is_loose = |i: usize| covariance[i][i] > T::of(LOOSE) * T::of(LOOSE);
    let all = (0..count).filter(|k| (0..2).any(|d| is_loose(PARAMETERS * k + d)));
    all.fold(0, |all, k| all | 1 << k)
}

/// What readings say for each contact (squared deviations); without bound where parameters are not determined, but for what is read at all.
pub(crate) fn information<T: Real, const K: usize>(
    normal: &Normal<T, K>,
    posterior: Option<&Posterior<T, K>>,
) -> [T; K] {
    posterior.map_or(normal.said, |posterior| posterior.information(normal))
}

pub(crate) fn freedom<T: Real, const K: usize, const D: usize>(fit: &Fit<T, K, D>) -> T {
    T::of(PAID) * T::of(fit.scene.count as u32)
}

/// Sum of squares of so many normal numbers beyond which they are not those of noise.
pub(crate) fn limit<T: Real>(freedom: T) -> T {
    let freedom = freedom.max(T::ONE);
    freedom + T::of(MISFIT_DEVIATIONS) * (T::of(2.0) * freedom).sqrt()
}

pub(crate) fn is_misfit<T: Real, const K: usize, const D: usize>(fit: &Fit<T, K, D>, readings: T) -> bool {
    fit.cost > limit(readings - freedom(fit))
}

/// What is left of the evidence: of two explanations the lower one is believed.
pub(crate) fn score<T: Real, const K: usize, const D: usize>(fit: &Fit<T, K, D>) -> T {
    -fit.evidence
}

pub(crate) fn better<T: Real, const K: usize, const D: usize>(
    a: Option<Fit<T, K, D>>,
    b: Option<Fit<T, K, D>>,
) -> Option<Fit<T, K, D>> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if score(&b) < score(&a) { b } else { a }),
        (a, b) => a.or(b),
    }
}

/// The contact that the readings speak least for, if that is less than its price.
pub(crate) fn weakest<T: Real, const K: usize, const D: usize>(fit: &Fit<T, K, D>) -> Option<usize> {
    let all = &fit.information;
    let least = (0..fit.scene.count).min_by(|a, b| all[*a].total_cmp(&all[*b]))?;
    (all[least] < T::of(PRICE)).then_some(least)
}

/// Whether the readings do not even tell how strong one contact is to a factor of two: it is none.
pub(crate) fn is_nothing<T: Real, const K: usize, const D: usize>(fit: &Fit<T, K, D>) -> bool {
    fit.information.iter().take(fit.scene.count).any(|said| *said < T::of(NOTHING))
}
