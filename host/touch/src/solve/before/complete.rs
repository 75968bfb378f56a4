//! Readings that are not known, or by a bound only, as the others have them.
//!
//! Readings of one contact have, once their rows are [balanced](crate::solve::fit::balance), as few dimensions as there are electrodes, so those that
//! are known tell the others. Of a converter with a floor, and of scans that leave grounds or electrodes out, methods that need every
//! reading get them so. The answer is the mean of what is left possible (ridge regression):
//!
//! ```text
//! minimise  sum over known readings (b[g] V - U c)^2 / s^2 + sum c[i]^2 / (t s[i])^2
//! ```
//!
//! with the linear theory's readings `U`, their singular values `s[i]`, the scale `t` at which images give readings as large as those that
//! are known, and the noise `s`. A bound counts where the answer breaks it. Limits: of several firm contacts rows are not linear when
//! balanced, and what is completed is off by some per cent of the largest reading.

use std::borrow::Cow;

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::solve::fit::balance::LEAST_GAP;
use crate::solve::fit::linear::Decomposition;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::readings::{Readings, Says};

/// Rounds in which bounds are judged: after three, what is completed changes by less than noise.
const ROUNDS: usize = 4;
/// Sweeps for the rows' scales.
const SWEEPS: usize = 8;
/// Error of the linear theory, as a share of the largest reading: of two firm contacts a hundredth is left of it.
const LINEAR_ERROR: f64 = 0.01;

/// Completes readings of a detector.
pub(crate) struct Completer {
    /// `electrodes^2 x rank`, orthonormal.
    units: DMatrix<f64>,
    singular_values: Vec<f64>,
    drive_v: f64,
    noise_v: f64,
}

impl Completer {
    /// Makes it ready for a detector.
    pub fn new(jacobian: &Jacobian) -> Self {
        let Decomposition { readings, singular_values, .. } = Decomposition::of(jacobian);
        let (drive_v, noise_v) = (jacobian.detector.drive_v, jacobian.detector.adc.deviation_v());
        Self { units: readings, singular_values, drive_v, noise_v }
    }

    /// Readings that are all voltages: those that are known as they are, the others by them.
    pub fn completed<'a>(&self, readings: &'a Readings) -> Cow<'a, Readings> {
        if readings.all_say().is_empty() || readings.volts().len() != self.units.nrows() {
            return Cow::Borrowed(readings);
        }
        let n = readings.electrodes();
        let readings = &grounded(readings);
        let known = self.known_scales(readings);
        let mut scales: Vec<f64> = known.iter().map(|scale| scale.unwrap_or(1.0)).collect();
        let mut volts: Vec<f64> = (0..n * n).map(|i| readings.touch_v(i / n, i % n)).collect();
        for round in 0..ROUNDS {
            let Some(found) = self.found(readings, &volts, &scales, round == 0) else { break };
            scales = self.scales(&known, &found);
            for (i, volts) in volts.iter_mut().enumerate() {
                let value = (found[i] / scales[i / n]).clamp(-self.drive_v, self.drive_v);
                *volts = match readings.says(i / n, i % n) {
                    Says::Voltage => readings.volts()[i],
                    Says::AtMost => value.min(readings.volts()[i]),
                    Says::AtLeast => value.max(readings.volts()[i]),
                    Says::Nothing => value,
                };
            }
        }
        Cow::Owned(Readings::from_fn(n, |g, e| volts[g * n + e]))
    }

    /// What balancing multiplies each row with, but for a common factor, as far as pairs of readings tell: `r[g][e] D[g] = r[e][g] D[e]`.
    fn known_scales(&self, readings: &Readings) -> Vec<Option<f64>> {
        let n = readings.electrodes();
        let is_pair = |g: usize, e: usize| g != e && [readings.says(g, e), readings.says(e, g)] == [Says::Voltage; 2];
        let log = |g: usize, e: usize| (1.0 - readings.at(g, e) / self.drive_v).max(LEAST_GAP).ln();
        let mut logs: Vec<Option<f64>> = (0..n).map(|g| (0..n).any(|e| is_pair(g, e)).then_some(0.0)).collect();
        for _ in 0..SWEEPS {
            for g in 0..n {
                let others = (0..n).filter(|e| is_pair(g, *e));
                let estimates = others.map(|e| log(e, g) - log(g, e) + logs[e].unwrap_or_default());
                let (sum, count) = estimates.fold((0.0, 0.0), |(sum, count), log| (sum + log, count + 1.0));
                if count > 0.0 {
                    logs[g] = Some(sum / count);
                }
            }
        }
        let found = logs.iter().flatten();
        let mean = found.clone().sum::<f64>() / found.count().max(1) as f64;
        logs.into_iter().map(|log| log.map(|log| (log - mean).exp())).collect()
    }

    /// What balancing multiplies each row with, of all rows, by balanced readings `b`: `b[g][e] - b[e][g] = Vcc (D[g] - D[e])`.
    fn scales(&self, known: &[Option<f64>], balanced_v: &DVector<f64>) -> Vec<f64> {
        let n = known.len();
        let scaled: Vec<(usize, f64)> =
            known.iter().enumerate().filter_map(|(g, scale)| Some((g, (*scale)?))).collect();
        let of = |g: usize| {
            if scaled.is_empty() {
                return 1.0;
            }
            let by = |(e, scale): &(usize, f64)| scale + (balanced_v[g * n + e] - balanced_v[e * n + g]) / self.drive_v;
            (scaled.iter().map(by).sum::<f64>() / scaled.len() as f64).max(LEAST_GAP)
        };
        (0..n).map(|g| known[g].unwrap_or_else(|| of(g))).collect()
    }

    /// Balanced readings by those that are known, and by the bounds that `before` breaks or is at; `None` where nothing is known.
    fn found(&self, readings: &Readings, before: &[f64], scales: &[f64], is_first: bool) -> Option<DVector<f64>> {
        let n = readings.electrodes();
        let counts = |i: usize| match readings.says(i / n, i % n) {
            Says::Voltage => true,
            Says::Nothing => false,
            Says::AtMost => is_first || before[i] >= readings.volts()[i],
            Says::AtLeast => before[i] <= readings.volts()[i],
        };
        let counted: Vec<usize> = (0..n * n).filter(|i| counts(*i)).collect();
        let value = |i: &usize| before[*i] * scales[i / n];
        let values = DVector::from_iterator(counted.len(), counted.iter().map(value));
        let known_v2 = values.norm_squared() / counted.len().max(1) as f64;
        let all_v2: f64 = self.singular_values.iter().map(|value| value * value).sum();
        if known_v2 <= 0.0 || all_v2 <= 0.0 {
            return None;
        }
        let scale2 = known_v2 * (n * n) as f64 / all_v2;
        let noise_v2 = self.noise_v.powi(2) + (LINEAR_ERROR * values.amax()).powi(2);
        let units = self.units.select_rows(&counted);
        let mut normal = units.tr_mul(&units);
        for (i, value) in self.singular_values.iter().enumerate() {
            normal[(i, i)] += noise_v2 / (scale2 * value * value).max(f64::MIN_POSITIVE);
        }
        Some(&self.units * Cholesky::new(normal)?.solve(&units.tr_mul(&values)))
    }
}

/// The readings with what is known without reading it: a grounded electrode is at ground, but for the few millivolts at the switch.
fn grounded(readings: &Readings) -> Readings {
    let is_known = |g: usize, e: usize| g == e && readings.says(g, e) != Says::Voltage;
    let volts = |g: usize, e: usize| if is_known(g, e) { 0.0 } else { readings.at(g, e) };
    let says = |g: usize, e: usize| if is_known(g, e) { Says::Voltage } else { readings.says(g, e) };
    Readings::from_fn(readings.electrodes(), volts).saying(says)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::samples;
    use tactomo_physics::scene::Contact;

    /// Largest error of what is completed, as a share of the largest reading.
    fn error(contact: Contact, says: impl Fn(f64, usize, usize) -> Says, limit_v: f64) -> f64 {
        let exact = samples::readings(contact);
        let known = Readings::from_fn(16, |g, e| exact.at(g, e).max(limit_v)).saying(|g, e| says(exact.at(g, e), g, e));
        let completed = Completer::new(&samples::jacobian(2000)).completed(&known).into_owned();
        let pairs = completed.volts().iter().zip(exact.volts());
        pairs.map(|(found, truth)| (found - truth).abs()).fold(0.0, f64::max) / exact.largest_v()
    }

    #[test]
    fn rows_that_were_not_read_follow_from_four_of_them() {
        let four = |_: f64, g: usize, _: usize| if g.is_multiple_of(5) { Says::Voltage } else { Says::Nothing };
        // Of the lightest, noise hides a tenth.
        for (conductance_s, most) in [(1e-5, 0.12), (2e-4, 0.05), (5e-3, 0.05)] {
            let found = error(Contact { conductance_s, ..samples::CONTACT }, four, 0.0);
            assert!(found < most, "{conductance_s} S: {found}");
        }
    }

    #[test]
    fn what_is_below_a_floor_follows_from_what_is_above() {
        let floor_v = 0.14;
        let below = |volts: f64, _: usize, _: usize| if volts < floor_v { Says::AtMost } else { Says::Voltage };
        for conductance_s in [2e-4, 5e-3] {
            let found = error(Contact { conductance_s, ..samples::CONTACT }, below, floor_v);
            assert!(found < 0.05, "{conductance_s} S: {found}");
        }
    }

    #[test]
    fn where_all_is_below_the_floor_nothing_touches() {
        let rest = Readings::from_fn(16, |_, _| 0.142).saying(|_, _| Says::AtMost);
        let completed = Completer::new(&samples::jacobian(400)).completed(&rest).into_owned();
        assert_eq!(completed, Readings::from_fn(16, |_, _| 0.0));
    }

    #[test]
    fn whole_readings_stay_as_they_are() {
        let readings = samples::readings(samples::CONTACT);
        assert!(matches!(Completer::new(&samples::jacobian(400)).completed(&readings), Cow::Borrowed(_)));
    }
}
