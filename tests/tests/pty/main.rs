//! The host against boards at the other end of a pseudo-terminal: good ones, rude ones, and ones that are pulled out.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should")]

mod board;
mod first_look;
mod host;
mod learned;

use std::thread;
use std::time::{Duration, Instant};

use board::Board;
use host::Host;
use serialport::SerialPort;
use tactomo::board::link::serial::{DEFAULT_BAUD, SerialLink};
use tactomo::board::session::greet;
use tactomo::run::options::RunOptions;
use tactomo::run::{LinkState, Snapshot};
use tactomo_protocol::{BoardMessage, Command, Fault};

/// What a chip's boot loader says.
const BOOT_TEXT: &[u8] = b"ets Jul 29 2019 12:21:46\r\n\r\nrst:0x1 (POWERON_RESET),boot:0x13 (SPI_FAST_FLASH_BOOT)\r\n";

#[test]
fn a_board_that_streams_already_is_joined_in_the_middle_of_a_frame() {
    let mut board = Board::plug("join");
    let host = Host::start(board.port());
    let tag = board.wait_for(Command::Hello);
    let frame = board.next_frame();
    board.raw(&frame[100..]);
    board.frames(5);
    board.answer(tag);
    board.wait_for_start();
    board.frames(50);
    host.wait_for_frames(50);
    let summary = host.finish().unwrap();
    assert_eq!(
        (summary.frames, summary.dropped, summary.corrupt),
        (50, 0, 0),
        "what came before Hello counts as nothing"
    );
}

#[test]
fn garbage_between_frames_is_counted_and_garbage_within_costs_one_frame() {
    let mut board = Board::plug("garbage");
    let host = Host::start(board.port());
    board.greet();
    for _ in 0..10 {
        board.frames(5);
        // Two stretches of junk between two zeros: a log sent raw.
        board.raw(&[0xFF, 0, 0x13, 0x07, 0xFF, 0]);
        board.frames(5);
        // The boot text swallows the frame behind it, with whose zero it ends.
        board.raw(BOOT_TEXT);
    }
    board.frames(5);
    host.wait_for_frames(95);
    let summary = host.finish().unwrap();
    assert_eq!((summary.frames, summary.dropped, summary.corrupt), (95, 10, 30));
}

#[test]
fn a_board_that_answers_what_it_was_not_asked_is_told_as_such() {
    let mut board = Board::plug("tags");
    let host = Host::start(board.port());
    for _ in 0..3 {
        let tag = board.wait_for(Command::Hello);
        board.answer(tag.wrapping_add(100));
        board.frames(2);
    }
    let error = host.ended().unwrap_err().to_string();
    assert!(
        error.contains("never to what it was asked") && error.contains("name command 101, and command 1"),
        "{error}"
    );
}

#[test]
fn a_flood_without_zeros_ends_with_the_next_frame() {
    let mut board = Board::plug("flood");
    let host = Host::start(board.port());
    board.greet();
    board.frames(1);
    board.raw(&vec![0x55; 4 << 20]);
    board.raw(&[0]);
    board.frames(20);
    host.wait_for_frames(21);
    let summary = host.finish().unwrap();
    assert_eq!((summary.frames, summary.dropped, summary.corrupt), (21, 0, 1));
}

#[test]
fn a_million_random_bytes_on_each_port_at_once_cost_no_frame_behind_them() {
    let on_port = |seed: u64| {
        let mut board = Board::plug(&format!("random-{seed}"));
        let host = Host::start(board.port());
        board.greet();
        board.frames(10);
        let mut random = fastrand::Rng::with_seed(seed);
        board.raw(&std::iter::repeat_with(|| random.u8(..)).take(1 << 20).collect::<Vec<_>>());
        // What they end with is no packet's beginning.
        board.raw(&[0]);
        board.frames(20);
        host.wait_for_frames(30);
        let summary = host.finish().unwrap();
        assert_eq!((summary.frames, summary.dropped), (30, 0), "port {seed}");
        assert!(summary.corrupt > 1000, "{} of port {seed}", summary.corrupt);
    };
    thread::scope(|ports| (1..=4).for_each(|seed| _ = ports.spawn(move || on_port(seed))));
}

#[test]
fn a_board_that_stalls_is_waited_for_and_asked_again() {
    let mut board = Board::plug("stall");
    let host = Host::start(board.port());
    board.greet();
    let frame = board.next_frame();
    for byte in frame {
        board.raw(&[byte]);
    }
    let frame = board.next_frame();
    board.raw(&frame[..200]);
    board.wait_for(Command::Hello);
    board.raw(&frame[200..]);
    board.frames(10);
    host.wait_for_frames(12);
    let summary = host.finish().unwrap();
    assert_eq!((summary.frames, summary.dropped, summary.corrupt), (12, 0, 0));
}

#[test]
fn a_board_that_starts_anew_is_started_again() {
    let mut board = Board::plug("reset");
    let host = Host::start(board.port());
    board.greet();
    board.frames(10);
    board.reset();
    board.raw(BOOT_TEXT);
    board.raw(&[0]);
    board.say(&BoardMessage::Fault(Fault::Reset("watchdog".try_into().unwrap())));
    board.answer(0);
    board.wait_for_start();
    board.frames(10);
    host.wait_for_frames(20);
    let summary = host.finish().unwrap();
    assert_eq!((summary.frames, summary.dropped, summary.corrupt), (20, 0, 1), "the boot text is the only loss");
}

#[test]
fn a_board_that_is_unplugged_is_taken_up_again_when_it_comes_back() {
    let mut board = Board::plug("unplug");
    let host = Host::start(board.port());
    board.greet();
    board.frames(10);
    host.wait_for_frames(10);
    board.unplug();
    host.wait_until("the loss is told", |snapshot| matches!(snapshot.link, LinkState::Lost(_)));
    let mut board = Board::plug("unplug");
    board.greet();
    board.frames(10);
    host.wait_for_frames(20);
    host.wait_until("frames come in again", |snapshot| snapshot.link == LinkState::Streaming);
    let summary = host.finish().unwrap();
    assert_eq!((summary.frames, summary.dropped, summary.corrupt), (20, 0, 0));
}

/// One of several, whose board is waited for.
fn waiting(options: RunOptions) -> RunOptions {
    RunOptions { waits: true, ..options }
}

/// Whether a board is waited for, for a reason with such words in it.
fn is_absent(snapshot: &Snapshot, words: &str) -> bool {
    matches!(&snapshot.link, LinkState::Absent(reason) if reason.contains(words))
}

#[test]
fn a_board_that_is_not_there_at_the_start_is_waited_for_where_it_is_one_of_several() {
    let mut board = Board::plug("late");
    board.unplug();
    let port = board.port().display().to_string();
    let host = Host::with(board.port(), waiting);
    host.wait_until("the port is missed", |snapshot| is_absent(snapshot, &format!("there is no serial port {port}")));
    let mut board = Board::plug("late");
    board.greet();
    board.frames(10);
    host.wait_for_frames(10);
    host.wait_until("frames come in", |snapshot| snapshot.link == LinkState::Streaming);
    let summary = host.finish().unwrap();
    assert_eq!((summary.frames, summary.dropped, summary.source), (10, 0, port));
}

#[test]
fn a_board_that_does_not_answer_at_the_start_is_asked_again_where_it_is_one_of_several() {
    let mut board = Board::plug("mute");
    let host = Host::with(board.port(), waiting);
    host.wait_until("the silence is told", |snapshot| is_absent(snapshot, "no board said Hello"));
    board.greet();
    board.frames(10);
    host.wait_for_frames(10);
    assert_eq!(host.finish().unwrap().frames, 10);
}

#[test]
fn a_board_that_does_not_come_in_time_is_an_error_at_the_end() {
    let mut board = Board::plug("never");
    board.unplug();
    let limit = Duration::from_millis(700);
    let host = Host::with(board.port(), |options| RunOptions { seconds: Some(limit), ..waiting(options) });
    let begin = Instant::now();
    let error = host.ended().unwrap_err().to_string();
    assert!(begin.elapsed() >= limit && error.contains(board.port().to_str().unwrap()), "{error}");
    let host = Host::with(board.port(), waiting);
    assert_eq!(host.finish().unwrap().frames, 0, "who ends it by hand knows");
    assert!(Host::start(board.port()).ended().is_err(), "alone it is an error at once");
}

#[test]
fn a_board_of_a_newer_protocol_is_refused_by_name() {
    let mut board = Board::plug("newer");
    let host = Host::start(board.port());
    board.wait_for(Command::Hello);
    // The example of docs/protocol-examples.md.
    board.raw(&[0x08, 0x50, 0xC0, 0xDE, 0x3F, 0xDF, 0x6C, 0x39, 0x00]);
    let message = host.ended().unwrap_err().to_string();
    for part in [board.port().to_str().unwrap(), "version 5", "version 4", "tactomo board flash"] {
        assert!(message.contains(part), "{part} is missing in: {message}");
    }
}

#[test]
fn a_port_with_another_program_on_the_board_is_told_by_its_junk() {
    let mut board = Board::plug("junk");
    let mut link = SerialLink::open(board.port().to_str().unwrap(), DEFAULT_BAUD).unwrap();
    board.raw(b"temperature 21.5\r\n\0temperature 21.6\r\n\0");
    let message = greet(&mut link, Instant::now() + Duration::from_millis(200)).unwrap_err().to_string();
    assert!(
        message.contains("bytes came that were no message") && message.contains("\"temperature 21.5\""),
        "{message}"
    );
}

#[test]
fn a_busy_port_is_told_at_once() {
    let board = Board::plug("busy");
    let mut other = serialport::new(board.port().to_str().unwrap(), DEFAULT_BAUD).open_native().unwrap();
    other.set_exclusive(true).unwrap();
    let message = Host::start(board.port()).ended().unwrap_err().to_string();
    assert!(message.contains(board.port().to_str().unwrap()) && message.contains("busy"), "{message}");
    assert!(other.bytes_to_read().is_ok(), "the other program keeps its port");
}

#[test]
fn a_port_that_is_gone_is_told_at_once() {
    let mut board = Board::plug("gone");
    board.unplug();
    thread::sleep(Duration::from_millis(10));
    let message = Host::start(board.port()).ended().unwrap_err().to_string();
    assert!(
        message.contains("there is no serial port") && message.contains(board.port().to_str().unwrap()),
        "{message}"
    );
}
