//! Any bytes in any chunks: no panic, and whatever is accepted goes out and comes back as it was.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tactomo_protocol::{
    BoardReceiver, CommandReceiver, FrameHead, MAX_COMMAND, MAX_WIRE, encode_board, encode_frame, encode_request,
};

fuzz_target!(|input: &[u8]| {
    let Some((&chunk, bytes)) = input.split_first() else { return };
    let chunk = usize::from(chunk) + 1;
    receive(bytes, chunk);
    // A fuzzer does not guess checksums: the same bytes as a packet whose checksum is right.
    receive(&packet(bytes), chunk);
    // The same behind a key frame, so that it can be a coded one.
    receive(&[key(), packet(bytes)].concat(), chunk);
});

/// A frame of four electrodes, with number 0.
fn key() -> Vec<u8> {
    let mut out = [0; MAX_WIRE];
    let length = encode_frame(FrameHead::default(), &[1000; 16], &mut out).expect("a frame");
    out[..length].to_vec()
}

fn receive(bytes: &[u8], chunk: usize) {
    let mut host = BoardReceiver::default();
    let mut board = CommandReceiver::default();
    for chunk in bytes.chunks(chunk) {
        let mut input = chunk;
        while let Some(result) = host.receive(&mut input) {
            let Ok(message) = result else { continue };
            let mut out = [0; MAX_WIRE];
            let length = encode_board(&message, &mut out).expect("what is accepted can be sent");
            assert_eq!(BoardReceiver::default().receive(&mut &out[..length]), Some(Ok(message)));
        }
        let mut input = chunk;
        while let Some(result) = board.receive(&mut input) {
            let Ok(request) = result else { continue };
            let mut out = [0; MAX_COMMAND];
            let length = encode_request(&request, &mut out).expect("what is accepted can be sent");
            assert_eq!(CommandReceiver::default().receive(&mut &out[..length]), Some(Ok(request)));
        }
    }
    let counted = host.counters();
    assert!(counted.dropped_bytes >= counted.corrupt && counted.dropped_bytes <= bytes.len() as u64);
}

/// `content` closed with its CRC-32, stuffed and ended, with code of the target's own.
fn packet(content: &[u8]) -> Vec<u8> {
    let mut packet = content.to_vec();
    packet.extend(crc32(content).to_le_bytes());
    let mut wire = Vec::new();
    for stretch in packet.split(|byte| *byte == 0) {
        let full = stretch.chunks_exact(254);
        let rest = full.remainder();
        full.for_each(|block| wire.extend([&[255], block].concat()));
        wire.push(rest.len() as u8 + 1);
        wire.extend(rest);
    }
    wire.push(0);
    wire
}

/// CRC-32 of ISO-HDLC, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
}
