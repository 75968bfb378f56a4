//! Playing, holding, seeking, and the end.

use std::path::PathBuf;

use tactomo_protocol::{FrameHead, Hello, MAX_WIRE, encode_board, encode_frame};

use super::*;
use crate::record::{Header, RecordWriter};

fn recording(name: &str, chunks: &[(u64, &[u8])]) -> PathBuf {
    let path = std::env::temp_dir().join(format!("tactomo-{}-{name}", std::process::id()));
    let mut writer = RecordWriter::new(File::create(&path).unwrap(), &Header::default()).unwrap();
    for (time_us, bytes) in chunks {
        writer.write(*time_us, bytes).unwrap();
    }
    path
}

fn play(link: &mut ReplayLink) -> Vec<u8> {
    let (mut all, mut buffer) = (Vec::new(), [0; 3]);
    loop {
        match link.read(&mut buffer) {
            Ok(count) => all.extend_from_slice(&buffer[..count]),
            Err(error) => {
                assert_eq!(error.kind(), io::ErrorKind::UnexpectedEof);
                return all;
            }
        }
    }
}

#[test]
fn all_bytes_come_in_order_and_then_the_end() {
    let path = recording("order", &[(5, b"first"), (1_000_000_000, b"second"), (1_000_000_000, b"third")]);
    let mut link = ReplayLink::open(&path, f64::INFINITY, false).unwrap();
    assert_eq!(play(&mut link), b"firstsecondthird");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn bytes_come_when_they_came() {
    let path = recording("pace", &[(9_000_000, b"a"), (9_400_000, b"b")]);
    let mut link = ReplayLink::open(&path, 4.0, false).unwrap();
    let begin = Instant::now();
    assert_eq!(play(&mut link), b"ab");
    assert!(begin.elapsed() >= Duration::from_millis(100), "0.4 s at four times the speed");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn the_end_is_calm_and_says_what_is_damaged() {
    let path = recording("calm", &[(0, b"first"), (1, b"second"), (2, b"third")]);
    let end = |link: &mut ReplayLink| loop {
        if let Err(error) = link.read(&mut [0; 100]) {
            break error.to_string();
        }
    };
    let mut link = ReplayLink::open(&path, f64::INFINITY, false).unwrap();
    assert_eq!(end(&mut link), "the recording is over");
    let mut file = std::fs::read(&path).unwrap();
    let at = file.windows(6).position(|bytes| bytes == b"second").unwrap();
    file[at] ^= 1;
    std::fs::write(&path, file).unwrap();
    let mut link = ReplayLink::open(&path, f64::INFINITY, false).unwrap();
    assert_eq!(end(&mut link), "the recording is over; it is damaged in 1 place (0 bytes left out)");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn what_is_damaged_is_known_while_it_is_played_and_a_packet_that_was_cut_off_is_given_as_it_is() {
    let path = recording("cut", &[(0, b"\x05whole\0"), (1, b"\x05cut")]);
    let mut link = ReplayLink::open(&path, f64::INFINITY, true).unwrap();
    let damage = |link: &ReplayLink| match link.playing() {
        Playing::Recording { damage, ended, .. } => (damage.is_any(), ended),
        other => panic!("{other:?}"),
    };
    let play = |link: &mut ReplayLink| {
        let (mut all, mut buffer) = (Vec::new(), [0; 100]);
        while !damage(link).1 {
            let count = link.read(&mut buffer).unwrap();
            all.extend_from_slice(&buffer[..count]);
        }
        all
    };
    assert_eq!(play(&mut link), b"\x05whole\0\x05cut");
    assert!(!damage(&link).0);
    let mut file = std::fs::read(&path).unwrap();
    file.truncate(file.len() - 1);
    std::fs::write(&path, file).unwrap();
    let mut link = ReplayLink::open(&path, f64::INFINITY, true).unwrap();
    play(&mut link);
    assert!(damage(&link).0, "the last chunk is not whole");
    std::fs::remove_file(path).unwrap();
}

fn hello() -> Vec<u8> {
    let hello = Hello::example(4);
    let mut wire = [0; MAX_WIRE];
    let length = encode_board(&BoardMessage::Hello(hello), &mut wire).unwrap();
    wire[..length].to_vec()
}

fn frame(sequence: u16) -> Vec<u8> {
    let mut wire = [0; MAX_WIRE];
    let head = FrameHead { sequence, time_us: 1000 * u32::from(sequence), ..FrameHead::default() };
    let length = encode_frame(head, &[4095; 16], &mut wire).unwrap();
    wire[..length].to_vec()
}

/// 2000 frames of 1 ms, in chunks of 25 bytes that begin and end anywhere.
fn session(name: &str) -> PathBuf {
    let mut stream = hello();
    (0..2000).for_each(|sequence| stream.extend(frame(sequence)));
    let chunks: Vec<&[u8]> = stream.chunks(25).collect();
    let each_us = 2_000_000 / chunks.len() as u64;
    let chunks: Vec<(u64, &[u8])> = (0..).map(|i| 7_000_000 + i * each_us).zip(chunks).collect();
    recording(name, &chunks)
}

/// What a host makes of a link.
struct Host {
    link: ReplayLink,
    receiver: BoardReceiver,
    /// Numbers of the frames that came, and whether a jump came before each.
    frames: Vec<(u16, bool)>,
    hellos: u32,
    jumped: bool,
}

impl Host {
    fn new(link: ReplayLink) -> Self {
        Self { link, receiver: BoardReceiver::default(), frames: Vec::new(), hellos: 0, jumped: false }
    }

    /// Reads once.
    fn read(&mut self) -> io::Result<usize> {
        let mut buffer = [0; 64];
        let count = self.link.read(&mut buffer)?;
        self.jumped |= self.link.jumped();
        let mut input = &buffer[..count];
        while let Some(message) = self.receiver.receive(&mut input) {
            match message.expect("no packet is broken") {
                BoardMessage::Frame(frame) => {
                    self.frames.push((frame.head.sequence, std::mem::take(&mut self.jumped)));
                }
                BoardMessage::Hello(_) => self.hellos += 1,
                _ => {}
            }
        }
        Ok(count)
    }

    fn read_until(&mut self, enough: impl Fn(&Self) -> bool) {
        let begin = Instant::now();
        while !enough(self) {
            assert!(begin.elapsed() < Duration::from_secs(10), "it never comes: {:?}", self.link.playing());
            self.read().unwrap();
        }
    }

    fn control(&mut self, control: Control) {
        self.link.control(&control).unwrap();
    }

    fn position_s(&self) -> f64 {
        match self.link.playing() {
            Playing::Recording { position_s, .. } => position_s,
            playing => panic!("{playing:?}"),
        }
    }

    fn has_ended(&self) -> bool {
        matches!(self.link.playing(), Playing::Recording { ended: true, .. })
    }
}

#[test]
fn a_seek_goes_on_there_without_a_broken_packet_and_says_that_it_has_jumped() {
    let path = session("seek");
    let mut host = Host::new(ReplayLink::open(&path, 4.0, true).unwrap());
    host.read_until(|host| host.frames.len() >= 20);
    for (to_s, expected) in [(1.5, 1500u16), (0.25, 250), (1.0, 1000)] {
        let before = host.frames.len();
        host.control(Control::Seek(to_s));
        assert!((host.position_s() - to_s).abs() < 1e-3);
        host.read_until(|host| host.frames.len() >= before + 20);
        let jump = host.frames[before..].iter().position(|(_, jumped)| *jumped).expect("it has jumped");
        assert!(jump <= 1, "at most the packet under way comes before");
        let first = host.frames[before + jump].0;
        assert!(first.abs_diff(expected) <= 2, "{first} for {expected}");
        assert!((host.position_s() - to_s).abs() < 0.3);
    }
    let follow = host.frames.windows(2).all(|pair| pair[1].1 || pair[1].0 == pair[0].0 + 1);
    assert!(follow, "nothing is missing but where it has jumped");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_seek_before_anything_was_read_still_gives_the_boards_hello() {
    let path = session("early-seek");
    let mut host = Host::new(ReplayLink::open(&path, 1.0, true).unwrap());
    host.control(Control::Seek(1.9));
    host.read_until(|host| host.frames.iter().any(|(_, jumped)| *jumped));
    assert_eq!(host.hellos, 1);
    assert!(host.frames.last().is_some_and(|(sequence, _)| (1898..1905).contains(sequence)));
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_recording_that_is_held_gives_nothing_but_what_it_was_sent_to() {
    let path = session("pause");
    let mut host = Host::new(ReplayLink::open(&path, 1.0, true).unwrap());
    host.read_until(|host| host.frames.len() >= 10);
    host.control(Control::Pause(true));
    let (held_s, count) = (host.position_s(), host.frames.len());
    (0..4).for_each(|_| assert_eq!(host.read().unwrap(), 0));
    assert_eq!(host.position_s(), held_s);
    host.control(Control::Seek(1.2));
    host.read_until(|host| host.frames.iter().any(|(_, jumped)| *jumped));
    let shown = host.frames.len();
    assert!(shown <= count + 2, "{} frames", shown - count);
    (0..4).for_each(|_| assert_eq!(host.read().unwrap(), 0));
    host.control(Control::Pause(false));
    host.read_until(|host| host.frames.len() >= shown + 10);
    assert!((1.2..1.3).contains(&host.position_s()), "{}", host.position_s());
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_recording_that_stays_open_ends_at_its_length_and_can_be_played_again() {
    let path = session("stays");
    let mut host = Host::new(ReplayLink::open(&path, f64::INFINITY, true).unwrap());
    host.read_until(Host::has_ended);
    assert_eq!(host.frames.len(), 2000);
    let Playing::Recording { position_s, length_s, .. } = host.link.playing() else { panic!() };
    assert_eq!(position_s, length_s);
    assert!((length_s - 2.0).abs() < 0.01, "{length_s}");
    assert_eq!(host.read().unwrap(), 0, "it stays there");
    host.control(Control::Pause(false));
    host.read_until(|host| host.frames.len() > 2000);
    assert_eq!(host.frames[2000], (0, true), "it plays from its beginning");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_loop_begins_again_and_ends_when_it_is_ended() {
    let path = session("loop");
    let mut host = Host::new(ReplayLink::open(&path, f64::INFINITY, false).unwrap());
    host.control(Control::Loop(true));
    host.read_until(|host| host.frames.len() >= 4500);
    assert_eq!(host.frames.iter().filter(|(_, jumped)| *jumped).count(), 2);
    host.control(Control::Loop(false));
    let error = loop {
        if let Err(error) = host.read() {
            break error;
        }
    };
    assert_eq!((error.kind(), host.frames.len()), (io::ErrorKind::UnexpectedEof, 6000));
    std::fs::remove_file(path).unwrap();
}

#[test]
fn the_speed_changes_while_it_plays_and_nonsense_is_refused() {
    let path = session("speed");
    let mut host = Host::new(ReplayLink::open(&path, 0.01, false).unwrap());
    host.read_until(|host| !host.frames.is_empty());
    for speed in [0.0, -1.0, f64::NAN] {
        assert!(matches!(host.link.control(&Control::Speed(speed)), Err(ControlError::Speed(_))));
    }
    assert_eq!(host.link.control(&Control::Seek(f64::NAN)), Err(ControlError::Seek));
    assert_eq!(host.link.control(&Control::Press(Vec::new())), Err(ControlError::Recording));
    let begin = Instant::now();
    host.control(Control::Speed(10.0));
    while host.read().is_ok() {}
    let took = begin.elapsed();
    assert!(took >= Duration::from_millis(180) && took < Duration::from_secs(5), "{took:?}");
    assert_eq!(host.frames.len(), 2000);
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_recording_without_anything_in_it_ends_at_once_even_if_it_is_to_begin_again() {
    let path = recording("empty", &[]);
    let mut link = ReplayLink::open(&path, 1.0, false).unwrap();
    link.control(&Control::Loop(true)).unwrap();
    assert!(play(&mut link).is_empty());
    std::fs::remove_file(path).unwrap();
}
