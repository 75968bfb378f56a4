//! What `auto` reaches on a detector, beside what any method could.

use tactomo_physics::detector::Detector;
use tactomo_physics::scene::{Contact, Touch};
use tactomo_study::judge::answered;
use tactomo_study::{Experiment, StudyError};
use tactomo_touch::metrics::Matching;
use tactomo_touch::solve::{Method, Solver};

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

/// What `auto` reaches with each of some groups of presses of detectors as built, drawn from the tolerances with such seeds, of which it knows the description:
/// what a user sees of a detector that nobody calibrated, with the first frame.
///
/// # Errors
/// As for [`by_auto`].
pub fn as_built(
    detector: &Detector,
    groups: &[Vec<Vec<Contact>>],
    seeds: impl IntoIterator<Item = u64>,
) -> Result<Vec<AsBuilt>, StudyError> {
    let described = Experiment::new(detector)?.tolerant();
    let mut all = vec![AsBuilt::default(); groups.len()];
    for seed in seeds {
        let experiment = described.as_built(seed)?;
        let mut solver = Method::Auto.build(&experiment.problem)?;
        for (presses, all) in groups.iter().zip(&mut all) {
            all.press(&experiment, &mut *solver, presses, seed)?;
        }
    }
    all.iter_mut().for_each(|one| one.errors_m.sort_by(f64::total_cmp));
    Ok(all)
}

/// What was found of presses on detectors as built.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AsBuilt {
    /// Of places (m), the least first; without end of contacts that were missed.
    errors_m: Vec<f64>,
    presses: usize,
    seen: usize,
    counted: usize,
}

impl AsBuilt {
    fn press(
        &mut self,
        experiment: &Experiment,
        solver: &mut dyn Solver,
        presses: &[Vec<Contact>],
        seed: u64,
    ) -> Result<(), StudyError> {
        let touches: Vec<_> =
            presses.iter().map(|contacts| contacts.iter().copied().map(Touch::from).collect()).collect();
        for (contacts, frame) in presses.iter().zip(experiment.frames(&touches, seed)?) {
            solver.reset();
            let solution = solver
                .solve(&frame.readings)
                .map_err(|error| StudyError::Solve { solver: solver.name().to_owned(), error })?;
            let found = answered(&solution);
            let matching = Matching::within(f64::INFINITY, contacts, found);
            self.errors_m.extend(matching.pairs.iter().map(|pair| pair.distance_m));
            self.errors_m.extend(matching.missed.iter().map(|_| f64::INFINITY));
            self.presses += 1;
            self.seen += usize::from(!found.is_empty());
            self.counted += usize::from(found.len() == contacts.len());
        }
        Ok(())
    }

    /// Half of the places are found better (m); `None` if half were missed.
    pub fn place_m(&self) -> Option<f64> {
        self.errors_m.get(self.errors_m.len() / 2).copied().filter(|error_m| error_m.is_finite())
    }

    /// Share of presses of which anything was seen.
    pub fn seen(&self) -> f64 {
        self.seen as f64 / self.presses.max(1) as f64
    }

    /// Share of presses of which as many contacts were found as there are.
    pub fn counted(&self) -> f64 {
        self.counted as f64 / self.presses.max(1) as f64
    }
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
            if let found @ [_] = answered(&solution) {
                let matching = Matching::within(f64::INFINITY, &[*contact], found);
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
        let exact = by_auto(&detector, &contacts, 1).unwrap();
        let built = as_built(&detector, &[contacts.map(|contact| vec![contact]).to_vec()], 1..=2).unwrap().remove(0);
        assert!(built.place_m().unwrap() > 2.0 * exact.place_m.unwrap(), "{exact:?} {built:?}");
        assert_eq!((built.seen(), built.errors_m.len()), (1.0, 4));
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
