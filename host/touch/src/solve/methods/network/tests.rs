use std::sync::Arc;

use super::*;
use crate::solve::pipeline::fault_tolerant::FaultTolerant;
use crate::solve::pipeline::method::Method;
use tactomo_physics::detector::{Detector, Tolerances};
use tactomo_physics::forward::{ForwardModel, Slab, readings_v};
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Measurement, drawn, finer_model};

fn solver() -> NetworkSolver {
    let slab: Box<dyn ForwardModel> = Box::new(Slab::new(&Detector::default()).unwrap());
    NetworkSolver::new(&Problem::new(slab), Arc::new(Network::shipped().unwrap())).unwrap()
}

/// Readings of a detector as built with a seed, which training does not use, under contacts of some sheet conductances, with faults of its wires.
fn read(seed: u64, contacts: &[(f64, f64, f64)], faults: &[&str]) -> Readings {
    let built = drawn(&Detector::default(), seed);
    let sheet_s = Detector::default().sheet_conductance_s();
    let contacts: Vec<Contact> =
        contacts.iter().map(|(x_m, y_m, sheets)| Contact::flat(*x_m, *y_m, 0.0025, sheets * sheet_s)).collect();
    let impedance_ohm = finer_model(&built, &[], 0).unwrap().impedance_ohm(&contacts).unwrap();
    let faults: Vec<_> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
    Measurement::new(&built, &faults, seed).unwrap().readings_v(Some(&impedance_ohm))
}

const PLACES: [(f64, f64, f64); 4] =
    [(0.0113, -0.0041, 0.1), (-0.0183, 0.0067, 0.5), (0.002, 0.0205, 3.0), (-0.006, -0.016, 0.3)];

#[test]
fn single_contacts_are_found_on_detectors_that_nobody_calibrated() {
    let mut solver = solver();
    let mut missed_m = Vec::new();
    for (seed, place) in (2000..2004).zip(PLACES) {
        let solution = solver.solve(&read(seed, &[place], &[])).unwrap();
        let [found] = solution.contacts[..] else { panic!("{seed}: {:?}", solution.contacts) };
        missed_m.push((found.x_m - place.0).hypot(found.y_m - place.1));
        let sheets = found.conductance_s / Detector::default().sheet_conductance_s();
        // Conductivity is known to 20 %, and of firm contacts little more than that they are firm is read.
        assert!((sheets / place.2).ln().abs() < 1.0, "{seed}: {sheets} {}", place.2);
        assert!(!solution.flags.misfit, "{seed}");
    }
    // A mean of 2 mm is what it is for.
    assert!(missed_m.iter().sum::<f64>() < 2e-3 * missed_m.len() as f64, "{missed_m:?}");
}

#[test]
fn two_contacts_far_apart_are_distinguished() {
    let mut solver = solver();
    let pair = [(-0.015, -0.012, 0.5), (0.014, 0.013, 0.5)];
    let solution = solver.solve(&read(2010, &pair, &[])).unwrap();
    assert_eq!(solution.contacts.len(), 2, "{:?}", solution.contacts);
    for (x_m, y_m, _) in pair {
        let nearest_m = solution.contacts.iter().map(|found| (found.x_m - x_m).hypot(found.y_m - y_m));
        assert!(nearest_m.fold(f64::INFINITY, f64::min) < 4e-3, "{:?}", solution.contacts);
    }
}

#[test]
fn what_it_never_saw_is_flagged() {
    let mut solver = solver();
    let place = [PLACES[1]];
    assert!(!solver.solve(&read(2020, &place, &[])).unwrap().flags.misfit);
    for fault in ["open:5", "short:5,6", "swap:5,10"] {
        assert!(solver.solve(&read(2020, &place, &[fault])).unwrap().flags.misfit, "{fault}");
    }
    let mut random = fastrand::Rng::with_seed(3);
    let noise = Readings::from_fn(16, |_, _| random.f64());
    assert!(solver.solve(&noise).unwrap().flags.misfit);
}

#[test]
fn without_a_broken_electrode_it_goes_on_with_the_others() {
    let slab: Box<dyn ForwardModel> = Box::new(Slab::new(&Detector::default()).unwrap());
    let mut solver = FaultTolerant::new(Method::Network, &Problem::new(slab)).unwrap();
    let mut missed_m = Vec::new();
    for (index, place) in PLACES.into_iter().enumerate() {
        let readings = read(2030 + index as u64, &[place], &["open:5"]);
        let mut last = Solution::default();
        (0..100).for_each(|_| last = solver.solve(&readings).unwrap());
        assert_eq!(last.flags.excluded, [5]);
        // Its count may be wrong then: the firmest is where the contact is.
        let firmest = last.contacts.iter().max_by(|a, b| a.conductance_s.total_cmp(&b.conductance_s)).unwrap();
        missed_m.push((firmest.x_m - place.0).hypot(firmest.y_m - place.1));
        solver.reset();
    }
    assert!(missed_m.iter().sum::<f64>() < 3e-3 * missed_m.len() as f64, "{missed_m:?}");
}

#[test]
fn nothing_is_found_where_nothing_touches() {
    assert_eq!(solver().solve(&Readings::from_fn(16, |_, _| 0.0)).unwrap(), Solution::default());
}

#[test]
fn readings_scale_with_the_drive_and_conductances_with_the_sheet() {
    let detector = Detector::default();
    let contact = Contact::flat(0.0113, -0.0041, 0.0025, 0.3 * detector.sheet_conductance_s());
    let mut twice = detector.clone();
    twice.layers.iter_mut().for_each(|layer| {
        (layer.bottom_s_per_m, layer.top_s_per_m) = (2.0 * layer.bottom_s_per_m, 2.0 * layer.top_s_per_m)
    });
    twice.contact_impedance_ohm_m2 /= 2.0;
    twice.on_resistance_ohm /= 2.0;
    twice.drive_v *= 0.5;
    let found = |detector: &Detector, factor: f64| {
        let slab: Box<dyn ForwardModel> = Box::new(Slab::new(detector).unwrap());
        let contact = Contact { conductance_s: factor * contact.conductance_s, ..contact };
        let readings = readings_v(&slab.impedance_ohm(&[contact]).unwrap(), detector);
        NetworkSolver::new(&Problem::new(slab), Arc::new(Network::shipped().unwrap()))
            .unwrap()
            .solve(&readings)
            .unwrap()
            .contacts[0]
    };
    let (one, other) = (found(&detector, 1.0), found(&twice, 2.0));
    assert!((one.x_m - other.x_m).hypot(one.y_m - other.y_m) < 1e-6, "{one:?} {other:?}");
    assert!((other.conductance_s / one.conductance_s - 2.0).abs() < 1e-3, "{one:?} {other:?}");
}

#[test]
fn other_detectors_are_refused_with_what_differs_and_what_to_do() {
    let network = Network::shipped().unwrap();
    let thicker = {
        let mut detector = Detector::default();
        detector.layers[0].thickness_m *= 2.0;
        detector
    };
    let moved = {
        let mut detector = Detector::default();
        detector.electrodes.swap(2, 3);
        detector
    };
    for (detector, what) in [
        (Detector::preset("display-140x70").unwrap(), "32 electrodes, not 16"),
        (Detector::preset("square-150").unwrap(), "no rectangle of 60.0 mm x 60.0 mm"),
        (thicker, "10.0 mm thick, not 5.0 mm"),
        (moved, "electrode 2 is elsewhere"),
    ] {
        let error = network.check(&detector).unwrap_err().to_string();
        assert!(error.contains(what) && error.contains("tools/train_network.py"), "{error}");
    }
    // Detectors within their tolerances, as calibrations find them, are not others.
    for seed in 0..20 {
        let built = drawn(&Detector { tolerances: Tolerances::default(), ..Detector::default() }, seed);
        assert_eq!(network.check(&built), Ok(()), "{seed}");
    }
    let display = Problem::of(&Detector::preset("square-150").unwrap()).unwrap();
    assert!(Method::Network.build(&display).map(|_| ()).unwrap_err().to_string().contains("train a network"));
}
