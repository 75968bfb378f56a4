//! The readings at rest, which are subtracted from all others.

/// Frames that are averaged.
pub const FRAMES: u32 = 32;

/// Mean readings of a detector that nothing touches.
///
/// An ideal detector at rest reads 0 V everywhere; a real one has the offsets of its converter.
#[derive(Debug)]
pub struct Baseline {
    mean_v: Vec<f64>,
    sum_v: Vec<f64>,
    /// Frames that are averaged.
    frames: u32,
    /// Frames still to come.
    missing: u32,
}

impl Baseline {
    /// Zeros for `count` readings, until the first frames have given the true ones.
    pub fn new(count: usize) -> Self {
        Self::over(FRAMES, count)
    }

    /// The same with the mean of other than the usual number of frames; of none it stays zero.
    pub fn over(frames: u32, count: usize) -> Self {
        Self { mean_v: vec![0.0; count], sum_v: vec![0.0; count], frames, missing: frames }
    }

    /// Takes the mean anew from the frames to come; until then the old one holds.
    pub fn renew(&mut self) {
        self.sum_v.fill(0.0);
        self.missing = self.frames;
    }

    /// Whether the mean is being taken.
    pub fn is_renewing(&self) -> bool {
        self.missing > 0
    }

    /// Takes `readings_v` into the mean, if that is being taken; returns whether this has completed it.
    pub fn add(&mut self, readings_v: &[f64]) -> bool {
        if self.missing == 0 {
            return false;
        }
        self.sum_v.iter_mut().zip(readings_v).for_each(|(sum, volts)| *sum += volts);
        self.missing -= 1;
        if self.missing == 0 {
            self.mean_v.iter_mut().zip(&self.sum_v).for_each(|(mean, sum)| *mean = sum / f64::from(self.frames));
        }
        self.missing == 0
    }

    /// Largest reading at rest (V).
    pub fn largest_v(&self) -> f64 {
        self.mean_v.iter().copied().fold(0.0, f64::max)
    }

    /// Puts `readings_v` less those at rest into `touch_v`.
    pub fn subtract(&self, readings_v: &[f64], touch_v: &mut [f64]) {
        let pairs = readings_v.iter().zip(&self.mean_v);
        touch_v.iter_mut().zip(pairs).for_each(|(touch, (volts, rest))| *touch = volts - rest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn touch(rest: &Baseline, readings_v: &[f64]) -> Vec<f64> {
        let mut touch_v = readings_v.to_vec();
        rest.subtract(readings_v, &mut touch_v);
        touch_v
    }

    #[test]
    fn the_mean_of_the_first_frames_is_subtracted_and_can_be_renewed() {
        let even = |volts: f64| vec![volts; 16];
        let mut rest = Baseline::new(16);
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
