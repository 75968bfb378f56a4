//! A run from bytes to snapshots, on a board of bytes only.

use std::sync::Arc;
use std::time::Duration;

use tactomo::board::identity::identity;
use tactomo::board::link::{Control, Link};
use tactomo::board::record::{Header, Recorder};
use tactomo::board::session::{GreetError, RequestedSettings, greet};
use tactomo::board::source::{Opened, Recording};
use tactomo::detector::{Calibration, Detector};
use tactomo::forward::jacobian::Jacobian;
use tactomo::forward::shell::Shell;
use tactomo::run::options::{LiveError, MakeSolver, RunOptions};
use tactomo::run::{LinkState, Request, Snapshot};
use tactomo::scene::Contact;
use tactomo::solve::{Lambda, Method, Tikhonov, Variant};
use tactomo_protocol::Settings;

use crate::fake::{FakeBoard, Links, Patient, ends, options, solving};

fn opened(link: impl Link + 'static) -> Opened {
    Opened::new(Box::new(link))
}

fn imaging() -> RunOptions {
    let make: MakeSolver = Arc::new(|order| {
        let jacobian = Jacobian::of(&Shell::with_nodes(&order.detector, 500)?);
        Ok(Box::new(Tikhonov::new(&jacobian, Lambda::default(), Variant::Balanced)))
    });
    RunOptions { solving: Some(solving(make)), ..options() }
}

#[test]
fn frames_become_images_and_everything_is_counted() {
    let board = FakeBoard { skip_every: 10, junk_every: 25, ..FakeBoard::new(1000) };
    let (ends, other) = ends();
    let summary = tactomo::run::run(&mut Patient(Some(board)), imaging(), ends).unwrap();
    assert_eq!((summary.source.as_str(), summary.solver.as_str()), ("fake board", "tikhonov"));
    assert_eq!((summary.frames, summary.dropped, summary.corrupt), (1000, 100, 40));
    assert!(summary.latency_us.p50 > 0.0 && summary.latency_us.p50 <= summary.latency_us.max);
    let snapshot = other.snapshots.borrow().clone();
    let answer = snapshot.answer.as_ref().unwrap();
    assert_eq!(answer.frame.measured.electrodes(), 16);
    assert!(answer.solution.image_s_per_m2.as_ref().is_some_and(|image| image.len() > 300));
    assert!(matches!(&snapshot.link, LinkState::Ended(_)));
    assert_eq!(snapshot.hello.as_ref().unwrap().board, "fake");
}

#[test]
fn a_board_with_other_electrodes_than_the_detector_is_refused() {
    let board = FakeBoard { electrodes: 8, ..FakeBoard::new(10) };
    let error = tactomo::run::run(&mut opened(board), options(), ends().0).unwrap_err();
    assert!(matches!(error, LiveError::Mismatch(_)), "{error:?}");
}

#[test]
fn a_detector_that_was_calibrated_on_another_board_is_shown_as_such() {
    let calibration = |board: &str| Calibration { board: Some(board.to_owned()), ..Calibration::default() };
    let notice = |board: &str| {
        let options = options();
        let detector = Detector { calibration: Some(calibration(board)), ..options.detector };
        let (ends, other) = ends();
        tactomo::run::run(&mut opened(FakeBoard::new(5)), RunOptions { detector, ..options }, ends).unwrap();
        let snapshot = other.snapshots.borrow().clone();
        (snapshot.calibration.clone(), identity(snapshot.hello.as_ref().unwrap()))
    };
    let (other, this) = notice("esp32");
    assert!(other.unwrap().contains(&format!("on another board (esp32) than this one ({this})")));
    assert_eq!(notice(&this).0, None);
}

#[test]
fn settings_that_are_asked_for_reach_the_board() {
    let settings = Settings { settle_us: 70, average_log2: 3, ..Settings::default() };
    let wanted = RequestedSettings { settle_us: Some(70), average_log2: Some(3), ..RequestedSettings::default() };
    let (ends, other) = ends();
    tactomo::run::run(&mut opened(FakeBoard::new(5)), RunOptions { settings: wanted, ..options() }, ends).unwrap();
    assert_eq!(other.snapshots.borrow().hello.as_ref().unwrap().settings, settings);
}

#[test]
fn a_board_that_is_unplugged_is_waited_for() {
    let lost = FakeBoard { breaks: true, ..FakeBoard::new(50) };
    let summary = tactomo::run::run(&mut Links(vec![lost, FakeBoard::new(70)]), options(), ends().0).unwrap();
    assert_eq!((summary.frames, summary.dropped), (120, 0));
}

#[test]
fn a_link_that_cannot_come_back_is_an_error() {
    let lost = FakeBoard { breaks: true, ..FakeBoard::new(50) };
    let error = tactomo::run::run(&mut opened(lost), options(), ends().0).unwrap_err();
    assert!(matches!(error, LiveError::Link { .. }), "{error:?}");
}

#[test]
fn a_board_of_a_newer_protocol_is_refused() {
    let error = tactomo::run::run(&mut opened(Says(newer_hello())), options(), ends().0).unwrap_err();
    let LiveError::Greet { error: GreetError::Version { found: NEWER }, .. } = &error else { panic!("{error:?}") };
    assert!(error.to_string().contains(&format!("version {NEWER}")), "{error}");
}

#[test]
fn a_board_that_says_nothing_of_use_is_given_up() {
    let mut link = Says(b"ets Jun  8 2016 00:22:57\r\n\0".to_vec());
    let deadline = std::time::Instant::now() + Duration::from_millis(50);
    let error = greet(&mut link, deadline).unwrap_err();
    assert!(error.to_string().contains("\"ets Jun  8 2016 00:22:57"), "{error}");
}

#[test]
fn presses_reach_the_simulated_detector_and_the_stop_ends_the_run() {
    let board = FakeBoard::new(u64::MAX);
    let asked = Arc::clone(&board.asked);
    let (ends, other) = ends();
    let contact = Contact::flat(0.01, 0.0, 0.002, 1e-3);
    let presses = [Control::Press(vec![contact]), Control::Press(Vec::new())];
    for request in presses.clone().map(Request::Control) {
        other.requests.send(request).unwrap();
    }
    other.requests.send(Request::Rezero).unwrap();
    let runs = std::thread::spawn(move || tactomo::run::run(&mut opened(board), options(), ends).unwrap());
    while asked.lock().unwrap().len() < 2 {
        std::thread::yield_now();
    }
    other.stop();
    runs.join().unwrap();
    assert_eq!(*asked.lock().unwrap(), presses);
}

#[test]
fn a_recording_plays_as_it_was_received() {
    let file = std::env::temp_dir().join(format!("tactomo-{}-pipeline", std::process::id()));
    let recorder = Recorder::create(&file, &Header::default()).unwrap();
    let board = FakeBoard { skip_every: 7, junk_every: 9, ..FakeBoard::new(500) };
    let live =
        tactomo::run::run(&mut opened(board), RunOptions { recorder: Some(recorder), ..options() }, ends().0).unwrap();
    let mut recording = Recording { path: file.clone(), speed: f64::INFINITY, stays_open: false };
    let played = tactomo::run::run(&mut recording, options(), ends().0).unwrap();
    std::fs::remove_file(file).unwrap();
    assert_eq!((played.frames, played.dropped, played.corrupt), (live.frames, live.dropped, live.corrupt));
    assert_eq!(played.frames, 500);
}

#[test]
fn the_solver_changes_while_frames_go_on() {
    let make: MakeSolver = Arc::new(|order| {
        let method = order.method;
        std::thread::sleep(Duration::from_millis(if method == Method::Noser { 200 } else { 0 }));
        let jacobian = Jacobian::of(&Shell::with_nodes(&order.detector, 300)?);
        match method {
            Method::Noser => Ok(Box::new(Tikhonov::noser(&jacobian, Lambda::default()))),
            Method::Tsvd => Err("no images".into()),
            _ => Ok(Box::new(Tikhonov::new(&jacobian, Lambda::default(), Variant::Balanced))),
        }
    });
    let options = RunOptions { solving: Some(solving(make)), ..options() };
    let (ends, other) = ends();
    let runs =
        std::thread::spawn(move || tactomo::run::run(&mut opened(FakeBoard::new(u64::MAX)), options, ends).unwrap());
    let told = |wanted: &dyn Fn(&Snapshot) -> bool| loop {
        let snapshot = other.snapshots.borrow().clone();
        if wanted(&snapshot) {
            return snapshot.statistics.frames;
        }
        assert!(!runs.is_finished());
        std::thread::sleep(Duration::from_millis(1));
    };
    told(&|snapshot| snapshot.answer.is_some());
    other.requests.send(Request::Solver(Method::Noser)).unwrap();
    let begun = told(&|snapshot| snapshot.solver.as_ref().is_some_and(|solver| solver.making == Some(Method::Noser)));
    let changed = told(&|snapshot| snapshot.solver.as_ref().is_some_and(|solver| solver.method == Method::Noser));
    assert!(changed > begun + 20, "{} frames while the solver was made", changed - begun);
    other.requests.send(Request::Solver(Method::Tsvd)).unwrap();
    told(&|snapshot| snapshot.solver.as_ref().is_some_and(|solver| solver.refused.is_some()));
    other.stop();
    let summary = runs.join().unwrap();
    assert_eq!((summary.solver.as_str(), summary.dropped, summary.corrupt), ("noser", 0, 0));
}

/// A link that says the same once, and then nothing.
struct Says(Vec<u8>);

impl Link for Says {
    fn name(&self) -> String {
        "a link".to_owned()
    }

    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = buffer.len().min(self.0.len());
        buffer.iter_mut().zip(self.0.drain(..count)).for_each(|(place, byte)| *place = byte);
        Ok(count)
    }

    fn write_all(&mut self, _bytes: &[u8]) -> std::io::Result<()> {
        Ok(())
    }
}

/// A version of the protocol that this program does not know.
const NEWER: u8 = tactomo_protocol::VERSION + 1;

/// A packet in it: a body without zeros whose checksum has none either is its own COBS.
fn newer_hello() -> Vec<u8> {
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    let packet = (1..=255u8).find_map(|byte| {
        let body = [NEWER << 4, byte, 7, 7];
        let packet: Vec<u8> = body.into_iter().chain(crc.checksum(&body).to_le_bytes()).collect();
        (!packet.contains(&0)).then_some(packet)
    });
    let packet = packet.unwrap();
    [&[packet.len() as u8 + 1], packet.as_slice(), &[0]].concat()
}
