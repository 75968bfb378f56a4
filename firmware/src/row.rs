//! One row of a scan: the electrodes that are read while one is grounded.

use tactomo_protocol::{MAX_ELECTRODES, Status};

use crate::adc::Ceilings;
use crate::{Chip, Mux, TimedOut};

/// What a [`Sampler`](crate::Sampler) is asked for, and where its conversions go. The ground is set, and the detector has settled.
pub trait Row {
    /// Error of the multiplexer's pins.
    type Error;

    /// The electrodes to convert, a bit each, electrode 0 the lowest.
    fn electrodes(&self) -> u32;

    /// How often each is to be converted: 1 to 256 times.
    fn conversions(&self) -> u32;

    /// Conversions of each electrode that come before those and are thrown away: 0 to 15. They find the sampling capacitor charged by another
    /// electrode, and leave it charged by this one. One that times out is [taken](Self::take) all the same.
    fn discarded(&self) -> u32;

    /// Brings an electrode to the converter and waits as long as the settings say. Needed where the multiplexer has one ADC input for all, before the
    /// first conversion of each electrode; where every electrode has an input of its own this does nothing, and may be left out.
    ///
    /// # Errors
    /// If a pin cannot be driven: the row is then to be given up.
    fn select(&mut self, electrode: u8) -> Result<(), Self::Error>;

    /// Feeds the watchdog, and sends what the line takes at this moment. To be called before every conversion, or every two or three if
    /// they are as fast as a UART's bytes (10 us), so that the line never runs dry.
    fn attend(&mut self);

    /// Takes the result of one conversion, in any order of the electrodes. One that timed out makes the electrode's reading zero, whatever
    /// its other conversions were.
    fn take(&mut self, electrode: u8, sampled: Result<u16, TimedOut>);
}

/// The sum of the codes of each electrode in a row.
pub(crate) type Sums = [u32; MAX_ELECTRODES];

/// The line to the host, while a scan goes on.
pub(crate) trait Attended<C> {
    /// Whether a frame that is done now could begin to be sent.
    fn has_room(&self) -> bool;

    /// Sends what the line takes at this moment.
    fn push(&mut self, chip: &mut C);

    /// Sends what the line takes, and takes what was received: for moments with time for both.
    fn transfer(&mut self, chip: &mut C);
}

/// Longest stretch of a wait in which nobody looks at the line (us): at 3 million baud, 75 bytes of the 128 of a UART's FIFO.
const WAIT_US: u32 = 250;

/// Waits, at least for `us`, and keeps line and watchdog alive.
pub(crate) fn wait<C: Chip>(chip: &mut C, line: &mut impl Attended<C>, mut us: u32) {
    while us > 0 {
        let piece = us.min(WAIT_US);
        chip.delay_us(piece);
        us -= piece;
        if us > 0 {
            chip.feed_watchdog();
            line.transfer(chip);
        }
    }
}

/// A row under way.
pub(crate) struct ScanRow<'a, M, C, A> {
    pub mux: &'a mut M,
    pub chip: &'a mut C,
    pub line: &'a mut A,
    pub electrodes: u32,
    pub average_log2: u8,
    /// Wait after an electrode was brought to the converter (us), and conversions that do not count then.
    pub select_us: u16,
    pub discarded: u8,
    pub ceilings: &'a Ceilings,
    /// Sums of each electrode's codes.
    pub sums: &'a mut Sums,
    pub status: Status,
    /// Electrodes of which a conversion timed out.
    pub timed_out: u32,
}

impl<M: Mux, C: Chip, A: Attended<C>> Row for ScanRow<'_, M, C, A> {
    type Error = M::Error;

    fn electrodes(&self) -> u32 {
        self.electrodes
    }

    fn conversions(&self) -> u32 {
        1 << self.average_log2
    }

    fn discarded(&self) -> u32 {
        self.discarded.into()
    }

    fn select(&mut self, electrode: u8) -> Result<(), M::Error> {
        self.mux.select(electrode)?;
        if M::SELECT_US > 0 {
            wait(self.chip, self.line, self.select_us.into());
        }
        Ok(())
    }

    fn attend(&mut self) {
        self.chip.feed_watchdog();
        self.line.push(self.chip);
    }

    fn take(&mut self, electrode: u8, sampled: Result<u16, TimedOut>) {
        let place = usize::from(electrode);
        let (Some(sum), Some(ceiling)) = (self.sums.get_mut(place), self.ceilings.get(place)) else { return };
        // What was not asked for would stay in the sums until it is.
        if self.electrodes >> place & 1 == 0 {
            return;
        }
        match sampled {
            Ok(code) => {
                *sum += u32::from(code);
                if code >= *ceiling {
                    self.status.insert(Status::SATURATED);
                }
            }
            Err(TimedOut) => {
                self.timed_out |= 1 << place;
                self.status.insert(Status::TIMED_OUT);
            }
        }
    }
}
