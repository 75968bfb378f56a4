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
use crate::fields::Stencil;
use crate::lanes::at_once;
use crate::products::add;
use crate::real::Real;
use crate::table::{MAX_ELECTRODES, MAX_KNOTS};
use crate::unknown::{Change, Detector, Fields, Unknown, of_pair, pairs};

/// The readings of contacts, with what their changes need.
pub(crate) struct Patterns<'a, T, const K: usize> {
    detector: &'a Detector<'a, T>,
    unknown: &'a Unknown<'a>,
    circuit: &'a Circuit<T, K>,
    /// What each table changes at contacts.
    fields: &'a [f32],
    /// What is there to be read (V), in the readings' order.
    there_v: &'a [T],
    /// Weights of the coefficients over distances in the field between a contact and one before it.
    by_ways: [[[T; MAX_KNOTS]; K]; K],
    /// Fields of the electrodes at each contact, with one more that is the same everywhere.
    bases: [[T; MAX_ELECTRODES + 1]; K],
}

impl<'a, T: Real, const K: usize> Patterns<'a, T, K> {
    /// Of contacts that are solved on a detector; `there_v` is what is there to be read (V), and `fields` room for what tables change.
    pub fn new(
        detector: &'a Detector<'a, T>,
        unknown: &'a Unknown<'a>,
        circuit: &'a Circuit<T, K>,
        there_v: &'a [T],
        fields: &'a mut [f32],
    ) -> Self {
        let (table, n) = (detector.table, detector.table.electrodes());
        let rows = fields.chunks_exact_mut(unknown.of_place(n).max(1));
        for (one, row) in circuit.loaded.iter().zip(rows).take(circuit.count) {
            at_once(
                #[inline(always)]
                || unknown.all_at(n, &Stencil::of(table, one.spot.at_m), row),
            );
        }
        let mut by_ways = [[[T::ZERO; MAX_KNOTS]; K]; K];
        for (k, (row, one)) in by_ways.iter_mut().zip(&circuit.loaded).take(circuit.count).enumerate() {
            for (weights, other) in row.iter_mut().zip(&circuit.loaded).take(k) {
                *weights = table.by_ways(one.spot.at_m, other.spot.at_m);
            }
        }
        let mut bases = [[T::ONE; MAX_ELECTRODES + 1]; K];
        for (base, one) in bases.iter_mut().zip(&circuit.loaded).take(circuit.count) {
            base[..n].copy_from_slice(&one.sample.value[..n]);
        }
        Self { detector, unknown, circuit, fields, there_v, by_ways, bases }
    }

    /// Changes of all readings (V) by one deviation in each direction: a row of readings for each; `gains` is room for so many.
    pub fn write(&self, volts: &mut [T], gains: &mut [T]) {
        at_once(
            #[inline(always)]
            || self.write_all(volts, gains),
        );
    }

    #[inline(always)]
    fn write_all(&self, volts: &mut [T], gains: &mut [T]) {
        let n = self.detector.table.electrodes();
        volts.fill(T::ZERO);
        for (index, (gain, there_v)) in gains.iter_mut().zip(self.there_v).enumerate() {
            *gain = self.detector.gain(index % n, *there_v);
        }
        let rows = volts.chunks_exact_mut(self.there_v.len());
        for ((number, direction), row) in self.unknown.directions.iter().enumerate().zip(rows) {
            let step = self.detector.moved.as_ref().map_or(T::ZERO, |(_, moved)| moved.steps[number]);
            let tables = [(direction.table, T::ONE), (direction.square, step)];
            for (which, share) in tables.into_iter().filter_map(|(which, share)| Some((which?, share))) {
                self.add_fields(which, share, row);
            }
            let changes = self.unknown.changes_of(direction);
            changes.iter().for_each(|change| self.add_change_there(*change, row));
            row.iter_mut().zip(&*gains).for_each(|(volts, gain)| *volts *= *gain);
            changes.iter().for_each(|change| self.add_change_read(*change, row));
        }
    }

    /// Adds so much of what a table changes.
    #[inline(always)]
    fn add_fields(&self, which: usize, share: T, volts: &mut [T]) {
        let (circuit, n) = (self.circuit, self.detector.table.electrodes());
        let loaded = &circuit.loaded[..circuit.count];
        let mut fields = [Fields::NONE; K];
        for (all, fields) in self.fields.chunks_exact(self.unknown.of_place(n)).zip(&mut fields).take(circuit.count) {
            self.unknown.of_table(n, which, all, fields);
        }
        // What drives currents besides those that flow: `dU - dN U`; and for the fields, whose change is there twice, half of the latter.
        let mut driven = fields.map(|fields| fields.value);
        for k in 0..circuit.count {
            for l in 0..k {
                let ohm = self.between_ohm(which, [k, l], &fields);
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
        let pads_ohm = &self.unknown.pads_ohm[which * pairs(n)..(which + 1) * pairs(n)];
        for g in 0..n {
            let row = &mut [T::ZERO; MAX_ELECTRODES][..n];
            for (e, ohm) in row.iter_mut().enumerate() {
                *ohm = T::of(of_pair(pads_ohm, e, g));
            }
            row[g] *= self.detector.moved.as_ref().map_or(T::ONE, |(_, moved)| moved.crowding[g]);
            for ((one, fields), couples) in loaded.iter().zip(&halved).zip(&couples) {
                add(row, -one.currents[g], fields);
                add(row, -fields[g], &one.currents);
                for (driving, couple) in one.driving_ohm_per_m.iter().zip(couples) {
                    add(row, -driving[g], couple);
                    add(row, -couple[g], driving);
                }
            }
            self.add_row(g, share, row, &mut volts[g * n..(g + 1) * n]);
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

    /// Change of the field between a contact and one before it by a table (ohm).
    #[inline(always)]
    fn between_ohm(&self, which: usize, [k, l]: [usize; 2], fields: &[Fields<T>; K]) -> T {
        let (table, n) = (self.detector.table, self.detector.table.electrodes());
        let [one, other] = [k, l].map(|k| &self.circuit.loaded[k]);
        let distances = &self.unknown.distances_ohm[which * table.knots()..(which + 1) * table.knots()];
        let mut ohm: T = distances.iter().zip(&self.by_ways[k][l]).map(|(ohm, weight)| *weight * T::of(*ohm)).sum();
        let walls = &self.unknown.walls[which * pairs(n + 1)..(which + 1) * pairs(n + 1)];
        let [here, there] = [k, l].map(|k| &self.bases[k]);
        let mut rest = walls;
        for row in 0..=n {
            let (triangle, after) = rest.split_at(row + 1);
            rest = after;
            let (mut of_here, mut of_there) = (T::ZERO, T::ZERO);
            for ((q, here), there) in triangle.iter().zip(here).zip(there) {
                let q = T::of(*q);
                of_here += q * *here;
                of_there += q * *there;
            }
            // Once, what is on the diagonal.
            ohm += there[row] * of_here + here[row] * (of_there - T::of(triangle[row]) * there[row]);
        }
        for e in 0..n {
            ohm += fields[k].value[e] * other.walls_ohm[e] + fields[l].value[e] * one.walls_ohm[e];
        }
        ohm
    }

    /// Adds what needs no fields: changes of what is there.
    fn add_change_there(&self, change: Change, volts: &mut [T]) {
        let n = self.detector.table.electrodes();
        let Some((_, moved)) = &self.detector.moved else { return };
        let drive_v = T::of(self.detector.table.head().drive_v);
        let per_ohm = |index: usize| (drive_v - self.there_v[index]) / self.circuit.loads_ohm[index / n];
        match change {
            Change::Switch(log) => {
                let ohm = T::of(log) * moved.switch_ohm;
                volts.iter_mut().enumerate().for_each(|(index, volts)| *volts += ohm * per_ohm(index));
            }
            Change::Pad(g, log) | Change::Crowding(g, log) => {
                let of_one = match change {
                    Change::Pad(..) => moved.own_pads_ohm[g],
                    _ => moved.crowding[g] * T::of(self.detector.table.pads_ohm(g, g)),
                };
                let ohm = T::of(log) * of_one;
                for (e, volts) in volts.iter_mut().skip(g * n).take(n).enumerate() {
                    // The grounded pad itself is nearer to ground by what its own resistance takes.
                    let own = -self.there_v[g * n + g] / self.circuit.loads_ohm[g];
                    *volts += ohm * if e == g { own } else { per_ohm(g * n + e) };
                }
            }
            Change::Gain(..) | Change::Offset(..) | Change::Bow(..) => {}
        }
    }

    /// Adds what needs no fields: changes of what a channel makes of it.
    fn add_change_read(&self, change: Change, volts: &mut [T]) {
        let n = self.detector.table.electrodes();
        let Some((_, moved)) = &self.detector.moved else { return };
        let mut of_channel = |e: usize, read_v: &dyn Fn(T) -> T| {
            let of_e = volts.iter_mut().zip(self.there_v).skip(e).step_by(n);
            of_e.for_each(|(volts, there_v)| *volts += read_v(*there_v));
        };
        match change {
            Change::Gain(e, log) => of_channel(e, &|there_v| T::of(log) * moved.gains[e] * there_v),
            Change::Offset(e, offset_v) => of_channel(e, &|_| T::of(offset_v)),
            Change::Bow(e, height_v) => of_channel(e, &|there_v| T::of(height_v) * self.unknown.bow(e, there_v)[0]),
            Change::Switch(..) | Change::Pad(..) | Change::Crowding(..) => {}
        }
    }
}
