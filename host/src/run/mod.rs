//! The live picture: from a board's bytes to touch, frame by frame, in three threads.
//!
//! The reader takes bytes, stamps them, hands them to the recording and decodes them; it never solves and never waits for a
//! disk, a page or a solver. The follower answers to the newest frame, at the board's rate where the solver allows. The searcher
//! finds thorough answers, from which the follower goes on once they explain the present better. What there is to show is published as
//! [`Snapshot`]s through a cell that keeps the latest only, so that a slow page slows nothing. Pages answer with [`Request`]s.
//!
//! ```text
//! reader      connection, recordings, frame    bytes to a Frame        -> inbox
//! inbox                                        frames, and all events  -> follower
//! follower    detector, solvers (maker)        a Frame to a TouchEvent -> answers
//!             searcher, wires, calibration     slow work beside it     -> inbox
//!             scanning                         the plan wanted next    -> reader
//! answers     event, notice                    a TouchEvent, shared    -> listeners, snapshots
//! ```

mod answers;
mod beneath;
pub mod calibration;
mod connection;
pub mod course;
mod detector;
mod event;
mod follower;
mod found;
mod frame;
mod inbox;
mod maker;
mod notice;
pub mod options;
mod order;
mod reader;
mod recordings;
mod refusals;
mod scanned;
pub mod scanning;
mod searcher;
mod solvers;
mod statistics;
pub mod table;
mod wires;

pub use self::beneath::Beneath;
pub use self::event::{Listener, TouchEvent};
pub use self::found::solution as solution_of_board;
pub use self::frame::{Arrival, Frame, NewestReadings};
pub use self::maker::SolverState;
pub use self::order::Order;
pub use self::reader::run;
pub use self::refusals::Refusals;
pub use self::scanned::Scan;

use std::path::PathBuf;
use std::sync::Arc;

use tactomo_board::link::{Control, Playing};
use tactomo_board::session::RequestedSettings;
use tactomo_protocol::Hello;

use self::calibration::{Calibrate, Calibrating, LearnedInUse};
use self::course::Course;
use tactomo_physics::detector::Detector;
use tactomo_touch::solve::Method;

/// What there is to show at a moment.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// How the link to the board fares.
    pub link: LinkState,
    /// Who the board is, once it has said so.
    pub hello: Option<Hello>,
    /// The newest answered frame, if there is one.
    pub answer: Option<Arc<TouchEvent>>,
    /// Which rows are scanned.
    pub scan: Scan,
    /// The solver, if there is to be one.
    pub solver: Option<SolverState>,
    /// Counts since the start.
    pub statistics: Statistics,
    /// The course of the readings, of every frame.
    pub course: Course,
    /// What the link plays, and what a person may ask of it.
    pub playing: Playing,
    /// The recording that is being kept, if one is.
    pub recording: Option<PathBuf>,
    /// Marks set in it.
    pub marks: u64,
    /// The detector that a calibration has found and that is in use.
    pub calibrated: Option<Arc<Detector>>,
    /// What was learned of the detector while it was used, if that is in use.
    pub learned: Option<LearnedInUse>,
    /// The file that was taken from, if a run before has kept it.
    pub learned_from: Option<PathBuf>,
    /// What was asked for and cannot be, for the person who asked.
    pub refused: Refusals,
    /// What to know of the baseline, as one sentence for a person; none if all is well.
    pub baseline: Option<String>,
    /// What to do about wires that may be exchanged, as a sentence for a person; none if nothing speaks for that.
    pub wires: Option<&'static str>,
    /// What to know of the detector's calibration, as one sentence for a person; none if all is well or there is none.
    pub calibration: Option<String>,
    /// The calibration by rubbing that is under way, if one is.
    pub calibrating: Option<Arc<Calibrating>>,
}

/// How the link to the board fares.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum LinkState {
    /// No board is open yet.
    #[default]
    Searching,
    /// No board is there yet, for the reason given; it is waited for.
    Absent(String),
    /// The link is open and the board has not said Hello yet.
    Waiting,
    /// Frames come in.
    Streaming,
    /// The board answers and sends no frames, for the reason given.
    Silent(String),
    /// The link was lost, for the reason given; it is tried again.
    Lost(String),
    /// The link has ended for good, for the reason given: the recording is over, the board speaks another protocol.
    Ended(String),
}

/// Counts since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Frames received whole.
    pub frames: u64,
    /// Frames a second over the last second.
    pub frames_per_s: f64,
    /// Scans for which the line had no room, so that their readings are in the mean of a frame.
    pub folded: u64,
    /// Frames that the sequence numbers say are missing: they were lost on the line.
    pub dropped: u64,
    /// Frames that came and were not solved by themselves, because newer ones had come.
    pub skipped: u64,
    /// Answers.
    pub solved: u64,
    /// Answers a second, over the last second.
    pub solved_per_s: f64,
    /// Stretches of bytes that were no message.
    pub corrupt: u64,
    /// Age of answers when they are ready: since the last byte of their frame came.
    pub age: Latency,
    /// Time that answers took, since their frame was taken up.
    pub latency: Latency,
}

/// How the latencies are distributed, in microseconds (us).
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Latency {
    /// Median.
    pub p50: f64,
    /// 99 of 100 are shorter.
    pub p99: f64,
    /// Longest.
    pub max: f64,
}

/// What a page asks.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Takes the baseline anew: nothing must press.
    Rezero,
    /// Reads the touch by another method.
    Solver(Method),
    /// Asks the board for other settings.
    Settings(RequestedSettings),
    /// Begins to keep a recording in a new file, or ends it.
    Record(bool),
    /// Sets a mark in the recording, with what is said of it.
    Mark(String),
    /// Asks something of a simulated detector or a recording.
    Control(Control),
    /// Asks something of the calibration by rubbing.
    Calibrate(Calibrate),
}
