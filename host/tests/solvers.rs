//! What holds for every solver there is, whatever the readings.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use std::cell::RefCell;
use std::sync::LazyLock;

use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use tactomo::detector::Detector;
use tactomo::forward::{ForwardModel, shell::Shell};
use tactomo::forward::{Resolution, Slab, readings_v};
use tactomo::readings::Readings;
use tactomo::scene::Contact;
use tactomo::simulate::{Noise, measured};
use tactomo::solve::{FaultTolerant, Method, Problem, Solution, SolveError, Solver};
use tactomo_physics::threads;

/// Frames of the same readings, one after the other, for what is believed only when it is said again.
const FRAMES: usize = 10;

/// The model that rectangles are inverted with, and a shell as other outlines need it.
static PROBLEMS: LazyLock<[Problem; 2]> = LazyLock::new(|| {
    let detector = detector();
    let slab: Box<dyn ForwardModel> = Box::new(Slab::new(&detector).unwrap());
    let shell: Box<dyn ForwardModel> = Box::new(Shell::with_nodes(&detector, 500).unwrap());
    [Problem::new(slab), Problem::new(shell)]
});

fn detector() -> Detector {
    Detector::preset(Detector::DEFAULT).unwrap().taken_as_exact()
}

/// Tries all solvers that the model serves, which on the slab are all there are, on all cores.
fn try_each(problem: &Problem, try_it: impl Fn(&mut dyn Solver) + Sync) {
    threads::map(&Method::ALL, |method| match method.build(problem) {
        Ok(mut solver) => try_it(&mut *solver),
        Err(error) => assert_ne!(problem.model.name(), "slab", "{}: {error}", method.name()),
    });
}

/// A solver as `live` runs it.
fn guarded(problem: &Problem) -> Box<dyn Solver> {
    Box::new(FaultTolerant::new(Method::Tikhonov, problem).unwrap())
}

/// A solution that a page can draw and a robot act on.
fn assert_sane(name: &str, problem: &Problem, solution: &Solution) {
    let size_m = problem.detector().outline.size_m();
    if let Some(image) = &solution.image_s_per_m2 {
        assert_eq!(image.len(), problem.jacobian.image_mesh.nodes_m.len(), "{name}");
        assert!(image.iter().all(|value| value.is_finite()), "{name}: an image that is not finite");
    }
    assert!(solution.contacts.len() <= 50, "{name}: {} contacts", solution.contacts.len());
    for found in &solution.contacts {
        let beside =
            [found.x_m, found.y_m].iter().zip(size_m).any(|(at, size)| at.abs().is_nan() || at.abs() > 0.51 * size);
        assert!(!beside && found.z_m == 0.0, "{name}: {found:?}");
        assert!(found.conductance_s.is_finite() && found.conductance_s >= 0.0, "{name}: {found:?}");
        assert!(found.radius_m.is_none_or(|radius_m| (0.0..1.0).contains(&radius_m)), "{name}: {found:?}");
        assert!(found.force_n.is_none_or(f64::is_finite), "{name}: {found:?}");
        if let Some(error) = found.uncertainty {
            let all = [error.x_m, error.y_m, error.conductance_s, error.correlation];
            assert!(all.iter().all(|value| value.is_finite()) && error.correlation.abs() <= 1.0, "{name}: {found:?}");
        }
    }
    assert!(
        solution.residual.is_none_or(|residual| residual.is_finite() && residual >= 0.0),
        "{name}: {:?}",
        solution.residual
    );
}

fn all(volts: impl Fn(usize, usize) -> f64) -> Readings {
    Readings::from_fn(16, volts)
}

/// Readings that no detector gives, or that say nothing.
fn odd_readings() -> Vec<Readings> {
    let one = |value: f64| all(move |g, e| if (g, e) == (3, 11) { value } else { 0.0 });
    vec![
        all(|_, _| 0.0),
        all(|_, _| -0.0),
        all(|_, _| 3.3),
        all(|_, _| 2.0),
        all(|_, _| 1.0),
        all(|_, _| -1.0),
        all(|_, _| 1e-300),
        all(|_, _| 1e300),
        all(|_, _| f64::MAX),
        all(|g, e| if (g + e) % 2 == 0 { f64::MAX } else { f64::MIN }),
        all(|g, e| [0.4, 1e260, 2.4, 3.3, -0.3, 0.1, 1e-200][(5 * g + e) % 7]),
        all(|g, e| if g == e { 0.0 } else { 2.0 }),
        all(|g, _| if g == 5 { 2.0 } else { 0.0 }),
        all(|_, e| if e == 5 { 2.0 } else { 0.0 }),
        one(2.0),
        one(-2.0),
        one(1e12),
    ]
}

fn any_volts() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => -0.5..2.5,
        2 => prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO,
        1 => Just(0.0),
        1 => Just(3.3),
    ]
}

/// Readings of a few levels, of a board's range, or of anything that is a number.
fn any_readings() -> impl Strategy<Value = Readings> {
    let of = |volts: BoxedStrategy<f64>| {
        prop::collection::vec(volts, 256).prop_map(|volts| Readings::new(16, volts).unwrap())
    };
    prop_oneof![
        of(any_volts().boxed()),
        of((0.0..2.0).boxed()),
        of((-0.003..0.003).boxed()),
        of(prop_oneof![Just(0.0), Just(2.0)].boxed()),
    ]
}

/// A contact as a finer slab reads it, with noise.
fn touched(seed: u64) -> Readings {
    let detector = detector();
    let slab = Slab::with_resolution(&detector, Resolution::FINE).unwrap();
    let conductance_s = detector.sheet_conductance_s();
    let impedance_ohm = slab.impedance_ohm(&[Contact::flat(0.011, -0.004, 0.002, conductance_s)]).unwrap();
    measured(&readings_v(&impedance_ohm, &detector), &detector.adc, &mut Noise::new(seed))
}

#[test]
fn odd_readings_are_answered_sanely() {
    for problem in &*PROBLEMS {
        try_each(problem, |solver| {
            for readings in odd_readings() {
                let solution = solver.solve(&readings).unwrap();
                assert_sane(solver.name(), problem, &solution);
            }
        });
    }
    threads::map(&*PROBLEMS, |problem| {
        let mut guarded = guarded(problem);
        for readings in odd_readings().iter().flat_map(|readings| std::iter::repeat_n(readings, FRAMES)) {
            assert_sane("guarded", problem, &guarded.solve(readings).unwrap());
        }
    });
}

#[test]
fn wrong_counts_and_no_numbers_are_refused_and_forgotten() {
    let touched = touched(1);
    try_each(&PROBLEMS[0], |solver| {
        let sound = solver.solve(&touched).unwrap();
        let few = solver.solve(&Readings::from_fn(4, |_, _| 0.1));
        assert_eq!(few, Err(SolveError::Electrodes { found: 4, expected: 16 }), "{}", solver.name());
        let none = solver.solve(&Readings::from_fn(0, |_, _| 0.1));
        assert_eq!(none, Err(SolveError::Electrodes { found: 0, expected: 16 }), "{}", solver.name());
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let told = solver.solve(&all(|g, e| if (g, e) == (3, 5) { bad } else { 0.1 }));
            assert_eq!(told, Err(SolveError::NotFinite { g: 3, e: 5 }), "{}", solver.name());
        }
        solver.reset();
        assert_eq!(solver.solve(&touched).unwrap(), sound, "{}", solver.name());
    });
}

#[test]
fn after_a_reset_the_answer_is_a_new_solvers() {
    let frames: Vec<_> = (1..4).map(touched).chain([all(|_, _| 1.7), all(|_, _| 0.0)]).collect();
    threads::map(&Method::ALL, |method| {
        let [mut used, mut new] = [(); 2].map(|()| method.build(&PROBLEMS[0]).unwrap());
        for readings in &frames {
            used.solve(readings).unwrap();
        }
        used.reset();
        for readings in &frames {
            assert_eq!(used.solve(readings), new.solve(readings), "{}", new.name());
        }
    });
}

/// Frames of nothing, less their mean, as the readings at rest are taken off. A converter gives no code below zero, so they are
/// not normal.
fn frames_at_rest(count: usize) -> Vec<Readings> {
    let (adc, mut noise) = (detector().adc, Noise::new(5));
    let mut frames: Vec<_> = (0..count).map(|_| measured(&all(|_, _| 0.0), &adc, &mut noise)).collect();
    let mean = |index: usize| frames.iter().map(|frame| frame.volts()[index]).sum::<f64>() / count as f64;
    let means: Vec<f64> = (0..256).map(mean).collect();
    for frame in &mut frames {
        frame.volts_mut().iter_mut().zip(&means).for_each(|(volts, mean)| *volts -= mean);
    }
    frames
}

#[test]
fn a_contact_is_found_and_rest_is_none() {
    let rest = frames_at_rest(100);
    try_each(&PROBLEMS[0], |solver| {
        let name = solver.name();
        assert!(!solver.solve(&touched(1)).unwrap().contacts.is_empty(), "{name}");
        solver.reset();
        for frame in &rest {
            assert_eq!(solver.solve(frame).unwrap().contacts, [], "{name}: noise is no contact");
        }
    });
}

#[test]
fn names_are_those_of_the_command_line() {
    for method in Method::ALL {
        assert_eq!(method.name(), method.build(&PROBLEMS[0]).unwrap().name());
        assert_eq!(method.name().parse(), Ok(method));
        assert!(!method.explanation().is_empty());
    }
}

#[test]
fn any_readings_are_answered_sanely() {
    // Few methods take most of the time: each is tried on all cores.
    threads::map(&[30, 30], |&cases| {
        for method in Method::ALL {
            answers_any_readings_sanely(&mut *method.build(&PROBLEMS[0]).unwrap(), cases);
        }
        answers_any_readings_sanely(&mut *guarded(&PROBLEMS[0]), cases);
    });
}

fn answers_any_readings_sanely(solver: &mut dyn Solver, cases: u32) {
    let solver = RefCell::new(solver);
    let config = ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() };
    let frames = prop::collection::vec(any_readings(), 1..3);
    let outcome = TestRunner::new(config).run(&frames, |frames| {
        let mut solver = solver.borrow_mut();
        solver.reset();
        for readings in &frames {
            let solution = solver.solve(readings).unwrap();
            assert_sane(solver.name(), &PROBLEMS[0], &solution);
        }
        Ok(())
    });
    outcome.unwrap();
}
