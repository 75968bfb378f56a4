//! What a calibration is worth, on presses that it was not fitted to, and what it is missing.

use std::fmt;
use std::sync::Arc;

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::ForwardModel;
use tactomo_physics::scene::Contact;

use super::CalibrateError;
use super::presses::Mean;
use crate::solve::{ContactSettings, Contacts, Problem, Solver};

/// Share of the presses that is held out, and most of them.
const SHARE: f64 = 1.0 / 6.0;
const MOST: usize = 24;
/// Fewest presses from which some are held out: of fewer all are needed.
const ENOUGH: usize = 12;
/// Share of the expected error of places before that has to be gone.
const BETTER: f64 = 0.05;

/// Sheet conductances from which a press is firm.
const FIRM: f64 = 0.3;
/// Share of the presses that light ones, and firm ones, have to be.
const EACH: f64 = 0.15;
/// Presses that are fitted at least for a calibration that nothing is missing for.
const USUAL: usize = 24;
/// Parts of each side that have to be pressed in.
const PARTS: usize = 3;

/// What the detector as described, and the one found, leave of presses that were not used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOut {
    /// How many.
    pub presses: usize,
    /// What a single contact on the detector as described, and on the one found, leaves of them: median, in standard deviations of a frame's noise.
    pub residuals: [f64; 2],
    /// Expected standard error of places (m) by what is known of the detector as described, and of the one found: median over the detector.
    pub place_errors_m: [f64; 2],
    /// What a single contact leaves of them on [the other detector](super::RubSettings::rival) that was asked for.
    pub rival: Option<f64>,
}

impl HeldOut {
    /// Share by which the residual of so few presses may be larger by chance: of 24 presses of 240 readings it scatters by a hundredth.
    pub const CHANCE: f64 = 0.03;

    /// Whether the detector that was found is better: presses that it does not know fit no worse, and places are known better.
    pub fn helped(&self) -> bool {
        let [before, after] = self.residuals;
        let [before_m, after_m] = self.place_errors_m;
        after <= (1.0 + Self::CHANCE) * before && after_m < (1.0 - BETTER) * before_m
    }
}

/// What a rub is missing.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Missing {
    /// More presses.
    Presses(usize),
    /// Firm ones.
    Firm,
    /// Light ones.
    Light,
    /// Presses near a place, x and y (m).
    Place([f64; 2]),
}

impl fmt::Display for Missing {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Presses(count) => write!(formatter, "rub longer: there are {count} presses only"),
            Self::Firm => formatter.write_str("press harder now and then: hardly a press was firm"),
            Self::Light => formatter.write_str("press lighter now and then: hardly a press was light"),
            Self::Place([x_m, y_m]) => {
                write!(formatter, "rub near ({:.0}, {:.0}) mm too: nothing has pressed there", 1e3 * x_m, 1e3 * y_m)
            }
        }
    }
}

/// Presses that are held out of so many: every sixth or so, in the order in which they came; `is_needed` are not.
pub(super) fn chosen(count: usize, is_needed: impl Fn(usize) -> bool) -> Vec<usize> {
    if count < ENOUGH {
        return Vec::new();
    }
    let held = ((SHARE * count as f64) as usize).min(MOST);
    let step = count / held;
    (0..held).map(|index| index * step + step / 2).filter(|index| !is_needed(*index)).collect()
}

/// What single contacts leave of presses on a detector that is taken as exact: median of the residuals, in standard deviations of the noise.
pub(super) fn residual(model: &Arc<dyn ForwardModel>, presses: &[Mean]) -> Result<Option<f64>, CalibrateError> {
    let problem = Problem::new(Arc::clone(model));
    let mut solver = Contacts::new(&problem, ContactSettings { most: 1, ..ContactSettings::of(&problem) })?;
    let mut residual = |press: &Mean| {
        solver.reset();
        let mut readings = press.readings.clone();
        readings.correct_channels(model.detector());
        solver.solve(&readings).ok()?.residual
    };
    let mut sorted: Vec<f64> = presses.iter().filter_map(&mut residual).collect();
    sorted.sort_by(f64::total_cmp);
    Ok(sorted.get(sorted.len() / 2).copied())
}

/// What presses that were found at these contacts are missing, what matters most first.
pub(super) fn missing(contacts: &[Contact], detector: &Detector) -> Vec<Missing> {
    let few = (contacts.len() < USUAL).then_some(Missing::Presses(contacts.len()));
    let firm_s = FIRM * detector.sheet_conductance_s();
    let firm = contacts.iter().filter(|contact| contact.conductance_s >= firm_s).count() as f64;
    let least = EACH * contacts.len() as f64;
    let firmness =
        [(firm < least).then_some(Missing::Firm), (contacts.len() as f64 - firm < least).then_some(Missing::Light)];
    let [low, high] = detector.outline.bounds();
    let part = |axis: usize, at_m: f64| {
        let share = (at_m - low[axis]) / (high[axis] - low[axis]);
        ((share * PARTS as f64).max(0.0) as usize).min(PARTS - 1)
    };
    let at: Vec<[usize; 2]> = contacts
        .iter()
        .map(|contact| detector.map_m([contact.x_m, contact.y_m, contact.z_m]))
        .map(|at_m| [part(0, at_m[0]), part(1, at_m[1])])
        .collect();
    let empty = (0..PARTS * PARTS).map(|index| [index % PARTS, index / PARTS]).filter(|part| !at.contains(part));
    let middle = |axis: usize, part: usize| low[axis] + (part as f64 + 0.5) / PARTS as f64 * (high[axis] - low[axis]);
    let places = empty.map(|[i, j]| [middle(0, i), middle(1, j)]).filter(|at_m| detector.outline.holds(*at_m));
    few.into_iter().chain(firmness.into_iter().flatten()).chain(places.map(Missing::Place)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rose_has_not_helped() {
        let of = |residuals, place_errors_m| HeldOut { presses: 24, residuals, place_errors_m, rival: None }.helped();
        assert!(of([3.0, 1.1], [0.6e-3, 0.2e-3]), "both fell");
        assert!(of([1.0, 1.01], [0.6e-3, 0.2e-3]), "a detector that was as described");
        assert!(!of([1.0, 1.3], [0.6e-3, 0.2e-3]), "it fits worse");
        assert!(!of([3.0, 1.1], [0.68e-3, 0.75e-3]), "places are known worse");
        assert!(!of([3.0, 1.1], [0.68e-3, 0.67e-3]), "hardly better");
    }

    #[test]
    fn some_of_the_presses_are_held_out_but_none_that_is_needed() {
        assert!(chosen(11, |_| false).is_empty());
        assert_eq!(chosen(24, |_| false), [3, 9, 15, 21]);
        assert_eq!(chosen(24, |index| index == 9), [3, 15, 21]);
        assert_eq!(chosen(6000, |_| false).len(), MOST);
    }

    #[test]
    fn it_says_what_is_missing() {
        let detector = Detector::default();
        let at = |share: [f64; 2], sheets: f64| {
            let [x_m, y_m] = share.map(|share| 0.06 * (share - 0.5));
            Contact::flat(x_m, y_m, 0.002, sheets * detector.sheet_conductance_s())
        };
        let all = |sheets: &dyn Fn(usize) -> f64, is_there: &dyn Fn([usize; 2]) -> bool| {
            let part = |index: usize| [index % 3, index / 3 % 3];
            let there = (0..36).filter(|index| is_there(part(*index)));
            there.map(|i| at(part(i).map(|p| (p as f64 + 0.5) / 3.0), sheets(i / 9))).collect::<Vec<_>>()
        };
        let both = |i: usize| [0.1, 1.0][i % 2];
        assert_eq!(missing(&all(&both, &|_| true), &detector), []);
        assert_eq!(missing(&all(&|_| 0.1, &|_| true), &detector), [Missing::Firm]);
        assert_eq!(missing(&all(&|_| 1.0, &|_| true), &detector), [Missing::Light]);
        let [Missing::Place(at_m)] = missing(&all(&both, &|part| part != [0, 2]), &detector)[..] else { panic!() };
        assert!((at_m[0] + 0.02).abs() < 1e-9 && (at_m[1] - 0.02).abs() < 1e-9, "{at_m:?}");
        assert_eq!(Missing::Place(at_m).to_string(), "rub near (-20, 20) mm too: nothing has pressed there");
        assert_eq!(missing(&all(&both, &|_| true)[..9], &detector)[..2], [Missing::Presses(9), Missing::Firm]);
    }
}
