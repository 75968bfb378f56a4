//! Contacts that move together on circles, and the voltages on their way.
//!
//! The truth is a [finer model](tactomo_physics::simulate::finer_model) than the one that is inverted. It is asked at places [`STEP_M`] apart on the
//! way round; between them readings are interpolated by cubics through the four nearest, which misses less than a hundredth of a code.

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardError, ForwardModel, readings_v};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;

/// From one place to the next at which the truth is asked, at most (m).
const STEP_M: f64 = 0.5e-3;
/// Radius of the circles, least distance of contacts and of their places from the outline's box, and radii of contacts, in distances
/// of electrodes.
const CIRCLE: f64 = 0.5;
const APART: f64 = 1.0;
const MARGIN: f64 = 0.25;
const RADII: [f64; 2] = [0.15, 0.25];
/// Conductances, in sheet conductances.
const SHEETS: [f64; 2] = [0.1, 1.0];

/// Contacts on their way round.
pub(super) struct Path {
    /// With their places at the centres of their circles.
    contacts: Vec<Contact>,
    circle_m: f64,
    /// Where they start (rad).
    start: f64,
    /// Voltages at places on the way.
    knots: Vec<Readings>,
}

impl Path {
    /// So many contacts on a detector whose electrodes are `spacing_m` (m) apart, chosen by a seed.
    ///
    /// # Errors
    /// [`ForwardError`] if the detector is too small for them.
    pub fn random(truth: &dyn ForwardModel, spacing_m: f64, count: usize, seed: u64) -> Result<Self, ForwardError> {
        let mut random = fastrand::Rng::with_seed(seed);
        let circle_m = CIRCLE * spacing_m;
        let contacts = contacts(truth.detector(), spacing_m, count, &mut random);
        let start = std::f64::consts::TAU * random.f64();
        let mut path = Self { contacts, circle_m, start, knots: Vec::new() };
        let count = (path.round_m() / STEP_M).ceil() as usize;
        let knot = |index: usize| {
            let contacts = path.contacts_at(index as f64 / count as f64 * path.round_m());
            Ok(readings_v(&truth.impedance_ohm(&contacts)?, truth.detector()))
        };
        path.knots = (0..count).map(knot).collect::<Result<_, ForwardError>>()?;
        Ok(path)
    }

    /// Length of the way round (m).
    pub fn round_m(&self) -> f64 {
        std::f64::consts::TAU * self.circle_m
    }

    /// The contacts after so long a way (m).
    pub fn contacts_at(&self, way_m: f64) -> Vec<Contact> {
        let (sin, cos) = (self.start + way_m / self.circle_m).sin_cos();
        let at = |contact: &Contact| Contact {
            x_m: contact.x_m + self.circle_m * cos,
            y_m: contact.y_m + self.circle_m * sin,
            ..*contact
        };
        self.contacts.iter().map(at).collect()
    }

    /// Voltages of the row of ground `g` (V) after so long a way (m).
    pub fn row_v(&self, g: usize, way_m: f64) -> Vec<f64> {
        let count = self.knots.len();
        let at = (way_m / self.round_m()).rem_euclid(1.0) * count as f64;
        let share = at.fract();
        let near: [&Readings; 4] = std::array::from_fn(|k| &self.knots[(at as usize + count + k - 1) % count]);
        let weights = cubic(share);
        (0..near[0].electrodes())
            .map(|e| near.iter().zip(weights).map(|(knot, weight)| weight * knot.at(g, e)).sum())
            .collect()
    }
}

/// Lagrange's weights of values at -1, 0, 1 and 2 for one at `x`.
fn cubic(x: f64) -> [f64; 4] {
    [
        -x * (x - 1.0) * (x - 2.0) / 6.0,
        (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0,
        -(x + 1.0) * x * (x - 2.0) / 2.0,
        (x + 1.0) * x * (x - 1.0) / 6.0,
    ]
}

/// Contacts on a detector, with room for their circles.
fn contacts(detector: &Detector, spacing_m: f64, count: usize, random: &mut fastrand::Rng) -> Vec<Contact> {
    let [low_m, high_m] = detector.outline.bounds();
    let margin_m = (MARGIN + CIRCLE) * spacing_m;
    let mut all: Vec<Contact> = Vec::with_capacity(count);
    let mut apart_m = APART * spacing_m;
    while all.len() < count {
        let [x_m, y_m] = [0, 1].map(|axis| {
            let (middle_m, half_m) =
                (0.5 * (low_m[axis] + high_m[axis]), 0.5 * (high_m[axis] - low_m[axis]) - margin_m);
            middle_m + half_m.max(0.0) * (2.0 * random.f64() - 1.0)
        });
        let radius_m = spacing_m * (RADII[0] + (RADII[1] - RADII[0]) * random.f64());
        let sheets = SHEETS[0] * (SHEETS[1] / SHEETS[0]).powf(random.f64());
        match all.iter().all(|other| (other.x_m - x_m).hypot(other.y_m - y_m) > apart_m) {
            true => all.push(Contact::flat(x_m, y_m, radius_m, sheets * detector.sheet_conductance_s())),
            // A small detector has no room for so many: then they are nearer.
            false => apart_m *= 0.99,
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::simulate::finer_model;

    #[test]
    fn voltages_between_places_are_those_of_the_model() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let truth = finer_model(&detector, &[], 0).unwrap();
        let path = Path::random(&*truth, 0.015, 2, 3).unwrap();
        let apart_m =
            |contacts: &[Contact]| (contacts[0].x_m - contacts[1].x_m).hypot(contacts[0].y_m - contacts[1].y_m);
        assert!((apart_m(&path.contacts_at(0.0)) - apart_m(&path.contacts_at(0.02))).abs() < 1e-9);
        for way_m in [0.00026, 0.0172, 0.0471, 0.2] {
            let exact = readings_v(&truth.impedance_ohm(&path.contacts_at(way_m)).unwrap(), &detector);
            let off_v = (0..16).flat_map(|g| path.row_v(g, way_m).into_iter().enumerate().map(move |(e, v)| (g, e, v)));
            let worst_v = off_v.map(|(g, e, volts)| (volts - exact.at(g, e)).abs()).fold(0.0, f64::max);
            assert!(worst_v < 0.01 * detector.adc.lsb_v(), "{worst_v} V off at {way_m} m");
        }
    }
}
