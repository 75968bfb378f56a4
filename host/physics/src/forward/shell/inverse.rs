//! Single elements of the inverse of a sparse matrix: the fields between the few nodes that contacts touch.
//!
//! With `A = L L^T`, an element of the inverse is a product of two columns of `L^-1`. Such a column is not zero on one path of the
//! elimination tree only, from its unknown to the root (Gilbert, SIAM J. Matrix Anal. Appl. 15, 1994): some hundred numbers of
//! thousands. Two paths have their upper part in common, so the product is one over the start of both, counted from the
//! root. A column is made when it is first asked for and kept: a contact that moves asks for few new ones.
//!
//! The factorisation is the up-looking one (Davis, Direct Methods for Sparse Linear Systems, 2006, chapter 4).

use std::sync::OnceLock;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::amd;

const ROOT: u32 = u32::MAX;

/// The matrix cannot be factorised: it is not positive definite to rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Singular;

/// Elements of the inverse of a symmetric positive definite matrix.
pub struct Inverse {
    /// Where each unknown is in the order of elimination.
    position: Vec<u32>,
    parent: Vec<u32>,
    columns: Vec<Column>,
    inverted: Vec<OnceLock<Path>>,
}

/// A column of `L`.
#[derive(Clone, Default)]
struct Column {
    diagonal: f64,
    below: Vec<(u32, f64)>,
}

/// A column of `L^-1`, from the root of the elimination tree.
struct Path {
    positions: Box<[u32]>,
    values: Box<[f64]>,
}

impl Inverse {
    /// Factorises a matrix that is given by its lower triangle.
    pub fn new(lower: SparseColMatRef<'_, u32, f64>) -> Result<Self, Singular> {
        let position = order(lower)?;
        let rows = permuted_rows(lower, &position);
        let parent = elimination_tree(&rows);
        let columns = factorise(&rows, &parent)?;
        let inverted = (0..parent.len()).map(|_| OnceLock::new()).collect();
        Ok(Self { position, parent, columns, inverted })
    }

    /// The element of two unknowns.
    pub fn element(&self, a: usize, b: usize) -> f64 {
        let [a, b] = [self.path(a), self.path(b)];
        let shorter = a.positions.len().min(b.positions.len());
        let common = partition(shorter, |index| a.positions[index] == b.positions[index]);
        dot(&a.values[..common], &b.values[..common])
    }

    fn path(&self, unknown: usize) -> &Path {
        self.inverted[unknown].get_or_init(|| self.invert(self.position[unknown]))
    }

    /// Solves `L y = e`.
    fn invert(&self, position: u32) -> Path {
        let mut sums = vec![0.0; self.columns.len()];
        sums[position as usize] = 1.0;
        let (mut positions, mut values, mut at) = (Vec::new(), Vec::new(), position);
        while at != ROOT {
            let column = &self.columns[at as usize];
            let value = sums[at as usize] / column.diagonal;
            column.below.iter().for_each(|&(row, factor)| sums[row as usize] -= factor * value);
            positions.push(at);
            values.push(value);
            at = self.parent[at as usize];
        }
        positions.reverse();
        values.reverse();
        Path { positions: positions.into(), values: values.into() }
    }
}

/// Scalar product by eight sums side by side, which a processor does at once.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        (0..8).for_each(|lane| sums[lane] += a[lane] * b[lane]);
    }
    sums.iter().sum::<f64>() + rest
}

/// How many indices, from 0, hold; once one does not, none after it does.
fn partition(count: usize, holds: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut high) = (0, count);
    while low < high {
        let middle = (low + high) / 2;
        if holds(middle) { low = middle + 1 } else { high = middle }
    }
    low
}

/// An order of elimination with little fill, as the position of each unknown.
fn order(lower: SparseColMatRef<'_, u32, f64>) -> Result<Vec<u32>, Singular> {
    let count = lower.ncols();
    let (mut unknowns, mut position) = (vec![0u32; count], vec![0u32; count]);
    let mut memory = MemBuffer::try_new(amd::order_scratch::<u32>(count, lower.compute_nnz())).map_err(|_| Singular)?;
    let stack = MemStack::new(&mut memory);
    amd::order(&mut unknowns, &mut position, lower.symbolic(), amd::Control::default(), stack).map_err(|_| Singular)?;
    Ok(position)
}

/// Rows of the lower triangle in the order of elimination; the diagonal comes with them.
fn permuted_rows(lower: SparseColMatRef<'_, u32, f64>, position: &[u32]) -> Vec<Vec<(u32, f64)>> {
    let mut rows = vec![Vec::new(); position.len()];
    for (column, at) in position.iter().enumerate() {
        let values = lower.val_of_col(column);
        for (row, value) in lower.row_idx_of_col(column).zip(values) {
            let other = position[row];
            rows[(*at).max(other) as usize].push(((*at).min(other), *value));
        }
    }
    rows
}

/// The parent of each position.
fn elimination_tree(rows: &[Vec<(u32, f64)>]) -> Vec<u32> {
    let (mut parent, mut ancestor) = (vec![ROOT; rows.len()], vec![ROOT; rows.len()]);
    for (row, elements) in rows.iter().enumerate() {
        for &(column, _) in elements {
            let mut at = column;
            while at != ROOT && (at as usize) < row {
                let next = std::mem::replace(&mut ancestor[at as usize], row as u32);
                if next == ROOT {
                    parent[at as usize] = row as u32;
                }
                at = next;
            }
        }
    }
    parent
}

/// Columns of `L`, row by row.
fn factorise(rows: &[Vec<(u32, f64)>], parent: &[u32]) -> Result<Vec<Column>, Singular> {
    let mut columns = vec![Column::default(); rows.len()];
    let (mut sums, mut seen) = (vec![0.0; rows.len()], vec![ROOT; rows.len()]);
    let mut pattern = Vec::new();
    for (row, elements) in rows.iter().enumerate() {
        pattern.clear();
        seen[row] = row as u32;
        for &(column, value) in elements {
            sums[column as usize] += value;
            let mut at = column;
            while seen[at as usize] != row as u32 {
                seen[at as usize] = row as u32;
                pattern.push(at);
                at = parent[at as usize];
            }
        }
        // Ascending positions are a topological order.
        pattern.sort_unstable();
        let mut diagonal = std::mem::take(&mut sums[row]);
        for &at in &pattern {
            let column = &mut columns[at as usize];
            let value = std::mem::take(&mut sums[at as usize]) / column.diagonal;
            column.below.iter().for_each(|&(below, factor)| sums[below as usize] -= factor * value);
            // What was taken from this row by its own elements belongs to its diagonal.
            diagonal -= value * value;
            column.below.push((row as u32, value));
        }
        if !(diagonal > 0.0 && diagonal.is_finite()) {
            return Err(Singular);
        }
        columns[row].diagonal = diagonal.sqrt();
    }
    Ok(columns)
}

#[cfg(test)]
mod tests {
    use faer::sparse::{SparseColMat, Triplet};
    use nalgebra::DMatrix;

    use super::*;

    #[test]
    fn elements_are_those_of_the_dense_inverse() {
        // A grid of resistors with something to ground, and numbers without a pattern.
        let (side, mut rng) = (9usize, fastrand::Rng::with_seed(3));
        let count = side * side;
        let mut dense = DMatrix::<f64>::zeros(count, count);
        for node in 0..count {
            dense[(node, node)] += 0.1 * rng.f64();
            let neighbours = [(node % side + 1 < side, node + 1), (node + side < count, node + side), (node == 3, 70)];
            for (_, other) in neighbours.into_iter().filter(|(is, _)| *is) {
                let conductance = 0.1 + rng.f64();
                dense[(node, node)] += conductance;
                dense[(other, other)] += conductance;
                dense[(node, other)] -= conductance;
                dense[(other, node)] -= conductance;
            }
        }
        let elements = (0..count * count).map(|i| (i % count, i / count)).filter(|&(row, column)| row >= column);
        let triplets: Vec<_> = elements
            .filter(|&at| dense[at] != 0.0)
            .map(|(row, column)| Triplet::new(row as u32, column as u32, dense[(row, column)]))
            .collect();
        let lower = SparseColMat::try_new_from_triplets(count, count, &triplets).unwrap();
        let inverse = Inverse::new(lower.as_ref()).unwrap_or_else(|_| panic!("it is positive definite"));
        let expected = dense.try_inverse().unwrap();
        for (a, b) in (0..count * count).map(|i| (i % count, i / count)) {
            assert!((inverse.element(a, b) / expected[(a, b)] - 1.0).abs() < 1e-10, "{a} {b}");
        }
    }
}
