//! When something presses, and what was read of it.

use tactomo_physics::readings::{Readings, Says};

/// Share of the drive that the middle one of the rows reaches at least while something presses, and below which it has let go. Readings at rest
/// are offsets and leakage, up to 5 % of the drive before the baseline is taken off (see [`BaselineTracker`](tactomo_board::baseline::BaselineTracker)), and
/// next to nothing after.
const PRESSED: f64 = 0.05;
const RELEASED: f64 = 0.02;

/// How much frames rise: the middle one of what each ground's row reaches, of those electrodes that can be trusted. One broken wire lifts its
/// own row to the drive at the lightest touch, and one that floats all rows: neither is a press.
pub fn level_v(touch: &Readings, trusted: &[usize]) -> f64 {
    let row = |g: usize| trusted.iter().map(|e| touch.touch_v(g, *e)).fold(0.0, f64::max);
    median(trusted.iter().map(|g| row(*g)).collect())
}

/// The middle one; zero of none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Whether something presses, with a hysteresis.
pub fn is_pressed(was: bool, level_v: f64, drive_v: f64) -> bool {
    level_v > drive_v * if was { RELEASED } else { PRESSED }
}

/// A mean of frames.
#[derive(Clone, Debug, Default)]
pub struct Mean {
    sum: Vec<f64>,
    /// What each reading says: a bound in one frame is one in the mean.
    says: Vec<Says>,
    frames: u32,
}

impl Mean {
    /// Takes a frame.
    pub fn add(&mut self, readings: &Readings) {
        self.sum.resize(readings.volts().len(), 0.0);
        self.sum.iter_mut().zip(readings.volts()).for_each(|(sum, volts)| *sum += volts);
        self.says.resize(readings.volts().len(), Says::Voltage);
        let bounds = self.says.iter_mut().zip(readings.all_say()).filter(|(_, says)| **says != Says::Voltage);
        bounds.for_each(|(ours, theirs)| *ours = *theirs);
        self.frames += 1;
    }

    /// Frames in it.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// The mean of readings of so many electrodes (V); `None` if no frame of as many was added.
    pub fn readings(&self, electrodes: usize) -> Option<Readings> {
        let mean = self.sum.iter().map(|sum| sum / f64::from(self.frames.max(1))).collect();
        Some(Readings::new(electrodes, mean)?.saying(|g, e| self.says[g * electrodes + e]))
    }
}
