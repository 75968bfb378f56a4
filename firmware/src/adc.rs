//! What the numbers of a converter mean.

use heapless::Vec;
use tactomo_protocol::{MAX_ELECTRODES, MAX_RANGES, Range};

/// A code for each electrode.
pub(crate) type Ceilings = [u16; MAX_ELECTRODES];

/// What a board's converters give.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adc {
    /// Bits of one conversion, at most 16.
    pub bits: u8,
    /// Code `2^bits` stands for this many millivolts (mV).
    pub full_scale_mv: u16,
    /// What the converters can see, from electrode 0 on; the last one that has electrodes reaches over all that are left.
    pub ranges: [Range; MAX_RANGES],
}

/// No converter.
const NO_RANGE: Range = Range { floor: 0, ceiling: 0, ..Range::of_codes(0, 1) };

impl Adc {
    /// A converter all of whose codes count, for all electrodes.
    pub const fn new(bits: u8, full_scale_mv: u16) -> Self {
        Self { bits, full_scale_mv, ranges: [Range::of_codes(u8::MAX, bits), NO_RANGE, NO_RANGE, NO_RANGE] }
    }

    /// Converters with these ranges, from electrode 0 on; those beyond the fourth are left out.
    pub fn with_ranges(self, ranges: &[Range]) -> Self {
        let mut own = [NO_RANGE; MAX_RANGES];
        own.iter_mut().zip(ranges).for_each(|(own, range)| *own = *range);
        Self { ranges: own, ..self }
    }

    /// The ranges of `electrodes` electrodes: the last one shrunk or stretched to end with them.
    pub(crate) fn ranges_of(&self, electrodes: u8) -> Vec<Range, MAX_RANGES> {
        let mut left = electrodes;
        let mut ranges: Vec<Range, MAX_RANGES> = Vec::new();
        for range in self.ranges.iter().filter(|range| range.electrodes > 0) {
            let electrodes = range.electrodes.min(left);
            left -= electrodes;
            if electrodes > 0 {
                // There is room for as many as there are.
                let _ = ranges.push(Range { electrodes, ..*range });
            }
        }
        if let Some(last) = ranges.last_mut() {
            last.electrodes += left;
        }
        ranges
    }

    /// The code at which a conversion of each electrode is at the end of the scale.
    pub(crate) fn ceilings(&self, electrodes: u8) -> Ceilings {
        let mut ceilings = [u16::MAX; MAX_ELECTRODES];
        let mut places = ceilings.iter_mut();
        for range in self.ranges_of(electrodes) {
            places.by_ref().take(range.electrodes.into()).for_each(|ceiling| *ceiling = range.ceiling);
        }
        ceilings
    }

    /// Bits below one code that averaging `2^average_log2` conversions wins: as many as it has doublings, as far as a reading of
    /// 16 bits holds them. (Noise falls by half a bit a doubling; the rest keeps the sum exact, so that the host loses nothing.)
    pub fn fraction_bits(&self, average_log2: u8) -> u8 {
        average_log2.min(16u8.saturating_sub(self.bits))
    }
}
