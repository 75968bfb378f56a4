//! Decodes defmt frames and prints them.

use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use defmt_decoder::{DecodeError, Frame, Table};
use tactomo_table::file::Format;

use super::ElfError;

/// Packets that may wait to be printed; more are lost, so that printing never holds up frames.
const QUEUE: usize = 256;

/// An ELF file of the firmware: ours are 2 MB.
const FORMAT: Format = Format::new("an ELF file of a board", 256 << 20);

/// Starts to print what is sent, with the texts of the firmware file `elf`.
pub(super) fn start(elf: &Path) -> Result<SyncSender<Vec<u8>>, ElfError> {
    let path = || elf.to_owned();
    let bytes = FORMAT.read(elf).map_err(|source| ElfError::Read { path: path(), source })?;
    let table = Table::parse(&bytes).map_err(|error| ElfError::Table { path: path(), reason: error.to_string() })?;
    let table = table.ok_or_else(|| ElfError::Table { path: path(), reason: "it has no section .defmt".to_owned() })?;
    let (printer, packets) = sync_channel(QUEUE);
    // A thread of its own: a slow terminal, or a packet that the decoder cannot take, must not harm the frames.
    thread::spawn(move || print(&table, &packets));
    Ok(printer)
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
    use crate::board_log::BoardLog;

    #[test]
    fn files_that_are_no_firmware_are_refused_by_name() {
        let missing = BoardLog::from_elf(Path::new("no/such.elf")).unwrap_err();
        assert!(matches!(&missing, ElfError::Read { .. }) && missing.to_string().contains("no/such.elf"));
        let text = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
        assert!(matches!(BoardLog::from_elf(&text), Err(ElfError::Table { .. })));
    }
}
