//! The table by which a board finds contacts by itself: how it is sent.

use std::io;
use std::time::{Duration, Instant};

use tactomo_protocol::{
    BoardMessage, BoardReceiver, Command, Fault, MAX_PIECE, Request, TableId, TablePiece, TableState,
};

use crate::link::Link;
use crate::session;

/// How long a board has to answer, and how often it is asked. A board that erases flash for the first piece takes up to 4 s (128 kB of an STM32F405, bytes
/// written one at a time; its data sheet, "Flash memory programming"), or for one in 64 up to 0.4 s (4 kB behind an ESP32); all others some milliseconds.
const PATIENCE: Duration = Duration::from_secs(6);
const TRIES: u32 = 3;
/// How often a table is begun at most: once more where it turns out to be another one than the board has, and once for each of two resets meanwhile.
const MOST_BEGINNINGS: u32 = 4;
/// Tags of commands go on from here, away from those of whoever has asked for Hello.
const FIRST_TAG: u8 = 127;
/// Before this version a firmware knows nothing of tables, and does not answer.
const OLD_FIRMWARE: &str = "its firmware is older than this program: flash it with `tactomo board flash`";

/// A table that a board did not get.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// The link broke.
    #[error("{link}: the link broke while the table was sent")]
    Link {
        /// Name of the link.
        link: String,
        /// What the system says.
        source: io::Error,
    },
    /// No answer.
    #[error("{link}: the board does not answer to a table; if it answers otherwise, {OLD_FIRMWARE}")]
    Silent {
        /// Name of the link.
        link: String,
    },
    /// It keeps none.
    #[error(
        "{link}: this board keeps no table, so it cannot find contacts by itself; docs/core.md says which boards can"
    )]
    NoRoom {
        /// Name of the link.
        link: String,
    },
    /// It is too long.
    #[error("{link}: the table has {bytes} bytes, and the board has room for {room}")]
    TooLong {
        /// Name of the link.
        link: String,
        /// Bytes of the table.
        bytes: usize,
        /// Bytes that the board keeps.
        room: usize,
    },
    /// It forgets what it has got.
    #[error(
        "{link}: the board has asked for the table from the beginning again and again, the last time at byte {at}: it restarts while it writes, or its flash \
         keeps nothing. Look for a fault of its supply (`tactomo live` names the reason of the last reset), try another cable or USB port, then another board"
    )]
    Forgets {
        /// Name of the link.
        link: String,
        /// How far the last try came (bytes).
        at: usize,
    },
    /// It was refused.
    #[error(
        "{link}: the board refuses the table at byte {at}: it is damaged, of another number of electrodes or another drive, or its flash cannot be written. \
         Compile the detector again, and say `--detector` if it is not the one that is connected"
    )]
    Refused {
        /// Name of the link.
        link: String,
        /// Where it was refused.
        at: usize,
    },
}

/// Sends a table to the board on `link`, unless it has that very one, and says of each piece how many bytes are there. The board stops streaming.
///
/// # Errors
/// [`TableError`] if the board has no room, refuses it or does not answer.
pub fn send(link: &mut dyn Link, table: &[u8], mut sent: impl FnMut(usize)) -> Result<TableId, TableError> {
    let mut talk = Talk { link, receiver: BoardReceiver::default(), tag: FIRST_TAG };
    talk.stop()?;
    let state = talk.ask(TablePiece::default())?;
    let link = talk.link.name();
    match state.room as usize {
        0 => return Err(TableError::NoRoom { link }),
        room if room < table.len() => return Err(TableError::TooLong { link, bytes: table.len(), room }),
        _ => {}
    }
    let checksum = table.last_chunk().map(|four| u32::from_le_bytes(*four));
    if let Some(usable) = state.usable.filter(|usable| Some(usable.checksum) == checksum) {
        return Ok(usable);
    }
    let (mut at, mut beginnings) = (0, 1);
    loop {
        let end = table.len().min(at + MAX_PIECE);
        let bytes = table[at..end].iter().copied().collect();
        let state = talk.ask(TablePiece { at: at as u32, bytes })?;
        if let Some(usable) = state.usable.filter(|usable| Some(usable.checksum) == checksum) {
            return Ok(usable);
        }
        // Where the board is: it has started anew if that is before where this piece ended.
        let held = (state.held as usize).min(table.len());
        if held == table.len() {
            return Err(TableError::Refused { link, at: held });
        }
        beginnings += u32::from(held < end);
        if beginnings > MOST_BEGINNINGS {
            return Err(TableError::Forgets { link, at });
        }
        at = held;
        sent(at);
    }
}

struct Talk<'a> {
    link: &'a mut dyn Link,
    receiver: BoardReceiver,
    tag: u8,
}

/// How a board answers.
enum Answer {
    Obeyed(Option<TableState>),
    Refused,
}

impl Talk<'_> {
    /// Has the board stop streaming: so it takes commands as fast as they come.
    fn stop(&mut self) -> Result<(), TableError> {
        self.command(&Command::Stop).map(|_| ())
    }

    fn ask(&mut self, piece: TablePiece) -> Result<TableState, TableError> {
        let at = piece.at as usize;
        match self.command(&Command::Table(piece))? {
            Answer::Obeyed(Some(state)) => Ok(state),
            Answer::Obeyed(None) => Err(self.silent()),
            Answer::Refused => Err(TableError::Refused { link: self.link.name(), at }),
        }
    }

    fn silent(&self) -> TableError {
        TableError::Silent { link: self.link.name() }
    }

    /// Sends a command until it is answered.
    fn command(&mut self, command: &Command) -> Result<Answer, TableError> {
        for _ in 0..TRIES {
            self.tag = self.tag.checked_add(1).unwrap_or(1);
            let request = Request { tag: self.tag, command: command.clone() };
            let answer = session::send(self.link, &request).and_then(|()| self.answer());
            let answer = answer.map_err(|source| TableError::Link { link: self.link.name(), source })?;
            if let Some(answer) = answer {
                return Ok(answer);
            }
        }
        Err(self.silent())
    }

    /// The answer to the command that was sent last; `None` if none comes in time.
    fn answer(&mut self) -> io::Result<Option<Answer>> {
        let (deadline, mut buffer, mut state) = (Instant::now() + PATIENCE, [0; 512], None);
        while Instant::now() < deadline {
            let count = self.link.read(&mut buffer)?;
            let mut input = &buffer[..count];
            while let Some(message) = self.receiver.receive(&mut input) {
                match message {
                    Ok(BoardMessage::Table(told)) if told.answers == self.tag => state = Some(told),
                    Ok(BoardMessage::Hello(hello)) if hello.answers == self.tag => {
                        return Ok(Some(Answer::Obeyed(state)));
                    }
                    Ok(BoardMessage::Fault(Fault::NoTable { answers })) if answers == self.tag => {
                        return Ok(Some(Answer::Refused));
                    }
                    _ => {}
                }
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests;
