//! Newtons from the conductance of a contact: the law that `tactomo calibrate force` finds for one detector and one tip.
//!
//! **Derivation.** The paper's eqs. (2) and (3) make a contact's own conductance `sigma S_c / l` a power of the force, `a F^gamma` (its
//! eq. (5) hides `sigma / l` in `a`). Its eqs. (4) to (6) put that in series with the detector's volume resistance `R0` and look at
//! the voltage between the two, `phi = Vcc R0 a F^gamma / (1 + R0 a F^gamma)`, which saturates at `Vcc`. Here the detector is in the model of
//! the solver, and with it all of `R0` that depends on the place. What is left of a contact is its conductance `G` with the constriction of
//! the current right under it, which readings tell far better than the contact's own (`tactomo_touch::solve` measures it): the
//! same everywhere. With that constriction, and whatever else is in series and not in the model, as one resistance `R`,
//!
//! ```text
//! 1 / G = 1 / (a F^gamma) + R,   G = a / (F^-gamma + a R) = p1 / (F^p3 + p2),
//! ```
//!
//! with `p1 = a`, `p2 = a R`, `p3 = -gamma`: eq. (6), of a conductance instead of a voltage. It saturates at `p1 / p2 = 1 / R`; nine tenths of
//! that are reached where `a R F^gamma = 9`, so
//!
//! ```text
//! FMAX = (9 / (a R))^(1 / gamma) = (p2 / 9)^(1 / p3).
//! ```
//!
//! The paper prints `(p2 / 0.9)^(1 / p3)` as eq. (8), which does not follow from its eq. (6): see [`ForceLaw::printed_fmax_n`]. Without `R` it is the
//! power law of eq. (5), `G = a F^gamma`.
//!
//! The constriction is no constant: by Hertz a ball's radius of contact grows as `F^(1/3)`, so of `1 / G` one part falls as `F^(-2/3)`, the
//! contact's own on an ideal surface, or as `F^(-5/3)` on a [film](crate::hertz::Surface), and one as `F^(-1/3)`, the constriction. Exponents that
//! are found are therefore between the two; over two decades of force eq. (6) follows the sum of `-2/3` and `-1/3` to 1 %.

use std::fmt::{self, Write as _};
use std::ops::RangeInclusive;

use super::check::{Problem, within};
use super::svg::short;

/// Share of the saturation at which a force is the largest that can be measured: eq. (8).
const SATURATED_SHARE: f64 = 0.9;
/// Forces beyond the maximum are given up to so many times the maximum, and held there, and no maximum is given that is so many times the largest
/// press: a law says little of what it never saw.
pub const FARTHEST: f64 = 2.0;

const CONDUCTANCE_S: RangeInclusive<f64> = 1e-12..=1e6;
/// Of Hertz's theory are 1/2 (a cylinder) and 2/3 (a ball) on an ideal surface, 2 and 5/3 on a film that the pressure makes conduct; foams that stiffen or yield, and
/// rough tips, are around that.
const EXPONENT: RangeInclusive<f64> = 1e-2..=10.0;
const SERIES_OHM: RangeInclusive<f64> = 1e-9..=1e9;
const FORCE_N: RangeInclusive<f64> = 1e-6..=1e6;
/// Of the logarithm of a conductance: more than a factor of `e^10` is no law.
const DEVIATION: RangeInclusive<f64> = 0.0..=10.0;

/// How the conductance of a contact, with its constriction, follows the force, for the tip that was calibrated.
///
/// Parameters are `ln a`, `gamma` and, of a law that saturates, `R`; their covariance is in that order.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForceLaw {
    /// `a`: conductance of a contact that is pressed with 1 N, but for the resistance in series (S).
    pub conductance_at_1_n_s: f64,
    /// `gamma`.
    pub exponent: f64,
    /// `R`: constriction, and what else is in series (ohm); `None` for the power law, which does not saturate.
    pub series_ohm: Option<f64>,
    /// Covariance of the parameters, a row each: 2 x 2, or 3 x 3 of a law that saturates.
    pub covariance: Vec<Vec<f64>>,
    /// Standard deviation of the logarithm of a contact's conductance about the law, from press to press.
    pub scatter: f64,
    /// Half the width between the curves of loading and unloading, as a logarithm of the conductance (a share, while it is small); 0
    /// where they were not distinguished: then it is in the scatter.
    pub hysteresis: f64,
    /// Smallest and largest force that was calibrated (N).
    pub range_n: [f64; 2],
    /// Largest force that can be measured (N), where the law saturates and the presses determine it.
    pub maximum_n: Option<f64>,
    /// Presses that it was fitted to.
    pub presses: usize,
}

/// A force with its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Newtons {
    /// Force (N).
    pub force_n: f64,
    /// Standard error: parameters, scatter, hysteresis and conductance together (N).
    pub deviation_n: f64,
    /// The force is beyond the largest that can be measured.
    pub beyond_maximum: bool,
}

impl ForceLaw {
    /// The law by which a contact of one siemens is pressed with one newton, exactly: where conductances themselves are wanted, to find
    /// another law from them.
    pub fn siemens() -> Self {
        Self {
            conductance_at_1_n_s: 1.0,
            exponent: 1.0,
            series_ohm: None,
            covariance: vec![vec![0.0; 2]; 2],
            scatter: 0.0,
            hysteresis: 0.0,
            range_n: [*FORCE_N.start(), *FORCE_N.end()],
            maximum_n: None,
            presses: 0,
        }
    }

    /// Force under a contact of such a conductance with its constriction, of which `deviation_s` is the standard error (S); zero where that is not
    /// known.
    ///
    /// The error of the conductance that a force should have is that of the contact itself, scatter, hysteresis, and the parameters' through
    /// their slopes (the delta method). What that is in newtons is the difference to the force under a contact that conducts so much
    /// better: near saturation, where the law is steep, forces may be much larger than given, but not much smaller.
    pub fn force_n(&self, conductance_s: f64, deviation_s: f64) -> Newtons {
        if conductance_s <= 0.0 {
            // No contact conducts less than nothing; as much as its error may be there.
            let deviation_n = if deviation_s > 0.0 { self.held_force_n(deviation_s) } else { 0.0 };
            return Newtons { force_n: 0.0, deviation_n, beyond_maximum: false };
        }
        let force_n = self.held_force_n(conductance_s);
        let own = (deviation_s / conductance_s).powi(2) + self.scatter.powi(2) + self.hysteresis.powi(2);
        let share = (own + self.quadratic(&self.slopes(force_n))).max(0.0).sqrt();
        // Where more is held too, less tells how steep the law is.
        let held_s = conductance_s.min(self.conductance_s(force_n));
        let more_n = self.held_force_n(held_s * (1.0 + share)) - force_n;
        let less_n = force_n - self.held_force_n(held_s / (1.0 + share));
        let beyond_maximum = conductance_s > self.conductance_s(self.limit_n());
        Newtons { force_n, deviation_n: more_n.max(less_n), beyond_maximum }
    }

    /// Conductance, with its constriction, of a contact that is pressed with such a force (S).
    pub fn conductance_s(&self, force_n: f64) -> f64 {
        let own_s = self.conductance_at_1_n_s * force_n.powf(self.exponent);
        own_s / (1.0 + own_s * self.series_ohm.unwrap_or(0.0))
    }

    /// The force beyond which contacts are flagged (N): the largest that can be measured, or else the largest that was calibrated.
    pub fn limit_n(&self) -> f64 {
        self.maximum_n.unwrap_or(self.range_n[1])
    }

    /// The largest force that is told (N), some way beyond that.
    pub fn farthest_n(&self) -> f64 {
        FARTHEST * self.limit_n()
    }

    /// `FMAX` (N), where nine tenths of the saturation are reached; `None` of a law that does not saturate.
    pub fn fmax_n(&self) -> Option<f64> {
        self.fmax_with_n(SATURATED_SHARE / (1.0 - SATURATED_SHARE))
    }

    /// Standard error of [`fmax_n`](Self::fmax_n) (N).
    pub fn fmax_deviation_n(&self) -> Option<f64> {
        let (fmax_n, series_ohm) = (self.fmax_n()?, self.series_ohm?);
        let slopes = [-1.0, -fmax_n.ln(), -1.0 / series_ohm].map(|slope| slope / self.exponent);
        Some(fmax_n * self.quadratic(&slopes).max(0.0).sqrt())
    }

    /// The maximum force as the paper prints it, `(p2 / 0.9)^(1 / p3)` (N): for comparison with its table II only.
    pub fn printed_fmax_n(&self) -> Option<f64> {
        self.fmax_with_n(SATURATED_SHARE)
    }

    /// Standard error of each parameter.
    pub fn parameter_deviations(&self) -> Vec<f64> {
        self.covariance.iter().enumerate().map(|(k, row)| row[k].max(0.0).sqrt()).collect()
    }

    /// Checks the numbers of a law that was read.
    ///
    /// # Errors
    /// The first [`Problem`] found, with its field.
    pub fn check(&self) -> Result<(), Problem> {
        within("force.conductance_at_1_n_s", self.conductance_at_1_n_s, CONDUCTANCE_S)?;
        within("force.exponent", self.exponent, EXPONENT)?;
        if let Some(series_ohm) = self.series_ohm {
            within("force.series_ohm", series_ohm, SERIES_OHM)?;
        }
        within("force.scatter", self.scatter, DEVIATION)?;
        within("force.hysteresis", self.hysteresis, DEVIATION)?;
        within("force.range_n[0]", self.range_n[0], FORCE_N)?;
        within("force.range_n[1]", self.range_n[1], self.range_n[0]..=*FORCE_N.end())?;
        if let Some(maximum_n) = self.maximum_n {
            within("force.maximum_n", maximum_n, FORCE_N)?;
        }
        self.check_covariance()
    }

    /// As the table `[force]` of a detector's file, with the standard errors beside the parameters.
    pub(super) fn write_toml(&self, text: &mut String) -> fmt::Result {
        let deviations = self.parameter_deviations();
        let error = |k: usize, factor: f64| short(deviations.get(k).map_or(0.0, |deviation| deviation * factor));
        let a_s = self.conductance_at_1_n_s;
        writeln!(text, "\n[force]\nconductance_at_1_n_s = {a_s:?} # standard error {}", error(0, a_s))?;
        writeln!(text, "exponent = {:?} # standard error {}", self.exponent, error(1, 1.0))?;
        if let Some(series_ohm) = self.series_ohm {
            writeln!(text, "series_ohm = {series_ohm:?} # standard error {}", error(2, 1.0))?;
        }
        writeln!(text, "covariance = {:?}", self.covariance)?;
        writeln!(text, "scatter = {:?}\nhysteresis = {:?}", self.scatter, self.hysteresis)?;
        writeln!(text, "range_n = {:?}", self.range_n)?;
        if let Some(maximum_n) = self.maximum_n {
            writeln!(text, "maximum_n = {maximum_n:?}")?;
        }
        writeln!(text, "presses = {}", self.presses)
    }

    fn check_covariance(&self) -> Result<(), Problem> {
        let wrong = |what: &str| Err(Problem::new("force.covariance", what));
        let size = if self.series_ohm.is_some() { 3 } else { 2 };
        if self.covariance.len() != size || self.covariance.iter().any(|row| row.len() != size) {
            return wrong("has to have a row and a column for each parameter: 2, or 3 with series_ohm");
        }
        let at = |i: usize, j: usize| self.covariance[i][j];
        let pairs = || (0..size).flat_map(|i| (0..size).map(move |j| (i, j)));
        if pairs().any(|(i, j)| !at(i, j).is_finite() || (at(i, j) - at(j, i)).abs() > 1e-9 * at(i, j).abs()) {
            return wrong("has to be finite and symmetric");
        }
        if pairs().any(|(i, j)| at(i, i) < 0.0 || at(i, j).powi(2) > at(i, i) * at(j, j) * (1.0 + 1e-9)) {
            return wrong("has to have variances of zero or more, and no correlation above 1");
        }
        Ok(())
    }

    /// The force at which `a R F^gamma` is so much.
    fn fmax_with_n(&self, product: f64) -> Option<f64> {
        let series_ohm = self.series_ohm?;
        Some((product / (self.conductance_at_1_n_s * series_ohm)).powf(self.exponent.recip()))
    }

    /// The force by the law, held at the farthest that is given (N).
    fn held_force_n(&self, conductance_s: f64) -> f64 {
        let held_s = conductance_s.min(self.conductance_s(self.farthest_n()));
        let own_s = held_s / (1.0 - held_s * self.series_ohm.unwrap_or(0.0));
        (own_s / self.conductance_at_1_n_s).powf(self.exponent.recip())
    }

    /// `d ln S` by the parameters.
    fn slopes(&self, force_n: f64) -> [f64; 3] {
        let conductance_s = self.conductance_s(force_n);
        let own = 1.0 - conductance_s * self.series_ohm.unwrap_or(0.0);
        [own, own * force_n.ln(), -conductance_s]
    }

    /// Variance of what has such slopes by the parameters.
    fn quadratic(&self, slopes: &[f64; 3]) -> f64 {
        let row = |(row, slope): (&Vec<f64>, &f64)| slope * row.iter().zip(slopes).map(|(of, by)| of * by).sum::<f64>();
        self.covariance.iter().zip(slopes).map(row).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn power() -> ForceLaw {
        ForceLaw {
            conductance_at_1_n_s: 2e-3,
            exponent: 0.5,
            series_ohm: None,
            covariance: vec![vec![4e-4, 0.0], vec![0.0, 9e-4]],
            scatter: 0.03,
            hysteresis: 0.04,
            range_n: [0.5, 9.0],
            maximum_n: None,
            presses: 10,
        }
    }

    fn saturating() -> ForceLaw {
        ForceLaw {
            series_ohm: Some(100.0),
            covariance: vec![vec![4e-4, 1e-5, 1e-2], vec![1e-5, 9e-4, -1e-2], vec![1e-2, -1e-2, 4.0]],
            ..power()
        }
    }

    #[test]
    fn a_power_law_by_hand() {
        // S = 2 mS sqrt(F): 4 mS at 4 N. Share of its error: 0.05 of its own, 0.03 and 0.04 about the law, 0.02 by a, ln 4 x 0.03 by the exponent.
        let found = power().force_n(4e-3, 2e-4);
        let share = (5e-3 + 4e-4 + (4f64.ln() * 0.03).powi(2)).sqrt();
        let more_n = 4.0 * ((1.0 + share).powi(2) - 1.0);
        assert!((found.force_n - 4.0).abs() < 1e-12 && (found.deviation_n - more_n).abs() < 1e-12, "{found:?}");
        assert!(!found.beyond_maximum);
    }

    #[test]
    fn eq_6_and_its_maximum_by_hand() {
        let law = saturating();
        // p1 = 2e-3, p2 = 0.2, p3 = -0.5: at 4 N 2e-3 / (0.5 + 0.2).
        assert!((law.conductance_s(4.0) - 2e-3 / 0.7).abs() < 1e-15);
        assert!((law.force_n(2e-3 / 0.7, 0.0).force_n - 4.0).abs() < 1e-12);
        // (p2 / 9)^(1 / p3) = (9 / 0.2)^2, where 0.9 of 1 / R conduct; as printed (0.9 / 0.2)^2, where 0.47 do.
        let fmax_n = law.fmax_n().unwrap();
        assert!((fmax_n - 2025.0).abs() < 1e-9 && (law.conductance_s(fmax_n) * 100.0 - 0.9).abs() < 1e-12);
        assert!((law.printed_fmax_n().unwrap() - 20.25).abs() < 1e-9);
        assert_eq!((power().fmax_n(), power().fmax_deviation_n(), power().printed_fmax_n()), (None, None, None));
    }

    /// A law with its parameters `ln a`, `gamma` and `R` moved.
    fn moved(law: &ForceLaw, by: [f64; 3]) -> ForceLaw {
        ForceLaw {
            conductance_at_1_n_s: law.conductance_at_1_n_s * by[0].exp(),
            exponent: law.exponent + by[1],
            series_ohm: law.series_ohm.map(|ohm| ohm + by[2]),
            ..law.clone()
        }
    }

    #[test]
    fn standard_errors_are_those_of_differences() {
        let law = saturating();
        let steps = [1e-6, 1e-6, 1e-4];
        let slopes = |of: &dyn Fn(&ForceLaw) -> f64| -> [f64; 3] {
            std::array::from_fn(|k| {
                let step = |sign: f64| moved(&law, std::array::from_fn(|j| if j == k { sign * steps[k] } else { 0.0 }));
                (of(&step(1.0)) - of(&step(-1.0))) / (2.0 * steps[k])
            })
        };
        let found = law.slopes(5.0);
        let expected = slopes(&|law| law.conductance_s(5.0).ln());
        assert!((0..3).all(|k| (found[k] - expected[k]).abs() < 1e-6 * expected[k].abs()), "{found:?} {expected:?}");
        let of_maximum = law.quadratic(&slopes(&|law| law.fmax_n().unwrap())).sqrt();
        assert!((law.fmax_deviation_n().unwrap() / of_maximum - 1.0).abs() < 1e-6);
    }

    #[test]
    fn beyond_the_maximum_forces_are_flagged_and_held() {
        for (law, limit_n) in [
            (power(), 9.0),
            (saturating(), 9.0),
            (ForceLaw { maximum_n: Some(5.0), ..saturating() }, 5.0),
            (ForceLaw { maximum_n: Some(20.0), ..power() }, 20.0),
        ] {
            let at = |force_n: f64| law.force_n(law.conductance_s(force_n), 0.0);
            assert!(!at(0.999 * limit_n).beyond_maximum && at(1.001 * limit_n).beyond_maximum, "{limit_n}");
            assert!((at(1.5 * limit_n).force_n / limit_n - 1.5).abs() < 1e-9);
            for conductance_s in [0.5, 1e3, 1e19] {
                let found = law.force_n(conductance_s, 0.1 * conductance_s);
                assert!((found.force_n / limit_n - 2.0).abs() < 1e-9 && found.beyond_maximum, "{found:?}");
                assert!(found.deviation_n > 0.1 * found.force_n && found.deviation_n < found.force_n, "{found:?}");
            }
        }
    }

    #[test]
    fn what_does_not_conduct_is_not_pressed() {
        let none = power().force_n(-1e-4, 2e-3);
        assert_eq!((none.force_n, none.beyond_maximum), (0.0, false));
        assert!((none.deviation_n - 1.0).abs() < 1e-12, "as much as its error is");
        assert_eq!(power().force_n(0.0, 0.0), Newtons::default());
    }

    #[test]
    fn wrong_numbers_are_named() {
        assert_eq!((power().check(), saturating().check()), (Ok(()), Ok(())));
        let problem = |spoil: fn(&mut ForceLaw)| {
            let mut law = saturating();
            spoil(&mut law);
            law.check().unwrap_err().to_string()
        };
        assert!(problem(|law| law.exponent = -0.5).starts_with("force.exponent is -0.5"));
        assert!(problem(|law| law.conductance_at_1_n_s = f64::NAN).starts_with("force.conductance_at_1_n_s is NaN"));
        assert!(problem(|law| law.series_ohm = Some(0.0)).starts_with("force.series_ohm is 0.0"));
        assert!(problem(|law| law.series_ohm = None).contains("2, or 3 with series_ohm"));
        assert!(problem(|law| law.range_n = [2.0, 1.0]).starts_with("force.range_n[1] is 1.0, but has to be from 2.0"));
        assert!(problem(|law| law.maximum_n = Some(1e19)).starts_with("force.maximum_n is 1e19"));
        assert!(problem(|law| law.covariance[0][1] = 1.0).contains("symmetric"));
        assert!(problem(|law| law.covariance[2][2] = 1e-9).contains("no correlation above 1"));
        assert!(problem(|law| law.scatter = f64::INFINITY).starts_with("force.scatter is inf"));
    }
}
