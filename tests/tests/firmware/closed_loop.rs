//! The simulated board: readings through pins, converter, uplink and line equal the voltages of the detector.

use std::time::{Duration, Instant};

use tactomo::board::link::Link;
use tactomo::board::simulated::{BoardModel, Options, SimulatedBoard, SimulatedBoardError};
use tactomo::detector::{Adc, Detector};
use tactomo::readings::Readings;
use tactomo::simulate::Physics;
use tactomo_protocol::{
    BoardMessage, BoardReceiver, Command, Frame, Hello, MAX_COMMAND, Request, Settings, Status, encode_request,
};

/// Longest wait for what a test waits for.
const PATIENCE: Duration = Duration::from_secs(30);

/// Voltages that tell ground, electrode and time: frame by frame another table.
struct Table;

impl Physics for Table {
    fn readings_v(&mut self, time_s: f64) -> Readings {
        Readings::from_fn(16, |g, e| voltage_v(time_s, g, e))
    }
}

fn voltage_v(time_s: f64, g: usize, e: usize) -> f64 {
    if g == e { 0.0 } else { 0.9 + 0.05 * g as f64 + 0.003 * e as f64 + 0.2 * (300.0 * time_s).sin() }
}

/// The same voltage everywhere.
struct Constant(usize, f64);

impl Physics for Constant {
    fn readings_v(&mut self, _time_s: f64) -> Readings {
        Readings::from_fn(self.0, |_, _| self.1)
    }
}

/// The default detector with a converter of `bits` and noise (LSB).
fn detector(bits: u8, noise_lsb: f64) -> Detector {
    let adc = Adc { bits, full_scale_v: 3.3, noise_lsb };
    Detector { adc, ..Detector::preset(Detector::DEFAULT).unwrap() }
}

/// A host that keeps what it received.
struct Host {
    board: SimulatedBoard,
    receiver: BoardReceiver,
}

impl Host {
    fn start(detector: &Detector, physics: impl Physics + 'static, options: Options) -> Self {
        let board = SimulatedBoard::start(detector, Box::new(physics), options).unwrap();
        Self { board, receiver: BoardReceiver::default() }
    }

    fn send(&mut self, command: Command) {
        let mut packet = [0; MAX_COMMAND];
        let length = encode_request(&Request { tag: 1, command }, &mut packet).unwrap();
        self.board.write_all(&packet[..length]).unwrap();
    }

    /// Collects what `pick` finds among the messages until there are `count`.
    fn collect<T>(&mut self, count: usize, pick: impl Fn(BoardMessage) -> Option<T>) -> Vec<T> {
        let (mut found, mut buffer, begin) = (Vec::new(), [0; 4096], Instant::now());
        while found.len() < count {
            assert!(begin.elapsed() < PATIENCE, "{} of {count} messages came", found.len());
            let length = self.board.read(&mut buffer).unwrap();
            let mut input = &buffer[..length];
            while let Some(message) = self.receiver.receive(&mut input) {
                found.extend(pick(message.unwrap()));
            }
        }
        found
    }

    fn frames(&mut self, count: usize) -> Vec<Frame> {
        self.collect(count, |message| if let BoardMessage::Frame(frame) = message { Some(frame) } else { None })
    }

    fn hello(&mut self) -> Hello {
        let pick = |message| if let BoardMessage::Hello(hello) = message { Some(hello) } else { None };
        self.collect(1, pick).remove(0)
    }
}

#[test]
fn readings_equal_the_voltages_of_the_moment_to_half_a_code() {
    for (bits, average_log2) in [(12, 0), (12, 2), (16, 0)] {
        let mut host = Host::start(&detector(bits, 0.0), Table, Options::default());
        host.send(Command::Configure(Settings { average_log2, ..Settings::default() }));
        host.send(Command::Start);
        let frames = host.frames(50);
        let first = frames[0].head;
        assert_eq!(first.sequence, 0, "time begins with the first frame");
        for frame in frames {
            let code_v = 3.3 / f64::from(1u32 << bits);
            let unit_v = code_v / f64::from(1 << frame.head.fraction_bits);
            let time_s = f64::from(frame.head.time_us - first.time_us) * 1e-6;
            for (i, reading) in frame.readings.iter().enumerate() {
                let missed_v = f64::from(*reading) * unit_v - voltage_v(time_s, i / 16, i % 16);
                // The head tells time to a microsecond, in which the voltages move by up to 60 uV.
                assert!(missed_v.abs() < code_v / 2.0 + 61e-6, "reading {i}: {missed_v} V off");
            }
            assert_eq!(frame.head.status, Status::default());
        }
    }
}

#[test]
fn hello_tells_the_detector() {
    let mut host = Host::start(&detector(12, 1.5), Table, Options::default());
    let hello = host.hello();
    assert_eq!((hello.board.as_str(), hello.firmware_version.as_str()), ("simulated", env!("CARGO_PKG_VERSION")));
    assert_eq!((hello.electrodes, hello.adc_bits, hello.adc_full_scale_mv, hello.drive_mv), (16, 12, 3300, 2000));
    host.send(Command::Hello);
    assert_eq!(host.hello(), Hello { answers: 1, ..hello });
}

#[test]
fn noise_has_the_strength_of_the_converter_repeats_with_its_seed_and_averages_out() {
    let codes = |seed, average_log2| {
        let mut host = Host::start(&detector(12, 1.5), Constant(16, 1.0), Options { seed, ..Options::default() });
        host.send(Command::Configure(Settings { average_log2, ..Settings::default() }));
        host.send(Command::Start);
        let unit = |frame: &Frame| f64::from(1 << frame.head.fraction_bits);
        let frames = host.frames(100);
        frames.iter().flat_map(|frame| frame.readings.iter().map(move |code| f64::from(*code) / unit(frame))).collect()
    };
    let spread = |codes: &Vec<f64>| {
        let mean = codes.iter().sum::<f64>() / codes.len() as f64;
        assert!((mean - 4096.0 / 3.3).abs() < 0.06, "mean {mean}");
        (codes.iter().map(|code| (code - mean).powi(2)).sum::<f64>() / codes.len() as f64).sqrt()
    };
    let once: Vec<f64> = codes(5, 0);
    // Rounding to codes adds 1/12 to the variance; 25600 samples tell the spread to half a percent.
    assert!((spread(&once) / (1.5f64.powi(2) + 1.0 / 12.0).sqrt() - 1.0).abs() < 0.03, "{}", spread(&once));
    assert!((spread(&codes(5, 4)) * 4.0 / spread(&once) - 1.0).abs() < 0.05, "16 conversions: a quarter of the noise");
    assert_eq!(codes(5, 0)[..2560], once[..2560]);
    assert_ne!(codes(6, 0)[..2560], once[..2560]);
}

#[test]
fn a_voltage_beyond_the_scale_saturates() {
    let mut host = Host::start(&detector(12, 0.0), Constant(16, 3.4), Options::default());
    host.send(Command::Start);
    let frame = host.frames(1).remove(0);
    assert_eq!((frame.head.status, frame.readings[17]), (Status::SATURATED, 4095));
}

#[test]
fn detectors_of_32_electrodes_are_scanned_and_larger_ones_refused() {
    let wide = Detector::preset("display-140x70").unwrap();
    let mut host = Host::start(&wide, Constant(32, 0.5), Options::default());
    host.send(Command::Start);
    assert_eq!(host.frames(1)[0].readings.len(), 1024);

    let electrodes = [&wide.electrodes[..], &wide.electrodes[..1]].concat();
    let refused = SimulatedBoard::start(&Detector { electrodes, ..wide }, Box::new(Table), Options::default());
    assert!(matches!(refused, Err(SimulatedBoardError::Board { .. })));
    let loud = Detector { drive_v: 66.0, ..detector(12, 0.0) };
    let refused = SimulatedBoard::start(&loud, Box::new(Table), Options::default());
    assert!(matches!(refused, Err(SimulatedBoardError::Voltage { field: "drive_v", .. })));
}

/// Readings of twelve bits that jump from frame to frame by most of the range, so that what they differ by says nothing.
struct Restless;

impl Physics for Restless {
    fn readings_v(&mut self, time_s: f64) -> Readings {
        Readings::from_fn(16, |g, e| 2.1 + 0.9 * (1e6 * time_s * (16 * g + e + 1) as f64 * 0.618_033_989).fract())
    }
}

#[test]
fn a_uart_at_921600_baud_gets_the_mean_of_scans_that_are_more_than_it_carries() {
    let options = Options { model: BoardModel::Esp32, ..Options::default() };
    let mut host = Host::start(&detector(12, 1.5), Restless, options);
    host.send(Command::Start);
    let frames = host.frames(300);
    let (first, last) = (frames[0].head, frames[299].head);
    let duration_s = f64::from(last.time_us - first.time_us) * 1e-6;
    let bytes_per_s = 299.0 * 400.0 / duration_s;
    assert!(bytes_per_s < 92_160.0 * 1.01, "{bytes_per_s} bytes/s in board time");
    assert_eq!(last.sequence - first.sequence, 299);
    let scans: usize = frames.iter().map(|frame| usize::from(frame.head.folded) + 1).sum();
    assert!(scans > 400, "{scans} scans");
    assert_eq!(host.receiver.counters().corrupt, 0);
}

#[test]
fn a_host_that_stops_reading_finds_whole_frames_and_new_ones() {
    let mut host = Host::start(&detector(12, 0.0), Restless, Options::default());
    host.send(Command::Start);
    host.frames(10);
    // 64 kB hold 160 frames, or 140 ms: of the rest, the last scans that are in a mean are sent.
    std::thread::sleep(Duration::from_millis(600));
    let frames = host.frames(400);
    assert!(frames.windows(2).all(|pair| pair[1].head.sequence == pair[0].head.sequence + 1));
    let gap_us = frames.windows(2).map(|pair| pair[1].head.time_us - pair[0].head.time_us).max().unwrap();
    assert!(gap_us > 200_000, "{gap_us} us");
    assert_eq!(host.receiver.counters().corrupt, 0);
}

#[test]
fn the_frame_rate_cap_holds_in_board_time() {
    let mut host = Host::start(&detector(12, 0.0), Table, Options::default());
    host.send(Command::Configure(Settings { max_frames_per_s: 200, ..Settings::default() }));
    host.send(Command::Start);
    let frames = host.frames(100);
    let duration_us = frames[99].head.time_us - frames[0].head.time_us;
    // A busy machine makes a frame late, never early by more than the lateness of the one before.
    assert!(duration_us >= 99 * 5000 - 5000, "{duration_us} us");
    assert!(frames.windows(2).all(|pair| pair[1].head.sequence == pair[0].head.sequence + 1));
}

#[test]
fn stop_silences_the_board() {
    let mut host = Host::start(&detector(12, 0.0), Table, Options::default());
    host.send(Command::Start);
    host.frames(5);
    host.send(Command::Stop);
    let mut buffer = [0; 65_536];
    let begin = Instant::now();
    while host.board.read(&mut buffer).unwrap() > 0 {
        assert!(begin.elapsed() < PATIENCE, "frames still come");
    }
    host.send(Command::Hello);
    host.receiver = BoardReceiver::default();
    host.hello();
}
