//! The clock of a recording: it runs at any speed, and stops.

use std::time::{Duration, Instant};

/// Tells when bytes of a recording are due.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    speed: f64,
    paused: bool,
    /// It was then at that time of the recording (us).
    since: Instant,
    from_us: u64,
}

impl Clock {
    /// A clock that runs `speed` times as fast as the recording was made.
    pub(super) fn new(speed: f64) -> Self {
        Self { speed, paused: false, since: Instant::now(), from_us: 0 }
    }

    pub(super) fn speed(&self) -> f64 {
        self.speed
    }

    pub(super) fn is_paused(&self) -> bool {
        self.paused
    }

    /// Goes on from a time of the recording (us).
    pub(super) fn restart(&mut self, time_us: u64, now: Instant) {
        (self.from_us, self.since) = (time_us, now);
    }

    /// Stops at a time of the recording (us), or goes on from there.
    pub(super) fn pause(&mut self, paused: bool, at_us: u64, now: Instant) {
        self.restart(at_us, now);
        self.paused = paused;
    }

    /// Goes on from a time of the recording (us) at another speed.
    pub(super) fn set_speed(&mut self, speed: f64, at_us: u64, now: Instant) {
        self.restart(at_us, now);
        self.speed = speed;
    }

    /// Where in the recording it is (us): far beyond its end if it is infinitely fast.
    pub(super) fn position_us(&self, now: Instant) -> u64 {
        match (self.paused, self.speed.is_finite()) {
            (true, _) => self.from_us,
            (false, false) => u64::MAX,
            (false, true) => {
                let elapsed_us = now.saturating_duration_since(self.since).as_secs_f64() * 1e6 * self.speed;
                self.from_us.saturating_add(elapsed_us as u64)
            }
        }
    }

    /// How long it is until what came at `time_us` is due: without end while it is stopped.
    pub(super) fn wait(&self, time_us: u64, now: Instant) -> Duration {
        if self.paused {
            return Duration::MAX;
        }
        if !self.speed.is_finite() {
            return Duration::ZERO;
        }
        let ahead_us = time_us.saturating_sub(self.from_us) as f64;
        let at = Duration::try_from_secs_f64(ahead_us * 1e-6 / self.speed).unwrap_or(Duration::MAX);
        at.saturating_sub(now.saturating_duration_since(self.since))
    }
}
