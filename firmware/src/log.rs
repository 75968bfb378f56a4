//! A defmt global logger whose bytes wait in memory until [`Chip::pull_log`](crate::Chip::pull_log) takes them into the board's
//! own stream.
//!
//! A board crate switches the feature `defmt` on, brings a critical section, and has `pull_log` call [`pull`]. When the queue is
//! full, whole log frames are dropped, so that what is left decodes.

use core::cell::{RefCell, UnsafeCell};

use critical_section::{Mutex, RestoreState};
use heapless::Deque;

/// Bytes of log that can wait.
const QUEUE_BYTES: usize = 512;

/// Bytes that wait, and the frame being written behind them.
struct Queue {
    bytes: Deque<u8, QUEUE_BYTES>,
    encoder: defmt::Encoder,
    /// Bytes of whole frames.
    whole: usize,
    /// Whether the frame under way did not fit.
    overflowed: bool,
}

static QUEUE: Mutex<RefCell<Queue>> = Mutex::new(RefCell::new(Queue {
    bytes: Deque::new(),
    encoder: defmt::Encoder::new(),
    whole: 0,
    overflowed: false,
}));

impl Queue {
    fn put(bytes: &mut Deque<u8, QUEUE_BYTES>, overflowed: &mut bool, encoded: &[u8]) {
        *overflowed |= encoded.iter().any(|byte| bytes.push_back(*byte).is_err());
    }

    fn begin(&mut self) {
        let Self { bytes, encoder, whole, overflowed } = self;
        (*whole, *overflowed) = (bytes.len(), false);
        encoder.start_frame(|encoded| Self::put(bytes, overflowed, encoded));
    }

    fn write(&mut self, content: &[u8]) {
        let Self { bytes, encoder, overflowed, .. } = self;
        encoder.write(content, |encoded| Self::put(bytes, overflowed, encoded));
    }

    fn end(&mut self) {
        let Self { bytes, encoder, whole, overflowed } = self;
        encoder.end_frame(|encoded| Self::put(bytes, overflowed, encoded));
        if *overflowed {
            bytes.truncate(*whole);
        }
    }
}

/// Moves log bytes into `buffer`, as far as it fits; returns how many.
pub fn pull(buffer: &mut [u8]) -> usize {
    with_queue(|queue| {
        let count = buffer.len().min(queue.bytes.len());
        buffer.iter_mut().zip(core::iter::from_fn(|| queue.bytes.pop_front())).for_each(|(to, byte)| *to = byte);
        count
    })
}

fn with_queue<T>(action: impl FnOnce(&mut Queue) -> T) -> T {
    critical_section::with(|section| action(&mut QUEUE.borrow_ref_mut(section)))
}

/// The critical section that a log frame holds from its begin to its end.
struct Held(UnsafeCell<RestoreState>);

#[allow(unsafe_code, reason = "touched only inside the critical section that it restores")]
unsafe impl Sync for Held {}

static HELD: Held = Held(UnsafeCell::new(RestoreState::invalid()));

#[defmt::global_logger]
struct Logger;

#[allow(unsafe_code, reason = "defmt's contract: a critical section is held from acquire to release")]
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: released in `release`, which defmt calls for every `acquire`; the cell is written inside the section.
        unsafe { *HELD.0.get() = critical_section::acquire() };
        with_queue(Queue::begin);
    }

    unsafe fn flush() {}

    unsafe fn release() {
        with_queue(Queue::end);
        // SAFETY: ends the section that `acquire` began; the cell is read inside it.
        unsafe { critical_section::release(*HELD.0.get()) };
    }

    unsafe fn write(bytes: &[u8]) {
        with_queue(|queue| queue.write(bytes));
    }
}
