//! The board's clock, by what was said on the link.

use std::time::{Duration, Instant};

use tactomo_protocol::Clock;

use super::Session;
use crate::clock::{BoardClock, Delay};

/// Commands that were sent and not yet taken note of elsewhere: more are not kept for whoever does not ask.
const MOST_SENT: usize = 32;

/// Time between two askings of what the clock shows: the most that crystals differ by makes 0.1 ms of it.
const ASK_EVERY: Duration = Duration::from_secs(1);

/// The board's clock, and when it was asked.
#[derive(Debug)]
pub(super) struct Timing {
    opened: Instant,
    clock: BoardClock,
    sent: Vec<(u8, Instant)>,
    /// When a command was sent last.
    asked: Instant,
    /// Whether the board says what its clock shows.
    is_told: bool,
}

impl Timing {
    pub fn new(opened: Instant) -> Self {
        Self { opened, clock: BoardClock::default(), sent: Vec::new(), asked: opened, is_told: false }
    }

    /// Takes note of a command with this tag, which is about to be sent.
    pub fn asked(&mut self, tag: u8, now: Instant) {
        self.asked = now;
        self.clock.asked(tag, now.saturating_duration_since(self.opened));
        if self.sent.len() < MOST_SENT {
            self.sent.push((tag, now));
        }
    }

    /// Whether a board that says what its clock shows is to be asked again.
    pub fn is_due(&self, now: Instant) -> bool {
        self.is_told && now.saturating_duration_since(self.asked) >= ASK_EVERY
    }

    /// The board has started anew, and its clock with it.
    pub fn restart(&mut self) {
        self.clock.restart();
    }
}

impl Session {
    /// Tags of the commands that were sent since this was asked last, and when.
    pub fn take_sent(&mut self) -> Vec<(u8, Instant)> {
        std::mem::take(&mut self.timing.sent)
    }

    /// Takes what the board's clock showed when it obeyed a command.
    pub fn clock(&mut self, said: Clock, came: Instant) {
        self.timing.is_told = true;
        self.timing.clock.said(said, came.saturating_duration_since(self.timing.opened));
    }

    /// How long before it came a frame was scanned, by the board time in the middle of its scan (us).
    pub fn delay(&mut self, time_us: u32, came: Instant) -> Option<Delay> {
        self.timing.clock.frame(time_us, came.saturating_duration_since(self.timing.opened))
    }
}
