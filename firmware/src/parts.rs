//! What a board crate brings.

use embedded_hal::delay::DelayNs;

/// The parts that a [`Board`](crate::Board) is made of.
#[derive(Debug)]
pub struct Parts<M, S, L, C> {
    /// Grounds electrodes: a [`Mux`](crate::Mux).
    pub mux: M,
    /// Converts voltages: a [`Sampler`].
    pub sampler: S,
    /// The line to the host: a [`Serial`].
    pub serial: L,
    /// Clock, delay, watchdog: a [`Chip`].
    pub chip: C,
}

/// A conversion did not finish within the sampler's bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the conversion did not finish in time")]
pub struct TimedOut;

/// Converts the voltage of an electrode.
pub trait Sampler {
    /// Runs one conversion of `electrode` (0 and up) and returns its code.
    ///
    /// With a multiplexer that brings every electrode to one input, [`Mux::select`](crate::Mux::select) came before, and
    /// `electrode` may be ignored. The wait for the converter is bounded, by about ten times a normal conversion: the scan
    /// never waits longer than 256 such bounds between two feeds of the watchdog.
    ///
    /// # Errors
    /// [`TimedOut`] if the converter did not finish within that bound.
    fn sample(&mut self, electrode: u8) -> Result<u16, TimedOut>;
}

/// The line to the host. Neither direction ever waits.
pub trait Serial {
    /// Takes as many of `bytes`, from the front, as the transmitter has room for at once; returns how many. A UART takes no
    /// more than its FIFO has free.
    fn push(&mut self, bytes: &[u8]) -> usize;

    /// Moves what was received into `buffer`, as far as it fits; returns how many bytes.
    fn pull(&mut self, buffer: &mut [u8]) -> usize;
}

/// Clock, delay, watchdog and log of the chip.
pub trait Chip: DelayNs {
    /// Microseconds (us) since the reset; never runs backwards.
    fn now_us(&mut self) -> u64;

    /// Feeds the watchdog; called before every reading, hence at least every 256 conversions or settle time.
    fn feed_watchdog(&mut self);

    /// Moves bytes of the chip's defmt stream into `buffer`, as far as it fits; returns how many. Chips without a log keep
    /// this form.
    fn pull_log(&mut self, _buffer: &mut [u8]) -> usize {
        0
    }
}
