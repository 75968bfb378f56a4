//! The board's own log: defmt frames, whose texts are in the firmware's ELF file.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use defmt_decoder::{DecodeError, Frame, Table};

/// Packets that may wait to be printed; more are lost, so that printing never holds up frames.
const QUEUE: usize = 256;

/// Why a firmware file does not serve to read its log.
#[derive(Debug, thiserror::Error)]
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
}

/// Prints the board's log, or counts it where its texts are not known.
#[derive(Debug)]
pub struct BoardLog {
    printer: Option<SyncSender<Vec<u8>>>,
    hinted: bool,
}

impl BoardLog {
    /// A log that is counted only.
    pub fn unread() -> Self {
        Self { printer: None, hinted: false }
    }

    /// A log whose texts are in the firmware file `elf`.
    ///
    /// # Errors
    /// [`ElfError`] if that is not a firmware file with defmt texts.
    pub fn from_elf(elf: &Path) -> Result<Self, ElfError> {
        let path = || elf.to_owned();
        let bytes = std::fs::read(elf).map_err(|source| ElfError::Read { path: path(), source })?;
        let table =
            Table::parse(&bytes).map_err(|error| ElfError::Table { path: path(), reason: error.to_string() })?;
        let table =
            table.ok_or_else(|| ElfError::Table { path: path(), reason: "it has no section .defmt".to_owned() })?;
        let (printer, packets) = sync_channel(QUEUE);
        // A thread of its own: a slow terminal, or a packet that the decoder cannot take, must not harm the frames.
        thread::spawn(move || print(&table, &packets));
        Ok(Self { printer: Some(printer), hinted: false })
    }

    /// Takes bytes of the board's defmt stream.
    pub fn take(&mut self, bytes: &[u8]) {
        if let Some(printer) = &self.printer {
            if printer.try_send(bytes.to_vec()).is_err() {
                tracing::debug!("{} bytes of the board's log were lost", bytes.len());
            }
        } else if !self.hinted {
            self.hinted = true;
            tracing::info!("the board sends a log; give the file of its firmware with `--elf` to read it");
        }
    }
}

fn print(table: &Table, packets: &Receiver<Vec<u8>>) {
    let mut decoder = table.new_stream_decoder();
    while let Ok(bytes) = packets.recv() {
        decoder.received(&bytes);
        loop {
            match decoder.decode() {
                Ok(frame) => tell(&frame),
                Err(DecodeError::UnexpectedEof) => break,
                Err(DecodeError::Malformed) if table.encoding().can_recover() => {}
                Err(DecodeError::Malformed) => {
                    decoder = table.new_stream_decoder();
                    break;
                }
            }
        }
    }
}

fn tell(frame: &Frame) {
    let message = frame.display_message();
    match frame.level().map(|level| level.as_str()) {
        Some("error") => tracing::error!("board: {message}"),
        Some("warn") => tracing::warn!("board: {message}"),
        Some("debug") => tracing::debug!("board: {message}"),
        Some("trace") => tracing::trace!("board: {message}"),
        _ => tracing::info!("board: {message}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_are_no_firmware_are_refused_by_name() {
        let missing = BoardLog::from_elf(Path::new("no/such.elf")).unwrap_err();
        assert!(matches!(&missing, ElfError::Read { .. }) && missing.to_string().contains("no/such.elf"));
        let text = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
        assert!(matches!(BoardLog::from_elf(&text), Err(ElfError::Table { .. })));
    }
}
