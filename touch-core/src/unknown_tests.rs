//! Detectors that are not as their table says, made up from tables of a sheet.

use std::vec::Vec;

use crate::circuit::Circuit;
use crate::detector::Detector;
use crate::evidence::information;
use crate::frame::{Errors, Frame};
use crate::held::Held;
use crate::lanes::Lanes;
use crate::loaded::Spot;
use crate::local::Sorted;
use crate::moved::{Layout, Moved};
use crate::normal::{ANY_RADIUS, Normal};
use crate::samples::{CELLS, KNOTS, fields_ohm, grid_m, table};
use crate::solver::Solver;
use crate::table::Table;
use crate::unknown::{Change, Direction, Unknown, pairs};
use crate::vector::Vector;
use crate::{Answer, Room};

const N: usize = 16;
/// Directions: two with fields, of which the first has a square, and one of each other kind.
pub(crate) const DIRECTIONS: usize = 8;
const TABLES: usize = 3;

/// What is not known of the made-up sheet.
pub(crate) struct MadeUp {
    directions: Vec<Direction>,
    changes: Vec<Change>,
    fields_ohm: Vec<f32>,
    pads_ohm: Vec<f32>,
    distances_ohm: Vec<f32>,
    walls: Vec<f32>,
}

impl MadeUp {
    pub(crate) fn new(table: &Table<'_>) -> Self {
        let pads_m = grid_m(4, 4);
        let mut fields = Vec::new();
        for j in 0..CELLS + 3 {
            for i in 0..CELLS + 3 {
                let head = table.head();
                let at_m =
                    [head.left_m + (i as f32 - 1.0) * head.step_x_m, head.bottom_m + (j as f32 - 1.0) * head.step_y_m];
                let own = fields_ohm(&pads_m, at_m);
                // Fields that are steeper on one side, by a share and its square; and one electrode a millimetre off.
                let share = 0.05 + 2.0 * at_m[0];
                fields.extend(own.iter().map(|ohm| share * ohm).chain([30.0]));
                fields.extend(own.iter().map(|ohm| 0.5 * share * share * ohm).chain([3.0]));
                let off = fields_ohm(&pads_m, [at_m[0] - 0.001, at_m[1]]);
                fields.push(off[5] - own[5]);
            }
        }
        fn each<const M: usize>(values: [f32; M], count: usize) -> impl Iterator<Item = f32> {
            values.into_iter().flat_map(move |v| std::iter::repeat_n(v, count))
        }
        let of_pair = |e: usize, g: usize| if e == 5 || g == 5 { 0.3 } else { 0.0 };
        let of_electrode = (0..N).flat_map(|e| (0..=e).map(move |g| of_pair(e, g)));
        let changes = std::vec![
            Change::Gain(3, 0.01),
            Change::Offset(2, 0.002),
            Change::Pad(7, 0.3),
            Change::Switch(0.25),
            Change::Bow(1, 0.01),
            Change::Gain(8, 0.005),
            Change::Pad(8, 0.5),
            Change::Crowding(8, 0.1),
        ];
        let alone = |number: usize, electrode: Option<usize>| Direction {
            changes: number..number + 1,
            electrode,
            ..Direction::default()
        };
        let mut directions = std::vec![
            Direction { table: Some(0), square: Some(1), ..Direction::default() },
            Direction { table: Some(2), electrode: Some(5), ..Direction::default() },
        ];
        directions.extend([Some(3), Some(2), Some(7), None, Some(1)].into_iter().enumerate().map(|(i, e)| alone(i, e)));
        directions.push(Direction { changes: 5..8, electrode: Some(8), ..Direction::default() });
        Self {
            directions,
            changes,
            fields_ohm: fields,
            pads_ohm: each([5.0, 1.0], pairs(N)).chain(of_electrode).collect(),
            distances_ohm: each([8.0, 1.0, 0.0], KNOTS).collect(),
            walls: each([2e-6, 1e-7, 0.0], pairs(N + 1)).collect(),
        }
    }

    pub(crate) fn unknown(&self) -> Unknown<'_> {
        Unknown {
            directions: &self.directions,
            changes: &self.changes,
            tables: TABLES,
            electrodes: &[5],
            fields_ohm: &self.fields_ohm,
            pads_ohm: &self.pads_ohm,
            distances_ohm: &self.distances_ohm,
            walls: &self.walls,
            ranges_v: &[[0.1, 1.9]; N],
            own_pads_ohm: &[40.0; N],
        }
    }
}

/// Calls a function with the detector after some steps.
fn on_moved<R>(
    table: &Table<'_>,
    made_up: &MadeUp,
    steps: [f64; DIRECTIONS],
    function: impl FnOnce(&Detector<'_, f64>, &Unknown<'_>) -> R,
) -> R {
    let unknown = made_up.unknown();
    let layout = Layout::of(table, &unknown);
    let (mut numbers, mut shares) = (std::vec![0.0; layout.numbers()], [0.0; TABLES]);
    let moved: Moved<'_, f64> = layout.moved(table, &unknown, &steps, &mut numbers, &mut shares);
    function(&Detector { table, moved: Some((&unknown, moved)) }, &unknown)
}

/// Readings of contacts on the detector after some steps (V).
pub(crate) fn read_v(table: &Table<'_>, made_up: &MadeUp, steps: [f64; DIRECTIONS], spots: &[Spot<f64>]) -> Vec<f64> {
    on_moved(table, made_up, steps, |detector, _| {
        let mut circuit = Circuit::<f64, 3>::EMPTY;
        assert!(circuit.solve(detector, spots));
        let mut volts = std::vec![0.0; N * N];
        volts.chunks_exact_mut(N).enumerate().for_each(|(g, row)| circuit.row_v(detector, g, row));
        let mut read_v = volts.clone();
        volts.chunks_exact(N).zip(read_v.chunks_exact_mut(N)).for_each(|(row, read_v)| detector.read_v(row, read_v));
        read_v
    })
}

fn spot(x_m: f64, y_m: f64, sheets: f64) -> Spot<f64> {
    let one = crate::tests::spot(x_m as f32, y_m as f32, sheets as f32);
    Spot { at_m: [x_m, y_m], ln_ohm: f64::from(one.ln_ohm), ln_radius: 0.0 }
}

fn scenes() -> [Vec<Spot<f64>>; 2] {
    [std::vec![spot(0.004, -0.011, 0.6)], std::vec![spot(-0.015, 0.008, 2.0), spot(0.012, -0.004, 0.3)]]
}

/// Steps that a detector may be off by.
const STEPS: [f64; DIRECTIONS] = [0.8, -1.1, 0.5, -0.7, 1.2, 0.4, -0.9, 0.6];

/// The parts of a room that what is held needs.
fn with_held<R>(
    unknown: &Unknown<'_>,
    table: &Table<'_>,
    function: impl FnOnce(&mut Held<'_, f64, DIRECTIONS>) -> R,
) -> R {
    let mut numbers = std::vec![0.0; Room::<f64>::numbers(table, unknown, 3)];
    let mut floats = std::vec![0.0; Room::<f64>::floats(table, unknown, 3)];
    let mut room = Room { numbers: &mut numbers, floats: &mut floats };
    function(&mut room.parts(table, unknown, 3).held)
}

/// Each is how readings differ by a small step, at the description and far from it.
#[test]
fn patterns_are_differences() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let made_up = MadeUp::new(&table);
    for spots in scenes() {
        for at in [[0.0; DIRECTIONS], STEPS] {
            for direction in 0..DIRECTIONS {
                let moved = |way: f64| {
                    let mut steps = at;
                    steps[direction] += way;
                    read_v(&table, &made_up, steps, &spots)
                };
                let (ahead, behind) = (moved(1e-3), moved(-1e-3));
                let expected: Vec<f64> = ahead.iter().zip(&behind).map(|(a, b)| (a - b) / 2e-3).collect();
                let found =
                    on_moved(&table, &made_up, at, |detector, unknown| {
                        let mut circuit = Circuit::<f64, 3>::EMPTY;
                        assert!(circuit.solve(detector, &spots));
                        circuit.derive(&table);
                        let (mut there_v, mut all) = (std::vec![0.0; N * N], std::vec![0.0; N * N * DIRECTIONS]);
                        there_v.chunks_exact_mut(N).enumerate().for_each(|(g, row)| circuit.row_v(detector, g, row));
                        let mut fields = std::vec![0.0; Room::<f64>::floats(&table, unknown, 3)];
                        let sorted = Sorted::<DIRECTIONS>::of(unknown);
                        let (fields, between_ohm) = fields.split_at_mut(3 * unknown.of_place(N));
                        crate::patterns::Patterns::new(detector, unknown, &circuit, &there_v, fields, between_ohm)
                            .write(&sorted, &mut all, &mut std::vec![0.0; N * N]);
                        crate::local::pattern(&sorted, &all, N * N, direction)
                    });
                let largest = expected.iter().fold(0.0f64, |most, v| most.max(v.abs()));
                let off = expected.iter().zip(&found).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(off < 5e-4 * largest, "{direction} at {at:?} under {spots:?}: {off} of {largest}");
            }
        }
    }
}

/// The sum of squares is the least that steps of the detector leave, with theirs, in the linear theory: and no other steps leave less.
#[test]
fn the_sum_of_squares_is_that_of_the_posteriors_mean() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let made_up = MadeUp::new(&table);
    let spots = &scenes()[1];
    let read = read_v(&table, &made_up, STEPS, spots);
    let frame = Frame::of_volts(&read);
    let mut errors = Errors::of(&frame, &table);
    errors.pads.fill(0.0);
    let noise_v = errors.variance_v2.sqrt();
    // At the description, and on the way.
    for at in [0.0, 0.3].map(|share| STEPS.map(|step| share * step)) {
        on_moved(&table, &made_up, at, |detector, unknown| {
            with_held(unknown, &table, |held| {
                let mut circuit = Circuit::<f64, 3>::EMPTY;
                assert!(circuit.solve(detector, spots));
                held.read(detector, &circuit);
                // Whether they are held in it, or were in another noise.
                held.hold(detector, unknown, &mut circuit, 3.0 * noise_v, |_, _| true);
                held.rescale(1.0 / 3.0);
                held.factorise(1.0).unwrap();
                held.set_state(&at);
                let mut normal = Normal::EMPTY;
                normal.sum_up_held(detector, &mut circuit, &frame, noise_v, f64::from(ANY_RADIUS), held);
                held.take();
                let mut mean = at;
                held.posterior(&mut mean);
                let patterns: Vec<Vec<f64>> = (0..DIRECTIONS).map(|k| held.pattern(k)).collect();
                let predicted = read_v(&table, &made_up, at, spots);
                let left = |steps: &[f64; DIRECTIONS]| {
                    let of_reading = |index: usize| {
                        let further = steps.iter().zip(&at).map(|(step, at)| step - at);
                        let by_steps: f64 = patterns.iter().zip(further).map(|(pattern, s)| pattern[index] * s).sum();
                        ((read[index] - predicted[index]) / noise_v - by_steps).powi(2)
                    };
                    (0..N * N).map(of_reading).sum::<f64>() + steps.iter().map(|s| s * s).sum::<f64>()
                };
                let least = left(&mean);
                assert!((normal.cost - least).abs() < 1e-6 * least, "{} {least}", normal.cost);
                for direction in 0..DIRECTIONS {
                    for way in [-0.1, 0.1] {
                        let mut other = mean;
                        other[direction] += way;
                        assert!(left(&other) > least);
                    }
                }
            });
        });
    }
}

/// As each row with each, whatever their length and however many there are.
#[test]
fn products_of_many_rows_are_those_of_two() {
    for (of_a, of_b, length) in [(1, 1, 1), (2, 4, 16), (3, 5, 7), (5, 9, 225), (1, 6, 256)] {
        let numbers = |count: usize| (0..count * length).map(|i| (0.37 * i as f64).sin()).collect::<Vec<f64>>();
        let (a, b) = (numbers(of_a), numbers(of_b));
        for is_lower in [false, true] {
            let mut found = std::vec![f64::NAN; of_a * of_b];
            f64::products(&a, &b, length, is_lower, |i, j, product| found[i * of_b + j] = product);
            for (i, j) in (0..of_a).flat_map(|i| (0..of_b).map(move |j| (i, j))).filter(|(i, j)| !is_lower || j <= i) {
                let row = |rows: &[f64], index: usize| rows[index * length..(index + 1) * length].to_vec();
                let expected: f64 = row(&a, i).iter().zip(row(&b, j)).map(|(a, b)| a * b).sum();
                assert!(
                    (found[i * of_b + j] - expected).abs() < 1e-12 * length as f64,
                    "{of_a} {of_b} {length} {i} {j}"
                );
            }
        }
    }
}

/// Where its place and its strength cannot be told apart, as in a corner, it is there all the same; where another one's strength would do as well, it is not.
#[test]
fn what_is_said_for_a_contact_does_not_count_where_it_is() {
    let mut normal = Normal::<f64, 3> { count: 8, ..Normal::EMPTY };
    (0..8).for_each(|i| normal.matrix[i][i] = 1000.0);
    normal.said = [1000.0; 3];
    normal.matrix[2][0] = 999.0;
    let said = information(&normal, normal.posterior(&Vector::ZERO).as_ref());
    assert!((said[0] - 1000.0).abs() < 1.0 && (said[1] - 1000.0).abs() < 1.0, "{said:?}");
    normal.matrix[6][2] = 999.0;
    normal.matrix[2][0] = 0.0;
    let said = information(&normal, normal.posterior(&Vector::ZERO).as_ref());
    assert!((said[0] - 2.0).abs() < 0.1 && (said[1] - 2.0).abs() < 0.1, "{said:?}");
}

/// One that is off by a deviation or so in all directions: contacts are where they are, as well as they say, and are not without what is not known.
#[test]
fn contacts_are_found_with_the_detector_that_they_are_on() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let made_up = MadeUp::new(&table);
    let unknown = made_up.unknown();
    let mut numbers = std::vec![0.0; Room::<f64>::numbers(&table, &unknown, 3)];
    for spots in scenes() {
        let read = read_v(&table, &made_up, STEPS, &spots);
        let frame = Frame::of_volts(&read);
        let mut floats = std::vec![0.0; Room::<f64>::floats(&table, &unknown, 3)];
        let mut room = Room { numbers: &mut numbers, floats: &mut floats };
        let mut solver = Solver::<f64, 3, DIRECTIONS>::default();
        let answer = solver.solve_unknown(&table, &unknown, &mut room, &frame).unwrap();
        assert_eq!(answer.contacts().len(), spots.len(), "{answer:?}");
        assert_eq!(answer.flags.bits(), crate::Flags::CALIBRATE.bits(), "{answer:?}");
        let off = |answer: &Answer<f64, 3>| {
            let nearest = |spot: &Spot<f64>| {
                let off = |c: &crate::Contact<f64>| (c.x_m - spot.at_m[0]).hypot(c.y_m - spot.at_m[1]);
                answer
                    .contacts()
                    .iter()
                    .map(|c| (off(c), c.sigma_m[0].max(c.sigma_m[1])))
                    .min_by(|a, b| a.0.total_cmp(&b.0))
            };
            spots
                .iter()
                .map(|spot| nearest(spot).unwrap())
                .fold((0.0f64, 0.0f64), |most, one| (most.0.max(one.0), most.1.max(one.1)))
        };
        let (off_m, sigma_m) = off(&answer);
        assert!(off_m < 3.0 * sigma_m && sigma_m < 1e-3, "{off_m} {sigma_m} {answer:?}");
        let plain = Solver::<f64, 3>::default().solve(&table, &frame).unwrap();
        assert!(plain.contacts().len() != spots.len() || off(&plain).0 > 3.0 * off_m, "{plain:?} {off_m}");
        // Followed, it stays, and costs less.
        let again = solver.solve_unknown(&table, &unknown, &mut room, &frame).unwrap();
        assert!(off(&again).0 < 3.0 * sigma_m && again.contacts().len() == spots.len());
        assert!(again.work.frames.iter().sum::<u32>() < answer.work.frames.iter().sum::<u32>());
    }
}

/// Patterns and derivatives are held on from frame to frame, cost less, and tell what such that are made anew would; in a frame whose readings say less they are made anew.
#[test]
fn patterns_serve_the_frames_after_theirs() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let made_up = MadeUp::new(&table);
    let unknown = made_up.unknown();
    let rooms = || {
        let numbers = std::vec![0.0; Room::<f64>::numbers(&table, &unknown, 3)];
        (numbers, std::vec![0.0; Room::<f64>::floats(&table, &unknown, 3)])
    };
    let (mut kept, mut other) = (rooms(), rooms());
    for spots in scenes() {
        let exact = read_v(&table, &made_up, STEPS, &spots);
        let mut solver = Solver::<f64, 3, DIRECTIONS>::default();
        for seed in 0..4 {
            let exact: Vec<f32> = exact.iter().map(|volts| *volts as f32).collect();
            let read: Vec<f64> = crate::tests::noisy(&exact, seed).into_iter().map(f64::from).collect();
            let mut says = std::vec![crate::Says::Voltage; read.len()];
            if seed == 3 {
                says[N + 2] = crate::Says::Nothing;
            }
            let frame = Frame::new(&read, &says);
            let mut anew = solver.clone();
            anew.fitting.on.is_held = false;
            assert_eq!(solver.fitting.on.is_held, seed > 0);
            let answer = |solver: &mut Solver<f64, 3, DIRECTIONS>, room: &mut (Vec<f64>, Vec<f32>)| {
                let mut room = Room { numbers: &mut room.0, floats: &mut room.1 };
                solver.solve_unknown(&table, &unknown, &mut room, &frame).unwrap()
            };
            let (held, made) = (answer(&mut solver, &mut kept), answer(&mut anew, &mut other));
            assert_eq!(held.contacts().len(), spots.len());
            let looks = |answer: &Answer<f64, 3>| answer.work.frames.iter().sum::<u32>();
            assert!(looks(&held) < looks(&made) || seed == 0 || seed == 3, "{held:?} {made:?}");
            if seed == 0 || seed == 3 {
                assert_eq!(held, made);
            }
            for (held, made) in held.contacts().iter().zip(made.contacts()) {
                let off = [(held.x_m - made.x_m) / made.sigma_m[0], (held.y_m - made.y_m) / made.sigma_m[1]];
                let sigma = held.sigma_m[0] / made.sigma_m[0];
                assert!(off.iter().all(|off| off.abs() < 0.1) && (sigma - 1.0).abs() < 0.1, "{off:?} {sigma}");
            }
        }
    }
}

/// Two contacts near to each other, which one in the middle nearly explains, are found from its halves.
#[test]
fn a_contact_that_is_two_is_found_to_be() {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    let made_up = MadeUp::new(&table);
    let unknown = made_up.unknown();
    let mut numbers = std::vec![0.0; Room::<f64>::numbers(&table, &unknown, 3)];
    let mut floats = std::vec![0.0; Room::<f64>::floats(&table, &unknown, 3)];
    let mut told = 0;
    for which in 0..24u32 {
        let angle = 0.26 * f64::from(which);
        let [x_m, y_m] = [0.0034 * angle.cos(), 0.0034 * angle.sin()];
        let pair = [spot(0.003 + x_m, -0.009 + y_m, 0.4), spot(0.003 - x_m, -0.009 - y_m, 0.4)];
        let exact: Vec<f32> = read_v(&table, &made_up, STEPS, &pair).into_iter().map(|volts| volts as f32).collect();
        let read: Vec<f64> = crate::tests::noisy(&exact, which).into_iter().map(f64::from).collect();
        let says = std::vec![crate::Says::Voltage; read.len()];
        let mut room = Room { numbers: &mut numbers, floats: &mut floats };
        let mut solver = Solver::<f64, 3, DIRECTIONS>::default();
        let answer = solver.solve_unknown(&table, &unknown, &mut room, &Frame::new(&read, &says)).unwrap();
        told += usize::from(answer.contacts().len() == 2);
    }
    assert!(told >= 18, "{told} of 24");
}
