//! Any solver, with newtons at its contacts: on a detector whose law of force is known.

use super::follow::{Followed, Follower, Lead, Parts};
use super::{FoundContact, Solution, SolveError, Solver};
use tactomo_physics::detector::ForceLaw;
use tactomo_physics::readings::Readings;

/// The solver, whose contacts then carry newtons.
pub(super) fn with(law: ForceLaw, solver: Box<dyn Solver>) -> Box<dyn Solver> {
    Box::new(InNewtons { law, half: solver })
}

/// A solver, or its half that answers, with a law.
struct InNewtons<T: ?Sized> {
    law: ForceLaw,
    half: Box<T>,
}

impl<T: ?Sized> InNewtons<T> {
    fn told(&self, mut solution: Solution) -> Solution {
        solution.contacts.iter_mut().for_each(|contact| contact.tell_force(&self.law));
        solution
    }
}

impl FoundContact {
    /// Adds the force by a law, unless the solver was taught forces itself.
    fn tell_force(&mut self, law: &ForceLaw) {
        if self.force_n.is_some() || !self.conductance_s.is_finite() {
            return;
        }
        let deviation_s = self.uncertainty.map_or(0.0, |errors| errors.conductance_s);
        let newtons = law.force_n(self.conductance_s, deviation_s);
        self.force_n = Some(newtons.force_n);
        self.force_deviation_n = Some(newtons.deviation_n);
        self.force_beyond_maximum = Some(newtons.beyond_maximum);
    }
}

impl Solver for InNewtons<dyn Solver> {
    fn name(&self) -> &'static str {
        self.half.name()
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let solution = self.half.solve(readings)?;
        Ok(self.told(solution))
    }

    fn reset(&mut self) {
        self.half.reset();
    }

    fn split(self: Box<Self>) -> Parts {
        let Parts { follower, searcher } = self.half.split();
        // A search leads to contacts that the follower tells of.
        Parts { follower: Box::new(InNewtons { law: self.law, half: follower }), searcher }
    }
}

impl Follower for InNewtons<dyn Follower> {
    fn follow(&mut self, readings: &Readings) -> Result<Followed, SolveError> {
        let Followed { solution, search } = self.half.follow(readings)?;
        Ok(Followed { solution: self.told(solution), search })
    }

    fn adopt(&mut self, lead: Lead, readings: &Readings) -> Result<Followed, SolveError> {
        let Followed { solution, search } = self.half.adopt(lead, readings)?;
        Ok(Followed { solution: self.told(solution), search })
    }

    fn lead(&self) -> Lead {
        self.half.lead()
    }

    fn inherit(&mut self, before: &[FoundContact]) {
        self.half.inherit(before);
    }

    fn reset(&mut self) {
        self.half.reset();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::samples::{CONTACT, readings};
    use crate::solve::{Guard, Method, Problem};
    use tactomo_physics::detector::Detector;

    fn law() -> ForceLaw {
        ForceLaw {
            conductance_at_1_n_s: 1e-4,
            exponent: 0.5,
            series_ohm: None,
            covariance: vec![vec![0.0; 2]; 2],
            scatter: 0.05,
            hysteresis: 0.0,
            range_n: [0.5, 2.0],
            maximum_n: None,
            presses: 10,
        }
    }

    fn problem(force: Option<ForceLaw>) -> Problem {
        Problem::of(&Detector { force, ..Detector::default() }).unwrap()
    }

    #[test]
    fn contacts_of_every_solver_carry_newtons() {
        let (calibrated, plain) = (problem(Some(law())), problem(None));
        let readings = readings(CONTACT);
        for method in Method::ALL {
            let solve = |problem| method.build(problem).unwrap().solve(&readings).unwrap().contacts;
            let (told, untold) = (solve(&calibrated), solve(&plain));
            assert!(!told.is_empty(), "{}", method.name());
            for (contact, before) in told.iter().zip(&untold) {
                let newtons =
                    law().force_n(contact.conductance_s, contact.uncertainty.map_or(0.0, |u| u.conductance_s));
                assert_eq!(contact.force_n, Some(newtons.force_n), "{}", method.name());
                assert_eq!(contact.force_deviation_n, Some(newtons.deviation_n));
                assert_eq!(contact.force_beyond_maximum, Some(newtons.beyond_maximum));
                assert!(newtons.deviation_n > 0.05 * newtons.force_n);
                assert_eq!((before.force_n, before.conductance_s), (None, contact.conductance_s));
            }
        }
    }

    #[test]
    fn halves_of_a_solver_carry_them_too_and_without_faulty_electrodes() {
        let (problem, readings) = (problem(Some(law())), readings(CONTACT));
        for method in [Method::Auto, Method::Contacts, Method::Tikhonov] {
            let Parts { mut follower, searcher } = method.build(&problem).unwrap().split();
            let mut followed = follower.follow(&readings).unwrap();
            if let Some(mut searcher) = searcher {
                let lead = searcher.search(follower.lead(), &readings, &mut |_| {}).unwrap();
                followed = follower.adopt(lead, &readings).unwrap();
            }
            assert!(followed.solution.contacts.iter().all(|contact| contact.force_n.is_some()));
            assert_eq!(followed.solution.contacts.len(), 1, "{}", method.name());
        }
        let mut broken = readings.clone();
        // A wire that is broken: grounded, it takes no current, and all others are at the drive.
        (0..16).filter(|e| *e != 3).for_each(|e| broken.volts_mut()[16 * 3 + e] = 2.0);
        let mut guard = Guard::new(Method::Contacts, &problem).unwrap();
        let last = (0..20).map(|_| guard.solve(&broken).unwrap()).last().unwrap();
        assert_eq!(last.flags.excluded, [3]);
        assert!(last.contacts.iter().all(|contact| contact.force_n.is_some()) && !last.contacts.is_empty());
    }

    #[test]
    fn a_force_that_was_taught_stays_and_nothing_is_made_of_no_number() {
        let mut taught = FoundContact { force_n: Some(7.0), ..FoundContact::flat(0.0, 0.0, 1e-4) };
        taught.tell_force(&law());
        assert_eq!((taught.force_n, taught.force_deviation_n), (Some(7.0), None));
        let mut broken = FoundContact::flat(0.0, 0.0, f64::NAN);
        broken.tell_force(&law());
        assert_eq!(broken.force_n, None);
    }
}
