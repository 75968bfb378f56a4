//! Against nalgebra's unblocked factorisation and dense inverse.

use fastrand::Rng;
use nalgebra::{DMatrix, DVector};

use super::order::minimum_degree;
use super::{Cholesky, Factor, NotPositive, Plan, gram, gram_of_rows};

/// About the sizes at which columns are halved, or made at a time.
const SIZES: [usize; 10] = [0, 1, 7, 16, 17, 31, 64, 65, 200, 500];
/// Share of the largest element, for each unknown.
const ROUNDING: f64 = 1e-14;

fn random(rows: usize, columns: usize, rng: &mut Rng) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| rng.f64() - 0.5)
}

/// Symmetric, with eigenvalues from 0.1 on.
fn positive(size: usize, rng: &mut Rng) -> DMatrix<f64> {
    let root = random(size, size, rng);
    &root * root.transpose() + DMatrix::identity(size, size) * 0.1
}

#[track_caller]
fn alike(found: &DMatrix<f64>, expected: &DMatrix<f64>, tolerance: f64) {
    assert_eq!(found.shape(), expected.shape());
    let (off, scale) = ((found - expected).amax(), expected.amax().max(f64::MIN_POSITIVE));
    assert!(off <= tolerance * scale, "{} of size {}", off / scale, found.nrows());
}

#[test]
fn a_factor_and_its_solutions_are_those_of_the_textbook() {
    let mut rng = Rng::with_seed(1);
    for size in SIZES {
        let matrix = positive(size, &mut rng);
        let tolerance = ROUNDING * 100.0 * size as f64;
        let lower = matrix.clone().cholesky().map_or_else(|| DMatrix::zeros(0, 0), |factor| factor.l());
        let factor = Cholesky::new(matrix.lower_triangle()).unwrap();
        assert_eq!(factor.size(), size);
        let diagonal = DMatrix::from_diagonal(&factor.diagonal());
        alike(&diagonal, &DMatrix::from_diagonal(&lower.diagonal()), tolerance);
        for count in [1, 3, 17, 300] {
            let right = random(count, size, &mut rng);
            let mut rows = right.clone();
            factor.forward(0, &mut rows);
            alike(&(&rows * lower.transpose()), &right, tolerance);
            factor.backward(&mut rows);
            alike(&(&rows * &matrix), &right, tolerance);
        }
        let right = DVector::from_fn(size, |_, _| rng.f64());
        let (mut solved, mut half) = (right.clone(), right.clone());
        factor.solve(&mut solved);
        factor.solve_transposed(&mut half);
        assert!((&matrix * solved - &right).amax() <= tolerance);
        assert!((lower.transpose() * half - &right).amax() <= tolerance);
        if size > 0 {
            let inverse = matrix.try_inverse().unwrap();
            let found = DMatrix::from_diagonal(&factor.inverse_diagonal());
            alike(&found, &DMatrix::from_diagonal(&inverse.diagonal()), tolerance);
        }
    }
}

#[test]
fn part_of_a_factor_solves_as_that_part() {
    let mut rng = Rng::with_seed(2);
    let matrix = positive(130, &mut rng);
    let factor = Cholesky::new(matrix.clone()).unwrap();
    let lower = matrix.cholesky().unwrap().l();
    for first in [0, 5, 64, 129, 130] {
        let right = random(40, 130 - first, &mut rng);
        let mut rows = right.clone();
        factor.forward(first, &mut rows);
        let part = lower.view((first, first), (130 - first, 130 - first));
        alike(&(&rows * part.transpose()), &right, 1e-12);
    }
}

#[test]
fn squares_are_those_of_plain_products() {
    let mut rng = Rng::with_seed(3);
    for (rows, columns) in [(0, 3), (3, 0), (1, 1), (4, 90), (200, 97), (97, 200), (33, 300)] {
        let matrix = random(rows, columns, &mut rng);
        let transposed = matrix.transpose();
        alike(&gram(&matrix).lower_triangle(), &(&transposed * &matrix).lower_triangle(), 1e-13);
        alike(&gram_of_rows(&matrix).lower_triangle(), &(&matrix * &transposed).lower_triangle(), 1e-13);
    }
}

#[test]
fn what_is_not_positive_definite_is_an_error() {
    let mut rng = Rng::with_seed(4);
    for size in [1, 7, 64, 200] {
        for at in [0, size / 2, size - 1] {
            for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
                let mut matrix = positive(size, &mut rng);
                matrix[(at, at)] = value;
                assert_eq!(Cholesky::new(matrix).map(|_| ()), Err(NotPositive), "{value} at {at} of {size}");
            }
        }
    }
    let singular = DMatrix::from_element(40, 40, 1.0);
    assert!(Cholesky::new(singular).is_err());
}

/// A grid of resistors with triangles between them, something to ground, and a node that is beside many: places of the lower
/// triangle, some twice, and elements.
fn grid(side: usize, rng: &mut Rng) -> (Vec<[u32; 2]>, Vec<f64>) {
    let count = side * side;
    let at = |x: usize, y: usize| (y * side + x) as u32;
    let within = |x: usize, y: usize| x < side && y < side;
    let nodes = (0..count).map(|node| (node % side, node / side));
    let edges = nodes.flat_map(|(x, y)| {
        let ends = [(x + 1, y), (x, y + 1), (x + 1, y + 1)];
        ends.into_iter().filter(move |(i, j)| within(*i, *j)).map(move |(i, j)| [at(x, y), at(i, j)])
    });
    let pad = (0..count.min(20)).map(|node| [count as u32, node as u32]);
    let mut elements: Vec<_> = (0..=count as u32).map(|node| ([node; 2], 0.01 + rng.f64())).collect();
    for [a, b] in edges.chain(pad) {
        let conductance = 0.1 + rng.f64();
        elements.extend([([a; 2], conductance), ([b; 2], conductance), ([a, b], -conductance)]);
    }
    elements.into_iter().unzip()
}

fn dense(unknowns: usize, places: &[[u32; 2]], elements: &[f64]) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(unknowns, unknowns);
    for (place, value) in places.iter().zip(elements) {
        let [a, b] = place.map(|unknown| unknown as usize);
        matrix[(a, b)] += value;
        if a != b {
            matrix[(b, a)] += value;
        }
    }
    matrix
}

#[test]
fn a_sparse_matrix_is_solved_as_a_dense_one() {
    let mut rng = Rng::with_seed(5);
    for side in [1, 2, 9, 20] {
        let unknowns = side * side + 1;
        let (places, elements) = grid(side, &mut rng);
        let plan = Plan::new(unknowns, &places);
        // The same plan serves other elements.
        for scale in [1.0, 3.0] {
            let elements: Vec<_> = elements.iter().map(|element| element * scale).collect();
            let factor = plan.factorise(&elements).unwrap();
            let matrix = dense(unknowns, &places, &elements);
            for columns in [0, 1, 8, 17] {
                let right = random(unknowns, columns, &mut rng);
                let mut solved = right.clone();
                factor.solve(&mut solved);
                alike(&(&matrix * solved), &right, 1e-11);
            }
        }
    }
}

#[test]
fn a_sparse_matrix_that_is_not_positive_definite_is_an_error() {
    let (places, elements) = grid(6, &mut Rng::with_seed(6));
    let plan = Plan::new(37, &places);
    for value in [-1e3, f64::NAN, f64::INFINITY] {
        for at in [0, 17, 36] {
            let mut elements = elements.clone();
            elements[at] = value;
            assert_eq!(plan.factorise(&elements).map(|_| ()), Err(NotPositive), "{value} at {at}");
        }
    }
    assert!(Plan::new(0, &[]).factorise(&[]).is_ok());
    assert!(Plan::new(2, &[[0, 0]]).factorise(&[1.0]).is_err(), "an unknown without elements");
}

fn fill(factor: &Factor) -> usize {
    (0..factor.unknowns()).map(|position| factor.column(position).count()).sum()
}

#[test]
fn fill_stays_small() {
    for (side, most) in [(10, 750), (50, 56_000), (100, 305_000)] {
        let (places, elements) = grid(side, &mut Rng::with_seed(7));
        let found = fill(&Plan::new(side * side + 1, &places).factorise(&elements).unwrap());
        assert!(found <= most, "{found} elements below the diagonal for {side} x {side} nodes");
    }
}

#[test]
fn an_order_has_every_unknown_once() {
    let mut rng = Rng::with_seed(8);
    for count in [0usize, 1, 2, 30, 300] {
        for edges in [0, count / 2, 2 * count, 20 * count] {
            let mut beside = vec![Vec::new(); count];
            for _ in 0..edges {
                let (a, b) = (rng.usize(..count), rng.usize(..count));
                if a != b && !beside[a].contains(&(b as u32)) {
                    beside[a].push(b as u32);
                    beside[b].push(a as u32);
                }
            }
            let mut order = minimum_degree(beside);
            order.sort_unstable();
            assert!(order.into_iter().eq(0..count as u32), "{count} {edges}");
        }
    }
}
