//! Codes, rest, and what touches above it.

extern crate std;

use std::vec::Vec;

use tactomo_protocol::{ConverterErrors, Hello, Range, Scope, Settings, Status};
use tactomo_touch_core::table::{Head, OTHERS, RADII};
use tactomo_touch_core::{Answer, Contents, Frame, Says, Solver, Table};

use super::cells::Cells;
use super::input::Input;
use super::rest::Rest;
use crate::scan::Scanned;

/// Electrodes, and readings of a frame.
const N: usize = 4;
const ALL: usize = N * N;
const NOISE_V: f32 = 0.001;

/// Two electrodes of a converter with a floor at 100 and a ceiling at 4000, and two of one that tells all; a code is a millivolt.
fn hello(noise_uv: u16) -> Hello {
    let errors = ConverterErrors { noise_uv, ..ConverterErrors::default() };
    let ranges = [
        Range { electrodes: 2, floor: 100, ceiling: 4000, errors },
        Range { electrodes: 2, floor: 0, ceiling: 4095, errors },
    ];
    Hello {
        answers: 0,
        firmware_version: heapless::String::new(),
        board: heapless::String::new(),
        electrodes: N as u8,
        adc_bits: 12,
        adc_full_scale_mv: 4096,
        drive_mv: 2000,
        settings: Settings::default(),
        is_streaming: false,
        ranges: ranges.into_iter().collect(),
    }
}

/// A table of a detector whose drive is so high (V), on which nothing is ever found; channel 1 reads a tenth too much.
fn table(drive_v: f32) -> Vec<u8> {
    let head = Head {
        step_x_m: 0.01,
        step_y_m: 0.01,
        radius_m: 0.002,
        radii_m: [0.001, 0.004],
        near_m: 0.002,
        ln_step: 0.5,
        drive_v,
        noise_v: NOISE_V,
        full_v: 1.99,
        sheet_s: 1e-3,
        top_s_per_m: 0.2,
        constriction_ohm: 1.0,
        ..Head::default()
    };
    let mut bytes = Vec::new();
    Contents {
        head,
        places_m: &[[0.0; 3]; N],
        sides: [4; 2],
        pads_ohm: &[1000.0; N * (N + 1) / 2],
        channels: &[[1.0, 0.0], [1.1, 0.0], [1.0, 0.0], [1.0, 0.0]],
        distances_ohm: &[0.0; 4],
        walls: &[0.0; (N + 1) * (N + 2) / 2],
        codes: &[[0.0, 1.0]; RADII * (N + OTHERS)],
        mask: &[1],
        coefficients: &[0; 16 * RADII * (N + OTHERS)],
    }
    .write(&mut bytes);
    bytes
}

fn scanned(status: Status) -> Scanned {
    Scanned { time_us: 0, folded: 0, status, fraction_bits: 0, stuck: false }
}

#[test]
fn codes_are_volts_and_bounds_at_the_ends_of_each_converters_range() {
    let input = Input::of(&hello(5000));
    let near = |(volts, says): (f32, Says), expected_v: f32, expected: Says| {
        assert!(
            (volts - expected_v).abs() < 1e-6 && says == expected,
            "{volts} {says:?}, not {expected_v} {expected:?}"
        );
    };
    near(input.used_v(0, 1000, 0, 0.0), 1.0, Says::Voltage);
    // Bits below a code, and a ground that is lifted.
    near(input.used_v(0, 16_040, 4, 0.0), 1.0025, Says::Voltage);
    near(input.used_v(0, 1000, 0, 0.02), 0.98, Says::Voltage);
    // Within two standard deviations of the noise of an end it is at the end.
    near(input.used_v(1, 111, 0, 0.0), 0.111, Says::Voltage);
    near(input.used_v(1, 109, 0, 0.0), 0.11, Says::AtMost);
    near(input.used_v(1, 50, 0, 0.01), 0.1, Says::AtMost);
    near(input.used_v(1, 3989, 0, 0.0), 3.989, Says::Voltage);
    near(input.used_v(1, 3991, 0, 0.0), 3.99, Says::AtLeast);
    near(input.used_v(2, 0, 0, 0.0), 0.0, Says::Voltage);
    near(input.used_v(3, 4095, 0, 0.0), 4.095, Says::Voltage);
    // Where noise is not known, three codes.
    let input = Input::of(&hello(0));
    near(input.used_v(0, 102, 0, 0.0), 0.103, Says::AtMost);
    near(input.used_v(0, 104, 0, 0.0), 0.104, Says::Voltage);
    assert!((input.drive_v - 2.0).abs() < 1e-6 && input.electrodes == N as u8);
}

#[test]
fn rest_is_the_mean_of_what_stood_still_and_anew_what_moves() {
    let mut rest = Rest::<2>::NONE;
    let add = |rest: &mut Rest<2>, count: usize, volts: f32| {
        (0..count).for_each(|i| rest.add(0, volts + if i % 2 == 0 { NOISE_V } else { -NOISE_V }, NOISE_V));
    };
    assert!(!rest.has_stood_still(), "nothing was read");
    add(&mut rest, 63, 0.3);
    assert!(!rest.has_stood_still());
    assert!((rest.above(0, 0.5) - 0.5).abs() < 1e-6, "it is not known yet");
    add(&mut rest, 1, 0.3);
    // The other cell is not read at all.
    assert!(rest.has_stood_still() && !rest.is_known());
    rest.take();
    assert!(rest.is_known() && (rest.above(0, 0.5) - 0.2).abs() < 1e-4 && (rest.above(1, 0.5) - 0.5).abs() < 1e-6);
    // A reading eight deviations away begins it anew, one of seven does not; and of the first few nothing is said.
    for (off, begins) in [(7.0, false), (9.0, true), (-9.0, true)] {
        let mut rest = Rest::<2>::NONE;
        add(&mut rest, 63, 0.3);
        rest.add(0, 0.3 + off * NOISE_V, NOISE_V);
        assert_eq!(rest.has_stood_still(), !begins, "{off}");
    }
    let mut rest = Rest::<2>::NONE;
    for volts in [0.0, 0.1, 0.2, 0.1] {
        rest.add(0, volts, NOISE_V);
    }
    rest.add(0, 0.1, NOISE_V);
    add(&mut rest, 59, 0.1);
    assert!(rest.has_stood_still());
    // A cell that has not stood as long as another holds it up.
    rest.add(1, 0.1, NOISE_V);
    assert!(!rest.has_stood_still());
    rest.restart();
    assert!(!rest.is_known() && !rest.has_stood_still());
}

#[test]
fn rest_follows_slowly_what_is_a_voltage_and_knows_that_it_was_none() {
    let mut rest = Rest::<3>::NONE;
    (0..64).for_each(|_| (0..3).for_each(|cell| rest.add(cell, 0.2, NOISE_V)));
    let touch_v = [-9.0 * NOISE_V, -9.0 * NOISE_V, -7.0 * NOISE_V];
    assert!(!rest.was_touched(&touch_v, NOISE_V, 2), "it is not known");
    rest.take();
    assert!(rest.was_touched(&touch_v, NOISE_V, 2) && !rest.was_touched(&touch_v, NOISE_V, 3));
    (0..4096).for_each(|_| rest.follow(&[0.01, 0.01, -0.01], &[Says::Voltage, Says::AtMost, Says::Voltage]));
    let above = [0, 1, 2].map(|cell| rest.above(cell, 0.2));
    assert!((above[0] + 0.01).abs() < 1e-3 && above[1].abs() < 1e-6 && (above[2] - 0.01).abs() < 1e-3, "{above:?}");
}

#[test]
fn cells_are_above_rest_and_keep_what_was_read_last() {
    let (bytes, input) = (table(1.9), Input::of(&hello(0)));
    let Ok(table) = Table::read(&bytes) else { panic!("{:?}", Table::read(&bytes)) };
    let Some(whole) = Scope::whole(N as u8) else { panic!("no scope") };
    let mut cells = Cells::<ALL>::NONE;
    // Electrode 0 is below its converter's floor: nothing. The others rest at some level; the ground is lifted by 0.1 V.
    let at_rest = |_: usize| [50, 600, 700, 800];
    let read = |levels: &dyn Fn(usize) -> [u16; N]| -> Vec<u16> { (0..N).flat_map(levels).collect() };
    let nothing = Answer::default();
    for number in 0..64 {
        assert!(!cells.knows_rest());
        cells.take(&table, &input, (&scanned(Status::default()), &whole, &read(&at_rest)));
        assert_eq!(cells.learn(&nothing, &table), number == 63);
    }
    assert!(cells.knows_rest());
    let volts = |cells: &Cells<ALL>| -> Vec<f32> {
        // What a solver would be given, by what it says of readings that are no numbers.
        (0..ALL).map(|cell| cells.touch_v(cell)).collect()
    };
    cells.take(&table, &input, (&scanned(Status::default()), &whole, &read(&|_| [150, 710, 700, 850])));
    let now = volts(&cells);
    for row in now.chunks(N) {
        let expected = [0.05, 0.1, 0.0, 0.05];
        assert!(row.iter().zip(expected).all(|(v, expected)| (v - expected).abs() < 1e-5), "{row:?}");
    }
    // A conversion that timed out says nothing, and the cell keeps its voltage.
    cells.take(
        &table,
        &input,
        (
            &scanned(Status::TIMED_OUT),
            &whole,
            &read(&|g| if g == 1 { [150, 0, 700, 850] } else { [150, 710, 700, 850] }),
        ),
    );
    assert_eq!(volts(&cells), now);
    let Some(frame) = cells.touch(&table) else { panic!("no frame") };
    assert!(frame.check(&table).is_ok());
    // What was rest was none: many are far below it.
    cells.take(&table, &input, (&scanned(Status::default()), &whole, &read(&|_| [50, 500, 600, 700])));
    assert!(!cells.knows_rest());
    // A frame of another size is none.
    assert!(Cells::<4>::NONE.touch(&table).is_none());
    let solved = Solver::new().solve(&table, &Frame::of_volts(&[0.0; ALL]));
    assert!(solved.is_ok_and(|answer| answer.contacts().is_empty()));
}
