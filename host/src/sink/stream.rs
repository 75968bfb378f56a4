//! Answers as JSON Lines: an object for each solved frame, for programs that go on with touch.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tactomo_touch::schema::FrameReport;

use crate::run::{Listener, TouchEvent};

/// Lines that may wait for whoever reads them; more are lost and counted, so that a slow reader never slows touch: 3 s at 1200 frames/s.
const QUEUE: usize = 4096;
/// Longest that a line waits in the buffer.
const FLUSH_EVERY: Duration = Duration::from_millis(20);
/// Longest wait for a reader at the end.
const PATIENCE: Duration = Duration::from_secs(1);

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
    fn touched(&mut self, event: &Arc<TouchEvent>) {
        let line =
            FrameReport { image_s_per_m2: None, readings_v: None, touch_v: None, averaged: None, ..event.report() };
        let sent = serde_json::to_string(&line).ok().zip(self.lines.as_ref()).map(|(line, lines)| lines.try_send(line));
        self.lost += u64::from(!matches!(sent, Some(Ok(()))));
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        self.lines = None;
        // A reader that is there and does not read would be waited for for ever.
        let end = Instant::now() + PATIENCE;
        while self.writer.as_ref().is_some_and(|writer| !writer.is_finished()) {
            if Instant::now() > end {
                tracing::warn!("the stream's reader does not read: the last lines are lost");
                return;
            }
            thread::sleep(Duration::from_millis(5));
        }
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
    let mut flushed = Instant::now();
    loop {
        match lines.recv_timeout(FLUSH_EVERY) {
            Ok(line) => writeln!(out, "{line}")?,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return out.flush(),
        }
        if flushed.elapsed() >= FLUSH_EVERY {
            out.flush()?;
            flushed = Instant::now();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use tactomo_touch::pointer::PointerEvent;
    use tactomo_touch::solve::{FoundContact, Solution};

    #[derive(Clone, Default)]
    struct Shared(Arc<Mutex<Vec<u8>>>);

    impl Write for Shared {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().extend(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn answers_are_lines_that_do_not_wait_while_more_come() {
        let out = Shared::default();
        let mut stream = Stream::start(Box::new(out.clone())).unwrap();
        let solution = Solution { contacts: vec![FoundContact::flat(0.01, 0.0, 1e-3)], ..Solution::default() };
        for sequence in 0..20 {
            let pointer_events = if sequence == 7 { vec![PointerEvent::Press] } else { Vec::new() };
            let age = Duration::from_micros(50);
            let of = TouchEvent::of(sequence, solution.clone());
            stream.touched(&Arc::new(TouchEvent { age, pointer_events, ..of }));
            thread::sleep(Duration::from_millis(5));
        }
        assert!(!out.0.lock().unwrap().is_empty(), "lines wait at most {FLUSH_EVERY:?}");
        drop(stream);
        let text = String::from_utf8(out.0.lock().unwrap().clone()).unwrap();
        let lines: Vec<serde_json::Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert_eq!((lines.len(), &lines[19]["sequence"]), (20, &19.into()));
        assert_eq!((&lines[3]["contacts"][0]["x_m"], &lines[3]["time_s"]), (&0.01.into(), &0.003.into()));
        assert_eq!((&lines[7]["events"][0]["kind"], lines[8].get("events")), (&"press".into(), None));
        assert!((lines[0]["age_us"].as_f64().unwrap() - 50.0).abs() < 1e-9);
    }
}
