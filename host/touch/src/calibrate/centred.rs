//! What a single contact shows of the detector, wherever it is and however firm.
//!
//! With one contact `Z = N(e,g) - N(e,x) - N(x,g) + N(x,x) + 1/C`, so that centring on both sides, `H Z H` with `H = 1 - 1/n`, leaves `H N H`
//! of the bare detector. Readings give `Z` up to a factor: `r = 1 - V/Vcc = Z[e][g] / D[g]`, and `Z` is symmetric, so the logarithms of
//! `r[g][e] / r[e][g]` are differences of those of the loads `D`.

use nalgebra::{Cholesky, DMatrix, DVector};
use tactomo_physics::readings::{Readings, Says};

use crate::solve::{PairOfLoads, loads};

/// Smallest `1 - V / Vcc` that a logarithm is taken of: noise of 1.5 LSB is 3 % of it.
const SMALLEST: f64 = 0.02;

/// What a frame shows of the bare detector.
#[derive(Clone, Debug)]
pub(super) enum Shown {
    /// All of it that one contact can show.
    Whole(Centred),
    /// Some pairs of electrodes alone: others read less than the converter can tell, whichever of the two is grounded.
    Partly(Partly),
}

/// The centred matrix of a frame, of norm one, and what noise makes of it.
#[derive(Clone, Debug)]
pub(super) struct Centred {
    /// `H Z H` but for its diagonal, which the on-resistance and the pads' own impedance are in: `n x n`, of norm one.
    pub matrix: DMatrix<f64>,
    /// Expected norm of the error of that by noise.
    pub noise: f64,
}

/// Impedances between those electrodes that are read, up to one factor and what depends on the row or the column only.
#[derive(Clone, Debug)]
pub(super) struct Partly {
    electrodes: usize,
    /// Two electrodes and their impedance.
    pairs: Vec<(usize, usize, f64)>,
    /// Standard deviation of an impedance by noise.
    noise: f64,
}

impl Shown {
    /// What a frame (V) of a detector with such a drive (V) shows, with noise of such a deviation (V) in each reading; `None` where readings are
    /// too large or too small for it. Of bounds nothing is taken but that they are no voltages.
    pub fn of(readings: &Readings, drive_v: f64, noise_v: f64) -> Option<Self> {
        let n = readings.electrodes();
        let share = |g: usize, e: usize| 1.0 - readings.at(g, e) / drive_v;
        let is_read = |g: usize, e: usize| g != e && readings.says(g, e) == Says::Voltage;
        let off_diagonal = || (0..n).flat_map(|g| (0..n).map(move |e| (g, e))).filter(|(g, e)| g != e);
        let is_out = |g: usize, e: usize| match readings.says(g, e) {
            Says::Voltage => !(share(g, e) > SMALLEST && share(g, e) < 2.0),
            Says::AtLeast => true,
            Says::AtMost | Says::Nothing => false,
        };
        if !tells_enough(readings) || off_diagonal().any(|(g, e)| is_out(g, e)) {
            return None;
        }
        let pair = |g: usize, e: usize| match is_read(g, e) && is_read(e, g) {
            true => PairOfLoads { log: (share(g, e) / share(e, g)).ln(), weight: 1.0 },
            false => PairOfLoads::default(),
        };
        let both: Vec<_> = (0..n * n).map(|index| pair(index / n, index % n)).collect();
        let loads: Vec<f64> = loads(&both, n).into_iter().map(f64::exp).collect();
        // The load of an electrode that has no pair is not known.
        let is_loaded: Vec<bool> = both.chunks(n).map(|row| row.iter().any(|pair| pair.weight > 0.0)).collect();
        let impedance = |i: usize, j: usize| {
            let read = [(i, j), (j, i)].into_iter().filter(|(g, e)| is_read(*g, *e) && is_loaded[*g]);
            let (sum, count) = read.fold((0.0, 0), |(sum, count), (g, e)| (sum + share(g, e) * loads[g], count + 1));
            (count > 0).then(|| sum / f64::from(count))
        };
        let all = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
        let pairs: Vec<_> = all.filter_map(|(i, j)| Some((i, j, impedance(i, j)?))).collect();
        let noise = noise_v / drive_v;
        if pairs.len() < n * (n - 1) / 2 {
            return Some(Self::Partly(Partly { electrodes: n, pairs, noise }));
        }
        let mut impedance = DMatrix::zeros(n, n);
        for (i, j, value) in pairs {
            (impedance[(i, j)], impedance[(j, i)]) = (value, value);
        }
        Centred::of(&impedance, noise).map(Self::Whole)
    }

    /// Whether it agrees with a centred matrix.
    fn is_near(&self, centre: &Centred) -> bool {
        let is_within = |distance: f64, noise: f64| distance < ALIKE + DEVIATIONS * noise.hypot(centre.noise);
        match self {
            Self::Whole(centred) => is_within(centred.distance(centre), centred.noise),
            Self::Partly(partly) => partly.beside(centre).is_some_and(|[distance, noise]| is_within(distance, noise)),
        }
    }

    fn whole(&self) -> Option<&Centred> {
        match self {
            Self::Whole(centred) => Some(centred),
            Self::Partly(_) => None,
        }
    }
}

/// Whether readings tell so many pairs of electrodes that one contact does not explain whatever they are: as many again as it has unknowns.
pub(super) fn tells_enough(readings: &Readings) -> bool {
    let n = readings.electrodes();
    let is_read = |g: usize, e: usize| [readings.says(g, e), readings.says(e, g)].contains(&Says::Voltage);
    let pairs = (0..n).map(|i| (0..i).filter(|j| is_read(i, *j)).count()).sum::<usize>();
    pairs >= 2 * (n + 1) || pairs == n * n.saturating_sub(1) / 2
}

impl Centred {
    /// The centred form of an impedance matrix with such noise in each element; `None` of none.
    fn of(impedance: &DMatrix<f64>, noise: f64) -> Option<Self> {
        let matrix = between_others(impedance);
        let norm = matrix.norm();
        let is_norm = norm > 0.0 && norm.is_finite();
        is_norm.then(|| Self { matrix: matrix / norm, noise: noise * impedance.nrows() as f64 / norm })
    }

    /// How far two are apart, as a share of either.
    fn distance(&self, other: &Self) -> f64 {
        (&self.matrix - &other.matrix).norm()
    }
}

impl Partly {
    /// How far it is from a centred matrix, and the norm of its error by noise, both as if it were whole. Least squares of
    /// `Z[i][j] = s M[i][j] + a[i] + a[j]`; `None` where there is no such `s` above zero.
    fn beside(&self, centre: &Centred) -> Option<[f64; 2]> {
        let n = self.electrodes;
        let mut terms = DMatrix::zeros(self.pairs.len(), n + 1);
        for (row, (i, j, _)) in self.pairs.iter().enumerate() {
            (terms[(row, *i)], terms[(row, *j)]) = (1.0, 1.0);
            terms[(row, n)] = centre.matrix[(*i, *j)];
        }
        let values = DVector::from_iterator(self.pairs.len(), self.pairs.iter().map(|(.., value)| *value));
        let found = Cholesky::new(terms.tr_mul(&terms))?.solve(&terms.tr_mul(&values));
        let scale = Some(found[n]).filter(|scale| *scale > 0.0)?;
        let freedoms = |pairs: usize| pairs.saturating_sub(n + 1) as f64;
        // Each pair is in the matrix twice.
        let share = 2.0 * freedoms(n * (n - 1) / 2) / freedoms(self.pairs.len());
        let left = (values - terms * found).norm();
        Some([left * share.sqrt() / scale, self.noise * n as f64 / scale])
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
    /// so that a minority of single ones is enough. Those that show a part are held against the mean of whole ones; `None` where none is whole.
    pub fn among(all: &[(usize, Shown)]) -> Option<Self> {
        let whole: Vec<_> = all.iter().filter_map(|(_, shown)| Some((shown, shown.whole()?))).collect();
        let step = (whole.len() / TRIED).max(1);
        // The least noisy are tried: what is near to a noisy one says little.
        let mut order = whole.clone();
        order.sort_by(|a, b| a.1.noise.total_cmp(&b.1.noise));
        let sharp = &order[..order.len().div_ceil(2)];
        let count = |centre: &Centred| sharp.iter().filter(|(other, _)| other.is_near(centre)).count();
        let (_, best) = sharp.iter().step_by(step.div_ceil(2)).max_by_key(|(_, centre)| count(centre))?;
        let mut mean = (*best).clone();
        for _ in 0..3 {
            mean = mean_of(whole.iter().filter(|(shown, _)| shown.is_near(&mean)).map(|(_, centred)| *centred))?;
        }
        let agree = all.iter().filter(|(_, shown)| shown.is_near(&mean)).map(|(index, _)| *index).collect();
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
