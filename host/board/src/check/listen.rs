//! A board's frames one after the other, and what else it says.

use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

use tactomo_physics::readings::Readings;
use tactomo_protocol::{BoardMessage, BoardReceiver, DecodeError, Fault, Frame, Hello};

use super::UnframedBytes;
use crate::link::Link;
use crate::measured::Volts;
use crate::sequence::Sequence;
use crate::session::{self, GreetError, RequestedSettings, Session};
use crate::source::{Source, SourceError};

/// How long a board has to say Hello: opening the port may have reset it, and then it boots first.
const PATIENCE: Duration = Duration::from_secs(6);
/// Bytes of one read.
const READ_BYTES: usize = 4096;

/// Why there are no frames.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ListenError {
    /// The link does not open.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// No board says Hello.
    #[error("{link}: no board said Hello within {seconds} s. {unframed}", seconds = PATIENCE.as_secs())]
    Silent {
        /// Name of the link.
        link: String,
        /// What came instead.
        unframed: UnframedBytes,
    },
    /// It answers what it was not asked.
    #[error("{link}: {error}")]
    Stray {
        /// Name of the link.
        link: String,
        /// What it names.
        error: GreetError,
    },
    /// Its protocol is another.
    #[error("{link}: {error}")]
    Version {
        /// Name of the link.
        link: String,
        /// Which one.
        error: GreetError,
    },
    /// It says Hello, and sends no frames.
    #[error("{link}: {}", session::MUTE)]
    Mute {
        /// Name of the link.
        link: String,
    },
    /// The link broke.
    #[error("{link} broke: was the board unplugged?")]
    Link {
        /// Name of the link.
        link: String,
        /// What the system says.
        source: io::Error,
    },
}

/// What has come since Hello.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counted {
    /// Frames received whole.
    pub frames: u64,
    /// Frames that the sequence numbers say are missing.
    pub dropped: u64,
    /// Stretches of bytes that were no message.
    pub corrupt: u64,
}

/// A board that has said Hello and was started.
pub struct Listening {
    link: Box<dyn Link>,
    session: Session,
    receiver: BoardReceiver,
    hello: Hello,
    volts: Volts,
    sequence: Sequence,
    frames: VecDeque<Readings>,
    faults: Vec<Fault>,
    counted: Counted,
    /// Corrupt stretches until Hello: boot text, mostly.
    junk: u64,
    begun: Instant,
}

impl Listening {
    /// Opens the source, and asks for Hello until a board says it.
    ///
    /// # Errors
    /// [`ListenError`], which says what came instead and what to do.
    pub fn open(source: &mut dyn Source, settings: RequestedSettings) -> Result<Self, ListenError> {
        let mut link = source.open()?;
        let mut session = Session::new(settings);
        let mut receiver = BoardReceiver::default();
        let (opened, mut unframed) = (Instant::now(), UnframedBytes::default());
        let mut buffer = [0; READ_BYTES];
        while opened.elapsed() < PATIENCE {
            let count = transfer(&mut *link, &mut session, &receiver, &mut buffer)?;
            unframed.add(&buffer[..count]);
            let mut input = &buffer[..count];
            while let Some(message) = receiver.receive(&mut input) {
                match message {
                    Ok(BoardMessage::Hello(hello)) => {
                        session.hello(&hello, Instant::now());
                        if !session.knows_the_board() {
                            continue;
                        }
                        let mut listening = Self::new(link, session, receiver, hello);
                        listening.receive(input)?;
                        return Ok(listening);
                    }
                    Ok(BoardMessage::Fault(fault)) => drop(session.fault(&fault)),
                    Err(DecodeError::Version(found)) => return Err(version(&*link, found)),
                    _ => {}
                }
            }
        }
        let link = link.name();
        Err(match session.stray() {
            Some((named, sent)) => ListenError::Stray { link, error: GreetError::Stray { named, sent } },
            None => ListenError::Silent { link, unframed },
        })
    }

    fn new(link: Box<dyn Link>, session: Session, receiver: BoardReceiver, hello: Hello) -> Self {
        Self {
            link,
            session,
            junk: receiver.counters().corrupt,
            receiver,
            volts: Volts::of(&hello),
            hello,
            sequence: Sequence::default(),
            frames: VecDeque::new(),
            faults: Vec::new(),
            counted: Counted::default(),
            begun: Instant::now(),
        }
    }

    /// Who the board is.
    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// The link, for what a person asks of a simulated board.
    pub fn link(&mut self) -> &mut dyn Link {
        &mut *self.link
    }

    /// Faults that the board has reported.
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }

    /// What has come.
    pub fn counted(&self) -> Counted {
        Counted { corrupt: self.receiver.counters().corrupt - self.junk, ..self.counted }
    }

    /// Frames a second since Hello.
    pub fn frames_per_s(&self) -> f64 {
        self.counted.frames as f64 / self.begun.elapsed().as_secs_f64().max(1e-3)
    }

    /// The next frame (V), or `None` if none has come yet.
    ///
    /// # Errors
    /// [`ListenError`] if the link breaks or the board is mute.
    pub fn next_frame(&mut self) -> Result<Option<Readings>, ListenError> {
        if let Some(frame) = self.frames.pop_front() {
            return Ok(Some(frame));
        }
        let mut buffer = [0; READ_BYTES];
        let count = transfer(&mut *self.link, &mut self.session, &self.receiver, &mut buffer)?;
        self.receive(&buffer[..count])?;
        if self.session.is_mute(Instant::now()) {
            return Err(ListenError::Mute { link: self.link.name() });
        }
        Ok(self.frames.pop_front())
    }

    fn receive(&mut self, mut input: &[u8]) -> Result<(), ListenError> {
        while let Some(message) = self.receiver.receive(&mut input) {
            match message {
                Ok(BoardMessage::Frame(frame)) => self.take(&frame),
                Ok(BoardMessage::Hello(hello)) => {
                    self.session.hello(&hello, Instant::now());
                    (self.volts, self.hello) = (Volts::of(&hello), hello);
                }
                Ok(BoardMessage::Fault(fault)) => {
                    if !self.session.fault(&fault) {
                        self.faults.push(fault);
                    }
                }
                Err(DecodeError::Version(found)) => return Err(version(&*self.link, found)),
                Ok(BoardMessage::Contacts(_)) => self.session.contacts(Instant::now()),
                Ok(BoardMessage::Log(_) | BoardMessage::Clock(_) | BoardMessage::Table(_)) | Err(_) => {}
            }
        }
        Ok(())
    }

    fn take(&mut self, frame: &Frame) {
        self.session.frame(Instant::now());
        let Some(readings) = self.volts.readings(frame).filter(|_| frame.scope.is_whole()) else { return };
        self.frames.push_back(readings);
        self.counted.frames += 1;
        self.counted.dropped += self.sequence.place(&frame.head).dropped;
    }
}

impl Drop for Listening {
    fn drop(&mut self) {
        self.session.leave(&mut *self.link);
    }
}

fn transfer(
    link: &mut dyn Link,
    session: &mut Session,
    receiver: &BoardReceiver,
    buffer: &mut [u8],
) -> Result<usize, ListenError> {
    let sent = session.transmit(link, receiver.counters().corrupt);
    sent.and_then(|()| link.read(buffer)).map_err(|source| ListenError::Link { link: link.name(), source })
}

fn version(link: &dyn Link, found: u8) -> ListenError {
    ListenError::Version { link: link.name(), error: GreetError::Version { found } }
}
