//! Reads a recording, whatever has happened to it.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read, Seek};
use std::path::Path;

use super::format::{Kind, MAX_CHUNK, MAX_OVERHEAD, Parsed};
use super::scan::{find_whole, is_one_chunk, parse};
use super::start::{Opened, Refused};
use super::window::Window;
use super::{Header, Loss, Note, RecordError};
use tactomo_table::file;

/// Bytes at the end in which the last chunk is looked for first: four of the longest.
const LAST_BYTES: u64 = 4 * (MAX_CHUNK + MAX_OVERHEAD) as u64;

/// Reads a recording, chunk by chunk; its bytes are not trusted.
#[derive(Debug)]
pub struct RecordReader<R: Read> {
    window: Window<R>,
    header: Header,
    loss: Loss,
    /// Where the first chunk of data is, or what is damaged before it.
    first: u64,
    /// Where damage ends that was counted: it is not counted again when it is read again.
    counted: BTreeSet<u64>,
    /// Time of the last chunk (us).
    time_us: u64,
}

/// What follows in a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Time since the start of the recording (us): when the bytes came, or the note was made.
    pub time_us: u64,
    /// The note; `None` for bytes of the board.
    pub note: Option<Note>,
}

impl RecordReader<File> {
    /// Opens a recording.
    ///
    /// # Errors
    /// [`RecordError`] if the file is not there, or no recording that this program reads.
    pub fn open(path: &Path) -> Result<Self, RecordError> {
        let open = |source| RecordError::Open { path: path.to_owned(), source };
        if path.is_dir() {
            return Err(RecordError::Folder { path: path.to_owned() });
        }
        let file = file::check_regular(path).and_then(|()| File::open(path));
        Self::new(file.map_err(open)?, path)
    }
}

impl<R: Read> RecordReader<R> {
    /// Reads the header of the recording in `input`, called `path` in errors.
    ///
    /// # Errors
    /// [`RecordError`] if it is no recording that this program reads.
    pub fn new(input: R, path: &Path) -> Result<Self, RecordError> {
        let mut window = Window::new(input);
        let path = || path.to_owned();
        let Opened { header, damage, junk_bytes } = Opened::new(&mut window).map_err(|refused| match refused {
            Refused::NotARecording => RecordError::NotARecording { path: path() },
            Refused::Version(found) => RecordError::Version { path: path(), found },
            Refused::Io(source) => RecordError::Open { path: path(), source },
        })?;
        let loss = Loss { header: damage, junk_bytes, ..Loss::default() };
        let first = window.offset();
        Ok(Self { window, header, loss, first, counted: BTreeSet::new(), time_us: 0 })
    }

    /// What the recording says about itself.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// What is damaged, as far as it was read.
    pub fn loss(&self) -> Loss {
        self.loss
    }

    /// Puts the bytes of the next chunk in place of what `bytes` holds; returns the time at which they came (us), or `None`
    /// at the end. Bytes of a chunk in which only these are damaged come all the same. Notes are passed over.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn next_into(&mut self, bytes: &mut Vec<u8>) -> io::Result<Option<u64>> {
        loop {
            match self.next_entry(bytes)? {
                Some(Entry { time_us, note: None }) => return Ok(Some(time_us)),
                Some(_) => {}
                None => return Ok(None),
            }
        }
    }

    /// Reads the next chunk or note, whichever comes first; its bytes take the place of those in `bytes`. `None` at the end.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn next_entry(&mut self, bytes: &mut Vec<u8>) -> io::Result<Option<Entry>> {
        loop {
            let begin = self.window.offset();
            let (chunk, is_whole) = match parse(&mut self.window)? {
                Parsed::Whole(chunk) => (chunk, true),
                Parsed::Damaged(chunk) if is_one_chunk(&mut self.window, chunk.length)? => {
                    self.count(begin + chunk.length as u64, |loss| loss.damaged_places += 1);
                    (chunk, false)
                }
                parsed => {
                    if !self.pass_damage(begin, matches!(parsed, Parsed::Short(_)))? {
                        return Ok(None);
                    }
                    continue;
                }
            };
            // The time of a damaged chunk may be what is damaged.
            self.time_us = if is_whole && chunk.kind != Kind::Header { chunk.time_us } else { self.time_us };
            let content = &self.window.held()[chunk.bytes.clone()];
            let entry = match chunk.kind {
                Kind::Data => {
                    bytes.clear();
                    bytes.extend_from_slice(content);
                    Some(Entry { time_us: self.time_us, note: None })
                }
                Kind::Note if is_whole => {
                    let note = serde_json::from_slice(content).unwrap_or(Note::Unknown);
                    Some(Entry { time_us: self.time_us, note: Some(note) })
                }
                Kind::Note | Kind::Header => None,
            };
            self.window.skip(chunk.length);
            if entry.is_some() {
                return Ok(entry);
            }
        }
    }

    /// Goes on to the next whole chunk; whether there is one. `may_be_cut`: whether what is here would be the end of a file that was cut.
    fn pass_damage(&mut self, begin: u64, may_be_cut: bool) -> io::Result<bool> {
        if self.window.ahead(1)?.is_empty() {
            return Ok(false);
        }
        let found = find_whole(&mut self.window)?;
        let passed = self.window.offset() - begin;
        self.count(self.window.offset(), |loss| match found {
            None if may_be_cut => loss.tail_bytes += passed,
            _ => {
                loss.damaged_places += 1;
                loss.left_out_bytes += passed;
            }
        });
        Ok(found.is_some())
    }

    /// Counts damage that ends at `end`, unless it was counted before.
    fn count(&mut self, end: u64, add: impl FnOnce(&mut Loss)) {
        if self.counted.insert(end) {
            add(&mut self.loss);
        }
    }
}

impl<R: Read + Seek> RecordReader<R> {
    /// Time of the last whole chunk (us); `None` if there is none. Reads the end of the file only, and then goes on where it was.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn last_time_us(&mut self) -> io::Result<Option<u64>> {
        let here = self.window.offset();
        let length = self.window.file_length()?;
        let mut back = LAST_BYTES;
        let last = loop {
            let from = length.saturating_sub(back).max(self.first);
            let last = self.last_from(from)?;
            if last.is_some() || from == self.first {
                break last;
            }
            back *= 16;
        };
        self.window.go_to(here)?;
        Ok(last)
    }

    /// The detector that a calibration found while this was recorded, as the end of the recording tells it; `None` if there is none.
    /// Goes on where it was.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn detector_found(&mut self) -> io::Result<Option<Note>> {
        let here = self.window.offset();
        let length = self.window.file_length()?;
        // Behind the headers, which are two and as long as the note is, there is at most the chunk under way.
        self.window.go_to(length.saturating_sub(LAST_BYTES + self.first).max(self.first))?;
        let mut found = None;
        while let Some(chunk) = find_whole(&mut self.window)? {
            if chunk.kind == Kind::Note {
                let note = serde_json::from_slice(&self.window.held()[chunk.bytes.clone()]).ok();
                found = note.filter(|note| matches!(note, Note::Detector { .. })).or(found);
            }
            self.window.skip(chunk.length);
        }
        self.window.go_to(here)?;
        Ok(found)
    }

    /// Time of the last whole chunk behind a place of the file.
    fn last_from(&mut self, from: u64) -> io::Result<Option<u64>> {
        let mut last = None;
        self.window.go_to(from)?;
        while let Some(chunk) = find_whole(&mut self.window)? {
            last = Some(chunk.time_us);
            self.window.skip(chunk.length);
        }
        Ok(last)
    }

    /// Goes on with the first chunk that came at `time_us` or later (us), found by halving the file: times never fall.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn seek(&mut self, time_us: u64) -> io::Result<()> {
        let (mut low, mut high) = (self.first, self.window.file_length()?);
        while high - low > LAST_BYTES {
            let middle = low + (high - low) / 2;
            self.window.go_to(middle)?;
            match find_whole(&mut self.window)? {
                Some(chunk) if chunk.time_us < time_us && self.window.offset() < high => low = self.window.offset(),
                _ => high = middle,
            }
        }
        self.window.go_to(low)?;
        self.time_us = time_us;
        while let Some(chunk) = find_whole(&mut self.window)? {
            if chunk.kind == Kind::Data && chunk.time_us >= time_us {
                break;
            }
            self.window.skip(chunk.length);
        }
        Ok(())
    }

    /// Goes on with the first chunk.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn rewind(&mut self) -> io::Result<()> {
        self.time_us = 0;
        self.window.go_to(self.first)
    }
}
