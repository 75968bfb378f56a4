//! Where a contact would explain most of a frame: a look at every other place.
//!
//! Readings of one contact, each row times its load `Z[g][g] + R`, are `Vcc (u_e - u_g + E[g][g] - E[e][g] + R)`, linear in the fields at its place.
//! Loads are had from the readings alone but for a factor, as `Z` is symmetric: `r[g][e] D[g] = r[e][g] D[e]` with `r = 1 - V / Vcc`. So the
//! scalar product with the pattern of a place is a sum over electrodes, and a look costs some dozen multiplications.

use crate::circuit::{Circuit, MAX_CONTACTS, PerElectrode, Spot};
use crate::fit::{Working, held_ohm};
use crate::frame::{Errors, Frame, left_v};
use crate::normal::{Factor, MOST, Normal, Pattern, RowSlopes};
use crate::solver::Task;
use crate::table::{MAX_ELECTRODES, Table};

/// About so many places are looked at.
const PLACES: usize = 256;
/// Candidates, and how far they are apart at least, in usual radii.
pub(crate) const CANDIDATES: usize = 3;
const APART: f32 = 2.0;
/// Damping of the normal equations in what contacts that are there could do as well, and share of a pattern that is taken for new at least: the host's.
const DAMPING: f32 = 1e-3;
const LEAST_NEW: f32 = 0.02;
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

/// Where one more contact would explain most of what contacts that are fitted leave of a frame; nowhere, if they are not determined. Counts the looks.
pub(crate) fn beside(
    Task { table, frame, errors }: Task<'_>,
    circuit: &Circuit,
    normal: &Normal,
    work: &mut Working<'_>,
) -> Candidates {
    let (head, n) = (table.head(), table.electrodes());
    let Some(factor) = Factor::of(normal, DAMPING) else { return Candidates::default() };
    // Large: it is made where it stays, for a board's stack has no room for two.
    let weight = 1.0 / errors.variance_v2;
    let mut beside = Beside { table, circuit, factor, weight, rows: [Row::NONE; MAX_ELECTRODES] };
    let mut volts = [0.0; MAX_ELECTRODES];
    for (g, row) in beside.rows.iter_mut().enumerate().take(n) {
        circuit.row_v(table, g, &mut volts);
        row.take(table, (frame, errors), g, &volts);
        row.slopes = RowSlopes::new(circuit, g, head.drive_v, head.radius_m);
        row.sum_up(circuit, n, head.radius_m);
    }
    beside.candidates(work)
}

/// What is left of a frame by contacts, ready for looks at more.
struct Beside<'a, 't> {
    table: &'a Table<'t>,
    circuit: &'a Circuit,
    factor: Factor,
    /// One over the variance of a reading (1/V2).
    weight: f32,
    rows: [Row; MAX_ELECTRODES],
}

/// What is left of a row. Readings that say nothing are zero.
#[derive(Clone, Copy)]
struct Row {
    /// What is left, but for what an error of the grounded pad makes (V).
    left_v: PerElectrode,
    /// Predicted readings, as shares of the drive.
    shares: PerElectrode,
    /// What an error of the grounded pad makes (V).
    pad_v: PerElectrode,
    /// Weight of that (1/V2).
    less: f32,
    /// Readings that say something: a bit each.
    known: u32,
    slopes: RowSlopes,
    /// Of each contact the sums over readings that say something: of all alike, by their shares, and by what an error of the grounded pad makes.
    alike: [Pattern; MAX_CONTACTS],
    by_share: [Pattern; MAX_CONTACTS],
    by_pad: [Pattern; MAX_CONTACTS],
    /// The last of what is not predicted.
    pad_of_load_v: f32,
}

impl Row {
    const NONE: Self = Self {
        left_v: [0.0; MAX_ELECTRODES],
        shares: [0.0; MAX_ELECTRODES],
        pad_v: [0.0; MAX_ELECTRODES],
        less: 0.0,
        known: 0,
        slopes: RowSlopes::NONE,
        alike: [Pattern::NONE; MAX_CONTACTS],
        by_share: [Pattern::NONE; MAX_CONTACTS],
        by_pad: [Pattern::NONE; MAX_CONTACTS],
        pad_of_load_v: 0.0,
    };

    /// Readings that say something, of so many electrodes, or those that do not.
    fn electrodes(&self, n: usize, are_known: bool) -> impl Iterator<Item = usize> {
        let bits = if are_known { self.known } else { !self.known };
        (0..n).filter(move |e| bits >> e & 1 == 1)
    }

    /// Takes what is left of a row by predicted readings (V).
    fn take(&mut self, table: &Table<'_>, (frame, errors): (&Frame<'_>, &Errors), g: usize, volts: &PerElectrode) {
        let (head, n) = (table.head(), table.electrodes());
        let (mut pad, mut left_by_pad) = (0.0, 0.0);
        for e in 0..n {
            let Some(left_v) = left_v(frame, g * n + e, head.full_v, volts[e]) else { continue };
            let pad_v = errors.pad_v(table, frame, g, e);
            (self.left_v[e], self.pad_v[e], self.shares[e]) = (left_v, pad_v, volts[e] / head.drive_v);
            self.known |= 1 << e;
            pad += pad_v * pad_v;
            left_by_pad += left_v * pad_v;
            self.pad_of_load_v += pad_v * (1.0 - self.shares[e]);
        }
        self.less = 1.0 / (errors.variance_v2 + pad);
        let share = self.less * left_by_pad;
        (0..n).for_each(|e| self.left_v[e] -= share * self.pad_v[e]);
    }

    /// Sums up the patterns of contacts.
    fn sum_up(&mut self, circuit: &Circuit, n: usize, unit_m: f32) {
        for (k, one) in circuit.loaded.iter().enumerate().take(circuit.count) {
            let sum = |weights: &PerElectrode| {
                Pattern::of(one, unit_m, |values| (0..n).map(|e| weights[e] * values[e]).sum())
            };
            (self.by_share[k], self.by_pad[k]) = (sum(&self.shares), sum(&self.pad_v));
            self.alike[k] = Pattern::of(one, unit_m, |values| self.electrodes(n, true).map(|e| values[e]).sum());
        }
    }
}

impl Beside<'_, '_> {
    fn candidates(&self, work: &mut Working<'_>) -> Candidates {
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
            work.looked();
            let own_ohm = table.rough(i, j, &mut fields_ohm);
            self.circuit.potentials_ohm(table, at_m, &fields_ohm, &mut potentials_ohm);
            let (along, square) = self.look(&potentials_ohm);
            if along > 0.0 && square > 0.0 {
                let ln_ohm = held_ohm(libm::logf((square / along).max(own_ohm)), table);
                let gain = self.weight * along * along / square;
                take(&mut all, Candidate { spot: Spot { at_m, ln_ohm, ln_radius: 0.0 }, gain }, APART * head.radius_m);
            }
        }
        all
    }

    /// Scalar product of what is left with what a siemens at a place would change, and the square of that but for what the contacts that there are could do as
    /// well: with potentials `p` there, a siemens changes `Vcc p_g / D_g (p_e - Z[e][g] p_g / D_g)`.
    ///
    /// What the contacts could do is summed up of patterns that are the same in all rows, but for readings that say nothing.
    fn look(&self, potentials_ohm: &PerElectrode) -> (f32, f32) {
        let (circuit, head, n) = (self.circuit, self.table.head(), self.table.electrodes());
        // As differences, of which the large constant of a light contact takes no digits.
        let mean_ohm = potentials_ohm.iter().take(n).sum::<f32>() / n as f32;
        let apart = |e: usize| potentials_ohm[e] - mean_ohm;
        let mut whole = [Pattern::NONE; MAX_CONTACTS];
        for (whole, one) in whole.iter_mut().zip(&circuit.loaded).take(circuit.count) {
            *whole = Pattern::of(one, head.radius_m, |values| (0..n).map(|e| apart(e) * values[e]).sum());
        }
        let (mut along, mut square, mut shared) = (0.0, 0.0, [0.0; MOST]);
        for (g, row) in self.rows.iter().enumerate().take(n) {
            let (own, own_apart) = (potentials_ohm[g], apart(g));
            let per_ohm = head.drive_v * own / circuit.loads_ohm[g];
            let (mut by_pad, mut of_load) = (0.0, 0.0);
            for e in row.electrodes(n, true) {
                let change = per_ohm * (apart(e) - own_apart + row.shares[e] * own);
                along += change * row.left_v[e];
                square += change * change;
                by_pad += change * row.pad_v[e];
                of_load += change * (1.0 - row.shares[e]);
            }
            let of_pad = row.less * by_pad;
            square -= of_pad * by_pad;
            of_load -= of_pad * row.pad_of_load_v;
            for (k, one) in circuit.loaded.iter().enumerate().take(circuit.count) {
                let mut pattern = Pattern::NONE;
                pattern.add(per_ohm, &whole[k]);
                for e in row.electrodes(n, false) {
                    pattern.add(-per_ohm * apart(e), &Pattern::of(one, head.radius_m, |values| values[e]));
                }
                pattern.add(-per_ohm * own_apart, &row.alike[k]);
                pattern.add(per_ohm * own, &row.by_share[k]);
                pattern.add(-of_pad, &row.by_pad[k]);
                row.slopes.add(circuit, k, &pattern, of_load, &mut shared);
            }
        }
        let shared = shared.map(|product| self.weight * product);
        let new = square - self.factor.square(shared) / self.weight;
        (along, new.max(LEAST_NEW * square))
    }
}
