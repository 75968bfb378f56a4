//! Where bytes come from: a serial port or a recording; the simulated board is beside.

pub mod discover;
pub mod replay;
pub mod serial;

use std::io;
use std::path::PathBuf;

use tactomo_physics::scene::{Contact, SceneName};
use tactomo_physics::simulate::{Fault, SimulationError};

use crate::record::{Loss, RecordError};
use discover::NoBoard;
use replay::ReplayLink;
use serial::{PortError, SerialLink};

/// A byte link to a board, in both directions.
pub trait Link: Send {
    /// What a person calls it, such as `/dev/ttyUSB0` or `simulated board`.
    fn name(&self) -> String;

    /// Reads what has come into `buffer`, waiting at most about 50 ms for it; 0 if nothing came.
    ///
    /// # Errors
    /// If the link is gone: the board was unplugged, the recording ended ([`io::ErrorKind::UnexpectedEof`]).
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// If the link is gone or does not take bytes in time.
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Does what a person asks of a simulated detector or a recording; a real board has nothing to be asked.
    ///
    /// # Errors
    /// [`ControlError`] if that cannot be: everything then stays as it was.
    fn control(&mut self, control: &Control) -> Result<(), ControlError> {
        let _ = control;
        Err(ControlError::Board)
    }

    /// What a person may ask of it, and how that stands.
    fn playing(&self) -> Playing {
        Playing::Board
    }

    /// Whether what was read last does not follow what was read before: a recording goes on elsewhere, and nothing between is missing.
    /// To be asked after each read; then it is false until the next jump.
    fn jumped(&mut self) -> bool {
        false
    }
}

/// What a person asks of a link that is no real board.
#[derive(Clone, Debug, PartialEq)]
pub enum Control {
    /// Presses on the simulated detector with these and no others; with none, lets go.
    Press(Vec<Contact>),
    /// Plays another scene on the simulated detector, from its beginning.
    Scene(SceneName),
    /// Gives the simulated detector these faults and no others.
    Faults(Vec<Fault>),
    /// Holds the recording, or goes on.
    Pause(bool),
    /// Goes on with the recording from here (s from its beginning).
    Seek(f64),
    /// Plays the recording so many times as fast as it was recorded; infinite for as fast as it can be read.
    Speed(f64),
    /// Begins the recording again where it ends, or not.
    Loop(bool),
}

/// Why what a person asks of a link cannot be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ControlError {
    /// Of a real board.
    #[error("this is a real board: only simulated detectors and recordings can be controlled from here")]
    Board,
    /// Of a recording.
    #[error("this is a recording: nothing can press on it; `tactomo live --simulate` has a detector to press on")]
    Recording,
    /// Of a simulated detector.
    #[error("this is a simulated detector, not a recording: it cannot be paused, moved or played at another speed")]
    Simulated,
    /// A simulated detector whose physics are given from outside.
    #[error("this simulated detector has readings of its own: nothing can press on it")]
    Fixed,
    /// A place that is none.
    #[error("a recording can go on at a number of seconds only")]
    Seek,
    /// A speed that is none.
    #[error("a speed has to be above 0, but {0} was asked for")]
    Speed(f64),
    /// A scene or a fault that the simulated detector cannot have.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
}

/// What a link plays, and what a person may ask of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Playing {
    /// A real board, or one whose physics are given from outside: nothing.
    #[default]
    Board,
    /// A simulated detector.
    Simulated {
        /// What touches it, beside the presses.
        scene: SceneName,
        /// What is wrong with it.
        faults: Vec<Fault>,
    },
    /// A recording.
    Recording {
        /// Where it is (s from its beginning).
        position_s: f64,
        /// How long it is (s).
        length_s: f64,
        /// How many times as fast as it was recorded it is played.
        speed: f64,
        /// Whether it is held.
        paused: bool,
        /// Whether it begins again where it ends.
        looped: bool,
        /// Whether it is at its end, and stays there until it is asked to go on elsewhere.
        ended: bool,
        /// What is damaged in it, as far as it was played.
        damage: Loss,
    },
}

/// Something that gives a [`Link`], and another one when that is lost.
pub trait Source: Send {
    /// What a person calls it, before anything is open.
    fn name(&self) -> String;

    /// Opens it.
    ///
    /// # Errors
    /// [`SourceError`], which says what to do.
    fn open(&mut self) -> Result<Box<dyn Link>, SourceError>;

    /// Whether a lost link may come back, as a board's does when it is plugged in again.
    fn comes_back(&self) -> bool;

    /// How many times faster than they were measured the bytes come; infinite where they wait for the reader.
    fn speed(&self) -> f64 {
        1.0
    }
}

/// Why a source does not open.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// The port that was named.
    #[error(transparent)]
    Port(#[from] PortError),
    /// No port was named, and none has a board.
    #[error(transparent)]
    NoBoard(#[from] NoBoard),
    /// The recording.
    #[error(transparent)]
    Recording(#[from] RecordError),
    /// A link that was opened before and cannot be opened again.
    #[error("{0} has ended")]
    Ended(String),
}

/// A board on the serial port of that name.
#[derive(Clone, Debug)]
pub struct NamedPort {
    /// Such as `/dev/ttyUSB0`.
    pub port: String,
    /// Bits a second.
    pub baud: u32,
}

impl Source for NamedPort {
    fn name(&self) -> String {
        self.port.clone()
    }

    fn open(&mut self) -> Result<Box<dyn Link>, SourceError> {
        Ok(Box::new(SerialLink::open(&self.port, self.baud)?))
    }

    fn comes_back(&self) -> bool {
        true
    }
}

/// Whichever USB serial port has a board that says Hello.
#[derive(Clone, Copy, Debug)]
pub struct AnyBoard {
    /// Bits a second.
    pub baud: u32,
}

impl Source for AnyBoard {
    fn name(&self) -> String {
        "any board".to_owned()
    }

    fn open(&mut self) -> Result<Box<dyn Link>, SourceError> {
        let port = discover::find_board(self.baud)?;
        Ok(Box::new(SerialLink::open(&port, self.baud)?))
    }

    fn comes_back(&self) -> bool {
        true
    }
}

/// A recording, played back.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Its file.
    pub path: PathBuf,
    /// How many times faster than it was recorded; infinite for as fast as it can be read.
    pub speed: f64,
    /// Whether it stays open at its end, for a person who may seek back; otherwise it is over then.
    pub stays_open: bool,
}

impl Source for Recording {
    fn name(&self) -> String {
        format!("recording {}", self.path.display())
    }

    fn open(&mut self) -> Result<Box<dyn Link>, SourceError> {
        Ok(Box::new(ReplayLink::open(&self.path, self.speed, self.stays_open)?))
    }

    fn comes_back(&self) -> bool {
        false
    }

    fn speed(&self) -> f64 {
        self.speed
    }
}

/// A link that is there already and opens once.
pub struct Opened(Option<Box<dyn Link>>, String);

impl Opened {
    /// A source of `link` alone.
    pub fn new(link: Box<dyn Link>) -> Self {
        let name = link.name();
        Self(Some(link), name)
    }
}

impl Source for Opened {
    fn name(&self) -> String {
        self.1.clone()
    }

    fn open(&mut self) -> Result<Box<dyn Link>, SourceError> {
        self.0.take().ok_or_else(|| SourceError::Ended(self.1.clone()))
    }

    fn comes_back(&self) -> bool {
        false
    }
}
