//! A stream of good packets, disturbed as the fuzzer likes: what arrives whole is received, and nothing that was not sent.
//!
//! The input chooses the disturbances but not bytes in a row, so it cannot write a packet of its own, checksum and all.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use tactomo_protocol::{
    BoardMessage, BoardReceiver, Clock, Command, CommandReceiver, Fault, Frame, FrameHead, Hello, Keys, Log, MAX_WIRE,
    Plan, Range, Request, Scope, Settings, encode_board, encode_keyed, encode_request,
};

/// Packets in a stream at most.
const PACKETS: usize = 8;

enum Sent {
    Board(BoardMessage),
    /// A frame that is received if its key was.
    Coded(BoardMessage),
    Host(Request),
}

static PACKETS_SENT: LazyLock<Vec<(Sent, Vec<u8>)>> = LazyLock::new(|| {
    let mut sent = Vec::new();
    let mut out = [0; MAX_WIRE];
    for message in board_messages() {
        let length = encode_board(&message, &mut out).expect("within the limits");
        sent.push((Sent::Board(message), out[..length].to_vec()));
    }
    sent.push(coded());
    for request in requests() {
        let length = encode_request(&request, &mut out).expect("within the limits");
        sent.push((Sent::Host(request), out[..length].to_vec()));
    }
    sent
});

const SETTINGS: Settings =
    Settings { settle_us: 300, average_log2: 2, max_frames_per_s: 0, select_us: 35, discarded: 1 };

fn board_messages() -> Vec<BoardMessage> {
    let frame = |sequence, scope: Option<Scope>, readings: &[u16]| {
        let head = FrameHead { sequence, time_us: 7 * u32::from(sequence), ..FrameHead::default() };
        let scope = scope.expect("within the limits");
        BoardMessage::Frame(Frame { head, scope, readings: readings.iter().copied().collect() })
    };
    let hello = Hello {
        answers: 3,
        firmware_version: "0.1.0".try_into().expect("short"),
        board: "esp32".try_into().expect("short"),
        electrodes: 16,
        adc_bits: 12,
        adc_full_scale_mv: 3300,
        drive_mv: 2000,
        settings: SETTINGS,
        is_streaming: false,
        ranges: [Range::of_codes(16, 12)].into_iter().collect(),
    };
    vec![
        BoardMessage::Hello(hello),
        frame(1, Scope::whole(4), &std::array::from_fn::<u16, 16, _>(|i| i as u16)),
        frame(0, Scope::whole(8), &[0; 64]),
        frame(2, Scope::whole(16), &std::array::from_fn::<u16, 256, _>(|i| (i * i % 2000) as u16)),
        frame(3, Scope::whole(16), &[4095; 256]),
        frame(4, Scope::of_rows(16, &[3, 0, 3], 0x8001), &[5, 0, 1, 2, 3, 4]),
        BoardMessage::Log(Log([0xFF, 0, 1, 0, 0].into_iter().collect())),
        BoardMessage::Fault(Fault::AdcStuck),
        BoardMessage::Fault(Fault::BadPlan { answers: 9 }),
        BoardMessage::Fault(Fault::BadRate { answers: 6 }),
        BoardMessage::Clock(Clock { answers: 6, time_us: 0 }),
        BoardMessage::Fault(Fault::Reset("watchdog".try_into().expect("short"))),
    ]
}

/// A frame whose key is the whole one of 16 electrodes with the number 2.
fn coded() -> (Sent, Vec<u8>) {
    let scope = Scope::whole(16).expect("within the limits");
    let (mut keys, mut out) = (Keys::<256>::default(), [0; MAX_WIRE]);
    let mut encoded = |sequence: u16, add: u16| {
        let head = FrameHead { sequence, time_us: 7 * u32::from(sequence), ..FrameHead::default() };
        let readings: [u16; 256] = std::array::from_fn(|i| (i * i % 2000) as u16 + add * (i % 5) as u16);
        let length = encode_keyed(head, &scope, &readings, &mut keys, &mut out).expect("within the limits");
        let frame = Frame { head, scope: scope.clone(), readings: readings.into_iter().collect() };
        (Sent::Coded(BoardMessage::Frame(frame)), out[..length].to_vec())
    };
    encoded(2, 0);
    encoded(6, 1)
}

fn requests() -> Vec<Request> {
    let grounds = [0, 5, 10, 15].into_iter().collect();
    let plan = Plan { grounds, reads: 0xFFFF, rows_a_frame: 2, average_log2: 1 };
    let commands = [
        Command::Hello,
        Command::Start,
        Command::Stop,
        Command::Configure(SETTINGS),
        Command::Scan(plan),
        Command::Rate { baud: 3_000_000 },
    ];
    (1..).zip(commands).map(|(tag, command)| Request { tag, command }).collect()
}

fuzz_target!(|input: &[u8]| {
    let Some((choice, disturbances)) = input.split_first_chunk::<PACKETS>() else { return };
    let mut stream: Vec<u8> = choice.iter().flat_map(|choice| packet(*choice)).copied().collect();
    for disturbance in disturbances.as_chunks().0 {
        disturb(&mut stream, *disturbance);
    }
    check_host(choice, &stream);
    check_board(choice, &stream);
});

fn chosen(choice: u8) -> &'static (Sent, Vec<u8>) {
    &PACKETS_SENT[usize::from(choice) % PACKETS_SENT.len()]
}

fn packet(choice: u8) -> &'static [u8] {
    &chosen(choice).1
}

/// Flips bits, cuts, puts in noise, repeats a part, or joins late.
fn disturb(stream: &mut Vec<u8>, [kind, low, high, a, b]: [u8; 5]) {
    if stream.is_empty() {
        return;
    }
    let at = usize::from(u16::from_le_bytes([low, high])) % stream.len();
    let part = at..(at + usize::from(a)).min(stream.len());
    match kind % 6 {
        0 => stream[at] ^= a,
        1 => drop(stream.drain(part)),
        2 => drop(stream.splice(at..at, noise(b).take(usize::from(a)))),
        3 => stream.extend_from_within(part),
        4 => drop(stream.drain(..at)),
        _ => stream.insert(at, 0),
    }
}

/// Bytes by a linear congruential generator.
fn noise(seed: u8) -> impl Iterator<Item = u8> {
    let next = |state: &u32| Some(state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    std::iter::successors(Some(u32::from(seed)), next).skip(1).map(|state| (state >> 24) as u8)
}

/// How many stretches of the stream are, byte for byte, a packet that `counts`.
fn whole(stream: &[u8], counts: impl Fn(&Sent) -> bool) -> usize {
    let closed = stream.iter().rposition(|byte| *byte == 0).map_or(0, |end| end + 1);
    let packets: Vec<_> = PACKETS_SENT.iter().filter(|(sent, _)| counts(sent)).collect();
    let is_whole = |stretch: &&[u8]| packets.iter().any(|(_, wire)| wire == stretch);
    stream[..closed].split_inclusive(|byte| *byte == 0).filter(is_whole).count()
}

fn check_host(choice: &[u8], mut stream: &[u8]) {
    let whole = whole(stream, |sent| matches!(sent, Sent::Board(_)));
    let mut receiver = BoardReceiver::default();
    let mut accepted = 0;
    while let Some(result) = receiver.receive(&mut stream) {
        let Ok(message) = result else { continue };
        let sent =
            |choice: &u8| matches!(&chosen(*choice).0, Sent::Board(sent) | Sent::Coded(sent) if *sent == message);
        assert!(choice.iter().any(sent), "never sent: {message:?}");
        accepted += 1;
    }
    assert!(accepted >= whole, "{whole} packets arrived whole, {accepted} were received");
}

fn check_board(choice: &[u8], mut stream: &[u8]) {
    let whole = whole(stream, |sent| matches!(sent, Sent::Host(_)));
    let mut receiver = CommandReceiver::default();
    let mut accepted = 0;
    while let Some(result) = receiver.receive(&mut stream) {
        let Ok(request) = result else { continue };
        let sent = |choice: &u8| matches!(&chosen(*choice).0, Sent::Host(sent) if *sent == request);
        assert!(choice.iter().any(sent), "never sent: {request:?}");
        accepted += 1;
    }
    assert!(accepted >= whole, "{whole} packets arrived whole, {accepted} were received");
}
