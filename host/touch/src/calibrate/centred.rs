//! What a single contact shows of the detector, wherever it is and however firm.
//!
//! With one contact `Z = N(e,g) - N(e,x) - N(x,g) + N(x,x) + 1/C`, so that centring on both sides, `H Z H` with `H = 1 - 1/n`, leaves `H N H`
//! of the bare detector. Readings give `Z` up to a factor: `r = 1 - V/Vcc = Z[e][g] / D[g]`, and `Z` is symmetric, so the logarithms of
//! `r[g][e] / r[e][g]` are differences of those of the loads `D`.

use nalgebra::DMatrix;
use tactomo_physics::readings::Readings;

/// Smallest `1 - V / Vcc` that a logarithm is taken of: noise of 1.5 LSB is 3 % of it.
const SMALLEST: f64 = 0.02;

/// The centred matrix of a frame, of norm one, and what noise makes of it.
#[derive(Clone, Debug)]
pub(super) struct Centred {
    /// `H Z H` but for its diagonal, which the on-resistance and the pads' own impedance are in: `n x n`, of norm one.
    pub matrix: DMatrix<f64>,
    /// Expected norm of the error of that by noise.
    pub noise: f64,
}

impl Centred {
    /// That of a frame (V) of a detector with such a drive (V), with noise of such a deviation (V) in each reading; `None` where readings are
    /// too large or too small for it.
    pub fn of(readings: &Readings, drive_v: f64, on_share: f64, noise_v: f64) -> Option<Self> {
        let n = readings.electrodes();
        let share = |g: usize, e: usize| 1.0 - readings.at(g, e) / drive_v;
        let off_diagonal = || (0..n).flat_map(|g| (0..n).map(move |e| (g, e))).filter(|(g, e)| g != e);
        if off_diagonal().any(|(g, e)| !(share(g, e) > SMALLEST && share(g, e) < 2.0)) {
            return None;
        }
        // Least squares of all pairs, with a mean of zero.
        let load = |e: usize| {
            let logs = (0..n).filter(|g| *g != e).map(|g| (share(g, e) / share(e, g)).ln());
            (logs.sum::<f64>() / n as f64).exp()
        };
        let loads: Vec<f64> = (0..n).map(load).collect();
        let impedance = DMatrix::from_fn(n, n, |e, g| match e == g {
            true => loads[g] * (1.0 - on_share),
            false => 0.5 * (share(g, e) * loads[g] + share(e, g) * loads[e]),
        });
        let mut matrix = between_others(&impedance);
        let norm = matrix.norm();
        if !(norm > 0.0 && norm.is_finite()) {
            return None;
        }
        matrix /= norm;
        let noise = noise_v / drive_v * n as f64 / norm;
        Some(Self { matrix, noise })
    }

    /// How far two are apart, as a share of either.
    pub fn distance(&self, other: &Self) -> f64 {
        (&self.matrix - &other.matrix).norm()
    }
}

/// What is left of a matrix without any part that depends on its row or its column only, and without its diagonal: centred over the pairs of
/// different electrodes.
pub(super) fn between_others(impedance: &DMatrix<f64>) -> DMatrix<f64> {
    let n = impedance.nrows();
    // Least squares of Z[i][j] = a[i] + a[j] over i < j: the mean of row i is a[i] (n - 2) / (n - 1) + sum / (n - 1).
    let row: Vec<f64> = (0..n).map(|i| (0..n).filter(|j| *j != i).map(|j| impedance[(i, j)]).sum::<f64>()).collect();
    let sum = row.iter().sum::<f64>() / (2.0 * (n as f64 - 1.0));
    let part: Vec<f64> = row.iter().map(|row| (row - sum) / (n as f64 - 2.0)).collect();
    DMatrix::from_fn(n, n, |i, j| if i == j { 0.0 } else { impedance[(i, j)] - part[i] - part[j] })
}

/// The matrix that most frames agree with, and those that do.
pub(super) struct Agreement {
    /// Mean of those that agree, of norm one.
    pub mean: Centred,
    /// Frames that agree.
    pub agree: Vec<usize>,
}

/// Deviations of the noise by which a frame may be off.
const DEVIATIONS: f64 = 3.0;
/// Share by which a frame of one contact may be off besides: a contact's width and the pads below it, in simulated rubs of contacts of 2 to 4 mm
/// up to 4 sheet conductances (their 99 % quantile).
pub(super) const ALIKE: f64 = 0.02;
/// Frames that are tried as the one that others agree with.
const TRIED: usize = 60;

impl Agreement {
    /// Finds it among the matrices of frames, as far as they have one. Frames of several contacts agree with nothing, and not with each other,
    /// so that a minority of single ones is enough. `None` of none.
    pub fn among(all: &[(usize, Centred)]) -> Option<Self> {
        let near = |a: &Centred, b: &Centred| a.distance(b) < ALIKE + DEVIATIONS * a.noise.hypot(b.noise);
        let step = (all.len() / TRIED).max(1);
        // The least noisy are tried: what is near to a noisy one says little.
        let mut order: Vec<_> = all.iter().collect();
        order.sort_by(|a, b| a.1.noise.total_cmp(&b.1.noise));
        let sharp = &order[..order.len().div_ceil(2)];
        let count = |centre: &Centred| sharp.iter().filter(|(_, other)| near(centre, other)).count();
        let best = sharp.iter().step_by(step.div_ceil(2)).max_by_key(|(_, centre)| count(centre))?;
        let mut mean = best.1.clone();
        for _ in 0..3 {
            mean = mean_of(all.iter().map(|(_, centred)| centred).filter(|centred| near(&mean, centred)))?;
        }
        let agree = all.iter().filter(|(_, centred)| near(&mean, centred)).map(|(index, _)| *index).collect();
        Some(Self { mean, agree })
    }
}

/// Mean of some, weighted by their noise.
fn mean_of<'a>(all: impl Iterator<Item = &'a Centred>) -> Option<Centred> {
    let (mut sum, mut weights) = (None, 0.0);
    for centred in all {
        let weight = 1.0 / (centred.noise.powi(2) + ALIKE.powi(2));
        let add = &centred.matrix * weight;
        sum = Some(match sum {
            Some(sum) => sum + add,
            None => add,
        });
        weights += weight;
    }
    let matrix: DMatrix<f64> = sum?;
    let norm = matrix.norm();
    Some(Centred { matrix: matrix / norm, noise: 1.0 / f64::sqrt(weights) })
}
