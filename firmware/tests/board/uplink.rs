//! The uplink on fast, slow and dead lines.

use tactomo_protocol::{BoardMessage, BoardReceiver, Command, DecodeError, Fault, Plan, Settings};

use super::more_parts::*;
use super::parts::*;

#[test]
fn a_lone_zero_cuts_boot_text_off_and_hello_follows() {
    let outside = Outside::default();
    simple_board(&outside, numbered).step().unwrap();
    assert_eq!(outside.wire.borrow().sent[0], 0);
    let messages = outside.messages();
    let [BoardMessage::Hello(hello)] = &messages[..] else { panic!("{messages:?}") };
    assert_eq!((hello.board.as_str(), hello.firmware_version.as_str(), hello.electrodes), ("test", "1.2.3", 16));
    assert_eq!((hello.adc_bits, hello.adc_full_scale_mv, hello.drive_mv), (12, 3300, 2000));
}

#[test]
fn a_line_that_takes_one_byte_at_a_time_carries_whole_frames() {
    let outside = Outside::default();
    outside.set_room(1);
    let mut board = simple_board(&outside, restless);
    outside.send(Command::Start);
    scan(&mut board, 20);
    outside.send(Command::Stop);
    step(&mut board, 2000);

    let messages = outside.messages();
    let frames = frames(&messages);
    assert_eq!(frames.iter().map(|frame| frame.head.sequence).collect::<Vec<_>>(), Vec::from_iter(0..20));
    // About 272 bytes leave a scan, one before each conversion and one a step; a frame has 334 and less, as means are less restless.
    assert!(
        frames[1..].iter().all(|frame| frame.head.folded <= 1) && frames.iter().any(|frame| frame.head.folded == 1)
    );
    let mut scans = 0;
    for frame in frames {
        let count = u64::from(frame.head.folded) + 1;
        let of_scans = |i: u64| (scans..scans + count).map(move |scan| restless(256 * scan + i, 0).unwrap());
        let mean = |i| (of_scans(i).map(u64::from).sum::<u64>() + count / 2) / count;
        assert!(frame.readings.iter().map(|reading| u64::from(*reading)).eq((0..256).map(mean)), "scan {scans}");
        assert_eq!(u64::from(frame.head.time_us), (2 * scans + count) * u64::from(frame_us()) / 2, "their middle");
        scans += count;
    }
    assert_eq!(256 * scans, outside.conversions.get(), "no conversion was for nothing");
}

/// Time of a scan of the test board (us).
fn frame_us() -> u32 {
    16 * (20 + 16 * CONVERSION_US as u32)
}

#[test]
fn a_dead_line_does_not_slow_the_scan_and_what_comes_then_is_new() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Start);
    scan(&mut board, 3);
    let before = outside.messages();
    assert_eq!(frames(&before).iter().map(|frame| frame.head.sequence).collect::<Vec<_>>(), [0, 1, 2]);

    outside.set_room(0);
    let begin_us = outside.clock_us.get();
    step(&mut board, 16 * 1000);
    let now_us = outside.clock_us.get();
    assert_eq!(now_us - begin_us, 1000 * u64::from(frame_us()), "at full rate");
    assert!(outside.messages().is_empty());

    outside.set_room(usize::MAX);
    scan(&mut board, 2);
    let after = outside.messages();
    let heads: Vec<_> = frames(&after).iter().map(|frame| (frame.head.sequence, frame.head.folded)).collect();
    // No byte of a frame was gone when the line died, so that of the last sixteen scans that are complete replaced it.
    assert_eq!(heads, [(3, 15), (4, 7), (5, 0)]);
    let age_us = now_us - u64::from(frames(&after)[0].head.time_us);
    assert!(age_us < 32 * u64::from(frame_us()), "{age_us} us");
}

/// A host that lost a key loses the frames that need it, and no more; a frame that is not sent is nobody's key.
#[test]
fn a_frame_is_coded_by_a_key_that_was_sent_and_a_key_comes_again() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Start);
    scan(&mut board, 2);
    let sent = std::mem::take(&mut outside.wire.borrow_mut().sent);
    let lengths: Vec<_> = sent.split_inclusive(|byte| *byte == 0).map(<[u8]>::len).filter(|bytes| *bytes > 1).collect();
    let [_hello, _clock, _started, key, coded] = lengths[..] else { panic!("{lengths:?}") };
    assert!(key > 330 && coded < 60, "a key of {key} bytes, and one bit a reading: {coded} bytes");
    scan(&mut board, 60);
    let sent = std::mem::take(&mut outside.wire.borrow_mut().sent);
    let (mut receiver, mut input) = (BoardReceiver::default(), &sent[..]);
    let came: Vec<_> = std::iter::from_fn(|| receiver.receive(&mut input)).collect();
    let lost = came.iter().take_while(|packet| **packet == Err(DecodeError::Key)).count();
    assert_eq!((lost, receiver.counters().without_key, receiver.counters().corrupt), (30, 30, 0));
    assert!(came[lost..].iter().all(Result::is_ok));
    // Another host stops and starts it, and has no key either.
    outside.send(Command::Stop);
    step(&mut board, 1);
    outside.send(Command::Start);
    scan(&mut board, 2);
    let sent = std::mem::take(&mut outside.wire.borrow_mut().sent);
    let (mut receiver, mut input) = (BoardReceiver::default(), &sent[..]);
    let came: Vec<_> = std::iter::from_fn(|| receiver.receive(&mut input)).map(Result::unwrap).collect();
    assert_eq!(frames(&came).len(), 2);
}

#[test]
fn sequence_numbers_wrap() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Start);
    scan(&mut board, 65_535);
    outside.messages();
    scan(&mut board, 3);
    let messages = outside.messages();
    let numbers: Vec<_> = frames(&messages).iter().map(|frame| frame.head.sequence).collect();
    assert_eq!(numbers, [65_535, 0, 1]);
}

#[test]
fn sending_overlaps_sampling() {
    let outside = Outside::default();
    outside.set_room(8);
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Start);
    scan(&mut board, 1);
    let sent = outside.wire.borrow().sent.len();
    board.step().unwrap();
    let row = outside.wire.borrow().sent.len() - sent;
    assert_eq!(row, 17 * 8, "a push before each of a row's 16 conversions, and one after the row");
}

#[test]
fn answers_go_before_frames_and_logs_between_them() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Start);
    scan(&mut board, 1);
    outside.messages();

    // While the line is blocked, a frame, a log of 100 bytes, a fault and an answer gather.
    outside.set_room(0);
    outside.log.borrow_mut().extend(0..100);
    scan(&mut board, 2);
    board.report(Fault::AdcStuck);
    outside.send(Command::Hello);
    outside.set_room(usize::MAX);
    scan(&mut board, 3);
    let kinds: String = outside.messages().iter().map(kind).collect();
    assert_eq!(kinds, "LXCHXFLFFF", "the log that had begun, faults and answers, then frames and log in turn");
}

fn kind(message: &BoardMessage) -> char {
    match message {
        BoardMessage::Hello(_) => 'H',
        BoardMessage::Frame(_) => 'F',
        BoardMessage::Log(_) => 'L',
        BoardMessage::Fault(_) => 'X',
        BoardMessage::Clock(_) => 'C',
        BoardMessage::Contacts(_) => 'A',
        BoardMessage::Table(_) => 'T',
    }
}

#[test]
fn log_bytes_arrive_in_order() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    let log: Vec<u8> = (0..1000u32).map(|i| (i * 7) as u8).collect();
    outside.log.borrow_mut().extend(&log);
    outside.send(Command::Start);
    scan(&mut board, 30);
    let arrived: Vec<u8> = outside
        .messages()
        .into_iter()
        .filter_map(|message| if let BoardMessage::Log(log) = message { Some(log.0) } else { None })
        .flatten()
        .collect();
    assert_eq!(arrived, log);
}

/// A line that frames fill. The log has its turn all the same.
#[test]
fn a_line_that_is_full_of_frames_carries_the_log_between_them() {
    let outside = Outside::default();
    outside.set_room(1);
    let mut board = simple_board(&outside, restless);
    outside.send(Command::Start);
    scan(&mut board, 10);
    let log: Vec<u8> = (0..=255).chain(0..=63).collect();
    outside.log.borrow_mut().extend(&log);
    scan(&mut board, 30);
    assert!(outside.log.borrow().is_empty(), "{} bytes still wait", outside.log.borrow().len());
    outside.set_room(usize::MAX);
    step(&mut board, 20);
    let messages = outside.messages();
    let arrived: Vec<u8> = messages
        .iter()
        .filter_map(|message| if let BoardMessage::Log(log) = message { Some(log.0.to_vec()) } else { None })
        .flatten()
        .collect();
    assert_eq!(arrived, log);
    let kinds: String = messages.iter().map(kind).collect();
    assert!(frames(&messages).len() > 20, "{kinds}");
}

/// A UART's FIFO holds 128 bytes; what it had at the last look before a conversion has to be taken out of it at once.
#[test]
fn a_whole_fifo_of_commands_is_taken_in_one_look() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Configure(Settings { settle_us: 400, ..Settings::default() }));
    outside.send(Command::Start);
    board.step().unwrap();
    outside.set_room(usize::MAX);
    outside.messages();
    let packet = |command| {
        let other = Outside::default();
        other.send(command);
        other.wire.take().to_board
    };
    let grounds = (0..96).map(|row| row % 16).collect();
    let plan = Plan { grounds, reads: 0x7FFF_FFFF & 0xFFFF, rows_a_frame: 16, average_log2: 8 };
    let mut fifo: Vec<u8> = packet(Command::Scan(plan)).into();
    fifo.extend(packet(Command::Hello));
    let noise = 128 - fifo.len();
    assert!(fifo.len() > 114 && noise > 0, "{} bytes", fifo.len());
    fifo.splice(0..0, vec![0; noise]);
    // It comes while the board waits.
    {
        let mut wire = outside.wire.borrow_mut();
        (wire.soon, wire.pulls) = (fifo, 0);
    }
    board.step().unwrap();
    assert!(outside.wire.borrow().to_board.is_empty(), "{} bytes are left", outside.wire.borrow().to_board.len());
    board.step().unwrap();
    assert_eq!(hellos(&outside.messages()).len(), 2, "both are answered");
}

#[test]
fn a_flood_of_questions_is_answered_as_far_as_there_is_room_and_never_cut() {
    let outside = Outside::default();
    outside.set_room(0);
    let mut board = simple_board(&outside, numbered);
    (0..100).for_each(|_| outside.send(Command::Hello));
    step(&mut board, 100);
    outside.set_room(3);
    step(&mut board, 1000);
    let messages = outside.messages();
    assert!((4..100).contains(&hellos(&messages).len()));
    let others = messages.iter().map(kind).filter(|kind| !"HC".contains(*kind));
    assert_eq!(others.count(), 0, "{messages:?}");
}

/// Faults whose packets take so many bytes on the wire: text and nine more.
fn fault(bytes: usize) -> Fault {
    Fault::Panic("x".repeat(bytes - 9).as_str().try_into().unwrap())
}

/// The queue holds 512 bytes: the zero and the Hello of the start take the first of them.
#[test]
fn the_queue_of_answers_is_filled_to_its_last_byte_and_never_beyond() {
    for missing in [0, 1] {
        let outside = Outside::default();
        outside.set_room(0);
        let mut board = simple_board(&outside, numbered);
        let mut probe = simple_board(&Outside::default(), numbered);
        probe.step().unwrap();
        let outside_of_hello = Outside::default();
        simple_board(&outside_of_hello, numbered).step().unwrap();
        let taken = outside_of_hello.wire.borrow().sent.len();
        let left = 512 - taken;
        (0..left / 100 - 1).for_each(|_| board.report(fault(100)));
        let rest = left % 100 + 100;
        let (first, second) = (rest / 2, rest - rest / 2);
        board.report(fault(first));
        board.report(fault(second + missing));
        board.report(fault(10));
        outside.set_room(usize::MAX);
        step(&mut board, 20);
        let messages = outside.messages();
        let faults = faults(&messages);
        // What does not fit is lost whole; then a shorter one still fits.
        let last = if missing == 0 { second } else { 10 };
        assert_eq!(faults.last(), Some(&&fault(last)), "{missing} too many");
        assert_eq!(faults.len(), left / 100 + 1);
    }
}

#[test]
fn a_frame_of_which_a_byte_is_gone_is_sent_to_its_end() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Start);
    // Some bytes of a frame are gone when the line dies.
    board.step().unwrap();
    outside.messages();
    outside.set_room(0);
    scan(&mut board, 1);
    outside.set_room(1);
    board.step().unwrap();
    outside.set_room(0);
    step(&mut board, 16 * 20);
    outside.set_room(usize::MAX);
    scan(&mut board, 1);
    let messages = outside.messages();
    let heads: Vec<_> = frames(&messages).iter().map(|frame| (frame.head.sequence, frame.head.folded)).collect();
    assert_eq!(heads, [(0, 0), (1, 4)], "of the 20 scans meanwhile 16 were too many for a mean");
}

#[test]
fn the_line_is_looked_after_during_long_waits() {
    let outside = Outside::default();
    let mut board = simple_board(&outside, restless);
    outside.send(Command::Configure(Settings { settle_us: 10_000, ..Settings::default() }));
    outside.send(Command::Start);
    scan(&mut board, 1);
    outside.messages();
    outside.set_room(0);
    scan(&mut board, 1);
    outside.set_room(4);
    // A command comes while the board waits: the FIFO of its UART does not hold it for long.
    outside.send_while_waiting(Command::Hello);
    let (sent, pulls) = (outside.wire.borrow().sent.len(), outside.wire.borrow().pulls);
    board.step().unwrap();
    let pieces = 10_000 / 250 - 1;
    let pushes = (outside.wire.borrow().sent.len() - sent) / 4;
    assert_eq!(pushes, pieces + 16 + 1, "a push a piece, a conversion and a step");
    assert_eq!(outside.wire.borrow().pulls - pulls, pieces + 1);
    assert!(outside.wire.borrow().to_board.is_empty(), "it was taken out of the FIFO");
    outside.set_room(usize::MAX);
    board.step().unwrap();
    assert_eq!(hellos(&outside.messages()).len(), 1, "and is obeyed after the row");
    assert!(outside.watchdog.get().longest_gap_us <= 250 + CONVERSION_US);
}
