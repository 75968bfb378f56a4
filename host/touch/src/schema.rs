//! What a solved frame is called outside of the program: the one schema behind JSON, CSV, NPZ and the page's socket.
//!
//! A frame is a [`FrameReport`]. Its figures are [`FRAME_COLUMNS`], those of all that touches together [`TOTAL_COLUMNS`], those of its contacts
//! [`CONTACT_COLUMNS`], those of its shape [`SHAPE_COLUMNS`]; a column that is added here is in every format. Names carry their units: `_m` metres, `_s` siemens for a conductance and seconds for a time, `_n`
//! newtons, `_v` volts, `_us` microseconds. `sigma_` is a standard error, and `force_deviation_n` that of the force. What is not known is absent in JSON, empty in CSV, and in arrays NaN, -1 of an
//! integer and false of a flag.

use serde::Serialize;
use serde::ser::Serializer;

use tactomo_physics::readings::Readings;

use crate::pointer::PointerEvent;
use crate::solve::{Alternative, Choice, Flags, FoundContact, FoundShape, Solution, Total};

mod columns;
mod csv;
mod events;
mod total;

pub use columns::{
    CONTACT_COLUMNS, ContactColumn, Kind, SHAPE_COLUMNS, ShapeColumn, contact_values, shape_values, word,
};
pub use csv::{csv_heads, csv_rows};
pub use events::{EVENT_COLUMNS, EventColumn};
pub use total::{TOTAL_COLUMNS, TotalColumn};

/// Version of a frame's JSON: it changes where a field goes or means something else, and stays where one is added.
pub const SCHEMA: u32 = 1;

/// [`SCHEMA`], as a field.
#[derive(Clone, Copy, Debug, Default)]
pub struct SchemaVersion;

impl Serialize for SchemaVersion {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u32(SCHEMA)
    }
}

/// A solved frame as it leaves the program: a line of JSON.
///
/// ```
/// use tactomo_touch::schema::FrameReport;
/// use tactomo_touch::solve::{FoundContact, Solution};
///
/// let solution = Solution { contacts: vec![FoundContact::flat(0.01, -0.005, 2e-4)], ..Solution::default() };
/// let line = serde_json::to_string(&FrameReport { time_s: Some(0.5), ..FrameReport::of(&solution) })?;
/// assert!(line.contains(r#""contacts":[{"x_m":0.01,"y_m":-0.005,"conductance_s":0.0002}]"#));
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Clone, Debug, Default, Serialize)]
pub struct FrameReport<'a> {
    /// Version of these fields.
    pub schema: SchemaVersion,
    /// The name that the detector has among several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub patch: Option<&'a str>,
    /// Number of the frame in its file, from 0; of frames from a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<u64>,
    /// The board's number of the scan; of frames from a board or its recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sequence: Option<u64>,
    /// Board time (s): since the first frame in a file, since the board's start in a stream.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// When the frame's last byte came, by the clock of the machine: seconds since 1970 (s), within half a microsecond.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arrived_unix_s: Option<f64>,
    /// When the middle of the scan was, by the clock of the machine that received it: nanoseconds since 1970 (ns); of boards that tell what their
    /// clock shows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub host_time_ns: Option<u64>,
    /// How far that is from the truth at most (ns).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub host_time_error_ns: Option<u64>,
    /// Frames lost or damaged since the one before.
    #[serde(skip_serializing_if = "is_none_or_zero")]
    pub lost_before: Option<u64>,
    /// Answers before this one that the stream lost, because whoever reads it was too slow.
    #[serde(skip_serializing_if = "is_none_or_zero")]
    pub missed_before: Option<u64>,
    /// Whether this is a better answer to the frame of the one before.
    #[serde(skip_serializing_if = "is_false")]
    pub revised: bool,
    /// Whether the baseline is being taken, so that less is known.
    #[serde(skip_serializing_if = "is_false")]
    pub rezeroing: bool,
    /// Time that the solver took (us).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame_us: Option<f64>,
    /// Age of the answer: time since the last byte of the frame arrived (us).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub age_us: Option<f64>,
    /// The contacts found: the answer, or beside the shape or image that is.
    pub contacts: &'a [FoundContact],
    /// Numbers of the contacts that were there in the answer before, and are no more.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub ended: &'a [u32],
    /// What all that touches comes to: of an image not, whose mesh is not known here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub total: Option<Total>,
    /// The shape found, if that is the answer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shape: Option<&'a FoundShape>,
    /// Root mean square of what the answer leaves of the readings, in standard deviations of the noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residual: Option<f64>,
    /// Probability that as many contacts touch as were found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certainty: Option<f64>,
    /// The likeliest other number of contacts, where it may be the right one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alternative: Option<Alternative>,
    /// What to know before this is believed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flags: Option<&'a Flags>,
    /// What was chosen and why.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub choice: Option<&'a Choice>,
    /// The image, if it is wanted: contact conductance per area at each node (S/m2).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image_s_per_m2: Option<&'a [f32]>,
    /// Readings as measured (V), if they are wanted: electrode `e` while `g` is grounded at `g n + e`; `null` where nothing was read.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "volts")]
    pub readings_v: Option<&'a Readings>,
    /// Readings as they are used (V), if they are wanted, in that order: one near an end of its converter's range is the bound there.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "volts")]
    pub used_v: Option<&'a Readings>,
    /// What the solver got (V), in that order: the mean of the last frames as far as they stood still, less the baseline.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "volts")]
    pub touch_v: Option<&'a Readings>,
    /// How many frames that is the mean of.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub averaged: Option<u32>,
    /// What the pointer did since the frame before, where a contact is one.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub events: &'a [PointerEvent],
}

fn is_false(value: &bool) -> bool {
    !value
}

/// Voltages row by row; what was not read is unknown.
fn volts<S: Serializer>(readings: &Option<&Readings>, serializer: S) -> Result<S::Ok, S::Error> {
    // What is not a number is null in JSON.
    serializer.collect_seq(readings.iter().flat_map(|readings| readings.read_v()))
}

fn is_none_or_zero(count: &Option<u64>) -> bool {
    count.is_none_or(|count| count == 0)
}

impl<'a> FrameReport<'a> {
    /// The report of a solution without its image; whoever knows them adds numbers and times.
    pub fn of(solution: &'a Solution) -> Self {
        Self {
            contacts: &solution.contacts,
            total: Total::of(solution, None),
            shape: solution.shape.as_ref(),
            residual: solution.residual,
            certainty: solution.certainty,
            alternative: solution.alternative,
            flags: Some(&solution.flags),
            choice: solution.choice.as_ref(),
            ..Self::default()
        }
    }

    fn flag(&self, of: fn(&Flags) -> bool) -> Option<bool> {
        self.flags.map(of)
    }
}

/// A figure of a frame, by its name.
pub struct FrameColumn {
    /// Name with unit.
    pub name: &'static str,
    /// What it is.
    pub of: Of,
}

/// What a figure of a frame is, in its own kind: a number of nanoseconds since 1970 has more digits than a float. `None` where it is not known.
#[derive(Clone, Copy)]
pub enum Of {
    /// A whole number.
    Integer(fn(&FrameReport) -> Option<u64>),
    /// Whether something is so.
    Flag(fn(&FrameReport) -> Option<bool>),
    /// Any number.
    Number(fn(&FrameReport) -> Option<f64>),
}

/// The figures of a frame but for its contacts and image, in the order of every format.
pub const FRAME_COLUMNS: [FrameColumn; 19] = [
    FrameColumn { name: "frame", of: Of::Integer(|frame| frame.frame) },
    FrameColumn { name: "sequence", of: Of::Integer(|frame| frame.sequence) },
    FrameColumn { name: "time_s", of: Of::Number(|frame| frame.time_s) },
    FrameColumn { name: "arrived_unix_s", of: Of::Number(|frame| frame.arrived_unix_s) },
    FrameColumn { name: "host_time_ns", of: Of::Integer(|frame| frame.host_time_ns) },
    FrameColumn { name: "host_time_error_ns", of: Of::Integer(|frame| frame.host_time_error_ns) },
    FrameColumn { name: "lost_before", of: Of::Integer(|frame| frame.lost_before) },
    FrameColumn { name: "rezeroing", of: Of::Flag(|frame| Some(frame.rezeroing)) },
    FrameColumn { name: "frame_us", of: Of::Number(|frame| frame.frame_us) },
    FrameColumn { name: "age_us", of: Of::Number(|frame| frame.age_us) },
    FrameColumn { name: "residual", of: Of::Number(|frame| frame.residual) },
    FrameColumn { name: "certainty", of: Of::Number(|frame| frame.certainty) },
    FrameColumn {
        name: "alternative_contacts",
        of: Of::Integer(|frame| frame.alternative.map(|other| other.contacts as u64)),
    },
    FrameColumn {
        name: "alternative_certainty",
        of: Of::Number(|frame| frame.alternative.map(|other| other.certainty)),
    },
    FrameColumn { name: "saturated", of: Of::Flag(|frame| frame.flag(|flags| flags.saturated)) },
    FrameColumn { name: "misfit", of: Of::Flag(|frame| frame.flag(|flags| flags.misfit)) },
    FrameColumn { name: "unfinished", of: Of::Flag(|frame| frame.flag(|flags| flags.unfinished)) },
    FrameColumn { name: "calibrate", of: Of::Flag(|frame| frame.flag(|flags| flags.calibrate)) },
    FrameColumn {
        name: "excluded_count",
        of: Of::Integer(|frame| frame.flags.map(|flags| flags.excluded.len() as u64)),
    },
];

impl FrameColumn {
    /// Its value as text; nothing if it is not known.
    fn text(&self, frame: &FrameReport) -> String {
        let text = match self.of {
            Of::Integer(of) => of(frame).map(|value| value.to_string()),
            Of::Flag(of) => of(frame).map(|value| value.to_string()),
            Of::Number(of) => of(frame).map(|value| value.to_string()),
        };
        text.unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::{Change, ElectrodeFault, FoundLine, FoundRing, LineUncertainty, RingUncertainty, Uncertainty};

    fn contact() -> FoundContact {
        FoundContact {
            id: Some(7),
            z_m: 0.5,
            apparent_conductance_s: Some(6.0),
            radius_m: Some(0.25),
            force_n: Some(3.0),
            force_deviation_n: Some(0.375),
            force_beyond_maximum: Some(true),
            depth_m: Some(0.0625),
            change: Some(Change::Move { way_m: [0.5, -0.25, 0.125] }),
            uncertainty: Some(Uncertainty { x_m: 0.125, y_m: 0.75, correlation: -0.5, conductance_s: 4.0 }),
            ..FoundContact::flat(1.0, 2.0, 8.0)
        }
    }

    fn solution() -> Solution {
        Solution {
            contacts: vec![contact(), FoundContact::flat(-1.0, -2.0, 5.0)],
            residual: Some(1.5),
            flags: Flags {
                misfit: true,
                excluded: vec![3, 14],
                faults: vec![ElectrodeFault::Open, ElectrodeFault::Contradicting],
                ..Flags::default()
            },
            choice: Some(Choice { what: "2 contacts".to_owned(), why: "they fit".to_owned() }),
            ..Solution::default()
        }
    }

    #[test]
    fn names_are_unique() {
        let heads = csv_heads();
        assert!(heads.iter().all(|head| heads.iter().filter(|other| *other == head).count() == 1), "{heads:?}");
    }

    #[test]
    fn json_csv_and_binary_say_the_same_of_a_contact() {
        let json = serde_json::to_value(contact()).unwrap();
        let solution = solution();
        let rows = csv_rows(&FrameReport::of(&solution));
        let heads = csv_heads();
        for (index, column) in CONTACT_COLUMNS.iter().enumerate() {
            let value = column.value(&contact()).unwrap();
            let flag = json[column.name].as_bool().map(f64::from);
            let number = json[column.name].as_f64().or(flag);
            match column.kind {
                Kind::Word(words) => assert_eq!(json[column.name], words[value as usize]),
                _ => assert_eq!(number, Some(value), "{}", column.name),
            }
            let cell = heads.iter().position(|head| *head == column.name).unwrap();
            assert_eq!(rows[0][cell], column.kind.text(Some(value)), "{}", column.name);
            if index > 0 {
                assert_eq!(contact_values(&contact())[index - 1], value as f32, "{}", column.name);
            }
        }
        assert!(json["id"].is_u64() && json["force_beyond_maximum"].is_boolean(), "{json}");
        assert_eq!(json.as_object().map(serde_json::Map::len), Some(CONTACT_COLUMNS.len()));
    }

    #[test]
    fn a_shape_is_an_object_and_columns_of_its_frame() {
        let uncertainty = Some(LineUncertainty { from_m: [0.1; 2], to_m: [0.2; 2], width_m: 0.3, conductance_s: 0.4 });
        let line = FoundLine { from_m: [1.0, 2.0], to_m: [3.0, 4.0], width_m: 5.0, conductance_s: 6.0, uncertainty };
        let ring =
            FoundRing { centre_m: [1.0, 2.0], radius_m: 3.0, width_m: 4.0, conductance_s: 5.0, uncertainty: None };
        let json = serde_json::to_value(FoundShape::Ring(ring)).unwrap();
        let known = serde_json::json!({
            "kind": "ring", "x_m": 1.0, "y_m": 2.0, "radius_m": 3.0, "width_m": 4.0, "conductance_s": 5.0
        });
        assert_eq!(json, known);
        let solution = Solution { shape: Some(FoundShape::Line(line)), ..solution() };
        let json = serde_json::to_value(FrameReport::of(&solution)).unwrap();
        let (heads, rows) = (csv_heads(), csv_rows(&FrameReport::of(&solution)));
        for column in &SHAPE_COLUMNS {
            let value = column.value(&FoundShape::Line(line));
            let name = column.name.trim_start_matches("shape_");
            assert_eq!(json["shape"].get(name).and_then(serde_json::Value::as_f64), value, "{name}");
            let cell = heads.iter().position(|head| *head == column.name).unwrap();
            assert_eq!(rows[1][cell].parse().ok(), value, "{name}");
        }
        assert_eq!(json["shape"].as_object().map(serde_json::Map::len), Some(13));
        let values = shape_values(&FoundShape::Line(line));
        assert!(values[0] == 1.0 && values[4].is_nan() && values[17] == 0.4, "{values:?}");
    }

    #[test]
    fn what_its_numbers_say_is_the_whole_of_a_contact_and_of_a_shape() {
        let new = FoundContact { change: Some(Change::Start), ..contact() };
        for contact in [contact(), new, FoundContact::flat(-1.0, -2.0, 5.0)] {
            let values = CONTACT_COLUMNS.each_ref().map(|column| column.value(&contact));
            assert_eq!(FoundContact::of_values(values), contact);
        }
        let line = LineUncertainty { from_m: [0.1, 0.2], to_m: [0.3, 0.4], width_m: 0.5, conductance_s: 0.6 };
        let line = FoundLine { from_m: [1.0, 2.0], to_m: [3.0, 4.0], uncertainty: Some(line), ..FoundLine::default() };
        let ring = RingUncertainty { centre_m: [0.1, 0.2], radius_m: 0.3, width_m: 0.4, conductance_s: 0.5 };
        let ring = FoundRing { centre_m: [1.0, 2.0], radius_m: 3.0, uncertainty: Some(ring), ..FoundRing::default() };
        let unsure = FoundShape::Ring(FoundRing { uncertainty: None, width_m: 4.0, conductance_s: 5.0, ..ring });
        for shape in [FoundShape::Line(line), FoundShape::Ring(ring), unsure] {
            let values = SHAPE_COLUMNS.each_ref().map(|column| column.value(&shape));
            assert_eq!(FoundShape::of_values(values), Some(shape));
        }
        assert_eq!(FoundShape::of_values([None; SHAPE_COLUMNS.len()]), None);
    }

    #[test]
    fn what_is_not_known_is_absent() {
        let flat = FoundContact::flat(1.0, 2.0, 8.0);
        assert_eq!(serde_json::to_string(&flat).unwrap(), r#"{"x_m":1.0,"y_m":2.0,"conductance_s":8.0}"#);
        assert!(contact_values(&flat)[4..].iter().all(|value| value.is_nan()));
        let nothing = Solution::default();
        let rows = csv_rows(&FrameReport::of(&nothing));
        assert_eq!((rows.len(), rows[0].len()), (1, csv_heads().len()));
        assert!(rows[0][FRAME_COLUMNS.len()..].iter().all(String::is_empty), "{rows:?}");
        let at = |name: &str| csv_heads().iter().position(|head| *head == name).unwrap();
        assert_eq!(
            [&rows[0][at("misfit")], &rows[0][at("excluded_count")], &rows[0][at("sequence")]],
            ["false", "0", ""]
        );
    }

    #[test]
    fn a_frame_is_a_line_of_json() {
        let solution = solution();
        let report = FrameReport {
            sequence: Some(9),
            time_s: Some(0.5),
            lost_before: Some(3),
            age_us: Some(40.0),
            ..FrameReport::of(&solution)
        };
        let json = serde_json::to_value(report).unwrap();
        assert_eq!((json["sequence"].as_u64(), json["lost_before"].as_u64()), (Some(9), Some(3)));
        assert_eq!((json["time_s"].as_f64(), json["age_us"].as_f64()), (Some(0.5), Some(40.0)));
        assert_eq!(json["flags"]["excluded"], serde_json::json!([3, 14]));
        let names = solution.flags.faults.iter().map(|fault| fault.name()).collect::<Vec<_>>();
        assert_eq!(json["flags"]["faults"], serde_json::json!(names));
        assert_eq!(json["choice"]["what"], "2 contacts");
        assert_eq!(json["contacts"].as_array().map(Vec::len), Some(2));
        let total = serde_json::json!({"conductance_s": 11.0, "x_m": 1.0 / 11.0, "y_m": 2.0 / 11.0, "z_m": 3.0 / 11.0});
        assert_eq!(json["total"], total);
        assert!(["image_s_per_m2", "frame", "shape", "events"].iter().all(|name| json.get(name).is_none()));
        let events = [PointerEvent::Press, PointerEvent::Move { dx_m: 0.5, dy_m: -0.25 }];
        let report = FrameReport {
            events: &events,
            arrived_unix_s: Some(1.79e9),
            host_time_ns: Some(1_795_356_721_248_139_205),
            ..FrameReport::of(&solution)
        };
        let rows = csv_rows(&report);
        let gestures = r#"[{"kind":"press"},{"kind":"move","dx_m":0.5,"dy_m":-0.25}]"#;
        assert_eq!(rows[1][csv_heads().len() - 3..], ["3 14", "2 contacts", gestures]);
        let at = |name: &str| csv_heads().iter().position(|head| *head == name).unwrap();
        assert_eq!([&rows[1][at("arrived_unix_s")], &rows[1][at("misfit")]], ["1790000000", "true"]);
        assert_eq!(rows[1][at("host_time_ns")], "1795356721248139205", "no float has so many digits");
        let values = |event: &PointerEvent| EVENT_COLUMNS.each_ref().map(|column| column.value(event));
        assert_eq!(values(&events[0]), [Some(1.0), None, None, None, None, None]);
        assert_eq!(values(&events[1]), [Some(0.0), Some(0.5), Some(-0.25), None, None, None]);
        assert_eq!(values(&PointerEvent::Release { held_s: 2.0 })[3], Some(2.0));
        assert_eq!(values(&PointerEvent::Click { x_m: 3.0, y_m: 4.0 })[4..], [Some(3.0), Some(4.0)]);
    }
}
