//! Scenes that span the use of a detector.

use std::f64::consts::TAU;

use tactomo_physics::detector::Detector;
use tactomo_physics::geometry::{self, Point};
use tactomo_physics::scene::{Hand, Scene, SceneName, Touch};

/// Firmness for a contact of 0.03, 0.3 and 2 sheet conductances.
const LIGHT: f64 = 0.015;
const FIRM: f64 = 0.15;
const HARD: f64 = 1.0;
/// Contacts lie within this share of half the sides, unless they are at the edge.
const REACH: f64 = 0.75;
/// Distances between contacts, in mean distances of electrodes.
const NEAR: f64 = 0.7;
const FAR: f64 = 2.0;
const APART: f64 = 1.3;
/// A contact at the edge: so many radii from it.
const EDGE_RADII: f64 = 1.2;
/// Seconds between two frames of the moving ball.
const STEP_S: f64 = 0.02;
/// Places tried before contacts are taken as they are.
const TRIES: usize = 1000;

/// A kind of scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SceneKind {
    /// Nothing touches.
    None,
    /// One contact of 0.03 sheet conductances.
    Light,
    /// One of 0.3.
    Firm,
    /// One of 2.
    Hard,
    /// A firm one at an edge.
    Edge,
    /// A firm one in a corner.
    Corner,
    /// A ball that rolls.
    MovingBall,
    /// Two firm ones, 0.7 mean distances of electrodes apart.
    TwoNear,
    /// Two firm ones, 2 mean distances of electrodes apart.
    TwoFar,
    /// Three of different firmness.
    Three,
    /// A hand laid down.
    FiveFingers,
    /// One wide contact.
    Wide,
    /// The rim of a cup.
    Ring,
    /// A bar.
    Line,
}

/// Kinds that are judged alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Group {
    /// Nothing.
    Nothing,
    /// One contact.
    One,
    /// Two or three.
    Several,
    /// What is an image rather than a few points.
    Shapes,
}

impl Group {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Nothing, Self::One, Self::Several, Self::Shapes];

    /// Its kinds.
    pub fn kinds(self) -> impl Iterator<Item = SceneKind> {
        SceneKind::ALL.into_iter().filter(move |kind| kind.group() == self)
    }
}

impl SceneKind {
    /// All of them.
    pub const ALL: [Self; 14] = [
        Self::None,
        Self::Light,
        Self::Firm,
        Self::Hard,
        Self::Edge,
        Self::Corner,
        Self::MovingBall,
        Self::TwoNear,
        Self::TwoFar,
        Self::Three,
        Self::FiveFingers,
        Self::Wide,
        Self::Ring,
        Self::Line,
    ];

    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Light => "light",
            Self::Firm => "firm",
            Self::Hard => "hard",
            Self::Edge => "edge",
            Self::Corner => "corner",
            Self::MovingBall => "moving ball",
            Self::TwoNear => "two near",
            Self::TwoFar => "two far",
            Self::Three => "three",
            Self::FiveFingers => "five fingers",
            Self::Wide => "wide",
            Self::Ring => "ring",
            Self::Line => "line",
        }
    }

    /// How it is judged.
    pub fn group(self) -> Group {
        match self {
            Self::None => Group::Nothing,
            Self::Light | Self::Firm | Self::Hard | Self::Edge | Self::Corner | Self::MovingBall => Group::One,
            Self::TwoNear | Self::TwoFar | Self::Three => Group::Several,
            Self::FiveFingers | Self::Wide | Self::Ring | Self::Line => Group::Shapes,
        }
    }

    /// What touches in each of `frames` frames one after the other. A `seed` chooses the places.
    pub fn frames(self, detector: &Detector, seed: u64, frames: usize) -> Vec<Vec<Touch>> {
        let places = &mut Places::new(detector, seed);
        let still = |touches: Vec<Touch>| vec![touches; frames];
        match self {
            Self::None => still(Vec::new()),
            Self::Light => still(places.apart(&[LIGHT], 0.0)),
            Self::Firm => still(places.apart(&[FIRM], 0.0)),
            Self::Hard => still(places.apart(&[HARD], 0.0)),
            Self::Edge => still(vec![places.at_edge()]),
            Self::Corner => still(vec![places.in_corner()]),
            Self::TwoNear => still(places.pair(NEAR)),
            Self::TwoFar => still(places.pair(FAR)),
            Self::Three => still(places.apart(&[0.1, 0.2, 0.3], APART)),
            Self::MovingBall => (0..frames).map(|i| places.of(SceneName::RollingBall, i as f64 * STEP_S)).collect(),
            Self::FiveFingers => still(places.of(SceneName::FiveFingers, 1.0)),
            Self::Wide => still(places.of(SceneName::Wide, 0.0)),
            Self::Ring => still(places.of(SceneName::Ring, 0.0)),
            Self::Line => still(places.of(SceneName::Line, 0.0)),
        }
    }
}

/// Mean distance of a detector's electrodes (m): the root of the area that each has.
pub fn electrode_distance_m(detector: &Detector) -> f64 {
    let [width_m, height_m] = detector.outline.size_m();
    (width_m * height_m / detector.electrodes.len() as f64).sqrt()
}

/// Where contacts are.
struct Places<'a> {
    detector: &'a Detector,
    hand: Hand,
    half_m: Point,
    seed: u64,
    random: fastrand::Rng,
}

impl<'a> Places<'a> {
    fn new(detector: &'a Detector, seed: u64) -> Self {
        let half_m = detector.outline.size_m().map(|side_m| side_m / 2.0);
        let random = fastrand::Rng::with_seed(seed);
        Self { detector, hand: Hand::relative(detector), half_m, seed, random }
    }

    /// A scene of the program's own.
    fn of(&self, name: SceneName, time_s: f64) -> Vec<Touch> {
        Scene::new(name, self.detector, self.hand, self.seed).at(time_s)
    }

    fn tip(&self, place_m: Point, firmness: f64) -> Touch {
        self.hand.tip(place_m, firmness, 1.0)
    }

    fn share(&mut self) -> f64 {
        2.0 * self.random.f64() - 1.0
    }

    fn anywhere(&mut self) -> Point {
        self.half_m.map(|half_m| REACH * half_m * (2.0 * self.random.f64() - 1.0))
    }

    fn is_on(&self, place_m: Point) -> bool {
        let inside = (0..2).all(|axis| place_m[axis].abs() <= 0.9 * self.half_m[axis]);
        inside && geometry::is_inside(place_m, &self.detector.outline.outer)
    }

    /// Contacts of such firmness, at least so many mean distances of electrodes apart.
    fn apart(&mut self, firmness: &[f64], distance: f64) -> Vec<Touch> {
        let apart_m = distance * electrode_distance_m(self.detector);
        let mut places_m: Vec<Point> = Vec::new();
        for tries in 0.. {
            if places_m.len() == firmness.len() {
                break;
            }
            let place_m = self.anywhere();
            let is_free = places_m.iter().all(|other| geometry::distance(place_m, *other) >= apart_m);
            if (is_free && self.is_on(place_m)) || tries >= TRIES {
                places_m.push(place_m);
            }
        }
        places_m.into_iter().zip(firmness).map(|(place_m, firmness)| self.tip(place_m, *firmness)).collect()
    }

    /// Two firm contacts so many mean distances of electrodes apart.
    fn pair(&mut self, distance: f64) -> Vec<Touch> {
        let half_m = 0.5 * distance * electrode_distance_m(self.detector);
        let (mut middle, mut direction) = ([0.0; 2], [1.0, 0.0]);
        let end = |middle: Point, direction: Point, sign: f64| {
            [0, 1].map(|axis| middle[axis] + sign * half_m * direction[axis])
        };
        for _ in 0..TRIES {
            let (sin, cos) = (TAU * self.random.f64()).sin_cos();
            (middle, direction) = (self.anywhere(), [cos, sin]);
            if [-1.0, 1.0].iter().all(|sign| self.is_on(end(middle, direction, *sign))) {
                break;
            }
        }
        [-1.0, 1.0].iter().map(|sign| self.tip(end(middle, direction, *sign), FIRM)).collect()
    }

    fn wall_distance_m(&self) -> f64 {
        EDGE_RADII * self.tip([0.0; 2], FIRM).disc().map_or(0.0, |disc| disc.radius_m)
    }

    fn at_edge(&mut self) -> Touch {
        let (axis, side) = (self.random.usize(..2), self.random.bool());
        let mut place_m = [0.0; 2];
        place_m[axis] = (self.half_m[axis] - self.wall_distance_m()) * if side { 1.0 } else { -1.0 };
        place_m[1 - axis] = 0.6 * self.half_m[1 - axis] * self.share();
        self.tip(place_m, FIRM)
    }

    fn in_corner(&mut self) -> Touch {
        let wall_distance_m = self.wall_distance_m();
        let place_m =
            self.half_m.map(|half_m| (half_m - wall_distance_m) * if self.random.bool() { 1.0 } else { -1.0 });
        self.tip(place_m, FIRM)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detector() -> Detector {
        Detector::preset(Detector::DEFAULT).unwrap()
    }

    fn touches(kind: SceneKind, seed: u64) -> Vec<Touch> {
        kind.frames(&detector(), seed, 2).remove(1)
    }

    #[test]
    fn kinds_have_what_they_say_at_any_seed() {
        for seed in 0..20 {
            for (kind, count) in
                [(SceneKind::None, 0), (SceneKind::Corner, 1), (SceneKind::Three, 3), (SceneKind::Ring, 1)]
            {
                assert_eq!(touches(kind, seed).len(), count);
            }
            for (kind, distance_m) in [(SceneKind::TwoNear, 0.0105), (SceneKind::TwoFar, 0.030)] {
                let pair = touches(kind, seed);
                let found_m = geometry::distance(pair[0].centre_m, pair[1].centre_m);
                assert!((found_m - distance_m).abs() < 1e-9, "{found_m}");
            }
        }
    }

    #[test]
    fn all_touches_are_on_all_rectangular_presets() {
        for detector in Detector::preset_names().filter_map(Detector::preset) {
            let [width_m, height_m] = detector.outline.size_m();
            for kind in SceneKind::ALL {
                for touch in (0..5).flat_map(|seed| kind.frames(&detector, seed, 3)).flatten() {
                    let inside = |[x, y]: &Point| x.abs() <= width_m / 2.0 && y.abs() <= height_m / 2.0;
                    assert!(touch.pieces().iter().flatten().all(inside), "{kind:?} on {}", detector.name);
                }
            }
        }
    }

    #[test]
    fn contacts_conduct_what_their_names_say() {
        let sheet_s = detector().sheet_conductance_s();
        for (kind, sheets) in
            [(SceneKind::Light, 0.03), (SceneKind::Firm, 0.3), (SceneKind::Edge, 0.3), (SceneKind::Hard, 2.0)]
        {
            assert!((touches(kind, 3)[0].conductance_s / sheet_s - sheets).abs() < 1e-9, "{kind:?}");
        }
    }

    #[test]
    fn only_the_ball_moves() {
        for kind in SceneKind::ALL {
            let frames = kind.frames(&detector(), 1, 3);
            assert_eq!(frames[0] == frames[2], kind != SceneKind::MovingBall, "{kind:?}");
        }
    }

    #[test]
    fn every_kind_is_in_one_group() {
        assert_eq!(Group::ALL.into_iter().flat_map(Group::kinds).count(), SceneKind::ALL.len());
    }
}
