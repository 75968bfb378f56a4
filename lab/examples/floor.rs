//! Presses of 0.02 to 10 N through the floor of an ESP32's converters: how many contacts are found, and how far off.
//!
//! `cargo run --release -p tactomo-lab --example floor -- [PLACES [SEED]]`, by default 30 places, seed 1. A ball of 5 mm presses the paper's
//! sample A. Below its floor a converter tells that alone, in the way that the ESP32's do: 142 mV of the first (electrodes 0 to 5), 128 mV
//! of the second. Beside it the same with the number taken as the voltage, and without a floor.

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardModel, readings_v};
use tactomo_physics::hertz::Hertz;
use tactomo_physics::readings::{Range, Readings, Says};
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Noise, finer_model, measured};
use tactomo_touch::solve::{Method, Problem, Solver};

/// Forces (N).
const FORCES_N: [f64; 9] = [0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0];
/// Radius of the ball (m).
const BALL_M: f64 = 0.005;
/// Floors of the two converters (V), and the electrodes of the first.
const FLOORS_V: [f64; 2] = [0.142, 0.128];
const FIRST: usize = 6;
/// Standard deviations of the noise above the floor up to which a reading counts as at it.
const MARGIN: f64 = 2.0;

struct Bench {
    detector: Detector,
    fine: Box<dyn ForwardModel>,
    problem: Problem,
    noise: Noise,
}

/// How readings are told.
#[derive(Clone, Copy)]
enum Told {
    Bounds,
    Numbers,
    NoFloor,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let argument = |index: usize, default: u64| std::env::args().nth(index).map_or(Ok(default), |text| text.parse());
    let (places, seed) = (argument(1, 30)?, argument(2, 1)?);
    let mut detector = Detector::preset(Detector::DEFAULT).ok_or("no preset")?.taken_as_exact();
    detector.adc.noise_lsb = 1.5;
    let fine = finer_model(&detector, &[], seed)?;
    let problem = Problem::of(&detector)?;
    let mut bench = Bench { fine, problem, noise: Noise::new(seed), detector };
    for (name, told) in [("bounds", Told::Bounds), ("numbers", Told::Numbers), ("no floor", Told::NoFloor)] {
        println!(
            "{name:<9} {:>8} {:>7} {:>9} {:>8} {:>8} {:>8}",
            "N", "one %", "misfit %", "median mm", "p95 mm", "above"
        );
        for force_n in FORCES_N {
            bench.report(force_n, told, places, seed)?;
        }
    }
    Ok(())
}

impl Bench {
    fn report(&mut self, force_n: f64, told: Told, places: u64, seed: u64) -> Result<(), Box<dyn std::error::Error>> {
        let mut random = fastrand::Rng::with_seed(seed);
        let [width_m, height_m] = self.detector.outline.size_m();
        let imprint = Hertz::of_sample_a(&self.detector).ball(BALL_M, force_n);
        let (mut ones, mut misfits, mut errors_mm, mut above) = (0, 0, Vec::new(), 0);
        for _ in 0..places {
            let [x_m, y_m] = [width_m, height_m].map(|side_m| 0.8 * side_m * (random.f64() - 0.5));
            let truth = Contact::flat(x_m, y_m, imprint.half_width_m, imprint.conductance_s);
            let readings = self.readings(truth, told)?;
            let n = readings.electrodes();
            above += (0..n * n).filter(|i| readings.says(i / n, i % n) == Says::Voltage).count();
            let mut solver: Box<dyn Solver> = Method::Contacts.build(&self.problem)?;
            let solution = solver.solve(&readings)?;
            misfits += u64::from(solution.flags.misfit);
            if let [found] = solution.contacts[..] {
                ones += 1;
                errors_mm.push(1e3 * (found.x_m - x_m).hypot(found.y_m - y_m));
            }
        }
        errors_mm.sort_by(f64::total_cmp);
        let at = |share: f64| errors_mm.get((share * (errors_mm.len() as f64 - 1.0)) as usize).copied();
        let [median, p95] = [0.5, 0.95].map(|share| at(share).unwrap_or(f64::NAN));
        let percent = |count: u64| 100.0 * count as f64 / places as f64;
        println!(
            "{:<9} {force_n:>8} {:>7.0} {:>9.0} {median:>8.3} {p95:>8.3} {:>8.0}",
            "",
            percent(ones),
            percent(misfits),
            above as f64 / places as f64
        );
        Ok(())
    }

    fn readings(&mut self, contact: Contact, told: Told) -> Result<Readings, Box<dyn std::error::Error>> {
        let exact = readings_v(&self.fine.impedance_ohm(&[contact])?, &self.detector);
        let noisy = measured(&exact, &self.detector.adc, &mut self.noise);
        let floor_v = |e: usize| FLOORS_V[usize::from(e >= FIRST)];
        let clipped = Readings::from_fn(noisy.electrodes(), |g, e| noisy.at(g, e).max(floor_v(e)));
        let margin_v = MARGIN * self.detector.adc.deviation_v();
        let range = |e: usize| Range { floor_v: floor_v(e) + margin_v, ceiling_v: f64::INFINITY };
        Ok(match told {
            Told::Bounds => clipped.within(&(0..noisy.electrodes()).map(range).collect::<Vec<_>>()),
            Told::Numbers => clipped,
            Told::NoFloor => noisy,
        })
    }
}
