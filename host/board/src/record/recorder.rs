//! Keeps a recording while it is made, off the thread that receives.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::{Header, RecordError, RecordWriter};

/// What is not yet with the system is lost when the program is killed: at most this much.
const FLUSH_EVERY: Duration = Duration::from_millis(200);

/// Chunks that may wait for a slow disk; the receiver then waits too, as no byte may be lost.
const QUEUE: usize = 4096;

/// Writes what it is given to a file, in a thread of its own.
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    began: Instant,
    chunks: SyncSender<(u64, Vec<u8>)>,
    /// `None` once it has failed.
    writer: Option<JoinHandle<io::Result<()>>>,
}

impl Recorder {
    /// Begins a recording in a new file.
    ///
    /// # Errors
    /// [`RecordError`] if the file cannot be written, or is there already: no recording is overwritten.
    pub fn create(path: &Path, header: &Header) -> Result<Self, RecordError> {
        let open = |source| RecordError::Open { path: path.to_owned(), source };
        let file = BufWriter::new(File::create_new(path).map_err(open)?);
        let mut writer = RecordWriter::new(file, header).map_err(open)?;
        writer.flush().map_err(open)?;
        let (chunks, queue) = sync_channel(QUEUE);
        let writer = thread::Builder::new().name("recorder".to_owned()).spawn(|| keep(writer, queue)).map_err(open)?;
        Ok(Self { path: path.to_owned(), began: Instant::now(), chunks, writer: Some(writer) })
    }

    /// Adds bytes that came just now.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the file takes no more.
    pub fn push(&mut self, bytes: &[u8]) -> Result<(), RecordError> {
        let time_us = self.began.elapsed().as_micros() as u64;
        if self.chunks.send((time_us, bytes.to_vec())).is_ok() {
            return Ok(());
        }
        self.join()
    }

    /// Writes what is left and closes the file.
    ///
    /// # Errors
    /// [`RecordError::Write`] if not everything could be kept.
    pub fn finish(mut self) -> Result<(), RecordError> {
        // The writer stops when its queue closes.
        self.chunks = sync_channel(0).0;
        self.join()
    }

    fn join(&mut self) -> Result<(), RecordError> {
        let written = match self.writer.take().map(JoinHandle::join) {
            Some(Ok(written)) => written,
            Some(Err(_)) => Err(io::Error::other("the recorder panicked")),
            None => Err(io::Error::other("it failed before")),
        };
        written.map_err(|source| RecordError::Write { path: self.path.clone(), source })
    }
}

/// Writes the queue until it closes.
fn keep(mut writer: RecordWriter<BufWriter<File>>, queue: Receiver<(u64, Vec<u8>)>) -> io::Result<()> {
    let mut flushed = Instant::now();
    loop {
        match queue.recv_timeout(FLUSH_EVERY) {
            Ok((time_us, bytes)) => writer.write(time_us, &bytes)?,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        if flushed.elapsed() >= FLUSH_EVERY {
            writer.flush()?;
            flushed = Instant::now();
        }
    }
    writer.flush()?;
    writer.get_ref().get_ref().sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::RecordReader;

    #[test]
    fn what_is_pushed_is_in_the_file_and_no_file_is_overwritten() {
        let path = std::env::temp_dir().join(format!("tactomo-{}-recorder", std::process::id()));
        let mut recorder = Recorder::create(&path, &Header::default()).unwrap();
        recorder.push(b"one").unwrap();
        recorder.push(b"two").unwrap();
        recorder.finish().unwrap();
        let mut reader = RecordReader::open(&path).unwrap();
        let mut bytes = Vec::new();
        assert!(reader.next_into(&mut bytes).unwrap().is_some());
        assert_eq!(bytes, b"one");
        let again = Recorder::create(&path, &Header::default());
        assert!(matches!(again, Err(RecordError::Open { .. })));
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_an_error() {
        let writer = RecordWriter::new(BufWriter::new(File::create("/dev/full").unwrap()), &Header::default()).unwrap();
        let (chunks, queue) = sync_channel(QUEUE);
        chunks.send((0, vec![0; 100_000])).unwrap();
        drop(chunks);
        assert!(keep(writer, queue).is_err());
    }
}
