//! The schemas of the channels, as JSON Schema: names and types of the fields. Those of Foxglove have the fields of its documentation that are
//! used here, and all that it requires.

use serde_json::{Map, Value, json};
use tactomo_touch::schema::{CONTACT_COLUMNS, Kind, SHAPE_COLUMNS, TOTAL_COLUMNS};

/// An object of such fields, those of which are required whose name does not end in `?`.
fn object<N: AsRef<str>>(fields: &[(N, Value)]) -> Value {
    let named = || fields.iter().map(|(name, schema)| (name.as_ref(), schema));
    let bare = |name: &str| name.trim_end_matches('?').to_owned();
    let properties: Map<_, _> = named().map(|(name, schema)| (bare(name), schema.clone())).collect();
    let required: Vec<_> = named().map(|(name, _)| name).filter(|name| !name.ends_with('?')).collect();
    json!({ "type": "object", "properties": properties, "required": required })
}

/// The same with a title.
fn titled(title: &str, fields: &[(&str, Value)]) -> Value {
    let mut schema = object(fields);
    schema["title"] = title.into();
    schema
}

fn array(items: Value) -> Value {
    json!({ "type": "array", "items": items })
}

fn number() -> Value {
    json!({ "type": "number" })
}

fn integer() -> Value {
    json!({ "type": "integer" })
}

fn text() -> Value {
    json!({ "type": "string" })
}

fn boolean() -> Value {
    json!({ "type": "boolean" })
}

fn bytes() -> Value {
    json!({ "type": "string", "contentEncoding": "base64" })
}

/// A time or a duration: the title tells Foxglove which.
fn time(title: &str) -> Value {
    titled(title, &[("sec", integer()), ("nsec", integer())])
}

fn numbers(title: &str, names: &[&str]) -> Value {
    titled(title, &names.iter().map(|name| (*name, number())).collect::<Vec<_>>())
}

fn vector3() -> Value {
    numbers("foxglove.Vector3", &["x", "y", "z"])
}

fn color() -> Value {
    numbers("foxglove.Color", &["r", "g", "b", "a"])
}

fn quaternion() -> Value {
    numbers("foxglove.Quaternion", &["x", "y", "z", "w"])
}

fn pose() -> Value {
    titled("foxglove.Pose", &[("position", vector3()), ("orientation", quaternion())])
}

fn packed_fields() -> Value {
    let fields = [("name", text()), ("offset", integer()), ("type", integer())];
    array(titled("foxglove.PackedElementField", &fields))
}

pub(super) fn point_cloud() -> Value {
    titled(
        "foxglove.PointCloud",
        &[
            ("timestamp", time("time")),
            ("frame_id", text()),
            ("pose", pose()),
            ("point_stride", integer()),
            ("fields", packed_fields()),
            ("data", bytes()),
        ],
    )
}

pub(super) fn grid() -> Value {
    titled(
        "foxglove.Grid",
        &[
            ("timestamp", time("time")),
            ("frame_id", text()),
            ("pose", pose()),
            ("column_count", integer()),
            ("cell_size", numbers("foxglove.Vector2", &["x", "y"])),
            ("row_stride", integer()),
            ("cell_stride", integer()),
            ("fields", packed_fields()),
            ("data", bytes()),
        ],
    )
}

pub(super) fn frame_transform() -> Value {
    titled(
        "foxglove.FrameTransform",
        &[
            ("timestamp", time("time")),
            ("parent_frame_id", text()),
            ("child_frame_id", text()),
            ("translation", vector3()),
            ("rotation", quaternion()),
        ],
    )
}

pub(super) fn scene_update() -> Value {
    let deletion = [("timestamp", time("time")), ("type", integer()), ("id", text())];
    let deletion = titled("foxglove.SceneEntityDeletion", &deletion);
    titled("foxglove.SceneUpdate", &[("deletions", array(deletion)), ("entities", array(scene_entity()))])
}

fn scene_entity() -> Value {
    let unused = |name: &str| array(json!({ "type": "object", "title": format!("foxglove.{name}Primitive") }));
    titled(
        "foxglove.SceneEntity",
        &[
            ("timestamp", time("time")),
            ("frame_id", text()),
            ("id", text()),
            ("lifetime", time("duration")),
            ("frame_locked", boolean()),
            ("metadata", array(titled("foxglove.KeyValuePair", &[("key", text()), ("value", text())]))),
            ("arrows", unused("Arrow")),
            ("cubes", unused("Cube")),
            ("spheres", unused("Sphere")),
            ("cylinders", array(cylinder())),
            ("lines", array(line())),
            ("triangles", unused("TriangleList")),
            ("texts", array(label())),
            ("models", unused("Model")),
        ],
    )
}

fn cylinder() -> Value {
    titled(
        "foxglove.CylinderPrimitive",
        &[
            ("pose", pose()),
            ("size", vector3()),
            ("bottom_scale", number()),
            ("top_scale", number()),
            ("color", color()),
        ],
    )
}

fn line() -> Value {
    titled(
        "foxglove.LinePrimitive",
        &[
            ("type", integer()),
            ("pose", pose()),
            ("thickness", number()),
            ("scale_invariant", boolean()),
            ("points", array(numbers("foxglove.Point3", &["x", "y", "z"]))),
            ("color", color()),
            ("colors", array(color())),
            ("indices", array(integer())),
        ],
    )
}

fn label() -> Value {
    titled(
        "foxglove.TextPrimitive",
        &[
            ("pose", pose()),
            ("billboard", boolean()),
            ("font_size", number()),
            ("scale_invariant", boolean()),
            ("color", color()),
            ("text", text()),
        ],
    )
}

/// What a line of `--stream` has without image and readings, which have channels of their own.
pub(super) fn touch() -> Value {
    let flags = ["saturated", "misfit", "unfinished", "calibrate"].map(|name| (name, boolean()));
    let flags: Vec<_> = flags.into_iter().chain([("excluded", array(integer())), ("faults", array(text()))]).collect();
    let event = ["dx_m?", "dy_m?", "held_s?", "x_m?", "y_m?"].map(|name| (name, number()));
    let event: Vec<_> = event.into_iter().chain([("kind", text())]).collect();
    titled(
        "tactomo.Touch",
        &[
            ("schema", integer()),
            ("patch?", text()),
            ("sequence", integer()),
            ("time_s", number()),
            ("arrived_unix_s", number()),
            ("host_time_ns?", integer()),
            ("host_time_error_ns?", integer()),
            ("lost_before?", integer()),
            ("missed_before?", integer()),
            ("revised?", boolean()),
            ("rezeroing?", boolean()),
            ("age_us?", number()),
            ("contacts", array(contact())),
            ("ended?", array(integer())),
            ("total?", total()),
            ("shape?", shape()),
            ("residual?", number()),
            ("certainty?", number()),
            ("alternative?", object(&[("contacts", integer()), ("certainty", number())])),
            ("flags", object(&flags)),
            ("choice?", object(&[("what", text()), ("why", text())])),
            ("events?", array(object(&event))),
        ],
    )
}

fn contact() -> Value {
    let is_always_there = |name: &str| ["x_m", "y_m"].contains(&name);
    let fields = CONTACT_COLUMNS.iter().map(|column| {
        let schema = match column.kind {
            Kind::Integer => integer(),
            Kind::Flag => boolean(),
            Kind::Number => number(),
            Kind::Word(_) => text(),
        };
        (format!("{}{}", column.name, if is_always_there(column.name) { "" } else { "?" }), schema)
    });
    object(&fields.collect::<Vec<_>>())
}

fn total() -> Value {
    object(&known_numbers(&TOTAL_COLUMNS.each_ref().map(|column| column.name.trim_start_matches("total_"))))
}

fn shape() -> Value {
    let names = SHAPE_COLUMNS.each_ref().map(|column| column.name.trim_start_matches("shape_"));
    object(&[known_numbers(&names), vec![("kind".to_owned(), text())]].concat())
}

/// Numbers that are there where they are known.
fn known_numbers(names: &[&str]) -> Vec<(String, Value)> {
    names.iter().map(|name| (format!("{name}?"), number())).collect()
}
