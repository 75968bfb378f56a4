//! The detector of the simulated board: a model finer than any that is inverted, under a scene and the mouse.

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::DMatrix;

use super::{Fault, FaultError, Measurement, Physics, as_built, uneven_shell};
use crate::detector::Detector;
use crate::forward::shell::Shell;
use crate::forward::{ForwardError, ForwardModel, Resolution, Slab, touched_impedance_ohm};
use crate::readings::Readings;
use crate::scene::{Contact, Scene, Touch};

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
}

/// The mouse's contact. A handle: clones share it.
#[derive(Clone, Debug, Default)]
pub struct Mouse(Arc<Mutex<Option<Contact>>>);

/// A detector that a scene and the mouse press on, and whose wires may be wrong.
pub struct Simulation {
    model: Box<dyn ForwardModel>,
    measurement: Measurement,
    scene: Scene,
    mouse: Mouse,
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

impl Mouse {
    /// Presses there, or lifts with `None`; replaces the press before it.
    pub fn press(&self, contact: Option<Contact>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = contact;
    }

    fn pressed(&self) -> Option<Contact> {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Simulation {
    /// A detector under a scene. `seed` chooses what its faults leave open.
    ///
    /// # Errors
    /// [`SimulationError`] if there is no model of the detector or it cannot have the faults.
    pub fn new(detector: &Detector, scene: Scene, faults: &[Fault], seed: u64) -> Result<Self, SimulationError> {
        let measurement = Measurement::new(detector, faults, seed)?;
        let model = finer_model(detector, faults, seed)?;
        Ok(Self { model, measurement, scene, mouse: Mouse::default(), last: None })
    }

    /// The mouse that presses on it.
    pub fn mouse(&self) -> Mouse {
        self.mouse.clone()
    }
}

impl Physics for Simulation {
    fn readings_v(&mut self, time_s: f64) -> Readings {
        let mut touches = self.scene.at(time_s);
        touches.extend(self.mouse.pressed().map(Touch::from));
        let impedance_ohm = match self.last.take() {
            Some((last, impedance_ohm)) if last == touches => impedance_ohm,
            _ => impedance_ohm(&*self.model, touches.clone()),
        };
        let readings = self.measurement.pad_voltages(impedance_ohm.as_ref());
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
    use crate::scene::{Hand, SceneName};

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
        simulation.mouse().press(press);
        let readings = simulation.readings_v(0.0);
        assert!(readings.at(15, 0) > 1.5 * readings.at(15, 3), "electrode 0 is under the press, 3 is not");
        assert!(readings.volts().iter().all(|v| (0.0..2.0).contains(v)));
        simulation.mouse().press(None);
        assert_eq!(simulation.readings_v(0.0).largest_v(), 0.0);
    }

    #[test]
    fn a_ring_is_felt_and_a_press_in_its_middle_is_felt_with_it() {
        let mut simulation = simulation(SceneName::Ring, &[]);
        let alone = simulation.readings_v(0.0);
        assert!(alone.largest_v() > 0.5);
        assert_eq!(simulation.readings_v(1.0), alone, "it lies still");
        simulation.mouse().press(Some(Contact::flat(0.0, 0.0, 0.003, 1e-3)));
        let both = simulation.readings_v(2.0);
        assert!(both.largest_v() > alone.largest_v() + 0.05, "{} {}", both.largest_v(), alone.largest_v());
    }

    #[test]
    fn what_is_beside_the_detector_does_not_touch_it() {
        let mut simulation = simulation(SceneName::Single, &[]);
        let alone = simulation.readings_v(0.0);
        let beside = Contact::flat(0.2, 0.0, 0.003, 1e-3);
        simulation.mouse().press(Some(beside));
        assert_eq!(simulation.readings_v(0.0), alone);
    }
}
