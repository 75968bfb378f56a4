//! Place and strength of a press, learned from presses at known places: no model, no detector, any number of channels.
//!
//! Readings are told apart by their direction and their size ([`features`]); place, and the strength over the size, are learned by
//! regression with a Gaussian kernel ([`regression`]), its parameters chosen by leaving one press out. One contact is all that such presses
//! teach. Readings unlike all that were taught ([`novelty`]) are answered, and flagged.

mod features;
mod novelty;
mod presses;
mod regression;

use self::features::{Described, Features};
use self::novelty::Novelty;
pub use self::presses::{Presses, PressesError, Strength};
use self::regression::{Points, Regression};
use super::locate::Locator;
use super::{Flags, FoundContact, Problem, Solution, SolveError, Solver};
use tactomo_physics::detector::Surface;
use tactomo_physics::forward::ForwardError;
use tactomo_physics::readings::Readings;

/// Presses that are simulated where none are told.
const SIMULATED: usize = 300;
/// Readings are like those taught if no more of their direction was never taught than so many times the most of a press.
const FARTHEST_BESIDE: f64 = 2.0;
/// How much the size of readings tells of the place of a press: of a detector nothing, once the force is taken out of them.
const SIZE_FOR_PLACE: f64 = 0.02;
/// How much it tells of the strength over the size.
const SIZE_FOR_STRENGTH: f64 = 0.3;
/// A size beyond those taught by this factor is too far, and below those taught no contact.
const SIZES_BEYOND: f64 = 2.0;

/// A regression from readings to the place and the strength of a press.
#[derive(Clone, Debug)]
pub struct Kernel {
    channels: usize,
    features: Features,
    size_for_place: f64,
    /// x, y and z (m).
    places: Regression,
    /// Logarithm of the strength over the size.
    strengths: Regression,
    novelty: Novelty,
    strength: Strength,
    limits: Limits,
}

/// What was taught, and how far from it readings may be.
#[derive(Clone, Debug)]
struct Limits {
    /// Smallest and largest x, y and z (m).
    places_m: [[f64; 2]; 3],
    /// Smallest and largest logarithm of the strength over the size.
    shares: [f64; 2],
    beside: f64,
    /// Smallest and largest size of readings (V).
    sizes_v: [f64; 2],
}

/// A press, as a kernel reads it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Press {
    /// Its middle (m).
    pub place_m: [f64; 3],
    /// Its strength, in the unit of the presses taught.
    pub strength: f64,
    /// The readings are unlike all that were taught.
    pub is_outside: bool,
}

/// Why nothing was learned.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("nothing can be learned from these presses: {0}")]
pub struct TeachError(String);

impl Kernel {
    /// Learns from presses.
    ///
    /// # Errors
    /// [`TeachError`] if there are too few presses or they are all alike.
    pub fn train(presses: &Presses) -> Result<Self, TeachError> {
        presses.check().map_err(TeachError)?;
        let alike = || TeachError("their readings are all alike".to_owned());
        let features = Features::of(presses).ok_or_else(alike)?;
        let described: Vec<Described> = presses.readings().map(|readings_v| features.describe(readings_v)).collect();
        let size_for_place = if presses.drive_v.is_some() { 0.0 } else { SIZE_FOR_PLACE };
        let sizes_v: Vec<f64> = described.iter().map(|described| described.size_v).collect();
        let shares: Vec<f64> =
            presses.strengths.iter().zip(&sizes_v).map(|(strength, size_v)| (strength / size_v).ln()).collect();
        let places =
            Regression::learn(points(&described, size_for_place), &presses.places_m.concat(), 3).ok_or_else(alike)?;
        let strengths = Regression::learn(points(&described, SIZE_FOR_STRENGTH), &shares, 1).ok_or_else(alike)?;
        let limits = Limits {
            places_m: [0, 1, 2].map(|axis| range(presses.places_m.iter().map(|place_m| place_m[axis]))),
            shares: range(shares.iter().copied()),
            beside: FARTHEST_BESIDE * range(described.iter().map(|described| described.beside))[1],
            sizes_v: range(sizes_v.iter().copied()),
        };
        Ok(Self {
            channels: presses.channels,
            novelty: Novelty::of(&places, &sizes_v).ok_or_else(alike)?,
            features,
            size_for_place,
            places,
            strengths,
            strength: presses.strength,
            limits,
        })
    }

    /// Readings that it needs for a press.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// How the strength of presses was measured.
    pub fn strength(&self) -> Strength {
        self.strength
    }

    /// Root mean square distance (m) by which it misses a press that it was not taught.
    pub fn left_out_m(&self) -> f64 {
        self.places.chosen.left_out.iter().map(|missed_m| missed_m * missed_m).sum::<f64>().sqrt()
    }

    /// The same for the strength, as a share of it.
    pub fn left_out_strength(&self) -> f64 {
        self.strengths.chosen.left_out[0]
    }

    /// The press that readings tell of (V, less those at rest); `None` if they are smaller than any that was taught.
    ///
    /// # Errors
    /// The first channel that is not finite, or `None` if there are not as many as were taught.
    pub fn press(&self, readings_v: &[f64]) -> Result<Option<Press>, Option<usize>> {
        if readings_v.len() != self.channels {
            return Err(None);
        }
        if let Some(channel) = readings_v.iter().position(|volts| !volts.is_finite()) {
            return Err(Some(channel));
        }
        let described = self.features.describe(readings_v);
        let [smallest_v, largest_v] = self.limits.sizes_v;
        if described.size_v < smallest_v / SIZES_BEYOND {
            return Ok(None);
        }
        let kernels = self.places.kernels(&described.point(self.size_for_place));
        let is_outside = self.novelty.is_new(&kernels, described.size_v)
            || described.beside > self.limits.beside
            || described.size_v > largest_v * SIZES_BEYOND;
        let found_m = self.places.values(&kernels);
        let place_m = [0, 1, 2].map(|axis| held(found_m[axis], self.limits.places_m[axis]));
        let share = self.strengths.values(&self.strengths.kernels(&described.point(SIZE_FOR_STRENGTH)))[0];
        let size_v = described.size_v.min(largest_v * SIZES_BEYOND);
        Ok(Some(Press { place_m, strength: held(share, self.limits.shares).exp() * size_v, is_outside }))
    }
}

fn held(value: f64, [low, high]: [f64; 2]) -> f64 {
    value.clamp(low, high)
}

/// Smallest and largest.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

fn points(described: &[Described], size_weight: f64) -> Points {
    let points: Vec<Vec<f64>> = described.iter().map(|described| described.point(size_weight)).collect();
    Points { dimensions: points[0].len(), values: points.concat() }
}

/// `kernel`: taught by simulated presses on a problem's model. Real ones teach better, as no model is right.
pub struct KernelSolver {
    electrodes: usize,
    drive_v: f64,
    kernel: Kernel,
    locator: Locator,
    surface: Option<Surface>,
}

impl KernelSolver {
    /// Simulates presses, and learns from them.
    ///
    /// # Errors
    /// [`ForwardError`] if the model takes no presses on this detector.
    pub fn new(problem: &Problem) -> Result<Self, ForwardError> {
        let detector = problem.detector();
        let kernel = Kernel::train(&Presses::simulated(problem, SIMULATED));
        let told =
            |error: TeachError| ForwardError::Detector { detector: detector.name.clone(), what: error.to_string() };
        Ok(Self {
            electrodes: detector.electrodes.len(),
            drive_v: detector.drive_v,
            kernel: kernel.map_err(told)?,
            locator: Locator::new(&problem.jacobian.image_mesh, detector),
            surface: detector.surface.clone(),
        })
    }

    /// What it has learned.
    pub fn kernel(&self) -> &Kernel {
        &self.kernel
    }
}

impl Solver for KernelSolver {
    fn name(&self) -> &'static str {
        "kernel"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        crate::solve::check(readings, self.electrodes)?;
        if self.locator.is_rest(readings) {
            return Ok(Solution::default());
        }
        // No voltage of a board is beyond its drive.
        let held = readings.volts().iter().map(|volts| volts.clamp(-self.drive_v, self.drive_v)).collect::<Vec<_>>();
        let Ok(Some(mut press)) = self.kernel.press(&held) else { return Ok(Solution::default()) };
        if let Some(surface) = &self.surface {
            press.place_m = surface.nearest(press.place_m).place_m;
        }
        Ok(press.solution(self.kernel.strength))
    }
}

impl Press {
    /// As a solution: a contact, with the force or the conductance that was taught.
    pub fn solution(&self, strength: Strength) -> Solution {
        let [x_m, y_m, z_m] = self.place_m;
        let contact = match strength {
            Strength::Conductance => FoundContact::flat(x_m, y_m, self.strength),
            Strength::Force => FoundContact { force_n: Some(self.strength), ..FoundContact::flat(x_m, y_m, 0.0) },
        };
        Solution {
            contacts: vec![FoundContact { z_m, ..contact }],
            flags: Flags { misfit: self.is_outside, ..Flags::default() },
            ..Solution::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::{ForwardModel, Resolution, Slab, readings_v};
    use tactomo_physics::scene::Contact;
    use tactomo_physics::simulate::{Noise, measured};

    fn problem() -> Problem {
        let slab: Box<dyn ForwardModel> = Box::new(Slab::new(&Detector::preset("square-60").unwrap()).unwrap());
        Problem::new(slab)
    }

    /// Readings of contacts by a finer slab, with noise.
    fn touched(contacts: &[Contact]) -> Readings {
        let detector = Detector::preset("square-60").unwrap();
        let slab = Slab::with_resolution(&detector, Resolution::FINE).unwrap();
        let readings = readings_v(&slab.impedance_ohm(contacts).unwrap(), &detector);
        measured(&readings, &detector.adc, &mut Noise::new(4))
    }

    #[test]
    fn finds_presses_that_it_was_not_taught() {
        let mut solver = KernelSolver::new(&problem()).unwrap();
        let sheet_s = solver_sheet_s();
        for (x_m, y_m, sheets) in [(0.0113, -0.0041, 0.05), (-0.0183, 0.0067, 0.5), (0.002, 0.0205, 3.0)] {
            let contact = Contact::flat(x_m, y_m, 0.002, sheets * sheet_s);
            let solution = solver.solve(&touched(&[contact])).unwrap();
            let [found] = solution.contacts[..] else { panic!("{solution:?}") };
            assert!((found.x_m - x_m).hypot(found.y_m - y_m) < 0.002, "{found:?}");
            assert!((found.conductance_s / contact.conductance_s).ln().abs() < 0.5, "{sheets}: {found:?}");
            assert!(!solution.flags.misfit, "{found:?}");
        }
    }

    fn solver_sheet_s() -> f64 {
        Detector::preset("square-60").unwrap().sheet_conductance_s()
    }

    #[test]
    fn what_it_was_not_taught_is_flagged() {
        let mut solver = KernelSolver::new(&problem()).unwrap();
        let conductance_s = 0.5 * solver_sheet_s();
        let two = [(-0.02, -0.02), (0.02, 0.02)].map(|(x_m, y_m)| Contact::flat(x_m, y_m, 0.002, conductance_s));
        assert!(solver.solve(&touched(&two)).unwrap().flags.misfit, "two contacts");
        let broken = Readings::from_fn(16, |g, e| if e == 3 && g != 3 { 1.3 } else { 0.2 });
        assert!(solver.solve(&broken).unwrap().flags.misfit, "a broken wire");
        assert_eq!(solver.solve(&Readings::from_fn(16, |_, _| 0.0)).unwrap(), Solution::default());
    }

    /// Presses on a sensor of five channels that is no detector of ours: each hears the force by its distance.
    fn five_channels(count: usize) -> Presses {
        let even = |step: f64, i: usize| (step * (i + 1) as f64).fract();
        let places_m: Vec<_> = (0..count).map(|i| [0.1 * even(0.7549, i), 0.1 * even(0.5698, i), 0.0]).collect();
        let strengths: Vec<f64> = (0..count).map(|i| 0.5 + 5.0 * even(0.3247, i)).collect();
        let heard = |place: &[f64; 3], force: f64| {
            let ears = [[0.0, 0.0], [0.1, 0.0], [0.0, 0.1], [0.1, 0.1], [0.05, 0.05]];
            ears.map(|ear| force / (1.0 + 200.0 * ((place[0] - ear[0]).powi(2) + (place[1] - ear[1]).powi(2))))
        };
        let readings_v = places_m.iter().zip(&strengths).flat_map(|(place, force)| heard(place, *force)).collect();
        Presses { channels: 5, readings_v, places_m, strengths, strength: Strength::Force, drive_v: None }
    }

    #[test]
    fn any_number_of_channels_is_learned_from() {
        let kernel = Kernel::train(&five_channels(200)).unwrap();
        assert!(
            kernel.left_out_m() < 0.002 && kernel.left_out_strength() < 0.05,
            "{} {}",
            kernel.left_out_m(),
            kernel.left_out_strength()
        );
        let unseen = five_channels(230);
        for index in 200..230 {
            let readings = &unseen.readings_v[5 * index..][..5];
            let press = kernel.press(readings).unwrap().unwrap();
            let place = unseen.places_m[index];
            assert!((press.place_m[0] - place[0]).hypot(press.place_m[1] - place[1]) < 0.004, "{press:?} {place:?}");
            assert!((press.strength / unseen.strengths[index] - 1.0).abs() < 0.1, "{press:?}");
        }
        assert_eq!(kernel.press(&[0.1; 4]), Err(None));
        assert_eq!(kernel.press(&[0.1, 0.1, f64::NAN, 0.1, 0.1]), Err(Some(2)));
        assert_eq!(kernel.press(&[1e-6; 5]), Ok(None));
        assert!(kernel.press(&[1.0, -1.0, 1.0, -1.0, 1.0]).unwrap().unwrap().is_outside);
    }

    #[test]
    fn presses_that_are_alike_teach_nothing() {
        let mut presses = five_channels(20);
        presses.readings_v.fill(0.5);
        assert!(Kernel::train(&presses).is_err());
        assert!(Kernel::train(&five_channels(5)).unwrap_err().to_string().contains("5 presses, but 10"));
    }
}
