//! What holds for any detector: laws of circuits, fields and derivatives, and what a reading says.

use std::vec::Vec;

use crate::detector::Detector;
use crate::frame::{Errors, left_v};
use crate::loaded::BENT;
use crate::normal::{ANY_RADIUS, USUAL_RADIUS};
use crate::samples::{CELLS, field_ohm, fields_ohm, grid_m, table, table_of};
use crate::tests::{Circuit, Normal, Spot, spot, volts};
use crate::vector::{PARAMETERS, Vector};
use crate::{Frame, Says, Table};

pub(crate) const ALL: [u8; (CELLS * CELLS).div_ceil(8)] = [255; (CELLS * CELLS).div_ceil(8)];
/// Columns and rows of 8, 16 and 32 electrodes.
const GRIDS: [[usize; 2]; 3] = [[4, 2], [4, 4], [8, 4]];

pub(crate) fn tables() -> impl Iterator<Item = (Vec<[f32; 2]>, Vec<u8>)> {
    GRIDS.into_iter().map(|[columns, rows]| {
        let pads_m = grid_m(columns, rows);
        let bytes = table_of(&pads_m, &ALL, |_| ());
        (pads_m, bytes)
    })
}

/// Solves linear equations by elimination with pivots.
pub(crate) fn solved(mut matrix: Vec<Vec<f64>>, mut right: Vec<f64>) -> Vec<f64> {
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
    let mut sample = crate::fields::Sample::<f64>::NONE;
    table.sample(at_m.map(f64::from), wide.into(), wide.into(), &mut sample);
    sample.value[..table.electrodes()].iter().copied().chain([1.0]).collect()
}

/// The own field of a disc there.
fn own_ohm(table: &Table<'_>, at_m: [f32; 2], wide: f32) -> f64 {
    let mut sample = crate::fields::Sample::<f64>::NONE;
    table.sample(at_m.map(f64::from), wide.into(), wide.into(), &mut sample);
    sample.value[table.electrodes()]
}

fn between_ohm(table: &Table<'_>, fields: [&[f64]; 2], [to_m, from_m]: [[f32; 2]; 2]) -> f64 {
    let n = table.electrodes();
    let pairs = (0..=n).flat_map(|s| (0..=n).map(move |t| (s, t)));
    let by_walls: f64 = pairs.map(|(s, t)| fields[0][s] * f64::from(table.walls.of_pair(s, t)) * fields[1][t]).sum();
    f64::from(Detector::described(table).by_ways_ohm(to_m, from_m).0) + by_walls
}

/// Readings by Kirchhoff's laws: contacts and couples of currents are nodes, all equations are solved at once.
fn dense_v(table: &Table<'_>, circuit: &Circuit) -> Vec<f64> {
    let (n, count, head) = (table.electrodes(), circuit.count, table.head());
    let loaded = &circuit.loaded[..count];
    // Of a disc whose radius' square is so much of that of the contact's spread.
    let wide = |k: usize, share: f32| {
        let spread_m = head.radius_m * loaded[k].spot.ln_radius.exp();
        let [small, wide] = head.radii_m;
        (share * spread_m * spread_m - small * small) / (wide * wide - small * small)
    };
    let at = |k: usize, place_m: [f32; 2]| with_one(table, place_m, wide(k, 1.0));
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
                matrix[k][l] = between_ohm(table, [&own(k), &own(l)], [loaded[k].spot.at_m, loaded[l].spot.at_m]);
            }
        }
        solved(matrix, right)
    };
    let all: Vec<_> = (0..n).map(currents_of).collect();
    // The potential near a contact that an electrode and, over another disc, the other contacts make, less so much of that of the contact's own field.
    let near = |k: usize, e: usize, [x_m, y_m]: [f32; 2], [share, of_others]: [f32; 2], own_share: f64| {
        let place_m = [loaded[k].spot.at_m[0] + x_m, loaded[k].spot.at_m[1] + y_m];
        let here = with_one(table, place_m, wide(k, of_others));
        let others = (0..count).filter(|l| *l != k);
        let by_others: f64 =
            others.map(|l| all[e][l] * between_ohm(table, [&here, &own(l)], [place_m, loaded[l].spot.at_m])).sum();
        let by_own = own_share * all[e][k] * own_ohm(table, place_m, wide(k, of_others));
        with_one(table, place_m, wide(k, share))[e] - by_others - by_own
    };
    // What drives the couples: its slopes; and the quadrupoles: its bends, half of that along x less that along y, and that along both.
    let driving = |k: usize, e: usize| {
        let [step_m, way_m] = [1e-4f32, 1e-3];
        let slope = |x: f32, y: f32| {
            let at =
                |sign: f32| near(k, e, [sign * step_m * x, sign * step_m * y], [loaded[k].driving_share, 1.0], 0.5);
            (at(1.0) - at(-1.0)) / (2.0 * f64::from(step_m))
        };
        let at = |x: f32, y: f32| near(k, e, [way_m * x, way_m * y], [BENT; 2], 0.25);
        let per_m2 = 1.0 / f64::from(way_m * way_m);
        let even = 0.5 * per_m2 * (at(1.0, 0.0) + at(-1.0, 0.0) - at(0.0, 1.0) - at(0.0, -1.0));
        let both = 0.25 * per_m2 * (at(1.0, 1.0) + at(-1.0, -1.0) - at(1.0, -1.0) - at(-1.0, 1.0));
        [slope(1.0, 0.0), slope(0.0, 1.0), even, both]
    };
    let drives: Vec<Vec<[f64; 4]>> = (0..count).map(|k| (0..n).map(|e| driving(k, e)).collect()).collect();
    let z = |e: usize, g: usize| {
        let mut ohm = f64::from(table.pads_ohm(e, g)) - all[g][count];
        for k in 0..count {
            let one = &loaded[k];
            let moments = [one.moment_s_m2, one.moment_s_m2, one.quadrupole_s_m4, one.quadrupole_s_m4].map(f64::from);
            let driven =
                moments.iter().zip(drives[k][e].iter().zip(drives[k][g])).map(|(moment, (a, b))| moment * a * b);
            ohm -= own(k)[e] * all[g][k] + driven.sum::<f64>();
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
            &[Spot { ln_radius: 1.0, ..spot(0.006, 0.005, 100.0) }, spot(-0.004, 0.001, 3.0)],
        ] {
            let mut circuit = Circuit::EMPTY;
            assert!(circuit.solve(&Detector::described(&table), spots));
            let (found, expected) = (volts(&table, spots), dense_v(&table, &circuit));
            let largest_v = expected.iter().fold(0.0f64, |most, v| most.max(v.abs()));
            let off_v = found.iter().zip(&expected).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
            assert!(off_v < 5.5e-5 * largest_v, "{} electrodes, {spots:?}: {off_v} of {largest_v}", table.electrodes());
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
            &Detector::described(&table),
            &[Spot {
                ln_radius,
                ln_ohm: if sheets > 1e3 { 0.0 } else { spot(0.0, 0.0, sheets).ln_ohm },
                ..spot(0.0, 0.0, 1.0)
            }]
        ));
        let one = &circuit.loaded[0];
        ([one.moment_s_m2, one.quadrupole_s_m4], one.radius_m, one.conductance_s())
    };
    let ([couple, quadrupole], radius_m, conductance_s) = of(1e-3, 0.0, 0.23);
    assert!((couple / (conductance_s * radius_m.powi(2) / 4.0) - 1.0).abs() < 0.01, "{couple} {conductance_s}");
    assert!((quadrupole / (conductance_s * radius_m.powi(4) / 24.0) - 1.0).abs() < 0.01, "{quadrupole}");
    assert!((radius_m / 0.0025 - 1.0).abs() < 0.01);
    // As firm as may be, where current spreads deep below, or in a sheet.
    let ([couple, quadrupole], radius_m, _) = of(1e5, 0.0, 0.01);
    assert!((couple / (8.0 / 3.0 * 0.01 * radius_m.powi(3)) - 1.0).abs() < 0.05, "{couple} {radius_m}");
    assert!((quadrupole / (32.0 / 45.0 * 0.01 * radius_m.powi(5)) - 1.0).abs() < 0.1, "{quadrupole} {radius_m}");
    assert!(radius_m < 0.0025 / 1.1 && radius_m > 0.0025 / 1.2, "{radius_m}");
    let ([couple, quadrupole], radius_m, _) = of(1e5, 0.0, 1e4);
    assert!((couple / (core::f32::consts::TAU * radius_m.powi(2) * 1.1e-3) - 1.0).abs() < 0.1, "{couple}");
    assert!((quadrupole / (core::f32::consts::PI * radius_m.powi(4) * 1.1e-3) - 1.0).abs() < 0.3, "{quadrupole}");
}

/// What is derived of a contact by its parameters, where its own field and its share of the detector change too, is what it differs by for a step of them.
#[test]
fn moments_and_conductances_change_with_the_parameters_as_their_derivatives_say() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let loaded = |spot: Spot| {
        let mut circuit = Circuit::EMPTY;
        assert!(circuit.solve(&Detector::described(&table), &[spot]));
        circuit.derive(&table);
        circuit.loaded[0].clone()
    };
    for (at_m, sheets, ln_radius) in
        [([0.004, -0.011], 0.3, 0.1), ([-0.0255, 0.009], 2.0, 0.3), ([0.012, 0.006], 20.0, -0.2)]
    {
        let begun = Spot { ln_radius, ..spot(at_m[0], at_m[1], sheets) };
        let one = loaded(begun);
        let scale = one.half_moment_by.iter().fold(0.0f32, |most, half| most.max(half.abs()));
        let moved = |parameter: usize, way: f32| {
            let mut spot = begun;
            match parameter {
                2 => spot.ln_ohm += way,
                3 => spot.ln_radius += way,
                axis => spot.at_m[axis] += table.head().radius_m * way,
            }
            loaded(spot)
        };
        for parameter in 0..PARAMETERS {
            let [up, down] = [0.02, -0.02].map(|way| moved(parameter, way));
            let half = 0.5 * (up.moment_s_m2 - down.moment_s_m2) / 0.04;
            let off = (half - one.half_moment_by[parameter]).abs();
            assert!(off < 0.03 * half.abs() + 0.003 * scale, "{at_m:?} {parameter}: {half} {:?}", one.half_moment_by);
            // Of a light contact, whose crowding hardly changes: alone, and going together with its resistance.
            let change = |parameter: usize| {
                let [up, down] = [0.02, -0.02].map(|way| moved(parameter, way).conductance_s());
                (up / down).ln() / 0.04
            };
            let with = |error: [f32; PARAMETERS]| {
                one.conductance_variance(&table, table.head().radius_m, |i, j| error[i] * error[j])
            };
            let own = with([0.0; PARAMETERS]);
            assert!(own > 0.0);
            for with_ohm in if sheets < 1.0 { &[0.0, 1.0][..] } else { &[] } {
                let mut error = [0.0; PARAMETERS];
                (error[2], error[parameter]) = (*with_ohm, error[parameter] + 1.0);
                let expected =
                    error[parameter] * change(parameter) + if parameter == 2 { 0.0 } else { with_ohm * change(2) };
                let found = (with(error) - own).sqrt();
                assert!(
                    (found - expected.abs()).abs() < 0.05 * expected.abs() + 0.01,
                    "{parameter} {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn fields_are_those_of_the_sheet_and_their_derivatives_their_differences() {
    for (pads_m, bytes) in tables() {
        let table = Table::read(&bytes).unwrap();
        let mut sample = crate::fields::Sample::NONE;
        for at_m in [[0.0034, -0.0088], [-0.0081, 0.0083], [0.0007, 0.0005]] {
            let value = |at_m: [f32; 2], wide: f32| {
                let mut sample = crate::fields::Sample::NONE;
                table.sample(at_m, wide, wide, &mut sample);
                sample
            };
            table.sample(at_m, 0.3, 0.3, &mut sample);
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
        let between = |at_m: [f32; 2]| Detector::described(&table).by_distance_ohm(at_m[0].hypot(at_m[1])).0;
        let apart = |at_m: [f32; 2]| field_ohm([0.0; 2], at_m);
        let [far, near] = [[0.03, 0.01], [0.006, 0.002]];
        assert!(((between(far) - between(near)) / (apart(far) - apart(near)) - 1.0).abs() < 0.2);
        let per_m = (Detector::described(&table).by_distance_ohm(0.0101).0
            - Detector::described(&table).by_distance_ohm(0.0099).0)
            / 2e-4;
        assert!((Detector::described(&table).by_distance_ohm(0.01f32).1 / per_m - 1.0).abs() < 0.01);
    }
}

pub(crate) fn summed(table: &Table<'_>, frame: &Frame<'_>, spots: &[Spot], deviation: f32) -> Normal {
    let (mut circuit, mut normal) = (Circuit::EMPTY, Normal::EMPTY);
    let detector = Detector::described(table);
    assert!(circuit.solve(&detector, spots));
    normal.sum_up(&detector, &mut circuit, frame, &Errors::of(frame, table), deviation);
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
        let covariance = normal.posterior(&Vector::ZERO).unwrap().covariance;
        // Times the matrix it is one.
        for i in 0..normal.count {
            for j in 0..normal.count {
                let pair = |a: usize, b: usize| normal.matrix[a.max(b)][a.min(b)];
                let scale = (normal.matrix[j][j] / normal.matrix[i][i]).sqrt();
                let sum: f32 = (0..normal.count).map(|k| covariance[i][k] * pair(k, j)).sum();
                assert!((sum - f32::from(u8::from(i == j))).abs() < 0.02 * scale.max(1.0), "{i} {j} {sum}");
            }
        }
    }
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
