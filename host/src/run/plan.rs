//! What the pipeline is to do, and what comes of it.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc;
use std::time::Duration;

use tokio::sync::watch;

use super::{Latency, Request, Snapshot};
use tactomo_board::board_log::BoardLog;
use tactomo_board::link::SourceError;
use tactomo_board::measured::Mismatch;
use tactomo_board::record::{RecordError, Recorder};
use tactomo_board::session::{GreetError, RequestedSettings};
use tactomo_physics::detector::Detector;
use tactomo_touch::solve::{Method, SolveError, Solver};

/// Makes the solver of a method for a detector; called in other threads too.
pub type MakeSolver = Arc<dyn Fn(Method, &Detector) -> Result<Box<dyn Solver>, BoxError> + Send + Sync>;
/// Any error.
pub type BoxError = Box<dyn std::error::Error + Send + Sync>;

/// What the pipeline is to do.
pub struct Plan {
    /// The detector that is connected; drive and ADC are the board's to tell.
    pub detector: Detector,
    /// Settings asked of the board.
    pub settings: RequestedSettings,
    /// What reads the touch; `None` only receives.
    pub solving: Option<Solving>,
    /// Keeps the bytes.
    pub recorder: Option<Recorder>,
    /// Where the board's log goes.
    pub board_log: BoardLog,
    /// Time from Hello to the end; `None` for without end.
    pub seconds: Option<Duration>,
}

/// What reads the touch.
pub struct Solving {
    /// The method to begin with.
    pub method: Method,
    /// Makes its solver once the board has said Hello, and those of other methods when a page asks for them.
    pub make: MakeSolver,
}

/// Where the pipeline meets the rest of the program.
pub struct Ends {
    /// Where snapshots go.
    pub snapshots: watch::Sender<Arc<Snapshot>>,
    /// Where requests come from.
    pub requests: mpsc::Receiver<Request>,
    /// Set to end the pipeline.
    pub stop: Arc<AtomicBool>,
}

/// What a run of the pipeline has come to.
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
    /// Frames that the sequence numbers say are missing.
    pub dropped: u64,
    /// Stretches of bytes that were no message, since the board's Hello.
    pub corrupt: u64,
    /// From the last byte of a frame received to its image ready, in microseconds (us).
    pub latency_us: Latency,
}

/// Why the pipeline cannot go on.
#[derive(Debug, thiserror::Error)]
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
    /// The recording cannot be kept.
    #[error(transparent)]
    Record(#[from] RecordError),
}
