//! A table of a made-up detector, for tests: potentials of a thin sheet without walls, of four by four electrodes.

extern crate std;

use std::vec::Vec;

use crate::contents::Contents;
use crate::crc::crc32;
use crate::table::{Head, OTHERS, RADII};

/// Electrodes along a side, and their distance (m).
const SIDE: usize = 4;
const PITCH_M: f32 = 0.015;
/// Cells along a side.
const CELLS: usize = 20;
const KNOTS: usize = 12;
/// Resistance of a square over a turn (ohm).
const OHM: f32 = 140.0;

/// Where the electrodes are (m).
fn pads_m() -> Vec<[f32; 2]> {
    let at = |i: usize| (i as f32 - 1.5) * PITCH_M;
    (0..SIDE * SIDE).map(|e| [at(e % SIDE), at(e / SIDE)]).collect()
}

/// Field of a current at some distance (ohm): nearer than 4 mm it is as at the bottom of a layer.
fn field_ohm([x, y]: [f32; 2], [to_x, to_y]: [f32; 2]) -> f32 {
    let square = (x - to_x).powi(2) + (y - to_y).powi(2);
    -0.5 * OHM * ((square + 1.6e-5) / 1e-3).ln()
}

/// Means over the electrodes are taken off.
fn fields_ohm(at_m: [f32; 2]) -> Vec<f32> {
    let fields: Vec<_> = pads_m().into_iter().map(|pad_m| field_ohm(at_m, pad_m)).collect();
    let mean = fields.iter().sum::<f32>() / fields.len() as f32;
    fields.into_iter().map(|ohm| ohm - mean).collect()
}

/// The bytes of the table.
pub(crate) fn table() -> Vec<u8> {
    let n = SIDE * SIDE;
    let sides = [CELLS + 3; 2];
    let width_m = SIDE as f32 * PITCH_M;
    let head = Head {
        left_m: -0.5 * width_m,
        bottom_m: -0.5 * width_m,
        step_x_m: width_m / CELLS as f32,
        step_y_m: width_m / CELLS as f32,
        radius_m: 0.0025,
        radii_m: [0.0015, 0.0055],
        near_m: 0.0025,
        ln_step: 0.4,
        drive_v: 2.0,
        on_resistance_ohm: 4.0,
        noise_v: 0.0012,
        model_share: 0.0003,
        shift_m: 0.0,
        ln_conductance_error: 0.0,
        pad_share: 0.03,
        full_v: 1.99,
        sheet_s: 1.1e-3,
        top_s_per_m: 0.23,
        constriction_ohm: 560.0,
        force_s: 2e-4,
        force_exponent: 1.2,
        force_ohm: 400.0,
        force_most_n: 20.0,
    };
    let mut pads_ohm = Vec::new();
    for e in 0..n {
        pads_ohm.extend((0..=e).map(|g| if e == g { 1000.0 } else { field_ohm(pads_m()[e], pads_m()[g]) }));
    }
    let distances_ohm: Vec<_> =
        (0..KNOTS).map(|k| -OHM * ((k as f32 - 1.0) * head.ln_step + (head.near_m / 0.032).ln())).collect();
    // Of the fields and of the rest, twice.
    let codes: Vec<_> = (0..n).map(|_| [0.0, 0.05]).chain([[100.0, 0.01], [1.0, 0.0]]).collect();
    let mut coefficients = Vec::new();
    for j in 0..sides[1] {
        for i in 0..sides[0] {
            let at = |index: usize, low_m: f32, step_m: f32| low_m + (index as f32 - 1.0) * step_m;
            let at_m = [at(i, head.left_m, head.step_x_m), at(j, head.bottom_m, head.step_y_m)];
            for radius in 0..RADII {
                // A wide disc's fields are flatter.
                let codes = fields_ohm(at_m).into_iter().map(|ohm| (ohm * (1.0 - 0.1 * radius as f32) / 0.05) as i16);
                coefficients.extend(codes.chain([0; OTHERS]));
            }
        }
    }
    let mut bytes = Vec::new();
    let contents = Contents {
        head,
        places_m: &pads_m().into_iter().map(|[x_m, y_m]| [x_m, y_m, 0.0]).collect::<Vec<_>>(),
        sides,
        pads_ohm: &pads_ohm,
        channels: &[[1.0, 0.0]; SIDE * SIDE],
        distances_ohm: &distances_ohm,
        walls: &[0.0; (SIDE * SIDE + 1) * (SIDE * SIDE + 2) / 2],
        codes: &codes.repeat(RADII),
        mask: &[255; (CELLS * CELLS).div_ceil(8)],
        coefficients: &coefficients,
    };
    contents.write(&mut bytes);
    bytes
}

/// Appends the checksum.
pub(crate) fn seal(bytes: &mut Vec<u8>) {
    bytes.extend(crc32(bytes).to_le_bytes());
}
