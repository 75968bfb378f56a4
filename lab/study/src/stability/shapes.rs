//! Sweeps of touches that are neither discs nor lines nor rings: what no solver has a model of but images.

use std::f64::consts::TAU;

use super::scenes::{millimetres, touched};
use super::sweep::{Bench, Maker, Sweep};
use crate::experiment::StudyError;
use tactomo_physics::geometry;
use tactomo_physics::scene::{Shape, Touch};

/// Width of an L's arms, and how long they are in all (mean distances of electrodes): the first is nearly a square.
const WIDTH: f64 = 0.2;
const ARMS: [f64; 5] = [0.25, 0.45, 0.7, 1.0, 1.4];
/// Radius of a quarter disc (mean distances of electrodes).
const RADII: [f64; 5] = [0.1, 0.2, 0.4, 0.7, 1.0];
/// Conductance (sheet conductances) of all of a touch, of which some lies over the edge in a corner.
const SHEETS: f64 = 1.0;
/// Corners of the polygon that stands for a disc.
const CORNERS: usize = 48;

/// All of them.
pub fn sweeps() -> Vec<Maker> {
    vec![
        Maker::new("Arms of an L", ARMS.len(), arms),
        Maker::new("Radius of a quarter disc in a corner", RADII.len(), quarter),
    ]
}

const NOTE: &str = "Error: the mean distance between what touches and what was found, both ways; of solvers without an image, contacts are discs.";

fn arms(bench: &Bench) -> Result<Sweep, StudyError> {
    let touches = |arm: f64, seed| vec![of_l(bench, arm, seed)];
    let note = format!("Two arms at a right angle, one sheet conductance in all; the first is nearly a square. {NOTE}");
    touched(bench, &note, &ARMS, |arm| millimetres(bench, arm), touches)
}

/// An L about a place in the middle, turned as a seed says.
fn of_l(bench: &Bench, arm: f64, seed: u64) -> Touch {
    let mut random = fastrand::Rng::with_seed(seed);
    let half_m = bench.sound.detector.outline.size_m().map(|side_m| 0.5 * side_m);
    let centre_m = half_m.map(|half_m| 0.2 * half_m * (2.0 * random.f64() - 1.0));
    let (sin, cos) = (TAU * random.f64()).sin_cos();
    let [arm_m, width_m] = [arm, WIDTH].map(|share| share * bench.sound.reach_m());
    // About the middle of the square between its ends, so that all lengths are as far from the edges.
    let corner = |[x, y]: [f64; 2]| {
        let [x, y] = [x - arm_m / 2.0, y - arm_m / 2.0];
        [x * cos - y * sin, x * sin + y * cos]
    };
    let corners = [[0.0, 0.0], [arm_m, 0.0], [arm_m, width_m], [width_m, width_m], [width_m, arm_m], [0.0, arm_m]];
    touch(bench, centre_m, corners.map(corner).to_vec())
}

fn quarter(bench: &Bench) -> Result<Sweep, StudyError> {
    let outer = &bench.sound.detector.outline.outer;
    let touches = |share: f64, seed: u64| {
        let centre_m = outer[fastrand::Rng::with_seed(seed).usize(..outer.len())];
        vec![touch(bench, centre_m, geometry::disc([0.0; 2], share * bench.sound.reach_m(), CORNERS))]
    };
    let note =
        format!("What of a disc about a corner is on the detector; the disc would have one sheet conductance. {NOTE}");
    touched(bench, &note, &RADII, |share| millimetres(bench, share), touches)
}

fn touch(bench: &Bench, centre_m: [f64; 2], corners_m: Vec<[f64; 2]>) -> Touch {
    Touch::flat(centre_m, Shape::Polygon { corners_m }, SHEETS * bench.sound.detector.sheet_conductance_s())
}
