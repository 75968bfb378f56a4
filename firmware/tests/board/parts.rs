//! Parts of a board for tests: what they do is set and seen from outside through shared handles.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;

use embedded_hal::delay::DelayNs;
use embedded_hal_mock::eh1::delay::NoopDelay;
use tactomo_firmware::mux::Mux;
use tactomo_firmware::{Adc, Board16, Chip, Identity, NoTouch, Parts, Sampler, Serial, TimedOut, Touch};
use tactomo_protocol::{BoardMessage, BoardReceiver, Command, Frame, Hello, MAX_COMMAND, Request, encode_request};

/// Time of one conversion of the test's converter (us).
pub const CONVERSION_US: u64 = 10;

/// What the tests' boards say about themselves.
pub const IDENTITY: Identity =
    Identity { firmware_version: "1.2.3", board: "test", electrodes: 16, adc: Adc::new(12, 3300), drive_mv: 2000 };

/// The outside of a test board.
#[derive(Clone, Default)]
pub struct Outside {
    pub wire: Rc<RefCell<Wire>>,
    pub clock_us: Rc<Cell<u64>>,
    pub watchdog: Rc<Cell<Watchdog>>,
    pub log: Rc<RefCell<VecDeque<u8>>>,
    /// Conversions so far.
    pub conversions: Rc<Cell<u64>>,
    receiver: Rc<RefCell<BoardReceiver>>,
}

/// The line: what the board sent, what waits for it, and how much it takes.
pub struct Wire {
    pub sent: Vec<u8>,
    pub to_board: VecDeque<u8>,
    /// Bytes that a push takes at most.
    pub room: usize,
    /// Times that the board looked for bytes.
    pub pulls: usize,
    /// Comes when the board has looked for bytes twice more.
    pub soon: Vec<u8>,
    /// Rates that it can be set to, the one that it has, and how many bytes were sent before each change.
    pub rates: &'static [u32],
    pub baud: u32,
    pub changes: Vec<usize>,
}

impl Default for Wire {
    fn default() -> Self {
        Self {
            sent: Vec::new(),
            to_board: VecDeque::new(),
            room: usize::MAX,
            pulls: 0,
            soon: Vec::new(),
            rates: &[],
            baud: 0,
            changes: Vec::new(),
        }
    }
}

#[derive(Clone, Copy, Default)]
pub struct Watchdog {
    pub feeds: u64,
    pub last_us: u64,
    pub longest_gap_us: u64,
}

/// The serial line of a test board.
pub struct TestSerial(pub Outside);

impl Serial for TestSerial {
    fn rates(&self) -> &'static [u32] {
        self.0.wire.borrow().rates
    }

    fn set_baud(&mut self, baud: u32) {
        let mut wire = self.0.wire.borrow_mut();
        wire.baud = baud;
        let sent = wire.sent.len();
        wire.changes.push(sent);
    }

    fn push(&mut self, bytes: &[u8]) -> usize {
        let mut wire = self.0.wire.borrow_mut();
        let count = bytes.len().min(wire.room);
        wire.sent.extend(&bytes[..count]);
        count
    }

    fn pull(&mut self, buffer: &mut [u8]) -> usize {
        let mut wire = self.0.wire.borrow_mut();
        wire.pulls += 1;
        if wire.pulls.is_multiple_of(2) {
            let soon = std::mem::take(&mut wire.soon);
            wire.to_board.extend(soon);
        }
        let waiting = &mut wire.to_board;
        let count = buffer.len().min(waiting.len());
        buffer.iter_mut().zip(waiting.drain(..count)).for_each(|(to, byte)| *to = byte);
        count
    }
}

/// A chip whose delays are checked by `D` and move the clock on.
pub struct TestChip<D>(Outside, D);

impl<D: DelayNs> DelayNs for TestChip<D> {
    fn delay_ns(&mut self, ns: u32) {
        self.1.delay_ns(ns);
        self.0.advance_us(u64::from(ns) / 1000);
    }

    fn delay_us(&mut self, us: u32) {
        self.1.delay_us(us);
        self.0.advance_us(u64::from(us));
    }
}

impl<D: DelayNs> Chip for TestChip<D> {
    fn now_us(&mut self) -> u64 {
        self.0.clock_us.get()
    }

    fn feed_watchdog(&mut self) {
        let now_us = self.0.clock_us.get();
        let Watchdog { feeds, last_us, longest_gap_us } = self.0.watchdog.get();
        let longest_gap_us = longest_gap_us.max(now_us - last_us);
        self.0.watchdog.set(Watchdog { feeds: feeds + 1, last_us: now_us, longest_gap_us });
    }

    fn pull_log(&mut self, buffer: &mut [u8]) -> usize {
        let mut log = self.0.log.borrow_mut();
        let count = buffer.len().min(log.len());
        buffer.iter_mut().zip(log.drain(..count)).for_each(|(to, byte)| *to = byte);
        count
    }
}

/// A converter that answers with a function of the conversion's number and the electrode, and takes its time.
pub struct TestSampler<F>(pub Outside, pub F);

impl<F: FnMut(u64, u8) -> Result<u16, TimedOut>> Sampler for TestSampler<F> {
    fn sample(&mut self, electrode: u8) -> Result<u16, TimedOut> {
        self.0.advance_us(CONVERSION_US);
        let number = self.0.conversions.replace(self.0.conversions.get() + 1);
        (self.1)(number, electrode)
    }
}

/// A multiplexer with nothing behind it.
pub struct NoMux;

impl Mux for NoMux {
    type Error = std::convert::Infallible;
    const SELECT_US: u16 = 0;

    fn ground(&mut self, _electrode: u8) -> Result<(), Self::Error> {
        Ok(())
    }

    fn select(&mut self, _electrode: u8) -> Result<(), Self::Error> {
        Ok(())
    }
}

pub type TestBoard<M, F, D, T = NoTouch> = Board16<M, TestSampler<F>, TestSerial, TestChip<D>, T>;

/// A board of these parts.
pub fn board<M: Mux, F, D: DelayNs>(outside: &Outside, mux: M, sample: F, delay: D) -> TestBoard<M, F, D>
where
    F: FnMut(u64, u8) -> Result<u16, TimedOut>,
{
    board_with(outside, mux, sample, delay, NoTouch)
}

/// A board of these parts that may find contacts.
pub fn board_with<M: Mux, F, D: DelayNs, T: Touch>(
    outside: &Outside,
    mux: M,
    sample: F,
    delay: D,
    touch: T,
) -> TestBoard<M, F, D, T>
where
    F: FnMut(u64, u8) -> Result<u16, TimedOut>,
{
    board_of(outside, mux, sample, delay, touch, IDENTITY)
}

/// The same of another identity.
pub fn board_of<M: Mux, F, D: DelayNs, T: Touch>(
    outside: &Outside,
    mux: M,
    sample: F,
    delay: D,
    touch: T,
    identity: Identity,
) -> TestBoard<M, F, D, T>
where
    F: FnMut(u64, u8) -> Result<u16, TimedOut>,
{
    let parts = Parts {
        mux,
        sampler: TestSampler(outside.clone(), sample),
        serial: TestSerial(outside.clone()),
        chip: TestChip(outside.clone(), delay),
        touch,
    };
    Board16::new(parts, identity).unwrap()
}

/// A board with no multiplexer and unchecked delays.
pub fn simple_board<F>(outside: &Outside, sample: F) -> TestBoard<NoMux, F, NoopDelay>
where
    F: FnMut(u64, u8) -> Result<u16, TimedOut>,
{
    board(outside, NoMux, sample, NoopDelay::new())
}

/// Takes `count` steps.
pub fn step<M: Mux, F, D: DelayNs, T: Touch>(board: &mut TestBoard<M, F, D, T>, count: usize)
where
    F: FnMut(u64, u8) -> Result<u16, TimedOut>,
    M::Error: std::fmt::Debug,
{
    for _ in 0..count {
        board.step().unwrap();
    }
}

impl Outside {
    pub fn advance_us(&self, us: u64) {
        self.clock_us.set(self.clock_us.get() + us);
    }

    pub fn send_tagged(&self, tag: u8, command: Command) {
        let mut packet = [0; MAX_COMMAND];
        let length = encode_request(&Request { tag, command }, &mut packet).unwrap();
        self.send_bytes(&packet[..length]);
    }

    pub fn send_bytes(&self, bytes: &[u8]) {
        self.wire.borrow_mut().to_board.extend(bytes);
    }

    /// Bytes that a push takes at most from now on.
    pub fn set_room(&self, room: usize) {
        self.wire.borrow_mut().room = room;
    }

    /// The messages sent since the last call; every packet must be whole.
    pub fn messages(&self) -> Vec<BoardMessage> {
        let sent = std::mem::take(&mut self.wire.borrow_mut().sent);
        assert!(sent.last().is_none_or(|byte| *byte == 0), "the last packet is cut");
        let (mut receiver, mut input) = (self.receiver.borrow_mut(), &sent[..]);
        std::iter::from_fn(|| receiver.receive(&mut input)).map(Result::unwrap).collect()
    }
}

pub fn frames(messages: &[BoardMessage]) -> Vec<&Frame> {
    messages
        .iter()
        .filter_map(|message| if let BoardMessage::Frame(frame) = message { Some(frame) } else { None })
        .collect()
}

pub fn hellos(messages: &[BoardMessage]) -> Vec<&Hello> {
    messages
        .iter()
        .filter_map(|message| if let BoardMessage::Hello(hello) = message { Some(hello) } else { None })
        .collect()
}
