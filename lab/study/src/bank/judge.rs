//! An answer to a scene: what the [judge](crate::judge) says of each, and how far it is from the bound.

use super::scenes::scale;
use crate::bound::Bound;
use crate::judge::{self, wrong_m};
use tactomo_physics::detector::Detector;
use tactomo_physics::scene::{Contact, Touch};
use tactomo_touch::metrics::Pair;
use tactomo_touch::solve::{FoundContact, Solution};

/// What was found further off than what is wrong stands for a contact that nothing else stands for, if it is within so many of its bounds: the readings of a light contact
/// hold how strong it is, and not where.
const BOUNDS: f64 = 3.0;
/// A contact is visible if the bound on the logarithm of its conductance, for a known radius, is below this.
const VISIBLE: f64 = 0.2;
/// A contact is in a corner if both coordinates are beyond this share of the half sides: where single contacts were lost on `square-60`.
const CORNER: f64 = 0.72;
/// A contact is at a wall if its centre is within so many radii of it.
const WALL_RADII: f64 = 1.5;

/// An answer, contact by contact: discs that touch, and what was found.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Judged {
    /// Discs that touch.
    pub truth: Vec<TrueContact>,
    /// What was found.
    pub found: Vec<FoundContact>,
    /// Which of the found ones are not there, visible or not.
    pub invented: Vec<usize>,
    /// Whether the answer is of the kind that touches: contacts, a line, a ring, or an image of any other shape.
    pub is_kind_right: bool,
    /// Whether the solver says that its answer does not explain the readings.
    pub misfit: bool,
    /// Probability that the solver claims for its count.
    pub certainty: Option<f64>,
    /// Another number of contacts that the answer names, if it does.
    pub alternative: Option<usize>,
    /// The solver's own residual.
    pub residual: Option<f64>,
    /// What the solver chose and why, if it says so.
    pub choice: Option<String>,
}

/// A contact that is there.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TrueContact {
    /// The contact.
    #[serde(flatten)]
    pub contact: Contact,
    /// Its radius for electrodes at 15 mm (m).
    pub scaled_radius_m: f64,
    /// Its conductance in sheet conductances.
    pub sheets: f64,
    /// Where it is.
    pub place: Place,
    /// The Cramer-Rao bound; `None` if the readings do not separate the contacts.
    pub bound: Option<Bound>,
    /// Whether it can be found at this noise.
    pub is_visible: bool,
    /// What was found of it.
    pub found: Option<Match>,
}

/// Where on the detector a contact is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    /// Both coordinates far out.
    Corner,
    /// Near to one wall.
    Wall,
    /// Anywhere else.
    Inside,
}

/// What was found of a contact.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Match {
    /// Which of the found ones.
    pub index: usize,
    /// Distance (m).
    pub error_m: f64,
    /// The distance over its bound for an unknown radius.
    pub over_bound: Option<f64>,
    /// Errors of x and y in standard errors as the solver claims them, if it does.
    pub place_sigmas: Option<[f64; 2]>,
    /// Error of the logarithm of the conductance, likewise.
    pub conductance_sigmas: Option<f64>,
}

impl Judged {
    /// Compares a solution with what touches and with the bounds of the errors of its discs.
    pub(super) fn new(detector: &Detector, touches: &[Touch], bounds: Option<&[Bound]>, solution: &Solution) -> Self {
        let judge::Judged { found, truth, near, is_kind_right } =
            judge::Judged::of(wrong_m(detector), touches, solution);
        let bound_of = |index: usize| bounds.and_then(|bounds| bounds.get(index)).copied();
        let mut pairs = near.pairs;
        let (mut missed, mut invented) = (near.missed, near.invented);
        invented.retain(|found_index| {
            let distance_m = |index: usize| {
                (found[*found_index].x_m - truth[index].x_m).hypot(found[*found_index].y_m - truth[index].y_m)
            };
            let is_there =
                |index: &usize| bound_of(*index).is_some_and(|bound| distance_m(*index) < BOUNDS * bound.position_m);
            let Some(at) = missed.iter().position(is_there) else { return true };
            let index = missed.remove(at);
            pairs.push(Pair { truth: index, found: *found_index, distance_m: distance_m(index) });
            false
        });
        let of = |(index, contact): (usize, &Contact)| {
            let bound = bound_of(index);
            let pair = pairs.iter().find(|pair| pair.truth == index);
            TrueContact {
                contact: *contact,
                scaled_radius_m: contact.radius_m / scale(detector),
                sheets: contact.conductance_s / detector.sheet_conductance_s(),
                place: Place::of(detector, contact),
                bound,
                is_visible: bound.is_some_and(|bound| bound.conductance < VISIBLE),
                found: pair.map(|pair| Match::of(contact, bound, pair, &found[pair.found])),
            }
        };
        Self {
            truth: truth.iter().enumerate().map(of).collect(),
            found: found.to_vec(),
            invented,
            is_kind_right,
            misfit: solution.flags.misfit,
            certainty: solution.certainty,
            alternative: solution.alternative.map(|other| other.contacts),
            residual: solution.residual,
            choice: solution.choice.as_ref().map(|choice| format!("{}: {}", choice.what, choice.why)),
        }
    }

    /// The contacts that can be found at this noise.
    pub fn visible(&self) -> impl Iterator<Item = &TrueContact> {
        self.truth.iter().filter(|contact| contact.is_visible)
    }

    /// Whether as many contacts were found as are there.
    pub fn is_count_right(&self) -> bool {
        self.is_kind_right && self.found.len() == self.truth.len()
    }

    /// Whether as many contacts were found as are there, but for invisible ones.
    pub fn is_visible_count_right(&self) -> bool {
        self.is_kind_right && (self.visible().count()..=self.truth.len()).contains(&self.found.len())
    }

    /// Contacts invented, visible ones missed, and a shape or an image that is not there.
    pub fn faults(&self) -> usize {
        let missed = self.visible().filter(|contact| contact.found.is_none()).count();
        self.invented.len() + missed + usize::from(!self.is_kind_right)
    }

    /// Whether the answer says itself that it may be wrong: by its flag, or by the right number of contacts as its alternative.
    pub fn is_warned(&self) -> bool {
        self.misfit || self.alternative == Some(self.truth.len())
    }

    /// The largest error over its bound of the visible ones; 0 if none of them was found.
    pub fn largest_over_bound(&self) -> f64 {
        self.visible().filter_map(|contact| contact.found?.over_bound).fold(0.0, f64::max)
    }

    /// Conductance of the strongest contact over that of the lightest.
    pub fn contrast(&self) -> f64 {
        let conductances_s = || self.truth.iter().map(|contact| contact.contact.conductance_s);
        conductances_s().fold(0.0, f64::max) / conductances_s().fold(f64::INFINITY, f64::min)
    }
}

impl Place {
    fn of(detector: &Detector, contact: &Contact) -> Self {
        let half_m = detector.outline.size_m().map(|side_m| side_m / 2.0);
        let place_m = [contact.x_m.abs(), contact.y_m.abs()];
        let is_any = |is: &dyn Fn(usize) -> bool| [0, 1].map(is);
        match (
            is_any(&|axis| place_m[axis] > CORNER * half_m[axis]),
            is_any(&|axis| half_m[axis] - place_m[axis] < WALL_RADII * contact.radius_m),
        ) {
            ([true, true], _) => Self::Corner,
            (_, [false, false]) => Self::Inside,
            _ => Self::Wall,
        }
    }
}

impl Match {
    fn of(truth: &Contact, bound: Option<Bound>, pair: &Pair, found: &FoundContact) -> Self {
        let sigmas = |error: f64, sigma: f64| error.abs() / sigma.max(f64::MIN_POSITIVE);
        let log_ratio = (found.conductance_s / truth.conductance_s).ln();
        Self {
            index: pair.found,
            error_m: pair.distance_m,
            over_bound: bound.map(|bound| pair.distance_m / bound.position_m),
            place_sigmas: found.uncertainty.map(|claimed| {
                [sigmas(found.x_m - truth.x_m, claimed.x_m), sigmas(found.y_m - truth.y_m, claimed.y_m)]
            }),
            conductance_sigmas: found
                .uncertainty
                .map(|claimed| sigmas(log_ratio, claimed.conductance_s / found.conductance_s)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_touch::solve::{Flags, FoundLine, FoundShape, Uncertainty};

    const CLEAR: Bound = Bound { position_m: 1e-4, conductance: 0.05, axes_m: [0.0; 2] };
    const FAINT: Bound = Bound { position_m: 2e-3, conductance: 0.5, axes_m: [0.0; 2] };

    fn there(x_mm: f64, y_mm: f64) -> Contact {
        Contact::flat(1e-3 * x_mm, 1e-3 * y_mm, 2e-3, 1e-3)
    }

    fn touches(truth: &[Contact]) -> Vec<Touch> {
        truth.iter().copied().map(Touch::from).collect()
    }

    fn seen(x_mm: f64, y_mm: f64) -> FoundContact {
        FoundContact::flat(1e-3 * x_mm, 1e-3 * y_mm, 1e-3)
    }

    fn judged(truth: &[Contact], bounds: &[Bound], contacts: Vec<FoundContact>) -> Judged {
        let solution = Solution { contacts, flags: Flags { misfit: true, ..Flags::default() }, ..Solution::default() };
        Judged::new(&Detector::default(), &touches(truth), Some(bounds), &solution)
    }

    #[test]
    fn visible_contacts_are_missed_and_others_are_not() {
        let truth = [there(0.0, 0.0), there(20.0, 0.0), there(0.0, 20.0)];
        let bounds = [CLEAR, FAINT, CLEAR];
        let answer = judged(&truth, &bounds, vec![seen(0.3, 0.4)]);
        assert_eq!((answer.faults(), answer.visible().count(), answer.is_count_right()), (1, 2, false));
        assert!((answer.largest_over_bound() - 5.0).abs() < 1e-9 && answer.misfit);
        assert_eq!(answer.truth[2].found, None);
    }

    #[test]
    fn what_is_too_far_off_is_invented_and_what_readings_do_not_place_is_not() {
        let truth = [there(0.0, 0.0), there(20.0, 0.0)];
        let answer = judged(&truth, &[CLEAR, FAINT], vec![seen(0.0, 2.2), seen(24.0, 0.0), seen(-20.0, 0.0)]);
        assert_eq!((answer.faults(), &answer.invented[..]), (1, &[2][..]));
        let answer = judged(&truth, &[CLEAR, FAINT], vec![seen(0.0, 2.3), seen(24.0, 0.0)]);
        assert_eq!((answer.faults(), &answer.invented[..], answer.is_count_right()), (2, &[0][..], true));
        for bound in [FAINT, Bound { position_m: 2e-3, ..CLEAR }] {
            let answer = judged(&truth, &[CLEAR, bound], vec![seen(0.0, 0.1), seen(25.9, 0.0)]);
            let found = answer.truth[1].found.unwrap();
            assert!(answer.faults() == 0 && (found.error_m - 5.9e-3).abs() < 1e-9, "within three of its bounds");
            let answer = judged(&truth, &[CLEAR, bound], vec![seen(0.0, 0.1), seen(26.1, 0.0)]);
            assert_eq!((answer.faults(), answer.truth[1].found), (1 + usize::from(answer.truth[1].is_visible), None));
        }
    }

    #[test]
    fn a_line_where_nothing_visible_touches_is_a_fault() {
        let line = Solution { shape: Some(FoundShape::Line(FoundLine::default())), ..Solution::default() };
        let answer = Judged::new(&Detector::default(), &touches(&[there(0.0, 0.0)]), Some(&[FAINT]), &line);
        assert_eq!((answer.faults(), answer.is_visible_count_right()), (1, false));
    }

    #[test]
    fn without_a_bound_nothing_is_visible() {
        let solution = Solution { contacts: vec![seen(0.0, 0.0)], ..Solution::default() };
        let answer = Judged::new(&Detector::default(), &touches(&[there(0.0, 0.0)]), None, &solution);
        assert_eq!((answer.visible().count(), answer.faults()), (0, 0));
        assert!(answer.truth[0].found.is_some_and(|found| found.over_bound.is_none()));
    }

    #[test]
    fn errors_are_counted_in_claimed_standard_errors() {
        let uncertainty = Uncertainty { x_m: 1e-4, y_m: 2e-4, correlation: 0.0, conductance_s: 1e-4 };
        let conductance_s = 1e-3 * 0.3f64.exp();
        let found = FoundContact { conductance_s, uncertainty: Some(uncertainty), ..seen(10.3, -0.1) };
        let answer = judged(&[there(10.0, 0.0)], &[CLEAR], vec![found]);
        let found = answer.truth[0].found.unwrap();
        let [x, y] = found.place_sigmas.unwrap();
        let log = found.conductance_sigmas.unwrap();
        assert!((x - 3.0).abs() < 1e-9 && (y - 0.5).abs() < 1e-9, "{x} {y}");
        assert!((log - 0.3 * conductance_s / 1e-4).abs() < 1e-9, "{log}");
        assert_eq!(
            judged(&[there(0.0, 0.0)], &[CLEAR], vec![seen(0.0, 0.0)]).truth[0].found.unwrap().place_sigmas,
            None
        );
    }

    #[test]
    fn corners_come_before_walls() {
        let place = |x_mm, y_mm| Place::of(&Detector::default(), &there(x_mm, y_mm));
        assert_eq!(place(22.0, -22.0), Place::Corner);
        assert_eq!(place(28.0, 22.0), Place::Corner);
        assert_eq!(place(28.0, 0.0), Place::Wall);
        assert_eq!(place(0.0, -27.1), Place::Wall);
        assert_eq!(place(26.0, 0.0), Place::Inside);
        assert_eq!(place(22.0, 0.0), Place::Inside);
    }
}
