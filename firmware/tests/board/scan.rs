//! The scan against mocked pins, delays and converters.

use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{ErrorType, OutputPin};
use embedded_hal_mock::eh1::MockError;
use embedded_hal_mock::eh1::delay::{CheckedDelay, NoopDelay, Transaction as Delay};
use embedded_hal_mock::eh1::digital::{Mock as Pin, State, Transaction as Level};
use tactomo_firmware::TimedOut;
use tactomo_firmware::mux::{Enabled, LatchLines, Latched, Transparent};
use tactomo_protocol::{Command, Fault, Settings, Status};

use super::more_parts::*;
use super::parts::*;

const HIGH: State = State::High;
const LOW: State = State::Low;

fn level(bits: usize, line: usize) -> Level {
    Level::set(if bits >> line & 1 == 1 { HIGH } else { LOW })
}

fn done(pins: impl IntoIterator<Item = Pin>) {
    pins.into_iter().for_each(|mut pin| pin.done());
}

#[test]
fn a_transparent_scan_sets_four_lines_and_settles_once_a_ground() {
    let address = [0, 1, 2, 3].map(|line| Pin::new(&(0..16).map(|ground| level(ground, line)).collect::<Vec<_>>()));
    let mut delay = CheckedDelay::new(&vec![Delay::delay_us(20); 16]);
    let outside = Outside::default();
    let mut board = board(&outside, Transparent::new(address.clone()), numbered, delay.clone());
    outside.send(Command::Start);
    scan(&mut board, 1);

    done(address);
    delay.done();
    let messages = outside.messages();
    let expected: Vec<u16> = (0..256).map(|reading| 4 * reading).collect();
    assert_eq!(frames(&messages)[0].readings[..], expected);
    assert_eq!(outside.conversions.get(), 256);
}

#[test]
fn a_latched_scan_strobes_half_a_for_a_ground_and_half_b_for_an_electrode() {
    let pairs = || (0..16).flat_map(|ground| std::iter::once(ground).chain(0..16));
    let address = [0, 1, 2, 3].map(|line| Pin::new(&pairs().map(|bits| level(bits, line)).collect::<Vec<_>>()));
    let strobes = |count: usize| {
        let levels = [HIGH].into_iter().chain((0..count).flat_map(|_| [LOW, HIGH]));
        Pin::new(&levels.map(Level::set).collect::<Vec<_>>())
    };
    let lines = [strobes(16 + 256), strobes(16), strobes(256)];
    let [wr, csa, csb] = lines.clone();
    let row = || std::iter::once(Delay::delay_us(20)).chain((0..16).map(|_| Delay::delay_us(17)));
    let mut delay = CheckedDelay::new(&(0..16).flat_map(|_| row()).collect::<Vec<_>>());

    let outside = Outside::default();
    let mux = Latched::new(address.clone(), LatchLines { wr, csa, csb }).unwrap();
    let mut board = board(&outside, mux, numbered, delay.clone());
    outside.send(Command::Start);
    scan(&mut board, 1);

    done(address.into_iter().chain(lines));
    delay.done();
    assert_eq!(frames(&outside.messages()).len(), 1);
}

/// A pin that writes its name and level into a common record.
#[derive(Clone)]
struct Recorded(&'static str, Rc<RefCell<Vec<String>>>);

impl ErrorType for Recorded {
    type Error = Infallible;
}

impl OutputPin for Recorded {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.1.borrow_mut().push(format!("{}0", self.0));
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.1.borrow_mut().push(format!("{}1", self.0));
        Ok(())
    }
}

#[test]
fn a_latch_opens_only_while_its_address_is_at_rest_and_before_the_conversion() {
    let record = Rc::new(RefCell::new(Vec::new()));
    let pin = |name| Recorded(name, Rc::clone(&record));
    let lines = LatchLines { wr: pin("wr"), csa: pin("csa"), csb: pin("csb") };
    let mux = Latched::new(["a", "b", "c", "d"].map(pin), lines).unwrap();
    let mux = Enabled::new(mux, pin("en")).unwrap();
    let converted = Rc::clone(&record);
    let sample = move |_, electrode| {
        converted.borrow_mut().push(format!("convert {electrode}"));
        Ok(0)
    };
    let outside = Outside::default();
    let mut board = board(&outside, mux, sample, NoopDelay::new());
    assert_eq!(record.take(), ["wr1", "csa1", "csb1", "en1"], "idle and off until the first scan");
    outside.send(Command::Start);
    board.step().unwrap();
    board.step().unwrap();

    let record = record.take();
    let second_row: Vec<_> = record.iter().skip(record.len() / 2).map(String::as_str).collect();
    let ground = ["en0", "a1", "b0", "c0", "d0", "csa0", "wr0", "wr1", "csa1"];
    let first = ["a0", "b0", "c0", "d0", "csb0", "wr0", "wr1", "csb1", "convert 0"];
    let second = ["a1", "b0", "c0", "d0", "csb0", "wr0", "wr1", "csb1", "convert 1"];
    assert_eq!(second_row[..27], [ground, first, second].concat());
}

/// Delays in the same record as the pins.
struct RecordedDelay(Rc<RefCell<Vec<String>>>);

impl DelayNs for RecordedDelay {
    fn delay_ns(&mut self, ns: u32) {
        self.0.borrow_mut().push(format!("{ns} ns"));
    }
}

#[test]
fn an_electrode_settles_after_it_was_selected_and_before_it_is_converted() {
    let record = Rc::new(RefCell::new(Vec::new()));
    let pin = |name| Recorded(name, Rc::clone(&record));
    let lines = LatchLines { wr: pin("wr"), csa: pin("csa"), csb: pin("csb") };
    let mux = Latched::new(["a", "b", "c", "d"].map(pin), lines).unwrap();
    let converted = Rc::clone(&record);
    let sample = move |_, _| {
        converted.borrow_mut().push("convert".to_owned());
        Ok(0)
    };
    let outside = Outside::default();
    let mut board = board(&outside, mux, sample, RecordedDelay(Rc::clone(&record)));
    record.take();
    outside.send(Command::Start);
    board.step().unwrap();
    let events = ["csa1", "csb1", "20000 ns", "17000 ns", "convert"];
    let order: Vec<_> = record.take().into_iter().filter(|event| events.contains(&event.as_str())).collect();
    assert_eq!(order[..8], ["csa1", "20000 ns", "csb1", "17000 ns", "convert", "csb1", "17000 ns", "convert"]);
}

#[test]
fn a_pin_that_fails_ends_the_step_with_its_error() {
    let error = || MockError::Io(std::io::ErrorKind::BrokenPipe);
    let mut failing = Pin::new(&[Level::set(LOW).with_error(error())]);
    let mut idle = [(); 3].map(|()| Pin::new(&[]));
    let [b, c, d] = idle.clone();
    let outside = Outside::default();
    let mut board = board(&outside, Transparent::new([failing.clone(), b, c, d]), numbered, NoopDelay::new());
    outside.send(Command::Start);
    assert_eq!(board.run(), error());
    failing.done();
    idle.iter_mut().for_each(Pin::done);
}

#[test]
fn a_stuck_converter_is_told_once_and_again_after_it_came_back() {
    let outside = Outside::default();
    // Frames 0 to 2 and 4 are stuck, whatever the averaging: a reading ends with its first time-out.
    let sample = |number, _| if number / 256 == 3 { Ok(7) } else { Err(TimedOut) };
    let mut board = simple_board(&outside, sample);
    outside.send(Command::Start);
    scan(&mut board, 3);
    let messages = outside.messages();
    assert_eq!(faults(&messages), [&Fault::AdcStuck]);
    let stuck = frames(&messages);
    assert!(stuck.iter().all(|frame| frame.head.status == Status::TIMED_OUT && frame.readings == [0; 256]));
    assert_eq!(stuck.len(), 3);

    scan(&mut board, 2);
    let messages = outside.messages();
    assert_eq!(frames(&messages)[0].head.status, Status::default());
    assert_eq!(faults(&messages), [&Fault::AdcStuck]);
}

#[test]
fn a_stuck_converter_costs_one_bound_a_reading_whatever_the_averaging() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, |_, _| Err(TimedOut));
    outside.send(Command::Configure(Settings { average_log2: 8, ..Settings::default() }));
    outside.send(Command::Start);
    scan(&mut board, 1);
    assert_eq!(outside.conversions.get(), 256);
}

#[test]
fn one_conversion_that_times_out_or_saturates_shows_in_its_frame_only() {
    let outside = Outside::default();
    let sample = |number, _| match number {
        100 => Err(TimedOut),
        300 => Ok(4095),
        _ => Ok(4094),
    };
    let mut board = simple_board(&outside, sample);
    outside.send(Command::Start);
    scan(&mut board, 3);
    let messages = outside.messages();
    let [late, saturated, clean] = frames(&messages)[..] else { panic!("three frames") };
    assert_eq!((late.head.status, late.readings[100], late.readings[101]), (Status::TIMED_OUT, 0, 4094));
    assert_eq!((saturated.head.status, saturated.readings[300 - 256]), (Status::SATURATED, 4095));
    assert_eq!(clean.head.status, Status::default());
    assert!(faults(&messages).is_empty());
}

#[test]
fn averaging_wins_a_bit_a_doubling_until_a_reading_is_full() {
    for average_log2 in 0..=8u8 {
        let count = 1u64 << average_log2;
        let outside = Outside::default();
        // Codes alternate between 1000 and 1001 in pairs of pairs: the mean is 1000 and a share of the last quarter.
        let code = |number: u64| 1000 + u16::from(number % 4 == 3) + (number / count / 16) as u16;
        let mut board = simple_board(&outside, move |number, _| Ok(code(number)));
        outside.send(Command::Configure(Settings { average_log2, ..Settings::default() }));
        outside.send(Command::Start);
        scan(&mut board, 1);

        let messages = outside.messages();
        let frame = frames(&messages)[0];
        let fraction_bits = average_log2.min(4);
        assert_eq!(frame.head.fraction_bits, fraction_bits);
        for (reading, value) in (0..).zip(&frame.readings) {
            let sum: u32 = (0..count).map(|i| u32::from(code(reading * count + i))).sum();
            let exact = f64::from(sum) / count as f64 * f64::from(1 << fraction_bits);
            assert_eq!(f64::from(*value), exact.round(), "reading {reading}, average {count}");
        }
        assert_eq!(outside.conversions.get(), 256 * count);
    }
}

#[test]
fn the_mean_is_rounded_to_the_nearest_and_full_scale_stays_in_range() {
    let outside = Outside::default();
    // 256 conversions of 12 bits: four bits are won, four are rounded away.
    let sample = |number: u64, _| {
        Ok(match number / 256 {
            0 => 4095,
            1 => u16::from(number % 256 < 7),
            2 => u16::from(number % 256 < 8),
            _ => 0,
        })
    };
    let mut board = simple_board(&outside, sample);
    outside.send(Command::Configure(Settings { average_log2: 8, ..Settings::default() }));
    outside.send(Command::Start);
    scan(&mut board, 1);
    let messages = outside.messages();
    assert_eq!(frames(&messages)[0].readings[..4], [4095 * 16, 0, 1, 0]);
    assert_eq!(frames(&messages)[0].head.status, Status::SATURATED);
}

#[test]
fn the_watchdog_is_fed_before_every_conversion_of_the_longest_scan() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Configure(Settings { average_log2: 8, ..Settings::default() }));
    outside.send(Command::Start);
    scan(&mut board, 2);
    let watchdog = outside.watchdog.get();
    assert!(watchdog.feeds >= 512 * 256);
    assert!(watchdog.longest_gap_us <= CONVERSION_US + 20, "{} us", watchdog.longest_gap_us);
}
