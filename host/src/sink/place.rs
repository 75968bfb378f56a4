//! Where a detector lies on a body, such as a finger's on a hand.
//!
//! The body has a right-handed frame, [`BODY`], in metres. A detector has one of its own, in which its contacts are: x and y from its middle, z out of
//! the surface that is pressed on; of a curved detector the frame of its file.

use std::fmt;

use serde::Deserialize;
use tactomo_physics::nalgebra::UnitQuaternion;

/// What the body's frame is called.
pub const BODY: &str = "body";

/// Farthest from the body's origin (m): more is millimetres.
const FARTHEST_M: f64 = 10.0;
/// Largest angle (rad), a whole turn: more is degrees.
const WHOLE_TURN_RAD: f64 = std::f64::consts::TAU;

/// Where a detector's frame is in that of the body, as a robot's description has it (`<origin xyz="..." rpy="..."/>` of URDF).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Its origin (m).
    pub xyz_m: [f64; 3],
    /// Roll, pitch and yaw (rad): it is turned about the body's x, then y, then z.
    #[serde(default)]
    pub rpy_rad: [f64; 3],
}

/// Why a place is none.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PlaceError {
    /// It is farther than any body reaches.
    #[error("{0} in xyz_m: a place is within {FARTHEST_M} m of the body's origin, in metres")]
    Far(f64),
    /// An angle is more than a whole turn.
    #[error("{0} in rpy_rad: roll, pitch and yaw are in radians, and a whole turn is 6.283")]
    Angle(f64),
}

impl Place {
    /// Checks its numbers.
    ///
    /// # Errors
    /// [`PlaceError`] if they are not in metres and radians.
    pub fn check(&self) -> Result<(), PlaceError> {
        let beyond = |all: [f64; 3], most: f64| all.into_iter().find(|value| value.is_nan() || value.abs() > most);
        match (beyond(self.xyz_m, FARTHEST_M), beyond(self.rpy_rad, WHOLE_TURN_RAD + 1e-9)) {
            (Some(value), _) => Err(PlaceError::Far(value)),
            (None, Some(value)) => Err(PlaceError::Angle(value)),
            (None, None) => Ok(()),
        }
    }

    /// How it is turned.
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        let [roll, pitch, yaw] = self.rpy_rad;
        UnitQuaternion::from_euler_angles(roll, pitch, yaw)
    }

    /// The directions of its x, y and z in the body's frame.
    pub fn axes(&self) -> [[f64; 3]; 3] {
        let rotation = self.rotation().to_rotation_matrix();
        [0, 1, 2].map(|axis| rotation.matrix().column(axis).into_owned().into())
    }
}

/// As a TOML file has it.
impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{{ xyz_m = {:?}, rpy_rad = {:?} }}", self.xyz_m, self.rpy_rad)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    fn axes(rpy_rad: [f64; 3]) -> [[f64; 3]; 3] {
        let axes = Place { xyz_m: [0.0; 3], rpy_rad }.axes();
        axes.map(|axis| axis.map(|value| (1e12 * value).round() / 1e12 + 0.0))
    }

    #[test]
    fn angles_are_those_of_urdf_about_axes_that_stay() {
        // A quarter turn about z brings x to y.
        assert_eq!(axes([0.0, 0.0, FRAC_PI_2]), [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        // About x and then about z: z goes to -y, and from there to x.
        assert_eq!(axes([FRAC_PI_2, 0.0, FRAC_PI_2]), [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]);
        // A positive pitch turns x down.
        assert_eq!(axes([0.0, FRAC_PI_2, 0.0])[0], [0.0, 0.0, -1.0]);
    }

    #[test]
    fn what_is_written_is_read_again() {
        let place = Place { xyz_m: [0.1, -1e-7, 0.0], rpy_rad: [PI, 0.25, -0.1 - 0.2] };
        let read: toml::Table = toml::from_str(&format!("place = {place}")).unwrap();
        assert_eq!(read["place"].clone().try_into(), Ok(place));
    }

    #[test]
    fn millimetres_and_degrees_are_refused() {
        let place = |xyz_m, rpy_rad| Place { xyz_m, rpy_rad }.check();
        assert_eq!(place([0.3, 0.0, -0.2], [PI, -2.0 * PI, 0.0]), Ok(()));
        assert_eq!(place([0.0, 30.0, 0.0], [0.0; 3]), Err(PlaceError::Far(30.0)));
        assert_eq!(place([0.0; 3], [0.0, 0.0, 90.0]), Err(PlaceError::Angle(90.0)));
        assert!(place([f64::NAN, 0.0, 0.0], [0.0; 3]).is_err() && place([0.0; 3], [f64::INFINITY; 3]).is_err());
    }
}
