//! The scan: every electrode read under every ground, row by row, with averaging.

use heapless::Vec;
use tactomo_protocol::{FrameHead, MAX_RANGES, MAX_READINGS, Range, Settings, Status};

use crate::{Chip, Mux, Sampler, TimedOut};

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
const NO_RANGE: Range = Range { electrodes: 0, floor: 0, ceiling: 0 };

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

    /// Code at which a conversion of `electrode` is at the end of the scale.
    fn ceiling(&self, electrode: u8) -> u16 {
        let mut end = 0u16;
        let mut ceiling = u16::MAX;
        for range in self.ranges.iter().filter(|range| range.electrodes > 0) {
            ceiling = range.ceiling;
            end += u16::from(range.electrodes);
            if u16::from(electrode) < end {
                break;
            }
        }
        ceiling
    }

    /// Bits below one code that averaging `2^average_log2` conversions wins: as many as it has doublings, as far as a reading of
    /// 16 bits holds them. (Noise falls by half a bit a doubling; the rest keeps the sum exact, so that the host loses nothing.)
    pub fn fraction_bits(&self, average_log2: u8) -> u8 {
        average_log2.min(16u8.saturating_sub(self.bits))
    }
}

/// A scan under way and the readings of the last whole one; room for `READINGS` of them.
#[derive(Debug)]
pub struct Scan<const READINGS: usize> {
    readings: [u16; READINGS],
    electrodes: u8,
    /// The ground whose row comes next.
    row: u8,
    time_us: u64,
    status: Status,
    timed_out: u16,
}

/// What a whole scan met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scanned {
    /// Board time at its start (us).
    pub time_us: u64,
    /// Saturated and timed-out conversions.
    pub status: Status,
    /// Whether no reading at all was converted in time.
    pub stuck: bool,
}

impl Scanned {
    /// The head of the frame that carries this scan.
    pub fn head(&self, sequence: u16, fraction_bits: u8) -> FrameHead {
        FrameHead { sequence, time_us: self.time_us as u32, status: self.status, fraction_bits }
    }
}

/// What the scan measures with, and how.
#[derive(Debug)]
pub struct Bench<'a, M, S, C> {
    /// Grounds and selects.
    pub mux: &'a mut M,
    /// Converts.
    pub sampler: &'a mut S,
    /// Waits, and feeds the watchdog.
    pub chip: &'a mut C,
    /// What the converter gives.
    pub adc: Adc,
    /// Settle time and averaging.
    pub settings: Settings,
}

impl<const READINGS: usize> Scan<READINGS> {
    /// A scan of `electrodes`; `None` if its readings do not fit.
    pub fn new(electrodes: u8) -> Option<Self> {
        let count = usize::from(electrodes) * usize::from(electrodes);
        (count <= READINGS.min(MAX_READINGS)).then_some(Self {
            readings: [0; READINGS],
            electrodes,
            row: 0,
            time_us: 0,
            status: Status::default(),
            timed_out: 0,
        })
    }

    /// Readings of the last whole scan, row by row (`readings[g * electrodes + e]`), in units of `2^-fraction_bits` codes.
    pub fn readings(&self) -> &[u16] {
        let count = usize::from(self.electrodes) * usize::from(self.electrodes);
        self.readings.get(..count).unwrap_or_default()
    }

    /// Whether some rows of a scan are done and others not.
    pub fn is_under_way(&self) -> bool {
        self.row != 0
    }

    /// Abandons the scan under way.
    pub fn abandon(&mut self) {
        self.row = 0;
    }

    /// Grounds the next electrode, waits the settle time and reads all electrodes; calls `between` before every conversion.
    /// Returns what the scan met once its last row is done.
    ///
    /// # Errors
    /// If a pin of the multiplexer cannot be driven; the scan is then abandoned.
    pub fn row<M: Mux, S: Sampler, C: Chip>(
        &mut self,
        bench: &mut Bench<M, S, C>,
        between: impl FnMut(&mut C),
    ) -> Result<Option<Scanned>, M::Error> {
        if self.row == 0 {
            self.begin(bench.chip.now_us());
        }
        let ground = core::mem::take(&mut self.row);
        self.read_row(ground, bench, between)?;
        let next = ground + 1;
        if next < self.electrodes {
            self.row = next;
            return Ok(None);
        }
        Ok(Some(self.scanned()))
    }

    fn begin(&mut self, now_us: u64) {
        self.time_us = now_us;
        self.status = Status::default();
        self.timed_out = 0;
    }

    fn scanned(&self) -> Scanned {
        let stuck = usize::from(self.timed_out) == self.readings().len();
        Scanned { time_us: self.time_us, status: self.status, stuck }
    }

    fn read_row<M: Mux, S: Sampler, C: Chip>(
        &mut self,
        ground: u8,
        bench: &mut Bench<M, S, C>,
        mut between: impl FnMut(&mut C),
    ) -> Result<(), M::Error> {
        bench.mux.ground(ground)?;
        bench.chip.delay_us(u32::from(bench.settings.settle_us));
        let first = usize::from(ground) * usize::from(self.electrodes);
        for electrode in 0..self.electrodes {
            bench.chip.feed_watchdog();
            bench.select(electrode)?;
            let (reading, status) = bench.read(electrode, &mut between);
            self.status.insert(status);
            self.timed_out += u16::from(status.contains(Status::TIMED_OUT));
            if let Some(place) = self.readings.get_mut(first + usize::from(electrode)) {
                *place = reading;
            }
        }
        Ok(())
    }
}

impl<M: Mux, S: Sampler, C: Chip> Bench<'_, M, S, C> {
    fn select(&mut self, electrode: u8) -> Result<(), M::Error> {
        self.mux.select(electrode)?;
        if M::SELECT_SETTLE_NS > 0 {
            self.chip.delay_ns(M::SELECT_SETTLE_NS);
        }
        Ok(())
    }

    /// The mean of `2^average_log2` conversions, and what they met. The first one that times out ends it: the reading is zero,
    /// and a stuck converter costs one bound a reading, whatever the averaging.
    fn read(&mut self, electrode: u8, mut between: impl FnMut(&mut C)) -> (u16, Status) {
        let (mut sum, mut status) = (0u32, Status::default());
        let ceiling = self.adc.ceiling(electrode);
        for _ in 0..1u32 << self.settings.average_log2 {
            between(self.chip);
            match self.sampler.sample(electrode) {
                Ok(code) if code >= ceiling => {
                    status.insert(Status::SATURATED);
                    sum += u32::from(code);
                }
                Ok(code) => sum += u32::from(code),
                Err(TimedOut) => return (0, Status::TIMED_OUT),
            }
        }
        (self.mean(sum), status)
    }

    /// Mean of `2^average_log2` codes in units of `2^-fraction_bits` codes, rounded to the nearest.
    fn mean(&self, sum: u32) -> u16 {
        let average_log2 = self.settings.average_log2;
        let shift = u32::from(average_log2 - self.adc.fraction_bits(average_log2));
        let half = (1u32 << shift) >> 1;
        // A sum of codes within the converter's bits fits; codes beyond them are held at the end of the scale.
        ((sum + half) >> shift).min(u32::from(u16::MAX)) as u16
    }
}
