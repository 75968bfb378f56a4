//! The readings that a fit is made to, and how far each may be from them.
//!
//! Three things part readings from a model's: noise, alike for all; an error of the model, taken as alike for all too; and
//! the resistance between a pad and the layer, which no builder knows to a per cent and which meshes and polynomials get wrong
//! first. It adds to `Z[g][g]` alone, so that `dV[g][e] = (Vcc - V[g][e]) d / (Z[g][g] + R)` for all `e` but `g`: one pattern for
//! each ground. With a covariance `s^2 (I + a q q^T)` of a row, `q` of length one, `(I - k q q^T) / s` makes its errors alike
//! and independent, with `k = 1 - (1 + a)^(-1/2)`.

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
}

/// Readings with what their errors are like.
#[derive(Clone, Debug)]
pub(in crate::solve) struct Target {
    electrodes: usize,
    /// Frames that the readings are the mean of.
    pub(super) frames: usize,
    /// Standard deviation of the readings by noise (V).
    pub noise_v: f64,
    /// Readings, less what spots cannot say (V).
    pub(super) volts: Vec<f64>,
    /// One over the standard deviation of each (1/V); zero leaves a reading out.
    weights: Vec<f64>,
    /// `q`, row by row, times the root of `k`.
    loads: Vec<f64>,
}

impl Target {
    /// The target of some readings.
    pub(super) fn new(readings: &Readings, errors: &Errors) -> Self {
        Self::of_mean(readings, 1, errors)
    }

    /// The target of the mean of some frames. Their noise averages; the errors of the model and of the pads do not.
    pub(super) fn of_mean(readings: &Readings, frames: usize, errors: &Errors) -> Self {
        let electrodes = readings.electrodes();
        let noise_v = errors.of_mean_v(frames);
        let deviation_v = noise_v.hypot(errors.model * readings.largest_v());
        let weight = |volts: &f64| if *volts < errors.full_v { 1.0 / deviation_v } else { 0.0 };
        let weights: Vec<_> = readings.volts().iter().map(weight).collect();
        let mut loads = Vec::with_capacity(weights.len());
        for (g, (row, weights)) in
            readings.volts().chunks_exact(electrodes).zip(weights.chunks_exact(electrodes)).enumerate()
        {
            loads.extend(load_pattern(g, row, weights, errors));
        }
        Self { electrodes, frames, noise_v, volts: readings.volts().to_vec(), weights, loads }
    }

    /// Makes the errors of volts alike, independent and of deviation one.
    pub fn whiten(&self, volts: &mut [f64]) {
        volts.iter_mut().zip(&self.weights).for_each(|(volts, weight)| *volts *= weight);
        for (row, load) in volts.chunks_exact_mut(self.electrodes).zip(self.loads.chunks_exact(self.electrodes)) {
            let share = dot(row, load);
            row.iter_mut().zip(load).for_each(|(volts, load)| *volts -= share * load);
        }
    }

    /// A whitened copy of volts.
    pub fn whitened(&self, volts: &[f64]) -> Vec<f64> {
        let mut all = volts.to_vec();
        self.whiten(&mut all);
        all
    }

    /// The transpose of [`whiten`](Self::whiten), which takes whitened residuals to derivatives by volts.
    pub fn whiten_transposed(&self, whitened: &mut [f64]) {
        for (row, load) in whitened.chunks_exact_mut(self.electrodes).zip(self.loads.chunks_exact(self.electrodes)) {
            let share = dot(row, load);
            row.iter_mut().zip(load).for_each(|(volts, load)| *volts -= share * load);
        }
        whitened.iter_mut().zip(&self.weights).for_each(|(volts, weight)| *volts *= weight);
    }

    /// Whitened differences of the readings from predicted ones.
    pub fn residuals(&self, volts: &[f64]) -> Vec<f64> {
        let mut all: Vec<_> = self.volts.iter().zip(volts).map(|(ours, theirs)| ours - theirs).collect();
        self.whiten(&mut all);
        all
    }

    /// Sum of squares of the residuals.
    pub fn cost(&self, volts: &[f64]) -> f64 {
        let residuals = self.residuals(volts);
        dot(&residuals, &residuals)
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

/// `q` times the root of `k` for one ground. `Z[g][g] + R` is about the pad's own impedance times the drive over the readings.
fn load_pattern(g: usize, row: &[f64], weights: &[f64], errors: &Errors) -> Vec<f64> {
    let largest_v = row.iter().copied().fold(0.0, f64::max);
    let share = errors.pad * largest_v / errors.drive_v;
    let pattern = |(e, (volts, weight)): (usize, (&f64, &f64))| match e == g {
        true => 0.0,
        false => share * (errors.drive_v - volts).max(0.0) * weight,
    };
    let mut pattern: Vec<_> = row.iter().zip(weights).enumerate().map(pattern).collect();
    let square = dot(&pattern, &pattern);
    let k = 1.0 - 1.0 / (1.0 + square).sqrt();
    let scale = if square > 0.0 { (k / square).sqrt() } else { 0.0 };
    pattern.iter_mut().for_each(|value| *value *= scale);
    pattern
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
