//! The detector of the simulated board: a model finer than any that is inverted, under a scene and what else presses.

use nalgebra::DMatrix;

use super::controls::{Built, Changes, Controls};
use super::{Fault, FaultError, Physics, as_built, uneven_shell};
use crate::detector::Detector;
use crate::forward::shell::Shell;
use crate::forward::{ForwardError, ForwardModel, Resolution, Slab, touched_impedance_ohm};
use crate::readings::Readings;
use crate::scene::{Contact, Scene, SceneName, Touch};

/// Nodes of the image that touches of other shapes than discs have on a simulated slab: not those that slabs are inverted on.
const SLAB_IMAGE_NODES: usize = 3000;
/// Nodes of a simulated shell for each one of the shell that is inverted.
const FINER: usize = 3;

/// Why a detector cannot be simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimulationError {
    /// There is no model of it.
    #[error(transparent)]
    Forward(#[from] ForwardError),
    /// A fault cannot be.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// A scene of another shape than discs, on a curved detector.
    #[error("only discs can touch a curved detector, so it cannot have the scene {0}: choose another one")]
    Shape(SceneName),
    /// The system gives no thread to make a model in.
    #[error("no thread to make the model of the detector: {0}")]
    Thread(String),
}

/// A detector that a scene and other contacts press on, and whose wires may be wrong.
pub struct Simulation {
    built: Built,
    scene: Scene,
    /// When the scene began (s).
    scene_from_s: f64,
    controls: Controls,
    pressed: Vec<Contact>,
    /// What touched last, and the impedances it made.
    last: Option<(Vec<Touch>, Option<DMatrix<f64>>)>,
}

/// The best model of a detector with such faults, finer than those that are inverted: the slab for rectangles, else the shell. Uneven
/// conductivity only the shell can have.
///
/// # Errors
/// [`ForwardError::Detector`] if there is no model of the detector.
pub fn finer_model(detector: &Detector, faults: &[Fault], seed: u64) -> Result<Box<dyn ForwardModel>, ForwardError> {
    let detector = &as_built(detector, faults, seed);
    let nodes = FINER * Shell::default_nodes(detector);
    if let Some(uneven) = uneven_shell(detector, nodes, faults, seed)? {
        return Ok(Box::new(uneven));
    }
    if detector.surface.is_none() && detector.outline.as_rectangle().is_some() {
        return Ok(Box::new(Slab::with_resolution(detector, Resolution::FINE)?.on_image(SLAB_IMAGE_NODES)));
    }
    Ok(Box::new(Shell::with_nodes(detector, nodes)?))
}

impl Simulation {
    /// A detector under a scene. `seed` chooses what its faults leave open.
    ///
    /// # Errors
    /// [`SimulationError`] if there is no model of the detector or it cannot have the faults.
    pub fn new(detector: &Detector, scene: Scene, faults: &[Fault], seed: u64) -> Result<Self, SimulationError> {
        let built = Built::new(detector, faults, seed)?;
        let controls = Controls::new(detector, &scene, faults, seed);
        Ok(Self { built, scene, scene_from_s: 0.0, controls, pressed: Vec::new(), last: None })
    }

    /// What a person may change of it while it runs.
    pub fn controls(&self) -> Controls {
        self.controls.clone()
    }

    /// Does what was asked for since the last frame.
    fn take_changes(&mut self, time_s: f64) {
        let Changes { pressed, scene, built } = self.controls.changes();
        self.pressed = pressed;
        if let Some(scene) = scene {
            (self.scene, self.scene_from_s) = (scene, time_s);
        }
        if let Some(built) = built {
            (self.built, self.last) = (built, None);
        }
    }
}

impl Physics for Simulation {
    fn readings_v(&mut self, time_s: f64) -> Readings {
        self.take_changes(time_s);
        let mut touches = self.scene.at(time_s - self.scene_from_s);
        touches.extend(self.pressed.iter().copied().map(Touch::from));
        let impedance_ohm = match self.last.take() {
            Some((last, impedance_ohm)) if last == touches => impedance_ohm,
            _ => impedance_ohm(&*self.built.model, touches.clone()),
        };
        let readings = self.built.measurement.pad_voltages(impedance_ohm.as_ref());
        self.last = Some((touches, impedance_ohm));
        readings
    }
}

/// Impedances under what of the touches is on the detector; `None` if nothing conducts. What is pressed beside it does not touch it.
fn impedance_ohm(model: &dyn ForwardModel, mut touches: Vec<Touch>) -> Option<DMatrix<f64>> {
    loop {
        match touched_impedance_ohm(model, &touches) {
            Ok(impedance_ohm) => return Some(impedance_ohm),
            Err(ForwardError::Contact { index, .. }) if index < touches.len() => {
                touches.remove(index);
            }
            Err(_) => return None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Hand;
    use std::time::{Duration, Instant};

    fn simulation(name: SceneName, faults: &[&str]) -> Simulation {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let scene = Scene::new(name, &detector, Hand::relative(&detector), 1);
        let faults: Vec<Fault> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
        Simulation::new(&detector, scene, &faults, 1).unwrap()
    }

    #[test]
    fn an_untouched_detector_is_at_ground_and_a_press_raises_the_electrodes_below_it() {
        let mut simulation = simulation(SceneName::Rest, &[]);
        assert_eq!(simulation.readings_v(0.0).largest_v(), 0.0);
        let press = simulation.scene.hand().tip([-0.0225, -0.0225], 0.5, 1.0).disc();
        simulation.controls().press(press.into_iter().collect());
        let readings = simulation.readings_v(0.0);
        assert!(readings.at(15, 0) > 1.5 * readings.at(15, 3), "electrode 0 is under the press, 3 is not");
        assert!(readings.volts().iter().all(|v| (0.0..2.0).contains(v)));
        simulation.controls().press(Vec::new());
        assert_eq!(simulation.readings_v(0.0).largest_v(), 0.0);
    }

    #[test]
    fn a_ring_is_felt_and_a_press_in_its_middle_is_felt_with_it() {
        let mut simulation = simulation(SceneName::Ring, &[]);
        let alone = simulation.readings_v(0.0);
        assert!(alone.largest_v() > 0.5);
        assert_eq!(simulation.readings_v(1.0), alone, "it lies still");
        simulation.controls().press(vec![Contact::flat(0.0, 0.0, 0.003, 1e-3)]);
        let both = simulation.readings_v(2.0);
        assert!(both.largest_v() > alone.largest_v() + 0.05, "{} {}", both.largest_v(), alone.largest_v());
    }

    #[test]
    fn what_is_beside_the_detector_does_not_touch_it() {
        let mut simulation = simulation(SceneName::Single, &[]);
        let alone = simulation.readings_v(0.0);
        let beside = Contact::flat(0.2, 0.0, 0.003, 1e-3);
        simulation.controls().press(vec![beside]);
        assert_eq!(simulation.readings_v(0.0), alone);
    }

    #[test]
    fn several_contacts_press_at_a_time() {
        let mut simulation = simulation(SceneName::Rest, &[]);
        let (left, right) = (Contact::flat(-0.0225, 0.0, 0.003, 1e-3), Contact::flat(0.0225, 0.0, 0.003, 1e-3));
        let mut readings = |contacts: &[Contact]| {
            simulation.controls().press(contacts.to_vec());
            simulation.readings_v(0.0)
        };
        let [one, other, both] = [&[left][..], &[right], &[left, right]].map(&mut readings);
        assert!(both.largest_v() > 0.0 && both != one && both != other && one != other);
    }

    #[test]
    fn a_scene_that_is_asked_for_begins_at_its_beginning() {
        let mut simulation = simulation(SceneName::Ring, &[]);
        simulation.readings_v(5.0);
        simulation.controls().play(SceneName::ChangingForce).unwrap();
        assert_eq!(simulation.readings_v(6.0).largest_v(), 0.0, "it begins with nothing");
        assert!(simulation.readings_v(6.0 + 1.35).largest_v() > 0.1, "half a period later it is firm");
        assert_eq!(simulation.controls().scene(), SceneName::ChangingForce);
    }

    #[test]
    fn faults_come_while_frames_go_on_and_only_those_asked_for_last() {
        let mut simulation = simulation(SceneName::Single, &[]);
        let controls = simulation.controls();
        let whole = simulation.readings_v(0.0);
        let fault = |text: &str| vec![text.parse::<Fault>().unwrap()];
        let failed = |error| panic!("{error}");
        controls.set_faults(fault("short:3,4"), failed).unwrap();
        controls.set_faults(fault("gain:4:0.5"), failed).unwrap();
        let (begin, mut longest) = (Instant::now(), Duration::ZERO);
        while controls.faults().is_empty() {
            let frame = Instant::now();
            let readings = simulation.readings_v(0.0);
            longest = longest.max(frame.elapsed());
            // The model may be ready just now.
            if controls.faults().is_empty() {
                assert_eq!(readings, whole, "until the model is made, all stays as it was");
            }
            assert!(begin.elapsed() < Duration::from_secs(60));
        }
        assert!(
            longest < begin.elapsed() / 2 || begin.elapsed() < Duration::from_millis(20),
            "a frame waited {longest:?}"
        );
        assert_eq!(controls.faults(), fault("gain:4:0.5"));
        let faulty = simulation.readings_v(0.0);
        assert_eq!(faulty.at(0, 4), 0.5 * whole.at(0, 4));
        assert_eq!(faulty.at(0, 3), whole.at(0, 3));
        assert!(matches!(controls.set_faults(fault("open:16"), failed), Err(SimulationError::Fault(_))));
    }
}
