//! Which lambda suits linear images: `cargo run --release --package tactomo-lab --example lambda`.
//!
//! A slab of `square-60` in full depth is touched at nine places, lightly and firmly, and measured with 12 bits and 1.5 LSB of
//! noise. Each lambda then images the readings on two models: mean distance of the strongest contact found from the true one
//! (mm), and mean number of contacts found for one.

use anyhow::{Context, Result};
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::forward::shell::Shell;
use tactomo_physics::forward::{ForwardModel, Resolution, Slab, readings_v};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Noise, measured};
use tactomo_touch::solve::{Lambda, Solver, Tikhonov, Variant};

/// Conductance of a contact in sheet conductances: within the linear theory, and far beyond.
const FIRMNESS: [f64; 2] = [0.02, 1.0];
/// Places along a side, from the middle (m), off the electrodes' symmetry.
const PLACES_M: [f64; 3] = [-0.021, 0.002, 0.013];
/// Frames of each contact, with new noise each time.
const FRAMES: usize = 20;
const RADIUS_M: f64 = 0.002;
/// Lambda as shares of the largest singular value: decades, and more closely where the best one lies.
const SHARES: [f64; 13] = [1e-4, 1e-3, 3e-3, 0.01, 0.015, 0.02, 0.025, 0.03, 0.04, 0.05, 0.07, 0.1, 1.0];

/// Linear methods.
const FAMILIES: [&str; 4] = ["tikhonov", "tsvd", "noser", "laplace"];
/// Lambda chosen anew for each frame.
const CHOSEN: [(&str, Lambda); 4] = [
    ("discrepancy", Lambda::Discrepancy(1.0)),
    ("discrepancy, 3 times the noise", Lambda::Discrepancy(3.0)),
    ("L-curve", Lambda::LCurve),
    ("GCV", Lambda::Gcv),
];

/// A contact and frames of its readings.
struct Scene {
    truth: Contact,
    frames: Vec<Readings>,
}

/// Errors of one lambda, summed.
#[derive(Default)]
struct Score {
    error_m: f64,
    found: usize,
    missed: usize,
    frames: usize,
}

fn main() -> Result<()> {
    let detector = Detector::preset(Detector::DEFAULT).context("no preset")?.taken_as_exact();
    let [light, firm] = FIRMNESS.map(|firmness| scenes(&detector, firmness));
    let (light, firm) = (light?, firm?);
    let models: [Box<dyn ForwardModel>; 2] = [Box::new(Shell::new(&detector)?), Box::new(Slab::new(&detector)?)];
    for model in models {
        let jacobian = Jacobian::of(&*model);
        let paper = Tikhonov::new(&jacobian, Lambda::Paper(5000.0), Variant::Paper);
        println!("\n# {}; the paper's lambda^2 = 5000 is {:.2e} here", model.name(), relative(&paper));
        for name in FAMILIES {
            println!(
                "\n{name}\n\n| lambda | light, mm | found | firm, mm | found | mean, mm |\n|---|---|---|---|---|---|"
            );
            for share in SHARES {
                row(&format!("{share}"), solver(name, &jacobian, Lambda::Relative(share))?, &light, &firm)?;
            }
        }
        println!(
            "\ntikhonov, lambda chosen from the readings\n\n| lambda | light, mm | found | firm, mm | found | mean, mm |\n|---|---|---|---|---|---|"
        );
        for (name, lambda) in CHOSEN {
            row(name, solver("tikhonov", &jacobian, lambda)?, &light, &firm)?;
        }
    }
    Ok(())
}

/// A linear method by its name.
fn solver(name: &str, jacobian: &Jacobian, lambda: Lambda) -> Result<Box<dyn Solver>> {
    Ok(match (name, lambda) {
        ("tsvd", Lambda::Relative(share)) => Box::new(Tikhonov::truncated(jacobian, share)),
        ("noser", lambda) => Box::new(Tikhonov::noser(jacobian, lambda)),
        ("laplace", lambda) => Box::new(Tikhonov::laplace_with(jacobian, lambda)?),
        (_, lambda) => Box::new(Tikhonov::new(jacobian, lambda, Variant::Balanced)),
    })
}

/// Prints what a solver makes of light and of firm contacts.
fn row(name: &str, mut solver: Box<dyn Solver>, light: &[Scene], firm: &[Scene]) -> Result<()> {
    let (light, firm) = (score(&mut *solver, light)?, score(&mut *solver, firm)?);
    let mean_mm = (light.mean_mm() + firm.mean_mm()) / 2.0;
    println!("| {name} | {} | {} | {mean_mm:.1} |", light.columns(), firm.columns());
    Ok(())
}

/// Lambda as a share of the largest singular value.
fn relative(solver: &Tikhonov) -> f64 {
    solver.lambda().unwrap_or(f64::NAN) / solver.singular_values()[0]
}

/// Nine contacts of one firmness, as a slab finer than any that is inverted reads them.
fn scenes(detector: &Detector, firmness: f64) -> Result<Vec<Scene>> {
    let slab = Slab::with_resolution(detector, Resolution::FINE)?;
    let conductance_s = firmness * detector.sheet_conductance_s();
    let mut noise = Noise::new(1);
    let places = PLACES_M.iter().flat_map(|&x_m| PLACES_M.map(|y_m| (x_m, y_m)));
    places
        .map(|(x_m, y_m)| {
            let truth = Contact::flat(x_m, y_m, RADIUS_M, conductance_s);
            let readings = readings_v(&slab.impedance_ohm(&[truth])?, detector);
            let frames = (0..FRAMES).map(|_| measured(&readings, &detector.adc, &mut noise)).collect();
            Ok(Scene { truth, frames })
        })
        .collect()
}

fn score(solver: &mut dyn Solver, scenes: &[Scene]) -> Result<Score> {
    let mut score = Score::default();
    for (truth, readings) in scenes.iter().flat_map(|scene| scene.frames.iter().map(|frame| (&scene.truth, frame))) {
        let contacts = solver.solve(readings)?.contacts;
        score.frames += 1;
        score.found += contacts.len();
        match contacts.first() {
            Some(first) => score.error_m += (first.x_m - truth.x_m).hypot(first.y_m - truth.y_m),
            None => score.missed += 1,
        }
    }
    Ok(score)
}

impl Score {
    fn mean_mm(&self) -> f64 {
        1e3 * self.error_m / (self.frames - self.missed) as f64
    }

    fn columns(&self) -> String {
        format!("{:.1} | {:.1}", self.mean_mm(), self.found as f64 / self.frames as f64)
    }
}
