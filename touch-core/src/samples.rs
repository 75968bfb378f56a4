//! Tables of made-up detectors, for tests: potentials of a thin sheet between electrodes on a grid, mirrored at its walls once.

extern crate std;

use std::vec::Vec;

use crate::contents::Contents;
use crate::crc::crc32;
use crate::table::{Head, OTHERS, RADII};
use crate::ways::ways_m;

/// Distance of electrodes (m).
const PITCH_M: f32 = 0.015;
/// Cells along a side.
pub(crate) const CELLS: usize = 20;
pub(crate) const KNOTS: usize = 15;
/// Resistance of a square over a turn (ohm).
const OHM: f32 = 140.0;

/// Where so many electrodes are in so many columns (m).
pub(crate) fn grid_m(columns: usize, rows: usize) -> Vec<[f32; 2]> {
    let at = |i: usize, count: usize| (i as f32 - 0.5 * (count as f32 - 1.0)) * PITCH_M;
    (0..columns * rows).map(|e| [at(e % columns, columns), at(e / columns, rows)]).collect()
}

/// Field of a current at some distance (ohm): nearer than 4 mm it is as at the bottom of a layer.
pub(crate) fn field_ohm([x, y]: [f32; 2], [to_x, to_y]: [f32; 2]) -> f32 {
    let square = (x - to_x).powi(2) + (y - to_y).powi(2);
    -0.5 * OHM * ((square + 1.6e-5) / 1e-3).ln()
}

/// The walls of the detector with these electrodes: its lowest and highest corner (m).
fn walls_m(pads_m: &[[f32; 2]]) -> [[f32; 2]; 2] {
    let half_m = [0, 1].map(|d| pads_m.iter().fold(0.0f32, |most, pad_m| most.max(pad_m[d])) + 0.5 * PITCH_M);
    [half_m.map(|half_m| -half_m), half_m]
}

/// What is taken off the field at each distance, so that those by all ways together have about no mean (ohm).
fn mean_ohm(pads_m: &[[f32; 2]]) -> f32 {
    let [low_m, high_m] = walls_m(pads_m);
    field_ohm(low_m.map(|m| 0.75 * m), high_m.map(|m| 0.75 * m))
}

/// The same with walls.
fn walled_ohm(pads_m: &[[f32; 2]], at_m: [f32; 2], to_m: [f32; 2]) -> f32 {
    let mean_ohm = mean_ohm(pads_m);
    ways_m(at_m, to_m, Some(walls_m(pads_m))).map(|way_m| field_ohm(way_m, [0.0; 2]) - mean_ohm).sum()
}

/// Of the electrodes, with walls; means over them are taken off.
pub(crate) fn fields_ohm(pads_m: &[[f32; 2]], at_m: [f32; 2]) -> Vec<f32> {
    let fields: Vec<_> = pads_m.iter().map(|pad_m| walled_ohm(pads_m, at_m, *pad_m)).collect();
    let mean = fields.iter().sum::<f32>() / fields.len() as f32;
    fields.into_iter().map(|ohm| ohm - mean).collect()
}

/// The bytes of the table of four by four electrodes.
pub(crate) fn table() -> Vec<u8> {
    table_of(&grid_m(4, 4), &[255; (CELLS * CELLS).div_ceil(8)], |_| ())
}

/// The bytes of the table of some electrodes, whose cells are on the detector as a mask says, with other numbers in its head.
pub(crate) fn table_of(pads_m: &[[f32; 2]], mask: &[u8], change: impl Fn(&mut Head)) -> Vec<u8> {
    let n = pads_m.len();
    let sides = [CELLS + 3; 2];
    let [[left_m, bottom_m], [right_m, top_m]] = walls_m(pads_m);
    let mut head = Head {
        left_m,
        bottom_m,
        step_x_m: (right_m - left_m) / CELLS as f32,
        step_y_m: (top_m - bottom_m) / CELLS as f32,
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
    change(&mut head);
    let mut pads_ohm = Vec::new();
    for e in 0..n {
        pads_ohm.extend((0..=e).map(|g| if e == g { 1000.0 } else { walled_ohm(pads_m, pads_m[e], pads_m[g]) }));
    }
    // Walls: the more the nearer an electrode is to the middle, and something that is the same everywhere.
    let wall = |e: usize, g: usize| match (pads_m.get(e), pads_m.get(g)) {
        (Some(one_m), Some(other_m)) => 1e-4 * (-field_ohm(*one_m, *other_m) / OHM).exp(),
        (None, None) => 20.0,
        _ => 0.02,
    };
    let walls: Vec<_> = (0..=n).flat_map(|e| (0..=e).map(move |g| wall(e, g))).collect();
    let channels: Vec<_> = (0..n).map(|e| [1.0 + 0.01 * e as f32, 0.001 * (e as f32 - 2.0)]).collect();
    let distances_ohm: Vec<_> = (0..KNOTS)
        .map(|k| -OHM * ((k as f32 - 1.0) * head.ln_step + (head.near_m / 0.032).ln()) - mean_ohm(pads_m))
        .collect();
    // Of the fields and of the rest, twice.
    let codes: Vec<_> = (0..n).map(|_| [0.0, 0.05]).chain([[100.0, 0.01], [0.5, 1.0 / 65_534.0]]).collect();
    let mut coefficients = Vec::new();
    for j in 0..sides[1] {
        for i in 0..sides[0] {
            let at = |index: usize, low_m: f32, step_m: f32| low_m + (index as f32 - 1.0) * step_m;
            let at_m = [at(i, head.left_m, head.step_x_m), at(j, head.bottom_m, head.step_y_m)];
            for radius in 0..RADII {
                // A wide disc's fields are flatter.
                let codes =
                    fields_ohm(pads_m, at_m).into_iter().map(|ohm| (ohm * (1.0 - 0.1 * radius as f32) / 0.05) as i16);
                // At the left edge half of a disc is on the detector, 10 mm from there all of it; its own field rises to the right.
                let [from_left_m, width_m] = [at_m[0] - head.left_m, CELLS as f32 * head.step_x_m];
                let share = (from_left_m / 0.01).clamp(0.0, 1.0);
                let own = 3000.0 * from_left_m / width_m * (1.0 + radius as f32);
                coefficients.extend(codes.chain([own as i16, (32_767.0 * share) as i16] as [i16; OTHERS]));
            }
        }
    }
    let mut bytes = Vec::new();
    let contents = Contents {
        head,
        places_m: &pads_m.iter().map(|[x_m, y_m]| [*x_m, *y_m, 0.0]).collect::<Vec<_>>(),
        sides,
        pads_ohm: &pads_ohm,
        channels: &channels,
        distances_ohm: &distances_ohm,
        walls: &walls,
        codes: &codes.repeat(RADII),
        mask,
        coefficients: &coefficients,
    };
    contents.write(&mut bytes);
    bytes
}

/// Appends the checksum.
pub(crate) fn seal(bytes: &mut Vec<u8>) {
    bytes.extend(crc32(bytes).to_le_bytes());
}
