//! The ESP32's two ADCs, which convert side by side.
//!
//! esp-hal's driver sets them up, but it waits for a conversion that it has begun before it begins another, for ever if that hangs. So what
//! starts, reads and restarts a conversion is here: the driver's own steps, with a bound.

use tactomo_firmware::{ConverterPair, TimedOut};

use crate::bounded::within;

/// Looks at the ADCs before a conversion is given up: 0.2 ms at least, some ten times what a conversion takes.
pub const MAX_LOOKS: u32 = 4_000;

/// Registers of two ADCs: ADC1 is unit 0, ADC2 unit 1.
pub trait Units {
    /// Whether the state machine of the last conversion is at rest, as a start needs it.
    fn are_at_rest(&mut self) -> bool;

    /// Starts a conversion of a channel. The start bit falls first, with which an earlier one is done with.
    fn start(&mut self, unit: usize, channel: u8);

    /// The reading of the conversion under way (mV), once it is done.
    fn reading(&mut self, unit: usize) -> Option<u16>;

    /// Lets the start bit fall.
    fn stop(&mut self, unit: usize);

    /// Gives the analogue side of both power, or takes it.
    fn power(&mut self, on: bool);
}

/// Two ADCs and the channel of each electrode.
#[derive(Debug)]
pub struct Converters<U, const ELECTRODES: usize> {
    units: U,
    channels: [u8; ELECTRODES],
}

impl<U: Units, const ELECTRODES: usize> Converters<U, ELECTRODES> {
    /// ADCs that are set up, and the channel of each electrode at its ADC.
    pub fn new(units: U, channels: [u8; ELECTRODES]) -> Self {
        Self { units, channels }
    }

    /// Converts a channel of each, or of one of them.
    fn channels(&mut self, channels: [Option<u8>; 2]) -> [Result<u16, TimedOut>; 2] {
        let units = &mut self.units;
        // Whatever comes of it: the conversion tells.
        let _ = within(MAX_LOOKS, || units.are_at_rest().then_some(()));
        for (unit, channel) in channels.iter().enumerate() {
            channel.iter().for_each(|channel| units.start(unit, *channel));
        }
        let mut readings = channels.map(|channel| channel.is_none().then_some(0));
        let _ = within(MAX_LOOKS, || {
            for (unit, reading) in readings.iter_mut().enumerate() {
                *reading = reading.or_else(|| units.reading(unit));
            }
            readings.iter().all(Option::is_some).then_some(())
        });
        readings.map(|reading| reading.ok_or(TimedOut))
    }
}

impl<U: Units, const ELECTRODES: usize> ConverterPair for Converters<U, ELECTRODES> {
    fn convert(&mut self, electrodes: [Option<u8>; 2]) -> [Result<u16, TimedOut>; 2] {
        self.channels(electrodes.map(|electrode| self.channels.get(usize::from(electrode?)).copied()))
    }

    /// Takes the power from both ADCs and gives it back. A conversion that comes late after all is thrown away, in place of one that nobody
    /// wants.
    fn restart(&mut self) {
        (0..2).for_each(|unit| self.units.stop(unit));
        self.units.power(false);
        self.units.power(true);
        // Both have a pin at channel 0.
        let _ = self.channels([Some(0), Some(0)]);
    }
}

#[cfg(test)]
mod tests;
