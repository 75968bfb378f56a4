//! A day at a sensor, simulated at speed, with the mean of 32 frames every ten seconds: conductivity that drifts by 20 %, offsets that drift by several codes,
//! leakage, presses that creep, a cup for an hour, a slow hand. Its detector is a finer slab than the one that is inverted.
//! `cargo test --release -p tactomo --test day -- --nocapture` prints what was found in each hour.
#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use std::f64::consts::TAU;
use std::sync::Arc;

use tactomo::board::baseline::{BaselineState, BaselineTracker};
use tactomo::detector::Detector;
use tactomo::forward::{DrivingLayer, Resolution, Slab, readings_v, touched_impedance_ohm};
use tactomo::readings::Readings;
use tactomo::scene::{Shape, Touch};
use tactomo::simulate::{Noise, measured};
use tactomo::solve::{FaultTolerant, FoundContact, Method, Problem, Solution, Solver};

const HOUR_S: f64 = 3600.0;
const DAY_S: f64 = 24.0 * HOUR_S;
const STEP_S: f64 = 10.0;
/// Frames whose mean is looked at, as live does when a solver is slower than the board.
const FRAMES: u32 = 32;
/// Leakage, in sheet conductances as described.
const LEAKAGE: f64 = 0.01;
/// Where a finger presses in each hour, when in it (s), for how long (s), and how firmly (sheet conductances).
const FINGER_M: [f64; 2] = [-0.011, 0.006];
const FINGER_S: [f64; 2] = [900.0, 120.0];
const FINGER: f64 = 0.3;
/// Creep of foam: a held press grows by a fifth, with a time constant of a standard linear solid (s).
const CREEP: f64 = 0.2;
const CREEP_S: f64 = 3.0;
/// Hours of a cup, and of a hand that takes five minutes to press and five to let go.
const CUP_H: usize = 9;
const HAND_H: usize = 15;
const HAND_M: [f64; 2] = [0.016, -0.013];

/// A calibrated detector: of one on paper, whose tolerances leave conductances open by a third, a drift by a fifth shows nothing.
fn detector() -> Detector {
    let mut detector = Detector::preset(Detector::DEFAULT).unwrap().taken_as_exact();
    detector.adc.noise_lsb = 1.5;
    detector
}

/// The detector as it is when an hour begins.
#[derive(Clone)]
struct Hour {
    slab: Slab,
    /// Conductivity over the described one.
    conductivity: f64,
}

impl Hour {
    fn new(hour: usize) -> Self {
        let mut detector = detector();
        let conductivity = 1.0 + 0.2 * (TAU * hour as f64 / 24.0).sin();
        for layer in &mut detector.layers {
            layer.bottom_s_per_m *= conductivity;
            layer.top_s_per_m *= conductivity;
        }
        let driving =
            DrivingLayer { leak_s: LEAKAGE * self::detector().sheet_conductance_s(), ..DrivingLayer::default() };
        let slab = Slab::under(&detector, Resolution::FINE, driving).unwrap().on_image(625);
        Self { slab, conductivity }
    }

    /// Pad voltages (V) under a touch, beside leakage. The conductance of a touch is the foam's, as in the paper, that of leakage does not
    /// drift.
    fn volts(&self, touch: Option<&([f64; 2], Shape, f64)>) -> Vec<f64> {
        let sheet_s = detector().sheet_conductance_s();
        let touches: Vec<Touch> = touch
            .map(|(at_m, shape, sheets)| Touch::flat(*at_m, shape.clone(), sheets * self.conductivity * sheet_s))
            .into_iter()
            .collect();
        readings_v(&touched_impedance_ohm(&self.slab, &touches).unwrap(), &detector()).volts().to_vec()
    }
}

/// What touches at a time of an hour (s), and how firmly (sheet conductances); `None` if nothing does.
fn touched(hour: usize, second: f64) -> Option<([f64; 2], Shape, f64)> {
    let tip = Shape::Disc { radius_m: 0.003 };
    let held_s = second - FINGER_S[0];
    match hour {
        CUP_H => {
            // Its weight creeps for minutes, of which every tenth is looked at.
            let grown = 1.0 + CREEP * (1.0 - (-(second / 600.0).floor()).exp());
            Some(([0.004, 0.002], Shape::Ring { radius_m: 0.019, width_m: 0.002 }, 1.5 * grown))
        }
        HAND_H if second < 1200.0 => {
            let firm = (second / 300.0).min(1.0).min((1200.0 - second) / 300.0);
            (firm > 0.0).then_some((HAND_M, tip, 0.1 * firm))
        }
        _ if (0.0..FINGER_S[1]).contains(&held_s) => {
            // To a hundredth, so that the same need not be simulated again and again.
            let grown = 1.0 + (100.0 * CREEP * (1.0 - (-(held_s + 1.0) / CREEP_S).exp())).round() / 100.0;
            Some((FINGER_M, tip, FINGER * grown))
        }
        _ => None,
    }
}

/// What a day has come to.
#[derive(Default)]
struct Day {
    /// Mean places of the finger in each hour (m), and its mean conductance (S).
    fingers_m: Vec<[f64; 2]>,
    fingers_s: Vec<f64>,
    /// Hours and seconds with contacts that are not there.
    invented: Vec<(usize, f64)>,
    /// The same with none though something touches, but for the very beginning and end of the slow hand.
    missed: Vec<(usize, f64)>,
    /// The same in which the baseline changed under load.
    taken: Vec<(usize, f64)>,
    /// Notices that came, and when.
    notices: Vec<(usize, BaselineState)>,
}

fn live_through() -> Day {
    let detector = detector();
    let problem = Problem::of(&detector).unwrap();
    let mut solver = FaultTolerant::new(Method::Auto, &problem).unwrap();
    let mut baseline = BaselineTracker::new(Arc::clone(&problem.jacobian), 1);
    let (mut noise, mut day) = (Noise::new(6), Day::default());
    let (mut rest_before, mut last_touched_s) = (vec![0.0; 256], 0.0);
    let mut hours = [Hour::new(0), Hour::new(1)];
    for hour in 0..24 {
        let mut fingers = Vec::new();
        let (mut last, mut ends) = (None, hours.each_ref().map(|of_hour| of_hour.volts(None)));
        for step in 0..(HOUR_S / STEP_S) as usize {
            let (second, time_s) = (STEP_S * step as f64, HOUR_S * hour as f64 + STEP_S * step as f64);
            let touch = touched(hour, second);
            if last != touch {
                ends = hours.each_ref().map(|of_hour| of_hour.volts(touch.as_ref()));
                last.clone_from(&touch);
            }
            let volts = readings_at(&ends, second / HOUR_S, time_s / DAY_S);
            let frame = mean(&volts, &detector, &mut noise);
            if baseline.add(frame.volts(), FRAMES, time_s, &[]) {
                day.notices.push((hour, baseline.state()));
            }
            let mut readings = frame.clone();
            baseline.subtract(frame.volts(), readings.volts_mut());
            let solution = solver.solve(&readings).unwrap();
            let mut rest = vec![0.0; 256];
            baseline.subtract(&[0.0; 256], &mut rest);
            match &touch {
                // In the first answer after a touch there may be some of it, for solvers average.
                None if !solution.contacts.is_empty() && last_touched_s < time_s - STEP_S => {
                    day.invented.push((hour, second));
                }
                None => {}
                Some((_, _, sheets)) => {
                    last_touched_s = time_s;
                    if rest != rest_before {
                        day.taken.push((hour, second));
                    }
                    if *sheets > 0.01 && solution.contacts.is_empty() && solution.shape.is_none() {
                        day.missed.push((hour, second));
                    }
                    fingers.extend(single(&solution).filter(|_| hour != CUP_H && hour != HAND_H));
                }
            }
            rest_before = rest;
        }
        hours = [hours[1].clone(), Hour::new(hour + 2)];
        if !fingers.is_empty() {
            let mean = |of: fn(&FoundContact) -> f64| fingers.iter().map(of).sum::<f64>() / fingers.len() as f64;
            let (x_m, y_m, conductance_s) =
                (mean(|found| found.x_m), mean(|found| found.y_m), mean(|found| found.conductance_s));
            day.fingers_m.push([x_m, y_m]);
            day.fingers_s.push(conductance_s);
            println!(
                "hour {hour:>2}, conductivity x {:.2}: finger at {:.3} {:.3} mm, {:.3} mS, in {} answers; leakage {:.4}, {:?}",
                hours[0].conductivity,
                1e3 * x_m,
                1e3 * y_m,
                1e3 * conductance_s,
                fingers.len(),
                baseline.leakage_sheets(),
                baseline.state()
            );
        }
    }
    day
}

/// Readings (V) between those at the beginning and the end of an hour, with offsets of channels, each of which drifts in its own way by up to
/// 5 codes.
fn readings_at(ends: &[Vec<f64>; 2], of_hour: f64, of_day: f64) -> Readings {
    let lsb_v = detector().adc.lsb_v();
    let offset = |e: usize| (e % 3) as f64 + (2.0 + (e % 4) as f64) * (TAU * (of_day + e as f64 / 7.0)).sin();
    let volts = ends[0].iter().zip(&ends[1]).map(|(from, to)| from + of_hour * (to - from));
    Readings::new(16, volts.enumerate().map(|(i, volts)| volts + lsb_v * offset(i % 16)).collect()).unwrap()
}

/// The mean of some frames of a converter (V).
fn mean(volts: &Readings, detector: &Detector, noise: &mut Noise) -> Readings {
    let mut mean = Readings::from_fn(16, |_, _| 0.0);
    for _ in 0..FRAMES {
        let frame = measured(volts, &detector.adc, noise);
        mean.volts_mut().iter_mut().zip(frame.volts()).for_each(|(sum, volts)| *sum += volts / f64::from(FRAMES));
    }
    mean
}

fn single(solution: &Solution) -> Option<FoundContact> {
    let [contact] = solution.contacts[..] else { return None };
    Some(contact)
}

#[test]
fn a_day_of_drift_invents_nothing_learns_nothing_and_moves_nothing() {
    let day = live_through();
    let some = |at: &[(usize, f64)]| format!("{} {:?}", at.len(), &at[..at.len().min(8)]);
    let wrong = [&day.invented, &day.missed, &day.taken].map(|at| some(at));
    println!("invented {}\nmissed {}\ntaken under load {}\nnotices {:?}", wrong[0], wrong[1], wrong[2], day.notices);
    assert_eq!(day.fingers_m.len(), 22);
    let apart_m = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let moved_m = day.fingers_m.iter().map(|place_m| apart_m(place_m, &day.fingers_m[0])).fold(0.0, f64::max);
    let off_m = day.fingers_m.iter().map(|place_m| apart_m(place_m, &FINGER_M)).fold(0.0, f64::max);
    println!("the finger's place moved by {:.3} mm, and is off by {:.3} mm at most", 1e3 * moved_m, 1e3 * off_m);
    assert!(moved_m < 1e-4 && off_m < 3e-4, "{moved_m} {off_m}");
    // Conductances are told as if the conductivity were that of the description, of which this contact's is a share.
    let [least_s, most_s] = [f64::min, f64::max].map(|fold| day.fingers_s.iter().copied().reduce(fold).unwrap());
    assert!(most_s < 1.03 * least_s, "{least_s} to {most_s} S");
    assert!(day.invented.is_empty() && day.missed.is_empty() && day.taken.is_empty(), "{wrong:?}");
    // The cup and the hand have lasted for long; nothing else is worth a word.
    let is_long = |hour: &usize| [CUP_H, HAND_H].contains(hour);
    assert!(day.notices.iter().all(|(hour, state)| is_long(hour) || state.notice().is_none()), "{:?}", day.notices);
}

/// Readings are ratios: a detector of another conductivity reads the same if all other resistances have changed with it, those of contacts, pads
/// and switch. So readings tell conductivity from the resistance of the switch, which drifts too, by nothing.
#[test]
fn a_drift_of_conductivity_cannot_be_told_from_one_of_the_switch() {
    let usual = detector();
    let mut other = usual.clone();
    for layer in &mut other.layers {
        layer.bottom_s_per_m *= 0.8;
        layer.top_s_per_m *= 0.8;
    }
    let volts = |detector: &Detector, conductance_s: f64| {
        let press = [Touch::flat(FINGER_M, Shape::Disc { radius_m: 0.003 }, conductance_s)];
        readings_v(&touched_impedance_ohm(&Slab::new(detector).unwrap(), &press).unwrap(), detector)
    };
    let apart_v =
        |a: &Readings, b: &Readings| a.volts().iter().zip(b.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let before = volts(&usual, 3e-3);
    // A switch that stays as it is shows what drifts by two codes, in what the grounded electrodes read.
    let by_conductivity_v = apart_v(&before, &volts(&other, 0.8 * 3e-3));
    assert!((0.5e-3..2e-3).contains(&by_conductivity_v), "{by_conductivity_v}");
    other.on_resistance_ohm /= 0.8;
    other.contact_impedance_ohm_m2 /= 0.8;
    let by_both_v = apart_v(&before, &volts(&other, 0.8 * 3e-3));
    assert!(by_both_v < 1e-7, "{by_both_v}");
}
