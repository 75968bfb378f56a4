//! Dense symmetric positive definite matrices: `A = L L^T`, and what is solved with `L`.
//!
//! Columns are halved until few are left, and between the halves lies one product of matrices, so that nearly all work is in large
//! products at every size (Gustavson, "Recursion leads to automatic variable blocking for dense linear-algebra algorithms", IBM J.
//! Res. Dev. 41, 1997).
//!
//! Several right sides are the rows of a matrix, not its columns: `X L^T = B` has the same recursion by columns as the factorisation,
//! and the numbers that belong to one unknown stand side by side.

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, DVector, Dyn};

use super::{NotPositive, pivot};

/// Columns that are not halved any more.
const NARROW: usize = 16;
/// Columns of an inverse that are made at a time.
const WIDE: usize = 64;
/// Rows that narrow columns are solved for side by side, in registers.
const LANES: usize = 8;
/// Up to this size, products are made element by element: packing them for a kernel would take longer.
const TINY: usize = 5;

/// The Cholesky factor `L` of a symmetric positive definite matrix.
#[derive(Clone, Debug)]
pub struct Cholesky {
    /// `L` in the lower triangle; what is above the diagonal means nothing.
    lower: DMatrix<f64>,
}

impl Cholesky {
    /// Factorises a square matrix, of which only the lower triangle is used.
    ///
    /// # Errors
    /// [`NotPositive`] if the matrix is not positive definite to rounding.
    ///
    /// # Panics
    /// If it is not square.
    pub fn new(mut matrix: DMatrix<f64>) -> Result<Self, NotPositive> {
        assert!(matrix.is_square(), "a symmetric matrix");
        let size = matrix.nrows();
        factorise(matrix.as_mut_slice(), size, size, size)?;
        Ok(Self { lower: matrix })
    }

    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.lower.nrows()
    }

    /// The diagonal of `L`: twice the sum of its logarithms is that of the determinant.
    pub fn diagonal(&self) -> DVector<f64> {
        self.lower.diagonal()
    }

    /// Solves `A x = b` in place.
    ///
    /// # Panics
    /// As [`forward`](Self::forward).
    pub fn solve(&self, right: &mut DVector<f64>) {
        self.check(0, right.len());
        let values = right.as_mut_slice();
        for (k, column) in self.columns().enumerate() {
            let (solved, rest) = values.split_at_mut(k + 1);
            solved[k] /= column[k];
            rest.iter_mut().zip(&column[k + 1..]).for_each(|(value, l)| *value -= l * solved[k]);
        }
        self.solve_transposed(right);
    }

    /// Solves `L^T x = b` in place.
    ///
    /// # Panics
    /// As [`forward`](Self::forward).
    pub fn solve_transposed(&self, right: &mut DVector<f64>) {
        self.check(0, right.len());
        let values = right.as_mut_slice();
        for (k, column) in self.columns().enumerate().rev() {
            let (rest, solved) = values.split_at_mut(k + 1);
            rest[k] = (rest[k] - dot(&column[k + 1..], solved)) / column[k];
        }
    }

    /// Solves `X L^T = B` in place with the rows and columns of `L` from `first` on; a row of `B` is a right side of `L x = b`.
    ///
    /// # Panics
    /// If the rows have another length than there are unknowns.
    pub fn forward(&self, first: usize, rows: &mut DMatrix<f64>) {
        let (count, unknowns) = rows.shape();
        self.check(first, unknowns);
        forward(self.lower_from(first), rows.as_mut_slice(), count, unknowns);
    }

    /// Solves `X L = B` in place; a row of `B` is a right side of `L^T x = b`.
    ///
    /// # Panics
    /// As [`forward`](Self::forward).
    pub fn backward(&self, rows: &mut DMatrix<f64>) {
        let (count, unknowns) = rows.shape();
        self.check(0, unknowns);
        backward(self.lower_from(0), rows.as_mut_slice(), count, unknowns);
    }

    /// The diagonal of the inverse: the sums of squares of the columns of `L^-1`.
    pub fn inverse_diagonal(&self) -> DVector<f64> {
        let mut diagonal = DVector::zeros(self.size());
        for first in (0..self.size()).step_by(WIDE) {
            let width = WIDE.min(self.size() - first);
            // Columns of L^-1 begin at the diagonal.
            let mut rows = DMatrix::identity(width, self.size() - first);
            self.forward(first, &mut rows);
            for column in rows.column_iter() {
                diagonal.rows_mut(first, width).zip_apply(&column, |sum, value| *sum += value * value);
            }
        }
        diagonal
    }

    fn check(&self, first: usize, unknowns: usize) {
        assert_eq!(first + unknowns, self.size(), "a number for each unknown");
    }

    fn columns(&self) -> impl DoubleEndedIterator<Item = &[f64]> + ExactSizeIterator {
        self.lower.as_slice().chunks_exact(self.size().max(1))
    }

    /// The rows and columns of `L` from one on.
    fn lower_from(&self, first: usize) -> Block<'_> {
        let size = self.size();
        Block::of_columns(self.lower.as_slice().get(first * size + first..).unwrap_or_default(), size)
    }
}

/// `A^T A`; only its lower triangle is to be used.
pub fn gram(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, columns) = matrix.shape();
    square(Block { elements: matrix.as_slice(), row_step: rows, column_step: 1 }, columns, rows)
}

/// `A A^T`; only its lower triangle is to be used.
pub fn gram_of_rows(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, columns) = matrix.shape();
    square(Block { elements: matrix.as_slice(), row_step: 1, column_step: rows }, rows, columns)
}

fn square(matrix: Block<'_>, rows: usize, columns: usize) -> DMatrix<f64> {
    let mut square = DMatrix::zeros(rows, rows);
    add_square(square.as_mut_slice(), rows, 1.0, matrix, [rows, rows, columns]);
    square
}

/// Part of a matrix: element `(i, j)` is `elements[i * row_step + j * column_step]`.
#[derive(Clone, Copy)]
struct Block<'a> {
    elements: &'a [f64],
    row_step: usize,
    column_step: usize,
}

impl<'a> Block<'a> {
    /// By columns that are `stride` elements apart.
    fn of_columns(elements: &'a [f64], stride: usize) -> Self {
        Self { elements, row_step: 1, column_step: stride }
    }

    fn at(self, row: usize, column: usize) -> f64 {
        self.elements[row * self.row_step + column * self.column_step]
    }

    /// The part that begins at an element.
    fn from(self, row: usize, column: usize) -> Self {
        Self { elements: &self.elements[row * self.row_step + column * self.column_step..], ..self }
    }

    fn transposed(self) -> Self {
        Self { row_step: self.column_step, column_step: self.row_step, ..self }
    }

    fn view(self, rows: usize, columns: usize) -> DMatrixView<'a, f64, Dyn, Dyn> {
        DMatrixView::from_slice_with_strides(self.elements, rows, columns, self.row_step, self.column_step)
    }
}

/// Adds a factor times the product of two blocks, `rows x inner` and `inner x columns`, to columns that are `stride` apart.
fn add_product(
    target: &mut [f64],
    stride: usize,
    factor: f64,
    [left, right]: [Block<'_>; 2],
    [rows, columns, inner]: [usize; 3],
) {
    if rows.min(columns).min(inner) > TINY {
        let mut target = DMatrixViewMut::from_slice_with_strides_mut(target, rows, columns, 1, stride);
        target.gemm(factor, &left.view(rows, inner), &right.view(inner, columns), 1.0);
        return;
    }
    for (column, k) in (0..columns).flat_map(|column| (0..inner).map(move |k| (column, k))) {
        let factor = factor * right.at(k, column);
        let target = &mut target[column * stride..][..rows];
        target.iter_mut().enumerate().for_each(|(row, value)| *value += factor * left.at(row, k));
    }
}

/// Adds a factor times `B C^T`, where `C` is the first `columns` rows of `B`, on and below the diagonal; above it, only where narrow parts
/// are made whole.
fn add_square(target: &mut [f64], stride: usize, factor: f64, matrix: Block<'_>, [rows, columns, inner]: [usize; 3]) {
    if inner == 0 {
        return;
    }
    if columns <= 2 * NARROW {
        return add_product(target, stride, factor, [matrix, matrix.transposed()], [rows, columns, inner]);
    }
    let half = half(columns);
    add_square(target, stride, factor, matrix, [half, half, inner]);
    let (target, below) = (&mut target[half..], matrix.from(half, 0));
    add_product(target, stride, factor, [below, matrix.transposed()], [rows - half, half, inner]);
    add_square(&mut target[half * stride..], stride, factor, below, [rows - half, columns - half, inner]);
}

/// Where columns are halved; the left half is a number of narrow parts.
fn half(columns: usize) -> usize {
    (columns / 2).next_multiple_of(NARROW)
}

/// Factorises columns whose first element is on the diagonal; rows below the square are solved with it.
fn factorise(panel: &mut [f64], stride: usize, rows: usize, columns: usize) -> Result<(), NotPositive> {
    if columns <= NARROW {
        return factorise_narrow(panel, stride, rows, columns);
    }
    let half = half(columns);
    let (left, right) = panel.split_at_mut(half * stride);
    factorise(left, stride, rows, half)?;
    let (rows, columns, right) = (rows - half, columns - half, &mut right[half..]);
    add_square(right, stride, -1.0, Block::of_columns(&left[half..], stride), [rows, columns, half]);
    factorise(right, stride, rows, columns)
}

/// The same for few columns: the square in a copy, then the rows below.
fn factorise_narrow(panel: &mut [f64], stride: usize, rows: usize, count: usize) -> Result<(), NotPositive> {
    let mut triangle = Triangle::of(Block::of_columns(panel, stride), count);
    triangle.factorise()?;
    for (k, column) in triangle.columns[..count].iter().enumerate() {
        panel[k * stride + k..][..count - k].copy_from_slice(&column[k..count]);
    }
    if rows > count {
        triangle.forward(&mut panel[count..], stride, rows - count);
    }
    Ok(())
}

/// A copy of the first columns of a triangle, zero beyond them.
struct Triangle {
    columns: [[f64; NARROW]; NARROW],
    count: usize,
}

impl Triangle {
    fn of(lower: Block<'_>, count: usize) -> Self {
        let mut columns = [[0.0; NARROW]; NARROW];
        for (k, column) in columns[..count].iter_mut().enumerate() {
            column[k..count].copy_from_slice(&lower.elements[k * lower.column_step..][k..count]);
        }
        Self { columns, count }
    }

    /// Cholesky's factorisation, column by column: each is taken off all that follow.
    fn factorise(&mut self) -> Result<(), NotPositive> {
        for k in 0..self.count {
            let scale = pivot(self.columns[k][k])?.recip();
            let column = self.columns[k].map(|value| value * scale);
            self.columns[k] = column;
            for next in k + 1..self.count {
                subtract(&mut self.columns[next], column[next], &column);
            }
        }
        Ok(())
    }

    /// Solves `X L^T = B` for as many columns as the triangle has, `stride` apart.
    fn forward(&self, columns: &mut [f64], stride: usize, rows: usize) {
        self.by_lanes(columns, stride, rows, |x, scales| {
            for k in 0..self.count {
                let mut left = x[k];
                (0..k).for_each(|j| subtract(&mut left, self.columns[j][k], &x[j]));
                x[k] = left.map(|value| value * scales[k]);
            }
        });
    }

    /// Solves `X L = B` likewise.
    fn backward(&self, columns: &mut [f64], stride: usize, rows: usize) {
        self.by_lanes(columns, stride, rows, |x, scales| {
            for k in (0..self.count).rev() {
                let mut left = x[k];
                (k + 1..self.count).for_each(|j| subtract(&mut left, self.columns[k][j], &x[j]));
                x[k] = left.map(|value| value * scales[k]);
            }
        });
    }

    /// Passes some rows at a time, with the reciprocals of the diagonal.
    #[inline(always)]
    fn by_lanes(
        &self,
        columns: &mut [f64],
        stride: usize,
        rows: usize,
        solve: impl Fn(&mut [[f64; LANES]; NARROW], &[f64; NARROW]),
    ) {
        let mut scales = [0.0; NARROW];
        (0..self.count).for_each(|k| scales[k] = self.columns[k][k].recip());
        for first in (0..rows).step_by(LANES) {
            let (width, mut x) = (LANES.min(rows - first), [[0.0; LANES]; NARROW]);
            for (k, x) in x[..self.count].iter_mut().enumerate() {
                let column = &columns[k * stride + first..][..width];
                match column.first_chunk() {
                    Some(whole) => *x = *whole,
                    None => x.iter_mut().zip(column).for_each(|(x, value)| *x = *value),
                }
            }
            solve(&mut x, &scales);
            for (k, x) in x[..self.count].iter().enumerate() {
                let column = &mut columns[k * stride + first..][..width];
                match column.first_chunk_mut() {
                    Some(whole) => *whole = *x,
                    None => column.iter_mut().zip(x).for_each(|(value, x)| *value = *x),
                }
            }
        }
    }
}

#[inline(always)]
fn subtract<const N: usize>(from: &mut [f64; N], factor: f64, values: &[f64; N]) {
    from.iter_mut().zip(values).for_each(|(from, value)| *from -= factor * value);
}

/// Solves `X L^T = B` for `count` columns of so many rows, one after the other without a gap.
fn forward(lower: Block<'_>, columns: &mut [f64], rows: usize, count: usize) {
    if count <= NARROW {
        return Triangle::of(lower, count).forward(columns, rows, rows);
    }
    let half = half(count);
    let (left, right) = columns.split_at_mut(half * rows);
    forward(lower, left, rows, half);
    let between = [Block::of_columns(left, rows), lower.from(half, 0).transposed()];
    add_product(right, rows, -1.0, between, [rows, count - half, half]);
    forward(lower.from(half, half), right, rows, count - half);
}

/// Solves `X L = B` likewise.
fn backward(lower: Block<'_>, columns: &mut [f64], rows: usize, count: usize) {
    if count <= NARROW {
        return Triangle::of(lower, count).backward(columns, rows, rows);
    }
    let half = half(count);
    let (left, right) = columns.split_at_mut(half * rows);
    backward(lower.from(half, half), right, rows, count - half);
    let between = [Block::of_columns(right, rows), lower.from(half, 0)];
    add_product(left, rows, -1.0, between, [rows, half, count - half]);
    backward(lower, left, rows, half);
}

/// Scalar product by eight sums side by side, which a processor does at once.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        (0..8).for_each(|lane| sums[lane] += a[lane] * b[lane]);
    }
    sums.iter().sum::<f64>() + rest
}
