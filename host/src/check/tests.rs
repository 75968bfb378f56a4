//! Checks of simulated detectors, frame by frame: every fault is named, and none is invented.

use super::diagnosis::{column, neighbours};
use super::touch::median;
use super::*;
use tactomo_physics::detector::Detector;
use tactomo_physics::scene::{Hand, Scene, SceneName};
use tactomo_physics::simulate::{self, Fault, Noise, Physics, Simulation, measured};
use tactomo_touch::solve::Problem;

/// As the ESP32 sends them, at a quarter of its rate.
const FRAMES_PER_S: f64 = 60.0;
/// Longest check (s).
const LONGEST_S: f64 = 60.0;
/// Firmness of the fingertip, from 0 to 1.
const FIRMNESS: f64 = 0.3;

/// The check of a detector, whose truth is `built`, with faults.
fn check(problem: &Problem, built: &Detector, faults: &[&str], seed: u64) -> Check {
    let faults: Vec<Fault> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
    let hand = Hand::relative(built);
    let scene = Scene::new(SceneName::Rest, built, hand, seed);
    let mut simulation = Simulation::new(built, scene, &faults, seed).unwrap();
    let tip = hand.tip([0.0; 2], FIRMNESS, 1.0).disc().unwrap();
    let presser = Presser::new(built, &problem.jacobian.image_mesh, tip.radius_m, tip.conductance_s);
    let controls = simulation.controls();
    let mut noise = Noise::new(seed);
    let mut check = Check::new(problem.clone(), 1);
    let mut asked = Ask::Rest;
    for frame in 0..(LONGEST_S * FRAMES_PER_S) as u32 {
        let time_s = f64::from(frame) / FRAMES_PER_S;
        check.take(&measured(&simulation.readings_v(time_s), &built.adc, &mut noise), time_s);
        if check.ask() != asked {
            asked = check.ask();
            let (scene, contacts) = presser.touch(asked);
            controls.play(scene).unwrap();
            controls.press(contacts);
        }
        if asked == Ask::Nothing {
            break;
        }
    }
    check
}

/// What is wrong, with whom.
fn found(report: &Report) -> Vec<(usize, State, Vec<usize>)> {
    report.faulty().map(|found| (found.electrode, found.state, found.with.clone())).collect()
}

fn exact(name: &str) -> Problem {
    Problem::of(&Detector::preset(name).unwrap().taken_as_exact()).unwrap()
}

/// Two different electrodes of 16.
fn pair(random: &mut fastrand::Rng) -> [usize; 2] {
    let first = random.usize(0..16);
    let second = (first + random.usize(1..16)) % 16;
    [first.min(second), first.max(second)]
}

#[test]
fn every_single_fault_is_named_with_all_that_are_in_it() {
    let problem = exact(Detector::DEFAULT);
    let built = problem.detector().clone();
    for seed in 0..10 {
        let mut random = fastrand::Rng::with_seed(seed);
        let one = random.usize(0..16);
        let [a, b] = pair(&mut random);
        let cases = [
            (format!("open:{one}"), vec![(one, State::Open, vec![])]),
            (format!("short:{a},{b}"), vec![(a, State::Shorted, vec![b]), (b, State::Shorted, vec![a])]),
            (format!("swap:{a},{b}"), vec![(a, State::Exchanged, vec![b]), (b, State::Exchanged, vec![a])]),
            (format!("gain:{one}:0.7"), vec![(one, State::Contradicting, vec![])]),
            (format!("gain:{one}:0"), vec![(one, State::Unread, vec![])]),
            (format!("invert:{one}"), vec![(one, State::Contradicting, vec![])]),
        ];
        for (fault, expected) in cases {
            let report = check(&problem, &built, &[&fault], seed).report("simulated");
            assert_eq!(found(&report), expected, "{fault}, seed {seed}");
            assert!(!report.sound && report.faulty().all(|found| found.advice.is_some()));
        }
    }
}

#[test]
fn no_fault_is_invented_on_detectors_as_described_and_as_built() {
    let described = Problem::of(&Detector::default()).unwrap();
    let exact = exact(Detector::DEFAULT);
    for seed in 0..10 {
        let built = simulate::drawn(&Detector::default(), seed);
        for (problem, built) in [(&exact, exact.detector()), (&described, &built)] {
            let report = check(problem, built, &[], seed).report("simulated");
            assert_eq!((found(&report), report.notes.clone()), (vec![], vec![]), "{}, seed {seed}", built.name);
            assert!(report.sound && report.presses == 1 + FINGERS);
        }
    }
}

#[test]
fn faults_of_detectors_as_built_are_named_too() {
    let described = Problem::of(&Detector::default()).unwrap();
    for seed in 0..3 {
        let built = simulate::drawn(&Detector::default(), seed);
        let [a, b] = pair(&mut fastrand::Rng::with_seed(seed));
        let cases = [
            (format!("open:{a}"), vec![(a, State::Open, vec![])]),
            (format!("short:{a},{b}"), vec![(a, State::Shorted, vec![b]), (b, State::Shorted, vec![a])]),
            (format!("swap:{a},{b}"), vec![(a, State::Exchanged, vec![b]), (b, State::Exchanged, vec![a])]),
        ];
        for (fault, expected) in cases {
            let report = check(&described, &built, &[&fault], seed).report("simulated");
            assert_eq!(found(&report), expected, "{fault}, seed {seed}");
        }
    }
}

#[test]
fn inputs_of_sound_detectors_follow_the_hand_by_far() {
    for name in Detector::preset_names() {
        let problem = exact(name);
        let check = check(&problem, problem.detector(), &[], 3);
        let hand = check.presses.first().unwrap();
        let pads = &check.detector.electrodes;
        let of = |e: usize| column(hand, e);
        let follows = |e: usize| of(e) / median(neighbours(pads, e, &[]).into_iter().map(of).collect());
        let least = (0..pads.len()).map(follows).fold(f64::INFINITY, f64::min);
        assert!(least > 0.5, "{name}: {least}");
    }
}

#[test]
fn a_press_at_the_start_is_told_and_waited_for() {
    let problem = exact(Detector::DEFAULT);
    let detector = problem.detector().clone();
    let scene = Scene::new(SceneName::Wide, &detector, Hand::relative(&detector), 1);
    let mut simulation = Simulation::new(&detector, scene, &[], 1).unwrap();
    let mut check = Check::new(problem, 1);
    for frame in 0..100 {
        check.take(&simulation.readings_v(f64::from(frame) / FRAMES_PER_S), f64::from(frame) / FRAMES_PER_S);
    }
    assert!(check.ask() == Ask::Rest && check.hindrance().is_some_and(|largest_v| largest_v > 0.1));
    let report = check.report("simulated");
    assert!(!report.sound && report.notes[0].contains("did not come to rest"), "{report:?}");
    assert!(report.electrodes.iter().all(|report| report.state == State::Untested));
}

#[test]
fn without_a_press_the_driving_layer_is_suspected() {
    let problem = exact(Detector::DEFAULT);
    let mut check = Check::new(problem, 1);
    let rest = tactomo_physics::readings::Readings::from_fn(16, |_, _| 0.0);
    (0..100).for_each(|frame| check.take(&rest, f64::from(frame) / FRAMES_PER_S));
    assert_eq!(check.ask(), Ask::Hand);
    let report = check.report("simulated");
    assert!(
        report.notes[0].contains("driving layer") && report.verdict().contains("nothing has pressed"),
        "{report:?}"
    );
}
