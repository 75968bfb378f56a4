//! Scenes by name: what touches a detector at any moment, the same for the same seed.

use std::f64::consts::TAU;

use super::demonstration::Demonstration;
use super::hand::{FINGERTIPS, LIGHTEST};
use super::name::SceneName;
use super::{Contact, Hand, Touch};
use crate::detector::{Detector, Outline, Surface};
use crate::geometry::{self, Point};

/// Seconds between two presses of a contact that comes and goes.
const PRESS_PERIOD_S: f64 = 2.7;
/// Seconds that the wandering contact takes across and back, in x and in y: not in step, so that it comes everywhere.
const WANDER_PERIOD_S: [f64; 2] = [11.3, 7.9];
/// Seconds of a round of the moving contact, and of the ball across and back, in x and in y.
const ROUND_PERIOD_S: f64 = 4.0;
const ROLL_PERIOD_S: [f64; 2] = [6.1, 8.7];
/// How far scenes reach from the middle, as a share of half the side.
const REACH: f64 = 0.78;
/// How far apart the contacts of a scene are, at least, as a share of the shorter side.
const APART: f64 = 0.3;
/// Contacts of the scene of several.
const SEVERAL: usize = 3;
/// Firmness of a steady press: with no newtons, 0.6 sheet conductances.
const STEADY: f64 = 0.3;
/// How much broader a wide contact is than a finger's.
const WIDE: f64 = 5.0;
/// Places tried before a scene gives up to find one inside the outline.
const TRIES: usize = 1000;

/// What touches a detector, moment by moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    name: SceneName,
    hand: Hand,
    half_size_m: [f64; 2],
    places: Vec<Point>,
    phase: f64,
    demonstration: Option<Demonstration>,
    /// Where places of the map are, on a curved detector.
    surface: Option<Surface>,
}

impl Scene {
    /// A scene on `detector`, pressed by `hand`. `seed` chooses places and phase.
    pub fn new(name: SceneName, detector: &Detector, hand: Hand, seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let count = match name {
            SceneName::Several => SEVERAL,
            SceneName::Single | SceneName::ChangingForce => 1,
            _ => 0,
        };
        let half_size_m = detector.outline.size_m().map(|side_m| side_m / 2.0);
        let places = places(&detector.outline, half_size_m, count, &mut random);
        let phase = TAU * random.f64();
        let demonstration = Demonstration::new(name, detector, &hand, phase);
        Self { name, hand, half_size_m, places, phase, demonstration, surface: detector.surface.clone() }
    }

    /// Its name.
    pub fn name(&self) -> SceneName {
        self.name
    }

    /// The hand that presses.
    pub fn hand(&self) -> &Hand {
        &self.hand
    }

    /// All that touches at `time_s` seconds after the start. Parts of it may lie beside a detector that is no rectangle. On a curved one,
    /// what touches beside its map is left out, and so is all that is not a disc.
    pub fn at(&self, time_s: f64) -> Vec<Touch> {
        match &self.surface {
            Some(surface) => self.on_map(time_s).into_iter().filter_map(|touch| raised(touch, surface)).collect(),
            None => self.on_map(time_s),
        }
    }

    fn on_map(&self, time_s: f64) -> Vec<Touch> {
        let one = |touch: Touch| vec![touch];
        match self.name {
            SceneName::Rest => Vec::new(),
            SceneName::Wandering => self.pressed(self.path_m(WANDER_PERIOD_S, time_s), time_s),
            SceneName::Single | SceneName::Several => self.steady(),
            SceneName::Wide => one(self.hand.tip(self.off_middle_m(0.15), STEADY, WIDE)),
            SceneName::Ring => one(self.hand.ring(self.off_middle_m(0.15), 1.0, 0.22 * self.shorter_m())),
            SceneName::Line => {
                one(self.hand.line(self.off_middle_m(0.1), 1.0, 0.6 * self.shorter_m(), 1.3 * self.phase))
            }
            SceneName::FiveFingers => self.fingers(time_s),
            SceneName::RollingBall => one(self.hand.tip(self.path_m(ROLL_PERIOD_S, time_s), STEADY, 1.5)),
            SceneName::Moving => one(self.hand.tip(self.round_m(time_s), STEADY, 1.0)),
            SceneName::ChangingForce => self.places.iter().flat_map(|place| self.pressed(*place, time_s)).collect(),
            SceneName::Gripper | SceneName::Display | SceneName::Pointer | SceneName::Texture | SceneName::Hand => {
                self.demonstration.map(|demonstration| demonstration.at(time_s)).unwrap_or_default()
            }
        }
    }

    fn shorter_m(&self) -> f64 {
        2.0 * self.half_size_m[0].min(self.half_size_m[1])
    }

    /// A place near the middle, at that share of the half size.
    fn off_middle_m(&self, share: f64) -> Point {
        let direction = self.phase.sin_cos();
        [share * self.half_size_m[0] * direction.1, share * self.half_size_m[1] * direction.0]
    }

    /// Steady contacts, each two thirds as firm as the one before.
    fn steady(&self) -> Vec<Touch> {
        let firmness = |index: usize| STEADY * (2.0f64 / 3.0).powi(index as i32);
        self.places.iter().enumerate().map(|(index, place)| self.hand.tip(*place, firmness(index), 1.0)).collect()
    }

    /// A contact that presses and lifts: the fourth power rests long at nothing, rises smoothly and is lifted as smoothly.
    fn pressed(&self, place_m: Point, time_s: f64) -> Vec<Touch> {
        let firmness = (TAU * time_s / PRESS_PERIOD_S / 2.0).sin().powi(4);
        if firmness > LIGHTEST { vec![self.hand.tip(place_m, firmness, 1.0)] } else { Vec::new() }
    }

    /// Five fingers, slightly turned, whose weight goes from one to the next.
    fn fingers(&self, time_s: f64) -> Vec<Touch> {
        let (sin, cos) = (0.15 * self.phase.sin()).sin_cos();
        let finger = |(index, [x, y]): (usize, Point)| {
            let turned = [x * cos - y * sin, x * sin + y * cos].map(|share| share * self.shorter_m());
            let turn = TAU * (time_s / ROUND_PERIOD_S - index as f64 / FINGERTIPS.len() as f64);
            self.hand.tip(turned, STEADY * (0.6 + 0.4 * turn.sin()), 0.8)
        };
        FINGERTIPS.into_iter().enumerate().map(finger).collect()
    }

    /// To and fro in x and y.
    fn path_m(&self, period_s: [f64; 2], time_s: f64) -> Point {
        let at = |axis: usize| (TAU * time_s / period_s[axis] + axis as f64 + self.phase).sin();
        [0, 1].map(|axis| REACH * self.half_size_m[axis] * at(axis))
    }

    /// On an ellipse.
    fn round_m(&self, time_s: f64) -> Point {
        let (sin, cos) = (TAU * time_s / ROUND_PERIOD_S + self.phase).sin_cos();
        [0.6 * self.half_size_m[0] * cos, 0.6 * self.half_size_m[1] * sin]
    }
}

/// Places within an outline and apart, as far as there is room.
fn places(outline: &Outline, half_size_m: [f64; 2], count: usize, random: &mut fastrand::Rng) -> Vec<Point> {
    let apart_m = APART * 2.0 * half_size_m[0].min(half_size_m[1]);
    let mut places: Vec<Point> = Vec::new();
    for _ in 0..TRIES {
        if places.len() == count {
            break;
        }
        let place = half_size_m.map(|half_m| REACH * half_m * (2.0 * random.f64() - 1.0));
        let is_free = places.iter().all(|other| geometry::distance(place, *other) > apart_m);
        if is_free && is_on(outline, place) {
            places.push(place);
        }
    }
    places
}

/// A disc of the map where it is in space.
fn raised(touch: Touch, surface: &Surface) -> Option<Touch> {
    let [x_m, y_m, z_m] = surface.place_m(touch.centre_m)?;
    touch.disc().map(|disc| Touch::from(Contact { x_m, y_m, z_m, ..disc }))
}

fn is_on(outline: &Outline, place: Point) -> bool {
    geometry::is_inside(place, &outline.outer) && !outline.holes.iter().any(|hole| geometry::is_inside(place, hole))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(name: SceneName, detector: &str, seed: u64) -> Scene {
        let detector = Detector::preset(detector).unwrap();
        Scene::new(name, &detector, Hand::relative(&detector), seed)
    }

    #[test]
    fn every_scene_stays_on_every_detector() {
        for (preset, name) in Detector::preset_names().flat_map(|preset| SceneName::ALL.map(|name| (preset, name))) {
            let [width_m, height_m] = Detector::preset(preset).unwrap().outline.size_m();
            let inside = |[x, y]: Point| x.abs() < width_m / 2.0 && y.abs() < height_m / 2.0;
            for seed in 0..5 {
                let scene = scene(name, preset, seed);
                let corners = (0..60).flat_map(|i| scene.at(f64::from(i) * 0.37)).flat_map(|touch| touch.pieces());
                assert!(corners.flatten().all(inside), "{name} on {preset}");
            }
        }
    }

    #[test]
    fn on_a_curved_detector_scenes_touch_the_surface() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/detectors/fingertip.toml");
        let detector = Detector::read(file.as_ref()).unwrap();
        let surface = detector.surface.as_ref().unwrap();
        for (name, touches) in [(SceneName::RollingBall, 1), (SceneName::FiveFingers, 5), (SceneName::Several, 3)] {
            let found = Scene::new(name, &detector, Hand::relative(&detector), 1).at(1.0);
            assert!(!found.is_empty() && found.len() <= touches, "{name}: {found:?}");
            for Touch { centre_m: [x_m, y_m], z_m, .. } in found {
                let foot = surface.nearest([x_m, y_m, z_m]);
                assert!(crate::space::distance(foot.place_m, [x_m, y_m, z_m]) < 1e-6, "{name}");
            }
        }
    }

    #[test]
    fn a_scene_repeats_with_its_seed_and_another_seed_differs() {
        for name in SceneName::ALL {
            let at = |seed| scene(name, Detector::DEFAULT, seed).at(0.9);
            assert_eq!(at(5), at(5), "{name}");
            assert!(at(5) != at(6) || name == SceneName::Rest, "{name}");
        }
    }

    #[test]
    fn scenes_have_what_their_names_say() {
        let at = |name, time_s| scene(name, Detector::DEFAULT, 1).at(time_s);
        for (name, count) in [
            (SceneName::Rest, 0),
            (SceneName::Single, 1),
            (SceneName::Several, 3),
            (SceneName::Ring, 1),
            (SceneName::Line, 1),
            (SceneName::FiveFingers, 5),
            (SceneName::RollingBall, 1),
        ] {
            assert_eq!(at(name, 1.0).len(), count, "{name}");
        }
        for name in [SceneName::RollingBall, SceneName::Moving] {
            let (before, after) = (&at(name, 1.0)[0], &at(name, 1.5)[0]);
            assert!(geometry::distance(before.centre_m, after.centre_m) > 0.003, "{name} moves");
            assert_eq!(before.conductance_s, after.conductance_s, "{name} is as firm everywhere");
        }
        let [light, firm] = [0.5, 1.3].map(|time_s| at(SceneName::ChangingForce, time_s)[0].clone());
        assert!(light.centre_m == firm.centre_m && firm.conductance_s > 2.0 * light.conductance_s);
        assert!(at(SceneName::ChangingForce, 0.0).is_empty(), "it lifts");
    }

    #[test]
    fn the_wandering_contact_presses_and_lifts_and_comes_everywhere() {
        let scene = scene(SceneName::Wandering, Detector::DEFAULT, 0);
        let seen: Vec<_> = (0..4000).map(|i| scene.at(f64::from(i) * 0.01)).collect();
        assert!(seen.iter().any(Vec::is_empty), "it lifts");
        let touches: Vec<_> = seen.into_iter().flatten().collect();
        assert!(touches.iter().any(|t| t.centre_m[0] < -0.02) && touches.iter().any(|t| t.centre_m[1] > 0.02));
        let sheet_s = Detector::preset(Detector::DEFAULT).unwrap().sheet_conductance_s();
        assert!(touches.iter().any(|touch| touch.conductance_s > sheet_s));
        assert!(touches.iter().any(|touch| touch.conductance_s < 0.02 * sheet_s));
    }

    #[test]
    fn names_are_read_back_and_others_reported() {
        for name in SceneName::ALL {
            assert_eq!(name.to_string().parse(), Ok(name));
        }
        let error = "dance".parse::<SceneName>().unwrap_err().to_string();
        assert!(error.contains("no scene `dance`") && error.contains("rolling-ball"), "{error}");
    }
}
