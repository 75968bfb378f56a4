use super::*;

/// Presses on a sensor of five channels that is no detector of ours: each hears the force by its distance.
fn five_channels(count: usize) -> Presses {
    let even = |step: f64, i: usize| (step * (i + 1) as f64).fract();
    let places_m: Vec<_> = (0..count).map(|i| [0.1 * even(0.7549, i), 0.1 * even(0.5698, i), 0.0]).collect();
    let strengths: Vec<f64> = (0..count).map(|i| 0.5 + 5.0 * even(0.3247, i)).collect();
    let heard = |place: &[f64; 3], force: f64| {
        let ears = [[0.0, 0.0], [0.1, 0.0], [0.0, 0.1], [0.1, 0.1], [0.05, 0.05]];
        ears.map(|ear| force / (1.0 + 200.0 * ((place[0] - ear[0]).powi(2) + (place[1] - ear[1]).powi(2))))
    };
    let readings_v = places_m.iter().zip(&strengths).flat_map(|(place, force)| heard(place, *force)).collect();
    Presses {
        channels: 5,
        readings_v,
        places_m,
        strengths,
        strength: Some(Strength::Force),
        names: Vec::new(),
        of: None,
        others: Vec::new(),
        drive_v: None,
    }
}

#[test]
fn any_number_of_channels_is_learned_from() {
    let kernel = Kernel::train(&five_channels(200)).unwrap();
    assert!(
        kernel.left_out_m() < 0.002 && kernel.left_out_strength().unwrap() < 0.05,
        "{} {:?}",
        kernel.left_out_m(),
        kernel.left_out_strength()
    );
    let unseen = five_channels(230);
    for index in 200..230 {
        let readings = &unseen.readings_v[5 * index..][..5];
        let press = kernel.press(readings).unwrap().unwrap();
        let place = unseen.places_m[index];
        assert!((press.place_m[0] - place[0]).hypot(press.place_m[1] - place[1]) < 0.004, "{press:?} {place:?}");
        assert!((press.strength.unwrap() / unseen.strengths[index] - 1.0).abs() < 0.1, "{press:?}");
    }
    assert_eq!(kernel.press(&[0.1; 4]), Err(None));
    assert_eq!(kernel.press(&[0.1, 0.1, f64::NAN, 0.1, 0.1]), Err(Some(2)));
    assert_eq!(kernel.press(&[1e-6; 5]), Ok(None));
    assert!(kernel.press(&[1.0, -1.0, 1.0, -1.0, 1.0]).unwrap().unwrap().is_outside);
}

#[test]
fn places_that_belong_to_other_presses_are_no_better_than_the_middle() {
    for (count, seed) in [(30, 1), (30, 2), (30, 3), (60, 4), (60, 5), (60, 6), (200, 7), (200, 8)] {
        let mut presses = five_channels(count);
        let right = Kernel::train(&presses).unwrap();
        assert!(!right.is_no_better_than_middle(), "{count}: {} {:?}", right.left_out_m(), right.middle_m());
        fastrand::Rng::with_seed(seed).shuffle(&mut presses.places_m);
        let wrong = Kernel::train(&presses).unwrap();
        assert!(wrong.is_no_better_than_middle(), "{count}: {} {:?}", wrong.left_out_m(), wrong.middle_m());
        // Of a square of 100 mm: 100 / sqrt(6).
        assert!((wrong.middle_m().unwrap() / 0.0408 - 1.0).abs() < 0.1, "{:?}", wrong.middle_m());
    }
}

#[test]
fn of_what_was_not_taught_nothing_is_told() {
    let kernel = Kernel::train(&five_channels(60)).unwrap();
    let press = kernel.press(&five_channels(1).readings_v).unwrap().unwrap();
    let told = |strength| serde_json::to_value(press.solution(strength).contacts[0]).unwrap();
    let names = |strength| told(strength).as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(Some(Strength::Force)), ["force_n", "x_m", "y_m"]);
    assert_eq!(names(Some(Strength::Conductance)), ["conductance_s", "x_m", "y_m"]);
    assert_eq!(names(None), ["x_m", "y_m"]);
}

#[test]
fn presses_that_are_alike_teach_nothing() {
    let mut presses = five_channels(20);
    presses.readings_v.fill(0.5);
    assert!(Kernel::train(&presses).is_err());
    assert!(Kernel::train(&five_channels(5)).unwrap_err().to_string().contains("5 presses, but 10"));
}

/// Presses on 48 cells in six rows that feel pressure, with noise of their own.
fn cells(count: usize, seed: u64) -> Presses {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut noise = tactomo_physics::simulate::Noise::new(seed);
    let mut presses = Presses {
        channels: 48,
        names: Vec::new(),
        readings_v: Vec::new(),
        places_m: Vec::new(),
        strengths: Vec::new(),
        strength: Some(Strength::Force),
        of: None,
        others: Vec::new(),
        drive_v: None,
    };
    for _ in 0..count {
        let (x, y, force) = (0.08 * random.f64(), 0.06 * random.f64(), 0.5 * 10f64.powf(random.f64()));
        let cell = |index: usize| {
            let [column, row] = [index % 8, index / 8].map(|i| 0.08 / 7.0 * i as f64);
            let felt = force * (-((x - column).powi(2) + (y - row).powi(2)) / (2.0 * 0.012 * 0.012)).exp();
            felt.powf(0.8) + 0.01 * noise.normal()
        };
        presses.readings_v.extend((0..48).map(cell));
        presses.places_m.push([x, y, 0.0]);
        presses.strengths.push(force);
    }
    presses
}

/// Share of readings that are flagged (%).
fn flagged(kernel: &Kernel, all: impl Iterator<Item = Vec<f64>>) -> f64 {
    let flags: Vec<bool> =
        all.map(|readings| kernel.press(&readings).unwrap().is_some_and(|press| press.is_outside)).collect();
    100.0 * flags.iter().filter(|is_outside| **is_outside).count() as f64 / flags.len() as f64
}

/// The channel that hears most.
fn loudest(readings: &[f64]) -> usize {
    (0..readings.len()).max_by(|a, b| readings[*a].total_cmp(&readings[*b])).unwrap()
}

#[test]
fn what_was_never_taught_is_flagged_and_single_presses_are_not() {
    for seed in [11, 12, 13] {
        let kernel = Kernel::train(&cells(500, seed)).unwrap();
        let unseen = cells(400, 100 + seed);
        let one = |index: usize| unseen.readings_v[48 * index..][..48].to_vec();
        let mut random = fastrand::Rng::with_seed(seed);
        let mut order: Vec<usize> = (0..48).collect();
        random.shuffle(&mut order);
        let with = |index: usize, at: usize, value: f64| {
            let mut readings = one(index);
            readings[at] = value;
            readings
        };
        let all = || 0..400;
        let single = flagged(&kernel, all().map(one));
        let permuted = flagged(&kernel, all().map(|i| order.iter().map(|&at| one(i)[at]).collect()));
        let mut noise = tactomo_physics::simulate::Noise::new(seed);
        let noisy = flagged(&kernel, all().map(|_| (0..48).map(|_| noise.normal()).collect()));
        let dead = flagged(&kernel, all().map(|i| with(i, loudest(&one(i)), 0.0)));
        let railed = flagged(&kernel, all().map(|i| with(i, random.usize(..48), 5.0)));
        let apart = |pair: &[usize; 2]| {
            let [a, b] = pair.map(|index| unseen.places_m[index]);
            (a[0] - b[0]).hypot(a[1] - b[1]) > 0.03
        };
        let pairs = all().map(|i| [i, (i + 57) % 400]).filter(apart);
        let two = flagged(&kernel, pairs.map(|[a, b]| one(a).iter().zip(one(b)).map(|(a, b)| a + b).collect()));
        let rates =
            format!("{seed}: single {single} permuted {permuted} noise {noisy} dead {dead} rail {railed} two {two}");
        assert!(
            single <= 3.0 && permuted >= 98.0 && noisy >= 99.0 && dead >= 95.0 && railed >= 98.0 && two >= 90.0,
            "{rates}"
        );
    }
}

/// Those of about one force.
fn steady(presses: &Presses) -> Presses {
    let kept: Vec<usize> =
        (0..presses.places_m.len()).filter(|&index| (2.0..2.4).contains(&presses.strengths[index])).collect();
    let channels = presses.channels;
    Presses {
        readings_v: kept.iter().flat_map(|index| presses.readings_v[channels * index..][..channels].to_vec()).collect(),
        places_m: kept.iter().map(|&index| presses.places_m[index]).collect(),
        strengths: kept.iter().map(|&index| presses.strengths[index]).collect(),
        ..presses.clone()
    }
}

#[test]
fn steady_presses_on_channels_of_unequal_gains_are_described_by_channels() {
    let equal = cells(4000, 21);
    // Factors from 1 to 1000, of the cells and of their noise alike.
    let factor = |index: usize| 1000f64.powf((0.618_034 * (index % 48) as f64).fract());
    let amplified = equal.readings_v.iter().enumerate().map(|(index, volts)| volts * factor(index)).collect();
    let unequal = steady(&Presses { readings_v: amplified, ..equal.clone() });
    let mut errors_m = Vec::new();
    for description in Description::ALL {
        let told = Told::of(&unequal, description).unwrap();
        errors_m.push(Regression::learn(&told.places(&unequal.places_m.concat(), &unequal.groups())).unwrap().missed());
    }
    let kernel = Kernel::train(&unequal).unwrap();
    assert_eq!((kernel.description(), kernel.left_out_m()), (Description::Channels, errors_m[1]));
    assert!(errors_m[1] < 0.95 * errors_m[0], "{errors_m:?}");
    // Of all forces and even gains, those that are alike but for their strength had better be alike.
    assert_eq!(Kernel::train(&cells(500, 21)).unwrap().description(), Description::Directions);
}

#[test]
fn a_height_that_is_noise_does_not_change_places() {
    let flat = cells(300, 5);
    let mut noise = tactomo_physics::simulate::Noise::new(6);
    let places_m = flat.places_m.iter().map(|[x, y, _]| [*x, *y, 1e-6 * noise.normal()]).collect();
    let [flat, noisy] = [flat.clone(), Presses { places_m, ..flat }].map(|presses| Kernel::train(&presses).unwrap());
    assert!(noisy.left_out_m() < 1.001 * flat.left_out_m(), "{} {}", noisy.left_out_m(), flat.left_out_m());
}

#[test]
fn places_alone_are_learned() {
    let presses = Presses { strengths: Vec::new(), strength: None, ..cells(200, 7) };
    let kernel = Kernel::train(&presses).unwrap();
    let press = kernel.press(&presses.readings_v[..48]).unwrap().unwrap();
    assert_eq!((kernel.strength(), kernel.left_out_strength(), press.strength), (None, None, None));
    assert!((press.place_m[0] - presses.places_m[0][0]).abs() < 0.002, "{press:?}");
}

/// The same presses, each in so many rows with noise of their own, in an order that mixes them.
fn in_rows(presses: &Presses, rows: usize, seed: u64) -> Presses {
    let mut noise = tactomo_physics::simulate::Noise::new(seed);
    let mut order: Vec<usize> = (0..presses.count() * rows).map(|row| row / rows).collect();
    fastrand::Rng::with_seed(seed).shuffle(&mut order);
    let readings = |press: &usize| &presses.readings_v[48 * press..][..48];
    Presses {
        readings_v: order.iter().flat_map(readings).map(|volts| volts + 0.001 * noise.normal()).collect(),
        places_m: order.iter().map(|press| presses.places_m[*press]).collect(),
        strengths: order.iter().map(|press| presses.strengths[*press]).collect(),
        of: None,
        ..presses.clone()
    }
}

#[test]
fn of_presses_of_several_rows_whole_ones_are_left_out() {
    let (few, unseen) = (cells(40, 31), cells(200, 131));
    for rows in [1, 6] {
        let taught = in_rows(&few, rows, 5);
        let kernel = Kernel::train(&taught).unwrap();
        let squares = (0..200).map(|index| {
            let found_m = kernel.press(&unseen.readings_v[48 * index..][..48]).unwrap().unwrap().place_m;
            found_m.iter().zip(&unseen.places_m[index]).map(|(found, is)| (found - is).powi(2)).sum::<f64>()
        });
        let unseen_m = (squares.sum::<f64>() / 200.0).sqrt();
        let ratio = unseen_m / kernel.left_out_m();
        assert!((0.5..2.0).contains(&ratio), "{rows} rows: told {}, unseen {unseen_m}", kernel.left_out_m());
        assert_eq!((kernel.presses(), kernel.rows()), (40, 40 * rows));
    }
    // A column may say it, where places are measured anew in each row.
    let apart = Presses { places_m: (0..80).map(|i| [1e-3 * f64::from(i), 0.0, 0.0]).collect(), ..in_rows(&few, 2, 5) };
    assert_eq!(apart.groups().iter().max(), Some(&79));
    let told = Presses { of: Some((0..80).map(|i| f64::from(i / 8)).collect()), ..apart };
    assert_eq!(told.groups(), (0..80).map(|i| i / 8).collect::<Vec<_>>());
}
