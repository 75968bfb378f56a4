//! How the readings of contacts change with what is not known of the detector.
//!
//! With the currents `U` of contacts, a step of a direction changes the impedances by
//!
//! ```text
//! dZ = dE - dF' U - U' dF + U' dN U
//! ```
//!
//! (see [`circuit`](crate::circuit)), and the readings by `((Vcc - V) dZ[g][g] - Vcc dZ[e][g]) / (Z[g][g] + R)`. What the contacts' own fields change is their resistance's,
//! which is fitted; of the couples, and of how current crowds, the change is left out.

use crate::circuit::Circuit;
use crate::fields::Stencil;
use crate::lanes::at_once;
use crate::real::Real;
use crate::table::MAX_ELECTRODES;
use crate::unknown::{Change, Detector, Knots, Unknown, of_pair, pairs};

/// The readings of contacts, with what their changes need.
pub(crate) struct Patterns<'a, T, const K: usize> {
    detector: &'a Detector<'a, T>,
    unknown: &'a Unknown<'a>,
    circuit: &'a Circuit<T, K>,
    stencils: [Option<Stencil<T>>; K],
    /// What is there to be read (V), in the readings' order.
    there_v: &'a [T],
    /// What channels make of a small change.
    gains: [T; MAX_ELECTRODES],
}

impl<'a, T: Real, const K: usize> Patterns<'a, T, K> {
    /// Of contacts that are solved on a detector; `there_v` is what is there to be read (V).
    pub fn new(
        detector: &'a Detector<'a, T>,
        unknown: &'a Unknown<'a>,
        circuit: &'a Circuit<T, K>,
        there_v: &'a [T],
    ) -> Self {
        let stencil = |k: usize| (k < circuit.count).then(|| Stencil::of(detector.table, circuit.loaded[k].spot.at_m));
        let mut gains = [T::ONE; MAX_ELECTRODES];
        gains.iter_mut().enumerate().take(detector.table.electrodes()).for_each(|(e, gain)| *gain = detector.gain(e));
        Self { detector, unknown, circuit, stencils: core::array::from_fn(stencil), there_v, gains }
    }

    /// Changes of all readings (V) by one deviation in each direction: a row of readings for each.
    pub fn write(&self, volts: &mut [T]) {
        at_once(
            #[inline(always)]
            || self.write_all(volts),
        );
    }

    #[inline(always)]
    fn write_all(&self, volts: &mut [T]) {
        volts.fill(T::ZERO);
        let rows = volts.chunks_exact_mut(self.there_v.len());
        for ((number, direction), row) in self.unknown.directions.iter().enumerate().zip(rows) {
            let step = self.detector.moved.as_ref().map_or(T::ZERO, |(_, moved)| moved.steps[number]);
            let tables = [(direction.table, T::ONE), (direction.square, step)];
            for (which, share) in tables.into_iter().filter_map(|(which, share)| Some((which?, share))) {
                self.add_fields(which, share, row);
            }
            let changes = self.unknown.changes_of(direction);
            changes.iter().for_each(|change| self.add_change(*change, row));
        }
    }

    /// Adds so much of what a table changes.
    #[inline(always)]
    fn add_fields(&self, which: usize, share: T, volts: &mut [T]) {
        let (circuit, n) = (self.circuit, self.detector.table.electrodes());
        let pads_ohm = &self.unknown.pads_ohm[which * pairs(n)..(which + 1) * pairs(n)];
        let mut fields = [[T::ZERO; MAX_ELECTRODES]; K];
        for (stencil, fields) in self.stencils.iter().zip(&mut fields) {
            let Some(stencil) = stencil else { break };
            self.unknown.fields_at(n, which, stencil, fields);
        }
        let mut less = [[T::ZERO; MAX_ELECTRODES]; K];
        for k in 0..circuit.count {
            for l in 0..k {
                let half_ohm = T::of(0.5) * self.between_ohm(which, [k, l], &fields);
                for e in 0..n {
                    less[k][e] += half_ohm * circuit.loaded[l].currents[e];
                    less[l][e] += half_ohm * circuit.loaded[k].currents[e];
                }
            }
        }
        for (fields, less) in fields.iter_mut().zip(&less).take(circuit.count) {
            fields.iter_mut().zip(less).for_each(|(field, less)| *field -= *less);
        }
        let mut row = [T::ZERO; MAX_ELECTRODES];
        for g in 0..n {
            for (e, ohm) in row.iter_mut().enumerate().take(n) {
                *ohm = T::of(of_pair(pads_ohm, e, g));
            }
            for (one, fields) in circuit.loaded.iter().zip(&fields).take(circuit.count) {
                let (current, field) = (one.currents[g], fields[g]);
                for e in 0..n {
                    row[e] -= fields[e] * current + one.currents[e] * field;
                }
            }
            self.add_row(g, share, &row, &mut volts[g * n..(g + 1) * n]);
        }
    }

    /// Adds what changes of a column of the impedances (ohm) change in a row of readings.
    #[inline(always)]
    fn add_row(&self, g: usize, share: T, ohm: &[T], volts: &mut [T]) {
        let n = volts.len();
        let drive_v = T::of(self.detector.table.head().drive_v);
        let per_ohm = share / self.circuit.loads_ohm[g];
        let there_v = &self.there_v[g * n..(g + 1) * n];
        for (((volts, ohm_e), there_v), gain) in volts.iter_mut().zip(ohm).zip(there_v).zip(&self.gains) {
            *volts += per_ohm * *gain * ((drive_v - *there_v) * ohm[g] - drive_v * *ohm_e);
        }
    }

    /// Change of the field between two contacts by a table (ohm).
    #[inline(always)]
    fn between_ohm(&self, which: usize, contacts: [usize; 2], fields: &[[T; MAX_ELECTRODES]; K]) -> T {
        let (table, n) = (self.detector.table, self.detector.table.electrodes());
        let [one, other] = contacts.map(|k| &self.circuit.loaded[k]);
        let way_m = [0, 1].map(|d| one.spot.at_m[d] - other.spot.at_m[d]);
        let knots = Knots::of(table, (way_m[0] * way_m[0] + way_m[1] * way_m[1]).sqrt());
        let distances = &self.unknown.distances_ohm[which * table.knots()..];
        let mut ohm: T = (0..4).map(|i| knots.value[i] * T::of(distances[knots.first + i])).sum();
        let walls = &self.unknown.walls[which * pairs(n + 1)..(which + 1) * pairs(n + 1)];
        let [here, there] = [one, other].map(|one| &one.sample.value);
        let at = |values: &[T], index: usize| if index < n { values[index] } else { T::ONE };
        let mut rest = walls;
        for row in 0..=n {
            let (triangle, after) = rest.split_at(row + 1);
            rest = after;
            let (mut of_here, mut of_there) = (T::ZERO, T::ZERO);
            for (index, q) in triangle.iter().enumerate() {
                let half = if index == row { T::of(0.5) * T::of(*q) } else { T::of(*q) };
                of_here += half * at(here, index);
                of_there += half * at(there, index);
            }
            ohm += at(there, row) * of_here + at(here, row) * of_there;
        }
        let [k, l] = contacts;
        for e in 0..n {
            ohm += fields[k][e] * other.walls_ohm[e] + fields[l][e] * one.walls_ohm[e];
        }
        ohm
    }

    /// Adds what needs no fields.
    fn add_change(&self, change: Change, volts: &mut [T]) {
        let n = self.detector.table.electrodes();
        let Some((_, moved)) = &self.detector.moved else { return };
        let mut add = |g: usize, e: usize, change_v: T| volts[g * n + e] += change_v;
        let drive_v = T::of(self.detector.table.head().drive_v);
        let per_ohm = |g: usize, e: usize| (drive_v - self.there_v[g * n + e]) / self.circuit.loads_ohm[g];
        match change {
            Change::Gain(e, log) => {
                (0..n).for_each(|g| add(g, e, T::of(log) * moved.gains[e] * self.there_v[g * n + e]));
            }
            Change::Offset(e, offset_v) => (0..n).for_each(|g| add(g, e, T::of(offset_v))),
            Change::Bow(e, height_v) => {
                (0..n).for_each(|g| add(g, e, T::of(height_v) * self.unknown.bow(e, self.there_v[g * n + e])));
            }
            Change::Switch(log) => {
                let ohm = T::of(log) * moved.switch_ohm;
                for (g, e) in (0..n).flat_map(|g| (0..n).map(move |e| (g, e))) {
                    add(g, e, moved.gains[e] * ohm * per_ohm(g, e));
                }
            }
            Change::Pad(g, log) => {
                let ohm = T::of(log) * moved.own_pads_ohm[g];
                for e in 0..n {
                    // The grounded pad itself is nearer to ground by what its own resistance takes.
                    let over =
                        if e == g { -self.there_v[g * n + g] / self.circuit.loads_ohm[g] } else { per_ohm(g, e) };
                    add(g, e, moved.gains[e] * ohm * over);
                }
            }
        }
    }
}
