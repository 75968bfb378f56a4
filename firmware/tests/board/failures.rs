//! Pins and converters that fail in the middle of a scan, and what is told and kept then.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use embedded_hal_mock::eh1::delay::NoopDelay;
use tactomo_firmware::{Mux, TimedOut};
use tactomo_protocol::{Command, Fault, Plan, Scope, Settings, Status};

use super::more_parts::*;
use super::parts::*;

/// A multiplexer that notes what it grounds, and of which one call fails.
#[derive(Clone, Default)]
struct Failing {
    grounded: Rc<RefCell<Vec<u8>>>,
    calls: Rc<Cell<u32>>,
    fails_at: u32,
}

impl Failing {
    fn at(fails_at: u32) -> Self {
        Self { fails_at, ..Self::default() }
    }

    fn call(&self) -> Result<(), &'static str> {
        let number = self.calls.replace(self.calls.get() + 1);
        if number == self.fails_at { Err("the pin is broken") } else { Ok(()) }
    }
}

impl Mux for Failing {
    type Error = &'static str;
    const SELECT_US: u16 = 1;

    fn ground(&mut self, electrode: u8) -> Result<(), Self::Error> {
        self.call()?;
        self.grounded.borrow_mut().push(electrode);
        Ok(())
    }

    fn select(&mut self, _electrode: u8) -> Result<(), Self::Error> {
        self.call()
    }
}

/// Every row makes 17 calls: a ground, and sixteen electrodes.
const CALLS_A_ROW: u32 = 17;

#[test]
fn a_pin_that_fails_once_abandons_its_frame_which_begins_anew() {
    // The ground of row 5, and an electrode of it.
    for fails_at in [5 * CALLS_A_ROW, 5 * CALLS_A_ROW + 9] {
        let outside = Outside::default();
        let mux = Failing::at(fails_at);
        let grounded = Rc::clone(&mux.grounded);
        let mut board = board(&outside, mux, |_, electrode| Ok(100 + u16::from(electrode)), NoopDelay::new());
        outside.send(Command::Start);
        step(&mut board, 5);
        assert_eq!(board.step(), Err("the pin is broken"));
        grounded.borrow_mut().clear();
        let begun_us = outside.clock_us.get();
        scan(&mut board, 1);
        let middle_us = begun_us.midpoint(outside.clock_us.get());
        board.step().unwrap();
        assert_eq!(grounded.borrow()[..16], (0..16).collect::<Vec<u8>>(), "from its first row on");
        let messages = outside.messages();
        let frame = frames(&messages)[0];
        assert_eq!((frame.head.sequence, u64::from(frame.head.time_us)), (0, middle_us), "with its own time");
        assert!(frame.readings.chunks(16).all(|row| row.iter().copied().eq(100..116)), "{:?}", frame.readings);
    }
}

#[test]
fn what_a_failed_row_has_summed_is_in_no_later_reading() {
    let outside = Outside::default();
    // In its row electrodes 0 to 7 were converted, each four times.
    let mux = Failing::at(2 * CALLS_A_ROW + 9);
    let mut board = board(&outside, mux, |_, electrode| Ok(1000 + u16::from(electrode)), NoopDelay::new());
    outside.send(Command::Configure(Settings { average_log2: 2, ..Settings::default() }));
    outside.send(Command::Start);
    assert!((0..3).map(|_| board.step()).any(|step| step.is_err()));
    scan(&mut board, 1);
    board.step().unwrap();
    let messages = outside.messages();
    let frame = frames(&messages)[0];
    assert_eq!(frame.head.fraction_bits, 2);
    for (reading, electrode) in frame.readings.iter().zip((0..16).cycle()) {
        assert_eq!(*reading, 4 * (1000 + electrode));
    }
}

#[test]
fn a_stuck_converter_is_told_by_frames_of_some_rows_too() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, |number, _| if number < 12 { Err(TimedOut) } else { Ok(7) });
    let plan = Plan { grounds: [3, 9].into_iter().collect(), reads: 0b111, rows_a_frame: 2, average_log2: 0 };
    outside.send(Command::Scan(plan));
    outside.send(Command::Start);
    scan(&mut board, 3);
    board.step().unwrap();
    let messages = outside.messages();
    assert_eq!(faults(&messages), [&Fault::AdcStuck], "once, of two frames");
    let told: Vec<_> = frames(&messages).iter().map(|frame| (frame.head.status, frame.readings.to_vec())).collect();
    let stuck = (Status::TIMED_OUT, vec![0; 6]);
    assert_eq!(told[..3], [stuck.clone(), stuck, (Status::default(), vec![7; 6])]);
    assert_eq!(frames(&messages)[0].scope, Scope::of_rows(16, &[3, 9], 0b111).unwrap());
}

/// The settings say how long an electrode settles at the one input, and how many of its conversions do not count.
#[test]
fn an_electrode_settles_and_its_first_conversions_are_thrown_away() {
    let outside = Outside::default();
    // Each first conversion of an electrode is far off, as a sampling capacitor makes it.
    let sample =
        |number: u64, electrode: u8| Ok(if number.is_multiple_of(4) { 4000 } else { 100 + u16::from(electrode) });
    let mut board = board(&outside, Failing::at(u32::MAX), sample, NoopDelay::new());
    let settings = Settings { settle_us: 20, average_log2: 1, select_us: 40, discarded: 2, ..Settings::default() };
    outside.send(Command::Configure(settings));
    outside.send(Command::Start);
    let begun_us = outside.clock_us.get();
    scan(&mut board, 1);
    assert_eq!(outside.conversions.get(), 256 * 4);
    assert_eq!(outside.clock_us.get() - begun_us, 16 * (20 + 16 * (40 + 4 * CONVERSION_US)));
    board.step().unwrap();
    let messages = outside.messages();
    let frame = frames(&messages)[0];
    assert_eq!(frame.head.status, Status::default());
    for (reading, electrode) in frame.readings.iter().zip((0..16).cycle()) {
        assert_eq!(*reading, 2 * (100 + electrode));
    }
    assert_eq!(hellos(&messages).last().unwrap().settings, settings);
}

/// After a reset a board says what it waits by itself, and a conversion that is thrown away is not forgiven if it never ends.
#[test]
fn hello_says_the_select_time_of_the_wiring_and_a_late_conversion_counts_though_it_is_discarded() {
    let outside = Outside::default();
    let sample = |number: u64, _| if number == 6 { Err(TimedOut) } else { Ok(50) };
    let mut board = board(&outside, Failing::at(u32::MAX), sample, NoopDelay::new());
    outside.send(Command::Configure(Settings { discarded: 1, ..Settings::default() }));
    outside.send(Command::Start);
    scan(&mut board, 1);
    board.step().unwrap();
    let messages = outside.messages();
    assert_eq!(hellos(&messages)[0].settings, Settings { select_us: 1, ..Settings::default() });
    let frame = frames(&messages)[0];
    let expected: Vec<u16> = (0..256).map(|reading| if reading == 3 { 0 } else { 50 }).collect();
    assert_eq!((frame.head.status, frame.readings.to_vec()), (Status::TIMED_OUT, expected));
}

/// A board on which every electrode has its own input does not wait for one, and a long wait looks after the line.
#[test]
fn select_times_are_waited_where_there_is_one_input_and_the_line_is_looked_after() {
    let time_us = |outside: &Outside, start_us: u64| outside.clock_us.get() - start_us;
    let settings = Settings { settle_us: 0, select_us: 10_000, ..Settings::default() };
    let outside = Outside::default();
    let mut own_inputs = simple_board(&outside, numbered);
    outside.send(Command::Configure(settings));
    outside.send(Command::Start);
    own_inputs.step().unwrap();
    assert_eq!(time_us(&outside, 0), 16 * CONVERSION_US);

    let outside = Outside::default();
    let mut one_input = board(&outside, Failing::at(u32::MAX), numbered, NoopDelay::new());
    outside.send(Command::Configure(settings));
    outside.send(Command::Start);
    outside.send_while_waiting(Command::Hello);
    one_input.step().unwrap();
    assert_eq!(time_us(&outside, 0), 16 * (10_000 + CONVERSION_US));
    assert!(outside.wire.borrow().to_board.is_empty(), "the FIFO was emptied");
    assert!(outside.watchdog.get().longest_gap_us <= 250 + CONVERSION_US);
}
