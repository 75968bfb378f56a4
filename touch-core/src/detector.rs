//! A detector as a circuit sees it, and fields between its places.

use crate::fields::Sample;
use crate::moved::Moved;
use crate::products::add;
use crate::real::{Real, rough_ln};
use crate::spline::{interval, weights};
use crate::table::{MAX_ELECTRODES, MAX_KNOTS, Table};
use crate::unknown::Unknown;
use crate::ways::{turned_ways_m, ways_m};

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
