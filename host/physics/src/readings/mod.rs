//! The readings of one frame, in volts, and what each of them says.

mod rounds;
mod scale;

use std::borrow::Cow;

pub use self::rounds::Rounds;
pub use self::scale::{Likely, NotVolts, check_volts};
use crate::detector::{Detector, Electrode};

/// What the number of a reading says of the pad's voltage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Says {
    /// It is the voltage, but for noise.
    #[default]
    Voltage,
    /// The voltage is that at most: the converter's floor was reached.
    AtMost,
    /// The voltage is that at least: the converter's ceiling was reached.
    AtLeast,
    /// Nothing: it was not read.
    Nothing,
}

impl Says {
    /// What the mean of two readings says: one with a bound is a bound.
    pub fn of_mean(self, other: Self) -> Self {
        match (self, other) {
            (one, other) if one == other => one,
            (Self::Voltage, bound) | (bound, Self::Voltage) => bound,
            _ => Self::Nothing,
        }
    }
}

/// What a converter's readings can tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Readings up to this say no more than that (V).
    pub floor_v: f64,
    /// Readings from this on say no less than that (V).
    pub ceiling_v: f64,
}

impl Range {
    /// What a reading (V) says.
    fn says(&self, volts: f64) -> Says {
        if volts <= self.floor_v {
            Says::AtMost
        } else if volts >= self.ceiling_v {
            Says::AtLeast
        } else {
            Says::Voltage
        }
    }
}

/// `n x n` readings of one frame (V): reading `(g, e)` is electrode `e` while `g` is grounded.
///
/// ```
/// use tactomo_physics::readings::Readings;
///
/// let readings = Readings::from_fn(16, |g, e| if g == e { 0.0 } else { 0.25 });
/// assert_eq!((readings.at(3, 7), readings.largest_v(), readings.volts().len()), (0.25, 0.25, 256));
/// assert!(Readings::new(16, vec![0.0; 255]).is_none());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Readings {
    electrodes: usize,
    volts: Vec<f64>,
    /// What each says; empty where all are voltages, as nearly always.
    says: Vec<Says>,
}

impl Readings {
    /// Readings row by row (`volts[g * electrodes + e]`); `None` unless there are `electrodes` squared.
    pub fn new(electrodes: usize, volts: Vec<f64>) -> Option<Self> {
        (volts.len() == electrodes * electrodes).then_some(Self { electrodes, volts, says: Vec::new() })
    }

    /// Readings from a function of ground and electrode.
    pub fn from_fn(electrodes: usize, mut volts: impl FnMut(usize, usize) -> f64) -> Self {
        let volts = (0..electrodes * electrodes).map(|i| volts(i / electrodes, i % electrodes)).collect();
        Self { electrodes, volts, says: Vec::new() }
    }

    /// These readings, each of which says what a function of ground and electrode gives.
    pub fn saying(mut self, mut says: impl FnMut(usize, usize) -> Says) -> Self {
        let n = self.electrodes;
        self.says = (0..n * n).map(|i| says(i / n, i % n)).collect();
        if self.says.iter().all(|says| *says == Says::Voltage) {
            self.says = Vec::new();
        }
        self
    }

    /// These readings by converters of such ranges, one an electrode: readings at an end of the range are bounds. An electrode beyond them has no
    /// range, and what was not read still says [nothing](Says::Nothing).
    pub fn within(mut self, ranges: &[Range]) -> Self {
        let n = self.electrodes.max(1);
        let before = std::mem::take(&mut self.says);
        let bounded = |(i, volts): (usize, &mut f64)| {
            let before = before.get(i).copied().unwrap_or_default();
            let Some(range) = ranges.get(i % n).filter(|_| before == Says::Voltage) else { return before };
            let says = range.says(*volts);
            *volts = volts.clamp(range.floor_v, range.ceiling_v);
            says
        };
        let says: Vec<Says> = self.volts.iter_mut().enumerate().map(bounded).collect();
        self.saying(|g, e| says[g * n + e])
    }

    /// These readings, some of which were not read.
    pub fn hiding(self, is_unread: impl Fn(usize, usize) -> bool) -> Self {
        let says = self.says.clone();
        let n = self.electrodes;
        self.saying(|g, e| match is_unread(g, e) {
            true => Says::Nothing,
            false => says.get(g * n + e).copied().unwrap_or_default(),
        })
    }

    /// What the reading of electrode `e` while `g` is grounded says.
    pub fn says(&self, g: usize, e: usize) -> Says {
        self.says.get(g * self.electrodes + e).copied().unwrap_or_default()
    }

    /// The voltages row by row (V), for who keeps them: not a number where nothing was read.
    pub fn read_v(&self) -> impl Iterator<Item = f64> {
        let is_unread = |i: usize| self.says.get(i) == Some(&Says::Nothing);
        self.volts.iter().enumerate().map(move |(i, &volts)| if is_unread(i) { f64::NAN } else { volts })
    }

    /// What each says, row by row; empty where all are voltages.
    pub fn all_say(&self) -> &[Says] {
        &self.says
    }

    /// The voltage (V), or what stands for it where only a bound of it is known, or nothing: zero below the floor.
    pub fn touch_v(&self, g: usize, e: usize) -> f64 {
        match self.says(g, e) {
            Says::Voltage | Says::AtLeast => self.at(g, e),
            Says::AtMost | Says::Nothing => 0.0,
        }
    }

    /// Number of electrodes.
    pub fn electrodes(&self) -> usize {
        self.electrodes
    }

    /// Electrode `e` while `g` is grounded (V).
    ///
    /// # Panics
    /// If `g` or `e` is not an electrode.
    pub fn at(&self, g: usize, e: usize) -> f64 {
        self.volts[g * self.electrodes + e]
    }

    /// All of them, row by row (V).
    pub fn volts(&self) -> &[f64] {
        &self.volts
    }

    /// All of them, row by row (V), to be changed.
    pub fn volts_mut(&mut self) -> &mut [f64] {
        &mut self.volts
    }

    /// The readings of some electrodes alone, in this order.
    ///
    /// # Panics
    /// If there is no such electrode.
    pub fn of(&self, electrodes: &[usize]) -> Self {
        let some = Self::from_fn(electrodes.len(), |g, e| self.at(electrodes[g], electrodes[e]));
        if self.says.is_empty() { some } else { some.saying(|g, e| self.says(electrodes[g], electrodes[e])) }
    }

    /// Takes from what each channel reads the offset that its detector says the baseline does not show, and divides it by its gain: no model
    /// knows of either. What a channel reads with nothing on the detector is no part of it: the baseline is subtracted before.
    pub fn correct_channels(&mut self, detector: &Detector) {
        for row in self.volts.chunks_mut(self.electrodes.max(1)) {
            let correct = |(volts, pad): (&mut f64, &Electrode)| {
                // An offset below zero is cut off where there is nothing: the smallest readings are lifted by what they are at most.
                let offset_v = pad.unseen_offset_v.max(-volts.max(0.0));
                *volts = (*volts - offset_v) / pad.gain;
            };
            row.iter_mut().zip(&detector.electrodes).for_each(correct);
        }
    }

    /// Root mean square of those that were read (V), as [`touch_v`](Self::touch_v) has them.
    pub fn rms_v(&self) -> f64 {
        self.rms_of(|volts| volts)
    }

    /// The same of what lies below the baseline (V), which noise alone leaves there.
    pub fn rms_below_rest_v(&self) -> f64 {
        self.rms_of(|volts| volts.min(0.0))
    }

    fn rms_of(&self, part: impl Fn(f64) -> f64) -> f64 {
        let n = self.electrodes.max(1);
        let read = (0..self.volts.len()).filter(|i| self.says.get(*i) != Some(&Says::Nothing));
        let (count, squares) = read
            .fold((0usize, 0.0), |(count, squares), i| (count + 1, squares + part(self.touch_v(i / n, i % n)).powi(2)));
        (squares / count.max(1) as f64).sqrt()
    }

    /// All of them as [`touch_v`](Self::touch_v) has them, row by row (V).
    pub fn touches_v(&self) -> Cow<'_, [f64]> {
        if self.says.is_empty() {
            return Cow::Borrowed(&self.volts);
        }
        let n = self.electrodes;
        Cow::Owned((0..n * n).map(|i| self.touch_v(i / n, i % n)).collect())
    }

    /// Whether every one was read.
    pub fn is_whole(&self) -> bool {
        !self.says.contains(&Says::Nothing)
    }

    /// The largest that is above the converter's floor (V); zero if there are none.
    pub fn largest_v(&self) -> f64 {
        self.touches_v().iter().copied().fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_at_an_end_of_the_range_are_bounds() {
        let ranges = [Range { floor_v: 0.1, ceiling_v: 2.0 }, Range { floor_v: 0.2, ceiling_v: 9.0 }];
        let readings = Readings::from_fn(3, |g, e| [0.05, 0.15, 0.05, 0.15, 0.25, 0.0, 2.5, 2.5, 7.0][3 * g + e]);
        let bounded = readings.within(&ranges);
        let says: Vec<_> = (0..9).map(|i| bounded.says(i / 3, i % 3)).collect();
        use Says::{AtLeast, AtMost, Voltage};
        assert_eq!(says, [AtMost, AtMost, Voltage, Voltage, Voltage, Voltage, AtLeast, Voltage, Voltage]);
        assert_eq!(bounded.volts(), [0.1, 0.2, 0.05, 0.15, 0.25, 0.0, 2.0, 2.5, 7.0]);
    }

    #[test]
    fn what_readings_say_goes_with_the_electrodes() {
        let says = |g: usize, e: usize| match (g, e) {
            (0, 2) => Says::AtMost,
            (2, 0) => Says::AtLeast,
            (2, 1) => Says::Nothing,
            _ => Says::Voltage,
        };
        let readings = Readings::from_fn(3, |g, e| (3 * g + e) as f64).saying(says);
        let some = readings.of(&[2, 0]);
        assert_eq!([some.says(0, 1), some.says(1, 0), some.says(0, 0)], [Says::AtLeast, Says::AtMost, Says::Voltage]);
        assert_eq!([readings.touch_v(0, 2), readings.touch_v(2, 1), readings.touch_v(2, 0)], [0.0, 0.0, 6.0]);
        assert_eq!(readings.largest_v(), 8.0);
        let all = readings.of(&[1, 2]).saying(|_, _| Says::Voltage);
        assert_eq!(all, Readings::from_fn(2, |g, e| (3 * (g + 1) + e + 1) as f64));
    }

    #[test]
    fn gains_are_those_of_the_channels_that_are_read() {
        let mut detector = Detector::default();
        detector.electrodes.truncate(3);
        detector.electrodes[1].gain = 1.25;
        let mut readings = Readings::from_fn(3, |g, e| (1 + g + 10 * e) as f64);
        readings.correct_channels(&detector);
        let expected = Readings::from_fn(3, |g, e| (1 + g + 10 * e) as f64 / if e == 1 { 1.25 } else { 1.0 });
        assert_eq!(readings, expected);
    }
}
