//! The line between the simulated board and the host: two bounded queues of bytes, and the rates of both ends, by which bytes arrive as they
//! were sent or do not.

use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tactomo_firmware::Serial;

use super::circuit::Circuit;
use super::model::{Figures, LineFigures};

/// Bytes that wait for the host: as many as the kernel keeps for a serial port that nobody reads.
const UP_BYTES: usize = 64 * 1024;
/// Bytes that wait for the board.
const DOWN_BYTES: usize = 4 * 1024;
/// Start, eight data bits, stop.
const BITS_A_BYTE: f64 = 10.0;

/// Both directions.
#[derive(Debug)]
pub(super) struct Line {
    /// Board to host.
    pub(super) up: Queue,
    /// Host to board.
    pub(super) down: Queue,
    /// Rates of the ends (bits a second); 0 on a line that has none.
    host_baud: AtomicU32,
    board_baud: AtomicU32,
    /// The highest rate that the bridge between them keeps.
    bridge_baud: AtomicU32,
    /// Whether the board has more to send than its FIFO took last.
    is_full: AtomicBool,
}

impl Line {
    /// The line of a board with these figures.
    pub(super) fn new(figures: &Figures) -> Self {
        let baud = figures.line.and_then(|line| line.rates.first().copied()).unwrap_or(0);
        Self {
            up: Queue::new(UP_BYTES),
            down: Queue::new(DOWN_BYTES),
            host_baud: AtomicU32::new(baud),
            board_baud: AtomicU32::new(baud),
            bridge_baud: AtomicU32::new(u32::MAX),
            is_full: AtomicBool::new(false),
        }
    }

    /// The rate of the host's end, where the line has one.
    pub(super) fn host_baud(&self) -> Option<u32> {
        Some(self.host_baud.load(Relaxed)).filter(|baud| *baud > 0)
    }

    pub(super) fn set_host_baud(&self, baud: u32) -> io::Result<()> {
        self.host_baud().ok_or(io::ErrorKind::Unsupported)?;
        self.host_baud.store(baud, Relaxed);
        Ok(())
    }

    /// Sets the highest rate that the bridge keeps.
    pub(super) fn set_bridge_baud(&self, baud: u32) {
        self.bridge_baud.store(baud, Relaxed);
    }

    /// Whether the board waits for room in its FIFO.
    pub(super) fn is_full(&self) -> bool {
        self.is_full.load(Relaxed)
    }

    /// Makes other bytes of those that pass the line now, where its ends differ in their rates or the bridge does not keep them.
    fn garble(&self, bytes: &mut [u8]) {
        let baud = self.board_baud.load(Relaxed);
        if baud != self.host_baud.load(Relaxed) || baud > self.bridge_baud.load(Relaxed) {
            bytes.iter_mut().for_each(|byte| *byte = byte.wrapping_mul(0x6D) ^ 0xA7);
        }
    }

    pub(super) fn is_open(&self) -> bool {
        self.down.lock().open
    }

    pub(super) fn close(&self) {
        self.up.close();
        self.down.close();
    }
}

/// Closes the line at the end of the scope, however it ends.
pub(super) struct CloseOnDrop<'a>(pub(super) &'a Line);

impl Drop for CloseOnDrop<'_> {
    fn drop(&mut self) {
        self.0.close();
    }
}

/// A bounded queue of bytes between two threads.
#[derive(Debug)]
pub(super) struct Queue {
    state: Mutex<State>,
    changed: Condvar,
    capacity: usize,
}

#[derive(Debug)]
struct State {
    bytes: VecDeque<u8>,
    open: bool,
}

impl Queue {
    fn new(capacity: usize) -> Self {
        let state = State { bytes: VecDeque::with_capacity(capacity), open: true };
        Self { state: Mutex::new(state), changed: Condvar::new(), capacity }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn close(&self) {
        self.lock().open = false;
        self.changed.notify_all();
    }

    /// Takes as many of `bytes` as there is room for; returns how many.
    fn put(&self, bytes: &[u8]) -> usize {
        let mut state = self.lock();
        let count = bytes.len().min(self.capacity - state.bytes.len());
        state.bytes.extend(&bytes[..count]);
        drop(state);
        if count > 0 {
            self.changed.notify_all();
        }
        count
    }

    /// Puts all of `bytes`, waiting for room.
    ///
    /// # Errors
    /// If the other end is gone, or there was no room in time.
    pub(super) fn put_all_within(&self, mut bytes: &[u8], bound: Duration) -> io::Result<()> {
        let end = Instant::now() + bound;
        while !bytes.is_empty() {
            if !self.lock().open {
                return Err(gone());
            }
            bytes = &bytes[self.put(bytes)..];
            let left = end.saturating_duration_since(Instant::now());
            if !bytes.is_empty() && left.is_zero() {
                return Err(io::Error::new(io::ErrorKind::TimedOut, "the simulated board does not take its commands"));
            }
            if !bytes.is_empty() {
                self.wait_until(left, |state| state.bytes.len() < self.capacity);
            }
        }
        Ok(())
    }

    /// Moves what is there into `buffer`; returns how many bytes.
    fn take(&self, buffer: &mut [u8]) -> usize {
        let mut state = self.lock();
        let count = buffer.len().min(state.bytes.len());
        buffer.iter_mut().zip(state.bytes.drain(..count)).for_each(|(to, byte)| *to = byte);
        drop(state);
        if count > 0 {
            self.changed.notify_all();
        }
        count
    }

    /// As [`take`](Self::take), but waits for a first byte.
    ///
    /// # Errors
    /// If nothing is left and the other end is gone.
    pub(super) fn take_within(&self, buffer: &mut [u8], bound: Duration) -> io::Result<usize> {
        self.wait(bound);
        match self.take(buffer) {
            0 if !self.lock().open => Err(gone()),
            count => Ok(count),
        }
    }

    /// Waits at most `bound` for a byte.
    pub(super) fn wait(&self, bound: Duration) {
        self.wait_until(bound, |state| !state.bytes.is_empty());
    }

    fn wait_until(&self, bound: Duration, ready: impl Fn(&State) -> bool) {
        let waiting = |state: &mut State| state.open && !ready(state);
        drop(self.changed.wait_timeout_while(self.lock(), bound, waiting));
    }
}

fn gone() -> io::Error {
    io::Error::new(io::ErrorKind::BrokenPipe, "the simulated board has stopped")
}

/// The board's end, as the firmware sees it.
#[derive(Debug)]
pub(super) struct BoardEnd {
    line: Arc<Line>,
    circuit: Arc<Circuit>,
    fifo: Option<Fifo>,
}

impl BoardEnd {
    pub(super) fn new(line: &Arc<Line>, circuit: &Arc<Circuit>, figures: &Figures) -> Self {
        let fifo = figures.line.map(|figures| Fifo { figures, held: 0.0, at: Duration::ZERO });
        Self { line: Arc::clone(line), circuit: Arc::clone(circuit), fifo }
    }
}

impl Serial for BoardEnd {
    fn push(&mut self, bytes: &[u8]) -> usize {
        let room = self.fifo.as_mut().map_or(bytes.len(), |fifo| fifo.room(self.circuit.now()));
        let mut sent = bytes[..bytes.len().min(room)].to_vec();
        // A packet comes when its last byte has left, and not before the board's own clock says so.
        if sent.len() == bytes.len() && sent.ends_with(&[0]) {
            let leaves = self.fifo.as_ref().map_or(Duration::ZERO, |fifo| fifo.time_of(sent.len()));
            self.circuit.wait_until(self.circuit.now() + leaves);
        }
        self.line.garble(&mut sent);
        let count = self.line.up.put(&sent);
        self.line.is_full.store(count < bytes.len(), Relaxed);
        if let Some(fifo) = &mut self.fifo {
            fifo.held += count as f64;
        }
        count
    }

    fn pull(&mut self, buffer: &mut [u8]) -> usize {
        let count = self.line.down.take(buffer);
        if count > 0 {
            // A command is not obeyed before it was sent, by the board's own clock.
            self.circuit.advance_to(self.circuit.wall());
        }
        // The board's thread may have slept since they came, where a board would have looked.
        self.line.garble(&mut buffer[..count]);
        count
    }

    fn rates(&self) -> &'static [u32] {
        self.fifo.as_ref().map_or(&[], |fifo| fifo.figures.rates)
    }

    fn set_baud(&mut self, baud: u32) {
        if let Some(fifo) = &mut self.fifo {
            self.circuit.advance(fifo.empty(self.circuit.now()).as_nanos() as u64);
            fifo.figures.bytes_per_s = f64::from(baud) / BITS_A_BYTE;
            self.line.board_baud.store(baud, Relaxed);
        }
    }
}

/// The FIFO of a transmitter that empties at a steady rate. A packet reaches the host when its last byte has left; bytes before it, when the FIFO
/// takes them.
#[derive(Debug)]
struct Fifo {
    figures: LineFigures,
    held: f64,
    at: Duration,
}

impl Fifo {
    /// Time from now until it is empty.
    fn empty(&mut self, now: Duration) -> Duration {
        self.room(now);
        let left = std::mem::take(&mut self.held) / self.figures.bytes_per_s;
        self.at = now + Duration::from_secs_f64(left);
        self.at - now
    }

    /// Time until it has sent what it holds, and so many bytes more.
    fn time_of(&self, bytes: usize) -> Duration {
        Duration::from_secs_f64((self.held + bytes as f64) / self.figures.bytes_per_s)
    }

    /// Bytes that it has room for at this board time.
    fn room(&mut self, now: Duration) -> usize {
        let sent = (now - self.at).as_secs_f64() * self.figures.bytes_per_s;
        self.at = now;
        self.held = (self.held - sent).max(0.0);
        (self.figures.fifo_bytes - self.held) as usize
    }
}
