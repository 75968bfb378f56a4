//! Scalar products of many rows of numbers, and Cholesky factors.

use crate::real::Real;

/// Rows of one side and of the other that are multiplied at once: as many products as keep a processor busy, and as it has registers for. Of 105 rows of 256 all products take
/// a fifth less time so than with two and four.
pub(crate) const DOWN: usize = 3;
pub(crate) const ACROSS: usize = 4;

/// Scalar products of one row, or some, with others.
pub(crate) trait Dots<T> {
    fn of_one(&self, a: &[T], b: [&[T]; ACROSS]) -> [T; ACROSS];
    fn of_some(&self, a: [&[T]; DOWN], b: [&[T]; ACROSS]) -> [[T; ACROSS]; DOWN];
}

/// Products of all rows of `a`, of so many numbers each, with all of `b`; where only the lower triangle is asked for, few above it.
#[inline(always)]
pub(crate) fn each_with_each<T: Real>(
    [a, b]: [&[T]; 2],
    length: usize,
    is_lower: bool,
    mut out: impl FnMut(usize, usize, T),
    dots: &impl Dots<T>,
) {
    let [of_a, of_b] = [a, b].map(|rows| rows.len() / length.max(1));
    let row_a = |i: usize| &a[i * length..(i + 1) * length];
    let mut i = 0;
    while i < of_a {
        let is_one = i + DOWN > of_a;
        let next = if is_one { i + 1 } else { i + DOWN };
        let end = if is_lower { of_b.min(next) } else { of_b };
        for j in (0..end).step_by(ACROSS) {
            // The last row is looked at again in place of those past it.
            let rows_b = core::array::from_fn(|l| {
                let first = (j + l).min(end - 1) * length;
                &b[first..first + length]
            });
            let mut tell = |k: usize, products: [T; ACROSS]| {
                products.into_iter().enumerate().take(end - j).for_each(|(l, product)| out(i + k, j + l, product));
            };
            if is_one {
                tell(0, dots.of_one(row_a(i), rows_b));
            } else {
                let rows_a = core::array::from_fn(|k| row_a(i + k));
                dots.of_some(rows_a, rows_b).into_iter().enumerate().for_each(|(k, products)| tell(k, products));
            }
        }
        i = next;
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

/// A square matrix of so many rows turned: rows become columns.
#[inline(always)]
pub(crate) fn turn<T: Copy>(matrix: &[T], n: usize, turned: &mut [T]) {
    for (i, row) in turned.chunks_exact_mut(n).enumerate().take(n) {
        row.iter_mut().enumerate().for_each(|(e, value)| *value = matrix[e * n + i]);
    }
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
        // There is something below a whole panel only. Two rows at once need what the panel's have once.
        let from = |j: usize| core::array::from_fn::<_, PANEL, _>(|k| &panel[k * count + j..(k + 1) * count]);
        let (pairs, last) = below.split_at_mut(below.len() - below.len() % (2 * count));
        for (pair, rows) in pairs.chunks_exact_mut(2 * count).enumerate() {
            let j = end + 2 * pair;
            let (one, other) = rows.split_at_mut(count);
            let [a, b, c, d] = from(j);
            let shares = [a, b, c, d].map(|row| [row[0], row[1]]);
            one[j] -= (0..PANEL).map(|k| shares[k][0] * shares[k][0]).sum::<T>();
            let all =
                one[j + 1..].iter_mut().zip(&mut other[j + 1..]).zip(&a[1..]).zip(&b[1..]).zip(&c[1..]).zip(&d[1..]);
            for (((((one, other), a), b), c), d) in all {
                *one -= shares[0][0] * *a + shares[1][0] * *b + shares[2][0] * *c + shares[3][0] * *d;
                *other -= shares[0][1] * *a + shares[1][1] * *b + shares[2][1] * *c + shares[3][1] * *d;
            }
        }
        if !last.is_empty() {
            let j = count - 1;
            last[j] -= from(j).iter().map(|row| row[0] * row[0]).sum::<T>();
        }
    }
    Some(())
}

/// `U'^-1` of a vector.
#[inline(always)]
pub(crate) fn forward<T: Real>(factor: &[T], count: usize, vector: &mut [T]) {
    let panels = factor.chunks_exact((PANEL * count).max(1)).take(count / PANEL);
    for (panel, rows) in panels.enumerate() {
        let first = panel * PANEL;
        let mut shares = [T::ZERO; PANEL];
        for k in 0..PANEL {
            let known: T = (0..k).map(|l| shares[l] * rows[l * count + first + k]).sum();
            shares[k] = (vector[first + k] - known) / rows[k * count + first + k];
            vector[first + k] = shares[k];
        }
        let [a, b, c, d] = core::array::from_fn(|k| &rows[k * count + first + PANEL..(k + 1) * count]);
        for ((((value, a), b), c), d) in vector[first + PANEL..count].iter_mut().zip(a).zip(b).zip(c).zip(d) {
            *value -= shares[0] * *a + shares[1] * *b + shares[2] * *c + shares[3] * *d;
        }
    }
    for i in count - count % PANEL..count {
        let known: T = (count - count % PANEL..i).map(|l| vector[l] * factor[l * count + i]).sum();
        vector[i] = (vector[i] - known) / factor[i * count + i];
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Of any number of rows: `U' U` is the matrix, what is below is left alone, and vectors are solved.
    #[test]
    fn factors_are_those_of_the_matrix() {
        for count in 1..15 {
            let row = |i: usize| (0..9).map(move |k| (0.7 * (i * 9 + k) as f64).sin());
            let element =
                |i: usize, j: usize| row(i).zip(row(j)).map(|(a, b)| a * b).sum::<f64>() + f64::from(u8::from(i == j));
            let below = 7.0;
            let at = |index: usize| {
                if index / count > index % count { below } else { element(index / count, index % count) }
            };
            let mut factor: Vec<f64> = (0..count * count).map(at).collect();
            factorise(&mut factor, count).unwrap();
            let upper = |i: usize, j: usize| if i > j { 0.0 } else { factor[i * count + j] };
            for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
                let product: f64 = (0..count).map(|k| upper(k, i) * upper(k, j)).sum();
                assert!((product - element(i, j)).abs() < 1e-12, "{count} {i} {j}");
                assert!(i <= j || factor[i * count + j] == below, "{count} {i} {j}");
            }
            let right: Vec<f64> = (0..count).map(|i| (1.3 * i as f64).cos()).collect();
            let mut solved = right.clone();
            forward(&factor, count, &mut solved);
            backward(&factor, count, &mut solved);
            for i in 0..count {
                let back: f64 = (0..count).map(|j| element(i, j) * solved[j]).sum();
                assert!((back - right[i]).abs() < 1e-11, "{count} {i}");
            }
        }
    }
}
