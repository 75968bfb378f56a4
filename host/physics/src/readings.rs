//! The readings of one frame, in volts.

use crate::detector::{Detector, Electrode};

/// `n x n` readings of one frame (V): reading `(g, e)` is electrode `e` while `g` is grounded.
#[derive(Clone, Debug, PartialEq)]
pub struct Readings {
    electrodes: usize,
    volts: Vec<f64>,
}

impl Readings {
    /// Readings row by row (`volts[g * electrodes + e]`); `None` unless there are `electrodes` squared.
    pub fn new(electrodes: usize, volts: Vec<f64>) -> Option<Self> {
        (volts.len() == electrodes * electrodes).then_some(Self { electrodes, volts })
    }

    /// Readings from a function of ground and electrode.
    pub fn from_fn(electrodes: usize, mut volts: impl FnMut(usize, usize) -> f64) -> Self {
        let volts = (0..electrodes * electrodes).map(|i| volts(i / electrodes, i % electrodes)).collect();
        Self { electrodes, volts }
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
        Self::from_fn(electrodes.len(), |g, e| self.at(electrodes[g], electrodes[e]))
    }

    /// Takes from what each channel reads the offset that its detector says the baseline does not show, and divides it by its gain: no model
    /// knows of either. What a channel reads with nothing on the detector is no part of it: the baseline is subtracted before.
    pub fn correct_channels(&mut self, detector: &Detector) {
        for row in self.volts.chunks_mut(self.electrodes.max(1)) {
            let correct = |(volts, pad): (&mut f64, &Electrode)| *volts = (*volts - pad.unseen_offset_v) / pad.gain;
            row.iter_mut().zip(&detector.electrodes).for_each(correct);
        }
    }

    /// The largest (V); zero if there are none.
    pub fn largest_v(&self) -> f64 {
        self.volts.iter().copied().fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
