//! What is not known of a detector as an error of the readings: its patterns, held while contacts move, and what they take from residuals and derivatives.
//!
//! With patterns `P` for a step of one deviation each, where the detector is at steps `s` and `r` is left of readings in noise of variance `v`, other steps cost least where,
//! with `p = P / sqrt(v)`, `U' U = I + p' p` and `g = p' r / sqrt(v) - s`,
//!
//! ```text
//! S = r' r / v + s' s - |U'^-1 g|^2
//! ```
//!
//! at `s + U^-1 U'^-1 g`, the posterior's mean: by Woodbury's identity the sum of squares with `v I + P P'` for the covariance. What is subtracted is as small as what is left,
//! however far the detector is from its description.

mod sums;

use self::sums::Sums;
use crate::circuit::Circuit;
use crate::detector::Detector;
use crate::frame::{Frame, left_v};
use crate::lanes::at_once;
use crate::local::{Locals, Sorted, rows};
use crate::moved::Layout;
use crate::patterns::Patterns;
use crate::products::{add, backward, dot, factorise, forward, turn};
use crate::real::Real;
use crate::table::Table;
use crate::unknown::{Unknown, pairs};
use crate::vector::PARAMETERS;

/// Room for a detector that is not known, as much as [`Room::numbers`] and [`Room::floats`] say. What is in it before does not matter; it is to be given again with the
/// next piece of work.
#[derive(Debug)]
pub struct Room<'m, T> {
    /// Numbers.
    pub numbers: &'m mut [T],
    /// Numbers that take no more digits.
    pub floats: &'m mut [f32],
}

/// Parts of the room.
pub(crate) struct Parts<'m, T, const D: usize> {
    /// For the detector.
    pub moved: &'m mut [T],
    pub shares: &'m mut [f32],
    /// For the patterns.
    pub held: Held<'m, T, D>,
}

impl<T: Real> Room<'_, T> {
    /// How many numbers there are to be for up to `contacts` contacts.
    pub fn numbers(table: &Table<'_>, unknown: &Unknown<'_>, contacts: usize) -> usize {
        Layout::of(table, unknown).numbers() + counts(table, unknown, contacts).iter().sum::<usize>()
    }

    /// How many floats there are to be for up to `contacts` contacts.
    pub fn floats(table: &Table<'_>, unknown: &Unknown<'_>, contacts: usize) -> usize {
        unknown.tables * (1 + pairs(contacts - 1)) + contacts * unknown.of_place(table.electrodes())
    }

    pub(crate) fn parts<const D: usize>(
        &mut self,
        table: &Table<'_>,
        unknown: &Unknown<'_>,
        contacts: usize,
    ) -> Parts<'_, T, D> {
        let (moved, mut rest) = self.numbers.split_at_mut(Layout::of(table, unknown).numbers());
        let [
            there_v,
            patterns,
            scaled,
            solved,
            factor,
            squares,
            products,
            taken,
            columns,
            slopes,
            left,
            read_v,
            turned,
            of_detector,
            with_contacts,
            pull,
            rows,
        ] = counts(table, unknown, contacts).map(|count| {
            let (part, after) = core::mem::take(&mut rest).split_at_mut(count);
            rest = after;
            part
        });
        let (shares, floats) = self.floats.split_at_mut(unknown.tables);
        let (fields, floats) = floats.split_at_mut(contacts * unknown.of_place(table.electrodes()));
        let between_ohm = &mut floats[..unknown.tables * pairs(contacts - 1)];
        let held = Held {
            sorted: Sorted::of(unknown),
            fields,
            between_ohm,
            there_v,
            patterns,
            scaled,
            solved,
            factor,
            squares,
            products,
            taken,
            columns,
            slopes,
            left,
            read_v,
            turned,
            sums: Sums { of_detector, with_contacts, pull, rows },
        };
        Parts { moved, shares, held }
    }
}

fn counts(table: &Table<'_>, unknown: &Unknown<'_>, contacts: usize) -> [usize; 17] {
    let (readings, count) = (table.electrodes() * table.electrodes(), unknown.directions.len());
    let parameters = PARAMETERS * contacts;
    [
        readings,
        readings * rows(unknown),
        count,
        count,
        count * count,
        count,
        count,
        count,
        parameters * count,
        readings * parameters,
        readings,
        readings,
        readings,
        count * count,
        parameters * count,
        count,
        parameters * count,
    ]
}

/// Patterns that are held.
#[derive(Debug)]
pub(crate) struct Held<'m, T, const D: usize> {
    sorted: Sorted<D>,
    /// What each table changes at contacts, and between them.
    fields: &'m mut [f32],
    between_ohm: &'m mut [f32],
    there_v: &'m mut [T],
    /// In noise: a row of readings for each common direction, then pairs of [layers](crate::local).
    patterns: &'m mut [T],
    /// `U s` and `U'^-1 s` of where the detector is.
    scaled: &'m mut [T],
    solved: &'m mut [T],
    /// `U`, row by row, and below it products of the patterns with each other; their squares.
    factor: &'m mut [T],
    squares: &'m mut [T],
    /// `U'^-1 p' r` of the last look, and `U'^-1 g` of the last that was taken; `U'^-1 p' J`, a row a parameter.
    products: &'m mut [T],
    taken: &'m mut [T],
    columns: &'m mut [T],
    /// Of the last look, in noise: derivatives, a row of readings for each parameter, and what is left.
    slopes: &'m mut [T],
    left: &'m mut [T],
    /// What channels read of contacts at the last look (V).
    read_v: &'m mut [T],
    /// Room for readings turned.
    turned: &'m mut [T],
    sums: Sums<'m, T>,
}

/// A look in the directions of the patterns.
pub(crate) struct Projected<'a, T> {
    /// `U'^-1 p' r` of what is left, and `U'^-1 p' J`: a row a parameter.
    pub left: &'a [T],
    pub columns: &'a [T],
    /// `U s` and `U'^-1 s` of where the detector is.
    pub scaled: &'a [T],
    pub solved: &'a [T],
}

impl<T: Real> Projected<'_, T> {
    /// What the best steps of the detector make of the sum of squares: `s' s` is `(U'^-1 s)' (U s)`.
    pub fn less(&self) -> T {
        let Self { left, scaled, solved, .. } = self;
        dot(solved, scaled) - dot(left, left) - dot(solved, solved) + T::of(2.0) * dot(left, solved)
    }
}

impl<T: Real, const D: usize> Held<'_, T, D> {
    /// Takes the patterns of contacts that were read, in noise of a deviation (V), of those readings that say something.
    pub fn hold<const K: usize>(
        &mut self,
        detector: &Detector<'_, T>,
        unknown: &Unknown<'_>,
        circuit: &mut Circuit<T, K>,
        noise_v: T,
        says: impl Fn(usize, T) -> bool,
    ) {
        circuit.derive(detector.table);
        Patterns::new(detector, unknown, circuit, self.there_v, self.fields, self.between_ohm).write(
            &self.sorted,
            self.patterns,
            self.left,
        );
        for (index, (scale, read_v)) in self.left.iter_mut().zip(&*self.read_v).enumerate() {
            *scale = if says(index, *read_v) { T::ONE / noise_v } else { T::ZERO };
        }
        let (n, readings) = (detector.table.electrodes(), self.there_v.len());
        turn(self.left, n, self.turned);
        let (common, layers) = self.patterns.split_at_mut(self.sorted.commons * readings);
        let rows = common.chunks_exact_mut(readings).map(|row| (row, &*self.left));
        let pairs =
            layers.chunks_exact_mut(2 * readings).take(self.sorted.layers).map(|pair| pair.split_at_mut(readings));
        let pairs = pairs.flat_map(|(down, across)| [(down, &*self.left), (across, &*self.turned)]);
        for (row, scales) in rows.chain(pairs) {
            row.iter_mut().zip(scales).for_each(|(value, scale)| *value *= *scale);
        }
        self.multiply();
    }

    /// Notes products of the patterns with each other.
    fn multiply(&mut self) {
        let readings = self.there_v.len();
        let n = readings.isqrt();
        let Self { sorted, patterns, factor, squares, turned, .. } = self;
        let count = sorted.count;
        let (common, mut locals) = split(patterns, turned, sorted, readings);
        let factor = &mut factor[..count * count];
        // In the triangle below the factor.
        let mut note = |i: usize, j: usize, product: T| factor[i.max(j) * count + i.min(j)] = product;
        T::products(common, common, readings, true, |i, j, product| {
            if j <= i {
                note(sorted.common_at(i), sorted.common_at(j), product);
            }
        });
        at_once(
            #[inline(always)]
            || {
                for (number, row) in sorted.common().zip(common.chunks_exact(readings)) {
                    locals.with(sorted, n, row, |local, product| note(number, local, product));
                }
                locals.with_each_other(sorted, n, &mut note);
            },
        );
        (0..count).for_each(|i| squares[i] = factor[i * count + i]);
    }

    /// Notes what contacts that are solved make: what is there to be read, and what channels read of it (V).
    pub fn read<const K: usize>(&mut self, detector: &Detector<'_, T>, circuit: &Circuit<T, K>) {
        let n = detector.table.electrodes();
        let rows = self.there_v.chunks_exact_mut(n).zip(self.read_v.chunks_exact_mut(n));
        at_once(
            #[inline(always)]
            || {
                for (g, (there_v, read_v)) in rows.enumerate() {
                    circuit.row_v(detector, g, there_v);
                    detector.read_v(there_v, read_v);
                }
            },
        );
    }

    /// What is there to be read (V).
    pub fn there_v(&self) -> &[T] {
        self.there_v
    }

    /// Takes what is held to so many times the noise.
    pub fn rescale(&mut self, times: T) {
        let count = self.sorted.count;
        let (per_time, per_square) = (T::ONE / times, T::ONE / (times * times));
        self.patterns.iter_mut().for_each(|value| *value *= per_time);
        self.squares[..count].iter_mut().for_each(|square| *square *= per_square);
        for i in 0..count {
            self.factor[i * count..i * count + i].iter_mut().for_each(|product| *product *= per_square);
        }
    }

    /// Factorises `I + p' p`, or where steps are damped with more than one in place of `I`; `None` if it makes no sense.
    pub fn factorise(&mut self, damping: T) -> Option<()> {
        let count = self.sorted.count;
        let Self { factor, squares, .. } = self;
        let factor = &mut factor[..count * count];
        for i in 0..count {
            factor[i * count + i] = damping + squares[i];
            (i + 1..count).for_each(|j| factor[i * count + j] = factor[j * count + i]);
        }
        at_once(
            #[inline(always)]
            || factorise(factor, count),
        )
    }

    /// Notes where the detector is.
    pub fn set_state(&mut self, steps: &[T]) {
        let count = self.solved.len();
        self.solved.copy_from_slice(&steps[..count]);
        for (i, row) in self.factor.chunks_exact(count.max(1)).enumerate().take(count) {
            self.scaled[i] = dot(&row[i..], &self.solved[i..count]);
        }
        forward(self.factor, count, self.solved);
    }

    /// What channels read of contacts (V).
    pub fn read_v(&self) -> &[T] {
        self.read_v
    }

    /// Notes what that leaves of a frame in so much noise (V); nothing, where a reading says nothing.
    pub fn leave(&mut self, frame: &Frame<'_, T>, full_v: T, noise_v: T) {
        for (index, (left, read_v)) in self.left.iter_mut().zip(&*self.read_v).enumerate() {
            *left = left_v(frame, index, full_v, *read_v).map_or(T::ZERO, |left_v| left_v / noise_v);
        }
    }

    /// Squares of what is left, at least, with those of the steps of the detector that leave it.
    pub fn least(&mut self) -> T {
        self.project_left();
        dot(self.left, self.left) + self.projected().less()
    }

    /// Notes the derivatives of the readings while an electrode is grounded by a parameter, in noise.
    pub fn note(&mut self, g: usize, parameter: usize, slopes: &[T]) {
        let first = parameter * self.left.len() + g * slopes.len();
        self.slopes[first..first + slopes.len()].copy_from_slice(slopes);
    }

    /// The pattern of a direction, in noise.
    #[cfg(test)]
    pub fn pattern(&self, direction: usize) -> std::vec::Vec<T> {
        crate::local::pattern(&self.sorted, self.patterns, self.there_v.len(), direction)
    }

    /// Ends the look at contacts of so many parameters: products of what is left, and of the derivatives, with the patterns are projected.
    pub fn project(&mut self, parameters: usize) {
        self.project_left();
        let (readings, count) = (self.left.len(), self.sorted.count);
        let Self { sorted, patterns, slopes, columns, factor, turned, .. } = self;
        let slopes = &slopes[..readings * parameters];
        let (common, mut locals) = split(patterns, turned, sorted, readings);
        T::products(slopes, common, readings, false, |which, place, product| {
            columns[which * count + sorted.common_at(place)] = product;
        });
        at_once(
            #[inline(always)]
            || {
                for (slopes, column) in slopes.chunks_exact(readings).zip(columns.chunks_exact_mut(count.max(1))) {
                    locals.with(sorted, readings.isqrt(), slopes, |local, product| column[local] = product);
                    forward(factor, count, column);
                }
            },
        );
    }

    /// The same of what is left alone.
    pub fn project_left(&mut self) {
        let Self { sorted, patterns, left, products, factor, turned, .. } = self;
        let (common, mut locals) = split(patterns, turned, sorted, left.len());
        multiplied(sorted, common, &mut locals, left, products);
        at_once(
            #[inline(always)]
            || forward(factor, sorted.count, products),
        );
    }

    /// Calls with products of the last look's derivatives, the lower triangle and few besides, and with those of what is left and them.
    pub fn products(&self, parameters: usize, squares: impl FnMut(usize, usize, T), with_left: impl FnMut(usize, T)) {
        let readings = self.left.len();
        let slopes = &self.slopes[..readings * parameters];
        T::products(slopes, slopes, readings, true, squares);
        self.products_with_left(parameters, with_left);
    }

    /// The latter alone.
    pub fn products_with_left(&self, parameters: usize, mut with_left: impl FnMut(usize, T)) {
        let readings = self.left.len();
        let slopes = &self.slopes[..readings * parameters];
        T::products(self.left, slopes, readings, false, |_, which, product| with_left(which, product));
    }

    /// What the last look leaves and its derivatives are in the directions of the patterns.
    pub fn projected(&self) -> Projected<'_, T> {
        let Self { products, scaled, solved, columns, .. } = self;
        Projected { left: products, columns, scaled, solved }
    }

    /// Takes what the detector's posterior mean explains from what the last look left.
    pub fn whiten(&mut self) {
        self.take();
        let Self { sorted, taken, patterns, left, factor, turned, .. } = self;
        backward(factor, sorted.count, taken);
        let readings = left.len();
        let (common, locals) = split(patterns, turned, sorted, readings);
        for (number, pattern) in sorted.common().zip(common.chunks_exact(readings)) {
            add(left, -taken[number], pattern);
        }
        locals.take(sorted, readings.isqrt(), taken, left);
    }

    /// What is left, in noise.
    pub fn left(&self) -> &[T] {
        self.left
    }

    /// The part of a change's square, in noise, that steps of the detector could do as well; and its products with the derivatives but for what these do too.
    pub fn shared(&mut self, change: &[T], shared: &mut [T]) -> T {
        let (readings, count) = (change.len(), self.sorted.count);
        let Self { sorted, patterns, slopes, columns, taken, factor, turned, .. } = self;
        let (common, mut locals) = split(patterns, turned, sorted, readings);
        multiplied(sorted, common, &mut locals, change, taken);
        T::products(change, &slopes[..readings * shared.len()], readings, false, |_, which, product| {
            shared[which] = product;
        });
        at_once(
            #[inline(always)]
            || forward(factor, count, taken),
        );
        for (shared, column) in shared.iter_mut().zip(columns.chunks_exact(count.max(1))) {
            *shared -= dot(column, taken);
        }
        dot(taken, taken)
    }

    /// The last look is where contacts are.
    pub fn take(&mut self) {
        for ((taken, left), solved) in self.taken.iter_mut().zip(&*self.products).zip(&*self.solved) {
            *taken = *left - *solved;
        }
    }

    /// Takes the detector to the posterior's mean, from where it was noted to be.
    pub fn posterior(&mut self, steps: &mut [T]) {
        backward(self.factor, self.taken.len(), self.taken);
        self.taken.iter().zip(steps).for_each(|(step, to)| *to += *step);
    }

    /// Logarithm of the determinant of `I + p' p`.
    pub fn ln_determinant(&self) -> T {
        let count = self.taken.len();
        T::of(2.0) * (0..count).map(|i| self.factor[i * count + i].ln()).sum::<T>()
    }
}

/// Common patterns, and local ones.
fn split<'a, T, const D: usize>(
    patterns: &'a mut [T],
    turned: &'a mut [T],
    sorted: &Sorted<D>,
    readings: usize,
) -> (&'a [T], Locals<'a, T>) {
    let (common, layers) = patterns.split_at_mut(sorted.commons * readings);
    (common, Locals { layers, turned })
}

/// Notes products of some readings with all patterns.
fn multiplied<T: Real, const D: usize>(
    sorted: &Sorted<D>,
    common: &[T],
    locals: &mut Locals<'_, T>,
    readings: &[T],
    products: &mut [T],
) {
    let count = readings.len();
    T::products(readings, common, count, false, |_, place, product| products[sorted.common_at(place)] = product);
    at_once(
        #[inline(always)]
        || locals.with(sorted, count.isqrt(), readings, |local, product| products[local] = product),
    );
}
