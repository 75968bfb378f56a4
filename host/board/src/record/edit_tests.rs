//! Pieces of recordings, and recordings that are joined, read back frame by frame.

use super::*;
use crate::frames::FrameFile;
use tactomo_physics::detector::Detector;
use tactomo_protocol::{BoardMessage, FrameHead, MAX_WIRE, encode_board, encode_frame};

fn path(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("tactomo-{}-edit-{name}", std::process::id()))
}

fn packet(sequence: u16) -> Vec<u8> {
    let mut wire = [0; MAX_WIRE];
    let head = FrameHead { sequence, time_us: 1000 * u32::from(sequence), ..FrameHead::default() };
    let length = encode_frame(head, &[sequence; 16], &mut wire).unwrap();
    wire[..length].to_vec()
}

fn hello() -> Vec<u8> {
    let mut wire = [0; MAX_WIRE];
    let length = encode_board(&BoardMessage::Hello(Hello::example(4)), &mut wire).unwrap();
    wire[..length].to_vec()
}

fn header(preset: &str) -> Header {
    Header::of(&Detector::preset(preset).unwrap(), "test".into(), 1_700_000_000)
}

/// A recording of so many frames from a number on, one every millisecond, in chunks that end within packets, with a mark at 10 ms.
fn record(name: &str, preset: &str, numbers: std::ops::Range<u16>) -> PathBuf {
    let path = path(name);
    let mut writer = RecordWriter::new(File::create(&path).unwrap(), &header(preset)).unwrap();
    writer.write(0, &hello()).unwrap();
    let mut rest = Vec::new();
    for (index, number) in numbers.enumerate() {
        let time_us = 1000 * index as u64;
        if index == 10 {
            writer.note(time_us, &Note::mark("slipped")).unwrap();
        }
        rest.extend(packet(number));
        let split = rest.len() - 7;
        writer.write(time_us, &rest[..split]).unwrap();
        rest.drain(..split);
    }
    writer.write(1000 * 100, &rest).unwrap();
    path
}

/// Times (ms) and numbers of frames.
type Frames = Vec<(u64, u16)>;

/// The frames of a recording, and what was noted in it.
fn read(path: &Path) -> (Frames, Vec<(f64, Note)>) {
    let mut file = FrameFile::open(path, None).unwrap();
    let frames = std::iter::from_fn(|| file.next_frame().unwrap())
        .map(|frame| ((frame.time_s.unwrap() * 1e3).round() as u64, frame.sequence.unwrap() as u16))
        .collect();
    assert!(!file.loss().unwrap().is_any(), "{}", file.loss().unwrap());
    let FrameFile::Recording(recorded) = file else { panic!("no recording") };
    (frames, recorded.notes().to_vec())
}

#[test]
fn a_piece_has_its_frames_its_marks_and_its_time() {
    let (from, to) = (record("whole", "square-60", 5..45), path("piece"));
    cut(&from, 0.008..=0.020, &to).unwrap();
    let (frames, notes) = read(&to);
    // The packets of 12 and 25 are cut: they began before the piece, or end after it.
    assert_eq!(frames, (13..25).map(|number| (u64::from(number - 13), number)).collect::<Vec<_>>());
    assert_eq!(notes, [(0.002, Note::mark("slipped"))]);
    let header = RecordReader::open(&to).unwrap().header().clone();
    assert_eq!(header.started(), Duration::from_millis(1_700_000_000_008));
    let refused = cut(&from, 3.0..=4.0, &path("nothing")).unwrap_err().to_string();
    assert!(refused.contains("nothing from 3 s to 4 s") && refused.contains("0.100 s"), "{refused}");
    assert!(!path("nothing").exists());
    assert!(
        matches!(
            cut(&from, 0.0..=1.0, &to),
            Err(EditError::Output(tactomo_physics::new_file::NewFileError::Exists { .. }))
        ),
        "it is there"
    );
    [from, to].iter().for_each(|path| std::fs::remove_file(path).unwrap());
}

#[test]
fn no_piece_is_cut_from_a_recording_in_another_version_of_the_protocol() {
    let [from, to] = ["other-version", "other-version-piece"].map(path);
    let mut writer = RecordWriter::new(File::create(&from).unwrap(), &header("square-60")).unwrap();
    // A packet of version 5: the example of docs/protocol-examples.md.
    writer.write(0, &[0x08, 0x50, 0xC0, 0xDE, 0x3F, 0xDF, 0x6C, 0x39, 0x00]).unwrap();
    writer.write(1_000_000, b"more").unwrap();
    let refused = cut(&from, 0.5..=2.0, &to).unwrap_err();
    assert!(matches!(refused, EditError::Protocol { other: OtherProtocol { found: 5 }, .. }), "{refused:?}");
    assert!(!to.exists());
    std::fs::remove_file(from).unwrap();
}

#[test]
fn joined_recordings_are_read_as_one_without_a_loss() {
    let parts = [record("first", "square-60", 500..530), record("second", "square-60", 7..40)];
    let out = path("joined");
    merge(&parts, &out).unwrap();
    let (frames, notes) = read(&out);
    let numbers: Vec<u16> = frames.iter().map(|(_, number)| *number).collect();
    assert_eq!(numbers, (500..530).chain(7..40).collect::<Vec<_>>());
    assert!(frames.windows(2).all(|pair| pair[0].0 <= pair[1].0), "times do not fall: {frames:?}");
    let kinds: Vec<_> = notes.iter().map(|(_, note)| matches!(note, Note::Joined { .. })).collect();
    assert_eq!(kinds, [false, true, false], "a mark, the joint, a mark");
    parts.iter().chain([&out]).for_each(|path| std::fs::remove_file(path).unwrap());
}

#[test]
fn recordings_of_other_detectors_are_not_joined() {
    let parts = [record("a", "square-60", 0..10), record("b", "square-50", 0..10)];
    let out = path("refused");
    let refused = merge(&parts, &out).unwrap_err().to_string();
    assert!(refused.contains("edit-b is of another detector than") && !out.exists(), "{refused}");
    parts.iter().for_each(|path| std::fs::remove_file(path).unwrap());
}

#[test]
fn what_a_calibration_found_goes_with_every_piece() {
    let path_of = path("calibrated");
    let mut writer = RecordWriter::new(File::create(&path_of).unwrap(), &header("square-60")).unwrap();
    writer.write(0, &hello()).unwrap();
    for number in 0..20 {
        writer.write(1000 * u64::from(number), &packet(number)).unwrap();
    }
    let found = Note::detector_found(&Detector::preset("square-60").unwrap());
    writer.note(19_000, &found).unwrap();
    let piece = path("calibrated-piece");
    cut(&path_of, 0.002..=0.006, &piece).unwrap();
    assert_eq!(RecordReader::open(&piece).unwrap().detector_found().unwrap(), Some(found));
    assert_eq!(read(&piece).0.len(), 5);
    [path_of, piece].iter().for_each(|path| std::fs::remove_file(path).unwrap());
}
