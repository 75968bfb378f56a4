//! The readings that a fit is made to, and how far each may be from them.
//!
//! Three things part readings from a model's: noise, alike for all; a small error of the model's own, taken as alike for all too; and what is not
//! known of the detector, which changes many readings together ([`ApproximationError`]). Of a detector that is as described the last is
//! the resistance between a pad and the layer alone, which meshes and polynomials get wrong first: it adds to `Z[g][g]`, so that
//! `dV[g][e] = (Vcc - V[g][e]) d / (Z[g][g] + R)` for all `e` but `g`, one pattern for each ground.
//!
//! A reading at an end of the converter's range is a bound: a model is held against it only where it breaks it, by as much as it does.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::DMatrix;

use super::approximation::ApproximationError;
use super::dot::dot;
use tactomo_physics::detector::ConverterErrors;
use tactomo_physics::forward::ForwardModel;
use tactomo_physics::readings::{Readings, Says};

/// Error of the model's, or the builder's, impedance of a pad, as a share of it.
pub(crate) const PAD_ERROR: f64 = 0.03;

/// Error of a forward model, as a share of the largest reading.
pub(crate) fn model_error(model: &dyn ForwardModel) -> f64 {
    // Against three times its nodes, a shell of 2000 is off by 0.0005 (curved) to 0.002 (0.4 mm of square-60), in the root of
    // the mean square and but for the pads' own impedances; the slab by 0.0002 to 0.0005.
    if model.name() == "shell" { 0.0015 } else { 0.0003 }
}

/// What gains and bows of converters change in readings, of one standard deviation each (V): two columns each. `of_electrode` tells which one reads an electrode.
pub(crate) fn converter_patterns_v(
    readings: &Readings,
    converters: &[ConverterErrors],
    of_electrode: impl Fn(usize) -> usize,
) -> DMatrix<f64> {
    let n = readings.electrodes();
    let mut patterns_v = DMatrix::zeros(n * n, 2 * converters.len());
    for (g, e) in (0..n).flat_map(|g| (0..n).map(move |e| (g, e))) {
        let index = of_electrode(e);
        let Some(converter) = converters.get(index) else { continue };
        let changes_v = converter.changes_v(readings.touch_v(g, e));
        (0..2).for_each(|kind| patterns_v[(g * n + e, 2 * index + kind)] = changes_v[kind]);
    }
    patterns_v
}

/// What is known of the errors of readings.
#[derive(Clone, Debug)]
pub(crate) struct Errors {
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
    /// Errors of the converters; none where nothing is known of them.
    pub converters: Arc<[ConverterErrors]>,
    /// Which of them reads each electrode.
    pub converter_of: Arc<[usize]>,
}

impl Errors {
    /// Standard deviation of the mean of some frames by noise (V).
    pub fn of_mean_v(&self, frames: usize) -> f64 {
        let [all, fixed] = [self.noise_v, self.rounding_v].map(|deviation_v| deviation_v * deviation_v);
        (fixed + (all - fixed).max(0.0) / frames.max(1) as f64).sqrt()
    }

    /// Readings as a board can give them: none is far beyond its drive. Numbers from elsewhere may be so large that their squares are not finite.
    fn held<'a>(&self, readings: &'a Readings) -> Cow<'a, Readings> {
        let most_v = 2.0 * self.drive_v;
        if readings.volts().iter().all(|volts| volts.abs() <= most_v) {
            return Cow::Borrowed(readings);
        }
        let held = Readings::from_fn(readings.electrodes(), |g, e| readings.at(g, e).clamp(-most_v, most_v));
        Cow::Owned(held.saying(|g, e| readings.says(g, e)))
    }

    /// What readings may be off by, but for noise, on a detector that is as described (V): a column for each ground's pad, and two for each
    /// converter, its gain and its bow.
    pub fn patterns_v(&self, readings: &Readings) -> DMatrix<f64> {
        let n = readings.electrodes();
        let of_pads = self.pad_patterns_v(readings);
        let mut patterns_v = DMatrix::zeros(n * n, n + 2 * self.converters.len());
        of_pads.iter().enumerate().for_each(|(i, volts)| patterns_v[(i, i / n)] = *volts);
        let of_electrode = |e: usize| self.converter_of.get(e).copied().unwrap_or_default();
        let of_converters = converter_patterns_v(readings, &self.converters, of_electrode);
        patterns_v.columns_mut(n, of_converters.ncols()).copy_from(&of_converters);
        patterns_v
    }

    /// Smallest standard deviation of a mean of frames with such readings (V).
    pub fn least_v(&self, largest_v: f64) -> f64 {
        self.of_mean_v(usize::MAX).hypot(self.model * largest_v)
    }

    /// What an error of a pad's own impedance changes (V), row by row: one pattern for each ground. `Z[g][g] + R` is about the pad's own impedance times the drive
    /// over the readings.
    pub fn pad_patterns_v(&self, readings: &Readings) -> Vec<f64> {
        let electrodes = readings.electrodes();
        let row = |g: usize| {
            let volts = move |e: usize| readings.touch_v(g, e);
            let share = self.pad * (0..electrodes).map(volts).fold(0.0, f64::max) / self.drive_v;
            let drive_v = self.drive_v;
            (0..electrodes).map(move |e| if e == g { 0.0 } else { share * (drive_v - volts(e)).max(0.0) })
        };
        (0..electrodes).flat_map(row).collect()
    }
}

/// What readings say of leakage since the baseline was taken.
pub(crate) struct LeakageSeen {
    /// Its likeliest standard deviation (sheet conductances).
    pub sheets: f64,
    /// By how much the sum of squares of what is left would fall with any leakage.
    pub squares: f64,
}

/// Readings with what their errors are like.
#[derive(Clone, Debug)]
pub(crate) struct Target {
    /// Frames that the readings are the mean of.
    pub(crate) frames: usize,
    /// Standard deviation of the readings by noise (V).
    pub noise_v: f64,
    /// Standard deviation of what each reading by itself is off by in every frame alike (V).
    fixed_v: f64,
    /// Readings, less what spots cannot say (V).
    pub(crate) volts: Vec<f64>,
    /// One over the standard deviation of each (1/V); zero leaves a reading out.
    weights: Vec<f64>,
    /// What each says; empty where all are voltages.
    says: Vec<Says>,
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
    pub(crate) fn of_mean(
        readings: &Readings,
        frames: usize,
        errors: &Errors,
        error: Option<&Arc<ApproximationError>>,
    ) -> Self {
        let held = errors.held(readings);
        let readings = &*held;
        let noise_v = errors.of_mean_v(frames);
        let deviation_v = noise_v.hypot(errors.model * readings.largest_v());
        let weight = |volts: &f64| if *volts < errors.full_v { 1.0 / deviation_v } else { 0.0 };
        let mut weights: Vec<_> = readings.volts().iter().map(weight).collect();
        let says = readings.all_say().to_vec();
        let unread = says.iter().zip(&mut weights).filter(|(says, _)| **says == Says::Nothing);
        unread.for_each(|(_, weight)| *weight = 0.0);
        let is_counted = |i: usize| weights[i] > 0.0 && is_voltage(&says, i);
        let of_pads = || {
            let mut patterns_v = errors.pad_patterns_v(readings);
            let left_out = patterns_v.iter_mut().enumerate().filter(|(i, _)| !is_counted(*i));
            left_out.for_each(|(_, volts)| *volts = 0.0);
            ApproximationError::of_rows(&patterns_v, readings.electrodes())
        };
        let of_converters = || {
            let mut patterns_v = errors.patterns_v(readings);
            let left_out = (0..patterns_v.nrows()).filter(|i| !is_counted(*i));
            left_out.for_each(|i| patterns_v.row_mut(i).fill(0.0));
            ApproximationError::of(&patterns_v, 0, Vec::new(), deviation_v)
        };
        let of_board = || Arc::new(if errors.converters.is_empty() { of_pads() } else { of_converters() });
        let is_informed = error.is_some();
        let error = error.map_or_else(of_board, Arc::clone);
        let shares = error.shares(deviation_v);
        let volts = readings.volts().to_vec();
        let fixed_v = errors.least_v(readings.largest_v());
        Self { frames, noise_v, fixed_v, volts, weights, says, error, is_informed, is_provisional: false, shares }
    }

    /// The target where a model predicts `volts` (V): bounds that it keeps are left out. Derivatives are whitened by this one.
    pub fn at(&self, volts: &[f64]) -> Cow<'_, Self> {
        if self.says.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut target = self.clone();
        for (i, weight) in target.weights.iter_mut().enumerate() {
            if !is_voltage(&self.says, i) && self.left(i, volts[i]) == 0.0 {
                *weight = 0.0;
            }
        }
        Cow::Owned(target)
    }

    /// Whether every reading says no more than that it is below the converter's range, as where nothing touches. A contact that has become lighter
    /// than the range shows keeps all these bounds too, and would stay for ever at the last conductance at which it did not.
    pub fn is_silent(&self) -> bool {
        let is_read = |says: &&Says| **says != Says::Nothing;
        let mut read = self.says.iter().filter(is_read).peekable();
        read.peek().is_some() && read.all(|says| *says == Says::AtMost)
    }

    /// How far a reading is from a predicted one (V): of a bound, by as much as that breaks it.
    fn left(&self, i: usize, predicted_v: f64) -> f64 {
        let left = self.volts[i] - predicted_v - self.error.mean_v.get(i).copied().unwrap_or_default();
        match self.says.get(i).copied().unwrap_or_default() {
            Says::Voltage => left,
            Says::AtMost => left.min(0.0),
            Says::AtLeast => left.max(0.0),
            Says::Nothing => 0.0,
        }
    }

    /// The readings that they are of, with what each says.
    pub fn readings(&self) -> Readings {
        let n = self.volts.len().isqrt();
        let readings = Readings::from_fn(n, |g, e| self.volts[g * n + e]);
        if self.says.is_empty() { readings } else { readings.saying(|g, e| self.says[g * n + e]) }
    }

    /// The target of the mean of some frames as long as it is not known what they may be off by together: an error of each reading by itself
    /// stands for that. One that is alike for all of a detector that is as described.
    pub(crate) fn provisional(readings: &Readings, frames: usize, errors: &Errors) -> Self {
        let model = errors.model.hypot(errors.detector.unwrap_or_default());
        let target = Self::of_mean(readings, frames, &Errors { model, ..errors.clone() }, None);
        Self { is_provisional: errors.detector.is_some(), ..target }
    }

    /// The target with what the readings may be off by together.
    pub(crate) fn with(&self, error: ApproximationError) -> Self {
        let shares = error.shares(self.deviation_v());
        Self { error: Arc::new(error), is_informed: true, is_provisional: false, shares, ..self.clone() }
    }

    /// The target with so much more that each reading by itself is off by in every frame alike (V).
    pub(crate) fn with_model_error(&self, model_v: f64) -> Self {
        let before_v = self.deviation_v();
        let smaller = before_v / before_v.hypot(model_v);
        let weights = self.weights.iter().map(|weight| smaller * weight).collect();
        let fixed_v = self.fixed_v.hypot(model_v);
        Self { weights, fixed_v, shares: self.error.shares(before_v / smaller), ..self.clone() }
    }

    /// The target as if the detector were as described; `None` if it is taken as that already.
    pub(crate) fn as_exact(&self, errors: &Errors) -> Option<Self> {
        self.is_informed.then(|| Self::of_mean(&self.readings(), self.frames, errors, None))
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
    pub(crate) fn is_stale(&self, volts: &[f64]) -> bool {
        self.is_informed && self.error.is_stale(volts)
    }

    /// Steps of the detector that are most likely where contacts have such readings (V).
    pub(crate) fn steps(&self, volts: &[f64]) -> Vec<f64> {
        self.error.steps(&self.pulls(volts))
    }

    /// Residuals times the inverse of their covariance (1/V), where contacts predict `volts`.
    pub(crate) fn pulls(&self, volts: &[f64]) -> Vec<f64> {
        let mut pulls = self.residuals(volts);
        self.whiten_transposed(&mut pulls);
        pulls
    }

    /// What readings say of leakage where contacts predict `volts`; `None` of a detector that is known exactly.
    ///
    /// With the pattern `p` of one deviation `s`, the residuals `r` and their covariance `S`, which has `p p^T` in it, `a = p^T S^-1 r` and
    /// `q = p^T S^-1 p`: without `p` in `S` the likeliest leakage would be `s a / q`, with a variance of `s^2 (1 - q) / q`. By the inversion of a
    /// matrix with a term of rank one (Sherman and Morrison, 1950).
    pub(crate) fn leakage(&self, volts: &[f64]) -> Option<LeakageSeen> {
        let pattern_v = self.error.leakage_v();
        let whitened = if pattern_v.is_empty() { return None } else { self.whitened(pattern_v) };
        let (pull, known) = (dot(pattern_v, &self.pulls(volts)), dot(&whitened, &whitened).max(f64::MIN_POSITIVE));
        let variance = (pull / known).powi(2) - (1.0 - known).max(0.0) / known;
        let sheets = self.error.about.leakage_sheets * variance.max(0.0).sqrt();
        Some(LeakageSeen { sheets, squares: pull * pull / known })
    }

    /// Leaves readings that do not count, or are bounds, out of patterns.
    pub(crate) fn mask(&self, patterns_v: &mut DMatrix<f64>) {
        let left_out = (0..self.weights.len()).filter(|i| self.weights[*i] == 0.0 || !is_voltage(&self.says, *i));
        left_out.for_each(|row| patterns_v.row_mut(row).fill(0.0));
    }

    /// Makes the errors of volts alike, independent and of deviation one.
    pub fn whiten(&self, volts: &mut [f64]) {
        volts.iter_mut().zip(&self.weights).for_each(|(volts, weight)| *volts *= weight);
        self.shrink(volts);
    }

    /// Whitened volts, a column each.
    pub fn whitened_columns(&self, columns_v: &[Vec<f64>]) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(self.weights.len(), columns_v.len());
        for (mut column, volts) in all.column_iter_mut().zip(columns_v) {
            let weighed = volts.iter().zip(&self.weights).map(|(volts, weight)| volts * weight);
            column.as_mut_slice().iter_mut().zip(weighed).for_each(|(to, volts)| *to = volts);
        }
        self.error.shrink_columns(&mut all, &self.shares);
        all
    }

    /// Makes the errors of the volts in each column alike, independent and of deviation one.
    pub fn whiten_columns(&self, columns_v: &mut DMatrix<f64>) {
        for mut column in columns_v.column_iter_mut() {
            column.as_mut_slice().iter_mut().zip(&self.weights).for_each(|(volts, weight)| *volts *= weight);
        }
        self.error.shrink_columns(columns_v, &self.shares);
    }

    fn shrink(&self, volts: &mut [f64]) {
        self.error.shrink(volts, &self.shares);
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
        // Few have bounds.
        (0..self.says.len()).for_each(|i| all[i] = self.left(i, volts[i]));
        self.whiten(&mut all);
        all
    }

    /// Sum of squares of the residuals.
    pub fn cost(&self, volts: &[f64]) -> f64 {
        let residuals = self.residuals(volts);
        dot(&residuals, &residuals)
    }

    /// Sum of squares of the residuals where there is no contact, which reads nothing on any detector: with what is added to it where contacts,
    /// whose readings an unknown detector changes, are judged without their determinant.
    pub fn cost_of_nothing(&self) -> f64 {
        if !self.is_informed {
            return self.cost(&vec![0.0; self.volts.len()]);
        }
        let squares =
            self.volts.iter().zip(&self.weights).enumerate().map(|(i, (volts, weight))| match self.says.get(i) {
                Some(Says::AtMost | Says::Nothing) => 0.0,
                _ => (volts * weight).powi(2),
            });
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

    /// Standard deviation of what each reading by itself is off by in every frame alike (V).
    pub fn fixed_v(&self) -> f64 {
        self.fixed_v
    }

    /// Readings that count, but for those that are bounds.
    pub fn count(&self) -> usize {
        (0..self.weights.len()).filter(|i| self.weights[*i] > 0.0 && is_voltage(&self.says, *i)).count()
    }

    /// Readings that say anything.
    pub fn known(&self) -> usize {
        self.volts.len() - self.says.iter().filter(|says| **says == Says::Nothing).count()
    }

    /// Whether there are readings that are too large to count.
    pub fn is_saturated(&self) -> bool {
        let is_full = |i: usize| self.weights[i] == 0.0 && is_voltage(&self.says, i);
        self.says.contains(&Says::AtLeast) || (0..self.weights.len()).any(is_full)
    }
}

fn is_voltage(says: &[Says], i: usize) -> bool {
    says.get(i).is_none_or(|says| *says == Says::Voltage)
}
