//! The rate of the line: which to try, whether it keeps what is sent, and when to leave it.
//!
//! From the rate that the link was opened at, the next higher one is tried as long as the last kept everything. So a bridge that does not keep one of
//! them costs one trial that fails, 0.4 s, whichever it is; one that keeps all three costs fifteen round trips.

use std::cmp::Ordering;
use std::time::{Duration, Instant};

use tactomo_protocol::Command;

use super::damage::Damage;

/// Rates that are tried above the first (bits a second), ascending: those that common USB bridges make (docs/firmware.md).
pub const RATES: [u32; 3] = [1_500_000, 2_000_000, 3_000_000];

/// Questions that are sent together: a board has room for so many answers that wait.
const BURST: u32 = 4;
/// Bursts of Hello in a trial: twelve answers, some 900 bytes.
const BURSTS: u32 = 3;
/// A trial that has taken so long has failed; the board gives it up after 300 ms.
const TRIAL: Duration = Duration::from_millis(250);
/// So long after a trial began the board is surely back from it: its 300 ms, and a row in which it does not look.
const BACK: Duration = Duration::from_millis(380);
/// A board at a higher rate is to hear something this often; after 2 s without, it goes back to its first.
pub(super) const KEEP_ALIVE: Duration = Duration::from_millis(500);
/// The link goes back to the first rate when nothing whole has come for this long, in which the board was asked three times.
const SILENCE: Duration = Duration::from_millis(1500);

/// What is going on.
#[derive(Debug, Default)]
enum Phase {
    #[default]
    Idle,
    /// The board has taken a rate, and the link is to follow.
    Follow(u32),
    /// A rate is on trial.
    Trial(Trial),
    /// The board is going back to the rate that is kept; nothing is said until then.
    Back(Instant),
}

/// A rate on trial: bursts of Hello that all have to be answered, and one that confirms the rate.
#[derive(Debug)]
struct Trial {
    baud: u32,
    began: Instant,
    burst: u32,
    /// Questions of the burst that are not sent yet.
    unsent: u32,
    /// Tags of those that are not answered yet.
    unanswered: Vec<u8>,
}

/// The rate of a link that has one.
#[derive(Debug)]
pub(super) struct Rates {
    /// All rates (bits a second), from the one on that the link was opened at.
    all: Vec<u32>,
    /// The last that board and host agreed on, and the highest that is worth a trial, by their places in `all`.
    kept: usize,
    highest: usize,
    /// What the link is set to (bits a second).
    link_baud: u32,
    phase: Phase,
    /// When something whole came last, and when a command was sent last.
    heard: Instant,
    sent: Instant,
    damage: Damage,
    /// The highest before the line fell silent, as it also does when the board is reset.
    before_silence: Option<usize>,
    /// What people were told of last (bits a second).
    told: u32,
}

impl Rates {
    /// A link that was opened at so many bits a second.
    pub(super) fn new(baud: u32, now: Instant) -> Self {
        let all: Vec<u32> = std::iter::once(baud).chain(RATES.into_iter().filter(|rate| *rate > baud)).collect();
        Self {
            highest: all.len() - 1,
            all,
            kept: 0,
            link_baud: baud,
            phase: Phase::Idle,
            heard: now,
            sent: now,
            damage: Damage::default(),
            before_silence: None,
            told: baud,
        }
    }

    /// Bits a second that the link is set to.
    pub(super) fn link_baud(&self) -> u32 {
        self.link_baud
    }

    fn kept_baud(&self) -> u32 {
        self.all[self.kept]
    }

    /// The first rate, if board and host agreed on another.
    pub(super) fn first_if_raised(&self) -> Option<u32> {
        (self.kept > 0).then(|| self.all[0])
    }

    /// Whether a change is under way, in which nothing else is said.
    pub(super) fn is_changing(&self) -> bool {
        !matches!(self.phase, Phase::Idle)
    }

    /// The rate to ask the board for, if there is a better one.
    pub(super) fn due(&self) -> Option<u32> {
        match self.kept.cmp(&self.highest) {
            Ordering::Less => Some(self.all[self.kept + 1]),
            Ordering::Equal => None,
            Ordering::Greater => Some(self.all[self.highest]),
        }
    }

    /// Whether the board is to hear something, so that it keeps its rate.
    pub(super) fn is_keep_alive_due(&self, now: Instant) -> bool {
        self.kept > 0 && now.saturating_duration_since(self.sent) >= KEEP_ALIVE
    }

    /// Takes note of a command that is sent.
    pub(super) fn sent(&mut self, now: Instant) {
        self.sent = now;
    }

    /// Takes note of something that came whole.
    pub(super) fn heard(&mut self, now: Instant) {
        self.heard = now;
    }

    /// Takes note of how many packets came damaged since the link was opened.
    pub(super) fn damaged(&mut self, total: u64, now: Instant) {
        let counts = self.kept > 0 && !self.is_changing();
        if self.damage.is_too_much(total, counts, now) && self.highest >= self.kept {
            self.highest = self.kept - 1;
            tracing::warn!(
                "packets arrive damaged at {} baud: the line goes on at {}",
                self.kept_baud(),
                self.all[self.highest]
            );
        }
    }

    /// What the link is to be set to now, if that is something else than it is.
    pub(super) fn link_due(&mut self, now: Instant) -> Option<u32> {
        self.look(now);
        let wanted = match &self.phase {
            Phase::Follow(baud) => *baud,
            Phase::Trial(trial) => trial.baud,
            Phase::Idle | Phase::Back(_) => self.kept_baud(),
        };
        (wanted != self.link_baud).then_some(wanted)
    }

    /// Ends what has taken too long.
    fn look(&mut self, now: Instant) {
        match &self.phase {
            Phase::Trial(trial) if now >= trial.began + TRIAL => self.trial_failed(now),
            Phase::Back(until) if now >= *until => (self.phase, self.heard) = (Phase::Idle, now),
            Phase::Idle if self.kept > 0 && now >= self.heard + SILENCE => self.fell_silent(now),
            Phase::Idle if self.due().is_none() && self.told != self.kept_baud() => {
                self.told = self.kept_baud();
                tracing::info!("the line goes at {} baud", self.told);
            }
            _ => {}
        }
    }

    /// The link was set to the rate that was due.
    pub(super) fn link_set(&mut self, baud: u32, now: Instant) {
        self.link_baud = baud;
        if let Phase::Follow(_) = self.phase {
            self.phase = Phase::Trial(Trial { baud, began: now, burst: 0, unsent: BURST, unanswered: Vec::new() });
        }
    }

    /// The link does not take the rate that was due; a board that has taken it gives it up.
    pub(super) fn link_refused(&mut self, now: Instant) {
        self.give_up();
        self.phase = Phase::Back(now + BACK);
    }

    /// What a trial under way asks the board next.
    pub(super) fn question(&self) -> Option<Command> {
        let Phase::Trial(trial) = &self.phase else { return None };
        let question = if trial.burst < BURSTS { Command::Hello } else { Command::Rate { baud: trial.baud } };
        (trial.unsent > 0).then_some(question)
    }

    /// Takes note of the tag with which the [question](Self::question) is sent.
    pub(super) fn asked(&mut self, tag: u8) {
        if let Phase::Trial(trial) = &mut self.phase {
            trial.unsent -= 1;
            trial.unanswered.push(tag);
        }
    }

    /// Takes the answer to a question of the trial under way; returns whether it is one.
    pub(super) fn answered(&mut self, tag: u8) -> bool {
        let Phase::Trial(trial) = &mut self.phase else { return false };
        let Some(place) = trial.unanswered.iter().position(|asked| *asked == tag) else { return false };
        trial.unanswered.swap_remove(place);
        if trial.burst == BURSTS {
            // Confirmed: the first answer will do.
            let baud = trial.baud;
            self.kept = self.all.iter().position(|rate| *rate == baud).unwrap_or_default();
            self.phase = Phase::Idle;
        } else if trial.unsent == 0 && trial.unanswered.is_empty() {
            (trial.burst, trial.unsent) = (trial.burst + 1, BURST);
        }
        true
    }

    /// The board has taken the rate that was [due](Self::due); its answer was the last at the old one.
    pub(super) fn taken(&mut self, baud: u32) {
        self.phase = Phase::Follow(baud);
    }

    /// The board does not take the rate that is due, or did not answer.
    pub(super) fn refused(&mut self) {
        self.give_up();
    }

    /// The board has started anew, at its first rate. That it fell silent before was no fault of the line.
    pub(super) fn board_has_started(&mut self) {
        (self.kept, self.phase) = (0, Phase::Idle);
        self.highest = self.before_silence.take().unwrap_or(self.highest);
    }

    fn trial_failed(&mut self, now: Instant) {
        if let Phase::Trial(trial) = &self.phase {
            let until = trial.began + BACK;
            tracing::debug!("the line does not keep {} baud", trial.baud);
            self.give_up();
            self.phase = Phase::Back(until.max(now));
        }
    }

    /// Gives up the rate that is due: the line stays at the one that is kept. One that was to be left, and could not be, is left alone: the board, which
    /// hears nothing then, goes back to its first too.
    fn give_up(&mut self) {
        if self.highest < self.kept {
            (self.kept, self.highest) = (0, 0);
        } else {
            self.highest = self.kept;
        }
    }

    /// Goes back to the first rate, as the board does by itself.
    fn fell_silent(&mut self, now: Instant) {
        tracing::warn!("nothing whole comes at {} baud any more: back to {}", self.kept_baud(), self.all[0]);
        self.before_silence = Some(self.highest);
        (self.highest, self.kept, self.heard) = (self.highest.min(self.kept - 1), 0, now);
    }
}
