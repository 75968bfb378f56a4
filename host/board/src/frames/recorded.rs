//! Frames of a recording, as fast as they can be read.

use std::collections::VecDeque;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use tactomo_protocol::{BoardMessage, BoardReceiver, Frame, Hello};

use super::{FileFrame, FramesError};
use crate::record::{Header, Loss, RecordReader};
use crate::sequence::Sequence;

/// A recording.
pub struct Recorded {
    path: PathBuf,
    reader: RecordReader<BufReader<File>>,
    receiver: BoardReceiver,
    chunk: Vec<u8>,
    board: Hello,
    sequence: Sequence,
    /// Board time of the first frame (us).
    first_us: Option<u64>,
    frames: VecDeque<FileFrame>,
}

impl Recorded {
    /// Reads up to where the board says who it is.
    pub(super) fn open(path: &Path) -> Result<Self, FramesError> {
        let mut reader = RecordReader::open(path)?;
        let (mut receiver, mut chunk) = (BoardReceiver::default(), Vec::new());
        loop {
            if !read(&mut reader, &mut chunk, path)? {
                return Err(FramesError::NoHello { path: path.to_owned() });
            }
            let mut input = &chunk[..];
            while let Some(message) = receiver.receive(&mut input) {
                let Ok(BoardMessage::Hello(board)) = message else { continue };
                let rest = input.to_vec();
                let mut recorded = Self {
                    path: path.to_owned(),
                    reader,
                    receiver,
                    chunk: rest,
                    board,
                    sequence: Sequence::default(),
                    first_us: None,
                    frames: VecDeque::new(),
                };
                recorded.decode();
                return Ok(recorded);
            }
        }
    }

    /// What the recording says about itself.
    pub fn header(&self) -> &Header {
        self.reader.header()
    }

    /// The board, as it said who it is first.
    pub fn board(&self) -> &Hello {
        &self.board
    }

    /// What of the file could not be read so far.
    pub fn loss(&self) -> Loss {
        self.reader.loss()
    }

    pub(super) fn next_frame(&mut self) -> Result<Option<FileFrame>, FramesError> {
        loop {
            if let Some(frame) = self.frames.pop_front() {
                return Ok(Some(frame));
            }
            if !read(&mut self.reader, &mut self.chunk, &self.path)? {
                return Ok(None);
            }
            self.decode();
        }
    }

    /// Takes the frames out of a chunk. Those of another board than the first one say nothing of its detector.
    fn decode(&mut self) {
        let chunk = std::mem::take(&mut self.chunk);
        let mut input = &chunk[..];
        while let Some(message) = self.receiver.receive(&mut input) {
            if let Ok(BoardMessage::Frame(frame)) = message
                && frame.readings.len() == usize::from(self.board.electrodes).pow(2)
            {
                let frame = self.in_volts(&frame);
                self.frames.push_back(frame);
            }
        }
        self.chunk = chunk;
    }

    fn in_volts(&mut self, frame: &Frame) -> FileFrame {
        let place = self.sequence.place(&frame.head);
        let first_us = *self.first_us.get_or_insert(place.time_us);
        let bits = i32::from(self.board.adc_bits) + i32::from(frame.head.fraction_bits);
        let unit_v = f64::from(self.board.adc_full_scale_mv) * 1e-3 / 2f64.powi(bits);
        FileFrame {
            time_s: Some(place.time_us.saturating_sub(first_us) as f64 * 1e-6),
            sequence: Some(place.sequence),
            lost_before: place.dropped,
            volts: frame.readings.iter().map(|&units| f64::from(units) * unit_v).collect(),
        }
    }
}

/// The next chunk; `false` at the end.
fn read(reader: &mut RecordReader<BufReader<File>>, chunk: &mut Vec<u8>, path: &Path) -> Result<bool, FramesError> {
    let read = reader.next_into(chunk).map_err(|source| FramesError::Read { path: path.to_owned(), source })?;
    Ok(read.is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::FrameFile;
    use crate::record::RecordWriter;
    use tactomo_protocol::{FrameHead, MAX_WIRE, Settings, encode_board, encode_frame};

    fn hello() -> Vec<u8> {
        let hello = Hello {
            firmware_version: "0.1.0".try_into().unwrap_or_default(),
            board: "test".try_into().unwrap_or_default(),
            electrodes: 4,
            adc_bits: 10,
            adc_full_scale_mv: 1024,
            drive_mv: 1500,
            settings: Settings::default(),
        };
        let mut wire = [0; MAX_WIRE];
        let length = encode_board(&BoardMessage::Hello(hello), &mut wire).unwrap();
        wire[..length].to_vec()
    }

    fn frame(sequence: u16, code: u16) -> Vec<u8> {
        let mut wire = [0; MAX_WIRE];
        let head =
            FrameHead { sequence, time_us: 1000 * u32::from(sequence), fraction_bits: 1, ..FrameHead::default() };
        let length = encode_frame(head, &[code; 16], &mut wire).unwrap();
        wire[..length].to_vec()
    }

    /// Opens a recording of these chunks.
    fn recorded(name: &str, chunks: &[Vec<u8>]) -> Result<FrameFile, FramesError> {
        let path = std::env::temp_dir().join(format!("tactomo-{}-frames-{name}", std::process::id()));
        let mut writer = RecordWriter::new(File::create(&path).unwrap(), &Header::default()).unwrap();
        chunks.iter().for_each(|chunk| writer.write(0, chunk).unwrap());
        let file = FrameFile::open(&path, None);
        std::fs::remove_file(path).unwrap();
        file
    }

    #[test]
    fn frames_after_hello_come_in_volts_with_their_times() {
        let together = [hello(), frame(3, 100)].concat();
        let split = frame(4, 40);
        let chunks = [frame(2, 7), together, split[..9].to_vec(), split[9..].to_vec(), b"junk\0".to_vec(), frame(9, 0)];
        let mut file = recorded("whole", &chunks).unwrap();
        assert_eq!((file.channels(), file.board().map(|board| board.drive_mv)), (16, Some(1500)));
        let frames: Vec<_> = std::iter::from_fn(|| file.next_frame().unwrap()).collect();
        assert_eq!(frames.len(), 3);
        for (found, (time_s, sequence, lost_before, volts)) in
            frames.iter().zip([(0.0, 3, 0, 0.05), (0.001, 4, 0, 0.02), (0.006, 9, 4, 0.0)])
        {
            assert!((found.time_s.unwrap() - time_s).abs() < 1e-12, "{found:?}");
            assert!(found.volts.iter().all(|found_v: &f64| (found_v - volts).abs() < 1e-12), "{found:?}");
            assert_eq!((found.sequence, found.lost_before), (Some(sequence), lost_before));
        }
    }

    #[test]
    fn a_recording_without_hello_is_told() {
        let told = recorded("no-hello", &[frame(1, 1)]).err().map(|error| error.to_string());
        assert!(told.is_some_and(|told| told.contains("no board says Hello")));
    }
}
