//! Where a contact would explain most of a frame: a look at every other place. This is for a first one; one more: `beside`.
//!
//! Readings of one contact, each row times its load `Z[g][g] + R`, are `Vcc (u_e - u_g + E[g][g] - E[e][g] + R)`, linear in the fields at its place.
//! Loads are had from the readings alone but for a factor, as `Z` is symmetric: `r[g][e] D[g] = r[e][g] D[e]` with `r = 1 - V / Vcc`. So the
//! scalar product with the pattern of a place is a sum over electrodes, and a look costs some dozen multiplications.

use crate::circuit::{PerElectrode, Spot};
use crate::fit::{Working, held_ohm};
use crate::frame::Frame;
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
pub(crate) struct Candidate {
    pub spot: Spot,
    /// By how much it would lower the sum of squares, in the linear theory.
    pub gain: f32,
}

/// The best candidates, the best first; those that are not there gain nothing.
pub(crate) type Candidates = [Candidate; CANDIDATES];

/// None at all.
pub(crate) const NO_CANDIDATES: Candidates =
    [Candidate { spot: Spot { at_m: [0.0; 2], ln_ohm: 0.0, ln_radius: 0.0 }, gain: 0.0 }; CANDIDATES];

/// Takes a candidate among the best, unless a better one is near.
pub(crate) fn take(all: &mut Candidates, new: Candidate, apart_m: f32) {
    let is_near = |old: &Candidate| {
        let [x, y] = [0, 1].map(|d| old.spot.at_m[d] - new.spot.at_m[d]);
        old.gain > 0.0 && x * x + y * y < apart_m * apart_m
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
pub(crate) fn first(Task { table, frame, errors }: Task<'_>, work: &mut Working<'_>) -> Candidates {
    let (head, n) = (table.head(), table.electrodes());
    let scales = row_scales(frame, n, head.drive_v);
    // Scalar products with `u_e - u_g` for each electrode, and with the rest of the patterns.
    let (mut of_fields, mut of_rest) = ([0.0; MAX_ELECTRODES], 0.0);
    let (mut rest_of_fields, mut rest_square, mut mean_pad) = ([0.0; MAX_ELECTRODES], 0.0, 0.0);
    for g in 0..n {
        mean_pad += (table.pads_ohm(g, g) + head.on_resistance_ohm) / n as f32;
        for e in 0..n {
            let volts = scales[g] * frame.touch_v(g * n + e);
            let rest = table.pads_ohm(g, g) - table.pads_ohm(e, g) + head.on_resistance_ohm;
            of_fields[e] += volts;
            of_fields[g] -= volts;
            of_rest += rest * volts;
            rest_of_fields[e] += rest;
            rest_of_fields[g] -= rest;
            rest_square += rest * rest;
        }
    }
    let mut all = Candidates::default();
    let mut fields_ohm = [0.0; MAX_ELECTRODES];
    for (i, j) in places(table) {
        let at_m = table.middle_m(i, j);
        if !table.holds(at_m[0], at_m[1]) {
            continue;
        }
        work.looked_at_first();
        let own_ohm = table.rough(i, j, &mut fields_ohm);
        let (mut along, mut square, mut squares, mut sum) = (of_rest, rest_square, 0.0, 0.0);
        for e in 0..n {
            let field = fields_ohm[e];
            along += field * of_fields[e];
            square += 2.0 * field * rest_of_fields[e];
            squares += field * field;
            sum += field;
        }
        square += 2.0 * (n as f32 * squares - sum * sum);
        if along > 0.0 && square > 0.0 {
            let ohm = head.drive_v * square / along - (mean_pad - 2.0 * sum / n as f32);
            let spot = Spot { at_m, ln_ohm: held_ohm(libm::logf(ohm.max(own_ohm)), table), ln_radius: 0.0 };
            let gain = along * along / (square * errors.variance_v2);
            take(&mut all, Candidate { spot, gain }, APART * head.radius_m);
        }
    }
    all
}

/// The loads of all rows but for their geometric mean.
fn row_scales(frame: &Frame<'_>, n: usize, drive_v: f32) -> PerElectrode {
    let mut scales = [1.0; MAX_ELECTRODES];
    let gap = |g: usize, e: usize| (1.0 - frame.touch_v(g * n + e) / drive_v).max(LEAST_GAP);
    for (g, scale) in scales.iter_mut().enumerate().take(n) {
        let product: f32 = (0..n).map(|e| gap(e, g) / gap(g, e)).product();
        let root = libm::powf(product, 1.0 / n as f32);
        *scale = if root.is_finite() { root } else { 1.0 };
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
            let mut work = Work::default();
            let mut working = Working { done: &mut work, attend: &mut || () };
            let [best, ..] = first(Task { table: &table, frame: &frame, errors: &errors }, &mut working);
            let scales = row_scales(&frame, 16, table.head().drive_v);
            let all: f32 =
                (0..256).map(|i| (scales[i / 16] * frame.touch_v(i)).powi(2)).sum::<f32>() / errors.variance_v2;
            assert_eq!(best.spot.at_m, at_m);
            assert!((best.spot.ln_ohm - truth.ln_ohm).abs() < 0.02, "{best:?}, {truth:?}");
            assert!((0.999..1.001).contains(&(best.gain / all)), "{} of {all}", best.gain);
        }
    }
}
