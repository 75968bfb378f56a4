//! The edges of the protocol: other versions, bodies that break a rule, and messages that are too long.

use tactomo_protocol::{
    BoardMessage, Command, Counters, DecodeError, EncodeError, Frame, FrameHead, Hello, MAX_WIRE, Status, VERSION,
    encode_board, encode_frame, encode_log, wire_bytes,
};

use crate::common::{board_wire, hello, packet, receive_board, receive_command};

/// Head bytes of this version.
const HELLO: u8 = VERSION << 4;
const FRAME: u8 = VERSION << 4 | 1;
const FAULT: u8 = VERSION << 4 | 3;
const COMMAND: u8 = VERSION << 4 | 8;

fn board_result(head: u8, body: &[u8]) -> Result<BoardMessage, DecodeError> {
    receive_board(&[&packet(head, body)]).0.remove(0)
}

fn command_result(head: u8, body: &[u8]) -> Result<Command, DecodeError> {
    receive_command(&packet(head, body)).0.remove(0)
}

#[test]
fn another_version_is_named_whatever_the_kind_and_the_body() {
    for version in (0..16).filter(|version| *version != VERSION) {
        for kind in 0..16 {
            for body in [&[][..], &[1; 8], &[0xFF; 16]] {
                let head = version << 4 | kind;
                assert_eq!(board_result(head, body), Err(DecodeError::Version(version)));
                assert_eq!(command_result(head, body), Err(DecodeError::Version(version)));
            }
        }
    }
    assert_eq!(
        DecodeError::Version(2).to_string(),
        "the peer speaks version 2 of the protocol, this side version 1: update the older of the two"
    );
}

#[test]
fn an_unknown_kind_and_the_wrong_direction_are_refused() {
    for kind in 4..16 {
        assert_eq!(board_result(VERSION << 4 | kind, &[]), Err(DecodeError::Body));
    }
    for kind in (0..16).filter(|kind| *kind != COMMAND & 15) {
        assert_eq!(command_result(VERSION << 4 | kind, &[]), Err(DecodeError::Body));
    }
}

#[test]
fn a_body_that_is_cut_or_too_long_is_refused() {
    assert_eq!(command_result(COMMAND, &[1]), Ok(Command::Start));
    for body in [&[][..], &[4], &[1, 0], &[3, 20, 0], &[0xFF; 12]] {
        assert_eq!(command_result(COMMAND, body), Err(DecodeError::Body), "{body:?}");
    }
    // A text that is longer than its field, and one that is not UTF-8.
    let long = [&[1, 25][..], &[b'x'; 25]].concat();
    for body in [&long[..], &[1, 2, 0xC3, 0x28]] {
        assert_eq!(board_result(FAULT, body), Err(DecodeError::Body), "{body:?}");
    }
    assert_eq!(board_result(VERSION << 4 | 2, &[7; 65]), Err(DecodeError::Body));
}

#[test]
fn a_hello_out_of_range_is_neither_sent_nor_taken() {
    let valid = hello();
    let break_it: [fn(&mut Hello); 7] = [
        |hello| hello.electrodes = 3,
        |hello| hello.electrodes = 33,
        |hello| hello.adc_bits = 0,
        |hello| hello.adc_bits = 17,
        |hello| hello.adc_full_scale_mv = 0,
        |hello| hello.drive_mv = 0,
        |hello| hello.settings.average_log2 = 9,
    ];
    assert_eq!(board_result(HELLO, &postcard::to_allocvec(&valid).unwrap()), Ok(BoardMessage::Hello(valid.clone())));
    for break_one in break_it {
        let mut hello = valid.clone();
        break_one(&mut hello);
        let body = postcard::to_allocvec(&hello).unwrap();
        assert_eq!(encode_board(&BoardMessage::Hello(hello), &mut [0; MAX_WIRE]), Err(EncodeError::Hello));
        assert_eq!(board_result(HELLO, &body), Err(DecodeError::Body));
    }
}

#[test]
fn a_frame_has_one_form_only() {
    let body = |shape: u8, packed: &[u8]| [&[1, 0, 2, 0, 0, 0, 0, shape], packed].concat();
    // Sixteen ones, one bit each.
    assert!(board_result(FRAME, &body(0, &[0xFF, 0xFF])).is_ok());
    // The same in two bits each, without its end, without readings, and half a head.
    for body in [body(1, &[0x55; 4]), body(0, &[0xFF]), body(0, &[]), vec![0; 7]] {
        assert_eq!(board_result(FRAME, &body), Err(DecodeError::Body), "{body:?}");
    }
    // Twenty-five ones: seven bits to spare, which must be zero.
    assert!(board_result(FRAME, &body(0, &[0xFF, 0xFF, 0xFF, 0x01])).is_ok());
    assert_eq!(board_result(FRAME, &body(0, &[0xFF, 0xFF, 0xFF, 0x81])), Err(DecodeError::Body));
}

#[test]
fn what_breaks_a_limit_is_not_sent() {
    let mut out = [0; MAX_WIRE];
    let head = FrameHead::default();
    for count in [0, 9, 17, 255, 1089] {
        assert_eq!(encode_frame(head, &vec![0; count], &mut out), Err(EncodeError::ReadingCount(count)));
    }
    let head = FrameHead { fraction_bits: 16, ..head };
    assert_eq!(encode_frame(head, &[0; 16], &mut out), Err(EncodeError::FractionBits(16)));
    assert_eq!(encode_log(&[0; 65], &mut out), Err(EncodeError::LogLength(65)));
}

/// The largest frames on the wire: 16 x 16 of 12 bits, and 32 x 32 of 16 bits, in a buffer that just holds them.
#[test]
fn the_largest_frames_take_400_and_2071_bytes() {
    for (largest, electrodes, bytes) in [(4095, 16, 400), (u16::MAX, 32, MAX_WIRE)] {
        let head = FrameHead { sequence: u16::MAX, time_us: u32::MAX, status: Status(255), fraction_bits: 0 };
        let readings = heapless::Vec::from_iter(std::iter::repeat_n(largest, electrodes * electrodes));
        let mut out = vec![0; bytes];
        assert_eq!(encode_frame(head, &readings, &mut out), Ok(bytes));
        assert_eq!(receive_board(&[&out]).0, [Ok(BoardMessage::Frame(Frame { head, readings }))]);
    }
    assert_eq!(wire_bytes(1 + 8 + 384 + 4), 400);
}

#[test]
fn a_flood_without_zeros_is_counted_and_forgotten() {
    let message = board_wire(&BoardMessage::Hello(hello()));
    let flood = [0x55; 1000];
    let chunks: Vec<&[u8]> = [&flood[..]; 1000].into_iter().chain([&[0][..], &message]).collect();
    let (received, counters) = receive_board(&chunks);
    assert_eq!(received, [Err(DecodeError::Corrupt), Ok(BoardMessage::Hello(hello()))]);
    assert_eq!(counters, Counters { messages: 1, corrupt: 1, dropped_bytes: 1_000_000 });
}
