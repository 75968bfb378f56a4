//! Single elements of the inverse of a sparse matrix: the fields between the few nodes that contacts touch.
//!
//! With `A = L L^T`, an element of the inverse is a product of two columns of `L^-1`. Such a column is not zero on one path of the
//! elimination tree only, from its unknown to the root (Gilbert, SIAM J. Matrix Anal. Appl. 15, 1994): some hundred numbers of
//! thousands. Two paths have their upper part in common, so the product is one over the start of both, counted from the
//! root. A column is made when it is first asked for and kept: a contact that moves asks for few new ones.

use std::sync::OnceLock;

use crate::algebra::{Factor, dot};

/// Elements of the inverse of a symmetric positive definite matrix.
pub struct Inverse {
    factor: Factor,
    inverted: Vec<OnceLock<Path>>,
}

/// A column of `L^-1`, from the root of the elimination tree.
struct Path {
    positions: Box<[u32]>,
    values: Box<[f64]>,
}

impl Inverse {
    /// Of a factorised matrix.
    pub fn new(factor: Factor) -> Self {
        let inverted = (0..factor.unknowns()).map(|_| OnceLock::new()).collect();
        Self { factor, inverted }
    }

    /// The element of two unknowns.
    pub fn element(&self, a: usize, b: usize) -> f64 {
        let [a, b] = [self.path(a), self.path(b)];
        let shorter = a.positions.len().min(b.positions.len());
        let common = partition(shorter, |index| a.positions[index] == b.positions[index]);
        dot(&a.values[..common], &b.values[..common])
    }

    fn path(&self, unknown: usize) -> &Path {
        self.inverted[unknown].get_or_init(|| self.invert(self.factor.position(unknown)))
    }

    /// Solves `L y = e`.
    fn invert(&self, position: usize) -> Path {
        let mut sums = vec![0.0; self.factor.unknowns()];
        sums[position] = 1.0;
        let (mut positions, mut values, mut next) = (Vec::new(), Vec::new(), Some(position));
        while let Some(at) = next {
            let value = sums[at] / self.factor.diagonal(at);
            let column = self.factor.column(at);
            column.clone().for_each(|(row, factor)| sums[*row as usize] -= factor * value);
            positions.push(at as u32);
            values.push(value);
            next = column.map(|(row, _)| *row as usize).next();
        }
        positions.reverse();
        values.reverse();
        Path { positions: positions.into(), values: values.into() }
    }
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

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::algebra::Plan;

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
        let lower = (0..count * count).map(|i| (i % count, i / count)).filter(|&(row, column)| row >= column);
        let lower = lower.filter(|&at| dense[at] != 0.0);
        let (places, values): (Vec<_>, Vec<_>) = lower.map(|at| ([at.0 as u32, at.1 as u32], dense[at])).unzip();
        let inverse = Inverse::new(Plan::new(count, &places).factorise(&values).unwrap());
        let expected = dense.try_inverse().unwrap();
        for (a, b) in (0..count * count).map(|i| (i % count, i / count)) {
            assert!((inverse.element(a, b) / expected[(a, b)] - 1.0).abs() < 1e-10, "{a} {b}");
        }
    }
}
