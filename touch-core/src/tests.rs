//! What the parts do together, on a made-up detector.

use std::vec::Vec;

use proptest::prelude::*;

use crate::detector::Detector;
use crate::frame::Errors;
use crate::normal::ANY_RADIUS;
use crate::samples::{seal, table};
use crate::table::MAX_ELECTRODES;
use crate::vector::PARAMETERS;
use crate::{BOARD_CONTACTS, Flags, Frame, FrameError, Says, Solver, Table, TableError};

/// As on a board.
pub(crate) type Spot = crate::loaded::Spot<f32>;
pub(crate) type Circuit = crate::circuit::Circuit<f32, BOARD_CONTACTS>;
pub(crate) type Normal = crate::normal::Normal<f32, BOARD_CONTACTS>;
pub(crate) type Scene = crate::fit::Scene<f32, BOARD_CONTACTS, 0>;
pub(crate) type Fit = crate::fit::Fit<f32, BOARD_CONTACTS, 0>;

pub(crate) fn spot(x_m: f32, y_m: f32, sheets: f32) -> Spot {
    Spot { at_m: [x_m, y_m], ln_ohm: (1.0 / (sheets * 1.1e-3) + 600.0).ln(), ln_radius: 0.0 }
}

/// Readings of contacts (V).
pub(crate) fn volts(table: &Table<'_>, spots: &[Spot]) -> Vec<f32> {
    let (n, mut circuit) = (table.electrodes(), Circuit::EMPTY);
    assert!(circuit.solve(&Detector::described(table), spots));
    let mut row = [0.0; MAX_ELECTRODES];
    let of_row = |g: usize| {
        circuit.row_v(&Detector::described(table), g, &mut row);
        row[..n].to_vec()
    };
    (0..n).flat_map(of_row).collect()
}

/// Noise of a deviation of 1 mV or so, always the same.
pub(crate) fn noisy(volts: &[f32], seed: u32) -> Vec<f32> {
    let mut state = seed;
    let mut uniform = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32 - 0.5
    };
    volts.iter().map(|volts| volts + 0.0014 * (uniform() + uniform() + uniform())).collect()
}

#[test]
fn readings_obey_the_identity_of_any_circuit() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let volts = volts(&table, &[spot(0.004, -0.011, 0.3), spot(-0.015, 0.008, 3.0)]);
    // `r[e][g] r[g][h] r[h][e] = r[g][e] r[h][g] r[e][h]`, as `Z` is symmetric.
    let r = |g: usize, e: usize| f64::from(1.0 - volts[g * 16 + e] / 2.0);
    for (e, g, h) in [(0, 5, 9), (3, 12, 7), (15, 1, 8)] {
        let (one, other) = (r(e, g) * r(g, h) * r(h, e), r(g, e) * r(h, g) * r(e, h));
        assert!((one / other - 1.0).abs() < 1e-4, "{one} {other}");
    }
    // A lightly touched detector reads in proportion.
    let [light, lighter] = [1e-3, 5e-4].map(|sheets| self::volts(&table, &[spot(0.004, -0.011, sheets)])[37]);
    assert!((light / lighter - 2.0).abs() < 0.01, "{light} {lighter}");
}

#[test]
fn slopes_are_the_differences_of_the_sum_of_squares() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let truth = [spot(0.004, -0.011, 0.3), spot(-0.015, 0.008, 1.0), spot(0.019, 0.014, 0.1)];
    let volts = volts(&table, &truth);
    let frame = Frame::of_volts(&volts);
    let errors = Errors::of(&frame, &table);
    let summed = |spots: &[Spot]| {
        let (mut circuit, mut normal) = (Circuit::EMPTY, Normal::EMPTY);
        assert!(circuit.solve(&Detector::described(&table), spots));
        normal.sum_up(&Detector::described(&table), &mut circuit, &frame, &errors, ANY_RADIUS);
        normal
    };
    let mut begun = truth;
    for spot in &mut begun {
        spot.at_m[0] += 0.001;
        spot.ln_ohm += 0.1;
        spot.ln_radius -= 0.2;
    }
    let normal = summed(&begun);
    for parameter in 0..normal.count {
        let moved = |way: f32| {
            let mut spots = begun;
            let spot = &mut spots[parameter / PARAMETERS];
            match parameter % PARAMETERS {
                2 => spot.ln_ohm += way,
                3 => spot.ln_radius += way,
                axis => spot.at_m[axis] += 0.0025 * way,
            }
            summed(&spots).objective()
        };
        let slope = -0.5 * (moved(0.02) - moved(-0.02)) / 0.04;
        let off = (slope - normal.pull[parameter]).abs() / normal.matrix[parameter][parameter].sqrt();
        assert!(off < 0.004 * normal.cost.sqrt(), "parameter {parameter}: {slope} {}", normal.pull[parameter]);
    }
}

#[test]
fn up_to_three_contacts_are_found_and_followed() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let truth = [spot(0.004, -0.011, 0.3), spot(-0.015, 0.008, 1.0), spot(0.019, 0.014, 0.1)];
    for count in 0..=truth.len() {
        let mut solver = <Solver>::patient();
        let read = |truth: &[Spot], seed| match truth {
            [] => noisy(&[0.0; 256], seed),
            some => noisy(&volts(&table, some), seed),
        };
        let answer = solver.solve(&table, &Frame::of_volts(&read(&truth[..count], 1))).unwrap();
        assert_eq!((answer.contacts().len(), answer.flags), (count, Flags::default()), "{answer:?}");
        // They move by 0.5 mm, and keep their numbers without a search.
        let moved = truth.map(|spot| Spot { at_m: [spot.at_m[0] + 5e-4, spot.at_m[1]], ..spot });
        let next = solver.solve(&table, &Frame::of_volts(&read(&moved[..count], 2))).unwrap();
        let ids = |answer: &crate::Answer| answer.contacts().iter().map(|contact| contact.id).collect::<Vec<_>>();
        assert_eq!(ids(&next), ids(&answer));
        assert!(count == 0 || next.work.first_looks + next.work.looks == 0, "{next:?}");
        for spot in &moved[..count] {
            let off = |contact: &&crate::Contact| (contact.x_m - spot.at_m[0]).hypot(contact.y_m - spot.at_m[1]);
            let nearest = next.contacts().iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
            let sigma_m = nearest.sigma_m[0].hypot(nearest.sigma_m[1]);
            assert!(off(&nearest) < 4.0 * sigma_m && sigma_m < 1e-3, "{nearest:?} {spot:?}");
        }
        // Nothing is left where nothing touches. The first frame could be one in which they lift.
        let lifting = solver.solve(&table, &Frame::of_volts(&read(&[], 3))).unwrap();
        assert!(lifting.contacts().is_empty() || lifting.flags.has(Flags::MISFIT), "{count} {lifting:?}");
        let left = solver.solve(&table, &Frame::of_volts(&read(&[], 4))).unwrap();
        assert!(left.contacts().is_empty() && !left.flags.has(Flags::MISFIT), "{count} {left:?}");
        // What lands is flagged in its first frame, and searched in the second.
        let landing = solver.solve(&table, &Frame::of_volts(&read(&truth[..count], 5))).unwrap();
        assert!(count == 0 || (landing.flags.has(Flags::MISFIT) && landing.work.looks == 0), "{count} {landing:?}");
        let landed = solver.solve(&table, &Frame::of_volts(&read(&truth[..count], 6))).unwrap();
        assert_eq!((landed.contacts().len(), landed.flags), (count, Flags::default()), "{landed:?}");
    }
}

#[test]
fn a_press_of_one_frame_is_found_unless_patience_is_asked_for() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let press = noisy(&volts(&table, &[spot(0.004, -0.011, 0.3), spot(-0.015, 0.008, 1.0)]), 1);
    let other = noisy(&volts(&table, &[spot(0.019, 0.014, 0.1)]), 2);
    let rest = noisy(&[0.0; 256], 3);
    let counts = |mut solver: Solver| {
        [&rest, &press, &rest, &press, &other, &rest].map(|read| {
            let answer = solver.solve(&table, &Frame::of_volts(read)).unwrap();
            (answer.contacts().len(), answer.flags.has(Flags::MISFIT))
        })
    };
    assert_eq!(counts(Solver::new()), [0, 2, 0, 2, 1, 0].map(|count| (count, false)));
    let waiting = counts(Solver::patient());
    assert_eq!(waiting[..2], [(0, false), (0, true)]);
}

#[test]
fn more_digits_and_room_for_more_contacts_find_the_same() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let all = [spot(0.004, -0.011, 0.3), spot(-0.015, 0.008, 1.0), spot(0.019, 0.014, 0.1)];
    for count in 1..=all.len() {
        let read = noisy(&volts(&table, &all[..count]), count as u32);
        let exact: Vec<_> = read.iter().map(|volts| f64::from(*volts)).collect();
        let board = Solver::new().solve(&table, &Frame::of_volts(&read)).unwrap();
        let host = Solver::<f64, 8>::default().solve(&table, &Frame::of_volts(&exact)).unwrap();
        assert_eq!((host.contacts().len(), host.flags), (count, board.flags));
        for (ours, theirs) in host.contacts().iter().zip(board.contacts()) {
            let [x_m, y_m] = [ours.x_m - f64::from(theirs.x_m), ours.y_m - f64::from(theirs.y_m)];
            assert!(x_m.hypot(y_m) < 1e-3 * f64::from(table.head().radius_m), "{ours:?} {theirs:?}");
        }
    }
}

#[test]
fn what_does_not_fit_is_said() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let mut broken = volts(&table, &[spot(0.004, -0.011, 0.3)]);
    (0..16).filter(|g| *g != 3).for_each(|g| broken[g * 16 + 3] = 1.3);
    let answer = Solver::new().solve(&table, &Frame::of_volts(&broken)).unwrap();
    assert!(answer.flags.has(Flags::MISFIT), "{answer:?}");
    let mut full = volts(&table, &[spot(0.004, -0.011, 0.3)]);
    full[20] = 2.0;
    let answer = Solver::new().solve(&table, &Frame::of_volts(&full)).unwrap();
    assert!(answer.flags.has(Flags::SATURATED) && answer.contacts().len() == 1, "{answer:?}");
}

#[test]
fn an_electrode_whose_wire_is_broken_is_left_out() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let truth = spot(0.004, -0.011, 0.3);
    let sound = volts(&table, &[truth]);
    let mut broken = sound.clone();
    for other in 0..16 {
        // Grounded it grounds nothing, and read it floats.
        (broken[6 * 16 + other], broken[other * 16 + 6]) = (2.0, 1.1);
    }
    broken[6 * 16 + 6] = 0.0;
    for (volts, left_out) in [(sound, 0), (broken, 1 << 6)] {
        let answer = Solver::new().solve(&table, &Frame::of_volts(&volts)).unwrap();
        let [found] = answer.contacts() else { panic!("{answer:?}") };
        assert!((found.x_m - 0.004).hypot(found.y_m + 0.011) < 2e-4, "{found:?}");
        assert_eq!((answer.left_out, answer.flags.has(Flags::FAULT)), (left_out, left_out != 0));
        assert!(!answer.flags.has(Flags::MISFIT), "{answer:?}");
    }
}

#[test]
fn newtons_rise_with_conductance_up_to_the_most() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let newtons = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1.0].map(|s| table.force_n([0.004, -0.011], s).unwrap());
    assert!(newtons.is_sorted() && newtons[..5].windows(2).all(|two| two[0] < two[1]), "{newtons:?}");
    // A light contact's resistance is its own: `S = a F^g`.
    let light_n = (1e-6f32 / 2e-4).powf(1.0 / 1.2);
    assert!((newtons[0] / light_n - 1.0).abs() < 0.01 && newtons[5] <= 20.0, "{newtons:?} {light_n}");
}

#[test]
fn bounds_and_gaps_leave_a_contact_where_it_is() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let truth = spot(0.004, -0.011, 1.0);
    let mut volts = volts(&table, &[truth]);
    // Half of the readings are below what the converter reads.
    let mut sorted = volts.clone();
    sorted.sort_by(f32::total_cmp);
    let floor_v = sorted[128];
    let mut says: Vec<_> = volts.iter().map(|v| if *v < floor_v { Says::AtMost } else { Says::Voltage }).collect();
    volts.iter_mut().for_each(|v| *v = v.max(floor_v));
    (32..48).for_each(|i| (says[i], volts[i]) = (Says::Nothing, f32::NAN));
    assert!(says.iter().filter(|says| **says == Says::AtMost).count() > 100);
    let answer = Solver::new().solve(&table, &Frame::new(&volts, &says)).unwrap();
    let [found] = answer.contacts() else { panic!("{answer:?}") };
    assert!((found.x_m - 0.004).hypot(found.y_m + 0.011) < 2e-4, "{found:?}");
}

#[test]
fn frames_of_others_are_refused() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let mut volts = [0.1; 256];
    let solve = |volts: &[f32]| Solver::new().solve(&table, &Frame::of_volts(volts)).map(|_| ());
    assert_eq!(solve(&volts[..255]), Err(FrameError::Length { found: 255, expected: 256 }));
    volts[35] = f32::INFINITY;
    assert_eq!(solve(&volts), Err(FrameError::NotFinite { g: 2, e: 3 }));
}

#[test]
fn damaged_tables_are_refused_and_say_why() {
    let sound = table();
    let read = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = sound.clone();
        change(&mut bytes);
        Table::read(&bytes).err()
    };
    let sealed = |at: usize, new: &[u8]| {
        let mut bytes = sound[..sound.len() - 4].to_vec();
        bytes[at..at + new.len()].copy_from_slice(new);
        seal(&mut bytes);
        Table::read(&bytes).err()
    };
    assert_eq!(read(&|_| ()), None);
    assert_eq!(read(&|bytes| bytes[0] = 0), Some(TableError::Magic));
    assert_eq!(read(&|bytes| bytes.clear()), Some(TableError::Magic));
    assert_eq!(sealed(4, &[9, 0]), Some(TableError::Version { found: 9 }));
    assert!(matches!(read(&|bytes| bytes.truncate(bytes.len() - 1)), Some(TableError::Length { .. })));
    assert!(matches!(read(&|bytes| bytes[500] ^= 4), Some(TableError::Checksum { .. })));
    assert!(matches!(sealed(6, &[200, 0]), Some(TableError::Count { what: "electrodes", found: 200, .. })));
    assert!(matches!(sealed(32, &f32::NAN.to_le_bytes()), Some(TableError::Number { what: "step of the grid" })));
    assert!(matches!(sealed(120, &f32::INFINITY.to_le_bytes()), Some(TableError::Number { .. })));
}

proptest! {
    /// Whatever a table says, under a right checksum: it is refused, or frames have answers that are numbers.
    #[test]
    fn a_table_is_refused_or_its_answers_are_finite(
        // Of the head; by factors, and anything.
        factors in prop::collection::vec((0usize..24, -8.0f32..8.0), 0..4),
        numbers in prop::collection::vec((0usize..750, any::<u32>()), 0..2),
        others in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..200),
        is_random in any::<bool>(),
        random_v in prop::collection::vec(-3.0f32..3.0, 256),
    ) {
        let mut bytes = table();
        let pressed_v = volts(&Table::read(&bytes).unwrap(), &[spot(0.004, -0.011, 0.3), spot(-0.015, 0.008, 3.0)]);
        bytes.truncate(bytes.len() - 4);
        // Behind the numbers.
        others.iter().for_each(|(index, byte)| { let at = 3000 + index.index(bytes.len() - 3000); bytes[at] = *byte; });
        let at = |index: usize| 24 + 4 * index..28 + 4 * index;
        for (index, ln) in factors {
            let old = f32::from_le_bytes(bytes[at(index)].try_into().unwrap());
            bytes[at(index)].copy_from_slice(&(old * 10f32.powf(ln)).to_le_bytes());
        }
        for (index, bits) in numbers {
            bytes[at(index)].copy_from_slice(&bits.to_le_bytes());
        }
        seal(&mut bytes);
        if let Ok(table) = Table::read(&bytes) {
            let mut solver = Solver::new();
            let [low_m, high_m] = table.bounds_m();
            for _ in 0..2 {
                let answer = solver.solve(&table, &Frame::of_volts(if is_random { &random_v } else { &pressed_v })).unwrap();
                prop_assert!(answer.residual.is_finite());
                for found in answer.contacts() {
                    let numbers = [
                        found.x_m, found.y_m, found.conductance_s, found.conductance_sigma_s, found.apparent_conductance_s,
                        found.force_n.unwrap_or(0.0), found.radius_m, found.radius_sigma_m, found.sigma_m[0], found.sigma_m[1],
                        found.correlation,
                    ];
                    prop_assert!(numbers.iter().all(|number| number.is_finite()), "{found:?} {:?}", table.head());
                    prop_assert!(found.x_m >= low_m[0] && found.x_m <= high_m[0], "{found:?}");
                    prop_assert!(found.y_m >= low_m[1] && found.y_m <= high_m[1], "{found:?}");
                }
            }
        }
    }

    #[test]
    fn no_bytes_end_the_program(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(Table::read(&bytes).is_err());
    }
}
