//! The readings at rest, which are subtracted from all others.

use crate::readings::Readings;

/// Frames that are averaged.
const FRAMES: u32 = 32;

/// Mean readings of a detector that nothing touches.
///
/// An ideal detector at rest reads 0 V everywhere; a real one has the offsets of its converter.
#[derive(Debug)]
pub struct Rest {
    mean_v: Vec<f64>,
    sum_v: Vec<f64>,
    /// Frames still to come.
    missing: u32,
}

impl Rest {
    /// Zeros for `count` readings, until the first frames have given the true ones.
    pub fn new(count: usize) -> Self {
        Self { mean_v: vec![0.0; count], sum_v: vec![0.0; count], missing: FRAMES }
    }

    /// Takes the mean anew from the frames to come; until then the old one holds.
    pub fn renew(&mut self) {
        self.sum_v.fill(0.0);
        self.missing = FRAMES;
    }

    /// Whether the mean is being taken.
    pub fn is_renewing(&self) -> bool {
        self.missing > 0
    }

    /// Takes `readings` into the mean, if that is being taken; returns whether this has completed it.
    pub fn add(&mut self, readings: &Readings) -> bool {
        if self.missing == 0 {
            return false;
        }
        self.sum_v.iter_mut().zip(readings.volts()).for_each(|(sum, volts)| *sum += volts);
        self.missing -= 1;
        if self.missing == 0 {
            self.mean_v.iter_mut().zip(&self.sum_v).for_each(|(mean, sum)| *mean = sum / f64::from(FRAMES));
        }
        self.missing == 0
    }

    /// Largest reading at rest (V).
    pub fn largest_v(&self) -> f64 {
        self.mean_v.iter().copied().fold(0.0, f64::max)
    }

    /// Puts `readings` less those at rest into `touch`.
    pub fn subtract(&self, readings: &Readings, touch: &mut Readings) {
        let pairs = readings.volts().iter().zip(&self.mean_v);
        touch.volts_mut().iter_mut().zip(pairs).for_each(|(touch, (volts, rest))| *touch = volts - rest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn touch(rest: &Rest, readings: &Readings) -> Readings {
        let mut touch = readings.clone();
        rest.subtract(readings, &mut touch);
        touch
    }

    #[test]
    fn the_mean_of_the_first_frames_is_subtracted_and_can_be_renewed() {
        let even = |volts: f64| Readings::from_fn(4, |_, _| volts);
        let mut rest = Rest::new(16);
        for i in 0..FRAMES {
            assert_eq!(touch(&rest, &even(1.0)), even(1.0), "nothing is subtracted before the mean is known");
            assert_eq!(rest.add(&even(f64::from(i % 2))), i == FRAMES - 1);
        }
        assert_eq!(touch(&rest, &even(1.0)), even(0.5));
        assert!(!rest.add(&even(9.0)), "the mean stays");
        assert_eq!(rest.largest_v(), 0.5);
        rest.renew();
        (1..FRAMES).for_each(|_| assert!(!rest.add(&even(2.0))));
        assert_eq!(touch(&rest, &even(1.0)), even(0.5), "the old mean holds while the new one is taken");
        assert!(rest.is_renewing() && rest.add(&even(2.0)) && !rest.is_renewing());
        assert_eq!(touch(&rest, &even(2.0)), even(0.0));
    }
}
