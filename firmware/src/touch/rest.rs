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

/// Readings at rest: the mean of the first ones.
#[derive(Debug)]
pub(super) struct Rest<const READINGS: usize> {
    volts: [f32; READINGS],
    counts: [u8; READINGS],
    is_taken: bool,
}

impl<const READINGS: usize> Rest<READINGS> {
    pub const NONE: Self = Self { volts: [0.0; READINGS], counts: [0; READINGS], is_taken: false };

    /// Takes it anew.
    pub fn restart(&mut self) {
        self.counts.fill(0);
        self.is_taken = false;
    }

    /// Whether it is known.
    pub fn is_taken(&self) -> bool {
        self.is_taken
    }

    /// What a reading is above it (V).
    pub fn above(&self, cell: usize, volts: f32) -> f32 {
        volts - self.volts.get(cell).copied().unwrap_or(0.0)
    }

    /// Takes a reading of a cell while rest is not known; one that has moved begins it anew.
    pub fn add(&mut self, cell: usize, volts: f32, noise_v: f32) {
        let (Some(rest), Some(count)) = (self.volts.get_mut(cell), self.counts.get_mut(cell)) else { return };
        if *count == 0 {
            *rest = 0.0;
        }
        if *count >= FEW && (volts - *rest).abs() > MOVED * noise_v {
            return self.restart();
        }
        if *count < COUNT {
            *count += 1;
            *rest += (volts - *rest) / f32::from(*count);
        }
    }

    /// Looks whether each cell that is read at all was read often enough.
    pub fn look(&mut self) {
        let is_done = |count: u8| count == 0 || count == COUNT;
        self.is_taken = self.counts.contains(&COUNT) && self.counts.iter().all(|count| is_done(*count));
    }

    /// Whether a cell was read when rest was taken.
    pub fn knows(&self, cell: usize) -> bool {
        self.counts.get(cell).is_some_and(|count| *count > 0)
    }

    /// Follows what is left of readings while nothing touches.
    pub fn follow(&mut self, touch_v: &[f32], says: &[Says]) {
        for (rest, (touch_v, says)) in self.volts.iter_mut().zip(touch_v.iter().zip(says)) {
            if *says == Says::Voltage {
                *rest += FOLLOW * touch_v;
            }
        }
    }

    /// Whether so many readings are below rest that it was none: something pressed when it was taken.
    pub fn was_touched(touch_v: &[f32], noise_v: f32, electrodes: usize) -> bool {
        touch_v.iter().filter(|volts| **volts < -MOVED * noise_v).count() >= electrodes
    }
}
