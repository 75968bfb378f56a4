//! Bytes on the wire of scans by the thin-shell model, for five codings of the readings:
//! `cargo test -p tactomo-tests --test wire_size -- --nocapture`.
#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should")]

use tactomo::detector::Detector;
use tactomo::forward::shell::Shell;
use tactomo::forward::{ForwardModel, readings_v};
use tactomo::scene::Contact;
use tactomo_protocol::frame::HEAD_BYTES;
use tactomo_protocol::{
    BoardMessage, BoardReceiver, CRC_BYTES, FrameHead, Keys, MAX_WIRE, Scope, encode_frame, encode_keyed, wire_bytes,
};

const ELECTRODES: usize = 16;
/// What a whole frame says of its scope: electrodes, and no rows.
const WHOLE_BYTES: usize = 2;

/// A contact in millimetres and siemens.
fn contact(x_mm: f64, y_mm: f64, radius_mm: f64, conductance_s: f64) -> Contact {
    Contact::flat(x_mm / 1e3, y_mm / 1e3, radius_mm / 1e3, conductance_s)
}

/// Scenes by name, from nobody touching to a palm.
fn scenes() -> Vec<(&'static str, Vec<Contact>)> {
    let fingers = [(-20.0, -5.0), (-11.0, 10.0), (0.0, 15.0), (11.0, 11.0), (20.0, -8.0)];
    vec![
        ("no contact", vec![]),
        ("light touch", vec![contact(4.0, -9.0, 2.0, 3e-5)]),
        ("one finger", vec![contact(4.0, -9.0, 4.0, 5e-4)]),
        ("pressed hard", vec![contact(4.0, -9.0, 6.0, 1e-2)]),
        ("near a corner", vec![contact(-25.0, 25.0, 3.0, 5e-4)]),
        ("two fingers", vec![contact(-15.0, 0.0, 4.0, 1e-3), contact(12.0, 9.0, 3.0, 3e-4)]),
        ("five fingers", fingers.map(|(x_mm, y_mm)| contact(x_mm, y_mm, 4.0, 5e-4)).to_vec()),
        ("palm", vec![contact(0.0, 0.0, 22.0, 2e-2)]),
    ]
}

/// Gaussian noise: sums of twelve uniform numbers of a linear congruential generator.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn gaussian(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// What a 12-bit converter of 3.3 V makes of the scene, with a noise of so many codes.
fn scan(shell: &Shell, contacts: &[Contact], noise_codes: f64, noise: &mut Noise) -> Vec<u16> {
    let volts = if contacts.is_empty() {
        vec![0.0; ELECTRODES * ELECTRODES]
    } else {
        readings_v(&shell.impedance_ohm(contacts).unwrap(), shell.detector()).volts().to_vec()
    };
    let code = |volt: &f64| (volt * 4096.0 / 3.3 + noise_codes * noise.gaussian()).round().clamp(0.0, 4095.0) as u16;
    volts.iter().map(code).collect()
}

/// Bytes of a whole frame's packet on the wire whose readings take `bytes`.
fn wire(bytes: usize) -> usize {
    wire_bytes(1 + HEAD_BYTES + WHOLE_BYTES + bytes + CRC_BYTES)
}

/// Bits of the largest.
fn width(values: impl IntoIterator<Item = u16>) -> usize {
    let largest = values.into_iter().max().unwrap_or(0);
    (u16::BITS - largest.leading_zeros()).max(1) as usize
}

/// Every reading in one byte below 128, in two below 16384: what postcard does with a `Vec<u16>`.
fn postcard_bytes(readings: &[u16]) -> usize {
    postcard::to_allocvec(readings).unwrap().len()
}

/// A row has its smallest reading in 12 bits and the width of the rest in 4, then the differences.
fn row_wise_bytes(readings: &[u16]) -> usize {
    let row_bits = |row: &[u16]| {
        let smallest = row.iter().copied().min().unwrap_or(0);
        16 + row.len() * width(row.iter().map(|reading| reading - smallest))
    };
    readings.chunks(ELECTRODES).map(row_bits).sum::<usize>().div_ceil(8)
}

/// Bytes of a frame on the wire after one of the same scene with other noise.
fn coded_bytes(shell: &Shell, contacts: &[Contact], noise_codes: f64, noise: &mut Noise) -> usize {
    let (mut keys, scope) = (Keys::<256>::default(), Scope::whole(16).unwrap());
    let mut out = [0; MAX_WIRE];
    let mut next = |sequence| {
        let head = FrameHead { sequence, ..FrameHead::default() };
        encode_keyed(head, &scope, &scan(shell, contacts, noise_codes, noise), &mut keys, &mut out).unwrap()
    };
    next(0);
    next(1)
}

#[test]
fn frames_of_real_scans_take_402_bytes_at_most() {
    let shell = Shell::new(&Detector::preset("square-60").unwrap()).unwrap();
    let mut noise = Noise(1);
    println!(
        "| scene | largest reading | plain postcard | 12 bits each | row-wise | a frame | coded | with noise of six codes |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (name, contacts) in scenes() {
        let readings = scan(&shell, &contacts, 1.5, &mut noise);
        let mut out = [0; MAX_WIRE];
        let ours = encode_frame(FrameHead::default(), &readings, &mut out).unwrap();
        let BoardMessage::Frame(frame) = BoardReceiver::default().receive(&mut &out[..ours]).unwrap().unwrap() else {
            panic!("a frame was sent")
        };
        assert_eq!(frame.readings[..], readings);
        let plain = wire(postcard_bytes(&readings));
        let fixed = wire(readings.len() * 12 / 8);
        let row_wise = wire(row_wise_bytes(&readings));
        let largest = readings.iter().max().unwrap();
        let [coded, noisy] = [1.5, 6.0].map(|codes| coded_bytes(&shell, &contacts, codes, &mut noise));
        println!("| {name} | {largest} | {plain} | {fixed} | {row_wise} | {ours} | {coded} | {noisy} |");
        // Independent Gaussian noise of 1.5 and of 6 codes in each of two frames takes 3.1 and 5.1 bits a difference, and a frame 20 bytes more.
        assert!(coded < 140 && noisy < 210, "{name}: {coded} and {noisy} bytes coded");
        assert!(ours <= fixed && ours < plain && fixed == 402, "{name}: {ours} bytes");
        assert!(ours <= row_wise + row_wise / 20, "{name}: a row-wise coding takes {row_wise} bytes, this one {ours}");
    }
}
