//! Contacts corrected by presses at known places, on a detector that has such.
//!
//! Known presses make a Gaussian process of the error at each place. Its mean is taken off what a solver finds; its variance, and what differs
//! from press to press, is in the standard errors afterwards. What the solver claims holds errors of the detector too, which are the same at the same
//! place and corrected: so much of the claim stays as presses have shown to differ.

use crate::gaussian::{Known, Prior, Process, Scatter};
use crate::solve::answer::{FoundContact, FoundLine, FoundRing, FoundShape, Solution, Uncertainty};
use tactomo_physics::detector::{ConductanceErrors, Detector, Outline, PlaceErrors};

/// What known presses say of errors everywhere.
pub(crate) struct Corrector {
    places: Option<Places>,
    /// Of the logarithm of the conductance.
    conductance: Option<Process>,
    outline: Outline,
}

/// Errors of places.
struct Places {
    axes: [Process; 2],
    scatter: Scatter,
}

/// A place as it is, and the standard errors of both axes with their correlation.
struct Placed {
    at_m: [f64; 2],
    deviations_m: [f64; 2],
    correlation: f64,
}

impl Corrector {
    /// The corrector of a detector, if it has a correction.
    pub fn of(detector: &Detector) -> Option<Self> {
        let correction = detector.correction.as_ref()?;
        let places = correction.place.as_ref().and_then(Places::of);
        let conductance = correction.conductance.as_ref().and_then(conductance);
        Some(Self { places, conductance, outline: detector.outline.clone() })
    }

    /// A conductance that is found at a place, and its standard error (S), as they are.
    pub fn conductance_s(&self, found_m: [f64; 2], [conductance_s, deviation_s]: [f64; 2]) -> [f64; 2] {
        let Some(process) = &self.conductance else { return [conductance_s, deviation_s] };
        let Known { mean, variance } = process.at(found_m);
        let factor = (-mean).exp();
        [factor * conductance_s, factor * deviation_s.hypot(variance.sqrt() * conductance_s)]
    }

    /// A place that is found with such standard errors and such a correlation, as it is.
    fn placed(&self, found_m: [f64; 2], claimed_m: [f64; 2], correlation: f64) -> Placed {
        let Some(places) = &self.places else { return Placed { at_m: found_m, deviations_m: claimed_m, correlation } };
        let errors = [0, 1].map(|axis| places.axes[axis].at(found_m));
        let at_m = self.held([0, 1].map(|axis| found_m[axis] - errors[axis].mean));
        let scattered = |axis: usize| places.scatter.variance(claimed_m[axis]);
        let deviations_m = [0, 1].map(|axis| (errors[axis].variance + scattered(axis)).sqrt());
        // What is added is independent in x and y: the covariance stays that of the share.
        let covariance_m2 = places.scatter.share.powi(2) * correlation * claimed_m[0] * claimed_m[1];
        let product_m2 = deviations_m[0] * deviations_m[1];
        Placed { at_m, deviations_m, correlation: if product_m2 > 0.0 { covariance_m2 / product_m2 } else { 0.0 } }
    }

    /// Contacts that were corrected, where they would be found.
    pub fn found(&self, contacts: &[FoundContact]) -> Vec<FoundContact> {
        let found = |contact: &FoundContact| {
            let [x_m, y_m] = self.found_m([contact.x_m, contact.y_m]);
            FoundContact { x_m, y_m, ..*contact }
        };
        contacts.iter().map(found).collect()
    }

    /// Where a place would be found, to the slope of the correction.
    fn found_m(&self, at_m: [f64; 2]) -> [f64; 2] {
        let Some(places) = &self.places else { return at_m };
        [0, 1].map(|axis| at_m[axis] + places.axes[axis].at(at_m).mean)
    }

    /// A place on the detector: nothing touches beside it.
    fn held(&self, at_m: [f64; 2]) -> [f64; 2] {
        if self.outline.holds(at_m) {
            return at_m;
        }
        let [low_m, high_m] = self.outline.bounds();
        [0, 1].map(|axis| at_m[axis].clamp(low_m[axis], high_m[axis]))
    }

    /// An answer with contacts and shapes where they are.
    pub fn solution(&self, mut solution: Solution) -> Solution {
        solution.contacts.iter_mut().for_each(|contact| *contact = self.contact(contact));
        solution.shape = solution.shape.map(|shape| self.shape(shape));
        solution
    }

    fn contact(&self, found: &FoundContact) -> FoundContact {
        let found_m = [found.x_m, found.y_m];
        let claimed = found
            .uncertainty
            .map_or([0.0; 4], |claimed| [claimed.x_m, claimed.y_m, claimed.correlation, claimed.conductance_s]);
        let Placed { at_m, deviations_m, correlation } = self.placed(found_m, [claimed[0], claimed[1]], claimed[2]);
        let [conductance_s, deviation_s] = self.conductance_s(found_m, [found.conductance_s, claimed[3]]);
        let [x_m, y_m] = deviations_m;
        let uncertainty = Uncertainty { x_m, y_m, correlation, conductance_s: deviation_s };
        let uncertainty = found.uncertainty.map(|_| uncertainty);
        let apparent_conductance_s =
            found.apparent_conductance_s.map(|apparent_s| apparent_s * conductance_s / found.conductance_s);
        FoundContact { x_m: at_m[0], y_m: at_m[1], conductance_s, apparent_conductance_s, uncertainty, ..*found }
    }

    /// Ends of a line, and the centre of a ring. How long or wide they are is not corrected.
    fn shape(&self, shape: FoundShape) -> FoundShape {
        let moved = |found_m: [f64; 2], claimed_m: Option<[f64; 2]>| {
            let Placed { at_m, deviations_m, .. } = self.placed(found_m, claimed_m.unwrap_or_default(), 0.0);
            (at_m, deviations_m)
        };
        match shape {
            FoundShape::Line(mut line) => {
                let claimed = line.uncertainty;
                let (from_m, from_deviations_m) = moved(line.from_m, claimed.map(|claimed| claimed.from_m));
                let (to_m, to_deviations_m) = moved(line.to_m, claimed.map(|claimed| claimed.to_m));
                if let Some(claimed) = &mut line.uncertainty {
                    (claimed.from_m, claimed.to_m) = (from_deviations_m, to_deviations_m);
                }
                FoundShape::Line(FoundLine { from_m, to_m, ..line })
            }
            FoundShape::Ring(mut ring) => {
                let (centre_m, deviations_m) = moved(ring.centre_m, ring.uncertainty.map(|claimed| claimed.centre_m));
                if let Some(claimed) = &mut ring.uncertainty {
                    claimed.centre_m = deviations_m;
                }
                FoundShape::Ring(FoundRing { centre_m, ..ring })
            }
        }
    }
}

impl Places {
    fn of(errors: &PlaceErrors) -> Option<Self> {
        let prior = Prior { length_m: errors.length_m, deviation: errors.deviation_m };
        let scatter = Scatter { noise: errors.noise_m, share: errors.claimed_share };
        let axis = |axis: usize| {
            let of = |pairs: &[[f64; 2]]| pairs.iter().map(|pair| pair[axis]).collect::<Vec<_>>();
            Process::scattered(prior, scatter, &errors.found_m, &of(&errors.errors_m), &of(&errors.standard_errors_m))
        };
        Some(Self { axes: [axis(0)?, axis(1)?], scatter })
    }
}

fn conductance(errors: &ConductanceErrors) -> Option<Process> {
    let prior = Prior { length_m: errors.length_m, deviation: errors.deviation };
    let scatter = Scatter { noise: errors.noise, share: 1.0 };
    Process::scattered(prior, scatter, &errors.found_m, &errors.log_errors, &errors.log_standard_errors)
}

#[cfg(test)]
impl Corrector {
    /// Mean error of a place that is found, and the standard errors that are given there, for tests of what makes corrections.
    pub(crate) fn error_and_deviations(&self, found: &FoundContact) -> ([f64; 2], [f64; 2]) {
        let corrected = self.contact(found);
        let deviations_m = corrected.uncertainty.map_or([0.0; 2], |deviation| [deviation.x_m, deviation.y_m]);
        ([found.x_m - corrected.x_m, found.y_m - corrected.y_m], deviations_m)
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::solve::pipeline::fault_tolerant::FaultTolerant;
    use crate::solve::pipeline::method::Method;
    use crate::solve::problem::Problem;
    use crate::solve::samples::{CONTACT, readings};
    use crate::solve::solver::{Parts, Solver};
    use tactomo_physics::detector::{Correction, ForceLaw};

    /// Errors of 2 mm in x and -1 mm in y all over `square-60`, and conductances that are found 10 % too large.
    fn correction() -> Correction {
        let at = |k: usize| 0.02 * (k as f64 - 1.0);
        let found_m: Vec<[f64; 2]> = (0..9).map(|k| [at(k % 3), at(k / 3)]).collect();
        let count = found_m.len();
        Correction {
            place: Some(PlaceErrors {
                length_m: 0.2,
                deviation_m: 2e-3,
                noise_m: 1e-4,
                claimed_share: 0.5,
                found_m: found_m.clone(),
                errors_m: vec![[2e-3, -1e-3]; count],
                standard_errors_m: vec![[1e-4; 2]; count],
            }),
            conductance: Some(ConductanceErrors {
                length_m: 0.2,
                deviation: 0.1,
                noise: 0.001,
                found_m,
                log_errors: vec![1.1f64.ln(); count],
                log_standard_errors: vec![0.001; count],
            }),
        }
    }

    fn problem(correction: Option<Correction>) -> Problem {
        // Two newtons at 0.1 mS, of a contact with its constriction.
        let force = ForceLaw { conductance_at_1_n_s: 5e-5, range_n: [0.01, 1e3], ..ForceLaw::siemens() };
        Problem::of(&Detector { correction, force: Some(force), ..Detector::default() }).unwrap()
    }

    fn assert_corrected(with: &FoundContact, without: &FoundContact, what: &str) {
        let moved_m = [with.x_m - without.x_m, with.y_m - without.y_m];
        assert!((moved_m[0] + 2e-3).abs() < 5e-5 && (moved_m[1] - 1e-3).abs() < 5e-5, "{what}: {moved_m:?}");
        assert!((with.conductance_s / without.conductance_s * 1.1 - 1.0).abs() < 0.005, "{what}");
        let [force_n, before_n] = [with, without].map(|contact| contact.force_n.unwrap());
        assert!((force_n / before_n * 1.1 - 1.0).abs() < 0.005, "{what}: {force_n} N of {before_n} N");
    }

    #[test]
    fn contacts_of_every_solver_are_corrected() {
        let (corrected, plain) = (problem(Some(correction())), problem(None));
        let readings = readings(CONTACT);
        for method in Method::ALL {
            let solve = |problem| method.build(problem).unwrap().solve(&readings).unwrap().contacts;
            let (with, without) = (solve(&corrected), solve(&plain));
            assert!(!with.is_empty() && with.len() == without.len(), "{}", method.name());
            for (with, without) in with.iter().zip(&without) {
                assert_corrected(with, without, method.name());
                let [with, without] = [with, without].map(|contact| contact.uncertainty);
                let Some((with, without)) = with.zip(without) else { continue };
                // Half of what was claimed, what differs from press to press, and hardly any doubt of the correction.
                let expected_m = (0.5 * without.x_m).hypot(1e-4);
                assert!(with.x_m > expected_m && with.x_m < expected_m + 6e-5, "{}: {with:?}", method.name());
            }
        }
    }

    #[test]
    fn halves_of_a_solver_and_the_guard_are_too_and_numbers_go_on() {
        let (corrected, plain) = (problem(Some(correction())), problem(None));
        let readings = readings(CONTACT);
        let live = |problem: &Problem, before: &[FoundContact]| {
            let Parts { mut tracker, search } = Method::Auto.build(problem).unwrap().split();
            tracker.inherit(before);
            tracker.follow(&readings).unwrap();
            let hypothesis =
                search.unwrap().search(tracker.hypothesis(), &readings, &mut |_| ControlFlow::Continue(())).unwrap();
            tracker.adopt(hypothesis, &readings).unwrap().solution.contacts[0]
        };
        assert_corrected(&live(&corrected, &[]), &live(&plain, &[]), "live");
        let tolerant = |problem: &Problem| {
            FaultTolerant::new(Method::Contacts, problem).unwrap().solve(&readings).unwrap().contacts[0]
        };
        assert_corrected(&tolerant(&corrected), &tolerant(&plain), "tolerant");
        // Corrected to be 22 mm from where it is found: only who takes that back knows it again.
        let mut far = correction();
        far.place.as_mut().unwrap().errors_m.fill([0.02, -0.01]);
        far.place.as_mut().unwrap().deviation_m = 0.02;
        let far = problem(Some(far));
        let first = live(&far, &[]);
        let next = live(&far, &[FoundContact { id: Some(41), ..first }]);
        assert_eq!(next.id, Some(41));
    }

    #[test]
    fn far_from_the_presses_nothing_is_corrected_and_the_doubt_is_reported() {
        let mut correction = correction();
        let places = correction.place.as_mut().unwrap();
        places.length_m = 1e-3;
        let detector = Detector { correction: Some(correction), ..Detector::default() };
        let corrector = Corrector::of(&detector).unwrap();
        let claimed = Uncertainty { x_m: 3e-4, y_m: 4e-4, correlation: 0.5, conductance_s: 1e-5 };
        let found = FoundContact { uncertainty: Some(claimed), ..FoundContact::flat(0.01, 0.01, 1e-3) };
        let corrected = corrector.contact(&found);
        assert!((corrected.x_m - 0.01).abs() < 1e-9 && (corrected.y_m - 0.01).abs() < 1e-9, "{corrected:?}");
        let uncertainty = corrected.uncertainty.unwrap();
        let variance_m2 = 4e-6 + 1e-8 + 0.25 * 9e-8;
        assert!((uncertainty.x_m.powi(2) / variance_m2 - 1.0).abs() < 1e-9, "{uncertainty:?}");
        let covariance_m2 = uncertainty.correlation * uncertainty.x_m * uncertainty.y_m;
        assert!((covariance_m2 - 0.25 * 0.5 * 12e-8).abs() < 1e-15, "{uncertainty:?}");
    }

    #[test]
    fn nothing_is_put_beside_the_detector_and_shapes_move_too() {
        let detector = Detector { correction: Some(correction()), ..Detector::default() };
        let corrector = Corrector::of(&detector).unwrap();
        let at_wall = corrector.contact(&FoundContact::flat(-0.029, 0.0295, 1e-3));
        assert_eq!([at_wall.x_m, at_wall.y_m], [-0.03, 0.03]);
        let claimed =
            crate::solve::LineUncertainty { from_m: [1e-4; 2], to_m: [1e-4; 2], width_m: 1e-3, conductance_s: 1e-5 };
        let line = FoundLine {
            from_m: [-0.01, 0.0],
            to_m: [0.01, 0.0],
            width_m: 2e-3,
            conductance_s: 1e-3,
            uncertainty: Some(claimed),
        };
        let FoundShape::Line(moved) = corrector.shape(FoundShape::Line(line)) else { panic!("no line") };
        assert!((moved.from_m[0] + 0.012).abs() < 5e-5 && (moved.to_m[1] - 1e-3).abs() < 5e-5, "{moved:?}");
        assert!(moved.uncertainty.is_some_and(|corrected| corrected.to_m[0] > 1.1e-4 && corrected.width_m == 1e-3));
    }
}
