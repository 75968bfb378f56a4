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

proptest! {
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
