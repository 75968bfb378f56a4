//! What holds for every message and every disturbance of the wire.

use proptest::prelude::*;
use proptest::sample::Index;
use tactomo_protocol::{
    BoardMessage, Counters, DecodeError, EncodeError, MAX_COMMAND, MAX_WIRE, encode_board, encode_request,
};

use crate::common::{board_message, board_wire, packet, receive_board, receive_command, request, request_wire};

/// One disturbance of a stream.
#[derive(Clone, Debug)]
enum Disturbance {
    /// Bits turn over.
    Flip(Index, u8),
    /// Bytes are lost.
    Cut(Index, usize),
    /// Noise comes in.
    Noise(Index, Vec<u8>),
    /// A part of the stream comes again, as from a buffer sent twice.
    Again(Index, usize),
    /// The receiver joins in the middle.
    Join(Index),
    /// A chip's boot text, without a zero.
    BootText(Index),
    /// A defmt frame sent raw on the same line: it starts with 0xFF and a zero.
    RawLog(Index, Vec<u8>),
}

impl Disturbance {
    fn apply(&self, stream: &mut Vec<u8>) {
        if stream.is_empty() {
            return;
        }
        let insert = |stream: &mut Vec<u8>, at: &Index, bytes: &[u8]| {
            let at = at.index(stream.len());
            stream.splice(at..at, bytes.iter().copied());
        };
        let range = |stream: &Vec<u8>, at: &Index, length: usize| {
            let at = at.index(stream.len());
            at..(at + length).min(stream.len())
        };
        match self {
            Self::Flip(at, bits) => {
                let at = at.index(stream.len());
                stream[at] ^= bits;
            }
            Self::Cut(at, length) => drop(stream.drain(range(stream, at, *length))),
            Self::Noise(at, noise) => insert(stream, at, noise),
            Self::Again(at, length) => {
                let again = stream[range(stream, at, *length)].to_vec();
                insert(stream, at, &again);
            }
            Self::Join(at) => drop(stream.drain(..at.index(stream.len()))),
            Self::BootText(at) => insert(stream, at, b"ets Jul 29 2019 12:21:46\r\n\r\nrst:0x1 (POWERON_RESET)\r\n"),
            Self::RawLog(at, body) => insert(stream, at, &[&[0xFF, 0], &body[..], &[0xFF, 0xFF]].concat()),
        }
    }
}

fn disturbance() -> impl Strategy<Value = Disturbance> {
    use Disturbance::*;
    prop_oneof![
        (any::<Index>(), 1u8..).prop_map(|(at, bits)| Flip(at, bits)),
        (any::<Index>(), 1..600usize).prop_map(|(at, length)| Cut(at, length)),
        (any::<Index>(), prop::collection::vec(any::<u8>(), 1..64)).prop_map(|(at, noise)| Noise(at, noise)),
        (any::<Index>(), 1..600usize).prop_map(|(at, length)| Again(at, length)),
        any::<Index>().prop_map(Join),
        any::<Index>().prop_map(BootText),
        (any::<Index>(), prop::collection::vec(1u8.., 1..32)).prop_map(|(at, body)| RawLog(at, body)),
    ]
}

/// The last frame and the last contacts: a scan that comes once more is no other.
#[derive(Default)]
struct Last([Option<(u16, u32)>; 2]);

impl Last {
    fn is_again(&mut self, message: &BoardMessage) -> bool {
        let (last, head) = match message {
            BoardMessage::Frame(frame) => (&mut self.0[0], &frame.head),
            BoardMessage::Contacts(contacts) => (&mut self.0[1], &contacts.head),
            BoardMessage::Hello(hello) if hello.answers == 0 => {
                *self = Self::default();
                return false;
            }
            _ => return false,
        };
        let scan = Some((head.sequence, head.time_us));
        std::mem::replace(last, scan) == scan
    }
}

/// Which of `sent` arrived whole, and what the rest is counted as. A plain reading of the framing rule: whatever stands
/// between two zeros is a packet that was sent, byte for byte, or junk.
fn whole<M: Clone>(sent: &[(M, Vec<u8>)], stream: &[u8], mut is_again: impl FnMut(&M) -> bool) -> (Vec<M>, Counters) {
    let (mut arrived, mut counters) = (Vec::new(), Counters::default());
    let mut stretches: Vec<&[u8]> = stream.split(|byte| *byte == 0).collect();
    stretches.pop(); // Still open.
    for stretch in stretches.into_iter().filter(|stretch| !stretch.is_empty()) {
        match sent.iter().find(|(_, wire)| wire[..wire.len() - 1] == *stretch) {
            Some((message, _)) if is_again(message) => counters.repeated += 1,
            Some((message, _)) => {
                arrived.push(message.clone());
                counters.messages += 1;
            }
            None => {
                counters.corrupt += 1;
                counters.dropped_bytes += stretch.len() as u64;
            }
        }
    }
    (arrived, counters)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn a_board_message_comes_back_as_it_was(message in board_message()) {
        let wire = board_wire(&message);
        prop_assert_eq!(wire.iter().position(|byte| *byte == 0), Some(wire.len() - 1));
        prop_assert_eq!(receive_board(&[&wire]).0, [Ok(message)]);
    }

    #[test]
    fn a_command_comes_back_as_it_was(request in request()) {
        let wire = request_wire(&request);
        prop_assert!(wire.len() <= MAX_COMMAND);
        prop_assert_eq!(receive_command(&wire).0, [Ok(request)]);
    }

    /// However often each packet comes.
    #[test]
    fn a_packet_that_comes_again_at_once_is_no_other_scan(
        messages in prop::collection::vec((board_message(), 1..4usize), 1..8),
    ) {
        let copies = |(message, count): &(BoardMessage, usize)| board_wire(message).repeat(*count);
        let stream: Vec<u8> = messages.iter().flat_map(copies).collect();
        let is_scan = |message: &BoardMessage| matches!(message, BoardMessage::Frame(_) | BoardMessage::Contacts(_));
        let kept = |(message, count): &(BoardMessage, usize)| vec![message.clone(); if is_scan(message) { 1 } else { *count }];
        let (received, counters) = receive_board(&[&stream]);
        let repeated: usize = messages.iter().filter(|(message, _)| is_scan(message)).map(|(_, count)| count - 1).sum();
        prop_assert_eq!((counters.repeated, counters.corrupt), (repeated as u64, 0));
        let expected: Vec<_> = messages.iter().flat_map(kept).collect();
        prop_assert_eq!(received.into_iter().flatten().collect::<Vec<_>>(), expected);
    }

    /// A frame or contacts with any bits changed, under a right checksum: refused, or what goes out again just so.
    #[test]
    fn whatever_is_taken_goes_out_as_it_came(
        message in board_message(),
        flips in prop::collection::vec((any::<Index>(), 0..8u8), 0..3),
        length in prop_oneof![4 => Just(0isize), 1 => -3..=3isize],
    ) {
        let wire = board_wire(&message);
        let sent = cobs::decode_vec(&wire[..wire.len() - 1]).unwrap();
        let (head, mut body) = (sent[0], sent[1..sent.len() - 4].to_vec());
        body.resize(body.len().saturating_add_signed(length), 0);
        for (at, bit) in flips {
            let at = at.index(body.len().max(1));
            body.get_mut(at).into_iter().for_each(|byte| *byte ^= 1 << bit);
        }
        let came = packet(head, &body);
        match &receive_board(&[&came]).0[..] {
            [Ok(taken @ (BoardMessage::Frame(_) | BoardMessage::Contacts(_)))] => {
                // Reserved bits of the status are ignored.
                body[6] &= 0xF3;
                prop_assert_eq!(board_wire(taken), packet(head, &body));
            }
            [Ok(taken)] => prop_assert_eq!(receive_board(&[&board_wire(taken)]).0, [Ok(taken.clone())]),
            [Err(DecodeError::Body)] => {}
            other => prop_assert!(came.len() > MAX_WIRE, "{other:?}"),
        }
    }

    #[test]
    fn an_output_too_short_is_refused(message in board_message(), request in request(), missing: Index) {
        let wire = board_wire(&message);
        let mut out = vec![0; missing.index(wire.len())];
        prop_assert_eq!(encode_board(&message, &mut out), Err(EncodeError::Full));
        let wire = request_wire(&request);
        let mut out = vec![0; missing.index(wire.len())];
        prop_assert_eq!(encode_request(&request, &mut out), Err(EncodeError::Full));
    }

    #[test]
    fn chunks_of_any_size_give_the_same_messages(
        messages in prop::collection::vec(board_message(), 0..6),
        cuts in prop::collection::vec(any::<Index>(), 0..12),
    ) {
        let stream: Vec<u8> = messages.iter().flat_map(board_wire).collect();
        let mut cuts: Vec<usize> = cuts.iter().map(|cut| cut.index(stream.len() + 1)).collect();
        cuts.extend([0, stream.len()]);
        cuts.sort_unstable();
        let chunks: Vec<&[u8]> = cuts.windows(2).map(|cut| &stream[cut[0]..cut[1]]).collect();
        let (received, counters) = receive_board(&chunks);
        let messages: Vec<_> = messages.into_iter().map(Ok).collect();
        prop_assert_eq!(counters, Counters { messages: messages.len() as u64, ..Counters::default() });
        prop_assert_eq!(received, messages);
    }

    #[test]
    fn a_disturbed_stream_gives_what_arrived_whole_and_nothing_else(
        messages in prop::collection::vec(board_message(), 1..6),
        disturbances in prop::collection::vec(disturbance(), 1..6),
    ) {
        let sent: Vec<_> = messages.into_iter().map(|message| (message.clone(), board_wire(&message))).collect();
        let mut stream: Vec<u8> = sent.iter().flat_map(|(_, wire)| wire.clone()).collect();
        disturbances.iter().for_each(|disturbance| disturbance.apply(&mut stream));
        let mut last = Last::default();
        let (arrived, expected) = whole(&sent, &stream, |message| last.is_again(message));
        let (received, counters) = receive_board(&[&stream]);
        prop_assert_eq!(received.into_iter().flatten().collect::<Vec<_>>(), arrived);
        prop_assert_eq!(counters, expected);
    }

    #[test]
    fn disturbed_commands_give_what_arrived_whole_and_nothing_else(
        requests in prop::collection::vec(request(), 1..9),
        disturbances in prop::collection::vec(disturbance(), 1..6),
    ) {
        let sent: Vec<_> = requests.into_iter().map(|request| (request.clone(), request_wire(&request))).collect();
        let mut stream: Vec<u8> = sent.iter().flat_map(|(_, wire)| wire.clone()).collect();
        disturbances.iter().for_each(|disturbance| disturbance.apply(&mut stream));
        let (arrived, expected) = whole(&sent, &stream, |_| false);
        let (received, counters) = receive_command(&stream);
        prop_assert_eq!(received.into_iter().flatten().collect::<Vec<_>>(), arrived);
        prop_assert_eq!(counters, expected);
    }
}
