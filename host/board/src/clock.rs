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
mod tests {
    use fastrand::Rng;

    use super::*;

    /// A board on a line with delays: its clock begins anywhere, and drifts.
    struct Trial {
        clock: BoardClock,
        random: Rng,
        drift: f64,
        began_s: f64,
        /// Shortest times of a command and of a frame on their ways, and the mean of what is added by chance (s).
        shortest_s: [f64; 2],
        chance_s: f64,
        tag: u8,
    }

    impl Trial {
        fn new(seed: u64) -> Self {
            let mut random = Rng::with_seed(seed);
            let drift = 9e-5 * (2.0 * random.f64() - 1.0);
            // The board's 32 bits wrap within the trial.
            let began_s = 4200.0 + 90.0 * random.f64();
            Self {
                clock: BoardClock::default(),
                random,
                drift,
                began_s,
                shortest_s: [2e-4, 2e-3],
                chance_s: 1e-3,
                tag: 0,
            }
        }

        fn board_us(&self, host_s: f64) -> u32 {
            let board_s = self.began_s + host_s * (1.0 - self.drift);
            (board_s * 1e6) as u64 as u32
        }

        fn delay_s(&mut self, way: usize) -> f64 {
            self.shortest_s[way] - self.chance_s * (1.0 - self.random.f64()).ln()
        }

        fn exchange(&mut self, host_s: f64) {
            self.tag = self.tag % 255 + 1;
            self.clock.asked(self.tag, Duration::from_secs_f64(host_s));
            let obeyed_s = host_s + self.delay_s(0);
            let came_s = obeyed_s + self.delay_s(1);
            let time_us = self.board_us(obeyed_s);
            self.clock.said(Clock { answers: self.tag, time_us }, Duration::from_secs_f64(came_s));
        }

        /// A frame from the middle of whose scan this machine's clock shows `host_s`: what is told of it less that, and the bound of that.
        fn frame(&mut self, host_s: f64) -> Option<[f64; 2]> {
            let came_s = host_s + self.delay_s(1);
            let time_us = self.board_us(host_s);
            let told = self.clock.frame(time_us, Duration::from_secs_f64(came_s))?;
            Some([came_s - told.delay_s - host_s, told.error_s])
        }

        /// Frames and exchanges for so long: errors and their bounds of the last minute.
        fn run(&mut self, from_s: f64, seconds: f64) -> Vec<[f64; 2]> {
            let mut found = Vec::new();
            for i in 0..(seconds * 100.0) as u32 {
                let host_s = from_s + 0.01 * f64::from(i);
                if i % 50 == 0 {
                    self.exchange(host_s);
                }
                found.extend(self.frame(host_s + 0.003));
            }
            found
        }
    }

    #[test]
    fn no_scan_is_further_off_than_is_told_and_that_is_half_of_the_quickest_exchange() {
        for seed in 0..20 {
            let mut trial = Trial::new(seed);
            let found = trial.run(0.0, 150.0);
            assert_eq!(found.len(), 15_000, "from the first exchange on");
            let beyond = found.iter().filter(|[off_s, error_s]| off_s.abs() > error_s + 2e-6).count();
            assert_eq!(beyond, 0, "seed {seed}");
            let [.., [off_s, error_s]] = found[..] else { panic!("no frame") };
            // Half of 2.2 ms, and what chance adds to the quickest of two seconds.
            assert!(off_s.abs() < 1.2e-3 && error_s < 1.6e-3, "seed {seed}: {off_s} {error_s}");
            let drift = trial.clock.line.unwrap().drift;
            assert!((drift - trial.drift / (1.0 - trial.drift)).abs() < 1e-5, "seed {seed}: {drift} {}", trial.drift);
        }
    }

    #[test]
    fn a_board_that_starts_anew_and_a_machine_that_slept_are_found_out() {
        let mut trial = Trial::new(3);
        trial.run(0.0, 60.0);
        // The board's clock begins at zero again, and then stays behind by a nap of this machine.
        trial.began_s = -60.0;
        let found = trial.run(60.0, 60.0);
        trial.began_s += 30.0;
        let woken = trial.run(120.0, 60.0);
        for found in [found, woken] {
            let later = &found[found.len() - 5000..];
            let beyond = later.iter().filter(|[off_s, error_s]| off_s.abs() > error_s + 2e-6).count();
            assert_eq!(beyond, 0);
            assert!(later.iter().all(|[_, error_s]| *error_s < 3e-3));
        }
    }

    #[test]
    fn a_board_that_does_not_say_what_its_clock_shows_has_no_time_and_neither_has_an_answer_nobody_asked_for() {
        let mut clock = BoardClock::default();
        assert_eq!(clock.frame(1_000, Duration::from_secs(1)), None);
        clock.said(Clock { answers: 3, time_us: 2_000 }, Duration::from_secs(1));
        assert_eq!(clock.frame(2_500, Duration::from_secs(1)), None);
    }

    fn at(seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds)
    }

    /// An exchange that takes 2 ms, with a board whose clock is behind by so much.
    fn exchange(clock: &mut BoardClock, tag: u8, sent_s: f64, behind_s: f64) {
        clock.asked(tag, at(sent_s));
        clock.said(Clock { answers: tag, time_us: ((sent_s + 1e-3 - behind_s) * 1e6) as u32 }, at(sent_s + 2e-3));
    }

    /// How far a frame of that moment is from where it was, less what is told as its error (s).
    fn beyond_s(clock: &mut BoardClock, scanned_s: f64, behind_s: f64) -> f64 {
        let came_s = scanned_s + 4e-3;
        let told = clock.frame(((scanned_s - behind_s) * 1e6) as u32, at(came_s)).expect("a clock that is known");
        (came_s - told.delay_s - scanned_s).abs() - told.error_s - 2e-6
    }

    #[test]
    fn a_command_that_was_sent_again_bounds_the_clock_from_its_first_sending() {
        let mut clock = BoardClock::default();
        clock.asked(5, at(1.0));
        clock.asked(5, at(3.0));
        // It obeyed the first, and its answer was late.
        clock.said(Clock { answers: 5, time_us: 1_001_000 }, at(3.1));
        assert!(beyond_s(&mut clock, 3.2, 0.0) <= 0.0);
        // The tag is free again, for a command after it.
        exchange(&mut clock, 5, 4.0, 0.0);
        let told = clock.frame(4_100_000, at(4.101)).expect("a clock that is known");
        assert!(told.error_s < 2e-3, "{told:?}");
    }

    #[test]
    fn an_answer_bounds_the_clock_once_and_only_if_it_was_asked_for() {
        // Asked and answered; answered twice; another's; forgotten behind sixteen others; asked before a restart.
        let known = |talk: &dyn Fn(&mut BoardClock)| {
            let mut clock = BoardClock::default();
            talk(&mut clock);
            clock.frame(2_000_000, at(3.0)).is_some()
        };
        let answer = |clock: &mut BoardClock, tag| clock.said(Clock { answers: tag, time_us: 1_001_000 }, at(1.1));
        assert!(known(&|clock| {
            clock.asked(1, at(1.0));
            answer(clock, 1);
        }));
        assert!(!known(&|clock| {
            clock.asked(1, at(1.0));
            answer(clock, 2);
        }));
        for (others, is_known) in [(15, true), (16, false)] {
            assert_eq!(
                known(&|clock| {
                    (1..=1 + others).for_each(|tag| clock.asked(tag, at(1.0)));
                    answer(clock, 1);
                }),
                is_known
            );
        }
        assert!(!known(&|clock| {
            clock.asked(1, at(1.0));
            clock.restart();
            answer(clock, 1);
        }));
        let mut clock = BoardClock::default();
        exchange(&mut clock, 1, 1.0, 0.0);
        // The same answer once more, much later, is of no command: it bounds nothing from below.
        clock.said(Clock { answers: 1, time_us: 5_000_000 }, at(9.0));
        assert!(beyond_s(&mut clock, 9.1, 0.0) <= 0.0);
    }

    #[test]
    fn a_time_ten_seconds_back_is_of_a_board_that_has_started_anew_and_a_slow_frame_is_not() {
        let mut clock = BoardClock::default();
        (0..20u8).for_each(|i| exchange(&mut clock, i + 1, 100.0 + f64::from(i), 0.0));
        assert!(clock.frame(110_000_000, at(119.1)).is_some(), "nine seconds old");
        assert!(beyond_s(&mut clock, 119.2, 0.0) <= 0.0);
        assert_eq!(clock.frame(1_000_000, at(119.3)), None, "its clock is not known");
        exchange(&mut clock, 40, 120.0, 118.0);
        assert!(beyond_s(&mut clock, 120.5, 118.0) <= 0.0);
    }
}
