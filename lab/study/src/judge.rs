//! Whether an answer is right: one judge for all studies, by what the answer says it is.

use tactomo_physics::scene::{Contact, Shape, Touch};
use tactomo_touch::metrics::{Matching, Pair};
use tactomo_touch::solve::{FoundContact, FoundShape, Solution};

use crate::scenes::electrode_distance_m;
use tactomo_physics::detector::Detector;

/// An answer is wrong from so far off on, in mean distances of electrodes: 2.25 mm of 15, which is half of 4.5 mm, about the least distance at which two firm
/// contacts are told apart: what is farther off stands for another place.
pub const WRONG_SHARE: f64 = 0.15;
/// What is claimed holds if the error is within so many standard errors: of normal errors 1.1 % are beyond, in both coordinates together.
const COVERED_SIGMAS: f64 = 3.0;

/// From which distance on an answer on a detector is wrong (m).
pub fn wrong_m(detector: &Detector) -> f64 {
    WRONG_SHARE * electrode_distance_m(detector)
}

/// What an answer says it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Some contacts, or none.
    Contacts,
    Line,
    Ring,
    /// An image that is no contacts.
    Image,
}

impl Kind {
    fn of(solution: &Solution) -> Self {
        match (&solution.shape, &solution.choice) {
            (Some(FoundShape::Line(_)), _) => Self::Line,
            (Some(FoundShape::Ring(_)), _) => Self::Ring,
            // The peaks of an image are the contacts of a solver that does not choose.
            (None, Some(_)) if !solution.is_contacts() => Self::Image,
            _ => Self::Contacts,
        }
    }

    /// Of what touches.
    fn of_touches(touches: &[Touch]) -> Self {
        match touches.iter().find(|touch| touch.disc().is_none()).map(|touch| &touch.shape) {
            None => Self::Contacts,
            Some(Shape::Line { .. }) => Self::Line,
            Some(Shape::Ring { .. }) => Self::Ring,
            Some(_) => Self::Image,
        }
    }
}

/// Contacts that are the answer: none where it says that a shape or an image is, for then they are kept beside it.
pub fn answered(solution: &Solution) -> &[FoundContact] {
    if Kind::of(solution) == Kind::Contacts { &solution.contacts } else { &[] }
}

/// An answer against what touches.
#[derive(Clone, Debug)]
pub struct Judged<'a> {
    /// Contacts that are the answer.
    pub found: &'a [FoundContact],
    /// Discs that touch.
    pub truth: Vec<Contact>,
    /// Which found contact stands for which disc: of those not farther off than what is wrong.
    pub near: Matching,
    /// Whether the answer is what touches: contacts of discs, a line of a line, a ring of a ring.
    pub is_kind_right: bool,
}

impl<'a> Judged<'a> {
    /// With the distance from which on an answer is wrong (m).
    pub fn of(wrong_m: f64, touches: &[Touch], solution: &'a Solution) -> Self {
        let truth: Vec<Contact> = touches.iter().filter_map(Touch::disc).collect();
        let found = answered(solution);
        let near = Matching::within(wrong_m, &truth, found);
        Self { found, near, is_kind_right: Kind::of(solution) == Kind::of_touches(touches), truth }
    }

    /// Whether as many contacts were found as touch.
    pub fn is_number_right(&self) -> bool {
        self.is_kind_right && self.found.len() == self.truth.len()
    }

    /// Whether all discs were found that have to be, and nothing that is not there.
    pub fn is_right(&self, has_to_be: impl Fn(&Contact) -> bool) -> bool {
        let is_missed = |index: &usize| has_to_be(&self.truth[*index]);
        self.is_kind_right && self.near.invented.is_empty() && !self.near.missed.iter().any(is_missed)
    }

    /// Found contacts and discs, as many as there are of both, however far they are from each other.
    pub fn pairs(&self) -> Matching {
        Matching::within(f64::INFINITY, &self.truth, self.found)
    }

    /// Whether the answer says itself how far off it is: the right number, each within some of its own standard errors.
    pub fn is_covered(&self) -> bool {
        self.is_number_right()
            && self.pairs().pairs.iter().all(|pair| self.sigmas(pair).is_some_and(|z| z <= COVERED_SIGMAS))
    }

    /// Distance of a pair in standard errors as claimed: Mahalanobis's.
    fn sigmas(&self, pair: &Pair) -> Option<f64> {
        let (truth, found) = (&self.truth[pair.truth], &self.found[pair.found]);
        let claimed = found.uncertainty?;
        let [x, y] = [(found.x_m - truth.x_m) / claimed.x_m, (found.y_m - truth.y_m) / claimed.y_m];
        let rest = 1.0 - claimed.correlation.powi(2);
        Some(((x * x - 2.0 * claimed.correlation * x * y + y * y) / rest).max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_touch::solve::{Choice, FoundLine, FoundRing, Uncertainty};

    const WRONG_M: f64 = 2.25e-3;

    fn discs(x_mm: &[f64]) -> Vec<Touch> {
        x_mm.iter().map(|x| Contact::flat(1e-3 * x, 0.0, 2e-3, 1e-3).into()).collect()
    }

    fn seen(x_mm: &[f64]) -> Solution {
        Solution {
            contacts: x_mm.iter().map(|x| FoundContact::flat(1e-3 * x, 0.0, 1e-3)).collect(),
            ..Solution::default()
        }
    }

    fn is_right(touches: &[Touch], solution: &Solution) -> bool {
        Judged::of(WRONG_M, touches, solution).is_right(|_| true)
    }

    #[test]
    fn contacts_beside_a_shape_or_an_image_are_no_answer() {
        let two = discs(&[-10.0, 10.0]);
        let contacts = seen(&[-10.0, 10.0]);
        assert!(is_right(&two, &contacts) && Judged::of(WRONG_M, &two, &contacts).is_number_right());
        let choice = |what: &str| Some(Choice { what: what.to_owned(), why: String::new() });
        let line = FoundShape::Line(FoundLine::default());
        let ring = FoundShape::Ring(FoundRing::default());
        for shape in [line, ring] {
            let answer = Solution { shape: Some(shape), choice: choice("line"), ..contacts.clone() };
            let judged = Judged::of(WRONG_M, &two, &answer);
            assert!(!judged.is_right(|_| true) && !judged.is_number_right() && judged.near.missed.len() == 2);
        }
        let image = Solution { image_s_per_m2: Some(vec![1.0]), choice: choice("image"), ..contacts.clone() };
        assert!(!is_right(&two, &image));
        let peaks = Solution { choice: None, ..image };
        assert!(is_right(&two, &peaks), "a solver that does not choose has contacts beside every image");
        let bar = Touch::flat([0.0; 2], Shape::Line { length_m: 0.02, width_m: 2e-3, angle_rad: 0.0 }, 1e-3);
        let of = |shape| Solution { shape: Some(shape), ..Solution::default() };
        assert!(is_right(std::slice::from_ref(&bar), &of(line)) && !is_right(std::slice::from_ref(&bar), &of(ring)));
        assert!(!is_right(&[bar], &contacts));
    }

    #[test]
    fn what_is_too_far_off_is_wrong_and_what_need_not_be_found_may_be_missed() {
        assert!(is_right(&discs(&[0.0]), &seen(&[2.2])) && !is_right(&discs(&[0.0]), &seen(&[2.3])));
        let judged =
            |answer: &Solution, has_to_be: bool| Judged::of(WRONG_M, &discs(&[0.0]), answer).is_right(|_| has_to_be);
        assert!(judged(&seen(&[]), false) && !judged(&seen(&[]), true) && !judged(&seen(&[5.0]), false));
        assert!((wrong_m(&Detector::default()) - WRONG_M).abs() < 1e-9);
    }

    #[test]
    fn an_answer_is_covered_by_standard_errors_that_hold_and_by_none_if_the_number_is_wrong() {
        let claims = |x_mm: &[f64], uncertainty| {
            let mut answer = seen(x_mm);
            answer.contacts.iter_mut().for_each(|contact| contact.uncertainty = uncertainty);
            Judged::of(WRONG_M, &discs(&[0.0]), &answer).is_covered()
        };
        let errors =
            |x_mm: f64| Some(Uncertainty { x_m: 1e-3 * x_mm, y_m: 1e-3, correlation: 0.0, conductance_s: 0.0 });
        assert!(claims(&[5.0], errors(2.0)) && !claims(&[5.0], errors(1.0)) && !claims(&[5.0], None));
        assert!(!claims(&[5.0, 6.0], errors(9.0)));
        // An ellipse across its error covers less than its axes would.
        let tilted = |correlation| Some(Uncertainty { x_m: 2e-3, y_m: 2e-3, correlation, conductance_s: 0.0 });
        assert!(claims(&[5.0], tilted(0.0)) && !claims(&[5.0], tilted(0.9)));
    }
}
