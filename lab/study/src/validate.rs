//! How far a forward model is from reference cases, and what solvers make of their readings.

use std::time::Instant;

use serde::Serialize;

use crate::case::Case;
use tactomo_physics::detector::Adc;
use tactomo_physics::forward::{ForwardError, ForwardModel, readings_v};
use tactomo_physics::readings::Readings;
use tactomo_physics::simulate::{Noise, measured};
use tactomo_touch::metrics::position_error_m;
use tactomo_touch::solve::{FoundContact, SolveError, Solver};

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
    /// Time for a frame that follows another of the same touch, median, in microseconds (us).
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
        // What is found must not lean on the trial before; the time is that of a frame that follows another.
        solver.reset();
        let solution = solver.solve(&trial_readings(case, trials, &mut noise))?;
        let next = trial_readings(case, trials, &mut noise);
        let start = Instant::now();
        solver.solve(&next)?;
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
