//! What a run is to do, and what comes of it.

use std::io;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::sync::watch;

use super::calibration::{LearnedInUse, Learning};
use super::found::OnBoard;
use super::scanning::ScanChoice;
use super::table::BoardTable;
use super::{Latency, Listener, Order, Request, Snapshot};
use tactomo_board::baseline::BaselineTracker;
use tactomo_board::board_log::BoardLog;
use tactomo_board::measured::Mismatch;
use tactomo_board::record::{OtherProtocol, RecordError, Recorder, Ring};
use tactomo_board::session::{self, GreetError, RequestedSettings};
use tactomo_board::source::SourceError;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::ForwardError;
use tactomo_physics::readings::Readings;
#[cfg(doc)]
use tactomo_physics::scene::SceneName;
use tactomo_physics::threads;
use tactomo_protocol::{Hello, Output};
use tactomo_touch::solve::{self, Look, Method, Problem, SolveError, Solver};
use tactomo_touch::vibration::Peak;

/// Makes the solver that is ordered; called in other threads.
pub type MakeSolver = Arc<dyn Fn(&Order) -> Result<Box<dyn Solver>, BoxError> + Send + Sync>;
/// Looks for exchanged wires in readings (V) less the baseline, with the forward model of an order's detector; called in another thread.
pub type LookAtWires = Arc<dyn Fn(&Order, Look, &Readings) -> Option<[usize; 2]> + Send + Sync>;
/// Begins the baseline of a detector as measured, whose readings are means of so many conversions each.
pub type BeginBaseline = Arc<dyn Fn(&Detector, u32) -> BaselineTracker + Send + Sync>;
/// Begins a recording in a new file, of a board that has said Hello, and of the detector that a calibration has found, if one has.
pub type BeginRecording = Box<dyn FnMut(&Hello, Option<&Detector>) -> Result<Recorder, RecordError> + Send>;
/// Any error.
pub type BoxError = Box<dyn std::error::Error + Send + Sync>;

/// What the run is to do.
pub struct RunOptions {
    /// The detector that is connected; drive and ADC are the board's to tell.
    pub detector: Detector,
    /// Settings asked of the board.
    pub settings: RequestedSettings,
    /// Which rows the board is asked to scan.
    pub scan: ScanChoice,
    /// What the board is asked to send.
    pub output: Output,
    /// The table that it finds contacts by, if it does.
    pub table: BoardTable,
    /// What reads the touch; `None` only receives.
    pub solving: Option<Solving>,
    /// Keeps the bytes.
    pub recorder: Option<Recorder>,
    /// Keeps the last seconds of them, and saves them when it is told to.
    pub ring: Option<Ring>,
    /// Where the board's log goes.
    pub board_log: BoardLog,
    /// Begins a recording when a page asks for one.
    pub begin_recording: Option<BeginRecording>,
    /// Who takes each answer.
    pub listeners: Vec<Box<dyn Listener>>,
    /// Where calibrated detectors are saved.
    pub folder: PathBuf,
    /// Whether a contact is a pointer in every scene, not in [`SceneName::Pointer`] alone.
    pub pointer: bool,
    /// Time from Hello to the end; `None` for without end.
    pub seconds: Option<Duration>,
    /// Whether a board that is not there at the start is waited for, as one that is lost later is. Then the time counts from the start as long as
    /// none has said Hello.
    pub waits: bool,
}

impl RunOptions {
    /// Receives the frames of a detector, without end, and does nothing else.
    pub fn new(detector: Detector) -> Self {
        Self {
            detector,
            settings: RequestedSettings::default(),
            scan: ScanChoice::default(),
            output: Output::default(),
            table: BoardTable::default(),
            solving: None,
            recorder: None,
            ring: None,
            begin_recording: None,
            listeners: Vec::new(),
            board_log: BoardLog::unread(),
            folder: PathBuf::from("."),
            pointer: false,
            seconds: None,
            waits: false,
        }
    }
}

/// What reads the touch.
pub struct Solving {
    /// The method to begin with.
    pub method: Method,
    /// Makes its solver once the board has said Hello, and those of other methods when a page asks for them.
    pub make: MakeSolver,
    /// Looks for exchanged wires.
    pub look_at_wires: LookAtWires,
    /// Begins the baseline once the board has said Hello.
    pub begin_baseline: BeginBaseline,
    /// How the detector is learned from what presses, and used once that helps; `None` if it is taken as it is.
    pub learning: Option<Learning>,
}

impl Solving {
    /// Reads the touch of a problem's detector by a method, and takes the detector as it is described.
    pub fn new(method: Method, problem: Problem) -> Self {
        problem.make_nuisance_beside();
        let at_rest = problem.clone();
        let problems = Arc::new(Problems { described: problem, other: Mutex::new(None) });
        let looked_at = Arc::clone(&problems);
        Self {
            method,
            make: Arc::new(move |order| {
                Ok(solve::without(order.method, &problems.of(&order.detector)?, &order.faulty)?)
            }),
            look_at_wires: Arc::new(move |order, look, readings| {
                look.run(&looked_at.of(&order.detector).ok()?, &order.faulty, readings)
            }),
            begin_baseline: Arc::new(move |detector, conversions| {
                BaselineTracker::new(at_rest.measured_as(detector).jacobian, conversions)
            }),
            learning: None,
        }
    }

    /// Takes what the board has found, of which no readings come: so there is nothing to make a solver of, and nothing to learn.
    pub fn on_board(self) -> Self {
        Self { make: Arc::new(|_| Ok(Box::new(OnBoard))), learning: None, ..self }
    }
}

/// Problems of the detector that was described, and of the one that it was calibrated to.
struct Problems {
    described: Problem,
    /// The last other one: models take a while.
    other: Mutex<Option<Problem>>,
}

impl Problems {
    fn of(&self, detector: &Detector) -> Result<Problem, ForwardError> {
        // Models do not depend on what measures the detector.
        let is_of = |problem: &Problem| {
            let modelled = problem.model.detector();
            *modelled == detector.measured_as(modelled)
        };
        if is_of(&self.described) {
            return Ok(self.described.measured_as(detector));
        }
        let mut other = self.other.lock().unwrap_or_else(PoisonError::into_inner);
        let known = other.take().filter(is_of);
        let problem = known.map_or_else(|| self.another(detector), Ok)?;
        *other = Some(problem.clone());
        Ok(problem.measured_as(detector))
    }
}

impl Problems {
    /// That of another detector, with what is not known of it: the solver in use goes on meanwhile. What was learned on the sensor holds for it too, if it has as many electrodes.
    fn another(&self, detector: &Detector) -> Result<Problem, ForwardError> {
        threads::leave_a_core();
        let problem = Problem::of(detector)?;
        problem.nuisance();
        Ok(match self.described.learned() {
            Some(learned) => problem.clone().with_learned(learned.clone()).unwrap_or(problem),
            None => problem,
        })
    }
}

/// Where the run meets the rest of the program.
pub struct Ends {
    /// Where snapshots go.
    pub snapshots: watch::Sender<Arc<Snapshot>>,
    /// Where requests come from.
    pub requests: mpsc::Receiver<Request>,
    /// Set to end the run.
    pub stop: Arc<AtomicBool>,
}

/// What a run has come to.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Summary {
    /// Where the bytes came from.
    pub source: String,
    /// Name of the solver in use at the end; `none` if there was none.
    pub solver: String,
    /// Frames received whole.
    pub frames: u64,
    /// Frames a second, from the first to the last.
    pub frames_per_s: f64,
    /// Scans for which the line had no room, so that their readings are in the mean of a frame.
    pub folded: u64,
    /// Frames that the sequence numbers say are missing: they were lost on the line.
    pub dropped: u64,
    /// Frames that came and were not answered by themselves, because newer ones had come.
    pub skipped: u64,
    /// Answers.
    pub solved: u64,
    /// Stretches of bytes that were no message, since the board's Hello.
    pub corrupt: u64,
    /// Time that answers took, since their frame was taken up, in microseconds (us).
    pub latency_us: Latency,
    /// Age of answers when they are ready, since the last byte of their frame came, in microseconds (us).
    pub age_us: Latency,
    /// The frequency at which the mean reading swung in the last seconds, if one stands out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vibration: Option<Peak>,
    /// What was learned of the detector, if that is in use at the end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learned: Option<LearnedInUse>,
}

/// Why the run cannot go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// The source does not open.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The board cannot be talked to.
    #[error("{link}: {error}")]
    Greet {
        /// Name of the link.
        link: String,
        /// Why.
        error: GreetError,
    },
    /// The recording is in another version of the protocol.
    #[error("{link}: {other}")]
    Recorded {
        /// Name of the link.
        link: String,
        /// Which version.
        other: OtherProtocol,
    },
    /// The board has said Hello, and the time is over without a frame.
    #[error("{link}: {}", session::MUTE)]
    Mute {
        /// Name of the link.
        link: String,
    },
    /// It was given a table, and does not find contacts by it.
    #[error("{link}: the board refuses to send contacts, as it has lost the table that it was given")]
    NoContacts {
        /// Name of the link.
        link: String,
    },
    /// The link broke and cannot come back.
    #[error("{link} broke")]
    Link {
        /// Name of the link.
        link: String,
        /// What the system says.
        source: io::Error,
    },
    /// The board does not fit the detector.
    #[error(transparent)]
    Mismatch(#[from] Mismatch),
    /// No solver can be made for the detector.
    #[error("cannot make a solver for this detector")]
    MakeSolver(#[source] BoxError),
    /// The solver cannot answer.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// A thread of the run cannot be started.
    #[error("cannot start a thread")]
    Thread(#[source] io::Error),
    /// The thread that solves has panicked; the message is on stderr.
    #[error("the solver panicked: this is a mistake in the program, please report it with the message above")]
    Panicked,
    /// The recording cannot be kept.
    #[error(transparent)]
    Record(#[from] RecordError),
}
