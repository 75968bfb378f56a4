//! Updates: the newest answered frame, in bytes.
//!
//! What is in them stands in the tables below, once: the program writes by them, and the page reads by their names, which come with the
//! [setup](super::wire) as its [`Layout`]. All numbers are little-endian. What is not known is not a number.
//!
//! | bytes | what |
//! |---|---|
//! | u32 each | the [words](WORDS) |
//! | u32 each | lengths of the [arrays](ARRAYS), then how many contacts there are |
//! | f32 each | the [numbers](NUMBERS) |
//! | f32 each | the arrays, one after the other |
//! | u32, then f32 each | of each contact its number from frame to frame, 0 if it has none; then its [numbers](contact_names) |
//! | f32 each | with a shape: its [columns](SHAPE_COLUMNS); then the contacts are beside it |
//! | the rest | UTF-8: what was chosen, a line feed, why; nothing if the solver does not choose |

use std::time::Instant;

use serde::Serialize;
use tactomo_physics::detector::Detector;
use tactomo_touch::pointer::PointerState;
use tactomo_touch::schema::{CONTACT_COLUMNS, SHAPE_COLUMNS, contact_values, shape_values};
use tactomo_touch::solve::{ElectrodeFault, Flags, FoundContact, Total};

use crate::run::TouchEvent;

/// What an update is made of.
pub(super) struct Shown<'a> {
    pub answer: &'a TouchEvent,
    /// Its contacts, with what they have done since the update before.
    pub contacts: &'a [FoundContact],
    /// Frames received so far.
    pub frames: u64,
    /// Points of the [course](crate::run::course) of the readings (V) since the update before, 4 ms each.
    pub course_v: &'a [f32],
    pub detector: &'a Detector,
    /// What all that touches comes to, if anything does.
    pub total: Option<Total>,
}

/// What has a name and is read from what is shown.
struct Named<T> {
    name: &'static str,
    of: fn(&Shown) -> T,
}

const fn named<T>(name: &'static str, of: fn(&Shown) -> T) -> Named<T> {
    Named { name, of }
}

/// Whole numbers; counts, and the board's time in the middle of the frame's scan, are modulo 2^32. The shape is 0 for none, or the number of its [name](SHAPES) from 1 on; flags are bits, the first of
/// [`FLAGS`] the lowest; electrodes are bits too: bit `e` is electrode `e`.
const WORDS: [Named<u32>; 8] = [
    named("sequence", |shown| shown.answer.frame.sequence as u32),
    named("frames", |shown| shown.frames as u32),
    named("time_ms", |shown| (1e3 * shown.answer.frame.time_s()).round() as u64 as u32),
    named("electrodes", |shown| shown.answer.frame.measured.electrodes() as u32),
    named("shape", |shown| {
        let name = shown.answer.solution.shape.as_ref().map(|shape| shape.name());
        SHAPES.iter().position(|known| Some(*known) == name).map_or(0, |index| index as u32 + 1)
    }),
    named("flags", |shown| {
        let flags = &shown.answer.solution.flags;
        FLAGS.iter().enumerate().map(|(bit, (_, is_set))| u32::from(is_set(flags)) << bit).sum::<u32>()
    }),
    named("excluded", |shown| bits(shown.answer.solution.flags.excluded.iter())),
    named("exchanged", |shown| {
        let Flags { excluded, faults, .. } = &shown.answer.solution.flags;
        let exchanged = excluded.iter().zip(faults).filter(|(_, fault)| **fault == ElectrodeFault::Exchanged);
        bits(exchanged.map(|(electrode, _)| electrode))
    }),
];

/// Residual of the readings: root mean square, in standard deviations of the noise. How sure the number of contacts is, and the likeliest other one. Age of the answer when this is sent: since the last byte of
/// its frame came. What all that touches comes to, and its middle on the map. The pointer: sum of its motion, 1 while it is pressed, clicks so far; not numbers if no contact is one.
const NUMBERS: [Named<f32>; 14] = [
    named("residual", |shown| known(shown.answer.solution.residual)),
    named("certainty", |shown| known(shown.answer.solution.certainty)),
    named("other_contacts", |shown| {
        known(shown.answer.solution.alternative.map(|alternative| alternative.contacts as f64))
    }),
    named("age_s", |shown| known(shown.answer.frame.arrived.age(Instant::now()).map(|age| age.as_secs_f64()))),
    named("total_force_n", |shown| known(shown.total.and_then(|total| total.force_n))),
    named("total_s", |shown| known(shown.total.map(|total| total.conductance_s))),
    named("centre_x_m", |shown| known(shown.total.map(|total| shown.detector.map_m(total.centre_m)[0]))),
    named("centre_y_m", |shown| known(shown.total.map(|total| shown.detector.map_m(total.centre_m)[1]))),
    named("pointer_x_m", |shown| pointer(shown, |state| state.way_m[0])),
    named("pointer_y_m", |shown| pointer(shown, |state| state.way_m[1])),
    named("pointer_pressed", |shown| pointer(shown, |state| f64::from(u8::from(state.is_pressed)))),
    named("pointer_clicks", |shown| pointer(shown, |state| state.clicks as f64)),
    named("floor_v", |shown| known(shown.answer.beneath.map(|beneath| beneath.floor_v))),
    named("above_floor", |shown| known(shown.answer.beneath.map(|beneath| f64::from(u8::from(beneath.is_pressed))))),
];

/// The image: contact conductance per area at each node, none if the solver makes no image. The readings as measured, electrode `e` under ground
/// `g` at `g n + e`. The course of the readings.
const ARRAYS: [Named<Vec<f32>>; 3] = [
    named("image_s_per_m2", |shown| shown.answer.solution.image_s_per_m2.as_deref().unwrap_or_default().to_vec()),
    named("readings_v", |shown| shown.answer.frame.measured.volts().iter().map(|&volt| volt as f32).collect()),
    named("course_v", |shown| shown.course_v.to_vec()),
];

/// Name of a flag, and whether it is set.
type Flag = (&'static str, fn(&Flags) -> bool);

/// Flags of a solution.
const FLAGS: [Flag; 4] = [
    ("saturated", |flags| flags.saturated),
    ("misfit", |flags| flags.misfit),
    ("unfinished", |flags| flags.unfinished),
    ("calibrate", |flags| flags.calibrate),
];

/// Names of shapes.
const SHAPES: [&str; 2] = ["line", "ring"];

/// Place of a contact on the map (m), which is that in space on a flat detector.
const MAP: [&str; 2] = ["map_x_m", "map_y_m"];

/// The names of what is in an update, in its order.
#[derive(Serialize)]
pub(super) struct Layout {
    words: Vec<&'static str>,
    numbers: Vec<&'static str>,
    arrays: Vec<&'static str>,
    contact: Vec<&'static str>,
    shape: Vec<&'static str>,
    flags: Vec<&'static str>,
    shapes: [&'static str; SHAPES.len()],
}

/// The layout of updates.
pub(super) fn layout() -> Layout {
    Layout {
        words: WORDS.iter().map(|word| word.name).collect(),
        numbers: NUMBERS.iter().map(|number| number.name).collect(),
        arrays: ARRAYS.iter().map(|array| array.name).collect(),
        contact: contact_names().collect(),
        shape: SHAPE_COLUMNS.iter().map(|column| column.name).collect(),
        flags: FLAGS.iter().map(|(name, _)| *name).collect(),
        shapes: SHAPES,
    }
}

/// Numbers of a contact: its columns after the id, and its place on the map.
fn contact_names() -> impl Iterator<Item = &'static str> {
    CONTACT_COLUMNS.iter().skip(1).map(|column| column.name).chain(MAP)
}

/// An update.
pub(super) fn update(shown: &Shown) -> Vec<u8> {
    let solution = &shown.answer.solution;
    let arrays = ARRAYS.map(|array| (array.of)(shown));
    let lengths = arrays.iter().map(|array| array.len()).chain([solution.contacts.len()]);
    let words = WORDS.iter().map(|word| (word.of)(shown)).chain(lengths.map(|length| length as u32));
    let numbers = NUMBERS.iter().map(|number| (number.of)(shown));
    let numbers = numbers.chain(arrays.iter().flat_map(|array| array.iter().copied()));
    let mut bytes: Vec<u8> = words.flat_map(u32::to_le_bytes).chain(numbers.flat_map(f32::to_le_bytes)).collect();
    for found in shown.contacts {
        bytes.extend(found.id.unwrap_or(0).to_le_bytes());
        bytes.extend(contact(found, shown.detector).flat_map(f32::to_le_bytes));
    }
    if let Some(shape) = &solution.shape {
        bytes.extend(shape_values(shape).into_iter().flat_map(f32::to_le_bytes));
    }
    if let Some(choice) = &solution.choice {
        bytes.extend([choice.what.as_bytes(), b"\n", choice.why.as_bytes()].concat());
    }
    bytes
}

/// In the order of [`contact_names`].
fn contact(found: &FoundContact, detector: &Detector) -> impl Iterator<Item = f32> + use<> {
    // Errors in space are not those on the flat map of a curved detector.
    let uncertainty = found.uncertainty.filter(|_| detector.surface.is_none());
    let map_m = detector.map_m([found.x_m, found.y_m, found.z_m]).map(|metres| metres as f32);
    contact_values(&FoundContact { uncertainty, ..*found }).into_iter().chain(map_m)
}

fn pointer(shown: &Shown, of: fn(&PointerState) -> f64) -> f32 {
    known(shown.answer.pointer.as_ref().map(of))
}

fn bits<'a>(electrodes: impl Iterator<Item = &'a usize>) -> u32 {
    electrodes.map(|e| 1_u32.checked_shl(*e as u32).unwrap_or_default()).fold(0, |all, bit| all | bit)
}

fn known(value: Option<f64>) -> f32 {
    value.map_or(f32::NAN, |value| value as f32)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::run::{Arrival, Frame};
    use tactomo_physics::readings::Readings;
    use tactomo_touch::solve::{Alternative, Change, Choice, FoundLine, FoundRing, FoundShape, Solution, Uncertainty};

    fn bytes_of(solution: Solution) -> Vec<u8> {
        let readings = Readings::from_fn(2, |g, e| (2 * g + e) as f64);
        let first = Frame::first(readings.clone(), readings.clone(), Arrival::at(Instant::now()));
        let frame = Frame { sequence: (7 << 32) + 9, board_time_us: 2_500_400, ..first };
        let pointer = Some(PointerState { way_m: [0.5, -0.25], is_pressed: true, clicks: 3 });
        let answer = TouchEvent { pointer, ..TouchEvent::new(frame, readings, solution) };
        let detector = &Detector::preset(Detector::DEFAULT).unwrap();
        let contacts = &answer.solution.contacts;
        let total = Total::of(&answer.solution, None);
        update(&Shown { answer: &answer, contacts, frames: 300, course_v: &[0.25, 0.75], detector, total })
    }

    fn words(bytes: &[u8]) -> Vec<u32> {
        bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    }

    fn floats(bytes: &[u8]) -> Vec<f32> {
        words(bytes).into_iter().map(f32::from_bits).collect()
    }

    #[test]
    fn an_update_is_laid_out_as_documented() {
        let errors = Uncertainty { x_m: 0.5, y_m: 0.25, correlation: -0.5, conductance_s: 4.0 };
        let known = FoundContact {
            id: Some(6),
            apparent_conductance_s: Some(1.75),
            radius_m: Some(1.5),
            force_n: Some(3.0),
            force_deviation_n: Some(0.75),
            force_beyond_maximum: Some(true),
            uncertainty: Some(errors),
            depth_m: Some(0.125),
            change: Some(Change::Move { way_m: [0.5, 0.25, 0.0] }),
            ..FoundContact::flat(0.25, -0.5, 2.0)
        };
        let bytes = bytes_of(Solution {
            image_s_per_m2: Some(vec![2.0, 4.0, -8.0]),
            contacts: vec![known, FoundContact::flat(1.0, 2.0, 3.0)],
            residual: Some(1.25),
            flags: Flags {
                saturated: true,
                unfinished: true,
                excluded: vec![3, 31],
                faults: vec![ElectrodeFault::Open, ElectrodeFault::Exchanged],
                ..Flags::default()
            },
            calibrated: None,
            shape: None,
            certainty: Some(0.75),
            alternative: Some(Alternative { contacts: 3, certainty: 0.125 }),
            choice: Some(Choice { what: "2 contacts".to_owned(), why: "µ".to_owned() }),
        });
        assert_eq!(words(&bytes[..48]), [9, 300, 2500, 2, 0, 0b101, 1 << 31 | 1 << 3, 1 << 31, 3, 4, 2, 2]);
        let head = floats(&bytes[48..140]);
        assert_eq!(head[..3], [1.25, 0.75, 3.0]);
        assert!((0.0..5.0).contains(&head[3]), "{} s old", head[3]);
        assert!(head[4].is_nan(), "not all newtons are known");
        assert_eq!(head[5], 4.75, "the sum");
        assert!((head[6] - (1.75 * 0.25 + 3.0) / 4.75).abs() < 1e-6 && (head[7] - 5.125 / 4.75).abs() < 1e-6);
        assert_eq!(head[8..12], [0.5, -0.25, 1.0, 3.0], "the pointer");
        assert!(head[12].is_nan() && head[13].is_nan(), "something is found");
        assert_eq!(head[14..], [2.0, 4.0, -8.0, 0.0, 1.0, 2.0, 3.0, 0.25, 0.75]);
        assert_eq!(words(&bytes[140..144]), [6]);
        let known = [0.25, -0.5, 0.0, 2.0, 1.75, 1.5, 3.0, 0.75, 1.0, 0.5, 0.25, -0.5, 4.0, 0.125];
        let known = [&known[..], &[7.068_583_5, 1.0, 0.5, 0.25, 0.0, 0.25, -0.5]].concat();
        assert_eq!(floats(&bytes[144..228]), known);
        assert_eq!(words(&bytes[228..232]), [0]);
        assert_eq!(floats(&bytes[232..248]), [1.0, 2.0, 0.0, 3.0]);
        assert!(floats(&bytes[248..308]).iter().all(|value| value.is_nan()), "what is not known");
        assert_eq!(floats(&bytes[308..316]), [1.0, 2.0]);
        assert_eq!(&bytes[316..], "2 contacts\nµ".as_bytes());
    }

    #[test]
    fn a_shape_follows_the_contacts_beside_it() {
        let ring =
            FoundRing { centre_m: [0.25, -0.5], radius_m: 2.0, width_m: 0.5, conductance_s: 3.0, uncertainty: None };
        let bytes = bytes_of(Solution {
            contacts: vec![FoundContact::flat(1.0, 2.0, 3.0)],
            shape: Some(FoundShape::Ring(ring)),
            ..Solution::default()
        });
        assert_eq!((words(&bytes[16..20]), words(&bytes[44..48])), (vec![2], vec![1]));
        let shape = floats(&bytes[104 + 4 * 6 + 88..]);
        assert_eq!((shape.len(), shape[4..9].to_vec()), (18, vec![0.25, -0.5, 2.0, 0.5, 3.0]));
        assert!(shape[..4].iter().chain(&shape[9..]).all(|value| value.is_nan()), "{shape:?}");
    }

    #[test]
    fn nothing_found_is_head_and_readings_alone() {
        let bytes = bytes_of(Solution::default());
        assert_eq!(words(&bytes[..48]), [9, 300, 2500, 2, 0, 0, 0, 0, 0, 4, 2, 0]);
        assert!(floats(&bytes[48..52])[0].is_nan());
        assert_eq!(bytes.len(), 104 + 4 * 6);
    }

    /// Words of the page's script that stand behind one of these.
    fn read_by_the_page(before: &[&str]) -> BTreeSet<&'static str> {
        let script = include_str!("web/protocol.js");
        // Not behind `layout.`, whose lists have the same names.
        let behind = |before: &&str| {
            let parts = script.split(*before).zip(script.split(*before).skip(1));
            parts.filter(|(head, _)| !head.ends_with('.')).map(|(_, tail)| tail).collect::<Vec<_>>()
        };
        let word = |text: &'static str| text.split(|c: char| !c.is_alphanumeric() && c != '_').next();
        before.iter().flat_map(behind).filter_map(word).collect()
    }

    #[test]
    fn the_page_reads_by_names_of_what_is_written() {
        let Layout { words, numbers, arrays, contact, shape, .. } = layout();
        let written: BTreeSet<_> = [words, numbers, arrays, contact, shape].concat().into_iter().collect();
        let read = read_by_the_page(&["words.", "numbers.", "arrays.", "values."]);
        assert!(read.len() > 30, "{read:?}");
        assert_eq!(read.difference(&written).collect::<Vec<_>>(), Vec::<&&str>::new());
    }

    #[test]
    fn every_shape_has_a_name_of_the_table() {
        let line =
            FoundLine { from_m: [0.0; 2], to_m: [0.01, 0.0], width_m: 0.002, conductance_s: 1.0, uncertainty: None };
        let ring =
            FoundRing { centre_m: [0.0; 2], radius_m: 0.01, width_m: 1e-3, conductance_s: 1.0, uncertainty: None };
        let names = [FoundShape::Line(line), FoundShape::Ring(ring)].map(|shape| shape.name());
        assert_eq!(names, SHAPES);
    }
}
