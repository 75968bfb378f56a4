//! What a surface conducts by the pressure on it.
//!
//! **Ideal.** All that touches conducts alike, `sigma / l`: the paper's eq. (3), with the conductivity `sigma` of the layer's top and the depth `l` of
//! surface that the current has to cross.
//!
//! **Measured.** The paper's table II does not bear that out. By it foams whose conductivity differs a hundredfold would differ in sensitivity by their
//! softness alone, and most samples would be in the reverse of the measured order. What it says is a film between foam and driving layer, which conducts whatever the
//! foam does, and the more so the more energy the press stores in the foam below it:
//!
//! ```text
//! c(p) = 1 S/m2 (p / u)^3,   u = sqrt(w E),   w = 18.7 kJ/m3
//! ```
//!
//! with the pressure `p` and the Young's modulus `E` of the foam on top. Its form was found with all samples in view; its one parameter, fitted to the four
//! single foams alone, gives sensitivities of the seven stacks within a factor of 1.8 (root mean square), and the order of all eleven with a rank
//! correlation of 0.95. `tactomo-lab study explain` has the other laws that were tried: Hertz's area, a real area of contact in proportion
//! to the force (Greenwood and Williamson 1966, Barber 2003), on the foam or on a film, and thresholds of a mesh.
//!
//! **Limits.** It is an empirical law, of one rubber sheet on four foams and of 0 to 5 N on 20 mm2: 0 to 250 kPa. Single samples are off by a factor of up to 3.
//! Another driving layer is another film: known presses tell (`tactomo calibrate force`).

use crate::detector::short;

/// Depth of surface that a contact's current crosses on an ideal surface, where none is given (m). The paper gives none. It was chosen for one sample: with
/// it the contact on sample A is at nine tenths of the drive at 2.1 N under a ball of 5 mm.
pub const SURFACE_DEPTH_M: f64 = 0.5e-3;

/// Energy `p^2 / E` in the foam at which its surface conducts 1 S/m2 (J/m3): `tactomo-lab study explain`, all samples of the paper's table II. Without any one of
/// the eleven samples it is between 17.2 and 21.0 kJ/m3.
const UNIT_ENERGY_J_PER_M3: f64 = 18.7e3;

/// A law of contact.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Surface {
    /// All that touches conducts alike, down to a depth.
    Ideal {
        /// `l` of the paper's eq. (3) (m).
        depth_m: f64,
    },
    /// A film that conducts as the cube of the pressure.
    Film {
        /// Pressure at which it conducts 1 S/m2 (Pa).
        unit_pa: f64,
    },
}

impl Surface {
    /// An ideal surface of the usual depth.
    pub const IDEAL: Self = Self::Ideal { depth_m: SURFACE_DEPTH_M };

    /// The film on a foam of such a Young's modulus (Pa), as the paper's table II has it.
    pub fn measured(young_pa: f64) -> Self {
        Self::Film { unit_pa: (UNIT_ENERGY_J_PER_M3 * young_pa).sqrt() }
    }

    /// What it conducts, in a few words.
    pub fn summary(&self) -> String {
        match self {
            Self::Ideal { depth_m } => format!("ideal, down to {} mm", short(depth_m * 1e3)),
            Self::Film { unit_pa } => format!("1 S/m\u{b2} at {} kPa", short(unit_pa * 1e-3)),
        }
    }

    /// Conductance per area (S/m2) under a pressure (Pa), on a layer of such a conductivity at its top (S/m).
    pub fn s_per_m2(&self, pressure_pa: f64, top_s_per_m: f64) -> f64 {
        match self {
            Self::Ideal { depth_m } => top_s_per_m / depth_m,
            Self::Film { unit_pa } => (pressure_pa / unit_pa).powi(3),
        }
    }
}
