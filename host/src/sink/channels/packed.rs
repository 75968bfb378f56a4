//! Numbers as bytes: images as point clouds, readings as grids.

use data_encoding::BASE64;
use serde::Serialize;
use tactomo_physics::forward::ImageMesh;
use tactomo_physics::readings::Readings;

use super::{At, Pose, Stamp};

/// Number types, as `foxglove.PackedElementField` counts them.
const FLOAT32: u8 = 7;
const FLOAT64: u8 = 8;

/// A `foxglove.PointCloud`.
#[derive(Debug, Serialize)]
pub(super) struct PointCloud<'a> {
    timestamp: Stamp,
    frame_id: &'a str,
    pose: Pose,
    point_stride: usize,
    fields: [Field; 4],
    data: String,
}

/// A `foxglove.Grid`.
#[derive(Debug, Serialize)]
pub(super) struct Grid<'a> {
    timestamp: Stamp,
    frame_id: &'a str,
    pose: Pose,
    column_count: usize,
    cell_size: Vector2,
    row_stride: usize,
    cell_stride: usize,
    fields: [Field; 3],
    data: String,
}

#[derive(Clone, Copy, Debug, Serialize)]
struct Vector2 {
    x: f64,
    y: f64,
}

#[derive(Clone, Copy, Debug, Serialize)]
struct Field {
    name: &'static str,
    offset: u8,
    r#type: u8,
}

/// An image (S/m2): x, y, z (m) and value of each node.
pub(super) fn image<'a>(
    image_s_per_m2: &[f32],
    mesh: &ImageMesh,
    At { stamp: timestamp, frame_id }: At<'a>,
) -> PointCloud<'a> {
    let field = |name, offset| Field { name, offset, r#type: FLOAT32 };
    let points = image_s_per_m2.iter().enumerate().flat_map(|(node, &value)| {
        let [x, y, z] = mesh.place_m(node).map(|metres| metres as f32);
        [x, y, z, value]
    });
    let data: Vec<u8> = points.flat_map(f32::to_le_bytes).collect();
    PointCloud {
        timestamp,
        frame_id,
        pose: Pose::at([0.0; 3]),
        point_stride: 4 * size_of::<f32>(),
        fields: [field("x", 0), field("y", 4), field("z", 8), field("conductance_s_per_m2", 12)],
        data: BASE64.encode(&data),
    }
}

/// Readings (V) as measured, as they are used, and as the solver got them: a row a ground, a column an electrode, beside the detector and as high as it is.
pub(super) fn readings<'a>(
    [readings, used, touch]: [&Readings; 3],
    [[_, low_m], [right_m, high_m]]: [[f64; 2]; 2],
    At { stamp: timestamp, frame_id }: At<'a>,
) -> Grid<'a> {
    let n = readings.electrodes();
    let cell_m = (high_m - low_m) / n.max(1) as f64;
    let cells = readings
        .read_v()
        .zip(used.read_v())
        .zip(touch.read_v())
        .flat_map(|((read_v, used_v), touch_v)| [read_v, used_v, touch_v]);
    let data: Vec<u8> = cells.flat_map(f64::to_le_bytes).collect();
    let field = |name, offset| Field { name, offset, r#type: FLOAT64 };
    let cell_stride = 3 * size_of::<f64>();
    Grid {
        timestamp,
        frame_id,
        pose: Pose::at([right_m + cell_m, low_m, 0.0]),
        column_count: n,
        cell_size: Vector2 { x: cell_m, y: cell_m },
        row_stride: n * cell_stride,
        cell_stride,
        fields: [field("readings_v", 0), field("used_v", 8), field("touch_v", 16)],
        data: BASE64.encode(&data),
    }
}
