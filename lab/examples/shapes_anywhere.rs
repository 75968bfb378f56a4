//! How surely lines and rings are found on detectors of any proportions, each from a cold start:
//! `cargo run --release --package tactomo-lab --example shapes_anywhere [SEED [SCENES [DETECTOR [BUILT]]]]`.
//!
//! DETECTOR is a preset, or `round-60`, a disc of 60 mm; all of them by default. With BUILT, readings are those of a detector that was drawn around its
//! description with this seed; without, the detector is known exactly. Lines lie anywhere in any direction, 0.3 to 0.9 times as long as fits through
//! the middle in that direction, 0.02 to 0.15 of the shorter side wide, of 1 to 10 sheet conductances. Rings have 0.3 to 0.9 of the
//! largest radius. Readings are of a finer model, with 12 bits and 1.5 LSB of noise. What is taken for something else is listed on stderr.

use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::time::Instant;

use tactomo_physics::detector::{Detector, Electrode, Outline};
use tactomo_physics::forward::{readings_v, touched_impedance_ohm};
use tactomo_physics::geometry::{self, Point};
use tactomo_physics::scene::{Shape, Touch};
use tactomo_physics::simulate::{Noise, drawn, finer_model, measured};
use tactomo_touch::solve::{Auto, Problem, Solver};

const DETECTORS: [&str; 3] = ["strip-13x60", "square-60", "round-60"];
const SCENES: usize = 200;
/// What is drawn for a line or a ring: shares of what fits, of the shorter side, and sheet conductances.
const SIZES: [f64; 2] = [0.3, 0.9];
const WIDTHS: [f64; 2] = [0.02, 0.15];
const SHEETS: [f64; 2] = [1.0, 10.0];

/// Draws a touch, and places on its rim (m).
type Draw = fn(&Detector, &mut fastrand::Rng) -> (Touch, Vec<Point>);

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let seed: u64 = words.next().map_or(Ok(1), |word| word.parse())?;
    let scenes: usize = words.next().map_or(Ok(SCENES), |word| word.parse())?;
    let only = words.next();
    let built: Option<u64> = words.next().map(|word| word.parse()).transpose()?;
    let names = only.as_deref().map_or(DETECTORS.to_vec(), |name| vec![name]);
    println!("| detector | shape | taken for it, % | misfits, % | first answer, ms: median, p90, mean |");
    println!("|---|---|---|---|---|");
    for name in names {
        let detector = detector(name)?;
        for (what, draw) in [("line", line as Draw), ("ring", ring)] {
            let mut random = fastrand::Rng::with_seed(seed);
            let row = row(&detector, built, what, || drawn_within(&detector, &mut random, draw), (seed, scenes))?;
            println!("| {name} | {what} | {row} |");
        }
    }
    Ok(())
}

fn detector(name: &str) -> Result<Detector, Box<dyn Error>> {
    let mut detector = match name {
        "round-60" => round(),
        _ => Detector::preset(name).ok_or_else(|| format!("no preset {name}"))?,
    };
    detector.adc.noise_lsb = 1.5;
    Ok(detector)
}

/// The default preset with a round outline, and its electrodes on two circles.
fn round() -> Detector {
    let on = |radius_m: f64, count: usize| {
        (0..count).map(move |i| {
            let (sin, cos) = (TAU * i as f64 / count as f64).sin_cos();
            [radius_m * cos, radius_m * sin]
        })
    };
    let electrodes = on(0.011, 5).chain(on(0.0235, 11)).map(|[x, y]| Electrode::flat(x, y, 0.002)).collect();
    let outline = Outline { outer: on(0.03, 64).collect(), holes: Vec::new() };
    Detector { name: "round-60".to_owned(), outline, electrodes, ..Detector::default() }
}

fn between(random: &mut fastrand::Rng, [low, high]: [f64; 2]) -> f64 {
    low + (high - low) * random.f64()
}

fn log_between(random: &mut fastrand::Rng, [low, high]: [f64; 2]) -> f64 {
    low * (high / low).powf(random.f64())
}

fn shorter_side_m(detector: &Detector) -> f64 {
    detector.outline.size_m().into_iter().fold(f64::INFINITY, f64::min)
}

fn is_on(detector: &Detector, at_m: Point) -> bool {
    geometry::is_inside(at_m, &detector.outline.outer)
}

fn anywhere(detector: &Detector, random: &mut fastrand::Rng) -> Point {
    detector.outline.size_m().map(|side_m| side_m * (random.f64() - 0.5))
}

/// A touch that is all on the detector. A long line along a diagonal has no place on it if it is wide: so all is drawn anew, not its place only.
fn drawn_within(detector: &Detector, random: &mut fastrand::Rng, draw: Draw) -> Touch {
    loop {
        let (touch, rim_m) = draw(detector, random);
        if rim_m.iter().all(|at_m| is_on(detector, *at_m)) {
            return touch;
        }
    }
}

/// A line and its corners.
fn line(detector: &Detector, random: &mut fastrand::Rng) -> (Touch, Vec<Point>) {
    let angle_rad = PI * random.f64();
    let (sin, cos) = angle_rad.sin_cos();
    let mut half_m = 0.0;
    while is_on(detector, [half_m * cos, half_m * sin]) {
        half_m += 1e-5;
    }
    let length_m = 2.0 * half_m * between(random, SIZES);
    let width_m = shorter_side_m(detector) * between(random, WIDTHS);
    let conductance_s = detector.sheet_conductance_s() * log_between(random, SHEETS);
    let centre_m = anywhere(detector, random);
    let corner = |[along, across]: [f64; 2]| {
        let [along_m, across_m] = [0.5 * along * length_m, 0.5 * across * width_m];
        [centre_m[0] + along_m * cos - across_m * sin, centre_m[1] + along_m * sin + across_m * cos]
    };
    let corners_m = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(corner);
    (Touch::flat(centre_m, Shape::Line { length_m, width_m, angle_rad }, conductance_s), corners_m.to_vec())
}

/// A ring and places on its outer rim.
fn ring(detector: &Detector, random: &mut fastrand::Rng) -> (Touch, Vec<Point>) {
    let shorter_m = shorter_side_m(detector);
    let width_m = shorter_m * between(random, WIDTHS);
    let radius_m = 0.5 * (shorter_m - width_m) * between(random, SIZES);
    let conductance_s = detector.sheet_conductance_s() * log_between(random, SHEETS);
    let centre_m = anywhere(detector, random);
    let on = |turn: u32| {
        let (sin, cos) = (TAU * f64::from(turn) / 32.0).sin_cos();
        let outer_m = radius_m + 0.5 * width_m;
        [centre_m[0] + outer_m * cos, centre_m[1] + outer_m * sin]
    };
    (Touch::flat(centre_m, Shape::Ring { radius_m, width_m }, conductance_s), (0..32).map(on).collect())
}

/// What becomes of scenes of one kind.
fn row(
    described: &Detector,
    built: Option<u64>,
    what: &str,
    mut make: impl FnMut() -> Touch,
    (seed, scenes): (u64, usize),
) -> Result<String, Box<dyn Error>> {
    let known = if built.is_some() { described.clone() } else { described.taken_as_exact() };
    let built = built.map_or(known.clone(), |seed| drawn(described, seed));
    let problem = Problem::of(&known)?;
    // Made once, before anything is timed.
    problem.nuisance();
    let mut solver = Auto::new(&problem)?;
    let fine = finer_model(&built, &[], seed)?;
    let mut noise = Noise::new(seed);
    let (mut right, mut misfits, mut times_ms) = (0, 0, Vec::new());
    for scene in 0..scenes {
        let touch = make();
        let exact = readings_v(&touched_impedance_ohm(&*fine, std::slice::from_ref(&touch))?, &built);
        let readings = measured(&exact, &built.adc, &mut noise);
        solver.reset();
        let begun = Instant::now();
        let solution = solver.solve(&readings)?;
        times_ms.push(1e3 * begun.elapsed().as_secs_f64());
        misfits += usize::from(solution.flags.misfit);
        match solution.choice.map(|choice| choice.what).unwrap_or_default() {
            taken_for if taken_for == what => right += 1,
            taken_for => eprintln!("{} {scene}: {taken_for} in place of {touch:?}", described.name),
        }
    }
    let percent = |count: usize| 100.0 * count as f64 / scenes.max(1) as f64;
    let mean_ms = times_ms.iter().sum::<f64>() / times_ms.len().max(1) as f64;
    times_ms.sort_by(f64::total_cmp);
    let rank = |share: f64| times_ms.get((share * scenes.saturating_sub(1) as f64).round() as usize).copied();
    let [median_ms, p90_ms] = [0.5, 0.9].map(|share| rank(share).unwrap_or(f64::NAN));
    Ok(format!("{:.1} | {:.1} | {median_ms:.1}, {p90_ms:.1}, {mean_ms:.1}", percent(right), percent(misfits)))
}
