//! Where a contact would explain most of a frame: a look at every other place.
//!
//! Readings of one contact, each row times its load `Z[g][g] + R`, are `Vcc (u_e - u_g + E[g][g] - E[e][g] + R)`, linear in the fields at its place.
//! Loads are had from the readings alone but for a factor, as `Z` is symmetric: `r[g][e] D[g] = r[e][g] D[e]` with `r = 1 - V / Vcc`. So the
//! scalar product with the pattern of a place is a sum over electrodes, and a look costs some dozen multiplications.

use crate::circuit::{Circuit, PerElectrode, Spot};
use crate::fit::{Working, held_ohm};
use crate::frame::{Errors, Frame, left_v};
use crate::normal::{Factor, MOST, Normal, RowSlopes};
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
pub(crate) fn first(table: &Table<'_>, frame: &Frame<'_>, errors: &Errors, work: &mut Working<'_>) -> Candidates {
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

/// What is left of a frame by contacts, ready for looks at more.
pub(crate) struct Beside<'a, 't> {
    table: &'a Table<'t>,
    circuit: &'a Circuit,
    factor: Factor,
    /// One over the variance of a reading (1/V2).
    weight: f32,
    rows: [Row; MAX_ELECTRODES],
}

/// What is left of a row.
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
}

impl Row {
    const NONE: Self = Self {
        left_v: [0.0; MAX_ELECTRODES],
        shares: [0.0; MAX_ELECTRODES],
        pad_v: [0.0; MAX_ELECTRODES],
        less: 0.0,
        known: 0,
    };

    fn is_known(&self, e: usize) -> bool {
        self.known >> e & 1 == 1
    }

    /// Takes what an error of the grounded pad makes off volts.
    fn without_pad(&self, volts: &mut [f32]) {
        let product: f32 = volts.iter().zip(&self.pad_v).map(|(volts, pad_v)| volts * pad_v).sum();
        volts.iter_mut().zip(&self.pad_v).for_each(|(volts, pad_v)| *volts -= self.less * product * pad_v);
    }
}

impl<'a, 't> Beside<'a, 't> {
    /// Of contacts that are fitted; `None` if they are not determined.
    pub fn new(
        table: &'a Table<'t>,
        circuit: &'a Circuit,
        frame: &Frame<'_>,
        errors: &Errors,
        normal: &Normal,
    ) -> Option<Self> {
        let (head, n) = (table.head(), table.electrodes());
        let factor = Factor::of(normal, DAMPING)?;
        let mut all =
            Self { table, circuit, factor, weight: 1.0 / errors.variance_v2, rows: [Row::NONE; MAX_ELECTRODES] };
        for (g, row) in all.rows.iter_mut().enumerate().take(n) {
            circuit.row_v(table, g, &mut row.shares);
            let mut pad = 0.0;
            for e in 0..n {
                if let Some(left_v) = left_v(frame, g * n + e, head.full_v, row.shares[e]) {
                    row.left_v[e] = left_v;
                    row.known |= 1 << e;
                    row.pad_v[e] = errors.pad_v(table, frame, g, e);
                    pad += row.pad_v[e] * row.pad_v[e];
                }
                row.shares[e] /= head.drive_v;
            }
            row.less = 1.0 / (errors.variance_v2 + pad);
            let mut left_v = row.left_v;
            row.without_pad(&mut left_v[..n]);
            row.left_v = left_v;
        }
        Some(all)
    }

    /// Where one more contact would explain most. Counts the looks.
    pub fn candidates(&self, errors: &Errors, work: &mut Working<'_>) -> Candidates {
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
                let gain = along * along / (square * errors.variance_v2);
                take(&mut all, Candidate { spot: Spot { at_m, ln_ohm, ln_radius: 0.0 }, gain }, APART * head.radius_m);
            }
        }
        all
    }

    /// Scalar product of what is left with what a siemens at a place would change, and the square of that but for what the contacts that there are could do as
    /// well: with potentials `p` there, a siemens changes `Vcc p_g / D_g (p_e - Z[e][g] p_g / D_g)`.
    fn look(&self, potentials_ohm: &PerElectrode) -> (f32, f32) {
        let (head, n) = (self.table.head(), self.table.electrodes());
        let (mut along, mut square, mut shared) = (0.0, 0.0, [0.0; MOST]);
        for (g, row) in self.rows.iter().enumerate().take(n) {
            let own = potentials_ohm[g];
            let per_ohm = head.drive_v * own / self.circuit.loads_ohm[g];
            let mut all = [0.0; MAX_ELECTRODES];
            for e in (0..n).filter(|e| row.is_known(*e)) {
                // As differences, of which the large constant of a light contact takes no digits.
                all[e] = per_ohm * (potentials_ohm[e] - own + row.shares[e] * own);
                along += all[e] * row.left_v[e];
            }
            let mut new = all;
            row.without_pad(&mut new[..n]);
            square += (0..n).map(|e| all[e] * new[e]).sum::<f32>();
            let slopes = RowSlopes::new(self.circuit, g, head.drive_v, head.radius_m);
            slopes.add_products(self.circuit, &new[..n], &row.shares, &mut shared);
        }
        let shared = shared.map(|product| self.weight * product);
        let new = square - self.factor.square(shared) / self.weight;
        (along, new.max(LEAST_NEW * square))
    }
}
