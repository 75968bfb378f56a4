//! Seeded noise.

/// Normally distributed numbers that repeat with their seed.
#[derive(Clone, Debug)]
pub struct Noise {
    uniform: fastrand::Rng,
    /// Numbers come in pairs; the second one of the last pair.
    spare: Option<f64>,
}

/// Independent numbers of one seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stream {
    Conversion,
    Floating,
    ContactSpread,
    Uneven,
    AsBuilt,
}

impl Noise {
    /// One of the streams of a seed.
    pub(super) fn of(seed: u64, stream: Stream) -> Self {
        let mut seeds = fastrand::Rng::with_seed(seed);
        Self::new(std::iter::repeat_with(|| seeds.u64(..)).nth(stream as usize).unwrap_or(seed))
    }

    /// Noise that is the same for the same `seed`.
    pub fn new(seed: u64) -> Self {
        Self { uniform: fastrand::Rng::with_seed(seed), spare: None }
    }

    /// The next number, of mean 0 and standard deviation 1: Marsaglia's polar method.
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        loop {
            let [x, y] = [(); 2].map(|()| 2.0 * self.uniform.f64() - 1.0);
            let square = x * x + y * y;
            if square > 0.0 && square < 1.0 {
                let scale = (-2.0 * square.ln() / square).sqrt();
                self.spare = Some(y * scale);
                return x * scale;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_normal_distribution() {
        let mut noise = Noise::new(7);
        let count = 200_000;
        let numbers: Vec<f64> = (0..count).map(|_| noise.normal()).collect();
        let moment = |power: i32| numbers.iter().map(|x| x.powi(power)).sum::<f64>() / f64::from(count);
        // Five standard errors of each moment: sqrt(1, 2, 15, 96 / count).
        assert!(moment(1).abs() < 0.0112, "{}", moment(1));
        assert!((moment(2) - 1.0).abs() < 0.0158, "{}", moment(2));
        assert!(moment(3).abs() < 0.0433, "{}", moment(3));
        assert!((moment(4) - 3.0).abs() < 0.11, "{}", moment(4));
    }

    #[test]
    fn a_seed_repeats_and_another_differs() {
        let first = |seed| {
            [(); 9].map({
                let mut noise = Noise::new(seed);
                move |()| noise.normal()
            })
        };
        assert_eq!(first(3), first(3));
        assert_ne!(first(3), first(4));
    }
}
