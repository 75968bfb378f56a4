//! The talk with a board: who are you, here are your settings, start.
//!
//! No input or output happens here: a [`Session`] is told what came and asked what to send.

use std::time::{Duration, Instant};

use tactomo_protocol::{BoardMessage, BoardReceiver, Command, DecodeError, Fault, Hello, MAX_COMMAND, Settings};

use crate::link::Link;

/// Time between two askings for Hello.
const ASK_EVERY: Duration = Duration::from_millis(250);

/// A board that was started and sends no frame for this long is asked again.
const SILENCE: Duration = Duration::from_millis(1500);

/// Settings of the scan that the user asks for; what is `None` stays as the board has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RequestedSettings {
    /// Wait between grounding an electrode and its first conversion, in microseconds (us).
    pub settle_us: Option<u16>,
    /// Base-2 logarithm of the conversions averaged into one reading.
    pub average_log2: Option<u8>,
    /// Frames a second at most; 0 for as fast as the board can.
    pub max_frames_per_s: Option<u16>,
}

impl RequestedSettings {
    /// The settings `now`, with those that are asked for.
    fn over(&self, now: Settings) -> Settings {
        Settings {
            settle_us: self.settle_us.unwrap_or(now.settle_us),
            average_log2: self.average_log2.unwrap_or(now.average_log2),
            max_frames_per_s: self.max_frames_per_s.unwrap_or(now.max_frames_per_s),
        }
    }
}

/// Why a board cannot be talked to.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GreetError {
    /// No Hello in time.
    #[error("no board said Hello within {seconds} s ({junk_bytes} bytes came that were no message)")]
    Silent {
        /// How long was waited (s).
        seconds: u64,
        /// Bytes that came and were no message: many mean another baud rate or another program on the board.
        junk_bytes: u64,
    },
    /// The board's version of the protocol is another.
    #[error("this board cannot be used: {0}")]
    Version(DecodeError),
    /// The link broke.
    #[error("the link broke: {0}")]
    Link(String),
}

/// Where the talk stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Waiting for Hello.
    Asking,
    /// Waiting for the Hello that answers Configure.
    Configuring(Settings),
    /// Frames are expected.
    Started,
}

/// The talk with one board, from the opening of its link on.
#[derive(Debug)]
pub struct Session {
    settings: RequestedSettings,
    stage: Stage,
    /// A command to be sent at once.
    due: Option<Command>,
    /// When the board was last heard of, or asked.
    heard: Option<Instant>,
}

impl Session {
    /// The talk with a board of which nothing is known yet.
    pub fn new(settings: RequestedSettings) -> Self {
        Self { settings, stage: Stage::Asking, due: None, heard: None }
    }

    /// The command to send now, if any.
    pub fn command(&mut self, now: Instant) -> Option<Command> {
        let command = self.due.take().or_else(|| self.is_silent(now).then_some(Command::Hello))?;
        self.heard = Some(now);
        Some(command)
    }

    fn is_silent(&self, now: Instant) -> bool {
        let patience = if self.stage == Stage::Started { SILENCE } else { ASK_EVERY };
        self.heard.is_none_or(|heard| now.duration_since(heard) >= patience)
    }

    /// Takes a Hello: an answer, or a board that has started anew and has to be told everything again.
    pub fn hello(&mut self, hello: &Hello, now: Instant) {
        let wanted = self.settings.over(hello.settings);
        let refused = self.stage == Stage::Configuring(wanted) && hello.settings != wanted;
        if hello.settings == wanted || refused {
            if refused {
                tracing::warn!("the board keeps {:?} instead of {wanted:?}", hello.settings);
                self.settings = RequestedSettings::default();
            }
            self.stage = Stage::Started;
            self.due = Some(Command::Start);
        } else {
            self.stage = Stage::Configuring(wanted);
            self.due = Some(Command::Configure(wanted));
        }
        self.heard = Some(now);
    }

    /// Takes note of a frame.
    pub fn frame(&mut self, now: Instant) {
        if self.stage == Stage::Started {
            self.heard = Some(now);
        }
    }
}

/// Asks the board on `link` for Hello until it answers.
///
/// # Errors
/// [`GreetError`] if it does not before `deadline`, or not in this version of the protocol.
pub fn greet(link: &mut dyn Link, deadline: Instant) -> Result<Hello, GreetError> {
    let begin = Instant::now();
    let mut receiver = BoardReceiver::default();
    let mut session = Session::new(RequestedSettings::default());
    let mut buffer = [0; 512];
    while Instant::now() < deadline {
        if let Some(command) = session.command(Instant::now()) {
            send(link, &command).map_err(|error| GreetError::Link(error.to_string()))?;
        }
        let count = link.read(&mut buffer).map_err(|error| GreetError::Link(error.to_string()))?;
        let mut input = &buffer[..count];
        while let Some(message) = receiver.receive(&mut input) {
            match message {
                Ok(BoardMessage::Hello(hello)) => return Ok(hello),
                Err(error @ DecodeError::Version(_)) => return Err(GreetError::Version(error)),
                _ => {}
            }
        }
    }
    let seconds = begin.elapsed().as_secs();
    Err(GreetError::Silent { seconds, junk_bytes: receiver.counters().dropped_bytes })
}

/// Sends a command.
///
/// # Errors
/// If the link does not take it.
pub fn send(link: &mut dyn Link, command: &Command) -> std::io::Result<()> {
    let mut wire = [0; MAX_COMMAND];
    let length = tactomo_protocol::encode_command(command, &mut wire).map_err(std::io::Error::other)?;
    // A zero ends whatever noise the board may have got before.
    link.write_all(&[0])?;
    link.write_all(&wire[..length])
}

/// What a fault means, for people.
pub fn explain(fault: &Fault) -> String {
    match fault {
        Fault::Panic(place) => format!("its firmware panicked at {place} and started anew"),
        Fault::Reset(cause) => format!("it restarted by itself: {cause}"),
        Fault::AdcStuck => "no conversion of its ADC finishes in time".to_owned(),
        Fault::BadSettings => "it refuses the settings, and keeps the old ones".to_owned(),
        Fault::UnknownVersion(version) => format!("it got a command in version {version} of the protocol"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hello(settings: Settings) -> Hello {
        Hello {
            firmware_version: "0.1.0".try_into().unwrap_or_default(),
            board: "test".try_into().unwrap_or_default(),
            electrodes: 16,
            adc_bits: 12,
            adc_full_scale_mv: 3300,
            drive_mv: 2000,
            settings,
        }
    }

    #[test]
    fn hello_is_asked_for_until_it_comes_and_then_the_board_is_started() {
        let begin = Instant::now();
        let mut session = Session::new(RequestedSettings::default());
        assert_eq!(session.command(begin), Some(Command::Hello));
        assert_eq!(session.command(begin), None);
        let later = begin + ASK_EVERY;
        assert_eq!(session.command(later), Some(Command::Hello));
        session.hello(&hello(Settings::default()), later);
        assert_eq!(session.command(later), Some(Command::Start));
        assert_eq!(session.command(later + ASK_EVERY), None, "frames may take their time");
        assert_eq!(session.command(later + SILENCE), Some(Command::Hello), "a silent board is asked again");
    }

    #[test]
    fn wishes_are_sent_once_and_a_board_that_keeps_its_own_is_started_all_the_same() {
        let now = Instant::now();
        let mut session = Session::new(RequestedSettings { settle_us: Some(70), ..RequestedSettings::default() });
        let wanted = Settings { settle_us: 70, ..Settings::default() };
        session.hello(&hello(Settings::default()), now);
        assert_eq!(session.command(now), Some(Command::Configure(wanted)));
        session.hello(&hello(wanted), now);
        assert_eq!(session.command(now), Some(Command::Start));

        let mut session = Session::new(RequestedSettings { settle_us: Some(70), ..RequestedSettings::default() });
        session.hello(&hello(Settings::default()), now);
        session.command(now);
        session.hello(&hello(Settings::default()), now);
        assert_eq!(session.command(now), Some(Command::Start), "nobody asks twice");
    }

    #[test]
    fn a_board_that_says_hello_by_itself_is_started_again() {
        let now = Instant::now();
        let mut session = Session::new(RequestedSettings::default());
        session.hello(&hello(Settings::default()), now);
        session.command(now);
        session.frame(now);
        assert_eq!(session.command(now + SILENCE / 2), None);
        session.hello(&hello(Settings::default()), now);
        assert_eq!(session.command(now), Some(Command::Start));
    }
}
