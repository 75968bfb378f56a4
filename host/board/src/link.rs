//! A line to a board, and what can be asked of it: a serial port or a recording; the simulated board is beside.

pub mod ports;
pub mod replay;
pub mod serial;

use std::io;

use tactomo_physics::scene::{Contact, SceneName};
use tactomo_physics::simulate::{Fault, SimulationError};

use crate::record::Loss;

/// A byte link to a board, in both directions.
pub trait Link: Send {
    /// What a person calls it, such as `/dev/ttyUSB0` or `simulated board`.
    fn name(&self) -> String;

    /// The serial number of the device at the other end, if it has one that no other device of this machine has.
    fn serial_number(&self) -> Option<String> {
        None
    }

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

    /// Bits a second that the line was opened at, or was [set](Self::set_baud) to; `None` if it has no rate.
    fn baud(&self) -> Option<u32> {
        None
    }

    /// Sets the line to another rate (bits a second). What was written and is not sent yet may be lost.
    ///
    /// # Errors
    /// If the line has no rate, or not this one, or is gone ([`io::ErrorKind::BrokenPipe`]).
    fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        let _ = baud;
        Err(io::ErrorKind::Unsupported.into())
    }

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
#[non_exhaustive]
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
