//! The time between frames, by the board's clock.

use std::time::Duration;

use super::sequence::Place;

/// Board time over which the interval is measured (us): the first time, and from then on.
const MEASURED_OVER_US: [u64; 2] = [100_000, 1_000_000];

/// Measures the time between frames. The board's clock tells what it is, however late the host is with them.
#[derive(Clone, Debug)]
pub struct Pace {
    /// How many times faster than the board measured its frames come.
    speed: f64,
    since: Option<Place>,
    period: Option<Duration>,
}

impl Pace {
    /// For frames that come `speed` times faster than the board measured them; infinite where they wait for the host.
    pub fn new(speed: f64) -> Self {
        Self { speed, since: None, period: None }
    }

    /// Takes note of a frame; returns whether the period was measured anew.
    pub fn note(&mut self, place: &Place) -> bool {
        let since = *self.since.get_or_insert(*place);
        let scans = place.sequence.checked_sub(since.sequence);
        let Some((scans, time_us)) = scans.zip(place.time_us.checked_sub(since.time_us)) else {
            self.since = Some(*place); // The board has started anew.
            return false;
        };
        if time_us < MEASURED_OVER_US[usize::from(self.period.is_some())] || scans == 0 || !self.speed.is_finite() {
            return false;
        }
        self.since = Some(*place);
        self.period = Some(Duration::from_secs_f64(time_us as f64 * 1e-6 / scans as f64 / self.speed));
        true
    }

    /// Time between frames, missing ones counted; `None` until it is known, and where frames wait for the host.
    pub fn period(&self) -> Option<Duration> {
        self.period
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Notes of scans of 2 ms, and how often the period was measured.
    fn notes(pace: &mut Pace, scans: impl Iterator<Item = u64>) -> usize {
        scans.filter(|scan| pace.note(&Place { sequence: *scan, time_us: scan * 2000, dropped: 0 })).count()
    }

    #[test]
    fn missing_frames_count_and_a_new_start_does_not() {
        let mut pace = Pace::new(1.0);
        assert_eq!(notes(&mut pace, 100..150), 0);
        assert_eq!((notes(&mut pace, 150..151), pace.period()), (1, Some(Duration::from_millis(2))));
        assert_eq!(notes(&mut pace, (151..2151).filter(|scan| scan % 3 == 0)), 3, "once a second");
        assert_eq!(pace.period(), Some(Duration::from_millis(2)));
        assert_eq!((notes(&mut pace, 0..400), pace.period()), (0, Some(Duration::from_millis(2))));
    }

    #[test]
    fn a_recording_has_the_pace_at_which_it_is_played() {
        let mut slow = Pace::new(0.25);
        notes(&mut slow, 0..100);
        assert_eq!(slow.period(), Some(Duration::from_millis(8)));
        let mut at_once = Pace::new(f64::INFINITY);
        assert_eq!((notes(&mut at_once, 0..5000), at_once.period()), (0, None));
    }
}
