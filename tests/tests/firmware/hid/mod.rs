//! A pad that an operating system takes for a touch screen: what its reports say by their own descriptor, and when they come.

mod items;

use std::cell::RefCell;
use std::rc::Rc;

use tactomo_firmware::Digitizer;
use tactomo_firmware::hid::{self, COUNT_REPORT, Report, ReportSink};
use tactomo_protocol::{BoardMessage, Command, Fault, Output, Plan};

use self::items::{Descriptor, Kind};
use crate::bench::{Bench, DETECTOR, ROOM, TABLE, finder, finger, simulation, table_memory};
use crate::parts::{frames, hellos, step};

const TOUCH_SCREEN: (u32, u32) = (0x0D, 0x04);
const FINGER: u32 = 0x22;
const TIP: (u32, u32) = (0x0D, 0x42);
const ID: (u32, u32) = (0x0D, 0x51);
const X: (u32, u32) = (0x01, 0x30);
const Y: (u32, u32) = (0x01, 0x31);
const SCAN_TIME: (u32, u32) = (0x0D, 0x56);
const COUNT: (u32, u32) = (0x0D, 0x54);
const MOST: (u32, u32) = (0x0D, 0x55);

/// What was sent, and whether the line to the operating system is busy.
#[derive(Default)]
struct Sent {
    reports: Vec<Report>,
    size_m: [f32; 2],
    is_busy: bool,
}

#[derive(Clone, Default)]
struct Sink(Rc<RefCell<Sent>>);

impl ReportSink for Sink {
    fn set_size(&mut self, size_m: [f32; 2]) {
        self.0.borrow_mut().size_m = size_m;
    }

    fn send(&mut self, report: &Report) -> bool {
        let mut sent = self.0.borrow_mut();
        if !sent.is_busy {
            sent.reports.push(*report);
        }
        !sent.is_busy
    }
}

/// What a report says of a finger.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Told {
    touches: bool,
    id: u32,
    /// From the detector's middle, y upwards (m).
    at_m: [f64; 2],
}

impl Sink {
    fn descriptor(&self) -> Descriptor {
        Descriptor::read(&hid::descriptor(self.0.borrow().size_m))
    }

    /// The reports since the last call, by their descriptor.
    fn told(&self) -> Vec<Vec<Told>> {
        let descriptor = self.descriptor();
        let fields = [TIP, ID, X, Y].map(|usage| descriptor.of(usage));
        let count = descriptor.of(COUNT)[0];
        let told = |report: Report| {
            let finger = |number: usize| {
                let [tip, id, x, y] = [0, 1, 2, 3].map(|field: usize| fields[field][number]);
                let from_middle_m = [x, y].map(|axis| {
                    let size_m = f64::from(axis.physical[1]) * 1e-5;
                    (f64::from(axis.value(&report)) / f64::from(axis.logical[1]) - 0.5) * size_m
                });
                let at_m = [from_middle_m[0], -from_middle_m[1]];
                Told { touches: tip.value(&report) == 1, id: id.value(&report), at_m }
            };
            (0..count.value(&report) as usize).map(finger).collect()
        };
        std::mem::take(&mut self.0.borrow_mut().reports).into_iter().map(told).collect()
    }
}

type Pad = Bench<Digitizer<tactomo_firmware::RamStore<Vec<u8>>, Sink, 256>>;

fn pad(memory: Vec<u8>) -> (Pad, Sink) {
    let sink = Sink::default();
    (Bench::new(Digitizer::new(finder(memory), sink.clone())), sink)
}

/// One that knows its readings at rest.
fn rested_pad() -> (Pad, Sink) {
    let (mut pad, sink) = pad(table_memory());
    pad.scan(&mut simulation(&[]), 80);
    assert_eq!(sink.told().len(), 0);
    (pad, sink)
}

fn is_near(told: Told, at_m: [f64; 2]) -> bool {
    (told.at_m[0] - at_m[0]).hypot(told.at_m[1] - at_m[1]) < 4e-4
}

#[test]
fn the_descriptor_is_of_a_touch_screen_and_reports_are_as_long_as_it_says() {
    let descriptor = Descriptor::read(&hid::descriptor([0.06, 0.0405]));
    assert_eq!(descriptor.application, TOUCH_SCREEN);
    assert_eq!(descriptor.bytes_of(Kind::Input, hid::TOUCH_ID), hid::REPORT_BYTES);
    assert_eq!(descriptor.bytes_of(Kind::Feature, hid::COUNT_ID), COUNT_REPORT.len());
    for usage in [TIP, ID, X, Y] {
        let fields = descriptor.of(usage);
        assert_eq!(fields.len(), 3);
        let collections: Vec<_> = fields.iter().map(|field| field.collection).collect();
        assert_eq!(collections, [(FINGER, 1), (FINGER, 2), (FINGER, 3)]);
        assert!(fields.iter().all(|field| field.kind == Kind::Input && field.report == hid::TOUCH_ID));
    }
    for (usage, hundredths_mm) in [(X, 6000), (Y, 4050)] {
        for field in descriptor.of(usage) {
            // 10^-3 cm.
            assert_eq!((field.unit, field.exponent), (0x11, -3));
            assert_eq!((field.physical, field.logical), ([0, hundredths_mm], [0, i32::from(hid::LAST_PLACE)]));
        }
    }
    // 10^-4 s.
    let time = descriptor.of(SCAN_TIME)[0];
    assert_eq!((time.unit, time.exponent, time.logical, time.physical), (0x1001, -4, [0, 65535], [0, 65535]));
    let most = descriptor.of(MOST)[0];
    assert_eq!((most.kind, most.value(&COUNT_REPORT)), (Kind::Feature, 3));
    for field in [TIP, ID, COUNT, MOST].into_iter().flat_map(|usage| descriptor.of(usage)) {
        assert_eq!((field.unit, field.exponent, field.physical), (0, 0, field.logical), "{field:?}");
    }
    let widest = Descriptor::read(&hid::descriptor([0.655, 0.4]));
    assert_eq!(widest.of(X)[2].physical, [0, 65500]);
}

#[test]
fn a_pad_without_a_host_tells_where_something_presses_and_once_that_it_has_gone() {
    let (mut pad, sink) = rested_pad();
    let place_m = [0.011, -0.007];
    pad.scan(&mut simulation(&[finger(place_m)]), 11);
    let pressed = sink.told();
    // From the third frame on: the second is searched while the rows of the next come.
    assert_eq!(pressed.len(), 9);
    assert!(pressed.iter().all(|told| told.len() == 1 && told[0].touches && is_near(told[0], place_m)), "{pressed:?}");
    assert!(pressed.iter().all(|told| told[0].id == pressed[0][0].id && told[0].id > 0));
    pad.scan(&mut simulation(&[]), 10);
    // In the frame in which it lifts, what there was stays, and so it does while the next is worked on.
    let lifted = [true, true, false].map(|touches| vec![Told { touches, ..pressed[8][0] }]);
    assert_eq!(sink.told(), lifted);
    // Nothing but the Hello was said on the line, and nobody was asked.
    assert_eq!(pad.outside.messages(), []);
}

/// A frame in which something lands is partly of before.
#[test]
fn something_that_lands_in_any_row_is_first_told_where_it_is() {
    let place_m = [0.01, 0.01];
    for row in 0..16 {
        let (mut pad, sink) = rested_pad();
        step(&mut pad.board, row);
        pad.scan(&mut simulation(&[finger(place_m)]), 12);
        let told = sink.told();
        assert!(told.len() >= 4, "row {row}: {}", told.len());
        assert!(told.iter().all(|fingers| fingers.len() == 1), "row {row}: {told:?}");
        let off_m = |told: &Vec<Told>| (told[0].at_m[0] - place_m[0]).hypot(told[0].at_m[1] - place_m[1]);
        assert!(told.iter().all(|told| off_m(told) < 4e-4), "row {row}: {told:?}");
    }
}

#[test]
fn two_fingers_are_two_and_one_stays_when_the_other_goes() {
    let (mut pad, sink) = rested_pad();
    let (first, second) = (finger([0.012, 0.01]), finger([-0.014, -0.008]));
    pad.scan(&mut simulation(&[first, second]), 5);
    let both = sink.told().pop().unwrap();
    assert_eq!(both.len(), 2);
    pad.scan(&mut simulation(&[second]), 5);
    let told = sink.told();
    assert_eq!(
        told[0].iter().map(|finger| finger.touches).collect::<Vec<_>>(),
        both.iter().map(|finger| is_near(*finger, [-0.014, -0.008])).collect::<Vec<_>>()
    );
    assert!(told[1..].iter().all(|fingers| fingers.len() == 1 && fingers[0].touches), "{told:?}");
}

#[test]
fn scan_times_are_those_of_the_board() {
    let (mut pad, sink) = rested_pad();
    pad.scan(&mut simulation(&[finger([0.0, 0.0])]), 400);
    let time = sink.descriptor().of(SCAN_TIME)[0];
    let times: Vec<_> = sink.0.borrow().reports.iter().map(|report| time.value(report)).collect();
    // A frame takes 256 conversions of 10 us and 16 settle times of 20 us: 2.88 ms.
    assert!(times.windows(2).all(|two| [28, 29].contains(&(two[1].wrapping_sub(two[0]) & 0xFFFF))), "{times:?}");
}

#[test]
fn a_report_that_finds_the_line_busy_is_made_up_for() {
    let (mut pad, sink) = rested_pad();
    pad.scan(&mut simulation(&[finger([0.0, 0.01])]), 4);
    let pressed = sink.told().pop().unwrap();
    sink.0.borrow_mut().is_busy = true;
    pad.scan(&mut simulation(&[]), 3);
    // Another presses before the host has heard that the first one went.
    let other = [finger([-0.014, 0.009])];
    pad.scan(&mut simulation(&other), 3);
    sink.0.borrow_mut().is_busy = false;
    pad.scan(&mut simulation(&other), 4);
    let told = sink.told();
    assert_eq!(told.iter().map(Vec::len).collect::<Vec<_>>(), [2, 1, 1, 1], "{told:?}");
    assert!(told[0].contains(&Told { touches: false, ..pressed[0] }));
    assert!(
        told.iter().all(|fingers| fingers.last().is_some_and(|last| last.touches && is_near(*last, [-0.014, 0.009])))
    );
}

#[test]
fn a_host_of_the_line_starts_and_stops_without_a_finger_being_lost() {
    let (mut pad, sink) = rested_pad();
    let mut pressing = simulation(&[finger([0.005, 0.004])]);
    let nothing_sent = pad.scan(&mut pressing, 3);
    assert_eq!(nothing_sent, []);
    for output in [Output::Frames, Output::Both, Output::Contacts, Output::Frames] {
        pad.command(Command::Output(output));
        pad.command(Command::Start);
        step(&mut pad.board, 16 * 4);
        let messages = pad.outside.messages();
        assert_eq!(frames(&messages).len() >= 3, output.has_frames(), "{output:?}");
        let contacts = messages.iter().filter(|message| matches!(message, BoardMessage::Contacts(_))).count();
        assert_eq!(contacts >= 3, output.has_contacts(), "{output:?}");
        let stopped = pad.command(Command::Stop);
        assert!(hellos(&stopped).iter().all(|hello| !hello.is_streaming));
        step(&mut pad.board, 16 * 4);
        assert!(pad.outside.messages().len() <= 1);
    }
    let told = sink.told();
    assert!(told.len() > 30);
    assert!(told.iter().all(|fingers| fingers.len() == 1 && fingers[0].touches && fingers[0].id == told[0][0].id));
}

#[test]
fn a_host_that_reads_no_more_holds_up_no_finger() {
    let (mut pad, sink) = rested_pad();
    pad.command(Command::Start);
    pad.outside.set_room(0);
    pad.read(&mut simulation(&[finger([0.005, 0.004])]));
    step(&mut pad.board, 16 * 20);
    // All but those while it lands.
    let told = sink.told().len();
    assert!(told >= 18, "{told}");
}

#[test]
fn rows_of_a_plan_are_refused_and_end_where_a_table_comes() {
    let plan = Plan { grounds: [0, 5].into_iter().collect(), reads: 0xFFFF, rows_a_frame: 2, average_log2: 0 };
    let (mut rested, _) = rested_pad();
    let refused = rested.command(Command::Scan(plan.clone()));
    assert!(refused.iter().any(|message| matches!(message, BoardMessage::Fault(Fault::BadPlan { .. }))), "{refused:?}");
    let (mut pad, sink) = pad(vec![0; ROOM]);
    let taken = pad.command(Command::Scan(plan));
    assert!(hellos(&taken).iter().any(|hello| hello.answers == 1), "{taken:?}");
    step(&mut pad.board, 100);
    // Nothing is scanned without a table.
    assert_eq!(pad.outside.conversions.get(), 0);
    pad.send(&TABLE);
    pad.scan(&mut simulation(&[]), 80);
    pad.scan(&mut simulation(&[finger([0.01, 0.01])]), 8);
    let told = sink.told();
    assert!(told.len() >= 4 && told.iter().all(|fingers| is_near(fingers[0], [0.01, 0.01])), "{told:?}");
}

/// Neither who asks for the state of the table, nor the same table again, nor one that cannot be used is felt by a finger.
#[test]
fn a_finger_stays_while_tables_are_asked_for_and_ends_with_its_own() {
    let (mut pad, sink) = rested_pad();
    let mut pressing = simulation(&[finger([0.01, 0.01])]);
    pad.scan(&mut pressing, 8);
    let first = sink.told().pop().unwrap();
    let mut foreign = TABLE.to_vec();
    foreign[16] ^= 1;
    pad.piece(0, &[]);
    for table in [&foreign[..256], &TABLE, &TABLE[..640]] {
        pad.send(table);
        pad.scan(&mut pressing, 2);
        let told = sink.told();
        assert!(told.len() >= 2 && told.iter().all(|fingers| fingers.len() == 1), "{told:?}");
        assert!(told.iter().all(|fingers| fingers[0].touches && fingers[0].id == first[0].id), "{told:?}");
    }
    let mut other = TABLE.to_vec();
    let end = other.len() - 4;
    other[70_000] ^= 1;
    let checksum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&other[..end]);
    other[end..].copy_from_slice(&checksum.to_le_bytes());
    // What turns out to be another comes once more.
    pad.send(&other);
    let (state, _) = pad.send(&other);
    assert_eq!(state.usable.map(|table| table.checksum), Some(checksum));
    sink.told();
    pad.scan(&mut pressing, 3);
    let told = sink.told();
    assert!(told.len() <= 1 && told.iter().flatten().all(|finger| !finger.touches), "rest is not known: {told:?}");
    pad.scan(&mut simulation(&[]), 80);
    pad.scan(&mut pressing, 4);
    assert!(sink.told().len() >= 2, "it goes on with the new one");
}

#[test]
fn a_pad_that_is_pressed_before_rest_is_known_is_silent_until_it_is() {
    let (mut pad, sink) = pad(table_memory());
    pad.scan(&mut simulation(&[finger([0.0, 0.01])]), 100);
    assert_eq!(sink.told().len(), 0);
    pad.scan(&mut simulation(&[]), 100);
    pad.scan(&mut simulation(&[finger([0.0, 0.01])]), 3);
    assert_eq!(sink.told().len(), 1);
    let size_m = sink.0.borrow().size_m.map(f64::from);
    let [low_m, high_m] = DETECTOR.outline.bounds();
    assert!((0..2).all(|axis| (size_m[axis] - (high_m[axis] - low_m[axis])).abs() < 1e-6));
}
