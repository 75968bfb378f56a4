//! The edges of the protocol: other versions, bodies that break a rule, and messages that are too long.

use tactomo_protocol::{
    BoardMessage, Command, ContactCode, ContactFlags, Contacts, Counters, DecodeError, EncodeError, Fault, Frame,
    FrameHead, Hello, MAX_COMMAND, MAX_WIRE, OLDEST, Plan, Range, Request, Scope, Settings, Status, VERSION,
    encode_board, encode_frame, encode_log, encode_request, encode_rows, wire_bytes,
};

use crate::common::{board_wire, hello, packet, receive_board, receive_command, request_wire};

/// Head bytes of this version.
const HELLO: u8 = VERSION << 4;
const FRAME: u8 = VERSION << 4 | 1;
const FAULT: u8 = VERSION << 4 | 3;
const CONTACTS: u8 = VERSION << 4 | 5;
const COMMAND: u8 = VERSION << 4 | 8;

fn board_result(head: u8, body: &[u8]) -> Result<BoardMessage, DecodeError> {
    receive_board(&[&packet(head, body)]).0.remove(0)
}

fn command_result(head: u8, body: &[u8]) -> Result<Request, DecodeError> {
    receive_command(&packet(head, body)).0.remove(0)
}

#[test]
fn another_version_is_named_whatever_the_kind_and_the_body() {
    for version in (0..16).filter(|version| *version != VERSION) {
        for kind in 0..16 {
            for body in [&[][..], &[1; 8], &[0xFF; 16]] {
                let head = version << 4 | kind;
                assert_eq!(command_result(head, body), Err(DecodeError::Version(version)), "a board obeys its own");
                if !(OLDEST..=VERSION).contains(&version) {
                    assert_eq!(board_result(head, body), Err(DecodeError::Version(version)));
                }
            }
        }
    }
    assert_eq!(DecodeError::Version(5).to_string(), "the peer speaks version 5 of the protocol, this side version 4");
}

#[test]
fn of_the_version_before_a_host_takes_all_but_coded_frames() {
    let of = |version: u8, message: &BoardMessage| {
        let stuffed = board_wire(message);
        let packet = cobs::decode_vec(&stuffed[..stuffed.len() - 1]).unwrap();
        board_result(version << 4 | packet[0] & 15, &packet[1..packet.len() - 4])
    };
    let frame =
        Frame { head: FrameHead::default(), scope: Scope::whole(4).unwrap(), readings: [7; 16].into_iter().collect() };
    let messages =
        [BoardMessage::Hello(hello()), BoardMessage::Frame(frame.clone()), BoardMessage::Fault(Fault::AdcStuck)];
    for message in &messages {
        assert_eq!(of(OLDEST, message).as_ref(), Ok(message));
    }
    let key = board_wire(&BoardMessage::Frame(frame));
    // One that is like the frame before it.
    let coded = [1, 0, 0, 0, 0, 0, 0, 0, 1, 4, 0, 0, 0];
    for version in OLDEST..=VERSION {
        let result = receive_board(&[&key, &packet(version << 4 | 4, &coded)]).0.remove(1);
        assert_eq!(result.is_ok(), version == VERSION, "{result:?}");
    }
    // A board of that version that obeys no host of this one is told by its version.
    let refusal = BoardMessage::Fault(Fault::UnknownVersion(VERSION));
    assert_eq!(of(OLDEST, &refusal), Err(DecodeError::Version(OLDEST)));
    assert_eq!(of(VERSION, &refusal), Ok(refusal));
}

/// Every count with every length of a body, every byte of flags, and every number of a contact.
#[test]
fn contacts_are_as_many_as_are_counted_and_have_numbers() {
    let body = |last: u8, ids: &[u8]| {
        let contacts = ids.iter().flat_map(|id| [*id, 1, 2, 3, 4, 5, 6, 7]);
        [9, 0, 1, 2, 3, 4, 0, last].into_iter().chain(contacts).collect::<Vec<u8>>()
    };
    for last in 0..=255 {
        let whole = body(last, &[1, 255, 8, 9, 10]);
        for length in 0..whole.len() {
            let result = board_result(CONTACTS, &whole[..length]);
            if length != 8 + 8 * usize::from(last & 3) {
                assert_eq!(result, Err(DecodeError::Body), "{last:#x} and {length} bytes");
                continue;
            }
            let Ok(BoardMessage::Contacts(contacts)) = result else { panic!("{last:#x}: {result:?}") };
            assert_eq!(
                contacts.found.iter().map(|contact| contact.id).collect::<Vec<_>>(),
                whole[8..].iter().step_by(8).take(contacts.found.len()).copied().collect::<Vec<_>>()
            );
            assert_eq!((contacts.head.sequence, contacts.head.fraction_bits), (9, 0));
            let sent = board_wire(&BoardMessage::Contacts(contacts));
            assert_eq!(sent, packet(CONTACTS, &whole[..length]), "it goes out as it came");
        }
    }
    for ids in [&[0][..], &[0, 1], &[1, 0], &[3, 2, 0]] {
        assert_eq!(board_result(CONTACTS, &body(ids.len() as u8, ids)), Err(DecodeError::Body));
        let found = ids.iter().map(|id| ContactCode { id: *id, ..ContactCode::default() }).collect();
        let contacts = Contacts { head: FrameHead::default(), flags: ContactFlags::default(), found };
        let sent = encode_board(&BoardMessage::Contacts(contacts), &mut [0; MAX_WIRE]);
        assert_eq!(sent, Err(EncodeError::ContactNumber));
    }
}

#[test]
fn an_unknown_kind_and_the_wrong_direction_are_refused() {
    for kind in 4..16 {
        assert_eq!(board_result(VERSION << 4 | kind, &[]), Err(DecodeError::Body));
    }
    for kind in (0..16).filter(|kind| *kind != COMMAND & 15) {
        assert_eq!(command_result(VERSION << 4 | kind, &[9, 0]), Err(DecodeError::Body));
    }
}

#[test]
fn a_body_that_is_cut_or_too_long_is_refused() {
    assert_eq!(command_result(COMMAND, &[9, 1]), Ok(Request { tag: 9, command: Command::Start }));
    for body in [&[][..], &[9], &[9, 5], &[9, 1, 0], &[9, 3, 20, 0, 0, 0], &[0xFF; 12]] {
        assert_eq!(command_result(COMMAND, body), Err(DecodeError::Body), "{body:?}");
    }
    // A plan of 97 rows.
    let long = [&[9, 4, 97][..], &[0; 97], &[1, 1, 0]].concat();
    assert_eq!(command_result(COMMAND, &long), Err(DecodeError::Body));
    // A text that is longer than its field, and one that is not UTF-8.
    let long = [&[1, 25][..], &[b'x'; 25]].concat();
    for body in [&long[..], &[1, 2, 0xC3, 0x28]] {
        assert_eq!(board_result(FAULT, body), Err(DecodeError::Body), "{body:?}");
    }
    assert_eq!(board_result(VERSION << 4 | 2, &[7; 65]), Err(DecodeError::Body));
}

#[test]
fn a_command_without_a_tag_is_neither_sent_nor_taken() {
    let request = Request { tag: 0, command: Command::Start };
    assert_eq!(encode_request(&request, &mut [0; MAX_COMMAND]), Err(EncodeError::Tag));
    assert_eq!(command_result(COMMAND, &[0, 1]), Err(DecodeError::Body));
}

/// Longer forms of a number stand for the same, up to the bytes that the longest number of its type takes: as postcard has it.
#[test]
fn a_varint_may_be_longer_than_it_needs_to_be() {
    let with = |settle: &[u8]| command_result(COMMAND, &[&[1, 3][..], settle, &[2, 100, 17, 1]].concat());
    let settings = Settings { settle_us: 20, average_log2: 2, max_frames_per_s: 100, select_us: 17, discarded: 1 };
    let expected = Ok(Request { tag: 1, command: Command::Configure(settings) });
    for settle in [&[20][..], &[0x94, 0], &[0x94, 0x80, 0]] {
        assert_eq!(with(settle), expected, "{settle:?}");
    }
    // Four bytes, and three that are more than 65535.
    for settle in [&[0x94, 0x80, 0x80, 0][..], &[0xFF, 0xFF, 0x04]] {
        assert_eq!(with(settle), Err(DecodeError::Body), "{settle:?}");
    }
    // Numbers of variants, masks and lengths have up to five bytes.
    let start = Ok(Request { tag: 1, command: Command::Start });
    assert_eq!(command_result(COMMAND, &[1, 0x81, 0x80, 0x80, 0x80, 0]), start);
    assert_eq!(command_result(COMMAND, &[1, 0x81, 0x80, 0x80, 0x80, 0x80, 0]), Err(DecodeError::Body));
    let plan = Plan { grounds: [3].into_iter().collect(), reads: 1, rows_a_frame: 1, average_log2: 0 };
    let long = [1, 4, 0x81, 0x80, 0x80, 0x80, 0, 3, 0x81, 0x80, 0x80, 0x80, 0, 1, 0];
    assert_eq!(command_result(COMMAND, &long), Ok(Request { tag: 1, command: Command::Scan(plan) }));
}

/// A host reads lengths on 64 bits and a board on 32: both take five bytes of them.
#[test]
fn a_length_of_six_bytes_is_refused_by_hosts_and_boards() {
    let scan = |length: &[u8]| command_result(COMMAND, &[&[1, 4][..], length, &[3, 1, 1, 0]].concat());
    let plan = Plan { grounds: [3].into_iter().collect(), reads: 1, rows_a_frame: 1, average_log2: 0 };
    assert_eq!(scan(&[0x81, 0x80, 0x80, 0x80, 0]), Ok(Request { tag: 1, command: Command::Scan(plan) }));
    let reset = |length: &[u8]| board_result(FAULT, &[&[1][..], length, b"ok"].concat());
    let reported = Fault::Reset("ok".try_into().unwrap());
    assert_eq!(reset(&[0x82, 0x80, 0x80, 0x80, 0]), Ok(BoardMessage::Fault(reported)));
    let mut hello_body = postcard::to_allocvec(&hello()).unwrap();
    let ranges = hello_body.iter().rposition(|byte| *byte == 0x8E).unwrap() - 2;
    assert_eq!(hello_body[ranges], 2, "the length of the list of ranges");
    let mut hello_with = |length: &[u8]| {
        hello_body.splice(ranges..=ranges, length.iter().copied());
        let result = board_result(HELLO, &hello_body);
        hello_body.splice(ranges..ranges + length.len(), [2]);
        result
    };
    assert_eq!(hello_with(&[0x82, 0x80, 0x80, 0x80, 0]), Ok(BoardMessage::Hello(hello())));
    // Six bytes up to ten, which a number of 64 bits may have, and five that are more than 32 bits.
    for fill in 4..9 {
        let long = |least: u8| [&[least | 0x80][..], &vec![0x80; fill], &[0]].concat();
        assert_eq!(scan(&long(1)), Err(DecodeError::Body), "{} bytes", fill + 2);
        assert_eq!(reset(&long(2)), Err(DecodeError::Body), "{} bytes", fill + 2);
        assert_eq!(hello_with(&long(2)), Err(DecodeError::Body), "{} bytes", fill + 2);
    }
    assert_eq!(scan(&[0x81, 0x80, 0x80, 0x80, 0x10]), Err(DecodeError::Body));
}

/// One byte more than the longest packet takes is junk, though the packet in it would be right.
#[test]
fn a_packet_that_takes_a_byte_more_than_the_limit_is_junk() {
    let grounds = [7; 96];
    let scan = |length: &[u8]| [&[255, 4][..], length, &grounds, &[0xFF, 0xFF, 0xFF, 0xFF, 0x0F, 32, 8]].concat();
    let plan = Plan { grounds: grounds.into_iter().collect(), reads: u32::MAX, rows_a_frame: 32, average_log2: 8 };
    let longest = packet(COMMAND, &scan(&[96]));
    assert_eq!(longest.len(), MAX_COMMAND);
    assert_eq!(receive_command(&longest).0, [Ok(Request { tag: 255, command: Command::Scan(plan) })]);
    let longer = packet(COMMAND, &scan(&[0xE0, 0]));
    assert_eq!(longer.len(), MAX_COMMAND + 1);
    let expected = Counters { corrupt: 1, dropped_bytes: MAX_COMMAND as u64, ..Counters::default() };
    assert_eq!(receive_command(&longer), (vec![Err(DecodeError::Corrupt)], expected));
    // In any chunks.
    for cut in 1..longer.len() {
        let mut receiver = tactomo_protocol::CommandReceiver::default();
        let (mut first, mut rest) = longer.split_at(cut);
        assert_eq!(receiver.receive(&mut first), None);
        assert_eq!(receiver.receive(&mut rest), Some(Err(DecodeError::Corrupt)), "cut at {cut}");
    }
    // A board of the same: the longest frame, and a whole packet of a version to come that is longer.
    let to_come = |bytes: usize| packet(0xF0, &vec![7; bytes]);
    let room = MAX_WIRE - to_come(0).len() - 8;
    assert_eq!(to_come(room).len(), MAX_WIRE);
    assert_eq!(receive_board(&[&to_come(room)]).0, [Err(DecodeError::Version(15))]);
    assert_eq!(to_come(room + 1).len(), MAX_WIRE + 1);
    assert_eq!(receive_board(&[&to_come(room + 1)]).0, [Err(DecodeError::Corrupt)]);
}

#[test]
fn a_hello_out_of_range_is_neither_sent_nor_taken() {
    let valid = hello();
    let break_it: [fn(&mut Hello); 17] = [
        |hello| hello.electrodes = 3,
        |hello| hello.electrodes = 33,
        |hello| hello.adc_bits = 0,
        |hello| hello.adc_bits = 17,
        |hello| hello.adc_full_scale_mv = 0,
        |hello| hello.drive_mv = 0,
        |hello| hello.settings.average_log2 = 9,
        |hello| hello.settings.discarded = 16,
        |hello| hello.settings.select_us = 10_001,
        |hello| hello.electrodes = 17,
        |hello| hello.ranges.clear(),
        |hello| hello.ranges[0].electrodes = 7,
        |hello| hello.ranges[0].floor = hello.ranges[0].ceiling,
        |hello| hello.ranges[1].ceiling = 4096,
        |hello| hello.adc_bits = 11,
        |hello| (hello.ranges[0].electrodes, hello.ranges[1].electrodes) = (0, 16),
        |hello| hello.ranges.push(Range { ceiling: 1, ..Range::of_codes(1, 12) }).unwrap(),
    ];
    assert_eq!(board_result(HELLO, &postcard::to_allocvec(&valid).unwrap()), Ok(BoardMessage::Hello(valid.clone())));
    for (number, break_one) in break_it.into_iter().enumerate() {
        let mut hello = valid.clone();
        break_one(&mut hello);
        let body = postcard::to_allocvec(&hello).unwrap();
        let sent = encode_board(&BoardMessage::Hello(hello), &mut [0; MAX_WIRE]);
        assert_eq!(sent, Err(EncodeError::Hello), "number {number}");
        assert_eq!(board_result(HELLO, &body), Err(DecodeError::Body), "number {number}");
    }
}

#[test]
fn every_electrode_has_the_range_of_its_converter() {
    let hello = hello();
    let floors: Vec<_> = (0..18).map(|electrode| hello.range_of(electrode).map(|range| range.floor)).collect();
    assert_eq!(floors, [[Some(142); 6].as_slice(), &[Some(128); 10], &[None; 2]].concat());
}

/// A frame's body with this shape, scope and readings.
fn body(shape: u8, scope: &[u8], packed: &[u8]) -> Vec<u8> {
    [&[1, 0, 2, 0, 0, 0, 0, shape], scope, packed].concat()
}

#[test]
fn a_frame_has_one_form_only() {
    let whole = |shape, packed| body(shape, &[4, 0], packed);
    // Sixteen ones, one bit each.
    assert!(board_result(FRAME, &whole(0, &[0xFF, 0xFF])).is_ok());
    // The same in two bits each, without its end, with a byte too many, without readings; half a scope, and half a head.
    let broken = [whole(1, &[0x55; 4]), whole(0, &[0xFF]), whole(0, &[0xFF, 0xFF, 0]), whole(0, &[])];
    for body in broken.into_iter().chain([body(0, &[4], &[]), vec![0; 7]]) {
        assert_eq!(board_result(FRAME, &body), Err(DecodeError::Body), "{body:?}");
    }
    // Twenty-five ones: seven bits to spare, which must be zero.
    assert!(board_result(FRAME, &body(0, &[5, 0], &[0xFF, 0xFF, 0xFF, 0x01])).is_ok());
    assert_eq!(board_result(FRAME, &body(0, &[5, 0], &[0xFF, 0xFF, 0xFF, 0x81])), Err(DecodeError::Body));
}

#[test]
fn a_scope_has_one_form_only() {
    let result = |scope: &[u8], readings: usize| {
        let ones = ((1u64 << readings) - 1).to_le_bytes();
        board_result(FRAME, &body(0, scope, &ones[..readings.div_ceil(8)]))
    };
    let scope_of = |scope: &[u8], readings| match result(scope, readings) {
        Ok(BoardMessage::Frame(frame)) => frame.scope,
        other => panic!("{scope:?}: {other:?}"),
    };
    let rows = scope_of(&[5, 3, 4, 0, 4, 0b1_0010], 6);
    assert_eq!(Some(rows.clone()), Scope::of_rows(5, &[4, 0, 4], 0b1_0010));
    assert_eq!(rows.cells().collect::<Vec<_>>(), [(4, 1), (4, 4), (0, 1), (0, 4), (4, 1), (4, 4)]);
    // Seventeen electrodes have a mask of three bytes.
    assert_eq!(scope_of(&[17, 1, 16, 1, 0, 1], 2).cells().collect::<Vec<_>>(), [(16, 0), (16, 16)]);
    // All grounds, but not in order, or not all read.
    assert!(!scope_of(&[4, 4, 1, 0, 2, 3, 15], 16).is_whole() && !scope_of(&[4, 4, 0, 1, 2, 3, 7], 12).is_whole());

    let broken: [(&[u8], usize); 9] = [
        (&[4, 4, 0, 1, 2, 3, 15], 16),    // The whole frame written out.
        (&[4, 1, 4, 15], 4),              // A ground that is not there,
        (&[4, 1, 0, 0x1F], 5),            // a reading of one that is not there,
        (&[4, 1, 0, 0], 0),               // nothing read,
        (&[3, 0], 9),                     // three electrodes,
        (&[33, 1, 0, 1, 0, 0, 0, 0], 1),  // thirty-three,
        (&[4, 5, 0, 1, 2, 3, 0, 15], 20), // more than a whole frame,
        (&[[32, 33].as_slice(), &[0; 33], &[1, 0, 0, 0]].concat(), 33), // more than 32 rows,
        (&[4, 3, 0, 1], 0),               // and a scope that is cut.
    ];
    for (scope, readings) in broken {
        assert_eq!(result(scope, readings), Err(DecodeError::Body), "{scope:?}");
    }
}

#[test]
fn status_bits_without_a_name_are_not_sent_and_are_dropped() {
    let head = FrameHead { status: Status(0xFF), ..FrameHead::default() };
    let mut out = [0; 64];
    let length = encode_frame(head, &[1; 16], &mut out).unwrap();
    let sent = cobs::decode_vec(&out[..length - 1]).unwrap();
    assert_eq!(sent[7], 3);
    let mut body = body(0, &[4, 0], &[0xFF, 0xFF]);
    body[6] = 0xFE;
    let Ok(BoardMessage::Frame(frame)) = board_result(FRAME, &body) else { panic!("a frame") };
    assert_eq!(frame.head.status, Status::TIMED_OUT);
}

#[test]
fn what_breaks_a_limit_is_not_sent() {
    let mut out = [0; MAX_WIRE];
    let head = FrameHead::default();
    for count in [0, 9, 17, 255, 1089] {
        assert_eq!(encode_frame(head, &vec![0; count], &mut out), Err(EncodeError::ReadingCount(count)));
    }
    let scope = Scope::of_rows(16, &[3, 4], 0xF).unwrap();
    let wrong = Err(EncodeError::ScopeReadings { found: 7, expected: 8 });
    assert_eq!(encode_rows(head, &scope, &[0; 7], &mut out), wrong);
    let head = FrameHead { fraction_bits: 16, ..head };
    assert_eq!(encode_frame(head, &[0; 16], &mut out), Err(EncodeError::FractionBits(16)));
    assert_eq!(encode_log(&[0; 65], &mut out), Err(EncodeError::LogLength(65)));
}

#[test]
fn a_plan_fits_a_board_or_not() {
    let valid = Plan { grounds: [0, 5, 5, 15].into_iter().collect(), reads: 0x8001, rows_a_frame: 2, average_log2: 8 };
    assert!(valid.is_valid(16) && valid.is_valid(32) && Plan::default().is_valid(4));
    let scopes: Vec<_> = (0..3).map(|frame| valid.scope(frame, 16)).collect();
    let rows = |grounds: &[u8]| Scope::of_rows(16, grounds, 0x8001);
    assert_eq!((valid.frames(), scopes), (2, vec![rows(&[0, 5]), rows(&[5, 15]), None]));
    assert_eq!((Plan::default().frames(), Plan::default().scope(0, 16)), (1, Scope::whole(16)));

    let break_it: [fn(&mut Plan); 8] = [
        |plan| plan.grounds[3] = 16,
        |plan| plan.reads = 0x1_0001,
        |plan| plan.reads = 0,
        |plan| plan.rows_a_frame = 3,
        |plan| plan.rows_a_frame = 0,
        |plan| plan.average_log2 = 9,
        |plan| (plan.grounds, plan.rows_a_frame) = ((0..34).map(|_| 0).collect(), 34),
        |plan| plan.grounds.clear(),
    ];
    for (number, break_one) in break_it.into_iter().enumerate() {
        let mut plan = valid.clone();
        break_one(&mut plan);
        assert!(!plan.is_valid(16), "number {number}");
    }
    assert!(!valid.is_valid(8), "eight electrodes have no number 15");
    let large = Plan { grounds: (0..17).map(|_| 1).collect(), reads: 0xFFFF, rows_a_frame: 17, average_log2: 0 };
    assert!(!large.is_valid(16), "more readings than a whole frame");
}

/// The largest whole frame of 16 x 16 readings of 12 bits; the largest frame of all, in a buffer that just holds it; and the longest command.
#[test]
fn the_longest_packets_take_402_and_2109_and_113_bytes() {
    let head = FrameHead { sequence: u16::MAX, time_us: u32::MAX, status: Status(3), folded: 15, fraction_bits: 0 };
    let mut out = [0; 402];
    assert_eq!(encode_frame(head, &[4095; 256], &mut out), Ok(402));
    assert_eq!(wire_bytes(1 + 10 + 384 + 4), 402);

    let grounds: Vec<u8> = (0..32).rev().collect();
    let scope = Scope::of_rows(32, &grounds, u32::MAX).unwrap();
    let mut out = vec![0; MAX_WIRE];
    assert_eq!(MAX_WIRE, 2109);
    let length = encode_rows(head, &scope, &[u16::MAX; 1024], &mut out).unwrap();
    let Ok(BoardMessage::Frame(frame)) = receive_board(&[&out[..length]]).0.remove(0) else { panic!("a frame") };
    assert_eq!((frame.scope, frame.readings.len()), (scope, 1024));

    let grounds = (0..96).map(|row| row % 32).collect();
    let plan = Plan { grounds, reads: u32::MAX, rows_a_frame: 32, average_log2: 8 };
    let request = Request { tag: 255, command: Command::Scan(plan) };
    assert_eq!((request_wire(&request).len(), MAX_COMMAND), (MAX_COMMAND, 113));
}

#[test]
fn a_flood_without_zeros_is_counted_and_forgotten() {
    let message = board_wire(&BoardMessage::Hello(hello()));
    let flood = [0x55; 1000];
    let chunks: Vec<&[u8]> = [&flood[..]; 1000].into_iter().chain([&[0][..], &message]).collect();
    let (received, counters) = receive_board(&chunks);
    assert_eq!(received, [Err(DecodeError::Corrupt), Ok(BoardMessage::Hello(hello()))]);
    assert_eq!(counters, Counters { messages: 1, corrupt: 1, dropped_bytes: 1_000_000, ..Counters::default() });
}

/// A whole packet of which the receiver's room holds all but the last bytes: what it held, and what it holds next, are not taken for it.
#[test]
fn a_stretch_that_is_too_long_is_junk_though_its_beginning_is_a_packet() {
    let request = Request { tag: 7, command: Command::Hello };
    let packet = request_wire(&request);
    let (whole, zero) = packet.split_at(packet.len() - 1);
    // One block of COBS after the other: what fits the room alone would be a stuffed packet of its own.
    let mut stream = whole.to_vec();
    stream.resize(MAX_COMMAND + 40, 0x55);
    let mut receiver = tactomo_protocol::CommandReceiver::default();
    let mut received = Vec::new();
    for mut chunk in [whole, &stream[whole.len()..], zero, &packet[..]] {
        received.extend(std::iter::from_fn(|| receiver.receive(&mut chunk)));
    }
    assert_eq!(received, [Err(DecodeError::Corrupt), Ok(request)]);
    let expected = Counters { messages: 1, corrupt: 1, dropped_bytes: stream.len() as u64, ..Counters::default() };
    assert_eq!(receiver.counters(), expected);
}
