//! Fewer events a second, where somebody wants fewer: the newest of those that are due together.

use std::sync::Arc;

use tactomo_touch::pointer::PointerEvent;

use crate::run::TouchEvent;

/// An event and what the pointer has done since the one before that was let through.
type Due = (Arc<TouchEvent>, Vec<PointerEvent>);

/// Lets so many events through a second of board time. What comes between waits: it is let through when the next one is due, unless a newer one
/// has come by then, or when nothing more comes. What the pointer did is not lost with it.
#[derive(Debug, Default)]
pub(super) struct Decimator {
    /// Least time between two (us); none lets all through.
    period_us: Option<u64>,
    /// Board time at which the next one is due (us).
    due_us: Option<u64>,
    held: Option<Arc<TouchEvent>>,
    pointer_events: Vec<PointerEvent>,
}

impl Decimator {
    /// At most so many a second; all of them if that is not said.
    pub fn new(most_per_s: Option<f64>) -> Self {
        let period_us = most_per_s.map(|most_per_s| (1e6 / most_per_s) as u64);
        Self { period_us, ..Self::default() }
    }

    /// Takes an event: gives it back if one is due.
    pub fn take(&mut self, event: Arc<TouchEvent>) -> Option<Due> {
        let Some(period_us) = self.period_us else {
            let pointer_events = event.pointer_events.clone();
            return Some((event, pointer_events));
        };
        self.pointer_events.extend_from_slice(&event.pointer_events);
        let now_us = event.frame.board_time_us;
        // A board that starts anew, or a recording that is played again, is due at once.
        let is_due = self.due_us.is_none_or(|due_us| now_us >= due_us || now_us + 2 * period_us < due_us);
        self.held = Some(event);
        if !is_due {
            return None;
        }
        // In step, so that the rate is the one asked for; where events were missing, from here on.
        let step = self.due_us.map(|due_us| due_us + period_us).filter(|next_us| *next_us > now_us);
        self.due_us = step.filter(|next_us| *next_us <= now_us + period_us).or(Some(now_us + period_us));
        self.held()
    }

    /// What waits, if something does.
    pub fn held(&mut self) -> Option<Due> {
        Some((self.held.take()?, std::mem::take(&mut self.pointer_events)))
    }
}

#[cfg(test)]
mod tests {
    use tactomo_touch::solve::Solution;

    use super::*;
    use crate::run::Frame;

    fn event(time_us: u64, pointer_events: &[PointerEvent]) -> Arc<TouchEvent> {
        let event = TouchEvent::of(0, Solution::default());
        let frame = Frame { board_time_us: time_us, ..event.frame };
        Arc::new(TouchEvent { frame, pointer_events: pointer_events.to_vec(), ..event })
    }

    /// Board times of what is let through (us).
    fn through(decimator: &mut Decimator, times_us: impl IntoIterator<Item = u64>) -> Vec<u64> {
        let times_us = times_us.into_iter();
        times_us
            .filter_map(|time_us| decimator.take(event(time_us, &[])))
            .map(|(event, _)| event.frame.board_time_us)
            .collect()
    }

    #[test]
    fn the_rate_is_the_one_that_was_asked_for() {
        // 832 us a frame are 1202 frames a second; 20 s of them.
        let frames = || (0..24_038).map(|i| 832 * i);
        for most_per_s in [10.0, 60.0, 500.0, 1000.0] {
            let count = through(&mut Decimator::new(Some(most_per_s)), frames()).len() as f64;
            assert!((count - 20.0 * most_per_s).abs() <= 1.0 + 0.001 * count, "{most_per_s}: {count}");
        }
        assert_eq!(through(&mut Decimator::new(Some(5000.0)), frames()).len(), 24_038);
        assert_eq!(through(&mut Decimator::new(None), frames()).len(), 24_038);
    }

    #[test]
    fn the_last_one_waits_until_nothing_more_comes_and_clocks_may_begin_again() {
        let mut decimator = Decimator::new(Some(100.0));
        assert_eq!(through(&mut decimator, [0, 1000, 2000]), [0]);
        assert_eq!(decimator.held().map(|(event, _)| event.frame.board_time_us), Some(2000));
        assert!(decimator.held().is_none());
        assert_eq!(through(&mut decimator, [50_000, 60_000, 500]), [50_000, 60_000, 500]);
    }

    #[test]
    fn no_click_is_lost_between_two() {
        let mut decimator = Decimator::new(Some(100.0));
        let given = [(0, vec![]), (1000, vec![PointerEvent::Press]), (2000, vec![]), (10_000, vec![])];
        let due: Vec<_> =
            given.iter().filter_map(|(time_us, events)| decimator.take(event(*time_us, events))).collect();
        assert_eq!((due.len(), &due[1].1), (2, &vec![PointerEvent::Press]));
    }
}
