//! The kernel as a solver for a detector.

use std::sync::Arc;

use crate::learned::Learned;
use crate::learned::kernel::{Kernel, Presses, Strength, TeachError};
use crate::solve::answer::{Solution, SolveError, check};
use crate::solve::fit::locate::Locator;
use crate::solve::problem::Problem;
use crate::solve::solver::Solver;
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Surface;
use tactomo_physics::forward::{ForwardError, readings_v};
use tactomo_physics::geometry::is_inside;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::Noise;

/// Presses that are simulated where none are given.
const SIMULATED: usize = 300;
/// Conductance of the lightest and of the firmest simulated press, in sheet conductances.
const FIRMNESS: [f64; 2] = [0.015, 10.0];
/// Radius of the narrowest and of the widest simulated press, in mean distances of electrodes.
const RADII: [f64; 2] = [0.1, 0.25];
/// Steps of the additive sequence of Roberts in four dimensions, which fills a cube evenly: powers of 1 over the root of
/// `g^5 = g + 1`.
const EVEN_STEPS: [f64; 4] =
    [0.856_674_883_854_502_9, 0.733_891_856_627_126, 0.628_706_721_037_808_6, 0.538_597_257_274_294];

/// `kernel`: taught on the sensor itself, or by simulated presses on a problem's model. Real ones teach better, as no model is right.
pub struct KernelSolver {
    electrodes: usize,
    drive_v: f64,
    kernel: Arc<Kernel>,
    locator: Locator,
    surface: Option<Surface>,
}

impl KernelSolver {
    /// Takes the kernel that the problem has, or simulates presses and learns from them.
    ///
    /// # Errors
    /// [`ForwardError`] if the model takes no presses on this detector.
    pub fn new(problem: &Problem) -> Result<Self, ForwardError> {
        let detector = problem.detector();
        let refused =
            |error: TeachError| ForwardError::Detector { detector: detector.name.clone(), what: with_causes(&error) };
        let kernel = match problem.learned() {
            Some(Learned::Kernel(kernel)) => Arc::clone(kernel),
            _ => Arc::new(Kernel::train(&Presses::simulated(problem, SIMULATED)).map_err(refused)?),
        };
        Ok(Self {
            electrodes: detector.electrodes.len(),
            drive_v: detector.drive_v,
            kernel,
            locator: Locator::new(&problem.jacobian.image_mesh, detector),
            surface: detector.surface.clone(),
        })
    }

    /// What it has learned.
    pub fn kernel(&self) -> &Kernel {
        &self.kernel
    }
}

impl Presses {
    /// Presses on the model of a problem, light and firm, narrow and wide, spread evenly, with the converter's noise. Always the same.
    pub fn simulated(problem: &Problem, count: usize) -> Self {
        let detector = problem.detector();
        let mut noise = Noise::new(1);
        let mut presses = Self {
            channels: detector.electrodes.len().pow(2),
            names: Vec::new(),
            readings_v: Vec::new(),
            places_m: Vec::new(),
            strengths: Vec::new(),
            strength: Some(Strength::Conductance),
            drive_v: Some(detector.drive_v),
            of: None,
            others: Vec::new(),
        };
        // Most outlines fill more than a quarter of their bounding boxes.
        for contact in (0..4 * count).filter_map(|index| simulated_contact(problem, index)) {
            let Ok(impedance_ohm) = problem.model.impedance_ohm(&[contact]) else { continue };
            if presses.count() == count {
                break;
            }
            let readings = readings_v(&impedance_ohm, detector);
            let noisy = readings.volts().iter().map(|volts| volts + detector.adc.deviation_v() * noise.normal());
            presses.readings_v.extend(noisy);
            presses.places_m.push([contact.x_m, contact.y_m, contact.z_m]);
            presses.strengths.push(contact.conductance_s);
        }
        presses
    }
}

/// A contact of the even sequence, if its place is on the detector.
fn simulated_contact(problem: &Problem, index: usize) -> Option<Contact> {
    let detector = problem.detector();
    let [x, y, firmness, radius] = EVEN_STEPS.map(|step| (0.5 + step * (index + 1) as f64).fract());
    let [low, high] = detector.outline.bounds();
    let map_m = [low[0] + x * (high[0] - low[0]), low[1] + y * (high[1] - low[1])];
    let in_a_hole = detector.outline.holes.iter().any(|hole| is_inside(map_m, hole));
    if in_a_hole || !is_inside(map_m, &detector.outline.outer) {
        return None;
    }
    let [x_m, y_m, z_m] = detector.place_m(map_m)?;
    let radius_m = (RADII[0] + radius * (RADII[1] - RADII[0])) * problem.spacing_m();
    let conductance_s = detector.sheet_conductance_s() * FIRMNESS[0] * (FIRMNESS[1] / FIRMNESS[0]).powf(firmness);
    Some(Contact { z_m, ..Contact::flat(x_m, y_m, radius_m, conductance_s) })
}

impl Solver for KernelSolver {
    fn name(&self) -> &'static str {
        "kernel"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        check(readings, self.electrodes)?;
        if self.locator.is_rest(readings) {
            return Ok(Solution::default());
        }
        // No voltage of a board is beyond its drive.
        let held = readings.volts().iter().map(|volts| volts.clamp(-self.drive_v, self.drive_v)).collect::<Vec<_>>();
        let Ok(Some(mut press)) = self.kernel.press(&held) else { return Ok(Solution::default()) };
        if let Some(surface) = &self.surface {
            press.place_m = surface.nearest(press.place_m).place_m;
        }
        Ok(press.solution(self.kernel.strength()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::pipeline::method::Method;
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
    fn what_was_taught_on_the_sensor_takes_the_place_of_what_is_simulated() {
        // Taught that all places are 1 mm further right.
        let mut presses = Presses::simulated(&problem(), 200);
        presses.places_m.iter_mut().for_each(|place_m| place_m[0] += 0.001);
        let taught = problem().with_learned(Kernel::train(&presses).unwrap().into()).unwrap();
        let touch = touched(&[Contact::flat(0.002, -0.004, 0.002, 0.5 * solver_sheet_s())]);
        let found = |problem: &Problem| Method::Kernel.build(problem).unwrap().solve(&touch).unwrap().contacts[0].x_m;
        let further_m = found(&taught) - found(&problem());
        assert!((further_m - 0.001).abs() < 4e-4, "{further_m}");
        let strip = Problem::of(&Detector::preset("square-60").unwrap().keeping(&[0, 1, 2, 3, 5, 6, 9, 10])).unwrap();
        let elsewhere = strip.with_learned(taught.learned().unwrap().clone()).err().unwrap().to_string();
        assert!(elsewhere.contains("256 readings") && elsewhere.contains("8 electrodes gives 64"), "{elsewhere}");
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
}
