//! Keeps a recording while it is made, off the thread that receives.

use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tactomo_physics::causes::with_causes;
use tactomo_physics::new_file::{self, NewFileError};
use tactomo_protocol::Hello;

use super::packets::FirstPacket;
use super::{Header, Note, RecordError, RecordWriter};

/// What is not yet with the system is lost when the program is killed: at most this much.
const FLUSH_EVERY: Duration = Duration::from_millis(200);

/// Bytes that may wait for a slow disk. A board on USB at 3000 frames/s sends 1.2 MB/s: a disk may then stall for 200 s, longer than any
/// that is not broken. More would only take the memory of a machine that cannot keep up.
const MAX_WAITING: usize = 256 << 20;

/// What is to be written, and its time (us from the start).
type Entry = (u64, What);

/// What is to be written.
#[derive(Debug)]
enum What {
    Bytes(Vec<u8>),
    Note(Note),
}

impl What {
    /// Its size in memory, about.
    fn len(&self) -> usize {
        match self {
            Self::Bytes(bytes) => bytes.len(),
            Self::Note(_) => size_of::<Note>(),
        }
    }
}

/// Writes what it is given to a file, in a thread of its own: nothing here waits for the disk but [`finish`](Self::finish) and dropping it.
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    began: Instant,
    /// Time of what was pushed last (us): times never fall.
    last_us: u64,
    first: FirstPacket,
    /// `None` once no more is taken.
    entries: Option<Sender<Entry>>,
    /// What a calibration found meanwhile, written once more at the end.
    found: Option<Note>,
    /// Bytes that wait for the disk.
    waiting: Arc<AtomicUsize>,
    most_waiting: usize,
    /// `None` once its error is reported.
    writer: Option<JoinHandle<io::Result<Kept>>>,
}

/// A recording of which the rest is being written.
#[derive(Debug)]
pub struct Closing {
    path: PathBuf,
    writer: Option<JoinHandle<io::Result<Kept>>>,
}

impl Recorder {
    /// Begins a recording in a new file, before the board says Hello.
    ///
    /// # Errors
    /// [`RecordError`] if the file cannot be written, or is there already: no recording is overwritten.
    pub fn create(path: &Path, header: &Header) -> Result<Self, RecordError> {
        // The header tells the time at which its owner calls this.
        let began = Instant::now();
        let mut recorder = Self::begin(path, header, None)?;
        recorder.began = began;
        Ok(recorder)
    }

    /// Begins a new file with its header, and what the board says of itself; nothing is left of one that takes not even these.
    fn begin(path: &Path, header: &Header, hello: Option<&Hello>) -> Result<Self, RecordError> {
        let file = new_file::create(path)?;
        let is_file = file.metadata().is_ok_and(|found| found.is_file());
        let begun = RecordWriter::new(BufWriter::new(file), header).and_then(|mut writer| {
            hello.map_or(Ok(()), |hello| writer.hello(hello))?;
            writer.flush()?;
            let kept = if is_file && hello.is_none() { Kept::Nothing } else { Kept::Something };
            Self::start(path, writer, |file| new_file::sync(file.get_ref()), (MAX_WAITING, kept))
        });
        begun.map_err(|source| {
            if is_file {
                drop(std::fs::remove_file(path));
            }
            NewFileError::of(path, source).into()
        })
    }

    /// Begins a recording in a new file while frames come from a board that has said `hello`. The recording begins with that, twice, so
    /// that damage to one does not cost the meaning of all frames; what comes before the end of the packet under way is left out.
    ///
    /// # Errors
    /// [`RecordError`] as of [`create`](Self::create).
    pub fn create_with_hello(path: &Path, header: &Header, hello: &Hello) -> Result<Self, RecordError> {
        Self::since(Instant::now(), path, header, hello)
    }

    /// Begins a recording of bytes of which the first came at `began`, some time ago.
    pub(super) fn since(began: Instant, path: &Path, header: &Header, hello: &Hello) -> Result<Self, RecordError> {
        let mut recorder = Self::begin(path, header, Some(hello))?;
        (recorder.began, recorder.first) = (began, FirstPacket::within());
        Ok(recorder)
    }

    fn start<W: Write + Send + 'static>(
        path: &Path,
        writer: RecordWriter<W>,
        sync: impl FnOnce(&W) -> io::Result<()> + Send + 'static,
        (most_waiting, kept): (usize, Kept),
    ) -> io::Result<Self> {
        let (entries, queue) = channel();
        let waiting = Arc::new(AtomicUsize::new(0));
        let left = Arc::clone(&waiting);
        let writer = thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || keep(writer, &queue, &left, sync, kept))?;
        Ok(Self {
            path: path.to_owned(),
            began: Instant::now(),
            last_us: 0,
            first: FirstPacket::default(),
            entries: Some(entries),
            found: None,
            waiting,
            most_waiting,
            writer: Some(writer),
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Adds bytes that came at `arrived`; never waits.
    ///
    /// # Errors
    /// [`RecordError::Full`] or [`RecordError::Write`] if the file takes no more, [`RecordError::TooSlow`] if 256 MB wait for the disk. What came before is
    /// kept; nothing more is taken.
    pub fn push(&mut self, bytes: &[u8], arrived: Instant) -> Result<(), RecordError> {
        let bytes = self.first.rest(bytes);
        if bytes.is_empty() {
            return Ok(());
        }
        self.send(What::Bytes(bytes.to_vec()), arrived)
    }

    /// Sets down a note at `made`; never waits.
    ///
    /// # Errors
    /// As [`push`](Self::push) has them.
    pub fn note(&mut self, note: Note, made: Instant) -> Result<(), RecordError> {
        if matches!(note, Note::Detector { .. }) {
            self.found = Some(note.clone());
        }
        self.send(What::Note(note), made)
    }

    fn send(&mut self, what: What, at: Instant) -> Result<(), RecordError> {
        let length = what.len();
        if self.entries.is_some() && self.waiting.load(Relaxed) + length > self.most_waiting {
            self.entries = None;
            return Err(RecordError::TooSlow {
                path: self.path.clone(),
                waiting_mb: self.most_waiting >> 20,
                seconds: self.last_us as f64 * 1e-6,
            });
        }
        self.last_us = self.last_us.max(at.saturating_duration_since(self.began).as_micros() as u64);
        self.waiting.fetch_add(length, Relaxed);
        let is_taken = self.entries.as_ref().is_some_and(|entries| entries.send((self.last_us, what)).is_ok());
        if is_taken {
            return Ok(());
        }
        self.entries = None;
        // It has ended by itself, so this does not wait.
        outcome(&self.path, self.writer.take().filter(JoinHandle::is_finished))
    }

    /// Takes no more; the rest is written while the caller goes on.
    pub fn close(mut self) -> Closing {
        self.end();
        Closing { path: self.path.clone(), writer: self.writer.take() }
    }

    fn end(&mut self) {
        if let Some((found, entries)) = self.found.take().zip(self.entries.as_ref()) {
            // A writer that is gone has said why, or will.
            let _ = entries.send((self.last_us, What::Note(found)));
        }
        self.entries = None;
    }

    /// Writes what is left and closes the file.
    ///
    /// # Errors
    /// [`RecordError::Full`] or [`RecordError::Write`] if not everything could be kept.
    pub fn finish(self) -> Result<(), RecordError> {
        self.close().wait()
    }
}

impl Drop for Recorder {
    /// Writes what is left.
    fn drop(&mut self) {
        self.end();
        if let Some(Err(error)) = self.writer.take().map(|writer| outcome(&self.path, Some(writer))) {
            tracing::warn!("{}", with_causes(&error));
        }
    }
}

impl Closing {
    /// Whether all is written, so that [`wait`](Self::wait) does not wait.
    pub fn is_done(&self) -> bool {
        self.writer.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Waits until all is written.
    ///
    /// # Errors
    /// [`RecordError::Full`] or [`RecordError::Write`] if not everything could be kept.
    pub fn wait(self) -> Result<(), RecordError> {
        outcome(&self.path, self.writer)
    }
}

/// What came of the writing thread.
fn outcome(path: &Path, writer: Option<JoinHandle<io::Result<Kept>>>) -> Result<(), RecordError> {
    let written = match writer.map(JoinHandle::join) {
        Some(Ok(written)) => written,
        Some(Err(_)) => Err(io::Error::other("the thread that writes it has panicked")),
        None => Err(io::Error::other("it has failed before")),
    };
    match written {
        Ok(Kept::Something) => Ok(()),
        // A name that is taken by nothing would stop the next try.
        Ok(Kept::Nothing) => {
            drop(std::fs::remove_file(path));
            Ok(())
        }
        Err(source) => {
            let path = path.to_owned();
            Err(match source.kind() {
                ErrorKind::StorageFull | ErrorKind::QuotaExceeded => RecordError::Full { path },
                _ => RecordError::Write { path, source },
            })
        }
    }
}

/// What is in a file that was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kept {
    /// More than its header, or it is a device.
    Something,
    /// Its header alone: no board said anything.
    Nothing,
}

/// Writes the queue until it closes.
fn keep<W: Write>(
    mut writer: RecordWriter<W>,
    queue: &Receiver<Entry>,
    waiting: &AtomicUsize,
    sync: impl FnOnce(&W) -> io::Result<()>,
    mut kept: Kept,
) -> io::Result<Kept> {
    let mut flushed = Instant::now();
    loop {
        match queue.recv_timeout(FLUSH_EVERY) {
            Ok((time_us, what)) => {
                kept = Kept::Something;
                match &what {
                    What::Bytes(bytes) => writer.write(time_us, bytes)?,
                    What::Note(note) => writer.note(time_us, note)?,
                }
                // `end` does not count what it adds.
                let _ = waiting.fetch_update(Relaxed, Relaxed, |left| Some(left.saturating_sub(what.len())));
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        if flushed.elapsed() >= FLUSH_EVERY {
            writer.flush()?;
            flushed = Instant::now();
        }
    }
    writer.flush()?;
    sync(writer.get_ref())?;
    Ok(kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::RecordReader;
    use std::sync::mpsc;
    use tactomo_physics::detector::Detector;

    fn path(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("tactomo-{}-{name}", std::process::id()))
    }

    fn chunks(path: &Path) -> Vec<(u64, Vec<u8>)> {
        let mut reader = RecordReader::open(path).unwrap();
        let mut bytes = Vec::new();
        std::iter::from_fn(|| reader.next_into(&mut bytes).unwrap().map(|time_us| (time_us, bytes.clone()))).collect()
    }

    #[test]
    fn what_is_pushed_is_in_the_file_with_its_times_and_no_file_is_overwritten() {
        let path = path("recorder");
        let mut recorder = Recorder::create(&path, &Header::default()).unwrap();
        let began = recorder.began;
        recorder.push(b"one", began + Duration::from_micros(1500)).unwrap();
        recorder.push(b"two", began + Duration::from_micros(900)).unwrap();
        recorder.finish().unwrap();
        assert_eq!(chunks(&path), [(1500, b"one".to_vec()), (1500, b"two".to_vec())], "times never fall");
        let again = Recorder::create(&path, &Header::default());
        assert!(matches!(again, Err(RecordError::New(NewFileError::Exists { .. }))));
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_recording_in_which_no_board_said_anything_leaves_no_file() {
        let path = path("silent");
        for _ in 0..2 {
            Recorder::create(&path, &Header::default()).unwrap().finish().unwrap();
            drop(Recorder::create(&path, &Header::default()).unwrap());
            assert!(!path.exists());
        }
    }

    #[test]
    fn notes_stand_where_they_were_made_and_a_detector_that_was_found_at_the_end_too() {
        let path = path("notes");
        let mut recorder = Recorder::create(&path, &Header::default()).unwrap();
        let times: Vec<Instant> = (0..5).map(|ms| recorder.began + Duration::from_millis(ms)).collect();
        let detector = Detector::preset("strip-13x60").unwrap();
        let found = Note::detector_found(&detector);
        recorder.push(b"one", times[0]).unwrap();
        recorder.note(Note::mark("slipped"), times[1]).unwrap();
        recorder.push(b"two", times[2]).unwrap();
        recorder.note(found.clone(), times[3]).unwrap();
        recorder.push(b"three", times[4]).unwrap();
        recorder.finish().unwrap();
        let mut reader = RecordReader::open(&path).unwrap();
        assert_eq!(reader.detector_found().unwrap().as_ref(), Some(&found));
        assert_eq!(found.detector(&path).unwrap(), Some(detector));
        let mut bytes = Vec::new();
        let entries: Vec<_> = std::iter::from_fn(|| reader.next_entry(&mut bytes).unwrap()).collect();
        let notes: Vec<_> = entries.iter().map(|entry| (entry.time_us, entry.note.clone())).collect();
        let mark = Some(Note::mark("slipped"));
        let expected =
            [(0, None), (1000, mark), (2000, None), (3000, Some(found.clone())), (4000, None), (4000, Some(found))];
        assert_eq!(notes, expected);
        assert_eq!((chunks(&path).len(), reader.loss().is_any()), (3, false));
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_recorder_that_is_dropped_has_written_all() {
        let path = path("dropped");
        let mut recorder = Recorder::create(&path, &Header::default()).unwrap();
        recorder.push(b"one", Instant::now()).unwrap();
        drop(recorder);
        assert_eq!(chunks(&path)[0].1, b"one");
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_told_with_what_is_kept_and_what_to_do() {
        let full = std::fs::File::create("/dev/full").unwrap();
        let writer = RecordWriter { out: BufWriter::new(full), chunk: Vec::new() };
        let mut recorder =
            Recorder::start(Path::new("full"), writer, |_| Ok(()), (MAX_WAITING, Kept::Something)).unwrap();
        let error = loop {
            if let Err(error) = recorder.push(&[0; 10_000], Instant::now()) {
                break error;
            }
        };
        let told = "recording to full has stopped: the disk is full. What came before is kept in it; make room on the disk, or record to another one";
        assert_eq!(error.to_string(), told);
        assert!(recorder.push(b"more", Instant::now()).is_err());
    }

    /// A disk that takes nothing before it is let go.
    struct Stalled(mpsc::Receiver<()>, Vec<u8>);

    impl Write for Stalled {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let _ = self.0.recv();
            self.1.extend(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_disk_that_stalls_holds_up_nobody_and_ends_the_recording_when_too_much_waits() {
        let (go, stall) = mpsc::channel();
        let (kept, written) = mpsc::channel();
        let writer = RecordWriter { out: Stalled(stall, Vec::new()), chunk: Vec::new() };
        let sync = move |disk: &Stalled| kept.send(disk.1.len()).map_err(io::Error::other);
        let mut recorder = Recorder::start(Path::new("slow"), writer, sync, (10_000, Kept::Something)).unwrap();
        let begin = Instant::now();
        for _ in 0..10 {
            recorder.push(&[7; 1000], Instant::now()).unwrap();
        }
        let error = recorder.push(&[7], Instant::now()).unwrap_err();
        assert!(begin.elapsed() < Duration::from_secs(1), "pushing waited");
        assert!(error.to_string().contains("the disk is too slow"), "{error}");
        let closing = recorder.close();
        assert!(!closing.is_done());
        drop(go);
        closing.wait().unwrap();
        assert!(written.recv().unwrap() > 10_000, "what was taken before is kept");
    }
}
