//! Frames of readings in files: recordings of this program, and tables of any other.

mod loss;
mod recorded;
mod rows;
mod survey;

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use tactomo_protocol::{Contacts, Hello};

pub use self::loss::RecordingLoss;
pub use self::recorded::Recorded;
pub use self::rows::{BOARD, LeftOut, Rows, hello_bytes, likely};
pub use self::survey::Survey;
use crate::baseline::BaselineTracker;
use crate::clock::Delay;
use crate::record::{self, OtherProtocol, RecordError};
use tactomo_physics::readings::{Readings, Says};
use tactomo_table::{Array, Table, TableError, file};

/// Names that an array of readings may have in an NPZ file.
const READINGS: [&str; 3] = ["readings_v", "readings", "volts"];
/// Frames of a file, one after the other.
pub enum FrameFile {
    /// A recording, and the board that it was taken from.
    Recording(Box<Recorded>),
    /// Rows of a table: CSV, NPY or NPZ.
    Table(Rows),
}

/// One frame.
#[derive(Clone, Debug, PartialEq)]
pub struct FileFrame {
    /// Board time since the first frame (s), if that is known.
    pub time_s: Option<f64>,
    /// When its last byte came (s since the recording's start), if the file tells.
    pub arrived_s: Option<f64>,
    /// How long before that it was scanned, if that is known.
    pub delay: Option<Delay>,
    /// The board's number of the scan, if the file tells.
    pub sequence: Option<u64>,
    /// Scans that are missing since the frame before: lost on the way, or damaged in the file.
    pub lost_before: u64,
    /// Readings (V) in the order of the channels, as they are [used](crate::measured::Volts::used); of a detector row by row.
    pub volts: Vec<f64>,
    /// Readings as measured (V), in the order of the channels.
    pub measured_v: Vec<f64>,
    /// What each says; empty where all are voltages.
    pub says: Vec<Says>,
    /// What the board has found in it by itself, if it did.
    pub found: Option<Box<FoundByBoard>>,
}

/// What a board has found in a frame by itself.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundByBoard {
    /// Its contacts.
    pub contacts: Contacts,
    /// Electrodes whose wires it has said to be broken, by then: a bit each.
    pub broken_wires: u32,
}

impl FileFrame {
    /// As the readings of a detector; `None` if they are no square.
    pub fn readings(&self) -> Option<Readings> {
        let n = self.volts.len().isqrt();
        let readings = Readings::new(n, self.volts.clone())?;
        Some(if self.says.is_empty() { readings } else { readings.saying(|g, e| self.says[g * n + e]) })
    }

    /// What the board has found, of a frame whose readings it has not sent.
    pub fn found_alone(&self) -> Option<&FoundByBoard> {
        self.found.as_deref().filter(|_| self.says.iter().all(|says| *says == Says::Nothing) && !self.says.is_empty())
    }

    /// As the readings of a detector as measured; `None` if they are no square.
    pub fn measured(&self) -> Option<Readings> {
        let n = self.measured_v.len().isqrt();
        let readings = Readings::new(n, self.measured_v.clone())?;
        Some(readings.hiding(|g, e| self.says.get(g * n + e) == Some(&Says::Nothing)))
    }

    /// The readings of a frame of which some were not read, rows of a scan; `None` of a whole frame.
    pub fn rows(&self) -> Option<Readings> {
        self.says.contains(&Says::Nothing).then(|| self.readings()).flatten()
    }

    /// Takes it into account for the baseline.
    pub fn note_rest(&self, baseline: &mut BaselineTracker) {
        let time_s = self.time_s.unwrap_or_default();
        match self.rows() {
            Some(rows) => _ = baseline.add_rows(&rows, time_s, &[]),
            None => _ = baseline.add(&self.touches_v(), 1, time_s, &[]),
        }
    }

    /// Takes the baseline off its readings.
    pub fn subtract(&mut self, baseline: &BaselineTracker) {
        let volts = self.volts.clone();
        baseline.subtract(&volts, &mut self.volts);
    }

    /// Readings as [`Readings::touch_v`] has them (V).
    pub fn touches_v(&self) -> Cow<'_, [f64]> {
        match self.readings() {
            Some(readings) if !self.says.is_empty() => Cow::Owned(readings.touches_v().into_owned()),
            _ => Cow::Borrowed(&self.volts),
        }
    }
}

/// Why a file gives no frames.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FramesError {
    /// As a recording.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// As a table.
    #[error(transparent)]
    Table(#[from] TableError),
    /// Its arrays are not readings.
    #[error("{path}: {what}")]
    Shape {
        /// The file.
        path: PathBuf,
        /// What is there and what is needed.
        what: String,
    },
    /// A recording that cannot be read on.
    #[error("cannot read on in {path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A recording in another version of the protocol.
    #[error("{path}: {other}")]
    Protocol {
        /// The file.
        path: PathBuf,
        /// Which version.
        other: OtherProtocol,
    },
    /// A recording that does not say what its readings mean.
    #[error(
        "{path}: no board says Hello in this recording, so it is not known what its frames mean; record it from the board's start"
    )]
    NoHello {
        /// The file.
        path: PathBuf,
    },
}

impl FrameFile {
    /// Opens a file: a recording, CSV, NPY or NPZ, by what is in it.
    ///
    /// A table has a frame a row, of as many numbers as there are channels (V), or a square a frame. One square alone is a frame
    /// if it has as many numbers as are `expected`.
    ///
    /// # Errors
    /// [`FramesError`], which says what is wrong with the file.
    pub fn open(path: &Path, expected: Option<usize>) -> Result<Self, FramesError> {
        Self::open_by(path, expected, |table| table.array(&READINGS))
    }

    /// Opens a file of frames, with another rule which readings of a table are meant.
    ///
    /// # Errors
    /// [`FramesError`], which says what is wrong with the file; also as `readings` does.
    pub fn open_by(
        path: &Path,
        expected: Option<usize>,
        readings: impl FnOnce(Table) -> Result<Array, String>,
    ) -> Result<Self, FramesError> {
        // Which of the two it is has to be read before it is read.
        file::check_regular(path).map_err(|source| TableError::Read { path: path.to_owned(), source })?;
        if is_recording(path) {
            return Ok(Self::Recording(Box::new(Recorded::open(path)?)));
        }
        let (table, wrong) = Table::read_log(path)?;
        let rows = Rows::read(table, wrong, expected, readings);
        Ok(Self::Table(rows.map_err(|what| FramesError::Shape { path: path.to_owned(), what })?))
    }

    /// Rows of a table that were left out so far.
    pub fn left_out(&self) -> Option<&LeftOut> {
        match self {
            Self::Recording(_) => None,
            Self::Table(rows) => Some(&rows.left_out).filter(|left_out| left_out.count > 0),
        }
    }

    /// The board that the frames were taken from: that of a recording, or of a table that says so.
    pub fn board(&self) -> Option<&Hello> {
        match self {
            Self::Recording(recorded) => Some(recorded.board()),
            Self::Table(rows) => rows.board.as_ref().map(|board| &board.0),
        }
    }

    /// What is damaged or missing in a recording, as far as it was read; nothing is known of a table.
    pub fn loss(&self) -> Option<RecordingLoss> {
        match self {
            Self::Recording(recorded) => Some(recorded.loss()),
            Self::Table(_) => None,
        }
    }

    /// What a recording says about itself.
    pub fn header(&self) -> Option<&record::Header> {
        match self {
            Self::Recording(recorded) => Some(recorded.header()),
            Self::Table(_) => None,
        }
    }

    /// Tells readings of a recording above a ground that is lifted by so much (V). Those of a table are that already.
    pub fn set_ground(&mut self, ground_v: f64) {
        match self {
            Self::Recording(recorded) => recorded.set_ground(ground_v),
            Self::Table(rows) => {
                rows.board.iter_mut().for_each(|board| board.1 = board.1.clone().above(ground_v));
            }
        }
    }

    /// Hands out frames too whose readings a board has not sent, with [what it has found](FileFrame::found_alone) in them: of these no reading says anything.
    pub fn keep_found(&mut self) {
        if let Self::Recording(recorded) = self {
            recorded.keep_found();
        }
    }

    /// Numbers in each frame.
    pub fn channels(&self) -> usize {
        match self {
            Self::Recording(recorded) => usize::from(recorded.board().electrodes).pow(2),
            Self::Table(rows) => rows.channels,
        }
    }

    /// The next frame, or `None` at the end.
    ///
    /// # Errors
    /// [`FramesError`] if the file cannot be read on.
    pub fn next_frame(&mut self) -> Result<Option<FileFrame>, FramesError> {
        match self {
            Self::Recording(recorded) => recorded.next_frame(),
            Self::Table(rows) => Ok(rows.next_frame()),
        }
    }
}

fn is_recording(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(record::START_BYTES as u64).read_to_end(&mut start));
    read.is_ok() && record::is_recording(&start)
}
