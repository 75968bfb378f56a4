//! A table in a file, for a board.

use std::io;
use std::path::{Path, PathBuf};

use tactomo_table::file::Format;
use tactomo_touch_core::table::{MAX_KNOTS, MAX_SIDE, bytes_of};
use tactomo_touch_core::{MAX_ELECTRODES, Table, TableError};

/// The longest that there is.
const FORMAT: Format = Format::new("a table of a detector", bytes_of(MAX_ELECTRODES, [MAX_SIDE; 2], MAX_KNOTS) as u64);

/// The bytes of a table that is whole and sound.
#[derive(Clone, Debug)]
pub struct CompiledTable {
    bytes: Vec<u8>,
    /// Electrodes of its detector.
    pub electrodes: usize,
    /// Drive above the lifted ground (V).
    pub drive_v: f64,
}

/// Why a file is none.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableFileError {
    /// It cannot be read.
    #[error("cannot read the table {path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// It holds none that is whole and sound.
    #[error("{path} cannot be used")]
    Table {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: TableError,
    },
}

impl CompiledTable {
    /// Reads a file and checks all that a board will: version, counts, numbers and checksum.
    ///
    /// # Errors
    /// [`TableFileError`], which names the file.
    pub fn read(path: &Path) -> Result<Self, TableFileError> {
        let bytes = FORMAT.read(path).map_err(|source| TableFileError::Read { path: path.to_owned(), source })?;
        Self::of(bytes).map_err(|source| TableFileError::Table { path: path.to_owned(), source })
    }

    /// Checks the bytes of a table.
    ///
    /// # Errors
    /// [`TableError`], which says what is wrong with them.
    pub fn of(bytes: Vec<u8>) -> Result<Self, TableError> {
        let table = Table::read(&bytes)?;
        let (electrodes, drive_v) = (table.electrodes(), table.head().drive_v.into());
        Ok(Self { bytes, electrodes, drive_v })
    }

    /// The bytes, as they are sent.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}
