//! What `auto` reaches on a detector, beside what any method could.

use tactomo_physics::detector::Detector;
use tactomo_physics::scene::{Contact, Touch};
use tactomo_physics::simulate::drawn;
use tactomo_study::{Experiment, StudyError};
use tactomo_touch::metrics::Matching;
use tactomo_touch::solve::{Method, Parameter, Solver};

/// What a solver reaches with one frame of each of some presses, each a cold start.
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
    let experiment = Experiment::new(detector)?;
    presses.on(&experiment, Method::Auto.build(&experiment.problem)?, contacts, seed)?;
    Ok(presses.reached())
}

/// What one contact that is fitted misses on so many detectors as built, drawn from its tolerances, if their description is taken as exact: how far tolerances
/// spoil a detector that is not calibrated. `auto`, which knows of tolerances, does better, but takes seconds to learn what each does.
///
/// # Errors
/// As for [`by_auto`].
pub fn as_built(detector: &Detector, contacts: &[Contact], seed: u64, count: u64) -> Result<Reached, StudyError> {
    let nominal = Experiment::new(detector)?;
    let mut presses = Presses::default();
    for index in 0..count {
        let seed = seed.wrapping_add(index);
        let built = drawn(detector, seed);
        built.check().map_err(|wrong| StudyError::AsBuilt { detector: detector.name.clone(), seed, wrong })?;
        let single = Method::Contacts.build_with(&nominal.problem, Some(Parameter::MaxContacts(1)))?;
        presses.on(&nominal.with_truth(&built)?, single, contacts, seed)?;
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
    fn on(
        &mut self,
        experiment: &Experiment,
        mut solver: Box<dyn Solver>,
        contacts: &[Contact],
        seed: u64,
    ) -> Result<(), StudyError> {
        let touches: Vec<_> = contacts.iter().map(|contact| vec![Touch::from(*contact)]).collect();
        let frames = experiment.frames(&touches, seed)?;
        for (contact, frame) in contacts.iter().zip(&frames) {
            solver.reset();
            let solution = solver
                .solve(&frame.readings)
                .map_err(|error| StudyError::Solve { solver: solver.name().to_owned(), error })?;
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
            place_m: super::rank::mean(&self.squares_m2).map(f64::sqrt),
            found: self.squares_m2.len() as f64 / self.all.max(1) as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerances_spoil_places() {
        let detector = Detector::default();
        let contacts = [Contact::flat(0.004, 0.007, 0.002, 1e-3), Contact::flat(-0.014, 0.011, 0.002, 1e-3)];
        let [exact, built] =
            [by_auto(&detector, &contacts, 1), as_built(&detector, &contacts, 1, 2)].map(Result::unwrap);
        assert!(built.place_m.unwrap() > 3.0 * exact.place_m.unwrap(), "{exact:?} {built:?}");
    }

    #[test]
    fn it_finds_single_presses_near_the_bound() {
        let detector = Detector::default();
        let contacts: Vec<_> = (0..6).map(|k| Contact::flat(0.004 * f64::from(k) - 0.01, 0.007, 0.002, 1e-3)).collect();
        let reached = by_auto(&detector, &contacts, 1).unwrap();
        assert_eq!(reached.found, 1.0);
        assert!(reached.place_m.unwrap() < 2e-4, "{reached:?}");
    }
}
