//! One link: what is said on it, and what of its bytes is no message.

use std::io;
use std::time::{Duration, Instant};

use tactomo_board::link::Link;
use tactomo_board::session::{self, Session};
use tactomo_protocol::BoardReceiver;

/// How long a board has to say Hello: opening the port may have reset it, and then it boots first.
pub(super) const PATIENCE: Duration = Duration::from_secs(6);

/// One link, from its opening on.
pub(super) struct Talk {
    pub session: Session,
    pub receiver: BoardReceiver,
    opened: Instant,
    /// Stretches of junk until the board said Hello; `None` before.
    pub junk: Option<u64>,
    /// Corrupt stretches that were counted.
    counted: u64,
    /// Whether no frame has come since a jump.
    pub landing: bool,
    /// What the board has refused, as it is shown.
    pub refusal: Option<session::Refusal>,
}

impl Talk {
    /// A link that was just opened, to a board that such settings are asked of.
    pub fn new(settings: session::RequestedSettings) -> Self {
        Self {
            session: Session::new(settings),
            receiver: BoardReceiver::default(),
            opened: Instant::now(),
            junk: None,
            counted: 0,
            landing: false,
            refusal: None,
        }
    }

    /// Sends what is due and reads what has come; returns the number of bytes.
    pub fn exchange(&mut self, link: &mut dyn Link, buffer: &mut [u8]) -> io::Result<usize> {
        if let Some(command) = self.session.command(Instant::now()) {
            session::send(link, &command)?;
        }
        link.read(buffer)
    }

    /// Whether no board has said Hello in time.
    pub fn is_in_vain(&self) -> bool {
        self.junk.is_none() && self.opened.elapsed() >= PATIENCE
    }

    /// Forgets the packet under way: what follows it is elsewhere.
    pub fn jumped(&mut self) {
        self.receiver = BoardReceiver::default();
        (self.junk, self.counted, self.landing) = (self.junk.map(|_| 0), 0, true);
    }

    /// Corrupt stretches since the last time this was asked; boot text before Hello is none.
    pub fn newly_corrupt(&mut self) -> u64 {
        let Some(junk) = self.junk else { return 0 };
        if self.landing {
            // The rest of a packet that a jump has landed in is none.
            self.counted = self.receiver.counters().corrupt;
            return 0;
        }
        let corrupt = self.receiver.counters().corrupt - junk;
        let newly = corrupt - self.counted;
        self.counted = corrupt;
        newly
    }
}
