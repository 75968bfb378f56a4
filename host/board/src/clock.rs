//! A board's clock against this machine's: when a scan was, by the clock that a camera or another board is told by.
//!
//! Each exchange and each frame bounds what this machine's clock showed at a board time:
//!
//! - a board obeys a command after it was sent, so the board time of its [`Clock`] message was not before that;
//! - whatever comes from a board was said before it came: a frame's middle, and the board time of a [`Clock`] message.
//!
//! Two crystals differ by a rate that hardly changes, so the truth is a line between all lower and all upper bounds (as in Zhang, Liu and Xia,
//! "Clock synchronization algorithms for network measurements", INFOCOM 2002, which has the upper ones only). The line that is farthest from all of
//! them is taken. What is told as its error is how far any line that keeps the bounds can be from it: no deviation, but a bound, as sure as the
//! crystals' rates are within 100 ppm. As in NTP's clock filter, the exchanges that were quickest count, and how long the others took does not matter.

use std::collections::VecDeque;
use std::time::Duration;

use tactomo_protocol::Clock;

/// Most that two crystals' rates differ by (s/s): 50 ppm each, twice what boards' data sheets have over all temperatures (ESP32: 10 ppm).
const MOST_DRIFT: f64 = 1e-4;
/// Time of which the tightest bounds of both sides are kept (s): at the largest drift their places in it make 0.2 ms.
const BLOCK_S: f64 = 2.0;
/// Such times that are kept: two minutes, in which a crystal that warms up changes its rate by less than 0.1 ppm a minute.
const BLOCKS: usize = 64;
/// Commands whose answers may be under way: the trial of a line's rate sends twelve.
const MOST_ASKED: usize = 16;
/// A board time that is so far before the last (s) is of a board that has started anew. Frames into which 15 slow scans were folded are 6 s old.
const BACK_S: f64 = 10.0;
/// Halvings of the interval of rates: 2e-4 s/s becomes 3e-9, which makes 0.4 us in two minutes.
const HALVINGS: u32 = 16;

/// How long before it came a frame was scanned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delay {
    /// From the middle of its scan until it came (s).
    pub delay_s: f64,
    /// How far that is from the truth at most (s).
    pub error_s: f64,
}

/// A bound of what this machine's clock shows at a board time.
#[derive(Clone, Copy, Debug)]
struct Bound {
    board_s: f64,
    /// By how much this machine's clock is ahead of the board's: at most, or at least.
    ahead_s: f64,
}

/// A board's clock against this machine's, from what was said on one link. Times of this machine are since any moment, the same for all.
///
/// ```
/// use std::time::Duration;
/// use tactomo_board::clock::BoardClock;
/// use tactomo_protocol::Clock;
///
/// let mut clock = BoardClock::default();
/// clock.asked(1, Duration::from_millis(500));
/// clock.said(Clock { answers: 1, time_us: 20_000 }, Duration::from_millis(504));
/// let delay = clock.frame(30_000, Duration::from_millis(515)).unwrap();
/// assert!((delay.delay_s - 3e-3).abs() < 1e-6 && (delay.error_s - 2e-3).abs() < 1e-3);
/// ```
#[derive(Debug, Default)]
pub struct BoardClock {
    /// Tags of commands, and when each was sent first.
    asked: VecDeque<(u8, f64)>,
    /// The last board time, unwrapped (us).
    last_us: Option<i64>,
    upper: VecDeque<Bound>,
    lower: VecDeque<Bound>,
    line: Option<Line>,
}

/// By how much this machine's clock is ahead of the board's.
#[derive(Clone, Copy, Debug)]
struct Line {
    /// The board time from which the line is told (s).
    from_s: f64,
    ahead_s: f64,
    drift: f64,
    /// Bound of its error within [`BLOCK_S`] of there (s).
    error_s: f64,
}

impl Line {
    fn ahead_at(&self, board_s: f64) -> f64 {
        self.ahead_s + self.drift * (board_s - self.from_s)
    }
}

impl BoardClock {
    /// Takes note of a command with this tag, which is about to be sent.
    pub fn asked(&mut self, tag: u8, now: Duration) {
        if self.asked.iter().any(|(other, _)| *other == tag) {
            // What answers it may answer its first sending.
            return;
        }
        if self.asked.len() >= MOST_ASKED {
            self.asked.pop_front();
        }
        self.asked.push_back((tag, now.as_secs_f64()));
    }

    /// Takes what the board's clock showed when it obeyed a command.
    pub fn said(&mut self, Clock { answers, time_us }: Clock, came: Duration) {
        let board_s = self.unwrap(time_us);
        let asked = self.asked.iter().position(|(tag, _)| *tag == answers);
        if let Some((_, sent_s)) = asked.and_then(|index| self.asked.remove(index)) {
            tighten(&mut self.lower, Bound { board_s, ahead_s: sent_s - board_s }, f64::max);
        }
        tighten(&mut self.upper, Bound { board_s, ahead_s: came.as_secs_f64() - board_s }, f64::min);
        self.fit();
    }

    /// Takes a frame: what the board's clock showed in the middle of its scan, and when it came. Returns how long that was before; `None` of a board
    /// that has not said what its clock shows.
    pub fn frame(&mut self, time_us: u32, came: Duration) -> Option<Delay> {
        let board_s = self.unwrap(time_us);
        let ahead_s = came.as_secs_f64() - board_s;
        let is_new = tighten(&mut self.upper, Bound { board_s, ahead_s }, f64::min);
        let is_beyond = self.line.is_some_and(|line| ahead_s < line.ahead_at(board_s));
        if is_new || is_beyond {
            self.fit();
        }
        let line = self.line?;
        let beyond_s = ((board_s - line.from_s).abs() - BLOCK_S).max(0.0);
        let error_s = line.error_s + 2.0 * MOST_DRIFT * beyond_s;
        Some(Delay { delay_s: ahead_s - line.ahead_at(board_s), error_s })
    }

    /// Forgets everything: what comes is of a board that has started anew.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// A board time since the first (s).
    fn unwrap(&mut self, time_us: u32) -> f64 {
        let now_us = match self.last_us {
            Some(last_us) => unwrapped(last_us, time_us),
            None => i64::from(time_us),
        };
        if self.last_us.is_some_and(|last_us| (now_us - last_us) as f64 * 1e-6 < -BACK_S) {
            (self.line, self.upper, self.lower) = (None, VecDeque::new(), VecDeque::new());
        }
        self.last_us = Some(now_us);
        now_us as f64 * 1e-6
    }

    /// Draws the line anew. Bounds that no line keeps are of a clock that was set, or stood still while the machine slept: the oldest go.
    fn fit(&mut self) {
        self.line = loop {
            let (Some(upper), Some(lower)) = (self.upper.front(), self.lower.front()) else { break None };
            let is_upper = upper.board_s <= lower.board_s;
            if let Some(line) = self.line_between() {
                break Some(line);
            }
            if is_upper {
                self.upper.pop_front()
            } else {
                self.lower.pop_front()
            };
        };
    }

    /// The line that is farthest from all bounds; `None` if none keeps them.
    fn line_between(&self) -> Option<Line> {
        let from_s = self.upper.back()?.board_s;
        // What a bound comes to at that time, if the clocks drift apart so.
        let at = |drift: f64| move |bound: &Bound| bound.ahead_s - drift * (bound.board_s - from_s);
        let most = |drift: f64| self.upper.iter().map(at(drift)).fold(f64::INFINITY, f64::min);
        let least = |drift: f64| self.lower.iter().map(at(drift)).fold(f64::NEG_INFINITY, f64::max);
        let room = |drift: f64| most(drift) - least(drift);
        // The room is concave in the drift, as the lowest of lines less the highest of lines.
        let drift = highest([-MOST_DRIFT, MOST_DRIFT], room);
        if room(drift) < 0.0 {
            return None;
        }
        let ahead_s = 0.5 * (most(drift) + least(drift));
        let drifts = [-MOST_DRIFT, MOST_DRIFT].map(|end| last_with_room(drift, end, room));
        let line = Line { from_s, ahead_s, drift, error_s: 0.0 };
        // How far other lines are off is convex in time, and so largest at an end of the time that it is told for.
        let off_s = [-BLOCK_S, BLOCK_S].map(|after_s| {
            let highest_s = value_at_highest(drifts, |drift| most(drift) + drift * after_s);
            let lowest_s = -value_at_highest(drifts, |drift| -least(drift) - drift * after_s);
            let told_s = line.ahead_at(from_s + after_s);
            (highest_s - told_s).max(told_s - lowest_s)
        });
        Some(Line { error_s: off_s[0].max(off_s[1]), ..line })
    }
}

/// A board time (us) near the last one, of which only the low 32 bits are known.
fn unwrapped(last_us: i64, time_us: u32) -> i64 {
    last_us + i64::from(time_us.wrapping_sub(last_us as u32) as i32)
}

/// Keeps a bound if it is the tightest of its time; returns whether it is the first of it.
fn tighten(bounds: &mut VecDeque<Bound>, bound: Bound, tighter: fn(f64, f64) -> f64) -> bool {
    let block = |bound: &Bound| (bound.board_s / BLOCK_S).floor();
    match bounds.back_mut() {
        Some(last) if block(last) >= block(&bound) => {
            if tighter(bound.ahead_s, last.ahead_s) != last.ahead_s {
                *last = bound;
            }
            false
        }
        _ => {
            bounds.push_back(bound);
            if bounds.len() > BLOCKS {
                bounds.pop_front();
            }
            true
        }
    }
}

/// Where a concave function is highest.
fn highest([mut low, mut high]: [f64; 2], of: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..2 * HALVINGS {
        let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
        if of(a) < of(b) { low = a } else { high = b }
    }
    0.5 * (low + high)
}

fn value_at_highest(between: [f64; 2], of: impl Fn(f64) -> f64) -> f64 {
    let [low, high] = between.map(&of);
    of(highest(between, &of)).max(low).max(high)
}

/// The drift nearest to `end` at which there is room, from one at which there is.
fn last_with_room(mut inside: f64, end: f64, room: impl Fn(f64) -> f64) -> f64 {
    if room(end) >= 0.0 {
        return end;
    }
    let mut outside = end;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (inside + outside);
        if room(middle) >= 0.0 { inside = middle } else { outside = middle }
    }
    inside
}

#[cfg(test)]
mod tests;
