//! What holds for any detector: laws of circuits, derivatives, and what does not depend on how electrodes are counted.

use std::vec::Vec;

use crate::circuit::{Circuit, Spot};
use crate::fit::{Fit, Fitting, Scene, Went};
use crate::frame::{Errors, left_v};
use crate::normal::{ANY_RADIUS, MOST, Normal, PARAMETERS, USUAL_RADIUS};
use crate::samples::{CELLS, field_ohm, fields_ohm, grid_m, table, table_of};
use crate::scan::{Candidate, NO_CANDIDATES, first};
use crate::search::{Search, Wants};
use crate::solver::Task;
use crate::tests::{noisy, spot, volts};
use crate::{Flags, Frame, MOST_PIECES, Says, Solver, Table};

const ALL: [u8; (CELLS * CELLS).div_ceil(8)] = [255; (CELLS * CELLS).div_ceil(8)];
/// Columns and rows of 8, 16 and 32 electrodes.
const GRIDS: [[usize; 2]; 3] = [[4, 2], [4, 4], [8, 4]];

fn tables() -> impl Iterator<Item = (Vec<[f32; 2]>, Vec<u8>)> {
    GRIDS.into_iter().map(|[columns, rows]| {
        let pads_m = grid_m(columns, rows);
        let bytes = table_of(&pads_m, &ALL, |_| ());
        (pads_m, bytes)
    })
}

/// Solves linear equations by elimination with pivots.
fn solved(mut matrix: Vec<Vec<f64>>, mut right: Vec<f64>) -> Vec<f64> {
    let n = right.len();
    for i in 0..n {
        let pivot = (i..n).max_by(|a, b| matrix[*a][i].abs().total_cmp(&matrix[*b][i].abs())).unwrap();
        matrix.swap(i, pivot);
        right.swap(i, pivot);
        for j in i + 1..n {
            let share = matrix[j][i] / matrix[i][i];
            (i..n).for_each(|k| matrix[j][k] -= share * matrix[i][k]);
            right[j] -= share * right[i];
        }
    }
    for i in (0..n).rev() {
        let sum: f64 = (i + 1..n).map(|k| matrix[i][k] * right[k]).sum();
        right[i] = (right[i] - sum) / matrix[i][i];
    }
    right
}

/// Fields of the electrodes at a place with one more that is the same everywhere, and the field between two places, in `f64`, as the table has them.
fn with_one(table: &Table<'_>, at_m: [f32; 2], wide: f32) -> Vec<f64> {
    let mut sample = crate::fields::Sample::NONE;
    table.sample(at_m, wide, &mut sample);
    (0..table.electrodes()).map(|e| f64::from(sample.value[e])).chain([1.0]).collect()
}

fn between_ohm(table: &Table<'_>, fields: [&[f64]; 2], way_m: f32) -> f64 {
    let n = table.electrodes();
    let pairs = (0..=n).flat_map(|s| (0..=n).map(move |t| (s, t)));
    let by_walls: f64 = pairs.map(|(s, t)| fields[0][s] * f64::from(table.walls.of_pair(s, t)) * fields[1][t]).sum();
    f64::from(table.by_distance_ohm(way_m).0) + by_walls
}

/// Readings by Kirchhoff's laws: contacts and couples of currents are nodes, all equations are solved at once.
fn dense_v(table: &Table<'_>, circuit: &Circuit) -> Vec<f64> {
    let (n, count, head) = (table.electrodes(), circuit.count, table.head());
    let loaded = &circuit.loaded[..count];
    let wides: Vec<f32> = loaded
        .iter()
        .map(|one| {
            let spread_m = head.radius_m * one.spot.ln_radius.exp();
            let [small, wide] = head.radii_m;
            (spread_m * spread_m - small * small) / (wide * wide - small * small)
        })
        .collect();
    let way = |a: [f32; 2], b: [f32; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let at = |k: usize, place_m: [f32; 2]| with_one(table, place_m, wides[k]);
    let own = |k: usize| at(k, loaded[k].spot.at_m);
    // Contact currents and the potential of the layer, for 1 A into an electrode.
    let currents_of = |e: usize| {
        let mut matrix = std::vec![std::vec![0.0; count + 1]; count + 1];
        let mut right = std::vec![1.0; count + 1];
        for k in 0..count {
            right[k] = own(k)[e];
            (matrix[k][count], matrix[count][k]) = (1.0, 1.0);
            matrix[k][k] = f64::from(loaded[k].ohm);
            for l in (0..count).filter(|l| *l != k) {
                matrix[k][l] = between_ohm(table, [&own(k), &own(l)], way(loaded[k].spot.at_m, loaded[l].spot.at_m));
            }
        }
        solved(matrix, right)
    };
    let all: Vec<_> = (0..n).map(currents_of).collect();
    // What drives the couples: differences of the potential that the electrode and the other contacts make, less half that of the contact's own field.
    let driving = |k: usize, d: usize, e: usize| {
        let step_m = 1e-4;
        let moved = |way_m: f32| {
            let mut place_m = loaded[k].spot.at_m;
            place_m[d] += way_m;
            let here = at(k, place_m);
            let others = (0..count).filter(|l| *l != k);
            let by_others: f64 = others
                .map(|l| all[e][l] * between_ohm(table, [&here, &own(l)], way(place_m, loaded[l].spot.at_m)))
                .sum();
            let mut sample = crate::fields::Sample::NONE;
            table.sample(place_m, wides[k], &mut sample);
            here[e] - by_others - 0.5 * all[e][k] * f64::from(sample.value[n])
        };
        (moved(step_m) - moved(-step_m)) / (2.0 * f64::from(step_m))
    };
    let drives: Vec<Vec<[f64; 2]>> =
        (0..count).map(|k| (0..n).map(|e| [driving(k, 0, e), driving(k, 1, e)]).collect()).collect();
    let z = |e: usize, g: usize| {
        let mut ohm = f64::from(table.pads_ohm(e, g)) - all[g][count];
        for k in 0..count {
            let [[a, b], [c, d]] = [drives[k][e], drives[k][g]];
            ohm -= own(k)[e] * all[g][k] + f64::from(loaded[k].moment_s_m2) * (a * c + b * d);
        }
        ohm
    };
    let (drive_v, on_ohm) = (f64::from(head.drive_v), f64::from(head.on_resistance_ohm));
    (0..n)
        .flat_map(|g| (0..n).map(move |e| (g, e)))
        .map(|(g, e)| drive_v * (1.0 - z(e, g) / (z(g, g) + on_ohm)))
        .collect()
}

#[test]
fn readings_are_those_of_all_equations_solved_at_once() {
    for (_, bytes) in tables() {
        let table = Table::read(&bytes).unwrap();
        let wide = Spot { ln_radius: 0.5, ..spot(-0.012, 0.008, 1.0) };
        for spots in [
            &[spot(0.004, -0.011, 0.02)][..],
            &[spot(0.002, 0.003, 100.0), wide],
            &[wide, spot(0.013, 0.01, 8.0), spot(0.001, -0.009, 0.3)],
        ] {
            let mut circuit = Circuit::EMPTY;
            assert!(circuit.solve(&table, spots));
            let (found, expected) = (volts(&table, spots), dense_v(&table, &circuit));
            let largest_v = expected.iter().fold(0.0f64, |most, v| most.max(v.abs()));
            let off_v = found.iter().zip(&expected).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
            assert!(off_v < 2e-4 * largest_v, "{} electrodes, {spots:?}: {off_v} of {largest_v}", table.electrodes());
            let n = table.electrodes();
            // An electrode that is grounded has what its switch lets stand.
            (0..n).for_each(|g| assert!(found[g * n + g] > 0.0 && found[g * n + g] < 0.01 * table.head().drive_v));
        }
    }
}

/// A perfect disc on a thick layer and on a thin one, and a light one, drive the moments that the module's page says.
#[test]
fn moments_are_those_of_discs_that_are_known() {
    let of = |sheets: f32, ln_radius: f32, top_s_per_m: f32| {
        let bytes = table_of(&grid_m(4, 4), &ALL, |head| head.top_s_per_m = top_s_per_m);
        let table = Table::read(&bytes).unwrap();
        let mut circuit = Circuit::EMPTY;
        assert!(circuit.solve(
            &table,
            &[Spot {
                ln_radius,
                ln_ohm: if sheets > 1e3 { 0.0 } else { spot(0.0, 0.0, sheets).ln_ohm },
                ..spot(0.0, 0.0, 1.0)
            }]
        ));
        let one = &circuit.loaded[0];
        (one.moment_s_m2, one.radius_m, one.conductance_s())
    };
    let (light, radius_m, conductance_s) = of(1e-3, 0.0, 0.23);
    assert!((light / (conductance_s * radius_m * radius_m / 4.0) - 1.0).abs() < 0.01, "{light} {conductance_s}");
    assert!((radius_m / 0.0025 - 1.0).abs() < 0.01);
    // As firm as may be, where current spreads deep below, or in a sheet.
    let (deep, radius_m, _) = of(1e5, 0.0, 0.01);
    assert!((deep / (8.0 / 3.0 * 0.01 * radius_m.powi(3)) - 1.0).abs() < 0.05, "{deep} {radius_m}");
    assert!(radius_m < 0.0025 / 1.1 && radius_m > 0.0025 / 1.2, "{radius_m}");
    let (thin, radius_m, _) = of(1e5, 0.0, 1e4);
    assert!((thin / (core::f32::consts::TAU * radius_m.powi(2) * 1.1e-3) - 1.0).abs() < 0.1, "{thin}");
}

#[test]
fn fields_are_those_of_the_sheet_and_their_derivatives_their_differences() {
    for (pads_m, bytes) in tables() {
        let table = Table::read(&bytes).unwrap();
        let mut sample = crate::fields::Sample::NONE;
        for at_m in [[0.0034, -0.0088], [-0.0081, 0.0083], [0.0007, 0.0005]] {
            let value = |at_m: [f32; 2], wide: f32| {
                let mut sample = crate::fields::Sample::NONE;
                table.sample(at_m, wide, &mut sample);
                sample
            };
            table.sample(at_m, 0.3, &mut sample);
            let exact = fields_ohm(&pads_m, at_m);
            for e in 0..pads_m.len() {
                assert!(
                    (sample.value[e] - 0.97 * exact[e]).abs() < 4.0 + 0.25 * exact[e].abs(),
                    "{e} {} {}",
                    sample.value[e],
                    exact[e]
                );
                let wider = value(at_m, 1.0).value[e] - value(at_m, 0.0).value[e];
                assert!(
                    (sample.wider[e] - wider).abs() < 0.01
                        && (wider + 0.1 * exact[e]).abs() < 1.0 + 0.02 * exact[e].abs()
                );
            }
            for e in 0..pads_m.len() + 2 {
                let moved = |d: usize, way: f32, wide: f32| {
                    let mut place_m = at_m;
                    place_m[d] += way;
                    value(place_m, wide)
                };
                let step_m = 1e-4;
                let near = |found: f32, expected: f32, scale: f32, what: &str| {
                    assert!((found - expected).abs() < 0.02 * scale, "{what} of {e}: {found} {expected}");
                };
                for d in 0..2 {
                    let [up, down] = [step_m, -step_m].map(|way| moved(d, way, 0.3));
                    let per = 0.5 / step_m;
                    near(sample.slope[d][e], per * (up.value[e] - down.value[e]), 1e4, "slope");
                    near(sample.turning[3 + d][e], per * (up.wider[e] - down.wider[e]), 1e3, "slope of wider");
                    near(sample.turning[d][e], per * (up.slope[0][e] - down.slope[0][e]), 1e6, "bend");
                    near(sample.turning[1 + d][e], per * (up.slope[1][e] - down.slope[1][e]), 1e6, "bend");
                }
            }
        }
        // Between places by distance.
        let between = |at_m: [f32; 2]| table.by_distance_ohm(at_m[0].hypot(at_m[1])).0;
        let apart = |at_m: [f32; 2]| field_ohm([0.0; 2], at_m);
        let [far, near] = [[0.03, 0.01], [0.006, 0.002]];
        assert!(((between(far) - between(near)) / (apart(far) - apart(near)) - 1.0).abs() < 0.2);
        let per_m = (table.by_distance_ohm(0.0101).0 - table.by_distance_ohm(0.0099).0) / 2e-4;
        assert!((table.by_distance_ohm(0.01).1 / per_m - 1.0).abs() < 0.01);
    }
}

fn summed(table: &Table<'_>, frame: &Frame<'_>, spots: &[Spot], deviation: f32) -> Normal {
    let (mut circuit, mut normal) = (Circuit::EMPTY, Normal::EMPTY);
    assert!(circuit.solve(table, spots));
    normal.sum_up(table, &circuit, frame, &Errors::of(frame, table), deviation);
    normal
}

/// Of one contact they are exact: light and firm, in the middle and at a wall, narrow and wide.
#[test]
fn slopes_of_one_contact_are_differences() {
    for (_, bytes) in tables() {
        let table = Table::read(&bytes).unwrap();
        for (at_m, sheets, ln_radius) in
            [([0.001, 0.002], 0.05, 0.3), ([-0.0255, 0.009], 3.0, 0.2), ([0.012, -0.006], 50.0, -0.3)]
        {
            let begun = Spot { ln_radius, ..spot(at_m[0], at_m[1], sheets) };
            let truth = Spot {
                at_m: [at_m[0] + 0.001, at_m[1] - 0.0007],
                ln_ohm: begun.ln_ohm + 0.05,
                ln_radius: ln_radius + 0.1,
            };
            let volts = volts(&table, &[truth]);
            let frame = Frame::of_volts(&volts);
            let normal = summed(&table, &frame, &[begun], ANY_RADIUS);
            for parameter in 0..PARAMETERS {
                let moved = |way: f32| {
                    let mut spot = begun;
                    match parameter {
                        2 => spot.ln_ohm += way,
                        3 => spot.ln_radius += way,
                        axis => spot.at_m[axis] += table.head().radius_m * way,
                    }
                    summed(&table, &frame, &[spot], ANY_RADIUS).objective()
                };
                let slope = -0.5 * (moved(0.01) - moved(-0.01)) / 0.02;
                let unit = normal.matrix[parameter][parameter].sqrt() * normal.cost.sqrt();
                let off = (slope - normal.pull[parameter]).abs() / unit;
                assert!(off < 4e-3, "{at_m:?} {sheets} {parameter}: {slope} {} of {unit}", normal.pull[parameter]);
            }
        }
    }
}

/// `J' W J` is how the sum of squares bends where the readings fit, with an error of the grounded pad and radii that are known before.
#[test]
fn the_normal_matrix_is_how_the_sum_of_squares_bends() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let truth = [spot(0.004, -0.011, 0.3), spot(-0.015, 0.008, 2.0)];
    let volts = volts(&table, &truth);
    let frame = Frame::of_volts(&volts);
    for deviation in [ANY_RADIUS, USUAL_RADIUS] {
        let normal = summed(&table, &frame, &truth, deviation);
        for i in 0..2 * PARAMETERS {
            let at = |way: f32| {
                let mut spots = truth;
                let spot = &mut spots[i / PARAMETERS];
                match i % PARAMETERS {
                    2 => spot.ln_ohm += way,
                    3 => spot.ln_radius += way,
                    axis => spot.at_m[axis] += table.head().radius_m * way,
                }
                summed(&table, &frame, &spots, deviation).objective()
            };
            let bend = 0.5 * (at(0.02) + at(-0.02)) / (0.02 * 0.02);
            assert!((bend / normal.matrix[i][i] - 1.0).abs() < 0.06, "{i}: {bend} {}", normal.matrix[i][i]);
        }
        let covariance = normal.covariance().unwrap();
        // Times the matrix it is one.
        for i in 0..normal.count {
            for j in 0..normal.count {
                let pair = |a: usize, b: usize| normal.matrix[a.max(b)][a.min(b)];
                let scale = (normal.matrix[j][j] / normal.matrix[i][i]).sqrt();
                let sum: f32 = (0..MOST).take(normal.count).map(|k| covariance[i][k] * pair(k, j)).sum();
                assert!((sum - f32::from(u8::from(i == j))).abs() < 0.02 * scale.max(1.0), "{i} {j} {sum}");
            }
        }
    }
}

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
                let (mut done, mut calls) = (crate::Work::default(), 0);
                let mut attend = || calls += 1;
                let mut work = crate::fit::Working { done: &mut done, attend: &mut attend };
                let found = first(Task { table: &table, frame: &frame, errors: &errors }, &mut work)[0];
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
fn what_a_reading_says_bounds_a_model() {
    let volts = [0.5; 4];
    let says = [Says::Voltage, Says::AtMost, Says::AtLeast, Says::Nothing];
    let frame = Frame::new(&volts, &says);
    let left = |predicted_v| [0, 1, 2, 3].map(|i| left_v(&frame, i, 1.9, predicted_v));
    assert_eq!(left(0.25), [Some(0.25), None, Some(0.25), None]);
    assert_eq!(left(0.75), [Some(-0.25), Some(-0.25), None, None]);
    // At the end of the converter's range it says nothing.
    assert_eq!(left_v(&frame, 0, 0.5, 0.25), None);
}

#[test]
fn channels_are_corrected_by_gain_and_offset_but_for_what_rest_hides() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    // Electrode 7: 7 % too much, and 5 mV. Electrode 0: 2 mV too little, of which a reading of 1 mV shows 1.
    assert!((table.corrected_v(7, 0.5) - 0.495 / 1.07).abs() < 1e-6);
    assert!((table.corrected_v(0, 0.5) - 0.502).abs() < 1e-6);
    assert!((table.corrected_v(0, 0.001) - 0.002).abs() < 1e-6);
    assert!((table.corrected_v(0, -0.001) + 0.001).abs() < 1e-6);
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
        let mut solver = Solver::new();
        let mut pieces = 0;
        let answer = loop {
            pieces += 1;
            if let Some(answer) = solver.solve_in_pieces(&table, &Frame::of_volts(&read), 1, &mut || ()).unwrap() {
                break answer;
            }
        };
        longest = longest.max(pieces);
        assert!(pieces < MOST_PIECES || answer.flags.has(Flags::MISFIT), "{answer:?}");
        // It is not searched again at once.
        let next = solver.solve(&table, &Frame::of_volts(&read)).unwrap();
        assert!(!answer.flags.has(Flags::MISFIT) || next.work.looks == 0, "{next:?}");
    }
    // What was followed before, and the last look.
    assert!((MOST_PIECES..=MOST_PIECES + 30).contains(&longest), "{longest}");
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

/// A fit of so many contacts that leaves so much, and says so much for each.
fn fit(contacts: usize, cost: f32, information: f32) -> Fit {
    let scene = (0..contacts).fold(Scene::EMPTY, |scene, k| scene.with(spot(0.01 * k as f32, 0.0, 1.0)));
    Fit { scene, cost, objective: cost, information: [information; 3], ..Fit::NONE }
}

fn starts(gains: &[f32]) -> crate::scan::Candidates {
    let mut all = NO_CANDIDATES;
    all.iter_mut().zip(gains).for_each(|(one, gain)| *one = Candidate { spot: spot(0.02, 0.01, 1.0), gain: *gain });
    all
}

/// Runs a search on made-up fits, by how many contacts they have; what it asked to be fitted, and what it found.
fn run(
    search: &mut Search,
    mut wants: Wants,
    mut of: impl FnMut(&Scene, f32) -> Option<Fit>,
    mut gain: impl FnMut(&Scene) -> f32,
) -> (Vec<(usize, f32)>, Option<Fit>) {
    let mut asked = Vec::new();
    for _ in 0..200 {
        wants = match wants {
            Wants::Fit(scene, deviation, _) => {
                asked.push((scene.count, deviation));
                let found = of(&scene, deviation);
                search.fitted(found, 240.0)
            }
            Wants::First => {
                search.starts = starts(&[gain(&Scene::EMPTY)]);
                search.placed(240.0)
            }
            Wants::Beside(scene, _) => {
                search.starts = starts(&[gain(&scene)]);
                search.placed(240.0)
            }
            Wants::Nothing(found) => return (asked, found),
        };
    }
    panic!("a search without end: {asked:?}");
}

#[test]
fn a_search_grows_exchanges_and_reduces() {
    // Nothing there.
    let mut search = Search::NONE;
    let wants = search.begin(None, Some(starts(&[59.0])), 240.0);
    assert!(matches!(wants, Wants::Nothing(None)));
    // Two contacts, each worth it: tried with usual radii, then fitted with any.
    let costs = [0.0, 5000.0, 240.0, 239.0];
    let by_count =
        |scene: &Scene, _| Some(fit(scene.count, costs[scene.count], 2000.0)).filter(|fit| fit.scene.count > 0);
    let gains = |scene: &Scene| if scene.count < 2 { 4000.0 } else { 10.0 };
    let wants = search.begin(None, None, 240.0);
    let (asked, found) = run(&mut search, wants, by_count, gains);
    assert_eq!(found.unwrap().scene.count, 2);
    let [usual, any] = [USUAL_RADIUS, ANY_RADIUS];
    assert_eq!(asked, [(1, usual), (1, usual), (1, any), (2, usual), (2, usual), (2, any)]);
    assert!(!search.more);
    // What was followed and fits is taken on; what left room for more is not.
    let wants = search.begin(Some(fit(2, 400.0, 2000.0)), None, 240.0);
    let (asked, _) = run(&mut search, wants, by_count, gains);
    assert_eq!(asked, [(2, any)]);
    search.more = true;
    let wants = search.begin(Some(fit(2, 400.0, 2000.0)), None, 240.0);
    assert!(run(&mut search, wants, by_count, gains).0.len() > 1);
    // Contacts that leave too much: each is looked for anew, beside the one that stays.
    let bad = |scene: &Scene, _| {
        Some(fit(scene.count, 9000.0 / (scene.count as f32 + 1.0), 2000.0)).filter(|fit| fit.scene.count > 0)
    };
    let mut search = Search::NONE;
    let wants = search.begin(None, None, 240.0);
    let (asked, found) = run(&mut search, wants, bad, gains);
    assert_eq!(found.unwrap().scene.count, 2);
    let anew = asked.windows(2).filter(|two| two[0] == (2, any) && two[1] == (1, usual)).count();
    assert_eq!(anew, 2, "{asked:?}");
    // One of which little is known is left out where the other does as well.
    let alike = |scene: &Scene, _| {
        Some(fit(scene.count, if scene.count == 1 { 241.0 } else { 230.0 }, 500.0)).filter(|fit| fit.scene.count > 0)
    };
    let mut search = Search::NONE;
    let wants = search.begin(Some(fit(2, 230.0, 500.0)), None, 240.0);
    let (asked, found) = run(&mut search, wants, alike, |_| 0.0);
    assert_eq!((found.unwrap().scene.count, &asked[1..]), (1, &[(1, any), (1, any)][..]));
    // One that readings do not speak for goes, and with the last of them all.
    let wants = search.begin(Some(fit(1, 230.0, 20.0)), None, 240.0);
    assert!(
        run(
            &mut search,
            wants,
            |scene, _| Some(fit(scene.count, 230.0, 20.0)).filter(|fit| fit.scene.count > 0),
            |_| 0.0
        )
        .1
        .is_none()
    );
    // Where one more beside three would explain much, that is said.
    let mut search = Search::NONE;
    let wants = search.begin(None, None, 240.0);
    let (_, found) = run(
        &mut search,
        wants,
        |scene, _| Some(fit(scene.count, 900.0 / scene.count.max(1) as f32, 2000.0)).filter(|fit| fit.scene.count > 0),
        |_| 500.0,
    );
    assert!(search.more && found.unwrap().scene.count == 3);
}

/// What a search would add beside a contact is what is missing there, and gains what a fit gains by it.
#[test]
fn one_more_is_looked_for_where_it_is_missing() {
    for (_, bytes) in tables().skip(1) {
        let table = Table::read(&bytes).unwrap();
        let (there, missing) = (spot(0.004, -0.009, 0.5), spot(-0.012, 0.006, 0.02));
        let mut read = volts(&table, &[there, missing]);
        let mut says: Vec<_> = read.iter().map(|_| Says::Voltage).collect();
        // One reading is not known, and says nothing whatever stands there.
        (says[21], read[21]) = (Says::Nothing, 1.7);
        let frame = Frame::new(&read, &says);
        let errors = Errors::of(&frame, &table);
        let task = Task { table: &table, frame: &frame, errors: &errors };
        // The one that is there is fitted as well as it goes by itself.
        let (mut circuit, mut fitting, mut looks) = (Circuit::EMPTY, Fitting::NONE, crate::Work::default());
        fitting.begin(Scene::EMPTY.with(there), ANY_RADIUS, 20);
        let alone = loop {
            let mut work = crate::fit::Working { done: &mut looks, attend: &mut || () };
            if let Went::ToEnd(found) = fitting.go_on(task, &mut circuit, &mut work) {
                break found.unwrap();
            }
        };
        assert!(circuit.solve(&table, alone.scene.spots()));
        let normal = fitting.normal;
        let (mut done, mut best, mut from, mut pieces) = (crate::Work::default(), NO_CANDIDATES, Some(0), 0);
        while let Some(at) = from {
            let mut work = crate::fit::Working { done: &mut done, attend: &mut || () };
            from = crate::beside::beside(task, &circuit, &normal, at, &mut best, &mut work);
            pieces += 1;
        }
        assert!(pieces == done.looks.div_ceil(40) && done.looks > 80, "{pieces} {done:?}");
        let found = best[0];
        let off_m = (found.spot.at_m[0] - missing.at_m[0]).hypot(found.spot.at_m[1] - missing.at_m[1]);
        assert!(off_m < 0.007, "{found:?}");
        let with = summed(&table, &frame, &[there, missing], ANY_RADIUS).objective();
        let without = normal.objective();
        assert!(
            found.gain > 0.4 * (without - with) && found.gain < 1.1 * (without - with),
            "{} {with} {without}",
            found.gain
        );
        assert!(((found.spot.ln_ohm - missing.ln_ohm).abs()) < 0.5, "{found:?}");
    }
}
