//! Experiments: what is measured, and what solvers know of it.

use super::*;
use crate::independent::tests::Contents;
use crate::scenes::SceneKind;
use tactomo_physics::causes::with_causes;
use tactomo_physics::forward::readings_v;
use tactomo_touch::solve::Method;

fn experiment() -> Experiment {
    Experiment::new(&Detector::preset(Detector::DEFAULT).unwrap()).unwrap()
}

fn readings(experiment: &Experiment, seed: u64) -> Readings {
    let touches = SceneKind::Firm.frames(&experiment.detector, 1, 1);
    experiment.frames(&touches, seed).unwrap().remove(0).readings
}

#[test]
fn readings_are_the_finer_models_with_noise_and_those_of_a_seed() {
    let experiment = experiment();
    let first = readings(&experiment, 1);
    assert_eq!(first, readings(&experiment, 1));
    assert_ne!(first, readings(&experiment, 2));
    let contact = SceneKind::Firm.frames(&experiment.detector, 1, 1)[0][0].disc().unwrap();
    let model = readings_v(&experiment.problem.model.impedance_ohm(&[contact]).unwrap(), &experiment.detector);
    let off = first.volts().iter().zip(model.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off > 0.0 && off < 0.02 * model.largest_v() + 0.006, "{off}");
}

#[test]
fn readings_of_an_independent_solution_are_its_own_with_noise_and_solvers_know_tolerances() {
    let solution = Arc::new(Contents::of_network().read().unwrap());
    let sound = experiment();
    let solved = sound.solved_by(Arc::clone(&solution)).unwrap();
    assert_eq!(solved.problem.detector(), &solved.detector);
    let touches = vec![solution.patches[7].contact(1e-3).into(), solution.patches[20].contact(2e-4).into()];
    let exact = readings_v(&solution.impedance_ohm(&touches).unwrap(), &sound.detector);
    let read = solved.frames(&[touches], 1).unwrap().remove(0).readings;
    let off = read.volts().iter().zip(exact.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let lsb_v = sound.detector.adc.lsb_v();
    assert!(exact.largest_v() > 100.0 * lsb_v && off > 0.0 && off < 8.0 * lsb_v, "{off}");
    let beside = Contact::flat(1e-3, 0.0, 2e-3, 1e-3);
    assert!(matches!(solved.frames(&[vec![beside.into()]], 1), Err(StudyError::Forward(ForwardError::Contact { .. }))));
}

#[test]
fn at_rest_readings_are_zero_in_the_mean_although_the_converter_cuts_noise_off() {
    let experiment = experiment();
    let frames = experiment.frames(&vec![Vec::new(); 20], 1).unwrap();
    let all: Vec<f64> = frames.iter().flat_map(|frame| frame.readings.volts().iter().copied()).collect();
    let mean_v = all.iter().sum::<f64>() / all.len() as f64;
    // The noise that is left is about 0.9 LSB: that of the mean of 5120 readings and of 256 baselines of 32 frames is 0.016 LSB.
    assert!(mean_v.abs() < 0.06 * experiment.detector.adc.lsb_v(), "{mean_v}");
}

/// As in live and `reconstruct`, which take the same baseline; more readings show less of a press.
#[test]
fn nothing_is_found_at_rest_on_many_electrodes() {
    let experiment = Experiment::new(&Detector::preset("display-140x70").unwrap()).unwrap();
    let mut solver = Method::Auto.build(&experiment.problem).unwrap();
    for seed in 0..4 {
        for frame in experiment.frames(&vec![Vec::new(); 25], seed).unwrap() {
            assert_eq!(solver.solve(&frame.readings).unwrap().contacts, [], "seed {seed}");
        }
    }
}

#[test]
fn a_wrong_sign_shows_in_the_baseline_and_is_taken_off() {
    let experiment = experiment();
    let wrong = experiment.with_faults(&[Fault::Invert { channel: 3 }], 1).unwrap();
    let (sound, wrong) = (readings(&experiment, 1), readings(&wrong, 1));
    assert!(sound.at(7, 3) > 0.02 && (wrong.at(7, 3) + sound.at(7, 3)).abs() < 0.02, "{}", wrong.at(7, 3));
    assert!((wrong.at(7, 4) - sound.at(7, 4)).abs() < 0.02);
}

#[test]
fn a_baseline_under_load_is_taken_off() {
    let experiment = experiment();
    let contact = SceneKind::Firm.frames(&experiment.detector, 1, 1)[0][0].disc().unwrap();
    let loaded = readings(&experiment.with_baseline(&[contact]).unwrap(), 1);
    assert!(loaded.volts().iter().all(|volts| volts.abs() < 0.01), "the same contact is no change");
}

#[test]
fn a_leak_is_a_baseline_under_all_that_presses() {
    let experiment = experiment();
    let leaking = experiment.with_faults(&["leak:0.01".parse().unwrap()], 1).unwrap();
    let rest = leaking.frames(&vec![Vec::new(); 10], 1).unwrap();
    assert!(rest.iter().all(|frame| frame.readings.volts().iter().all(|volts| volts.abs() < 0.01)));
    let (sound, leaking) = (readings(&experiment, 1), readings(&leaking, 1));
    let off = sound.volts().iter().zip(leaking.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // Its voltages at rest alone would leave 16 mV. The noise is the same.
    assert!(off < 0.003, "{off}");
}

#[test]
fn faults_of_time_are_refused() {
    let error = experiment().with_faults(&["creep:0.2:3".parse().unwrap()], 1).err().unwrap();
    assert_eq!(error, StudyError::OfTime { fault: "creep:0.2:3".to_owned() });
}

#[test]
fn solvers_know_of_another_converter_but_not_of_a_wrong_detector() {
    let experiment = experiment();
    let mut other = experiment.detector.clone();
    other.adc.bits = 10;
    assert_eq!(experiment.measured_as(&other).problem.detector().adc.bits, 10);
    other.layers[0].thickness_m *= 2.0;
    let wrong = experiment.with_truth(&other).unwrap();
    assert_eq!(wrong.problem.detector(), &experiment.detector.taken_as_exact());
    assert_ne!(readings(&wrong, 1), readings(&experiment, 1));
}

#[test]
fn what_was_drawn_is_measured_and_solvers_know_the_description_only() {
    let experiment = experiment();
    let built = experiment.as_built(3).unwrap();
    assert_eq!(built.problem.detector(), &experiment.detector);
    assert_eq!(built.truth(), &drawn(&experiment.detector, 3));
    assert_ne!(readings(&built, 1), readings(&experiment, 1));
    assert_ne!(readings(&built, 1), readings(&experiment.as_built(4).unwrap(), 1));
    let known = built.known_as(built.truth()).unwrap();
    assert_eq!(known.problem.detector(), built.truth());
    let mut wide = Detector { name: "wide".to_owned(), ..experiment.detector };
    wide.tolerances.gain_share = 1.0;
    let error = with_causes(&Experiment::of(&wide, Some(1)).err().unwrap());
    assert!(error.starts_with("wide as built with seed 1 is no detector: narrow"), "{error}");
    assert!(error.contains("electrodes.gains["), "{error}");
}

/// Readings of one contact, foretold by who knows what was built, and not by who knows the description.
#[test]
fn who_knows_the_truth_foretells_readings_and_who_knows_the_description_does_not() {
    // The converter cuts off offsets below zero, which no knowledge of the detector brings back.
    let tolerances = Tolerances { offset_lsb: 0.0, ..Tolerances::default() };
    let built = experiment().as_built_within(tolerances, 2).unwrap();
    let known = built.known_as(built.truth()).unwrap();
    let touches = SceneKind::Firm.frames(&built.detector, 1, 1);
    let off = |experiment: &Experiment| {
        let frame = experiment.frames(&touches, 1).unwrap().remove(0);
        let Problem { model, .. } = &experiment.problem;
        let impedance_ohm = model.impedance_ohm(&frame.contacts.unwrap()).unwrap();
        let foretold = readings_v(&impedance_ohm, model.detector());
        let pairs = frame.readings.volts().iter().zip(foretold.volts());
        pairs.map(|(read, foretold)| (read - foretold).abs()).fold(0.0, f64::max) / foretold.largest_v()
    };
    let [described, known] = [&built, &known].map(off);
    // Five deviations of the noise are 6 of some 700 mV.
    assert!(known < 0.02 && described > 5.0 * known, "{described} {known}");
}

#[test]
fn gains_that_are_described_are_taken_off_and_others_are_not() {
    let experiment = experiment();
    let mut told = experiment.detector.clone();
    told.electrodes.iter_mut().enumerate().for_each(|(e, pad)| pad.gain = 1.0 + 0.02 * (e % 3) as f64);
    let wrong = experiment.with_truth(&told).unwrap();
    assert!(
        matches!((&wrong.truth, &experiment.truth), (Truth::Model(one), Truth::Model(other)) if Arc::ptr_eq(one, other)),
        "gains need no other model"
    );
    let right = wrong.known_as(&told).unwrap();
    let off = |other: &Experiment| {
        let pair = [readings(&experiment, 1), readings(other, 1)];
        let volts = pair[0].volts().iter().zip(pair[1].volts()).map(|(a, b)| (a - b).abs());
        volts.fold(0.0, f64::max) / pair[0].largest_v()
    };
    // Noise is that of one seed, so codes differ by rounding alone: 0.8 of 0.8 mV in 0.3 V.
    assert!(off(&wrong) > 0.02 && off(&right) < 0.006, "{} {}", off(&wrong), off(&right));
}

#[test]
fn what_changes_after_the_baseline_is_in_the_readings() {
    let experiment = experiment();
    let at_rest = |experiment: &Experiment| experiment.frames(&vec![Vec::new(); 20], 1).unwrap();
    let mean_v = |experiment: &Experiment, channel: usize| {
        let of = |frame: &Frame| (0..16).map(|g| frame.readings.at(g, channel)).sum::<f64>() / 16.0;
        at_rest(experiment).iter().map(of).sum::<f64>() / 20.0
    };
    let mut shifted = experiment.truth().clone();
    shifted.electrodes[3].offset_v += 0.05;
    let shifted = experiment.with_truth(&shifted).unwrap();
    assert!(mean_v(&shifted, 3).abs() < 2e-3, "a baseline takes offsets off");
    let since = shifted.changed_since(&experiment);
    assert!((mean_v(&since, 3) - 0.05).abs() < 2e-3 && mean_v(&since, 4).abs() < 2e-3);
    let leaking = experiment.with_faults(&[Fault::Leak { sheets: 0.03 }], 1).unwrap();
    let leak_v = |experiment: &Experiment| at_rest(experiment)[0].readings.largest_v();
    assert!(leak_v(&leaking.changed_since(&experiment)) > 0.05);
}
