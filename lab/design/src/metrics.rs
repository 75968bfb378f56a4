//! The paper's four metrics of a detector: SENS and FMAX of the largest reading, as it defines them, SR and PA with its solver.

use tactomo_physics::forward::{ForwardError, ForwardModel, readings_v};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Noise, measured};

use super::curve::{self, Fit};
use super::imaging::{Images, Imaging};
use super::paper::PaperSolver;
use super::press::{MIDDLE, Press, nine_places};

/// Frames of each contact where there is noise: metrics are means over them, and the curve is fitted to all.
const NOISY_FRAMES: usize = 4;

/// The paper's metrics of a detector.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Metrics {
    /// The largest reading (V) over the strength of a contact in the middle, eq. (6), as in section III.B; SENS (7) and FMAX (8) are its figures. `None`
    /// if nothing is read.
    pub curve: Option<Fit>,
    /// FMAX as eq. (8) is printed, where FMAX is determined.
    pub printed_maximum: Option<f64>,
    /// SR and PA.
    #[serde(flatten)]
    pub imaging: Imaging,
}

impl Metrics {
    /// SENS (V per unit of strength), if it is determined.
    pub fn sensitivity(&self) -> Option<f64> {
        self.curve.and_then(|fit| fit.sensitivity.value())
    }

    /// The slope at half of FMAX (V per unit of strength), if it is determined.
    pub fn sensitivity_at_half_maximum(&self) -> Option<f64> {
        self.curve.and_then(|fit| fit.sensitivity_at_half_maximum.value())
    }

    /// FMAX (unit of strength), if it is determined.
    pub fn maximum(&self) -> Option<f64> {
        self.curve.and_then(|fit| fit.maximum_force.value())
    }
}

/// Readings without noise of all that the metrics look at: computed once for a detector.
pub struct Sweep {
    /// In the middle, over the strengths.
    curve: Vec<(f64, Readings)>,
    /// At the nine places, at the strength that is compared.
    places: Vec<(Contact, Readings)>,
    adc: tactomo_physics::detector::Adc,
}

impl Sweep {
    /// Readings of contacts of such strengths, and of one at the nine places.
    ///
    /// # Errors
    /// [`ForwardError`] if a contact is off the detector.
    pub fn of(model: &dyn ForwardModel, press: &Press, strengths: &[f64], compared: f64) -> Result<Self, ForwardError> {
        let detector = model.detector();
        let readings =
            |contact: Contact| Ok::<_, ForwardError>(readings_v(&model.impedance_ohm(&[contact])?, detector));
        let curve = strengths.iter().map(|strength| Ok((*strength, readings(press.at(MIDDLE, *strength))?)));
        let places = nine_places(detector).map(|place| press.at(place, compared));
        let places = places.into_iter().map(|contact| Ok((contact, readings(contact)?)));
        Ok(Self {
            curve: curve.collect::<Result<_, ForwardError>>()?,
            places: places.collect::<Result<_, ForwardError>>()?,
            adc: detector.adc,
        })
    }

    /// The metrics without noise.
    pub fn metrics(&self, solver: &PaperSolver) -> Metrics {
        self.over(solver, 1, &mut Readings::clone)
    }

    /// The metrics through the converter, with its noise.
    pub fn noisy_metrics(&self, solver: &PaperSolver, noise: &mut Noise) -> Metrics {
        self.over(solver, NOISY_FRAMES, &mut |readings| measured(readings, &self.adc, noise))
    }

    fn over(&self, solver: &PaperSolver, frames: usize, read: &mut dyn FnMut(&Readings) -> Readings) -> Metrics {
        let mut points = Vec::with_capacity(frames * self.curve.len());
        let mut images = Images::new(solver);
        for _ in 0..frames {
            points.extend(self.curve.iter().map(|(strength, readings)| [*strength, read(readings).largest_v()]));
            for (contact, readings) in &self.places {
                images.add(&read(readings), contact);
            }
        }
        let curve = curve::fit(&points);
        let determined = curve.filter(|fit| fit.maximum_force.value().is_some());
        Metrics {
            curve,
            printed_maximum: determined.map(|fit| fit.curve.printed_maximum_force()),
            imaging: images.figures(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::press::{CONDUCTIVITIES_S_PER_M, in_decades};
    use super::*;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::Slab;

    #[test]
    fn noise_changes_little_where_readings_are_large_and_its_seed_repeats() {
        let detector = Detector::default();
        let solver = PaperSolver::new(&detector).unwrap();
        let strengths = in_decades(CONDUCTIVITIES_S_PER_M, 13);
        let sweep = Sweep::of(&Slab::new(&detector).unwrap(), &Press::PAPER, &strengths, 1.0).unwrap();
        let exact = sweep.metrics(&solver);
        let noisy = sweep.noisy_metrics(&solver, &mut Noise::new(3));
        assert_eq!(noisy, sweep.noisy_metrics(&solver, &mut Noise::new(3)));
        assert_ne!(noisy, sweep.noisy_metrics(&solver, &mut Noise::new(4)));
        let [a, b] = [&exact, &noisy].map(|metrics| metrics.imaging.accuracy().unwrap());
        assert!((a - b).abs() < 0.01 && a > 0.5 && a < 1.0, "{a} {b}");
        let [a, b] = [&exact, &noisy].map(|metrics| metrics.sensitivity().unwrap());
        assert!((a / b - 1.0).abs() < 0.2, "{a} {b}");
        assert!(exact.maximum().is_some());
    }
}
