//! The thread that receives: it reads, stamps, records, decodes and counts, and never waits for a disk, a page or a solver, but where each
//! frame of a recording is to be answered.

mod by_board;
mod links;

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use tactomo_board::identity::{self, Sensor};
use tactomo_board::link::{Control, Link, Playing};
use tactomo_board::measured::{self, Volts};
use tactomo_board::record::OtherProtocol;
use tactomo_board::sequence::Sequence;
use tactomo_board::session::{self, GreetError};
use tactomo_board::source::Source;
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;
use tactomo_physics::scene::SceneName;
use tactomo_protocol::{BoardMessage, Contacts, DecodeError, Fault, Hello};

use super::connection::Connection;
use super::course::Course;
use super::follower::FollowThread;
use super::frame::{Arrival, Frame, NewestReadings, Rows};
use super::inbox::{Event, Inbox, Taken};
use super::notice::NoticeBoard;
use super::options::{Ends, LiveError, RunOptions, Summary};
use super::recordings::Recordings;
use super::scanned::Scanned;
use super::scanning::{PlanRequests, Planner, RequestedPlan};
use super::{LinkState, Request};

/// Runs until the time is over, the recording ends, or it is told to stop. A board that is lost is waited for, and one that is not there at the start
/// if that is [wanted](RunOptions::waits).
///
/// # Errors
/// [`LiveError`] if the board cannot be used, its readings not be solved, or the recording not be kept.
pub fn run(source: &mut dyn Source, mut options: RunOptions, ends: Ends) -> Result<Summary, LiveError> {
    let Ends { snapshots, requests, stop } = ends;
    let inbox = Arc::new(Inbox::new(source.speed().is_infinite()));
    let notice = Arc::new(NoticeBoard::new(snapshots));
    let solving = options.solving.take();
    let listeners = std::mem::take(&mut options.listeners);
    let folder = options.folder.clone();
    let (requested, scan) = (Arc::<RequestedPlan>::default(), options.scan.clone());
    let scanned = Scanned::new(scan.clone());
    let planner = Planner::new(scan, Arc::clone(&requested));
    let start = |solving| FollowThread::start(solving, &inbox, Arc::clone(&notice), listeners, folder, planner);
    let started = solving.map(start).transpose();
    let follower = started.map_err(LiveError::Thread)?;
    if follower.is_some() {
        // Most boards measure as the detector's description says, so their first frame finds a solver.
        inbox.put(Event::Board(Arc::new(options.detector.clone())));
        inbox.put(Event::Pointer(options.pointer));
        inbox.wait_until_ready(|| stop.load(Ordering::Relaxed));
    }
    let course = Course::default();
    notice.change(|snapshot| snapshot.course = course.clone());
    let mut reader = Reader {
        recordings: Recordings::of(&mut options, Arc::clone(&notice)),
        options,
        requests,
        stop,
        inbox: Arc::clone(&inbox),
        notice: Arc::clone(&notice),
        follows: follower.is_some(),
        sequence: Sequence::default(),
        frames_lost: 0,
        board: None,
        greeted: None,
        begun: Instant::now(),
        missed: None,
        course: course.clone(),
        scanned,
        newest: None,
        plans: PlanRequests::new(requested),
        found: None,
        broken_wires: 0,
    };
    let ended = reader.run(source);
    inbox.close();
    let solved = follower.map_or(Ok(()), FollowThread::join);
    // What ended the solving also ended the reading; a failure to keep the recording counts for more than either.
    let ended = reader.recordings.finish().and(solved).and(ended);
    if let Err(error) = &ended {
        notice.publish(|snapshot| snapshot.link = LinkState::Ended(with_causes(error)));
    }
    ended.map(|source| summary(&notice, source, &course))
}

fn summary(notice: &NoticeBoard, source: String, course: &Course) -> Summary {
    let (statistics, frames_per_s) =
        notice.count(|meter| (meter.statistics(Instant::now()), meter.overall_frames_per_s()));
    Summary {
        source,
        solver: notice.solver_name().to_owned(),
        frames: statistics.frames,
        frames_per_s,
        folded: statistics.folded,
        dropped: statistics.dropped,
        skipped: statistics.skipped,
        solved: statistics.solved,
        corrupt: statistics.corrupt,
        latency_us: statistics.latency,
        age_us: statistics.age,
        vibration: course.peak(),
        learned: notice.learned(),
    }
}

struct Reader {
    options: RunOptions,
    requests: std::sync::mpsc::Receiver<Request>,
    stop: Arc<std::sync::atomic::AtomicBool>,
    inbox: Arc<Inbox>,
    notice: Arc<NoticeBoard>,
    /// Whether anybody takes the frames.
    follows: bool,
    sequence: Sequence,
    /// Frames lost on the way since the run began.
    frames_lost: u64,
    board: Option<Board>,
    /// When the first board said Hello.
    greeted: Option<Instant>,
    begun: Instant,
    /// Why there is no board, while the first is waited for.
    missed: Option<LiveError>,
    recordings: Recordings,
    course: Course,
    scanned: Scanned,
    /// All readings as measured and as used, while the board sends rows.
    newest: Option<[NewestReadings; 2]>,
    /// The scan plan that the follower requests, on its way to the board.
    plans: PlanRequests,
    /// Contacts whose readings are still to come.
    found: Option<Contacts>,
    /// Electrodes of which the board has said that their wires are broken: a bit each.
    broken_wires: u32,
}

/// Who has said Hello, and what its frames mean.
struct Board {
    hello: Hello,
    detector: Arc<Detector>,
    volts: Volts,
    noise_v: f64,
}

impl Reader {
    fn receive(&mut self, connection: &mut Connection, link: &dyn Link, bytes: &[u8]) -> Result<(), LiveError> {
        let received = Instant::now();
        if bytes.is_empty() {
            return Ok(());
        }
        let bytes = connection.plain.pass(bytes);
        self.keep(&bytes, received)?;
        let mut input = &bytes[..];
        while let Some(message) = connection.receiver.receive(&mut input) {
            match message {
                Ok(BoardMessage::Frame(frame)) => self.frame(connection, &frame, received),
                Ok(BoardMessage::Hello(hello)) => self.hello(connection, link, hello, received)?,
                Ok(BoardMessage::Contacts(contacts)) => self.contacts(connection, contacts, received),
                Ok(BoardMessage::Table(_)) => {}
                Ok(BoardMessage::Clock(clock)) => connection.session.clock(clock, received),
                Ok(BoardMessage::Log(log)) => self.options.board_log.take(&log.0),
                Ok(BoardMessage::Fault(fault)) => {
                    if let Fault::BrokenWires { electrodes } = fault {
                        self.broken_wires |= electrodes;
                    }
                    // What answers a command is told where that is given up.
                    if !connection.session.fault(&fault) {
                        tracing::warn!("the board says: {}", session::explain(&fault));
                    }
                }
                Err(DecodeError::Version(found)) => return Err(other_protocol(link, found)),
                Err(_) => {}
            }
        }
        let corrupt = connection.newly_corrupt();
        self.notice.count(|meter| meter.corrupt(corrupt));
        Ok(())
    }

    /// Keeps the bytes. Where that fails, the picture goes on; without one there is nothing else to do.
    fn keep(&mut self, bytes: &[u8], received: Instant) -> Result<(), LiveError> {
        match self.recordings.push(bytes, received) {
            Err(error) if !self.follows => Err(error.into()),
            Err(error) => {
                self.recordings.give_up(error);
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }

    fn hello(
        &mut self,
        connection: &mut Connection,
        link: &dyn Link,
        hello: Hello,
        now: Instant,
    ) -> Result<(), LiveError> {
        connection.session.hello(&hello, now);
        if connection.answers && !connection.session.knows_the_board() {
            return Ok(());
        }
        self.recordings.hello(&hello);
        let sensor = (self.follows && connection.junk.is_none()).then(|| Sensor::on(link, &hello));
        connection.junk.get_or_insert(connection.receiver.counters().corrupt);
        self.greeted.get_or_insert(now);
        self.missed = None;
        let known = self.board.as_ref();
        if known.is_none_or(|board| !is_same(&board.hello, &hello)) {
            let Hello { board, firmware_version, electrodes, .. } = &hello;
            tracing::info!("board {board} with firmware {firmware_version}: {electrodes} electrodes");
            let measured = Arc::new(measured::as_measured(&self.options.detector, &hello)?);
            let solved = known.map_or(&self.options.detector, |board| &board.detector);
            if *solved != *measured {
                self.inbox.put(Event::Board(Arc::clone(&measured)));
            }
            self.inbox.put(Event::Conversions(hello.settings.conversions()));
            let noise_v = measured.adc.deviation_v();
            let calibrated = self.notice.calibrated();
            let other_board = identity::other_board(calibrated.as_deref().unwrap_or(&measured), &hello);
            // Settings change its Hello, and not what it is.
            let is_new = known.is_none_or(|board| identity::identity(&board.hello) != identity::identity(&hello));
            if is_new {
                self.broken_wires = 0;
            }
            if let Some(notice) = other_board.as_ref().filter(|_| is_new) {
                tracing::warn!("{notice}");
            }
            self.notice.change(|snapshot| {
                (snapshot.hello, snapshot.calibration) = (Some(hello.clone()), other_board);
            });
            self.board =
                Some(Board { volts: Volts::of(&hello).above(measured.ground_v), hello, detector: measured, noise_v });
        }
        // After the detector, of which something may have been learned.
        sensor.into_iter().for_each(|sensor| self.inbox.put(Event::Sensor(sensor)));
        Ok(())
    }

    fn frame(&mut self, connection: &mut Connection, frame: &tactomo_protocol::Frame, received: Instant) {
        // Before Hello nobody knows what the readings mean.
        let (Some(board), Some(_)) = (&self.board, connection.junk) else { return };
        connection.session.frame(received);
        connection.landed();
        if !self.options.output.has_frames() {
            return;
        }
        let Some(measured) = board.volts.measured(frame) else {
            return self.notice.count(|meter| meter.corrupt(1));
        };
        let place = self.sequence.place(&frame.head);
        self.frames_lost += place.dropped;
        self.notice.count(|meter| meter.frame(received, &frame.head, place.dropped));
        self.scanned.add(&frame.scope);
        if !self.follows {
            return;
        }
        let is_its = |contacts: &mut Contacts| contacts.head.sequence == frame.head.sequence;
        let contacts = self.found.take_if(is_its);
        let found = contacts.map(|contacts| self.found_on_board(&contacts, true));
        let used = board.volts.used(measured.clone());
        let (measured, used, rows) = match frame.scope.is_whole() {
            true => {
                self.newest = None;
                (measured, used, Vec::new())
            }
            false => {
                let none = || [(); 2].map(|()| NewestReadings::new(used.electrodes()));
                let [as_measured, as_used] = self.newest.get_or_insert_with(none);
                let whole = (as_measured.with(&measured), as_used.with(&used));
                (whole.0, whole.1, vec![Rows { readings: used, time_us: place.time_us }])
            }
        };
        self.course.add(place.time_us, &used);
        let (sequence, board_time_us, arrived) = (place.sequence, place.time_us, Arrival::at(received));
        let delay = connection.session.delay(frame.head.time_us, received);
        let (status, lost) = (frame.head.status, self.frames_lost);
        let frame = Frame { sequence, board_time_us, arrived, delay, status, lost, measured, used };
        self.inbox.put_frame(Taken::new(frame, rows, found), board.noise_v);
    }

    fn is_timed_out(&self) -> bool {
        self.options.seconds.zip(self.greeted).is_some_and(|(limit, begin)| begin.elapsed() >= limit)
    }

    fn is_over(&self) -> bool {
        self.is_timed_out() || self.stop.load(Ordering::Relaxed) || self.inbox.is_closed()
    }

    fn answer_requests(&mut self, mut open: Option<(&mut dyn Link, &mut Connection)>) {
        while let Ok(request) = self.requests.try_recv() {
            match request {
                Request::Rezero => {
                    self.inbox.put(Event::Rezero);
                    if let Some((_, connection)) = open.as_mut().filter(|_| self.options.output.has_contacts()) {
                        connection.session.renew_output();
                    }
                }
                Request::Solver(method) => self.inbox.put(Event::Method(method)),
                Request::Settings(settings) => {
                    self.options.settings = self.options.settings.changed_by(settings);
                    if let Some((_, connection)) = &mut open {
                        connection.session.request(settings);
                    }
                }
                Request::Record(true) => {
                    if let Some(board) = &self.board {
                        self.recordings.begin(&board.hello);
                    }
                }
                Request::Record(false) => self.recordings.end(),
                Request::Mark(text) => self.recordings.mark(text),
                Request::Calibrate(ask) => self.inbox.put(Event::Calibrate(ask)),
                Request::Control(control) => {
                    let refused = open.as_mut().and_then(|(link, _)| link.control(&control).err());
                    if let (None, Control::Scene(scene)) = (&refused, control) {
                        self.inbox.put(Event::Pointer(self.options.pointer || scene == SceneName::Pointer));
                    }
                    self.notice.change(|snapshot| snapshot.refused.control = refused.map(|error| with_causes(&error)));
                }
            }
        }
    }

    /// Shows how the link fares.
    fn show_link(&mut self, link: &dyn Link, connection: &mut Connection) {
        if connection.session.is_mute(Instant::now()) {
            self.enter(LinkState::Silent(session::MUTE.to_owned()));
        } else if connection.junk.is_some() {
            self.enter(LinkState::Streaming);
        }
        // Of this link: what another refused is past.
        let refusal = connection.session.refusal().map(|refusal| refusal.to_string());
        let (playing, scan) = (link.playing(), self.scanned.scan());
        self.notice.change(|snapshot| {
            (snapshot.playing, snapshot.scan, snapshot.refused.settings) = (playing, scan, refusal);
        });
        self.recordings.found(self.notice.calibrated());
        if !self.follows {
            self.notice.keep_fresh();
        }
    }

    fn enter(&self, state: LinkState) {
        if self.notice.link() != state {
            self.notice.publish(|snapshot| snapshot.link = state);
        }
    }
}

/// Whether two Hellos say the same, whichever commands they answer.
fn is_same(one: &Hello, other: &Hello) -> bool {
    *one == Hello { answers: one.answers, is_streaming: one.is_streaming, ..other.clone() }
}

/// What bytes in another version of the protocol mean: of a board, or of a recording, which does not answer.
fn other_protocol(link: &dyn Link, found: u8) -> LiveError {
    let (is_recording, link) = (matches!(link.playing(), Playing::Recording { .. }), link.name());
    match is_recording {
        true => LiveError::Recorded { link, other: OtherProtocol { found } },
        false => LiveError::Greet { link, error: GreetError::Version { found } },
    }
}
