//! The independent numbers in the readings of a frame.
//!
//! Readings depend on the contacts through the impedance matrix alone, `V[g][e] = Vcc (1 - Z[e][g] / D[g])`,
//! `D[g] = Z[g][g] + R_on`, and `Z` is symmetric: 16 electrodes give 256 readings of 136 numbers. So least squares of readings are
//! least squares of 136 data: with `M = dV / dZ` and the Cholesky factor `L` of `M' M`, `|dV - M dZ|^2 = |L^-1 M' dV - L' dZ|^2`
//! but for a constant. A reading is of one element of `Z` and one on its diagonal, so `L` is diagonal but for its last 16 rows.

use nalgebra::{DMatrix, DVector};

use super::Target;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::ContactFields;

/// What is added to the squares on diagonals, as a share: readings that are left out may leave an element of `Z` unknown.
const LEAST_DIAGONAL: f64 = 1e-12;

/// Readings at some contacts, reduced to independent data, each of deviation 1.
pub(super) struct Data {
    electrodes: usize,
    /// `Z`'s elements beside the diagonal.
    pairs: Vec<Pair>,
    /// Of the diagonal's rows.
    lower: DMatrix<f64>,
    /// `M' dV`, of the diagonal (1/ohm).
    pulls: Vec<f64>,
    /// How far the readings are from those of the contacts, `L^-1 M' dV`: pairs, then the diagonal.
    pub residual: DVector<f64>,
}

/// An element of `Z` beside the diagonal.
struct Pair {
    i: usize,
    j: usize,
    /// Its own weight, in `L` (1/ohm).
    own: f64,
    /// What the two elements on the diagonal add to its datum (1/ohm).
    diagonal: [f64; 2],
    /// `M' dV` (1/ohm).
    pull: f64,
}

impl Data {
    /// Reduces readings at contacts that give `impedance_ohm`.
    pub fn new(target: &Target, impedance_ohm: &DMatrix<f64>, detector: &Detector) -> Self {
        let n = impedance_ohm.nrows();
        let load_ohm = |g: usize| impedance_ohm[(g, g)] + detector.on_resistance_ohm;
        let share = |g: usize, e: usize| impedance_ohm[(e, g)] / load_ohm(g);
        let weight = |g: usize, e: usize| target.weights[g * n + e];
        let left =
            |g: usize, e: usize| weight(g, e) * (target.volts[g * n + e] - detector.drive_v * (1.0 - share(g, e)));
        // Derivatives by the element itself, and by the one on the diagonal.
        let own = |g: usize, e: usize| -weight(g, e) * detector.drive_v / load_ohm(g);
        let by_load = |g: usize, e: usize| weight(g, e) * detector.drive_v * share(g, e) / load_ohm(g);

        let mut pairs = Vec::with_capacity(n * (n - 1) / 2);
        let mut squares = DMatrix::<f64>::zeros(n, n);
        let mut pulls = vec![0.0; n];
        for g in 0..n {
            let alone = by_load(g, g) + own(g, g);
            squares[(g, g)] += alone * alone;
            pulls[g] += alone * left(g, g);
            for e in (0..n).filter(|&e| e != g) {
                squares[(g, g)] += by_load(g, e).powi(2);
                pulls[g] += by_load(g, e) * left(g, e);
            }
        }
        let floor = LEAST_DIAGONAL * squares.amax().max(f64::MIN_POSITIVE);
        for (i, j) in (0..n).flat_map(|j| (0..j).map(move |i| (i, j))) {
            let weight = (own(i, j).powi(2) + own(j, i).powi(2) + floor).sqrt();
            let diagonal = [own(i, j) * by_load(i, j) / weight, own(j, i) * by_load(j, i) / weight];
            squares[(i, i)] -= diagonal[0] * diagonal[0];
            squares[(j, j)] -= diagonal[1] * diagonal[1];
            squares[(j, i)] -= diagonal[0] * diagonal[1];
            squares[(i, j)] = squares[(j, i)];
            pairs.push(Pair { i, j, own: weight, diagonal, pull: own(i, j) * left(i, j) + own(j, i) * left(j, i) });
        }
        let lower = lower_factor(squares, floor);
        let residual = reduced_residual(&pairs, &pulls, &lower);
        Self { electrodes: n, pairs, lower, pulls, residual }
    }

    /// Number of data.
    pub fn len(&self) -> usize {
        self.residual.len()
    }

    /// The data's derivatives by a node's conductance, times `scale_s`, into `column`: of `dZ[i][j] / dC[k] = -Z[i][k] Z[k][j]`.
    pub fn derivative(&self, fields: &ContactFields, node: usize, scale_s: f64, column: &mut [f64]) {
        let n = self.electrodes;
        let at: Vec<f64> = (0..n).map(|e| fields.nodes_ohm[(node, e)]).collect();
        let (beside, diagonal) = column.split_at_mut(self.pairs.len());
        for (value, pair) in beside.iter_mut().zip(&self.pairs) {
            let (a, b) = (at[pair.i], at[pair.j]);
            *value = -scale_s * (pair.own * a * b + pair.diagonal[0] * a * a + pair.diagonal[1] * b * b);
        }
        for (row, value) in diagonal.iter_mut().enumerate() {
            let sum: f64 = (row..n).map(|i| self.lower[(i, row)] * at[i] * at[i]).sum();
            *value = -scale_s * sum;
        }
    }

    /// Half the derivative of the sum of squares by the conductance of each node (1/S): below zero where more would fit better.
    pub fn slopes_per_s(&self, fields: &ContactFields) -> DVector<f64> {
        let n = self.electrodes;
        let mut form = DMatrix::zeros(n, n);
        for pair in &self.pairs {
            form[(pair.i, pair.j)] = 0.5 * pair.pull;
            form[(pair.j, pair.i)] = 0.5 * pair.pull;
        }
        for (i, pull) in self.pulls.iter().enumerate() {
            form[(i, i)] = *pull;
        }
        let product = &fields.nodes_ohm * form;
        let sums = product.component_mul(&fields.nodes_ohm);
        DVector::from_fn(sums.nrows(), |node, _| sums.row(node).sum())
    }
}

/// The Cholesky factor, or, where readings that are left out make it singular, as much of it as they tell.
fn lower_factor(squares: DMatrix<f64>, floor: f64) -> DMatrix<f64> {
    let n = squares.nrows();
    let mut lower = DMatrix::zeros(n, n);
    for j in 0..n {
        let rest = squares[(j, j)] - (0..j).map(|k| lower[(j, k)] * lower[(j, k)]).sum::<f64>();
        let pivot: f64 = rest.max(floor).sqrt();
        lower[(j, j)] = pivot;
        for i in j + 1..n {
            let rest: f64 = squares[(i, j)] - (0..j).map(|k| lower[(i, k)] * lower[(j, k)]).sum::<f64>();
            lower[(i, j)] = rest / pivot;
        }
    }
    lower
}

/// `L^-1 M' dV`: pairs, then what is left on the diagonal.
fn reduced_residual(pairs: &[Pair], pulls: &[f64], lower: &DMatrix<f64>) -> DVector<f64> {
    let mut left = pulls.to_vec();
    let mut residual: Vec<f64> = pairs.iter().map(|pair| pair.pull / pair.own).collect();
    for (pair, datum) in pairs.iter().zip(&residual) {
        left[pair.i] -= pair.diagonal[0] * datum;
        left[pair.j] -= pair.diagonal[1] * datum;
    }
    for row in 0..left.len() {
        let known: f64 = (0..row).map(|k| lower[(row, k)] * left[k]).sum();
        left[row] = (left[row] - known) / lower[(row, row)];
    }
    residual.extend(left);
    DVector::from_vec(residual)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::forward::{ForwardModel, Slab, readings_v};

    #[test]
    fn least_squares_are_those_of_all_readings() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let slab = Slab::new(&detector).unwrap().on_image(100);
        let sheet_s = detector.sheet_conductance_s();
        let image_s = slab.image_mesh().image_with((0..100).map(|node| (node, sheet_s * 0.01 * (1 + node % 5) as f64)));
        let fields = slab.image_fields(&image_s).unwrap();
        let model = readings_v(&fields.impedance_ohm, &detector);
        let odd = |i: usize| ((i * 37 % 101) as f64 / 101.0 - 0.5) * 0.01;
        let volts: Vec<f64> = model.volts().iter().enumerate().map(|(i, volts)| volts + odd(i)).collect();
        let mut weights = vec![1e3; 256];
        weights[5] = 0.0;
        let target = Target { volts, weights };
        let data = Data::new(&target, &fields.impedance_ohm, &detector);
        assert_eq!(data.len(), 136);

        let mut all = fields.readings_jacobian_v_per_s(&detector) * sheet_s;
        let mut left = DVector::from_fn(256, |i, _| target.volts[i] - model.volts()[i]);
        for (row, weight) in target.weights.iter().enumerate() {
            all.row_mut(row).scale_mut(*weight);
            left[row] *= weight;
        }
        let mut reduced = DMatrix::zeros(data.len(), 100);
        for (node, mut column) in reduced.column_iter_mut().enumerate() {
            data.derivative(&fields, node, sheet_s, column.as_mut_slice());
        }
        let [squares, expected] = [&reduced, &all].map(|jacobian| jacobian.tr_mul(jacobian));
        assert!((squares - &expected).amax() < 1e-9 * expected.amax());
        let (pull, expected) = (reduced.tr_mul(&data.residual), all.tr_mul(&left));
        assert!((&pull - &expected).amax() < 1e-9 * expected.amax());
        let slopes = data.slopes_per_s(&fields) * sheet_s;
        assert!((slopes + &expected).amax() < 1e-9 * expected.amax());
    }
}
