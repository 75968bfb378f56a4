//! The mean of readings that stand still.

/// Mean square difference of a frame from the mean of those before it, in what noise makes of it, above which it does not stand still. Of
/// 256 readings noise alone leaves 1.00 +- 0.09, so 1 in 30 000 still frames is taken for a move.
const STILL: f64 = 1.35;

/// Frames after which the newest weigh as much as all before: what creeps is followed.
const LONGEST: u32 = 256;

/// Averages frames as long as they differ by no more than noise.
#[derive(Clone, Debug)]
pub struct Steady {
    mean_v: Vec<f64>,
    count: u32,
}

impl Steady {
    /// Begins with a frame's readings (V).
    pub fn of(volts: &[f64]) -> Self {
        Self { mean_v: volts.to_vec(), count: 1 }
    }

    /// Adds a frame's readings (V), whose noise has the deviation `noise_v`; begins anew with it if they have moved.
    pub fn add(&mut self, volts: &[f64], noise_v: f64) {
        let squares: f64 = self.mean_v.iter().zip(volts).map(|(mean, volts)| (volts - mean).powi(2)).sum();
        let expected = noise_v * noise_v * (1.0 + 1.0 / f64::from(self.count));
        if self.mean_v.len() != volts.len() || squares > STILL * expected * volts.len() as f64 {
            *self = Self::of(volts);
            return;
        }
        self.count = (self.count + 1).min(LONGEST);
        let share = 1.0 / f64::from(self.count);
        self.mean_v.iter_mut().zip(volts).for_each(|(mean, volts)| *mean += share * (volts - *mean));
    }

    /// The mean (V).
    pub fn mean_v(&self) -> &[f64] {
        &self.mean_v
    }

    /// Frames that it is the mean of.
    pub fn count(&self) -> u32 {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn still_frames_are_averaged_and_a_move_begins_anew() {
        let mut random = fastrand::Rng::with_seed(4);
        let mut noise = || (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
        let mut frame = |volts: f64| (0..256).map(|_| volts + 1e-3 * noise()).collect::<Vec<_>>();
        let mut steady = Steady::of(&frame(0.5));
        (0..99).for_each(|_| steady.add(&frame(0.5), 1e-3));
        assert_eq!(steady.count(), 100);
        let error_v = (steady.mean_v().iter().map(|volts| (volts - 0.5).powi(2)).sum::<f64>() / 256.0).sqrt();
        assert!((0.7e-4..1.3e-4).contains(&error_v), "a tenth of the noise: {error_v}");
        steady.add(&frame(0.501), 1e-3);
        assert_eq!(steady.count(), 1);
    }
}
