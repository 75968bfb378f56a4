//! A recording as a link: its bytes, when they came.

use std::fs::File;
use std::io::{self, BufReader};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use super::Link;
use crate::record::{RecordError, RecordReader};

/// Longest that a read waits.
const LONGEST_WAIT: Duration = Duration::from_millis(50);

/// A recording being played back.
pub struct ReplayLink {
    name: String,
    reader: RecordReader<BufReader<File>>,
    speed: f64,
    /// When the recording's time was zero.
    began: Option<Instant>,
    chunk: Chunk,
}

/// The chunk under way.
#[derive(Default)]
struct Chunk {
    time_us: u64,
    bytes: Vec<u8>,
    /// Bytes of it that were handed out.
    given: usize,
}

impl ReplayLink {
    /// Opens a recording, to be played `speed` times as fast as it was recorded: infinite for as fast as it can be read.
    ///
    /// # Errors
    /// [`RecordError`] if the file is not there or no recording.
    pub fn open(path: &Path, speed: f64) -> Result<Self, RecordError> {
        let reader = RecordReader::open(path)?;
        tracing::info!("playing {}: {}", path.display(), reader.header());
        let name = format!("recording {}", path.display());
        Ok(Self { name, reader, speed, began: None, chunk: Chunk::default() })
    }

    /// Gets the next chunk once the last is used up.
    fn advance(&mut self) -> io::Result<()> {
        if self.chunk.given < self.chunk.bytes.len() {
            return Ok(());
        }
        self.chunk.given = 0;
        self.chunk.bytes.clear();
        match self.reader.next_into(&mut self.chunk.bytes)? {
            Some(time_us) => self.chunk.time_us = time_us,
            None => return Err(io::Error::new(io::ErrorKind::UnexpectedEof, ended(&self.reader))),
        }
        Ok(())
    }

    /// How long it is until the chunk under way is due.
    fn wait(&mut self) -> Duration {
        let at = Duration::try_from_secs_f64(self.chunk.time_us as f64 * 1e-6 / self.speed).unwrap_or(Duration::MAX);
        let now = Instant::now();
        // Starting with the first chunk skips the silence before it.
        let began = *self.began.get_or_insert_with(|| now.checked_sub(at).unwrap_or(now));
        at.saturating_sub(now.duration_since(began))
    }
}

impl Link for ReplayLink {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.advance()?;
        let wait = if self.speed.is_finite() { self.wait() } else { Duration::ZERO };
        thread::sleep(wait.min(LONGEST_WAIT));
        if wait > LONGEST_WAIT {
            return Ok(0);
        }
        let rest = &self.chunk.bytes[self.chunk.given..];
        let count = rest.len().min(buffer.len());
        buffer[..count].copy_from_slice(&rest[..count]);
        self.chunk.given += count;
        Ok(count)
    }

    /// A recording takes no commands: what the board was told then is in its answers.
    fn write_all(&mut self, _bytes: &[u8]) -> io::Result<()> {
        Ok(())
    }
}

/// How the recording ended, for people.
fn ended<R: io::BufRead>(reader: &RecordReader<R>) -> String {
    let loss = reader.loss();
    match (loss.damaged_chunks, loss.tail_bytes) {
        (0, 0) => "the recording is over".to_owned(),
        (damaged, tail) => {
            format!(
                "the recording is over; {damaged} damaged chunks and an unfinished {tail} bytes at its end were left out"
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Header, RecordWriter};

    fn recording(name: &str, chunks: &[(u64, &[u8])]) -> std::path::PathBuf {
        let path = std::env::temp_dir().join(format!("tactomo-{}-{name}", std::process::id()));
        let mut writer = RecordWriter::new(File::create(&path).unwrap(), &Header::default()).unwrap();
        for (time_us, bytes) in chunks {
            writer.write(*time_us, bytes).unwrap();
        }
        path
    }

    fn play(link: &mut ReplayLink) -> Vec<u8> {
        let (mut all, mut buffer) = (Vec::new(), [0; 3]);
        loop {
            match link.read(&mut buffer) {
                Ok(count) => all.extend_from_slice(&buffer[..count]),
                Err(error) => {
                    assert_eq!(error.kind(), io::ErrorKind::UnexpectedEof);
                    return all;
                }
            }
        }
    }

    #[test]
    fn all_bytes_come_in_order_and_then_the_end() {
        let path = recording("order", &[(5, b"first"), (1_000_000_000, b"second"), (7, b"third")]);
        let mut link = ReplayLink::open(&path, f64::INFINITY).unwrap();
        assert_eq!(play(&mut link), b"firstsecondthird");
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn bytes_come_when_they_came() {
        let path = recording("pace", &[(9_000_000, b"a"), (9_400_000, b"b")]);
        let mut link = ReplayLink::open(&path, 4.0).unwrap();
        let begin = Instant::now();
        assert_eq!(play(&mut link), b"ab");
        assert!(begin.elapsed() >= Duration::from_millis(100), "0.4 s at four times the speed");
        std::fs::remove_file(path).unwrap();
    }
}
