//! The rate of the simulated board's line is negotiated, and left where the line does not keep it.
#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should")]

use std::time::{Duration, Instant};

use tactomo_board::link::Link;
use tactomo_board::session::{RATES, RequestedSettings, Session};
use tactomo_board::simulated::{BoardModel, Options, SimulatedBoard};
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_physics::simulate::Physics;
use tactomo_protocol::{BoardMessage, BoardReceiver, Frame};

const FIRST: u32 = 921_600;
const PATIENCE: Duration = Duration::from_secs(20);

/// Nothing touches.
struct Untouched;

impl Physics for Untouched {
    fn readings_v(&mut self, _time_s: f64) -> Readings {
        Readings::from_fn(16, |_, _| 0.5)
    }
}

fn board(model: BoardModel) -> SimulatedBoard {
    let detector = Detector::preset(Detector::DEFAULT).unwrap();
    SimulatedBoard::start(&detector, Box::new(Untouched), Options { seed: 1, model }).unwrap()
}

/// A host on a line that stays open after it.
struct Host<'a> {
    board: &'a mut SimulatedBoard,
    session: Session,
    receiver: BoardReceiver,
    frames: Vec<Frame>,
}

impl<'a> Host<'a> {
    /// A host that opens the line, at the first rate.
    fn new(board: &'a mut SimulatedBoard) -> Self {
        if board.baud().is_some() {
            board.set_baud(FIRST).unwrap();
        }
        let session = Session::new(RequestedSettings::default());
        Self { board, session, receiver: BoardReceiver::default(), frames: Vec::new() }
    }

    fn exchange(&mut self) {
        self.session.transmit(self.board, self.receiver.counters().corrupt).unwrap();
        let mut buffer = [0; 4096];
        let count = self.board.read(&mut buffer).unwrap();
        let mut input = &buffer[..count];
        while let Some(message) = self.receiver.receive(&mut input) {
            match message {
                Ok(BoardMessage::Hello(hello)) => self.session.hello(&hello, Instant::now()),
                Ok(BoardMessage::Frame(frame)) => {
                    self.session.frame(Instant::now());
                    self.frames.push(frame);
                }
                Ok(BoardMessage::Fault(fault)) => drop(self.session.fault(&fault)),
                _ => {}
            }
        }
    }

    /// Goes on until this many frames have come; how long that took.
    fn until_frames(&mut self, frames: usize) -> Duration {
        let begin = Instant::now();
        while self.frames.len() < frames {
            assert!(begin.elapsed() < PATIENCE, "{} of {frames} frames", self.frames.len());
            self.exchange();
        }
        begin.elapsed()
    }

    /// Goes on until the line has this rate; how long that took.
    fn until_rate(&mut self, baud: u32) -> Duration {
        let begin = Instant::now();
        while self.session.baud() != Some(baud) || self.session.is_changing_rate() {
            assert!(begin.elapsed() < PATIENCE, "the line stays at {:?} baud", self.session.baud());
            self.exchange();
        }
        begin.elapsed()
    }

    fn for_a_while(&mut self, time: Duration) {
        let begin = Instant::now();
        while begin.elapsed() < time {
            self.exchange();
        }
    }

    /// Frames that are missing between the first and the last.
    fn missing(&self) -> usize {
        let numbers = || self.frames.iter().map(|frame| frame.head.sequence);
        numbers().zip(numbers().skip(1)).map(|(a, b)| usize::from(b.wrapping_sub(a)) - 1).sum()
    }
}

#[test]
fn the_highest_rate_that_the_bridge_keeps_is_taken_before_the_first_frame() {
    for most in [u32::MAX, 2_500_000, 1_600_000, FIRST] {
        let mut board = board(BoardModel::Esp32);
        board.set_bridge_baud(most);
        let mut host = Host::new(&mut board);
        let took = host.until_frames(300);
        let expected = RATES.into_iter().filter(|rate| *rate <= most).max().unwrap_or(FIRST);
        assert_eq!(host.session.baud(), Some(expected));
        assert_eq!((host.missing(), host.frames[0].head.sequence), (0, 0));
        assert!(took < Duration::from_secs(4), "{took:?}");
    }
}

#[test]
fn a_line_without_rates_is_left_as_it_is() {
    for model in [BoardModel::Ideal, BoardModel::Esp32c3] {
        let mut board = board(model);
        let mut host = Host::new(&mut board);
        host.until_frames(10);
        assert_eq!((host.session.baud(), host.receiver.counters().corrupt), (None, 0));
    }
}

#[test]
fn a_board_that_was_left_at_a_high_rate_is_found_again() {
    let mut board = board(BoardModel::Esp32);
    let mut host = Host::new(&mut board);
    host.until_frames(10);
    // It crashes; the next one opens the line at the first rate, and hears only noise.
    let mut host = Host::new(&mut board);
    let took = host.until_rate(3_000_000);
    assert!(took < Duration::from_secs(4), "{took:?}");
    host.until_frames(10);
}

#[test]
fn a_host_that_leaves_does_not_let_the_next_one_wait() {
    let mut board = board(BoardModel::Esp32);
    let mut host = Host::new(&mut board);
    host.until_frames(10);
    let Host { mut session, board: line, .. } = host;
    session.leave(line);
    // As long as it takes to close a port and open it.
    std::thread::sleep(Duration::from_millis(50));
    let mut host = Host::new(&mut board);
    let took = host.until_rate(3_000_000);
    assert!(took < Duration::from_millis(1500), "{took:?}");
}

#[test]
fn a_rate_is_kept_over_a_silence_of_frames_and_given_up_when_the_bridge_does_not_keep_it() {
    let mut board = board(BoardModel::Esp32);
    let mut host = Host::new(&mut board);
    host.until_frames(10);
    host.for_a_while(Duration::from_millis(2500));
    assert_eq!((host.session.baud(), host.missing()), (Some(3_000_000), 0));
    host.board.set_bridge_baud(2_000_000);
    let left = Instant::now();
    while host.session.baud() == Some(3_000_000) || host.session.is_changing_rate() {
        assert!(left.elapsed() < PATIENCE, "it stays");
        host.exchange();
    }
    host.until_frames(host.frames.len() + 300);
    assert!(host.session.baud() <= Some(2_000_000));
}
