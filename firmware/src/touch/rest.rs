//! Readings of the detector at rest, and how they drift.

use tactomo_touch_core::Says;

/// Readings of each cell that rest is the mean of: 0.15 s on the ESP32. Their mean's noise is an eighth of a reading's.
const COUNT: u8 = 64;
/// A reading so many standard deviations from the mean of those before it has moved: of 256 that only have noise, one in 10^12 frames does.
const MOVED: f32 = 8.0;
/// Readings before one can be told from their mean.
const FEW: u8 = 4;
/// Share by which rest follows what is left where nothing touches: 10 s on the ESP32, as slow as warmth.
const FOLLOW: f32 = 1.0 / 4096.0;

/// Readings at rest: the mean of some that stood still. Until they are known they are taken for nothing, as those of a perfect detector are.
#[derive(Debug)]
pub(super) struct Rest<const READINGS: usize> {
    volts: [f32; READINGS],
    counts: [u8; READINGS],
    is_known: bool,
}

impl<const READINGS: usize> Rest<READINGS> {
    pub const NONE: Self = Self { volts: [0.0; READINGS], counts: [0; READINGS], is_known: false };

    /// Begins anew.
    pub fn restart(&mut self) {
        self.counts.fill(0);
        self.is_known = false;
    }

    /// Whether it is known.
    pub fn is_known(&self) -> bool {
        self.is_known
    }

    /// What a reading is above it (V).
    pub fn above(&self, cell: usize, volts: f32) -> f32 {
        match self.volts.get(cell) {
            Some(rest) if self.is_known => volts - rest,
            _ => volts,
        }
    }

    /// Takes a reading of a cell, while rest is not known; one that has moved begins it anew.
    pub fn add(&mut self, cell: usize, volts: f32, noise_v: f32) {
        let (Some(mean), Some(count)) = (self.volts.get_mut(cell), self.counts.get_mut(cell)) else { return };
        if *count >= FEW && (volts - *mean).abs() > MOVED * noise_v {
            return self.restart();
        }
        if *count < COUNT {
            *count += 1;
            *mean = if *count == 1 { volts } else { *mean + (volts - *mean) / f32::from(*count) };
        }
    }

    /// Whether each cell that is read at all has stood still for as long as it takes.
    pub fn has_stood_still(&self) -> bool {
        self.counts.contains(&COUNT) && self.counts.iter().all(|count| [0, COUNT].contains(count))
    }

    /// What stood still is rest.
    pub fn take(&mut self) {
        let unread = self.volts.iter_mut().zip(&self.counts).filter(|(_, count)| **count == 0);
        unread.for_each(|(volts, _)| *volts = 0.0);
        self.is_known = true;
    }

    /// Follows what is left of readings while nothing touches.
    pub fn follow(&mut self, touch_v: &[f32], says: &[Says]) {
        for (rest, (touch_v, says)) in self.volts.iter_mut().zip(touch_v.iter().zip(says)) {
            if *says == Says::Voltage {
                *rest += FOLLOW * touch_v;
            }
        }
    }

    /// Whether so many readings are below rest that it was none: something pressed when it was taken, and has gone.
    pub fn was_touched(&self, touch_v: &[f32], noise_v: f32, electrodes: usize) -> bool {
        self.is_known && touch_v.iter().filter(|volts| **volts < -MOVED * noise_v).count() >= electrodes
    }
}
