//! One link: what is said on it, and what of its bytes is no message.

use std::io;
use std::time::{Duration, Instant};

use tactomo_board::check::UnframedBytes;
use tactomo_board::link::Link;
use tactomo_board::record::PlainPackets;
use tactomo_board::session::{self, GreetError, Session};
use tactomo_protocol::BoardReceiver;

/// How long a board has to say Hello: opening the port may have reset it, and then it boots first.
const PATIENCE: Duration = Duration::from_secs(6);

/// One link, from its opening on.
pub(super) struct Connection {
    /// Whether there is a board that hears what it is asked: a recording has the answers that another host got.
    pub answers: bool,
    pub session: Session,
    /// Bytes pass it before they are kept and received.
    pub plain: PlainPackets,
    pub receiver: BoardReceiver,
    /// What came before the board said Hello.
    unframed: UnframedBytes,
    opened: Instant,
    /// Stretches of junk until the board said Hello, in answer to what it was asked; `None` before.
    pub junk: Option<u64>,
    /// Corrupt stretches that were counted.
    counted: u64,
    /// Whether no frame has come since a jump.
    pub landing: bool,
}

impl Connection {
    /// A link that was just opened, to a board that such settings are asked of, and that answers or does not.
    pub fn new(settings: session::RequestedSettings, answers: bool) -> Self {
        Self {
            answers,
            session: Session::new(settings),
            plain: PlainPackets::default(),
            receiver: BoardReceiver::default(),
            unframed: UnframedBytes::default(),
            opened: Instant::now(),
            junk: None,
            counted: 0,
            landing: false,
        }
    }

    /// Sends what is due and reads what has come; returns the number of bytes.
    pub fn exchange(&mut self, link: &mut dyn Link, buffer: &mut [u8]) -> io::Result<usize> {
        self.session.transmit(link, self.receiver.counters().corrupt)?;
        let count = link.read(buffer)?;
        if self.junk.is_none() {
            self.unframed.add(&buffer[..count]);
        }
        Ok(count)
    }

    /// Whether no board has said Hello in time, and what is wrong.
    pub fn in_vain(&self) -> Option<GreetError> {
        if self.junk.is_some() || self.opened.elapsed() < PATIENCE {
            return None;
        }
        let silent = GreetError::Silent { seconds: PATIENCE.as_secs(), unframed: self.unframed.clone() };
        Some(self.session.stray().map_or(silent, |(named, sent)| GreetError::Stray { named, sent }))
    }

    /// Forgets the packet under way: what follows it is elsewhere.
    pub fn jumped(&mut self) {
        (self.plain, self.receiver) = (PlainPackets::default(), BoardReceiver::default());
        (self.junk, self.counted, self.landing) = (self.junk.map(|_| 0), 0, true);
    }

    /// Takes note of a frame: the rest of a packet that a jump has landed in is behind.
    pub fn landed(&mut self) {
        if std::mem::take(&mut self.landing) {
            self.counted = self.receiver.counters().corrupt;
        }
    }

    /// Corrupt stretches since the last time this was asked; boot text before Hello is none.
    pub fn newly_corrupt(&mut self) -> u64 {
        let Some(junk) = self.junk else { return 0 };
        let corrupt = self.receiver.counters().corrupt - junk;
        let newly = corrupt - self.counted;
        self.counted = corrupt;
        // The rest of a packet that a jump has landed in is none, and neither is what comes at a rate that the line does not keep.
        if self.landing || self.session.is_changing_rate() { 0 } else { newly }
    }
}

#[cfg(test)]
mod tests {
    use tactomo_protocol::{FrameHead, MAX_WIRE, encode_frame};

    use super::*;

    fn frame() -> Vec<u8> {
        let mut wire = [0; MAX_WIRE];
        let length = encode_frame(FrameHead::default(), &[7; 16], &mut wire).unwrap();
        wire[..length].to_vec()
    }

    /// Receives bytes in one read, and takes note of the frames in them; how many stretches are newly corrupt.
    fn receive(connection: &mut Connection, bytes: &[u8]) -> u64 {
        let mut input = bytes;
        while let Some(message) = connection.receiver.receive(&mut input) {
            if message.is_ok() {
                connection.landed();
            }
        }
        connection.newly_corrupt()
    }

    #[test]
    fn where_a_jump_lands_is_no_damage_and_what_comes_after_is() {
        let mut connection = Connection::new(session::RequestedSettings::default(), false);
        connection.junk = Some(0);
        let junk = b"\x09a rest\0";
        assert_eq!(receive(&mut connection, &[junk, &frame()[..]].concat()), 1);
        connection.jumped();
        assert_eq!(
            receive(&mut connection, &[junk, &frame()[..]].concat()),
            0,
            "the rest of a packet, and a frame in the same read"
        );
        assert_eq!(receive(&mut connection, &[junk, &frame()[..]].concat()), 1);
        connection.jumped();
        assert_eq!(receive(&mut connection, junk) + receive(&mut connection, &frame()), 0, "in two reads");
    }
}
