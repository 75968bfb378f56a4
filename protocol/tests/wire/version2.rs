//! What hosts still understand of version 2, against bytes of then.

use tactomo_protocol::{
    BoardMessage, Command, DecodeError, EncodeError, Fault, Frame, FrameHead, Hello, MAX_COMMAND, MAX_WIRE, Plan,
    Request, Scope, Settings, Status, encode_hello, encode_request,
};

use crate::common::{hello, packet, receive_board, receive_command};

/// The Hello of version 2 of docs/protocol.md.
const HELLO: &[u8] = &[
    0x16, 0x20, 0x07, 0x05, 0x30, 0x2E, 0x31, 0x2E, 0x30, 0x05, 0x65, 0x73, 0x70, 0x33, 0x32, 0x10, 0x0C, 0x80, 0x20,
    0xD0, 0x0F, 0x14, 0x01, 0x1D, 0x01, 0x02, 0x06, 0x8E, 0x01, 0x9C, 0x18, 0x88, 0x27, 0x90, 0x4E, 0xE0, 0x5D, 0x0A,
    0x80, 0x01, 0x88, 0x18, 0x88, 0x27, 0x90, 0x4E, 0xE0, 0x5D, 0xE5, 0xF4, 0xC4, 0x42, 0x00,
];
const FRAME: &[u8] = &[
    0x08, 0x21, 0x01, 0x02, 0x01, 0x02, 0x03, 0x04, 0x03, 0x03, 0x04, 0x0D, 0x10, 0x32, 0x04, 0x76, 0x98, 0xB0, 0xDC,
    0x0E, 0x55, 0xF2, 0xE4, 0xE3, 0x00,
];
const BAD_PLAN: &[u8] = &[0x08, 0x23, 0x05, 0x09, 0x4A, 0x6D, 0xE1, 0xC1, 0x00];
const UNKNOWN_VERSION: &[u8] = &[0x08, 0x23, 0x04, 0x03, 0x15, 0xB5, 0x2F, 0x38, 0x00];

fn received(wire: &[u8]) -> Result<BoardMessage, DecodeError> {
    receive_board(&[wire]).0.remove(0)
}

fn old_hello() -> Hello {
    Hello { version: 2, ..hello() }
}

#[test]
fn a_board_of_version_2_is_understood() {
    assert_eq!(received(HELLO), Ok(BoardMessage::Hello(old_hello())));
    let head = FrameHead { sequence: 513, time_us: 67_305_985, status: Status(0), fraction_bits: 0 };
    let readings = [0, 1, 2, 3, 4, 0, 6, 7, 8, 9, 0, 11, 12, 13, 14, 0].into_iter().collect();
    let frame = Frame { head, scope: Scope::whole(4).unwrap(), readings };
    assert_eq!(received(FRAME), Ok(BoardMessage::Frame(frame)));
    assert_eq!(received(BAD_PLAN), Ok(BoardMessage::Fault(Fault::BadPlan { answers: 9 })));
    assert_eq!(received(UNKNOWN_VERSION), Ok(BoardMessage::Fault(Fault::UnknownVersion(3))));
}

#[test]
fn a_hello_of_version_2_is_kept_as_it_came_and_its_limits_hold() {
    let mut wire = [0; MAX_WIRE];
    let length = encode_hello(&old_hello(), &mut wire).unwrap();
    assert_eq!(wire[..length], *HELLO);
    let new = Hello { settings: Settings { discarded: 1, ..Settings::default() }, ..old_hello() };
    assert_eq!(encode_hello(&new, &mut wire), Err(EncodeError::NotInVersion(2)));
    // Of this version's Hello it has the head only.
    let body = postcard::to_allocvec(&hello()).unwrap();
    assert_eq!(received(&packet(0x20, &body)), Err(DecodeError::Body));
}

#[test]
fn commands_can_be_said_in_version_2_but_for_settings_that_it_has_no_word_for() {
    let settings = Settings { settle_us: 300, average_log2: 2, max_frames_per_s: 100, ..Settings::default() };
    let grounds = [0, 5, 10, 15].into_iter().collect();
    let plan = Plan { grounds, reads: 0xFFFF, rows_a_frame: 2, average_log2: 1 };
    let examples: [(u8, Command, &[u8]); 5] = [
        (7, Command::Hello, &[0x03, 0x28, 0x07, 0x05, 0x8D, 0x58, 0x5E, 0x86, 0x00]),
        (8, Command::Start, &[0x08, 0x28, 0x08, 0x01, 0xD4, 0x74, 0xC1, 0x76, 0x00]),
        (9, Command::Stop, &[0x08, 0x28, 0x09, 0x02, 0x2F, 0x14, 0xD3, 0xF6, 0x00]),
        (
            10,
            Command::Configure(settings),
            &[0x0C, 0x28, 0x0A, 0x03, 0xAC, 0x02, 0x02, 0x64, 0x23, 0x44, 0xD5, 0xFB, 0x00],
        ),
        (
            11,
            Command::Scan(plan),
            &[
                0x05, 0x28, 0x0B, 0x04, 0x04, 0x0D, 0x05, 0x0A, 0x0F, 0xFF, 0xFF, 0x03, 0x02, 0x01, 0x23, 0x67, 0x79,
                0x60, 0x00,
            ],
        ),
    ];
    let mut out = [0; MAX_COMMAND];
    for (tag, command, wire) in examples {
        let length = encode_request(&Request { tag, command }, 2, &mut out).unwrap();
        assert_eq!(out[..length], *wire);
        assert_eq!(receive_command(wire).0, [Err(DecodeError::Version(2))], "a board does not take it");
    }
    for unknown in [Settings { select_us: 1, ..settings }, Settings { discarded: 1, ..settings }] {
        let request = Request { tag: 5, command: Command::Configure(unknown) };
        for version in [1, 2] {
            assert_eq!(encode_request(&request, version, &mut out), Err(EncodeError::NotInVersion(version)));
        }
    }
}
