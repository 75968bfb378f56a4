//! Sparse symmetric positive definite matrices: `A = L L^T` in an order of elimination with little fill.
//!
//! What depends on places alone, the order, the elimination tree and the places of `L`, is made once for all matrices with elements
//! at the same places. The factorisation is the up-looking one: row by row, each a triangular system with the rows before it (Davis,
//! Direct Methods for Sparse Linear Systems, 2006, chapter 4).

use std::sync::Arc;

use nalgebra::DMatrix;

use super::order::minimum_degree;
use super::{NotPositive, pivot};

/// Parent of a root.
const ROOT: u32 = u32::MAX;
/// Right sides that are solved for side by side.
const LANES: usize = 8;

/// How matrices with elements at the same places are factorised.
///
/// "Positions" are numbers of unknowns in the order of elimination.
#[derive(Debug)]
pub struct Plan {
    /// Position of each unknown.
    position: Vec<u32>,
    /// By rows of the matrix in that order: column and number of each element of the lower triangle.
    elements: Rows<(u32, u32)>,
    /// The columns of each row of `L` left of the diagonal, ascending.
    pattern: Rows<u32>,
    /// The rows of each column of `L` below the diagonal, ascending.
    below: Rows<u32>,
}

/// Lists one after the other.
#[derive(Debug)]
struct Rows<T> {
    starts: Vec<u32>,
    all: Vec<T>,
}

/// A factorised matrix.
#[derive(Clone, Debug)]
pub struct Factor {
    plan: Arc<Plan>,
    diagonal: Vec<f64>,
    /// Elements of `L` below the diagonal, column after column.
    values: Vec<f64>,
}

impl<T: Copy + Default> Rows<T> {
    /// From pairs of a row and what is in it, in the order in which they come.
    fn new(rows: usize, pairs: impl Iterator<Item = (u32, T)> + Clone) -> Self {
        let mut starts = vec![0u32; rows + 1];
        pairs.clone().for_each(|(row, _)| starts[row as usize + 1] += 1);
        (0..rows).for_each(|row| starts[row + 1] += starts[row]);
        let mut all = vec![T::default(); starts[rows] as usize];
        let mut next = starts.clone();
        for (row, value) in pairs {
            let at = &mut next[row as usize];
            all[*at as usize] = value;
            *at += 1;
        }
        Self { starts, all }
    }

    fn range(&self, row: usize) -> std::ops::Range<usize> {
        self.starts[row] as usize..self.starts[row + 1] as usize
    }

    fn of(&self, row: usize) -> &[T] {
        &self.all[self.range(row)]
    }
}

impl Plan {
    /// For elements at some places (row and column, in either triangle, not in both); several at one place add up.
    ///
    /// # Panics
    /// If there is no such unknown.
    pub fn new(unknowns: usize, places: &[[u32; 2]]) -> Arc<Self> {
        let mut position = vec![0; unknowns];
        let order = minimum_degree(neighbours(unknowns, places));
        order.iter().enumerate().for_each(|(at, unknown)| position[*unknown as usize] = at as u32);
        let elements = places.iter().enumerate().map(|(number, place)| {
            let [a, b] = place.map(|unknown| position[unknown as usize]);
            (a.max(b), (a.min(b), number as u32))
        });
        let elements = Rows::new(unknowns, elements);
        let pattern = pattern(unknowns, &elements);
        let pairs = (0..unknowns).flat_map(|row| pattern.of(row).iter().map(move |column| (*column, row as u32)));
        let below = Rows::new(unknowns, pairs);
        Arc::new(Self { position, elements, pattern, below })
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.position.len()
    }

    /// Factorises the matrix with such elements, in the order of the places.
    ///
    /// # Errors
    /// [`NotPositive`] if the matrix is not positive definite to rounding.
    ///
    /// # Panics
    /// If there are fewer values than places.
    pub fn factorise(self: &Arc<Self>, elements: &[f64]) -> Result<Factor, NotPositive> {
        let unknowns = self.unknowns();
        let (mut diagonal, mut values) = (vec![0.0; unknowns], vec![0.0; self.below.all.len()]);
        let mut filled: Vec<usize> = self.below.starts.iter().map(|start| *start as usize).collect();
        let mut sums = vec![0.0; unknowns];
        for row in 0..unknowns {
            for (column, number) in self.elements.of(row) {
                sums[*column as usize] += elements[*number as usize];
            }
            let mut left = std::mem::take(&mut sums[row]);
            for column in self.pattern.of(row).iter().map(|column| *column as usize) {
                let value = std::mem::take(&mut sums[column]) / diagonal[column];
                let (start, end) = (self.below.starts[column] as usize, filled[column]);
                for (below, l) in self.below.all[start..end].iter().zip(&values[start..end]) {
                    sums[*below as usize] -= l * value;
                }
                left -= value * value;
                values[end] = value;
                filled[column] += 1;
            }
            diagonal[row] = pivot(left)?;
        }
        Ok(Factor { plan: Arc::clone(self), diagonal, values })
    }
}

impl Factor {
    /// Solves `A X = B` in place for the columns of `B`.
    ///
    /// # Panics
    /// If there is another number of rows than unknowns.
    pub fn solve(&self, right: &mut DMatrix<f64>) {
        let unknowns = self.unknowns();
        assert_eq!(right.nrows(), unknowns, "a row for each unknown");
        for columns in right.as_mut_slice().chunks_mut((LANES * unknowns).max(1)) {
            if columns.len() == unknowns { self.solve_lanes::<1>(columns) } else { self.solve_lanes::<LANES>(columns) }
        }
    }

    /// Solves for up to so many columns: their numbers stand side by side for each position, so that a processor does them at once.
    fn solve_lanes<const LANES: usize>(&self, columns: &mut [f64]) {
        let mut lanes = vec![[0.0; LANES]; self.plan.unknowns()];
        for (lane, column) in columns.chunks_exact(lanes.len()).enumerate() {
            column.iter().zip(&self.plan.position).for_each(|(value, at)| lanes[*at as usize][lane] = *value);
        }
        for column in 0..lanes.len() {
            let scale = self.diagonal[column].recip();
            let solved = lanes[column].map(|value| value * scale);
            lanes[column] = solved;
            for (row, l) in self.column(column) {
                let row = &mut lanes[*row as usize];
                (0..LANES).for_each(|lane| row[lane] -= l * solved[lane]);
            }
        }
        for column in (0..lanes.len()).rev() {
            let mut left = lanes[column];
            for (row, l) in self.column(column) {
                let row = &lanes[*row as usize];
                (0..LANES).for_each(|lane| left[lane] -= l * row[lane]);
            }
            let scale = self.diagonal[column].recip();
            lanes[column] = left.map(|value| value * scale);
        }
        for (lane, column) in columns.chunks_exact_mut(lanes.len()).enumerate() {
            column.iter_mut().zip(&self.plan.position).for_each(|(value, at)| *value = lanes[*at as usize][lane]);
        }
    }

    /// Where an unknown is in the order of elimination.
    pub fn position(&self, unknown: usize) -> usize {
        self.plan.position[unknown] as usize
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.plan.unknowns()
    }

    /// The diagonal element of `L` at a position.
    pub fn diagonal(&self, position: usize) -> f64 {
        self.diagonal[position]
    }

    /// The column of `L` at a position, below its diagonal: positions and elements. The first of them is the parent in the elimination
    /// tree.
    pub fn column(&self, position: usize) -> impl Iterator<Item = (&u32, &f64)> + Clone {
        let range = self.plan.below.range(position);
        self.plan.below.all[range.clone()].iter().zip(&self.values[range])
    }
}

/// The unknowns beside each.
fn neighbours(unknowns: usize, places: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut beside = vec![Vec::new(); unknowns];
    for [a, b] in places.iter().filter(|[a, b]| a != b) {
        beside[*a as usize].push(*b);
        beside[*b as usize].push(*a);
    }
    beside.iter_mut().for_each(|all| {
        all.sort_unstable();
        all.dedup();
    });
    beside
}

/// The columns of each row of `L`: the paths in the elimination tree from the row's elements up to the row itself. The tree grows with
/// the rows (Liu, "The role of elimination trees in sparse factorization", SIAM J. Matrix Anal. Appl. 11, 1990).
fn pattern(unknowns: usize, elements: &Rows<(u32, u32)>) -> Rows<u32> {
    let (mut parent, mut seen) = (vec![ROOT; unknowns], vec![ROOT; unknowns]);
    let (mut starts, mut all) = (vec![0], Vec::new());
    for row in 0..unknowns {
        seen[row] = row as u32;
        let first = all.len();
        for (column, _) in elements.of(row) {
            let mut at = *column as usize;
            while seen[at] != row as u32 {
                seen[at] = row as u32;
                all.push(at as u32);
                if parent[at] == ROOT {
                    parent[at] = row as u32;
                }
                at = parent[at] as usize;
            }
        }
        all[first..].sort_unstable();
        starts.push(all.len() as u32);
    }
    Rows { starts, all }
}
