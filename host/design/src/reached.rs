//! What `auto` reaches on a detector, beside what any method could.

use tactomo_physics::detector::Detector;
use tactomo_physics::scene::{Contact, Touch};
use tactomo_study::{Experiment, StudyError};
use tactomo_touch::metrics::Matching;
use tactomo_touch::solve::Method;

/// What `auto` reaches with one frame of each of some presses, each a cold start.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Reached {
    /// Root mean square error of places where exactly one contact was found (m).
    pub place_m: Option<f64>,
    /// Share of presses of which exactly one contact was found.
    pub found: f64,
}

/// Presses a detector, which is as described, with single contacts: readings of a finer model, through the converter.
///
/// # Errors
/// [`StudyError`] if it cannot be modelled, or a contact is off it.
pub fn by_auto(detector: &Detector, contacts: &[Contact], seed: u64) -> Result<Reached, StudyError> {
    let mut presses = Presses::default();
    presses.on(&Experiment::new(detector)?, contacts, seed)?;
    Ok(presses.reached())
}

/// The same on so many detectors as built, drawn from its tolerances, of which `auto` knows the description only.
///
/// # Errors
/// As for [`by_auto`].
pub fn as_built(detector: &Detector, contacts: &[Contact], seed: u64, drawn: u64) -> Result<Reached, StudyError> {
    let nominal = Experiment::new(detector)?;
    let mut presses = Presses::default();
    for index in 0..drawn {
        let seed = seed.wrapping_add(index);
        presses.on(&nominal.as_built(seed)?, contacts, seed)?;
    }
    Ok(presses.reached())
}

/// Presses so far.
#[derive(Default)]
struct Presses {
    squares_m2: Vec<f64>,
    all: usize,
}

impl Presses {
    fn on(&mut self, experiment: &Experiment, contacts: &[Contact], seed: u64) -> Result<(), StudyError> {
        let touches: Vec<_> = contacts.iter().map(|contact| vec![Touch::from(*contact)]).collect();
        let frames = experiment.frames(&touches, seed)?;
        let mut solver = Method::Auto.build(&experiment.problem)?;
        for (contact, frame) in contacts.iter().zip(&frames) {
            solver.reset();
            let solution = solver
                .solve(&frame.readings)
                .map_err(|error| StudyError::Solve { solver: Method::Auto.name().to_owned(), error })?;
            if solution.is_contacts() && solution.contacts.len() == 1 {
                let matching = Matching::within(f64::INFINITY, &[*contact], &solution.contacts);
                self.squares_m2.extend(matching.pairs.iter().map(|pair| pair.distance_m.powi(2)));
            }
        }
        self.all += contacts.len();
        Ok(())
    }

    fn reached(&self) -> Reached {
        Reached {
            place_m: super::metrics::mean(&self.squares_m2).map(f64::sqrt),
            found: self.squares_m2.len() as f64 / self.all.max(1) as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_finds_single_presses_near_the_bound() {
        let detector = Detector::default();
        let contacts: Vec<_> = (0..6).map(|k| Contact::flat(0.004 * f64::from(k) - 0.01, 0.007, 0.002, 1e-3)).collect();
        let reached = by_auto(&detector, &contacts, 1).unwrap();
        assert_eq!(reached.found, 1.0);
        assert!(reached.place_m.unwrap() < 2e-4, "{reached:?}");
    }
}
