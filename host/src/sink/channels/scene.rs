//! Contacts and shapes as things to look at.

use std::f64::consts::TAU;

use serde::Serialize;
use tactomo_touch::solve::{FoundContact, FoundLine, FoundRing, FoundShape, Solution};

use super::{At, Pose, Stamp, Vector3};

/// How high discs stand (m).
const HEIGHT_M: f64 = 1e-3;
/// Height of the text beside a contact (m).
const TEXT_M: f64 = 3e-3;
/// Corners that a ring is drawn with.
const CORNERS: usize = 48;
/// Line types, as `foxglove.LinePrimitive` counts them.
const STRIP: u8 = 0;
const LOOP: u8 = 1;

const ORANGE: Color = Color { r: 1.0, g: 0.5, b: 0.1, a: 0.9 };
const GREY: Color = Color { r: 0.5, g: 0.5, b: 0.5, a: 0.6 };

/// A `foxglove.SceneUpdate`: what was there goes, and what was found comes.
#[derive(Debug, Serialize)]
pub(super) struct SceneUpdate<'a> {
    deletions: [Deletion; 1],
    entities: Vec<Entity<'a>>,
}

#[derive(Debug, Serialize)]
struct Deletion {
    timestamp: Stamp,
    /// 1: all of this topic.
    r#type: u8,
    id: &'static str,
}

/// A `foxglove.SceneEntity`. Lists that stay empty are there, since readers count on them.
#[derive(Debug, Serialize)]
struct Entity<'a> {
    timestamp: Stamp,
    frame_id: &'a str,
    id: String,
    lifetime: Stamp,
    frame_locked: bool,
    metadata: Vec<Pair>,
    arrows: [(); 0],
    cubes: [(); 0],
    spheres: [(); 0],
    cylinders: Vec<Cylinder>,
    lines: Vec<Line>,
    triangles: [(); 0],
    texts: Vec<Text>,
    models: [(); 0],
}

#[derive(Debug, Serialize)]
struct Pair {
    key: &'static str,
    value: String,
}

#[derive(Clone, Copy, Debug, Serialize)]
struct Color {
    r: f64,
    g: f64,
    b: f64,
    a: f64,
}

#[derive(Debug, Serialize)]
struct Cylinder {
    pose: Pose,
    size: Vector3,
    bottom_scale: f64,
    top_scale: f64,
    color: Color,
}

#[derive(Debug, Serialize)]
struct Line {
    r#type: u8,
    pose: Pose,
    thickness: f64,
    scale_invariant: bool,
    points: Vec<Vector3>,
    color: Color,
    colors: [(); 0],
    indices: [(); 0],
}

#[derive(Debug, Serialize)]
struct Text {
    pose: Pose,
    billboard: bool,
    font_size: f64,
    scale_invariant: bool,
    color: Color,
    text: String,
}

/// What was found.
pub(super) fn update<'a>(
    solution: &Solution,
    usual_radius_m: f64,
    At { stamp: timestamp, frame_id }: At<'a>,
) -> SceneUpdate<'a> {
    let entity = |id| Entity {
        timestamp,
        frame_id,
        id,
        lifetime: Stamp::of(0),
        frame_locked: true,
        metadata: Vec::new(),
        arrows: [],
        cubes: [],
        spheres: [],
        cylinders: Vec::new(),
        lines: Vec::new(),
        triangles: [],
        texts: Vec::new(),
        models: [],
    };
    // Where a shape or an image is the answer, contacts are beside it.
    let color = if solution.is_contacts() { ORANGE } else { GREY };
    let contacts = solution.contacts.iter().enumerate().map(|(index, contact)| {
        let number = contact.id.map_or_else(|| format!("unnumbered {index}"), |id| id.to_string());
        Entity {
            metadata: said(contact),
            cylinders: vec![disc(contact, usual_radius_m, color)],
            texts: contact.force_n.map(|force_n| force(contact, force_n)).into_iter().collect(),
            ..entity(format!("contact {number}"))
        }
    });
    let shape = solution.shape.as_ref().map(|shape| Entity { lines: vec![line(shape)], ..entity("shape".to_owned()) });
    let entities = contacts.chain(shape).collect();
    SceneUpdate { deletions: [Deletion { timestamp, r#type: 1, id: "" }], entities }
}

fn said(contact: &FoundContact) -> Vec<Pair> {
    let told = [("conductance_s", contact.known_conductance_s()), ("force_n", contact.force_n)];
    let pair = |(key, value): (&'static str, Option<f64>)| Some(Pair { key, value: value?.to_string() });
    told.into_iter().filter_map(pair).collect()
}

fn disc(contact: &FoundContact, usual_radius_m: f64, color: Color) -> Cylinder {
    let width_m = 2.0 * contact.radius_m.unwrap_or(usual_radius_m);
    let pose = Pose::at([contact.x_m, contact.y_m, contact.z_m + 0.5 * HEIGHT_M]);
    Cylinder { pose, size: [width_m, width_m, HEIGHT_M].into(), bottom_scale: 1.0, top_scale: 1.0, color }
}

fn force(contact: &FoundContact, force_n: f64) -> Text {
    Text {
        pose: Pose::at([contact.x_m, contact.y_m, contact.z_m + 2.0 * TEXT_M]),
        billboard: true,
        font_size: TEXT_M,
        scale_invariant: false,
        color: ORANGE,
        text: format!("{force_n:.2} N"),
    }
}

fn line(shape: &FoundShape) -> Line {
    let (r#type, points) = match shape {
        FoundShape::Line(FoundLine { from_m, to_m, .. }) => (STRIP, vec![*from_m, *to_m]),
        FoundShape::Ring(FoundRing { centre_m: [x, y], radius_m, .. }) => {
            let corner = |i: usize| {
                let (sin, cos) = (TAU * i as f64 / CORNERS as f64).sin_cos();
                [x + radius_m * cos, y + radius_m * sin]
            };
            (LOOP, (0..CORNERS).map(corner).collect())
        }
    };
    Line {
        r#type,
        pose: Pose::at([0.0; 3]),
        thickness: shape.width_m(),
        scale_invariant: false,
        points: points.into_iter().map(|[x, y]| [x, y, 0.5 * HEIGHT_M].into()).collect(),
        color: ORANGE,
        colors: [],
        indices: [],
    }
}
