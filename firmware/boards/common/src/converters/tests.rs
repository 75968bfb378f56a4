//! The ESP32's whole way from a command to a frame, over registers that hang.

extern crate std;

use core::cell::Cell;
use core::convert::Infallible;
use std::rc::Rc;
use std::vec::Vec;

use embedded_hal::delay::DelayNs;
use tactomo_firmware::{
    Activity, Adc, Board16, Chip, ConverterPair, Identity, Mux, NoTouch, Parts, Serial, SideBySide, TimedOut,
};
use tactomo_protocol::{
    BoardMessage, BoardReceiver, Command, Fault, Frame, MAX_COMMAND, Request, Settings, Status, encode_request,
};

use super::{Converters, MAX_LOOKS, Units};
use crate::WATCHDOG_TIMEOUT_MS;
use crate::range::ESP32_ELECTRODES;

/// A look takes some 50 ns: 12 cycles of 240 MHz, of a bus at a third of that.
const LOOK_NS: u64 = 50;
const CONVERSION_NS: u64 = 10_000;

/// What the registers, the chip and the test share.
#[derive(Default)]
struct State {
    now_ns: Cell<u64>,
    /// Which units hang, and whether a restart helps.
    hangs: Cell<[bool; 2]>,
    restarts_help: Cell<bool>,
    restarts: Cell<u32>,
    last_fed_ns: Cell<u64>,
    longest_gap_ns: Cell<u64>,
}

impl State {
    fn pass(&self, ns: u64) {
        self.now_ns.set(self.now_ns.get() + ns);
    }
}

/// Registers of which a conversion is done after its time, or never. A late code waits in its unit until a start.
struct Registers {
    state: Rc<State>,
    /// Channel and end of the conversion under way.
    running: [Option<(u8, u64)>; 2],
}

impl Units for Registers {
    fn are_at_rest(&mut self) -> bool {
        self.state.pass(LOOK_NS);
        self.running.iter().all(Option::is_none)
    }

    fn start(&mut self, unit: usize, channel: u8) {
        let hangs = self.state.hangs.get()[unit];
        self.running[unit] = Some((channel, if hangs { u64::MAX } else { self.state.now_ns.get() + CONVERSION_NS }));
    }

    fn reading(&mut self, unit: usize) -> Option<u16> {
        self.state.pass(LOOK_NS);
        let done = self.running[unit].take_if(|(_, end_ns)| *end_ns <= self.state.now_ns.get());
        done.map(|(channel, _)| 1000 * (1 + unit as u16) + 10 * u16::from(channel))
    }

    fn stop(&mut self, unit: usize) {
        self.running[unit] = None;
    }

    fn power(&mut self, on: bool) {
        self.state.restarts.set(self.state.restarts.get() + u32::from(on));
        if on && self.state.restarts_help.get() {
            self.state.hangs.set([false; 2]);
        }
    }
}

struct NoMux;

impl Mux for NoMux {
    type Error = Infallible;
    const SELECT_US: u16 = 0;

    fn ground(&mut self, _electrode: u8) -> Result<(), Infallible> {
        Ok(())
    }

    fn select(&mut self, _electrode: u8) -> Result<(), Infallible> {
        Ok(())
    }
}

#[derive(Default)]
struct Line {
    to_board: Vec<u8>,
    sent: Rc<core::cell::RefCell<Vec<u8>>>,
}

impl Serial for Line {
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.sent.borrow_mut().extend(bytes);
        bytes.len()
    }

    fn pull(&mut self, buffer: &mut [u8]) -> usize {
        let count = buffer.len().min(self.to_board.len());
        buffer.iter_mut().zip(self.to_board.drain(..count)).for_each(|(to, byte)| *to = byte);
        count
    }
}

struct FakeChip(Rc<State>);

impl DelayNs for FakeChip {
    fn delay_ns(&mut self, ns: u32) {
        self.0.pass(ns.into());
    }
}

impl Chip for FakeChip {
    fn now_us(&mut self) -> u64 {
        self.0.now_ns.get() / 1000
    }

    fn feed_watchdog(&mut self) {
        let now_ns = self.0.now_ns.get();
        let gap_ns = now_ns - self.0.last_fed_ns.replace(now_ns);
        self.0.longest_gap_ns.set(self.0.longest_gap_ns.get().max(gap_ns));
    }
}

/// Channel of each electrode, another for each of a unit.
const CHANNELS: [u8; 16] = [0, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9];

fn converters(state: &Rc<State>) -> Converters<Registers, 16> {
    Converters::new(Registers { state: Rc::clone(state), running: [None; 2] }, CHANNELS)
}

type FakeBoard = Board16<NoMux, SideBySide<Converters<Registers, 16>>, Line, FakeChip>;

/// An ESP32 that was started with these settings, and what it sends.
fn board(state: &Rc<State>, settings: Settings) -> (FakeBoard, Rc<core::cell::RefCell<Vec<u8>>>) {
    let mut line = Line::default();
    for command in [Command::Configure(settings), Command::Start] {
        let mut packet = [0; MAX_COMMAND];
        let length = encode_request(&Request { tag: 1, command }, &mut packet).expect("a command");
        line.to_board.extend(&packet[..length]);
    }
    let sent = Rc::clone(&line.sent);
    let parts = Parts {
        mux: NoMux,
        sampler: SideBySide::new(converters(state), ESP32_ELECTRODES[0]),
        serial: line,
        chip: FakeChip(Rc::clone(state)),
        touch: NoTouch,
    };
    let identity =
        Identity { firmware_version: "0", board: "esp32", electrodes: 16, adc: Adc::new(12, 4096), drive_mv: 2000 };
    (Board16::new(parts, identity).expect("an ESP32"), sent)
}

fn messages(sent: &Rc<core::cell::RefCell<Vec<u8>>>) -> Vec<BoardMessage> {
    let sent = sent.take();
    let (mut receiver, mut input) = (BoardReceiver::default(), &sent[..]);
    std::iter::from_fn(|| receiver.receive(&mut input)).map(|message| message.expect("whole packets")).collect()
}

fn frames(messages: Vec<BoardMessage>) -> Vec<Frame> {
    let frame = |message| if let BoardMessage::Frame(frame) = message { Some(frame) } else { None };
    messages.into_iter().filter_map(frame).collect()
}

#[test]
fn every_electrode_is_read_at_its_unit_and_channel_ten_slots_a_row() {
    let state = Rc::default();
    let (mut board, sent) = board(&state, Settings { settle_us: 0, ..Settings::default() });
    while board.step() != Ok(Activity::Frame) {}
    let took_us = state.now_ns.get() / 1000;
    assert!((1600..1800).contains(&took_us), "160 conversion times are {took_us} us");
    let _ = board.step();
    let frame = frames(messages(&sent)).remove(0);
    let expected =
        (0..16).map(|electrode| if electrode < 6 { 1000 } else { 2000 } + 10 * u16::from(CHANNELS[electrode]));
    assert!(frame.readings.iter().copied().eq((0..16).flat_map(|_| expected.clone())), "{:?}", frame.readings);
    assert_eq!((frame.head.status, state.restarts.get()), (Status::default(), 0));
}

/// Both units hang, with the largest average: each pair of electrodes costs one bound and one restart, and not one for each conversion.
#[test]
fn a_row_of_two_stuck_units_ends_after_one_bound_a_pair_and_the_watchdog_is_fed() {
    let state: Rc<State> = Rc::default();
    state.hangs.set([true; 2]);
    let (mut board, sent) = board(&state, Settings { average_log2: 8, settle_us: 0, ..Settings::default() });
    assert_eq!(board.step(), Ok(Activity::Row));
    // A conversion and the one that a restart throws away wait for rest and for the end; the second looks at two units.
    let bound_ns = 2 * 3 * u64::from(MAX_LOOKS) * LOOK_NS;
    let row_ns = state.now_ns.get();
    assert!(row_ns <= 10 * bound_ns, "a row took {} ms", row_ns / 1_000_000);
    assert_eq!(state.restarts.get(), 10);
    while board.step() != Ok(Activity::Frame) {}
    let timeout_ns = u64::from(WATCHDOG_TIMEOUT_MS) * 1_000_000;
    let gap_ns = state.longest_gap_ns.get();
    assert!(gap_ns <= bound_ns && 100 * gap_ns < timeout_ns, "the watchdog was not fed for {} us", gap_ns / 1000);
    let _ = board.step();
    let messages = messages(&sent);
    assert!(messages.contains(&BoardMessage::Fault(Fault::AdcStuck)));
    assert!(frames(messages)[0].readings.iter().all(|reading| *reading == 0));
}

#[test]
fn the_longest_waits_of_the_settings_feed_the_watchdog_in_time() {
    let state: Rc<State> = Rc::default();
    let longest = Settings { settle_us: u16::MAX, discarded: 15, select_us: 10_000, ..Settings::default() };
    let (mut board, _) = board(&state, longest);
    while board.step() != Ok(Activity::Frame) {}
    assert!(state.longest_gap_ns.get() < 1_000_000, "{} ns", state.longest_gap_ns.get());
}

#[test]
fn one_stuck_unit_leaves_the_other_its_readings() {
    let state: Rc<State> = Rc::default();
    state.hangs.set([false, true]);
    let (mut board, sent) = board(&state, Settings { average_log2: 1, ..Settings::default() });
    while board.step() != Ok(Activity::Frame) {}
    let _ = board.step();
    let messages = messages(&sent);
    assert!(!messages.contains(&BoardMessage::Fault(Fault::AdcStuck)));
    let frame = &frames(messages)[0];
    assert_eq!(frame.head.status, Status::TIMED_OUT);
    let row = &frame.readings[..16];
    assert!(row[..6].iter().all(|reading| *reading >= 2000) && row[6..].iter().all(|reading| *reading == 0), "{row:?}");
}

#[test]
fn a_restart_brings_units_back_and_throws_a_late_code_away() {
    let state: Rc<State> = Rc::default();
    state.hangs.set([true, false]);
    state.restarts_help.set(true);
    let mut converters = converters(&state);
    assert_eq!(converters.convert([Some(3), Some(8)]), [Err(TimedOut), Ok(2020)]);
    converters.restart();
    assert_eq!(state.restarts.get(), 1);
    assert_eq!(converters.convert([Some(3), Some(8)]), [Ok(1050), Ok(2020)]);
    assert_eq!(converters.convert([None, Some(15)])[1], Ok(2090));
}

/// Registers of a unit that ends a conversion too late: that is done with the next start, in place of the one that was to be started.
#[derive(Default)]
struct Late {
    /// Which units are late next.
    is_late: [bool; 2],
    late: [Option<u16>; 2],
    done: [Option<u16>; 2],
    looks_until_rest: u32,
    at_rest: bool,
    /// What was done: a start of a unit and its channel, a stop, power.
    calls: Vec<std::string::String>,
}

impl Units for Late {
    fn are_at_rest(&mut self) -> bool {
        self.looks_until_rest = self.looks_until_rest.saturating_sub(1);
        self.at_rest = self.looks_until_rest == 0;
        self.at_rest
    }

    fn start(&mut self, unit: usize, channel: u8) {
        assert!(self.at_rest, "started while the last conversion goes on");
        self.calls.push(std::format!("start {unit} {channel}"));
        let code = 100 * (1 + unit as u16) + u16::from(channel);
        self.done[unit] = self.late[unit].take();
        if self.is_late[unit] {
            (self.is_late[unit], self.late[unit]) = (false, Some(code));
        } else {
            self.done[unit] = self.done[unit].or(Some(code));
        }
    }

    fn reading(&mut self, unit: usize) -> Option<u16> {
        self.done[unit].take()
    }

    fn stop(&mut self, unit: usize) {
        self.calls.push(std::format!("stop {unit}"));
    }

    fn power(&mut self, on: bool) {
        self.calls.push(std::format!("power {on}"));
        self.at_rest = false;
    }
}

#[test]
fn a_code_that_is_late_is_nobodys_after_a_restart() {
    for late in [[true, false], [false, true], [true, true]] {
        let units = Late { is_late: late, looks_until_rest: 100, ..Late::default() };
        let mut converters = Converters::new(units, CHANNELS);
        let first = converters.convert([Some(1), Some(9)]);
        assert_eq!(first, [0, 1].map(|unit| if late[unit] { Err(TimedOut) } else { Ok([103, 203][unit]) }));
        converters.units.calls.clear();
        converters.units.looks_until_rest = 100;
        converters.restart();
        let expected = ["stop 0", "stop 1", "power false", "power true", "start 0 0", "start 1 0"];
        assert_eq!(converters.units.calls, expected);
        for _ in 0..3 {
            assert_eq!(converters.convert([Some(5), Some(15)]), [Ok(107), Ok(209)], "late: {late:?}");
        }
        // One alone starts nothing at the other, and an electrode that is not there nothing at all.
        converters.units.calls.clear();
        assert_eq!(converters.convert([None, Some(6)])[1], Ok(200));
        assert_eq!(converters.convert([Some(16), None])[1], Ok(0));
        assert_eq!(converters.units.calls, ["start 1 0"]);
    }
}
