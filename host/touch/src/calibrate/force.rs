//! From presses of known force to a law from conductance to force.
//!
//! Two laws are fitted, the power law of the paper's eq. (5) and its eq. (6), which saturates: see
//! [`ForceLaw`] for what they say of a conductance. Each is fitted with and without a difference between
//! loading and unloading where presses tell it, by Levenberg's and Marquardt's steps with a share of outliers (`fit`). The law with the
//! lowest Bayesian information criterion is taken: no more law than the presses need. Presses that contradict each other are refused with what to
//! look at (`order`).
//!
//! **No prior for the exponent.** The law of contact says 5/3 under a ball, and even four presses over a decade of force tell it better than that is known of an
//! unknown tip. It was tried on 300 simulated sets each of 3 to 12 presses from 0.5 to 8 N. With 5/3 give or take 0.35 or more nothing changes: half of the
//! forces told by four presses are off by less than 1.9 % with it and without, at a scatter of 5 %. Give or take 0.1, that is 1.8 %, and at a scatter of 15 % 4.8 in place of 5.1 %
//! (of twelve presses 3.0 in place of 3.7 %). But then an ideal surface is told off by 25 to 40 % in place of 2 to 12, and a flat tip by 44 to 50 % in place of 1 to 7.
//!
//! Where the tip and the foam's elasticity are known, the same fit tells the film on the foam (`skin`): the exponent is that of the law of contact then.

mod fit;
mod order;
mod plateaus;
mod skin;
#[cfg(test)]
mod tests;

use tactomo_physics::detector::{FARTHEST, ForceLaw, Problem};
use tactomo_physics::hertz::FORCE_N;
use tactomo_physics::scene::CONDUCTANCE_S;

use self::fit::{Fitted, Form, Known, Point};
pub use self::order::Mistyped;
pub use self::plateaus::{Moment, Plateau, pairs, plateaus};
pub use self::skin::{SkinFit, fit_skin};

/// Fewest presses: two or three parameters and a scatter, of which something is left. Of three, fits are refused in up to six cases of ten.
pub const FEWEST: usize = 4;
/// Largest force over the smallest, at least: with a scatter of 10 %, ten presses then tell the exponent to a tenth or two.
const SPREAD: f64 = 2.0;
/// Largest share of presses that may be left out as outliers.
const LEFT_OUT: f64 = 0.25;
/// Two-sided confidence at which a parameter has to differ from nothing to be determined: 95 %, as a quantile of the normal distribution.
const DETERMINED: f64 = 1.959_964;
/// Quantile of the normal distribution below which 95 % are: bands of 90 %.
const BAND: f64 = 1.644_854;

/// A press of known force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForcePress {
    /// Force (N).
    pub force_n: f64,
    /// Conductance with its constriction (S): what a solver's contacts have as newtons on a detector with
    /// [`ForceLaw::siemens`].
    pub conductance_s: f64,
    /// Its standard error (S); zero where it is not known.
    pub deviation_s: f64,
    /// Whether the force was rising or falling, where that is known.
    pub direction: Option<Direction>,
}

/// Which way the force was going.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// It was rising.
    Loading,
    /// It was falling.
    Unloading,
}

/// A law of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Law {
    /// Eq. (5) without its divider: a power of the force.
    Power,
    /// Eq. (6): it saturates.
    Saturating,
}

/// The largest force that can be measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MaximumForce {
    /// Nine tenths of the saturation are reached at this force.
    Saturation {
        /// Force (N).
        force_n: f64,
        /// Standard error (N).
        deviation_n: f64,
    },
    /// The law does not saturate as far as the presses go: the largest of them.
    Calibrated {
        /// Force (N).
        force_n: f64,
    },
    /// The law saturates somewhere, and the presses do not tell where: a parameter of it may be nothing, at 95 % confidence, or the
    /// maximum is beyond twice the largest press. The paper's sample D has 34975 N from presses of up to 5 N.
    NotDetermined,
}

/// A law that was tried.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Candidate {
    /// Which law.
    pub law: Law,
    /// Whether loading and unloading have curves of their own.
    pub hysteresis: bool,
    /// Bayesian information criterion: -2 ln likelihood + parameters x ln presses; the lowest is the best.
    pub bic: f64,
}

/// A parameter of a law.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct FittedParameter {
    /// Its name in a detector's file, with its unit.
    pub name: &'static str,
    /// Its value; `None` where it is not determined: it may be nothing, at 95 % confidence.
    pub value: Option<f64>,
    /// Its standard error, with the allowance for few presses.
    #[serde(rename = "standard_error")]
    pub deviation: Option<f64>,
}

/// A fitted law.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceFit {
    /// The law, for the detector's file. Its covariance and scatter have Student's allowance for few presses: 1.645 standard errors are bands of 90 %.
    pub law: ForceLaw,
    /// Its parameters.
    pub parameters: Vec<FittedParameter>,
    /// The largest force that can be measured.
    pub maximum: MaximumForce,
    /// Presses that do not agree with the others, by their index: they count for little.
    pub left_out: Vec<usize>,
    /// All that was tried.
    pub candidates: Vec<Candidate>,
}

/// Why presses give no law.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ForceError {
    /// Too few.
    #[error("{found} presses, but {FEWEST} at least are needed; ten with forces from light to firm are good")]
    TooFew {
        /// How many there are.
        found: usize,
    },
    /// Not a press.
    #[error("press {}: {what}", press + 1)]
    Value {
        /// Its index.
        press: usize,
        /// What is wrong.
        what: String,
    },
    /// All alike.
    #[error("the forces go from {} N to {} N only: press with forces that differ {SPREAD} times at least, better ten times", range_n[0], range_n[1])]
    Narrow {
        /// Smallest and largest force (N).
        range_n: [f64; 2],
    },
    /// Conductances that contradict the forces.
    #[error(transparent)]
    Mistyped(#[from] Mistyped),
    /// Too many outliers.
    #[error(
        "presses {} do not agree with the others, which is too many of {count}: press again, one tip, upright, until the scale stands still",
        numbers(presses)
    )]
    Disagree {
        /// Their indices.
        presses: Vec<usize>,
        /// Number of presses.
        count: usize,
    },
    /// No rise.
    #[error(
        "the conductance hardly rises with the force (exponent {exponent:.2} \u{b1} {deviation:.2}): press with forces that differ more, or more often"
    )]
    Flat {
        /// Exponent found.
        exponent: f64,
        /// Its standard error.
        deviation: f64,
    },
    /// No elastic layer.
    #[error(transparent)]
    Skin(#[from] Problem),
    /// The law that is wanted, or any, is open.
    #[error("the presses do not determine a law: press more often, with forces that differ more")]
    Open,
}

/// Numbers of presses for people, from 1.
fn numbers(presses: &[usize]) -> String {
    presses.iter().map(|press| (press + 1).to_string()).collect::<Vec<_>>().join(", ")
}

/// Fits a law to presses: that which they need, or the one that is `wanted`.
///
/// # Errors
/// [`ForceError`] if they tell none; nothing is guessed.
pub fn fit_force(presses: &[ForcePress], wanted: Option<Law>) -> Result<ForceFit, ForceError> {
    let tried = rising(presses)?;
    let candidates = tried.iter().map(Fitted::candidate).collect();
    // Of itself no law is taken whose exponent is open: it has more parameters than the presses tell.
    let is_taken = |fit: &&Fitted| match wanted {
        Some(law) => fit.form().law == law,
        None => is_determined(fit.exponent(), fit.freedom()),
    };
    let best = tried.iter().find(is_taken).ok_or(ForceError::Open)?;
    let left_out = left_out(presses, best)?;
    let (law, maximum) = law_of(best, presses, &left_out);
    Ok(ForceFit { law, parameters: parameters(best), maximum, left_out, candidates })
}

/// Fits all forms, whatever the exponent, to presses whose conductance rises with the force; the likeliest first.
fn rising(presses: &[ForcePress]) -> Result<Vec<Fitted>, ForceError> {
    check(presses)?;
    order::check(presses)?;
    let tried = tried(presses, None);
    check_rise(&tried)?;
    Ok(tried)
}

/// All forms fitted to presses, with what is known; the likeliest first.
fn tried(presses: &[ForcePress], known: Option<Known>) -> Vec<Fitted> {
    let points: Vec<Point> = presses.iter().map(Point::of).collect();
    let mut tried: Vec<Fitted> = forms(presses, known).filter_map(|form| fit::fit(&points, form)).collect();
    tried.sort_by(|a, b| a.bic.total_cmp(&b.bic));
    tried
}

/// Presses that do not agree with the others, if they are not too many.
fn left_out(presses: &[ForcePress], best: &Fitted) -> Result<Vec<usize>, ForceError> {
    let left_out = best.outliers();
    if left_out.len() > 1 {
        order::check_exchange(presses, &left_out, best)?;
    }
    if left_out.len() as f64 > LEFT_OUT * presses.len() as f64 {
        return Err(ForceError::Disagree { presses: left_out, count: presses.len() });
    }
    Ok(left_out)
}

/// Whether a value differs from nothing, with its standard error and so many degrees of freedom.
fn is_determined([value, deviation]: [f64; 2], freedom: f64) -> bool {
    value > crate::student::quantile(DETERMINED, freedom) * deviation
}

/// Checks that the conductance rises with the force: as the best power law says, whatever else may be.
fn check_rise(tried: &[Fitted]) -> Result<(), ForceError> {
    let power = tried.iter().find(|fit| fit.form().law == Law::Power).ok_or(ForceError::Open)?;
    let [exponent, deviation] = power.exponent();
    match is_determined([exponent, deviation], power.freedom()) {
        true => Ok(()),
        false => Err(ForceError::Flat { exponent, deviation }),
    }
}

/// The parameters with their standard errors, and no number where a parameter is open.
fn parameters(best: &Fitted) -> Vec<FittedParameter> {
    let freedom = best.freedom();
    let parameter = |name, value: [f64; 2]| FittedParameter {
        name,
        value: is_determined(value, freedom).then_some(value[0]),
        deviation: is_determined(value, freedom).then_some(widening(freedom) * value[1]),
    };
    let known = [("conductance_at_1_n_s", best.conductance_at_1_n_s()), ("exponent", best.exponent())];
    let series = best.series().map(|series| parameter("series_ohm", series));
    known.map(|(name, value)| parameter(name, value)).into_iter().chain(series).collect()
}

fn check(presses: &[ForcePress]) -> Result<(), ForceError> {
    for (index, press) in presses.iter().enumerate() {
        let wrong = |what: String| Err(ForceError::Value { press: index, what });
        for (what, value, unit, range) in
            [("force", press.force_n, "N", FORCE_N), ("conductance", press.conductance_s, "S", CONDUCTANCE_S)]
        {
            if !range.contains(&value) {
                let (low, high) = (range.start(), range.end());
                return wrong(format!("its {what} is {value:?} {unit}, but has to be from {low:?} to {high:?} {unit}"));
            }
        }
        if !(0.0..=*CONDUCTANCE_S.end()).contains(&press.deviation_s) {
            return wrong(format!(
                "its conductance's deviation is {:?} S, but has to be zero or more",
                press.deviation_s
            ));
        }
    }
    if presses.len() < FEWEST {
        return Err(ForceError::TooFew { found: presses.len() });
    }
    let range_n = range_n(presses.iter());
    if range_n[1] < SPREAD * range_n[0] { Err(ForceError::Narrow { range_n }) } else { Ok(()) }
}

/// Smallest and largest force (N).
fn range_n<'a>(presses: impl Iterator<Item = &'a ForcePress>) -> [f64; 2] {
    presses.fold([f64::INFINITY, 0.0], |[low, high]: [f64; 2], press| [low.min(press.force_n), high.max(press.force_n)])
}

/// What to try: two curves only where both were pressed twice, and a constriction always where it is known.
fn forms(presses: &[ForcePress], known: Option<Known>) -> impl Iterator<Item = Form> {
    let count = |of: Direction| presses.iter().filter(|press| press.direction == Some(of)).count();
    let both = count(Direction::Loading).min(count(Direction::Unloading)) > 1;
    let laws = [Law::Power, Law::Saturating].into_iter();
    laws.flat_map(move |law| [false, true].map(|hysteresis| Form { law, hysteresis, known }))
        .filter(move |form| (both || !form.hysteresis) && (known.is_none() || form.law == Law::Saturating))
}

/// Student's allowance: so much wider are bands of 90 % by a scatter that is known with so many degrees of freedom.
fn widening(freedom: f64) -> f64 {
    crate::student::quantile(BAND, freedom) / BAND
}

/// The law of a fit, and its maximum.
fn law_of(best: &Fitted, presses: &[ForcePress], left_out: &[usize]) -> (ForceLaw, MaximumForce) {
    let freedom = best.freedom();
    let widening = widening(freedom);
    let kept = presses.iter().enumerate().filter(|(index, _)| !left_out.contains(index)).map(|(_, press)| press);
    let mut law = ForceLaw {
        conductance_at_1_n_s: best.conductance_at_1_n_s()[0],
        exponent: best.exponent()[0],
        series_ohm: best.series().map(|[ohm, _]| ohm),
        covariance: best.covariance(widening * widening),
        scatter: widening * best.scatter(),
        hysteresis: best.hysteresis(),
        range_n: range_n(kept),
        maximum_n: None,
        presses: presses.len() - left_out.len(),
    };
    let maximum = match best.series() {
        None => MaximumForce::Calibrated { force_n: law.range_n[1] },
        Some(series) if !(is_determined(series, freedom) && is_determined(best.exponent(), freedom)) => {
            MaximumForce::NotDetermined
        }
        Some(_) => match law.fmax_n().zip(law.fmax_deviation_n()) {
            Some((force_n, deviation_n)) if force_n < FARTHEST * law.range_n[1] => {
                MaximumForce::Saturation { force_n, deviation_n }
            }
            _ => MaximumForce::NotDetermined,
        },
    };
    if let MaximumForce::Saturation { force_n, .. } = maximum {
        law.maximum_n = Some(force_n);
    }
    (law, maximum)
}
