//! The curve of a sensor's output over force, the paper's eq. (6), and its fit.
//!
//! `phi(F) = p1 / (F^p3 + p2)` with `p3 < 0` is a logistic curve in `ln F`: with the saturation `P = p1 / p2`, the exponent `g = -p3` and the
//! force `H = p2^(1 / p3)` of half the saturation, `phi = P / (1 + (H / F)^g)`. It is fitted in `ln P`, `ln H`, `ln g`, which cannot leave what makes
//! sense, by Levenberg and Marquardt's method.
//!
//! What the data leave open is not given as a number. Where the curve is still a power law at the largest force, any saturation above some
//! value fits: it is open unless the power law (`H` to infinity) fits worse by more than chance makes it. Forces far beyond those that were applied
//! are open as well.

use nalgebra::{Matrix3, Vector3};
use tactomo_touch::student::quantile as student_quantile;

/// Share of the saturation at the largest detectable force, eq. (8).
const LARGEST_SHARE: f64 = 0.9;
/// Of a standard normal distribution: 95 % are within.
const BAND_DEVIATIONS: f64 = 1.959_964;
/// A saturation is believed if a power law fits worse by so many standard deviations: one in 2000 power laws bends as much by chance.
const OPEN_DEVIATIONS: f64 = 3.3;
/// A band wider than this factor tells nothing.
const OPEN_FACTOR: f64 = 100.0;
/// A force beyond so many times the largest that was applied is an extrapolation, not a figure: the paper's table II has such ones, 34 975 N from
/// presses of up to 5 N.
const OPEN_TIMES: f64 = 4.0;
/// Steps of the fit at most; it takes 5 to 20.
const STEPS: usize = 100;
/// Exponents and shares of the saturation at the largest output that fits start from.
const START_EXPONENTS: [f64; 2] = [0.7, 1.5];
const START_SHARES: [f64; 3] = [0.95, 0.6, 0.1];
/// Points that a fit needs: one more than it has parameters.
pub const LEAST_POINTS: usize = 4;

/// The paper's eq. (6), in its own parameters.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct OutputCurve {
    /// `p1`: unit of the output times unit of force to the power of `p3`.
    pub p1: f64,
    /// `p2`: unit of force to the power of `p3`.
    pub p2: f64,
    /// `p3`, below zero.
    pub p3: f64,
}

/// A figure with its 95 % band, or what is known of it where the data leave it open.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Figure {
    /// Determined by the data.
    Determined {
        /// Best estimate.
        value: f64,
        /// Lower end of the band.
        low: f64,
        /// Upper end of the band.
        high: f64,
    },
    /// Not determined: above this, how far is open.
    Above(f64),
    /// Not determined at all.
    Open,
}

/// A fitted curve.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Fit {
    /// The best curve. Where figures are open it only describes the data.
    pub curve: OutputCurve,
    /// Saturation `p1 / p2` (unit of the output).
    pub saturation: Figure,
    /// Force of half the saturation.
    pub half_force: Figure,
    /// Exponent `-p3`.
    pub exponent: Figure,
    /// SENS, eq. (7): slope at half of the largest force that was applied.
    pub sensitivity: Figure,
    /// The same at half of FMAX, which "half of the maximum force" can mean as well.
    pub sensitivity_at_half_maximum: Figure,
    /// FMAX: force at nine tenths of the saturation, `(p2 / 9)^(1 / p3)`.
    pub maximum_force: Figure,
    /// Root mean square of what the curve leaves (unit of the output).
    pub residual: f64,
}

impl OutputCurve {
    /// Output at a force.
    pub fn output(&self, force: f64) -> f64 {
        if force > 0.0 { self.p1 / (force.powf(self.p3) + self.p2) } else { 0.0 }
    }

    /// Slope at a force above zero: eq. (7) with the force where its subscript is missing.
    pub fn slope(&self, force: f64) -> f64 {
        -self.p3 * self.p1 * force.powf(self.p3 - 1.0) / (force.powf(self.p3) + self.p2).powi(2)
    }

    /// Force at nine tenths of the saturation: `(p2 / 9)^(1 / p3)`, which follows from (6).
    pub fn maximum_force(&self) -> f64 {
        (self.p2 * (1.0 - LARGEST_SHARE) / LARGEST_SHARE).powf(1.0 / self.p3)
    }

    /// Eq. (8) as printed, `(p2 / 0.9)^(1 / p3)`, which does not follow from (6): for comparison with the paper's numbers.
    pub fn printed_maximum_force(&self) -> f64 {
        (self.p2 / LARGEST_SHARE).powf(1.0 / self.p3)
    }

    fn of(logs: &Vector3<f64>) -> Self {
        let [saturation, half_force, exponent] = [logs[0].exp(), logs[1].exp(), logs[2].exp()];
        let p2 = half_force.powf(-exponent);
        Self { p1: saturation * p2, p2, p3: -exponent }
    }
}

impl Figure {
    /// The number, if it is determined.
    pub fn value(&self) -> Option<f64> {
        match self {
            Self::Determined { value, .. } => Some(*value),
            _ => None,
        }
    }

    /// Whether a number is within the band; `None` where there is none.
    pub fn holds(&self, number: f64) -> Option<bool> {
        match self {
            Self::Determined { low, high, .. } => Some((*low..=*high).contains(&number)),
            _ => None,
        }
    }

    /// In another unit.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        match self {
            Self::Determined { value, low, high } => {
                Self::Determined { value: value * factor, low: low * factor, high: high * factor }
            }
            Self::Above(value) => Self::Above(value * factor),
            Self::Open => Self::Open,
        }
    }

    /// From a logarithm and half the width of its band.
    fn of_log(log: f64, half_width: f64) -> Self {
        let [value, low, high] = [log, log - half_width, log + half_width].map(f64::exp);
        if high < OPEN_FACTOR * low { Self::Determined { value, low, high } } else { Self::Open }
    }
}

/// Fits eq. (6) to outputs over forces; `None` with fewer than [`LEAST_POINTS`] forces above zero, or where no output is above zero.
pub fn fit(points: &[[f64; 2]]) -> Option<Fit> {
    let points: Vec<[f64; 2]> =
        points.iter().copied().filter(|[force, output]| *force > 0.0 && output.is_finite()).collect();
    let largest_force = points.iter().map(|[force, _]| *force).fold(0.0, f64::max);
    let largest = points.iter().map(|[_, output]| *output).fold(0.0, f64::max);
    if points.len() < LEAST_POINTS || largest <= 0.0 {
        return None;
    }
    let starts = START_SHARES.into_iter().flat_map(|share| {
        START_EXPONENTS.map(|exponent: f64| {
            // Where the largest output is `share` of the saturation, half of that is at the largest force over (share / (1 - share))^(1 / g).
            let half_force = largest_force * ((1.0 - share) / share).powf(1.0 / exponent);
            Vector3::new((largest / share).ln(), half_force.ln(), exponent.ln())
        })
    });
    let (logs, squares) = starts.map(|start| descend(&points, start)).min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(figures(&points, logs, squares, largest_force))
}

/// Bands from the covariance of the logarithms, with Student's factor for the noise that is estimated from what the curve leaves.
fn figures(points: &[[f64; 2]], logs: Vector3<f64>, squares: f64, largest_force: f64) -> Fit {
    let curve = OutputCurve::of(&logs);
    let freedom = (points.len() - 3) as f64;
    let factor = student_quantile(BAND_DEVIATIONS, freedom);
    let variance = squares / freedom;
    // Where the outputs do not tell a parameter at all, its band is endless.
    let covariance = normal(points, &logs).0.try_inverse().map(|inverse| inverse * variance);
    let half_width = |direction: Vector3<f64>| {
        let square = covariance.map_or(f64::INFINITY, |covariance| direction.dot(&(covariance * direction)));
        if square >= 0.0 { factor * square.sqrt() } else { f64::INFINITY }
    };
    let of = |log: f64, direction: Vector3<f64>| Figure::of_log(log, half_width(direction));
    let half_force_n = largest_force / 2.0;
    let output = curve.output(half_force_n);
    let share = output / logs[0].exp();
    let exponent = logs[2].exp();
    // ln slope = ln P + ln g + ln s + ln (1 - s) - ln F, with s the share of the saturation, of which d logit = (-g, g ln (F / H)) by ln H and ln g.
    let logit = exponent * (half_force_n.ln() - logs[1]);
    let slope_changes = Vector3::new(1.0, -(1.0 - 2.0 * share) * exponent, 1.0 + (1.0 - 2.0 * share) * logit);
    let nine = (LARGEST_SHARE / (1.0 - LARGEST_SHARE)).ln() / exponent;
    // The same at H 9^(1 / g) / 2, where the share is one of g alone.
    let at_half = 1.0 / (1.0 + (-(nine - 2f64.ln()) * exponent).exp());
    let half_changes = Vector3::new(1.0, -1.0, 1.0 - (1.0 - 2.0 * at_half) * exponent * 2f64.ln() + nine);
    let saturates = bends(points, squares, variance);
    let within = |figure: Figure| match figure {
        Figure::Determined { value, .. } if value > OPEN_TIMES * largest_force => Figure::Above(largest_force),
        figure => figure,
    };
    let if_it_saturates = |figure: Figure, above: f64| if saturates { figure } else { Figure::Above(above) };
    Fit {
        curve,
        saturation: if_it_saturates(of(logs[0], Vector3::x()), curve.output(largest_force)),
        half_force: if_it_saturates(within(of(logs[1], Vector3::y())), largest_force),
        exponent: of(logs[2], Vector3::z()),
        sensitivity: of(curve.slope(half_force_n).ln(), slope_changes),
        sensitivity_at_half_maximum: if_it_saturates(
            of(curve.slope(curve.maximum_force() / 2.0).ln(), half_changes),
            0.0,
        ),
        maximum_force: if_it_saturates(within(of(logs[1] + nine, Vector3::new(0.0, 1.0, -nine))), largest_force),
        residual: (squares / points.len() as f64).sqrt(),
    }
}

/// Whether a power law fits worse than chance allows.
fn bends(points: &[[f64; 2]], squares: f64, variance: f64) -> bool {
    // Two parameters, of which the factor is linear: the exponent by golden section.
    let left = |exponent: f64| {
        let powers: Vec<f64> = points.iter().map(|[force, _]| force.powf(exponent)).collect();
        let factor = powers.iter().zip(points).map(|(power, [_, output])| power * output).sum::<f64>()
            / powers.iter().map(|power| power * power).sum::<f64>();
        powers.iter().zip(points).map(|(power, [_, output])| (output - factor * power).powi(2)).sum::<f64>()
    };
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let [mut low, mut high] = [0.01, 4.0];
    for _ in 0..40 {
        let [a, b] = [high - golden * (high - low), low + golden * (high - low)];
        if left(a) < left(b) { high = b } else { low = a }
    }
    let freedom = (points.len() - 3) as f64;
    left((low + high) / 2.0) - squares > student_quantile(OPEN_DEVIATIONS, freedom).powi(2) * variance
}

/// The fit from one start: logarithms, and the sum of squares that is left.
fn descend(points: &[[f64; 2]], start: Vector3<f64>) -> (Vector3<f64>, f64) {
    let (mut logs, mut damping) = (start, 1e-3);
    let mut squares = left(points, &logs);
    for _ in 0..STEPS {
        let (curvature, slope) = normal(points, &logs);
        let mut damped = curvature;
        (0..3).for_each(|k| damped[(k, k)] = damped[(k, k)] * (1.0 + damping) + f64::MIN_POSITIVE);
        // A step of more than a factor of e at once leaves the region where slopes mean anything.
        let step = damped.try_inverse().map_or(Vector3::zeros(), |inverse| inverse * slope).map(|x| x.clamp(-1.0, 1.0));
        let tried = left(points, &(logs + step));
        if tried < squares {
            let gain = (squares - tried) / squares;
            (logs, squares, damping) = (logs + step, tried, damping * 0.2);
            if gain < 1e-12 {
                break;
            }
        } else {
            damping *= 5.0;
            if damping > 1e12 {
                break;
            }
        }
    }
    (logs, squares)
}

fn left(points: &[[f64; 2]], logs: &Vector3<f64>) -> f64 {
    let squares = points.iter().map(|[force, output]| (output - share(*force, logs) * logs[0].exp()).powi(2)).sum();
    if f64::is_finite(squares) { squares } else { f64::INFINITY }
}

/// Share of the saturation at a force.
fn share(force: f64, logs: &Vector3<f64>) -> f64 {
    1.0 / (1.0 + (-logs[2].exp() * (force.ln() - logs[1])).exp())
}

/// `J'J` and `J'r` of the logarithms.
fn normal(points: &[[f64; 2]], logs: &Vector3<f64>) -> (Matrix3<f64>, Vector3<f64>) {
    let [saturation, exponent] = [logs[0].exp(), logs[2].exp()];
    let mut sums = (Matrix3::zeros(), Vector3::zeros());
    for [force, output] in points {
        let share = share(*force, logs);
        let bend = saturation * share * (1.0 - share) * exponent;
        let slopes = Vector3::new(saturation * share, -bend, bend * (force.ln() - logs[1]));
        sums.0 += slopes * slopes.transpose();
        sums.1 += slopes * (output - saturation * share);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::simulate::Noise;

    fn curve(saturation: f64, half_force: f64, exponent: f64) -> OutputCurve {
        OutputCurve::of(&Vector3::new(saturation.ln(), half_force.ln(), exponent.ln()))
    }

    fn points(of: impl Fn(f64) -> f64, noise: f64, seed: u64) -> Vec<[f64; 2]> {
        let mut random = Noise::new(seed);
        (1..=20).map(|k| f64::from(k) * 0.25).map(|force| [force, of(force) + noise * random.normal()]).collect()
    }

    #[test]
    fn exact_curves_come_back_and_their_figures_follow_from_eq_6() {
        let truth = curve(1.3, 0.8, 0.9);
        let fit = fit(&points(|force| truth.output(force), 0.0, 0)).unwrap();
        assert!((fit.curve.p3 / truth.p3 - 1.0).abs() < 1e-6 && (fit.curve.p2 / truth.p2 - 1.0).abs() < 1e-6);
        let most = fit.maximum_force.value().unwrap();
        assert!((truth.output(most) / 1.3 - 0.9).abs() < 1e-6);
        // The printed form is another force: there the output is 0.9 / 1.9 of the saturation.
        assert!((truth.output(truth.printed_maximum_force()) / 1.3 - 0.9 / 1.9).abs() < 1e-9);
        let step = 1e-5;
        let slope = (truth.output(2.5 + step) - truth.output(2.5 - step)) / (2.0 * step);
        assert!((fit.sensitivity.value().unwrap() / slope - 1.0).abs() < 1e-6);
    }

    /// What the issue of this fit is: bands that hold what is true as often as they say.
    #[test]
    fn known_parameters_are_within_their_bands_in_95_of_100_curves() {
        let mut random = Noise::new(5);
        let mut held = [[0u32; 2]; 6];
        for seed in 0..1000 {
            let [half_force, exponent] = [1.2 * (0.4 * random.normal()).exp(), 1.1 * (0.2 * random.normal()).exp()];
            let truth = curve(1.0, half_force, exponent);
            let Some(fit) = fit(&points(|force| truth.output(force), 0.01, seed)) else { panic!("no fit") };
            let figures = [
                (fit.saturation, 1.0),
                (fit.half_force, half_force),
                (fit.exponent, exponent),
                (fit.sensitivity, truth.slope(2.5)),
                (fit.maximum_force, truth.maximum_force()),
                (fit.sensitivity_at_half_maximum, truth.slope(truth.maximum_force() / 2.0)),
            ];
            for (count, (figure, truth)) in held.iter_mut().zip(figures) {
                let Some(held) = figure.holds(truth) else { continue };
                count[usize::from(held)] += 1;
            }
        }
        for (name, [missed, held]) in ["P", "H", "g", "SENS", "FMAX", "SENS at half FMAX"].iter().zip(held) {
            let share = f64::from(held) / f64::from(held + missed);
            println!("{name}: {held} of {} within", held + missed);
            // Four standard errors of a share of 1000 are 2.8 points.
            assert!(held + missed > 850 && (share - 0.95).abs() < 0.028, "{name}: {share} of {}", held + missed);
        }
    }

    #[test]
    fn a_power_law_has_no_largest_force() {
        for exponent in [0.4, 0.8, 1.3] {
            let numbers = (0..300).filter(|seed| {
                let fit = fit(&points(|force: f64| 0.2 * force.powf(exponent), 0.01, *seed)).unwrap();
                fit.maximum_force.value().is_some() || fit.saturation.value().is_some()
            });
            assert_eq!(numbers.count(), 0, "{exponent}");
        }
        let Figure::Above(force) = fit(&points(|force| 0.1 * force, 0.003, 1)).unwrap().maximum_force else {
            panic!("not open")
        };
        assert_eq!(force, 5.0);
    }

    #[test]
    fn what_is_saturated_everywhere_tells_no_exponent() {
        let fit = fit(&points(|_| 1.0, 0.01, 3)).unwrap();
        assert_eq!(fit.exponent.value().or(fit.maximum_force.value()), None, "{fit:?}");
    }

    #[test]
    fn too_little_is_no_curve() {
        assert_eq!(fit(&[[1.0, 1.0], [2.0, 1.5], [3.0, 1.7]]), None);
        assert_eq!(fit(&[[0.0, 1.0]; 9]), None);
        assert_eq!(fit(&points(|_| -1.0, 0.0, 1)), None);
    }
}
