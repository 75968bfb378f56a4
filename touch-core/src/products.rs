//! Scalar products of many rows of numbers, and Cholesky factors.

use crate::real::Real;

/// Rows of either side that are multiplied at once: as many products as keep a processor busy, and as it has registers for.
pub(crate) const ROWS: [usize; 2] = [2, 4];

/// Products of all rows of `a`, of so many numbers each, with all of `b`; where only the lower triangle is asked for, few above it.
#[inline(always)]
pub(crate) fn each_with_each<T: Real>(
    [a, b]: [&[T]; 2],
    length: usize,
    is_lower: bool,
    mut out: impl FnMut(usize, usize, T),
    dots: impl Fn([&[T]; ROWS[0]], [&[T]; ROWS[1]]) -> [[T; ROWS[1]]; ROWS[0]],
) {
    let [of_a, of_b] = [a, b].map(|rows| rows.len() / length.max(1));
    // The last row is looked at again in place of those past it.
    let row = |index: usize, count: usize| {
        let first = index.min(count - 1) * length;
        first..first + length
    };
    for i in (0..of_a).step_by(ROWS[0]) {
        let end = if is_lower { of_b.min(i + ROWS[0]) } else { of_b };
        for j in (0..end).step_by(ROWS[1]) {
            let products =
                dots(core::array::from_fn(|k| &a[row(i + k, of_a)]), core::array::from_fn(|k| &b[row(j + k, of_b)]));
            for (k, products) in products.into_iter().enumerate().take(of_a - i) {
                products.into_iter().enumerate().take(of_b - j).for_each(|(l, product)| out(i + k, j + l, product));
            }
        }
    }
}

/// Scalar product.
#[inline(always)]
pub(crate) fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sums = [T::ZERO; 8];
    for (a, b) in a.iter().zip(b) {
        (0..8).for_each(|lane| sums[lane] += a[lane] * b[lane]);
    }
    sums.into_iter().sum::<T>() + a_rest.iter().zip(b_rest).map(|(a, b)| *a * *b).sum::<T>()
}

/// Adds so much of a row to another.
#[inline(always)]
pub(crate) fn add<T: Real>(to: &mut [T], share: T, row: &[T]) {
    to.iter_mut().zip(row).for_each(|(to, value)| *to += share * *value);
}

/// Rows that are taken off those below at once.
const PANEL: usize = 4;

/// Makes the upper triangle of `I + p p'`, whose rows are of so many numbers, to that of `U` with `U' U` for it; `None` if rounding has the say.
#[inline(always)]
pub(crate) fn factorise<T: Real>(matrix: &mut [T], count: usize) -> Option<()> {
    for first in (0..count).step_by(PANEL) {
        let end = (first + PANEL).min(count);
        let (before, below) = matrix.split_at_mut(end * count);
        let panel = &mut before[first * count..];
        for i in first..end {
            let (rows, rest) = panel.split_at_mut((i + 1 - first) * count);
            let row = &mut rows[(i - first) * count..];
            let square = row[i];
            // One at least, but for rounding.
            if !(square > T::of(0.5) && square.is_finite()) {
                return None;
            }
            let scale = T::ONE / square.sqrt();
            row[i..].iter_mut().for_each(|value| *value *= scale);
            for (j, other) in rest.chunks_exact_mut(count).enumerate() {
                let j = i + 1 + j;
                add(&mut other[j..], -row[j], &row[j..]);
            }
        }
        for (j, other) in below.chunks_exact_mut(count).enumerate() {
            let j = end + j;
            // There is something below a whole panel only.
            let [a, b, c, d] = core::array::from_fn(|k| &panel[k * count + j..(k + 1) * count]);
            let shares = [a[0], b[0], c[0], d[0]];
            for ((((value, a), b), c), d) in other[j..].iter_mut().zip(a).zip(b).zip(c).zip(d) {
                *value -= shares[0] * *a + shares[1] * *b + shares[2] * *c + shares[3] * *d;
            }
        }
    }
    Some(())
}

/// `U'^-1` of a vector.
#[inline(always)]
pub(crate) fn forward<T: Real>(factor: &[T], count: usize, vector: &mut [T]) {
    for (i, row) in factor.chunks_exact(count.max(1)).enumerate().take(count) {
        let value = vector[i] / row[i];
        vector[i] = value;
        add(&mut vector[i + 1..count], -value, &row[i + 1..]);
    }
}

/// `U^-1` of a vector.
#[inline(always)]
pub(crate) fn backward<T: Real>(factor: &[T], count: usize, vector: &mut [T]) {
    for i in (0..count).rev() {
        let row = &factor[i * count..(i + 1) * count];
        vector[i] = (vector[i] - dot(&row[i + 1..], &vector[i + 1..count])) / row[i];
    }
}
