//! Frames of a recording, as fast as they can be read.

use std::collections::VecDeque;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tactomo_physics::readings::Readings;
use tactomo_protocol::{BoardMessage, BoardReceiver, Contacts, DecodeError, Fault, Frame, FrameHead, Hello};

use super::{FileFrame, FoundByBoard, FramesError, RecordingLoss};
use crate::clock::BoardClock;
use crate::measured::Volts;
use crate::record::{Entry, Header, Note, OtherProtocol, RecordReader};
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
    /// Messages that were corrupt in recordings before the one under way.
    corrupt_before: u64,
    lost: RecordingLoss,
    times: Times,
    clock: BoardClock,
    notes: Vec<(f64, Note)>,
    frames: VecDeque<FileFrame>,
    /// Contacts whose readings have not come yet.
    found: Option<Contacts>,
    /// Electrodes whose wires the board has said to be broken: a bit each.
    broken_wires: u32,
    /// Whether frames are handed out that have nothing but what the board has found.
    keeps_found: bool,
}

/// From board times to seconds since the first frame. Where the board begins to count anew, or another recording was joined on, times go on by
/// when the frames came.
#[derive(Debug, Default)]
struct Times {
    /// When the chunk under way came (us since the recording's start).
    arrived_us: u64,
    first_arrived_us: Option<u64>,
    /// A board time (us), and the seconds that it stands for.
    base: Option<(u64, f64)>,
    last: Option<(u64, f64)>,
}

impl Times {
    /// When what comes now came, but not before the last frame (s).
    fn now_s(&self) -> f64 {
        let first_us = self.first_arrived_us.unwrap_or(self.arrived_us);
        let arrived_s = self.arrived_us.saturating_sub(first_us) as f64 * 1e-6;
        self.last.map_or(0.0, |(_, last_s)| arrived_s.max(last_s))
    }

    /// The time of a frame (s).
    fn place(&mut self, board_us: u64) -> f64 {
        self.first_arrived_us.get_or_insert(self.arrived_us);
        let now_s = self.now_s();
        let (base_us, base_s) = *self.base.get_or_insert((board_us, now_s));
        let time_s = base_s + board_us.saturating_sub(base_us) as f64 * 1e-6;
        self.last = Some((board_us, time_s));
        time_s
    }
}

impl Recorded {
    /// Reads up to where the board says who it is.
    pub(super) fn open(path: &Path) -> Result<Self, FramesError> {
        let mut reader = RecordReader::open(path)?;
        let (mut receiver, mut chunk, mut notes) = (BoardReceiver::default(), Vec::new(), Vec::new());
        let mut clock = BoardClock::default();
        loop {
            let mut times = Times::default();
            match read(&mut reader, &mut chunk, path)? {
                None => return Err(FramesError::NoHello { path: path.to_owned() }),
                Some(Entry { time_us, note: Some(note) }) => {
                    match note {
                        Note::Asked { tag } => clock.asked(tag, Duration::from_micros(time_us)),
                        note => notes.push((time_us as f64 * 1e-6, note)),
                    }
                    continue;
                }
                Some(entry) => times.arrived_us = entry.time_us,
            }
            let mut input = &chunk[..];
            while let Some(message) = receiver.receive(&mut input) {
                let board = match message {
                    Ok(BoardMessage::Hello(board)) => board,
                    Err(DecodeError::Version(found)) => {
                        return Err(FramesError::Protocol { path: path.to_owned(), other: OtherProtocol { found } });
                    }
                    Ok(BoardMessage::Clock(said)) => {
                        clock.said(said, Duration::from_micros(times.arrived_us));
                        continue;
                    }
                    _ => continue,
                };
                let rest = input.to_vec();
                let mut recorded = Self {
                    path: path.to_owned(),
                    reader,
                    junk: receiver.counters().corrupt,
                    corrupt_before: 0,
                    receiver,
                    chunk: rest,
                    volts: Volts::of(&board),
                    board,
                    lost: RecordingLoss::default(),
                    sequence: Sequence::default(),
                    times,
                    clock,
                    notes,
                    frames: VecDeque::new(),
                    found: None,
                    broken_wires: 0,
                    keeps_found: false,
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

    /// Notes that were passed, with their times (s since the recording's start).
    pub fn notes(&self) -> &[(f64, Note)] {
        &self.notes
    }

    /// Tells readings that are still to come above a ground that is lifted by so much (V).
    pub(super) fn set_ground(&mut self, ground_v: f64) {
        self.volts = self.volts.clone().above(ground_v);
        for frame in &mut self.frames {
            let all = frame.volts.iter_mut().chain(&mut frame.measured_v);
            all.for_each(|volts| *volts -= ground_v);
        }
    }

    pub(super) fn keep_found(&mut self) {
        self.keeps_found = true;
    }

    /// The board, as it said who it is first.
    pub fn board(&self) -> &Hello {
        &self.board
    }

    /// What is damaged or missing, as far as it was read.
    pub fn loss(&self) -> RecordingLoss {
        let corrupt = self.corrupt_before + self.receiver.counters().corrupt - self.junk;
        RecordingLoss { file: self.reader.loss(), corrupt, ..self.lost }
    }

    pub(super) fn next_frame(&mut self) -> Result<Option<FileFrame>, FramesError> {
        loop {
            let mut frames = std::iter::from_fn(|| self.frames.pop_front());
            let frame = frames.find(|frame| self.keeps_found || frame.found_alone().is_none());
            if frame.is_some() {
                return Ok(frame);
            }
            let Some(entry) = read(&mut self.reader, &mut self.chunk, &self.path)? else {
                if self.found.is_none() {
                    return Ok(None);
                }
                self.end_found();
                continue;
            };
            match entry.note {
                None => {
                    self.times.arrived_us = entry.time_us;
                    self.decode();
                }
                Some(Note::Asked { tag }) => self.clock.asked(tag, Duration::from_micros(entry.time_us)),
                Some(note) => {
                    if matches!(note, Note::Joined { .. }) {
                        self.begin_another();
                    }
                    self.notes.push((entry.time_us as f64 * 1e-6, note));
                }
            }
        }
    }

    /// What follows is of another recording, whose board counts anew.
    fn begin_another(&mut self) {
        self.end_found();
        self.broken_wires = 0;
        self.corrupt_before += self.receiver.counters().corrupt - self.junk;
        (self.receiver, self.junk) = (BoardReceiver::default(), 0);
        self.sequence.restart();
        self.clock.restart();
        self.times.base = None;
    }

    /// Takes the frames out of a chunk. Those of another board than the first one say nothing of its detector.
    fn decode(&mut self) {
        let chunk = std::mem::take(&mut self.chunk);
        let mut input = &chunk[..];
        while let Some(message) = self.receiver.receive(&mut input) {
            match message {
                Ok(BoardMessage::Frame(frame)) => self.frame(&frame),
                Ok(BoardMessage::Contacts(contacts)) => {
                    self.end_found();
                    self.found = Some(contacts);
                }
                Ok(BoardMessage::Fault(Fault::BrokenWires { electrodes })) => self.broken_wires |= electrodes,
                Ok(BoardMessage::Clock(said)) => self.clock.said(said, Duration::from_micros(self.times.arrived_us)),
                Ok(BoardMessage::Hello(Hello { answers: 0, .. })) => self.restarted(),
                _ => {}
            }
        }
        self.chunk = chunk;
    }

    /// The board has started anew, and counts from zero.
    fn restarted(&mut self) {
        self.clock.restart();
        self.sequence.restart();
        // Before its first frame it is no news.
        if self.times.base.take().is_some() {
            let at_us = (self.times.now_s() * 1e6).round() as u64;
            self.lost.restarted_us = if self.lost.restarts == 0 { at_us } else { self.lost.restarted_us };
            self.lost.restarts += 1;
        }
    }

    /// Takes a frame, with the contacts that came before it, if they are its.
    fn frame(&mut self, frame: &Frame) {
        let Some(measured) = self.volts.measured(frame) else {
            self.lost.other_frames += 1;
            return;
        };
        let found = self.found.take_if(|contacts| contacts.head.sequence == frame.head.sequence);
        self.end_found();
        let used = self.volts.used(measured.clone());
        self.take(&frame.head, [measured, used], found);
    }

    /// Takes contacts whose readings do not come.
    fn end_found(&mut self) {
        if let Some(contacts) = self.found.take() {
            let nothing = Readings::from_fn(self.board.electrodes.into(), |_, _| 0.0).hiding(|_, _| true);
            self.take(&contacts.head.clone(), [nothing.clone(), nothing], Some(contacts));
        }
    }

    /// Takes a frame's readings, as measured and as used, and what the board has found in it.
    fn take(&mut self, head: &FrameHead, [measured, used]: [Readings; 2], found: Option<Contacts>) {
        let place = self.sequence.place(head);
        if self.times.last.is_some_and(|(last_us, _)| place.time_us < last_us) {
            // Its Hello was lost.
            self.restarted();
        }
        if let Some((last_us, _)) = self.times.last.filter(|_| place.dropped > 0) {
            let gap_us = place.time_us.saturating_sub(last_us);
            self.lost.missing_us += gap_us / (place.dropped + 1) * place.dropped;
        }
        self.lost.missing_frames += place.dropped;
        let broken_wires = self.broken_wires;
        self.frames.push_back(FileFrame {
            time_s: Some(self.times.place(place.time_us)),
            arrived_s: Some(self.times.arrived_us as f64 * 1e-6),
            delay: self.clock.frame(head.time_us, Duration::from_micros(self.times.arrived_us)),
            sequence: Some(place.sequence),
            lost_before: place.dropped,
            volts: used.volts().to_vec(),
            measured_v: measured.volts().to_vec(),
            says: used.all_say().to_vec(),
            found: found.map(|contacts| Box::new(FoundByBoard { contacts, broken_wires })),
        });
    }
}

/// The next chunk or note; `None` at the end.
fn read(reader: &mut RecordReader<File>, chunk: &mut Vec<u8>, path: &Path) -> Result<Option<Entry>, FramesError> {
    reader.next_entry(chunk).map_err(|source| FramesError::Read { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::FrameFile;
    use crate::record::RecordWriter;
    use proptest::prelude::*;
    use tactomo_protocol::{FrameHead, MAX_WIRE, Range, encode_board, encode_frame};

    fn said() -> Hello {
        let ranges = [Range::of_codes(4, 10)].into_iter().collect();
        Hello { adc_bits: 10, adc_full_scale_mv: 1024, drive_mv: 1500, ranges, ..Hello::example(4) }
    }

    fn hello() -> Vec<u8> {
        encoded(&said())
    }

    fn encoded(hello: &Hello) -> Vec<u8> {
        let mut wire = [0; MAX_WIRE];
        let length = encode_board(&BoardMessage::Hello(hello.clone()), &mut wire).unwrap();
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
        assert_eq!(loss.to_string(), "4 frames are missing (0.004 s); 1 message is corrupt");
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

    #[test]
    fn a_board_that_starts_anew_is_told_with_the_moment_and_times_go_on() {
        let start = encoded(&Hello { answers: 0, ..said() });
        let before = (30_000..30_010).map(|number| frame(number, 7));
        let after = (0..10).map(|number| frame(number, 7));
        for chunks in [
            [hello()].into_iter().chain(before.clone()).chain([start]).chain(after.clone()).collect::<Vec<_>>(),
            [hello()].into_iter().chain(before).chain(after).collect(),
        ] {
            let path = std::env::temp_dir().join(format!("tactomo-{}-frames-restart", std::process::id()));
            let mut writer = RecordWriter::new(File::create(&path).unwrap(), &Header::default()).unwrap();
            chunks.iter().enumerate().for_each(|(i, chunk)| writer.write(500_000 * i as u64, chunk).unwrap());
            let (times, loss) = times_s(&mut FrameFile::open(&path, None).unwrap());
            std::fs::remove_file(path).unwrap();
            assert!(times.len() == 20 && times.is_sorted(), "{times:?}");
            assert!(times[10] >= 4.5, "{times:?}");
            assert!(!loss.is_damage() && loss.missing_frames == 0 && loss.restarts == 1, "{loss}");
            assert!(loss.to_string().contains("1 restart of the board at"), "{loss}");
        }
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
            writer.hello(&said()).unwrap();
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
    fn no_flipped_bit_costs_both_hellos() {
        let path = std::env::temp_dir().join(format!("tactomo-{}-frames-hello", std::process::id()));
        let mut writer = RecordWriter::new(Vec::new(), &Header::default()).unwrap();
        let header_bytes = writer.get_ref().len();
        writer.hello(&said()).unwrap();
        let hello_bytes = writer.get_ref().len() - header_bytes;
        writer.write(1, &frame(1, 100)).unwrap();
        for bit in 0..8 * hello_bytes {
            let mut file = writer.get_ref().clone();
            file[header_bytes + bit / 8] ^= 1 << (bit % 8);
            std::fs::write(&path, file).unwrap();
            assert!(FrameFile::open(&path, None).is_ok(), "byte {}, bit {}", bit / 8, bit % 8);
        }
    }

    #[test]
    fn a_recording_in_another_version_of_the_protocol_is_refused() {
        // A packet of version 5: the example of docs/protocol-examples.md.
        let newer = vec![0x08, 0x50, 0xC0, 0xDE, 0x3F, 0xDF, 0x6C, 0x39, 0x00];
        let refusal = recorded("newer", &[b"boot text\0".to_vec(), newer]).err();
        assert!(matches!(refusal, Some(FramesError::Protocol { other: OtherProtocol { found: 5 }, .. })));
        let message = refusal.map(|error| error.to_string()).unwrap_or_default();
        assert!(message.contains("version 5") && message.contains("version 4"), "{message}");
        assert!(message.contains("use the program that recorded it"), "{message}");
    }

    #[test]
    fn a_recording_without_hello_is_refused() {
        let refusal = recorded("no-hello", &[frame(1, 1)]).err().map(|error| error.to_string());
        assert!(refusal.is_some_and(|refusal| refusal.contains("no board says Hello")));
    }
}
