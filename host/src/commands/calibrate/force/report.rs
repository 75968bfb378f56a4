//! What was found, as a table and as JSON.

use std::path::Path;

use serde::Serialize;
use tactomo::calibrate::force::{Candidate, Direction, FittedParameter, ForceFit, ForcePress, Law, MaximumForce};
use tactomo::detector::{ForceLaw, short};

/// A press, and where it was found.
pub struct ReportedPress {
    /// The press.
    pub press: ForcePress,
    /// Where in the file, for people.
    pub place: String,
}

/// The result.
#[derive(Serialize)]
pub struct Report<'a> {
    detector: &'a str,
    out: String,
    law: Law,
    /// `null` where a parameter is not determined.
    parameters: &'a [FittedParameter],
    /// `saturation`, `largest calibrated force` or `not determined`.
    maximum_force: &'static str,
    maximum_force_n: Option<f64>,
    maximum_force_deviation_n: Option<f64>,
    /// By the paper's eq. (8) as it is printed, which does not follow from its eq. (6).
    maximum_force_as_printed_n: Option<f64>,
    /// Smallest and largest force that was calibrated.
    range_n: [f64; 2],
    /// Standard deviation of the logarithm of the conductance.
    scatter: f64,
    /// Half the width between loading and unloading, of the logarithm of the conductance.
    hysteresis: f64,
    /// Presses that do not agree with the others, by their number from 1.
    left_out: Vec<usize>,
    presses: Vec<Row<'a>>,
    candidates: &'a [Candidate],
}

#[derive(Serialize)]
struct Row<'a> {
    place: &'a str,
    force_n: f64,
    direction: Option<Direction>,
    conductance_with_constriction_s: f64,
    sigma_conductance_with_constriction_s: f64,
    /// By the law.
    fitted_force_n: f64,
    fitted_force_deviation_n: f64,
}

impl<'a> Report<'a> {
    /// That of a fit.
    pub fn of(detector: &'a str, out: &Path, presses: &'a [ReportedPress], fit: &'a ForceFit) -> Self {
        let (maximum_force, maximum_force_n, maximum_force_deviation_n) = match fit.maximum {
            MaximumForce::Saturation { force_n, deviation_n } => ("saturation", Some(force_n), Some(deviation_n)),
            MaximumForce::Calibrated { force_n } => ("largest calibrated force", Some(force_n), None),
            MaximumForce::NotDetermined => ("not determined", None, None),
        };
        let is_determined = matches!(fit.maximum, MaximumForce::Saturation { .. });
        Self {
            detector,
            out: out.display().to_string(),
            law: if fit.law.series_ohm.is_some() { Law::Saturating } else { Law::Power },
            parameters: &fit.parameters,
            maximum_force,
            maximum_force_n,
            maximum_force_deviation_n,
            maximum_force_as_printed_n: fit.law.printed_fmax_n().filter(|_| is_determined),
            range_n: fit.law.range_n,
            scatter: fit.law.scatter,
            hysteresis: fit.law.hysteresis,
            left_out: fit.left_out.iter().map(|press| press + 1).collect(),
            presses: presses.iter().map(|press| Row::of(press, &fit.law)).collect(),
            candidates: &fit.candidates,
        }
    }

    /// For people.
    pub fn table(&self) -> String {
        let head = format!("{:>5}  {:<16} {:>9}  {:>21}  {:>17}", "press", "where", "N", "G (S)", "N by the law");
        let rows = self.presses.iter().enumerate().map(|(index, row)| {
            let odd =
                if self.left_out.contains(&(index + 1)) { "  left out: does not agree with the others" } else { "" };
            let conductance = siemens(row.conductance_with_constriction_s, row.sigma_conductance_with_constriction_s);
            let fitted = format!("{} \u{b1} {}", three(row.fitted_force_n), three(row.fitted_force_deviation_n));
            let [number, force] = [(index + 1).to_string(), short(row.force_n)];
            format!("{number:>5}  {:<16} {force:>9}  {conductance:>21}  {fitted:>17}{odd}", row.place)
        });
        let lines = std::iter::once(head).chain(rows).chain([self.law_line()]);
        let lines = lines.chain(self.parameters.iter().map(parameter_line));
        lines
            .chain([
                format!("  maximum force         {}", self.maximum_line()),
                scatter_line(self.scatter, self.hysteresis),
                format!("wrote {}: {} with newtons", self.out, self.detector),
            ])
            .collect::<Vec<_>>()
            .join("\n")
    }

    fn law_line(&self) -> String {
        match self.law {
            Law::Power => "law: G = a F^gamma".to_owned(),
            Law::Saturating => "law: 1/G = 1/(a F^gamma) + R, the paper's eq. (6)".to_owned(),
        }
    }

    fn maximum_line(&self) -> String {
        let [_, largest_n] = self.range_n;
        match (self.maximum_force_n, self.maximum_force_deviation_n) {
            (Some(force_n), Some(error_n)) => {
                format!(
                    "{} \u{b1} {} N, where nine tenths of the saturation are reached",
                    three(force_n),
                    three(error_n)
                )
            }
            (Some(force_n), None) => {
                format!("{} N, the largest of the presses: the conductance does not saturate up to it", short(force_n))
            }
            _ => format!(
                "not determined: contacts are flagged beyond {} N, the largest of the presses",
                short(largest_n)
            ),
        }
    }
}

impl<'a> Row<'a> {
    fn of(reported: &'a ReportedPress, law: &ForceLaw) -> Self {
        let ReportedPress { press, place } = reported;
        let fitted = law.force_n(press.conductance_s, press.deviation_s);
        Self {
            place,
            force_n: press.force_n,
            direction: press.direction,
            conductance_with_constriction_s: press.conductance_s,
            sigma_conductance_with_constriction_s: press.deviation_s,
            fitted_force_n: fitted.force_n,
            fitted_force_deviation_n: fitted.deviation_n,
        }
    }
}

fn parameter_line(parameter: &FittedParameter) -> String {
    let what = match parameter.name {
        "exponent" => "gamma".to_owned(),
        "series_ohm" => "R (ohm)".to_owned(),
        _ => "a (S at 1 N)".to_owned(),
    };
    let value = match (parameter.value, parameter.deviation) {
        (Some(value), Some(error)) => format!("{} \u{b1} {}", three(value), three(error)),
        _ => "not determined".to_owned(),
    };
    format!("  {what:<21} {value}")
}

/// How far presses are from a law, and loading from unloading, in logarithms of the conductance.
pub fn scatter_line(scatter: f64, hysteresis: f64) -> String {
    let per_cent = |share: f64| format!("{:.1} %", 100.0 * share);
    let hysteresis = match hysteresis {
        0.0 => "in the scatter".to_owned(),
        half => format!("{} to either side", per_cent(half)),
    };
    format!("  scatter of presses    {} of the conductance; hysteresis {hysteresis}", per_cent(scatter))
}

/// A conductance with its standard error (S).
pub fn siemens(conductance_s: f64, deviation_s: f64) -> String {
    format!("{conductance_s:.3e} \u{b1} {deviation_s:.0e}")
}

/// A number with three digits.
pub fn three(value: f64) -> String {
    let decade = if value == 0.0 { 0.0 } else { value.abs().log10().floor() };
    match (-3.0..4.0).contains(&decade) {
        true => format!("{value:.*}", (2.0 - decade).max(0.0) as usize),
        false => format!("{value:.2e}"),
    }
}
