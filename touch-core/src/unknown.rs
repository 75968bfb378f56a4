//! What is not known of a detector, compiled as its table is: how all that the table says changes with it.
//!
//! A detector differs from its description in independent directions, each of which has a standard deviation of one: its thickness, how uneven it is, where an electrode
//! is, what a channel reads. Fields change nearly linearly with all of them where readings do not: what is not linear is the circuit, and that is solved exactly. So a
//! direction is a table of changes of fields, for a disc of the usual radius, on the same grid; one whose square counts has a second table. What belongs to a board or to
//! a pad alone needs no fields.

use core::ops::Range;

use crate::fields::{Sample, Stencil};
use crate::lanes::at_once;
use crate::products::add;
use crate::real::{Real, rough_ln};
use crate::spline::{interval, weights};
use crate::table::{MAX_ELECTRODES, MAX_KNOTS, Table};
use crate::ways::{turned_ways_m, ways_m};

/// A change that needs no fields, for a step of one deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// Of the logarithm of what a channel reads over what is there.
    Gain(usize, f32),
    /// Of what a channel reads besides what is there (V).
    Offset(usize, f32),
    /// Of the logarithm of a pad's own impedance.
    Pad(usize, f32),
    /// Of the logarithm of an electrode's field at itself, which is most of a pad's impedance: of how its current crowds there.
    Crowding(usize, f32),
    /// Of the logarithm of the switch's resistance.
    Switch(f32),
    /// Of the height of a channel's bow (V): a parabola between the ends of its converter's range.
    Bow(usize, f32),
}

impl Change {
    /// Whether it is of what is there, rather than of what channels make of it.
    pub(crate) fn is_there(&self) -> bool {
        matches!(self, Self::Pad(..) | Self::Crowding(..) | Self::Switch(_))
    }
}

/// A direction in which a detector may differ.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Direction {
    /// Number of the table of changes for a step of one deviation.
    pub table: Option<usize>,
    /// Number of the table of second derivatives.
    pub square: Option<usize>,
    /// What it changes besides: numbers of changes.
    pub changes: Range<usize>,
    /// The electrode at which alone anything differs, if there is one: its field, and those between it and others, and what is its own. No square is of such.
    pub electrode: Option<usize>,
}

/// All that is not known of a detector of `n` electrodes, whose table has `nx` by `ny` coefficients over places and `k` over distances, in so many tables of changes.
#[derive(Clone, Copy, Debug)]
pub struct Unknown<'a> {
    /// The directions.
    pub directions: &'a [Direction],
    /// Changes that need no fields, of all directions.
    pub changes: &'a [Change],
    /// How many tables there are.
    pub tables: usize,
    /// Electrodes of the last tables, of each of which it is the field of one electrode alone that changes.
    pub electrodes: &'a [usize],
    /// Coefficients of changes of the fields of the electrodes, and of the disc's own (ohm): rows of `y`, in them of `x`, for each tables of `n + 1`, and of those of one electrode of one.
    pub fields_ohm: &'a [f32],
    /// Changes of the fields between the electrodes (ohm): tables of lower triangles. On the diagonal, the field of an electrode at itself, they are those of its logarithm
    /// times what it is: its current crowds at the pad, where what a direction makes of the layer is a factor.
    pub pads_ohm: &'a [f32],
    /// Changes of the spline over distances (ohm): tables of `k`.
    pub distances_ohm: &'a [f32],
    /// Changes of `Q`: tables of lower triangles of `n + 1`. They are of what the fields of the electrodes are by the table that is changed: what fields change is among them.
    pub walls: &'a [f32],
    /// Ends of the range of each channel's converter (V).
    pub ranges_v: &'a [[f32; 2]],
    /// What is each pad's own of the impedance while it is grounded (ohm).
    pub own_pads_ohm: &'a [f32],
}

/// Sums up so much of each table's numbers at a coefficient.
#[inline(always)]
fn blend(shares: &[f32], node: &[f32], sums: &mut [f32]) {
    for (share, of_table) in shares.iter().zip(node.chunks_exact(sums.len())) {
        add(sums, *share, of_table);
    }
}

/// How many elements a lower triangle has.
pub(crate) const fn pairs(side: usize) -> usize {
    side * (side + 1) / 2
}

/// An element of a symmetric matrix of which the lower triangle is there.
pub(crate) fn of_pair<T: Copy>(triangle: &[T], a: usize, b: usize) -> T {
    let (high, low) = if a < b { (b, a) } else { (a, b) };
    triangle[pairs(high) + low]
}

impl Unknown<'_> {
    /// What a direction changes besides fields.
    pub(crate) fn changes_of(&self, direction: &Direction) -> &[Change] {
        self.changes.get(direction.changes.clone()).unwrap_or(&[])
    }

    /// How many tables change more than the field of an electrode.
    fn common_tables(&self) -> usize {
        self.tables - self.electrodes.len()
    }

    /// The electrode whose field is all that a table changes, if it is one of those.
    pub(crate) fn electrode_of(&self, which: usize) -> Option<usize> {
        self.electrodes.get(which.checked_sub(self.common_tables())?).copied()
    }

    /// How many numbers all tables have at a coefficient, and so at a place.
    fn at_once(&self, electrodes: usize) -> usize {
        self.common_tables() * (electrodes + 1) + self.electrodes.len()
    }

    /// Changes of all tables at a coefficient.
    fn node(&self, node: usize, electrodes: usize) -> &[f32] {
        let count = self.at_once(electrodes);
        self.fields_ohm.get(node * count..(node + 1) * count).unwrap_or(&[])
    }

    /// Adds what shares of the tables change at a place.
    pub(crate) fn add<T: Real>(&self, table: &Table<'_>, shares: &[f32], at_m: [T; 2], sample: &mut Sample<T>) {
        at_once(
            #[inline(always)]
            || self.add_at(table, shares, &Stencil::of(table, at_m), sample),
        );
    }

    #[inline(always)]
    fn add_at<T: Real>(&self, table: &Table<'_>, shares: &[f32], stencil: &Stencil<T>, sample: &mut Sample<T>) {
        let count = table.electrodes() + 1;
        for (which, node) in stencil.nodes.into_iter().enumerate() {
            let mut change = [0.0f32; MAX_ELECTRODES + 1];
            let change = &mut change[..count];
            let (common, local) = self.node(node, table.electrodes()).split_at(self.common_tables() * count);
            blend(shares, common, change);
            let shares = &shares[self.common_tables()..];
            shares.iter().zip(local).zip(self.electrodes).for_each(|((share, ohm), e)| change[*e] += share * ohm);
            let [value, x, y, xx, xy, yy] = stencil.weights.each_ref().map(|weights| weights[which]);
            for (q, ohm) in change.iter().enumerate() {
                let ohm = T::of(*ohm);
                sample.value[q] += value * ohm;
                sample.slope[0][q] += x * ohm;
                sample.slope[1][q] += y * ohm;
                sample.turning[0][q] += xx * ohm;
                sample.turning[1][q] += xy * ohm;
                sample.turning[2][q] += yy * ohm;
            }
        }
    }

    /// How many numbers it takes what all tables change at a place.
    pub(crate) fn of_place(&self, electrodes: usize) -> usize {
        3 * self.at_once(electrodes)
    }

    /// What all tables change at a place: fields, and their derivatives along x and y.
    #[inline(always)]
    pub(crate) fn all_at<T: Real>(&self, electrodes: usize, stencil: &Stencil<T>, all: &mut [f32]) {
        let count = self.at_once(electrodes);
        all.fill(0.0);
        for (index, node) in stencil.nodes.into_iter().enumerate() {
            let changes = self.node(node, electrodes);
            for (sums, weights) in all.chunks_exact_mut(count.max(1)).zip(&stencil.weights) {
                add(sums, weights[index].to_f32().unwrap_or(0.0), changes);
            }
        }
    }

    /// Those of the field of the electrode of a table that changes that alone.
    #[inline(always)]
    pub(crate) fn of_electrode<T: Real>(&self, electrodes: usize, which: usize, all: &[f32]) -> [T; 3] {
        let (count, place) = (self.at_once(electrodes), self.common_tables() * electrodes + which);
        core::array::from_fn(|part| T::of(all[part * count + place]))
    }

    /// Those of a table.
    #[inline(always)]
    pub(crate) fn of_table<T: Real>(&self, electrodes: usize, which: usize, all: &[f32], at: &mut Fields<T>) {
        let count = electrodes + 1;
        let parts = all.chunks_exact(self.at_once(electrodes));
        let mut parts = parts.map(|all| &all[which * count..(which + 1) * count]);
        let [value, x, y] = core::array::from_fn(|_| parts.next().unwrap_or(&[]));
        for (to, from) in [&mut at.value].into_iter().chain(&mut at.slope).zip([value, x, y]) {
            to.iter_mut().zip(from).take(electrodes).for_each(|(to, from)| *to = T::of(*from));
        }
        at.own_ohm = [value, x, y].map(|from| from.last().map_or(T::ZERO, |ohm| T::of(*ohm)));
    }
}

/// What a table changes at a place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fields<T> {
    /// Fields of the electrodes (ohm), and their derivatives by the place (ohm/m).
    pub value: [T; MAX_ELECTRODES],
    pub slope: [[T; MAX_ELECTRODES]; 2],
    /// The disc's own field (ohm), and its derivatives (ohm/m).
    pub own_ohm: [T; 3],
}

impl<T: Real> Fields<T> {
    pub const NONE: Self =
        Self { value: [T::ZERO; MAX_ELECTRODES], slope: [[T::ZERO; MAX_ELECTRODES]; 2], own_ohm: [T::ZERO; 3] };
}

/// A detector after steps in the directions, as far as that is the same at all places. Larger by its parts than a board's stack has room for, it is kept where the
/// solver's room is.
#[derive(Clone, Debug)]
pub(crate) struct Moved<'m, T> {
    /// Steps, in deviations.
    pub steps: &'m [T],
    /// Share of each table.
    pub shares: &'m [f32],
    /// Fields between electrodes, the spline over distances, `Q`: whole rows.
    pub pads_ohm: &'m [T],
    pub distances_ohm: &'m [T],
    pub walls: &'m [T],
    /// Of each channel; its range begins there (V), and is one over so much long (1/V).
    pub gains: &'m [T],
    pub offsets_v: &'m [T],
    pub bows_v: &'m [T],
    lows_v: &'m [T],
    per_v: &'m [T],
    /// Factor on each electrode's field at itself.
    pub crowding: &'m [T],
    /// Own impedance of each pad, and the switch's (ohm).
    pub own_pads_ohm: &'m [T],
    pub switch_ohm: T,
}

impl<T: Real> Moved<'_, T> {
    /// A channel's bow over its height at a voltage (V), and its derivative (1/V).
    #[inline(always)]
    pub fn bow(&self, e: usize, volts: T) -> [T; 2] {
        let (per_v, four) = (self.per_v[e], T::of(4.0));
        let share = per_v * (volts - self.lows_v[e]);
        let inside = if share > T::ZERO && share < T::ONE { four } else { T::ZERO };
        [inside * share * (T::ONE - share), inside * per_v * (T::ONE - share - share)]
    }
}

/// Where that is kept.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    electrodes: usize,
    knots: usize,
    directions: usize,
}

/// Adds so much of one of equal parts.
fn add_part<T: Real>(sums: &mut [T], share: T, parts: &[f32], which: usize) {
    let count = sums.len();
    let part = parts.get(which * count..(which + 1) * count).unwrap_or(&[]);
    sums.iter_mut().zip(part).for_each(|(sum, ohm)| *sum += share * T::of(*ohm));
}

/// Makes the lower triangle of a symmetric matrix, which the first numbers are, to the matrix.
fn square<T: Copy>(numbers: &mut [T], side: usize) {
    for i in (0..side).rev() {
        (0..=i).rev().for_each(|j| numbers[i * side + j] = numbers[pairs(i) + j]);
    }
    for i in 0..side {
        (0..i).for_each(|j| numbers[j * side + i] = numbers[i * side + j]);
    }
}

impl Layout {
    pub fn of(table: &Table<'_>, unknown: &Unknown<'_>) -> Self {
        Self { electrodes: table.electrodes(), knots: table.knots(), directions: unknown.directions.len() }
    }

    fn counts(&self) -> [usize; 11] {
        let n = self.electrodes;
        [self.directions, n * n, self.knots, (n + 1) * (n + 1), n, n, n, n, n, n, n + 1]
    }

    /// How many numbers it takes.
    pub fn numbers(&self) -> usize {
        self.counts().iter().sum()
    }

    /// Works out what steps make of a detector.
    pub fn moved<'m, T: Real>(
        &self,
        table: &Table<'_>,
        unknown: &Unknown<'_>,
        steps: &[T],
        numbers: &'m mut [T],
        shares: &'m mut [f32],
    ) -> Moved<'m, T> {
        let n = self.electrodes;
        let [own, all_pads, distances, all_walls, crowding, gains, offsets, bows, lows_v, per_v, last] =
            self.parts(&mut *numbers);
        own.copy_from_slice(&steps[..self.directions]);
        let (pads, walls) = (&mut all_pads[..pairs(n)], &mut all_walls[..pairs(n + 1)]);
        table.parts([&mut *pads, &mut *distances, &mut *walls]);
        for ((low, per_v), [low_v, high_v]) in lows_v.iter_mut().zip(&mut *per_v).zip(unknown.ranges_v) {
            (*low, *per_v) = (T::of(*low_v), T::ONE / (T::of(*high_v) - T::of(*low_v)));
        }
        gains.fill(T::ZERO);
        offsets.fill(T::ZERO);
        bows.fill(T::ZERO);
        last.fill(T::ZERO);
        shares.fill(0.0);
        for (direction, step) in unknown.directions.iter().zip(steps.iter().copied()) {
            let half_square = T::of(0.5) * step * step;
            for (which, share) in [(direction.table, step), (direction.square, half_square)] {
                let Some(which) = which.filter(|_| share != T::ZERO) else { continue };
                shares[which] = share.to_f32().unwrap_or(0.0);
                add_part(pads, share, unknown.pads_ohm, which);
                add_part(distances, share, unknown.distances_ohm, which);
                add_part(walls, share, unknown.walls, which);
            }
            for change in unknown.changes_of(direction) {
                match *change {
                    Change::Gain(e, log) => gains[e] += step * T::of(log),
                    Change::Offset(e, volts) => offsets[e] += step * T::of(volts),
                    Change::Pad(e, log) => last[e] += step * T::of(log),
                    Change::Crowding(e, log) => pads[pairs(e) + e] += step * T::of(log) * T::of(table.pads_ohm(e, e)),
                    Change::Bow(e, height_v) => bows[e] += step * T::of(height_v),
                    Change::Switch(log) => last[n] += step * T::of(log),
                }
            }
        }
        gains.iter_mut().for_each(|gain| *gain = gain.exp());
        for e in 0..n {
            let (own_ohm, there_ohm) = (T::of(unknown.own_pads_ohm[e]), T::of(table.pads_ohm(e, e)));
            let factor = last[e].exp();
            let at_itself = &mut pads[pairs(e) + e];
            crowding[e] = ((*at_itself - there_ohm) / there_ohm).exp();
            *at_itself = there_ohm * crowding[e] + own_ohm * (factor - T::ONE);
            last[e] = own_ohm * factor;
        }
        last[n] = T::of(table.head().on_resistance_ohm) * last[n].exp();
        square(all_pads, n);
        square(all_walls, n + 1);
        self.as_moved(numbers, shares)
    }

    /// What was worked out last.
    pub fn as_moved<'m, T: Real>(&self, numbers: &'m mut [T], shares: &'m [f32]) -> Moved<'m, T> {
        let [steps, pads_ohm, distances_ohm, walls, crowding, gains, offsets_v, bows_v, lows_v, per_v, last] =
            self.parts(numbers);
        let (own_pads_ohm, switch_ohm) = (&last[..self.electrodes], last[self.electrodes]);
        Moved {
            steps,
            shares,
            pads_ohm,
            distances_ohm,
            walls,
            gains,
            offsets_v,
            bows_v,
            lows_v,
            per_v,
            crowding,
            own_pads_ohm,
            switch_ohm,
        }
    }

    fn parts<'m, T>(&self, numbers: &'m mut [T]) -> [&'m mut [T]; 11] {
        let mut rest = numbers;
        self.counts().map(|count| {
            let (part, after) = core::mem::take(&mut rest).split_at_mut(count);
            rest = after;
            part
        })
    }
}

/// A detector as a circuit sees it: as its table says, or moved from there.
#[derive(Clone, Debug)]
pub(crate) struct Detector<'a, T> {
    pub table: &'a Table<'a>,
    pub moved: Option<(&'a Unknown<'a>, Moved<'a, T>)>,
}

impl<'a, T: Real> Detector<'a, T> {
    /// As its table says.
    pub fn described(table: &'a Table<'a>) -> Self {
        Self { table, moved: None }
    }

    /// Takes what the table says of a place (m) to what is there.
    pub fn take(&self, at_m: [T; 2], sample: &mut Sample<T>) {
        if let Some((unknown, moved)) = &self.moved
            && unknown.tables > 0
        {
            unknown.add(self.table, moved.shares, at_m, sample);
        }
    }

    /// Fields between an electrode and all (ohm).
    #[inline(always)]
    pub fn pads_ohm(&self, g: usize) -> [T; MAX_ELECTRODES] {
        let (mut all, n) = ([T::ZERO; MAX_ELECTRODES], self.table.electrodes());
        match &self.moved {
            Some((_, moved)) => all[..n].copy_from_slice(&moved.pads_ohm[g * n..(g + 1) * n]),
            None => {
                all.iter_mut().enumerate().take(n).for_each(|(e, ohm)| *ohm = T::of(self.table.pads_ohm(e, g)));
            }
        }
        all
    }

    /// The field of an electrode at itself (ohm).
    pub fn pad_ohm(&self, g: usize) -> T {
        let there = |moved: &Moved<'a, T>| moved.pads_ohm[g * self.table.electrodes() + g];
        self.moved.as_ref().map_or_else(|| T::of(self.table.pads_ohm(g, g)), |(_, moved)| there(moved))
    }

    /// Resistance of a switch (ohm).
    pub fn switch_ohm(&self) -> T {
        self.moved.as_ref().map_or_else(|| T::of(self.table.head().on_resistance_ohm), |(_, moved)| moved.switch_ohm)
    }

    /// What channels make of voltages, but for what the table says of it (V).
    #[inline(always)]
    pub fn read_v(&self, volts: &[T], read_v: &mut [T]) {
        read_v.copy_from_slice(volts);
        let Some((_, moved)) = &self.moved else { return };
        let Moved { gains, offsets_v, bows_v, .. } = moved;
        for (e, read_v) in read_v.iter_mut().enumerate() {
            *read_v = gains[e] * *read_v + offsets_v[e] + bows_v[e] * moved.bow(e, *read_v)[0];
        }
    }

    /// What channels make of small changes of voltages.
    #[inline(always)]
    pub fn gains(&self, volts: &[T], gains: &mut [T]) {
        gains.fill(T::ONE);
        let Some((_, moved)) = &self.moved else { return };
        for ((e, gain), volts) in gains.iter_mut().enumerate().zip(volts) {
            *gain = moved.gains[e] + moved.bows_v[e] * moved.bow(e, *volts)[1];
        }
    }

    /// The value alone (ohm) of [that part](Self::by_ways_ohm) of the field between two places, roughly: what a look at one more contact needs.
    #[inline(always)]
    pub fn rough_by_ways_ohm(&self, to_m: [T; 2], from_m: [T; 2]) -> T {
        let head = self.table.head();
        let (per_near_m2, per_step) = (1.0 / (head.near_m * head.near_m), 0.5 / head.ln_step);
        let of_way = |[x_m, y_m]: [T; 2]| {
            let square = per_near_m2 * (x_m * x_m + y_m * y_m).to_f32().unwrap_or(0.0);
            let (first, t) = interval(per_step * rough_ln(square.max(1.0)), self.table.knots() - 3);
            let weights = weights(t).value;
            (0..4).map(|k| T::of(weights[k]) * self.distance_ohm(first + k)).sum::<T>()
        };
        ways_m(to_m, from_m, self.table.walls_m()).map(of_way).sum()
    }

    /// A coefficient over distances (ohm).
    fn distance_ohm(&self, knot: usize) -> T {
        self.moved.as_ref().map_or_else(|| T::of(self.table.distance_ohm(knot)), |(_, moved)| moved.distances_ohm[knot])
    }

    /// The part of the field between two places that goes by the ways between them: its value (ohm), its derivatives by each of both (ohm/m), and the bends there (ohm/m2):
    /// half of that along x less that along y, and that along both.
    #[inline(always)]
    pub fn by_ways_ohm(&self, to_m: [T; 2], from_m: [T; 2]) -> (T, [[T; 2]; 2], [[T; 2]; 2]) {
        let (mut ohm, mut slopes, mut bends) = (T::ZERO, [[T::ZERO; 2]; 2], [[T::ZERO; 2]; 2]);
        for (way_m, turns) in turned_ways_m(to_m, from_m, self.table.walls_m()) {
            let distance_m = (way_m[0] * way_m[0] + way_m[1] * way_m[1]).sqrt().max(T::of(1e-9));
            let (part_ohm, per_m, per_m2) = self.by_distance_ohm(distance_m);
            ohm += part_ohm;
            let per_m = per_m / distance_m;
            for d in 0..2 {
                slopes[0][d] += per_m * way_m[d];
                slopes[1][d] += per_m * turns[d] * way_m[d];
            }
            // Turned, both ways along an axis bend alike, and those along both once as much and once less.
            let bend = (per_m2 - per_m) / (distance_m * distance_m);
            let even = T::of(0.5) * bend * (way_m[0] * way_m[0] - way_m[1] * way_m[1]);
            let both = bend * way_m[0] * way_m[1];
            for (bends, turned) in bends.iter_mut().zip([T::ONE, turns[0] * turns[1]]) {
                bends[0] += even;
                bends[1] += turned * both;
            }
        }
        (ohm, slopes, bends)
    }

    /// What a way adds to that by its length (m): its value (ohm), and its first and second derivatives by that (ohm/m, ohm/m2).
    #[inline(always)]
    pub(crate) fn by_distance_ohm(&self, distance_m: T) -> (T, T, T) {
        let knots = Knots::of(self.table, distance_m);
        let sum = |weights: &[T; 4]| (0..4).map(|k| weights[k] * self.distance_ohm(knots.first + k)).sum::<T>();
        (sum(&knots.value), sum(&knots.slope), sum(&knots.bend))
    }

    /// `Q b` of the fields at a place.
    #[inline(always)]
    pub fn by_walls(&self, fields_ohm: &[T], products: &mut [T; MAX_ELECTRODES + 1]) {
        let n = fields_ohm.len();
        let with_constant = || fields_ohm.iter().copied().chain([T::ONE]);
        match &self.moved {
            Some((_, moved)) => {
                let products = &mut products[..n + 1];
                products.fill(T::ZERO);
                let rows = moved.walls.chunks_exact(n + 1);
                rows.zip(with_constant()).for_each(|(row, ohm)| add(products, ohm, row));
            }
            None => {
                for (row, product) in products.iter_mut().enumerate().take(n + 1) {
                    let terms = with_constant().enumerate();
                    *product = terms.map(|(s, ohm)| T::of(self.table.walls.of_pair(row, s)) * ohm).sum();
                }
            }
        }
    }
}

impl Table<'_> {
    /// Weights of the coefficients over distances in the field between two places.
    pub(crate) fn by_ways<T: Real>(&self, to_m: [T; 2], from_m: [T; 2]) -> [T; MAX_KNOTS] {
        let mut all = [T::ZERO; MAX_KNOTS];
        for [x_m, y_m] in ways_m(to_m, from_m, self.walls_m()) {
            let knots = Knots::of(self, (x_m * x_m + y_m * y_m).sqrt());
            all.iter_mut().skip(knots.first).zip(knots.value).for_each(|(sum, weight)| *sum += weight);
        }
        all
    }
}

/// Coefficients over distances, with their weights.
struct Knots<T> {
    /// The first of four.
    first: usize,
    /// Weights in the value, and in the derivatives by the distance (1/m, 1/m2).
    value: [T; 4],
    slope: [T; 4],
    bend: [T; 4],
}

impl<T: Real> Knots<T> {
    /// At a distance (m).
    #[inline(always)]
    fn of(table: &Table<'_>, distance_m: T) -> Self {
        let [near_m, ln_step] = [table.head.near_m, table.head.ln_step].map(T::of);
        // Nearer than that there is no second contact.
        let distance_m = distance_m.max(near_m);
        let (first, t) = interval((distance_m / near_m).ln() / ln_step, table.knots() - 3);
        let weights = weights(t);
        let per_m = T::ONE / (ln_step * distance_m);
        let bend = |k: usize| per_m * (per_m * weights.bend[k] - weights.slope[k] / distance_m);
        let slope = weights.slope.map(|slope| per_m * slope);
        Self { first, value: weights.value, slope, bend: core::array::from_fn(bend) }
    }
}
