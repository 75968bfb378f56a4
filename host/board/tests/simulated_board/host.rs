//! A host that talks with a simulated board.

use std::io;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tactomo_board::clock::Delay;
use tactomo_board::link::{Control, ControlError, Link, Playing};
use tactomo_board::record::{PlainPackets, Recorder};
use tactomo_board::session::{RequestedSettings, Session, send};
use tactomo_board::simulated::{Options, SimulatedBoard};
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::{Hand, Scene, SceneName};
use tactomo_physics::simulate::{Physics, Simulation};
use tactomo_protocol::{BoardMessage, BoardReceiver, Frame, Hello, Settings};

const PATIENCE: Duration = Duration::from_secs(20);

/// Nothing touches; keeps the times of the first frames.
#[derive(Default)]
pub struct Untouched(pub Arc<Mutex<Vec<f64>>>);

impl Physics for Untouched {
    fn readings_v(&mut self, time_s: f64) -> Readings {
        self.0.lock().unwrap().push(time_s);
        Readings::from_fn(16, |_, _| 0.1)
    }
}

pub fn detector() -> Detector {
    Detector::preset(Detector::DEFAULT).unwrap()
}

pub fn board(physics: Untouched) -> SimulatedBoard {
    SimulatedBoard::start(&detector(), Box::new(physics), Options::default()).unwrap()
}

pub fn simulated(scene: SceneName) -> SimulatedBoard {
    let detector = detector();
    let scene = Scene::new(scene, &detector, Hand::relative(&detector), 1);
    let simulation = Simulation::new(&detector, scene, &[], 1).unwrap();
    SimulatedBoard::simulate(&detector, simulation, Options::default()).unwrap()
}

/// A line that loses one command in a few, or none.
pub struct Lossy {
    pub board: SimulatedBoard,
    /// Which of the writes are lost, a bit each, from the lowest on; then none.
    pub lost: u32,
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
pub struct Host {
    pub board: Lossy,
    pub session: Session,
    pub plain: PlainPackets,
    pub receiver: BoardReceiver,
    pub hello: Option<Hello>,
    pub frames: Vec<Frame>,
    /// For each frame when it came, and how long before it was scanned.
    pub timed: Vec<(Instant, Option<Delay>)>,
    pub recorder: Option<Recorder>,
}

impl Host {
    pub fn new(board: SimulatedBoard, requested: RequestedSettings) -> Self {
        let (session, receiver) = (Session::new(requested), BoardReceiver::default());
        let board = Lossy { board, lost: 0 };
        Self {
            board,
            session,
            plain: PlainPackets::default(),
            receiver,
            hello: None,
            frames: Vec::new(),
            timed: Vec::new(),
            recorder: None,
        }
    }

    pub fn exchange(&mut self, read_bytes: usize) {
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
                    self.timed.push((arrived, self.session.delay(frame.head.time_us, arrived)));
                    self.frames.push(frame);
                }
                Ok(BoardMessage::Clock(clock)) => self.session.clock(clock, arrived),
                Ok(BoardMessage::Fault(fault)) => drop(self.session.fault(&fault)),
                _ => {}
            }
        }
    }

    pub fn exchange_until(&mut self, what: &str, enough: impl Fn(&Self) -> bool) {
        let begin = Instant::now();
        while !enough(self) {
            assert!(begin.elapsed() < PATIENCE, "never: {what}");
            self.exchange(4096);
        }
    }

    pub fn frames_more(&mut self, count: usize) {
        let wanted = self.frames.len() + count;
        self.exchange_until("frames", |host| host.frames.len() >= wanted);
    }

    pub fn settings(&self) -> Settings {
        self.hello.as_ref().unwrap().settings
    }
}
