//! Whether a slab can be made of a detector, and whether a contact can be on it.

use super::Slab;
use crate::detector::{Detector, Layer};
use crate::scene::Contact;

/// Width and height of a detector that the model can be made for (m), or what is wrong with it.
pub(super) fn check(detector: &Detector) -> Result<[f64; 2], String> {
    let size_m =
        detector.outline.as_rectangle().ok_or("its outline is not a rectangle; use the shell for other outlines")?;
    if detector.surface.is_some() {
        return Err("it is curved; use the shell".to_owned());
    }
    let positive = |value: f64| value > 0.0 && value.is_finite();
    let sound = |layer: &Layer| [layer.thickness_m, layer.bottom_s_per_m, layer.top_s_per_m].into_iter().all(positive);
    if detector.layers.is_empty() {
        return Err("it has no layer".to_owned());
    }
    if let Some(index) = detector.layers.iter().position(|layer| !sound(layer)) {
        return Err(format!("layer {index} needs a thickness and conductivities above zero"));
    }
    if detector.electrodes.is_empty() {
        return Err("it has no electrode".to_owned());
    }
    for (index, pad) in detector.electrodes.iter().enumerate() {
        let inside =
            [(pad.x_m, size_m[0]), (pad.y_m, size_m[1])].iter().all(|(at, size)| at.abs() + pad.radius_m <= size / 2.0);
        if !(positive(pad.radius_m) && inside) {
            return Err(format!("electrode {index} needs a radius above zero and a place inside the outline"));
        }
        let impedance_ohm_m2 = detector.pad_impedance_ohm_m2(pad);
        if !(impedance_ohm_m2 >= 0.0 && impedance_ohm_m2.is_finite()) {
            return Err(format!("the contact impedance of electrode {index} is below zero or not a number"));
        }
    }
    Ok(size_m)
}

impl Slab {
    /// Whether a contact can be on this detector, or what is wrong with it.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn check_contact(&self, contact: &Contact) -> Result<(), String> {
        let inside = 2.0 * contact.x_m.abs() <= self.size_m[0] && 2.0 * contact.y_m.abs() <= self.size_m[1];
        if !inside {
            return Err(format!("its middle, {} {} m, is not on the detector", contact.x_m, contact.y_m));
        }
        if !(contact.radius_m > 0.0 && contact.radius_m <= self.size_m[0].max(self.size_m[1])) {
            return Err(format!("its radius is {} m", contact.radius_m));
        }
        if !(contact.conductance_s >= 0.0 && contact.conductance_s.is_finite()) {
            return Err(format!("its conductance is {} S", contact.conductance_s));
        }
        Ok(())
    }
}
