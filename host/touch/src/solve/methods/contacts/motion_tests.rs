//! Contacts in the mean of frames that stand still, and what happens when something moves.

use std::ops::ControlFlow;
use std::sync::LazyLock;

use super::*;
use crate::solve::solver::{Followed, Parts, Solver};
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{Resolution, Slab, readings_v};
use tactomo_physics::readings::Range;
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Noise, drawn, measured};

static PROBLEM: LazyLock<Problem> = LazyLock::new(|| Problem::of(&detector()).unwrap());
static FINE: LazyLock<Slab> = LazyLock::new(|| Slab::with_resolution(&detector(), Resolution::FINE).unwrap());

fn detector() -> Detector {
    let mut detector = Detector::default().taken_as_exact();
    detector.adc.noise_lsb = 1.5;
    detector
}

/// A contact of so many sheet conductances.
fn contact(x_m: f64, y_m: f64, sheets: f64) -> Contact {
    Contact::flat(x_m, y_m, 0.0025, sheets * detector().sheet_conductance_s())
}

/// A solver with the frames of one scene after another.
struct MotionTrial {
    solver: Contacts,
    noise: Noise,
    exact: Readings,
}

impl MotionTrial {
    fn new() -> Self {
        let solver = Contacts::new(&PROBLEM, ContactSettings::of(&PROBLEM)).unwrap();
        Self { solver, noise: Noise::new(7), exact: Readings::from_fn(16, |_, _| 0.0) }
    }

    fn touch(&mut self, contacts: &[Contact]) {
        self.exact = readings_v(&FINE.impedance_ohm(contacts).unwrap(), &detector());
    }

    fn frame(&mut self) -> Readings {
        measured(&self.exact, &detector().adc, &mut self.noise)
    }

    fn solve(&mut self) -> Solution {
        let frame = self.frame();
        self.solver.solve(&frame).unwrap()
    }
}

fn sigma_m(solution: &Solution) -> f64 {
    let [found] = solution.contacts[..] else { panic!("{:?}", solution.contacts) };
    let uncertainty = found.uncertainty.unwrap();
    uncertainty.x_m.hypot(uncertainty.y_m)
}

fn is_at(found: &FoundContact, truth: &Contact, within_m: f64) -> bool {
    (found.x_m - truth.x_m).hypot(found.y_m - truth.y_m) < within_m
}

#[test]
fn standard_errors_shrink_with_frames_until_the_model_is_the_limit() {
    let mut trial = MotionTrial::new();
    trial.touch(&[contact(0.007, -0.004, 0.03)]);
    let sigmas_m: Vec<_> = (0..400).map(|_| sigma_m(&trial.solve())).collect();
    for frames in [2, 4, 9, 16] {
        let shrunk = sigmas_m[0] / sigmas_m[frames - 1] / (frames as f64).sqrt();
        assert!((0.85..1.15).contains(&shrunk), "{frames}: {shrunk}");
    }
    assert!(sigmas_m[0] / sigmas_m[399] > 5.0, "{} {}", sigmas_m[0], sigmas_m[399]);
    trial.touch(&[contact(0.007, -0.004, 100.0)]);
    (0..300).for_each(|_| drop(trial.solve()));
    let firm_m = sigma_m(&trial.solve());
    assert!(firm_m > 2e-6, "the model is no better than that: {firm_m}");
}

#[test]
fn a_contact_that_glides_is_known_better_than_by_each_frame_and_as_well_as_is_said() {
    let (mut off, mut by_frame_m, mut said_m) = (Vec::new(), 0.0, 0.0);
    for phase in 0..4 {
        let mut trial = MotionTrial::new();
        trial.noise = Noise::new(20 + phase);
        for frame in 0..90 {
            // Round in four seconds, at 400 frames a second and 35 mm/s.
            let (sin, cos) = (1.57 * (f64::from(frame) / 400.0 + phase as f64)).sin_cos();
            let truth = contact(0.022 * cos, 0.022 * sin, 0.02);
            trial.touch(&[truth]);
            let solution = trial.solve();
            let [found] = &solution.contacts[..] else { panic!("{frame}: {solution:?}") };
            if frame >= 30 {
                let of_frame = trial.solver.found().unwrap().fit.contacts[0];
                by_frame_m += (of_frame.x_m - truth.x_m).hypot(of_frame.y_m - truth.y_m);
                let uncertainty = found.uncertainty.as_ref().unwrap();
                said_m += uncertainty.x_m.hypot(uncertainty.y_m);
                off.extend([(found.x_m - truth.x_m, uncertainty.x_m), (found.y_m - truth.y_m, uncertainty.y_m)]);
            }
        }
    }
    let off_m: f64 = off.chunks(2).map(|pair| pair[0].0.hypot(pair[1].0)).sum();
    let within = off.iter().filter(|(off_m, sigma_m)| off_m.abs() < *sigma_m).count() as f64 / off.len() as f64;
    let report = format!("{off_m:.1e} m in all, {by_frame_m:.1e} by frames, {said_m:.1e} said, {within:.2} within");
    assert!(off_m < 0.7 * by_frame_m && within > 0.6 && said_m < 3.0 * off_m, "{report}");
}

#[test]
fn the_same_readings_again_tell_no_more() {
    let mut trial = MotionTrial::new();
    trial.touch(&[contact(0.007, -0.004, 0.3)]);
    let frame = trial.frame();
    let sigmas_m: Vec<_> = (0..20).map(|_| sigma_m(&trial.solver.solve(&frame).unwrap())).collect();
    assert!(sigmas_m.iter().all(|again_m| (again_m / sigmas_m[0] - 1.0).abs() < 0.01), "{sigmas_m:?}");
}

#[test]
fn a_light_contact_is_found_after_some_frames_where_one_is_too_noisy() {
    let mut trial = MotionTrial::new();
    let truth = contact(-0.010, 0.006, 0.003);
    trial.touch(&[truth]);
    let solutions: Vec<_> = (0..64).map(|_| trial.solve()).collect();
    let last = solutions.last().unwrap();
    assert!(last.contacts.len() == 1 && is_at(&last.contacts[0], &truth, 2e-3), "{last:?}");
    assert!((0.8..1.25).contains(&last.residual.unwrap()), "in the noise of the mean: {:?}", last.residual);
}

#[test]
fn contacts_that_come_and_go_beside_a_still_one_are_noticed_at_once() {
    let [still, other] = [contact(0.010, 0.004, 0.3), contact(-0.012, -0.009, 0.5)];
    let mut trial = MotionTrial::new();
    trial.touch(&[still]);
    (0..100).for_each(|_| drop(trial.solve()));
    for _ in 0..3 {
        trial.touch(&[still, other]);
        let came = trial.solve();
        assert_eq!(came.contacts.len(), 2, "{came:?}");
        assert!([still, other].iter().all(|truth| came.contacts.iter().any(|found| is_at(found, truth, 2e-4))));
        (0..40).for_each(|_| assert_eq!(trial.solve().contacts.len(), 2));
        trial.touch(&[still]);
        let gone: Vec<_> = (0..40).map(|_| trial.solve()).collect();
        assert!(gone.iter().all(|solution| solution.contacts.len() == 1 && !solution.flags.misfit), "{:?}", gone[0]);
    }
}

#[test]
fn a_scene_that_stands_still_is_searched_only_when_its_frames_have_doubled() {
    let mut trial = MotionTrial::new();
    trial.touch(&[contact(0.010, 0.004, 0.3), contact(-0.012, -0.009, 0.05)]);
    let Parts { mut tracker, search: searcher } =
        Box::new(Contacts::new(&PROBLEM, ContactSettings::of(&PROBLEM)).unwrap()).split();
    let mut searcher = searcher.unwrap();
    let mut searched = 0;
    for _ in 0..300 {
        let frame = trial.frame();
        let Followed { search, .. } = tracker.follow(&frame).unwrap();
        if search {
            searched += 1;
            let hypothesis = searcher.search(tracker.hypothesis(), &frame, &mut |_| ControlFlow::Continue(())).unwrap();
            assert!(!tracker.adopt(hypothesis, &frame).unwrap().search);
        }
    }
    assert!((6..9).contains(&searched), "{searched}: with 1, 2, 4, 8, 16, 32 frames");
}

/// An ESP32 reads no lower than about this (V).
const FLOOR_V: f64 = 0.14;

/// A frame of a board that reads nothing below [`FLOOR_V`].
fn above_floor(trial: &mut MotionTrial) -> Readings {
    let n = detector().electrodes.len();
    let frame = trial.frame();
    let clipped = Readings::from_fn(n, |g, e| frame.at(g, e).max(FLOOR_V));
    clipped.within(&vec![Range { floor_v: FLOOR_V, ceiling_v: f64::INFINITY }; n])
}

/// Sheet conductances of a contact that lifts slowly, as a finger does: below 0.04 it is below the range.
fn lifting() -> impl Iterator<Item = f64> {
    (0..150).map(|frame| 0.3 * 0.96f64.powi(frame))
}

#[test]
fn a_contact_that_lifts_below_the_converters_range_is_gone() {
    let mut trial = MotionTrial::new();
    let mut count = |sheets| {
        trial.touch(&[contact(0.007, -0.004, sheets)]);
        let frame = above_floor(&mut trial);
        trial.solver.solve(&frame).unwrap().contacts.len()
    };
    let counts: Vec<_> = lifting().map(&mut count).collect();
    assert!(
        counts[..20].iter().all(|count| *count == 1) && counts[120..].iter().all(|count| *count == 0),
        "{counts:?}"
    );
}

#[test]
fn a_contact_that_lifts_below_the_converters_range_is_gone_in_rows_too() {
    let mut trial = MotionTrial::new();
    let mut count = |(index, sheets)| {
        trial.touch(&[contact(0.007, -0.004, sheets)]);
        let frame = above_floor(&mut trial);
        let row = frame.clone().hiding(|ground, _| ground != index % 16);
        trial.solver.solve_rows(&row, &frame, 2e-3).unwrap().contacts.len()
    };
    let counts: Vec<_> = lifting().enumerate().map(&mut count).collect();
    assert!(
        counts[..20].iter().all(|count| *count == 1) && counts[120..].iter().all(|count| *count == 0),
        "{counts:?}"
    );
}

#[test]
fn rows_after_whole_frames_go_on_from_what_these_were_off_by() {
    let described = Detector::default();
    let built = drawn(&described, 3);
    let fine = Slab::with_resolution(&built, Resolution::FINE).unwrap();
    let problem = Problem::of(&described).unwrap();
    problem.nuisance();
    let mut solver = Contacts::new(&problem, ContactSettings::of(&problem)).unwrap();
    let mut noise = Noise::new(9);
    let mut frame = |x_m: f64| {
        let exact = readings_v(&fine.impedance_ohm(&[contact(x_m, -0.004, 1.0)]).unwrap(), &built);
        measured(&exact, &built.adc, &mut noise)
    };
    let whole = (0..10).map(|_| solver.solve(&frame(0.007)).unwrap()).last().unwrap();
    assert!(!whole.flags.is_doubtful(), "{whole:?}");
    for index in 0..40 {
        let all = frame(0.007 + 2.5e-5 * index as f64);
        let rows = all.clone().hiding(|ground, _| ground % 8 != index % 8);
        let solution = solver.solve_rows(&rows, &all, 1e-3).unwrap();
        let [found] = solution.contacts[..] else { panic!("{solution:?}") };
        let off_m = (found.x_m - 0.007 - 2.5e-5 * index as f64).hypot(found.y_m + 0.004);
        assert!(off_m < 3e-4 && !solution.flags.is_doubtful(), "{index}: {off_m} {solution:?}");
    }
}

#[test]
fn noise_in_a_few_rows_is_no_contact() {
    // On 32 electrodes most readings of a frame of two rows are completed.
    let detector = Detector::preset("display-140x70").unwrap().taken_as_exact();
    let n = detector.electrodes.len();
    let problem = Problem::of(&detector).unwrap();
    let mut solver = Contacts::new(&problem, ContactSettings::of(&problem)).unwrap();
    let (rest, mut noise) = (Readings::from_fn(n, |_, _| 0.0), Noise::new(7));
    let seen = (0..2000).filter(|frame| {
        let frame_v = measured(&rest, &detector.adc, &mut noise);
        let rows = frame_v.hiding(|ground, _| ground / 2 != frame % (n / 2));
        !solver.solve_rows(&rows, &rows, 2e-4).unwrap().contacts.is_empty()
    });
    assert_eq!(seen.count(), 0);
}

#[test]
fn grounds_are_chosen_for_what_moves() {
    let mut trial = MotionTrial::new();
    let Parts { mut tracker, search } = Box::new(MotionTrial::new().solver).split();
    let mut searcher = search.unwrap();
    let mut answered = |contacts: &[Contact]| {
        trial.touch(contacts);
        let frame = trial.frame();
        let Followed { search, .. } = tracker.follow(&frame).unwrap();
        if search {
            let hypothesis = searcher.search(tracker.hypothesis(), &frame, &mut |_| ControlFlow::Continue(())).unwrap();
            tracker.adopt(hypothesis, &frame).unwrap();
        }
        tracker.telling_grounds(3).map(|grounds| grounds.len())
    };
    let standing: Vec<_> = (0..40).map(|_| answered(&[contact(0.0, 0.0, 0.3)])).collect();
    assert_eq!(standing[39], Some(16), "{standing:?}");
    let moving: Vec<_> = (0..40).map(|frame| answered(&[contact(2e-4 * f64::from(frame), 0.0, 0.3)])).collect();
    assert_eq!((moving[0], moving[39]), (Some(16), Some(3)), "{moving:?}");
    let again: Vec<_> = (0..40).map(|_| answered(&[contact(8e-3, 0.0, 0.3)])).collect();
    assert_eq!(again[39], Some(16), "{again:?}");
}
