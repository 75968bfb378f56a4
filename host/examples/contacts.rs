//! How well contacts are found on `square-60` at 12 bits and 1.5 LSB of noise: at rest, alone, together, near to each other, with
//! an electrode dead; each from a cold start, on readings of a finer slab than the one that is fitted.
//!
//! `cargo run --release --example contacts -- [SOLVER] [TRIALS]`, by default `contacts` and 100.

use std::time::Instant;

use anyhow::Context;
use tactomo::detector::Detector;
use tactomo::forward::{ForwardModel, Resolution, Slab, readings_v};
use tactomo::metrics::Matching;
use tactomo::readings::Readings;
use tactomo::scene::Contact;
use tactomo::simulate::{Noise, measured};
use tactomo::solve::{Method, Problem, Solver};
use tactomo::study::cramer_rao;

const REST_FRAMES: usize = 10_000;
const RADIUS_M: f64 = 0.0025;

struct Bench {
    detector: Detector,
    fine: Slab,
    problem: Problem,
    method: Method,
    solver: Box<dyn Solver>,
    trials: usize,
    places: fastrand::Rng,
    noise: Noise,
}

/// What came out of some trials.
#[derive(Default)]
struct Outcome {
    trials: usize,
    right: usize,
    errors_m: Vec<f64>,
    conductance_errors: Vec<f64>,
    cold_us: Vec<f64>,
    warm_us: Vec<f64>,
}

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let method = arguments.next().map_or(Ok(Method::Contacts), |name| name.parse()).map_err(anyhow::Error::msg)?;
    let trials = arguments.next().map_or(Ok(100), |count| count.parse())?;
    let mut detector =
        Detector::preset(Detector::DEFAULT).context("the default detector is a preset")?.taken_as_exact();
    detector.adc.noise_lsb = 1.5;
    let slab: Box<dyn ForwardModel> = Box::new(Slab::new(&detector)?);
    let problem = Problem::new(slab);
    let mut bench = Bench {
        fine: Slab::with_resolution(&detector, Resolution::FINE)?,
        solver: method.build(&problem)?,
        method,
        problem,
        detector,
        trials,
        places: fastrand::Rng::with_seed(3),
        noise: Noise::new(7),
    };
    println!("{}: contacts invented in {REST_FRAMES} frames at rest: {}", method.name(), bench.at_rest()?);
    println!(
        "{:<34} {:>7} {:>28} {:>16} {:>16} {:>14}",
        "", "right %", "error mm: mean, median, p95", "conductance %", "cold us, p95", "next us, p95"
    );
    for sheets in [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0] {
        bench.report(&format!("one, {sheets} sheet conductances"), |bench| bench.scattered(1, sheets))?;
    }
    for sheets in [0.03, 0.3, 3.0] {
        for count in [2, 3, 5] {
            bench.report(&format!("{count} at least 10 mm apart, {sheets}"), |bench| bench.scattered(count, sheets))?;
        }
    }
    for sheets in [0.03, 0.3, 3.0] {
        for apart_m in [0.004, 0.006, 0.009, 0.012] {
            bench.report(&format!("two {} mm apart, {sheets}", 1e3 * apart_m), |bench| bench.pair(apart_m, sheets))?;
            let middle = bench.pair_at([0.003, 0.004], 0.6, apart_m, sheets);
            let bound = cramer_rao(&bench.fine, &middle, bench.detector.adc.deviation_v())?;
            let mean_m = bound.map(|all| all.iter().map(|one| one.position_m).sum::<f64>() / all.len() as f64);
            println!("{:<34} {:>7} {:>10.3}", "  Cramer-Rao bound, rms", "", 1e3 * mean_m.unwrap_or(f64::NAN));
        }
    }
    bench.each_dead()
}

impl Bench {
    fn frame(&mut self, exact: &Readings) -> Readings {
        measured(exact, &self.detector.adc, &mut self.noise)
    }

    /// Frames of noise about nothing, as rest is subtracted from them.
    fn at_rest(&mut self) -> anyhow::Result<usize> {
        let deviation_v = self.detector.adc.deviation_v();
        let mut invented = 0;
        for _ in 0..REST_FRAMES {
            let readings = Readings::from_fn(16, |_, _| deviation_v * self.noise.normal());
            invented += self.solver.solve(&readings)?.contacts.len();
        }
        Ok(invented)
    }

    fn place_m(&mut self, within_m: f64) -> [f64; 2] {
        [(); 2].map(|()| within_m * (2.0 * self.places.f64() - 1.0))
    }

    fn contact(&self, [x_m, y_m]: [f64; 2], radius_m: f64, sheets: f64) -> Contact {
        Contact::flat(x_m, y_m, radius_m, sheets * self.detector.sheet_conductance_s())
    }

    /// Contacts at least 10 mm apart and 3 mm from the edge, each of half to one and a half times a conductance if there are several.
    fn scattered(&mut self, count: usize, sheets: f64) -> Vec<Contact> {
        let mut all: Vec<Contact> = Vec::new();
        while all.len() < count {
            let [x_m, y_m] = self.place_m(0.027);
            let factor = if count == 1 { 1.0 } else { 0.5 + self.places.f64() };
            if all.iter().all(|other| (other.x_m - x_m).hypot(other.y_m - y_m) > 0.010) {
                all.push(self.contact([x_m, y_m], RADIUS_M, factor * sheets));
            }
        }
        all
    }

    /// Two small contacts of one conductance, in any direction.
    fn pair(&mut self, apart_m: f64, sheets: f64) -> Vec<Contact> {
        let (middle_m, angle) = (self.place_m(0.02), std::f64::consts::TAU * self.places.f64());
        self.pair_at(middle_m, angle, apart_m, sheets)
    }

    fn pair_at(&self, middle_m: [f64; 2], angle: f64, apart_m: f64, sheets: f64) -> Vec<Contact> {
        let half_m = [0.5 * apart_m * angle.cos(), 0.5 * apart_m * angle.sin()];
        let at = |sign: f64| [0, 1].map(|axis| middle_m[axis] + sign * half_m[axis]);
        [-1.0, 1.0].map(|sign| self.contact(at(sign), 0.6 * RADIUS_M, sheets)).into()
    }

    fn try_one(&mut self, truth: &[Contact], outcome: &mut Outcome) -> anyhow::Result<()> {
        let exact = readings_v(&self.fine.impedance_ohm(truth)?, &self.detector);
        let frames = [self.frame(&exact), self.frame(&exact)];
        self.solver.reset();
        let begin = Instant::now();
        let found = self.solver.solve(&frames[0])?.contacts;
        outcome.cold_us.push(1e6 * begin.elapsed().as_secs_f64());
        let begin = Instant::now();
        self.solver.solve(&frames[1])?;
        outcome.warm_us.push(1e6 * begin.elapsed().as_secs_f64());
        outcome.trials += 1;
        if found.len() == truth.len() {
            outcome.right += 1;
            let matching = Matching::within(f64::INFINITY, truth, &found);
            for pair in matching.pairs {
                outcome.errors_m.push(pair.distance_m);
                let ratio = found[pair.found].conductance_s / truth[pair.truth].conductance_s;
                outcome.conductance_errors.push((ratio - 1.0).abs());
            }
        }
        Ok(())
    }

    fn report(&mut self, name: &str, mut truth: impl FnMut(&mut Self) -> Vec<Contact>) -> anyhow::Result<()> {
        let mut outcome = Outcome::default();
        for _ in 0..self.trials {
            let truth = truth(self);
            self.try_one(&truth, &mut outcome)?;
        }
        outcome.print(name);
        Ok(())
    }

    /// Mean errors of a contact with each electrode left out in turn, over that with all.
    fn each_dead(&mut self) -> anyhow::Result<()> {
        let all: Vec<usize> = (0..16).collect();
        let mut errors_m = Vec::new();
        for dead in [None].into_iter().chain(all.iter().copied().map(Some)) {
            let kept: Vec<_> = all.iter().copied().filter(|e| Some(*e) != dead).collect();
            let mut solver = self.method.build(&self.problem.through(&kept, &[]))?;
            (self.places, self.noise) = (fastrand::Rng::with_seed(5), Noise::new(9));
            let mut sum_m = 0.0;
            for _ in 0..self.trials {
                let truth = self.scattered(1, 0.3);
                let exact = readings_v(&self.fine.impedance_ohm(&truth)?, &self.detector);
                let frame = self.frame(&exact);
                solver.reset();
                let found = solver.solve(&frame.of(&kept))?.contacts;
                sum_m += Matching::within(f64::INFINITY, &truth, &found).ospa_m(0.03);
            }
            errors_m.push(sum_m / self.trials as f64);
        }
        let (with_all_m, worst_m) = (errors_m[0], errors_m[1..].iter().copied().fold(0.0, f64::max));
        let mean_m = errors_m[1..].iter().sum::<f64>() / 16.0;
        println!(
            "one electrode dead, 0.3: {:.3} mm with all, {:.2} times that in the mean, {:.2} with the worst dead",
            1e3 * with_all_m,
            mean_m / with_all_m,
            worst_m / with_all_m
        );
        Ok(())
    }
}

impl Outcome {
    fn print(&mut self, name: &str) {
        let mean_mm = 1e3 * self.errors_m.iter().sum::<f64>() / self.errors_m.len() as f64;
        let errors = [0.5, 0.95].map(|share| 1e3 * quantile(&mut self.errors_m, share));
        let conductances = [0.5, 0.95].map(|share| 100.0 * quantile(&mut self.conductance_errors, share));
        let [cold, next] =
            [&mut self.cold_us, &mut self.warm_us].map(|us| [0.5, 0.95].map(|share| quantile(us, share)));
        println!(
            "{name:<34} {:>7.1} {mean_mm:>10.3} {:>8.3} {:>8.3} {:>8.1} {:>7.1} {:>8.0} {:>7.0} {:>7.0} {:>6.0}",
            100.0 * self.right as f64 / self.trials as f64,
            errors[0],
            errors[1],
            conductances[0],
            conductances[1],
            cold[0],
            cold[1],
            next[0],
            next[1]
        );
    }
}

fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(((values.len().max(1) - 1) as f64 * share).round() as usize).copied().unwrap_or(f64::NAN)
}
