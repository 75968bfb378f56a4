//! How strongly a linear image is held down: lambda given, or chosen from the readings of each frame.
//!
//! All ways to choose need the singular values and the readings' coefficients only, so they cost microseconds. With
//! `r = lambda^2 / (s^2 + lambda^2)` the share of a coefficient that is left over, what is left of the readings is
//! `rho = sum (r b)^2 + outside`, and the image has the norm `eta = sum ((1 - r) b / s)^2`.

use crate::solve::answer::Choice;
use tactomo_physics::forward::jacobian::Jacobian;

/// Smallest lambda that is tried, in largest singular values.
const LEAST: f64 = 1e-5;
/// Largest.
const MOST: f64 = 10.0;
/// Lambdas tried in a decade.
const TRIED_IN_A_DECADE: usize = 10;
/// Halvings of the range of lambda for the discrepancy: to 1e-6 of it.
const HALVINGS: usize = 24;

/// How strongly an image is held down.
///
/// ```
/// use tactomo_touch::solve::Lambda;
///
/// assert_eq!("0.03".parse(), Ok(Lambda::default()));
/// assert_eq!("gcv".parse(), Ok(Lambda::Gcv));
/// assert!("-1".parse::<Lambda>().is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Lambda {
    /// A share of the largest singular value: the same meaning for every detector, mesh and drive voltage.
    Relative(f64),
    /// In the unit of the singular values: V m / S for Tikhonov's image.
    Absolute(f64),
    /// `lambda^2` under the paper's scaling: the conductance of each node (S) as unknown, on a mesh of as many nodes, of equal
    /// areas, with a sheet of 1 S and a drive of 2 V; so in V2/S2.
    Paper(f64),
    /// Morozov's discrepancy principle: what is left of the readings is noise, times this factor. The noise is the converter's, or
    /// what of the readings no image can give, whichever is more: that measures the model's error in each frame.
    Discrepancy(f64),
    /// The corner of the L-curve: largest curvature of the norm of the image over what is left of the readings, both in logarithms
    /// (Hansen, "The L-curve and its use in the numerical treatment of inverse problems", 2001).
    LCurve,
    /// Generalised cross validation: least `rho / (readings - sum (1 - r))^2` (Golub, Heath and Wahba, 1979).
    Gcv,
}

impl Lambda {
    /// The paper's `lambda^2`, section II.C.
    pub const PAPER: Self = Self::Paper(5000.0);
}

impl Default for Lambda {
    /// Smallest position error over light and firm contacts with 1.5 LSB of noise, on shell and slab together:
    /// `examples/lambda.rs`.
    fn default() -> Self {
        Self::Relative(0.03)
    }
}

/// A text that is no [`Lambda`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no lambda: a share of the largest singular value above zero, discrepancy, l-curve or gcv is needed")]
pub struct UnknownLambda(pub String);

impl std::str::FromStr for Lambda {
    type Err = UnknownLambda;

    /// A share of the largest singular value, or `discrepancy`, `l-curve`, `gcv`.
    fn from_str(text: &str) -> Result<Self, UnknownLambda> {
        match (text, text.parse::<f64>()) {
            ("discrepancy", _) => Ok(Self::Discrepancy(1.0)),
            ("l-curve", _) => Ok(Self::LCurve),
            ("gcv", _) => Ok(Self::Gcv),
            (_, Ok(share)) if share > 0.0 && share.is_finite() => Ok(Self::Relative(share)),
            _ => Err(UnknownLambda(text.to_owned())),
        }
    }
}

/// The readings of a frame in terms of those that images can give.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum<'a> {
    /// Falling.
    pub singular_values: &'a [f64],
    /// Of the readings, for each of them (V).
    pub coefficients_v: Vec<f64>,
    /// Sum of squares of the readings that no image gives (V2).
    pub outside_v2: f64,
    /// Number of readings.
    pub readings: usize,
    /// Standard deviation of a reading by noise and rounding (V).
    pub noise_v: f64,
}

impl Spectrum<'_> {
    /// Shares of the singular images, and of the readings what is left (V2), for a share kept of each coefficient.
    pub fn filtered(&self, kept: impl Fn(f64) -> f64) -> (Vec<f64>, f64) {
        let mut left_v2 = self.outside_v2;
        let pairs = self.singular_values.iter().zip(&self.coefficients_v);
        let shares = pairs
            .map(|(&value, coefficient_v)| {
                let kept = kept(value);
                left_v2 += ((1.0 - kept) * coefficient_v).powi(2);
                if kept > 0.0 { kept * coefficient_v / value } else { 0.0 }
            })
            .collect();
        (shares, left_v2)
    }

    /// Root mean square of what is left of the readings, in standard deviations of noise.
    pub fn deviations(&self, left_v2: f64) -> f64 {
        (left_v2 / self.readings as f64).sqrt() / self.noise_v
    }

    /// Share of the readings that no image gives, 0 to 1.
    pub fn outside(&self) -> f64 {
        let inside_v2: f64 = self.coefficients_v.iter().map(|value| value * value).sum();
        (self.outside_v2 / (inside_v2 + self.outside_v2).max(f64::MIN_POSITIVE)).sqrt()
    }

    /// What is left of the readings (V2) with a lambda.
    fn left_v2(&self, lambda: f64) -> f64 {
        self.filtered(|value| kept(value, lambda)).1
    }

    /// Square of the noise of a reading (V2), or of what stands for it.
    pub fn noise_v2(&self) -> f64 {
        let free = self.readings.saturating_sub(self.singular_values.len()).max(1);
        (self.outside_v2 / free as f64).max(self.noise_v * self.noise_v)
    }

    /// The lambda that leaves `factor` times the noise, or an end of the range.
    fn by_discrepancy(&self, factor: f64) -> f64 {
        let inside = self.singular_values.len() as f64;
        let target_v2 = self.outside_v2 + factor * factor * inside * self.noise_v2();
        let [mut low, mut high] = self.range().map(f64::ln);
        for _ in 0..HALVINGS {
            let middle = (low + high) / 2.0;
            if self.left_v2(middle.exp()) < target_v2 { low = middle } else { high = middle }
        }
        low.exp()
    }

    /// Curvature of the L-curve at a lambda.
    fn curvature(&self, lambda: f64) -> f64 {
        let (mut rho, mut eta, mut slope) = (self.outside_v2, 0.0, 0.0);
        for (&value, coefficient_v) in self.singular_values.iter().zip(&self.coefficients_v) {
            let kept = kept(value, lambda);
            let norm2 = if value > 0.0 { (kept * coefficient_v / value).powi(2) } else { 0.0 };
            rho += ((1.0 - kept) * coefficient_v).powi(2);
            eta += norm2;
            slope -= 4.0 / lambda * (1.0 - kept) * norm2;
        }
        let square = lambda * lambda;
        let sum = square * slope * rho + 2.0 * lambda * eta * rho + square * square * eta * slope;
        // `rho' = -lambda^2 eta'`, and `eta'` is below zero.
        -2.0 * (eta * rho / slope) * sum / (square * square * eta * eta + rho * rho).powf(1.5)
    }

    /// The function whose least value is generalised cross validation's choice.
    fn cross_validation(&self, lambda: f64) -> f64 {
        let used: f64 = self.singular_values.iter().map(|&value| kept(value, lambda)).sum();
        self.left_v2(lambda) / (self.readings as f64 - used).powi(2)
    }

    /// The lambda, of those tried, at which a function is least.
    fn least(&self, function: impl Fn(f64) -> f64) -> f64 {
        let [low, high] = self.range();
        let steps = TRIED_IN_A_DECADE * (high / low).log10().round() as usize;
        let tried = (0..=steps).map(|step| low * (high / low).powf(step as f64 / steps as f64));
        let values = tried.map(|lambda| (lambda, function(lambda))).filter(|(_, value)| value.is_finite());
        values.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(high, |(lambda, _)| lambda)
    }

    fn range(&self) -> [f64; 2] {
        [LEAST, MOST].map(|share| share * self.largest())
    }

    fn largest(&self) -> f64 {
        self.singular_values.first().copied().unwrap_or_default().max(f64::MIN_POSITIVE)
    }
}

/// The share of a coefficient that Tikhonov's image keeps.
fn kept(value: f64, lambda: f64) -> f64 {
    let square = value * value;
    if square > 0.0 { square / (square + lambda * lambda) } else { 0.0 }
}

impl Lambda {
    /// What a solver does for each frame, on singular values of which the largest is given.
    pub fn rule(self, jacobian: &Jacobian, largest: f64) -> Rule {
        match self {
            Self::Relative(share) => Rule::Given(share * largest),
            Self::Absolute(lambda) => Rule::Given(lambda),
            Self::Paper(squared) => Rule::Given(squared.sqrt() * paper_unit(jacobian)),
            Self::Discrepancy(factor) => Rule::Discrepancy(factor),
            Self::LCurve => Rule::LCurve,
            Self::Gcv => Rule::Gcv,
        }
    }
}

/// How each frame gets its lambda.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rule {
    /// It is this, in the unit of the singular values.
    Given(f64),
    /// [`Lambda::Discrepancy`].
    Discrepancy(f64),
    /// [`Lambda::LCurve`].
    LCurve,
    /// [`Lambda::Gcv`].
    Gcv,
    /// Singular values below this are left out, in place of a lambda.
    Truncated(f64),
}

impl Rule {
    /// The share of a coefficient with such a singular value that an image keeps.
    pub fn kept(self, value: f64, lambda: f64) -> f64 {
        match self {
            Self::Truncated(least) => f64::from(u8::from(value >= least)),
            _ => kept(value, lambda),
        }
    }

    /// The lambda for the readings of a frame.
    pub fn lambda(self, spectrum: &Spectrum) -> f64 {
        match self {
            Self::Given(lambda) | Self::Truncated(lambda) => lambda,
            Self::Discrepancy(factor) => spectrum.by_discrepancy(factor),
            Self::LCurve => spectrum.least(|lambda| -spectrum.curvature(lambda)),
            Self::Gcv => spectrum.least(|lambda| spectrum.cross_validation(lambda)),
        }
    }

    /// What was chosen and why, if the readings chose it.
    pub fn choice(self, spectrum: &Spectrum, lambda: f64, left_v2: f64) -> Option<Choice> {
        let rule = match self {
            Self::Given(_) | Self::Truncated(_) => return None,
            Self::Discrepancy(_) => "discrepancy",
            Self::LCurve => "corner of the L-curve",
            Self::Gcv => "generalised cross validation",
        };
        let [low, high] = spectrum.range();
        let at_an_end =
            if lambda < 1.01 * low || lambda > 0.99 * high { ", an end of the range that is tried" } else { "" };
        Some(Choice {
            what: format!("lambda {:.2e} of the largest singular value", lambda / spectrum.largest()),
            why: format!("{rule}{at_an_end}; it leaves {:.1} deviations of noise", spectrum.deviations(left_v2)),
        })
    }
}

/// What 1 V/S of the paper is here (V m / S): its unknowns are conductances `a c` of nodes with equal areas `a`, so its
/// singular values are ours over `sqrt(a)`; and they are proportional to the drive over the sheet conductance.
fn paper_unit(jacobian: &Jacobian) -> f64 {
    let areas_m2 = &jacobian.image_mesh.node_areas_m2;
    let mean_m2 = areas_m2.iter().sum::<f64>() / areas_m2.len() as f64;
    mean_m2.sqrt() * (jacobian.detector.drive_v / 2.0) / jacobian.detector.sheet_conductance_s()
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALUES: [f64; 4] = [10.0, 3.0, 0.5, 0.01];

    /// Coefficients that fall as the singular values do, and then noise.
    fn spectrum(outside_v2: f64) -> Spectrum<'static> {
        let coefficients_v = vec![1.0, 0.3, 0.05, 0.02];
        Spectrum { singular_values: &VALUES, coefficients_v, outside_v2, readings: 20, noise_v: 0.02 }
    }

    /// Sums as they are defined: the logarithms of what is left and of the image's norm.
    fn logarithms(lambda: f64) -> [f64; 2] {
        let (shares, left_v2) = spectrum(0.001).filtered(|value| kept(value, lambda));
        [left_v2.ln() / 2.0, shares.iter().map(|share| share * share).sum::<f64>().ln() / 2.0]
    }

    #[test]
    fn the_curvature_is_that_of_the_curve() {
        for lambda in [0.02, 0.1, 0.7, 4.0] {
            let step = 1e-3;
            let [before, at, after] = [-step, 0.0, step].map(|step: f64| logarithms(lambda * step.exp()));
            let first = [0, 1].map(|axis| (after[axis] - before[axis]) / (2.0 * step));
            let second = [0, 1].map(|axis| (after[axis] - 2.0 * at[axis] + before[axis]) / (step * step));
            let curvature =
                (first[0] * second[1] - second[0] * first[1]) / (first[0].powi(2) + first[1].powi(2)).powf(1.5);
            let found = spectrum(0.001).curvature(lambda);
            assert!((found - curvature).abs() < 1e-3 * curvature.abs().max(0.1), "{lambda}: {found} {curvature}");
        }
    }

    #[test]
    fn the_discrepancy_leaves_what_it_says() {
        let spectrum = spectrum(16.0 * 0.02 * 0.02);
        let lambda = Rule::Discrepancy(1.0).lambda(&spectrum);
        assert!((spectrum.left_v2(lambda) / (20.0 * 0.02 * 0.02) - 1.0).abs() < 1e-4, "{lambda}");
        // Readings that the model cannot give are noise to it.
        let worse = Rule::Discrepancy(1.0).lambda(&self::spectrum(16.0 * 0.1 * 0.1));
        assert!(worse > 1.5 * lambda, "{worse} {lambda}");
    }

    #[test]
    fn cross_validation_drops_what_is_noise() {
        let noisy = spectrum(16.0 * 0.02 * 0.02);
        let lambda = Rule::Gcv.lambda(&noisy);
        assert!(kept(VALUES[3], lambda) < 0.1 && kept(VALUES[0], lambda) > 0.9, "{lambda}");
        // Nothing is left over: all of it is kept.
        let exact = Spectrum { outside_v2: 1e-12, noise_v: 1e-9, ..spectrum(0.0) };
        assert!(Rule::Gcv.lambda(&exact) < 0.01 * lambda);
    }

    #[test]
    fn every_rule_answers_to_nothing_and_to_much() {
        for coefficients_v in [vec![0.0; 4], vec![1e3; 4], vec![-1e-300; 4]] {
            for outside_v2 in [0.0, 1e6] {
                let spectrum = Spectrum { coefficients_v: coefficients_v.clone(), ..spectrum(outside_v2) };
                for rule in [Rule::Discrepancy(1.0), Rule::LCurve, Rule::Gcv] {
                    let lambda = rule.lambda(&spectrum);
                    assert!((9e-5..=100.1).contains(&lambda), "{rule:?}: {lambda}");
                }
            }
        }
    }

    #[test]
    fn rules_are_read_by_their_names() {
        assert_eq!("0.05".parse(), Ok(Lambda::Relative(0.05)));
        assert_eq!("l-curve".parse(), Ok(Lambda::LCurve));
        for wrong in ["-1", "0", "nan", "inf", "much"] {
            assert!(wrong.parse::<Lambda>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_choice_is_reported_and_a_given_lambda_is_not() {
        let spectrum = spectrum(0.0064);
        let chosen = |rule: Rule| rule.choice(&spectrum, 0.3, spectrum.left_v2(0.3));
        assert_eq!(chosen(Rule::Given(0.3)), None);
        assert_eq!(
            chosen(Rule::Gcv).map(|choice| choice.what),
            Some("lambda 3.00e-2 of the largest singular value".into())
        );
    }
}
