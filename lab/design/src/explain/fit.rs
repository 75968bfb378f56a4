//! How near a law comes to the paper's table II, and the parameters that come nearest.
//!
//! Errors are logarithms of factors. The unit of SENS is unknown ("reconstructed value"), so one factor for all samples is taken off: the median of the
//! samples that a law is fitted to. A maximum force that the paper's own fit did not find (D and DA) counts as right from [`FAILED_N`] on.

use super::super::rank::{chance, mean, spearman};
use super::Eighth;
use super::bench::{Bench, Curve};
use super::laws::Law;

/// From this force on a maximum is a failed fit there (N): four times what was applied.
const FAILED_N: f64 = 20.0;
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
    /// Over all of them.
    pub all: [Option<f64>; 2],
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

fn curves(law: &Law, benches: &[Bench], parameters: &[f64], eighth: Eighth) -> Vec<Option<Curve>> {
    let of = |bench: &Bench| bench.curve(|force_n| (law.contact)(bench, parameters, force_n), eighth);
    benches.iter().map(of).collect()
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

/// The median of the errors of SENS over some samples: the logarithm of its unit.
fn unit(errors: &[Option<[f64; 2]>], of: impl Fn(usize) -> bool) -> f64 {
    let mut logs: Vec<f64> =
        errors.iter().enumerate().filter(|(at, _)| of(*at)).filter_map(|(_, one)| Some((*one)?[0])).collect();
    logs.sort_by(f64::total_cmp);
    let (low, high) = (logs.get(logs.len().saturating_sub(1) / 2), logs.get(logs.len() / 2));
    low.zip(high).map_or(0.0, |(low, high)| (low + high) / 2.0)
}

fn cost(
    law: &Law,
    benches: &[Bench],
    parameters: &[f64],
    fit_to: impl Fn(usize) -> bool + Copy,
    eighth: Eighth,
) -> f64 {
    let errors: Vec<_> = benches
        .iter()
        .enumerate()
        .map(|(at, bench)| {
            let curve = fit_to(at).then(|| bench.curve(|force_n| (law.contact)(bench, parameters, force_n), eighth));
            curve.flatten().map(|curve| self::errors(bench, &curve))
        })
        .collect();
    let unit = unit(&errors, fit_to);
    let square = |error: f64| counted(error).powi(2);
    let of = |one: &Option<[f64; 2]>| {
        one.map_or(NOTHING * NOTHING, |[sensitivity, maximum]| square(sensitivity - unit) + square(maximum))
    };
    errors.iter().enumerate().filter(|(at, _)| fit_to(*at)).map(|(_, one)| of(one)).sum()
}

fn judged(
    law: &Law,
    benches: &[Bench],
    parameters: Vec<f64>,
    fit_to: impl Fn(usize) -> bool + Copy,
    eighth: Eighth,
) -> Judged {
    let curves = curves(law, benches, &parameters, eighth);
    let errors = benches.iter().zip(&curves).map(|(bench, curve)| curve.as_ref().map(|curve| errors(bench, curve)));
    let mut errors: Vec<Option<[f64; 2]>> = errors.collect();
    let unit = unit(&errors, fit_to);
    errors.iter_mut().flatten().for_each(|[sensitivity, _]| *sensitivity -= unit);
    Judged {
        unit_mv: (-unit).exp(),
        left: left(benches, &errors, |at| !fit_to(at)),
        all: left(benches, &errors, |_| true),
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
