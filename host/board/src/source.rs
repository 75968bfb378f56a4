//! What gives a link, and another one when that is lost: a serial port, whichever has a board, or a recording.

pub mod discover;

use std::path::PathBuf;

use self::discover::NoBoard;
use crate::link::Link;
use crate::link::ports::named;
use crate::link::replay::ReplayLink;
use crate::link::serial::{PortError, SerialLink};
use crate::record::RecordError;

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
#[non_exhaustive]
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
    /// A link that is open, and a board that could not be made ready.
    #[error(transparent)]
    Prepared(Box<dyn std::error::Error + Send + Sync>),
    /// A link that was opened before and cannot be opened again.
    #[error("{0} has ended")]
    Ended(String),
}

/// A board on the serial port of that name.
#[derive(Clone, Debug)]
pub struct NamedPort {
    /// Such as `/dev/ttyUSB0`, or the serial number of its USB device.
    pub port: String,
    /// Bits a second.
    pub baud: u32,
}

impl Source for NamedPort {
    fn name(&self) -> String {
        self.port.clone()
    }

    fn open(&mut self) -> Result<Box<dyn Link>, SourceError> {
        Ok(Box::new(SerialLink::open(&named(&self.port), self.baud)?))
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
