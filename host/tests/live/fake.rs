//! A board of bytes only: it answers commands and sends frames as fast as they are read, with the faults that a test asks for.

use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, mpsc};

use tactomo::board::baseline::{BaselineTracker, FRAMES};
use tactomo::board::link::{Control, ControlError, Link};
use tactomo::board::source::{Source, SourceError};
use tactomo::detector::Detector;
use tactomo::run::options::{Ends, MakeSolver, RunOptions, Solving};
use tactomo::run::{Request, Snapshot};
use tactomo::solve::Method;
use tactomo_protocol::{
    BoardMessage, Command, CommandReceiver, FrameHead, Hello, MAX_WIRE, Settings, encode_board, encode_frame,
};
use tokio::sync::watch;

/// A board on the test's own link.
pub struct FakeBoard {
    pub electrodes: u8,
    /// Frames to send, then the link ends as a recording does, or breaks.
    pub frames: u64,
    pub breaks: bool,
    /// After every so many frames one is left out.
    pub skip_every: u64,
    /// After every so many frames come bytes that are no message.
    pub junk_every: u64,
    pub settings: Settings,
    pub receiver: CommandReceiver,
    pub out: VecDeque<u8>,
    pub streaming: bool,
    pub sent: u64,
    pub sequence: u64,
    /// What was asked of it.
    pub asked: Arc<Mutex<Vec<Control>>>,
}

impl FakeBoard {
    pub fn new(frames: u64) -> Self {
        Self {
            electrodes: 16,
            frames,
            breaks: false,
            skip_every: u64::MAX,
            junk_every: u64::MAX,
            settings: Settings::default(),
            receiver: CommandReceiver::default(),
            out: VecDeque::new(),
            streaming: false,
            sent: 0,
            sequence: 0,
            asked: Arc::default(),
        }
    }

    fn obey(&mut self, tag: u8, command: Command) {
        match command {
            Command::Hello | Command::Scan(_) | Command::Rate { .. } | Command::Output(_) | Command::Table(_) => {}
            Command::Configure(settings) => self.settings = settings,
            Command::Start => self.streaming = true,
            Command::Stop => self.streaming = false,
        }
        self.say_hello(tag);
    }

    fn say_hello(&mut self, answers: u8) {
        let (board, settings, is_streaming) = ("fake".try_into().unwrap(), self.settings, self.streaming);
        let hello = Hello { answers, board, settings, is_streaming, ..Hello::example(self.electrodes) };
        let mut wire = [0; MAX_WIRE];
        let length = encode_board(&BoardMessage::Hello(hello), &mut wire).unwrap();
        self.out.extend(&wire[..length]);
    }

    /// A frame of a press that comes and goes, with faults where they are due.
    fn send_frame(&mut self) {
        self.sent += 1;
        self.sequence += if self.sent.is_multiple_of(self.skip_every) { 2 } else { 1 };
        if self.sent.is_multiple_of(self.junk_every) {
            self.out.extend(b"\x05junk\x00");
        }
        let height = (self.sent / 100 % 2 * 40) as u16;
        let n = usize::from(self.electrodes);
        let readings: Vec<u16> =
            (0..n * n).map(|i| if i % (n + 1) == 0 { 0 } else { height + (i % 7) as u16 }).collect();
        let head = FrameHead {
            sequence: self.sequence as u16,
            time_us: (self.sequence * 1000) as u32,
            ..FrameHead::default()
        };
        let mut wire = [0; MAX_WIRE];
        let length = encode_frame(head, &readings, &mut wire).unwrap();
        self.out.extend(&wire[..length]);
    }
}

impl Link for FakeBoard {
    fn name(&self) -> String {
        "fake board".to_owned()
    }

    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.out.is_empty() && self.streaming {
            if self.sent == self.frames {
                let kind = if self.breaks { io::ErrorKind::BrokenPipe } else { io::ErrorKind::UnexpectedEof };
                return Err(kind.into());
            }
            self.send_frame();
        }
        let count = buffer.len().min(self.out.len());
        buffer.iter_mut().zip(self.out.drain(..count)).for_each(|(place, byte)| *place = byte);
        Ok(count)
    }

    fn control(&mut self, control: &Control) -> Result<(), ControlError> {
        self.asked.lock().unwrap().push(control.clone());
        Ok(())
    }

    fn write_all(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        while let Some(Ok(request)) = self.receiver.receive(&mut bytes) {
            self.obey(request.tag, request.command);
        }
        Ok(())
    }
}

/// A board whose frames wait for whoever takes them, so that each is answered.
pub struct Patient(pub Option<FakeBoard>);

impl Source for Patient {
    fn name(&self) -> String {
        "patient board".to_owned()
    }

    fn open(&mut self) -> Result<Box<dyn Link>, SourceError> {
        let board = self.0.take().ok_or_else(|| SourceError::Ended(self.name()))?;
        Ok(Box::new(board))
    }

    fn comes_back(&self) -> bool {
        false
    }

    fn speed(&self) -> f64 {
        f64::INFINITY
    }
}

/// Links that open one after the other, as a board does that is unplugged and plugged in again.
pub struct Links(pub Vec<FakeBoard>);

impl Source for Links {
    fn name(&self) -> String {
        "fake boards".to_owned()
    }

    fn open(&mut self) -> Result<Box<dyn Link>, SourceError> {
        if self.0.is_empty() {
            return Err(SourceError::Ended(self.name()));
        }
        Ok(Box::new(self.0.remove(0)))
    }

    fn comes_back(&self) -> bool {
        true
    }
}

/// Options of a run on the default detector that finds nothing.
pub fn options() -> RunOptions {
    RunOptions::new(Detector::preset(Detector::DEFAULT).unwrap().taken_as_exact())
}

/// The other side of a pipeline's ends.
pub struct Other {
    pub snapshots: watch::Receiver<Arc<Snapshot>>,
    pub requests: mpsc::SyncSender<Request>,
    pub stop: Arc<AtomicBool>,
}

impl Other {
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// Ends for a pipeline, and their other side.
pub fn ends() -> (Ends, Other) {
    let (snapshot, snapshots) = watch::channel(Arc::new(Snapshot::default()));
    let (request, requests) = mpsc::sync_channel(8);
    let stop = Arc::new(AtomicBool::new(false));
    let ends = Ends { snapshots: snapshot, requests, stop: Arc::clone(&stop) };
    (ends, Other { snapshots, requests: request, stop })
}

/// Solves by what a test makes.
pub fn solving(make: MakeSolver) -> Solving {
    Solving {
        method: Method::Tikhonov,
        make,
        look_at_wires: Arc::new(|_, _, _| None),
        begin_baseline: Arc::new(|detector, _| BaselineTracker::over(FRAMES, detector.electrodes.len().pow(2))),
        learning: None,
    }
}
