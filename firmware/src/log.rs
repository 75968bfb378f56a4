//! A defmt global logger whose bytes wait in memory until [`Chip::pull_log`](crate::Chip::pull_log) takes them into the board's
//! own stream.
//!
//! A board crate switches the feature `defmt` on, brings a critical section, and has `pull_log` call [`pull`]. When the queue is
//! full, whole log frames are dropped, so that what is left decodes.

use core::cell::{RefCell, UnsafeCell};

use critical_section::{Mutex, RestoreState};

use crate::log_queue::LogQueue;

/// Bytes that wait, and the encoder of the frame being written behind them.
struct Log {
    queue: LogQueue,
    encoder: defmt::Encoder,
}

static LOG: Mutex<RefCell<Log>> =
    Mutex::new(RefCell::new(Log { queue: LogQueue::new(), encoder: defmt::Encoder::new() }));

impl Log {
    fn begin(&mut self) {
        let Self { queue, encoder } = self;
        queue.begin();
        encoder.start_frame(|encoded| queue.put(encoded));
    }

    fn write(&mut self, content: &[u8]) {
        let Self { queue, encoder } = self;
        encoder.write(content, |encoded| queue.put(encoded));
    }

    fn end(&mut self) {
        let Self { queue, encoder } = self;
        encoder.end_frame(|encoded| queue.put(encoded));
        queue.end();
    }
}

/// Moves log bytes into `buffer`, as far as it fits; returns how many.
pub fn pull(buffer: &mut [u8]) -> usize {
    with_log(|log| log.queue.pull(buffer))
}

fn with_log<T>(action: impl FnOnce(&mut Log) -> T) -> T {
    critical_section::with(|section| action(&mut LOG.borrow_ref_mut(section)))
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
        with_log(Log::begin);
    }

    unsafe fn flush() {}

    unsafe fn release() {
        with_log(Log::end);
        // SAFETY: ends the section that `acquire` began; the cell is read inside it.
        unsafe { critical_section::release(*HELD.0.get()) };
    }

    unsafe fn write(bytes: &[u8]) {
        with_log(|log| log.write(bytes));
    }
}
