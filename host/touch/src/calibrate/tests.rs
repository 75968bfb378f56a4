//! A rub on simulated detectors as built.

use super::*;
use crate::solve::{ContactSettings, Contacts, Problem, Solver};
use std::sync::LazyLock;
use tactomo_physics::detector::{Detector, Parameter, Tolerances};
use tactomo_physics::readings::{Range, Says};
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Measurement, drawn, finer_model};

/// A detector as built with what its board reads of contacts, less what it reads at rest.
struct RubTrial {
    model: Box<dyn tactomo_physics::forward::ForwardModel>,
    board: Measurement,
    rest_v: Vec<f64>,
    random: fastrand::Rng,
}

impl RubTrial {
    fn new(seed: u64) -> Self {
        let built = drawn(&Detector::default(), seed);
        let mut board = Measurement::new(&built, &[], seed).unwrap();
        let mut rest_v = vec![0.0; 256];
        for _ in 0..32 {
            let readings = board.readings_v(None);
            rest_v.iter_mut().zip(readings.volts()).for_each(|(sum, volts)| *sum += volts / 32.0);
        }
        Self { model: finer_model(&built, &[], seed).unwrap(), board, rest_v, random: fastrand::Rng::with_seed(seed) }
    }

    fn contacts(&mut self, count: usize) -> Vec<Contact> {
        let mut place_m = || 0.046 * (self.random.f64() - 0.5);
        let places: Vec<_> = (0..count).map(|_| [place_m(), place_m()]).collect();
        places.into_iter().map(|[x_m, y_m]| Contact::flat(x_m, y_m, 0.0025, 1e-3)).collect()
    }

    fn frame(&mut self, contacts: &[Contact]) -> Frame {
        let read = self.board.readings_v(Some(&self.model.impedance_ohm(contacts).unwrap()));
        let readings = Readings::from_fn(16, |g, e| read.at(g, e) - self.rest_v[16 * g + e]);
        Frame { readings, known_m: None }
    }
}

/// The converters of an ESP32, whose lowest codes read 142 and 128 mV: see `Volts` of the package `tactomo-board`, with its margin.
fn esp32() -> Vec<Range> {
    (0..16).map(|e| Range { floor_v: if e < 6 { 0.148 } else { 0.134 }, ceiling_v: 3.094 }).collect()
}

/// Light and firm presses of a rub, as a board reads them less the baseline, and as one with floors reads them, whose baseline is below these.
fn both_boards(trial: &mut RubTrial, count: usize) -> Vec<(Contact, [Frame; 2])> {
    let mut pressed = |_| {
        let contact = trial.contacts(1)[0];
        let contact = Contact { conductance_s: 1e-4 * 30f64.powf(trial.random.f64()), ..contact };
        let whole = trial.frame(&[contact]);
        let read = Readings::from_fn(16, |g, e| whole.readings.at(g, e) + trial.rest_v[16 * g + e]);
        (contact, [whole, Frame { readings: read.within(&esp32()), known_m: None }])
    };
    (0..count).map(&mut pressed).collect()
}

#[test]
fn what_is_below_a_floor_spoils_no_calibration() {
    let mut trial = RubTrial::new(5);
    let presses = both_boards(&mut trial, 80);
    let bounds = |frame: &Frame| frame.readings.all_say().iter().filter(|says| **says != Says::Voltage).count();
    let hidden = presses.iter().map(|(_, [_, floored])| bounds(floored)).sum::<usize>();
    assert!(hidden > 80 * 256 / 10, "{hidden}");
    let tried = both_boards(&mut trial, 24);
    // What a channel reads at rest is in the baseline of one board, and in the other's calibration: each is tried by itself.
    let [whole_m, floored_m] = [0, 1].map(|board| {
        let of_board = |(contact, frames): &(Contact, [Frame; 2])| (*contact, frames[board].clone());
        let frames: Vec<_> = presses.iter().map(|press| of_board(press).1).collect();
        off_m(&rubbed(&frames).unwrap().detector, &tried.iter().map(of_board).collect::<Vec<_>>())
    });
    assert!(floored_m < 1.5 * whole_m && floored_m < 0.2e-3, "{whole_m} {floored_m}");
}

#[test]
fn two_electrodes_that_are_below_the_floor_in_every_frame_are_reported() {
    let mut trial = RubTrial::new(5);
    let hidden = |readings: Readings| readings.saying(|g, e| if g + e == 1 { Says::AtMost } else { Says::Voltage });
    let frame = |(_, [whole, _]): (Contact, [Frame; 2])| Frame { readings: hidden(whole.readings), known_m: None };
    let frames: Vec<_> = both_boards(&mut trial, 20).into_iter().map(frame).collect();
    assert_eq!(rubbed(&frames).map(|found| found.single), Err(CalibrateError::Light { touched: 20 }));
}

/// A rub of 48 presses, and what comes of it.
static RUBBED: LazyLock<Rub> = LazyLock::new(|| {
    let frames: Vec<_> = both_boards(&mut RubTrial::new(5), 48).into_iter().map(|(_, [whole, _])| whole).collect();
    rubbed(&frames).unwrap()
});

fn rubbed(frames: &[Frame]) -> Result<Rub, CalibrateError> {
    rub(&Detector::default(), frames, &RubSettings { presses: 40, ..RubSettings::default() }, &mut |_| true)
}

/// Mean distance of single contacts from where they are found with a detector (m).
fn off_m(detector: &Detector, tried: &[(Contact, Frame)]) -> f64 {
    let problem = Problem::of(&detector.taken_as_exact()).unwrap();
    let mut solver = Contacts::new(&problem, ContactSettings { most: 1, ..ContactSettings::of(&problem) }).unwrap();
    let off_m = |(contact, frame): &(Contact, Frame)| {
        solver.reset();
        let mut readings = frame.readings.clone();
        readings.correct_channels(detector);
        let found = solver.solve(&readings).unwrap().contacts[0];
        (found.x_m - contact.x_m).hypot(found.y_m - contact.y_m)
    };
    tried.iter().map(off_m).sum::<f64>() / tried.len() as f64
}

#[test]
fn presses_at_unknown_places_make_places_right() {
    let mut trial = RubTrial::new(5);
    let mut frames = Vec::new();
    for index in 0..60 {
        // Every tenth is of two fingers.
        let contacts = trial.contacts(1 + usize::from(index % 10 == 9));
        frames.push(trial.frame(&contacts));
    }
    let tried: Vec<_> = (0..12)
        .map(|_| {
            let contacts = trial.contacts(1);
            (contacts[0], trial.frame(&contacts))
        })
        .collect();
    let found = rubbed(&frames).unwrap();
    let [before_m, after_m] = [&Detector::default(), &found.detector].map(|detector| off_m(detector, &tried));
    assert!(after_m < 0.4e-3 && after_m < 0.3 * before_m, "{before_m} {after_m}");
    assert!(found.single <= 56 && found.wires.is_none(), "{}", found.single);
    let again = Detector::from_toml(&found.detector.to_toml(), "").unwrap();
    assert_eq!(again.calibration.unwrap().parameters.len(), found.detector.calibration.unwrap().parameters.len());
}

#[test]
fn what_readings_do_not_tell_stays_as_uncertain_as_it_is_described() {
    let found = &*RUBBED;
    let calibration = found.detector.calibration.clone().unwrap();
    let left = |parameter: Parameter| {
        let known = calibration.parameters.iter().find(|known| known.parameter == parameter).unwrap();
        known.standard_error / Tolerances::default().deviation(&found.detector, parameter)
    };
    assert!(left(Parameter::Thickness) < 0.5, "{}", left(Parameter::Thickness));
    // Conductivity, contacts, pads and switch together change nothing; nor does the driving layer what single contacts do not.
    for parameter in [Parameter::Conductivity, Parameter::DrivingSheet] {
        assert!(left(parameter) > 0.7 && left(parameter) < 1.01, "{parameter}: {}", left(parameter));
    }
    let problem = Problem::of(&found.detector).unwrap();
    let mut solver = Contacts::new(&problem, ContactSettings::of(&problem)).unwrap();
    let mut off = |contact: Contact, frame: &Frame| {
        solver.reset();
        let mut readings = frame.readings.clone();
        readings.correct_channels(&found.detector);
        let found = solver.solve(&readings).unwrap().contacts[0];
        let deviation = found.uncertainty.unwrap().conductance_s / found.conductance_s;
        ((found.conductance_s / contact.conductance_s).ln() / deviation).abs()
    };
    // None of the presses of the rub, which are the first.
    let tried = both_boards(&mut RubTrial::new(5), 64).split_off(48);
    let offs: Vec<_> = tried.iter().map(|(contact, [whole, _])| off(*contact, whole)).collect();
    assert!(offs.iter().all(|off| *off < 2.5), "{offs:?}");
}

#[test]
fn presses_that_were_not_used_say_whether_it_helped() {
    let found = &*RUBBED;
    let held_out = found.held_out.unwrap();
    let [before, after] = held_out.residuals;
    assert!(found.helped() && held_out.presses == 8 && after < 0.5 * before, "{held_out:?}");
    assert_eq!(found.place_error_m(), held_out.place_errors_m[1]);
    // Of a few light presses in one place nothing can be concluded.
    let mut trial = RubTrial::new(5);
    let few: Vec<_> = (0..8)
        .map(|_| {
            let [contact] = trial.contacts(1)[..] else { panic!() };
            trial.frame(&[Contact { x_m: 0.2 * contact.x_m, y_m: 0.2 * contact.y_m, conductance_s: 1e-4, ..contact }])
        })
        .collect();
    let found = rubbed(&few).unwrap();
    assert!(!found.helped() && found.held_out.is_none(), "{:?}", found.held_out);
    assert_eq!(found.missing[..2], [Missing::Presses(8), Missing::Firm]);
    assert!(found.missing.iter().any(|missing| matches!(missing, Missing::Place(_))), "{:?}", found.missing);
}

#[test]
fn exchanged_wires_are_found_and_known_places_tell_a_turned_sensor() {
    let mut trial = RubTrial::new(6);
    let turned: Vec<usize> = (0..16).rev().collect();
    let mut frames = Vec::new();
    for index in 0..24 {
        let contacts = trial.contacts(1);
        let frame = trial.frame(&contacts);
        let known_m = (index < 3).then_some([contacts[0].x_m, contacts[0].y_m]);
        frames.push(Frame { readings: frame.readings.of(&turned), known_m });
    }
    assert_eq!(rubbed(&frames).unwrap().wires, Some(turned));
}

#[test]
fn three_known_places_tell_all_eight_ways_that_a_square_can_lie() {
    let mut trial = RubTrial::new(8);
    let contacts: Vec<_> = (0..24).map(|_| trial.contacts(1)[0]).collect();
    let frames: Vec<_> = contacts.iter().map(|contact| trial.frame(&[*contact])).collect();
    let detector = Detector::default();
    for (mirrored, turns) in (0..8).map(|way| (way >= 4, way % 4)) {
        let lying = |[x_m, y_m]: [f64; 2]| {
            let start_m = if mirrored { [-x_m, y_m] } else { [x_m, y_m] };
            (0..turns).fold(start_m, |[x_m, y_m], _| [-y_m, x_m])
        };
        let known = |(index, frame): (usize, &Frame)| {
            let at_m = lying([contacts[index].x_m, contacts[index].y_m]);
            Frame { known_m: (index < 3).then_some(at_m), ..frame.clone() }
        };
        let frames: Vec<_> = frames.iter().enumerate().map(known).collect();
        let order = rub::Sorted::new(&detector, &frames, 24).unwrap().order;
        let lies_there = |(channel, electrode): (usize, &usize)| {
            let [x_m, y_m] = lying([detector.electrodes[channel].x_m, detector.electrodes[channel].y_m]);
            let described = &detector.electrodes[*electrode];
            (described.x_m - x_m).hypot(described.y_m - y_m) < 1e-6
        };
        assert!(order.electrodes.iter().enumerate().all(lies_there), "{mirrored} {turns}: {order:?}");
    }
}

#[test]
fn what_is_no_rub_says_so() {
    let mut trial = RubTrial::new(7);
    assert_eq!(rubbed(&[]).unwrap_err(), CalibrateError::NoPress { frames: 0 });
    let several: Vec<_> = (0..40)
        .map(|_| {
            let contacts = trial.contacts(3);
            trial.frame(&contacts)
        })
        .collect();
    assert!(matches!(rubbed(&several), Err(CalibrateError::NotSingle { .. })), "{:?}", rubbed(&several).err());
    let few = Frame { readings: Readings::from_fn(8, |_, _| 1.0), known_m: None };
    assert!(matches!(rubbed(&[few]), Err(CalibrateError::Count { readings: 8, .. })));
}
