//! Samplers of boards to come: two converters side by side, one that is late, one that hangs.

use std::cell::RefCell;
use std::rc::Rc;

use tactomo_firmware::{Activity, Board16, ConverterPair, NoTouch, Parts, Row, Sampler, SideBySide, TimedOut};
use tactomo_protocol::{Command, Fault, Plan, Settings, Status};

use super::more_parts::*;
use super::parts::*;

type Record = Rc<RefCell<Vec<String>>>;

fn board_with<S: Sampler>(outside: &Outside, sampler: S) -> Board16<NoMux, S, TestSerial, NullPart> {
    Board16::new(Parts { mux: NoMux, sampler, serial: serial(outside), chip: NullPart, touch: NoTouch }, IDENTITY)
        .unwrap()
}

fn scan_with<S: Sampler>(board: &mut Board16<NoMux, S, TestSerial, NullPart>, frames: usize) {
    for _ in 0..frames {
        while board.step().unwrap() != Activity::Frame {}
    }
}

/// Two converters that work side by side, as the ESP32's do: electrodes 0 to 5 are at one, 6 to 15 at the other.
struct Pair {
    slots: Rc<RefCell<u32>>,
    /// Which of them hang, and restarts.
    hang: [bool; 2],
    restarts: Rc<RefCell<u32>>,
}

impl ConverterPair for Pair {
    fn convert(&mut self, electrodes: [Option<u8>; 2]) -> [Result<u16, TimedOut>; 2] {
        assert_ne!(electrodes, [None, None], "nothing is asked for");
        *self.slots.borrow_mut() += 1;
        let of = |unit: usize| match electrodes[unit] {
            Some(electrode) if !self.hang[unit] => Ok(u16::from(electrode) * 10),
            Some(_) => Err(TimedOut),
            // What nobody asked for means nothing.
            None => Err(TimedOut),
        };
        [of(0), of(1)]
    }

    fn restart(&mut self) {
        *self.restarts.borrow_mut() += 1;
    }
}

/// What two converters did: slots, restarts.
type Done = (Rc<RefCell<u32>>, Rc<RefCell<u32>>);

fn pair(hang: [bool; 2]) -> (SideBySide<Pair>, Done) {
    let done = Done::default();
    let pair = Pair { slots: Rc::clone(&done.0), hang, restarts: Rc::clone(&done.1) };
    (SideBySide::new(pair, 6), done)
}

/// Both hang at the largest average: an electrode of each costs one conversion, and not 256.
#[test]
fn two_converters_that_hang_cost_one_slot_and_one_restart_a_pair() {
    let outside = Outside::default();
    let (sampler, (slots, restarts)) = pair([true; 2]);
    let mut board = board_with(&outside, sampler);
    outside.send(Command::Configure(Settings { average_log2: 8, discarded: 3, ..Settings::default() }));
    outside.send(Command::Start);
    assert_eq!(board.step(), Ok(Activity::Row));
    assert_eq!((*slots.borrow(), *restarts.borrow()), (10, 10));
    scan_with(&mut board, 1);
    board.step().unwrap();
    assert_eq!(faults(&outside.messages()), [&Fault::AdcStuck]);
}

#[test]
fn one_converter_that_hangs_leaves_the_other_its_average() {
    let outside = Outside::default();
    let (sampler, (slots, restarts)) = pair([true, false]);
    let mut board = board_with(&outside, sampler);
    outside.send(Command::Configure(Settings { average_log2: 2, ..Settings::default() }));
    outside.send(Command::Start);
    scan_with(&mut board, 1);
    assert_eq!((*slots.borrow(), *restarts.borrow()), (16 * 40, 16 * 6));
    board.step().unwrap();
    let messages = outside.messages();
    let frame = frames(&messages)[0];
    assert_eq!(frame.head.status, Status::TIMED_OUT);
    let row: Vec<u16> = (0..16).map(|electrode| if electrode < 6 { 0 } else { 40 * electrode }).collect();
    assert!(frame.readings.chunks(16).all(|found| found == row), "{:?}", frame.readings);
}

#[test]
fn of_two_converters_rows_and_single_electrodes_can_be_asked() {
    let outside = Outside::default();
    let (mut sampler, (slots, _)) = pair([false; 2]);
    assert_eq!([0, 5, 6, 15].map(|electrode| sampler.sample(electrode)), [Ok(0), Ok(50), Ok(60), Ok(150)]);
    slots.replace(0);
    let mut board = board_with(&outside, sampler);
    let plan =
        Plan { grounds: [2].into_iter().collect(), reads: 0b1000_0001_0010_0001, rows_a_frame: 1, average_log2: 0 };
    outside.send(Command::Scan(plan));
    outside.send(Command::Configure(Settings { discarded: 1, ..Settings::default() }));
    outside.send(Command::Start);
    scan_with(&mut board, 1);
    assert_eq!(*slots.borrow(), 2 * 2, "two pairs, each once for nothing");
    board.step().unwrap();
    assert_eq!(frames(&outside.messages())[0].readings, [0, 50, 80, 150]);
}

#[test]
fn two_converters_side_by_side_take_ten_slots_a_row() {
    let outside = Outside::default();
    let (sampler, (slots, _)) = pair([false; 2]);
    let mut board = board_with(&outside, sampler);
    outside.send(Command::Start);
    scan_with(&mut board, 1);
    assert_eq!(*slots.borrow(), 16 * 10);
    outside.send(Command::Configure(Settings { average_log2: 2, ..Settings::default() }));
    scan_with(&mut board, 1);
    board.step().unwrap();
    let messages = outside.messages();
    let [once, averaged] = frames(&messages)[..] else { panic!("two frames") };
    for (reading, electrode) in (0..16).cycle().take(256).enumerate() {
        assert_eq!((once.readings[reading], averaged.readings[reading]), (electrode * 10, electrode * 40));
    }
}

/// A converter that answers one request too late: its code comes with the next one, unless it is restarted.
struct Late {
    record: Record,
    conversions: u32,
    late: Option<u16>,
}

impl Sampler for Late {
    fn sample(&mut self, electrode: u8) -> Result<u16, TimedOut> {
        self.conversions += 1;
        self.record.borrow_mut().push(format!("sample {electrode}"));
        if let Some(code) = self.late.take() {
            return Ok(code);
        }
        if self.conversions == 16 + 3 {
            self.late = Some(4000);
            return Err(TimedOut);
        }
        Ok(7)
    }

    fn restart(&mut self) {
        self.record.borrow_mut().push("restart".to_owned());
        self.late = None;
    }
}

#[test]
fn a_late_conversion_is_never_taken_for_another() {
    let outside = Outside::default();
    let record = Record::default();
    let mut board = board_with(&outside, Late { record: Rc::clone(&record), conversions: 0, late: None });
    outside.send(Command::Start);
    scan_with(&mut board, 1);
    board.step().unwrap();
    let messages = outside.messages();
    let frame = frames(&messages)[0];
    assert_eq!(frame.head.status, Status::TIMED_OUT);
    for (reading, code) in frame.readings.iter().enumerate() {
        assert_eq!(*code, if reading == 16 + 2 { 0 } else { 7 }, "reading {reading}");
    }
    assert_eq!(record.borrow()[16..22], ["sample 0", "sample 1", "sample 2", "restart", "sample 3", "sample 4"]);
}

#[test]
fn a_reading_of_which_one_conversion_is_late_is_zero() {
    let outside = Outside::default();
    let mut board = board_with(&outside, Late { record: Record::default(), conversions: 0, late: None });
    outside.send(Command::Configure(Settings { average_log2: 2, ..Settings::default() }));
    outside.send(Command::Start);
    scan_with(&mut board, 2);
    board.step().unwrap();
    let messages = outside.messages();
    let [late, next] = frames(&messages)[..] else { panic!("two frames") };
    // The nineteenth conversion is the third of electrode 4; what it had of the first two is forgotten.
    let expected: Vec<u16> = (0..256).map(|reading| if reading == 4 { 0 } else { 28 }).collect();
    assert_eq!((late.head.status, &late.readings[..]), (Status::TIMED_OUT, &expected[..]));
    assert_eq!((next.head.status, &next.readings[..]), (Status::default(), &[28; 256][..]));
}

/// Hangs from a conversion on until it is restarted often enough.
struct Stuck {
    restarts: u32,
}

impl Sampler for Stuck {
    fn sample(&mut self, _electrode: u8) -> Result<u16, TimedOut> {
        if self.restarts < 300 { Err(TimedOut) } else { Ok(5) }
    }

    fn restart(&mut self) {
        self.restarts += 1;
    }
}

#[test]
fn a_stuck_converter_is_restarted_after_every_reading_until_it_comes_back() {
    let outside = Outside::default();
    let mut board = board_with(&outside, Stuck { restarts: 0 });
    outside.send(Command::Configure(Settings { average_log2: 3, ..Settings::default() }));
    outside.send(Command::Start);
    scan_with(&mut board, 3);
    board.step().unwrap();
    let messages = outside.messages();
    assert_eq!(faults(&messages), [&Fault::AdcStuck]);
    let late: Vec<_> =
        frames(&messages).iter().map(|frame| frame.readings.iter().filter(|code| **code == 0).count()).collect();
    assert_eq!(late, [256, 300 - 256, 0]);
}

/// Hands over codes of electrodes that nobody asked for.
struct Generous;

impl Sampler for Generous {
    fn sample(&mut self, _electrode: u8) -> Result<u16, TimedOut> {
        Ok(1)
    }

    fn sample_row<R: Row>(&mut self, row: &mut R) -> Result<(), R::Error> {
        (0..=255).for_each(|electrode| row.take(electrode, Ok(if electrode < 16 { 1 } else { 100 })));
        Ok(())
    }
}

#[test]
fn codes_that_nobody_asked_for_are_left_out() {
    let outside = Outside::default();
    let mut board = board_with(&outside, Generous);
    let few =
        tactomo_protocol::Plan { grounds: [0].into_iter().collect(), reads: 0b10, rows_a_frame: 1, average_log2: 0 };
    outside.send(Command::Scan(few));
    outside.send(Command::Start);
    scan_with(&mut board, 3);
    outside.send(Command::Scan(tactomo_protocol::Plan::default()));
    scan_with(&mut board, 1);
    board.step().unwrap();
    let messages = outside.messages();
    let (whole, rows): (Vec<_>, Vec<_>) = frames(&messages).into_iter().partition(|frame| frame.scope.is_whole());
    assert!(!rows.is_empty() && rows.iter().all(|frame| frame.readings == [1]), "{rows:?}");
    assert_eq!(whole[0].readings, [1; 256]);
}
