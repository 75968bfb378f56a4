//! What is known of a board's clock, on lines that are slow, and by boards that start anew.

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
        Self { clock: BoardClock::default(), random, drift, began_s, shortest_s: [2e-4, 2e-3], chance_s: 1e-3, tag: 0 }
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
