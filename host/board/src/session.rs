//! The talk with a board: who are you, here are your settings, start.
//!
//! No input or output happens here: a [`Session`] is given what came and asked what to send.

use std::fmt;
use std::time::{Duration, Instant};

use tactomo_protocol::{BoardMessage, BoardReceiver, Command, DecodeError, Fault, Hello, MAX_COMMAND, Settings};

use crate::link::Link;

/// Time between two askings for Hello.
const ASK_EVERY: Duration = Duration::from_millis(250);

/// A board that was started and sends no frame for this long is asked again.
const SILENCE: Duration = Duration::from_millis(1500);

/// Time between two sendings of settings that the board has not confirmed. It obeys between two rows of a scan, of which the longest (16 x 256
/// conversions of 40 us, 66 ms to settle) takes 0.23 s; but one that is just starting, or a flipped bit on the line, loses them.
const CONFIGURE_EVERY: Duration = Duration::from_millis(500);
/// How often they are sent before they count as refused: 2.5 s, in which a board has started anew, too.
const CONFIGURE_TRIES: u32 = 5;

/// A started board that sends no frame for this long, and the time of its slowest frame, is [mute](Session::is_mute): by then it was asked
/// again twice, and a chip that had just restarted would have answered.
pub const MUTE_AFTER: Duration = Duration::from_secs(4);
/// No board takes longer for a conversion: the slowest, the ESP32-C3, takes about 40 us (docs/hardware.md).
const CONVERSION: Duration = Duration::from_micros(50);

/// What a [mute](Session::is_mute) board means and what to do, for people.
pub const MUTE: &str = "the board answers but sends no frames: its scan hangs, or the line loses long packets. Press the board's reset button; \
     if that does not help, try another cable or USB port, a lower baud rate on both sides, and flash the firmware again";

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
    /// These, with those that are asked for later.
    pub fn changed_by(self, later: Self) -> Self {
        Self {
            settle_us: later.settle_us.or(self.settle_us),
            average_log2: later.average_log2.or(self.average_log2),
            max_frames_per_s: later.max_frames_per_s.or(self.max_frames_per_s),
        }
    }

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

/// Settings that a board does not take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// What was asked for.
    pub wanted: Settings,
    /// What the board keeps.
    pub kept: Settings,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { wanted, kept } = self;
        let rate = |settings: &Settings| match settings.max_frames_per_s {
            0 => "as many frames a second as it can".to_owned(),
            rate => format!("at most {rate} frames a second"),
        };
        let parts = [
            (wanted.settle_us != kept.settle_us)
                .then(|| format!("a settle time of {} us instead of {} us", kept.settle_us, wanted.settle_us)),
            (wanted.average_log2 != kept.average_log2).then(|| {
                format!("an average over {} instead of {} conversions", kept.conversions(), wanted.conversions())
            }),
            (wanted.max_frames_per_s != kept.max_frames_per_s)
                .then(|| format!("{} instead of {}", rate(kept), rate(wanted))),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        write!(f, "the board keeps {}", parts.join(", and "))
    }
}

/// Settings on their way to the board.
#[derive(Clone, Copy, Debug)]
struct Configuring {
    wanted: Settings,
    /// How often they were sent.
    tries: u32,
    /// When they were sent last.
    sent: Option<Instant>,
}

/// The talk with one board, from the opening of its link on.
///
/// Any Hello may be an old one: the one of the board's start, or the answer to an earlier question. So only [`Fault::BadSettings`], or
/// silence about settings that were sent several times, is a refusal.
#[derive(Debug)]
pub struct Session {
    requested: RequestedSettings,
    /// What the board said of itself last.
    hello: Option<Hello>,
    configuring: Option<Configuring>,
    /// Whether Start is to be sent at once.
    start_is_due: bool,
    /// Since when frames are expected and none came: since the first Start after the last frame.
    waiting_since: Option<Instant>,
    /// Whether the board was started.
    started: bool,
    /// When the board was last heard of, or asked.
    heard: Option<Instant>,
    refusal: Option<Refusal>,
}

impl Session {
    /// The talk with a board of which nothing is known yet.
    pub fn new(requested: RequestedSettings) -> Self {
        Self {
            requested,
            hello: None,
            configuring: None,
            start_is_due: false,
            waiting_since: None,
            started: false,
            heard: None,
            refusal: None,
        }
    }

    /// Asks the board for other settings, which may be while frames come; what is `None` stays as it is. A board that starts anew gets
    /// them again.
    pub fn request(&mut self, requested: RequestedSettings) {
        self.requested = self.requested.changed_by(requested);
        self.refusal = None;
        if let Some(hello) = &self.hello {
            let wanted = self.requested.over(hello.settings);
            // Settings that are on their way may still arrive, so they have to be taken back too.
            let is_wanted = hello.settings == wanted && self.configuring.is_none();
            self.configuring = (!is_wanted).then_some(Configuring { wanted, tries: 0, sent: None });
        }
    }

    /// The settings that the board did not take, if there are such since the last [request](Self::request).
    pub fn refusal(&self) -> Option<Refusal> {
        self.refusal
    }

    /// The command to send now, if any.
    pub fn command(&mut self, now: Instant) -> Option<Command> {
        let command = self.next_command(now)?;
        self.heard = Some(now);
        Some(command)
    }

    fn next_command(&mut self, now: Instant) -> Option<Command> {
        if std::mem::take(&mut self.start_is_due) {
            self.started = true;
            self.waiting_since.get_or_insert(now);
            return Some(Command::Start);
        }
        if let Some(configuring) = &mut self.configuring {
            let is_due = configuring.sent.is_none_or(|sent| now.saturating_duration_since(sent) >= CONFIGURE_EVERY);
            if is_due && configuring.tries < CONFIGURE_TRIES {
                configuring.tries += 1;
                configuring.sent = Some(now);
                return Some(Command::Configure(configuring.wanted));
            }
            if is_due {
                self.refused();
                return self.next_command(now);
            }
            return None;
        }
        self.is_silent(now).then_some(Command::Hello)
    }

    fn is_silent(&self, now: Instant) -> bool {
        let patience = if self.started { SILENCE } else { ASK_EVERY };
        self.heard.is_none_or(|heard| now.saturating_duration_since(heard) >= patience)
    }

    /// Takes a Hello: an answer, an old one, or that of a board that has started anew and has to be told everything again.
    pub fn hello(&mut self, hello: &Hello, now: Instant) {
        self.heard = Some(now);
        let wanted = self.requested.over(hello.settings);
        let is_changing = self.configuring.is_some_and(|configuring| configuring.wanted == wanted);
        if hello.settings == wanted {
            self.configuring = None;
            self.start_is_due = true;
        } else if !is_changing {
            self.configuring = Some(Configuring { wanted, tries: 0, sent: None });
        }
        self.hello = Some(hello.clone());
    }

    /// Takes note of a fault that the board reports.
    pub fn fault(&mut self, fault: &Fault) {
        if *fault == Fault::BadSettings && self.configuring.is_some_and(|configuring| configuring.tries > 0) {
            self.refused();
        }
    }

    /// Gives up the settings that were asked for; the board goes on with those that it has.
    fn refused(&mut self) {
        let wanted = self.configuring.take().map(|configuring| configuring.wanted);
        if let Some((wanted, hello)) = wanted.zip(self.hello.as_ref()) {
            let refusal = Refusal { wanted, kept: hello.settings };
            tracing::warn!("{refusal}");
            self.refusal = Some(refusal);
        }
        self.requested = RequestedSettings::default();
        self.start_is_due = true;
    }

    /// Takes note of a frame.
    pub fn frame(&mut self, now: Instant) {
        if self.started {
            self.heard = Some(now);
            self.waiting_since = None;
        }
    }

    /// Whether the board answers and sends no frames, although it was started, and asked again.
    pub fn is_mute(&self, now: Instant) -> bool {
        let patience = MUTE_AFTER + self.hello.as_ref().map(slowest_frame).unwrap_or_default();
        self.waiting_since.is_some_and(|since| now.saturating_duration_since(since) >= patience)
    }
}

/// Longest that a board takes for a frame with its settings.
fn slowest_frame(hello: &Hello) -> Duration {
    let (electrodes, settings) = (u32::from(hello.electrodes), hello.settings);
    let conversions = (electrodes * electrodes) << settings.average_log2.min(Settings::MAX_AVERAGE_LOG2);
    let scan = CONVERSION * conversions + Duration::from_micros(settings.settle_us.into()) * electrodes;
    let period = match settings.max_frames_per_s {
        0 => Duration::ZERO,
        rate => Duration::from_secs(1) / u32::from(rate),
    };
    scan.max(period)
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
mod tests;
