//! Frames of readings in files: recordings of this program, and tables of any other.

mod recorded;
mod survey;

use std::borrow::Cow;
use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use tactomo_protocol::{BoardMessage, BoardReceiver, Contacts, EncodeError, Hello, MAX_WIRE, encode_board};

pub use self::recorded::{Recorded, RecordingLoss};
pub use self::survey::Survey;
use crate::baseline::BaselineTracker;
use crate::clock::Delay;
use crate::measured::Volts;
use crate::record::{self, OtherProtocol, RecordError};
use tactomo_physics::readings::{Readings, Says};
use tactomo_table::{Array, Table, TableError, file};

/// Names that an array of readings may have in an NPZ file.
const READINGS: [&str; 3] = ["readings_v", "readings", "volts"];
/// Name of the array, in an NPZ file of a recording's frames, with the message by which the board said who it is, byte by byte: its drive, its
/// converters and their floors.
pub const BOARD: &str = "board_hello";
/// Name of the array with the frames' times (s).
const TIMES: &str = "time_s";

/// Frames of a file, one after the other.
pub enum FrameFile {
    /// A recording, and the board that it was taken from.
    Recording(Box<Recorded>),
    /// Rows of a table: CSV, NPY or NPZ.
    Table(Rows),
}

/// Rows of a table.
pub struct Rows {
    rows: std::vec::IntoIter<f64>,
    channels: usize,
    /// Frames that were read, those that are left out included.
    read: usize,
    left_out: LeftOut,
    /// The board that they are of, if the file says, and what its readings mean.
    board: Option<Box<(Hello, Volts)>>,
    /// Time of each (s), if the file says.
    times_s: Vec<f64>,
}

/// Rows of a table that were left out, because they are no numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// How many.
    pub count: u64,
    /// What is wrong with the first of them.
    pub first: Option<String>,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let rows = if self.count == 1 { "row is left out" } else { "rows are left out, first" };
        write!(f, "{} {rows}: {}", self.count, self.first.as_deref().unwrap_or("no numbers"))
    }
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
        let shape = |what| FramesError::Shape { path: path.to_owned(), what };
        let (mut table, wrong) = Table::read_log(path)?;
        let [board, times] = [BOARD, TIMES].map(|name| table.take(name));
        let board = board.map(|bytes| said(&bytes.values)).transpose().map_err(shape)?;
        let rows = readings(table).and_then(|array| Rows::of(array, expected)).map_err(shape)?;
        let rows = Rows {
            left_out: LeftOut { count: 0, first: wrong },
            board: board.map(|board| Box::new((board.clone(), Volts::of(&board)))),
            times_s: times.map(|times| times.values).unwrap_or_default(),
            ..rows
        };
        rows.check().map_err(shape)?;
        Ok(Self::Table(rows))
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

impl Rows {
    /// Frames from an array: `frames x channels`, `frames x n x n`, or one frame alone, `channels` or `n x n`.
    fn of(array: Array, expected: Option<usize>) -> Result<Self, String> {
        let channels = match array.shape[..] {
            [n, m] if n == m && Some(n * m) == expected => n * m,
            [_, _] | [_, _, _] => array.columns(),
            [channels] => channels,
            _ => 0,
        };
        let square = array.shape.len() != 3 || array.shape[1] == array.shape[2];
        if channels == 0 || array.values.is_empty() || !square {
            return Err(format!(
                "an array of {} is not frames: `frames x channels` or `frames x electrodes x electrodes` is needed",
                array.shape_text()
            ));
        }
        Ok(Self {
            rows: array.values.into_iter(),
            channels,
            read: 0,
            left_out: LeftOut::default(),
            board: None,
            times_s: Vec::new(),
        })
    }

    /// Why a frame is none (the reading that is no number), if it is none. Where the board is known, what is no number was not read.
    fn wrong(&self, volts: &[f64]) -> Option<usize> {
        let wrong = volts.iter().position(|volts| !volts.is_finite());
        wrong.filter(|_| self.board.is_none() || !volts.iter().any(|volts| volts.is_finite()))
    }

    /// Checks that more frames are right than wrong, and of the board that the file names.
    fn check(&self) -> Result<(), String> {
        let frames = || self.rows.as_slice().chunks_exact(self.channels);
        let wrong = frames().filter(|frame| self.wrong(frame).is_some()).count();
        if 2 * wrong >= frames().len() {
            let first = frames().enumerate().find_map(|(row, frame)| Some(place(row + 1, self.wrong(frame)?)));
            let first = self.left_out.first.clone().or(first).unwrap_or_default();
            return Err(format!("{wrong} of {} rows are no readings: {first}", frames().len()));
        }
        match &self.board {
            Some(board) if usize::from(board.0.electrodes).pow(2) != self.channels => Err(format!(
                "its board has {} electrodes, but its frames {} readings",
                board.0.electrodes, self.channels
            )),
            _ => Ok(()),
        }
    }

    /// The next frame of numbers alone.
    fn next_frame(&mut self) -> Option<FileFrame> {
        let mut lost_before = 0;
        loop {
            let volts: Vec<f64> = self.rows.by_ref().take(self.channels).collect();
            if volts.len() < self.channels {
                return None;
            }
            self.read += 1;
            if let Some(channel) = self.wrong(&volts) {
                self.left_out.first.get_or_insert_with(|| place(self.read, channel));
                (self.left_out.count, lost_before) = (self.left_out.count + 1, lost_before + 1);
                continue;
            }
            return Some(FileFrame { lost_before, ..self.frame(volts) });
        }
    }

    /// The frame that was read last.
    fn frame(&self, mut measured_v: Vec<f64>) -> FileFrame {
        let (mut volts, mut says) = (measured_v.clone(), Vec::new());
        if let Some(board) = &self.board {
            let n = measured_v.len().isqrt();
            let unread: Vec<bool> = measured_v.iter().map(|volts| !volts.is_finite()).collect();
            measured_v.iter_mut().filter(|volts| !volts.is_finite()).for_each(|volts| *volts = 0.0);
            if let Some(measured) = Readings::new(n, measured_v.clone()) {
                let used = board.1.used(measured.hiding(|g, e| unread[g * n + e]));
                (volts, says) = (used.volts().to_vec(), used.all_say().to_vec());
            }
        }
        FileFrame {
            time_s: self.times_s.get(self.read - 1).copied().filter(|time_s| time_s.is_finite()),
            delay: None,
            arrived_s: None,
            sequence: None,
            lost_before: 0,
            volts,
            measured_v,
            says,
            found: None,
        }
    }
}

/// What is wrong with a reading that is no number.
fn place(row: usize, channel: usize) -> String {
    format!("row {row}, column {} is not a finite number", channel + 1)
}

/// What a board says of itself, as the array [`BOARD`] has it: its message on the wire.
///
/// # Errors
/// If it is longer than a message is.
pub fn hello_bytes(hello: &Hello) -> Result<Vec<i64>, EncodeError> {
    let mut wire = [0; MAX_WIRE];
    let length = encode_board(&BoardMessage::Hello(hello.clone()), &mut wire)?;
    Ok(wire[..length].iter().map(|&byte| i64::from(byte)).collect())
}

/// What a board has said of itself.
fn said(bytes: &[f64]) -> Result<Hello, String> {
    let wire: Vec<u8> = bytes.iter().take(MAX_WIRE).map(|&byte| byte as u8).collect();
    match BoardReceiver::default().receive(&mut &wire[..]) {
        Some(Ok(BoardMessage::Hello(hello))) => Ok(hello),
        _ => Err(format!(
            "its array {BOARD} is not what a board says of itself: export the recording again, or leave the array out"
        )),
    }
}

/// What a table with so many columns most likely is, where frames of `electrodes` squared are needed.
pub fn likely(columns: usize, electrodes: usize) -> Option<String> {
    let n = electrodes;
    let all = n * n;
    Some(match columns {
        _ if columns == all - n => format!("{n} x {} are all but the grounded electrode's own readings: put a 0 there in each row of {n}", n - 1),
        _ if n > 3 && (columns == n * (n - 3) || columns == n * (n - 3) / 2) => format!(
            "{columns} are what EIT with adjacent drive measures ({n} x {}), not one grounded electrode at a time: `tactomo-lab learn` takes any channels",
            n - 3
        ),
        _ if columns == all / 2 - n / 2 || columns == all / 2 + n / 2 => {
            "this is one reading of each pair of electrodes, but the two differ: both are needed".to_owned()
        }
        _ if columns == 2 * all => {
            "these are two numbers a reading: real and imaginary parts, decimal commas that were taken for separators, or two frames a row".to_owned()
        }
        _ if columns == all + 1 => "one column is no reading, such as a number or a time: leave it out, or name the columns in the first line".to_owned(),
        _ if columns == n => format!("each row is of one grounded electrode: write the {n} rows of a frame one after the other in a row"),
        _ if columns > all && columns.is_multiple_of(all) => format!("these are {} frames a row: one is needed", columns / all),
        _ if columns > all && columns < all + n => {
            format!("{} columns are no readings: leave them out, or name the columns in the first line", columns - all)
        }
        _ if columns > 1 && columns.isqrt().pow(2) == columns => format!("these are of {} electrodes", columns.isqrt()),
        _ => return None,
    })
}

fn is_recording(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(record::START_BYTES as u64).read_to_end(&mut start));
    read.is_ok() && record::is_recording(&start)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(array: Array) -> Result<Vec<Vec<f64>>, String> {
        let mut rows = Rows::of(array, Some(16))?;
        Ok(std::iter::from_fn(|| rows.next_frame()).map(|frame| frame.volts).collect())
    }

    fn array(shape: &[usize]) -> Array {
        Array { shape: shape.to_vec(), values: (0..shape.iter().product()).map(|i: usize| i as f64).collect() }
    }

    #[test]
    fn rows_and_squares_are_frames() {
        assert_eq!(frames(array(&[2, 3])), Ok(vec![vec![0.0, 1.0, 2.0], vec![3.0, 4.0, 5.0]]));
        assert_eq!(frames(array(&[4])).map(|frames| frames.len()), Ok(1));
        assert_eq!(frames(array(&[4, 4])).map(|frames| frames.len()), Ok(1), "as many as are expected");
        assert_eq!(frames(array(&[3, 3])).map(|frames| frames.len()), Ok(3));
        assert_eq!(frames(array(&[3, 2, 2])).map(|frames| frames[2].clone()), Ok(vec![8.0, 9.0, 10.0, 11.0]));
    }

    #[test]
    fn rows_that_are_no_numbers_are_left_out_and_counted() {
        let values = [1.0, 2.0, f64::NAN, 4.0, 5.0, f64::INFINITY, 7.0, 8.0].to_vec();
        let mut rows = Rows::of(Array { shape: vec![4, 2], values }, None).unwrap();
        let frames: Vec<_> =
            std::iter::from_fn(|| rows.next_frame()).map(|frame| (frame.volts[0], frame.lost_before)).collect();
        assert_eq!(frames, [(1.0, 0), (7.0, 2)]);
        assert_eq!(rows.left_out.to_string(), "2 rows are left out, first: row 2, column 1 is not a finite number");
    }

    #[test]
    fn numbers_of_columns_are_told_apart() {
        for (columns, word) in [
            (240, "16 x 15"),
            (208, "EIT"),
            (104, "EIT"),
            (120, "pair"),
            (136, "pair"),
            (512, "imaginary"),
            (257, "one column"),
            (260, "4 columns"),
            (16, "one grounded"),
            (768, "3 frames"),
            (64, "8 electrodes"),
            (1024, "4 frames"),
        ] {
            assert!(
                likely(columns, 16).is_some_and(|what| what.contains(word)),
                "{columns}: {:?}",
                likely(columns, 16)
            );
        }
        assert_eq!(likely(250, 16), None);
    }

    #[test]
    fn other_shapes_are_refused() {
        for shape in [&[][..], &[0], &[2, 0], &[2, 2, 3], &[1, 1, 2, 2]] {
            assert!(frames(array(shape)).unwrap_err().contains("is not frames"), "{shape:?}");
        }
    }
}
