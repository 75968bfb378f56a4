//! Where a contact would explain most of a frame: a look at every other place.
//!
//! Readings of one contact, each row times its load `Z[g][g] + R`, are `Vcc (u_e - u_g + E[g][g] - E[e][g] + R)`, linear in the fields at its place.
//! Loads are had from the readings alone but for a factor, as `Z` is symmetric: `r[g][e] D[g] = r[e][g] D[e]` with `r = 1 - V / Vcc`. So the
//! scalar product with the pattern of a place is a sum over electrodes, and a look costs some dozen multiplications.

use crate::circuit::{Circuit, PerElectrode, Spot};
use crate::fit::held_ohm;
use crate::frame::{Errors, Frame, left_v};
use crate::table::{MAX_ELECTRODES, Table};

/// About so many places are looked at.
const PLACES: usize = 256;
/// Candidates, and how far they are apart at least, in usual radii.
pub(crate) const CANDIDATES: usize = 3;
const APART: f32 = 2.0;
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

/// Takes a candidate among the best, unless a better one is near.
fn take(all: &mut Candidates, new: Candidate, apart_m: f32) {
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
fn places(table: &Table<'_>) -> impl Iterator<Item = (usize, usize)> {
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
pub(crate) fn first(table: &Table<'_>, frame: &Frame<'_>, errors: &Errors, looks: &mut u32) -> Candidates {
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
        *looks += 1;
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

/// What is left of a frame by contacts, ready for looks at more.
pub(crate) struct Beside<'a, 't> {
    table: &'a Table<'t>,
    circuit: &'a Circuit,
    /// What is left, but for what errors of pads make (V).
    left_v: [PerElectrode; MAX_ELECTRODES],
    /// Predicted readings, as shares of the drive.
    shares: [PerElectrode; MAX_ELECTRODES],
}

impl<'a, 't> Beside<'a, 't> {
    /// Of contacts that are fitted.
    pub fn new(table: &'a Table<'t>, circuit: &'a Circuit, frame: &Frame<'_>, errors: &Errors) -> Self {
        let (head, n) = (table.head(), table.electrodes());
        let none = [[0.0; MAX_ELECTRODES]; MAX_ELECTRODES];
        let mut all = Self { table, circuit, left_v: none, shares: none };
        for g in 0..n {
            let (left, volts) = (&mut all.left_v[g], &mut all.shares[g]);
            circuit.row_v(table, g, volts);
            let mut pads = [0.0; MAX_ELECTRODES];
            let (mut by_pad, mut pad) = (0.0, 0.0);
            for e in 0..n {
                let left_v = left_v(frame, g * n + e, head.full_v, volts[e]);
                if let Some(left_v) = left_v.filter(|_| e != g) {
                    pads[e] = errors.pads[g] * (head.drive_v - frame.touch_v(g * n + e)).max(0.0);
                    by_pad += left_v * pads[e];
                    pad += pads[e] * pads[e];
                }
                left[e] = left_v.unwrap_or_default();
                volts[e] /= head.drive_v;
            }
            let less = by_pad / (errors.variance_v2 + pad);
            left.iter_mut().zip(pads).for_each(|(left_v, pad_v)| *left_v -= less * pad_v);
        }
        all
    }

    /// Where one more contact would explain most. Counts the looks.
    pub fn candidates(&self, errors: &Errors, looks: &mut u32) -> Candidates {
        let (table, head) = (self.table, self.table.head());
        let mut all = Candidates::default();
        let (mut fields_ohm, mut potentials_ohm) = ([0.0; MAX_ELECTRODES], [0.0; MAX_ELECTRODES]);
        for (i, j) in places(table) {
            let at_m = table.middle_m(i, j);
            let is_free = |spot: &Spot| {
                let [x, y] = [0, 1].map(|d| at_m[d] - spot.at_m[d]);
                x * x + y * y > head.radius_m * head.radius_m
            };
            let mut there = self.circuit.loaded.iter().take(self.circuit.count).map(|one| &one.spot);
            if !table.holds(at_m[0], at_m[1]) || !there.all(is_free) {
                continue;
            }
            *looks += 1;
            let own_ohm = table.rough(i, j, &mut fields_ohm);
            self.circuit.potentials_ohm(table, at_m, &fields_ohm, &mut potentials_ohm);
            let (along, square) = self.look(&potentials_ohm);
            if along > 0.0 && square > 0.0 {
                let ln_ohm = held_ohm(libm::logf((square / along).max(own_ohm)), table);
                let gain = along * along / (square * errors.variance_v2);
                take(&mut all, Candidate { spot: Spot { at_m, ln_ohm, ln_radius: 0.0 }, gain }, APART * head.radius_m);
            }
        }
        all
    }

    /// Scalar product of what is left with what a siemens at a place would change, and the square of that: with potentials `p` there,
    /// `Vcc p_g / D_g (p_e - Z[e][g] p_g / D_g)`.
    fn look(&self, potentials_ohm: &PerElectrode) -> (f32, f32) {
        let n = self.table.electrodes();
        let (mut along, mut square) = (0.0, 0.0);
        for g in 0..n {
            let own = potentials_ohm[g];
            let (mut along_row, mut square_row) = (0.0, 0.0);
            for e in 0..n {
                // As differences, of which the large constant of a light contact takes no digits.
                let change = potentials_ohm[e] - own + self.shares[g][e] * own;
                along_row += change * self.left_v[g][e];
                square_row += change * change;
            }
            let per_ohm = self.table.head().drive_v * own / self.circuit.loads_ohm[g];
            along += per_ohm * along_row;
            square += per_ohm * per_ohm * square_row;
        }
        (along, square)
    }
}
