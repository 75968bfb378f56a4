//! The scan: rows of readings, one ground after the other, as the plan says.

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
    time_us: u64,
    status: Status,
    timed_out: u16,
}

/// What a whole frame met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scanned {
    /// Board time at its start (us).
    pub time_us: u64,
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
        FrameHead { sequence, time_us: self.time_us as u32, status: self.status, fraction_bits: self.fraction_bits }
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
            sums: [0; MAX_ELECTRODES],
            ceilings: adc.ceilings(electrodes),
            plan: Plan::default(),
            scope,
            next_frame: 0,
            row: 0,
            time_us: 0,
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

    /// Whether some rows of a frame are done and others not.
    pub fn is_under_way(&self) -> bool {
        self.row != 0
    }

    /// Abandons the frame under way; the next one is the plan's first.
    pub fn abandon(&mut self) {
        (self.row, self.next_frame) = (0, 0);
    }

    /// Grounds the next electrode, waits the settle time and reads what is to be read. Returns what the frame met once its last row is done.
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
        let row = mem::take(&mut self.row);
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
            self.row = next;
            return Ok(None);
        }
        let stuck = usize::from(self.timed_out) == self.scope.readings();
        Ok(Some(Scanned { time_us: self.time_us, status, fraction_bits, stuck }))
    }

    fn begin(&mut self, now_us: u64) {
        self.time_us = now_us;
        self.status = Status::default();
        self.timed_out = 0;
        let stays_whole = self.plan.is_whole() && self.scope.is_whole();
        if !stays_whole && let Some(scope) = self.plan.scope(self.next_frame, self.scope.electrodes()) {
            self.scope = scope;
        }
        self.next_frame = if self.next_frame + 1 < self.plan.frames() { self.next_frame + 1 } else { 0 };
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
