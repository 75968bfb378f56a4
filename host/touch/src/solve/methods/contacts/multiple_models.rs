//! Contacts from row to row: what is known of them is carried on, and each row of readings, as it comes, tells a little more.
//!
//! A Kalman filter in information form. With the information `L` on the parameters before (the inverse of their covariance), the rows'
//! whitened derivatives `J` and residuals `r`,
//!
//! ```text
//! predict  L' = (L^-1 + Q)^-1        update  L'' = L' + J^T J,   L'' (o - m) = J^T (r - J (m - o0)) ...
//! ```
//!
//! `Q` is how far a contact may go between two frames. Nobody knows whether it stands or runs, so there are several filters, from still to
//! fast, on the same derivatives, and the one whose predictions were most likely of late is believed (static multiple models: Bar-Shalom, Li
//! and Kirubarajan, Estimation with applications to tracking and navigation, 2001, 11.6). A still contact is averaged over a fifth of a
//! second, one that runs is taken from the newest rows alone, and no speed has to be given. A filter that was less likely by far goes on from
//! the one that is believed.
//!
//! Limits: what is the same in every frame counts as noise of each row; what it adds to the covariance is elsewhere
//! (`contacts::systematic_error`).

use nalgebra::{Cholesky, DMatrix, DVector};

use super::discs::PARAMETERS;
use crate::solve::fit::policy;

/// How a contact may change: standard deviations of the way (m/s), and of the logarithms of its resistance and radius (1/s), as if each frame
/// were independent of the one before.
#[derive(Clone, Copy, Debug)]
struct Motion {
    speed_m_per_s: f64,
    resistance_per_s: f64,
    radius_per_s: f64,
}

/// From still to as fast as hands are, and each speed with a force that hardly changes and with one that does: a contact that moves at one
/// force is taken for slower than it is where its resistance would have to run along. That of a still contact forgets within a fifth of a
/// second.
const MOTIONS: [Motion; 7] = [
    Motion { speed_m_per_s: 5e-4, resistance_per_s: 0.05, radius_per_s: 0.02 },
    Motion { speed_m_per_s: 0.05, resistance_per_s: 0.3, radius_per_s: 0.1 },
    Motion { speed_m_per_s: 0.2, resistance_per_s: 1.0, radius_per_s: 0.3 },
    Motion { speed_m_per_s: 1.0, resistance_per_s: 10.0, radius_per_s: 2.0 },
    Motion { speed_m_per_s: 0.02, resistance_per_s: 3.0, radius_per_s: 0.5 },
    Motion { speed_m_per_s: 0.15, resistance_per_s: 20.0, radius_per_s: 3.0 },
    Motion { speed_m_per_s: 1.0, resistance_per_s: 150.0, radius_per_s: 10.0 },
];
/// Time over which likelihoods are compared (s).
const MEMORY_S: f64 = 0.02;
/// Longest time between frames that a contact is carried over (s).
const LONGEST_S: f64 = 0.1;

/// A filter for each way in which contacts may move, and which of them is believed.
#[derive(Clone, Debug)]
pub(super) struct MultipleModels {
    filters: [Filter; MOTIONS.len()],
    best: usize,
    /// Time since it began (s).
    age_s: f64,
}

/// The filter of one way to move.
#[derive(Clone, Debug)]
struct Filter {
    /// Its mean, from the contacts that are believed, in their parameters.
    mean: DVector<f64>,
    information: DMatrix<f64>,
    /// Logarithm of the likelihood of its predictions of late.
    likelihood: f64,
}

/// What rows of readings say: with whitened derivatives `J` and residuals `r` at the contacts that are believed.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    /// `J^T J`.
    pub information: DMatrix<f64>,
    /// `J^T r`.
    pub pull: DVector<f64>,
    /// `r^T r`.
    pub cost: f64,
}

impl MultipleModels {
    /// Begins with what a fit knows: the information on the parameters of its contacts.
    pub fn new(information: DMatrix<f64>) -> Self {
        let filter = Filter { mean: DVector::zeros(information.nrows()), information, likelihood: 0.0 };
        Self { filters: std::array::from_fn(|_| filter.clone()), best: MOTIONS.len() - 1, age_s: 0.0 }
    }

    /// Information on the parameters by the filter that is believed.
    pub fn information(&self) -> &DMatrix<f64> {
        &self.filters[self.best].information
    }

    /// Whether the contacts are believed to stand.
    #[cfg(test)]
    pub fn is_still(&self) -> bool {
        self.best == 0
    }

    /// Whether the contacts are believed to move, after two memories in which that could be seen.
    pub fn moves(&self) -> Option<bool> {
        (self.age_s > 2.0 * MEMORY_S).then_some(self.best > 0)
    }

    /// Tells what is known from other contacts, so far away in the parameters.
    pub fn shift(&mut self, way: &DVector<f64>) {
        self.filters.iter_mut().for_each(|filter| filter.mean -= way);
    }

    /// Takes units of the places' parameters (m) to others, a contact each.
    pub fn rescale(&mut self, from_m: &[f64], to_m: &[f64]) {
        let scale = |i: usize| match i % PARAMETERS {
            0 | 1 => from_m[i / PARAMETERS] / to_m[i / PARAMETERS],
            _ => 1.0,
        };
        for filter in &mut self.filters {
            let size = filter.mean.len();
            (0..size).for_each(|i| filter.mean[i] *= scale(i));
            for (i, j) in (0..size).flat_map(|i| (0..size).map(move |j| (i, j))) {
                filter.information[(i, j)] /= scale(i) * scale(j);
            }
        }
    }

    /// Lets time (s) pass; `unit_m` are the units of the places' parameters (m). `None` where nothing is determined.
    pub fn predict(&mut self, elapsed_s: f64, unit_m: &[f64]) -> Option<()> {
        let elapsed_s = elapsed_s.clamp(0.0, LONGEST_S);
        self.age_s += elapsed_s;
        for (filter, motion) in self.filters.iter_mut().zip(&MOTIONS) {
            let step = |i: usize| match i % PARAMETERS {
                0 | 1 => motion.speed_m_per_s * elapsed_s / unit_m[i / PARAMETERS],
                2 => motion.resistance_per_s * elapsed_s,
                _ => motion.radius_per_s * elapsed_s,
            };
            let mut covariance = Cholesky::new(filter.information.clone())?.inverse();
            (0..covariance.nrows()).for_each(|i| covariance[(i, i)] += step(i) * step(i));
            filter.information = Cholesky::new(covariance)?.inverse();
            filter.likelihood *= (-elapsed_s / MEMORY_S).exp();
        }
        Some(())
    }

    /// Takes rows into account; how far the contacts that are believed go, in their parameters. `None` where nothing is determined.
    pub fn update(&mut self, rows: &Rows) -> Option<DVector<f64>> {
        for filter in &mut self.filters {
            filter.update(rows)?;
        }
        let likelihoods = self.filters.iter().map(|filter| filter.likelihood).enumerate();
        self.best = likelihoods.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(best, _)| best);
        let believed = self.filters[self.best].clone();
        for filter in &mut self.filters {
            if filter.likelihood < believed.likelihood - policy::gone_nats() {
                let likelihood = believed.likelihood - policy::gone_nats();
                *filter = Filter { likelihood, ..believed.clone() };
            }
            filter.mean -= &believed.mean;
            filter.likelihood -= believed.likelihood;
        }
        Some(believed.mean)
    }
}

impl Filter {
    fn update(&mut self, rows: &Rows) -> Option<()> {
        let before = Cholesky::new(self.information.clone())?;
        // Residuals are at the contacts that are believed: at this filter's mean they are by the derivatives less.
        let along = &rows.information * &self.mean;
        let pull = &rows.pull - &along;
        let cost = rows.cost - 2.0 * rows.pull.dot(&self.mean) + self.mean.dot(&along);
        self.information += &rows.information;
        let after = Cholesky::new(self.information.clone())?;
        let step = after.solve(&pull);
        self.likelihood -= 0.5 * (cost - pull.dot(&step) + after.ln_determinant() - before.ln_determinant());
        self.mean += step;
        self.likelihood.is_finite().then_some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT_M: [f64; 1] = [2.5e-3];
    const FRAME_S: f64 = 7e-4;

    /// One contact whose place, in x and y, resistance and radius each frame measures with such deviations, in its parameters.
    struct MeasuredContact {
        filters: MultipleModels,
        random: fastrand::Rng,
        believed: [f64; PARAMETERS],
    }

    const DEVIATIONS: [f64; PARAMETERS] = [0.04, 0.04, 0.02, 0.1];

    impl MeasuredContact {
        fn new(seed: u64) -> Self {
            let information =
                DMatrix::from_fn(PARAMETERS, PARAMETERS, |i, j| if i == j { DEVIATIONS[i].powi(-2) } else { 0.0 });
            Self {
                filters: MultipleModels::new(information),
                random: fastrand::Rng::with_seed(seed),
                believed: [0.0; PARAMETERS],
            }
        }

        fn normal(&mut self) -> f64 {
            (0..12).map(|_| self.random.f64()).sum::<f64>() - 6.0
        }

        fn frame(&mut self, truth: [f64; PARAMETERS]) -> [f64; PARAMETERS] {
            self.filters.predict(FRAME_S, &UNIT_M).unwrap();
            let left: Vec<f64> =
                (0..PARAMETERS).map(|i| (truth[i] - self.believed[i]) / DEVIATIONS[i] + self.normal()).collect();
            let rows = Rows {
                information: DMatrix::from_fn(PARAMETERS, PARAMETERS, |i, j| {
                    if i == j { DEVIATIONS[i].powi(-2) } else { 0.0 }
                }),
                pull: DVector::from_fn(PARAMETERS, |i, _| left[i] / DEVIATIONS[i]),
                cost: left.iter().map(|left| left * left).sum(),
            };
            let step = self.filters.update(&rows).unwrap();
            (0..PARAMETERS).for_each(|i| self.believed[i] += step[i]);
            self.believed
        }

        /// Root of the mean square error of x over frames of a contact of that speed (m/s), in its parameter.
        fn error(&mut self, speed_m_per_s: f64, frames: usize) -> f64 {
            let mut squares = 0.0;
            for frame in 0..frames {
                let x = speed_m_per_s * FRAME_S * frame as f64 / UNIT_M[0];
                let found = self.frame([x, 0.0, 0.0, 0.0]);
                squares += if frame >= frames / 2 { (found[0] - x).powi(2) } else { 0.0 };
            }
            (squares / (frames - frames / 2) as f64).sqrt()
        }
    }

    #[test]
    fn a_still_contact_is_averaged_and_a_fast_one_is_followed() {
        let still: f64 = (0..8).map(|seed| MeasuredContact::new(seed).error(0.0, 600)).sum::<f64>() / 8.0;
        assert!(still < 0.2 * DEVIATIONS[0], "{still}");
        for speed_m_per_s in [0.05, 0.2, 0.5, 1.0] {
            let moving: f64 =
                (0..8).map(|seed| MeasuredContact::new(seed).error(speed_m_per_s, 300)).sum::<f64>() / 8.0;
            assert!(moving < 1.1 * DEVIATIONS[0], "{speed_m_per_s} m/s: {moving}");
        }
    }

    #[test]
    fn a_contact_that_starts_is_followed_within_some_frames() {
        let mut contact = MeasuredContact::new(3);
        (0..400).for_each(|_| _ = contact.frame([0.0; PARAMETERS]));
        assert!(contact.filters.is_still());
        let mut last = 0.0;
        for frame in 0..20 {
            let x = 0.3 * FRAME_S * f64::from(frame) / UNIT_M[0];
            last = contact.frame([x, 0.0, 0.0, 0.0])[0] - x;
        }
        assert!(last.abs() < 4.0 * DEVIATIONS[0] && !contact.filters.is_still(), "{last}");
    }

    #[test]
    fn units_change_nothing() {
        let (mut one, mut other) = (MeasuredContact::new(5), MeasuredContact::new(5));
        other.filters.rescale(&UNIT_M, &[5e-3]);
        other.filters.rescale(&[5e-3], &UNIT_M);
        for frame in 0..20 {
            let truth = [0.01 * f64::from(frame), 0.0, 0.1, 0.0];
            let found = [&mut one, &mut other].map(|contact| contact.frame(truth));
            assert!((0..PARAMETERS).all(|i| (found[0][i] - found[1][i]).abs() < 1e-9), "{found:?}");
        }
    }
}
