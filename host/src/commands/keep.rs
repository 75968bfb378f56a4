//! What `live` and `record` keep, and the board's log.

use std::path::Path;

use tactomo::board::board_log::{BoardLog, ElfError};
use tactomo::board::record::{Header, RecordError, Recorder};
use tactomo::detector::Detector;
use tactomo::run::options::BeginRecording;

/// Begins a recording in a new file, if one is wanted.
pub fn begin(file: Option<&Path>, header: &Header) -> Result<Option<Recorder>, RecordError> {
    file.map(|file| Recorder::create(file, header)).transpose()
}

/// Begins recordings in new files of the working directory, named by the time, as often as a page asks for one. They carry the detector as
/// a calibration has found it, if one has. `patch` is the name that the detector has among several, so that none takes another's file.
pub fn on_request(detector: Detector, source: String, patch: &str) -> BeginRecording {
    let of = if patch.is_empty() { String::new() } else { format!("{patch}-") };
    Box::new(move |hello, calibrated| {
        let header = Header::now(calibrated.unwrap_or(&detector), source.clone());
        let name = format!("touch-{of}{}.tactomo", header.started_unix_s);
        Recorder::create_with_hello(Path::new(&name), &header, hello)
    })
}

/// Where the board's log goes: printed with the texts of the firmware file `elf`, or only noticed.
pub fn board_log(elf: Option<&Path>) -> Result<BoardLog, ElfError> {
    elf.map_or_else(|| Ok(BoardLog::unread()), BoardLog::from_elf)
}
