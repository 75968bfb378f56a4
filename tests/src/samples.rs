//! What tests of several commands write: folders, tables and recordings.

use std::path::PathBuf;

use tactomo_board::record::{Header, RecordWriter};
use tactomo_physics::detector::Detector;
use tactomo_protocol::{BoardMessage, FrameHead, Hello, MAX_WIRE, encode_board, encode_frame};

/// A folder that goes when the test ends.
pub struct Folder(PathBuf);

impl Folder {
    /// A new one.
    pub fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("tactomo-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    /// The path of a file in it.
    pub fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    /// A file in it with such contents; its path.
    pub fn with(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        std::fs::write(self.0.join(name), bytes).unwrap();
        self.path(name)
    }

    /// Names of all files in it.
    pub fn names(&self) -> Vec<String> {
        let files = std::fs::read_dir(&self.0).unwrap().map(|file| file.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<_> = files.collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _gone = std::fs::remove_dir_all(&self.0);
    }
}

/// Rows of numbers as text.
pub fn csv(rows: &[Vec<f64>]) -> String {
    let line = |row: &Vec<f64>| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// A recording of 100 frames a second, whose readings (V) are those of each time (s).
pub fn recording(path: &str, detector: &Detector, seconds: f64, mut row: impl FnMut(f64) -> Vec<f64>) {
    let header = Header::of(detector, "a test".to_owned(), 0);
    let mut writer = RecordWriter::new(std::fs::File::create(path).unwrap(), &header).unwrap();
    let mut wire = [0; MAX_WIRE];
    let hello = Hello { adc_bits: 12, adc_full_scale_mv: 3300, drive_mv: 2000, ..Hello::example(16) };
    let length = encode_board(&BoardMessage::Hello(hello), &mut wire).unwrap();
    writer.write(0, &wire[..length]).unwrap();
    for sequence in 0..(100.0 * seconds) as u16 {
        let lsb_v = detector.adc.lsb_v();
        let codes: Vec<u16> =
            row(0.01 * f64::from(sequence)).iter().map(|volts| (volts / lsb_v).round() as u16).collect();
        let head = FrameHead { sequence, time_us: 10_000 * u32::from(sequence), ..FrameHead::default() };
        let length = encode_frame(head, &codes, &mut wire).unwrap();
        writer.write(10_000 * u64::from(sequence), &wire[..length]).unwrap();
    }
    writer.flush().unwrap();
}
