//! Cuts a piece out of a recording, and joins recordings, without decoding more than the board's Hello.

use std::fs::File;
use std::io::{self, BufWriter};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tactomo_physics::new_file::{self, NewFile, NewFileError};
use tactomo_protocol::{BoardMessage, BoardReceiver, DecodeError, Hello};

use super::packets::FirstPacket;
use super::{Header, Note, OtherProtocol, RecordError, RecordReader, RecordWriter};

/// Time between the end of a recording and the start of the one that is joined on (us).
const PAUSE_US: u64 = 1000;

/// Why nothing was cut or joined.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EditError {
    /// One of the recordings.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The new recording.
    #[error(transparent)]
    Output(#[from] NewFileError),
    /// A recording that cannot be read on.
    #[error("cannot read on in {path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Nothing came in the time that was to be cut out.
    #[error("{path} has nothing from {from_s} s to {to_s} s: its last bytes came {length_s:.3} s after its start")]
    Empty {
        /// The file.
        path: PathBuf,
        /// Start and end of that time (s).
        from_s: f64,
        /// The end.
        to_s: f64,
        /// Time of the last bytes (s).
        length_s: f64,
    },
    /// A recording in another version of the protocol, in which the board's Hello is not found.
    #[error("{path}: {other}")]
    Protocol {
        /// The file.
        path: PathBuf,
        /// Which version.
        other: OtherProtocol,
    },
    /// Recordings of different detectors.
    #[error(
        "{path} is of another detector than {first}: what is joined is read as one, so it has to be of one. Detectors differ too where only \
         one recording has a calibration; `tactomo recording info FILE` shows both"
    )]
    OtherDetector {
        /// The file.
        path: PathBuf,
        /// The one it was to be joined to.
        first: PathBuf,
    },
}

/// A new recording that was made of others.
struct Output {
    file: NewFile,
    writer: RecordWriter<BufWriter<File>>,
}

impl Output {
    fn create(path: &Path, header: &Header) -> Result<Self, NewFileError> {
        let file = NewFile::new(path)?;
        let writer = RecordWriter::new(file.create()?, header).map_err(|source| file.failed(source))?;
        Ok(Self { file, writer })
    }

    fn failed(&self) -> impl Fn(io::Error) -> EditError + use<> {
        let path = self.file.path().to_owned();
        move |source| NewFileError::of(&path, source).into()
    }

    fn write(&mut self, time_us: u64, bytes: &[u8]) -> Result<(), EditError> {
        self.writer.write(time_us, bytes).map_err(self.failed())
    }

    fn note(&mut self, time_us: u64, note: &Note) -> Result<(), EditError> {
        self.writer.note(time_us, note).map_err(self.failed())
    }

    fn finish(mut self) -> Result<(), EditError> {
        let done = self.writer.flush().and_then(|()| new_file::sync(self.writer.get_ref().get_ref()));
        done.map_err(self.failed())?;
        Ok(self.file.finish()?)
    }
}

fn cannot_read(path: &Path) -> impl Fn(io::Error) -> EditError + '_ {
    |source| EditError::Read { path: path.to_owned(), source }
}

/// Makes a new recording `out` of the times `span_s` (s from the start) of `recording`: from the first packet that begins in it on, with
/// the board's Hello before. Marks in it stay, and what a calibration has found.
///
/// # Errors
/// [`EditError`] if there is nothing in the span, `recording` cannot be read, or `out` cannot be written or is there already.
pub fn cut(recording: &Path, span_s: RangeInclusive<f64>, out: &Path) -> Result<(), EditError> {
    let mut reader = RecordReader::open(recording)?;
    let found = reader.detector_found().map_err(cannot_read(recording))?;
    let span_us = |s: f64| (s.max(0.0) * 1e6) as u64;
    let (from_us, to_us) = (span_us(*span_s.start()), span_us(*span_s.end()));
    let mut before = Before::default();
    let (mut bytes, mut output, mut last_us) = (Vec::new(), None, 0);
    while let Some(entry) = reader.next_entry(&mut bytes).map_err(cannot_read(recording))? {
        if entry.time_us > to_us {
            break;
        }
        last_us = entry.time_us;
        match (entry.note, entry.time_us < from_us) {
            (None, true) => {
                before.pass(&bytes).map_err(|other| EditError::Protocol { path: recording.to_owned(), other })?;
            }
            (Some(note), false) if !matches!(note, Note::Detector { .. }) => {
                let output = open_at(&mut output, &reader, from_us, out, &before)?;
                output.note(entry.time_us - from_us, &note)?;
            }
            (Some(_), _) => {}
            (None, false) => {
                let kept = before.first.rest(&bytes);
                let output = open_at(&mut output, &reader, from_us, out, &before)?;
                output.write(entry.time_us - from_us, kept)?;
            }
        }
    }
    let Some(mut output) = output else {
        let length_s = 1e-6 * reader.last_time_us().map_err(cannot_read(recording))?.unwrap_or_default() as f64;
        let (from_s, to_s) = (*span_s.start(), *span_s.end());
        return Err(EditError::Empty { path: recording.to_owned(), from_s, to_s, length_s });
    };
    if let Some(found) = found {
        output.note(last_us - from_us, &found)?;
    }
    output.finish()
}

/// The recording that is made, begun where it is not yet.
fn open_at<'a>(
    output: &'a mut Option<Output>,
    reader: &RecordReader<File>,
    from_us: u64,
    out: &Path,
    before: &Before,
) -> Result<&'a mut Output, EditError> {
    let made = match output.take() {
        Some(begun) => begun,
        None => {
            let header = reader.header().clone().started_later(Duration::from_micros(from_us));
            let mut made = Output::create(out, &header)?;
            if let Some(hello) = &before.hello {
                made.writer.hello(hello).map_err(made.failed())?;
            }
            made
        }
    };
    Ok(output.insert(made))
}

/// What came before the span.
#[derive(Default)]
struct Before {
    receiver: BoardReceiver,
    /// The last thing that the board said of itself.
    hello: Option<Hello>,
    first: FirstPacket,
}

impl Before {
    fn pass(&mut self, mut bytes: &[u8]) -> Result<(), OtherProtocol> {
        self.first.pass(bytes);
        while let Some(message) = self.receiver.receive(&mut bytes) {
            match message {
                Ok(BoardMessage::Hello(hello)) => self.hello = Some(hello),
                Err(DecodeError::Version(found)) => return Err(OtherProtocol { found }),
                _ => {}
            }
        }
        Ok(())
    }
}

/// Joins recordings of one detector, in this order, to a new one, `out`: each follows the one before at once, whatever time was between them.
/// A [note](Note::Joined) stands where each begins.
///
/// # Errors
/// [`EditError`] if they are of different detectors, one cannot be read, or `out` cannot be written or is there already.
pub fn merge(recordings: &[PathBuf], out: &Path) -> Result<(), EditError> {
    let Some((first, others)) = recordings.split_first() else { return Ok(()) };
    let mut reader = RecordReader::open(first)?;
    let header = reader.header().clone();
    let mut found = reader.detector_found().map_err(cannot_read(first))?;
    for path in others {
        check_same(&header, first, path)?;
    }
    let mut output = Output::create(out, &header)?;
    let mut last_us = append(&mut reader, first, 0, &mut output)?;
    for path in others {
        let mut reader = RecordReader::open(path)?;
        found = reader.detector_found().map_err(cannot_read(path))?.or(found);
        let begin_us = last_us + PAUSE_US;
        let Header { started_unix_s, notes, .. } = reader.header().clone();
        output.note(begin_us, &Note::Joined { started_unix_s, notes })?;
        last_us = append(&mut reader, path, begin_us, &mut output)?;
    }
    if let Some(found) = found {
        output.note(last_us, &found)?;
    }
    output.finish()
}

fn check_same(header: &Header, first: &Path, path: &Path) -> Result<(), EditError> {
    let other = RecordReader::open(path)?.header().clone();
    let is_same = match other.detector(path)? {
        Some(detector) => header.is_of(&detector),
        None => header.detector == other.detector,
    };
    if is_same {
        return Ok(());
    }
    Err(EditError::OtherDetector { path: path.to_owned(), first: first.to_owned() })
}

/// Copies all of a recording, its times from `begin_us` on; returns its last time (us).
fn append(reader: &mut RecordReader<File>, path: &Path, begin_us: u64, output: &mut Output) -> Result<u64, EditError> {
    let (mut bytes, mut last_us) = (Vec::new(), begin_us);
    while let Some(entry) = reader.next_entry(&mut bytes).map_err(cannot_read(path))? {
        last_us = begin_us + entry.time_us;
        match entry.note {
            None => output.write(last_us, &bytes)?,
            Some(Note::Detector { .. }) => {}
            Some(note) => output.note(last_us, &note)?,
        }
    }
    Ok(last_us)
}

#[cfg(test)]
#[path = "edit_tests.rs"]
mod tests;
