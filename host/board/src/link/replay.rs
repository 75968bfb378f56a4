//! A recording as a link: its bytes, when they came.

mod player;

use std::fs::File;
use std::io;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use tactomo_protocol::{BoardMessage, BoardReceiver};

use self::player::Clock;
use super::{Control, ControlError, Link, Playing};
use crate::record::{Note, RecordError, RecordReader};

/// Longest that a read waits.
const LONGEST_WAIT: Duration = Duration::from_millis(50);

/// A recording being played back.
pub struct ReplayLink {
    name: String,
    reader: RecordReader<File>,
    clock: Clock,
    looped: bool,
    stays_open: bool,
    chunk: Chunk,
    /// Times of the first chunk and the last one (us).
    span_us: [u64; 2],
    /// Where to go on (us), once the packet under way is complete.
    seek_us: Option<u64>,
    /// What is given is not what followed in the recording.
    jumped: bool,
    stage: Stage,
    /// Whether a packet is to be given although the clock is stopped, to show where it stands.
    shows: bool,
    /// Looks for the board's Hello until it was given: without it nobody knows what frames mean.
    hello: Option<Box<BoardReceiver>>,
}

/// Where in the stream of bytes the link is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Between two packets.
    Between,
    /// Within a packet of which some bytes were given.
    Within,
    /// Within a packet of which none were given: they are left out up to its end.
    Joining,
    /// At the end.
    Ended,
}

/// The chunk under way.
#[derive(Default)]
struct Chunk {
    time_us: u64,
    bytes: Vec<u8>,
    /// Bytes of it that were handed out or left out.
    given: usize,
}

impl Chunk {
    fn rest(&self) -> &[u8] {
        &self.bytes[self.given..]
    }
}

impl ReplayLink {
    /// Opens a recording, to be played `speed` times as fast as it was recorded: infinite for as fast as it can be read.
    ///
    /// At its end the link is over, unless it `stays_open` for whoever may [seek](Control::Seek) back.
    ///
    /// # Errors
    /// [`RecordError`] if the file is not there or no recording.
    pub fn open(path: &Path, speed: f64, stays_open: bool) -> Result<Self, RecordError> {
        let open = |source| RecordError::Open { path: path.to_owned(), source };
        let mut reader = RecordReader::open(path)?;
        tracing::info!("playing {}: {}", path.display(), reader.header());
        let last_us = reader.last_time_us().map_err(open)?;
        let mut link = Self {
            name: format!("recording {}", path.display()),
            reader,
            clock: Clock::new(speed),
            looped: false,
            stays_open,
            chunk: Chunk::default(),
            span_us: [0; 2],
            seek_us: None,
            jumped: false,
            shows: false,
            stage: Stage::Between,
            hello: Some(Box::default()),
        };
        // The silence before the first chunk is skipped.
        if link.next_chunk().map_err(open)? {
            let first_us = link.chunk.time_us;
            link.span_us = [first_us, last_us.unwrap_or_default().max(first_us)];
        }
        link.clock.restart(link.span_us[0], Instant::now());
        Ok(link)
    }

    /// Gets the next chunk; whether there is one.
    fn next_chunk(&mut self) -> io::Result<bool> {
        self.chunk.given = 0;
        self.chunk.bytes.clear();
        while let Some(entry) = self.reader.next_entry(&mut self.chunk.bytes)? {
            match entry.note {
                None => {
                    self.chunk.time_us = entry.time_us;
                    return Ok(true);
                }
                Some(Note::Joined { .. }) => {
                    // Another recording follows, whose board counts anew.
                    self.jumped = true;
                    self.stage = Stage::Between;
                }
                Some(_) => {}
            }
        }
        Ok(false)
    }

    /// Makes sure that there are bytes to give; whether there are, or the recording has ended.
    fn has_bytes(&mut self) -> io::Result<bool> {
        loop {
            if self.stage == Stage::Joining {
                self.join();
            }
            if !self.chunk.rest().is_empty() {
                return Ok(true);
            }
            if !self.next_chunk()? {
                return Ok(false);
            }
        }
    }

    /// Leaves out bytes up to the end of a packet.
    fn join(&mut self) {
        match self.chunk.rest().iter().position(|byte| *byte == 0) {
            Some(end) => {
                self.chunk.given += end + 1;
                self.stage = Stage::Between;
            }
            None => self.chunk.given = self.chunk.bytes.len(),
        }
    }

    /// Whether it is to go on elsewhere, and cannot do so yet: a packet is under way, or the board has not said Hello.
    fn must_go_on(&self) -> bool {
        self.seek_us.is_some() && (self.stage == Stage::Within || self.hello.is_some()) && self.stage != Stage::Ended
    }

    /// Goes where it was asked to.
    fn obey_seek(&mut self) -> io::Result<()> {
        if self.must_go_on() {
            return Ok(());
        }
        let Some(time_us) = self.seek_us.take() else { return Ok(()) };
        if time_us <= self.span_us[0] {
            self.reader.rewind()?;
            self.stage = Stage::Between;
        } else {
            self.reader.seek(time_us)?;
            self.stage = Stage::Joining;
        }
        self.jumped = true;
        self.shows = true;
        self.clock.restart(time_us, Instant::now());
        self.next_chunk()?;
        Ok(())
    }

    /// What there is to do at the end: to begin again, to stay there, or to be over.
    fn end(&mut self) -> io::Result<usize> {
        let is_empty = self.span_us[0] == self.span_us[1] && self.chunk.time_us == 0;
        let begins_again = self.looped && !is_empty;
        if !self.stays_open && !begins_again {
            return Err(io::Error::new(io::ErrorKind::UnexpectedEof, ended(&self.reader)));
        }
        if self.stage != Stage::Ended && !begins_again {
            tracing::info!("{}", ended(&self.reader));
        }
        self.stage = Stage::Ended;
        if begins_again {
            self.seek_us = Some(self.span_us[0]);
        } else {
            thread::sleep(LONGEST_WAIT);
        }
        Ok(0)
    }

    /// Gives bytes of the chunk under way; those up to the end of the packet, if it is to go on elsewhere.
    fn give(&mut self, buffer: &mut [u8]) -> usize {
        let rest = self.chunk.rest();
        let mut count = rest.len().min(buffer.len());
        if self.seek_us.is_some() && self.hello.is_none() || self.shows {
            count = rest[..count].iter().position(|byte| *byte == 0).map_or(count, |end| end + 1);
        }
        buffer[..count].copy_from_slice(&rest[..count]);
        self.chunk.given += count;
        self.stage = if buffer[..count].ends_with(&[0]) { Stage::Between } else { Stage::Within };
        self.shows &= self.stage == Stage::Within;
        self.look_for_hello(&buffer[..count]);
        count
    }

    fn look_for_hello(&mut self, mut bytes: &[u8]) {
        let Some(receiver) = &mut self.hello else { return };
        while let Some(message) = receiver.receive(&mut bytes) {
            if matches!(message, Ok(BoardMessage::Hello(_))) {
                self.hello = None;
                return;
            }
        }
    }

    /// Seconds from the beginning to a time of the recording.
    fn seconds(&self, time_us: u64) -> f64 {
        time_us.saturating_sub(self.span_us[0]) as f64 * 1e-6
    }

    fn position_us(&self) -> u64 {
        match (self.stage, self.seek_us) {
            (_, Some(time_us)) => time_us,
            (Stage::Ended, None) => self.span_us[1],
            _ => self.clock.position_us(Instant::now()).min(self.chunk.time_us).max(self.span_us[0]),
        }
    }

    fn seek(&mut self, position_s: f64) {
        let length_us = self.span_us[1] - self.span_us[0];
        // Casting holds what is out of range at its ends.
        self.seek_us = Some(self.span_us[0] + ((position_s * 1e6) as u64).min(length_us));
    }
}

impl Link for ReplayLink {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.obey_seek()?;
        if self.stage == Stage::Ended || !self.has_bytes()? {
            return self.end();
        }
        let is_due = self.must_go_on() || self.shows && self.clock.is_paused();
        let wait = if is_due { Duration::ZERO } else { self.clock.wait(self.chunk.time_us, Instant::now()) };
        thread::sleep(wait.min(LONGEST_WAIT));
        if wait > LONGEST_WAIT {
            return Ok(0);
        }
        Ok(self.give(buffer))
    }

    /// A recording takes no commands: what the board was asked then is in its answers.
    fn write_all(&mut self, _bytes: &[u8]) -> io::Result<()> {
        Ok(())
    }

    fn control(&mut self, control: &Control) -> Result<(), ControlError> {
        match *control {
            Control::Pause(paused) => {
                if !paused && self.stage == Stage::Ended {
                    self.seek(0.0);
                }
                self.clock.pause(paused, self.position_us(), Instant::now());
            }
            Control::Seek(position_s) if position_s.is_finite() => self.seek(position_s),
            Control::Seek(_) => return Err(ControlError::Seek),
            Control::Speed(speed) if speed > 0.0 => self.clock.set_speed(speed, self.position_us(), Instant::now()),
            Control::Speed(speed) => return Err(ControlError::Speed(speed)),
            Control::Loop(looped) => self.looped = looped,
            Control::Press(_) | Control::Scene(_) | Control::Faults(_) => return Err(ControlError::Recording),
        }
        Ok(())
    }

    fn playing(&self) -> Playing {
        Playing::Recording {
            position_s: self.seconds(self.position_us()),
            length_s: self.seconds(self.span_us[1]),
            speed: self.clock.speed(),
            paused: self.clock.is_paused(),
            looped: self.looped,
            ended: self.stage == Stage::Ended && self.seek_us.is_none(),
            damage: self.reader.loss(),
        }
    }

    fn jumped(&mut self) -> bool {
        std::mem::take(&mut self.jumped)
    }
}

/// How the recording ended, for people.
fn ended(reader: &RecordReader<File>) -> String {
    let loss = reader.loss();
    if loss.is_any() { format!("the recording is over; {loss}") } else { "the recording is over".to_owned() }
}

#[cfg(test)]
mod tests;
