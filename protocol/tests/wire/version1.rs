//! What hosts still understand of version 1, against bytes of then.

use tactomo_protocol::{
    BoardMessage, Command, DecodeError, EncodeError, Fault, Frame, FrameHead, Hello, MAX_COMMAND, MAX_WIRE, Plan,
    Range, Request, Scope, Settings, Status, encode_hello, encode_request,
};

use crate::common::{hello, packet, receive_board, receive_command};

/// The examples of version 1 of docs/protocol.md.
const HELLO: &[u8] = &[
    0x15, 0x10, 0x05, 0x30, 0x2E, 0x31, 0x2E, 0x30, 0x05, 0x65, 0x73, 0x70, 0x33, 0x32, 0x10, 0x0C, 0xE4, 0x19, 0xD0,
    0x0F, 0x14, 0x01, 0x05, 0xCD, 0x69, 0xF5, 0xE1, 0x00,
];
const FRAME: &[u8] = &[
    0x08, 0x11, 0x01, 0x02, 0x01, 0x02, 0x03, 0x04, 0x0E, 0x03, 0x10, 0x32, 0x04, 0x76, 0x98, 0xB0, 0xDC, 0x0E, 0x6F,
    0x08, 0xB4, 0x85, 0x00,
];
const LOG: &[u8] = &[0x03, 0x12, 0xFF, 0x02, 0x12, 0x05, 0xDD, 0x45, 0xF3, 0x7A, 0x00];
const RESET: &[u8] =
    &[0x10, 0x13, 0x01, 0x08, 0x77, 0x61, 0x74, 0x63, 0x68, 0x64, 0x6F, 0x67, 0x11, 0x78, 0x03, 0x4D, 0x00];
const ADC_STUCK: &[u8] = &[0x07, 0x13, 0x02, 0x41, 0x32, 0x38, 0xCE, 0x00];
const BAD_SETTINGS: &[u8] = &[0x07, 0x13, 0x03, 0xD7, 0x02, 0x3F, 0xB9, 0x00];
const UNKNOWN_VERSION: &[u8] = &[0x08, 0x13, 0x04, 0x02, 0x13, 0x60, 0x43, 0x6B, 0x00];

fn received(wire: &[u8]) -> Result<BoardMessage, DecodeError> {
    receive_board(&[wire]).0.remove(0)
}

fn old_hello() -> Hello {
    Hello {
        version: 1,
        answers: 0,
        adc_full_scale_mv: 3300,
        is_streaming: false,
        ranges: [Range::of_codes(16, 12)].into_iter().collect(),
        ..hello()
    }
}

#[test]
fn a_board_of_version_1_is_understood() {
    assert_eq!(received(HELLO), Ok(BoardMessage::Hello(old_hello())));
    let head = FrameHead { sequence: 513, time_us: 67_305_985, status: Status(0), fraction_bits: 0 };
    let readings = [0, 1, 2, 3, 4, 0, 6, 7, 8, 9, 0, 11, 12, 13, 14, 0].into_iter().collect();
    let frame = Frame { head, scope: Scope::whole(4).unwrap(), readings };
    assert_eq!(received(FRAME), Ok(BoardMessage::Frame(frame)));
    assert!(matches!(received(LOG), Ok(BoardMessage::Log(log)) if log.0 == [255, 0, 18, 0]));
    let faults = [
        (RESET, Fault::Reset("watchdog".try_into().unwrap())),
        (ADC_STUCK, Fault::AdcStuck),
        (BAD_SETTINGS, Fault::BadSettings { answers: 0 }),
        (UNKNOWN_VERSION, Fault::UnknownVersion(2)),
    ];
    for (wire, fault) in faults {
        assert_eq!(received(wire), Ok(BoardMessage::Fault(fault)));
    }
}

#[test]
fn a_frame_of_version_1_has_one_form_only() {
    let body = |shape: u8, packed: &[u8]| [&[1, 0, 2, 0, 0, 0, 0, shape], packed].concat();
    let result = |body: &[u8]| received(&packet(0x11, body));
    assert!(result(&body(0, &[0xFF, 0xFF])).is_ok());
    for body in [body(1, &[0x55; 4]), body(0, &[0xFF]), body(0, &[]), body(0, &[0xFF, 0xFF, 0xFF, 0x81]), vec![0; 7]] {
        assert_eq!(result(&body), Err(DecodeError::Body), "{body:?}");
    }
}

#[test]
fn a_hello_of_version_1_out_of_range_is_refused_and_a_good_one_is_kept_as_it_came() {
    let mut wire = [0; MAX_WIRE];
    let length = encode_hello(&old_hello(), &mut wire).unwrap();
    assert_eq!(wire[..length], *HELLO);
    let body = [&[0, 0][..], &[16, 12, 0xE4, 0x19, 0xD0, 0x0F, 20, 0, 0]].concat();
    assert!(received(&packet(0x10, &body)).is_ok());
    for (at, value) in [(2, 3), (2, 33), (3, 0), (3, 17), (3, 200), (9, 9)] {
        let mut body = body.clone();
        body[at] = value;
        assert_eq!(received(&packet(0x10, &body)), Err(DecodeError::Body), "{value} at {at}");
    }
    let newer = Hello { version: 4, ..hello() };
    assert_eq!(encode_hello(&newer, &mut wire), Err(EncodeError::NotInVersion(4)));
}

#[test]
fn commands_can_be_said_in_version_1_and_plans_cannot() {
    let settings = Settings { settle_us: 300, average_log2: 2, max_frames_per_s: 100, ..Settings::default() };
    let examples: [(Command, &[u8]); 4] = [
        (Command::Hello, &[0x02, 0x18, 0x05, 0xA6, 0x8A, 0xC2, 0xC3, 0x00]),
        (Command::Start, &[0x07, 0x18, 0x01, 0x30, 0xBA, 0xC5, 0xB4, 0x00]),
        (Command::Stop, &[0x07, 0x18, 0x02, 0x8A, 0xEB, 0xCC, 0x2D, 0x00]),
        (Command::Configure(settings), &[0x0B, 0x18, 0x03, 0xAC, 0x02, 0x02, 0x64, 0x95, 0xEE, 0x37, 0x65, 0x00]),
    ];
    let mut out = [0; MAX_COMMAND];
    for (command, wire) in examples {
        let length = encode_request(&Request { tag: 5, command }, 1, &mut out).unwrap();
        assert_eq!(out[..length], *wire);
        assert_eq!(receive_command(wire).0, [Err(DecodeError::Version(1))], "a board does not take it");
    }
    let plan = Request { tag: 5, command: Command::Scan(Plan::default()) };
    assert_eq!(encode_request(&plan, 1, &mut out), Err(EncodeError::NotInVersion(1)));
}
