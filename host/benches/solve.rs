//! Solvers: making them, and a frame.

use divan::{Bencher, black_box};
use tactomo::detector::Detector;
use tactomo::forward::{ForwardModel, Slab, readings_v};
use tactomo::readings::Readings;
use tactomo::scene::Contact;
use tactomo::solve::{Lambda, Method, Problem, Tikhonov, Variant};

fn main() {
    divan::main();
}

fn problem() -> Problem {
    let Some(Ok(slab)) = Detector::preset(Detector::DEFAULT).map(|detector| Slab::new(&detector.taken_as_exact()))
    else {
        unreachable!("a preset")
    };
    Problem::new(std::sync::Arc::new(slab) as std::sync::Arc<dyn ForwardModel>)
}

/// Readings of two firm contacts.
fn readings(problem: &Problem) -> Readings {
    let contacts = [Contact::flat(0.012, 0.004, 0.002, 1e-3), Contact::flat(-0.015, -0.008, 0.003, 3e-4)];
    let impedance_ohm = problem.model.impedance_ohm(&contacts);
    readings_v(&impedance_ohm.unwrap_or_else(|error| unreachable!("{error}")), problem.detector())
}

/// Ready for frames, the model being there.
#[divan::bench(args = Method::ALL.map(Method::name))]
fn set_up(bencher: Bencher, name: &str) {
    let (problem, method) = (problem(), method(name));
    bencher.bench(|| method.build(black_box(&problem)).map(|solver| solver.name()));
}

/// A frame, image and contacts, after frames like it.
#[divan::bench(args = Method::ALL.map(Method::name))]
fn frame(bencher: Bencher, name: &str) {
    let problem = problem();
    let mut solver = method(name).build(&problem).unwrap_or_else(|error| unreachable!("{error}"));
    let readings = readings(&problem);
    let _warm = [(); 5].map(|()| solver.solve(&readings));
    bencher.bench_local(|| solver.solve(black_box(&readings)));
}

/// The linear image alone.
#[divan::bench]
fn linear_image(bencher: Bencher) {
    let problem = problem();
    let (solver, readings) = (tikhonov(&problem, Lambda::default()), readings(&problem));
    bencher.bench_local(|| solver.image_s_per_m2(black_box(&readings)));
}

/// The same with lambda chosen from the readings.
#[divan::bench(args = ["discrepancy", "l-curve", "gcv"])]
fn linear_image_with_chosen_lambda(bencher: Bencher, rule: &str) {
    let problem = problem();
    let lambda = match rule {
        "discrepancy" => Lambda::Discrepancy(1.0),
        "l-curve" => Lambda::LCurve,
        _ => Lambda::Gcv,
    };
    let (solver, readings) = (tikhonov(&problem, lambda), readings(&problem));
    bencher.bench_local(|| solver.image_s_per_m2(black_box(&readings)));
}

fn tikhonov(problem: &Problem, lambda: Lambda) -> Tikhonov {
    Tikhonov::new(&problem.jacobian, lambda, Variant::Balanced)
}

fn method(name: &str) -> Method {
    name.parse().unwrap_or_else(|error| unreachable!("{error}"))
}
