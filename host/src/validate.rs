//! How far a forward model is from reference cases, and what solvers make of their readings.

use std::time::Instant;

use serde::Serialize;

use crate::case::Case;
use crate::detector::Adc;
use crate::forward::{ForwardError, ForwardModel, readings_v};
use crate::readings::Readings;
use crate::scene::Contact;
use crate::simulate::{Noise, measured};
use crate::solve::{FoundContact, SolveError, Solver};

/// What came out for one case.
#[derive(Clone, Debug, Serialize)]
pub struct CaseReport {
    /// Name of the case.
    pub case: String,
    /// Name of the forward model.
    pub model: String,
    /// Largest difference of a reading over the largest reading.
    pub forward_error: f64,
    /// Largest difference of an impedance over the largest impedance.
    pub impedance_error: f64,
    /// The reference's own: `mesh_error_v` over the largest reading, about twice the error left in it.
    pub reference_error: f64,
    /// What each solver found.
    pub solvers: Vec<SolverReport>,
}

/// What a solver found.
#[derive(Clone, Debug, Serialize)]
pub struct SolverReport {
    /// Name of the solver.
    pub solver: String,
    /// Contacts found in the first trial.
    pub contacts: Vec<FoundContact>,
    /// Number of contacts in the case.
    pub count_true: usize,
    /// Number found, mean over the trials.
    pub count_found: f64,
    /// Distance of the true contacts from those found for them (m), mean over contacts and trials; none if none was found.
    pub position_error_m: Option<f64>,
    /// Time for a frame, median, in microseconds (us).
    pub frame_us: f64,
}

/// Noise to repeat with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trials {
    /// Standard deviation of noise (LSB), on quantised readings; `None` takes the readings as they are.
    pub noise_lsb: Option<f64>,
    /// Where the noise starts; the same seed gives the same noise.
    pub seed: u64,
    /// How often.
    pub count: usize,
}

/// Compares a model's readings with a case's: forward error and impedance error, as in [`CaseReport`].
///
/// # Errors
/// [`ForwardError`] if the model cannot take the case's contacts.
pub fn forward_errors(case: &Case, model: &dyn ForwardModel) -> Result<[f64; 2], ForwardError> {
    let impedance_ohm = model.impedance_ohm(&case.contacts)?;
    let readings = readings_v(&impedance_ohm, &case.detector);
    let pairs = readings.volts().iter().zip(case.readings.volts());
    let largest_v = pairs.map(|(ours, theirs)| (ours - theirs).abs()).fold(0.0, f64::max);
    let largest_ohm = (&impedance_ohm - &case.impedance_ohm).amax();
    Ok([largest_v / case.readings.largest_v(), largest_ohm / case.impedance_ohm.amax()])
}

/// Lets a solver read the contacts of a case from its readings.
///
/// # Errors
/// [`SolveError`] if the readings do not fit the solver.
pub fn try_solver(case: &Case, solver: &mut dyn Solver, trials: &Trials) -> Result<SolverReport, SolveError> {
    let mut noise = Noise::new(trials.seed);
    let (mut first, mut found, mut errors_m, mut times_us) = (Vec::new(), 0, Vec::new(), Vec::new());
    for trial in 0..trials.count.max(1) {
        let readings = trial_readings(case, trials, &mut noise);
        let start = Instant::now();
        let solution = solver.solve(&readings)?;
        times_us.push(start.elapsed().as_secs_f64() * 1e6);
        found += solution.contacts.len();
        errors_m.extend(position_error_m(&case.contacts, &solution.contacts));
        if trial == 0 {
            first = solution.contacts;
        }
    }
    times_us.sort_by(f64::total_cmp);
    Ok(SolverReport {
        solver: solver.name().to_owned(),
        contacts: first,
        count_true: case.contacts.len(),
        count_found: found as f64 / times_us.len() as f64,
        position_error_m: (!errors_m.is_empty()).then(|| errors_m.iter().sum::<f64>() / errors_m.len() as f64),
        frame_us: times_us[times_us.len() / 2],
    })
}

fn trial_readings(case: &Case, trials: &Trials, noise: &mut Noise) -> Readings {
    match trials.noise_lsb {
        None => case.readings.clone(),
        Some(noise_lsb) => measured(&case.readings, &Adc { noise_lsb, ..case.detector.adc }, noise),
    }
}

/// Mean distance (m) of true contacts from the found ones that are matched to them, each to one at most; `None` without a
/// match. Nearest pairs are matched first.
pub fn position_error_m(truth: &[Contact], found: &[FoundContact]) -> Option<f64> {
    let mut pairs: Vec<_> = (0..truth.len())
        .flat_map(|i| (0..found.len()).map(move |j| (i, j)))
        .map(|(i, j)| ((truth[i].x_m - found[j].x_m).hypot(truth[i].y_m - found[j].y_m), i, j))
        .collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut true_free, mut found_free) = (vec![true; truth.len()], vec![true; found.len()]);
    let mut matched_m = Vec::new();
    for (distance_m, i, j) in pairs {
        if true_free[i] && found_free[j] {
            (true_free[i], found_free[j]) = (false, false);
            matched_m.push(distance_m);
        }
    }
    (!matched_m.is_empty()).then(|| matched_m.iter().sum::<f64>() / matched_m.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(x_m: f64) -> Contact {
        Contact::flat(x_m, 0.0, 0.001, 1e-3)
    }

    fn found(x_m: f64) -> FoundContact {
        FoundContact::flat(x_m, 0.0, 1e-3)
    }

    #[test]
    fn nearest_pairs_are_matched_first_and_once() {
        let error_m = position_error_m(&[truth(0.0), truth(0.010)], &[found(0.009), found(0.002), found(0.5)]);
        assert!(error_m.is_some_and(|error_m| (error_m - 0.0015).abs() < 1e-12), "{error_m:?}");
        assert_eq!(
            position_error_m(&[truth(0.0), truth(0.010)], &[found(0.009)]).map(|m| (m * 1e3).round()),
            Some(1.0)
        );
        assert_eq!(position_error_m(&[truth(0.0)], &[]), None);
    }
}
