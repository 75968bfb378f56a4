//! Where a contact would explain most of a frame: a look at every other place. This is for a first one; one more: `beside`.
//!
//! Readings of one contact, each row times its load `Z[g][g] + R`, are `Vcc (u_e - u_g + E[g][g] - E[e][g] + R)`, linear in the fields at its place.
//! Loads are had from the readings alone but for a factor, as `Z` is symmetric: `r[g][e] D[g] = r[e][g] D[e]` with `r = 1 - V / Vcc`. So the
//! scalar product with the pattern of a place is a sum over electrodes, and a look costs some dozen multiplications.

use crate::fit::{Working, held_ohm};
use crate::frame::Frame;
use crate::loaded::{PerElectrode, Spot};
use crate::real::Real;
use crate::solver::Task;
use crate::table::{MAX_ELECTRODES, Table};

/// About so many places are looked at.
const PLACES: usize = 256;
/// Candidates, and how far they are apart at least, in usual radii.
pub(crate) const CANDIDATES: usize = 3;
pub(crate) const APART: f32 = 2.0;
/// Smallest `1 - V / Vcc` that a ratio is taken of.
const LEAST_GAP: f32 = 1e-3;

/// A place where a contact would explain some of a frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Candidate<T> {
    pub spot: Spot<T>,
    /// By how much it would lower the sum of squares, in the linear theory.
    pub gain: T,
    /// Which contact it would take half of, if any, and where the other half would be.
    pub half_of: Option<(usize, Spot<T>)>,
}

/// The best candidates, the best first; those that are not there gain nothing.
pub(crate) type Candidates<T> = [Candidate<T>; CANDIDATES];

impl<T: Real> Candidate<T> {
    /// One that is not there.
    pub const NONE: Self = Self { spot: Spot::NONE, gain: T::ZERO, half_of: None };
}

/// None at all.
pub(crate) const fn no_candidates<T: Real>() -> Candidates<T> {
    [Candidate::NONE; CANDIDATES]
}

/// Takes a candidate among the best, unless a better one is near.
pub(crate) fn take<T: Real>(all: &mut Candidates<T>, new: Candidate<T>, apart_m: T) {
    let is_near = |old: &Candidate<T>| {
        let [x, y] = [0, 1].map(|d| old.spot.at_m[d] - new.spot.at_m[d]);
        old.gain > T::ZERO && x * x + y * y < apart_m * apart_m
    };
    let place = match all.iter().position(is_near) {
        Some(near) if all[near].gain >= new.gain => return,
        Some(near) => near,
        None if all[CANDIDATES - 1].gain >= new.gain => return,
        None => CANDIDATES - 1,
    };
    all[place] = new;
    let mut at = place;
    while at > 0 && all[at - 1].gain < all[at].gain {
        all.swap(at - 1, at);
        at -= 1;
    }
}

/// The places that are looked at.
pub(crate) fn places(table: &Table<'_>) -> impl Iterator<Item = (usize, usize)> {
    let [columns, rows] = table.cells();
    let mut stride = 1;
    while columns.div_ceil(stride) * rows.div_ceil(stride) > PLACES {
        stride += 1;
    }
    // In the middle of what is left over.
    let first = |count: usize| (count - 1) % stride / 2;
    let (first_i, first_j) = (first(columns), first(rows));
    (first_j..rows).step_by(stride).flat_map(move |j| (first_i..columns).step_by(stride).map(move |i| (i, j)))
}

/// Where one contact would explain most of a frame, where there is none yet. Counts the looks.
pub(crate) fn first<T: Real, const K: usize>(
    Task { table, frame, errors, .. }: Task<'_, T>,
    work: &mut Working<'_, K>,
) -> Candidates<T> {
    let (head, n) = (table.head(), table.electrodes());
    let scales = row_scales(frame, n, T::of(head.drive_v));
    // Scalar products with `u_e - u_g` for each electrode, and with the rest of the patterns.
    let (mut of_fields, mut of_rest) = ([T::ZERO; MAX_ELECTRODES], T::ZERO);
    let (mut rest_of_fields, mut rest_square, mut mean_pad) = ([T::ZERO; MAX_ELECTRODES], T::ZERO, T::ZERO);
    for g in 0..n {
        mean_pad += (T::of(table.pads_ohm(g, g)) + T::of(head.on_resistance_ohm)) / T::of(n as u32);
        for e in 0..n {
            let volts = scales[g] * frame.touch_v(g * n + e);
            let rest = T::of(table.pads_ohm(g, g)) - T::of(table.pads_ohm(e, g)) + T::of(head.on_resistance_ohm);
            of_fields[e] += volts;
            of_fields[g] -= volts;
            of_rest += rest * volts;
            rest_of_fields[e] += rest;
            rest_of_fields[g] -= rest;
            rest_square += rest * rest;
        }
    }
    let mut all = no_candidates();
    let mut fields_ohm = [T::ZERO; MAX_ELECTRODES];
    for (i, j) in places(table) {
        let at_m = table.middle_m(i, j);
        if !table.holds(at_m[0], at_m[1]) {
            continue;
        }
        work.looked_at_first();
        let own_ohm = table.rough(i, j, &mut fields_ohm);
        let (mut along, mut square, mut squares, mut sum) = (of_rest, rest_square, T::ZERO, T::ZERO);
        for e in 0..n {
            let field = fields_ohm[e];
            along += field * of_fields[e];
            square += T::of(2.0) * field * rest_of_fields[e];
            squares += field * field;
            sum += field;
        }
        square += T::of(2.0) * (T::of(n as u32) * squares - sum * sum);
        if along > T::ZERO && square > T::ZERO {
            let ohm = T::of(head.drive_v) * square / along - (mean_pad - T::of(2.0) * sum / T::of(n as u32));
            let spot = Spot { at_m, ln_ohm: held_ohm(ohm.max(own_ohm).ln(), table), ln_radius: T::ZERO };
            let gain = along * along / (square * errors.variance_v2);
            take(&mut all, Candidate { spot, gain, half_of: None }, T::of(APART) * T::of(head.radius_m));
        }
    }
    all
}

/// The loads of all rows but for their geometric mean.
fn row_scales<T: Real>(frame: &Frame<'_, T>, n: usize, drive_v: T) -> PerElectrode<T> {
    let mut scales = [T::ONE; MAX_ELECTRODES];
    let gap = |g: usize, e: usize| (T::ONE - frame.touch_v(g * n + e) / drive_v).max(T::of(LEAST_GAP));
    for (g, scale) in scales.iter_mut().enumerate().take(n) {
        let product: T = (0..n).map(|e| gap(e, g) / gap(g, e)).product();
        let root = product.powf(T::ONE / T::of(n as u32));
        *scale = if root.is_finite() { root } else { T::ONE };
    }
    scales
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Work;
    use crate::frame::Errors;
    use crate::samples::table;
    use crate::tests::{spot, volts};

    /// A contact at a place that is looked at is the best candidate, with the resistance that it has, and gains all that there is: no pattern gains
    /// more than the sum of squares of the frame.
    #[test]
    fn a_contact_at_a_place_that_is_looked_at_explains_its_frame() {
        let bytes = table();
        let table = Table::read(&bytes).unwrap();
        for (which, sheets) in [(22, 0.02), (57, 0.5), (84, 8.0)] {
            let (i, j) = places(&table).nth(which).unwrap();
            let at_m = table.middle_m(i, j);
            let truth = spot(at_m[0], at_m[1], sheets);
            let read = volts(&table, &[truth]);
            let frame = Frame::of_volts(&read);
            let errors = Errors::of(&frame, &table);
            let mut work = <Work>::default();
            let mut working = Working { done: &mut work, attend: &mut || () };
            let [best, ..] = first(Task { table: &table, frame: &frame, errors: &errors, unknown: None }, &mut working);
            let scales = row_scales(&frame, 16, table.head().drive_v);
            let all: f32 =
                (0..256).map(|i| (scales[i / 16] * frame.touch_v(i)).powi(2)).sum::<f32>() / errors.variance_v2;
            assert_eq!(best.spot.at_m, at_m);
            assert!((best.spot.ln_ohm - truth.ln_ohm).abs() < 0.03, "{best:?}, {truth:?}");
            assert!((0.999..1.001).contains(&(best.gain / all)), "{} of {all}", best.gain);
        }
    }
}
