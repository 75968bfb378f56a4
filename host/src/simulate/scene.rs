//! A scene that moves by itself, and the mouse that presses into it.

use std::f64::consts::TAU;
use std::sync::{Arc, Mutex, PoisonError};

use crate::detector::Detector;
use crate::scene::Contact;

/// Conductance of the firmest press, in sheet conductances: well beyond where the linear theory ends.
const FIRMEST: f64 = 2.0;

/// A press shorter than this share of the firmest is no press.
const LIGHTEST: f64 = 1e-3;

/// Radius of the firmest contact, as a share of the detector's shorter side.
const RADIUS_SHARE: f64 = 0.045;

/// Seconds between two presses of the wandering contact.
const PRESS_PERIOD_S: f64 = 2.7;

/// Seconds that the contact takes across and back, in x and in y: not in step, so that it comes everywhere.
const WANDER_PERIOD_S: [f64; 2] = [11.3, 7.9];

/// How far it wanders from the middle, as a share of half the side.
const WANDER_SHARE: f64 = 0.78;

/// The contacts of the simulated board: one that wanders over the detector, pressing and lifting, and one that the mouse makes.
///
/// A handle: clones share the mouse's contact.
#[derive(Clone, Debug)]
pub struct Scene {
    half_size_m: [f64; 2],
    sheet_conductance_s: f64,
    wanders: bool,
    pressed: Arc<Mutex<Option<Contact>>>,
}

impl Scene {
    /// A scene on `detector` with a contact that wanders by itself.
    pub fn wandering(detector: &Detector) -> Self {
        Self { wanders: true, ..Self::at_rest(detector) }
    }

    /// A scene on `detector` that only [`press`](Self::press) touches.
    pub fn at_rest(detector: &Detector) -> Self {
        let [low, high] = detector.outline.bounds();
        Self {
            half_size_m: [0, 1].map(|axis| (high[axis] - low[axis]) / 2.0),
            sheet_conductance_s: detector.sheet_conductance_s(),
            wanders: false,
            pressed: Arc::new(Mutex::new(None)),
        }
    }

    /// Presses there, or lifts with `None`; replaces the press before it.
    pub fn press(&self, contact: Option<Contact>) {
        *self.pressed.lock().unwrap_or_else(PoisonError::into_inner) = contact;
    }

    /// A contact at a place (m) that a finger makes with `firmness` from 0 to 1.
    pub fn touch(&self, x_m: f64, y_m: f64, firmness: f64) -> Contact {
        let firmness = firmness.clamp(LIGHTEST, 1.0);
        let shorter_m = 2.0 * self.half_size_m[0].min(self.half_size_m[1]);
        Contact {
            z_m: 0.0,
            x_m: x_m.clamp(-self.half_size_m[0], self.half_size_m[0]),
            y_m: y_m.clamp(-self.half_size_m[1], self.half_size_m[1]),
            // A sphere pressed into foam: the area grows as the two-thirds power of the force (Hertz).
            radius_m: RADIUS_SHARE * shorter_m * firmness.cbrt(),
            conductance_s: FIRMEST * self.sheet_conductance_s * firmness,
        }
    }

    /// All contacts at `time_s` seconds after the start.
    pub fn contacts(&self, time_s: f64) -> Vec<Contact> {
        let pressed = *self.pressed.lock().unwrap_or_else(PoisonError::into_inner);
        self.wandering_contact(time_s).into_iter().chain(pressed).collect()
    }

    fn wandering_contact(&self, time_s: f64) -> Option<Contact> {
        // The fourth power rests long at nothing, rises smoothly and is lifted just as smoothly.
        let firmness = (TAU * time_s / PRESS_PERIOD_S / 2.0).sin().powi(4);
        let place = |axis: usize| {
            WANDER_SHARE * self.half_size_m[axis] * (TAU * time_s / WANDER_PERIOD_S[axis] + axis as f64).sin()
        };
        (self.wanders && firmness > LIGHTEST).then(|| self.touch(place(0), place(1), firmness))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Detector {
        Detector::preset(Detector::DEFAULT).unwrap()
    }

    #[test]
    fn the_wandering_contact_presses_and_lifts_and_stays_on_the_detector() {
        let scene = Scene::wandering(&square());
        let seen: Vec<_> = (0..4000).map(|i| scene.contacts(f64::from(i) * 0.01)).collect();
        assert!(seen.iter().any(Vec::is_empty), "it lifts");
        let contacts: Vec<_> = seen.into_iter().flatten().collect();
        assert!(contacts.iter().all(|c| c.x_m.abs() + c.radius_m < 0.03 && c.y_m.abs() + c.radius_m < 0.03));
        assert!(contacts.iter().any(|c| c.x_m < -0.02) && contacts.iter().any(|c| c.y_m > 0.02), "it comes everywhere");
        let sheet_s = square().sheet_conductance_s();
        assert!(
            contacts.iter().any(|c| c.conductance_s > sheet_s)
                && contacts.iter().any(|c| c.conductance_s < 0.02 * sheet_s)
        );
    }

    #[test]
    fn a_press_is_seen_by_every_clone_until_it_lifts() {
        let scene = Scene::at_rest(&square());
        let press = scene.touch(0.01, -0.02, 0.5);
        scene.clone().press(Some(press));
        assert_eq!(scene.contacts(1.0), [press]);
        scene.press(None);
        assert!(scene.contacts(1.0).is_empty());
    }
}
