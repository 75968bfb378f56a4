//! The first word of a board, and what its faults mean.

use std::time::Instant;

use tactomo_protocol::{BoardMessage, BoardReceiver, DecodeError, Fault, Hello, VERSION};

use super::{RequestedSettings, Session};
use crate::check::UnframedBytes;
use crate::link::Link;

/// Why a board cannot be talked to.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GreetError {
    /// No Hello in time.
    #[error("no board said Hello within {seconds} s. {unframed}")]
    Silent {
        /// How long was waited (s).
        seconds: u64,
        /// What came instead, and what that means.
        unframed: UnframedBytes,
    },
    /// Answers to commands that were not sent.
    #[error(
        "the board says Hello, but never to what it was asked: its answers name command {named}, and command {sent} was sent. If another \
         program talks to this board, end that; else its firmware does not follow docs/protocol.md: flash it again"
    )]
    Stray {
        /// The command that its last answer names.
        named: u8,
        /// The command that was sent last.
        sent: u8,
    },
    /// The board speaks another version of the protocol.
    #[error(
        "this board speaks version {found} of the protocol, this program version {VERSION}: flash the firmware of this program with \
         `tactomo board flash`"
    )]
    Version {
        /// The version that it speaks.
        found: u8,
    },
    /// The link broke.
    #[error("the link broke: {0}")]
    Link(String),
}

/// Asks the board on `link` for Hello until it answers.
///
/// # Errors
/// [`GreetError`] if it does not before `deadline`, or in another version of the protocol.
pub fn greet(link: &mut dyn Link, deadline: Instant) -> Result<Hello, GreetError> {
    let begin = Instant::now();
    let mut receiver = BoardReceiver::default();
    let mut session = Session::new(RequestedSettings::default());
    let (mut buffer, mut unframed) = ([0; 512], UnframedBytes::default());
    while Instant::now() < deadline {
        let sent = session.transmit(link, receiver.counters().corrupt);
        let read = sent.and_then(|()| link.read(&mut buffer));
        let count = read.map_err(|error| GreetError::Link(error.to_string()))?;
        unframed.add(&buffer[..count]);
        let mut input = &buffer[..count];
        while let Some(message) = receiver.receive(&mut input) {
            match message {
                Ok(BoardMessage::Hello(hello)) => return Ok(hello),
                Ok(BoardMessage::Fault(fault)) => drop(session.fault(&fault)),
                Err(DecodeError::Version(found)) => return Err(GreetError::Version { found }),
                _ => {}
            }
        }
    }
    Err(GreetError::Silent { seconds: begin.elapsed().as_secs(), unframed })
}

/// What a fault means, for people.
pub fn explain(fault: &Fault) -> String {
    match fault {
        Fault::Panic(place) => format!("its firmware panicked at {place} and started anew"),
        Fault::Reset(cause) => format!("it restarted by itself: {cause}"),
        Fault::AdcStuck => "no conversion of its ADC finishes in time".to_owned(),
        Fault::BadSettings { .. } => "it refuses the settings, and keeps the old ones".to_owned(),
        Fault::BadPlan { .. } => "it refuses the scan plan, and keeps the old one".to_owned(),
        Fault::BadRate { .. } => {
            "its line cannot be set to the rate that was asked for, and keeps the old one".to_owned()
        }
        Fault::NoTable { .. } => {
            "it has no table to find contacts by, or cannot take this one: `tactomo board table` sends one".to_owned()
        }
        Fault::BrokenWires { electrodes } => {
            let broken: Vec<_> = (0..u32::BITS).filter(|e| electrodes >> e & 1 == 1).map(|e| e.to_string()).collect();
            format!("electrode {} is left out: its wire is broken", broken.join(" and electrode "))
        }
        Fault::UnknownVersion(version) => format!("it got a command in version {version} of the protocol"),
    }
}
