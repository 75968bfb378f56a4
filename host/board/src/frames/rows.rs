//! Frames in the rows of a table.

use std::fmt;

use tactomo_protocol::{BoardMessage, BoardReceiver, EncodeError, Hello, MAX_WIRE, encode_board};

use super::FileFrame;
use crate::measured::Volts;
use tactomo_physics::readings::Readings;
use tactomo_table::{Array, Table};

/// Name of the array, in an NPZ file of a recording's frames, with the message by which the board said who it is, byte by byte: its drive, its
/// converters and their floors.
pub const BOARD: &str = "board_hello";
/// Name of the array with the frames' times (s).
const TIMES: &str = "time_s";

/// Rows of a table.
pub struct Rows {
    rows: std::vec::IntoIter<f64>,
    pub(super) channels: usize,
    /// Frames that were read, those that are left out included.
    read: usize,
    pub(super) left_out: LeftOut,
    /// The board that they are of, if the file says, and what its readings mean.
    pub(super) board: Option<Box<(Hello, Volts)>>,
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

impl Rows {
    /// Frames of a table, of which a last row was `wrong`; what is wrong with it if they are none.
    pub(super) fn read(
        mut table: Table,
        wrong: Option<String>,
        expected: Option<usize>,
        readings: impl FnOnce(Table) -> Result<Array, String>,
    ) -> Result<Self, String> {
        let [board, times] = [BOARD, TIMES].map(|name| table.take(name));
        let board = board.map(|bytes| said(&bytes.values)).transpose()?;
        let rows = Self {
            left_out: LeftOut { count: 0, first: wrong },
            board: board.map(|board| Box::new((board.clone(), Volts::of(&board)))),
            times_s: times.map(|times| times.values).unwrap_or_default(),
            ..Self::of(readings(table)?, expected)?
        };
        rows.check()?;
        Ok(rows)
    }

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
    pub(super) fn next_frame(&mut self) -> Option<FileFrame> {
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
