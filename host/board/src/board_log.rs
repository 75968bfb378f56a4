//! The board's own log: defmt frames, whose texts are in the firmware's ELF file. Only a program with the feature `log` can print it.

use std::path::{Path, PathBuf};
use std::sync::mpsc::SyncSender;

#[cfg(feature = "log")]
mod printer;

/// Why a firmware file does not serve to read its log.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ElfError {
    /// It cannot be read.
    #[error("cannot read the firmware file {path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// It is no ELF file, or its log is in another version of defmt.
    #[error("{path} is not the ELF file of a firmware whose log can be read: {reason}")]
    Table {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// This program was built without what decodes logs.
    #[error(
        "this program was built without the log of boards: build it with `cargo build --release --features log` to use `--elf`"
    )]
    NotBuilt,
}

/// Prints the board's log, or says once that there is one.
#[derive(Debug)]
pub struct BoardLog {
    printer: Option<SyncSender<Vec<u8>>>,
    hinted: bool,
}

impl BoardLog {
    /// A log whose texts are not known.
    pub fn unread() -> Self {
        Self { printer: None, hinted: false }
    }

    /// A log whose texts are in the firmware file `elf`.
    ///
    /// # Errors
    /// [`ElfError`] if that is not a firmware file with defmt texts, or this program cannot print them.
    pub fn from_elf(elf: &Path) -> Result<Self, ElfError> {
        Ok(Self { printer: Some(start(elf)?), hinted: false })
    }

    /// Takes bytes of the board's defmt stream.
    pub fn take(&mut self, bytes: &[u8]) {
        if let Some(printer) = &self.printer {
            if printer.try_send(bytes.to_vec()).is_err() {
                tracing::debug!("{} bytes of the board's log were lost", bytes.len());
            }
        } else if !self.hinted {
            self.hinted = true;
            let how = if cfg!(feature = "log") { "" } else { ", in a program built with `--features log`," };
            tracing::info!("the board sends a log; give the file of its firmware with `--elf`{how} to read it");
        }
    }
}

#[cfg(feature = "log")]
use self::printer::start;

#[cfg(not(feature = "log"))]
fn start(_elf: &Path) -> Result<SyncSender<Vec<u8>>, ElfError> {
    Err(ElfError::NotBuilt)
}
