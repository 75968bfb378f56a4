//! What presses in a scene, and how hard.

#[cfg(doc)]
use super::SceneName;
use super::{Shape, Touch};
use crate::detector::Detector;
use crate::geometry::Point;
use crate::hertz::{Beyond, Hertz, Imprint, Surface};

/// Fingertips of a hand laid down: from the middle finger's root, in shares of the shorter side, thumb first.
pub(super) const FINGERTIPS: [Point; 5] = [[-0.30, -0.12], [-0.20, 0.20], [-0.02, 0.28], [0.14, 0.22], [0.29, 0.05]];

/// Conductance of a press of firmness 1, in sheet conductances: well beyond where the linear theory ends.
const FIRMEST: f64 = 2.0;
/// Radius of that press, as a share of the detector's shorter side.
const RADIUS_SHARE: f64 = 0.045;
/// Width of a strip of firmness 1, as a share of the detector's shorter side.
const STRIP_SHARE: f64 = 0.05;
/// A press shorter than this share of the firmest is no press.
pub(super) const LIGHTEST: f64 = 1e-3;
/// Radius of a human fingertip (m), and the largest share of the detector's shorter side that one of a scene has.
const FINGERTIP_M: f64 = 0.008;
const FINGERTIP_SHARE: f64 = 1.0 / 7.0;

/// Turns the firmness of a scene's presses, 0 to 1, into touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hand {
    shorter_m: f64,
    sheet_conductance_s: f64,
    hertz: Hertz,
    fingertip: Option<Fingertip>,
}

/// A hand that presses in newtons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fingertip {
    /// Mechanics of the detector under it.
    pub hertz: Hertz,
    /// Force of a press of firmness 1 (N).
    pub force_n: f64,
    /// Radius of a tip, and of the bar that a line or a ring is pressed with (m).
    pub radius_m: f64,
}

impl Fingertip {
    /// Radius of a fingertip that fits a detector (m): a human one, or a smaller one.
    pub fn fitting_m(detector: &Detector) -> f64 {
        FINGERTIP_M.min(FINGERTIP_SHARE * shorter_m(detector))
    }
}

impl Hand {
    /// A hand without newtons, the same on any detector: conductances relative to its sheet conductance, radii to its size.
    /// A disc's radius grows as the cube root of firmness, a strip's width as the square root, as under Hertz.
    pub fn relative(detector: &Detector) -> Self {
        Self {
            shorter_m: shorter_m(detector),
            sheet_conductance_s: detector.sheet_conductance_s(),
            hertz: Hertz::of_sample_a(detector).with(Surface::IDEAL),
            fingertip: None,
        }
    }

    /// This hand on a detector of such mechanics, for [demonstrations](SceneName::detector), which always press in newtons.
    pub fn on(self, hertz: Hertz) -> Self {
        Self { hertz, ..self }
    }

    /// A hand that presses in newtons.
    pub fn in_newtons(detector: &Detector, fingertip: Fingertip) -> Self {
        Self { hertz: fingertip.hertz, fingertip: Some(fingertip), ..Self::relative(detector) }
    }

    /// Mechanics of the detector: of an ideal sample A unless given.
    pub(super) fn hertz(&self) -> Hertz {
        self.hertz
    }

    /// Force of a press of firmness 1 (N), if it presses in newtons.
    pub(super) fn force_n(&self) -> Option<f64> {
        self.fingertip.map(|fingertip| fingertip.force_n)
    }

    /// The touch of a tip `breadth` times as wide as a finger's. (Under a force, a ball's contact is as wide as the cube root of
    /// its radius, so the ball's radius is the cube of that.)
    pub fn tip(&self, centre_m: Point, firmness: f64, breadth: f64) -> Touch {
        let firmness = firmness.clamp(LIGHTEST, 1.0);
        let (radius_m, conductance_s) = match self.tip_imprint(firmness, breadth) {
            Some(imprint) => (imprint.half_width_m, imprint.conductance_s),
            None => (
                breadth * RADIUS_SHARE * self.shorter_m * firmness.cbrt(),
                FIRMEST * self.sheet_conductance_s * firmness,
            ),
        };
        Touch::flat(centre_m, Shape::Disc { radius_m }, conductance_s)
    }

    /// The touch of a round bar that lies straight on the detector.
    pub fn line(&self, centre_m: Point, firmness: f64, length_m: f64, angle_rad: f64) -> Touch {
        let (width_m, conductance_s) = self.strip(firmness, length_m);
        Touch::flat(centre_m, Shape::Line { length_m, width_m, angle_rad }, conductance_s)
    }

    /// The touch of a round bar bent to a circle, or of the rim of a cup: locally the contact of a straight one.
    pub fn ring(&self, centre_m: Point, firmness: f64, radius_m: f64) -> Touch {
        let (width_m, conductance_s) = self.strip(firmness, std::f64::consts::TAU * radius_m);
        Touch::flat(centre_m, Shape::Ring { radius_m, width_m: width_m.min(radius_m) }, conductance_s)
    }

    /// The limit of Hertz's theory that a tip's touch is beyond, if it is.
    pub fn beyond(&self, firmness: f64, breadth: f64) -> Option<Beyond> {
        self.tip_imprint(firmness, breadth)?.beyond
    }

    fn tip_imprint(&self, firmness: f64, breadth: f64) -> Option<Imprint> {
        let Fingertip { hertz, force_n, radius_m } = self.fingertip?;
        Some(hertz.ball(radius_m * breadth.powi(3), force_n * firmness))
    }

    /// Width (m) and conductance (S).
    fn strip(&self, firmness: f64, length_m: f64) -> (f64, f64) {
        let firmness = firmness.clamp(LIGHTEST, 1.0);
        match self.fingertip {
            Some(Fingertip { hertz, force_n, radius_m }) => {
                let imprint = hertz.cylinder(radius_m, length_m, force_n * firmness);
                (2.0 * imprint.half_width_m, imprint.conductance_s)
            }
            None => (STRIP_SHARE * self.shorter_m * firmness.sqrt(), FIRMEST * self.sheet_conductance_s * firmness),
        }
    }
}

fn shorter_m(detector: &Detector) -> f64 {
    let [width_m, height_m] = detector.outline.size_m();
    width_m.min(height_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detector::Foam;
    use crate::hertz::Skin;

    fn newtons(force_n: f64) -> Hand {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let hertz = Hertz::new(&detector, Skin::from(Foam::of('A').unwrap())).unwrap();
        let radius_m = Fingertip::fitting_m(&detector);
        Hand::in_newtons(&detector, Fingertip { hertz, force_n, radius_m })
    }

    #[test]
    fn force_spreads_a_tip_as_its_cube_root_and_a_film_conducts_as_its_power_of_five_thirds() {
        let [light, firm] = [0.1, 0.8].map(|firmness| newtons(1.0).tip([0.0; 2], firmness, 1.0).disc().unwrap());
        assert!((firm.radius_m / light.radius_m - 2.0).abs() < 1e-12);
        assert!((firm.conductance_s / light.conductance_s - 32.0).abs() < 1e-9);
        let wide = newtons(1.0).tip([0.0; 2], 0.1, 3.0).disc().unwrap();
        assert!((wide.radius_m / light.radius_m - 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_bar_bent_to_a_circle_conducts_as_a_straight_one_of_its_length() {
        let line = newtons(2.0).line([0.0; 2], 0.5, 0.04, 0.3);
        let ring = newtons(2.0).ring([0.0; 2], 0.5, 0.04 / std::f64::consts::TAU);
        assert!((line.conductance_s / ring.conductance_s - 1.0).abs() < 1e-12);
        assert!((line.area_m2() / ring.area_m2() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_hand_without_newtons_scales_with_the_detector() {
        let [small, large] = ["fingertip-10", "square-150"].map(|name| {
            let detector = Detector::preset(name).unwrap();
            let contact = Hand::relative(&detector).tip([0.0; 2], 0.4, 1.0).disc().unwrap();
            (contact.radius_m / shorter_m(&detector), contact.conductance_s / detector.sheet_conductance_s())
        });
        assert!((small.0 - large.0).abs() < 1e-12 && (small.1 - large.1).abs() < 1e-12);
    }

    #[test]
    fn a_press_beyond_hertz_is_reported() {
        assert_eq!(newtons(0.5).beyond(1.0, 1.0), None);
        assert_eq!(newtons(5.0).beyond(1.0, 1.0), Some(Beyond::Tip));
    }
}
