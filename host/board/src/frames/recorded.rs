//! Frames of a recording, as fast as they can be read.

use std::collections::VecDeque;
use std::fmt;
use std::fs::File;
use std::path::{Path, PathBuf};

use tactomo_protocol::{BoardMessage, BoardReceiver, Frame, Hello};

use super::{FileFrame, FramesError};
use crate::measured::Volts;
use crate::record::{Header, Loss, RecordReader};
use crate::sequence::Sequence;

/// A recording.
pub struct Recorded {
    path: PathBuf,
    reader: RecordReader<File>,
    receiver: BoardReceiver,
    chunk: Vec<u8>,
    board: Hello,
    volts: Volts,
    sequence: Sequence,
    /// Stretches of junk before the board said Hello, which are no loss.
    junk: u64,
    lost: RecordingLoss,
    /// Board time of the first frame (us).
    first_us: Option<u64>,
    frames: VecDeque<FileFrame>,
}

/// What is damaged or missing in a recording, as far as it was read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordingLoss {
    /// What is damaged in the file.
    pub file: Loss,
    /// Stretches of bytes that are no message of the board.
    pub corrupt: u64,
    /// Frames that are missing by their numbers: lost in the file, on the line, or by the board.
    pub missing_frames: u64,
    /// Frames of a board with another number of electrodes than the first one, or of some rows only, which are left out.
    pub other_frames: u64,
}

impl RecordingLoss {
    /// Whether anything is damaged or missing.
    pub fn is_any(&self) -> bool {
        *self != Self::default()
    }
}

impl fmt::Display for RecordingLoss {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let count = |count: u64, one: &str, many: &str| {
            (count > 0).then(|| format!("{count} {}", if count == 1 { one } else { many }))
        };
        let parts = [
            count(self.missing_frames, "frame is missing", "frames are missing"),
            self.file.is_any().then(|| self.file.to_string()),
            count(self.corrupt, "message is corrupt", "messages are corrupt"),
            count(
                self.other_frames,
                "frame is of another board or scan plan",
                "frames are of another board or scan plan",
            ),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        if parts.is_empty() { write!(f, "nothing is missing") } else { write!(f, "{}", parts.join("; ")) }
    }
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
                    junk: receiver.counters().corrupt,
                    receiver,
                    chunk: rest,
                    volts: Volts::of(&board),
                    board,
                    lost: RecordingLoss::default(),
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

    /// What is damaged or missing, as far as it was read.
    pub fn loss(&self) -> RecordingLoss {
        let corrupt = self.receiver.counters().corrupt - self.junk;
        RecordingLoss { file: self.reader.loss(), corrupt, ..self.lost }
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

    /// Takes the whole frames out of a chunk. Those of another board than the first one say nothing of its detector.
    fn decode(&mut self) {
        let chunk = std::mem::take(&mut self.chunk);
        let mut input = &chunk[..];
        while let Some(message) = self.receiver.receive(&mut input) {
            if let Ok(BoardMessage::Frame(frame)) = message {
                match self.in_volts(&frame) {
                    Some(frame) => self.frames.push_back(frame),
                    None => self.lost.other_frames += 1,
                }
            }
        }
        self.chunk = chunk;
    }

    /// Readings and time of a frame; `None` if it is of a board with other electrodes, or not whole.
    fn in_volts(&mut self, frame: &Frame) -> Option<FileFrame> {
        let volts = self.volts.of_frame(frame)?.collect();
        let place = self.sequence.place(&frame.head);
        self.lost.missing_frames += place.dropped;
        let first_us = *self.first_us.get_or_insert(place.time_us);
        let time_s = Some(place.time_us.saturating_sub(first_us) as f64 * 1e-6);
        Some(FileFrame { time_s, sequence: Some(place.sequence), lost_before: place.dropped, volts })
    }
}

/// The next chunk; `false` at the end.
fn read(reader: &mut RecordReader<File>, chunk: &mut Vec<u8>, path: &Path) -> Result<bool, FramesError> {
    let read = reader.next_into(chunk).map_err(|source| FramesError::Read { path: path.to_owned(), source })?;
    Ok(read.is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::FrameFile;
    use crate::record::RecordWriter;
    use proptest::prelude::*;
    use tactomo_protocol::{FrameHead, MAX_WIRE, Range, encode_board, encode_frame};

    fn hello() -> Vec<u8> {
        let ranges = [Range::of_codes(4, 10)].into_iter().collect();
        let hello = Hello { adc_bits: 10, adc_full_scale_mv: 1024, drive_mv: 1500, ranges, ..Hello::example(4) };
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
        let loss = file.loss().unwrap();
        assert_eq!((loss.missing_frames, loss.corrupt, loss.other_frames), (4, 1, 0));
        assert_eq!(loss.to_string(), "4 frames are missing; 1 message is corrupt");
        let expected = [(0.0, 3, 0, 0.05), (0.001, 4, 0, 0.02), (0.006, 9, 4, 0.0)];
        for (found, (time_s, sequence, lost_before, volts)) in frames.iter().zip(expected) {
            assert!((found.time_s.unwrap() - time_s).abs() < 1e-12, "{found:?}");
            assert!(found.volts.iter().all(|found_v| (found_v - volts).abs() < 1e-12), "{found:?}");
            assert_eq!((found.sequence, found.lost_before), (Some(sequence), lost_before));
        }
    }

    /// The frames of a file by their times, and what is lost of it.
    fn times_s(file: &mut FrameFile) -> (Vec<f64>, RecordingLoss) {
        let times = std::iter::from_fn(|| file.next_frame().unwrap()).filter_map(|frame| frame.time_s).collect();
        (times, file.loss().unwrap())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// A recording begun by [`Recorder::create_with_hello`](crate::record::Recorder): Hello twice, then four frames a chunk.
        #[test]
        fn one_flipped_bit_costs_a_chunk_of_frames_at_most_and_never_without_a_word(
            at in any::<prop::sample::Index>(),
            bit in 0..8u32,
        ) {
            let path = std::env::temp_dir().join(format!("tactomo-{}-frames-flip", std::process::id()));
            let mut writer = RecordWriter::new(Vec::new(), &Header::default()).unwrap();
            let stream: Vec<Vec<u8>> = (0..80).map(|i| frame(i, 100)).collect();
            writer.write(0, &hello()).unwrap();
            writer.write(0, &hello()).unwrap();
            stream.chunks(4).for_each(|frames| writer.write(1, &frames.concat()).unwrap());
            let mut file = writer.get_ref().clone();
            let at = at.index(file.len());
            file[at] ^= 1u8 << bit;
            std::fs::write(&path, file).unwrap();
            let (times, loss) = times_s(&mut FrameFile::open(&path, None).unwrap());
            prop_assert!(times.len() >= 76, "{} of 80 frames", times.len());
            prop_assert!(loss.is_any(), "at {}", at);
            // What is missing at the very beginning or end has no frame after it to say so; the file does.
            prop_assert!(loss.missing_frames + times.len() as u64 == 80 || loss.file.is_any());
        }
    }

    #[test]
    fn a_recording_without_hello_is_refused() {
        let refusal = recorded("no-hello", &[frame(1, 1)]).err().map(|error| error.to_string());
        assert!(refusal.is_some_and(|refusal| refusal.contains("no board says Hello")));
    }
}
