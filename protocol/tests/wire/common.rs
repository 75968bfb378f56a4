//! Messages of every kind and size, and what can happen to them on a wire.

use heapless::Vec as Fixed;
use proptest::prelude::*;
use tactomo_protocol::{
    BoardMessage, BoardReceiver, Clock, Command, CommandReceiver, ContactCode, ContactFlags, Contacts, ConverterErrors,
    Counters, DecodeError, Fault, Frame, FrameHead, Hello, Log, MAX_COMMAND, MAX_WIRE, Output, Plan, Range, Request,
    Scope, Settings, Status, TableId, TablePiece, TableState, encode_board, encode_request,
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
    let selecting = (0..=Settings::MAX_SELECT_US, 0..=Settings::MAX_DISCARDED);
    (any::<u16>(), 0..=Settings::MAX_AVERAGE_LOG2, any::<u16>(), selecting).prop_map(
        |(settle_us, average_log2, max_frames_per_s, (select_us, discarded))| Settings {
            settle_us,
            average_log2,
            max_frames_per_s,
            select_us,
            discarded,
        },
    )
}

/// One to four ranges that sum up to all electrodes.
fn ranges(electrodes: u8, adc_bits: u8) -> impl Strategy<Value = Fixed<Range, 4>> {
    let largest = ((1u32 << adc_bits) - 1) as u16;
    let cuts = prop::collection::vec(1..electrodes, 0..=3);
    let errors = (any::<u16>(), any::<u16>(), any::<u16>());
    let errors = errors.prop_map(|(noise_uv, gain_ppm, bow_uv)| ConverterErrors { noise_uv, gain_ppm, bow_uv });
    let sight =
        (0..largest, 1..=largest, errors).prop_map(|(a, ceiling, errors)| (a.min(ceiling - 1), ceiling, errors));
    (cuts, prop::collection::vec(sight, 4)).prop_map(move |(mut cuts, sights)| {
        cuts.extend([0, electrodes]);
        cuts.sort_unstable();
        cuts.dedup();
        let runs = cuts.windows(2).map(|cut| cut[1] - cut[0]);
        let range = |(electrodes, sight): (u8, &(u16, u16, ConverterErrors))| {
            let (floor, ceiling, errors) = *sight;
            Range { electrodes, floor, ceiling, errors }
        };
        runs.zip(&sights).map(range).collect()
    })
}

fn any_hello() -> impl Strategy<Value = BoardMessage> {
    let shape = (4..=32u8, 1..=16u8).prop_flat_map(|(n, bits)| (Just(n), Just(bits), ranges(n, bits)));
    (text(), text(), shape, 1u16.., 1u16.., settings(), any::<u8>(), any::<bool>()).prop_map(
        |(firmware_version, board, shape, adc_full_scale_mv, drive_mv, settings, answers, is_streaming)| {
            let (electrodes, adc_bits, ranges) = shape;
            BoardMessage::Hello(Hello {
                answers,
                firmware_version,
                board,
                electrodes,
                adc_bits,
                adc_full_scale_mv,
                drive_mv,
                settings,
                is_streaming,
                ranges,
            })
        },
    )
}

/// Some of the electrodes' bits, never none.
fn reads(electrodes: u8) -> impl Strategy<Value = u32> {
    let all = u32::MAX >> (32 - u32::from(electrodes));
    prop_oneof![Just(all), (1..=all)]
}

/// Whole frames, and rows of any kind that hold no more than a whole one.
pub fn scope() -> impl Strategy<Value = Scope> {
    let rows = (4..=32u8).prop_flat_map(|n| (Just(n), prop::collection::vec(0..n, 1..=32), reads(n)));
    let some = rows.prop_map(|(n, mut grounds, reads)| {
        grounds.truncate((usize::from(n).pow(2) / reads.count_ones() as usize).min(grounds.len()));
        Scope::of_rows(n, &grounds, reads).expect("a scope")
    });
    prop_oneof![(4..=32u8).prop_map(|n| Scope::whole(n).expect("4 to 32")), some]
}

fn head() -> impl Strategy<Value = FrameHead> {
    let head = (any::<u16>(), any::<u32>(), 0..=3u8, 0..=15u8, 0..=15u8);
    head.prop_map(|(sequence, time_us, status, folded, fraction_bits)| FrameHead {
        sequence,
        time_us,
        status: Status(status),
        folded,
        fraction_bits,
    })
}

fn frame() -> impl Strategy<Value = BoardMessage> {
    let readings = (scope(), 0..=16u32).prop_flat_map(|(scope, bits)| {
        let largest = ((1u32 << bits) - 1) as u16;
        let readings = prop::collection::vec(prop_oneof![Just(0), 0..=largest], scope.readings());
        (Just(scope), readings)
    });
    (head(), readings).prop_map(|(head, (scope, readings))| {
        let readings = Fixed::from_slice(&readings).expect("room for 32 x 32");
        BoardMessage::Frame(Frame { head, scope, readings })
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
        any::<u8>().prop_map(|answers| Fault::BadSettings { answers }),
        any::<u8>().prop_map(|answers| Fault::BadPlan { answers }),
        any::<u8>().prop_map(|answers| Fault::BadRate { answers }),
        any::<u8>().prop_map(|answers| Fault::NoTable { answers }),
        any::<u32>().prop_map(|electrodes| Fault::BrokenWires { electrodes }),
        any::<u8>().prop_map(Fault::UnknownVersion),
    ]
    .prop_map(BoardMessage::Fault)
}

fn clock() -> impl Strategy<Value = BoardMessage> {
    (any::<u8>(), any::<u32>()).prop_map(|(answers, time_us)| BoardMessage::Clock(Clock { answers, time_us }))
}

fn contacts() -> impl Strategy<Value = BoardMessage> {
    let contact = (1u8.., any::<[i16; 2]>(), any::<u16>(), any::<u8>());
    let contact = contact.prop_map(|(id, at, conductance, sigma)| ContactCode { id, at, conductance, sigma });
    let all = [ContactFlags::MORE, ContactFlags::MISFIT, ContactFlags::SATURATED, ContactFlags::RESTING];
    let flags = prop::sample::subsequence(all.to_vec(), 0..=4).prop_map(|raised| {
        let mut flags = ContactFlags::default();
        raised.into_iter().for_each(|flag| flags.raise(flag));
        flags
    });
    (head(), flags, prop::collection::vec(contact, 0..=3)).prop_map(|(head, flags, found)| {
        let head = FrameHead { fraction_bits: 0, ..head };
        BoardMessage::Contacts(Contacts { head, flags, found: found.into_iter().collect() })
    })
}

fn table() -> impl Strategy<Value = BoardMessage> {
    let id = (any::<u32>(), any::<u32>()).prop_map(|(layout, checksum)| TableId { layout, checksum });
    (any::<u8>(), any::<u32>(), any::<u32>(), prop::option::of(id))
        .prop_map(|(answers, room, held, usable)| BoardMessage::Table(TableState { answers, room, held, usable }))
}

pub fn board_message() -> impl Strategy<Value = BoardMessage> {
    prop_oneof![any_hello(), frame(), log(), fault(), clock(), contacts(), table()]
}

/// Any plan that the wire carries, whether or not a board would take it.
fn plan() -> impl Strategy<Value = Plan> {
    (prop::collection::vec(any::<u8>(), 0..=96), any::<u32>(), any::<u8>(), any::<u8>()).prop_map(
        |(grounds, reads, rows_a_frame, average_log2)| Plan {
            grounds: Fixed::from_slice(&grounds).expect("room for 96"),
            reads,
            rows_a_frame,
            average_log2,
        },
    )
}

pub fn request() -> impl Strategy<Value = Request> {
    let command = prop_oneof![
        Just(Command::Hello),
        Just(Command::Start),
        Just(Command::Stop),
        settings().prop_map(Command::Configure),
        plan().prop_map(Command::Scan),
        any::<u32>().prop_map(|baud| Command::Rate { baud }),
        prop_oneof![Just(Output::Frames), Just(Output::Contacts), Just(Output::Both)].prop_map(Command::Output),
        (any::<u32>(), prop::collection::vec(any::<u8>(), 0..=64))
            .prop_map(|(at, bytes)| { Command::Table(TablePiece { at, bytes: bytes.into_iter().collect() }) }),
    ];
    (1u8.., command).prop_map(|(tag, command)| Request { tag, command })
}

/// A Hello as the paper's board sends it, whose two converters see different ranges.
pub fn hello() -> Hello {
    let errors = ConverterErrors { noise_uv: 5000, gain_ppm: 10_000, bow_uv: 12_000 };
    let range = |electrodes, floor, ceiling| Range { electrodes, floor, ceiling, errors };
    let ranges = [range(6, 142, 3100), range(10, 128, 3080)];
    Hello {
        answers: 7,
        firmware_version: "0.1.0".try_into().unwrap(),
        board: "esp32".try_into().unwrap(),
        electrodes: 16,
        adc_bits: 12,
        adc_full_scale_mv: 4096,
        drive_mv: 2000,
        settings: Settings::default(),
        is_streaming: true,
        ranges: ranges.into_iter().collect(),
    }
}

pub fn board_wire(message: &BoardMessage) -> Vec<u8> {
    let mut out = [0; MAX_WIRE];
    let length = encode_board(message, &mut out).expect("a message within the limits");
    out[..length].to_vec()
}

pub fn request_wire(request: &Request) -> Vec<u8> {
    let mut out = [0; MAX_COMMAND];
    let length = encode_request(request, &mut out).expect("every command fits");
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
pub fn receive_command(mut bytes: &[u8]) -> (Vec<Result<Request, DecodeError>>, Counters) {
    let mut receiver = CommandReceiver::default();
    let received = std::iter::from_fn(|| receiver.receive(&mut bytes)).collect();
    (received, receiver.counters())
}
