//! What a board crate brings.

use embedded_hal::delay::DelayNs;

use crate::{NoTouch, Row};

/// The parts that a [`Board`](crate::Board) is made of.
#[derive(Debug)]
pub struct Parts<M, S, L, C, T = NoTouch> {
    /// Grounds electrodes: a [`Mux`](crate::Mux).
    pub mux: M,
    /// Converts voltages: a [`Sampler`].
    pub sampler: S,
    /// The line to the host: a [`Serial`].
    pub serial: L,
    /// Clock, delay, watchdog: a [`Chip`].
    pub chip: C,
    /// Finds contacts, if anything does: a [`Touch`](crate::Touch).
    pub touch: T,
}

/// A conversion did not finish within the sampler's bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the conversion did not finish in time")]
pub struct TimedOut;

/// Converts the voltages of electrodes.
///
/// A converter that does one thing after the other needs [`sample`](Self::sample) alone, and [`restart`](Self::restart) where it can hang. One that
/// can do better writes [`sample_row`](Self::sample_row) itself: two converters that work side by side ([`SideBySide`](crate::SideBySide)), or one
/// behind a bus that takes the next address while it sends the last code.
///
/// A conversion that comes too late is never to be returned in place of another: whoever starts a conversion first clears, or reads and
/// throws away, what an earlier one may have left.
pub trait Sampler {
    /// Runs one conversion of `electrode` (0 and up) and returns its code.
    ///
    /// With a multiplexer that brings every electrode to one input, [`Row::select`] came before, and `electrode` may be ignored. The wait
    /// for the converter is bounded, by about ten times a normal conversion.
    ///
    /// # Errors
    /// [`TimedOut`] if the converter did not finish within that bound.
    fn sample(&mut self, electrode: u8) -> Result<u16, TimedOut>;

    /// Sets the converter up anew, and gives up a conversion that did not finish. It comes after each one that timed out, before the next
    /// is started.
    fn restart(&mut self) {}

    /// Converts every electrode of a row as often as it says, and hands it the codes.
    ///
    /// This form takes one electrode after the other: [`select`](Row::select)s it, [`sample`](Self::sample)s it, and calls
    /// [`attend`](Row::attend) before each conversion; the first are [thrown away](Row::discarded). The first conversion that times out is the electrode's last, so that a stuck converter
    /// costs one bound an electrode, whatever the averaging, and the converter is [restarted](Self::restart). Other forms do so too.
    ///
    /// # Errors
    /// As [`Row::select`] has them.
    fn sample_row<R: Row>(&mut self, row: &mut R) -> Result<(), R::Error> {
        let mut electrodes = row.electrodes();
        let mut electrode = 0;
        while electrodes != 0 {
            if electrodes & 1 == 1 {
                row.select(electrode)?;
                let discarded = row.discarded();
                for number in 0..discarded + row.conversions() {
                    row.attend();
                    let sampled = self.sample(electrode);
                    if number >= discarded || sampled.is_err() {
                        row.take(electrode, sampled);
                    }
                    if sampled.is_err() {
                        self.restart();
                        break;
                    }
                }
            }
            electrodes >>= 1;
            electrode += 1;
        }
        Ok(())
    }
}

/// The line to the host. Neither direction ever waits.
pub trait Serial {
    /// Rates that the line can be set to (bits a second), of which it has the first after a reset; none on a line whose rate is not the board's to
    /// choose, such as a USB port.
    fn rates(&self) -> &'static [u32] {
        &[]
    }

    /// Sets the line to one of its [rates](Self::rates), when what was pushed has left the transmitter: that alone is waited for, a FIFO's time.
    fn set_baud(&mut self, _baud: u32) {}

    /// Takes as many of `bytes`, from the front, as the transmitter has room for at once; returns how many. A UART takes no
    /// more than its FIFO has free.
    fn push(&mut self, bytes: &[u8]) -> usize;

    /// Moves what was received into `buffer`, as far as it fits; returns how many bytes. Called between two rows, and every 250 us of a wait.
    fn pull(&mut self, buffer: &mut [u8]) -> usize;
}

/// Clock, delay, watchdog and log of the chip.
pub trait Chip: DelayNs {
    /// Microseconds (us) since the reset; never runs backwards.
    fn now_us(&mut self) -> u64;

    /// Feeds the watchdog; called before every conversion, every 250 us of a wait, and in every step of a board that has nothing to do.
    fn feed_watchdog(&mut self);

    /// Moves bytes of the chip's defmt stream into `buffer`, as far as it fits; returns how many. Chips without a log keep
    /// this form.
    fn pull_log(&mut self, _buffer: &mut [u8]) -> usize {
        0
    }
}
