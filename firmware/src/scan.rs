//! The scan: rows of readings, one ground after the other, as the plan says.
//!
//! While the line has no room for a frame that is done, its rows are scanned again, and what is sent is the mean: no conversion is for nothing, and a
//! plan goes on with its next frame when this one has gone.

use core::mem;

use tactomo_protocol::scope::electrodes_of;
use tactomo_protocol::{FrameHead, MAX_ELECTRODES, MAX_READINGS, Plan, Scope, Settings, Status};

use crate::adc::{Adc, Ceilings};
use crate::row::{Attended, ScanRow, Sums, wait};
use crate::{Chip, Mux, Sampler};

/// A scan under way and the readings of the last frame; room for `READINGS` of them.
#[derive(Debug)]
pub struct Scan<const READINGS: usize> {
    readings: [u16; READINGS],
    /// Sums of the readings of all scans of this frame, if it is scanned again.
    totals: [u32; READINGS],
    /// Scans of this frame that are done.
    scans: u8,
    /// Sums of the codes of the row under way; zero between rows.
    sums: Sums,
    ceilings: Ceilings,
    plan: Plan,
    /// What the frame under way, or the last one, holds.
    scope: Scope,
    /// Number of the plan's frame that comes next.
    next_frame: usize,
    /// The row of the frame that comes next.
    row: usize,
    /// Board time at which the frame's first scan began (us).
    begun_us: u64,
    status: Status,
    timed_out: u16,
}

/// What a whole frame met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scanned {
    /// Board time in the middle between its start and its end (us).
    pub time_us: u64,
    /// Scans beside the first, of which the readings are the mean.
    pub folded: u8,
    /// Saturated and timed-out conversions.
    pub status: Status,
    /// Bits below one code that averaging has won.
    pub fraction_bits: u8,
    /// Whether no reading at all was converted in time.
    pub stuck: bool,
}

impl Scanned {
    /// The head of the frame.
    pub fn head(&self, sequence: u16) -> FrameHead {
        let Self { time_us, folded, status, fraction_bits, .. } = *self;
        FrameHead { sequence, time_us: time_us as u32, status, folded, fraction_bits }
    }
}

/// What the scan measures with, and how.
#[derive(Debug)]
pub(crate) struct FrontEnd<'a, M, S, C, A> {
    /// Grounds and selects.
    pub mux: &'a mut M,
    /// Converts.
    pub sampler: &'a mut S,
    /// Waits, and feeds the watchdog.
    pub chip: &'a mut C,
    /// What is sent and received meanwhile.
    pub line: &'a mut A,
    /// What the converter gives.
    pub adc: Adc,
    /// Settle times and averaging.
    pub settings: Settings,
}

impl<const READINGS: usize> Scan<READINGS> {
    /// A scan of whole frames of `electrodes`; `None` if their readings do not fit.
    pub fn new(electrodes: u8, adc: &Adc) -> Option<Self> {
        let scope = Scope::whole(electrodes)?;
        (scope.readings() <= READINGS.min(MAX_READINGS)).then_some(Self {
            readings: [0; READINGS],
            totals: [0; READINGS],
            scans: 0,
            sums: [0; MAX_ELECTRODES],
            ceilings: adc.ceilings(electrodes),
            plan: Plan::default(),
            scope,
            next_frame: 0,
            row: 0,
            begun_us: 0,
            status: Status::default(),
            timed_out: 0,
        })
    }

    /// Readings of the last frame, row by row, in units of `2^-fraction_bits` codes.
    pub fn readings(&self) -> &[u16] {
        self.readings.get(..self.scope.readings()).unwrap_or_default()
    }

    /// What the last frame holds.
    pub fn scope(&self) -> &Scope {
        &self.scope
    }

    /// The plan in force.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Goes over to another plan, beginning with its first row; returns whether it can be scanned. If not, the old one stays.
    pub fn set_plan(&mut self, plan: Plan) -> bool {
        let fits = plan.is_valid(self.scope.electrodes());
        if fits {
            self.plan = plan;
            self.abandon();
        }
        fits
    }

    /// Whether some rows of a frame are done and it is not.
    pub fn is_under_way(&self) -> bool {
        self.row != 0 || self.scans != 0
    }

    /// Abandons the frame under way; the next one is the plan's first.
    pub fn abandon(&mut self) {
        (self.row, self.scans, self.next_frame) = (0, 0, 0);
    }

    /// Grounds the next electrode, waits the settle time and reads what is to be read. Returns what the frame met once its last row is done, and the
    /// line has room for it or it was scanned as often as can be.
    ///
    /// # Errors
    /// If a pin of the multiplexer cannot be driven; the frame is then abandoned.
    pub(crate) fn row<M: Mux, S: Sampler, C: Chip, A: Attended<C>>(
        &mut self,
        front_end: &mut FrontEnd<M, S, C, A>,
    ) -> Result<Option<Scanned>, M::Error> {
        if self.row == 0 {
            self.begin(front_end.chip.now_us());
        }
        let (row, scans) = (mem::take(&mut self.row), mem::take(&mut self.scans));
        let average_log2 = if self.plan.is_whole() { front_end.settings.average_log2 } else { self.plan.average_log2 };
        front_end.mux.ground(self.scope.ground(row))?;
        let Settings { settle_us, select_us, discarded, .. } = front_end.settings;
        wait(front_end.chip, front_end.line, settle_us.into());
        let mut scanned = ScanRow {
            mux: front_end.mux,
            chip: front_end.chip,
            line: front_end.line,
            electrodes: self.scope.reads(),
            average_log2,
            select_us,
            discarded,
            ceilings: &self.ceilings,
            sums: &mut self.sums,
            status: self.status,
            timed_out: 0,
        };
        let sampled = front_end.sampler.sample_row(&mut scanned);
        let ScanRow { status, timed_out, .. } = scanned;
        self.status = status;
        let fraction_bits = front_end.adc.fraction_bits(average_log2);
        self.keep(row, timed_out, average_log2 - fraction_bits);
        sampled?;
        let next = row + 1;
        if next < self.scope.rows() {
            (self.row, self.scans) = (next, scans);
            return Ok(None);
        }
        self.scans = scans + 1;
        if scans > 0 {
            self.fold();
        }
        // A reading that timed out is zero, and no mean with others.
        let is_full = scans == FrameHead::MOST_FOLDED || self.timed_out > 0;
        Ok((is_full || front_end.line.has_room()).then(|| self.end(front_end.chip.now_us(), fraction_bits)))
    }

    fn begin(&mut self, now_us: u64) {
        match self.scans {
            0 => {
                self.begun_us = now_us;
                self.status = Status::default();
                self.timed_out = 0;
                let stays_whole = self.plan.is_whole() && self.scope.is_whole();
                if !stays_whole && let Some(scope) = self.plan.scope(self.next_frame, self.scope.electrodes()) {
                    self.scope = scope;
                }
            }
            1 => self.totals.iter_mut().zip(&self.readings).for_each(|(total, reading)| *total = (*reading).into()),
            _ => {}
        }
    }

    /// Adds the readings to the totals.
    fn fold(&mut self) {
        let is_late = |reading: u16| reading == 0 && self.timed_out > 0;
        for (total, reading) in self.totals.iter_mut().zip(self.readings) {
            *total = if is_late(reading) { 0 } else { *total + u32::from(reading) };
        }
    }

    /// Ends a frame; the next one is the plan's next.
    fn end(&mut self, now_us: u64, fraction_bits: u8) -> Scanned {
        let scans = mem::take(&mut self.scans);
        if scans > 1 {
            let mean = |total: u32| ((total + u32::from(scans / 2)) / u32::from(scans)) as u16;
            self.readings.iter_mut().zip(&self.totals).for_each(|(reading, total)| *reading = mean(*total));
        }
        self.next_frame = if self.next_frame + 1 < self.plan.frames() { self.next_frame + 1 } else { 0 };
        Scanned {
            time_us: self.begun_us.midpoint(now_us),
            folded: scans - 1,
            status: self.status,
            fraction_bits,
            stuck: usize::from(self.timed_out) == self.scope.readings(),
        }
    }

    /// Keeps the means of a row's conversions, in units of `2^-fraction_bits` codes, rounded to the nearest: the sums less `shift` bits.
    fn keep(&mut self, row: usize, timed_out: u32, shift: u8) {
        let reads = self.scope.reads();
        let half = (1u32 << shift) >> 1;
        // A sum of codes within the converter's bits fits; codes beyond them are held at the end of the scale.
        let mean = |sum: &mut u32| ((mem::take(sum) + half) >> shift).min(u16::MAX.into()) as u16;
        let count = self.scope.row_readings();
        let places = self.readings.iter_mut().skip(row * count);
        if reads & reads.wrapping_add(1) == 0 && timed_out == 0 {
            // The common case, all electrodes from the first one on, is much of what a scan costs beside its conversions.
            places.zip(&mut self.sums[..count]).for_each(|(place, sum)| *place = mean(sum));
            return;
        }
        for (place, electrode) in places.zip(electrodes_of(reads)) {
            let is_late = timed_out >> electrode & 1 == 1;
            let reading = mean(&mut self.sums[usize::from(electrode)]);
            *place = if is_late { 0 } else { reading };
        }
        self.timed_out += (timed_out & reads).count_ones() as u16;
    }
}
