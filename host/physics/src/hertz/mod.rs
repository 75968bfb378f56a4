//! Contact mechanics: from a force to the disc or strip of contact that it makes, and back.
//!
//! A rigid tip is pressed on an elastic layer. Its area of contact and the pressure over it are Hertz's; what that conducts is the
//! [surface](Surface)'s. The paper's eq. (1) is Hertz's *radius* of contact under the name of an area; here the area is `pi a^2`. Where
//! all of it conducts alike, the exponent of eq. (2) is 2/3 for a ball and 1/2 for a cylinder; on a film that conducts as the cube of the
//! pressure it is 5/3 and 2. The paper's eq. (5) hides `sigma / l` in the factor `a`.
//!
//! A contact that conducts unevenly is given as the even disc or strip of its conductance and its second moment, which is all that readings
//! tell of it.
//!
//! Sources: K. L. Johnson, *Contact Mechanics* (1985), eqs. (4.22) and (4.43); I. N. Sneddon, Int. J. Eng. Sci. 3 (1965), and
//! E. K. Dimitriadis et al., Biophys. J. 82 (2002), for the limits.

mod skin;
mod surface;

use std::f64::consts::PI;
use std::ops::RangeInclusive;

pub use self::skin::{POISSON, RATIO, Skin, YOUNG_PA};
pub use self::surface::{SURFACE_DEPTH_M, Surface};
use crate::detector::{Detector, FOAMS, Problem};

/// Contacts are within Hertz's theory up to this share of the tip's radius, and of the layer's thickness.
///
/// At half the tip's radius a ball's contact is 4 % narrower than Hertz's (Sneddon). At half the thickness of a layer on a
/// hard ground it is about a fifth narrower (Dimitriadis et al., for an incompressible layer; foam is nearer to Hertz).
const LARGEST_SHARE: f64 = 0.5;

/// Forces that something presses with (N): from a grain of sand's to a car's on its wheel.
pub const FORCE_N: RangeInclusive<f64> = 1e-6..=1e4;
/// Radii of tips that press (m): from a needle's to a head's.
pub const TIP_M: RangeInclusive<f64> = 1e-5..=1.0;
/// A press that nothing presses with.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "a press needs a tip with a radius from {:?} m to {:?} m, and a force from {:?} N to {:?} N: {radius_m:?} m and {force_n:?} N are given",
    TIP_M.start(), TIP_M.end(), FORCE_N.start(), FORCE_N.end()
)]
pub struct PressError {
    /// Radius of the tip (m).
    pub radius_m: f64,
    /// Force (N).
    pub force_n: f64,
}

/// Checks that something may press so.
///
/// # Errors
/// [`PressError`] if it is too small or too large.
pub fn check_press(radius_m: f64, force_n: f64) -> Result<(), PressError> {
    if TIP_M.contains(&radius_m) && FORCE_N.contains(&force_n) { Ok(()) } else { Err(PressError { radius_m, force_n }) }
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
/// # Ok::<(), tactomo_physics::detector::Problem>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hertz {
    plane_modulus_pa: f64,
    thickness_m: f64,
    top_s_per_m: f64,
    surface: Surface,
}

/// What presses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tip {
    /// A ball, or a tip that is as round where it touches.
    Ball {
        /// Its radius (m).
        radius_m: f64,
    },
    /// A flat punch.
    Flat {
        /// Its radius (m).
        radius_m: f64,
    },
}

/// Where a tip touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imprint {
    /// Radius of a disc, half the width of a strip (m): of the even one that conducts as much and is as wide in the mean of the squares.
    pub half_width_m: f64,
    /// Conductance of all of it (S).
    pub conductance_s: f64,
    /// The limit of Hertz's theory that it is beyond, if any.
    pub beyond: Option<Beyond>,
}

/// A limit of Hertz's theory. Beyond it contacts are narrower than it says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
pub enum Beyond {
    /// The contact is wider than half the tip.
    #[error("the contact is wider than half the tip")]
    Tip,
    /// The contact's radius is more than half the thickness of the layer.
    #[error("the contact's radius is more than half the layer's thickness")]
    Thickness,
}

impl Tip {
    /// The power of the force that the conductance of its contact is in proportion to.
    pub fn exponent(self, surface: Surface) -> f64 {
        // The area goes with F^(2/3) or stays, the pressure is the force over it.
        let area = match self {
            Self::Ball { .. } => 2.0 / 3.0,
            Self::Flat { .. } => 0.0,
        };
        match surface {
            Surface::Ideal { .. } => area,
            Surface::Film { .. } => area + 3.0 * (1.0 - area),
        }
    }
}

impl Hertz {
    /// The mechanics of `detector` with such a skin.
    ///
    /// # Errors
    /// [`Problem`] if a constant is not one of an elastic layer.
    pub fn new(detector: &Detector, skin: Skin) -> Result<Self, Problem> {
        skin.check()?;
        Ok(Self::under(detector, skin))
    }

    /// The mechanics of `detector` as if it were as soft as the paper's sample A, of which all its demonstrations are.
    pub fn of_sample_a(detector: &Detector) -> Self {
        Self::under(detector, FOAMS[0].into())
    }

    /// The same mechanics on another surface.
    #[must_use]
    pub fn with(self, surface: Surface) -> Self {
        Self { surface, ..self }
    }

    fn under(detector: &Detector, skin: Skin) -> Self {
        Self {
            plane_modulus_pa: skin.young_pa / (1.0 - skin.poisson * skin.poisson),
            thickness_m: detector.thickness_m(),
            top_s_per_m: detector.layers.last().map_or(0.0, |layer| layer.top_s_per_m),
            surface: skin.surface,
        }
    }

    /// The disc under a ball: `a^3 = 3 F R / (4 E*)` with `E* = E / (1 - nu^2)`. It is never wider than the ball.
    ///
    /// The pressure is `p sqrt(1 - r^2 / a^2)` with `p = 3 F / (2 pi a^2)`. Its cube over the disc is `2 pi a^2 p^3 / 5`, of which the mean of `r^2` is `2 a^2 / 7`.
    pub fn ball(&self, radius_m: f64, force_n: f64) -> Imprint {
        let hertz_m = (0.75 * force_n * radius_m / self.plane_modulus_pa).cbrt();
        let half_width_m = hertz_m.min(radius_m);
        let area_m2 = PI * half_width_m * half_width_m;
        let beyond = self.beyond(half_width_m, radius_m);
        self.imprint(half_width_m, area_m2, 1.5 * force_n / area_m2, [(4.0_f64 / 7.0).sqrt(), 0.4], beyond)
    }

    /// The strip under a cylinder that lies on its side: `b^2 = 4 F R / (pi E* L)`. It is never wider than the cylinder.
    ///
    /// The pressure is `p sqrt(1 - x^2 / b^2)` with `p = 2 F / (pi b L)`. Its cube over the strip is `3 pi b L p^3 / 8`, of which the mean of `x^2` is `b^2 / 6`.
    pub fn cylinder(&self, radius_m: f64, length_m: f64, force_n: f64) -> Imprint {
        let hertz_m = (4.0 * force_n * radius_m / (PI * self.plane_modulus_pa * length_m)).sqrt();
        let half_width_m = hertz_m.min(radius_m);
        let area_m2 = 2.0 * half_width_m * length_m;
        let beyond = self.beyond(half_width_m, radius_m);
        self.imprint(half_width_m, area_m2, 4.0 / PI * force_n / area_m2, [0.5_f64.sqrt(), 3.0 * PI / 16.0], beyond)
    }

    /// The disc under a flat punch, at one pressure all over: that of a foam, which gives way at the edge, where a hard layer's pressure would be without bounds.
    pub fn flat(&self, radius_m: f64, force_n: f64) -> Imprint {
        let area_m2 = PI * radius_m * radius_m;
        self.imprint(radius_m, area_m2, force_n / area_m2, [1.0; 2], None)
    }

    /// The contact under a tip.
    pub fn tip(&self, tip: Tip, force_n: f64) -> Imprint {
        match tip {
            Tip::Ball { radius_m } => self.ball(radius_m, force_n),
            Tip::Flat { radius_m } => self.flat(radius_m, force_n),
        }
    }

    /// Force under a ball whose contact has that conductance (N): [`ball`](Self::ball) backwards, within the theory's limits.
    pub fn ball_force_n(&self, radius_m: f64, conductance_s: f64) -> f64 {
        let tip = Tip::Ball { radius_m };
        (conductance_s / self.conductance_at_1_n_s(tip)).powf(1.0 / tip.exponent(self.surface))
    }

    /// Pressure at which a film conducts 1 S/m2 (Pa), if contacts under such a tip conduct `conductance_at_1_n_s` times the force to the power of
    /// [`Tip::exponent`].
    pub fn film_unit_pa(&self, tip: Tip, conductance_at_1_n_s: f64) -> f64 {
        (self.with(Surface::Film { unit_pa: 1.0 }).conductance_at_1_n_s(tip) / conductance_at_1_n_s).cbrt()
    }

    /// The factor of the power of the force (S) that the conductance is within the theory's limits.
    fn conductance_at_1_n_s(&self, tip: Tip) -> f64 {
        let (Tip::Ball { radius_m } | Tip::Flat { radius_m }) = tip;
        // So light a press that it is within all limits.
        let light_n = 1e-9 * self.plane_modulus_pa * radius_m * radius_m;
        self.tip(tip, light_n).conductance_s / light_n.powf(tip.exponent(self.surface))
    }

    /// What a contact of such a half width, area and largest pressure is on this surface; `of_film` are the shares of the half width and of the conductance under
    /// that pressure all over that are left where the cube of the pressure conducts.
    fn imprint(
        &self,
        half_width_m: f64,
        area_m2: f64,
        pressure_pa: f64,
        of_film: [f64; 2],
        beyond: Option<Beyond>,
    ) -> Imprint {
        let [width_share, share] = match self.surface {
            Surface::Ideal { .. } => [1.0; 2],
            Surface::Film { .. } => of_film,
        };
        let conductance_s = self.surface.s_per_m2(pressure_pa, self.top_s_per_m) * area_m2 * share;
        Imprint { half_width_m: half_width_m * width_share, conductance_s, beyond }
    }

    /// The limit of Hertz's theory that a contact is beyond.
    fn beyond(&self, half_width_m: f64, tip_m: f64) -> Option<Beyond> {
        if half_width_m > LARGEST_SHARE * tip_m {
            Some(Beyond::Tip)
        } else {
            (half_width_m > LARGEST_SHARE * self.thickness_m).then_some(Beyond::Thickness)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Foam;
    use crate::forward::{ForwardModel, Slab};
    use crate::scene::Contact;

    fn measured_a() -> Hertz {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        Hertz::new(&detector, Foam::of('A').unwrap().into()).unwrap()
    }

    fn sample_a() -> Hertz {
        measured_a().with(Surface::IDEAL)
    }

    /// What pieces of a contact conduct, and their mean square from the middle: by the midpoint rule over the pressure, piece by piece.
    fn summed(hertz: &Hertz, half_m: f64, pressure_pa: f64, area_m2: impl Fn(f64) -> f64) -> [f64; 2] {
        let steps = 20_000;
        let mut sums = [0.0; 2];
        for step in 0..steps {
            let share = (f64::from(step) + 0.5) / f64::from(steps);
            let here_pa = pressure_pa * (1.0 - share * share).sqrt();
            let own_s = hertz.surface.s_per_m2(here_pa, 0.2273) * area_m2(share) * half_m / f64::from(steps);
            sums[0] += own_s;
            sums[1] += own_s * (share * half_m).powi(2);
        }
        [sums[0], sums[1] / sums[0]]
    }

    #[test]
    fn on_a_film_a_ball_and_a_rod_conduct_what_their_pieces_do() {
        let hertz = measured_a();
        let ball = hertz.ball(0.008, 1.0);
        let a_m: f64 = 2.498_67e-3;
        let [sum_s, square_m2] = summed(&hertz, a_m, 1.5 / (PI * a_m * a_m), |share| 2.0 * PI * share * a_m);
        assert!((ball.conductance_s / sum_s - 1.0).abs() < 1e-4, "{ball:?} {sum_s}");
        // An even disc's mean square is half of its radius squared.
        assert!((ball.half_width_m.powi(2) / 2.0 / square_m2 - 1.0).abs() < 1e-4, "{ball:?}");
        let rod = hertz.cylinder(0.003, 0.04, 2.0);
        let b_m = 7.0467e-4;
        let [sum_s, square_m2] = summed(&hertz, b_m, 4.0 / (PI * b_m * 0.04), |_| 2.0 * 0.04);
        assert!((rod.conductance_s / sum_s - 1.0).abs() < 1e-4, "{rod:?} {sum_s}");
        // And an even strip's a third of its half width squared.
        assert!((rod.half_width_m.powi(2) / 3.0 / square_m2 - 1.0).abs() < 1e-4, "{rod:?}");
    }

    #[test]
    fn a_flat_punch_on_a_film_conducts_as_the_cube_of_its_force_whatever_the_foam_does() {
        let hertz = measured_a();
        let [light, firm] = [1.0, 2.0].map(|force_n| hertz.flat(0.0025, force_n));
        assert!((firm.conductance_s / light.conductance_s - 8.0).abs() < 1e-9 && firm.half_width_m == 0.0025);
        let better = Hertz { top_s_per_m: 100.0, ..hertz };
        assert_eq!(better.flat(0.0025, 1.0), light);
        // 2 N on 19.635 mm2 are 101.86 kPa; 80.90 kPa conduct 1 S/m2 on 0.35 MPa: sqrt(18.7 kJ/m3 x 0.35 MPa).
        assert!((firm.conductance_s - 1.9960 * 19.635e-6).abs() < 1e-8, "{firm:?}");
        // Where all conducts alike, the force under a flat punch tells nothing.
        assert_eq!(sample_a().flat(0.0025, 1.0), sample_a().flat(0.0025, 2.0));
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
    fn an_ideal_sample_a_saturates_at_2_1_n_under_a_ball() {
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
        for (hertz, force_n) in
            [sample_a(), measured_a()].into_iter().flat_map(|one| [1e-6, 0.02, 0.9].map(|n| (one, n)))
        {
            let back_n = hertz.ball_force_n(0.006, hertz.ball(0.006, force_n).conductance_s);
            assert!((back_n / force_n - 1.0).abs() < 1e-12, "{force_n} {back_n}");
        }
    }

    #[test]
    fn a_film_is_known_by_what_it_conducts_at_1_n() {
        // 1 N on 19.635 mm2 are 50.93 kPa, of a film of 80.90 kPa 0.24949 S/m2.
        let flat = Tip::Flat { radius_m: 0.0025 };
        let found_pa = measured_a().film_unit_pa(flat, 0.24949 * 19.635e-6);
        assert!((found_pa / 80.901e3 - 1.0).abs() < 1e-4, "{found_pa}");
        // The ball of 8 mm of the tests of commands: 6.6273 uS at 1 N.
        let found_pa = sample_a().film_unit_pa(Tip::Ball { radius_m: 0.008 }, 6.6273e-6);
        assert!((found_pa / 80.901e3 - 1.0).abs() < 1e-4, "{found_pa}");
        let ideal = |tip: Tip| tip.exponent(Surface::IDEAL);
        assert_eq!((ideal(flat), ideal(Tip::Ball { radius_m: 0.008 })), (0.0, 2.0 / 3.0));
    }
}
