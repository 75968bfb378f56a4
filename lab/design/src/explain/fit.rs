//! How near a law comes to the paper's table II, and the parameters that come nearest.
//!
//! Errors are logarithms of factors. The unit of SENS is unknown ("reconstructed value"), so one factor for all samples is taken off: the median of the
//! samples that a law is fitted to. A maximum force that the paper's own fit did not find (D and DA) counts as right from [`FAILED_N`] on.

use super::super::rank::{chance, mean, median, spearman};
use super::super::samples::FAILED_N;
use super::Eighth;
use super::bench::{Bench, Curve};
use super::laws::Law;

/// An error counts as this at most: 3 is a factor of 20.
const MOST: f64 = 3.0;
/// What a sample counts that conducts nothing.
const NOTHING: f64 = 2.0 * MOST;
/// The search for parameters: its first step in logarithms and exponents, and its last.
const STEPS: [f64; 2] = [0.5, 0.004];

/// A law with parameters, and what it leaves.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Judged {
    /// Logarithms of its parameters.
    pub parameters: Vec<f64>,
    /// Of SENS: mV of the paper for a share of 1 of the drive.
    pub unit_mv: f64,
    /// Errors of SENS and of FMAX, for each sample; `None` where it conducts nothing.
    pub errors: Vec<Option<[f64; 2]>>,
    /// Factors that SENS and FMAX are off by, root mean square of the logarithm over the samples that it was not fitted to.
    pub left: [Option<f64>; 2],
    /// Rank correlation over all samples of what it says with what was measured, and how likely one so strong is by chance: of SENS and FMAX.
    pub order: [Option<[f64; 2]>; 2],
}

/// Fits a law to some of the samples, and judges it by all.
pub fn fitted(law: &Law, benches: &[Bench], fit_to: impl Fn(usize) -> bool + Copy, eighth: Eighth) -> Judged {
    let cost = |parameters: &[f64]| cost(law, benches, parameters, fit_to, eighth);
    let found = law.starts.iter().map(|start| descend(cost, start.to_vec())).min_by(|a, b| a.1.total_cmp(&b.1));
    let parameters = found.map(|(parameters, _)| parameters).unwrap_or_default();
    judged(law, benches, parameters, fit_to, eighth)
}

/// The factor that SENS is off by, and FMAX.
fn errors(bench: &Bench, curve: &Curve) -> [f64; 2] {
    let sensitivity = (curve.sensitivity / bench.measured.sensitivity_mv_per_n).ln();
    let maximum = match bench.measured.maximum_n {
        Some(measured_n) => (curve.maximum_n / measured_n).ln(),
        None => (curve.maximum_n / FAILED_N).ln().min(0.0),
    };
    [sensitivity, maximum]
}

/// The curves of some samples and their errors, the unit of SENS still in them; `None` of others, and where one conducts nothing.
fn told(
    law: &Law,
    benches: &[Bench],
    parameters: &[f64],
    of: impl Fn(usize) -> bool,
    eighth: Eighth,
) -> Vec<Option<(Curve, [f64; 2])>> {
    let one = |(at, bench): (usize, &Bench)| {
        let curve = of(at).then(|| bench.curve(|force_n| (law.contact)(bench, parameters, force_n), eighth));
        curve.flatten().map(|curve| (curve, errors(bench, &curve)))
    };
    benches.iter().enumerate().map(one).collect()
}

/// The logarithm of the unit of SENS: the median of the errors of some samples.
fn unit(told: &[Option<(Curve, [f64; 2])>], of: impl Fn(usize) -> bool) -> f64 {
    let counted = told.iter().enumerate().filter(|(at, _)| of(*at));
    median(counted.filter_map(|(_, one)| one.map(|(_, errors)| errors[0])).collect()).unwrap_or(0.0)
}

fn cost(
    law: &Law,
    benches: &[Bench],
    parameters: &[f64],
    fit_to: impl Fn(usize) -> bool + Copy,
    eighth: Eighth,
) -> f64 {
    let told = told(law, benches, parameters, fit_to, eighth);
    let unit = unit(&told, fit_to);
    let square = |error: f64| counted(error).powi(2);
    let of = |one: &Option<(Curve, [f64; 2])>| {
        one.map_or(NOTHING * NOTHING, |(_, [sensitivity, maximum])| square(sensitivity - unit) + square(maximum))
    };
    told.iter().enumerate().filter(|(at, _)| fit_to(*at)).map(|(_, one)| of(one)).sum()
}

fn judged(
    law: &Law,
    benches: &[Bench],
    parameters: Vec<f64>,
    fit_to: impl Fn(usize) -> bool + Copy,
    eighth: Eighth,
) -> Judged {
    let told = told(law, benches, &parameters, |_| true, eighth);
    let unit = unit(&told, fit_to);
    let errors = told.iter().map(|one| one.map(|(_, [sensitivity, maximum])| [sensitivity - unit, maximum]));
    let errors: Vec<Option<[f64; 2]>> = errors.collect();
    let curves: Vec<Option<Curve>> = told.iter().map(|one| one.map(|(curve, _)| curve)).collect();
    Judged {
        unit_mv: (-unit).exp(),
        left: left(benches, &errors, |at| !fit_to(at)),
        order: order(benches, &curves),
        errors,
        parameters,
    }
}

/// An error as it counts: beyond a factor of 20 it is as wrong as can be.
pub fn counted(error: f64) -> f64 {
    error.abs().min(MOST)
}

/// Factors that SENS, and FMAX where that was measured, are off by over some samples; one that conducts nothing is off by the most that counts.
fn left(benches: &[Bench], errors: &[Option<[f64; 2]>], of: impl Fn(usize) -> bool) -> [Option<f64>; 2] {
    [0, 1].map(|figure| {
        let counts = |at: usize| of(at) && (figure == 0 || benches[at].measured.maximum_n.is_some());
        let counted = errors.iter().enumerate().filter(|(at, _)| counts(*at));
        let squares: Vec<f64> =
            counted.map(|(_, one)| one.map_or(MOST, |errors| self::counted(errors[figure])).powi(2)).collect();
        mean(&squares).map(|square| square.sqrt().exp())
    })
}

fn order(benches: &[Bench], curves: &[Option<Curve>]) -> [Option<[f64; 2]>; 2] {
    let pairs = |of: fn(&Bench, &Curve) -> Option<[f64; 2]>| -> Vec<[f64; 2]> {
        benches.iter().zip(curves).filter_map(|(bench, curve)| of(bench, curve.as_ref()?)).collect()
    };
    let sensitivities = pairs(|bench, curve| Some([bench.measured.sensitivity_mv_per_n, curve.sensitivity]));
    let maxima = pairs(|bench, curve| Some([bench.measured.maximum_n?, curve.maximum_n]));
    [sensitivities, maxima].map(|pairs| Some([spearman(&pairs)?, chance(&pairs)?]))
}

/// Compass search: a step along each parameter, either way, halved where none is better.
fn descend(cost: impl Fn(&[f64]) -> f64, mut at: Vec<f64>) -> (Vec<f64>, f64) {
    let mut least = cost(&at);
    let mut step = STEPS[0];
    while step > STEPS[1] {
        let tried = (0..2 * at.len()).map(|way| {
            let mut other = at.clone();
            other[way / 2] += if way % 2 == 0 { step } else { -step };
            (cost(&other), other)
        });
        match tried.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(other, _)| *other < least) {
            Some((other, place)) => (least, at) = (other, place),
            None => step /= 2.0,
        }
    }
    (at, least)
}
