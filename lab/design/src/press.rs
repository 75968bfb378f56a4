//! What presses in the studies: a round contact of a given conductivity, or a ball pressed with a force.

use std::f64::consts::PI;

use tactomo_physics::detector::{Detector, Problem};
use tactomo_physics::geometry::Point;
use tactomo_physics::hertz::{Hertz, Imprint, SURFACE_DEPTH_M, Skin, Surface};
use tactomo_physics::scene::Contact;

/// Diameter of the paper's simulated contact (m), section III.A.
pub const CONTACT_DIAMETER_M: f64 = 0.004;
/// Conductivities under the contact that stand for force there (S/m).
pub const CONDUCTIVITIES_S_PER_M: [f64; 2] = [0.001, 10.0];
/// The one at which places, image widths and limits are compared (S/m): that of the paper's study of thickness.
pub const COMPARED_S_PER_M: f64 = 1.0;
/// Diameter of the paper's indenter (m), section IV.B.
pub const INDENTER_DIAMETER_M: f64 = 0.005;
/// Forces there (N), from the lightest that its force sensor of 50 N resolves.
pub const FORCES_N: [f64; 2] = [0.01, 5.0];
/// Steps of force from nothing to the largest: every 0.125 N.
pub const STEPS: usize = 40;
/// The paper's nine places: so far from the middle (m) on its detector of 60 mm, and in proportion on others.
const APART_M: f64 = 0.020;
const OF_WIDTH_M: f64 = 0.060;

/// What makes a contact of a strength: a conductivity (S/m) or a force (N).
#[derive(Clone, Copy, Debug)]
pub enum Press {
    /// A disc under which the surface has some conductivity, down to [`SURFACE_DEPTH_M`]. The paper does not say how deep its "elements under the
    /// contact" are; this is the depth that contacts have elsewhere.
    Conductivity {
        /// Of the disc (m).
        radius_m: f64,
    },
    /// A ball on a layer of foam: Hertz.
    Ball {
        /// Of the ball (m).
        radius_m: f64,
        /// The layer.
        hertz: Hertz,
    },
    /// A flat punch on a layer of foam.
    Flat {
        /// Of the punch (m).
        radius_m: f64,
        /// The layer.
        hertz: Hertz,
    },
}

impl Press {
    /// The paper's simulated contact.
    pub const PAPER: Self = Self::Conductivity { radius_m: CONTACT_DIAMETER_M / 2.0 };

    /// The paper's indenter on a detector of such a skin: flat, which fits its table II. Under a flat one an ideal surface tells no force, so on that it is a ball, as in
    /// the paper's eq. (1).
    ///
    /// # Errors
    /// [`Problem`] if that is no elastic layer.
    pub fn indenter(detector: &Detector, skin: Skin) -> Result<Self, Problem> {
        let (radius_m, hertz) = (INDENTER_DIAMETER_M / 2.0, Hertz::new(detector, skin)?);
        Ok(match skin.surface {
            Surface::Ideal { .. } => Self::Ball { radius_m, hertz },
            Surface::Film { .. } => Self::Flat { radius_m, hertz },
        })
    }

    /// The contact of a strength at a place (m).
    pub fn at(&self, [x_m, y_m]: Point, strength: f64) -> Contact {
        let imprinted = |imprint: Imprint| Contact::flat(x_m, y_m, imprint.half_width_m, imprint.conductance_s);
        match self {
            Self::Conductivity { radius_m } => {
                Contact::flat(x_m, y_m, *radius_m, strength * PI * radius_m * radius_m / SURFACE_DEPTH_M)
            }
            Self::Ball { radius_m, hertz } => imprinted(hertz.ball(*radius_m, strength)),
            Self::Flat { radius_m, hertz } => imprinted(hertz.flat(*radius_m, strength)),
        }
    }
}

/// Force of a step (N).
pub fn force_n(step: usize) -> f64 {
    step as f64 * FORCES_N[1] / STEPS as f64
}

/// The paper's nine places, in proportion to the detector's sides (m): rows from the lowest, the middle one is the fifth.
pub fn nine_places(detector: &Detector) -> [Point; 9] {
    let [width_m, height_m] = detector.outline.size_m();
    let step = |index: usize| (index as f64 - 1.0) * APART_M / OF_WIDTH_M;
    std::array::from_fn(|k| [step(k % 3) * width_m, step(k / 3) * height_m])
}

/// The middle of a detector (m).
pub const MIDDLE: Point = [0.0, 0.0];

/// Values even in the logarithm, both ends included.
pub fn in_decades([low, high]: [f64; 2], count: usize) -> Vec<f64> {
    let share = |index: usize| index as f64 / (count.max(2) - 1) as f64;
    (0..count).map(|index| low * (high / low).powf(share(index))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Foam;

    #[test]
    fn strengths_are_conductivities_or_newtons() {
        // 1 S/m over 0.5 mm is 2000 S/m2, times 12.566 mm2.
        let contact = Press::PAPER.at([0.01, 0.0], 1.0);
        assert!((contact.conductance_s - 0.025_133).abs() < 1e-6 && contact.radius_m == 0.002);
        let detector = Detector::default();
        let skin: Skin = Foam::of('A').unwrap().into();
        let hertz = Hertz::new(&detector, skin).unwrap();
        let flat = Press::indenter(&detector, skin).unwrap().at(MIDDLE, 1.0);
        assert_eq!((flat.conductance_s, flat.radius_m), (hertz.flat(0.0025, 1.0).conductance_s, 0.0025));
        let ball = Press::indenter(&detector, skin.with(Surface::IDEAL)).unwrap().at(MIDDLE, 1.0);
        assert_eq!(ball.conductance_s, hertz.with(Surface::IDEAL).ball(0.0025, 1.0).conductance_s);
    }

    #[test]
    fn places_are_those_of_the_paper_and_scale() {
        let places = nine_places(&Detector::default());
        assert_eq!(places[4], MIDDLE);
        assert!((places[0][0] + 0.02).abs() < 1e-12 && (places[8][1] - 0.02).abs() < 1e-12);
        let strip = nine_places(&Detector::preset("strip-13x60").unwrap());
        assert!((strip[8][0] - 0.013 / 3.0).abs() < 1e-12 && (strip[8][1] - 0.02).abs() < 1e-12);
    }

    #[test]
    fn decades_have_both_ends() {
        let values = in_decades([0.001, 100.0], 11);
        assert!(
            (values[0] - 0.001).abs() < 1e-15 && (values[10] - 100.0).abs() < 1e-9 && (values[2] - 0.01).abs() < 1e-12
        );
    }
}
