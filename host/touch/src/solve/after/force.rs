//! Newtons of contacts, on a detector whose law of force is known.

mod meter;

use self::meter::{Measured, Meter};
use super::correct::Corrector;
use crate::solve::answer::Solution;
use crate::solve::problem::Problem;
use tactomo_physics::detector::ForceLaw;
use tactomo_physics::readings::Readings;

/// What makes forces of readings at the places of contacts.
pub(crate) struct Scale {
    law: ForceLaw,
    meter: Meter,
    /// What known presses say of conductances.
    corrector: Option<Corrector>,
}

impl Scale {
    /// The scale of a problem whose detector has a law of force.
    pub fn of(problem: &Problem) -> Option<Self> {
        let (law, meter) = problem.detector().force.clone().zip(Meter::new(problem))?;
        Some(Self { law, meter, corrector: Corrector::of(problem.detector()) })
    }

    /// Adds forces to contacts, unless the solver was taught forces itself.
    pub fn with_forces(&self, readings: &Readings, mut solution: Solution) -> Solution {
        let is_known = solution.contacts.iter().any(|contact| contact.force_n.is_some());
        let measured = if is_known { None } else { self.meter.measure(readings, &solution.contacts) };
        for (contact, measured) in solution.contacts.iter_mut().zip(measured.into_iter().flatten()) {
            let Measured { conductance_s, deviation_s } = measured;
            let found = [conductance_s, deviation_s];
            let [conductance_s, deviation_s] = match &self.corrector {
                Some(corrector) => corrector.conductance_s([contact.x_m, contact.y_m], found),
                None => found,
            };
            contact.set_force(self.law.force_n(conductance_s, deviation_s));
        }
        solution
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::solve::answer::FoundContact;
    use crate::solve::pipeline::fault_tolerant::FaultTolerant;
    use crate::solve::pipeline::method::{Family, Method};
    use crate::solve::samples::{CONTACT, readings};
    use crate::solve::solver::{Parts, Solver};
    use tactomo_physics::detector::Detector;

    fn problem(force: Option<ForceLaw>) -> Problem {
        Problem::of(&Detector { force, ..Detector::default() }).unwrap()
    }

    /// Half a newton at 0.1 mS, of a contact with its constriction.
    fn law() -> ForceLaw {
        ForceLaw { conductance_at_1_n_s: 2e-4, scatter: 0.05, range_n: [0.1, 0.8], ..ForceLaw::siemens() }
    }

    #[test]
    fn contacts_of_every_solver_carry_newtons() {
        let (calibrated, plain) = (problem(Some(law())), problem(None));
        let readings = readings(CONTACT);
        let mut forces = Vec::new();
        for method in Method::ALL {
            let solve = |problem| method.build(problem).unwrap().solve(&readings).unwrap().contacts;
            let (with, without) = (solve(&calibrated), solve(&plain));
            assert!(!with.is_empty() && without.iter().all(|contact| contact.force_n.is_none()), "{}", method.name());
            for (with, without) in with.iter().zip(&without) {
                let (force_n, deviation_n) = (with.force_n.unwrap(), with.force_deviation_n.unwrap());
                assert!(force_n > 0.0 && deviation_n > 0.04 * force_n, "{}: {with:?}", method.name());
                assert_eq!(with.force_beyond_maximum, Some(force_n > 0.8), "{}: {with:?}", method.name());
                let plain =
                    FoundContact { force_n: None, force_deviation_n: None, force_beyond_maximum: None, ..*with };
                assert_eq!(plain, *without, "{}: newtons change nothing else", method.name());
            }
            forces.push((method, with[0].force_n.unwrap()));
        }
        // As far as the place is right, the force does not depend on the solver.
        let best = forces[1].1;
        for (method, force_n) in forces {
            let factor = if method.family() == Family::Contacts || method == Method::Auto { 1.01 } else { 1.3 };
            assert!((force_n / best).ln().abs() < f64::ln(factor), "{}: {force_n} N, {best} N", method.name());
        }
    }

    #[test]
    fn halves_of_a_solver_carry_them_too_and_without_faulty_electrodes() {
        let (problem, readings) = (problem(Some(law())), readings(CONTACT));
        let mut found = Vec::new();
        for method in [Method::Auto, Method::Contacts, Method::Bsbl] {
            let Parts { mut tracker, search } = method.build(&problem).unwrap().split();
            let mut followed = tracker.follow(&readings).unwrap();
            if let Some(mut search) = search {
                let hypothesis =
                    search.search(tracker.hypothesis(), &readings, &mut |_| ControlFlow::Continue(())).unwrap();
                followed = tracker.adopt(hypothesis, &readings).unwrap();
            }
            let [contact] = followed.solution.contacts[..] else { panic!("{}", method.name()) };
            found.push(contact.force_n.unwrap());
        }
        let mut broken = readings.clone();
        // A wire that is broken: grounded, it takes no current, and all others are at the drive; read, it is anywhere.
        (0..16).filter(|e| *e != 3).for_each(|e| broken.volts_mut()[16 * 3 + e] = 2.0);
        (0..16).filter(|g| *g != 3).for_each(|g| broken.volts_mut()[16 * g + 3] = 0.7);
        let mut solver = FaultTolerant::new(Method::Contacts, &problem).unwrap();
        let last = (0..20).map(|_| solver.solve(&broken).unwrap()).last().unwrap();
        assert_eq!(last.flags.excluded, [3]);
        found.push(last.contacts[0].force_n.unwrap());
        assert!(found.iter().all(|force_n| (force_n / found[0] - 1.0).abs() < 0.03), "{found:?}");
    }

    #[test]
    fn a_force_that_was_taught_stays_and_nothing_is_made_of_no_number() {
        let problem = problem(Some(law()));
        let scale = Scale { law: law(), meter: Meter::new(&problem).unwrap(), corrector: None };
        let scaled = |contact| {
            scale.with_forces(&readings(CONTACT), Solution { contacts: vec![contact], ..Solution::default() })
        };
        let taught = FoundContact { force_n: Some(7.0), ..FoundContact::flat(0.0, 0.0, 1e-4) };
        assert_eq!(scaled(taught).contacts, [taught]);
        assert_eq!(scaled(FoundContact::flat(f64::NAN, 0.0, 1e-4)).contacts[0].force_n, None);
    }
}
