//! Which rows the board is asked to scan: whole frames, some grounds, or what the scene needs at the moment.
//!
//! A wire carries so many rows a second, whatever they are; the board scans each again until it has room. While nothing touches two grounds see a touch come, wherever it is. What
//! stands is read in whole frames, which are averaged; of what moves those grounds that tell most of it are scanned most, and all others in turn, for what is
//! new. Where the answer is a line, a ring or an image, or rows do not fit, whole frames are scanned.

mod choice;
mod request;

use std::sync::Arc;
use std::time::Instant;

use tactomo_physics::detector::Detector;
use tactomo_protocol::{MAX_PLAN_ROWS, Plan, Settings};
use tactomo_touch::scanning::{Attention, FOCUS, spread, with_others};

pub use self::choice::ScanChoice;
pub(super) use self::request::{PlanRequests, RequestedPlan};

/// Rows of a frame of an adaptive plan: 2000 frames/s at 921600 baud, where one row would be 2800 and tell each time of one ground alone.
const ROWS: usize = 2;
/// Rows of a frame of a list, at most.
const LIST_ROWS: usize = 8;

/// Chooses plans.
pub(super) struct Planner {
    choice: ScanChoice,
    requested: Arc<RequestedPlan>,
    begun: Instant,
    attention: Attention,
    /// Whether the plan of a choice that is not adaptive was requested.
    is_requested: bool,
}

impl Planner {
    /// Begins with whole frames; plans go to `requested`.
    pub fn new(choice: ScanChoice, requested: Arc<RequestedPlan>) -> Self {
        let attention = Attention::new(FOCUS);
        Self { choice, requested, begun: Instant::now(), attention, is_requested: false }
    }

    /// Begins anew, as with another board.
    pub fn restart(&mut self) {
        *self = Self::new(self.choice.clone(), Arc::clone(&self.requested));
    }

    /// Requests a plan, if it is time for another: `telling` are the grounds that tell most, so many as they are asked for, and
    /// `touches` is whether anything touches, `conversions` how many a reading is the mean of by the settings.
    pub fn consider(
        &mut self,
        detector: &Detector,
        (touches, conversions): (bool, u32),
        telling: impl FnOnce(usize) -> Option<Vec<usize>>,
    ) {
        if self.choice == ScanChoice::Whole || self.requested.is_refused() {
            return;
        }
        let is_new = match self.choice {
            ScanChoice::Adaptive => self.attention.consider(self.begun.elapsed().as_secs_f64(), touches, telling),
            _ => !std::mem::replace(&mut self.is_requested, true),
        };
        if is_new {
            let plan = self.plan(detector);
            let average_log2 = conversions.max(1).ilog2().min(Settings::MAX_AVERAGE_LOG2.into()) as u8;
            let average_log2 = if plan.is_whole() { 0 } else { average_log2 };
            self.requested.put(Plan { average_log2, ..plan });
        }
    }

    fn plan(&self, detector: &Detector) -> Plan {
        let electrodes = detector.electrodes.len();
        match &self.choice {
            ScanChoice::Whole => Plan::default(),
            ScanChoice::Four => listed(&spread(detector, 4), electrodes),
            ScanChoice::Grounds(grounds) => {
                let grounds: Vec<usize> = grounds.iter().map(|ground| usize::from(*ground)).collect();
                listed(&grounds, electrodes)
            }
            ScanChoice::Adaptive => {
                self.attention.grounds().map_or_else(Plan::default, |grounds| adaptive(grounds, electrodes))
            }
        }
    }
}

/// A plan of these grounds, round and round.
fn listed(grounds: &[usize], electrodes: usize) -> Plan {
    let rows_a_frame =
        (1..=LIST_ROWS.min(electrodes)).rev().find(|rows| grounds.len().is_multiple_of(*rows)).unwrap_or(1);
    plan(grounds.iter().copied(), rows_a_frame, electrodes)
}

/// A plan of these grounds, and all others in turn; whole frames where these are all.
fn adaptive(focus: &[usize], electrodes: usize) -> Plan {
    if focus.len() >= electrodes {
        return Plan::default();
    }
    let rows = with_others(focus, electrodes, MAX_PLAN_ROWS);
    let rows_a_frame = if rows.len().is_multiple_of(ROWS) { ROWS } else { 1 };
    plan(rows.into_iter(), rows_a_frame, electrodes)
}

fn plan(grounds: impl Iterator<Item = usize>, rows_a_frame: usize, electrodes: usize) -> Plan {
    Plan {
        grounds: grounds.take(MAX_PLAN_ROWS).filter_map(|ground| u8::try_from(ground).ok()).collect(),
        reads: u32::MAX >> (u32::BITS as usize - electrodes.clamp(1, u32::BITS as usize)),
        rows_a_frame: rows_a_frame as u8,
        average_log2: 0,
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use tactomo_touch::scanning::{PAUSE_S, SHORT_PAUSE_S};

    fn pause(pause_s: f64) {
        std::thread::sleep(Duration::from_secs_f64(pause_s));
    }

    fn planner(choice: ScanChoice) -> (Planner, Arc<RequestedPlan>) {
        let requested = Arc::default();
        (Planner::new(choice, Arc::clone(&requested)), requested)
    }

    fn detector() -> Detector {
        Detector::preset(Detector::DEFAULT).unwrap()
    }

    #[test]
    fn plans_are_those_that_boards_take() {
        for electrodes in [4, 9, 16, 25, 32] {
            for focus in [vec![1, 2], vec![0, 1, 3]] {
                let plan = adaptive(&focus, electrodes);
                assert!(plan.is_valid(electrodes as u8), "{electrodes}: {plan:?}");
                let all = (0..electrodes as u8).all(|ground| plan.grounds.contains(&ground));
                assert!(all, "{electrodes}: every ground has its turn");
            }
            assert!(listed(&[0, 3, 1], electrodes).is_valid(electrodes as u8));
        }
        assert!(adaptive(&(0..16).collect::<Vec<_>>(), 16).is_whole(), "all grounds are a whole frame");
        let of_16 = adaptive(&[5, 10], 16);
        assert_eq!((&of_16.grounds[..8], of_16.rows_a_frame), (&[5, 10, 5, 0, 10, 5, 10, 1][..], 2));
    }

    #[test]
    fn a_plan_is_requested_when_what_touches_has_changed() {
        let (mut planner, requested) = planner(ScanChoice::Adaptive);
        let detector = detector();
        planner.consider(&detector, (false, 1), |_| Some(vec![5, 10]));
        let at_rest = requested.take().unwrap();
        planner.consider(&detector, (false, 1), |_| Some(vec![6, 9]));
        assert_eq!(requested.take(), None, "too soon");
        pause(SHORT_PAUSE_S);
        planner.consider(&detector, (true, 1), |count| Some(vec![1; count]));
        let touched = requested.take().unwrap();
        assert!(touched != at_rest && touched.grounds[..3] == [1, 1, 1]);
        pause(PAUSE_S);
        planner.consider(&detector, (true, 1), |_| None);
        assert!(requested.take().unwrap().is_whole(), "an image takes whole frames");
        requested.set_refused(true);
        pause(PAUSE_S);
        planner.consider(&detector, (false, 1), |_| Some(vec![5, 10]));
        assert_eq!(requested.take(), None);
    }

    #[test]
    fn whole_frames_are_nothing_to_ask_for() {
        let (mut planner, requested) = planner(ScanChoice::Whole);
        planner.consider(&detector(), (true, 1), |_| Some(vec![1, 2]));
        assert_eq!(requested.take(), None);
    }
}
