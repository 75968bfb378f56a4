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

use crate::circuit::Circuit;
use crate::frame::{Frame, left_v};
use crate::lanes::at_once;
use crate::patterns::Patterns;
use crate::products::{add, backward, dot, factorise, forward};
use crate::real::Real;
use crate::table::Table;
use crate::unknown::{Detector, Layout, Unknown};
use crate::vector::PARAMETERS;

/// Square of a pattern, in noise, below which its direction is left out: it changes a sum of squares by no more.
const LEAST_SQUARE: f32 = 0.3;

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
pub(crate) struct Parts<'m, T> {
    /// For the detector.
    pub moved: &'m mut [T],
    pub shares: &'m mut [f32],
    /// For the patterns.
    pub held: Held<'m, T>,
}

impl<T: Real> Room<'_, T> {
    /// How many numbers there are to be for up to `contacts` contacts.
    pub fn numbers(table: &Table<'_>, unknown: &Unknown<'_>, contacts: usize) -> usize {
        Layout::of(table, unknown).numbers() + counts(table, unknown, contacts).iter().sum::<usize>()
    }

    /// How many floats there are to be for up to `contacts` contacts.
    pub fn floats(table: &Table<'_>, unknown: &Unknown<'_>, contacts: usize) -> usize {
        unknown.tables + contacts * unknown.of_place(table.electrodes())
    }

    pub(crate) fn parts(&mut self, table: &Table<'_>, unknown: &Unknown<'_>, contacts: usize) -> Parts<'_, T> {
        let (moved, mut rest) = self.numbers.split_at_mut(Layout::of(table, unknown).numbers());
        let [there_v, patterns, scaled, solved, factor, squares, products, taken, columns, slopes, left, read_v] =
            counts(table, unknown, contacts).map(|count| {
                let (part, after) = core::mem::take(&mut rest).split_at_mut(count);
                rest = after;
                part
            });
        let (shares, fields) = self.floats.split_at_mut(unknown.tables);
        let fields = &mut fields[..contacts * unknown.of_place(table.electrodes())];
        let held = Held {
            fields,
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
        };
        Parts { moved, shares, held }
    }
}

fn counts(table: &Table<'_>, unknown: &Unknown<'_>, contacts: usize) -> [usize; 12] {
    let (readings, count) = (table.electrodes() * table.electrodes(), unknown.directions.len());
    let parameters = PARAMETERS * contacts;
    [
        readings,
        readings * count,
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
    ]
}

/// Patterns that are held.
#[derive(Debug)]
pub(crate) struct Held<'m, T> {
    /// What each table changes at contacts.
    fields: &'m mut [f32],
    there_v: &'m mut [T],
    /// In noise: a row of readings for each direction that counts.
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

/// Which directions count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Kept<const D: usize> {
    which: [u16; D],
    /// How many.
    pub count: usize,
}

impl<const D: usize> Kept<D> {
    /// None.
    pub const NONE: Self = Self { which: [0; D], count: 0 };

    /// Their numbers.
    pub fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.which.iter().take(self.count).map(|which| usize::from(*which))
    }
}

impl<T: Real> Held<'_, T> {
    /// Takes the patterns of contacts that were read, in noise of a deviation (V), of those readings that say something; that is so many times
    /// what noise is, in which directions count.
    pub fn hold<const K: usize, const D: usize>(
        &mut self,
        detector: &Detector<'_, T>,
        unknown: &Unknown<'_>,
        circuit: &Circuit<T, K>,
        [noise_v, times]: [T; 2],
        says: impl Fn(usize, T) -> bool,
    ) -> Kept<D> {
        Patterns::new(detector, unknown, circuit, self.there_v, self.fields).write(self.patterns, self.left);
        let readings = self.there_v.len();
        for (index, (scale, read_v)) in self.left.iter_mut().zip(&*self.read_v).enumerate() {
            *scale = if says(index, *read_v) { T::ONE / noise_v } else { T::ZERO };
        }
        let (mut kept, least) = (Kept::NONE, T::of(LEAST_SQUARE) / (times * times));
        for direction in 0..unknown.directions.len() {
            let (before, from) = self.patterns.split_at_mut(direction * readings);
            let pattern = &mut from[..readings];
            pattern.iter_mut().zip(&*self.left).for_each(|(value, scale)| *value *= *scale);
            if dot(pattern, pattern) > least {
                if let Some(to) = before.get_mut(kept.count * readings..(kept.count + 1) * readings) {
                    to.copy_from_slice(pattern);
                }
                kept.which[kept.count] = direction as u16;
                kept.count += 1;
            }
        }
        self.multiply(kept.count);
        kept
    }

    /// Notes products of the patterns with each other.
    fn multiply(&mut self, count: usize) {
        let Self { patterns, factor, squares, there_v, .. } = self;
        let (readings, factor) = (there_v.len(), &mut factor[..count * count]);
        let patterns = &patterns[..readings * count];
        // In the triangle below the factor.
        T::products(patterns, patterns, readings, true, |i, j, product| factor[i * count + j] = product);
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
                    let all = read_v.iter_mut().zip(there_v).enumerate();
                    all.for_each(|(e, (read_v, there_v))| *read_v = detector.read_v(e, *there_v));
                }
            },
        );
    }

    /// What is there to be read (V).
    pub fn there_v(&self) -> &[T] {
        self.there_v
    }

    /// Takes what is held to so many times the noise.
    pub fn rescale(&mut self, count: usize, times: T) {
        let (per_time, per_square) = (T::ONE / times, T::ONE / (times * times));
        self.patterns[..self.there_v.len() * count].iter_mut().for_each(|value| *value *= per_time);
        self.squares[..count].iter_mut().for_each(|square| *square *= per_square);
        for i in 0..count {
            self.factor[i * count..i * count + i].iter_mut().for_each(|product| *product *= per_square);
        }
    }

    /// Factorises `I + p' p`, or where steps are damped with more than one in place of `I`; `None` if it makes no sense.
    pub fn factorise(&mut self, count: usize, damping: T) -> Option<()> {
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
    pub fn set_state<const D: usize>(&mut self, kept: &Kept<D>, steps: &[T; D]) {
        let count = kept.count;
        kept.iter().zip(self.solved.iter_mut()).for_each(|(direction, to)| *to = steps[direction]);
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
    pub fn least(&mut self, count: usize) -> T {
        self.project_left(count);
        dot(self.left, self.left) + self.projected(count).less()
    }

    /// Notes the derivatives of the readings while an electrode is grounded by a parameter, in noise.
    pub fn note(&mut self, g: usize, parameter: usize, slopes: &[T]) {
        let first = parameter * self.left.len() + g * slopes.len();
        self.slopes[first..first + slopes.len()].copy_from_slice(slopes);
    }

    /// The pattern of a direction, in noise.
    #[cfg(test)]
    pub fn pattern(&self, direction: usize) -> &[T] {
        let readings = self.there_v.len();
        &self.patterns[direction * readings..(direction + 1) * readings]
    }

    /// Ends the look at contacts of so many parameters: products of what is left, and of the derivatives, with the patterns are projected.
    pub fn project(&mut self, count: usize, parameters: usize) {
        self.project_left(count);
        let Self { patterns, slopes, left, columns, factor, .. } = self;
        let readings = left.len();
        let patterns = &patterns[..readings * count];
        T::products(&slopes[..readings * parameters], patterns, readings, false, |which, direction, product| {
            columns[which * count + direction] = product;
        });
        at_once(
            #[inline(always)]
            || {
                for column in columns.chunks_exact_mut(count.max(1)).take(parameters) {
                    forward(factor, count, column);
                }
            },
        );
    }

    /// The same of what is left alone.
    pub fn project_left(&mut self, count: usize) {
        let Self { patterns, left, products, factor, .. } = self;
        let readings = left.len();
        let patterns = &patterns[..readings * count];
        T::products(left, patterns, readings, false, |_, direction, product| products[direction] = product);
        at_once(
            #[inline(always)]
            || forward(factor, count, &mut products[..count]),
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
    pub fn projected(&self, count: usize) -> Projected<'_, T> {
        let Self { products, scaled, solved, columns, .. } = self;
        Projected { left: &products[..count], columns, scaled: &scaled[..count], solved: &solved[..count] }
    }

    /// Takes what the detector's posterior mean explains from what the last look left.
    pub fn whiten(&mut self, count: usize) {
        self.take(count);
        let Self { taken, patterns, left, factor, .. } = self;
        let vector = &mut taken[..count];
        backward(factor, count, vector);
        for (step, pattern) in vector.iter().zip(patterns.chunks_exact(left.len())) {
            add(left, -*step, pattern);
        }
    }

    /// What is left, in noise.
    pub fn left(&self) -> &[T] {
        self.left
    }

    /// The part of a change's square, in noise, that steps of the detector could do as well; and its products with the derivatives but for what these do too.
    pub fn shared(&mut self, change: &[T], count: usize, shared: &mut [T]) -> T {
        let vector = &mut self.taken[..count];
        let readings = change.len();
        T::products(change, &self.patterns[..readings * count], readings, false, |_, direction, product| {
            vector[direction] = product;
        });
        T::products(change, &self.slopes[..readings * shared.len()], readings, false, |_, which, product| {
            shared[which] = product;
        });
        forward(self.factor, count, vector);
        for (shared, column) in shared.iter_mut().zip(self.columns.chunks_exact(count.max(1))) {
            *shared -= dot(&column[..count], vector);
        }
        dot(vector, vector)
    }

    /// The last look is where contacts are.
    pub fn take(&mut self, count: usize) {
        for ((taken, left), solved) in self.taken.iter_mut().zip(&*self.products).zip(&*self.solved).take(count) {
            *taken = *left - *solved;
        }
    }

    /// Takes those directions that count to the posterior's mean, from where the detector was noted to be.
    pub fn posterior<const D: usize>(&mut self, kept: &Kept<D>, steps: &mut [T; D]) {
        backward(self.factor, kept.count, self.taken);
        kept.iter().zip(self.taken.iter()).for_each(|(direction, step)| steps[direction] += *step);
    }

    /// Logarithm of the determinant of `I + p' p`.
    pub fn ln_determinant(&self, count: usize) -> T {
        T::of(2.0) * (0..count).map(|i| self.factor[i * count + i].ln()).sum::<T>()
    }
}
