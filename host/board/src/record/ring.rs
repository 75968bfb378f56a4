//! Keeps the last seconds of a board, and saves them when something happens.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use tactomo_physics::new_file::NewFileError;
use tactomo_protocol::Hello;

use super::{Closing, Header, Note, RecordError, Recorder};

/// Most bytes that are held: beyond that the oldest go, however short the time is. A board on USB at 3000 frames/s sends 1.2 MB/s.
const MOST_HELD: usize = 256 << 20;
/// Most files of one name.
const MOST_FILES: u32 = 100_000;

/// The last seconds of a board. When it is asked to save, a new file gets what it holds and what comes within a time after that.
#[derive(Debug)]
pub struct Ring {
    path: PathBuf,
    header: Header,
    last: Duration,
    after: Duration,
    held: VecDeque<(Instant, Vec<u8>)>,
    held_bytes: usize,
    hello: Option<Hello>,
    trigger: Trigger,
    /// The file under way, and when it ends.
    saving: Option<(Recorder, Instant)>,
    closing: Vec<Closing>,
    files: u32,
}

/// Tells a [`Ring`] to save, from any thread.
#[derive(Clone, Debug, Default)]
pub struct Trigger(Arc<AtomicBool>);

impl Trigger {
    /// Saves what is held and what follows; while a file is under way, that goes on for longer.
    pub fn save(&self) {
        self.0.store(true, Relaxed);
    }
}

impl Ring {
    /// Holds the `last` seconds, and saves them with what comes within the time `after`, in files like `path` with `-1`, `-2` and so on behind
    /// the name; their headers are like `header`.
    pub fn new(path: PathBuf, header: Header, last: Duration, after: Duration) -> Self {
        Self {
            path,
            header,
            last,
            after,
            held: VecDeque::new(),
            held_bytes: 0,
            hello: None,
            trigger: Trigger::default(),
            saving: None,
            closing: Vec::new(),
            files: 0,
        }
    }

    /// What tells it to save.
    pub fn trigger(&self) -> Trigger {
        self.trigger.clone()
    }

    /// Files that were begun.
    pub fn files(&self) -> u32 {
        self.files
    }

    /// Takes what the board says of itself: each file begins with that.
    pub fn hello(&mut self, hello: &Hello) {
        self.hello = Some(hello.clone());
    }

    /// Takes bytes that came at `arrived`; never waits for a disk. Returns the file that was begun, if one was.
    ///
    /// # Errors
    /// [`RecordError`] if a file cannot be made or written.
    pub fn push(&mut self, bytes: &[u8], arrived: Instant) -> Result<Option<PathBuf>, RecordError> {
        self.hold(bytes, arrived);
        if self.saving.as_ref().is_some_and(|(_, end)| arrived > *end) {
            self.closing.extend(self.saving.take().map(|(recorder, _)| recorder.close()));
        }
        let done: Vec<usize> = (0..self.closing.len()).rev().filter(|&index| self.closing[index].is_done()).collect();
        for index in done {
            self.closing.swap_remove(index).wait()?;
        }
        if let Some((recorder, _)) = &mut self.saving {
            recorder.push(bytes, arrived)?;
        }
        self.obey(arrived)
    }

    fn hold(&mut self, bytes: &[u8], arrived: Instant) {
        self.held.push_back((arrived, bytes.to_vec()));
        self.held_bytes += bytes.len();
        let is_old = |(came, _): &(Instant, Vec<u8>)| arrived.saturating_duration_since(*came) > self.last;
        while self.held.front().is_some_and(is_old) || self.held_bytes > MOST_HELD {
            let Some((_, oldest)) = self.held.pop_front() else { break };
            self.held_bytes -= oldest.len();
        }
    }

    /// Begins a file, or lengthens the one under way, if that is asked for and the board is known.
    fn obey(&mut self, now: Instant) -> Result<Option<PathBuf>, RecordError> {
        let Some(hello) = &self.hello else { return Ok(None) };
        if !self.trigger.0.swap(false, Relaxed) {
            return Ok(None);
        }
        let note = Note::mark("saved here");
        if let Some((recorder, end)) = &mut self.saving {
            *end = now + self.after;
            recorder.note(note, now)?;
            return Ok(None);
        }
        let began = self.held.front().map_or(now, |(came, _)| *came);
        let header = self.header.clone().started_ago(now.saturating_duration_since(began));
        let mut recorder = create(&self.path, &mut self.files, |path| Recorder::since(began, path, &header, hello))?;
        for (came, bytes) in &self.held {
            recorder.push(bytes, *came)?;
        }
        recorder.note(note, now)?;
        let path = recorder.path().to_owned();
        self.saving = Some((recorder, now + self.after));
        Ok(Some(path))
    }

    /// Writes what is left of all files.
    ///
    /// # Errors
    /// [`RecordError`] if not everything could be kept.
    pub fn finish(mut self) -> Result<(), RecordError> {
        let last = self.saving.take().map(|(recorder, _)| recorder.close());
        let finished: Vec<_> = self.closing.drain(..).chain(last).map(Closing::wait).collect();
        finished.into_iter().collect()
    }
}

/// Makes the next file of a name that is not there yet; `count` is the number of the last one.
fn create(
    path: &Path,
    count: &mut u32,
    make: impl Fn(&Path) -> Result<Recorder, RecordError>,
) -> Result<Recorder, RecordError> {
    loop {
        *count += 1;
        match make(&numbered(path, *count)) {
            Err(RecordError::New(NewFileError::Exists { .. })) if *count < MOST_FILES => {}
            made => return made,
        }
    }
}

/// `touch.tactomo` with 3: `touch-3.tactomo`.
fn numbered(path: &Path, number: u32) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map_or_else(String::new, |extension| format!(".{}", extension.to_string_lossy()));
    path.with_file_name(format!("{stem}-{number}{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::RecordReader;

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("tactomo-{}-ring-{name}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    /// Packets of three bytes, one every 100 ms, each with its number; at these numbers it is asked to save.
    fn run(ring: &mut Ring, numbers: std::ops::Range<u8>, save_at: &[u8]) -> Vec<PathBuf> {
        let begin = Instant::now();
        let mut begun = Vec::new();
        for number in numbers {
            if save_at.contains(&number) {
                ring.trigger().save();
            }
            begun.extend(ring.push(&[number, 9, 0], begin + Duration::from_millis(100 * u64::from(number))).unwrap());
        }
        begun
    }

    /// Numbers of the packets in a file, but for the Hello, and the times of its marks (us).
    fn read(path: &Path) -> (Vec<u8>, Vec<u64>) {
        let mut reader = RecordReader::open(path).unwrap();
        let (mut bytes, mut marks, mut packets) = (Vec::new(), Vec::new(), Vec::new());
        while let Some(entry) = reader.next_entry(&mut bytes).unwrap() {
            match entry.note {
                Some(_) => marks.push(entry.time_us),
                None => packets.push(bytes.clone()),
            }
        }
        (packets.iter().filter(|packet| packet.len() == 3).map(|packet| packet[0]).collect(), marks)
    }

    fn ring(folder: &Path) -> Ring {
        let seconds = Duration::from_secs;
        let mut ring = Ring::new(folder.join("touch.tactomo"), Header::default(), seconds(2), seconds(1));
        ring.hello(&Hello::example(16));
        ring
    }

    #[test]
    fn what_came_before_and_after_is_saved_and_nothing_else() {
        let folder = folder("saved");
        let mut ring = ring(&folder);
        let begun = run(&mut ring, 1..120, &[50, 100]);
        ring.finish().unwrap();
        let files = ["touch-1.tactomo", "touch-2.tactomo"].map(|name| folder.join(name));
        assert_eq!(begun, files);
        // The packet in which a file begins may have begun before: it is left out.
        assert_eq!(read(&files[0]), ((31..=60).collect(), vec![2_000_000]));
        assert_eq!(read(&files[1]), ((81..=110).collect(), vec![2_000_000]));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_second_event_lengthens_the_file_and_files_that_are_there_stay() {
        let folder = folder("longer");
        std::fs::write(folder.join("touch-1.tactomo"), "mine").unwrap();
        let mut ring = ring(&folder);
        let begun = run(&mut ring, 1..80, &[10, 15, 24]);
        ring.finish().unwrap();
        assert_eq!(begun, [folder.join("touch-2.tactomo")]);
        assert_eq!(read(&begun[0]).0, (2..=34).collect::<Vec<u8>>());
        assert_eq!(read(&begun[0]).1.len(), 3);
        assert_eq!(std::fs::read(folder.join("touch-1.tactomo")).unwrap(), b"mine");
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn an_event_before_the_board_is_known_is_kept_in_mind() {
        let folder = folder("early");
        let mut ring = Ring::new(folder.join("t"), Header::default(), Duration::from_secs(2), Duration::ZERO);
        ring.trigger().save();
        assert_eq!(ring.push(&[1, 2, 0], Instant::now()).unwrap(), None);
        ring.hello(&Hello::example(16));
        assert_eq!(ring.push(&[2, 2, 0], Instant::now()).unwrap(), Some(folder.join("t-1")));
        drop(ring);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
