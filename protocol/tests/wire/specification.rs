//! The examples in docs/protocol-examples.md are what the crate sends and takes.
//!
//! Each is a block marked `wire`: who sends it and what a receiver makes of it, then the bytes in hexadecimal.

use std::fmt::Debug;

use heapless::Vec as Fixed;
use tactomo_protocol::{
    BoardMessage, BoardReceiver, Clock, Command, ContactCode, ContactFlags, Contacts, DecodeError, Fault, Frame,
    FrameHead, Keys, Log, MAX_WIRE, Output, Plan, Request, Scope, Settings, Status, TableId, TablePiece, TableState,
    encode_keyed,
};

use crate::common::{board_wire, hello, packet, receive_command, request_wire};

const PAGE: &str = include_str!("../../../docs/protocol-examples.md");

/// What a receiver makes of the bytes, and the bytes.
type Example = (String, Vec<u8>);

/// The examples of the page.
fn examples() -> Vec<Example> {
    let blocks = PAGE.split("```wire\n").skip(1);
    blocks
        .map(|block| {
            let (described, rest) = block.split_once('\n').unwrap();
            let (bytes, _) = rest.split_once("```").unwrap();
            let bytes = bytes.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap());
            (described.to_owned(), bytes.collect())
        })
        .collect()
}

fn frame(head: FrameHead, scope: Option<Scope>, readings: &[u16]) -> BoardMessage {
    BoardMessage::Frame(Frame { head, scope: scope.unwrap(), readings: Fixed::from_slice(readings).unwrap() })
}

/// One of every kind of message, and the edges of a frame's coding.
fn board_messages() -> Vec<BoardMessage> {
    let numbered = |sequence| FrameHead { sequence, time_us: 67_305_985, ..FrameHead::default() };
    let mut timed_out = FrameHead { folded: 2, fraction_bits: 4, ..numbered(65_535) };
    timed_out.status.insert(Status::SATURATED);
    timed_out.status.insert(Status::TIMED_OUT);
    vec![
        BoardMessage::Hello(hello()),
        frame(numbered(513), Scope::whole(4), &[0, 1, 2, 3, 4, 0, 6, 7, 8, 9, 0, 11, 12, 13, 14, 0]),
        frame(
            numbered(514),
            Scope::whole(5),
            &std::array::from_fn::<u16, 25, _>(|i| if i % 6 == 0 { 0 } else { 150 * i as u16 }),
        ),
        frame(timed_out, Scope::whole(4), &[65535, 256, 0, 1, 255, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]),
        frame(numbered(0), Scope::whole(4), &[0; 16]),
        frame(numbered(1), Scope::of_rows(16, &[12, 0, 12], 0b1001_0000_0000_0001), &[3, 0, 450, 0, 7, 440, 2, 0, 451]),
        BoardMessage::Log(Log(Fixed::from_slice(&[0xFF, 0x00, 0x12, 0x00]).unwrap())),
        BoardMessage::Fault(Fault::Panic("src/main.rs:42".try_into().unwrap())),
        BoardMessage::Fault(Fault::Reset("watchdog".try_into().unwrap())),
        BoardMessage::Fault(Fault::AdcStuck),
        BoardMessage::Fault(Fault::BadSettings { answers: 8 }),
        BoardMessage::Fault(Fault::UnknownVersion(3)),
        BoardMessage::Fault(Fault::BadPlan { answers: 9 }),
        BoardMessage::Fault(Fault::BadRate { answers: 13 }),
        BoardMessage::Clock(Clock { answers: 7, time_us: 67_305_985 }),
        BoardMessage::Fault(Fault::NoTable { answers: 14 }),
        BoardMessage::Fault(Fault::BrokenWires { electrodes: 1 << 5 | 1 << 12 }),
        contacts(numbered(513)),
        BoardMessage::Table(TableState { answers: 15, room: 0, held: 0, usable: None }),
        BoardMessage::Table(TableState {
            answers: 15,
            room: 131_072,
            held: 106_000,
            usable: Some(TableId { layout: 0x0403_0201, checksum: 0xC0DE_CAFE }),
        }),
    ]
}

/// Two contacts, the second of which the readings do not place.
fn contacts(head: FrameHead) -> BoardMessage {
    let mut flags = ContactFlags::default();
    flags.raise(ContactFlags::MORE);
    let found =
        [ContactCode::new(7, [0.012_34, -0.02], 2e-4, 1e-4), ContactCode::new(8, [0.0, 0.03], 5e-5, f32::INFINITY)];
    BoardMessage::Contacts(Contacts { head, flags, found: found.into_iter().collect() })
}

fn requests() -> Vec<Request> {
    let settings = Settings { settle_us: 300, average_log2: 2, max_frames_per_s: 100, select_us: 35, discarded: 1 };
    let grounds = [0, 5, 10, 15].into_iter().collect();
    let plan = Plan { grounds, reads: 0xFFFF, rows_a_frame: 2, average_log2: 1 };
    let commands = [
        Command::Hello,
        Command::Start,
        Command::Stop,
        Command::Configure(settings),
        Command::Scan(plan),
        Command::Scan(Plan::default()),
        Command::Rate { baud: 3_000_000 },
        Command::Output(Output::Contacts),
        Command::Table(TablePiece { at: 300, bytes: [1, 0, 2].into_iter().collect() }),
    ];
    (7..).zip(commands).map(|(tag, command)| Request { tag, command }).collect()
}

fn described<M: Debug>(result: &Result<M, DecodeError>) -> String {
    match result {
        Ok(message) => format!("{message:?}"),
        Err(error) => format!("refused: {error}"),
    }
}

/// The examples as the crate sends them, and packets that it refuses: for a host one of a newer version, one that lost a byte, and one with a length
/// of six bytes; for a board one with such a length, and one that takes a byte more than the longest.
fn expected() -> Vec<Example> {
    let boards = board_messages().into_iter().map(|message| (board_wire(&message), Ok(message)));
    let [reset, scan, longest] = too_long();
    let refused = [
        (packet(0x50, &[0xC0, 0xDE]), Err(DecodeError::Version(5))),
        (board_wire(&BoardMessage::Fault(Fault::AdcStuck))[1..].to_vec(), Err(DecodeError::Corrupt)),
        (reset, Err(DecodeError::Body)),
    ];
    let hosts = requests().into_iter().map(|request| (request_wire(&request), Ok(request)));
    let hosts = hosts.chain([(scan, Err(DecodeError::Body)), (longest, Err(DecodeError::Corrupt))]);
    let boards =
        boards.chain(coded()).chain(refused).map(|(wire, result)| (format!("board: {}", described(&result)), wire));
    boards.chain(hosts.map(|(wire, result)| (format!("host: {}", described(&result)), wire))).collect()
}

/// A key frame, a frame coded by it, of which one reading is far off, and one whose key did not come.
fn coded() -> Vec<(Vec<u8>, Result<BoardMessage, DecodeError>)> {
    let head = |sequence| FrameHead { sequence, time_us: 67_305_985, ..FrameHead::default() };
    let scope = Scope::whole(4);
    let key = [3000, 3001, 2999, 0, 5, 3010, 3011, 3012, 7, 8, 3013, 3014, 9, 10, 11, 3015];
    let readings = [3002, 3000, 2999, 0, 9, 3009, 3015, 3006, 6, 8, 2200, 3013, 10, 12, 11, 3018];
    let frame = |sequence, readings: &[u16]| frame(head(sequence), scope.clone(), readings);
    let mut keys = Keys::<16>::default();
    let scope = scope.clone().unwrap();
    keys.remember(&head(513), &scope, &key);
    let coded = |sequence, keys: &mut Keys<16>| {
        let mut out = [0; MAX_WIRE];
        let length = encode_keyed(head(sequence), &scope, &readings, keys, &mut out).unwrap();
        out[..length].to_vec()
    };
    let by_the_key = coded(515, &mut keys);
    keys.remember(&head(516), &scope, &key);
    vec![
        (board_wire(&frame(513, &key)), Ok(frame(513, &key))),
        (by_the_key, Ok(frame(515, &readings))),
        (coded(517, &mut keys), Err(DecodeError::Key)),
    ]
}

/// A fault and a plan whose lengths have six bytes, and the longest plan with a length of two.
fn too_long() -> [Vec<u8>; 3] {
    let reset = [&[1, 0x82, 0x80, 0x80, 0x80, 0x80, 0][..], b"ok"].concat();
    let scan = [13, 4, 0x81, 0x80, 0x80, 0x80, 0x80, 0, 3, 1, 1, 0];
    let longest = [&[14, 4, 0xE0, 0][..], &[7; 96], &[0xFF, 0xFF, 0xFF, 0xFF, 0x0F, 32, 8]].concat();
    [packet(0x43, &reset), packet(0x48, &scan), packet(0x48, &longest)]
}

fn page_text(examples: &[Example]) -> String {
    let line = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ");
    let block = |(described, bytes): &Example| {
        format!("```wire\n{described}\n{}\n```\n", bytes.chunks(32).map(line).collect::<Vec<_>>().join("\n"))
    };
    examples.iter().map(block).collect::<Vec<_>>().join("\n")
}

#[test]
fn the_examples_are_what_is_sent() {
    let expected = expected();
    assert!(
        examples() == expected,
        "docs/protocol-examples.md should have these examples:\n\n{}",
        page_text(&expected)
    );
}

#[test]
fn the_examples_are_what_is_taken() {
    // One host reads all that boards send, so that it has the keys of coded frames.
    let mut host = BoardReceiver::default();
    for (expected, wire) in examples() {
        let mut bytes = &wire[..];
        let taken = match expected.split_once(": ") {
            Some(("board", _)) => {
                let results = std::iter::from_fn(|| host.receive(&mut bytes));
                results.map(|result| format!("board: {}", described(&result))).collect()
            }
            _ => {
                receive_command(&wire).0.iter().map(|result| format!("host: {}", described(result))).collect::<Vec<_>>()
            }
        };
        assert_eq!(taken, [expected]);
    }
}
