//! The pins and the ADC of the emulated board: address lines kept in memory, readings from the table.

use core::cell::Cell;
use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin};
use tactomo_firmware::{Sampler, TimedOut};

use crate::gauge::Gauge;
use crate::machine::press;
use crate::table::{ELECTRODES, FRAMES, reading};

type Readings = [[u16; ELECTRODES]; ELECTRODES];

/// The readings of each frame, in memory.
static TABLE: [Readings; FRAMES] = table();

const fn table() -> [Readings; FRAMES] {
    let mut table = [[[0; ELECTRODES]; ELECTRODES]; FRAMES];
    let mut place = 0;
    while place < FRAMES * ELECTRODES * ELECTRODES {
        let (frame, ground, electrode) =
            (place / (ELECTRODES * ELECTRODES), place / ELECTRODES % ELECTRODES, place % ELECTRODES);
        table[frame][ground][electrode] = reading(frame, ground, electrode);
        place += 1;
    }
    table
}

/// Reading of a detector that nothing touches, in the scan with this number: a level, and noise of five codes.
fn at_rest(scan: u32, ground: usize, electrode: usize) -> u16 {
    let level = (37 * ground + 61 * electrode) as u16 % 900 + 60;
    let place = ((scan as usize * ELECTRODES + ground) * ELECTRODES + electrode) as u32;
    let scattered = place.wrapping_mul(2_654_435_761);
    let bits = (scattered ^ scattered >> 15).wrapping_mul(0x2C1B_3C6D).count_ones() as i32;
    // 32 fair bits have a deviation of 2.8.
    level.wrapping_add_signed((7 * (bits - 16) / 4) as i16)
}

/// What the sampler reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Played {
    /// The frames of the table.
    Table,
    /// A detector at rest, with noise.
    Rest,
    /// One without noise, on which something presses.
    Press {
        /// Number of the first scan in which it does.
        from: u32,
        /// Of the first one after.
        to: u32,
    },
}

/// One of the multiplexer's address lines, a bit of their levels.
pub struct AddressLine<'a> {
    levels: &'a Cell<u8>,
    bit: u8,
}

/// The four address lines A0 to A3, whose levels are kept in `levels`.
pub fn address_lines(levels: &Cell<u8>) -> [AddressLine<'_>; 4] {
    [0, 1, 2, 3].map(|line| AddressLine { levels, bit: 1 << line })
}

impl ErrorType for AddressLine<'_> {
    type Error = Infallible;
}

impl OutputPin for AddressLine<'_> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.levels.set(self.levels.get() & !self.bit);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.levels.set(self.levels.get() | self.bit);
        Ok(())
    }
}

/// Reads what is played under the ground that the address lines tell; goes to its next frame when they come back to 0.
pub struct TableSampler<'a> {
    levels: &'a Cell<u8>,
    gauge: &'a Gauge,
    played: Played,
    scan: u32,
    ground: usize,
}

impl<'a> TableSampler<'a> {
    /// A sampler that begins with the first frame of what is played.
    pub fn new(levels: &'a Cell<u8>, gauge: &'a Gauge, played: Played) -> Self {
        Self { levels, gauge, played, scan: u32::MAX, ground: ELECTRODES - 1 }
    }

    // In line, some of its work moves out of what the gauge leaves out.
    #[inline(never)]
    fn read(&mut self, electrode: usize) -> Option<u16> {
        let before = self.ground;
        self.ground = usize::from(self.levels.get());
        if self.ground == 0 && before != 0 {
            self.scan = self.scan.wrapping_add(1);
        }
        let (scan, ground) = (self.scan, self.ground);
        let of = |frame: &Readings| frame.get(ground)?.get(electrode).copied();
        match self.played {
            Played::Table => of(TABLE.get(scan as usize % FRAMES)?),
            Played::Rest => Some(at_rest(scan, ground, electrode)),
            Played::Press { from, to } if (from..to).contains(&scan) => of(press()),
            Played::Press { .. } => Some(0),
        }
    }
}

impl Sampler for TableSampler<'_> {
    fn sample(&mut self, electrode: u8) -> Result<u16, TimedOut> {
        let gauge = self.gauge;
        gauge.leave_out(|| self.read(usize::from(electrode))).ok_or(TimedOut)
    }
}
