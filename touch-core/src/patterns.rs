//! How the readings of contacts change with what is not known of the detector.
//!
//! With the currents `U` of contacts, a step of a direction changes the impedances by
//!
//! ```text
//! dZ = dE - dF' U - U' dF + U' dN U
//! ```
//!
//! (see [`circuit`](crate::circuit)), less what couples of currents change, and the readings by `((Vcc - V) dZ[g][g] - Vcc dZ[e][g]) / (Z[g][g] + R)`. What the contacts' own
//! fields change is their resistance's, which is fitted, and their moment's. Of what drives a couple, the change of the field's slope between contacts is left out.

use crate::circuit::Circuit;
use crate::detector::Detector;
use crate::fields::Stencil;
use crate::lanes::at_once;
use crate::local::Sorted;
use crate::products::{add, dot};
use crate::real::Real;
use crate::table::{MAX_ELECTRODES, MAX_KNOTS};
use crate::unknown::{Change, Direction, Fields, Unknown, of_pair, pairs};

/// The readings of contacts, with what their changes need.
pub(crate) struct Patterns<'a, T, const K: usize> {
    detector: &'a Detector<'a, T>,
    unknown: &'a Unknown<'a>,
    circuit: &'a Circuit<T, K>,
    /// What each table changes at contacts.
    fields: &'a [f32],
    /// What each table changes of the field between a contact and one before it (ohm): [those](pairs) of the first table, then of the next.
    between_ohm: &'a [f32],
    /// What is there to be read (V), in the readings' order.
    there_v: &'a [T],
}

/// Terms of `dZ`: of each contact what changes its fields, and its two couples, twice.
const TERMS: usize = 6;
/// Numbers that are summed up at once.
const AT_ONCE: usize = 8;

impl<'a, T: Real, const K: usize> Patterns<'a, T, K> {
    /// Of contacts that are solved on a detector; `there_v` is what is there to be read (V), and the others are room for what tables change.
    pub fn new(
        detector: &'a Detector<'a, T>,
        unknown: &'a Unknown<'a>,
        circuit: &'a Circuit<T, K>,
        there_v: &'a [T],
        fields: &'a mut [f32],
        between_ohm: &'a mut [f32],
    ) -> Self {
        let (table, n) = (detector.table, detector.table.electrodes());
        let rows = fields.chunks_exact_mut(unknown.of_place(n).max(1));
        for (one, row) in circuit.loaded.iter().zip(rows).take(circuit.count) {
            at_once(
                #[inline(always)]
                || unknown.all_at(n, &Stencil::of(table, one.spot.at_m), row),
            );
        }
        let pairs_of = (0..circuit.count).flat_map(|k| (0..k).map(move |l| [k, l]));
        for (pair, [one, other]) in pairs_of.map(|pair| pair.map(|k| &circuit.loaded[k])).enumerate() {
            let by_ways: [f32; MAX_KNOTS] =
                table.by_ways(one.spot.at_m, other.spot.at_m).map(|weight| weight.to_f32().unwrap_or(0.0));
            let form = form(&one.described_ohm[..n], &other.described_ohm[..n]);
            let tables =
                unknown.distances_ohm.chunks_exact(table.knots()).zip(unknown.walls.chunks_exact(pairs(n + 1)));
            at_once(
                #[inline(always)]
                || {
                    for (which, (distances, walls)) in tables.enumerate() {
                        between_ohm[which * pairs(K - 1) + pair] =
                            dot(distances, &by_ways[..distances.len()]) + dot(walls, &form[..walls.len()]);
                    }
                },
            );
        }
        Self { detector, unknown, circuit, fields, between_ohm, there_v }
    }

    /// Changes of readings (V) by one deviation in each direction: a row of readings for each common one, then pairs of [layers](crate::local); `gains` is room for a row.
    pub fn write<const D: usize>(&self, sorted: &Sorted<D>, volts: &mut [T], gains: &mut [T]) {
        at_once(
            #[inline(always)]
            || {
                let (n, readings) = (self.detector.table.electrodes(), self.there_v.len());
                for (gains, there_v) in gains.chunks_exact_mut(n).zip(self.there_v.chunks_exact(n)) {
                    self.detector.gains(there_v, gains);
                }
                let (common, layers) = volts.split_at_mut(sorted.commons * readings);
                for (number, row) in sorted.common().zip(common.chunks_exact_mut(readings)) {
                    self.write_common(number, gains, row);
                }
                for (layer, pair) in layers.chunks_exact_mut(2 * readings).enumerate().take(sorted.layers) {
                    pair.fill(T::ZERO);
                    sorted.local(layer).for_each(|(e, number)| self.write_local(number, e, gains, pair));
                }
            },
        );
    }

    #[inline(always)]
    fn write_common(&self, number: usize, gains: &[T], row: &mut [T]) {
        let direction = &self.unknown.directions[number];
        row.fill(T::ZERO);
        let step = self.detector.moved.as_ref().map_or(T::ZERO, |(_, moved)| moved.steps[number]);
        let tables = [(direction.table, T::ONE), (direction.square, step)];
        for (which, share) in tables.into_iter().filter_map(|(which, share)| Some((which?, share))) {
            self.add_fields(which, share, row);
        }
        let change = |index: usize, times: T, volts: T| row[index] = times * row[index] + volts;
        self.add_changes(direction, gains, change, 0..self.there_v.len());
    }

    /// What a direction changes in the readings of an electrode, and in those while it is grounded.
    #[inline(always)]
    fn write_local(&self, number: usize, e: usize, gains: &[T], pair: &mut [T]) {
        let (n, direction) = (self.detector.table.electrodes(), &self.unknown.directions[number]);
        let (mut down, mut across) = ([T::ZERO; MAX_ELECTRODES], [T::ZERO; MAX_ELECTRODES]);
        if let Some(which) = direction.table {
            self.add_field(which, e, &mut down[..n], &mut across[..n]);
        }
        // Its own reading while it is grounded is among the latter.
        let change = |index: usize, times: T, volts: T| {
            let to = if index / n == e { &mut across[index % n] } else { &mut down[index / n] };
            *to = times * *to + volts;
        };
        let of_grounded = e * n..(e + 1) * n;
        self.add_changes(direction, gains, change, of_grounded.chain((0..n).filter(|g| *g != e).map(|g| g * n + e)));
        let (layer_down, layer_across) = pair.split_at_mut(n * n);
        for (i, (down, across)) in down.into_iter().zip(across).enumerate().take(n) {
            (layer_down[i * n + e], layer_across[i * n + e]) = (down, across);
        }
    }

    /// Takes what is there in readings to what channels make of it, and adds what needs no fields: calls with a reading, how many times it is taken, and what is added (V).
    #[inline(always)]
    fn add_changes(
        &self,
        direction: &Direction,
        gains: &[T],
        mut change_by: impl FnMut(usize, T, T),
        readings: impl Iterator<Item = usize>,
    ) {
        let changes = self.unknown.changes_of(direction);
        for change in changes.iter().filter(|change| change.is_there()) {
            let readings = self.readings_of(*change);
            readings.for_each(|index| change_by(index, T::ONE, self.changed_there_v(*change, index)));
        }
        readings.for_each(|index| change_by(index, gains[index], T::ZERO));
        for change in changes.iter().filter(|change| !change.is_there()) {
            let readings = self.readings_of(*change);
            readings.for_each(|index| change_by(index, T::ONE, self.changed_read_v(*change, index)));
        }
    }

    /// Adds so much of what a table changes.
    #[inline(always)]
    fn add_fields(&self, which: usize, share: T, volts: &mut [T]) {
        let (circuit, n) = (self.circuit, self.detector.table.electrodes());
        if let Some(e) = self.unknown.electrode_of(which) {
            let (mut down, mut across) = ([T::ZERO; MAX_ELECTRODES], [T::ZERO; MAX_ELECTRODES]);
            self.add_field(which, e, &mut down[..n], &mut across[..n]);
            for (i, (down, across)) in down.into_iter().zip(across).enumerate().take(n) {
                volts[i * n + e] += share * down;
                volts[e * n + i] += share * across;
            }
            return;
        }
        let loaded = &circuit.loaded[..circuit.count];
        let mut fields = [Fields::NONE; K];
        for (all, fields) in self.fields.chunks_exact(self.unknown.of_place(n)).zip(&mut fields).take(circuit.count) {
            self.unknown.of_table(n, which, all, fields);
        }
        // What drives currents besides those that flow: `dU - dN U`; and for the fields, whose change is there twice, half of the latter.
        let mut driven = fields.map(|fields| fields.value);
        for k in 0..circuit.count {
            for l in 0..k {
                let ohm = T::of(self.between_ohm[which * pairs(K - 1) + pairs(k - 1) + l]);
                add(&mut driven[k], -ohm, &loaded[l].currents);
                add(&mut driven[l], -ohm, &loaded[k].currents);
            }
        }
        let mut halved = [[T::ZERO; MAX_ELECTRODES]; K];
        for ((halved, fields), driven) in halved.iter_mut().zip(&fields).zip(&driven).take(circuit.count) {
            add(halved, T::of(0.5), &fields.value);
            add(halved, T::of(0.5), driven);
        }
        let couples = self.couples_ohm_per_m(&fields, &driven);
        // `dZ` but for the pads is the sum of products of a column with a row.
        let (mut columns, mut rows) =
            ([[[T::ZERO; MAX_ELECTRODES]; TERMS]; K], [[[T::ZERO; MAX_ELECTRODES]; TERMS]; K]);
        for (k, (one, couples)) in loaded.iter().zip(&couples).enumerate() {
            let [x, y] = &one.driving_ohm_per_m;
            columns[k] = [one.currents, halved[k], *x, couples[0], *y, couples[1]];
            rows[k] = [halved[k], one.currents, couples[0], *x, couples[1], *y];
        }
        let [columns, rows] = [&columns, &rows].map(|terms| terms[..circuit.count].as_flattened());
        let mut pads_ohm = [[T::ZERO; MAX_ELECTRODES]; MAX_ELECTRODES];
        let mut triangle = &self.unknown.pads_ohm[which * pairs(n)..(which + 1) * pairs(n)];
        for g in 0..n {
            let (row, after) = triangle.split_at(g + 1);
            triangle = after;
            row.iter().enumerate().for_each(|(e, ohm)| (pads_ohm[g][e], pads_ohm[e][g]) = (T::of(*ohm), T::of(*ohm)));
            pads_ohm[g][g] *= self.detector.moved.as_ref().map_or(T::ONE, |(_, moved)| moved.crowding[g]);
        }
        for (g, pads_ohm) in pads_ohm.iter_mut().enumerate().take(n) {
            for (part, sums) in pads_ohm.as_chunks_mut::<AT_ONCE>().0.iter_mut().enumerate().take(n.div_ceil(AT_ONCE)) {
                let mut all = *sums;
                for (column, row) in columns.iter().zip(rows) {
                    let row = &row.as_chunks::<AT_ONCE>().0[part];
                    (0..AT_ONCE).for_each(|e| all[e] -= column[g] * row[e]);
                }
                *sums = all;
            }
            self.add_row(g, share, &pads_ohm[..n], &mut volts[g * n..(g + 1) * n]);
        }
    }

    /// Adds what a table changes whose fields are those of one electrode alone: `dZ` is its row and column, and fields between contacts are what they were.
    #[inline(always)]
    fn add_field(&self, which: usize, electrode: usize, down: &mut [T], across: &mut [T]) {
        let (circuit, n) = (self.circuit, down.len());
        // Its field, and slopes of that, at each contact.
        let mut fields = [[T::ZERO; 3]; K];
        for (all, fields) in self.fields.chunks_exact(self.unknown.of_place(n)).zip(&mut fields).take(circuit.count) {
            *fields = self.unknown.of_electrode(n, which, all);
        }
        let pads_ohm = &self.unknown.pads_ohm[which * pairs(n)..(which + 1) * pairs(n)];
        let mut ohm = [T::ZERO; MAX_ELECTRODES];
        for (e, ohm) in ohm.iter_mut().enumerate().take(n).filter(|(e, _)| *e != electrode) {
            *ohm = T::of(of_pair(pads_ohm, e, electrode));
        }
        let ohm = &mut ohm[..n];
        for (k, one) in circuit.loaded.iter().enumerate().take(circuit.count) {
            add(ohm, -fields[k][0], &one.currents);
            let current = |k: usize| (0..circuit.count).map(|l| circuit.inverse_s[k][l] * fields[l][0]).sum::<T>();
            for d in 0..2 {
                let others = (0..circuit.count).filter(|l| *l != k);
                let by_others: T = others.map(|l| circuit.slopes_ohm_per_m[k][l][d] * current(l)).sum();
                let driving = fields[k][1 + d] - T::of(0.5) * one.sample.slope[d][n] * current(k) - by_others;
                add(ohm, -one.moment_s_m2 * driving, &one.driving_ohm_per_m[d]);
            }
        }
        let crowding = self.detector.moved.as_ref().map_or(T::ONE, |(_, moved)| moved.crowding[electrode]);
        let own_ohm = T::of(2.0) * ohm[electrode] + crowding * T::of(of_pair(pads_ohm, electrode, electrode));
        let drive_v = T::of(self.detector.table.head().drive_v);
        for (g, down) in down.iter_mut().enumerate().filter(|(g, _)| *g != electrode) {
            *down -= drive_v / self.circuit.loads_ohm[g] * ohm[g];
        }
        ohm[electrode] = own_ohm;
        let per_ohm = T::ONE / self.circuit.loads_ohm[electrode];
        let there_v = &self.there_v[electrode * n..(electrode + 1) * n];
        for ((across, there_v), ohm) in across.iter_mut().zip(there_v).zip(ohm) {
            *across += per_ohm * ((drive_v - *there_v) * own_ohm - drive_v * *ohm);
        }
    }

    /// Half of what changes of what drives the couples of currents and of their moments are of the impedances, over what drives them.
    #[inline(always)]
    fn couples_ohm_per_m(
        &self,
        fields: &[Fields<T>; K],
        driven: &[[T; MAX_ELECTRODES]; K],
    ) -> [[[T; MAX_ELECTRODES]; 2]; K] {
        let (circuit, n) = (self.circuit, self.detector.table.electrodes());
        let mut couples = [[[T::ZERO; MAX_ELECTRODES]; 2]; K];
        let mut currents = [[T::ZERO; MAX_ELECTRODES]; K];
        for (currents, row) in currents.iter_mut().zip(&circuit.inverse_s).take(circuit.count) {
            row.iter().zip(driven).take(circuit.count).for_each(|(share, driven)| add(currents, *share, driven));
        }
        for (k, one) in circuit.loaded.iter().enumerate().take(circuit.count) {
            let half_moment = T::of(0.5) * fields[k].own_ohm[0] * one.moment_by_own;
            for d in 0..2 {
                let couple = &mut couples[k][d];
                add(couple, one.moment_s_m2, &fields[k].slope[d]);
                add(couple, -T::of(0.5) * one.moment_s_m2 * one.sample.slope[d][n], &currents[k]);
                add(couple, -T::of(0.5) * one.moment_s_m2 * fields[k].own_ohm[1 + d], &one.currents);
                for l in (0..circuit.count).filter(|l| *l != k) {
                    add(couple, -one.moment_s_m2 * circuit.slopes_ohm_per_m[k][l][d], &currents[l]);
                }
                add(couple, half_moment, &one.driving_ohm_per_m[d]);
            }
        }
        couples
    }

    /// Adds what changes of a column of the impedances (ohm) change in a row of readings.
    #[inline(always)]
    fn add_row(&self, g: usize, share: T, ohm: &[T], volts: &mut [T]) {
        let n = volts.len();
        let drive_v = T::of(self.detector.table.head().drive_v);
        let per_ohm = share / self.circuit.loads_ohm[g];
        let there_v = &self.there_v[g * n..(g + 1) * n];
        for ((volts, ohm_e), there_v) in volts.iter_mut().zip(ohm).zip(there_v) {
            *volts += per_ohm * ((drive_v - *there_v) * ohm[g] - drive_v * *ohm_e);
        }
    }

    /// The readings that a change that needs no fields changes.
    #[inline(always)]
    fn readings_of(&self, change: Change) -> impl Iterator<Item = usize> + use<T, K> {
        let (n, all) = (self.detector.table.electrodes(), self.there_v.len());
        match change {
            Change::Switch(_) => (0..all).step_by(1),
            Change::Pad(g, _) | Change::Crowding(g, _) => (g * n..(g + 1) * n).step_by(1),
            Change::Gain(e, _) | Change::Offset(e, _) | Change::Bow(e, _) => (e..all).step_by(n),
        }
    }

    /// What it changes of what is there (V).
    #[inline(always)]
    fn changed_there_v(&self, change: Change, index: usize) -> T {
        let Some((_, moved)) = &self.detector.moved else { return T::ZERO };
        let n = self.detector.table.electrodes();
        let (drive_v, load_ohm) = (T::of(self.detector.table.head().drive_v), self.circuit.loads_ohm[index / n]);
        let ohm = match change {
            Change::Switch(log) => T::of(log) * moved.switch_ohm,
            Change::Pad(g, log) => T::of(log) * moved.own_pads_ohm[g],
            Change::Crowding(g, log) => T::of(log) * moved.crowding[g] * T::of(self.detector.table.pads_ohm(g, g)),
            Change::Gain(..) | Change::Offset(..) | Change::Bow(..) => return T::ZERO,
        };
        // The grounded pad itself is nearer to ground by what its own resistance takes.
        let is_own = !matches!(change, Change::Switch(_)) && index / n == index % n;
        ohm * if is_own { -self.there_v[index] } else { drive_v - self.there_v[index] } / load_ohm
    }

    /// What it changes of what a channel makes of that (V).
    #[inline(always)]
    fn changed_read_v(&self, change: Change, index: usize) -> T {
        let Some((_, moved)) = &self.detector.moved else { return T::ZERO };
        let there_v = self.there_v[index];
        match change {
            Change::Gain(e, log) => T::of(log) * moved.gains[e] * there_v,
            Change::Offset(_, offset_v) => T::of(offset_v),
            Change::Bow(e, height_v) => T::of(height_v) * moved.bow(e, there_v)[0],
            Change::Switch(..) | Change::Pad(..) | Change::Crowding(..) => T::ZERO,
        }
    }
}

/// Factors of the lower triangle of `Q` in `a' Q b`, of fields at two places (ohm) with one more that is the same everywhere.
fn form<T: Real>(a_ohm: &[T], b_ohm: &[T]) -> [f32; pairs(MAX_ELECTRODES + 1)] {
    let with_constant = |fields: &[T]| {
        let mut all = [1.0; MAX_ELECTRODES + 1];
        all.iter_mut().zip(fields).for_each(|(to, ohm)| *to = ohm.to_f32().unwrap_or(0.0));
        all
    };
    let (a, b) = (with_constant(a_ohm), with_constant(b_ohm));
    let mut factors = [0.0; pairs(MAX_ELECTRODES + 1)];
    let mut rest = &mut factors[..];
    for s in 0..=a_ohm.len() {
        let (row, after) = rest.split_at_mut(s + 1);
        rest = after;
        row.iter_mut().zip(a.iter().zip(&b)).for_each(|(factor, (of_a, of_b))| *factor = a[s] * of_b + b[s] * of_a);
        row[s] *= 0.5;
    }
    factors
}
