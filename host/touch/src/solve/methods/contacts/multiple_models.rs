//! Contacts from frame to frame: what is known of them is carried on, and each frame of readings, as it comes, tells a little more.
//!
//! A Kalman filter in information form. With the information `L` on the parameters before (the inverse of their covariance `P`), the frame's
//! whitened derivatives `J` and residuals `r`,
//!
//! ```text
//! predict  P' = P + Q        update  L'' = L' + J^T J,   L'' (o - m) = J^T (r - J (m - o0)) ...
//! ```
//!
//! `Q` is how far a contact may go between two frames: at some speed `s`, in a new direction each frame, or in one that lasts. The latter is
//! carried on with the contacts, as rates `v` that fade within a time `T` (Singer, Estimating optimal tracking filter performance for manned
//! maneuvering targets, IEEE Transactions on Aerospace and Electronic Systems, 1970; here the rate is what he calls acceleration):
//!
//! ```text
//! v' = f v + w,   o' = o + v' t,   f = exp(-t / T),   var w = (1 - f^2) s^2
//! ```
//!
//! With `f = 0` that is the former. Nobody knows whether a contact stands or runs, so there are several filters, from still to
//! fast, on the same derivatives, and the one whose predictions were most likely of late is believed (static multiple models: Bar-Shalom, Li
//! and Kirubarajan, Estimation with applications to tracking and navigation, 2001, 11.6). A still contact is averaged over a fifth of a
//! second, one that glides over some frames, one that darts is taken from the newest rows alone, and no speed has to be given. A filter that
//! was less likely by far goes on from the one that is believed.
//!
//! Limits: what is the same in every frame counts as noise of each frame; what it adds to the covariance is elsewhere
//! (`contacts::systematic_error`).

use nalgebra::{Cholesky, DMatrix, DVector};

use super::discs::PARAMETERS;
use crate::solve::fit::policy;

/// How a contact may change: standard deviations of the way (m/s), and of the logarithms of its resistance and radius (1/s).
#[derive(Clone, Copy, Debug)]
struct Motion {
    speed_m_per_s: f64,
    resistance_per_s: f64,
    radius_per_s: f64,
    /// How long such a speed lasts (s); 0 if each frame is independent of the one before.
    lasts_s: f64,
}

/// From still to as fast as hands are, and each speed with a force that hardly changes and with one that does: a contact that moves at one
/// force is taken for slower than it is where its resistance would have to run along. That of a still contact forgets within a fifth of a
/// second.
const MOTIONS: [Motion; 7] = [
    Motion { speed_m_per_s: 5e-4, resistance_per_s: 0.05, radius_per_s: 0.02, lasts_s: 0.0 },
    Motion { speed_m_per_s: 0.05, resistance_per_s: 0.3, radius_per_s: 0.1, lasts_s: LASTS_S },
    Motion { speed_m_per_s: 0.2, resistance_per_s: 1.0, radius_per_s: 0.3, lasts_s: LASTS_S },
    Motion { speed_m_per_s: 1.0, resistance_per_s: 10.0, radius_per_s: 2.0, lasts_s: LASTS_S },
    Motion { speed_m_per_s: 0.02, resistance_per_s: 3.0, radius_per_s: 0.5, lasts_s: LASTS_S },
    Motion { speed_m_per_s: 0.15, resistance_per_s: 20.0, radius_per_s: 3.0, lasts_s: LASTS_S },
    Motion { speed_m_per_s: 1.0, resistance_per_s: 150.0, radius_per_s: 10.0, lasts_s: 0.0 },
];
/// How long a direction lasts (s).
const LASTS_S: f64 = 1.0;
/// Time over which likelihoods are compared (s).
const MEMORY_S: f64 = 0.02;
/// Longest time between frames that a contact is carried over (s).
const LONGEST_S: f64 = 0.1;

impl Motion {
    /// Standard deviations of the parameters' rates (1/s), where places have such units (m).
    fn rates(&self, unit_m: &[f64]) -> DVector<f64> {
        let of = |i: usize| match i % PARAMETERS {
            0 | 1 => self.speed_m_per_s / unit_m[i / PARAMETERS],
            2 => self.resistance_per_s,
            _ => self.radius_per_s,
        };
        DVector::from_fn(PARAMETERS * unit_m.len(), |i, _| of(i))
    }
}

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
    /// Of a motion that lasts.
    rates: Option<Rates>,
    /// Logarithm of the likelihood of its predictions of late.
    likelihood: f64,
}

/// How fast parameters change, as far as that is known.
#[derive(Clone, Debug)]
struct Rates {
    /// In parameters a second.
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Covariance of parameters, a row each, and rates.
    with_parameters: DMatrix<f64>,
}

/// What a frame of readings says: with whitened derivatives `J` and residuals `r` at the contacts that are believed.
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
        let mean = DVector::zeros(information.nrows());
        let filter = Filter { mean, information, rates: None, likelihood: 0.0 };
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
        let size = PARAMETERS * to_m.len();
        let scale = DVector::from_fn(size, |i, _| match i % PARAMETERS {
            0 | 1 => from_m[i / PARAMETERS] / to_m[i / PARAMETERS],
            _ => 1.0,
        });
        let products = &scale * scale.transpose();
        for filter in &mut self.filters {
            filter.mean.component_mul_assign(&scale);
            filter.information.component_div_assign(&products);
            if let Some(rates) = &mut filter.rates {
                rates.mean.component_mul_assign(&scale);
                rates.covariance.component_mul_assign(&products);
                rates.with_parameters.component_mul_assign(&products);
            }
        }
    }

    /// Lets time (s) pass; `unit_m` are the units of the places' parameters (m). `None` where nothing is determined.
    pub fn predict(&mut self, elapsed_s: f64, unit_m: &[f64]) -> Option<()> {
        let elapsed_s = elapsed_s.clamp(0.0, LONGEST_S);
        self.age_s += elapsed_s;
        for (filter, motion) in self.filters.iter_mut().zip(&MOTIONS) {
            filter.predict(motion, elapsed_s, unit_m)?;
        }
        Some(())
    }

    /// Takes a frame into account; how far the contacts that are believed go, in their parameters. `None` where nothing is determined.
    pub fn update(&mut self, rows: &Rows) -> Option<DVector<f64>> {
        for filter in &mut self.filters {
            filter.update(rows)?;
        }
        let likelihoods = self.filters.iter().map(|filter| filter.likelihood).enumerate();
        self.best = likelihoods.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(best, _)| best);
        let believed = self.filters[self.best].clone();
        for filter in &mut self.filters {
            if filter.likelihood < believed.likelihood - policy::GONE_NATS {
                let likelihood = believed.likelihood - policy::GONE_NATS;
                *filter = Filter { likelihood, ..believed.clone() };
            }
            filter.mean -= &believed.mean;
            filter.likelihood -= believed.likelihood;
        }
        Some(believed.mean)
    }
}

impl Filter {
    fn predict(&mut self, motion: &Motion, elapsed_s: f64, unit_m: &[f64]) -> Option<()> {
        let mut covariance = Cholesky::new(self.information.clone())?.inverse();
        let deviations = motion.rates(unit_m);
        if motion.lasts_s > 0.0 {
            let rates = self.rates.get_or_insert_with(|| Rates::unknown(&deviations));
            rates.predict((-elapsed_s / motion.lasts_s).exp(), &deviations);
            self.mean += elapsed_s * &rates.mean;
            let crossed = elapsed_s * &rates.with_parameters;
            covariance += &crossed + crossed.transpose() + elapsed_s * elapsed_s * &rates.covariance;
            rates.with_parameters += elapsed_s * &rates.covariance;
        } else {
            self.rates = None;
            deviations.iter().enumerate().for_each(|(i, rate)| covariance[(i, i)] += (elapsed_s * rate).powi(2));
        }
        self.information = Cholesky::new(covariance)?.inverse();
        self.likelihood *= (-elapsed_s / MEMORY_S).exp();
        Some(())
    }

    fn update(&mut self, rows: &Rows) -> Option<()> {
        let before = Cholesky::new(self.information.clone())?;
        // Residuals are at the contacts that are believed: at this filter's mean they are by the derivatives less.
        let along = &rows.information * &self.mean;
        let pull = &rows.pull - &along;
        let cost = rows.cost - 2.0 * rows.pull.dot(&self.mean) + self.mean.dot(&along);
        let after = Cholesky::new(&self.information + &rows.information)?;
        let step = after.solve(&pull);
        self.likelihood -= 0.5 * (cost - pull.dot(&step) + after.ln_determinant() - before.ln_determinant());
        self.mean += &step;
        if let Some(rates) = &mut self.rates {
            // Rates by parameters: what is learned of these is learned of those.
            let gain = rates.with_parameters.transpose() * &self.information;
            let with_parameters = after.solve(&(&self.information * &rates.with_parameters));
            rates.mean += &gain * step;
            rates.covariance -= &gain * (&rates.with_parameters - &with_parameters);
            rates.with_parameters = with_parameters;
        }
        self.information += &rows.information;
        self.likelihood.is_finite().then_some(())
    }
}

impl Rates {
    /// Of such deviations, and no more known.
    fn unknown(deviations: &DVector<f64>) -> Self {
        let size = deviations.len();
        let covariance = DMatrix::from_diagonal(&deviations.component_mul(deviations));
        Self { mean: DVector::zeros(size), covariance, with_parameters: DMatrix::zeros(size, size) }
    }

    /// Lets them fade to that share of what they were.
    fn predict(&mut self, left: f64, deviations: &DVector<f64>) {
        self.mean *= left;
        self.with_parameters *= left;
        self.covariance *= left * left;
        let new = 1.0 - left * left;
        deviations.iter().enumerate().for_each(|(i, rate)| self.covariance[(i, i)] += new * rate * rate);
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
    fn a_still_contact_is_averaged_and_so_is_one_that_keeps_its_direction() {
        let still: f64 = (0..8).map(|seed| MeasuredContact::new(seed).error(0.0, 600)).sum::<f64>() / 8.0;
        assert!(still < 0.2 * DEVIATIONS[0], "{still}");
        for speed_m_per_s in [0.05, 0.2, 0.5, 1.0] {
            let moving: f64 =
                (0..8).map(|seed| MeasuredContact::new(seed).error(speed_m_per_s, 300)).sum::<f64>() / 8.0;
            assert!(moving < 0.5 * DEVIATIONS[0], "{speed_m_per_s} m/s: {moving}");
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
