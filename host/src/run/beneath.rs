//! Boards that read nothing below a voltage: where nothing is found by one, something may press more lightly than it can read.

use std::fmt;

use tactomo_physics::detector::Detector;
use tactomo_physics::readings::{Readings, Says};
use tactomo_touch::solve::Solution;

/// Nothing was found, by a board whose converters read nothing below a floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beneath {
    /// The highest of their floors (V).
    pub floor_v: f64,
    /// Whether a reading is above it: then something presses.
    pub is_pressed: bool,
}

impl Beneath {
    /// Of the answer to readings as they are used, by a detector as its board measures it; `None` where something was found, or nothing hides.
    pub fn of(detector: &Detector, used: &Readings, solution: &Solution) -> Option<Self> {
        let is_found = !solution.contacts.is_empty() || solution.shape.is_some() || solution.image_s_per_m2.is_some();
        let floor =
            |pad: &tactomo_physics::detector::Electrode| Some(detector.converters.get(pad.converter)?.range_v[0]);
        let floor_v = detector.electrodes.iter().filter_map(floor).fold(0.0, f64::max);
        if is_found || floor_v <= 0.0 {
            return None;
        }
        let kept = || (0..used.electrodes()).filter(|e| !solution.flags.excluded.contains(e));
        let is_above = |g, e| g != e && matches!(used.says(g, e), Says::Voltage | Says::AtLeast);
        Some(Self { floor_v, is_pressed: kept().any(|g| kept().any(|e| is_above(g, e))) })
    }
}

impl fmt::Display for Beneath {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { floor_v, is_pressed } = self;
        let begins = if *is_pressed { "something touches," } else { "nothing touches, or it is" };
        write!(formatter, "{begins} pressed more lightly than this board can read ({floor_v:.2} V)")
    }
}

/// Board time without anything found after which that is said (us).
const SAID_AFTER_US: u64 = 1_000_000;

/// Says once a run that a board reads nothing below its floor, where nothing is found for a while.
#[derive(Debug, Default)]
pub(super) struct BeneathNotice {
    since_us: Option<u64>,
    is_said: bool,
}

impl BeneathNotice {
    /// Takes what there is beneath an answer to the frame of a board time (us); what to say now, if anything.
    pub fn take(&mut self, beneath: Option<Beneath>, time_us: u64) -> Option<Beneath> {
        let Some(beneath) = beneath.filter(|_| !self.is_said) else {
            self.since_us = None;
            return None;
        };
        let since_us = *self.since_us.get_or_insert(time_us);
        self.is_said = time_us.saturating_sub(since_us) >= SAID_AFTER_US;
        self.is_said.then_some(beneath)
    }
}

#[cfg(test)]
mod tests {
    use tactomo_physics::detector::ConverterErrors;
    use tactomo_physics::readings::Range;
    use tactomo_touch::solve::{Flags, FoundContact};

    use super::*;

    /// What 16 electrodes read of which all but the last are at a floor of 0.142 V.
    fn beneath(last_v: f64, floor_v: f64, solution: &Solution) -> Option<Beneath> {
        let converters = vec![ConverterErrors { gain_share: 0.01, bow_v: 0.01, range_v: [floor_v, 3.1] }];
        let used = Readings::from_fn(16, |_, e| if e == 15 { last_v } else { 0.0 });
        let used = used.within(&[Range { floor_v: floor_v + 0.006, ceiling_v: 3.0 }; 16]);
        Beneath::of(&Detector { converters, ..Detector::default() }, &used, solution)
    }

    #[test]
    fn what_presses_more_lightly_than_a_board_reads_is_told_of_those_with_a_floor_alone() {
        let nothing = Solution::default();
        let said = |found: Option<Beneath>| found.map(|beneath| beneath.to_string());
        let lightly = "pressed more lightly than this board can read (0.14 V)";
        assert_eq!(said(beneath(0.0, 0.142, &nothing)), Some(format!("nothing touches, or it is {lightly}")));
        assert_eq!(said(beneath(0.3, 0.142, &nothing)), Some(format!("something touches, {lightly}")));
        let broken = Solution { flags: Flags { excluded: vec![15], ..Flags::default() }, ..Solution::default() };
        assert_eq!(
            beneath(2.0, 0.142, &broken).map(|beneath| beneath.is_pressed),
            Some(false),
            "a broken wire presses"
        );
        assert_eq!(beneath(0.0, 0.0, &nothing), None, "nothing hides");
        let found = Solution { contacts: vec![FoundContact::flat(0.0, 0.0, 1e-4)], ..Solution::default() };
        assert_eq!(beneath(0.3, 0.142, &found), None);
    }

    #[test]
    fn it_is_said_once_where_nothing_is_found_for_a_second() {
        let beneath = beneath(0.0, 0.142, &Solution::default());
        let mut notice = BeneathNotice::default();
        let mut said = |beneath, time_ms: u64| notice.take(beneath, 1000 * time_ms).is_some();
        assert!(!said(beneath, 0) && !said(None, 900) && !said(beneath, 1000) && !said(beneath, 1900));
        assert!(said(beneath, 2000) && !said(beneath, 4000) && !said(beneath, 8000));
    }
}
