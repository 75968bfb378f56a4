//! Contact mechanics: from a force to the disc or strip of contact that it makes, and back.
//!
//! A rigid tip is pressed on an elastic layer. Its area of contact is Hertz's; the conductance of that area is the paper's
//! eq. (3), `sigma S / l`, with the conductivity `sigma` of the layer's top and the depth `l` of surface that the current
//! has to cross. The paper's eq. (1) is Hertz's *radius* of contact under the name of an area; here the area is `pi a^2`, so
//! the exponent of eq. (2) is 2/3 for a ball and 1/2 for a cylinder. Its eq. (5) hides `sigma / l` in the factor `a`.
//!
//! Sources: K. L. Johnson, *Contact Mechanics* (1985), eqs. (4.22) and (4.43); I. N. Sneddon, Int. J. Eng. Sci. 3 (1965), and
//! E. K. Dimitriadis et al., Biophys. J. 82 (2002), for the limits.

use std::f64::consts::PI;

use crate::detector::{Detector, FOAMS, Foam, Stack};

/// Poisson's ratio where none is given: open-cell foams are near 1/3. The paper gives none.
pub const POISSON: f64 = 0.3;

/// Depth of surface that a contact's current crosses where none is given (m). The paper gives none either; with
/// this one the contact on its sample A is at nine tenths of the drive at 2.1 N under its tip of 5 mm, where its table II has 2.8 N.
pub const SURFACE_DEPTH_M: f64 = 0.5e-3;

/// Contacts are within Hertz's theory up to this share of the tip's radius, and of the layer's thickness.
///
/// At half the tip's radius a ball's contact is 4 % narrower than Hertz's (Sneddon). At half the thickness of a layer on a
/// hard ground it is about a fifth narrower (Dimitriadis et al., for an incompressible layer; foam is nearer to Hertz).
const LARGEST_SHARE: f64 = 0.5;

/// What a detector's layer is to the touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Skin {
    /// Young's modulus (Pa).
    pub young_pa: f64,
    /// Poisson's ratio, -1 to 0.5.
    pub poisson: f64,
    /// Depth of surface that a contact's current crosses (m): `l` of the paper's eq. (3).
    pub surface_depth_m: f64,
}

/// Contact mechanics of a detector.
///
/// ```
/// use tactomo_physics::detector::Detector;
/// use tactomo_physics::hertz::{Hertz, Skin};
///
/// let hertz = Hertz::new(&Detector::default(), Skin::of(0.35e6))?;
/// let [light, firm] = [0.5, 2.0].map(|force_n| hertz.ball(0.01, force_n).half_width_m);
/// // Radii go with the cube root of the force.
/// assert!((firm / light - 4f64.cbrt()).abs() < 1e-9);
/// # Ok::<(), tactomo_physics::hertz::SkinError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hertz {
    plane_modulus_pa: f64,
    thickness_m: f64,
    conductance_s_per_m2: f64,
}

/// Where a tip touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imprint {
    /// Radius of a disc, half the width of a strip (m).
    pub half_width_m: f64,
    /// Conductance of all of it (S).
    pub conductance_s: f64,
    /// The limit of Hertz's theory that it is beyond, if any.
    pub beyond: Option<Beyond>,
}

/// A limit of Hertz's theory. Beyond it contacts are narrower than it says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Beyond {
    /// The contact is wider than half the tip.
    #[error("the contact is wider than half the tip")]
    Tip,
    /// The contact's radius is more than half the thickness of the layer.
    #[error("the contact's radius is more than half the layer's thickness")]
    Thickness,
}

/// Elastic constants that no layer has.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{what} is {value}; it has to be {allowed}")]
pub struct SkinError {
    what: &'static str,
    value: f64,
    allowed: &'static str,
}

impl Skin {
    /// A skin of one Young's modulus (Pa).
    pub fn of(young_pa: f64) -> Self {
        Self { young_pa, poisson: POISSON, surface_depth_m: SURFACE_DEPTH_M }
    }

    /// A skin of layers of such thicknesses (any unit) and Young's moduli (Pa): they give way one after the other, so that their compliances add up.
    pub fn of_layers(layers: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let add = |[thickness, compliance]: [f64; 2], (own, young_pa): (f64, f64)| {
            [thickness + own, compliance + own / young_pa]
        };
        let [thickness, compliance] = layers.into_iter().fold([0.0; 2], add);
        Self::of(thickness / compliance)
    }

    fn check(&self) -> Result<(), SkinError> {
        let wrong = |what, value, allowed| Err(SkinError { what, value, allowed });
        if !(self.young_pa > 0.0 && self.young_pa.is_finite()) {
            return wrong("Young's modulus (Pa)", self.young_pa, "above zero");
        }
        if !(self.poisson > -1.0 && self.poisson <= 0.5) {
            return wrong("Poisson's ratio", self.poisson, "above -1 and at most 0.5");
        }
        if !(self.surface_depth_m > 0.0 && self.surface_depth_m.is_finite()) {
            return wrong("depth of surface (m)", self.surface_depth_m, "above zero");
        }
        Ok(())
    }
}

impl From<Foam> for Skin {
    fn from(foam: Foam) -> Self {
        Self::of(foam.elasticity_pa)
    }
}

impl From<&Stack> for Skin {
    /// Foams of equal thickness.
    fn from(stack: &Stack) -> Self {
        Self::of_layers(stack.foams().iter().map(|foam| (1.0, foam.elasticity_pa)))
    }
}

impl Hertz {
    /// The mechanics of `detector` with such a skin.
    ///
    /// # Errors
    /// [`SkinError`] if a constant is not one of an elastic layer.
    pub fn new(detector: &Detector, skin: Skin) -> Result<Self, SkinError> {
        skin.check()?;
        Ok(Self::under(detector, skin))
    }

    /// The mechanics of `detector` as if it were as soft as the paper's sample A, of which all its demonstrations are.
    pub fn of_sample_a(detector: &Detector) -> Self {
        Self::under(detector, FOAMS[0].into())
    }

    fn under(detector: &Detector, skin: Skin) -> Self {
        let top_s_per_m = detector.layers.last().map_or(0.0, |layer| layer.top_s_per_m);
        Self {
            plane_modulus_pa: skin.young_pa / (1.0 - skin.poisson * skin.poisson),
            thickness_m: detector.thickness_m(),
            conductance_s_per_m2: top_s_per_m / skin.surface_depth_m,
        }
    }

    /// The disc under a ball: `a^3 = 3 F R / (4 E*)` with `E* = E / (1 - nu^2)`. It is never wider than the ball.
    pub fn ball(&self, radius_m: f64, force_n: f64) -> Imprint {
        let hertz_m = (0.75 * force_n * radius_m / self.plane_modulus_pa).cbrt();
        let half_width_m = hertz_m.min(radius_m);
        self.imprint(half_width_m, PI * half_width_m * half_width_m, radius_m)
    }

    /// The strip under a cylinder that lies on its side: `b^2 = 4 F R / (pi E* L)`. It is never wider than the cylinder.
    pub fn cylinder(&self, radius_m: f64, length_m: f64, force_n: f64) -> Imprint {
        let hertz_m = (4.0 * force_n * radius_m / (PI * self.plane_modulus_pa * length_m)).sqrt();
        let half_width_m = hertz_m.min(radius_m);
        self.imprint(half_width_m, 2.0 * half_width_m * length_m, radius_m)
    }

    /// Force under a ball whose contact has that conductance (N): [`ball`](Self::ball) backwards, within the theory's limits.
    pub fn ball_force_n(&self, radius_m: f64, conductance_s: f64) -> f64 {
        let half_width_m = (conductance_s / self.conductance_s_per_m2 / PI).sqrt();
        self.plane_modulus_pa * half_width_m.powi(3) / (0.75 * radius_m)
    }

    fn imprint(&self, half_width_m: f64, area_m2: f64, tip_m: f64) -> Imprint {
        let beyond = if half_width_m > LARGEST_SHARE * tip_m {
            Some(Beyond::Tip)
        } else {
            (half_width_m > LARGEST_SHARE * self.thickness_m).then_some(Beyond::Thickness)
        };
        Imprint { half_width_m, conductance_s: self.conductance_s_per_m2 * area_m2, beyond }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forward::{ForwardModel, Slab};
    use crate::scene::Contact;

    fn sample_a() -> Hertz {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        Hertz::new(&detector, Foam::of('A').unwrap().into()).unwrap()
    }

    #[test]
    fn a_ball_on_sample_a_by_hand() {
        // E* = 0.35 MPa / 0.91 = 384 615 Pa; a^3 = 3 x 1 N x 8 mm / (4 E*) = 1.56e-8 m3; a = 2.4987 mm.
        let imprint = sample_a().ball(0.008, 1.0);
        assert!((imprint.half_width_m - 2.49867e-3).abs() < 1e-7, "{imprint:?}");
        // 0.2273 S/m over 0.5 mm is 454.6 S/m2, times 19.614 mm2.
        assert!((imprint.conductance_s - 8.9165e-3).abs() < 1e-6, "{imprint:?}");
        assert_eq!(imprint.beyond, None);
    }

    #[test]
    fn a_cylinder_on_sample_a_by_hand() {
        // b^2 = 4 x 2 N x 3 mm / (pi E* 40 mm) = 4.9656e-7 m2; b = 0.70467 mm; area 56.374 mm2.
        let imprint = sample_a().cylinder(0.003, 0.04, 2.0);
        assert!((imprint.half_width_m - 7.0467e-4).abs() < 2e-8, "{imprint:?}");
        assert!((imprint.conductance_s - 454.6 * 5.6374e-5).abs() < 1e-6, "{imprint:?}");
    }

    #[test]
    fn sample_a_saturates_near_the_force_of_the_paper() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let imprint = sample_a().ball(0.0025, 2.1);
        let contact = Contact::flat(0.0, 0.0, imprint.half_width_m, imprint.conductance_s);
        let z = Slab::new(&detector).unwrap().impedance_ohm(&[contact]).unwrap();
        // All current goes through the contact: what it takes of the drive, mean over the grounds.
        let share = |g: usize| 1.0 / imprint.conductance_s / (z[(g, g)] + detector.on_resistance_ohm);
        let at_contact = 1.0 - (0..16).map(share).sum::<f64>() / 16.0;
        assert!((at_contact - 0.9).abs() < 0.005, "{at_contact}");
    }

    /// Force of a rigid sphere with a contact of radius `a`, without Hertz's paraboloid (Sneddon 1965).
    fn sneddon_n(plane_modulus_pa: f64, radius_m: f64, a: f64) -> f64 {
        let log = ((radius_m + a) / (radius_m - a)).ln();
        plane_modulus_pa * ((a * a + radius_m * radius_m) / 2.0 * log - a * radius_m)
    }

    #[test]
    fn within_its_limits_a_ball_agrees_with_sneddons_sphere() {
        let hertz = Hertz { thickness_m: 1.0, ..sample_a() };
        for (share, tolerance) in [(0.1, 0.003), (0.3, 0.02), (0.499, 0.04)] {
            let force_n = sneddon_n(hertz.plane_modulus_pa, 0.01, share * 0.01);
            let imprint = hertz.ball(0.01, force_n);
            let error = imprint.half_width_m / (share * 0.01) - 1.0;
            assert!(error > 0.0 && error < tolerance, "{share}: {error}");
        }
        assert_eq!(hertz.ball(0.01, 0.15 * hertz.plane_modulus_pa * 1e-4).beyond, None);
        assert_eq!(hertz.ball(0.01, 0.17 * hertz.plane_modulus_pa * 1e-4).beyond, Some(Beyond::Tip));
    }

    #[test]
    fn contacts_beyond_the_theory_are_flagged_and_no_wider_than_the_tip() {
        let hertz = sample_a();
        assert_eq!(hertz.ball(0.05, 0.2).beyond, Some(Beyond::Thickness));
        let hard = hertz.ball(0.0025, 50.0);
        assert_eq!((hard.half_width_m, hard.beyond), (0.0025, Some(Beyond::Tip)));
        assert_eq!(hertz.cylinder(0.001, 0.01, 100.0).half_width_m, 0.001);
    }

    #[test]
    fn the_force_comes_back_from_the_conductance() {
        let hertz = sample_a();
        for force_n in [1e-6, 0.02, 0.9] {
            let back_n = hertz.ball_force_n(0.006, hertz.ball(0.006, force_n).conductance_s);
            assert!((back_n / force_n - 1.0).abs() < 1e-12, "{force_n} {back_n}");
        }
    }

    #[test]
    fn stacks_are_as_soft_as_springs_one_after_the_other() {
        let stack: Stack = "AB".parse().unwrap();
        assert!((Skin::from(&stack).young_pa - 2.0 / (1.0 / 0.35e6 + 1.0 / 0.96e6)).abs() < 1e-6);
        assert_eq!(Skin::from(&"A".parse::<Stack>().unwrap()).young_pa, 0.35e6);
    }

    #[test]
    fn constants_of_no_layer_are_refused() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        for (skin, named) in [
            (Skin::of(0.0), "Young's modulus"),
            (Skin::of(f64::NAN), "Young's modulus"),
            (Skin { poisson: 0.51, ..Skin::of(1e5) }, "at most 0.5"),
            (Skin { surface_depth_m: -1.0, ..Skin::of(1e5) }, "depth of surface"),
        ] {
            let error = Hertz::new(&detector, skin).unwrap_err().to_string();
            assert!(error.contains(named), "{error}");
        }
    }
}
