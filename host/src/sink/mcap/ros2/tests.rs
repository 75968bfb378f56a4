//! Messages read back by their definitions, by a reader that knows nothing of what wrote them; and one byte by byte.

use std::collections::BTreeMap;
use std::time::Duration;

use tactomo_physics::detector::{ForceLaw, Surface};
use tactomo_physics::readings::{Readings, Says};
use tactomo_touch::changes::Changes;
use tactomo_touch::schema::CONTACT_COLUMNS;
use tactomo_touch::solve::{Choice, ElectrodeFault, Flags, FoundContact, FoundLine, FoundShape, Solution, Uncertainty};

use super::*;
use crate::run::{Arrival, Frame, TouchEvent};

/// What a message has, by the path of each field: numbers, and texts.
type Fields = BTreeMap<String, Value>;

#[derive(Clone, Debug, PartialEq)]
enum Value {
    Number(f64),
    Text(String),
}

/// A message that is being read, by a schema's definitions.
struct Reader<'a> {
    definitions: BTreeMap<&'a str, &'a str>,
    bytes: &'a [u8],
    at: usize,
    fields: Fields,
}

/// All fields of a message of a type; it has to have nothing else.
fn read(schema: &str, bytes: &[u8]) -> Fields {
    let rule = format!("\n{}\nMSG: ", "=".repeat(80));
    let mut parts = schema.split(rule.as_str());
    let first = parts.next().unwrap();
    let named = |part: &str| part.split_once('\n').map(|(name, _)| name.len()).unwrap();
    let definitions = parts.map(|part| part.split_at(named(part))).collect();
    assert_eq!(bytes[..4], [0, 1, 0, 0], "CDR, little-endian");
    let mut reader = Reader { definitions, bytes: &bytes[4..], at: 0, fields: Fields::new() };
    reader.message(first, "");
    assert_eq!(reader.at, reader.bytes.len(), "nothing is left of {bytes:?}");
    reader.fields
}

impl<'a> Reader<'a> {
    fn message(&mut self, definition: &'a str, path: &str) {
        let lines = definition.lines().map(|line| line.split('#').next().unwrap().trim());
        for line in lines.filter(|line| !line.is_empty() && !line.contains('=')) {
            let (r#type, name) = line.split_once(' ').unwrap();
            self.field(r#type, &format!("{path}{name}"));
        }
    }

    fn field(&mut self, r#type: &str, path: &str) {
        if let Some(item) = r#type.strip_suffix("[]") {
            let count = self.number("uint32") as usize;
            self.fields.insert(format!("{path}.count"), Value::Number(count as f64));
            (0..count).for_each(|index| self.field(item, &format!("{path}[{index}]")));
        } else if r#type == "string" {
            let length = self.number("uint32") as usize;
            let (text, end) = self.bytes[self.at..self.at + length].split_at(length - 1);
            assert_eq!(end, [0]);
            self.at += length;
            self.fields.insert(path.to_owned(), Value::Text(String::from_utf8(text.to_vec()).unwrap()));
        } else if r#type.chars().next().unwrap().is_lowercase() && !r#type.contains('/') {
            let number = self.number(r#type);
            self.fields.insert(path.to_owned(), Value::Number(number));
        } else {
            // A name without a package is of the same package.
            let name = if r#type.contains('/') { r#type.to_owned() } else { format!("tactomo_msgs/{}", r#type) };
            let definition = self.definitions.get(name.as_str()).copied().unwrap_or_else(|| panic!("{name}"));
            self.message(definition, &format!("{path}."));
        }
    }

    fn number(&mut self, r#type: &str) -> f64 {
        let size = match r#type {
            "bool" | "uint8" => 1,
            "uint16" => 2,
            "int32" | "uint32" => 4,
            "int64" | "uint64" | "float64" => 8,
            other => panic!("{other}"),
        };
        self.at = self.at.div_ceil(size) * size;
        let mut bytes = [0; 8];
        bytes[..size].copy_from_slice(&self.bytes[self.at..self.at + size]);
        self.at += size;
        let number = u64::from_le_bytes(bytes);
        match r#type {
            "float64" => f64::from_bits(number),
            "int64" => number.cast_signed() as f64,
            "int32" => f64::from((number as u32).cast_signed()),
            _ => number as f64,
        }
    }
}

fn event(solution: Solution) -> TouchEvent {
    let arrived = Arrival::recorded(Duration::from_nanos(1_700_000_000_123_456_789));
    let event = TouchEvent::of(7, solution);
    TouchEvent { frame: Frame { arrived, ..event.frame }, ..event }
}

fn delivery(solution: Solution) -> Delivery {
    let mut changes = Changes::default();
    changes.take(&[3, 5].map(|id| FoundContact { id: Some(id), ..FoundContact::flat(0.0, 0.0, 1.0) }));
    Delivery { lost_before: 4, ..Delivery::at_once(event(solution), &mut changes) }
}

fn fields(topic: Topic, delivery: &Delivery, detector: &Detector) -> Option<Fields> {
    let (.., schema) = topic.described();
    topic.message(delivery, detector).map(|message| read(&schema, message.bytes()))
}

fn number(fields: &Fields, path: &str) -> f64 {
    match fields.get(path) {
        Some(Value::Number(number)) => *number,
        other => panic!("{path}: {other:?} in {fields:?}"),
    }
}

fn text<'a>(fields: &'a Fields, path: &str) -> &'a str {
    match fields.get(path) {
        Some(Value::Text(text)) => text,
        other => panic!("{path}: {other:?} in {fields:?}"),
    }
}

/// A numbered contact with newtons and standard errors, and one of which only the place is known.
fn two() -> Solution {
    let uncertainty = Uncertainty { x_m: 1e-4, y_m: 2e-4, correlation: 0.5, conductance_s: 1e-5 };
    let known = FoundContact {
        id: Some(3),
        force_n: Some(2.0),
        radius_m: Some(0.003),
        uncertainty: Some(uncertainty),
        ..FoundContact::flat(0.01, -0.02, 1e-3)
    };
    let flags =
        Flags { misfit: true, excluded: vec![1, 15], faults: vec![ElectrodeFault::Open; 2], ..Flags::default() };
    Solution {
        contacts: vec![known, FoundContact::flat(0.0, 0.005, 0.0)],
        flags,
        residual: Some(1.5),
        choice: Some(Choice { what: "2 contacts".to_owned(), why: String::new() }),
        ..Solution::default()
    }
}

#[test]
fn contacts_have_all_that_every_output_has() {
    let found = fields(Topic::Contacts, &delivery(two()), &Detector::default()).unwrap();
    let header = ["header.stamp.sec", "header.stamp.nanosec"].map(|path| number(&found, path));
    assert_eq!((header, text(&found, "header.frame_id")), ([1.7e9, 123_456_789.0], "tactomo"));
    let names = ["sequence", "time_s", "lost_before", "rezeroing", "contacts.count", "ended.count", "ended[0]"];
    assert_eq!(names.map(|name| number(&found, name)), [7.0, 0.007, 4.0, 0.0, 2.0, 1.0, 5.0]);
    let delivery = delivery(two());
    for (index, contact) in delivery.changed.contacts.iter().enumerate() {
        for column in &CONTACT_COLUMNS {
            let value = number(&found, &format!("contacts[{index}].{}", column.name));
            let unknown = match column.name {
                "id" => -1.0,
                "state" => 255.0,
                "force_beyond_maximum" => 0.0,
                _ => f64::NAN,
            };
            let expected = column.value(contact).unwrap_or(unknown);
            assert_eq!(value.to_bits(), expected.to_bits(), "{index} {}", column.name);
        }
    }
    let of_one = found.keys().filter(|name| name.starts_with("contacts[0].")).count();
    assert_eq!(of_one, CONTACT_COLUMNS.len());
    assert!(number(&found, "residual") == 1.5 && number(&found, "certainty").is_nan());
    let flags = ["saturated", "misfit", "unfinished", "calibrate", "excluded[0]", "excluded[1]"];
    assert_eq!(flags.map(|name| number(&found, name)), [0.0, 1.0, 0.0, 0.0, 1.0, 15.0]);
    assert_eq!(["faults[0]", "faults[1]", "choice"].map(|name| text(&found, name)), ["open", "open", "2 contacts"]);
}

#[test]
fn points_are_as_many_as_contacts_with_their_fields_in_each() {
    let found = fields(Topic::Points, &delivery(two()), &Detector::default()).unwrap();
    let names = ["height", "width", "point_step", "row_step", "data.count", "is_bigendian", "is_dense"];
    assert_eq!(names.map(|name| number(&found, name)), [1.0, 2.0, 28.0, 56.0, 56.0, 0.0, 1.0]);
    let bytes: Vec<u8> = (0..56).map(|i| number(&found, &format!("data[{i}]")) as u8).collect();
    let value = |point: usize, field: usize| {
        let at = 28 * point + number(&found, &format!("fields[{field}].offset")) as usize;
        let bytes = bytes[at..at + 4].try_into().unwrap();
        match number(&found, &format!("fields[{field}].datatype")) {
            7.0 => f64::from(f32::from_le_bytes(bytes)),
            5.0 => f64::from(i32::from_le_bytes(bytes)),
            other => panic!("{other}"),
        }
    };
    let named: Vec<_> = (0..7).map(|field| text(&found, &format!("fields[{field}].name"))).collect();
    assert_eq!(named, ["x", "y", "z", "force_n", "conductance_s", "radius_m", "id"]);
    let points = [0, 1].map(|point| std::array::from_fn::<_, 7, _>(|field| value(point, field)));
    let close = |found: f64, expected: f64| (found - expected).abs() < 1e-7 || found.is_nan() && expected.is_nan();
    let expected = [[0.01, -0.02, 0.0, 2.0, 1e-3, 0.003, 3.0], [0.0, 0.005, 0.0, f64::NAN, f64::NAN, f64::NAN, -1.0]];
    let pairs = points.iter().flatten().zip(expected.iter().flatten());
    assert!(pairs.clone().all(|(found, expected)| close(*found, *expected)), "{points:?}");
}

#[test]
fn a_wrench_is_that_of_all_contacts_and_only_where_forces_are_known() {
    let axes = ["force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z"];
    let of = |solution: Solution, detector: &Detector| {
        let found = fields(Topic::Wrench, &delivery(solution), detector)?;
        Some(axes.map(|axis| number(&found, &format!("wrench.{axis}"))))
    };
    let flat = Detector::default();
    assert_eq!(of(two(), &flat), None, "one force is not known");
    assert_eq!(of(Solution::default(), &flat), None, "nothing is known without a law of force");
    let known = Detector { force: Some(ForceLaw::siemens()), ..Detector::default() };
    assert_eq!(of(Solution::default(), &known), Some([0.0; 6]));
    let press = |place_m: [f64; 3], force_n| {
        let [x_m, y_m, z_m] = place_m;
        FoundContact { x_m, y_m, z_m, force_n: Some(force_n), ..FoundContact::flat(0.0, 0.0, 1e-3) }
    };
    let contacts = vec![press([0.01, -0.02, 0.0], 2.0), press([0.0, 0.01, 0.0], 1.0)];
    let [.., fz, tx, ty, tz] = of(Solution { contacts, ..Solution::default() }, &flat).unwrap();
    assert!(fz == -3.0 && (tx - 0.03).abs() < 1e-12 && (ty - 0.02).abs() < 1e-12 && tz == 0.0, "{fz} {tx} {ty} {tz}");
    let line = FoundLine { from_m: [0.0; 2], to_m: [0.01; 2], width_m: 1e-3, conductance_s: 1e-3, uncertainty: None };
    let shape = Some(FoundShape::Line(line));
    assert_eq!(of(Solution { contacts: vec![press([0.0; 3], 1.0)], shape, ..Solution::default() }, &known), None);

    // On a roof that looks up and along x, a press is down and back.
    let roof = "v 0 0 0.02\nv 0.02 -0.02 0\nv 0.02 0.02 0\nf 1 2 3\n";
    let roof = Detector { surface: Some(Surface::parse(roof.as_bytes(), "roof.obj", "m").unwrap()), ..known };
    let contacts = vec![press([0.015, 0.0, 0.005], 2.0)];
    let found = of(Solution { contacts, ..Solution::default() }, &roof).unwrap();
    let along = 2.0_f64.sqrt();
    let expected = [-along, 0.0, -along, 0.0, 0.01 * along, 0.0];
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
}

#[test]
fn readings_are_bit_for_bit() {
    let says = |g: usize, e: usize| if (g, e) == (1, 2) { Says::Nothing } else { Says::Voltage };
    let readings = Readings::from_fn(4, |g, e| (g * 4 + e) as f64 / 3.0).saying(says);
    let mut delivery = delivery(Solution::default());
    let event = (*delivery.event).clone();
    let frame = Frame { measured: readings.clone(), ..event.frame };
    delivery.event = TouchEvent { frame, averaged: 9, ..event }.into();
    let found = fields(Topic::Frame, &delivery, &Detector::default()).unwrap();
    assert_eq!(["electrodes", "averaged", "touch_v.count"].map(|name| number(&found, name)), [4.0, 9.0, 16.0]);
    for (i, volts) in readings.read_v().enumerate() {
        assert_eq!(number(&found, &format!("readings_v[{i}]")).to_bits(), volts.to_bits());
    }
    assert!(number(&found, "readings_v[6]").is_nan() && number(&found, "used_v[6]") == 0.1 * 3.0);
}

#[test]
fn a_message_is_these_bytes() {
    let known = FoundContact { force_n: Some(1.0), ..FoundContact::flat(0.5, 0.25, 1e-3) };
    let solution = Solution { contacts: vec![known], ..Solution::default() };
    let message = Topic::Wrench.message(&delivery(solution), &Detector::default()).unwrap();
    let number = |value: f64| value.to_le_bytes();
    let expected: Vec<u8> = [
        &[0, 1, 0, 0][..],
        // 1 700 000 000 s and 123 456 789 ns.
        &[0x00, 0xf1, 0x53, 0x65, 0x15, 0xcd, 0x5b, 0x07],
        // Eight bytes with the zero, which the next number is aligned after: 20 bytes so far, so 4 more.
        &[8, 0, 0, 0, b't', b'a', b'c', b't', b'o', b'm', b'o', 0, 0, 0, 0, 0],
        &[number(0.0), number(0.0), number(-1.0), number(-0.25), number(0.5), number(0.0)].concat(),
    ]
    .concat();
    assert_eq!(message.bytes(), expected);
}

#[test]
fn a_file_has_the_topics_of_its_profile() {
    let mut bytes = Vec::new();
    let detectors = vec![(Arc::default(), Detector::default())];
    let mut file = Ros2File::new(&mut bytes, detectors, &BTreeMap::new()).unwrap();
    file.write(&delivery(two())).unwrap();
    file.finish().unwrap();
    // The header's profile, behind the magic and the record's opcode and length.
    assert_eq!(bytes[17..25], [4, 0, 0, 0, b'r', b'o', b's', b'2']);
}

#[test]
fn topics_are_called_as_ros_2_has_names() {
    let names = ["", "thumb", "board-1", "2nd", "_x", "a b"].map(name);
    assert_eq!(names, ["", "thumb", "board_1", "patch_2nd", "patch__x", "a_b"]);
}

#[test]
fn places_are_in_the_frame_of_their_detector() {
    let of_thumb = Delivery { patch: "thumb-1".into(), ..delivery(two()) };
    for topic in [Topic::Points, Topic::Contacts, Topic::Frame] {
        let found = fields(topic, &of_thumb, &Detector::default()).unwrap();
        assert_eq!(text(&found, "header.frame_id"), "thumb-1");
    }
}
