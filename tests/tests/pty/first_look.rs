//! A first look at a port without a board's firmware, and at one that has it.

use std::thread::{self, JoinHandle};

use super::BOOT_TEXT;
use super::board::Board;
use tactomo::board::check::{Counted, ListenError, Listening};
use tactomo::board::link::serial::DEFAULT_BAUD;
use tactomo::board::session::RequestedSettings;
use tactomo::board::source::NamedPort;
use tactomo_protocol::{BoardMessage, Command, Fault};

fn look(board: &Board) -> JoinHandle<Result<Listening, ListenError>> {
    let mut source = NamedPort { port: board.port().display().to_string(), baud: DEFAULT_BAUD };
    thread::spawn(move || Listening::open(&mut source, RequestedSettings::default()))
}

#[test]
fn what_a_boot_loader_says_is_shown_and_explained() {
    let mut board = Board::plug("download");
    let looking = look(&board);
    board.wait_for(Command::Hello);
    board.raw(BOOT_TEXT);
    board.raw(b"waiting for download\r\n");
    let message = looking.join().unwrap().err().unwrap().to_string();
    for part in ["no board said Hello", "rst:0x1 (POWERON_RESET)", "\"waiting for download\"", "boot pin"] {
        assert!(message.contains(part), "{part} is missing in: {message}");
    }
}

#[test]
fn frames_and_faults_of_a_board_are_taken_and_its_boot_text_is_not_counted() {
    let mut board = Board::plug("first-look");
    let looking = look(&board);
    let tag = board.wait_for(Command::Hello);
    board.raw(BOOT_TEXT);
    board.raw(&[0]);
    board.answer(tag);
    let mut listening = looking.join().unwrap().unwrap();
    let serving = thread::spawn(move || {
        board.wait_for_start();
        board.say(&BoardMessage::Fault(Fault::AdcStuck));
        board.frames(3);
        board.next_frame();
        board.frames(3);
        board
    });
    let mut frames = Vec::new();
    while frames.len() < 6 {
        frames.extend(listening.next_frame().unwrap());
    }
    drop(serving.join().unwrap());
    // The scripted board's reading `i` is `8 i` codes of 12 bits of 3.3 V.
    assert!((frames[0].at(1, 2) - 8.0 * 18.0 * 3.3 / 4096.0).abs() < 1e-12);
    assert_eq!(listening.counted(), Counted { frames: 6, dropped: 1, corrupt: 0 });
    assert_eq!(listening.faults(), [Fault::AdcStuck]);
}
