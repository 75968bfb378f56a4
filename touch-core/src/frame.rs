//! A frame of readings, and how far each may be from those of a model.

use crate::real::Real;
use crate::table::{MAX_ELECTRODES, Table};

/// What a reading says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Says {
    /// A voltage.
    #[default]
    Voltage,
    /// The voltage is at most this.
    AtMost,
    /// The voltage is at least this.
    AtLeast,
    /// Nothing: it was not read.
    Nothing,
}

/// Readings of a frame, less the baseline: electrode `e` while `g` is grounded is at `g n + e`.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'f, T = f32> {
    /// Voltages (V).
    pub(crate) volts: &'f [T],
    /// What each says; empty where all are voltages.
    says: &'f [Says],
    /// Electrodes that are left out, a bit each, of how many.
    left_out: u32,
    electrodes: usize,
    /// Standard deviation of a reading by noise (V), if that is not the table's.
    noise_v: Option<T>,
}

/// Share of the drive that everything reaches when a broken wire is to be grounded: the host's.
const UNGROUNDED: f32 = 0.97;

/// Why a frame has no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// Another number of readings than the table's electrodes give.
    #[error("a frame of {found} readings, but the table is for {expected}")]
    Length {
        /// In the frame.
        found: usize,
        /// Of the table.
        expected: usize,
    },
    /// A reading that is no number.
    #[error("the reading of electrode {e} with electrode {g} grounded is not a finite number")]
    NotFinite {
        /// Grounded electrode.
        g: usize,
        /// Electrode read.
        e: usize,
    },
}

impl<'f, T: Real> Frame<'f, T> {
    /// A frame of voltages (V), with what each says.
    pub fn new(volts: &'f [T], says: &'f [Says]) -> Self {
        Self { volts, says, left_out: 0, electrodes: 0, noise_v: None }
    }

    /// A frame whose readings are all voltages.
    pub fn of_volts(volts: &'f [T]) -> Self {
        Self::new(volts, &[])
    }

    /// The frame with another noise than a single one has, as the mean of some: its standard deviation (V).
    pub fn with_noise(self, noise_v: T) -> Self {
        Self { noise_v: Some(noise_v), ..self }
    }

    /// The frame without electrodes whose wires are broken, and which these are: while one is to be grounded, most others rise to the drive, for nothing is
    /// grounded. Where that is so of most electrodes, it is no electrode's fault.
    pub(crate) fn without_broken(self, table: &Table<'_>) -> (Self, u32) {
        let (n, least_v) = (table.electrodes(), T::of(UNGROUNDED) * T::of(table.head().drive_v));
        let is_broken = |g: usize| {
            let risen = (0..n).filter(|e| *e != g && self.touch_v(g * n + e) > least_v).count();
            4 * risen > 3 * (n - 1)
        };
        let broken = (0..n).filter(|g| is_broken(*g)).fold(0u32, |broken, g| broken | 1 << g);
        let left_out = if 2 * broken.count_ones() as usize > n { 0 } else { broken };
        (Self { left_out, electrodes: n, ..self }, left_out)
    }

    /// Checks that it can be one of a table's detector.
    ///
    /// # Errors
    /// [`FrameError`] if it cannot.
    pub fn check(&self, table: &Table<'_>) -> Result<(), FrameError> {
        let n = table.electrodes();
        let expected = n * n;
        let counts = [self.volts.len(), if self.says.is_empty() { expected } else { self.says.len() }];
        if let Some(found) = counts.into_iter().find(|count| *count != expected) {
            return Err(FrameError::Length { found, expected });
        }
        match (0..expected).find(|i| self.says_at(*i) != Says::Nothing && !self.volts[*i].is_finite()) {
            Some(i) => Err(FrameError::NotFinite { g: i / n, e: i % n }),
            None => Ok(()),
        }
    }

    pub(crate) fn says_at(&self, index: usize) -> Says {
        let is_out = |electrode: usize| self.left_out >> electrode & 1 == 1;
        if self.left_out != 0 && (is_out(index / self.electrodes) || is_out(index % self.electrodes)) {
            return Says::Nothing;
        }
        self.says.get(index).copied().unwrap_or_default()
    }

    /// What a reading is of a touch (V): nothing where it is below what the converter reads.
    pub(crate) fn touch_v(&self, index: usize) -> T {
        match self.says_at(index) {
            Says::Voltage | Says::AtLeast => self.volts[index],
            Says::AtMost | Says::Nothing => T::ZERO,
        }
    }
}

/// What is known of the errors of a frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Errors<T> {
    /// Variance of each reading by itself (V2).
    pub variance_v2: T,
    /// Share of the readings' distance from the drive that an error of a grounded pad's own impedance changes.
    pub pads: [T; MAX_ELECTRODES],
    /// Readings that count as voltages.
    pub count: usize,
    /// Whether any is at the upper end of the converter's range.
    pub is_full: bool,
}

impl<T: Real> Errors<T> {
    pub fn of(frame: &Frame<'_, T>, table: &Table<'_>) -> Self {
        let (head, n) = (table.head(), table.electrodes());
        let mut errors = Self::default();
        let mut largest_v: T = T::ZERO;
        for g in 0..n {
            let mut largest_of_row_v: T = T::ZERO;
            for i in g * n..(g + 1) * n {
                let is_full = frame.says_at(i) == Says::AtLeast || frame.touch_v(i) >= T::of(head.full_v);
                errors.is_full |= is_full;
                errors.count += usize::from(frame.says_at(i) == Says::Voltage && !is_full);
                largest_of_row_v = largest_of_row_v.max(frame.touch_v(i));
            }
            errors.pads[g] = T::of(head.pad_share) * largest_of_row_v / T::of(head.drive_v);
            largest_v = largest_v.max(largest_of_row_v);
        }
        let model_v = T::of(head.model_share) * largest_v;
        let noise_v = frame.noise_v.unwrap_or(T::of(head.noise_v));
        errors.variance_v2 = noise_v * noise_v + model_v * model_v;
        errors
    }

    /// What an error of a grounded pad's own impedance changes in a reading (V).
    pub fn pad_v(&self, table: &Table<'_>, frame: &Frame<'_, T>, g: usize, e: usize) -> T {
        let below_v = T::of(table.head().drive_v) - frame.touch_v(g * table.electrodes() + e);
        if e == g { T::ZERO } else { self.pads[g] * below_v.max(T::ZERO) }
    }
}

/// By how much a reading is more than a model's (V), of a bound by as much as that breaks it; `None` if it says nothing of that.
pub(crate) fn left_v<T: Real>(frame: &Frame<'_, T>, index: usize, full_v: T, predicted_v: T) -> Option<T> {
    let left_v = frame.volts[index] - predicted_v;
    match frame.says_at(index) {
        Says::Voltage if frame.volts[index] < full_v => Some(left_v),
        Says::AtMost if left_v < T::ZERO => Some(left_v),
        Says::AtLeast if left_v > T::ZERO => Some(left_v),
        _ => None,
    }
}
