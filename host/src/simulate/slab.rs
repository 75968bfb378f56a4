//! The simulated board's detector: a slab in full, finer than any solver inverts.

use super::{Physics, Scene};
use crate::detector::Detector;
use crate::forward::{ForwardError, ForwardModel, Resolution, Slab, readings_v};
use crate::readings::Readings;

/// A slab under a [`Scene`].
///
/// It shares neither mesh nor discretisation with what is inverted: fields by cosine modes in three dimensions, pads and
/// contacts as polynomial densities on discs, the current through each contact as it distributes itself.
#[derive(Clone, Debug)]
pub struct SlabPhysics {
    slab: Slab,
    scene: Scene,
}

impl SlabPhysics {
    /// The physics of `detector` under `scene`.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if the detector is not a rectangular slab.
    pub fn new(detector: &Detector, scene: Scene) -> Result<Self, ForwardError> {
        Ok(Self { slab: Slab::with_resolution(detector, Resolution::FINE)?, scene })
    }
}

impl Physics for SlabPhysics {
    fn readings_v(&mut self, time_s: f64) -> Readings {
        let mut contacts = self.scene.contacts(time_s);
        // What is pressed beside the detector does not touch it.
        contacts.retain(|contact| self.slab.check_contact(contact).is_ok());
        let detector = self.slab.detector();
        match self.slab.impedance_ohm(&contacts) {
            Ok(impedance_ohm) => readings_v(&impedance_ohm, detector),
            // Without a contact nothing drives the detector: it takes the potential of the ground.
            Err(_) => Readings::from_fn(detector.electrodes.len(), |_, _| 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_untouched_detector_is_at_ground_and_a_press_raises_the_electrodes_below_it() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let scene = Scene::at_rest(&detector);
        let mut physics = SlabPhysics::new(&detector, scene.clone()).unwrap();
        assert_eq!(physics.readings_v(0.0).largest_v(), 0.0);
        scene.press(Some(scene.touch(-0.0225, -0.0225, 0.5)));
        let readings = physics.readings_v(0.0);
        assert!(readings.at(15, 0) > 1.5 * readings.at(15, 3), "electrode 0 is under the press, 3 is not");
        assert!(readings.volts().iter().all(|v| (0.0..detector.drive_v).contains(v)));
    }
}
