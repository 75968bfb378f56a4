//! How often a command is sent again that the board answers and does not follow.

use std::time::{Duration, Instant};

use tactomo_protocol::Command;

/// Pause before a command is sent for the third time; each further one is twice as long.
const FIRST_PAUSE: Duration = Duration::from_millis(500);
/// Doublings of the pause: 4 s at most.
const MOST_DOUBLINGS: u32 = 3;

/// The pauses of settings, plans, outputs and Start, each by itself: one that is not followed does not hold up the others.
#[derive(Debug, Default)]
pub(super) struct Paces {
    settings: Pace,
    plan: Pace,
    output: Pace,
    start: Pace,
}

/// How often a command was sent in vain.
#[derive(Debug, Default)]
struct Pace {
    sent: u32,
    not_before: Option<Instant>,
}

impl Paces {
    /// Whether it is time for a command.
    pub(super) fn allow(&mut self, command: &Command, now: Instant) -> bool {
        self.of(command).is_none_or(|pace| pace.not_before.is_none_or(|at| now >= at))
    }

    /// Takes note that a command is sent. The second time comes at once: the board may have started anew meanwhile.
    pub(super) fn sent(&mut self, command: &Command, now: Instant) {
        if let Some(pace) = self.of(command) {
            pace.not_before =
                pace.sent.checked_sub(1).map(|times| now + FIRST_PAUSE * (1 << times.min(MOST_DOUBLINGS)));
            pace.sent += 1;
        }
    }

    /// The board has followed a command of this kind, or another one of the kind is asked for: the next is sent at once.
    pub(super) fn restart(&mut self, kind: &Command) {
        if let Some(pace) = self.of(kind) {
            *pace = Pace::default();
        }
    }

    /// The pace of a command; questions have one of their own.
    fn of(&mut self, command: &Command) -> Option<&mut Pace> {
        match command {
            Command::Configure(_) => Some(&mut self.settings),
            Command::Scan(_) => Some(&mut self.plan),
            Command::Output(_) => Some(&mut self.output),
            Command::Start | Command::Stop => Some(&mut self.start),
            Command::Hello | Command::Rate { .. } | Command::Table(_) => None,
        }
    }
}
