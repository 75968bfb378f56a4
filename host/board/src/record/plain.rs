//! Bytes of a board as they are kept: no frame needs another to be read.

use tactomo_protocol::{BoardMessage, BoardReceiver, Frame, Kind, MAX_WIRE, encode_rows};

/// Takes the bytes of a board, and gives them with each coded frame as the plain one that says the same. So a recording can begin anywhere, be cut
/// and be joined, and no damage costs more than its own frames. All else passes as it is, what is no packet too.
#[derive(Debug, Default)]
pub struct PlainPackets {
    receiver: BoardReceiver,
    /// The packet under way, as long as it may be a coded frame.
    held: Vec<u8>,
    /// Whether the rest of the packet under way passes.
    passes: bool,
}

impl PlainPackets {
    /// The bytes that follow; a coded frame is among them once it is complete. One whose key did not come passes as it is.
    pub fn pass(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut plain = Vec::with_capacity(2 * bytes.len());
        for piece in bytes.split_inclusive(|byte| *byte == 0) {
            let message = self.receiver.receive(&mut &*piece);
            let ends = piece.ends_with(&[0]);
            match (self.passes, message) {
                (true, _) => plain.extend_from_slice(piece),
                (false, message) => {
                    self.held.extend_from_slice(piece);
                    match message {
                        Some(Ok(BoardMessage::Frame(frame))) if may_be_coded(&self.held) => {
                            plain.extend(as_plain(&frame).unwrap_or_else(|| self.held.clone()));
                            self.held.clear();
                        }
                        _ if ends || !may_be_coded(&self.held) || self.held.len() > MAX_WIRE => {
                            plain.append(&mut self.held);
                            self.passes = true;
                        }
                        _ => {}
                    }
                }
            }
            self.passes &= !ends;
        }
        plain
    }
}

/// Whether a packet that begins so can be a coded frame: behind the first byte of its stuffing is its head, which is never zero.
fn may_be_coded(packet: &[u8]) -> bool {
    packet.get(1).is_none_or(|head| head & 15 == Kind::CodedFrame as u8)
}

fn as_plain(frame: &Frame) -> Option<Vec<u8>> {
    let mut wire = [0; MAX_WIRE];
    let length = encode_rows(frame.head, &frame.scope, &frame.readings, &mut wire).ok()?;
    Some(wire[..length].to_vec())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactomo_protocol::{Fault, FrameHead, Keys, Scope, encode_board, encode_keyed};

    use super::*;

    /// Frames as a board sends them, the first of them a key; their readings, coded or not as the board would, and plain.
    fn stream(count: u16) -> (Vec<u8>, Vec<u8>) {
        let scope = Scope::whole(16).unwrap();
        let mut keys = Keys::<256>::default();
        let (mut sent, mut plain) = (Vec::new(), Vec::new());
        for sequence in 0..count {
            let head = FrameHead { sequence, ..FrameHead::default() };
            let readings: Vec<u16> = (0..256).map(|i| 2000 + (7 * i + 3 * sequence) % 11).collect();
            let mut wire = [0; MAX_WIRE];
            let length = encode_rows(head, &scope, &readings, &mut wire).unwrap();
            plain.extend(&wire[..length]);
            let length = encode_keyed(head, &scope, &readings, &mut keys, &mut wire).unwrap();
            sent.extend(&wire[..length]);
            if sequence % 5 == 4 {
                let length = encode_board(&BoardMessage::Fault(Fault::AdcStuck), &mut wire).unwrap();
                [&mut sent, &mut plain].into_iter().for_each(|stream| stream.extend(&wire[..length]));
            }
        }
        (sent, plain)
    }

    #[test]
    fn coded_frames_are_given_as_plain_ones() {
        let (sent, plain) = stream(50);
        assert!(4 * sent.len() < 3 * plain.len(), "{} bytes for {}", sent.len(), plain.len());
        for read_bytes in [1, 7, 100, 4096] {
            let mut packets = PlainPackets::default();
            let given: Vec<u8> = sent.chunks(read_bytes).flat_map(|bytes| packets.pass(bytes)).collect();
            assert!(given == plain, "by {read_bytes} bytes");
        }
    }

    #[test]
    fn a_frame_without_its_key_passes_as_it_is() {
        let (sent, _) = stream(20);
        let key_bytes = sent.iter().position(|byte| *byte == 0).unwrap() + 1;
        assert_eq!(PlainPackets::default().pass(&sent[key_bytes..]), &sent[key_bytes..]);
    }

    proptest! {
        /// Whatever comes, nothing of it is withheld but the beginning of what may be a coded frame.
        #[test]
        fn junk_passes_as_it_is(
            pieces in prop::collection::vec(prop::collection::vec(prop_oneof![Just(0u8), Just(0x44), any::<u8>()], 0..300), 0..30),
        ) {
            let (mut packets, mut given) = (PlainPackets::default(), Vec::new());
            pieces.iter().for_each(|piece| given.extend(packets.pass(piece)));
            given.extend(packets.pass(&[0]));
            let mut all = pieces.concat();
            all.push(0);
            prop_assert_eq!(given, all);
        }
    }
}
