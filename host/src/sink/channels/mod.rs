//! What Foxglove and MCAP files get: channels of JSON, made from an event. Of several detectors, each has its own, such as `/tactomo/thumb/touch`, and
//! a frame of its own name, which is in that of the body where it has a [`Place`] there.
//!
//! | topic | schema | what |
//! |---|---|---|
//! | `/tactomo/touch` | `tactomo.Touch` | the event, as a line of `--stream` |
//! | `/tactomo/contacts` | `foxglove.SceneUpdate` | contacts as discs, a shape as a line or a ring |
//! | `/tactomo/image` | `foxglove.PointCloud` | the image: a point at each node, if the answer has one |
//! | `/tactomo/readings` | `foxglove.Grid` | the readings as measured, as they are used, and as the solver got them, 64 bits each |
//! | `/tactomo/thumb/tf` | `foxglove.FrameTransform` | where the detector is on the body, once a second, if that is told |
//!
//! The schemas of Foxglove are those of its documentation (<https://docs.foxglove.dev/docs/sdk/schemas>), in JSON, where bytes are base64.

mod packed;
mod scene;
mod schemas;

use std::io;
use std::sync::Arc;

use serde::Serialize;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::ImageMesh;

use super::feed::Delivery;
use super::lines::Fields;
use super::place::{BODY, Place};

/// What places of a detector that is alone are relative to.
const FRAME: &str = "tactomo";

/// What places of a detector are relative to, by the name that it has among several; empty if it is alone.
pub(super) fn frame_id(patch: &str) -> &str {
    if patch.is_empty() { FRAME } else { patch }
}

/// A topic of a detector, by the same name.
pub(super) fn topic(patch: &str, what: &str) -> String {
    if patch.is_empty() { format!("/tactomo/{what}") } else { format!("/tactomo/{patch}/{what}") }
}

/// A channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// The event.
    Touch,
    /// Contacts and shape.
    Contacts,
    /// The image.
    Image,
    /// The readings.
    Readings,
    /// Where the detector is on the body.
    Transform,
}

impl Channel {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Touch, Self::Contacts, Self::Image, Self::Readings, Self::Transform];

    /// What its topic ends in.
    fn name(self) -> &'static str {
        match self {
            Self::Touch => "touch",
            Self::Contacts => "contacts",
            Self::Image => "image",
            Self::Readings => "readings",
            Self::Transform => "tf",
        }
    }

    /// Name of its schema.
    pub fn schema_name(self) -> &'static str {
        match self {
            Self::Touch => "tactomo.Touch",
            Self::Contacts => "foxglove.SceneUpdate",
            Self::Image => "foxglove.PointCloud",
            Self::Readings => "foxglove.Grid",
            Self::Transform => "foxglove.FrameTransform",
        }
    }

    /// Its schema, as JSON Schema.
    pub fn schema(self) -> String {
        let schema = match self {
            Self::Touch => schemas::touch(),
            Self::Contacts => schemas::scene_update(),
            Self::Image => schemas::point_cloud(),
            Self::Readings => schemas::grid(),
            Self::Transform => schemas::frame_transform(),
        };
        schema.to_string()
    }
}

/// A channel of one of several detectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Number of the detector.
    detector: usize,
    /// What of it.
    pub channel: Channel,
}

/// Makes the messages of several detectors, or of one.
#[derive(Clone, Debug)]
pub struct Topics(Vec<Messages>);

impl Topics {
    /// Of detectors whose [names](Messages::of_patch) are different.
    pub fn new(detectors: Vec<Messages>) -> Self {
        Self(detectors)
    }

    /// All topics, in an order that stays.
    pub fn all(&self) -> impl Iterator<Item = Topic> {
        let of = |(detector, messages): (usize, &Messages)| {
            let (place, topic) = (messages.place, move |channel| Topic { detector, channel });
            let has = move |channel: &Channel| *channel != Channel::Transform || place.is_some();
            Channel::ALL.into_iter().filter(has).map(topic)
        };
        self.0.iter().enumerate().flat_map(of)
    }

    /// What a topic is called.
    pub fn name(&self, Topic { detector, channel }: Topic) -> String {
        let patch = self.0.get(detector).map_or("", |messages| &messages.patch);
        self::topic(patch, channel.name())
    }

    /// Writes the message of a topic; `false` if the event is of another detector, or has nothing for it.
    ///
    /// # Errors
    /// As of [`Messages::write`].
    pub fn write(&self, topic: Topic, delivery: &Delivery, out: &mut Vec<u8>) -> io::Result<bool> {
        match self.0.get(topic.detector).filter(|messages| messages.patch == delivery.patch) {
            Some(messages) => messages.write(topic.channel, delivery, out),
            None => Ok(false),
        }
    }
}

/// Makes the messages of a detector.
#[derive(Clone, Debug)]
pub struct Messages {
    /// Its name among several; empty if it is alone.
    patch: Arc<str>,
    /// Where it is on the body, if that is told.
    place: Option<Place>,
    mesh: ImageMesh,
    usual_radius_m: f64,
    /// Corners of what the detector takes up (m).
    bounds_m: [[f64; 2]; 2],
}

impl Messages {
    /// For a detector with images on such a mesh; contacts whose radius is not known are drawn with the usual one (m).
    pub fn new(detector: &Detector, mesh: ImageMesh, usual_radius_m: f64) -> Self {
        Self { patch: Arc::default(), place: None, mesh, usual_radius_m, bounds_m: detector.outline.bounds() }
    }

    /// The same, of one of several by this name.
    pub fn of_patch(self, name: &str) -> Self {
        Self { patch: name.into(), ..self }
    }

    /// The same, at a place on the body, if it has one there.
    pub fn at(self, place: Option<Place>) -> Self {
        Self { place, ..self }
    }

    /// Writes the message of a channel; `false` if the event has nothing for it.
    ///
    /// # Errors
    /// If memory ends, which `serde_json` cannot tell from anything else.
    pub fn write(&self, channel: Channel, delivery: &Delivery, out: &mut Vec<u8>) -> io::Result<bool> {
        let event = &*delivery.event;
        let at = At { frame_id: frame_id(&self.patch), stamp: Stamp::of(event.frame.stamp_ns()) };
        match channel {
            Channel::Touch => put(&Fields::default().of(delivery), out),
            Channel::Contacts => put(&scene::update(&event.solution, self.usual_radius_m, at), out),
            Channel::Image => match &event.solution.image_s_per_m2 {
                Some(image) if image.len() == self.mesh.nodes_m.len() => {
                    put(&packed::image(image, &self.mesh, at), out)
                }
                _ => return Ok(false),
            },
            Channel::Readings => {
                put(&packed::readings([&event.frame.measured, &event.frame.used, &event.touch], self.bounds_m, at), out)
            }
            Channel::Transform => match self.place.filter(|_| delivery.renews) {
                Some(place) => put(&FrameTransform::of(&place, at), out),
                None => return Ok(false),
            },
        }?;
        Ok(true)
    }
}

fn put(message: &impl Serialize, out: &mut Vec<u8>) -> io::Result<()> {
    Ok(serde_json::to_writer(out, message)?)
}

/// When and in which frame places are.
#[derive(Clone, Copy, Debug)]
struct At<'a> {
    frame_id: &'a str,
    stamp: Stamp,
}

/// A time, as Foxglove has it.
#[derive(Clone, Copy, Debug, Serialize)]
struct Stamp {
    sec: u64,
    nsec: u64,
}

impl Stamp {
    /// From nanoseconds since 1970 (ns).
    fn of(unix_ns: u64) -> Self {
        Self { sec: unix_ns / 1_000_000_000, nsec: unix_ns % 1_000_000_000 }
    }
}

#[derive(Clone, Copy, Debug, Serialize)]
struct Vector3 {
    x: f64,
    y: f64,
    z: f64,
}

impl From<[f64; 3]> for Vector3 {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}

#[derive(Clone, Copy, Debug, Serialize)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

#[derive(Clone, Copy, Debug, Serialize)]
struct Pose {
    position: Vector3,
    orientation: Quaternion,
}

impl Pose {
    /// At a place (m), not turned.
    fn at(place_m: [f64; 3]) -> Self {
        Self { position: place_m.into(), orientation: Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 } }
    }
}

/// A `foxglove.FrameTransform`: where the frame of a detector is.
#[derive(Clone, Copy, Debug, Serialize)]
struct FrameTransform<'a> {
    timestamp: Stamp,
    parent_frame_id: &'a str,
    child_frame_id: &'a str,
    translation: Vector3,
    rotation: Quaternion,
}

impl<'a> FrameTransform<'a> {
    fn of(place: &Place, At { frame_id, stamp }: At<'a>) -> Self {
        let [x, y, z, w] = place.rotation().coords.into();
        Self {
            timestamp: stamp,
            parent_frame_id: BODY,
            child_frame_id: frame_id,
            translation: place.xyz_m.into(),
            rotation: Quaternion { x, y, z, w },
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;
    use tactomo_touch::changes::Changes;

    use data_encoding::BASE64;
    use serde_json::Value;
    use tactomo_physics::readings::{Readings, Says};
    use tactomo_touch::solve::{FoundContact, FoundRing, FoundShape, Solution};

    use super::*;
    use crate::run::{Arrival, Frame, TouchEvent};

    fn messages() -> Messages {
        let mesh = ImageMesh { nodes_m: vec![[0.01, 0.02], [-0.01, 0.0]], ..ImageMesh::default() };
        let place = Place { xyz_m: [0.1, 0.0, -0.02], rpy_rad: [0.0, 0.0, std::f64::consts::FRAC_PI_2] };
        Messages::new(&Detector::default(), mesh, 2e-3).of_patch("thumb").at(Some(place))
    }

    fn message(channel: Channel, event: TouchEvent) -> Option<Value> {
        let arrived = Arrival::recorded(Duration::from_nanos(1_700_000_000_123_456_789));
        let event = TouchEvent { frame: Frame { arrived, ..event.frame }, ..event };
        let mut changes = Changes::default();
        changes.take(&[FoundContact { id: Some(2), ..FoundContact::default() }]);
        let delivery = Delivery::at_once(event, &mut changes);
        let mut out = Vec::new();
        messages().write(channel, &delivery, &mut out).unwrap().then(|| serde_json::from_slice(&out).unwrap())
    }

    /// Whether a value has what a schema says it has, all that it requires, and nothing that is not in it.
    fn check(value: &Value, schema: &Value, at: &str) {
        match (schema["type"].as_str().unwrap_or_else(|| panic!("{at} has a type")), value) {
            ("object", Value::Object(fields)) => {
                for (name, value) in fields {
                    check(value, &schema["properties"][name], &format!("{at}.{name}"));
                }
                for name in schema["required"].as_array().into_iter().flatten() {
                    assert!(value.get(name.as_str().unwrap()).is_some(), "{at} has {name}");
                }
            }
            ("array", Value::Array(items)) => {
                items.iter().enumerate().for_each(|(i, item)| check(item, &schema["items"], &format!("{at}[{i}]")));
            }
            ("integer", Value::Number(number)) => assert!(number.is_u64(), "{at}: {number}"),
            ("number", Value::Number(_)) | ("string", Value::String(_)) | ("boolean", Value::Bool(_)) => {}
            (kind, other) => panic!("{at} is {kind}, not {other}"),
        }
    }

    #[test]
    fn messages_are_what_their_schemas_say() {
        let ring =
            FoundRing { centre_m: [0.0; 2], radius_m: 0.01, width_m: 1e-3, conductance_s: 1.0, uncertainty: None };
        let contact = FoundContact { id: Some(3), force_n: Some(1.5), ..FoundContact::flat(0.01, 0.0, 1e-3) };
        let solution = Solution {
            contacts: vec![contact, FoundContact::flat(0.0, 0.0, 1e-3)],
            image_s_per_m2: Some(vec![0.5, 1.5]),
            residual: Some(1.0),
            certainty: Some(0.5),
            ..Solution::default()
        };
        let shaped = Solution { shape: Some(FoundShape::Ring(ring)), ..solution.clone() };
        for channel in Channel::ALL {
            let schema: Value = serde_json::from_str(&channel.schema()).unwrap();
            assert_eq!(schema["title"], channel.schema_name());
            for solution in [&solution, &shaped] {
                let message = message(channel, TouchEvent::of(9, solution.clone())).unwrap();
                check(&message, &schema, channel.name());
            }
        }
    }

    #[test]
    fn readings_are_bit_for_bit_and_what_was_not_read_is_no_number() {
        let volts = |g: usize, e: usize| 0.1 + (g * 4 + e) as f64 / 3.0;
        let says = |g: usize, e: usize| if (g, e) == (1, 2) { Says::Nothing } else { Says::Voltage };
        let readings = Readings::from_fn(4, volts).saying(says);
        let touch = Readings::from_fn(4, |g, e| volts(g, e) / 7.0);
        let used = Readings::from_fn(4, |g, e| volts(g, e).max(1.0));
        let event = TouchEvent::of(0, Solution::default());
        let event = TouchEvent { frame: Frame { measured: readings, used, ..event.frame }, touch, ..event };
        let grid = message(Channel::Readings, event).unwrap();
        let (columns, stride) = (grid["column_count"].as_u64().unwrap(), grid["cell_stride"].as_u64().unwrap());
        assert_eq!((columns, stride, grid["row_stride"].as_u64()), (4, 24, Some(96)));
        let data = BASE64.decode(grid["data"].as_str().unwrap().as_bytes()).unwrap();
        let found: Vec<f64> = data.chunks(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap())).collect();
        for (i, pair) in found.chunks(3).enumerate() {
            let (g, e) = (i / 4, i % 4);
            let is_same = if (g, e) == (1, 2) { pair[0].is_nan() } else { pair[0] == volts(g, e) };
            let others = [volts(g, e).max(1.0), volts(g, e) / 7.0];
            assert!(is_same && pair[1..] == others, "{g} {e}: {pair:?}");
        }
        assert_eq!(
            (&grid["timestamp"]["sec"], &grid["timestamp"]["nsec"]),
            (&1_700_000_000.into(), &123_456_789.into())
        );
    }

    #[test]
    fn an_image_has_its_nodes_places_and_what_has_none_sends_nothing() {
        let solution = Solution { image_s_per_m2: Some(vec![0.5, 1.5]), ..Solution::default() };
        let cloud = message(Channel::Image, TouchEvent::of(0, solution)).unwrap();
        let data = BASE64.decode(cloud["data"].as_str().unwrap().as_bytes()).unwrap();
        let found: Vec<f32> = data.chunks(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
        assert_eq!(found, [0.01, 0.02, 0.0, 0.5, -0.01, 0.0, 0.0, 1.5]);
        assert!(message(Channel::Image, TouchEvent::of(0, Solution::default())).is_none());
    }
    #[test]
    fn a_place_is_a_transform_from_the_body_and_one_that_is_not_told_has_no_channel() {
        let transform = message(Channel::Transform, TouchEvent::of(0, Solution::default())).unwrap();
        assert_eq!([&transform["parent_frame_id"], &transform["child_frame_id"]], ["body", "thumb"]);
        assert_eq!(transform["translation"], serde_json::json!({ "x": 0.1, "y": 0.0, "z": -0.02 }));
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for (name, value) in [("x", 0.0), ("y", 0.0), ("z", half), ("w", half)] {
            let found = transform["rotation"][name].as_f64().unwrap();
            assert!((found - value).abs() < 1e-12, "{name}: {found}");
        }
        let topics = Topics::new(vec![messages(), messages().of_patch("palm").at(None)]);
        let names: Vec<_> = topics.all().map(|topic| topics.name(topic)).collect();
        assert!(names.contains(&"/tactomo/thumb/tf".to_owned()) && names.len() == 9, "{names:?}");
    }
}
