//! The talk with a simulated board, from its start to a recording of it.
#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should")]

mod host;
mod models;

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tactomo_board::frames::FrameFile;
use tactomo_board::link::{Control, ControlError, Link, Playing};
use tactomo_board::record::{Header, Recorder};
use tactomo_board::session::RequestedSettings;
use tactomo_board::simulated::{BoardModel, Options, SimulatedBoard};
use tactomo_physics::scene::{Contact, SceneName};
use tactomo_protocol::{Frame, Settings};

use crate::host::{Host, Untouched, board, detector, simulated};

/// The board's Hello of its start and its answer to the first question come in one read, apart, or after the settings were sent; and some commands
/// are lost.
#[test]
fn settings_reach_the_board_before_its_first_frame_every_time() {
    for run in 0..100u64 {
        let requested = RequestedSettings {
            settle_us: Some(70),
            average_log2: Some(1),
            max_frames_per_s: Some(500 + run as u16),
            ..Default::default()
        };
        let mut host = Host::new(board(Untouched::default()), requested);
        // A command is two writes, of which the first ends whatever was on the line before.
        host.board.lost = match run {
            0 => 0b10,
            1 => 0b1000,
            2 => 0b10_0000,
            3 => 0b1000_1010,
            _ => 0,
        };
        std::thread::sleep(Duration::from_micros(run % 6 * 400));
        host.frames_more(2);
        let expected =
            Settings { settle_us: 70, average_log2: 1, max_frames_per_s: 500 + run as u16, ..Settings::default() };
        assert_eq!((host.settings(), host.session.refusal()), (expected, None), "run {run}");
        assert_eq!(host.frames[0].head.sequence, 0);
        assert_eq!(host.frames[0].head.fraction_bits, 1, "the first frame is averaged");
    }
}

#[test]
fn settings_change_while_frames_come() {
    let mut host = Host::new(board(Untouched::default()), RequestedSettings::default());
    host.frames_more(20);
    host.session.request(RequestedSettings { average_log2: Some(2), ..RequestedSettings::default() });
    host.exchange_until("averaged frames", |host| host.frames.last().unwrap().head.fraction_bits == 2);
    host.session.request(RequestedSettings { max_frames_per_s: Some(100), ..RequestedSettings::default() });
    host.exchange_until("a rate", |host| host.settings().max_frames_per_s == 100);
    assert_eq!(host.settings(), Settings { average_log2: 2, max_frames_per_s: 100, ..Settings::default() });
    host.frames_more(5);
    let steps = host.frames.windows(2).map(|pair| pair[1].head.sequence.wrapping_sub(pair[0].head.sequence));
    assert!(steps.into_iter().all(|step| step == 1), "no frame is lost for it");
    assert_eq!(host.session.refusal(), None);
}

/// The simulated board's clock runs as this machine's does, from when its thread began: some time between its making and its first Hello.
#[test]
fn scans_were_when_their_delays_say_within_what_is_told_of_their_errors() {
    for model in [BoardModel::Ideal, BoardModel::Esp32] {
        let made = Instant::now();
        let board = SimulatedBoard::start(&detector(), Box::new(Untouched::default()), Options { seed: 1, model });
        let mut host = Host::new(board.unwrap(), RequestedSettings::default());
        host.exchange_until("hello", |host| host.hello.is_some());
        let greeted = Instant::now();
        host.frames_more(1000);
        let board_s = |frame: &Frame| f64::from(frame.head.time_us) * 1e-6;
        let began = host.timed.iter().zip(&host.frames).map(|((came, delay), frame)| {
            let delay = delay.unwrap();
            let began_s = came.duration_since(made).as_secs_f64() - delay.delay_s - board_s(frame);
            [began_s - delay.error_s, began_s + delay.error_s]
        });
        let [least_s, most_s] = began
            .fold([0.0, f64::INFINITY], |all, [least_s, most_s]| [f64::max(all[0], least_s), f64::min(all[1], most_s)]);
        let latest_s = greeted.duration_since(made).as_secs_f64();
        assert!(least_s <= most_s + 1e-6, "{model:?}: all frames tell of one beginning: {least_s} {most_s}");
        assert!(most_s > 0.0 && least_s < latest_s, "{model:?}: {least_s} to {most_s}, and not {latest_s}");
        let errors_s = host.timed.iter().filter_map(|(_, delay)| delay.map(|delay| delay.error_s));
        assert!(errors_s.fold(f64::INFINITY, f64::min) < 0.1, "{model:?}");
    }
}

#[test]
fn the_scene_begins_with_the_first_frame_however_late_the_host_is() {
    let times = Arc::new(Mutex::new(Vec::new()));
    let mut host = Host::new(board(Untouched(Arc::clone(&times))), RequestedSettings::default());
    // Its clock starts with its thread, which a busy machine may start late: once it has said Hello, it runs.
    host.exchange_until("hello", |host| host.hello.is_some());
    std::thread::sleep(Duration::from_millis(300));
    host.frames_more(3);
    let times = times.lock().unwrap();
    assert_eq!(times[0], 0.0);
    for (time_s, frame) in times.iter().zip(&host.frames) {
        let since_us = frame.head.time_us - host.frames[0].head.time_us;
        assert!((time_s - f64::from(since_us) * 1e-6).abs() < 2e-6);
    }
    assert!(host.frames[0].head.time_us >= 300_000, "the board's own clock runs from its start");
}

#[test]
fn presses_scenes_and_faults_come_while_frames_go_on() {
    let mut host = Host::new(simulated(SceneName::Rest), RequestedSettings::default());
    host.frames_more(20);
    let largest = |frame: &Frame| frame.readings.iter().copied().max().unwrap();
    assert!(largest(host.frames.last().unwrap()) < 30, "noise alone");
    let press = |x_m| Contact::flat(x_m, 0.01, 0.004, 2e-3);
    host.board.control(&Control::Press(vec![press(-0.02), press(0.02)])).unwrap();
    host.exchange_until("a press", |host| largest(host.frames.last().unwrap()) > 100);
    host.board.control(&Control::Press(Vec::new())).unwrap();
    host.exchange_until("no press", |host| largest(host.frames.last().unwrap()) < 30);
    host.board.control(&Control::Scene(SceneName::Several)).unwrap();
    host.exchange_until("the scene", |host| largest(host.frames.last().unwrap()) > 100);

    let begin = host.frames.len();
    host.board.control(&Control::Faults(vec!["gain:4:0.5".parse().unwrap()])).unwrap();
    let has_fault =
        |host: &Host| matches!(host.board.playing(), Playing::Simulated { faults, .. } if faults.len() == 1);
    host.exchange_until("the fault", has_fault);
    host.frames_more(20);
    let steps = host.frames[begin..].windows(2).map(|pair| pair[1].head.time_us - pair[0].head.time_us);
    let longest_us = steps.max().unwrap();
    // A frame takes 0.8 ms; making the model takes 0.2 to 1 s. A busy machine may take the board's time away, but not so long.
    assert!(longest_us < 150_000, "the board stood still for {longest_us} us");

    assert!(matches!(host.board.control(&Control::Pause(true)), Err(ControlError::Simulated)));
    let error = host.board.control(&Control::Faults(vec!["open:99".parse().unwrap()])).unwrap_err().to_string();
    assert!(error.contains("there is no electrode 99"), "{error}");
    let mut fixed = board(Untouched::default());
    assert_eq!(fixed.control(&Control::Press(Vec::new())), Err(ControlError::Fixed));
}

/// Reads of any length, so that the recording begins anywhere in a packet.
#[test]
fn a_recording_begun_while_frames_come_is_read_from_its_first_frame_on() {
    for read_bytes in [1, 33, 100, 4096] {
        let path = std::env::temp_dir().join(format!("tactomo-{}-middle-{read_bytes}", std::process::id()));
        let mut host = Host::new(board(Untouched::default()), RequestedSettings::default());
        host.frames_more(10);
        (0..7).for_each(|_| host.exchange(read_bytes));
        let header = Header::of(&detector(), host.board.name(), 0);
        host.recorder = Some(Recorder::create_with_hello(&path, &header, host.hello.as_ref().unwrap()).unwrap());
        let before = host.frames.len();
        while host.frames.len() < before + 20 {
            host.exchange(read_bytes);
        }
        // On a busy machine one read has several of them.
        let received = host.frames.len() - before;
        let closing = host.recorder.take().unwrap().close();
        while !closing.is_done() {
            host.exchange(4096);
        }
        closing.wait().unwrap();
        let mut file = FrameFile::open(&path, None).unwrap();
        let frames = std::iter::from_fn(|| file.next_frame().unwrap()).count();
        assert!((received - 1..=received).contains(&frames), "{frames} of {received} with reads of {read_bytes} bytes");
        assert!(!file.loss().unwrap().is_any(), "{}", file.loss().unwrap());
        assert_eq!(file.header().unwrap().detector(&path).unwrap(), Some(detector()));
        std::fs::remove_file(path).unwrap();
    }
}
