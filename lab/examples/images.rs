//! How like the truth images are: `cargo run --release --package tactomo-lab --example images [--seed N] [SOLVER...]`.
//!
//! A slab of `square-60` in full depth, of a finer grid than any that is inverted, is touched as in the scenes that are not a
//! few small contacts, and measured with 12 bits and 1.5 LSB of noise. For each solver and scene: correlation of the image of a
//! first frame with the true one, both smoothed by 2 mm, the mean of several placings; time of that frame; and the same after
//! some more frames of the same contacts. Contacts of a solver that makes no image are drawn as discs of the radii found. `--seed` chooses the
//! first of the placings; without it they are those that settings were chosen on.

use std::time::Instant;

use anyhow::{Context, Result};
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardModel, ImageMesh, Resolution, Slab, readings_v, touched_impedance_ohm};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::{Hand, Scene, SceneName};
use tactomo_physics::simulate::{Noise, measured};
use tactomo_touch::metrics::{Comparison, found_s_per_m2, truth_s_per_m2};
use tactomo_touch::solve::{Method, Problem};

const SCENES: [SceneName; 6] =
    [SceneName::FiveFingers, SceneName::Wide, SceneName::Ring, SceneName::Line, SceneName::Single, SceneName::Several];
const SMOOTHING_M: f64 = 0.002;
/// Radius of contacts whose own was not found: a sixth of the mean distance of the electrodes, as `contacts` takes it.
const USUAL_RADIUS_M: f64 = 0.0025;
/// Nodes of the grid that simulates: 61 x 61, against 45 x 45 and 20 x 20 that are inverted.
const NODES: usize = 3721;
/// Placings of each scene.
const SEEDS: u64 = 5;
/// Frames of each, with new noise.
const FRAMES: usize = 10;

/// What a solver is shown, and the truth.
struct Shown {
    frames: Vec<Readings>,
    truth: Vec<f32>,
}

fn main() -> Result<()> {
    let mut asked: Vec<String> = std::env::args().skip(1).collect();
    let seed = match asked.iter().position(|word| word == "--seed") {
        Some(at) if at + 1 < asked.len() => asked.drain(at..at + 2).next_back().map(|text| text.parse()).transpose()?,
        _ => None,
    };
    let detector = Detector::preset(Detector::DEFAULT).context("no preset")?.taken_as_exact();
    let problem = Problem::new(Box::new(Slab::new(&detector)?) as Box<dyn ForwardModel>);
    let mesh = &problem.jacobian.image_mesh;
    let shown: Vec<_> =
        SCENES.iter().map(|&scene| shown(&detector, mesh, scene, seed.unwrap_or(0))).collect::<Result<_>>()?;
    let comparison = Comparison::new(mesh, SMOOTHING_M);
    println!("first frame: correlation, ms / frame {FRAMES}: correlation, ms\n");
    println!("| solver | {} |", SCENES.map(|scene| scene.to_string()).join(" | "));
    println!("|---|{}", "---|".repeat(SCENES.len()));
    for method in Method::ALL {
        if !(asked.is_empty() || asked.iter().any(|name| name == method.name())) {
            continue;
        }
        let cells: Vec<_> =
            shown.iter().map(|shown| cell(method, &problem, &comparison, shown)).collect::<Result<_>>()?;
        println!("| {} | {} |", method.name(), cells.join(" | "));
    }
    Ok(())
}

/// Frames of several placings of a scene.
fn shown(detector: &Detector, mesh: &ImageMesh, scene: SceneName, first_seed: u64) -> Result<Vec<Shown>> {
    let slab = Slab::with_resolution(detector, Resolution::FINE)?.on_image(NODES);
    (first_seed..first_seed + SEEDS)
        .map(|seed| {
            let touches = Scene::new(scene, detector, Hand::relative(detector), seed).at(1.0 + seed as f64);
            let exact = readings_v(&touched_impedance_ohm(&slab, &touches)?, detector);
            let mut noise = Noise::new(seed);
            let frames = (0..FRAMES).map(|_| measured(&exact, &detector.adc, &mut noise)).collect();
            Ok(Shown { frames, truth: truth_s_per_m2(mesh, &touches)? })
        })
        .collect()
}

fn cell(method: Method, problem: &Problem, comparison: &Comparison, shown: &[Shown]) -> Result<String> {
    let mesh = &problem.jacobian.image_mesh;
    let mut solver = method.build(problem)?;
    // Correlation and seconds of the first frame and the last.
    let mut sums = [[0.0; 2]; 2];
    for Shown { frames, truth } in shown {
        solver.reset();
        for (index, readings) in frames.iter().enumerate() {
            let begin = Instant::now();
            let solution = solver.solve(readings)?;
            let seconds = begin.elapsed().as_secs_f64();
            if index == 0 || index + 1 == FRAMES {
                let image = found_s_per_m2(mesh, &solution, USUAL_RADIUS_M);
                let correlation = comparison.of(truth, &image).correlation.unwrap_or(0.0);
                let sum = &mut sums[usize::from(index > 0)];
                *sum = [sum[0] + correlation, sum[1] + seconds];
            }
        }
    }
    let [[first, first_s], [last, last_s]] = sums.map(|sum| sum.map(|sum| sum / shown.len() as f64));
    Ok(format!("{first:.2}, {:.1} / {last:.2}, {:.1}", 1e3 * first_s, 1e3 * last_s))
}
