//! How well single contacts are found on detectors of any shape at 12 bits and 1.5 LSB of noise, each from a cold start and then
//! followed as it moves, on readings of a finer model than the one that is fitted.
//!
//! `cargo run --release -p tactomo-lab --example contacts_anywhere -- [TRIALS]`, by default 40.

use std::path::Path;
use std::time::Instant;

use tactomo_physics::detector::{Detector, Layer};
use tactomo_physics::forward::{Auto, readings_v};
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Noise, finer_model, measured};
use tactomo_physics::space;
use tactomo_touch::solve::{ContactSettings, Contacts, Problem, Solver};

/// Length of a step of a contact that is followed, in radii.
const STEP: f64 = 0.03;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let trials = std::env::args().nth(1).map_or(Ok(40), |count| count.parse())?;
    println!(
        "{:<16} {:>7} {:>22} {:>16} {:>10} {:>10} {:>10} {:>12}",
        "single", "right %", "error %: mean, p95", "conductance %", "made ms", "cold us", "step us", "forward us"
    );
    for detector in detectors()? {
        for sheets in [0.03, 0.3, 3.0] {
            report(&detector, sheets, trials)?;
        }
    }
    Ok(())
}

fn detectors() -> Result<Vec<Detector>, Box<dyn std::error::Error>> {
    let preset = |name: &str| Detector::preset(name).ok_or_else(|| format!("no preset {name}"));
    let mut thin = preset("square-60")?;
    thin.layers = vec![Layer::uniform(0.0004, 0.2273)];
    thin.name = "thin shell".to_owned();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host/examples/detectors");
    let example = |name: &str| Detector::read(&folder.join(name));
    let mut all = vec![thin, example("l-shape.toml")?, example("fingertip.toml")?, preset("square-60")?];
    all.iter_mut().for_each(|detector| detector.adc.noise_lsb = 1.5);
    Ok(all)
}

/// Larger side of what the detector would be put into (m).
fn width_m(detector: &Detector) -> f64 {
    detector.outline.size_m().into_iter().fold(0.0, f64::max)
}

fn report(detector: &Detector, sheets: f64, trials: usize) -> Result<(), Box<dyn std::error::Error>> {
    let fine = finer_model(detector, &[], 1)?;
    let problem = Problem::new(Auto::new(&detector.taken_as_exact(), None)?.model);
    let settings = ContactSettings::of(&problem);
    let begin = Instant::now();
    let mut solver = Contacts::new(&problem, settings)?;
    let made_ms = 1e3 * begin.elapsed().as_secs_f64();
    let fields = problem.model.spots(settings.radius_m).ok_or("no spots")?;
    let (mut places, mut noise) = (fastrand::Rng::with_seed(21), Noise::new(8));
    let (mut right, mut errors, mut off, mut cold, mut step, mut forward) =
        (0, Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mesh = problem.model.image_mesh();
    let areas_m2 = mesh.triangle_areas_m2();
    let area_m2: f64 = areas_m2.iter().sum();
    for _ in 0..trials {
        let mut left_m2 = area_m2 * places.f64();
        let triangle = areas_m2.iter().position(|part_m2| {
            left_m2 -= part_m2;
            left_m2 <= 0.0
        });
        let at = space::middle(mesh.triangles[triangle.unwrap_or_default()].map(|node| mesh.place_m(node as usize)));
        let (mut place_m, along) = fields.footing(at);
        let conductance_s = sheets * detector.sheet_conductance_s();
        solver.reset();
        for count in 0..5 {
            let [x_m, y_m, z_m] = place_m;
            let truth = Contact { z_m, ..Contact::flat(x_m, y_m, settings.radius_m, conductance_s) };
            let exact = readings_v(&fine.impedance_ohm(&[truth])?, detector);
            let frame = measured(&exact, &detector.adc, &mut noise);
            let begin = Instant::now();
            let found = solver.solve(&frame)?.contacts;
            if count == 0 { &mut cold } else { &mut step }.push(1e6 * begin.elapsed().as_secs_f64());
            let begin = Instant::now();
            problem.model.impedance_ohm(&[truth])?;
            forward.push(1e6 * begin.elapsed().as_secs_f64());
            if let [one] = found[..] {
                right += 1;
                let error_m = space::distance([one.x_m, one.y_m, one.z_m], place_m);
                errors.push(100.0 * error_m / width_m(detector));
                off.push(100.0 * (one.conductance_s / conductance_s - 1.0).abs());
            }
            place_m = fields.footing(space::along(place_m, STEP * settings.radius_m, along[0])).0;
        }
    }
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    println!(
        "{:<16} {:>7.1} {:>14.3} {:>7.3} {:>8.1} {:>7.1} {:>10.0} {:>10.0} {:>10.0} {:>12.0}   {} sheets",
        detector.name,
        100.0 * f64::from(right) / (5 * trials) as f64,
        mean,
        quantile(&mut errors, 0.95),
        quantile(&mut off, 0.5),
        quantile(&mut off, 0.95),
        made_ms,
        quantile(&mut cold, 0.5),
        quantile(&mut step, 0.5),
        quantile(&mut forward, 0.5),
        sheets
    );
    Ok(())
}

fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(((values.len().max(1) - 1) as f64 * share).round() as usize).copied().unwrap_or(f64::NAN)
}
