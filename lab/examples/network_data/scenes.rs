//! Scenes at random, wider than those that solvers are tried with.

use std::f64::consts::TAU;

use tactomo_physics::detector::Detector;
use tactomo_physics::scene::{Hand, Scene, SceneName, Shape, Touch};

/// A place (m).
type Point = [f64; 2];

/// Conductance of a contact, in sheet conductances, and its radius, as a share of the shorter side: 0.6 to 4.2 mm on 60 mm.
const SHEETS: [f64; 2] = [0.015, 6.0];
const RADIUS_SHARES: [f64; 2] = [0.01, 0.07];
/// Of a wide contact: 4.5 to 12 mm on 60 mm.
const WIDE_SHARES: [f64; 2] = [0.075, 0.2];
/// Conductance of a wide contact or a whole shape, in sheet conductances.
const WHOLE_SHEETS: [f64; 2] = [0.1, 6.0];
/// Middles of contacts lie so many radii from the edge, at least.
const EDGE_RADII: f64 = 1.1;
/// Least distance of two contacts, as a share of the shorter side: 6 mm on 60 mm.
const APART_SHARE: f64 = 0.1;
/// Places tried before contacts are taken as they are.
const TRIES: usize = 200;
/// Share of contacts that are sheared: two discs up to this many radii apart, of which one presses more.
const SHEARED: f64 = 0.3;
const SHEAR_RADII: f64 = 0.9;

/// What touches, and as how many contacts.
pub struct Drawn {
    pub touches: Vec<Touch>,
    /// Place (m) and conductance (S) of each contact; `None` if it is one shape.
    pub contacts: Option<Vec<[f64; 3]>>,
}

/// Draws scenes on a detector.
pub struct Scenes<'a> {
    detector: &'a Detector,
    half_m: Point,
    shorter_m: f64,
    sheet_s: f64,
    random: fastrand::Rng,
}

impl<'a> Scenes<'a> {
    pub fn new(detector: &'a Detector, seed: u64) -> Self {
        let size_m = detector.outline.size_m();
        Self {
            detector,
            half_m: size_m.map(|side_m| side_m / 2.0),
            shorter_m: size_m[0].min(size_m[1]),
            sheet_s: detector.sheet_conductance_s(),
            random: fastrand::Rng::with_seed(seed),
        }
    }

    /// One more scene: mostly single contacts, some of several, some shapes.
    pub fn draw(&mut self) -> Drawn {
        match self.random.u32(0..100) {
            0..2 => self.discs(0),
            2..36 => self.discs(1),
            36..54 => self.discs(2),
            54..66 => self.discs(3),
            66..72 => self.discs(4),
            72..76 => self.discs(5),
            76..88 => self.hand(),
            88..92 => self.wide(),
            92..96 => self.line(),
            _ => self.ring(),
        }
    }

    fn discs(&mut self, count: usize) -> Drawn {
        let mut discs: Vec<(Point, f64, f64)> = Vec::new();
        for _ in 0..count {
            let radius_m = self.shorter_m * self.between_logs(RADIUS_SHARES);
            let conductance_s = self.sheet_s * self.between_logs(SHEETS);
            let apart_m = APART_SHARE * self.shorter_m;
            let mut place_m = self.anywhere(EDGE_RADII * radius_m);
            for _ in 0..TRIES {
                if discs.iter().all(|(other, ..)| (place_m[0] - other[0]).hypot(place_m[1] - other[1]) > apart_m) {
                    break;
                }
                place_m = self.anywhere(EDGE_RADII * radius_m);
            }
            discs.push((place_m, radius_m, conductance_s));
        }
        self.pressed(&discs)
    }

    /// A hand laid down, turned, moved, and pressing unevenly.
    fn hand(&mut self) -> Drawn {
        let scene =
            Scene::new(SceneName::FiveFingers, self.detector, Hand::relative(self.detector), self.random.u64(..));
        let fingers = scene.at(100.0 * self.random.f64());
        let (sin, cos) = (self.signed() * 0.35).sin_cos();
        let scale = 0.85 + 0.25 * self.random.f64();
        let moved_m = [0, 1].map(|axis| 0.12 * self.half_m[axis] * self.signed());
        let firmer = self.between_logs([0.25, 4.0]);
        let mut discs = Vec::new();
        for disc in fingers.iter().filter_map(Touch::disc) {
            let radius_m = disc.radius_m * self.between_logs([0.7, 1.6]);
            let turned = [disc.x_m * cos - disc.y_m * sin, disc.x_m * sin + disc.y_m * cos];
            let place_m = [0, 1].map(|axis| {
                let most_m = self.half_m[axis] - EDGE_RADII * radius_m;
                (scale * turned[axis] + moved_m[axis]).clamp(-most_m, most_m)
            });
            discs.push((place_m, radius_m, disc.conductance_s * firmer * self.between_logs([0.5, 2.0])));
        }
        self.pressed(&discs)
    }

    /// Contacts of discs, some sheared.
    fn pressed(&mut self, discs: &[(Point, f64, f64)]) -> Drawn {
        let (mut touches, mut contacts) = (Vec::new(), Vec::new());
        for &(place_m, radius_m, conductance_s) in discs {
            let parts = if self.random.f64() < SHEARED {
                self.sheared(place_m, radius_m, conductance_s)
            } else {
                vec![(place_m, conductance_s)]
            };
            let middle = |axis: usize| parts.iter().map(|(at, s)| at[axis] * s).sum::<f64>() / conductance_s;
            contacts.push([middle(0), middle(1), conductance_s]);
            touches.extend(parts.iter().map(|(at_m, s)| Touch::flat(*at_m, Shape::Disc { radius_m }, *s)));
        }
        Drawn { touches, contacts: Some(contacts) }
    }

    fn sheared(&mut self, place_m: Point, radius_m: f64, conductance_s: f64) -> Vec<(Point, f64)> {
        let (sin, cos) = (TAU * self.random.f64()).sin_cos();
        let by_m = SHEAR_RADII * radius_m * self.random.f64();
        let share = 0.3 + 0.4 * self.random.f64();
        let at = |sign: f64| {
            self.held(
                [place_m[0] + sign * by_m * cos / 2.0, place_m[1] + sign * by_m * sin / 2.0],
                EDGE_RADII * radius_m,
            )
        };
        vec![(at(-1.0), share * conductance_s), (at(1.0), (1.0 - share) * conductance_s)]
    }

    fn wide(&mut self) -> Drawn {
        let radius_m = self.shorter_m * self.between_logs(WIDE_SHARES);
        let place_m = self.anywhere(EDGE_RADII * radius_m);
        let conductance_s = self.sheet_s * self.between_logs(WHOLE_SHEETS);
        Drawn {
            touches: vec![Touch::flat(place_m, Shape::Disc { radius_m }, conductance_s)],
            contacts: Some(vec![[place_m[0], place_m[1], conductance_s]]),
        }
    }

    fn line(&mut self) -> Drawn {
        let length_m = self.shorter_m * (0.3 + 0.45 * self.random.f64());
        let shape = Shape::Line {
            length_m,
            width_m: self.shorter_m * (0.02 + 0.05 * self.random.f64()),
            angle_rad: TAU * self.random.f64(),
        };
        self.shape(shape, 0.55 * length_m)
    }

    fn ring(&mut self) -> Drawn {
        let radius_m = self.shorter_m * (0.12 + 0.18 * self.random.f64());
        let width_m = self.shorter_m * (0.02 + 0.05 * self.random.f64());
        self.shape(Shape::Ring { radius_m, width_m }, radius_m + width_m)
    }

    fn shape(&mut self, shape: Shape, reach_m: f64) -> Drawn {
        let conductance_s = self.sheet_s * self.between_logs(WHOLE_SHEETS);
        Drawn { touches: vec![Touch::flat(self.anywhere(reach_m), shape, conductance_s)], contacts: None }
    }

    /// A place at least so far from the edge (m).
    fn anywhere(&mut self, margin_m: f64) -> Point {
        [0, 1].map(|axis| (self.half_m[axis] - margin_m).max(0.0) * self.signed())
    }

    fn held(&self, place_m: Point, margin_m: f64) -> Point {
        [0, 1].map(|axis| {
            let most_m = (self.half_m[axis] - margin_m).max(0.0);
            place_m[axis].clamp(-most_m, most_m)
        })
    }

    fn signed(&mut self) -> f64 {
        2.0 * self.random.f64() - 1.0
    }

    fn between_logs(&mut self, [low, high]: [f64; 2]) -> f64 {
        low * (high / low).powf(self.random.f64())
    }
}
