//! Where one more contact would explain most of what others leave of a frame.
//!
//! With potentials `p` at a place, a siemens there changes the reading of electrode `e` while `g` is grounded by `c (p_e - p_g + s_e p_g)`, with `c = Vcc p_g / D_g`
//! and the predicted share `s` of the drive. That is a sum of three patterns over the electrodes, of which two are the same at all places. So what a look needs of
//! a row are its scalar products with `p`; all others are summed up once. Likewise what the contacts that there are could do as well: their derivatives are
//! bilinear in what the electrode read and the grounded one have of them.

use crate::circuit::Circuit;
use crate::detector::Detector;
use crate::fit::{Working, held_ohm};
use crate::frame::{Errors, Frame, left_v};
use crate::loaded::{PerElectrode, Spot};
use crate::normal::Normal;
use crate::posterior::Factor;
use crate::real::Real;
use crate::scan::{APART, Candidate, Candidates, places, take};
use crate::slopes::{Pattern, RowSlopes};
use crate::solver::Task;
use crate::table::{MAX_ELECTRODES, Table};
use crate::vector::{PARAMETERS, Vector};

/// Damping of the normal equations in what contacts that are there could do as well, and share of a pattern that is taken for new at least: the host's.
const DAMPING: f32 = 1e-3;
const LEAST_NEW: f32 = 0.02;

/// Places that are looked at in one piece of work: with what is got ready for them, as many operations as two looks at three contacts.
const A_PIECE: usize = 40;

/// Takes the places among some where one more contact would explain most of what contacts that are fitted leave of a frame among the best, and counts the looks;
/// returns the number of the place to go on at, if there is one. None are taken where the contacts are not determined.
pub(crate) fn beside<T: Real, const K: usize>(
    Task { table, frame, errors, .. }: Task<'_, T>,
    circuit: &Circuit<T, K>,
    normal: &Normal<T, K>,
    from: usize,
    best: &mut Candidates<T>,
    work: &mut Working<'_, K>,
) -> Option<usize> {
    let (head, n) = (table.head(), table.electrodes());
    let factor = Factor::of(normal, T::of(DAMPING))?;
    // Large: it is made where it stays, for a board's stack has no room for two, and its state for none.
    let weight = T::ONE / errors.variance_v2;
    let mut beside = Beside { table, circuit, factor, weight, rows: [Row::NONE; MAX_ELECTRODES] };
    let mut volts = [T::ZERO; MAX_ELECTRODES];
    for (g, row) in beside.rows.iter_mut().enumerate().take(n) {
        circuit.row_v(&Detector::described(table), g, &mut volts);
        row.take((frame, errors), g, (T::of(head.drive_v), T::of(head.full_v)), &volts[..n]);
        row.slopes = RowSlopes::new(circuit, g, T::of(head.drive_v), T::of(head.radius_m));
        row.sum_up(circuit, g, T::of(head.radius_m), n);
    }
    beside.look_from(from, best, work)
}

/// What is left of a frame by contacts, ready for looks at more.
struct Beside<'a, 't, T, const K: usize> {
    table: &'a Table<'t>,
    circuit: &'a Circuit<T, K>,
    factor: Factor<T, K>,
    /// One over the variance of a reading (1/V2).
    weight: T,
    rows: [Row<T, K>; MAX_ELECTRODES],
}

/// What is left of a row. Readings that say nothing are zero, and no part of any sum.
#[derive(Clone, Copy)]
struct Row<T, const K: usize> {
    /// What is left, but for what an error of the grounded pad makes (V).
    left_v: PerElectrode<T>,
    /// Predicted readings, as shares of the drive.
    shares: PerElectrode<T>,
    /// Readings that say something: a bit each, and how many.
    known: u32,
    count: T,
    /// Sums of the shares, of their squares, of what is left, and of that times the shares.
    share: T,
    share_square: T,
    left: T,
    left_share: T,
    /// What an error of the grounded pad makes of a reading, over what its share leaves of one (V): of all but the grounded electrode's.
    pad_v: T,
    /// Its square, summed up over that (V), and its weight (1/V2).
    pad_of_load_v: T,
    less: T,
    /// Share of the grounded electrode's own reading, if that says something.
    own_share: T,
    slopes: RowSlopes<T, K>,
    /// Derivatives by all parameters, summed up: of all readings alike, by their shares, and by what an error of the grounded pad makes of them.
    alike: Vector<T, K>,
    by_share: Vector<T, K>,
    by_pad: Vector<T, K>,
}

impl<T: Real, const K: usize> Row<T, K> {
    const NONE: Self = Self {
        left_v: [T::ZERO; MAX_ELECTRODES],
        shares: [T::ZERO; MAX_ELECTRODES],
        known: 0,
        count: T::ZERO,
        share: T::ZERO,
        share_square: T::ZERO,
        left: T::ZERO,
        left_share: T::ZERO,
        pad_v: T::ZERO,
        pad_of_load_v: T::ZERO,
        less: T::ZERO,
        own_share: T::ZERO,
        slopes: RowSlopes::NONE,
        alike: Vector::ZERO,
        by_share: Vector::ZERO,
        by_pad: Vector::ZERO,
    };

    /// Takes what is left of a row by predicted readings (V).
    fn take(&mut self, (frame, errors): (&Frame<'_, T>, &Errors<T>), g: usize, (drive_v, full_v): (T, T), volts: &[T]) {
        self.pad_v = errors.pads[g] * drive_v;
        let mut left_of_load = T::ZERO;
        for (e, predicted_v) in volts.iter().enumerate() {
            let Some(left_v) = left_v(frame, g * volts.len() + e, full_v, *predicted_v) else { continue };
            let share = *predicted_v / drive_v;
            (self.left_v[e], self.shares[e]) = (left_v, share);
            self.known |= 1 << e;
            self.count += T::ONE;
            self.share += share;
            self.share_square += share * share;
            if e == g {
                self.own_share = share;
            } else {
                left_of_load += left_v * (T::ONE - share);
                self.pad_of_load_v += self.pad_v * (T::ONE - share) * (T::ONE - share);
            }
        }
        self.less = T::ONE / (errors.variance_v2 + self.pad_v * self.pad_of_load_v);
        let pads = self.less * self.pad_v * self.pad_v * left_of_load;
        for e in (0..volts.len()).filter(|e| self.known >> e & 1 == 1) {
            if e != g {
                self.left_v[e] -= pads * (T::ONE - self.shares[e]);
            }
            self.left += self.left_v[e];
            self.left_share += self.left_v[e] * self.shares[e];
        }
    }

    /// Sums up the derivatives by the parameters of contacts.
    fn sum_up(&mut self, circuit: &Circuit<T, K>, g: usize, unit_m: T, n: usize) {
        for (k, one) in circuit.loaded.iter().enumerate().take(circuit.count) {
            let known = |values: &[T]| (0..n).filter(|e| self.known >> e & 1 == 1).map(|e| values[e]).sum();
            let by_share = |values: &[T]| (0..n).map(|e| self.shares[e] * values[e]).sum();
            let alike = Pattern::of(one, unit_m, known);
            let by_share = Pattern::of(one, unit_m, by_share);
            let mut by_pad = Pattern::NONE;
            by_pad.add(self.pad_v, &alike);
            by_pad.add(-self.pad_v, &by_share);
            if self.known >> g & 1 == 1 {
                by_pad.add(self.pad_v * (self.own_share - T::ONE), &self.slopes.own[k]);
            }
            for (pattern, sums) in
                [(alike, &mut self.alike), (by_share, &mut self.by_share), (by_pad, &mut self.by_pad)]
            {
                let changes_ohm = pattern.changes_ohm(&self.slopes.own[k], one);
                sums.0[k] = changes_ohm;
            }
        }
    }
}

impl<T: Real, const K: usize> Beside<'_, '_, T, K> {
    fn look_from(&self, from: usize, best: &mut Candidates<T>, work: &mut Working<'_, K>) -> Option<usize> {
        let (table, head) = (self.table, self.table.head());
        let (mut fields_ohm, mut potentials_ohm) = ([T::ZERO; MAX_ELECTRODES], [T::ZERO; MAX_ELECTRODES]);
        let mut looks = 0;
        for (number, (i, j)) in places(table).enumerate().skip(from) {
            let at_m = table.middle_m(i, j);
            let is_free = |spot: &Spot<T>| {
                let [x, y] = [0, 1].map(|d| at_m[d] - spot.at_m[d]);
                x * x + y * y > T::of(head.radius_m) * T::of(head.radius_m)
            };
            let mut there = self.circuit.loaded.iter().take(self.circuit.count).map(|one| &one.spot);
            if !table.holds(at_m[0], at_m[1]) || !there.all(is_free) {
                continue;
            }
            if looks == A_PIECE {
                return Some(number);
            }
            looks += 1;
            work.looked();
            let own_ohm = table.rough(i, j, &mut fields_ohm);
            self.circuit.potentials_ohm(&Detector::described(table), at_m, &fields_ohm, &mut potentials_ohm);
            let (along, square) = self.look(&potentials_ohm[..table.electrodes()]);
            if along > T::ZERO && square > T::ZERO {
                let ln_ohm = held_ohm(((square / along).max(own_ohm)).ln(), table);
                let gain = self.weight * along * along / square;
                take(
                    best,
                    Candidate { spot: Spot { at_m, ln_ohm, ln_radius: T::ZERO }, gain, half_of: None },
                    T::of(APART) * T::of(head.radius_m),
                );
            }
        }
        None
    }

    /// Scalar product of what is left with what a siemens at a place with these potentials would change, and the square of that but for what the contacts that there
    /// are could do as well.
    fn look(&self, potentials_ohm: &[T]) -> (T, T) {
        let (circuit, head, n) = (self.circuit, self.table.head(), potentials_ohm.len());
        // As differences, of which the large constant of a light contact takes no digits.
        let mean_ohm = potentials_ohm.iter().copied().sum::<T>() / T::of(n as u32);
        let mut apart = [T::ZERO; MAX_ELECTRODES];
        apart.iter_mut().zip(potentials_ohm).for_each(|(apart, ohm)| *apart = *ohm - mean_ohm);
        let (mut along, mut square, mut shared) = (T::ZERO, T::ZERO, Vector::ZERO);
        // What the grounded electrodes have of the contacts, by what a potential changes in their rows.
        let mut grounded = [Pattern::NONE; K];
        for (g, row) in self.rows.iter().enumerate().take(n) {
            let (own, down) = (potentials_ohm[g], -apart[g]);
            let per_ohm = T::of(head.drive_v) * own / circuit.loads_ohm[g];
            let (mut by_left, mut by_share, mut sum, mut squares) = (T::ZERO, T::ZERO, T::ZERO, T::ZERO);
            for e in 0..n {
                by_left += apart[e] * row.left_v[e];
                by_share += apart[e] * row.shares[e];
                if row.known >> e & 1 == 1 {
                    sum += apart[e];
                    squares += apart[e] * apart[e];
                }
            }
            along += per_ohm * (by_left + down * row.left + own * row.left_share);
            let of_own = own * row.share_square + T::of(2.0) * (by_share + down * row.share);
            square += per_ohm * per_ohm * (squares + down * (down * row.count + T::of(2.0) * sum) + own * of_own);
            let changes = sum + down * row.count + own * row.share;
            let of_load = per_ohm * (changes - by_share - down * row.share - own * row.share_square);
            let by_pad = row.pad_v * (of_load - per_ohm * own * row.own_share * (T::ONE - row.own_share));
            let of_pad = row.less * by_pad;
            square -= of_pad * by_pad;
            let of_load = of_load - of_pad * row.pad_of_load_v;
            let slopes = &row.slopes;
            for i in 0..PARAMETERS * circuit.count {
                let moved = per_ohm * (down * row.alike[i] + own * row.by_share[i]) - of_pad * row.by_pad[i];
                shared[i] += slopes.per_ohm * (moved - of_load * slopes.own_ohm[i]);
            }
            for (k, grounded) in grounded.iter_mut().enumerate().take(circuit.count) {
                grounded.add(slopes.per_ohm * per_ohm, &slopes.own[k]);
            }
            self.leave_out(row, per_ohm, &apart[..n], &mut shared);
        }
        for (k, one) in circuit.loaded.iter().enumerate().take(circuit.count) {
            let whole = Pattern::of(one, T::of(head.radius_m), |values| (0..n).map(|e| apart[e] * values[e]).sum());
            add(&mut shared, k, T::ONE, whole.changes_ohm(&grounded[k], one));
        }
        shared.iter_mut().for_each(|product| *product *= self.weight);
        let new = square - self.factor.square(shared) / self.weight;
        (along, new.max(T::of(LEAST_NEW) * square))
    }

    /// Takes off the shares that readings of a row that say nothing would have in the scalar products.
    fn leave_out(&self, row: &Row<T, K>, per_ohm: T, apart: &[T], shared: &mut Vector<T, K>) {
        let unknown = (0..apart.len()).filter(|e| row.known >> e & 1 == 0);
        if unknown.clone().next().is_none() {
            return;
        }
        for (k, one) in self.circuit.loaded.iter().enumerate().take(self.circuit.count) {
            let sum = |values: &[T]| unknown.clone().map(|e| apart[e] * values[e]).sum();
            let pattern = Pattern::of(one, T::of(self.table.head().radius_m), sum);
            let share = -row.slopes.per_ohm * per_ohm;
            add(shared, k, share, pattern.changes_ohm(&row.slopes.own[k], one));
        }
    }
}

/// Adds so much of derivatives by a contact's parameters.
fn add<T: Real, const K: usize>(sums: &mut Vector<T, K>, k: usize, share: T, changes: [T; PARAMETERS]) {
    sums.0[k].iter_mut().zip(changes).for_each(|(sum, change)| *sum += share * change);
}
