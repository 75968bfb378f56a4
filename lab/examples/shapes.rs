//! How surely lines and rings are told from contacts: `cargo run --release --package tactomo-lab --example shapes [SEED [SCENES [CLASS]]]`.
//!
//! Random bars, rims and contacts on `square-60`, read by a finer model with 12 bits and 1.5 LSB of noise. For each class: what `auto` takes
//! them for, from a cold start; how far off ends, centres, radii, widths and conductances of shapes are, and how many of the errors are within
//! one and two of their standard errors; correlation of the image with the truth, both smoothed by 2 mm; time of the first
//! frame, and of a further one.

use std::error::Error;
use std::f64::consts::TAU;
use std::time::Instant;

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardModel, readings_v, touched_impedance_ohm};
use tactomo_physics::geometry::{self, Point};
use tactomo_physics::scene::{Shape, Touch};
use tactomo_physics::simulate::{Noise, finer_model, measured};
use tactomo_touch::metrics::{Comparison, found_s_per_m2, truth_s_per_m2};
use tactomo_touch::solve::{Auto, FoundShape, Problem, Solution, Solver};

const SCENES: usize = 50;
const SMOOTHING_M: f64 = 0.002;
/// Frames of a scene with new noise.
const FRAMES: usize = 10;

type Made = Vec<Touch>;

/// A kind of scene.
struct Class {
    name: &'static str,
    make: fn(&mut fastrand::Rng) -> Made,
}

const CLASSES: [Class; 12] = [
    Class { name: "line, 25 - 45 mm", make: |random| line(random, [0.025, 0.045], [0.3, 3.0], 0.0) },
    Class { name: "line, 15 - 25 mm", make: |random| line(random, [0.015, 0.025], [0.3, 3.0], 0.0) },
    Class { name: "line, light", make: |random| line(random, [0.025, 0.045], [0.03, 0.3], 0.0) },
    Class { name: "line across an edge", make: |random| line(random, [0.025, 0.045], [0.3, 3.0], 0.3) },
    Class { name: "ring, radius 10 - 20 mm", make: |random| ring(random, [0.010, 0.020], [0.3, 3.0], 0.0) },
    Class { name: "ring, radius 8 - 10 mm", make: |random| ring(random, [0.008, 0.010], [0.3, 3.0], 0.0) },
    Class { name: "ring, light", make: |random| ring(random, [0.010, 0.020], [0.03, 0.3], 0.0) },
    Class { name: "ring across an edge", make: |random| ring(random, [0.010, 0.020], [0.3, 3.0], 0.3) },
    Class { name: "2 contacts, near", make: |random| row(random, 2) },
    Class { name: "3 contacts in a row", make: |random| row(random, 3) },
    Class { name: "1 or 2 contacts", make: |random| contacts(random, 1, 2) },
    Class { name: "3 to 5 contacts", make: |random| contacts(random, 3, 5) },
];

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let seed: u64 = words.next().map_or(Ok(1), |word| word.parse())?;
    let scenes: usize = words.next().map_or(Ok(SCENES), |word| word.parse())?;
    let only = words.next().unwrap_or_default();
    let detector = Detector::preset(Detector::DEFAULT).ok_or("no preset")?.taken_as_exact();
    let problem = Problem::of(&detector)?;
    let fine = finer_model(&detector, &[], seed)?;
    println!(
        "| scene | taken for | place, median / p90, mm | width, conductance: median error | within 1 / 2 sigma | correlation, mean / worst | misfit | first frame, next ones, ms |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for class in CLASSES.iter().filter(|class| class.name.contains(&only)) {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut tally = Tally::new(&problem);
        for _ in 0..scenes {
            let touches = (class.make)(&mut random);
            tally.add(&touches, &*fine, &problem, random.u64(..))?;
        }
        println!("| {} | {} |", class.name, tally.row());
    }
    Ok(())
}

fn log_uniform(random: &mut fastrand::Rng, [low, high]: [f64; 2]) -> f64 {
    low * (high / low).powf(random.f64())
}

fn sheet_s() -> f64 {
    Detector::default().sheet_conductance_s()
}

/// A bar whose share `beyond` at most lies beyond an edge; with 0 none does.
fn line(random: &mut fastrand::Rng, lengths_m: [f64; 2], sheets: [f64; 2], beyond: f64) -> Made {
    loop {
        let width_m = log_uniform(random, [0.0015, 0.006]);
        let length_m = (lengths_m[0] + (lengths_m[1] - lengths_m[0]) * random.f64()).max(4.0 * width_m);
        let angle_rad = TAU * random.f64();
        let centre_m = [0, 1].map(|_| 0.06 * (random.f64() - 0.5));
        let shape = Shape::Line { length_m, width_m, angle_rad };
        let touch = Touch::flat(centre_m, shape, sheet_s() * log_uniform(random, sheets));
        if is_within(&touch, beyond) {
            return vec![touch];
        }
    }
}

fn ring(random: &mut fastrand::Rng, radii_m: [f64; 2], sheets: [f64; 2], beyond: f64) -> Made {
    loop {
        let radius_m = radii_m[0] + (radii_m[1] - radii_m[0]) * random.f64();
        let width_m = log_uniform(random, [0.0015, 0.006]);
        let centre_m = [0, 1].map(|_| 0.05 * (random.f64() - 0.5));
        let touch = Touch::flat(centre_m, Shape::Ring { radius_m, width_m }, sheet_s() * log_uniform(random, sheets));
        if is_within(&touch, beyond) {
            return vec![touch];
        }
    }
}

/// What of a line is on the detector.
fn within(from: Point, to: Point) -> [Point; 2] {
    let at = |share: f64| [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
    let is_on = |share: &f64| at(*share).iter().all(|at_m| at_m.abs() <= 0.03);
    let mut shares = (0..=1000).map(|i| f64::from(i) / 1000.0).filter(is_on);
    let first = shares.next().unwrap_or(0.0);
    [at(first), at(shares.next_back().unwrap_or(1.0))]
}

/// Whether some, but no more than such a share of a touch, lies beyond the edges.
fn is_within(touch: &Touch, beyond: f64) -> bool {
    let inside = |[x, y]: &Point| x.abs() < 0.03 && y.abs() < 0.03;
    let all: Vec<_> = match touch.shape {
        Shape::Line { length_m, angle_rad, .. } => (0..=40)
            .map(|i| length_m * (f64::from(i) / 40.0 - 0.5))
            .map(|at| [touch.centre_m[0] + at * angle_rad.cos(), touch.centre_m[1] + at * angle_rad.sin()])
            .collect(),
        _ => touch.pieces().into_iter().flatten().collect(),
    };
    let share = all.iter().filter(|at| !inside(at)).count() as f64 / all.len() as f64;
    if beyond == 0.0 { share == 0.0 } else { share > 0.05 && share <= beyond }
}

/// Discs that do not touch each other.
fn contacts(random: &mut fastrand::Rng, least: usize, most: usize) -> Made {
    let count = random.usize(least..=most);
    let mut made: Made = Vec::new();
    while made.len() < count {
        let radius_m = log_uniform(random, [0.001, 0.006]);
        let centre_m = [0, 1].map(|_| (0.06 - 2.0 * radius_m) * (random.f64() - 0.5));
        let is_free = made.iter().all(|other| {
            let far_m = other.disc().map_or(0.0, |disc| disc.radius_m) + radius_m + 0.002;
            geometry::distance(centre_m, other.centre_m) > far_m
        });
        if is_free {
            let conductance_s = sheet_s() * log_uniform(random, [0.03, 10.0]);
            made.push(Touch::flat(centre_m, Shape::Disc { radius_m }, conductance_s));
        }
    }
    made
}

/// Discs of the same size, alike firm, on a line, each a half to a mean distance of electrodes from the next.
fn row(random: &mut fastrand::Rng, count: usize) -> Made {
    loop {
        let (sin, cos) = (TAU * random.f64()).sin_cos();
        let apart_m = 0.0075 * (1.0 + random.f64());
        let radius_m = log_uniform(random, [0.0015, 0.003]);
        let first_m = [0, 1].map(|_| 0.05 * (random.f64() - 0.5));
        let sheets = log_uniform(random, [0.03, 3.0]);
        let disc = |i: usize, firmness: f64| {
            let at_m = [first_m[0] + i as f64 * apart_m * cos, first_m[1] + i as f64 * apart_m * sin];
            Touch::flat(at_m, Shape::Disc { radius_m }, sheet_s() * sheets * firmness)
        };
        let made: Made = (0..count).map(|i| disc(i, 0.8 + 0.4 * random.f64())).collect();
        if made.iter().all(|touch| touch.centre_m.iter().all(|at_m| at_m.abs() < 0.027)) {
            return made;
        }
    }
}

/// What became of the scenes of a class.
struct Tally<'a> {
    comparison: Comparison,
    problem: &'a Problem,
    taken_for: Vec<(String, usize)>,
    places_m: Vec<f64>,
    widths: Vec<f64>,
    conductances: Vec<f64>,
    /// Errors in standard errors.
    sigmas: Vec<f64>,
    correlations: Vec<f64>,
    misfits: usize,
    first_s: Vec<f64>,
    next_s: Vec<f64>,
}

impl<'a> Tally<'a> {
    fn new(problem: &'a Problem) -> Self {
        Self {
            comparison: Comparison::new(&problem.jacobian.image_mesh, SMOOTHING_M),
            problem,
            taken_for: Vec::new(),
            places_m: Vec::new(),
            widths: Vec::new(),
            conductances: Vec::new(),
            sigmas: Vec::new(),
            correlations: Vec::new(),
            misfits: 0,
            first_s: Vec::new(),
            next_s: Vec::new(),
        }
    }

    fn add(
        &mut self,
        touches: &[Touch],
        fine: &dyn ForwardModel,
        problem: &Problem,
        seed: u64,
    ) -> Result<(), Box<dyn Error>> {
        let detector = problem.detector();
        let mesh = &problem.jacobian.image_mesh;
        let exact = readings_v(&touched_impedance_ohm(fine, touches)?, detector);
        let mut noise = Noise::new(seed);
        let mut solver = Auto::new(problem)?;
        let mut first = None;
        for frame in 0..FRAMES {
            let readings = measured(&exact, &detector.adc, &mut noise);
            let begun = Instant::now();
            let solution = solver.solve(&readings)?;
            let seconds = begun.elapsed().as_secs_f64();
            if frame == 0 {
                self.first_s.push(seconds);
                first = Some(solution);
            } else {
                self.next_s.push(seconds);
            }
        }
        let solution = first.ok_or("no frame")?;
        let image = found_s_per_m2(mesh, &solution, self.problem.spacing_m() / 6.0);
        let truth = truth_s_per_m2(mesh, touches)?;
        self.correlations.push(self.comparison.of(&truth, &image).correlation.unwrap_or(0.0));
        self.misfits += usize::from(solution.flags.misfit);
        self.note(&solution, touches);
        Ok(())
    }

    fn note(&mut self, solution: &Solution, touches: &[Touch]) {
        let what = solution.choice.as_ref().map(|choice| choice.what.clone()).unwrap_or_default();
        let what = if what.contains("contact") { "contacts".to_owned() } else { what };
        match self.taken_for.iter_mut().find(|(other, _)| *other == what) {
            Some((_, count)) => *count += 1,
            None => self.taken_for.push((what, 1)),
        }
        let (Some(shape), [touch]) = (&solution.shape, touches) else { return };
        let log = |found: f64, truth: f64| (found / truth).ln().abs();
        let touching_s = self.problem.jacobian.image_mesh.conductances_s(touches).map_or(0.0, |all| all.iter().sum());
        match (shape, &touch.shape) {
            (FoundShape::Line(found), Shape::Line { length_m, width_m, angle_rad }) => {
                let end = |sign: f64| {
                    let half_m = 0.5 * sign * length_m;
                    [touch.centre_m[0] + half_m * angle_rad.cos(), touch.centre_m[1] + half_m * angle_rad.sin()]
                };
                let [mut from, mut to] = within(end(-1.0), end(1.0));
                if geometry::distance(from, found.from_m) > geometry::distance(to, found.from_m) {
                    std::mem::swap(&mut from, &mut to);
                }
                self.places_m.extend([geometry::distance(from, found.from_m), geometry::distance(to, found.to_m)]);
                self.widths.push(log(found.width_m, *width_m));
                self.conductances.push(log(found.conductance_s, touching_s));
                if let Some(errors) = &found.uncertainty {
                    for axis in 0..2 {
                        self.sigmas.push((from[axis] - found.from_m[axis]).abs() / errors.from_m[axis]);
                        self.sigmas.push((to[axis] - found.to_m[axis]).abs() / errors.to_m[axis]);
                    }
                    self.sigmas.push((found.conductance_s - touching_s).abs() / errors.conductance_s);
                }
            }
            (FoundShape::Ring(found), Shape::Ring { radius_m, width_m }) => {
                let off_m = geometry::distance(found.centre_m, touch.centre_m);
                self.places_m.extend([off_m, (found.radius_m - radius_m).abs()]);
                self.widths.push(log(found.width_m, *width_m));
                self.conductances.push(log(found.conductance_s, touching_s));
                if let Some(errors) = &found.uncertainty {
                    for axis in 0..2 {
                        let off_m = (touch.centre_m[axis] - found.centre_m[axis]).abs();
                        self.sigmas.push(off_m / errors.centre_m[axis]);
                    }
                    self.sigmas.push((found.radius_m - radius_m).abs() / errors.radius_m);
                    self.sigmas.push((found.conductance_s - touching_s).abs() / errors.conductance_s);
                }
            }
            _ => {}
        }
    }

    fn row(mut self) -> String {
        self.taken_for.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let scenes: usize = self.taken_for.iter().map(|(_, count)| count).sum();
        let taken: Vec<_> = self
            .taken_for
            .iter()
            .map(|(what, count)| format!("{what} {:.0} %", 100.0 * *count as f64 / scenes as f64))
            .collect();
        let within = |sigmas: f64| {
            let count = self.sigmas.iter().filter(|off| **off <= sigmas).count();
            format!("{:.0}", 100.0 * count as f64 / self.sigmas.len().max(1) as f64)
        };
        let within = format!("{} / {} %", within(1.0), within(2.0));
        let worst = self.correlations.iter().copied().fold(1.0, f64::min);
        let mean = self.correlations.iter().sum::<f64>() / self.correlations.len().max(1) as f64;
        let rank = |values: &mut Vec<f64>, share: f64| {
            values.sort_by(f64::total_cmp);
            values.get((share * values.len().saturating_sub(1) as f64).round() as usize).copied().unwrap_or(f64::NAN)
        };
        format!(
            "{} | {:.2} / {:.2} | {:.0} %, {:.1} % | {within} | {mean:.2} / {worst:.2} | {} | {:.0}, p90 {:.0}; {:.1}, p90 {:.1}",
            taken.join(", "),
            1e3 * rank(&mut self.places_m, 0.5),
            1e3 * rank(&mut self.places_m, 0.9),
            100.0 * rank(&mut self.widths, 0.5),
            100.0 * rank(&mut self.conductances, 0.5),
            self.misfits,
            1e3 * rank(&mut self.first_s, 0.5),
            1e3 * rank(&mut self.first_s, 0.9),
            1e3 * rank(&mut self.next_s, 0.5),
            1e3 * rank(&mut self.next_s, 0.9),
        )
    }
}
