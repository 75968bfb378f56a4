//! Contacts that stay while their strengths change, frame by frame.

use super::super::tests::{FINE, contact, frame, solver};
use super::super::{ContactSettings, Contacts};
use super::*;
use crate::solve::answer::{FoundContact, Solution};
use crate::solve::problem::Problem;
use crate::solve::solver::Solver;
use tactomo_physics::detector::{Adc, ConverterErrors, Detector};
use tactomo_physics::forward::{ForwardModel, readings_v};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::{Hand, Scene, SceneName};
use tactomo_physics::simulate::{Noise, drawn, finer_model, measured};

/// Frames a second.
const RATE: f64 = 250.0;

/// What is found of contacts that are somewhere at each time (s), in each frame.
fn followed(seconds: f64, at: impl Fn(f64) -> Vec<Contact>) -> Vec<Solution> {
    let (mut solver, mut noise) = (solver(), Noise::new(5));
    let frames = (0..(seconds * RATE) as usize).map(|index| frame(&at(index as f64 / RATE), &mut noise));
    frames.map(|frame| solver.solve(&frame).unwrap()).collect()
}

fn counts(found: &[Solution]) -> Vec<usize> {
    found.iter().map(|found| found.contacts.len()).collect()
}

/// How far the nearest found contact is from each true one, at most (m).
fn largest_error_m(truth: &[Contact], found: &[FoundContact]) -> f64 {
    let nearest_m = |one: &Contact| {
        let apart_m = found.iter().map(|found| (found.x_m - one.x_m).hypot(found.y_m - one.y_m));
        apart_m.fold(f64::INFINITY, f64::min)
    };
    truth.iter().map(nearest_m).fold(0.0, f64::max)
}

/// The contacts of a scene at a time (s).
fn contacts_of(name: SceneName, seed: u64) -> impl Fn(f64) -> Vec<Contact> {
    let detector = Detector::preset(Detector::DEFAULT).unwrap();
    let scene = Scene::new(name, &detector, Hand::relative(&detector), seed);
    move |time_s| scene.at(time_s).iter().filter_map(|touch| touch.disc()).collect()
}

/// Five fingers whose weight goes from one to the next.
fn five_fingers() -> impl Fn(f64) -> Vec<Contact> {
    contacts_of(SceneName::FiveFingers, 1)
}

#[test]
fn five_fingers_that_stay_are_told_from_four_as_weight_goes_from_one_to_the_next() {
    let scene = five_fingers();
    let found = followed(1.2, &scene);
    let counts = counts(&found);
    assert!(counts[20..90].iter().all(|count| *count == 4), "a frame by itself does not tell: {counts:?}");
    assert!(counts[150..].iter().all(|count| *count == 5), "{counts:?}");
    let last = found.last().unwrap();
    let error_m = largest_error_m(&scene(1.2), &last.contacts);
    assert!(error_m < 0.6e-3 && last.certainty > Some(0.95), "{error_m} {:?}", last.certainty);
}

#[test]
fn a_finger_that_was_told_so_is_let_go_when_it_lifts_and_followed_when_it_moves() {
    let scene = five_fingers();
    let lifted = |time_s: f64| {
        let kept = if time_s > 1.0 { 4 } else { 5 };
        scene(time_s).into_iter().take(kept).collect::<Vec<_>>()
    };
    let found = followed(1.2, lifted);
    assert_eq!((found[240].contacts.len(), found.last().unwrap().contacts.len()), (5, 4), "{:?}", counts(&found));
    let moved = |time_s: f64| {
        let away_m = 0.02 * (time_s - 1.0).clamp(0.0, 0.3);
        let mut all = scene(time_s);
        all[0].y_m -= away_m;
        all
    };
    let found = followed(2.6, moved);
    let error_m = largest_error_m(&moved(2.0)[..1], &found[320].contacts);
    assert!(error_m < 1e-3, "{error_m}");
    let error_m = largest_error_m(&moved(2.6), &found.last().unwrap().contacts);
    assert!(found.last().unwrap().contacts.len() == 5 && error_m < 1e-3, "{error_m} {:?}", counts(&found));
}

#[test]
fn one_finger_that_presses_more_and_less_or_moves_is_no_two_that_stay() {
    let pressing = |time_s: f64| vec![contact(0.012, -0.007, 1.0 + 0.9 * (3.0 * time_s).sin())];
    assert!(counts(&followed(1.6, pressing)).iter().all(|count| *count == 1));
    for speed in [0.002, 0.02] {
        let moving = |time_s: f64| vec![contact(speed * time_s, 0.009, 0.7 + 0.4 * (4.0 * time_s).sin())];
        let counts = counts(&followed(1.2, moving));
        assert!(counts.iter().all(|count| *count == 1), "{speed} m/s: {counts:?}");
    }
    for seed in [1, 2] {
        let counts = counts(&followed(5.0, contacts_of(SceneName::RollingBall, seed)));
        assert!(counts.iter().all(|count| *count == 1), "a ball, seed {seed}: {counts:?}");
    }
}

/// What each converter of a chip is off by is the same in all frames. It is little more than the noise of one, and no contact of all.
#[test]
fn what_converters_are_off_by_is_no_second_contact() {
    let described = Detector::default().taken_as_exact();
    let mut board = described.clone();
    board.adc = Adc { bits: 12, full_scale_v: 4.096, noise_lsb: 5.0 };
    let converter = |floor_v: f64| ConverterErrors { gain_share: 0.01, bow_v: 0.012, range_v: [floor_v, 3.1] };
    board.converters = [0.142, 0.128].map(converter).into();
    board.electrodes.iter_mut().skip(6).for_each(|pad| pad.converter = 1);
    let problem = Problem::of(&described).unwrap().measured_as(&board);
    for seed in [2, 4, 6] {
        let mut solver = Contacts::new(&problem, ContactSettings::of(&problem)).unwrap();
        let (mut noise, scene) = (Noise::new(seed), contacts_of(SceneName::RollingBall, seed));
        let chip = [0; 4].map(|_| noise.normal());
        let read = |contacts: &[Contact], noise: &mut Noise| {
            let true_v = readings_v(&FINE.impedance_ohm(contacts).unwrap(), &board);
            Readings::from_fn(16, |g, e| {
                let (volts, index) = (true_v.touch_v(g, e), board.electrodes[e].converter);
                let [gain_v, bow_v] = board.converters[index].changes_v(volts);
                volts + chip[2 * index] * gain_v + chip[2 * index + 1] * bow_v + 0.005 * noise.normal()
            })
        };
        let frames = (0..1720).map(|index| read(&scene(f64::from(index) / 430.0), &mut noise)).collect::<Vec<_>>();
        let counts: Vec<_> = frames.iter().map(|frame| solver.solve(frame).unwrap().contacts.len()).collect();
        let wrong = counts.iter().filter(|count| **count != 1).count();
        assert!(wrong == 0, "seed {seed}: {wrong} of {}", counts.len());
    }
}

#[test]
fn what_several_frames_say_holds_contacts_where_one_frame_says_little() {
    let scene = five_fingers();
    let (mut solver, mut noise) = (solver(), Noise::new(9));
    for index in 0..200 {
        solver.solve(&frame(&scene(f64::from(index) / RATE), &mut noise)).unwrap();
    }
    let finder = solver.finder();
    let fit = solver.found().unwrap().fit.clone();
    let still = fit.still.clone().unwrap();
    assert!(
        still.cost(&fit.contacts) < 60.0 && still.of(&[0, 2]).unwrap().cost(&[fit.contacts[0], fit.contacts[2]]) < 30.0
    );
    let next = frame(&scene(0.8), &mut noise);
    let target = Target::of_mean(&next, 1, &finder.errors, None);
    let held = finder.disc_fitter().go_on(&fit, &target, COLD).unwrap();
    let free = finder.disc_fitter().fit(fit.contacts.clone(), &target, COLD).unwrap();
    let error_m = |contacts: &[Contact]| {
        let off_m = |one: &Contact| {
            contacts.iter().map(|found| (found.x_m - one.x_m).hypot(found.y_m - one.y_m)).fold(f64::INFINITY, f64::min)
        };
        scene(0.8).iter().map(off_m).fold(0.0, f64::max)
    };
    let [held_m, free_m] = [&held, &free].map(|fit| error_m(&fit.contacts));
    assert!(held_m < 0.7e-3 && free_m > 1.5 * held_m, "{held_m} {free_m}");
    let deviation = |fit: &crate::solve::methods::contacts::discs::DiscFit| fit.covariance().unwrap()[(0, 0)].sqrt();
    assert!(deviation(&held) < deviation(&free));
}

/// What is not known of the detector is common to all frames: the third and second finger are told apart from one wide contact, on a detector that nobody has calibrated.
#[test]
fn five_fingers_are_told_on_a_detector_as_built() {
    let described = Detector::default();
    let built = drawn(&described, 411);
    let truth = finer_model(&built, &[], 0).unwrap();
    let problem = Problem::of(&described).unwrap();
    let mut solver = Contacts::new(&problem, ContactSettings::of(&problem)).unwrap();
    let (mut noise, scene) = (Noise::new(3), five_fingers());
    let read = |time_s: f64, noise: &mut Noise| {
        let impedance_ohm = truth.impedance_ohm(&scene(time_s)).unwrap();
        measured(&readings_v(&impedance_ohm, &built), &built.adc, noise)
    };
    let found: Vec<_> =
        (0..600).map(|index| solver.solve(&read(f64::from(index) / RATE, &mut noise)).unwrap()).collect();
    let counts = counts(&found);
    assert!(counts[..60].iter().all(|count| *count < 5), "a frame by itself does not tell: {counts:?}");
    assert!(counts[500..].iter().all(|count| *count == 5), "{counts:?}");
    let error_m = largest_error_m(&scene(599.0 / RATE), &found[599].contacts);
    assert!(error_m < 2e-3, "{error_m}");
}
