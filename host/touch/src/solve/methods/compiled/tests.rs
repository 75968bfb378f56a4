use super::*;
use crate::solve::compiled::Ways;
use crate::solve::pipeline::method::Method;
use tactomo_physics::detector::{ConverterErrors, Detector, ForceLaw, Outline, Parameter, Tolerances, electrode_grid};
use tactomo_physics::forward::{ForwardModel, Resolution, Slab, readings_v};
use tactomo_physics::scene::Contact as Disc;
use tactomo_physics::simulate::{Noise, drawn, measured};

fn detector() -> Detector {
    Detector::preset("square-60").unwrap().taken_as_exact()
}

fn disc(x_m: f64, y_m: f64, radius_m: f64, sheets: f64) -> Disc {
    Disc::flat(x_m, y_m, radius_m, sheets * detector().sheet_conductance_s())
}

/// Readings of discs by a finer slab, with noise.
fn touched(discs: &[Disc], noise: &mut Noise) -> Readings {
    let detector = detector();
    let slab = Slab::with_resolution(&detector, Resolution::FINE).unwrap();
    if discs.is_empty() {
        // What a baseline leaves: noise that the converter cuts off at zero has a mean, which is a press.
        return Readings::from_fn(detector.electrodes.len(), |_, _| 0.0);
    }
    measured(&readings_v(&slab.impedance_ohm(discs).unwrap(), &detector), &detector.adc, noise)
}

fn off_m(found: &FoundContact, disc: &Disc) -> f64 {
    (found.x_m - disc.x_m).hypot(found.y_m - disc.y_m)
}

/// A third of the electrodes' distance, firm: one contact, of its radius, and nothing is left of the readings.
#[test]
fn a_wide_firm_disc_is_one_contact() {
    let mut solver = Compiled::new(&Problem::of(&detector()).unwrap()).unwrap();
    let slab = Slab::with_resolution(&detector(), Resolution::FINE).unwrap();
    for (x_m, y_m) in [(0.0035, -0.0033), (-0.0101, 0.015), (0.015, 0.015)] {
        for sheets in [1.0, 10.0, 60.0] {
            let there = disc(x_m, y_m, 0.005, sheets);
            solver.reset();
            let solution = solver.solve(&readings_v(&slab.impedance_ohm(&[there]).unwrap(), &detector())).unwrap();
            let [found] = &solution.contacts[..] else { panic!("{there:?} {solution:?}") };
            assert!(off_m(found, &there) < 2e-5, "{there:?} {found:?}");
            assert!((found.radius_m.unwrap() / 0.005 - 1.0).abs() < 0.04, "{there:?} {found:?}");
            assert!(solution.residual.unwrap() < 0.09, "{there:?} {solution:?}");
        }
    }
}

#[test]
fn contacts_are_where_the_full_physics_has_them() {
    let mut solver = Compiled::new(&Problem::of(&detector()).unwrap()).unwrap();
    let mut noise = Noise::new(3);
    // Light and firm, narrow and wide, in the middle and cut by a wall; how far they may be off (m).
    let alone = [
        (disc(0.004, -0.011, 0.002, 0.1), 6e-4),
        (disc(-0.015, 0.008, 0.0055, 1.0), 1e-4),
        (disc(0.0117, 0.0161, 0.0059, 1.65), 1e-4),
        (disc(-0.0032, 0.0256, 0.0027, 38.0), 3e-4),
        (disc(-0.024, 0.002, 0.0015, 0.3), 6e-4),
        (disc(0.0276, 0.0181, 0.003, 6.0), 1.5e-3),
    ];
    for (disc, most_m) in alone {
        solver.reset();
        let solution = solver.solve(&touched(&[disc], &mut noise)).unwrap();
        let [found] = &solution.contacts[..] else { panic!("{disc:?} {solution:?}") };
        assert!(off_m(found, &disc) < most_m, "{disc:?} {found:?}");
        assert!(!solution.flags.misfit && !solution.flags.calibrate, "{disc:?} {solution:?}");
        let (log, errors) = ((found.conductance_s / disc.conductance_s).ln(), found.uncertainty.unwrap());
        assert!(log.abs() < 4.0 * errors.conductance_s / found.conductance_s, "{log} {disc:?} {found:?}");
    }
    let three =
        [disc(0.008, 0.009, 0.0028, 0.11), disc(-0.0068, -0.0238, 0.0016, 0.45), disc(-0.0186, -0.0046, 0.006, 3.77)];
    for count in 2..=3 {
        let mut right = 0;
        for _ in 0..8 {
            solver.reset();
            let solution = solver.solve(&touched(&three[..count], &mut noise)).unwrap();
            // Noise may look like a light contact more, of which none is sure.
            let is_right = solution.contacts.len() == count;
            let is_named = solution.alternative.is_some_and(|other| other.contacts == count);
            assert!((is_right || is_named) && !solution.flags.misfit, "{solution:?}");
            right += usize::from(is_right);
            for disc in &three[..count] {
                let nearest_m = solution.contacts.iter().map(|found| off_m(found, disc)).fold(f64::MAX, f64::min);
                assert!(nearest_m < 1.5e-3, "{disc:?} {solution:?}");
            }
        }
        assert!(right >= 7, "{count}: {right} of 8");
    }
}

/// Each frame is answered by itself, whatever lifts or lands between one and the next.
#[test]
fn five_contacts_are_found_and_those_that_stay_when_others_lift() {
    let mut solver = Compiled::new(&Problem::of(&detector()).unwrap()).unwrap();
    let five = [(-0.02, -0.02), (0.02, -0.02), (-0.02, 0.02), (0.02, 0.02), (0.0, 0.0)];
    let five = five.map(|(x_m, y_m)| disc(x_m, y_m, 0.0025, 0.5));
    let mut noise = Noise::new(3);
    for count in [5, 5, 3, 2, 0, 1, 4, 0, 3] {
        let solution = solver.solve(&touched(&five[..count], &mut noise)).unwrap();
        assert!(solution.contacts.len() == count && !solution.flags.misfit, "{count}: {solution:?}");
    }
}

#[test]
fn errors_of_conductances_are_as_large_as_they_are_said_to_be() {
    let mut solver = Compiled::new(&Problem::of(&detector()).unwrap()).unwrap();
    let (mut noise, mut random) = (Noise::new(7), fastrand::Rng::with_seed(7));
    let slab = Slab::with_resolution(&detector(), Resolution::FINE).unwrap();
    let scenes = 60;
    let sigmas = (0..scenes).map(|_| {
        let [x_m, y_m] = [0, 1].map(|_| 0.052 * (random.f64() - 0.5));
        let disc = disc(x_m, y_m, 1e-3 * 6f64.powf(random.f64()), 0.02 * 1e3f64.powf(random.f64()));
        let clean = readings_v(&slab.impedance_ohm(&[disc]).unwrap(), &detector());
        solver.reset();
        let found = solver.solve(&measured(&clean, &detector().adc, &mut noise)).unwrap().contacts[0];
        let errors = found.uncertainty.unwrap();
        (found.conductance_s / disc.conductance_s).ln().abs() * found.conductance_s / errors.conductance_s
    });
    let sigmas: Vec<f64> = sigmas.collect();
    let within = |most: f64| sigmas.iter().filter(|sigma| **sigma < most).count();
    // Of normal errors 41 and 57 would be: what the fields are off by is not noise.
    assert!((30..=55).contains(&within(1.0)) && within(2.0) >= 48, "{} {}", within(1.0), within(2.0));
}

#[test]
fn standard_errors_are_about_those_of_many_frames() {
    let mut solver = Compiled::new(&Problem::of(&detector()).unwrap()).unwrap();
    let (mut noise, disc) = (Noise::new(5), disc(0.004, -0.011, 0.0025, 0.05));
    let clean = touched(&[disc], &mut Noise::new(1));
    let frames = 60;
    let squares = (0..frames).map(|_| {
        solver.reset();
        let read = measured(&clean, &detector().adc, &mut noise);
        let found = solver.solve(&read).unwrap().contacts[0];
        let errors = found.uncertainty.unwrap();
        [(found.x_m - disc.x_m) / errors.x_m, (found.y_m - disc.y_m) / errors.y_m].map(|off| off * off)
    });
    let mean = squares.map(|[x, y]| 0.5 * (x + y)).sum::<f64>() / f64::from(frames);
    // The frame that the others are made of has noise of its own.
    assert!((0.4..4.0).contains(&mean), "{mean}");
}

#[test]
fn a_board_tells_the_newtons_of_the_host() {
    let law = ForceLaw {
        conductance_at_1_n_s: 1e-3,
        exponent: 1.3,
        series_ohm: Some(500.0),
        range_n: [0.1, 5.0],
        ..ForceLaw::siemens()
    };
    let problem = Problem::of(&Detector { force: Some(law), ..detector() }).unwrap();
    let bytes = compile(&problem).unwrap();
    let table = Table::read(&bytes).unwrap();
    let mut solver = Method::Core.build(&problem).unwrap();
    let mut noise = Noise::new(3);
    // Light and firm, in the middle, at a wall and towards a corner.
    for (x_m, y_m) in [(0.004, -0.011), (-0.022, 0.003), (0.015, 0.015)] {
        for sheets in [0.03, 0.3, 3.0] {
            solver.reset();
            let solution = solver.solve(&touched(&[disc(x_m, y_m, 0.0025, sheets)], &mut noise)).unwrap();
            let [found] = &solution.contacts[..] else { panic!("{solution:?}") };
            let at_m = [found.x_m, found.y_m].map(|m| m as f32);
            let board_n = table.force_n(at_m, found.apparent_conductance_s.unwrap() as f32).unwrap();
            let mut received = [*found];
            add_newtons(&bytes, problem.detector().force.as_ref().unwrap(), &mut received);
            for newtons in [board_n.into(), received[0].force_n.unwrap()] {
                let apart = (newtons / found.force_n.unwrap()).ln();
                assert!(apart.abs() < 0.05, "{x_m} {y_m} {sheets}: {newtons} N, {:?} N", found.force_n);
            }
        }
    }
}

#[test]
fn a_described_detector_is_trusted_less_than_an_exact_one() {
    let model_share = |detector: &Detector| {
        let bytes = compile(&Problem::of(detector).unwrap()).unwrap();
        f64::from(Table::read(&bytes).unwrap().head().model_share)
    };
    let [exact, described] = [model_share(&detector()), model_share(&Detector::preset("square-60").unwrap())];
    assert!(exact < 1e-3 && (0.01..0.05).contains(&described), "{exact} {described}");
    // Gains of 1 % and bows of 12 mV, of two converters, as an ESP32 has: what a firmer contact does too is no error.
    let errors = ConverterErrors { gain_share: 0.01, bow_v: 0.012, range_v: [0.142, 3.1] };
    let mut on_a_chip = Detector { converters: vec![errors; 2], ..detector() };
    on_a_chip.electrodes[8..].iter_mut().for_each(|pad| pad.converter = 1);
    let on_a_chip = model_share(&on_a_chip);
    assert!((0.005..0.015).contains(&on_a_chip), "{on_a_chip}");
}

#[test]
fn on_detectors_as_built_contacts_are_counted_and_a_calibration_is_asked_for() {
    let described = Detector::preset("square-60").unwrap();
    let mut solver = Compiled::new(&Problem::of(&described).unwrap()).unwrap();
    let mut solve = |built: &Detector, discs: &[Disc]| {
        solver.reset();
        let slab = Slab::with_resolution(built, Resolution::FINE).unwrap();
        let readings = readings_v(&slab.impedance_ohm(discs).unwrap(), built);
        solver.solve(&measured(&readings, &built.adc, &mut Noise::new(3))).unwrap()
    };
    let all = [disc(0.011, -0.013, 0.003, 0.5), disc(-0.012, 0.008, 0.003, 0.5)];
    assert!(all.iter().all(|disc| !solve(&described, &[*disc]).flags.calibrate), "it is as described");
    let (mut right, mut within, mut places) = (0, 0, 0);
    for built in (0..8).map(|seed| drawn(&described, seed)) {
        for count in 1..=all.len() {
            let solution = solve(&built, &all[..count]);
            assert!(solution.flags.calibrate && !solution.flags.misfit, "{solution:?}");
            right += usize::from(solution.contacts.len() == count);
            for found in solution.contacts.iter().filter(|_| solution.contacts.len() == count) {
                let nearest_m = all[..count].iter().map(|disc| off_m(found, disc)).fold(f64::MAX, f64::min);
                let known = found.uncertainty.unwrap();
                within += usize::from(nearest_m < 2.0 * known.x_m.hypot(known.y_m));
                places += 1;
            }
        }
    }
    assert!(right >= 14, "{right} of 16");
    assert!(10 * within >= 9 * places, "{within} of {places}");
}

/// Far from what is described, changes that multiply each other tell: a pad on a layer that conducts three times worse there than on top has twice the field at itself, of
/// which unevenness takes its part.
#[test]
fn detectors_far_from_their_description_leave_no_more_than_noise() {
    let described = Detector::preset("square-60").unwrap();
    let mut solver = Compiled::new(&Problem::of(&described).unwrap()).unwrap();
    let tolerances = described.tolerances;
    let twice_as_uneven =
        Tolerances { uneven_share: 2.0 * tolerances.uneven_share, top_over_bottom_factor: 1.0, ..tolerances };
    let (mut errors_m, mut residuals, mut within) = (Vec::new(), Vec::new(), 0);
    for seed in 0..3 {
        let built = drawn(&Detector { tolerances: twice_as_uneven, ..described.clone() }, seed);
        let built = built.stepped(&[(Parameter::TopOverBottom, 3f64.ln())]);
        let slab = Slab::with_resolution(&built, Resolution::FINE).unwrap();
        let (mut noise, mut random) = (Noise::new(seed), fastrand::Rng::with_seed(seed));
        for _ in 0..12 {
            let [x_m, y_m] = [0, 1].map(|_| 0.05 * (random.f64() - 0.5));
            let disc = disc(x_m, y_m, 0.0025, 0.1 * 20f64.powf(random.f64()));
            let readings = readings_v(&slab.impedance_ohm(&[disc]).unwrap(), &built);
            solver.reset();
            let solution = solver.solve(&measured(&readings, &built.adc, &mut noise)).unwrap();
            let [found] = &solution.contacts[..] else { panic!("{disc:?} {solution:?}") };
            let known = found.uncertainty.unwrap();
            errors_m.push(off_m(found, &disc));
            residuals.push(solution.residual.unwrap());
            within += usize::from(off_m(found, &disc) < 2.0 * known.x_m.hypot(known.y_m));
        }
    }
    errors_m.sort_unstable_by(f64::total_cmp);
    residuals.sort_unstable_by(f64::total_cmp);
    let middle = errors_m.len() / 2;
    assert!(errors_m[middle] < 3e-4, "{errors_m:?}");
    assert!(residuals[middle] < 1.1, "{residuals:?}");
    assert!(within >= 32, "{within} of {}", errors_m.len());
}

#[test]
fn tables_are_of_a_layout_and_of_a_size() {
    let table = |detector: &Detector| compile(&Problem::of(&detector.taken_as_exact()).unwrap()).unwrap();
    let square = table(&detector());
    assert!((60_000..110_000).contains(&square.len()), "{}", square.len());
    let mut other = detector();
    other.electrodes[3].x_m += 1e-3;
    let layout = |bytes: &[u8]| Table::read(bytes).unwrap().layout();
    assert_ne!(layout(&square), layout(&table(&other)));
    other.electrodes[3].x_m -= 1e-3;
    other.layers[0].thickness_m *= 1.01;
    assert_eq!(layout(&square), layout(&table(&other)), "what is calibrated is of the same layout");
}

/// Who fits a table and who reads it mirror contacts at the same walls, whatever the outline: also at cut corners that no middle of a cell is in.
#[test]
fn tables_are_read_with_the_walls_that_they_are_fitted_with() {
    for (cut_m, has_walls) in [(0.0, true), (0.0005, true), (0.006, false)] {
        let (half_m, inner_m) = (0.03, 0.03 - cut_m);
        let mut outer =
            vec![[-half_m, -half_m], [half_m, -half_m], [half_m, inner_m], [inner_m, half_m], [-half_m, half_m]];
        outer.dedup();
        let outline = Outline { outer, holes: Vec::new() };
        let problem = Problem::of(&Detector { outline, ..detector() }).unwrap();
        let bytes = compile(&problem).unwrap();
        let walls_m = Table::read(&bytes).unwrap().walls_m::<f64>();
        assert_eq!(
            (walls_m.is_some(), Ways::of(problem.modelled()).walls_m.is_some()),
            (has_walls, has_walls),
            "{cut_m}"
        );
    }
}

#[test]
fn what_has_no_table_says_why() {
    let square = Detector::preset("square-60").unwrap();
    let many = Detector { electrodes: electrode_grid(0.06, 0.06, 6, 6, 0.002), ..square };
    let problem = Problem::of(&many).unwrap();
    let why = Method::Core.build(&problem).err().unwrap().to_string();
    assert!(why.contains("36 electrodes") && why.contains("32 at most"), "{why}");
}

#[test]
fn gains_and_offsets_are_those_of_the_channels() {
    let mut detector = detector();
    (detector.electrodes[5].gain, detector.electrodes[5].unseen_offset_v) = (1.02, -0.003);
    let bytes = compile(&Problem::of(&detector).unwrap()).unwrap();
    let table = Table::read(&bytes).unwrap();
    for volts in [0.0, 0.001, 0.4] {
        let mut readings = Readings::from_fn(16, |_, _| volts);
        readings.correct_channels(&detector);
        let ours = f64::from(table.corrected_v(5, volts as f32));
        assert!((ours - readings.at(2, 5)).abs() < 1e-6, "{ours} {}", readings.at(2, 5));
    }
}
