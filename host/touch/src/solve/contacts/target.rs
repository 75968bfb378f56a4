//! The readings that a fit is made to, and how far each may be from them.
//!
//! Three things part readings from a model's: noise, alike for all; a small error of the model's own, taken as alike for all too; and what is not
//! known of the detector, which changes many readings together ([`ApproximationError`]). Of a detector that is as described the last is
//! the resistance between a pad and the layer alone, which meshes and polynomials get wrong first: it adds to `Z[g][g]`, so that
//! `dV[g][e] = (Vcc - V[g][e]) d / (Z[g][g] + R)` for all `e` but `g`, one pattern for each ground.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::approximation::ApproximationError;
use tactomo_physics::readings::Readings;

/// What is known of the errors of readings.
#[derive(Clone, Copy, Debug)]
pub(super) struct Errors {
    /// Standard deviation by noise (V).
    pub noise_v: f64,
    /// The part of it that is the same in every frame (V).
    pub rounding_v: f64,
    /// Error of the model, as a share of the largest reading.
    pub model: f64,
    /// Error of a detector that is not known exactly, as a share of the largest reading; none of one that is.
    pub detector: Option<f64>,
    /// Error of a pad's own impedance, as a share of it.
    pub pad: f64,
    /// Voltage of the driving layer (V).
    pub drive_v: f64,
    /// Readings from here on are saturated and do not count (V).
    pub full_v: f64,
}

impl Errors {
    /// Standard deviation of the mean of some frames by noise (V).
    fn of_mean_v(&self, frames: usize) -> f64 {
        let [all, fixed] = [self.noise_v, self.rounding_v].map(|deviation_v| deviation_v * deviation_v);
        (fixed + (all - fixed).max(0.0) / frames.max(1) as f64).sqrt()
    }

    /// Smallest standard deviation of a mean of frames with such readings (V).
    pub fn least_v(&self, largest_v: f64) -> f64 {
        self.of_mean_v(usize::MAX).hypot(self.model * largest_v)
    }

    /// What an error of a pad's own impedance changes (V), row by row: one pattern for each ground. `Z[g][g] + R` is about the pad's own impedance times the drive
    /// over the readings.
    pub fn pad_patterns_v(&self, readings: &Readings) -> Vec<f64> {
        let electrodes = readings.electrodes();
        let row = |(g, row): (usize, &[f64])| {
            let share = self.pad * row.iter().copied().fold(0.0, f64::max) / self.drive_v;
            let drive_v = self.drive_v;
            let pattern = |(e, volts): (usize, &f64)| if e == g { 0.0 } else { share * (drive_v - volts).max(0.0) };
            row.iter().enumerate().map(pattern).collect::<Vec<_>>()
        };
        readings.volts().chunks_exact(electrodes).enumerate().flat_map(row).collect()
    }
}

/// Readings with what their errors are like.
#[derive(Clone, Debug)]
pub(in crate::solve) struct Target {
    /// Frames that the readings are the mean of.
    pub(super) frames: usize,
    /// Standard deviation of the readings by noise (V).
    pub noise_v: f64,
    /// Readings, less what spots cannot say (V).
    pub(super) volts: Vec<f64>,
    /// One over the standard deviation of each (1/V); zero leaves a reading out.
    weights: Vec<f64>,
    error: Arc<ApproximationError>,
    /// Whether that is of what is not known of the detector.
    is_informed: bool,
    /// Whether what is not known of the detector is taken as an error that is alike for all readings.
    is_provisional: bool,
    /// `k` of each direction.
    shares: Vec<f64>,
}

impl Target {
    /// The target of the mean of some frames. Their noise averages; the errors of the model and of the detector do not. Without what is known of the latter, that
    /// of a detector that is as described.
    pub(super) fn of_mean(
        readings: &Readings,
        frames: usize,
        errors: &Errors,
        error: Option<&Arc<ApproximationError>>,
    ) -> Self {
        let noise_v = errors.of_mean_v(frames);
        let deviation_v = noise_v.hypot(errors.model * readings.largest_v());
        let weight = |volts: &f64| if *volts < errors.full_v { 1.0 / deviation_v } else { 0.0 };
        let weights: Vec<_> = readings.volts().iter().map(weight).collect();
        let of_pads = || {
            let mut patterns_v = errors.pad_patterns_v(readings);
            let counted = patterns_v.iter_mut().zip(&weights).filter(|(_, weight)| **weight == 0.0);
            counted.for_each(|(volts, _)| *volts = 0.0);
            Arc::new(ApproximationError::of_rows(&patterns_v, readings.electrodes()))
        };
        let is_informed = error.is_some();
        let error = error.map_or_else(of_pads, Arc::clone);
        let shares = error.shares(deviation_v);
        let volts = readings.volts().to_vec();
        Self { frames, noise_v, volts, weights, error, is_informed, is_provisional: false, shares }
    }

    /// The target of the mean of some frames as long as it is not known what they may be off by together: an error of each reading by itself
    /// stands for that. One that is alike for all of a detector that is as described.
    pub(super) fn provisional(readings: &Readings, frames: usize, errors: &Errors) -> Self {
        let model = errors.model.hypot(errors.detector.unwrap_or_default());
        let target = Self::of_mean(readings, frames, &Errors { model, ..*errors }, None);
        Self { is_provisional: errors.detector.is_some(), ..target }
    }

    /// The same with what the readings may be off by together.
    pub(super) fn with(&self, error: ApproximationError) -> Self {
        let shares = error.shares(self.deviation_v());
        Self { error: Arc::new(error), is_informed: true, is_provisional: false, shares, ..self.clone() }
    }

    /// The same as if the detector were as described; `None` if it is taken as that already.
    pub(super) fn as_exact(&self, errors: &Errors) -> Option<Self> {
        let n = self.volts.len().isqrt();
        let readings = Readings::from_fn(n, |g, e| self.volts[g * n + e]);
        self.is_informed.then(|| Self::of_mean(&readings, self.frames, errors, None))
    }

    /// What the readings may be off by together; none of a detector that is as described.
    pub fn error(&self) -> Option<&Arc<ApproximationError>> {
        Some(&self.error).filter(|_| self.is_informed)
    }

    /// Whether what is not known of the detector is taken as an error that is alike for all readings.
    pub fn is_provisional(&self) -> bool {
        self.is_provisional
    }

    /// Whether what the readings may be off by together was made for others than `volts`.
    pub(super) fn is_stale(&self, volts: &[f64]) -> bool {
        self.is_informed && self.error.is_stale(volts)
    }

    /// Steps of the detector that are most likely where contacts have such readings (V).
    pub(super) fn steps(&self, volts: &[f64]) -> Vec<f64> {
        let mut pulls = self.residuals(volts);
        self.whiten_transposed(&mut pulls);
        self.error.steps(&pulls)
    }

    /// Leaves readings that do not count out of patterns.
    pub(super) fn mask(&self, patterns_v: &mut DMatrix<f64>) {
        let left_out = self.weights.iter().enumerate().filter(|(_, weight)| **weight == 0.0);
        left_out.for_each(|(row, _)| patterns_v.row_mut(row).fill(0.0));
    }

    /// Makes the errors of volts alike, independent and of deviation one.
    pub fn whiten(&self, volts: &mut [f64]) {
        volts.iter_mut().zip(&self.weights).for_each(|(volts, weight)| *volts *= weight);
        self.shrink(volts);
    }

    fn shrink(&self, volts: &mut [f64]) {
        self.error.directions.iter().zip(&self.shares).for_each(|(direction, share)| direction.shrink(volts, *share));
    }

    /// A whitened copy of volts.
    pub fn whitened(&self, volts: &[f64]) -> Vec<f64> {
        let mut all = volts.to_vec();
        self.whiten(&mut all);
        all
    }

    /// The transpose of [`whiten`](Self::whiten), which takes whitened residuals to derivatives by volts.
    pub fn whiten_transposed(&self, whitened: &mut [f64]) {
        self.shrink(whitened);
        whitened.iter_mut().zip(&self.weights).for_each(|(volts, weight)| *volts *= weight);
    }

    /// Whitened differences of the readings from predicted ones.
    pub fn residuals(&self, volts: &[f64]) -> Vec<f64> {
        let mut all: Vec<_> = self.volts.iter().zip(volts).map(|(ours, theirs)| ours - theirs).collect();
        all.iter_mut().zip(&self.error.mean_v).for_each(|(left, mean)| *left -= mean);
        self.whiten(&mut all);
        all
    }

    /// Sum of squares of the residuals.
    pub fn cost(&self, volts: &[f64]) -> f64 {
        let residuals = self.residuals(volts);
        dot(&residuals, &residuals)
    }

    /// The same for there being no contact, which reads nothing on any detector: with what is added to it where contacts, whose readings an
    /// unknown detector changes, are judged without their determinant.
    pub fn cost_of_nothing(&self) -> f64 {
        if !self.is_informed {
            return self.cost(&vec![0.0; self.volts.len()]);
        }
        let squares = self.volts.iter().zip(&self.weights).map(|(volts, weight)| (volts * weight).powi(2));
        squares.sum::<f64>() - self.ln_determinant()
    }

    /// Logarithm of the determinant of the readings' covariance, in that of noise alone.
    pub fn ln_determinant(&self) -> f64 {
        self.shares.iter().map(|share| -2.0 * (1.0 - share).ln()).sum()
    }

    /// Standard deviation of a reading that counts (V).
    pub fn deviation_v(&self) -> f64 {
        1.0 / self.weights.iter().copied().fold(f64::MIN_POSITIVE, f64::max)
    }

    /// Readings that count.
    pub fn count(&self) -> usize {
        self.weights.iter().filter(|weight| **weight > 0.0).count()
    }

    /// Whether there are readings that do not count.
    pub fn is_saturated(&self) -> bool {
        self.weights.contains(&0.0)
    }
}

/// Scalar product, in four sums for the processor to do at once.
pub(in crate::solve) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_lanes, a_rest) = a.as_chunks::<4>();
    let (b_lanes, b_rest) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in a_lanes.iter().zip(b_lanes) {
        (0..4).for_each(|lane| sums[lane] += a[lane] * b[lane]);
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}
