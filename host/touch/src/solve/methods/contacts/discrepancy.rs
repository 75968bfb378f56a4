//! What the readings of contacts that move differ from the model by, on a detector that is not known exactly.
//!
//! Whole frames tell what detector and board are likely to differ by. With patterns `P` of one standard deviation each, residuals `r` and noise
//! of the deviation `d`, the steps along the patterns have
//!
//! ```text
//! mean s = (d^2 I + P^T P)^-1 P^T r,   covariance (I + P^T (I - H) P / d^2)^-1
//! ```
//!
//! where `H` projects on what the contacts' parameters change. Steps are the detector's and stay; patterns are those of the contacts and change
//! with them. So where contacts go, their patterns `P'` are made anew: readings are off by `P' s`, and how far that is unknown is the steps'
//! covariance seen through `P'`. Between two makings nothing is said of the share that has changed but its size.

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::ContactFinder;
use super::discs::DiscFit;
use crate::solve::fit::approximation::{About, ApproximationError};
use crate::solve::fit::dot::dot;
use crate::solve::fit::policy;
use crate::solve::fit::target::Target;

/// Patterns are made anew once readings have changed by this part of what makes them [stale](policy::STALE_SHARE).
const RENEWED: f64 = 0.5;

/// What all readings are off by, of a detector that is not known exactly; nothing of one that is.
#[derive(Clone, Debug, Default)]
pub(super) struct Discrepancy {
    /// As far as it is known (V).
    pub volts: Vec<f64>,
    /// What it may be besides, in independent patterns of one standard deviation (V), a column each.
    pub patterns_v: DMatrix<f64>,
    steps: Option<Arc<Steps>>,
    /// Readings of the contacts that it was made for (V).
    made_for: Vec<f64>,
    /// Readings of those that were in the whole frame (V).
    found_with: Vec<f64>,
    /// How much of it is no longer what it was made as: 0 to 1.
    changed: f64,
}

/// What a whole frame told of detector and board.
struct Steps {
    mean: DVector<f64>,
    /// Of the steps' information.
    factor: Cholesky<f64, Dyn>,
    about: About,
}

impl std::fmt::Debug for Steps {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Steps").field("mean", &self.mean.len()).finish_non_exhaustive()
    }
}

impl Steps {
    /// The patterns of what is not known of them.
    fn unknown(&self, patterns_v: &DMatrix<f64>) -> DMatrix<f64> {
        let across = self.factor.l_dirty().solve_lower_triangular(&patterns_v.transpose());
        across.map_or_else(|| patterns_v.clone(), |across| across.transpose())
    }
}

impl Discrepancy {
    /// Takes note of the readings that contacts predict now (V).
    pub fn follow(&mut self, volts: &[f64]) {
        self.changed = (change(&self.made_for, volts) / policy::STALE_SHARE).min(1.0);
    }

    /// Whether its patterns are to be made anew.
    pub fn is_outdated(&self) -> bool {
        self.changed >= RENEWED
    }

    /// Whether contacts have gone so far that a whole frame has to tell anew, where they predict such readings (V).
    pub fn is_stale(&self, volts: &[f64]) -> bool {
        change(&self.found_with, volts) >= policy::STALE_SHARE
    }

    /// Whether the detector is known exactly.
    pub fn is_nothing(&self) -> bool {
        self.steps.is_none()
    }

    /// What of it is left (V).
    pub fn left_v(&self) -> impl Iterator<Item = f64> {
        let left = (1.0 - self.changed * self.changed).sqrt();
        self.volts.iter().map(move |volts| left * volts)
    }

    /// Standard deviation of what has come in its place, the same for all readings (V).
    pub fn new_v(&self) -> f64 {
        self.changed * (dot(&self.volts, &self.volts) / self.volts.len().max(1) as f64).sqrt()
    }
}

/// Change of readings as a share of what they were.
fn change(before: &[f64], after: &[f64]) -> f64 {
    let squares = before.iter().zip(after).map(|(before, after)| (after - before).powi(2));
    (squares.sum::<f64>() / dot(before, before).max(f64::MIN_POSITIVE)).sqrt()
}

impl ContactFinder {
    /// What readings are off by as whole frames tell it; nothing of a detector that is known exactly.
    pub(super) fn discrepancy(&self, fit: &DiscFit, target: &Target) -> Discrepancy {
        self.inferred_discrepancy(fit, target).unwrap_or_default()
    }

    fn inferred_discrepancy(&self, fit: &DiscFit, target: &Target) -> Option<Discrepancy> {
        let about = target.error()?.about.clone();
        let patterns = self.patterns_at(fit, &about)?;
        let plain = target.with(ApproximationError::of_mean(patterns.mean_v.clone()));
        let mut patterns_v = patterns.patterns_v.clone();
        plain.mask(&mut patterns_v);
        let variance_v2 = plain.deviation_v().powi(2);
        let mut information = patterns_v.tr_mul(&patterns_v) / variance_v2;
        (0..information.nrows()).for_each(|i| information[(i, i)] += 1.0);
        let pulls = DVector::from_vec(plain.pulls(&fit.volts));
        let mean = Cholesky::new(information.clone())?.solve(&patterns_v.tr_mul(&pulls));
        // What contacts may be as well says nothing of the detector.
        let slopes = DMatrix::from_fn(patterns_v.nrows(), fit.slopes_v().len(), |i, j| fit.slopes_v()[j][i]);
        let along = slopes.tr_mul(&patterns_v) / variance_v2;
        let contacts = self.disc_fitter().covariance(fit, &plain)?;
        information -= along.tr_mul(&(contacts * &along));
        let steps = Arc::new(Steps { mean, factor: Cholesky::new(information)?, about });
        Some(patterns.after(steps, fit.volts.clone(), fit.volts.clone()))
    }

    /// The same detector with contacts that have gone on; `None` if they make no sense.
    pub(super) fn discrepancy_at(&self, before: &Discrepancy, fit: &DiscFit) -> Option<Discrepancy> {
        let steps = before.steps.clone()?;
        let patterns = self.patterns_at(fit, &steps.about)?;
        Some(patterns.after(steps, fit.volts.clone(), before.found_with.clone()))
    }

    fn patterns_at(&self, fit: &DiscFit, about: &About) -> Option<Patterns> {
        let (patterns_v, described) = self.patterns_v(&fit.contacts, about)?;
        let mean_v = match &about.near {
            Some(near) => {
                let volts = near.detector.readings_v(&fit.contacts, self.problem.detector()).ok()?;
                near.mean_v(volts.volts(), described.volts(), &patterns_v)
            }
            None => vec![0.0; patterns_v.nrows()],
        };
        Some(Patterns { patterns_v, mean_v })
    }
}

/// What a detector that is not known exactly changes in the readings of some contacts.
struct Patterns {
    /// Of steps of one standard deviation each (V), a column each.
    patterns_v: DMatrix<f64>,
    /// What is no step (V).
    mean_v: Vec<f64>,
}

impl Patterns {
    fn after(self, steps: Arc<Steps>, made_for: Vec<f64>, found_with: Vec<f64>) -> Discrepancy {
        let by_steps = &self.patterns_v * &steps.mean;
        let volts = self.mean_v.iter().zip(&by_steps).map(|(mean, steps)| mean + steps).collect();
        Discrepancy {
            volts,
            patterns_v: steps.unknown(&self.patterns_v),
            steps: Some(steps),
            made_for,
            found_with,
            changed: 0.0,
        }
    }
}
