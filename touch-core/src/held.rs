//! What is not known of a detector as an error of the readings: its patterns, held while contacts move, and what they take from residuals and derivatives.
//!
//! With patterns `P` for a step of one deviation each and noise of variance `v`, readings that a detector at steps `s` would have are `y - h(c, s) + P s`, of covariance
//! `v I + P P'`. By Woodbury's identity, with `p = P / sqrt(v)` and `L L' = I + p' p`,
//!
//! ```text
//! r' (v I + P P')^-1 r = r' r / v - |L^-1 p' r / sqrt(v)|^2
//! ```
//!
//! and the posterior's mean of the steps is `L'^-1 L^-1 p' r / sqrt(v)`.

use crate::circuit::Circuit;
use crate::lanes::at_once;
use crate::patterns::Patterns;
use crate::real::Real;
use crate::table::Table;
use crate::unknown::{Detector, Layout, Unknown};
use crate::vector::PARAMETERS;

/// Square of a pattern, in noise, below which its direction is left out: it changes a sum of squares by no more.
const LEAST_SQUARE: f32 = 0.3;

/// Room for a detector that is not known, as much as [`Room::numbers`] and [`Unknown::tables`] say. What is in it before does not matter; it is to be given again with the
/// next piece of work.
#[derive(Debug)]
pub struct Room<'m, T> {
    /// Numbers.
    pub numbers: &'m mut [T],
    /// Shares of the tables.
    pub shares: &'m mut [f32],
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

    pub(crate) fn parts(&mut self, table: &Table<'_>, unknown: &Unknown<'_>, contacts: usize) -> Parts<'_, T> {
        let (moved, mut rest) = self.numbers.split_at_mut(Layout::of(table, unknown).numbers());
        let [there_v, patterns, state, factor, products, taken, columns, slopes, left] =
            counts(table, unknown, contacts).map(|count| {
                let (part, after) = core::mem::take(&mut rest).split_at_mut(count);
                rest = after;
                part
            });
        let held = Held { there_v, patterns, state, factor, products, taken, columns, slopes, left };
        Parts { moved, shares: &mut *self.shares, held }
    }
}

fn counts(table: &Table<'_>, unknown: &Unknown<'_>, contacts: usize) -> [usize; 9] {
    let (readings, count) = (table.electrodes() * table.electrodes(), unknown.directions.len());
    let parameters = PARAMETERS * contacts;
    [
        readings,
        readings * count,
        readings,
        count * count,
        count,
        count,
        parameters * count,
        readings * parameters,
        readings,
    ]
}

/// Patterns that are held.
#[derive(Debug)]
pub(crate) struct Held<'m, T> {
    there_v: &'m mut [T],
    /// In noise: rows of readings, of those directions that count.
    patterns: &'m mut [T],
    /// What the detector's steps are of the readings, in the linear theory.
    state: &'m mut [T],
    /// `L`, row by row.
    factor: &'m mut [T],
    /// `L^-1 p' r` of the last look, and of the last that was taken; `L^-1 p' J`, a row a parameter.
    products: &'m mut [T],
    taken: &'m mut [T],
    columns: &'m mut [T],
    /// Of the last look: derivatives by the parameters (V), rows of readings, and what is left, in noise.
    slopes: &'m mut [T],
    left: &'m mut [T],
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
    /// Takes the patterns of contacts in noise of a deviation (V), of those readings that say something; `None` if they make no sense.
    pub fn hold<const K: usize, const D: usize>(
        &mut self,
        detector: &Detector<'_, T>,
        unknown: &Unknown<'_>,
        circuit: &Circuit<T, K>,
        noise_v: T,
        says: impl Fn(usize, T) -> bool,
    ) -> Option<Kept<D>> {
        self.note_there(detector, circuit);
        Patterns::new(detector, unknown, circuit, self.there_v).write(self.patterns);
        let all = unknown.directions.len();
        let scale = T::ONE / noise_v;
        self.products.fill(T::ZERO);
        for (index, row) in self.patterns.chunks_exact_mut(all).enumerate() {
            let read_v = detector.read_v(index % detector.table.electrodes(), self.there_v[index]);
            let scale = if says(index, read_v) { scale } else { T::ZERO };
            for (value, square) in row.iter_mut().zip(self.products.iter_mut()) {
                *value *= scale;
                *square += *value * *value;
            }
        }
        let mut kept = Kept::NONE;
        for (direction, _) in self.products.iter().enumerate().filter(|(_, square)| **square > T::of(LEAST_SQUARE)) {
            kept.which[kept.count] = direction as u16;
            kept.count += 1;
        }
        let count = kept.count;
        for row in 0..self.there_v.len() {
            for (to, from) in kept.iter().enumerate() {
                self.patterns[row * count + to] = self.patterns[row * all + from];
            }
        }
        self.factorise(count)?;
        Some(kept)
    }

    /// Notes what is there to be read.
    pub fn note_there<const K: usize>(&mut self, detector: &Detector<'_, T>, circuit: &Circuit<T, K>) {
        let rows = self.there_v.chunks_exact_mut(detector.table.electrodes());
        rows.enumerate().for_each(|(g, row)| circuit.row_v(detector, g, row));
    }

    /// What is there to be read (V).
    pub fn there_v(&self) -> &[T] {
        self.there_v
    }

    fn factorise(&mut self, count: usize) -> Option<()> {
        let Self { patterns, factor, there_v, .. } = self;
        let rows = there_v.len();
        at_once(
            #[inline(always)]
            || factorise(&patterns[..rows * count], count, &mut factor[..count * count]),
        )
    }

    /// Notes where the detector is.
    pub fn set_state<const D: usize>(&mut self, kept: &Kept<D>, steps: &[T; D]) {
        for (state, row) in self.state.iter_mut().zip(self.patterns.chunks_exact(kept.count.max(1))) {
            *state = kept.iter().zip(row).map(|(direction, pattern)| steps[direction] * *pattern).sum();
        }
    }

    /// Begins a look.
    pub fn begin(&mut self) {
        self.slopes.fill(T::ZERO);
        self.left.fill(T::ZERO);
    }

    /// Notes a reading, of which so much is left beside where the detector is, with its derivatives by the parameters (V); returns what the detector's steps are of it,
    /// in noise.
    pub fn add(&mut self, index: usize, noise_v: T, left_v: T, slope: &[T]) -> T {
        let state = self.state[index];
        self.left[index] = left_v / noise_v + state;
        self.slopes[index * slope.len()..(index + 1) * slope.len()].copy_from_slice(slope);
        state
    }

    /// The patterns of a reading, in noise.
    #[cfg(test)]
    pub fn pattern(&self, index: usize, count: usize) -> &[T] {
        &self.patterns[index * count..(index + 1) * count]
    }

    /// Ends the look at contacts of so many parameters: products of what is left, and of the derivatives times `scale`, with the patterns are projected.
    pub fn project(&mut self, count: usize, parameters: usize, scale: T) {
        let Self { patterns, slopes, left, products, columns, factor, .. } = self;
        let rows = left.len();
        at_once(
            #[inline(always)]
            || {
                let patterns = &patterns[..rows * count];
                multiply(patterns, count, left, 1, 0, &mut products[..count]);
                forward(factor, count, &mut products[..count]);
                for (which, column) in columns.chunks_exact_mut(count.max(1)).enumerate().take(parameters) {
                    multiply(patterns, count, slopes, parameters, which, column);
                    column.iter_mut().for_each(|value| *value *= scale);
                    forward(factor, count, column);
                }
            },
        );
    }

    /// `L^-1 p' r`, and `L^-1 p' J`: a row a parameter.
    pub fn projected(&self, count: usize) -> (&[T], &[T]) {
        (&self.products[..count], self.columns)
    }

    /// Takes what the detector's posterior mean explains from what the last look left.
    pub fn whiten(&mut self, count: usize) {
        let vector = &mut self.taken[..count];
        vector.copy_from_slice(&self.products[..count]);
        backward(self.factor, count, vector);
        for (left, pattern) in self.left.iter_mut().zip(self.patterns.chunks_exact(count.max(1))) {
            if *left != T::ZERO {
                *left -= dot(&pattern[..count], vector);
            }
        }
    }

    /// What is left, in noise.
    pub fn left(&self) -> &[T] {
        self.left
    }

    /// The part of a change's square, in noise, that steps of the detector could do as well; and its products with the derivatives but for what these do too, whose
    /// volts are so much noise.
    pub fn shared(&mut self, change: &[T], count: usize, scale: T, products: &mut [T]) -> T {
        let vector = &mut self.taken[..count];
        vector.fill(T::ZERO);
        let slopes = self.slopes.chunks_exact(products.len());
        for ((value, pattern), slope) in change.iter().zip(self.patterns.chunks_exact(count.max(1))).zip(slopes) {
            vector.iter_mut().zip(pattern).for_each(|(sum, pattern)| *sum += *value * *pattern);
            products.iter_mut().zip(slope).for_each(|(sum, slope)| *sum += *value * *slope);
        }
        forward(self.factor, count, vector);
        for (product, column) in products.iter_mut().zip(self.columns.chunks_exact(count.max(1))) {
            *product = scale * *product - dot(&column[..count], vector);
        }
        dot(vector, vector)
    }

    /// The last look is where contacts are.
    pub fn take(&mut self, count: usize) {
        self.taken[..count].copy_from_slice(&self.products[..count]);
    }

    /// `L'^-1` of the last products that were taken: the posterior's mean of those directions that count.
    pub fn posterior<const D: usize>(&mut self, kept: &Kept<D>, steps: &mut [T; D]) {
        backward(self.factor, kept.count, self.taken);
        kept.iter().zip(self.taken.iter()).for_each(|(direction, step)| steps[direction] = *step);
    }

    /// Logarithm of the determinant of `I + p' p`.
    pub fn ln_determinant(&self, count: usize) -> T {
        T::of(2.0) * (0..count).map(|i| self.factor[i * count + i].ln()).sum::<T>()
    }
}

/// `L` of `I + p' p`; `None` if rounding has the say.
#[inline(always)]
fn factorise<T: Real>(patterns: &[T], count: usize, matrix: &mut [T]) -> Option<()> {
    gram(patterns, count, matrix);
    (0..count).for_each(|i| matrix[i * count + i] += T::ONE);
    for i in 0..count {
        let (above, rest) = matrix.split_at_mut(i * count);
        let row = &mut rest[..count];
        for (j, other) in above.chunks_exact(count).enumerate() {
            row[j] = (row[j] - dot(&row[..j], &other[..j])) / other[j];
        }
        let square = row[i] - dot(&row[..i], &row[..i]);
        // One at least, but for rounding.
        if !(square > T::of(0.5) && square.is_finite()) {
            return None;
        }
        row[i] = square.sqrt();
    }
    Some(())
}

/// `p' v`, of a vector whose elements are `stride` apart from `first` on, four rows of `p` at once.
#[inline(always)]
fn multiply<T: Real>(rows: &[T], count: usize, vector: &[T], stride: usize, first: usize, product: &mut [T]) {
    product.fill(T::ZERO);
    if count == 0 {
        return;
    }
    for (at, four) in rows.chunks(4 * count).enumerate() {
        let factor = |row: usize| vector[(4 * at + row) * stride + first];
        if four.len() == 4 * count {
            let [fa, fb, fc, fd] = [0, 1, 2, 3].map(factor);
            let (a, rest) = four.split_at(count);
            let (b, rest) = rest.split_at(count);
            let (c, d) = rest.split_at(count);
            for ((((sum, a), b), c), d) in product.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                *sum += fa * *a + fb * *b + fc * *c + fd * *d;
            }
        } else {
            for (row, part) in four.chunks_exact(count).enumerate() {
                let factor = factor(row);
                product.iter_mut().zip(part).for_each(|(sum, value)| *sum += factor * *value);
            }
        }
    }
}

/// `L^-1` of a vector, with `L` row by row.
#[inline(always)]
pub(crate) fn forward<T: Real>(factor: &[T], count: usize, vector: &mut [T]) {
    for (i, row) in factor.chunks_exact(count.max(1)).enumerate().take(count) {
        vector[i] = (vector[i] - dot(&row[..i], &vector[..i])) / row[i];
    }
}

/// `L'^-1` of a vector.
fn backward<T: Real>(factor: &[T], count: usize, vector: &mut [T]) {
    for i in (0..count).rev() {
        let row = &factor[i * count..(i + 1) * count];
        let value = vector[i] / row[i];
        vector[i] = value;
        vector.iter_mut().zip(row).take(i).for_each(|(other, factor)| *other -= *factor * value);
    }
}

/// Scalar product, in four sums for a processor to do at once.
#[inline(always)]
pub(crate) fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut sums = [T::ZERO; 4];
    for (a, b) in a.iter().zip(b) {
        (0..4).for_each(|lane| sums[lane] += a[lane] * b[lane]);
    }
    sums.into_iter().sum::<T>() + a_rest.iter().zip(b_rest).map(|(a, b)| *a * *b).sum::<T>()
}

/// Lower triangle of `p' p`, four rows of `p` at once.
#[inline(always)]
fn gram<T: Real>(rows: &[T], count: usize, matrix: &mut [T]) {
    matrix.fill(T::ZERO);
    if count == 0 {
        return;
    }
    for four in rows.chunks(4 * count) {
        let mut parts = four.chunks_exact(count);
        let [a, b, c, d] = core::array::from_fn(|_| parts.next().unwrap_or(&[]));
        let is_whole = d.len() == count;
        for (i, row) in matrix.chunks_exact_mut(count).enumerate() {
            let row = &mut row[..=i];
            if is_whole {
                let (a, b, c, d) = (&a[..=i], &b[..=i], &c[..=i], &d[..=i]);
                let [fa, fb, fc, fd] = [a[i], b[i], c[i], d[i]];
                for (j, sum) in row.iter_mut().enumerate() {
                    *sum += fa * a[j] + fb * b[j] + fc * c[j] + fd * d[j];
                }
            } else {
                for part in four.chunks_exact(count) {
                    row.iter_mut().zip(part).for_each(|(sum, value)| *sum += part[i] * *value);
                }
            }
        }
    }
}
