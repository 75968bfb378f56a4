//! Recordings: the bytes of a board, with the times at which they came.
//!
//! What is not understood is kept too, as it came. Only coded frames are written as [plain ones](PlainPackets), which need no other to be read.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | magic: `89 T C T O 0D 0A 1A` (not text, and broken by any program that takes it for text) |
//! | 1 | version of the format: 2 |
//! | n | [header](Header): a chunk of the kind `H` at time 0, whose bytes are JSON in UTF-8 (at most 16 MiB) |
//! | n | the same once more: one of them survives any single damage |
//! | ... | chunks of the kind `D` (bytes of the board) and `N` ([notes](Note), as JSON), to the end of the file; their times never fall |
//!
//! A chunk: `A5 54 63` and its kind, `H`, `D` or `N`; time since the start of the recording in microseconds and number of bytes (at most
//! 65536 in a `D`), both as LEB128; the bytes; CRC-32 (as in zlib) of the version and all of these, little-endian.
//!
//! A file that was cut off loses the chunk that was cut, no more. A damaged chunk costs itself alone: the reader goes on at the next
//! one whose CRC is right, and [counts](Loss) what is damaged and what it left out. Where only bytes within a chunk are damaged, they are handed
//! out all the same: packets of the protocol have checksums of their own, and those beside the damage are whole. Up to 64 KiB before the
//! magic that are none of the recording are passed over.

pub mod edit;
mod format;
mod header;
mod loss;
mod note;
mod packets;
mod plain;
mod reader;
mod recorder;
mod ring;
mod scan;
mod start;
#[cfg(test)]
mod tests;
mod window;
mod writer;

pub use header::Header;
pub use loss::{HeaderDamage, Loss};
pub use note::Note;
pub use plain::PlainPackets;
pub use reader::{Entry, RecordReader};
pub use recorder::{Closing, Recorder};
pub use ring::{Ring, Trigger};
pub use writer::RecordWriter;

use std::io;
use std::path::PathBuf;

use tactomo_physics::detector::TomlError;
use tactomo_physics::new_file::NewFileError;

/// What a recording begins with.
pub const MAGIC: [u8; 8] = *b"\x89TCTO\r\n\x1a";
/// Version of the format.
const VERSION: u8 = 2;

/// Why a recording cannot be read or kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The file cannot be opened.
    #[error("cannot open the recording {path}")]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A folder, perhaps of recordings.
    #[error(
        "{path} is a folder, not a recording: name one of the recordings in it. `tactomo live --body {path}` shows all of them together, \
         `tactomo recording check {path}` tells how they are"
    )]
    Folder {
        /// The folder.
        path: PathBuf,
    },
    /// A new recording cannot be made.
    #[error(transparent)]
    New(#[from] NewFileError),
    /// The file does not begin as a recording does.
    #[error("{path} is not a recording of tactomo, or too damaged to be read as one")]
    NotARecording {
        /// The file.
        path: PathBuf,
    },
    /// Another version of the format.
    #[error(
        "{path} is a recording in version {found} of the format, and this program reads version {VERSION}: use the program that \
         recorded it"
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u8,
    },
    /// The detector in the header cannot be built.
    #[error("{path}: the detector in the recording's header is wrong; choose the detector with `--detector`")]
    Detector {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: TomlError,
    },
    /// The recording can no longer be written.
    #[error("cannot go on recording to {path}; what came before is kept")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The disk is full, or a quota is used up.
    #[error(
        "recording to {path} has stopped: the disk is full. What came before is kept in it; make room on the disk, or record to another one"
    )]
    Full {
        /// The file.
        path: PathBuf,
    },
    /// The disk takes bytes more slowly than the board sends them.
    #[error(
        "recording to {path} has stopped: the disk is too slow, and {waiting_mb} MB wait to be written; the first {seconds:.1} s \
         are kept. Record to a faster disk"
    )]
    TooSlow {
        /// The file.
        path: PathBuf,
        /// How much waited (MB).
        waiting_mb: usize,
        /// How long the recording is (s).
        seconds: f64,
    },
}

/// A recording of a board that spoke another version of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "its board spoke version {found} of the protocol, and this program reads version {version}: use the program that recorded it",
    version = tactomo_protocol::VERSION
)]
pub struct OtherProtocol {
    /// The version that it spoke.
    pub found: u8,
}

/// Bytes of a file that tell whether it is a recording.
pub const START_BYTES: usize = start::MOST_JUNK + MAGIC.len();

/// Whether a file whose first [`START_BYTES`] are `start` may be a recording: one damaged byte does not make another file of it, nor
/// does what was put before it.
pub fn is_recording(start: &[u8]) -> bool {
    start::find_magic(start).is_some()
}
