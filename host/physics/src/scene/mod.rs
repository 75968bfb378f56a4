//! What presses: the contacts present at a moment, and scenes in which they come and go.

mod demonstration;
mod hand;
mod name;
mod script;
mod touch;

pub use self::demonstration::TEXTURE_HZ;
pub use self::hand::{Fingertip, Hand};
pub use self::name::SceneName;
pub use self::script::Scene;
pub use self::touch::{CONDUCTANCE_S, Shape, Touch, TouchError};

/// A disc of contact between driving layer and detector.
///
/// ```
/// use tactomo_physics::scene::{Contact, Touch};
///
/// // A light press of 3 mm radius, 9 mm right of the middle and 6 mm below it.
/// let press = Contact::flat(0.009, -0.006, 0.003, 2e-4);
/// assert_eq!(Touch::from(press).disc(), Some(press));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Contact {
    /// Centre, x (m).
    pub x_m: f64,
    /// Centre, y (m).
    pub y_m: f64,
    /// Centre, z (m): on a curved detector; zero on a flat one.
    #[serde(default, skip_serializing_if = "crate::geometry::is_zero")]
    pub z_m: f64,
    /// Radius (m).
    pub radius_m: f64,
    /// Conductance of the whole disc (S), spread evenly over its area; a part beyond an edge of the detector touches nothing.
    pub conductance_s: f64,
}

impl Contact {
    /// A contact on a flat detector.
    pub const fn flat(x_m: f64, y_m: f64, radius_m: f64, conductance_s: f64) -> Self {
        Self { x_m, y_m, z_m: 0.0, radius_m, conductance_s }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_height_of_a_flat_contact_need_not_be_written() {
        let flat = Contact::flat(0.01, 0.02, 0.003, 1e-3);
        let text = serde_json::to_string(&flat).unwrap();
        assert_eq!(text, r#"{"x_m":0.01,"y_m":0.02,"radius_m":0.003,"conductance_s":0.001}"#);
        for contact in [flat, Contact { z_m: 0.004, ..flat }] {
            let text = serde_json::to_string(&contact).unwrap();
            assert_eq!(serde_json::from_str::<Contact>(&text).unwrap(), contact);
        }
    }
}
