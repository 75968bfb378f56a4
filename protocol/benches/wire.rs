//! Encoding and decoding of frames, in bytes on the wire a second on one core:
//! `cargo bench -p tactomo-protocol --features fast-crc`.

use divan::{Bencher, counter::BytesCount};
use tactomo_protocol::{BoardReceiver, FrameHead, MAX_WIRE, encode_frame};

/// Largest reading of a 16 x 16 frame at 12 bits: nobody touches, a light touch, a hard press.
const LARGEST: [u16; 3] = [5, 200, 3000];

fn main() {
    divan::main();
}

/// Readings spread as a press spreads them: many small, few large, none on the diagonal.
fn readings(largest: u16, seed: u32) -> [u16; 256] {
    let mut state = seed;
    std::array::from_fn(|i| {
        state = state.wrapping_mul(1664525).wrapping_add(1013904223);
        let share = f64::from(state >> 16) / 65536.0;
        if i % 17 == 0 { 0 } else { (f64::from(largest) * share * share).round() as u16 }
    })
}

/// A stream of 1000 frames.
fn stream(largest: u16) -> Vec<u8> {
    let mut out = [0; MAX_WIRE];
    (0..1000u16)
        .flat_map(|i| {
            let head = FrameHead { sequence: i, time_us: 1000 * u32::from(i), ..FrameHead::default() };
            let length = encode_frame(head, &readings(largest, u32::from(i)), &mut out).expect("room");
            out[..length].to_vec()
        })
        .collect()
}

#[divan::bench(args = LARGEST)]
fn decode(bencher: Bencher, largest: u16) {
    let stream = stream(largest);
    bencher.counter(BytesCount::of_slice(&stream)).bench_local(|| {
        let mut receiver = BoardReceiver::default();
        let mut input = &stream[..];
        while let Some(message) = receiver.receive(&mut input) {
            divan::black_box(&message);
        }
        assert_eq!(receiver.counters().messages, 1000);
    });
}

#[divan::bench(args = LARGEST)]
fn encode(bencher: Bencher, largest: u16) {
    let readings = readings(largest, 1);
    let mut out = [0; MAX_WIRE];
    let length = encode_frame(FrameHead::default(), &readings, &mut out).expect("room");
    bencher
        .counter(BytesCount::new(length))
        .bench_local(|| encode_frame(FrameHead::default(), divan::black_box(&readings), &mut out));
}
