//! Coded frames: what is sent comes back, whatever is lost on the way, and by the specification alone.

use heapless::Vec as Fixed;
use proptest::prelude::*;
use tactomo_protocol::{
    BoardMessage, BoardReceiver, DecodeError, Frame, FrameHead, Keys, Kind, MAX_READINGS, MAX_WIRE, Scope, encode_keyed,
};

use crate::common::{board_wire, hello, packet, receive_board, scope};

/// A board's side of a line: keys are what went out.
#[derive(Default)]
struct Sender(Keys<MAX_READINGS>);

impl Sender {
    /// A frame as it goes out, and whether it was coded.
    fn send(&mut self, frame: &Frame) -> (Vec<u8>, bool) {
        let Frame { head, scope, readings } = frame;
        let mut out = [0; MAX_WIRE];
        let length = encode_keyed(*head, scope, readings, &mut self.0, &mut out).unwrap();
        let is_coded = out[1] & 15 == Kind::CodedFrame as u8;
        assert!(is_coded || out[..length] == board_wire(&BoardMessage::Frame(frame.clone())));
        (out[..length].to_vec(), is_coded)
    }
}

fn whole(sequence: u16, readings: &[u16]) -> Frame {
    let electrodes = readings.len().isqrt() as u8;
    let head = FrameHead { sequence, time_us: 1000 * u32::from(sequence), ..FrameHead::default() };
    Frame { head, scope: Scope::whole(electrodes).unwrap(), readings: Fixed::from_slice(readings).unwrap() }
}

/// Readings of 16 electrodes near 3000 with a noise of 6 codes, and what `pressed` adds.
fn noisy(seed: u64, pressed: impl Fn(usize) -> u16) -> Vec<u16> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f64 / f64::from(1 << 24)
    };
    // Twelve uniform numbers less their mean are nearly normal.
    let mut normal = move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
    (0..256).map(|at| (3000.0 + 6.0 * normal()).round() as u16 + pressed(at)).collect()
}

/// The specification in other words: bits as a list, one number after the other.
fn decoded(body: &[u8], key: &[u16]) -> Vec<u16> {
    let k = usize::from(body[7] & 15);
    let mut bits = body[11..].iter().flat_map(|byte| (0..8).map(move |bit| usize::from(byte >> bit & 1)));
    let number = |bits: &mut dyn Iterator<Item = usize>, count: usize| -> usize {
        bits.take(count).enumerate().map(|(at, bit)| bit << at).sum()
    };
    let mut one = |key: &u16| {
        let mut ones = 0;
        while ones < 8 && bits.next().unwrap() == 1 {
            ones += 1;
        }
        let z = if ones == 8 { number(&mut bits, 17) } else { (ones << k) + number(&mut bits, k) };
        let difference = if z % 2 == 0 { z as i32 / 2 } else { -(z as i32 + 1) / 2 };
        (i32::from(*key) + difference) as u16
    };
    key.iter().map(&mut one).collect()
}

#[test]
fn a_still_frame_takes_half_the_bytes_and_another_decoder_reads_it() {
    let (mut sender, mut bytes) = (Sender::default(), 0);
    let key = noisy(1, |_| 0);
    let (wire, is_coded) = sender.send(&whole(1, &key));
    assert!(!is_coded && wire.len() > 350);
    for sequence in 2..30 {
        // Two cells jump, one of them by more than eight times the mean.
        let readings = noisy(sequence.into(), |at| [0, 900][usize::from(at == 17)] + [0, 60][usize::from(at == 200)]);
        let (wire, is_coded) = sender.send(&whole(sequence, &readings));
        assert!(is_coded);
        let unstuffed = cobs::decode_vec(&wire[..wire.len() - 1]).unwrap();
        assert_eq!(unstuffed[0], 0x44);
        let body = &unstuffed[1..unstuffed.len() - 4];
        assert_eq!((body[8], &body[9..11]), (sequence as u8 - 1, &[16, 0][..]));
        assert_eq!(decoded(body, &key), readings);
        bytes += wire.len();
    }
    // The noise of a difference of two is 8.5 codes: 5.1 bits each at least, 164 bytes, and 22 around them.
    assert!((180..200).contains(&(bytes / 28)), "{}", bytes / 28);
}

#[test]
fn a_lost_frame_costs_itself_and_a_lost_key_those_until_the_next() {
    let frames: Vec<_> = (0..100).map(|sequence| whole(sequence, &noisy(sequence.into(), |_| 0))).collect();
    let mut sender = Sender::default();
    let sent: Vec<_> = frames.iter().map(|frame| sender.send(frame)).collect();
    let keys: Vec<_> = (0..100).filter(|at| !sent[*at].1).collect();
    assert_eq!(keys, [0, 32, 64, 96]);
    let came_without = |lost: usize| {
        let mut receiver = BoardReceiver::default();
        let wires = sent.iter().enumerate().filter(|(at, _)| *at != lost);
        let results: Vec<_> = wires.filter_map(|(_, (wire, _))| receiver.receive(&mut &wire[..])).collect();
        let came: Vec<_> = results
            .iter()
            .filter_map(|result| match result {
                Ok(BoardMessage::Frame(frame)) => Some(frame.clone()),
                _ => None,
            })
            .collect();
        assert!(came.iter().all(|frame| *frame == frames[usize::from(frame.head.sequence)]));
        let without = results.iter().filter(|result| **result == Err(DecodeError::Key)).count();
        assert_eq!((receiver.counters().without_key, receiver.counters().corrupt), (without as u64, 0));
        (came.len(), without)
    };
    assert_eq!(came_without(10), (99, 0));
    assert_eq!(came_without(32), (68, 31));
    assert_eq!(came_without(0), (68, 31));
}

#[test]
fn frames_of_rows_have_keys_of_their_own() {
    let readings: [u16; 32] = std::array::from_fn(|at| 500 + at as u16);
    let rows = |sequence, grounds: &[u8], fraction_bits| Frame {
        head: FrameHead { sequence, fraction_bits, ..FrameHead::default() },
        scope: Scope::of_rows(16, grounds, 0xFFFF).unwrap(),
        readings: Fixed::from_slice(&readings).unwrap(),
    };
    let mut sender = Sender::default();
    let mut is_coded = |frame: &Frame| sender.send(frame).1;
    assert!(!is_coded(&rows(0, &[3, 5], 0)) && !is_coded(&rows(1, &[7, 7], 0)));
    assert!(is_coded(&rows(2, &[3, 5], 0)) && is_coded(&rows(3, &[7, 7], 0)));
    assert!(!is_coded(&rows(4, &[3, 7], 0)), "rows of two keys");
    assert!(!is_coded(&rows(5, &[7, 3], 4)), "other units");
    assert!(is_coded(&rows(6, &[7, 3], 4)));
    assert!(!is_coded(&whole(7, &noisy(7, |_| 0))));
    assert!(is_coded(&whole(8, &noisy(8, |_| 0))));
    // 32 whole frames are 256 of two rows.
    assert!(
        !is_coded(&rows(9, &[1, 2], 0))
            && is_coded(&rows(9 + 255, &[1, 2], 0))
            && !is_coded(&rows(9 + 256, &[1, 2], 0))
    );
}

#[test]
fn what_moves_far_from_its_key_is_sent_as_it_is_and_is_a_key() {
    let mut sender = Sender::default();
    let moved = |by: u16| move |at: usize| by * (at % 7) as u16;
    assert!(!sender.send(&whole(1, &noisy(1, |_| 0))).1);
    assert!(!sender.send(&whole(2, &noisy(2, moved(200)))).1);
    assert!(sender.send(&whole(3, &noisy(3, moved(200)))).1);
}

#[test]
fn a_board_that_starts_anew_has_no_key() {
    let frame = |sequence| BoardMessage::Frame(whole(sequence, &[5; 16]));
    let mut sender = Sender::default();
    sender.send(&whole(3, &[5; 16]));
    let (coded, is_coded) = sender.send(&whole(4, &[5; 16]));
    assert!(is_coded);
    let started = board_wire(&BoardMessage::Hello(tactomo_protocol::Hello { answers: 0, ..hello() }));
    let all = [board_wire(&frame(3)), coded.clone(), started, coded].concat();
    let (received, _) = receive_board(&[&all]);
    assert_eq!((&received[1], &received[3]), (&Ok(frame(4)), &Err(DecodeError::Key)));
}

#[test]
fn a_coded_body_has_one_form() {
    let key = board_wire(&BoardMessage::Frame(whole(0, &[7; 16])));
    // Sixteen zeros of `k` 0 are one bit each.
    let body = |age: u8, k: u8, bits: &[u8]| [&[1, 0, 0, 0, 0, 0, 0, k, age, 4, 0], bits].concat();
    let result = |body: &[u8]| receive_board(&[&key, &packet(0x44, body)]).0.remove(1);
    assert!(result(&body(1, 0, &[0, 0])).is_ok());
    assert_eq!(result(&body(2, 0, &[0, 0])), Err(DecodeError::Key));
    assert_eq!(result(&body(0, 0, &[0, 0])), Err(DecodeError::Body), "its own key");
    assert_eq!(result(&body(1, 0, &[0, 0, 0])), Err(DecodeError::Body), "a byte too many");
    assert_eq!(result(&body(1, 0, &[0])), Err(DecodeError::Body), "a byte too few");
    // Sixteen numbers of three bits each are six bytes; a difference of -8 leads below zero.
    assert!(result(&body(1, 2, &[0; 6])).is_ok());
    assert_eq!(result(&body(1, 3, &[0b1110_1111, 0, 0, 0, 0, 0, 0, 0, 0])), Err(DecodeError::Body), "below zero");
    // 8 ones stand for numbers alone that would have had as many.
    assert_eq!(result(&body(1, 0, &[0xFF, 7, 0, 0, 0])), Err(DecodeError::Body), "a short number in the long form");
    for cut in 0..11 {
        assert_eq!(result(&body(1, 0, &[0, 0])[..cut]), Err(DecodeError::Body), "{cut} bytes");
    }
}

/// A coded frame of one row that is like its key, and the key: packets of any number and age, ground and time.
fn row(sequence: u16, ground: u8, time_us: u32) -> Frame {
    Frame {
        head: FrameHead { sequence, time_us, ..FrameHead::default() },
        scope: Scope::of_rows(16, &[ground], 0xF).unwrap(),
        readings: Fixed::from_slice(&[100 + u16::from(ground); 4]).unwrap(),
    }
}

fn coded_row(sequence: u16, ground: u8, time_us: u32, age: u8) -> Vec<u8> {
    let ([s0, s1], [t0, t1, t2, t3]) = (sequence.to_le_bytes(), time_us.to_le_bytes());
    packet(0x44, &[s0, s1, t0, t1, t2, t3, 0, 0, age, 16, 1, ground, 0xF, 0, 0])
}

/// An age is one byte: a key that is older than it tells is no key, whatever else came meanwhile.
#[test]
fn a_key_of_more_than_255_frames_is_none_whatever_age_is_named() {
    for gap in 0..=1030u16 {
        let first = 65_300;
        for every in [u16::MAX, 100] {
            let mut receiver = BoardReceiver::default();
            let mut take = |wire: &[u8]| receiver.receive(&mut &wire[..]).unwrap();
            let plain = |sequence: u16, ground| board_wire(&BoardMessage::Frame(row(sequence, ground, 0)));
            assert!(take(&plain(first, 3)).is_ok());
            // Frames of another ground.
            for between in (1..gap).filter(|between| between.is_multiple_of(every)) {
                assert!(take(&plain(first.wrapping_add(between), 4)).is_ok());
            }
            let sequence = first.wrapping_add(gap);
            let result = take(&coded_row(sequence, 3, 0, gap as u8));
            let expected = match gap {
                1..=255 => Ok(BoardMessage::Frame(row(sequence, 3, 0))),
                _ if gap.is_multiple_of(256) => Err(DecodeError::Body),
                _ => Err(DecodeError::Key),
            };
            assert_eq!(result, expected, "{gap} frames later");
        }
    }
    // Nor does a sender name such a key: one row of sixteen would be sent as it is after 512 frames else.
    for (gap, codes) in [(255, true), (256, false), (257, false), (511, false), (515, false)] {
        let mut sender = Sender::default();
        sender.send(&row(0, 3, 0));
        (1..gap).for_each(|sequence| _ = sender.send(&row(sequence, 4, 0)));
        assert_eq!(sender.send(&row(gap, 3, 0)).1, codes, "{gap}");
    }
}

/// Numbers begin anew after 65535: who was away for so long has no key, though its last one has the number of one that it missed.
#[test]
fn a_key_that_was_missed_is_not_taken_for_the_one_of_the_same_number_before() {
    let mut sender = Sender::default();
    let send = |sender: &mut Sender, number: u32, reading: u16| {
        let head = FrameHead { sequence: number as u16, time_us: 70 * number, ..FrameHead::default() };
        let frame =
            Frame { head, scope: Scope::whole(4).unwrap(), readings: Fixed::from_slice(&[reading; 16]).unwrap() };
        sender.send(&frame).0
    };
    let mut receiver = BoardReceiver::default();
    let mut take = |wire: Vec<u8>| receiver.receive(&mut &wire[..]).unwrap();
    assert!(take(send(&mut sender, 0, 5005)).is_ok());
    (1..=65_536).for_each(|number| _ = send(&mut sender, number, 5006));
    assert_eq!(take(send(&mut sender, 65_537, 5006)), Err(DecodeError::Key));
    let later: Vec<_> = (65_538..65_580).map(|number| take(send(&mut sender, number, 5006))).collect();
    let right =
        |result: &Result<_, _>| matches!(result, Ok(BoardMessage::Frame(frame)) if frame.readings == [5006; 16]);
    assert!(later.iter().all(|result| right(result) || *result == Err(DecodeError::Key)));
    assert!(right(&later[40]), "and goes on from the next key");
}

/// Time in which numbers may have begun anew: four seconds, of which nobody tells how many frames they were.
#[test]
fn after_four_seconds_without_a_frame_there_is_no_key() {
    for (gap_us, is_kept) in [(0, true), (4_000_000, true), (4_000_001, false), (u32::MAX, false)] {
        let start_us = u32::MAX - 1_000_000;
        let key = board_wire(&BoardMessage::Frame(row(7, 3, start_us)));
        let coded = coded_row(9, 3, start_us.wrapping_add(gap_us), 2);
        let result = receive_board(&[&key, &coded]).0.remove(1);
        assert_eq!(result.is_ok(), is_kept, "{gap_us} us: {result:?}");
        let mut sender = Sender::default();
        sender.send(&row(7, 3, start_us));
        assert_eq!(sender.send(&row(9, 3, start_us.wrapping_add(gap_us))).1, is_kept, "{gap_us} us");
    }
}

#[test]
fn keys_are_of_one_number_of_electrodes_and_as_many_as_there_is_room_for() {
    let frame = |sequence, electrodes: usize| whole(sequence, &vec![9; electrodes * electrodes]);
    let mut sender = Sender::default();
    let codes: Vec<bool> = [(0, 5), (1, 5), (2, 6), (3, 5), (4, 5), (5, 32), (6, 32)]
        .map(|(sequence, electrodes)| sender.send(&frame(sequence, electrodes)).1)
        .to_vec();
    assert_eq!(codes, [false, true, false, false, true, false, true]);
    let mut narrow = Keys::<25>::default();
    let mut codes = |frame: &Frame| {
        let mut out = [0; MAX_WIRE];
        encode_keyed(frame.head, &frame.scope, &frame.readings, &mut narrow, &mut out).unwrap();
        out[1] & 15 == Kind::CodedFrame as u8
    };
    let narrow_codes = [(0, 5), (1, 5), (2, 6), (3, 6), (4, 5), (5, 5)].map(|(sequence, n)| codes(&frame(sequence, n)));
    assert_eq!(narrow_codes, [false, true, false, false, false, true]);
    // What is wrong with a body is told first, then that there is no key, then what is wrong with the differences.
    let result = |wires: &[&[u8]]| receive_board(wires).0.pop().unwrap();
    let key = board_wire(&BoardMessage::Frame(row(0, 3, 0)));
    let of = |age, scope: &[u8], bits: &[u8]| packet(0x44, &[&[1, 0, 0, 0, 0, 0, 0, 0, age], scope, bits].concat());
    let (good, bad) = (&[16, 1, 3, 0xF, 0][..], &[16, 1, 16, 0xF, 0][..]);
    assert_eq!(result(&[&of(1, bad, &[0])]), Err(DecodeError::Body));
    assert_eq!(result(&[&of(0, good, &[0])]), Err(DecodeError::Body));
    assert_eq!(result(&[&of(1, good, &[0, 0, 0])]), Err(DecodeError::Key));
    assert_eq!(result(&[&key, &of(1, good, &[0, 0, 0])]), Err(DecodeError::Body));
    assert!(result(&[&key, &of(1, good, &[0])]).is_ok());
}

/// The rules of the page for a whole frame of 4 electrodes, bit by bit: its readings, or `None` if it is refused.
fn by_the_page(k: u32, bits: &[u8], key: &[u16]) -> Option<Vec<u16>> {
    let all: Vec<u64> = bits.iter().flat_map(|byte| (0..8).map(move |bit| u64::from(byte >> bit & 1))).collect();
    let mut at = 0;
    let mut number = |count: usize| {
        let bits = all.get(at..at + count)?;
        at += count;
        Some(bits.iter().enumerate().map(|(place, bit)| bit << place).sum::<u64>())
    };
    let mut readings = Vec::new();
    for key in key {
        let mut q = 0;
        while q < 8 && number(1)? == 1 {
            q += 1;
        }
        let z = if q == 8 { number(17)? } else { (q << k) + number(k as usize)? };
        if q == 8 && z >> k < 8 {
            return None;
        }
        let d = if z % 2 == 0 { (z / 2) as i64 } else { -(z as i64 + 1) / 2 };
        readings.push(u16::try_from(i64::from(*key) + d).ok()?);
    }
    let is_end = all.len() - at < 8 && all[at..].iter().all(|bit| *bit == 0);
    is_end.then_some(readings)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn differences_of_any_bits_are_read_by_the_page_or_refused_by_it(
        k in 0..16u32,
        key in prop::collection::vec(prop_oneof![any::<u16>(), 0..40u16, 65500..=65535u16], 16),
        near in prop::collection::vec(prop_oneof![4 => -20..20i32, 1 => -70_000..70_000i32], 16),
        flips in prop::collection::vec(any::<prop::sample::Index>(), 0..2),
        more in prop_oneof![6 => Just(0isize), 1 => -1..=1isize],
    ) {
        // Written by the page too.
        let mut bits: Vec<u8> = Vec::new();
        for d in near {
            let z = if d >= 0 { 2 * d } else { -2 * d - 1 } as u64 & 0x1_FFFF;
            let (head, low, count) = if z >> k < 8 { (z >> k, z, k) } else { (8, z, 17) };
            bits.extend((0..head).map(|_| 1).chain((head < 8).then_some(0)));
            bits.extend((0..count).map(|bit| (low >> bit & 1) as u8));
        }
        let mut bytes: Vec<u8> = bits.chunks(8).map(|bits| bits.iter().rev().fold(0, |byte, bit| byte << 1 | bit)).collect();
        bytes.resize(bytes.len().saturating_add_signed(more), 0);
        for flip in flips {
            let at = flip.index(8 * bytes.len().max(1));
            bytes.get_mut(at / 8).into_iter().for_each(|byte| *byte ^= 1 << (at % 8));
        }
        let frame = whole(0, &key);
        let wire = packet(0x44, &[&[1, 0, 0, 0, 0, 0, 0, k as u8, 1, 4, 0], &bytes[..]].concat());
        let result = receive_board(&[&board_wire(&BoardMessage::Frame(frame)), &wire]).0.remove(1);
        let readings = match result {
            Ok(BoardMessage::Frame(frame)) => Some(frame.readings.to_vec()),
            Err(DecodeError::Body) => None,
            other => panic!("{other:?}"),
        };
        prop_assert_eq!(readings, by_the_page(k, &bytes, &key));
    }

    /// Whatever is lost, comes again or is late: a frame that is taken is the one that was sent.
    #[test]
    fn on_any_line_a_frame_that_is_taken_is_the_one_that_was_sent(
        steps in prop::collection::vec((0..3u8, prop_oneof![8 => 1..4u16, 1 => 200..400u16, 1 => 1..=u16::MAX], 0..4u8, any::<u16>()), 1..80),
        first in any::<u16>(),
    ) {
        let (mut sender, mut receiver) = (Sender::default(), BoardReceiver::default());
        let (mut sequence, mut time_us) = (first, 0u32);
        for (ground, step, fate, reading) in steps {
            (sequence, time_us) = (sequence.wrapping_add(step), time_us.wrapping_add(100 * u32::from(step)));
            let mut frame = row(sequence, ground, time_us);
            frame.readings.iter_mut().for_each(|place| *place = reading % 50);
            let (wire, _) = sender.send(&frame);
            let mut take = || receiver.receive(&mut &wire[..]).unwrap();
            match fate {
                0 => {}
                1 => {
                    let once = take();
                    prop_assert!(once == Ok(BoardMessage::Frame(frame)) || once == Err(DecodeError::Key));
                    prop_assert!(once.is_err() || take() == Err(DecodeError::Repeated));
                }
                _ => {
                    let once = take();
                    prop_assert!(once == Ok(BoardMessage::Frame(frame)) || once == Err(DecodeError::Key), "{:?}", once);
                }
            }
        }
    }

    #[test]
    fn any_readings_come_back(
        (scope, frames) in scope().prop_flat_map(|scope| {
            let near = prop::collection::vec(1000..1040u16, scope.readings());
            let any = prop::collection::vec(any::<u16>(), scope.readings());
            (Just(scope), prop::collection::vec(prop_oneof![3 => near, 1 => any], 2..6))
        }),
        first in any::<u16>(),
    ) {
        let (mut sender, mut receiver) = (Sender::default(), BoardReceiver::default());
        for (index, readings) in (0..).zip(frames) {
            let head = FrameHead { sequence: first.wrapping_add(index), ..FrameHead::default() };
            let frame = Frame { head, scope: scope.clone(), readings: Fixed::from_slice(&readings).unwrap() };
            let (wire, _) = sender.send(&frame);
            prop_assert_eq!(receiver.receive(&mut &wire[..]), Some(Ok(BoardMessage::Frame(frame))));
        }
    }
}
