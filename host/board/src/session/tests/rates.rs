//! The negotiation of the line's rate between the session and the firmware itself, over lines that lose, garble, and keep some rates only.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::rc::Rc;

use embedded_hal::delay::DelayNs;
use proptest::prelude::*;
use tactomo_firmware::{Adc, Board16, Chip, Identity, Mux, NoTouch, Parts, Sampler, Serial, TimedOut};
use tactomo_protocol::{BoardMessage, BoardReceiver, MAX_COMMAND, encode_request};

use super::*;

static ALL: [u32; 4] = [921_600, 1_500_000, 2_000_000, 3_000_000];
/// Time of a conversion (us): a frame of four electrodes takes 1.6 ms.
const CONVERSION_US: u64 = 100;
/// Time between two looks of the host (us).
const STEP_US: u64 = 5_000;

/// Both ends of a line, and what is between them.
struct Wire {
    now_us: u64,
    host_baud: u32,
    board_baud: u32,
    /// The highest rate that is kept.
    cap: u32,
    /// Of so many bytes one is damaged, at rates above the first; 0 for none.
    damage_every: u32,
    /// State of the damage's random numbers.
    random: u32,
    up: VecDeque<u8>,
    down: VecDeque<u8>,
    /// When the board's transmitter is empty (us).
    empty_us: f64,
}

impl Wire {
    fn pass(&mut self, byte: u8) -> u8 {
        self.random = self.random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let is_garbled = self.host_baud != self.board_baud || self.board_baud > self.cap;
        let is_hit =
            self.damage_every > 0 && self.board_baud > ALL[0] && (self.random >> 8).is_multiple_of(self.damage_every);
        if is_garbled || is_hit { byte.wrapping_mul(0x6D) ^ 0xA7 } else { byte }
    }
}

#[derive(Clone)]
struct Part(Rc<RefCell<Wire>>);

impl Mux for Part {
    type Error = Infallible;
    const SELECT_US: u16 = 0;

    fn ground(&mut self, _electrode: u8) -> Result<(), Infallible> {
        Ok(())
    }

    fn select(&mut self, _electrode: u8) -> Result<(), Infallible> {
        Ok(())
    }
}

impl Sampler for Part {
    fn sample(&mut self, _electrode: u8) -> Result<u16, TimedOut> {
        self.0.borrow_mut().now_us += CONVERSION_US;
        Ok(500)
    }
}

impl DelayNs for Part {
    fn delay_ns(&mut self, ns: u32) {
        self.0.borrow_mut().now_us += u64::from(ns) / 1000;
    }
}

impl Chip for Part {
    fn now_us(&mut self) -> u64 {
        self.0.borrow().now_us
    }

    fn feed_watchdog(&mut self) {}
}

impl Serial for Part {
    fn push(&mut self, bytes: &[u8]) -> usize {
        let mut wire = self.0.borrow_mut();
        let (now_us, byte_us) = (wire.now_us as f64, 1e7 / f64::from(wire.board_baud));
        wire.empty_us = wire.empty_us.max(now_us);
        let room = 128.0 - (wire.empty_us - now_us) / byte_us;
        let count = bytes.len().min(room.max(0.0) as usize);
        wire.empty_us += count as f64 * byte_us;
        for byte in &bytes[..count] {
            let arrived = wire.pass(*byte);
            wire.up.push_back(arrived);
        }
        count
    }

    fn pull(&mut self, buffer: &mut [u8]) -> usize {
        let mut wire = self.0.borrow_mut();
        let count = buffer.len().min(wire.down.len());
        buffer.iter_mut().zip(wire.down.drain(..count)).for_each(|(to, byte)| *to = byte);
        count
    }

    fn rates(&self) -> &'static [u32] {
        &ALL
    }

    fn set_baud(&mut self, baud: u32) {
        let mut wire = self.0.borrow_mut();
        wire.now_us = wire.now_us.max(wire.empty_us.ceil() as u64);
        wire.board_baud = baud;
    }
}

type TestBoard = Board16<Part, Part, Part, Part>;

/// A host and a board on a line.
struct Pair {
    wire: Rc<RefCell<Wire>>,
    board: TestBoard,
    begin: Instant,
    session: Session,
    receiver: BoardReceiver,
    /// Numbers of the frames that came.
    numbers: Vec<u16>,
}

impl Pair {
    fn new(cap: u32, damage_every: u32, seed: u32) -> Self {
        let wire = Rc::new(RefCell::new(Wire {
            now_us: 0,
            host_baud: ALL[0],
            board_baud: ALL[0],
            cap,
            damage_every,
            random: seed,
            up: VecDeque::new(),
            down: VecDeque::new(),
            empty_us: 0.0,
        }));
        let part = || Part(Rc::clone(&wire));
        let parts = Parts { mux: part(), sampler: part(), serial: part(), chip: part(), touch: NoTouch };
        let identity =
            Identity { firmware_version: "1", board: "test", electrodes: 4, adc: Adc::new(12, 3300), drive_mv: 2000 };
        let board = TestBoard::new(parts, identity).unwrap();
        let (begin, receiver) = (Instant::now(), BoardReceiver::default());
        let mut pair = Self { wire, board, begin, session: talk(begin), receiver, numbers: Vec::new() };
        pair.open();
        pair
    }

    fn now(&self) -> Instant {
        self.begin + Duration::from_micros(self.wire.borrow().now_us)
    }

    /// A host opens the line, whatever was before.
    fn open(&mut self) {
        self.session = talk(self.now());
        self.wire.borrow_mut().host_baud = ALL[0];
        self.receiver = BoardReceiver::default();
    }

    fn run(&mut self, seconds: f64) {
        let end_us = self.wire.borrow().now_us + (1e6 * seconds) as u64;
        while self.wire.borrow().now_us < end_us {
            self.host();
            let until_us = self.wire.borrow().now_us + STEP_US;
            while self.wire.borrow().now_us < until_us {
                self.board.step().unwrap();
                self.wire.borrow_mut().now_us += 50;
            }
        }
    }

    /// What a host does between two reads.
    fn host(&mut self) {
        let bytes: Vec<u8> = self.wire.borrow_mut().up.drain(..).collect();
        let (mut input, now) = (&bytes[..], self.now());
        while let Some(message) = self.receiver.receive(&mut input) {
            match message {
                Ok(BoardMessage::Hello(hello)) => self.session.hello(&hello, now),
                Ok(BoardMessage::Frame(frame)) => {
                    self.session.frame(now);
                    self.numbers.push(frame.head.sequence);
                }
                Ok(BoardMessage::Fault(fault)) => drop(self.session.fault(&fault)),
                _ => {}
            }
        }
        let rates = self.session.rates.as_mut().unwrap();
        rates.damaged(self.receiver.counters().corrupt, now);
        if let Some(baud) = rates.link_due(now) {
            self.wire.borrow_mut().host_baud = baud;
            rates.link_set(baud, now);
            // The pause that a host makes here.
            return;
        }
        while let Some(request) = self.session.command(now) {
            let mut packet = [0; MAX_COMMAND];
            let length = encode_request(&request, &mut packet).unwrap();
            let mut wire = self.wire.borrow_mut();
            for byte in [&[0], &packet[..length]].concat() {
                let arrived = wire.pass(byte);
                wire.down.push_back(arrived);
            }
        }
    }

    fn bauds(&self) -> (u32, u32) {
        (self.wire.borrow().host_baud, self.wire.borrow().board_baud)
    }

    fn missing(&self) -> usize {
        self.numbers.windows(2).map(|pair| usize::from(pair[1].wrapping_sub(pair[0]).wrapping_sub(1))).sum()
    }
}

/// A session on a link with a rate.
fn talk(now: Instant) -> Session {
    let mut session = Session::new(RequestedSettings::default());
    session.rates = Some(Rates::new(ALL[0], now));
    session
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn on_a_line_that_keeps_some_rates_the_highest_of_them_is_found_and_no_frame_is_lost(cap in ALL[0]..4_000_000) {
        let mut pair = Pair::new(cap, 0, 1);
        pair.run(1.0);
        let expected = ALL.into_iter().filter(|rate| *rate <= cap).max().unwrap();
        prop_assert_eq!(pair.bauds(), (expected, expected));
        prop_assert!(pair.numbers.len() > 100 && pair.numbers[0] == 0);
        pair.run(3.0);
        prop_assert_eq!((pair.bauds(), pair.missing()), ((expected, expected), 0));
    }

    #[test]
    fn a_line_that_damages_higher_rates_is_left_for_one_that_it_keeps(every in 100..30_000u32, seed in any::<u32>()) {
        let mut pair = Pair::new(u32::MAX, every, seed);
        pair.run(90.0);
        // Damage at every rate but the first: in the end it is that one, and no more is lost.
        let before = pair.numbers.len();
        prop_assert_eq!(pair.bauds(), (ALL[0], ALL[0]));
        pair.numbers.clear();
        pair.run(3.0);
        prop_assert!(before > 0 && pair.numbers.len() > 1000);
        prop_assert_eq!((pair.bauds(), pair.missing()), ((ALL[0], ALL[0]), 0));
    }

    #[test]
    fn whatever_a_bridge_and_hosts_do_the_board_is_found_again(
        events in prop::collection::vec((0.01..3.0f64, ALL[0]..4_000_000, any::<bool>()), 1..6),
        cap in ALL[0]..4_000_000,
    ) {
        let mut pair = Pair::new(u32::MAX, 0, 1);
        for (seconds, cap, opens) in events {
            pair.wire.borrow_mut().cap = cap;
            pair.run(seconds);
            if opens {
                pair.open();
            }
        }
        pair.wire.borrow_mut().cap = cap;
        pair.run(12.0);
        pair.numbers.clear();
        pair.run(2.0);
        let (host, board) = pair.bauds();
        prop_assert!(host == board && host <= cap, "{} {} of {}", host, board, cap);
        prop_assert!(pair.numbers.len() > 500 && pair.missing() == 0, "{} {}", pair.numbers.len(), pair.missing());
    }
}
