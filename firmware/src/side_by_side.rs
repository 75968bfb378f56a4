//! Two converters that work side by side, as the ESP32's do.

use crate::{Row, Sampler, TimedOut};

/// Two converters, each with electrodes of its own.
pub trait ConverterPair {
    /// Converts an electrode of each, at the same time, or one of either; what comes of the one that was not asked for means nothing. At least
    /// one is asked for.
    ///
    /// Each wait is bounded, as [`Sampler::sample`] says.
    fn convert(&mut self, electrodes: [Option<u8>; 2]) -> [Result<u16, TimedOut>; 2];

    /// Sets both up anew, as [`Sampler::restart`] says.
    fn restart(&mut self);
}

/// A [`Sampler`] over two converters: the first has the electrodes from 0 on, the second those that follow.
#[derive(Debug)]
pub struct SideBySide<C> {
    converters: C,
    /// Electrodes of the first.
    first: u8,
}

impl<C: ConverterPair> SideBySide<C> {
    /// Converters of which the first has so many electrodes.
    pub fn new(converters: C, first: u8) -> Self {
        Self { converters, first }
    }

    /// Converts a pair of electrodes as often as the row says. The first conversion of an electrode that times out is its last, and the pair ends
    /// with that of both.
    fn convert_pair<R: Row>(&mut self, row: &mut R, mut pair: [Option<u8>; 2]) {
        let discarded = row.discarded();
        for number in 0..discarded + row.conversions() {
            row.attend();
            let sampled = self.converters.convert(pair);
            let mut is_late = false;
            for (place, sampled) in pair.iter_mut().zip(sampled) {
                let Some(electrode) = *place else { continue };
                if number >= discarded || sampled.is_err() {
                    row.take(electrode, sampled);
                }
                is_late |= sampled.is_err();
                *place = place.filter(|_| sampled.is_ok());
            }
            if is_late {
                self.converters.restart();
            }
            if pair == [None, None] {
                return;
            }
        }
    }
}

impl<C: ConverterPair> Sampler for SideBySide<C> {
    fn sample(&mut self, electrode: u8) -> Result<u16, TimedOut> {
        let is_first = electrode < self.first;
        let asked = if is_first { [Some(electrode), None] } else { [None, Some(electrode)] };
        let [first, second] = self.converters.convert(asked);
        if is_first { first } else { second }
    }

    fn restart(&mut self) {
        self.converters.restart();
    }

    /// An electrode of each at a time, as long as both have some left.
    fn sample_row<R: Row>(&mut self, row: &mut R) -> Result<(), R::Error> {
        let below = 1u32.checked_shl(self.first.into()).unwrap_or(0).wrapping_sub(1);
        let electrodes = row.electrodes();
        let mut of_first = tactomo_protocol::scope::electrodes_of(electrodes & below);
        let mut of_second = tactomo_protocol::scope::electrodes_of(electrodes & !below);
        loop {
            let pair = [of_first.next(), of_second.next()];
            if pair == [None, None] {
                return Ok(());
            }
            self.convert_pair(row, pair);
        }
    }
}
