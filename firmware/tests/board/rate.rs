//! The rate of the line: set on trial, confirmed, and given up without a host.

use proptest::prelude::*;
use tactomo_firmware::Activity;
use tactomo_protocol::{BoardMessage, Command, Fault};

use crate::more_parts::{faults, numbered, scan};
use crate::parts::{Outside, frames, hellos, simple_board, step};

const RATES: [u32; 3] = [921_600, 2_000_000, 3_000_000];

fn outside() -> Outside {
    let outside = Outside::default();
    (outside.wire.borrow_mut().rates, outside.wire.borrow_mut().baud) = (&RATES, RATES[0]);
    outside
}

fn baud(outside: &Outside) -> u32 {
    outside.wire.borrow().baud
}

#[test]
fn a_rate_that_the_line_does_not_have_is_refused_and_changes_nothing() {
    let without = Outside::default();
    for (outside, baud) in [(without, 921_600), (outside(), 1_500_000), (outside(), 0)] {
        let mut board = simple_board(&outside, numbered);
        step(&mut board, 1);
        outside.messages();
        outside.send_tagged(9, Command::Rate { baud });
        step(&mut board, 3);
        let messages = outside.messages();
        assert_eq!(faults(&messages), [&Fault::BadRate { answers: 9 }]);
        assert!(hellos(&messages).is_empty() && outside.wire.borrow().changes.is_empty());
    }
}

#[test]
fn the_rate_changes_behind_the_answer_and_nothing_is_sent_before_the_host_is_heard() {
    let outside = outside();
    let mut board = simple_board(&outside, numbered);
    outside.send(Command::Start);
    scan(&mut board, 3);
    outside.messages();
    outside.set_room(7);
    outside.send_tagged(5, Command::Rate { baud: 3_000_000 });
    for _ in 0..200 {
        step(&mut board, 1);
    }
    assert_eq!(baud(&outside), 3_000_000);
    let sent = outside.wire.borrow().sent.len();
    assert_eq!(outside.wire.borrow().changes, [sent], "and nothing behind it");
    let before = outside.messages();
    assert_eq!(hellos(&before).last().map(|hello| hello.answers), Some(5));
    outside.set_room(usize::MAX);
    outside.send_tagged(6, Command::Hello);
    scan(&mut board, 2);
    outside.send_tagged(7, Command::Rate { baud: 3_000_000 });
    scan(&mut board, 3);
    let after = outside.messages();
    assert_eq!(hellos(&after).iter().map(|hello| hello.answers).collect::<Vec<_>>(), [6, 7]);
    let numbers: Vec<u16> =
        frames(&before).into_iter().chain(frames(&after)).map(|frame| frame.head.sequence).collect();
    assert!(numbers.len() > 3 && numbers.windows(2).all(|pair| pair[1] == pair[0] + 1), "{numbers:?}");
}

#[test]
fn a_rate_that_is_not_confirmed_is_given_up_after_300_ms_whatever_else_is_said() {
    let outside = outside();
    let mut board = simple_board(&outside, numbered);
    for kept in [921_600, 2_000_000] {
        outside.send(Command::Rate { baud: kept });
        step(&mut board, 3);
        outside.send(Command::Rate { baud: kept });
        step(&mut board, 3);
        outside.send(Command::Rate { baud: 3_000_000 });
        step(&mut board, 3);
        assert_eq!(baud(&outside), 3_000_000);
        for _ in 0..29 {
            outside.advance_us(10_000);
            outside.send(Command::Hello);
            step(&mut board, 1);
            assert_eq!(baud(&outside), 3_000_000);
        }
        outside.advance_us(10_000);
        step(&mut board, 3);
        assert_eq!(baud(&outside), kept, "the last that was confirmed");
        outside.send_tagged(77, Command::Hello);
        step(&mut board, 1);
        assert_eq!(hellos(&outside.messages()).last().unwrap().answers, 77, "it speaks again");
    }
}

#[test]
fn a_rate_is_kept_as_long_as_a_host_is_heard_every_two_seconds() {
    let outside = outside();
    let mut board = simple_board(&outside, numbered);
    for _ in 0..2 {
        outside.send(Command::Rate { baud: 2_000_000 });
        step(&mut board, 3);
    }
    for _ in 0..5 {
        outside.advance_us(1_900_000);
        step(&mut board, 3);
        outside.send(Command::Hello);
        step(&mut board, 3);
        assert_eq!(baud(&outside), 2_000_000);
    }
    outside.send(Command::Start);
    scan(&mut board, 1);
    outside.advance_us(1_000_000);
    // Bytes that are no command keep nothing.
    outside.send_bytes(b"\x05noise\0\x03\x48\0");
    scan(&mut board, 1);
    outside.advance_us(1_000_000);
    scan(&mut board, 2);
    assert_eq!(baud(&outside), 921_600);
    let before = frames(&outside.messages()).len();
    assert!(before > 0);
    while board.step().unwrap() != Activity::Frame {}
    step(&mut board, 1);
    assert!(!frames(&outside.messages()).is_empty(), "the stream goes on");
}

proptest! {
    /// However slow the line is, and whatever waits: all of the answer leaves at the old rate, nothing behind it, and no packet is cut.
    #[test]
    fn an_answer_has_left_before_the_rate_changes(rooms in prop::collection::vec(0..60usize, 1..40), before in 0..50usize, hellos_before in 0..3) {
        let outside = outside();
        let mut board = simple_board(&outside, numbered);
        outside.send(Command::Start);
        step(&mut board, 40);
        outside.messages();
        outside.set_room(rooms[0]);
        step(&mut board, before);
        (0..hellos_before).for_each(|_| outside.send(Command::Hello));
        outside.send_tagged(5, Command::Rate { baud: 2_000_000 });
        let mut rooms = rooms.into_iter().cycle();
        let mut steps = 0;
        while baud(&outside) == RATES[0] && steps < 3000 {
            outside.set_room(if steps < 2000 { rooms.next().unwrap() } else { usize::MAX });
            step(&mut board, 1);
            steps += 1;
        }
        prop_assert_eq!(baud(&outside), 2_000_000);
        let sent = outside.wire.borrow().sent.len();
        outside.set_room(usize::MAX);
        step(&mut board, 40);
        prop_assert_eq!((&outside.wire.borrow().changes, outside.wire.borrow().sent.len()), (&vec![sent], sent));
        let messages = outside.messages();
        let last = messages.last();
        prop_assert!(matches!(last, Some(BoardMessage::Hello(hello)) if hello.answers == 5), "{:?}", last);
    }
}
