//! Messages of every kind and size, and what can happen to them on a wire.

use heapless::Vec as Fixed;
use proptest::prelude::*;
use tactomo_protocol::{
    BoardMessage, BoardReceiver, Command, CommandReceiver, Counters, DecodeError, Fault, Frame, FrameHead, Hello, Log,
    MAX_COMMAND, MAX_WIRE, Settings, Status, encode_board, encode_command,
};

/// A text of up to `N` bytes, not all of them ASCII.
fn text<const N: usize>() -> impl Strategy<Value = heapless::String<N>> {
    prop::collection::vec(prop_oneof![prop::char::range(' ', '~'), any::<char>()], 0..=N).prop_map(|letters| {
        let mut text = heapless::String::new();
        letters.into_iter().take_while(|letter| text.push(*letter).is_ok()).for_each(drop);
        text
    })
}

pub fn settings() -> impl Strategy<Value = Settings> {
    (any::<u16>(), 0..=Settings::MAX_AVERAGE_LOG2, any::<u16>())
        .prop_map(|(settle_us, average_log2, max_frames_per_s)| Settings { settle_us, average_log2, max_frames_per_s })
}

fn any_hello() -> impl Strategy<Value = BoardMessage> {
    (text(), text(), 4..=32u8, 1..=16u8, 1u16.., 1u16.., settings()).prop_map(
        |(firmware_version, board, electrodes, adc_bits, adc_full_scale_mv, drive_mv, settings)| {
            let hello = Hello { firmware_version, board, electrodes, adc_bits, adc_full_scale_mv, drive_mv, settings };
            BoardMessage::Hello(hello)
        },
    )
}

fn frame() -> impl Strategy<Value = BoardMessage> {
    let head = (any::<u16>(), any::<u32>(), any::<u8>(), 0..=15u8);
    let head = head.prop_map(|(sequence, time_us, status, fraction_bits)| FrameHead {
        sequence,
        time_us,
        status: Status(status),
        fraction_bits,
    });
    let readings = (4..=32usize, 0..=16u32).prop_flat_map(|(electrodes, bits)| {
        let largest = ((1u32 << bits) - 1) as u16;
        prop::collection::vec(prop_oneof![Just(0), 0..=largest], electrodes * electrodes)
    });
    (head, readings).prop_map(|(head, readings)| {
        let readings = Fixed::from_slice(&readings).expect("room for 32 x 32");
        BoardMessage::Frame(Frame { head, readings })
    })
}

fn log() -> impl Strategy<Value = BoardMessage> {
    let byte = prop_oneof![Just(0), any::<u8>()];
    prop::collection::vec(byte, 0..=64)
        .prop_map(|bytes| BoardMessage::Log(Log(Fixed::from_slice(&bytes).expect("room for 64"))))
}

fn fault() -> impl Strategy<Value = BoardMessage> {
    prop_oneof![
        text().prop_map(Fault::Panic),
        text().prop_map(Fault::Reset),
        Just(Fault::AdcStuck),
        Just(Fault::BadSettings),
        any::<u8>().prop_map(Fault::UnknownVersion),
    ]
    .prop_map(BoardMessage::Fault)
}

pub fn board_message() -> impl Strategy<Value = BoardMessage> {
    prop_oneof![any_hello(), frame(), log(), fault()]
}

pub fn command() -> impl Strategy<Value = Command> {
    prop_oneof![
        Just(Command::Hello),
        Just(Command::Start),
        Just(Command::Stop),
        settings().prop_map(Command::Configure),
    ]
}

/// A Hello as the paper's board sends it.
pub fn hello() -> Hello {
    Hello {
        firmware_version: "0.1.0".try_into().unwrap(),
        board: "esp32".try_into().unwrap(),
        electrodes: 16,
        adc_bits: 12,
        adc_full_scale_mv: 3300,
        drive_mv: 2000,
        settings: Settings::default(),
    }
}

pub fn board_wire(message: &BoardMessage) -> Vec<u8> {
    let mut out = [0; MAX_WIRE];
    let length = encode_board(message, &mut out).expect("a message within the limits");
    out[..length].to_vec()
}

pub fn command_wire(command: &Command) -> Vec<u8> {
    let mut out = [0; MAX_COMMAND];
    let length = encode_command(command, &mut out).expect("every command fits");
    out[..length].to_vec()
}

/// A packet on the wire with any head and body, its checksum right; written with other code than the crate's.
pub fn packet(head: u8, body: &[u8]) -> Vec<u8> {
    let mut packet = [&[head], body].concat();
    packet.extend(crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC).checksum(&packet).to_le_bytes());
    [cobs::encode_vec(&packet), vec![0]].concat()
}

/// What a host's receiver makes of the chunks, and its counters.
pub fn receive_board(chunks: &[&[u8]]) -> (Vec<Result<BoardMessage, DecodeError>>, Counters) {
    let mut receiver = BoardReceiver::default();
    let mut received = Vec::new();
    for mut chunk in chunks.iter().copied() {
        received.extend(std::iter::from_fn(|| receiver.receive(&mut chunk)));
    }
    (received, receiver.counters())
}

/// What a board's receiver makes of the bytes, and its counters.
pub fn receive_command(mut bytes: &[u8]) -> (Vec<Result<Command, DecodeError>>, Counters) {
    let mut receiver = CommandReceiver::default();
    let received = std::iter::from_fn(|| receiver.receive(&mut bytes)).collect();
    (received, receiver.counters())
}
