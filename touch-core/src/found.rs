//! What solver and search find on any detector, in any order of its electrodes, and what they say of what they do not find.

use std::vec::Vec;

use crate::detector::Detector;
use crate::fit::{Bench, Fitting, Scene as AnyScene, Went};
use crate::frame::Errors;
use crate::laws::{ALL, solved, summed, tables};
use crate::normal::{ANY_RADIUS, Normal};
use crate::samples::{CELLS, grid_m, table, table_of};
use crate::scan::{first, no_candidates};
use crate::solver::Task;
use crate::tests::{Circuit, Scene, Spot, noisy, spot, volts};
use crate::vector::{PARAMETERS, Vector};
use crate::{Flags, Frame, Says, Solver, Table};

const MOST_PIECES: u32 = <Solver>::MOST_PIECES;

#[test]
fn a_first_contact_is_where_it_is_for_any_number_of_electrodes_and_they_may_be_counted_anew() {
    for (pads_m, bytes) in tables() {
        let (table, n) = (Table::read(&bytes).unwrap(), pads_m.len());
        // Every third after the other: an order in which none stays.
        let order: Vec<usize> = (0..n).map(|e| (e * 3 + 1) % n).collect();
        let renumbered = table_of(&order.iter().map(|e| pads_m[*e]).collect::<Vec<_>>(), &ALL, |_| ());
        let other = Table::read(&renumbered).unwrap();
        for truth in [&[spot(0.004, -0.007, 0.1)][..], &[spot(0.004, -0.009, 0.6), spot(-0.011, 0.004, 0.2)]] {
            let read = noisy(&volts(&table, truth), 3);
            let moved: Vec<_> = (0..n * n).map(|i| read[order[i / n] * n + order[i % n]]).collect();
            let [frame, moved] = [&read, &moved].map(|volts| Frame::of_volts(volts));
            if let [alone] = truth {
                let errors = Errors::of(&frame, &table);
                let (mut done, mut calls) = (<crate::Work>::default(), 0);
                let mut attend = || calls += 1;
                let mut work = crate::fit::Working { done: &mut done, attend: &mut attend };
                let found = first(Task { table: &table, frame: &frame, errors: &errors, unknown: None }, &mut work)[0];
                let off_m = (found.spot.at_m[0] - alone.at_m[0]).hypot(found.spot.at_m[1] - alone.at_m[1]);
                assert!(off_m < 0.006 && (found.spot.ln_ohm - alone.ln_ohm).abs() < 0.1, "{n}: {found:?}");
                assert!(calls >= 100 && calls == done.first_looks);
            }
            let [one, two] = [(&table, &frame), (&other, &moved)].map(|(t, f)| Solver::new().solve(t, f).unwrap());
            assert_eq!((one.contacts().len(), one.flags), (truth.len(), Flags::default()), "{n} {one:?}");
            for spot in truth {
                let near = |answer: &crate::Answer| {
                    let off = |c: &crate::Contact| (c.x_m - spot.at_m[0]).hypot(c.y_m - spot.at_m[1]);
                    *answer.contacts().iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap()
                };
                let (a, b) = (near(&one), near(&two));
                assert!((a.x_m - spot.at_m[0]).hypot(a.y_m - spot.at_m[1]) < 3e-4, "{n} {a:?}");
                assert!((a.x_m - b.x_m).hypot(a.y_m - b.y_m) < 2e-5, "{n} {a:?} {b:?}");
                assert!(
                    (a.conductance_s / b.conductance_s - 1.0).abs() < 0.02
                        && (a.sigma_m[0] / b.sigma_m[0] - 1.0).abs() < 0.05
                );
            }
        }
    }
}

/// Errors are what noise makes of places and strengths, and the radius is no better known than before.
#[test]
fn errors_are_those_of_many_draws() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let truth = [spot(0.004, -0.011, 0.3)];
    let exact = volts(&table, &truth);
    let mut squares = [0.0; 3];
    for seed in 0..60 {
        let noisy = noisy(&exact, 1000 + seed);
        let answer = Solver::new().solve(&table, &Frame::of_volts(&noisy)).unwrap();
        let found = answer.contacts()[0];
        let own = found.conductance_s;
        let error_s = own - Solver::new().solve(&table, &Frame::of_volts(&exact)).unwrap().contacts()[0].conductance_s;
        for (square, error) in squares.iter_mut().zip([
            (found.x_m - 0.004) / found.sigma_m[0],
            (found.y_m + 0.011) / found.sigma_m[1],
            error_s / found.conductance_sigma_s,
        ]) {
            *square += error * error / 60.0;
        }
        assert!(found.radius_sigma_m <= ANY_RADIUS * found.radius_m && found.radius_sigma_m > 0.0);
        assert!(found.correlation.abs() < 1.0 && answer.residual > 0.3 && answer.residual < 1.3);
    }
    // The table has the noise somewhat larger, and a conductance an error of its own.
    assert!(squares[..2].iter().all(|square| (0.15..2.0).contains(square)) && squares[2] < 2.0, "{squares:?}");
}

/// The mean of some frames tells more than one does, and as much more as its noise is less, down to the table's own error.
#[test]
fn a_frame_of_less_noise_tells_more() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let exact = volts(&table, &[spot(0.004, -0.011, 0.3)]);
    let noise_v = table.head().noise_v;
    let sigma_m = |frame: Frame<'_>| Solver::new().solve(&table, &frame).unwrap().contacts()[0].sigma_m[0];
    let [one, same, quarter] = [None, Some(noise_v), Some(noise_v / 4.0)].map(|noise_v| match noise_v {
        Some(noise_v) => sigma_m(Frame::of_volts(&exact).with_noise(noise_v)),
        None => sigma_m(Frame::of_volts(&exact)),
    });
    assert_eq!(one, same);
    assert!((0.2..0.8).contains(&(quarter / one)), "{quarter} {one}");
}

/// One that a step would take over the edge stays there, and the other takes the step that is best with that.
#[test]
fn a_contact_at_a_wall_does_not_lead_others_astray() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let mut normal = Normal::<f32, 3> { count: 8, ..Normal::EMPTY };
    (0..8).for_each(|i| normal.matrix[i][i] = 4.0);
    // The second one's strength goes with the first one's place along x.
    normal.matrix[6][0] = 3.0;
    normal.pull = Vector::ZERO;
    (normal.pull[0], normal.pull[6]) = (2.0, -1.0);
    let at = |x_m: f32| <AnyScene<f32, 3, 0>>::EMPTY.with(spot(x_m, 0.0, 0.3)).with(spot(0.0, 0.01, 0.3));
    let [[low_m, _], [high_m, _]] = table.bounds_m();
    for (x_m, is_free) in [(0.02, true), (high_m, false), (low_m, true)] {
        let (step, gain) = at(x_m).step(&normal, 0.0, &table).unwrap();
        let [x, strength] = if is_free { [11.0 / 7.0, -10.0 / 7.0] } else { [0.0, -0.25] };
        assert!((step[0] - x).abs() < 1e-4 && (step[6] - strength).abs() < 1e-4, "{x_m} {step:?}");
        assert!((gain - (2.0 * x - strength)).abs() < 1e-4, "{x_m} {gain}");
        assert!((1..8).filter(|i| *i != 6).all(|i| step[i] == 0.0));
    }
}

/// Where something presses over the edge, or where there is no detector.
#[test]
fn contacts_stay_on_the_detector() {
    let mut mask = ALL;
    // The right third is cut off.
    (0..CELLS * CELLS).filter(|i| i % CELLS > 12).for_each(|i| mask[i / 8] &= !(1 << (i % 8)));
    let bytes = table_of(&grid_m(4, 4), &mask, |_| ());
    let table = Table::read(&bytes).unwrap();
    let whole = crate::samples::table();
    let whole = Table::read(&whole).unwrap();
    assert!(table.holds(0.008, 0.0) && !table.holds(0.0095, 0.0) && whole.holds(0.0095, 0.0));
    let [low_m, high_m] = whole.bounds_m();
    (0..2).for_each(|d| assert!((low_m[d] + 0.03).abs() < 1e-6 && (high_m[d] - 0.03).abs() < 1e-6));
    let mut told = 0;
    for (at, of) in
        [([0.014, 0.002], &table), ([0.0095, -0.02], &table), ([-0.0299, 0.0299], &whole), ([0.0299, 0.0], &whole)]
    {
        let read = noisy(&volts(&whole, &[spot(at[0], at[1], 1.0)]), 9);
        let mut solver = Solver::new();
        for _ in 0..3 {
            let answer = solver.solve(of, &Frame::of_volts(&read)).unwrap();
            told += answer.contacts().len();
            assert!(answer.contacts().iter().all(|c| of.holds(c.x_m, c.y_m)), "{answer:?}");
            let [low_m, high_m] = of.bounds_m();
            let is_in =
                |c: &crate::Contact| c.x_m >= low_m[0] && c.x_m <= high_m[0] && c.y_m >= low_m[1] && c.y_m <= high_m[1];
            assert!(answer.contacts().iter().all(is_in), "{answer:?}");
        }
    }
    assert!(told >= 4);
}

#[test]
fn work_in_pieces_finds_the_same_and_each_piece_is_small() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let truth = [spot(0.004, -0.011, 0.3), spot(-0.015, 0.008, 1.0), spot(0.019, 0.014, 0.1)];
    let (mut whole, mut pieces) = (Solver::new(), Solver::new());
    for count in [0, 1, 0, 0, 3, 3, 3, 2, 2] {
        let read = noisy(&if count == 0 { std::vec![0.0; 256] } else { volts(&table, &truth[..count]) }, count as u32);
        let frame = Frame::of_volts(&read);
        let expected = whole.solve(&table, &frame).unwrap();
        assert!(!whole.is_busy());
        let (mut calls, mut before, mut number) = (0, 0, 0);
        let found = loop {
            let found = pieces.solve_in_pieces(&table, &frame, 1, &mut || calls += 1).unwrap();
            assert!(calls - before <= 260, "a piece is at most the places for a first contact, or 40 others");
            assert!(found.is_some() || calls > before || number == 0, "each piece does something");
            (before, number) = (calls, number + 1);
            assert_eq!(pieces.is_busy(), found.is_none());
            if let Some(found) = found {
                break found;
            }
        };
        assert_eq!(found, expected);
        assert_eq!(calls, found.work.frames.iter().sum::<u32>() + found.work.first_looks + found.work.looks);
    }
    // A frame that is given up leaves nothing behind.
    let read = noisy(&volts(&table, &truth), 4);
    let mut given_up = Solver::new();
    assert_eq!(given_up.solve_in_pieces(&table, &Frame::of_volts(&read), 5, &mut || ()), Ok(None));
    let short = given_up.solve_in_pieces(&table, &Frame::of_volts(&read[..100]), 5, &mut || ());
    assert!(short.is_err());
    assert_eq!(given_up.solve(&table, &Frame::of_volts(&read)), Solver::new().solve(&table, &Frame::of_volts(&read)));
}

#[test]
fn a_search_ends_on_any_readings_and_says_so() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let mut longest = 0;
    // Any readings, and six contacts.
    for seed in 1..30u32 {
        let mut state = seed;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut read: Vec<_> = (0..256).map(|_| if seed < 4 { 2.0 * random() } else { 0.0 }).collect();
        for _ in 0..if seed < 4 { 0 } else { 6 } {
            let spot = spot(0.05 * random() - 0.025, 0.05 * random() - 0.025, 10f32.powf(3.0 * random() - 2.0));
            volts(&table, &[spot]).iter().zip(&mut read).for_each(|(v, sum)| *sum += v);
        }
        let mut solver = <Solver>::patient();
        let mut pieces = 0;
        let answer = loop {
            pieces += 1;
            if let Some(answer) = solver.solve_in_pieces(&table, &Frame::of_volts(&read), 1, &mut || ()).unwrap() {
                break answer;
            }
        };
        longest = longest.max(pieces);
        assert!(pieces < MOST_PIECES || answer.flags.has(Flags::MISFIT), "{answer:?}");
        // Who waits does not search it again at once.
        let next = solver.solve(&table, &Frame::of_volts(&read)).unwrap();
        assert!(!answer.flags.has(Flags::MISFIT) || next.work.looks == 0, "{next:?}");
    }
    // What was followed before, and the last look.
    assert!((MOST_PIECES..=MOST_PIECES + 50).contains(&longest), "{longest}");
}

#[test]
fn flags_say_what_is_wrong() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let answer = |table: &Table<'_>, read: &[f32]| Solver::new().solve(table, &Frame::of_volts(read)).unwrap();
    // As firm as the driving layer itself.
    let firm = answer(&table, &noisy(&volts(&table, &[spot(0.0, 0.0, 1e4)]), 1));
    assert!(firm.flags.has(Flags::SATURATED) && firm.contacts().len() == 1, "{firm:?}");
    // Five are more than three.
    let mut five = std::vec![0.0; 256];
    for at in [[-0.021, -0.018], [0.02, -0.015], [0.003, 0.002], [-0.017, 0.022], [0.016, 0.02]] {
        volts(&table, &[spot(at[0], at[1], 0.1)]).iter().zip(&mut five).for_each(|(v, sum)| *sum += v);
    }
    let many = answer(&table, &noisy(&five, 2));
    assert!(many.flags.has(Flags::MORE) && many.contacts().len() == 3, "{many:?}");
    // A detector that is not known well, and readings that show it, or do not.
    let unknown = table_of(&grid_m(4, 4), &ALL, |head| head.model_share = 0.05);
    let unknown = Table::read(&unknown).unwrap();
    let sound = noisy(&volts(&table, &[spot(0.0, 0.0, 0.3)]), 1);
    let off: Vec<_> =
        sound.iter().enumerate().map(|(i, v)| v * (1.0 + 0.03 * ((i * 37 % 11) as f32 / 5.0 - 1.0))).collect();
    assert!(answer(&unknown, &off).flags.has(Flags::CALIBRATE));
    assert!(
        !answer(&unknown, &sound).flags.has(Flags::CALIBRATE) && !answer(&table, &sound).flags.has(Flags::CALIBRATE)
    );
}

/// Readings at a floor bound a contact and speak for none: what has lifted is gone in the next frame, though all that is left says "no more than".
#[test]
fn a_contact_that_has_lifted_is_gone_where_all_readings_are_at_a_floor() {
    for (_, bytes) in tables() {
        let table = Table::read(&bytes).unwrap();
        for (at_m, sheets) in [([0.004, -0.007], 0.02), ([-0.011, 0.004], 0.1), ([0.012, 0.006], 1.0)] {
            let pressed = noisy(&volts(&table, &[spot(at_m[0], at_m[1], sheets)]), 3);
            let largest_v = pressed.iter().fold(0.0f32, |most, v| most.max(*v));
            for share in [0.0, 0.3, 0.6] {
                let floor_v = share * largest_v;
                let floored = |read: &[f32]| -> (Vec<f32>, Vec<Says>) {
                    let says = |v: &f32| if *v <= floor_v { Says::AtMost } else { Says::Voltage };
                    (read.iter().map(|v| v.max(floor_v)).collect(), read.iter().map(says).collect())
                };
                let mut solver = Solver::new();
                let mut contacts = |(volts, says): (Vec<f32>, Vec<Says>)| {
                    solver.solve(&table, &Frame::new(&volts, &says)).unwrap().contacts().len()
                };
                let there = [0; 3].map(|_| contacts(floored(&pressed)));
                let lifted =
                    [0; 2].map(|_| contacts(floored(&std::vec![if share > 0.0 { 0.0 } else { 1e-4 }; pressed.len()])));
                assert_eq!((there[2], lifted[1]), (1, 0), "{at_m:?} {sheets} {share}: {there:?} {lifted:?}");
            }
        }
    }
}

/// What a search would add beside a contact is what is missing there, and gains what a fit gains by it.
#[test]
fn one_more_is_looked_for_where_it_is_missing() {
    for (_, bytes) in tables().skip(1) {
        let table = Table::read(&bytes).unwrap();
        let (there, missing) = (spot(0.004, -0.009, 0.5), spot(-0.012, 0.006, 0.02));
        let mut read = volts(&table, &[there, missing]);
        let mut says: Vec<_> = read.iter().map(|_| Says::Voltage).collect();
        // Some readings are not known, and say nothing whatever stands there: one, a grounded electrode's own, most of a row; others are bounds that hold or do not.
        let n = table.electrodes();
        (3 * n + 4..4 * n).chain([n + 5, 2 * n + 2]).for_each(|i| (says[i], read[i]) = (Says::Nothing, 1.7));
        (4 * n..5 * n).for_each(|i| says[i] = Says::AtMost);
        (6 * n..7 * n).for_each(|i| says[i] = Says::AtLeast);
        let frame = Frame::new(&read, &says);
        let errors = Errors::of(&frame, &table);
        let task = Task { table: &table, frame: &frame, errors: &errors, unknown: None };
        // The one that is there is fitted as well as it goes by itself.
        let (mut circuit, mut fitting, mut looks) = (Circuit::EMPTY, Fitting::NONE, <crate::Work>::default());
        fitting.begin(Scene::EMPTY.with(there), ANY_RADIUS, 20);
        let alone = loop {
            let mut work = crate::fit::Working { done: &mut looks, attend: &mut || () };
            if let Went::ToEnd(found) = fitting.go_on(task, &mut Bench { circuit: &mut circuit, room: None }, &mut work)
            {
                break found.unwrap();
            }
        };
        assert!(circuit.solve(&Detector::described(&table), alone.scene.spots()));
        circuit.derive(&table);
        let normal = fitting.normal;
        let (mut done, mut best, mut from, mut pieces) = (<crate::Work>::default(), no_candidates(), Some(0), 0);
        while let Some(at) = from {
            let mut work = crate::fit::Working { done: &mut done, attend: &mut || () };
            from = crate::beside::beside(task, &circuit, &normal, at, &mut best, &mut work);
            pieces += 1;
        }
        assert!(pieces == done.looks.div_ceil(40) && done.looks > 80, "{pieces} {done:?}");
        let found = best[0];
        let off_m = (found.spot.at_m[0] - missing.at_m[0]).hypot(found.spot.at_m[1] - missing.at_m[1]);
        assert!(off_m < 0.007, "{found:?}");
        // By how much that would lower the sum of squares is what the normal equations say of the strength of one that is too light to change anything, with what the one
        // that is there could do as well.
        let light = Spot { ln_ohm: 16.0, ..found.spot };
        let both = summed(&table, &frame, &[alone.scene.spots()[0], light], ANY_RADIUS);
        let pair = |a: usize, b: usize| f64::from(both.matrix[a.max(b)][a.min(b)]);
        let strength = PARAMETERS + 2;
        let damped = |i: usize, j: usize| if i == j { 1.001 * pair(i, i) } else { pair(i, j) };
        let matrix = (0..PARAMETERS).map(|i| (0..PARAMETERS).map(|j| damped(i, j)).collect()).collect();
        let shared: Vec<_> = (0..PARAMETERS).map(|i| pair(i, strength)).collect();
        let as_well: f64 = solved(matrix, shared.clone()).iter().zip(&shared).map(|(a, b)| a * b).sum();
        let expected = f64::from(both.pull[strength]).powi(2) / (pair(strength, strength) - as_well);
        assert!((f64::from(found.gain) / expected - 1.0).abs() < 0.3, "{found:?}, not {expected}");
        assert!(((found.spot.ln_ohm - missing.ln_ohm).abs()) < 0.5, "{found:?}");
    }
}

/// A number is a contact's from landing to lifting, whichever others come and go, and is given once.
#[test]
fn who_stays_keeps_its_number_and_who_comes_gets_a_new_one() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let all = [spot(0.004, -0.011, 0.3), spot(-0.015, 0.008, 1.0), spot(0.019, 0.014, 0.3)];
    let mut solver = Solver::new();
    let mut seen = Vec::new();
    let mut before: Vec<(usize, u32)> = Vec::new();
    for (seed, there) in [&[0, 1][..], &[1], &[1, 2], &[2], &[], &[2, 0], &[0, 1, 2], &[1]].into_iter().enumerate() {
        let spots: Vec<_> = there.iter().map(|k| all[*k]).collect();
        let exact = if spots.is_empty() { std::vec![0.0; 256] } else { volts(&table, &spots) };
        let mut told = Vec::new();
        for again in 0..3 {
            let read = noisy(&exact, (10 * seed + again) as u32);
            let answer = solver.solve(&table, &Frame::of_volts(&read)).unwrap();
            told = answer
                .contacts()
                .iter()
                .map(|c| {
                    let off = |k: &usize| (c.x_m - all[*k].at_m[0]).hypot(c.y_m - all[*k].at_m[1]);
                    ((0..3).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap(), c.id)
                })
                .collect();
        }
        told.sort_unstable();
        let mut expected = there.to_vec();
        expected.sort_unstable();
        assert_eq!(told.iter().map(|(k, _)| *k).collect::<Vec<_>>(), expected);
        for (k, id) in &told {
            match before.iter().find(|(old, _)| old == k) {
                Some((_, old)) => assert_eq!(id, old, "{k} stays"),
                None => assert!(!seen.contains(id) && *id > 0, "{k} is new, {id} was given"),
            }
            seen.push(*id);
        }
        before = told;
    }
}
