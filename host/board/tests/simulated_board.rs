//! The talk with a simulated board, from its start to a recording of it.
#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should")]

use std::io;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tactomo_board::frames::FrameFile;
use tactomo_board::inputs::BoardInputs;
use tactomo_board::link::{Control, ControlError, Link, Playing};
use tactomo_board::measured::{Volts, as_measured};
use tactomo_board::record::{Header, PlainPackets, Recorder};
use tactomo_board::session::{RequestedSettings, Session, send};
use tactomo_board::simulated::{BoardModel, Options, SimulatedBoard, SimulatedBoardError};
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::{Contact, Hand, Scene, SceneName};
use tactomo_physics::simulate::{Physics, Simulation};
use tactomo_protocol::{BoardMessage, BoardReceiver, Frame, Hello, Settings, Status};

const PATIENCE: Duration = Duration::from_secs(20);

/// Nothing touches; keeps the times of the first frames.
#[derive(Default)]
struct Untouched(Arc<Mutex<Vec<f64>>>);

impl Physics for Untouched {
    fn readings_v(&mut self, time_s: f64) -> Readings {
        self.0.lock().unwrap().push(time_s);
        Readings::from_fn(16, |_, _| 0.1)
    }
}

fn detector() -> Detector {
    Detector::preset(Detector::DEFAULT).unwrap()
}

fn board(physics: Untouched) -> SimulatedBoard {
    SimulatedBoard::start(&detector(), Box::new(physics), Options::default()).unwrap()
}

fn simulated(scene: SceneName) -> SimulatedBoard {
    let detector = detector();
    let scene = Scene::new(scene, &detector, Hand::relative(&detector), 1);
    let simulation = Simulation::new(&detector, scene, &[], 1).unwrap();
    SimulatedBoard::simulate(&detector, simulation, Options::default()).unwrap()
}

/// A line that loses one command in a few, or none.
struct Lossy {
    board: SimulatedBoard,
    /// Which of the writes are lost, a bit each, from the lowest on; then none.
    lost: u32,
}

impl Link for Lossy {
    fn name(&self) -> String {
        self.board.name()
    }

    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.board.read(buffer)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        let is_lost = self.lost & 1 == 1;
        self.lost >>= 1;
        if is_lost { Ok(()) } else { self.board.write_all(bytes) }
    }

    fn control(&mut self, control: &Control) -> Result<(), ControlError> {
        self.board.control(control)
    }

    fn playing(&self) -> Playing {
        self.board.playing()
    }
}

/// A host that talks as `live` does.
struct Host {
    board: Lossy,
    session: Session,
    plain: PlainPackets,
    receiver: BoardReceiver,
    hello: Option<Hello>,
    frames: Vec<Frame>,
    recorder: Option<Recorder>,
}

impl Host {
    fn new(board: SimulatedBoard, requested: RequestedSettings) -> Self {
        let (session, receiver) = (Session::new(requested), BoardReceiver::default());
        let board = Lossy { board, lost: 0 };
        Self {
            board,
            session,
            plain: PlainPackets::default(),
            receiver,
            hello: None,
            frames: Vec::new(),
            recorder: None,
        }
    }

    fn exchange(&mut self, read_bytes: usize) {
        if let Some(command) = self.session.command(Instant::now()) {
            send(&mut self.board, &command).unwrap();
        }
        let mut buffer = vec![0; read_bytes];
        let count = self.board.read(&mut buffer).unwrap();
        let arrived = Instant::now();
        let bytes = self.plain.pass(&buffer[..count]);
        if let Some(recorder) = &mut self.recorder {
            recorder.push(&bytes, arrived).unwrap();
        }
        let mut input = &bytes[..];
        while let Some(message) = self.receiver.receive(&mut input) {
            match message {
                Ok(BoardMessage::Hello(hello)) => {
                    self.session.hello(&hello, arrived);
                    self.hello = Some(hello);
                }
                Ok(BoardMessage::Frame(frame)) => {
                    self.session.frame(arrived);
                    self.frames.push(frame);
                }
                Ok(BoardMessage::Fault(fault)) => drop(self.session.fault(&fault)),
                _ => {}
            }
        }
    }

    fn exchange_until(&mut self, what: &str, enough: impl Fn(&Self) -> bool) {
        let begin = Instant::now();
        while !enough(self) {
            assert!(begin.elapsed() < PATIENCE, "never: {what}");
            self.exchange(4096);
        }
    }

    fn frames_more(&mut self, count: usize) {
        let wanted = self.frames.len() + count;
        self.exchange_until("frames", |host| host.frames.len() >= wanted);
    }

    fn settings(&self) -> Settings {
        self.hello.as_ref().unwrap().settings
    }
}

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

/// The same voltage everywhere (V), which rises with time (V/s).
#[derive(Clone, Copy)]
struct Rising(f64, f64);

impl Physics for Rising {
    fn readings_v(&mut self, time_s: f64) -> Readings {
        Readings::from_fn(16, |_, _| self.0 + self.1 * time_s)
    }
}

fn model(model: BoardModel, seed: u64, physics: impl Physics + 'static) -> Host {
    let board = SimulatedBoard::start(&detector(), Box::new(physics), Options { seed, model });
    Host::new(board.unwrap(), RequestedSettings::default())
}

/// Frames of a board at a constant voltage (V).
fn frames_at(board: BoardModel, volts: f64, seed: u64) -> Vec<Frame> {
    let mut host = model(board, seed, Rising(volts, 0.0));
    host.frames_more(10);
    host.frames
}

#[test]
fn boards_scan_as_fast_as_their_budgets_say() {
    // Settle, conversions and the firmware's work of sixteen rows (`docs/firmware.md`).
    let budgets_us = [(BoardModel::Ideal, 832.0), (BoardModel::Esp32, 2334.0), (BoardModel::Esp32c3, 15_015.0)];
    for (board, budget_us) in budgets_us {
        let mut host = model(board, 1, Rising(0.5, 0.0));
        host.frames_more(40);
        let mut scans_us: Vec<f64> = host.frames.windows(2).map(|pair| scan_us(&pair[0], &pair[1])).collect();
        scans_us.sort_by(f64::total_cmp);
        let median_us = scans_us[scans_us.len() / 2];
        assert!((median_us / budget_us - 1.0).abs() < 0.01, "{board:?}: {median_us} us a scan");
    }
}

#[test]
fn boards_tell_their_names_and_what_their_converters_can_see() {
    let hello = |board| {
        let mut host = model(board, 1, Rising(0.0, 0.0));
        host.exchange_until("hello", |host| host.hello.is_some());
        let hello = host.hello.unwrap();
        let ranges: Vec<_> = hello.ranges.iter().map(|range| (range.electrodes, range.floor, range.ceiling)).collect();
        (hello.board.to_string(), hello.adc_full_scale_mv, ranges)
    };
    assert_eq!(hello(BoardModel::Ideal), ("simulated".to_owned(), 3300, vec![(16, 0, 4095)]));
    let esp32 = vec![(6, 142, 3100), (10, 128, 3100)];
    assert_eq!(hello(BoardModel::Esp32), ("esp32 (simulated)".to_owned(), 4096, esp32));
    assert_eq!(hello(BoardModel::Esp32c3), ("esp32c3 (simulated)".to_owned(), 4096, vec![(16, 0, 2500)]));
}

/// What the firmware reads, with noise and the chip's own errors averaged out, against what foams of little conductivity let through; and what the
/// settings that are advised make of it.
#[test]
fn a_foam_of_little_conductivity_lags_until_the_settings_suit_it() {
    /// Electrodes by turns at 0.5 and 1.5 V.
    #[derive(Clone, Copy)]
    struct Turns;
    impl Physics for Turns {
        fn readings_v(&mut self, _time_s: f64) -> Readings {
            Readings::from_fn(16, |g, e| if (g + e) % 2 == 0 { 0.5 } else { 1.5 })
        }
    }
    // Largest lag of the mean reading of an electrode, of a step of 1 V from one to the next (mV).
    let lag_mv = |board, foam: &str, settings| {
        let foam = detector().in_material(&foam.parse().unwrap()).unwrap();
        let options = Options { seed: 3, model: board };
        let board = SimulatedBoard::start(&foam, Box::new(Turns), options).unwrap();
        let mut host = Host::new(board, settings);
        host.exchange_until("its settings", |host| host.session.refusal().is_none() && host.frames.len() > 5);
        host.frames.clear();
        host.frames_more(40);
        let mean = |cell: usize| {
            let codes = host
                .frames
                .iter()
                .map(|frame| f64::from(frame.readings[cell]) / f64::from(1 << frame.head.fraction_bits));
            codes.sum::<f64>() / host.frames.len() as f64
        };
        // High and low of one electrode differ by a volt where nothing lags; a chip's gain and bow are a per cent of that.
        (0..15).map(|g| (1000.0 - (mean(16 * g + 5) - mean(16 * (g + 1) + 5)).abs()).abs()).fold(0.0, f64::max)
    };
    let need = |board: &str, foam: &str| {
        let pad_ohm = detector().in_material(&foam.parse().unwrap()).unwrap().largest_pad_ohm();
        BoardInputs::of(board).unwrap().need(pad_ohm).unwrap()
    };
    for (name, board, foam, lags_mv) in [
        ("esp32", BoardModel::Esp32, "C", 60.0),
        ("esp32c3", BoardModel::Esp32c3, "C", 300.0),
        ("esp32c3", BoardModel::Esp32c3, "D", 25.0),
    ] {
        let asked = |select_us, settle_us, discarded| RequestedSettings {
            select_us: Some(select_us),
            settle_us: Some(settle_us),
            discarded: Some(discarded),
            ..RequestedSettings::default()
        };
        let as_it_was = if name == "esp32c3" { asked(2, 20, 0) } else { RequestedSettings::default() };
        let before_mv = lag_mv(board, foam, as_it_was);
        let need = need(name, foam);
        let after_mv = lag_mv(board, foam, asked(need.select_us, need.settle_us, need.discarded));
        assert!(before_mv > lags_mv && after_mv < 30.0, "{name}, {foam}: {before_mv} mV, then {after_mv} mV");
        assert!(lag_mv(board, "A", RequestedSettings::default()) < 30.0, "{name}");
    }
}

/// Board time of a scan, of the frames that went lost between too.
fn scan_us(one: &Frame, next: &Frame) -> f64 {
    let scans = next.head.sequence.wrapping_sub(one.head.sequence);
    f64::from(next.head.time_us - one.head.time_us) / f64::from(scans)
}

#[test]
fn the_line_of_the_esp32_carries_every_scan() {
    // Above 2.05 V a frame is twelve bits a reading: 398 to 400 bytes as it is, of which the line carries 230 a second.
    let mut host = model(BoardModel::Esp32, 1, Rising(2.5, 0.0));
    host.frames_more(300);
    let [first, last] = [&host.frames[100], &host.frames[299]].map(|frame| frame.head);
    let frames_per_s = 199.0 / (f64::from(last.time_us - first.time_us) * 1e-6);
    assert!(frames_per_s > 415.0, "{frames_per_s}");
    assert_eq!(last.sequence - first.sequence, 199, "none is dropped");
}

#[test]
fn floors_and_ceilings_show_in_the_readings() {
    let ends = |board, volts| {
        let frame = frames_at(board, volts, 3).remove(5);
        let row = frame.readings[32..48].to_vec();
        assert!(frame.readings.chunks(16).all(|other| other == row), "noise does not reach in");
        (row[0], row[5], row[6], row[15])
    };
    assert_eq!(ends(BoardModel::Esp32, 0.05), (142, 142, 128, 128));
    assert_eq!(ends(BoardModel::Esp32, 3.3), (3100, 3100, 3100, 3100));
    assert_eq!(ends(BoardModel::Esp32c3, -0.1), (0, 0, 0, 0));
    assert_eq!(ends(BoardModel::Esp32c3, 2.7), (2500, 2500, 2500, 2500));
    let head = |volts| frames_at(BoardModel::Esp32, volts, 3)[5].head;
    assert_eq!([head(3.3), head(2.0)].map(|head| head.status), [Status::SATURATED, Status::default()]);
}

#[test]
fn above_a_lifted_ground_nothing_is_at_the_floor() {
    let lifted = Detector { drive_v: 1.75, ground_v: 0.25, ..detector() };
    for board in [BoardModel::Ideal, BoardModel::Esp32] {
        let scene = Scene::new(SceneName::Rest, &lifted, Hand::relative(&lifted), 1);
        let simulation = Simulation::new(&lifted, scene, &[], 1).unwrap();
        let options = Options { seed: 4, model: board };
        let board = SimulatedBoard::simulate(&lifted, simulation, options).unwrap();
        let mut host = Host::new(board, RequestedSettings::default());
        host.frames_more(20);
        let hello = host.hello.clone().unwrap();
        assert_eq!(hello.drive_mv, 2000);
        let measured = as_measured(&lifted, &hello).unwrap();
        assert_eq!((measured.drive_v, measured.ground_v), (1.75, 0.25));
        let volts = Volts::of(&hello).above(measured.ground_v);
        for frame in &host.frames {
            let readings = volts.readings(frame).unwrap();
            assert!(readings.all_say().is_empty());
            // Noise of 5 mV, a gain of 1 % and the bow of a chip.
            assert!(readings.volts().iter().all(|volts| volts.abs() < 0.04), "{readings:?}");
        }
        // On the ground of the converter all the same would be below the floor.
        let contact = Contact::flat(0.01, 0.005, 0.003, 2e-5);
        host.board.control(&Control::Press(vec![contact])).unwrap();
        let largest_v = |host: &Host| volts.readings(host.frames.last().unwrap()).unwrap().largest_v();
        host.exchange_until("a light press", |host| largest_v(host) > 0.03);
        assert!(largest_v(&host) < 0.1, "{}", largest_v(&host));
    }
}

#[test]
fn a_seed_repeats_a_board_and_another_is_another_chip() {
    for board in [BoardModel::Esp32, BoardModel::Esp32c3] {
        let codes = |seed| frames_at(board, 1.0, seed)[0].readings.to_vec();
        assert_eq!(codes(5), codes(5));
        // A chip's gain is in the mean of a frame.
        let mean = |codes: Vec<u16>| codes.into_iter().map(f64::from).sum::<f64>() / 256.0;
        let means: Vec<f64> = (1..8).map(|seed| mean(codes(seed))).collect();
        let spread = means.iter().copied().fold(f64::MIN, f64::max) - means.iter().copied().fold(f64::MAX, f64::min);
        assert!(spread > 4.0 && means.iter().all(|mean| (mean - 1000.0).abs() < 60.0), "{means:?}");
    }
}

#[test]
fn the_scene_moves_on_while_a_real_board_scans() {
    // 10 V/s over fifteen rows of 944 us, and the ideal board's noise.
    let risen = |board| {
        let mut host = model(board, 2, Rising(0.5, 10.0));
        host.frames_more(6);
        let row = |frame: &Frame, ground: usize| {
            frame.readings[16 * ground..][..16].iter().map(|code| f64::from(*code)).sum::<f64>() / 16.0
        };
        // Where the machine is too slow the board's clock jumps, and never back; near the ceiling nothing rises.
        let in_range = host.frames.iter().filter(|frame| row(frame, 15) < 2300.0);
        in_range.map(|frame| row(frame, 15) - row(frame, 0)).fold(f64::INFINITY, f64::min)
    };
    assert!((risen(BoardModel::Esp32c3) - 141.5).abs() < 8.0, "{} mV", risen(BoardModel::Esp32c3));
    assert!(risen(BoardModel::Ideal).abs() < 3.0, "{} codes", risen(BoardModel::Ideal));
}

#[test]
fn a_board_takes_no_more_electrodes_than_it_has_inputs_for() {
    let wide = Detector::preset("display-140x70").unwrap();
    let start = |model| SimulatedBoard::start(&wide, Box::new(Rising(0.0, 0.0)), Options { seed: 1, model }).err();
    let error = start(BoardModel::Esp32).unwrap();
    assert!(matches!(error, SimulatedBoardError::Electrodes { electrodes: 32, most: 16, .. }), "{error}");
    assert!(start(BoardModel::Ideal).is_none());
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
        let closing = host.recorder.take().unwrap().close();
        while !closing.is_done() {
            host.exchange(4096);
        }
        closing.wait().unwrap();
        let mut file = FrameFile::open(&path, None).unwrap();
        let frames = std::iter::from_fn(|| file.next_frame().unwrap()).count();
        assert!((19..=20).contains(&frames), "{frames} frames with reads of {read_bytes} bytes");
        assert!(!file.loss().unwrap().is_any(), "{}", file.loss().unwrap());
        assert_eq!(file.header().unwrap().detector(&path).unwrap(), Some(detector()));
        std::fs::remove_file(path).unwrap();
    }
}
