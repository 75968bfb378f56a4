//! Key frames as they are fitted together: what readings are off by in all of them.
//!
//! What is not known of the detector is the same in all frames, and linear near some detector; so are the errors of pads and converters. So is what each reading by itself is off by, but for
//! noise: the baseline's error is the same in all frames, the model's in proportion to what is read, and that of steps of the detector in proportion
//! to what these change. Taken as independent from frame to frame, they made light contacts beside a firm one that is pressed more and less.

use std::sync::Arc;

use nalgebra::allocator::Allocator;
use nalgebra::{Cholesky, DMatrix, DVector, DefaultAllocator, Dim, Dyn, OMatrix};

use super::super::ContactFinder;
use super::super::discs::{DiscFit, DiscFitter};
use super::KeyFrame;
use super::together::Together;
use crate::solve::fit::approximation::{About, Linearised};
use crate::solve::fit::dot::dot;
use crate::solve::fit::target::Target;
use tactomo_physics::forward::Nuisance;

/// Frames that a baseline is the mean of at first (`host/board/src/baseline`).
const BASELINE_FRAMES: f64 = 32.0;
/// Share by which what steps of a detector change in the readings is wrong, as it is found with coarse models and taken as linear: without it, fits to
/// detectors as built leave 1.1 times the squares of noise and contacts are invented; with a hundredth they leave those of noise, 0.86 to 1.0 times, and
/// with 0.03 five fingers are not told.
const PATTERN_ERROR: f64 = 0.01;

/// A key frame as it is fitted.
pub(super) struct Frame {
    /// With the errors of noise and model alone.
    pub target: Target,
    /// With what the readings may be off by together: for fits of this frame alone.
    pub alone: Target,
    /// What steps of the detector, pads and converters change, whitened, a row each.
    transposed: DMatrix<f64>,
    /// What readings change by with steps of the detector, as a share of the largest.
    pub unknown: f64,
    /// What the model is wrong by in each of them (V), but for steps of the detector.
    model_v: f64,
}

/// Key frames, to be explained together.
pub(super) struct Window<'a> {
    pub finder: &'a ContactFinder,
    pub fitter: DiscFitter<'a>,
    pub frames: Vec<Frame>,
    /// What is not known of the detector. It may be [made](crate::solve::problem::Problem::nuisance) meanwhile: for one window it is what it was at its begin.
    nuisance: Option<&'a Nuisance>,
    pub about: About,
    /// Information of all frames about steps of the detector, with what is known of these before.
    pub of_detector: DMatrix<f64>,
    /// Inverse of the covariance, between frames, of what each reading by itself is off by.
    pub between: DMatrix<f64>,
    /// That times what steps of the detector change in each frame, whitened, a column each.
    pub patterns: Vec<DMatrix<f64>>,
    /// Of `of_detector`.
    pub factor: Cholesky<f64, Dyn>,
}

impl ContactFinder {
    /// Inverse of the covariance between frames of what each reading by itself is off by, in its deviations of each frame: noise is each frame's own, the
    /// baseline's error the same in all, the model's in proportion to what is read, and that of the first patterns, which are steps of the detector, to
    /// what these change.
    fn between(&self, frames: &[Frame], steps: usize) -> Option<DMatrix<f64>> {
        let baseline_v = self.errors.noise_v / BASELINE_FRAMES.sqrt();
        let covariance = |i: usize, j: usize| {
            let (one, other) = (&frames[i], &frames[j]);
            let noise_v2 = if i == j { one.target.noise_v.powi(2) } else { 0.0 };
            let model_v2 = one.model_v * other.model_v * likeness(&one.target.volts, &other.target.volts);
            let of_each = (noise_v2 + baseline_v * baseline_v + model_v2)
                / (one.target.deviation_v() * other.target.deviation_v());
            let of_steps = one.transposed.rows(0, steps).dot(&other.transposed.rows(0, steps));
            of_each + PATTERN_ERROR * PATTERN_ERROR * of_steps / one.transposed.ncols() as f64
        };
        Some(Cholesky::new(DMatrix::from_fn(frames.len(), frames.len(), covariance))?.inverse())
    }
}

impl<'a> Window<'a> {
    /// Of key frames whose readings are linear near a detector, or else the described one.
    pub fn new(finder: &'a ContactFinder, keys: &[KeyFrame], about: About) -> Option<Self> {
        let nuisance = finder.problem.nuisance();
        let frame = |key: &KeyFrame| {
            finder.check(&key.mean.readings).ok()?;
            let alone = Target::of_mean(&key.mean.readings, key.mean.frames, &finder.errors, None);
            let model_v = finder.errors.model * key.mean.readings.largest_v();
            let (alone, mut patterns, steps) = match nuisance {
                Some(nuisance) => {
                    let (alone, patterns) = finder.informed_with_patterns(&alone, &key.contacts, &about)?;
                    (alone, patterns, nuisance.directions())
                }
                None => {
                    let mut patterns = finder.errors.patterns_v(&key.mean.readings);
                    alone.mask(&mut patterns);
                    (alone, patterns, 0)
                }
            };
            let of_steps = patterns.columns(0, steps);
            let unknown_v = (of_steps.norm_squared() / patterns.nrows() as f64).sqrt();
            let unknown = unknown_v / key.mean.readings.largest_v();
            let alone = alone.with_model_error(PATTERN_ERROR * unknown_v);
            let target = alone.without_unknowns();
            target.whiten_columns(&mut patterns);
            Some(Frame { target, alone, transposed: patterns.transpose(), unknown, model_v })
        };
        let frames: Vec<_> = keys.iter().map(frame).collect::<Option<_>>()?;
        let unknowns = frames.first()?.transposed.nrows();
        let steps = nuisance.map_or(0, Nuisance::directions);
        let between = finder.between(&frames, steps)?;
        let patterns: Vec<_> = frames.iter().map(|frame| frame.transposed.transpose()).collect();
        let patterns = across(&between, &patterns);
        let information = |sum: DMatrix<f64>, (frame, all): (&Frame, &DMatrix<f64>)| sum + &frame.transposed * all;
        let of_detector = frames.iter().zip(&patterns).fold(DMatrix::identity(unknowns, unknowns), information);
        let factor = Cholesky::new(of_detector.clone())?;
        Some(Self {
            fitter: finder.disc_fitter(),
            of_detector,
            factor,
            finder,
            nuisance,
            about,
            between,
            patterns,
            frames,
        })
    }

    /// The detector that an explanation makes likeliest, if it is far from where readings are linear.
    pub fn nearer(&self, found: &Together) -> Option<About> {
        let nuisance = self.nuisance?;
        let steps = self.factor.solve(&self.pull(&self.residuals(&found.at.fits).0)?);
        let steps = steps.as_slice()[..nuisance.directions()].to_vec();
        let is_far =
            |frame: &Frame| frame.alone.error().is_some_and(|error| error.is_far(&steps, frame.target.deviation_v()));
        self.frames.iter().any(is_far).then_some(())?;
        let detector = nuisance.similar(&steps).ok()?;
        Some(About { near: Some(Arc::new(Linearised { steps, detector })), ..self.about.clone() })
    }

    /// Residuals of all frames times what is [between](Self::between) them, and their sum of squares.
    pub fn residuals(&self, fits: &[DiscFit]) -> (Vec<DVector<f64>>, f64) {
        let of = |(fit, frame): (&DiscFit, &Frame)| DVector::from_vec(frame.target.residuals(&fit.volts));
        let own: Vec<_> = fits.iter().zip(&self.frames).map(of).collect();
        let all = across(&self.between, &own);
        let squares = own.iter().zip(&all).map(|(own, all)| own.dot(all)).sum();
        (all, squares)
    }

    /// What all frames' residuals pull the detector by.
    pub fn pull(&self, residuals: &[DVector<f64>]) -> Option<DVector<f64>> {
        let pulls = self.frames.iter().zip(residuals).map(|(frame, left)| &frame.transposed * left);
        pulls.reduce(|sum, pull| sum + pull)
    }
}

/// How alike readings are in their proportions: 1 if they are, and 0 if what is read in one is not in the other.
fn likeness(one: &[f64], other: &[f64]) -> f64 {
    dot(one, other) / (dot(one, one) * dot(other, other)).sqrt().max(f64::MIN_POSITIVE)
}

/// A matrix between frames times what each frame has.
pub(super) fn across<R: Dim, C: Dim>(between: &DMatrix<f64>, all: &[OMatrix<f64, R, C>]) -> Vec<OMatrix<f64, R, C>>
where
    DefaultAllocator: Allocator<R, C>,
{
    let row = |i: usize| all.iter().enumerate().map(|(j, of)| of * between[(i, j)]).reduce(|sum, one| sum + one);
    (0..all.len()).filter_map(row).collect()
}
