//! Numbers in files of others: CSV, NPY and NPZ, recognised by what is in them. None of it is trusted.
//!
//! [`mod@file`] bounds what is read of any file that is read whole.

mod archive;
mod channels;
mod csv;
pub mod file;
mod kinds;
mod npy;
mod npz;

use std::io;
use std::path::{Path, PathBuf};

pub use self::archive::Archive;
pub use self::channels::{Channels, channels};
pub use self::csv::CsvWriter;
use self::file::Format;
pub use self::npy::Values;
pub use self::npz::NpzWriter;

/// Longest table that is read, in its file and unpacked (bytes).
const LONGEST: u64 = 1 << 28;
/// Tables are read whole.
const FORMAT: Format = Format::new("a table", LONGEST);

/// Numbers of some shape, the last axis running fastest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Array {
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// As many as the product of the lengths.
    pub values: Vec<f64>,
}

/// What a file holds.
///
/// ```
/// use tactomo_table::Table;
///
/// let table = Table::parse(b"x_m,y_m\n0.01,0.02\n0.03,0.04\n")?;
/// assert!(matches!(table, Table::Columns { names, .. } if names == ["x_m", "y_m"]));
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Table {
    /// Columns of text, with names if its first line has them.
    Columns {
        /// A name for each column, or none at all.
        names: Vec<String>,
        /// A row a line.
        rows: Array,
    },
    /// Arrays with names, in the order of the file; a lone array has the name `array`.
    Arrays(Vec<(String, Array)>),
}

/// Why a file is no table.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// It cannot be opened or read.
    #[error("cannot read {path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// It is not what it seems.
    #[error("{path}: {what}")]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong, where, and what is needed.
        what: String,
    },
}

impl Table {
    /// Reads a file.
    ///
    /// # Errors
    /// [`TableError`], which says where the file is wrong.
    pub fn read(path: &Path) -> Result<Self, TableError> {
        Self::parse(&bytes_of(path)?).map_err(|what| TableError::Format { path: path.to_owned(), what })
    }

    /// Reads a file of which some rows may be wrong, but fewer than are right, as those of a log are: see [`parse_log`](Self::parse_log).
    ///
    /// # Errors
    /// [`TableError`], which says where the file is wrong.
    pub fn read_log(path: &Path) -> Result<(Self, Option<String>), TableError> {
        Self::parse_log(&bytes_of(path)?).map_err(|what| TableError::Format { path: path.to_owned(), what })
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// What is wrong and where.
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        match Self::parse_log(bytes)? {
            (_, Some(wrong)) => Err(wrong),
            (table, None) => Ok(table),
        }
    }

    /// Reads the bytes of a file of which some rows may be wrong, but fewer than are right: those are not numbers throughout, and what is wrong with
    /// the first of them is told.
    ///
    /// # Errors
    /// What is wrong and where.
    pub fn parse_log(bytes: &[u8]) -> Result<(Self, Option<String>), String> {
        if npz::is_npz(bytes) {
            return Ok((Self::Arrays(npz::parse(bytes)?), None));
        }
        if npy::is_npy(bytes) {
            return Ok((Self::Arrays(vec![("array".to_owned(), npy::parse(bytes)?)]), None));
        }
        let csv::Text { names, rows, wrong } = csv::parse(&kinds::text_of(bytes)?)?;
        Ok((Self::Columns { names, rows }, wrong))
    }

    /// Takes an array out, by its name.
    pub fn take(&mut self, wanted: &str) -> Option<Array> {
        let Self::Arrays(arrays) = self else { return None };
        let index = arrays.iter().position(|(name, _)| name == wanted)?;
        Some(arrays.remove(index).1)
    }

    /// The array of a name, or the lone one; of columns with names those that are [channels].
    ///
    /// # Errors
    /// The names that there are.
    pub fn array(self, wanted: &[&str]) -> Result<Array, String> {
        let mut arrays = match self {
            Self::Columns { names, rows } => {
                let channels = channels(&names).which;
                return Ok(if names.is_empty() { rows } else { rows.of_columns(&channels) });
            }
            Self::Arrays(arrays) => arrays,
        };
        if let Some(index) = arrays.iter().position(|(name, _)| wanted.contains(&name.as_str())) {
            return Ok(arrays.swap_remove(index).1);
        }
        match &mut arrays[..] {
            [(_, lone)] => Ok(std::mem::take(lone)),
            _ => Err(format!(
                "no array is called {}; there are {}",
                wanted.join(" or "),
                names(arrays.iter().map(|(name, _)| name))
            )),
        }
    }
}

/// All bytes of a file that is not too long.
fn bytes_of(path: &Path) -> Result<Vec<u8>, TableError> {
    FORMAT.read(path).map_err(|source| TableError::Read { path: path.to_owned(), source })
}

/// Names of arrays, for messages.
fn names<'a>(names: impl Iterator<Item = &'a String>) -> String {
    let names: Vec<_> = names.map(|name| name.escape_debug().to_string()).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

impl Array {
    /// Numbers in a row.
    pub fn flat(values: Vec<f64>) -> Self {
        Self { shape: vec![values.len()], values }
    }

    /// Length of the first axis; 1 for a number.
    pub fn rows(&self) -> usize {
        self.shape.first().copied().unwrap_or(1)
    }

    /// Numbers in each row.
    pub fn columns(&self) -> usize {
        self.shape.iter().skip(1).product()
    }

    /// Some of the columns, in this order.
    ///
    /// # Panics
    /// If there is no such column.
    pub fn of_columns(&self, columns: &[usize]) -> Self {
        let rows = self.values.chunks_exact(self.columns().max(1));
        let values = rows.flat_map(|row| columns.iter().map(|&column| row[column])).collect();
        Self { shape: vec![self.rows(), columns.len()], values }
    }

    /// Shape for messages: `3 x 256`.
    pub fn shape_text(&self) -> String {
        self.shape.iter().map(usize::to_string).collect::<Vec<_>>().join(" x ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn arrays_are_found_by_name_or_alone() {
        let [one, two] = [1.0, 2.0].map(|value| Array::flat(vec![value]));
        let both = || Table::Arrays(vec![("x".into(), one.clone()), ("readings_v".into(), two.clone())]);
        assert_eq!(both().array(&["readings_v"]), Ok(two.clone()));
        assert_eq!(both().array(&["y"]).unwrap_err(), "no array is called y; there are x, readings_v");
        assert_eq!(Table::Arrays(vec![("x".into(), one.clone())]).array(&["y"]), Ok(one));
        assert!(Table::Arrays(Vec::new()).array(&["y"]).is_err());
    }

    #[test]
    fn a_missing_file_and_other_bytes_are_refused() {
        let missing = Table::read(Path::new("no/such.csv")).unwrap_err();
        assert_eq!(missing.to_string(), "cannot read no/such.csv");
        assert!(Table::parse(&[0xff, 0x00, 0x07]).unwrap_err().contains("neither text nor NPY"));
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_without_panic(
            start in prop::sample::select(vec![&b""[..], b"PK\x03\x04", b"\x93NUMPY\x01\x00", b"1,2\n"]),
            tail in prop::collection::vec(any::<u8>(), 0..400),
        ) {
            let bytes = [start, &tail].concat();
            if let Ok(Table::Columns { rows, .. }) = Table::parse(&bytes) {
                prop_assert_eq!(rows.values.len(), rows.shape.iter().product::<usize>());
            }
        }

        #[test]
        fn damaged_files_are_read_without_panic(at in any::<prop::sample::Index>(), bit in 0..8u32, cut in any::<prop::sample::Index>()) {
            let mut bytes = Vec::new();
            let mut writer = NpzWriter::new(io::Cursor::new(&mut bytes));
            writer.add("readings_v", &[2, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
            writer.finish().unwrap();
            let npy = npy::bytes(&[2, 3], npy::Values::Numbers(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
            for mut bytes in [bytes, npy] {
                let index = at.index(bytes.len());
                bytes[index] ^= 1 << bit;
                for part in [&bytes[..], &bytes[..cut.index(bytes.len())]] {
                    if let Ok(Table::Arrays(arrays)) = Table::parse(part) {
                        prop_assert!(arrays.iter().all(|(_, array)| array.values.len() == array.shape.iter().product::<usize>()));
                    }
                }
            }
        }
    }
}
