//! What averaging does to one contact that stands, moves at some speeds, or is pressed harder and harder, light and firm: `square-60`
//! at 12 bits, 1.5 LSB and 1200 frames/s, on readings of a finer model than the one that is fitted. `alone` is the error of each frame
//! by itself; shares are within one and two claimed standard errors.
//!
//! `cargo run --release -p tactomo-lab --example motion -- [PATHS]`, by default 6.

use std::time::Instant;

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardModel, readings_v};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Noise, finer_model, measured};
use tactomo_touch::solve::{ContactSettings, Contacts, FoundContact, Problem, Solver};

/// Frames a second.
const RATE_HZ: f64 = 1200.0;
/// Frames of a path at most, and the length of one (m).
const FRAMES: usize = 300;
const LONGEST_M: f64 = 0.030;
/// Frames that do not count, while the contact is found.
const SETTLED: usize = 20;

/// Errors of a contact, with their claimed standard errors.
#[derive(Default)]
struct Errors {
    places_m: Vec<[f64; 2]>,
    logs: Vec<[f64; 2]>,
    missed: usize,
}

impl Errors {
    fn note(&mut self, truth: &Contact, found: &[FoundContact]) {
        let [found] = found else {
            self.missed += 1;
            return;
        };
        let Some(uncertainty) = found.uncertainty else { return };
        self.places_m.push([found.x_m - truth.x_m, uncertainty.x_m]);
        self.places_m.push([found.y_m - truth.y_m, uncertainty.y_m]);
        let log = (found.conductance_s / truth.conductance_s).ln();
        self.logs.push([log, uncertainty.conductance_s / found.conductance_s]);
    }
}

fn rms(errors: &[[f64; 2]]) -> f64 {
    (errors.iter().map(|[error, _]| error * error).sum::<f64>() / errors.len().max(1) as f64).sqrt()
}

/// Share within so many standard errors (per cent).
fn within(errors: &[[f64; 2]], many: f64) -> f64 {
    let inside = errors.iter().filter(|[error, sigma]| error.abs() < many * sigma).count();
    100.0 * inside as f64 / errors.len().max(1) as f64
}

struct Bench {
    detector: Detector,
    fine: Box<dyn ForwardModel>,
    solver: Contacts,
    alone: Contacts,
    noise: Noise,
}

impl Bench {
    fn new() -> Result<Self, Box<dyn std::error::Error>> {
        let mut detector = Detector::default().taken_as_exact();
        detector.adc.noise_lsb = 1.5;
        let problem = Problem::of(&detector)?;
        let settings = ContactSettings { most: 1, ..ContactSettings::of(&problem) };
        Ok(Self {
            fine: finer_model(&detector, &[], 1)?,
            solver: Contacts::new(&problem, settings)?,
            alone: Contacts::new(&problem, settings)?,
            detector,
            noise: Noise::new(8),
        })
    }

    fn frame(&mut self, contact: &Contact) -> Result<Readings, Box<dyn std::error::Error>> {
        let exact = readings_v(&self.fine.impedance_ohm(&[*contact])?, &self.detector);
        Ok(measured(&exact, &self.detector.adc, &mut self.noise))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths = std::env::args().nth(1).map_or(Ok(6), |count| count.parse())?;
    let mut bench = Bench::new()?;
    println!(
        "{:>7} {:>6} {:>7} | {:>9} {:>9} {:>8} {:>8} {:>10} | {:>8} {:>8} {:>10} | {:>6} {:>8}",
        "sheets",
        "mm/s",
        "ln C/s",
        "alone mm",
        "error mm",
        "ratio",
        "sigma",
        "1s, 2s",
        "ln C",
        "ratio",
        "1s, 2s",
        "missed",
        "us"
    );
    for sheets in [0.01, 0.03, 0.3, 3.0] {
        for (speed_m_per_s, pressing_per_s) in [
            (0.0, 0.0),
            (0.001, 0.0),
            (0.002, 0.0),
            (0.005, 0.0),
            (0.02, 0.0),
            (0.1, 0.0),
            (0.3, 0.0),
            (0.0, 0.3),
            (0.0, 1.0),
            (0.0, 5.0),
        ] {
            report(&mut bench, sheets, speed_m_per_s, pressing_per_s, paths)?;
        }
    }
    Ok(())
}

fn report(
    bench: &mut Bench,
    sheets: f64,
    speed_m_per_s: f64,
    pressing_per_s: f64,
    paths: usize,
) -> Result<(), Box<dyn std::error::Error>> {
    let (mut averaged, mut alone, mut times_us) = (Errors::default(), Errors::default(), Vec::new());
    let step_m = speed_m_per_s / RATE_HZ;
    let frames = FRAMES.min((LONGEST_M / step_m.max(1e-9)) as usize);
    for path in 0..paths {
        let way = 2.4 * path as f64;
        let (sin, cos) = way.sin_cos();
        bench.solver.reset();
        for frame in 0..frames {
            let along_m = step_m * (frame as f64 - 0.5 * frames as f64);
            let strength = (pressing_per_s * frame as f64 / RATE_HZ).exp();
            let conductance_s = sheets * bench.detector.sheet_conductance_s() * strength;
            let contact =
                Contact::flat(0.005 * sin + along_m * cos, -0.004 * cos + along_m * sin, 0.0025, conductance_s);
            let readings = bench.frame(&contact)?;
            let begin = Instant::now();
            let solution = bench.solver.solve(&readings)?;
            times_us.push(1e6 * begin.elapsed().as_secs_f64());
            if frame < SETTLED {
                continue;
            }
            averaged.note(&contact, &solution.contacts);
            if frame % 8 == 0 {
                bench.alone.reset();
                alone.note(&contact, &bench.alone.solve(&readings)?.contacts);
            }
        }
    }
    times_us.sort_unstable_by(f64::total_cmp);
    let sigma: Vec<_> = averaged.places_m.iter().map(|[_, sigma]| [*sigma, 0.0]).collect();
    println!(
        "{sheets:>7} {:>6} {pressing_per_s:>7} | {:>9.4} {:>9.4} {:>8.2} {:>8.4} {:>4.0} / {:>3.0} | {:>8.3} {:>8.2} {:>4.0} / {:>3.0} | {:>6} {:>8.0}",
        1e3 * speed_m_per_s,
        1e3 * rms(&alone.places_m),
        1e3 * rms(&averaged.places_m),
        rms(&averaged.places_m) / rms(&alone.places_m),
        1e3 * rms(&sigma),
        within(&averaged.places_m, 1.0),
        within(&averaged.places_m, 2.0),
        rms(&averaged.logs),
        rms(&averaged.logs) / rms(&alone.logs),
        within(&averaged.logs, 1.0),
        within(&averaged.logs, 2.0),
        averaged.missed,
        times_us[times_us.len() / 2]
    );
    Ok(())
}
