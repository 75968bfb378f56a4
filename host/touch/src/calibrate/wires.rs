//! Which wire is which electrode's, from the centred matrix alone.
//!
//! Exchanged wires permute rows and columns of the matrix. The order that brings it nearest to that of the description is sought by exchanges of
//! two, from several starts: a quadratic assignment of 16 or 32. A detector that looks the same when it is turned or mirrored leaves
//! the order open up to that: of orders that fit alike, the one that leaves most wires where they are is taken.

use nalgebra::DMatrix;

/// Random starts of the search.
const STARTS: usize = 400;
/// Orders whose misfit is within this factor of the best fit alike: as-built detectors of the default tolerances break the symmetry of their
/// description by less.
const ALIKE: f64 = 1.6;

/// An order of wires.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Order {
    /// Of each channel, the electrode of the description that it is connected to.
    pub electrodes: Vec<usize>,
    /// Distance of the permuted matrices, as a share of either.
    pub distance: f64,
}

impl Order {
    /// Channels that are not where the description has them.
    pub fn exchanged(&self) -> Vec<usize> {
        (0..self.electrodes.len()).filter(|channel| self.electrodes[*channel] != *channel).collect()
    }
}

/// The orders that fit best, those that fit alike first by how many wires they leave in place; both matrices centred, of norm one.
pub(super) fn orders(measured: &DMatrix<f64>, described: &DMatrix<f64>) -> Vec<Order> {
    let n = measured.nrows();
    let mut random = fastrand::Rng::with_seed(1);
    let mut found: Vec<Order> = Vec::new();
    for start in 0..STARTS {
        let mut electrodes: Vec<usize> = (0..n).collect();
        if start > 0 {
            random.shuffle(&mut electrodes);
        }
        let order = improved(measured, described, electrodes);
        if !found.iter().any(|other| other.electrodes == order.electrodes) {
            found.push(order);
        }
    }
    let least = found.iter().map(|order| order.distance).fold(f64::INFINITY, f64::min);
    found.retain(|order| order.distance <= ALIKE * least);
    found.sort_by(|a, b| {
        let exchanged = |order: &Order| order.exchanged().len();
        exchanged(a).cmp(&exchanged(b)).then(a.distance.total_cmp(&b.distance))
    });
    found
}

/// Exchanges pairs for as long as that helps.
fn improved(measured: &DMatrix<f64>, described: &DMatrix<f64>, mut electrodes: Vec<usize>) -> Order {
    let n = electrodes.len();
    loop {
        let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
        let gains = pairs.map(|pair| (gain(measured, described, &electrodes, pair), pair));
        match gains.max_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((gain, (i, j))) if gain > 1e-12 => electrodes.swap(i, j),
            _ => break,
        }
    }
    let permuted = DMatrix::from_fn(n, n, |i, j| described[(electrodes[i], electrodes[j])]);
    let distance = (measured - permuted).norm();
    Order { electrodes, distance }
}

/// By how much the scalar product grows where two are exchanged.
fn gain(measured: &DMatrix<f64>, described: &DMatrix<f64>, electrodes: &[usize], (i, j): (usize, usize)) -> f64 {
    let (a, b) = (electrodes[i], electrodes[j]);
    let others = electrodes.iter().enumerate().filter(|(k, _)| *k != i && *k != j);
    others.map(|(k, e)| (measured[(i, k)] - measured[(j, k)]) * (described[(b, *e)] - described[(a, *e)])).sum::<f64>()
        * 2.0
}

#[cfg(test)]
mod tests {
    use super::super::centred::between_others;
    use super::*;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::{ForwardModel, Slab};
    use tactomo_physics::simulate::drawn;

    fn centred(detector: &Detector) -> DMatrix<f64> {
        let matrix = between_others(Slab::new(detector).unwrap().electrode_fields_ohm());
        let norm = matrix.norm();
        matrix / norm
    }

    #[test]
    fn fifty_random_orders_are_found_on_detectors_as_built() {
        let paper = Detector::default();
        let described = centred(&paper);
        let mut random = fastrand::Rng::with_seed(11);
        let all: Vec<_> = (0..5).map(|seed| centred(&drawn(&paper, seed))).collect();
        for trial in 0..50 {
            let mut order: Vec<usize> = (0..16).collect();
            random.shuffle(&mut order);
            let built = &all[trial % all.len()];
            let measured = DMatrix::from_fn(16, 16, |i, j| built[(order[i], order[j])]);
            let found = orders(&measured, &described);
            assert!(found.len() <= 8, "trial {trial}: {} orders", found.len());
            assert!(found.iter().any(|found| found.electrodes == order), "trial {trial}: {found:?} {order:?}");
        }
    }

    #[test]
    fn wires_that_are_right_stay() {
        let paper = Detector::default();
        for seed in 0..10 {
            let found = orders(&centred(&drawn(&paper, seed)), &centred(&paper));
            assert_eq!(found[0].exchanged(), [0; 0], "seed {seed}");
        }
    }
}
