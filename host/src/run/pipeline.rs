//! The thread from a board's bytes to its images.

use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

use tactomo_protocol::{BoardMessage, BoardReceiver, DecodeError, Frame, Hello};

use super::interpret::Interpreter;
use super::plan::{Ends, LiveError, Plan, Summary};
use super::solvers::Solvers;
use super::statistics::Meter;
use super::{FrameSnapshot, LinkState, Request, Snapshot};
use tactomo_board::link::{Link, Source};
use tactomo_board::pace::Pace;
use tactomo_board::sequence::{Place, Sequence};
use tactomo_board::session::{self, GreetError, RequestedSettings, Session};
use tactomo_physics::detector::Detector;
use tactomo_touch::solve::{Method, Solution};

/// How long a board has to say Hello: opening the port may have reset it, and then it boots first.
const PATIENCE: Duration = Duration::from_secs(6);
/// Time between two tries to open a link that was lost.
const REOPEN_EVERY: Duration = Duration::from_millis(500);
/// Shortest time between two snapshots: no screen shows more.
const PUBLISH_EVERY: Duration = Duration::from_millis(8);
/// Longest time between two snapshots, so that the rate of a silent board falls.
const PUBLISH_AT_LEAST: Duration = Duration::from_millis(250);
/// Share of the time between frames that the solver may take: the rest is for receiving and publishing.
const SOLVER_SHARE: f64 = 0.8;
/// Bytes of one read: 40 ms at 921600 baud.
const READ_BYTES: usize = 4096;

/// Runs until the time is over, the recording ends, or it is told to stop. A board that is lost is waited for.
///
/// # Errors
/// [`LiveError`] if the board cannot be used, or the recording not be kept.
pub fn run(source: &mut dyn Source, plan: Plan, ends: Ends) -> Result<Summary, LiveError> {
    let mut pipeline = Pipeline::new(plan, ends, source.speed());
    let ended = pipeline.run(source);
    if let Err(error) = &ended {
        pipeline.enter(LinkState::Ended(error.to_string()));
    }
    // A failure to keep the recording counts for more than what ended the run.
    if let Some(recorder) = pipeline.plan.recorder.take() {
        recorder.finish()?;
    }
    ended.map(|source| pipeline.summary(source))
}

/// How the talk on a link ended.
enum End {
    /// Time is over, or the user has enough.
    Stopped,
    /// There is nothing more to come.
    Over(String),
    /// The link is lost and may come back.
    Lost(String),
}

struct Pipeline {
    plan: Plan,
    ends: Ends,
    meter: Meter,
    sequence: Sequence,
    pace: Pace,
    interpreter: Option<(Detector, Interpreter)>,
    solvers: Option<Solvers>,
    /// When the first board said Hello.
    greeted: Option<Instant>,
    hello: Option<Hello>,
    state: LinkState,
    newest: Option<Newest>,
    published: Instant,
    /// Whether `newest` was not published yet.
    fresh: bool,
}

/// The newest frame, without its readings.
struct Newest {
    frame: tactomo_protocol::FrameHead,
    place: Place,
    arrived: Instant,
    solution: Solution,
}

/// One link, from its opening on.
struct Talk {
    session: Session,
    receiver: BoardReceiver,
    opened: Instant,
    /// Stretches of junk until the board said Hello; `None` before.
    junk: Option<u64>,
    /// Corrupt stretches that were counted.
    counted: u64,
}

impl Pipeline {
    fn new(mut plan: Plan, ends: Ends, speed: f64) -> Self {
        Self {
            solvers: plan.solving.take().map(Solvers::new),
            plan,
            ends,
            meter: Meter::default(),
            sequence: Sequence::default(),
            pace: Pace::new(speed),
            interpreter: None,
            greeted: None,
            hello: None,
            state: LinkState::Searching,
            newest: None,
            published: Instant::now(),
            fresh: false,
        }
    }

    /// Returns the name of the last link.
    fn run(&mut self, source: &mut dyn Source) -> Result<String, LiveError> {
        let mut link = source.open()?;
        loop {
            match self.talk(link.as_mut(), source.comes_back())? {
                End::Stopped => return Ok(link.name()),
                End::Over(reason) => {
                    tracing::info!("{reason}");
                    self.enter(LinkState::Ended(reason));
                    return Ok(link.name());
                }
                End::Lost(reason) => {
                    tracing::warn!("{}: {reason}; waiting for it to come back", link.name());
                    self.enter(LinkState::Lost(reason));
                    let name = link.name();
                    drop(link); // A port that stays open keeps its name from the board that is plugged in again.
                    match self.reopen(source) {
                        Some(again) => link = again,
                        None => return Ok(name),
                    }
                }
            }
        }
    }

    /// Opens the source again as soon as that is possible; `None` if the run ends before.
    fn reopen(&mut self, source: &mut dyn Source) -> Option<Box<dyn Link>> {
        while !self.is_over() {
            match source.open() {
                Ok(link) => return Some(link),
                Err(error) => tracing::debug!("{error}"),
            }
            self.answer_requests(None);
            self.publish();
            thread::sleep(REOPEN_EVERY);
        }
        None
    }

    /// Talks with the board on `link` to the end.
    fn talk(&mut self, link: &mut dyn Link, comes_back: bool) -> Result<End, LiveError> {
        let mut talk = Talk::new(self.plan.settings);
        let mut buffer = [0; READ_BYTES];
        self.sequence.restart();
        self.enter(LinkState::Waiting);
        while !self.is_over() {
            self.answer_requests(Some((&mut *link, &mut talk.session)));
            self.change_solver();
            match talk.exchange(link, &mut buffer) {
                Ok(count) => {
                    if link.jumped() {
                        self.sequence.restart();
                    }
                    self.receive(&mut talk, link, &buffer[..count])?;
                }
                Err(error) => return lost(link, error, comes_back),
            }
            if comes_back && talk.is_in_vain() {
                return self.unanswered(&talk, link);
            }
            self.publish_if_due();
        }
        Ok(End::Stopped)
    }

    /// No board has answered: at the start that is an error, later it may come back.
    fn unanswered(&self, talk: &Talk, link: &dyn Link) -> Result<End, LiveError> {
        let error =
            GreetError::Silent { seconds: PATIENCE.as_secs(), junk_bytes: talk.receiver.counters().dropped_bytes };
        if self.greeted.is_some() {
            return Ok(End::Lost(error.to_string()));
        }
        Err(LiveError::Greet { link: link.name(), error })
    }

    fn receive(&mut self, talk: &mut Talk, link: &dyn Link, bytes: &[u8]) -> Result<(), LiveError> {
        let received = Instant::now();
        if bytes.is_empty() {
            return Ok(());
        }
        if let Some(recorder) = &mut self.plan.recorder {
            recorder.push(bytes, received)?;
        }
        let mut input = bytes;
        while let Some(message) = talk.receiver.receive(&mut input) {
            match message {
                Ok(BoardMessage::Frame(frame)) => self.frame(talk, &frame, received)?,
                Ok(BoardMessage::Hello(hello)) => self.hello(talk, hello, received)?,
                Ok(BoardMessage::Log(log)) => self.plan.board_log.take(&log.0),
                Ok(BoardMessage::Fault(fault)) => {
                    talk.session.fault(&fault);
                    tracing::warn!("the board says: {}", session::explain(&fault));
                }
                Err(error @ DecodeError::Version(_)) => {
                    return Err(LiveError::Greet { link: link.name(), error: GreetError::Version(error) });
                }
                Err(_) => {}
            }
        }
        self.meter.corrupt(talk.newly_corrupt());
        Ok(())
    }

    fn hello(&mut self, talk: &mut Talk, hello: Hello, now: Instant) -> Result<(), LiveError> {
        talk.session.hello(&hello, now);
        talk.junk.get_or_insert(talk.receiver.counters().corrupt);
        self.greeted.get_or_insert(now);
        let measured = tactomo_board::measured::as_measured(&self.plan.detector, &hello)?;
        if self.interpreter.as_ref().is_none_or(|(detector, _)| *detector != measured) {
            let solver = self.solvers.as_ref().map(|solvers| solvers.make(&measured)).transpose();
            let interpreter = Interpreter::new(&measured, solver.map_err(LiveError::MakeSolver)?);
            self.interpreter = Some((measured, interpreter));
        }
        if self.hello.as_ref() != Some(&hello) {
            tracing::info!(
                "board {} with firmware {}: {} electrodes",
                hello.board,
                hello.firmware_version,
                hello.electrodes
            );
        }
        self.hello = Some(hello);
        self.enter(LinkState::Streaming);
        Ok(())
    }

    /// Goes on with the solver that was asked for, once it is made.
    fn change_solver(&mut self) {
        let (Some(solvers), Some((detector, interpreter))) = (&mut self.solvers, &mut self.interpreter) else { return };
        if let Some(solver) = solvers.ready(detector) {
            interpreter.change_solver(solver);
            interpreter.keep_within(solver_time(&self.pace));
        }
    }

    fn frame(&mut self, talk: &mut Talk, frame: &Frame, received: Instant) -> Result<(), LiveError> {
        // Before Hello nobody knows what the readings mean.
        let (Some((_, interpreter)), Some(_)) = (&mut self.interpreter, talk.junk) else { return Ok(()) };
        talk.session.frame(received);
        let Some(solution) = interpreter.interpret(frame)? else {
            self.meter.corrupt(1);
            return Ok(());
        };
        let place = self.sequence.place(&frame.head);
        if self.pace.note(&place) {
            interpreter.keep_within(solver_time(&self.pace));
        }
        self.meter.frame(received, Instant::now(), place.dropped);
        self.newest = Some(Newest { frame: frame.head, place, arrived: received, solution });
        self.fresh = true;
        Ok(())
    }

    fn is_over(&self) -> bool {
        let timed_out = self.plan.seconds.zip(self.greeted).is_some_and(|(limit, begin)| begin.elapsed() >= limit);
        timed_out || self.ends.stop.load(Ordering::Relaxed)
    }

    fn answer_requests(&mut self, mut open: Option<(&mut dyn Link, &mut Session)>) {
        while let Ok(request) = self.ends.requests.try_recv() {
            match (request, &mut open, &mut self.interpreter) {
                (Request::Rezero, _, Some((_, interpreter))) => interpreter.rezero(),
                (Request::Solver(method), ..) => self.ask_for(method),
                (Request::Settings(settings), Some((_, session)), _) => session.request(settings),
                (Request::Control(control), Some((link, _)), _) => {
                    if let Err(error) = link.control(&control) {
                        tracing::warn!("{error}");
                    }
                }
                _ => {}
            }
        }
    }

    fn ask_for(&mut self, method: Method) {
        if let Some(solvers) = &mut self.solvers {
            solvers.change(method, self.interpreter.as_ref().map(|(detector, _)| detector));
        }
    }

    fn enter(&mut self, state: LinkState) {
        if self.state != state {
            self.state = state;
            self.publish();
        }
    }

    fn publish_if_due(&mut self) {
        let elapsed = self.published.elapsed();
        if elapsed >= PUBLISH_AT_LEAST || self.fresh && elapsed >= PUBLISH_EVERY {
            self.publish();
        }
    }

    fn publish(&mut self) {
        self.published = Instant::now();
        self.fresh = false;
        if self.ends.snapshots.receiver_count() == 0 {
            return;
        }
        let statistics = self.meter.statistics(self.published);
        let frame = self.newest.as_ref().zip(self.interpreter.as_ref());
        let snapshot = Snapshot {
            link: self.state.clone(),
            hello: self.hello.clone(),
            frame: frame.map(|(newest, (_, interpreter))| newest.snapshot(interpreter)),
            solver: self.solvers.as_ref().map(Solvers::state),
            statistics,
            ..Snapshot::default()
        };
        self.ends.snapshots.send_replace(Arc::new(snapshot));
    }

    fn summary(&mut self, source: String) -> Summary {
        let statistics = self.meter.statistics(Instant::now());
        Summary {
            source,
            solver: self.solvers.as_ref().map_or("none", |solvers| solvers.state().method.name()).to_owned(),
            frames: statistics.frames,
            frames_per_s: self.meter.overall_frames_per_s(),
            dropped: statistics.dropped,
            corrupt: statistics.corrupt,
            latency_us: statistics.age,
        }
    }
}

impl Newest {
    fn snapshot(&self, interpreter: &Interpreter) -> FrameSnapshot {
        FrameSnapshot {
            sequence: self.place.sequence,
            board_time_us: self.place.time_us,
            arrived: self.arrived,
            status: self.frame.status,
            readings: interpreter.readings().clone(),
            solution: self.solution.clone(),
            rezeroing: interpreter.is_rezeroing(),
        }
    }
}

impl Talk {
    fn new(wish: RequestedSettings) -> Self {
        Self {
            session: Session::new(wish),
            receiver: BoardReceiver::default(),
            opened: Instant::now(),
            junk: None,
            counted: 0,
        }
    }

    /// Sends what is due and reads what has come; returns the number of bytes.
    fn exchange(&mut self, link: &mut dyn Link, buffer: &mut [u8]) -> io::Result<usize> {
        if let Some(command) = self.session.command(Instant::now()) {
            session::send(link, &command)?;
        }
        link.read(buffer)
    }

    fn is_in_vain(&self) -> bool {
        self.junk.is_none() && self.opened.elapsed() >= PATIENCE
    }

    /// Corrupt stretches since the last time this was asked; boot text before Hello is none.
    fn newly_corrupt(&mut self) -> u64 {
        let Some(junk) = self.junk else { return 0 };
        let corrupt = self.receiver.counters().corrupt - junk;
        let newly = corrupt - self.counted;
        self.counted = corrupt;
        newly
    }
}

/// How long the solver may take for a frame.
fn solver_time(pace: &Pace) -> Option<Duration> {
    pace.period().map(|period| period.mul_f64(SOLVER_SHARE))
}

fn lost(link: &dyn Link, error: io::Error, comes_back: bool) -> Result<End, LiveError> {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => Ok(End::Over(error.to_string())),
        _ if comes_back => Ok(End::Lost(error.to_string())),
        _ => Err(LiveError::Link { link: link.name(), source: error }),
    }
}
