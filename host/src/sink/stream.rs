//! Answers as JSON Lines: an object for each solved frame, for programs that go on with touch.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use tactomo_touch::schema::FrameReport;

use crate::run::SolvedFrame;
use crate::run::plan::Listener;

/// Lines that may wait for whoever reads them; more are lost and counted, so that a slow reader never slows touch: 3 s at 1200 frames/s.
const QUEUE: usize = 4096;
/// Longest that a line waits in the buffer.
const FLUSH_EVERY: Duration = Duration::from_millis(20);

/// Why there is no stream.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// The file cannot be made, or is there already.
    #[error("cannot write the stream {path}; it has to be a new file, or `-` for stdout")]
    Create {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

/// Writes answers, in a thread of its own.
pub struct Stream {
    lines: Option<SyncSender<String>>,
    writer: Option<JoinHandle<io::Result<()>>>,
    lost: u64,
}

impl Stream {
    /// Writes to a new file, or to stdout if it is called `-`.
    ///
    /// # Errors
    /// [`StreamError`] if the file is there already or cannot be made.
    pub fn create(path: &Path) -> Result<Self, StreamError> {
        let failed = |source| StreamError::Create { path: path.to_owned(), source };
        let out: Box<dyn Write + Send> = match path.as_os_str() == "-" {
            true => Box::new(io::stdout()),
            false => Box::new(File::create_new(path).map_err(failed)?),
        };
        Self::start(out).map_err(failed)
    }

    fn start(out: Box<dyn Write + Send>) -> io::Result<Self> {
        let (lines, queue) = sync_channel(QUEUE);
        let writer =
            thread::Builder::new().name("stream".to_owned()).spawn(move || write(&queue, BufWriter::new(out)))?;
        Ok(Self { lines: Some(lines), writer: Some(writer), lost: 0 })
    }
}

impl Listener for Stream {
    fn solved(&mut self, solved: &SolvedFrame<'_>) {
        let SolvedFrame { frame, solution, age } = solved;
        let line = FrameReport {
            time_s: Some(frame.board_time_us as f64 * 1e-6),
            sequence: Some(frame.sequence),
            age_us: Some(age.as_secs_f64() * 1e6),
            ..FrameReport::of(solution)
        };
        let sent = serde_json::to_string(&line).ok().zip(self.lines.as_ref()).map(|(line, lines)| lines.try_send(line));
        self.lost += u64::from(!matches!(sent, Some(Ok(()))));
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        self.lines = None;
        match self.writer.take().map(JoinHandle::join) {
            // Whoever reads has enough.
            Some(Ok(Err(error))) if error.kind() == io::ErrorKind::BrokenPipe => return,
            Some(Ok(Err(error))) => tracing::error!("the stream ended early: {error}"),
            _ => {}
        }
        if self.lost > 0 {
            tracing::warn!("{} lines of the stream were lost: its reader is too slow", self.lost);
        }
    }
}

fn write(lines: &Receiver<String>, mut out: BufWriter<Box<dyn Write + Send>>) -> io::Result<()> {
    loop {
        match lines.recv_timeout(FLUSH_EVERY) {
            Ok(line) => writeln!(out, "{line}")?,
            Err(RecvTimeoutError::Timeout) => out.flush()?,
            Err(RecvTimeoutError::Disconnected) => return out.flush(),
        }
    }
}
