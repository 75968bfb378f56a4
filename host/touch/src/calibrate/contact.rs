//! A press of a rub and the unknowns of its contact.

use nalgebra::DVector;
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;

/// Standard deviation of the logarithm of a contact's radius about the usual one, and of its conductance about where it was found: so wide that
/// hundreds of presses together do not say what all conductances are, which is not known before.
const RADIUS_DEVIATION: f64 = 0.5;
const CONDUCTANCE_DEVIATION: f64 = 30.0;
/// Unknowns of a press.
pub(super) const OF_PRESS: usize = 4;
/// Which of them is the logarithm of the conductance.
pub(super) const CONDUCTANCE: usize = 2;
/// A press: one contact for as long as it stands.
#[derive(Clone, Debug)]
pub(super) struct Press {
    /// Mean readings (V), less the baseline.
    pub readings: Readings,
    /// Standard deviation of each by noise (V).
    pub noise_v: f64,
    /// Where it is known to be (m), and to what standard deviation (m).
    pub known_m: Option<([f64; 2], f64)>,
    /// The contact as it is fitted.
    pub contact: Contact,
    /// Radius and conductance that it is held near to.
    pub usual: Contact,
}

impl Press {
    /// Of each unknown of a contact, how far it is from what is known of it before, in standard deviations, and standard deviations in its unit.
    pub fn prior(&self, contact: &Contact) -> [(f64, f64); OF_PRESS] {
        let log = |value: f64, usual: f64, deviation: f64| ((value / usual).ln() / deviation, 1.0 / deviation);
        let place = |at_m: f64, axis: usize| match self.known_m {
            Some((known_m, deviation_m)) => ((at_m - known_m[axis]) / deviation_m, 1.0 / deviation_m),
            None => (0.0, 0.0),
        };
        [
            place(contact.x_m, 0),
            place(contact.y_m, 1),
            log(contact.conductance_s, self.usual.conductance_s, CONDUCTANCE_DEVIATION),
            log(contact.radius_m, self.usual.radius_m, RADIUS_DEVIATION),
        ]
    }
}

/// Steps for derivatives: of a place (m) and of logarithms.
const STEP_M: f64 = 1e-5;
const STEP_LOG: f64 = 1e-3;

/// A contact by its unknowns: x, y (m), and the logarithms of conductance and radius.
pub(super) trait Moves: Sized {
    fn moved(&self, step: &DVector<f64>, detector: &Detector) -> Self;
    fn neighbours(&self, detector: &Detector) -> [(Self, f64); OF_PRESS];
}

impl Moves for Contact {
    /// Moved by a step, at most a tenth of the detector and a factor of three, and within the detector.
    fn moved(&self, step: &DVector<f64>, detector: &Detector) -> Self {
        let [low, high] = detector.outline.bounds();
        let place = |at_m: f64, axis: usize| {
            let most_m = 0.1 * (high[axis] - low[axis]);
            (at_m + step[axis].clamp(-most_m, most_m)).clamp(low[axis], high[axis])
        };
        Self {
            x_m: place(self.x_m, 0),
            y_m: place(self.y_m, 1),
            conductance_s: self.conductance_s * step[2].clamp(-1.1, 1.1).exp(),
            radius_m: self.radius_m * step[3].clamp(-0.5, 0.5).exp(),
            ..*self
        }
    }

    fn neighbours(&self, detector: &Detector) -> [(Self, f64); OF_PRESS] {
        // Towards the middle, so that they stay on the detector.
        let inward = |at_m: f64, axis: usize| {
            let [low, high] = detector.outline.bounds();
            if at_m > 0.5 * (low[axis] + high[axis]) { -STEP_M } else { STEP_M }
        };
        let (x, y) = (inward(self.x_m, 0), inward(self.y_m, 1));
        [
            (Self { x_m: self.x_m + x, ..*self }, x),
            (Self { y_m: self.y_m + y, ..*self }, y),
            (Self { conductance_s: self.conductance_s * STEP_LOG.exp(), ..*self }, STEP_LOG),
            (Self { radius_m: self.radius_m * STEP_LOG.exp(), ..*self }, STEP_LOG),
        ]
    }
}
