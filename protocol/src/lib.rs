//! The wire between a tomographic tactile sensor board and its host.
//!
//! The board sends [`BoardMessage`]s: who it is, its scans, its log and its faults. The host sends [`Request`]s. Both use this crate; it
//! has no allocator and no unsafe code, and it never panics, whatever comes down the line.
//!
//! A *packet* is one message. On the wire it is stuffed (COBS) and ends with a zero byte, so a receiver that joins in the
//! middle, or gets noise or boot text, waits for the next zero and goes on. Inside:
//!
//! | bytes | what |
//! |---|---|
//! | 1 | head: protocol version in the high four bits, [kind](Kind) in the low four |
//! | n | body: postcard, or for frames and contacts the layout of [`frame`] and [`contacts`] |
//! | 4 | CRC-32 (ISO-HDLC, as in zlib) of head and body, little-endian |
//!
//! Only head, CRC and COBS are promised to every future version: that is enough for a receiver to recognise a newer peer
//! and to refuse it by name ([`DecodeError::Version`]) instead of misreading it. `docs/protocol.md` is the whole specification, and `docs/protocol-examples.md` has
//! examples that are tested against this crate.
//!
//! A host asks, and gets the answer through a line that said something else before:
//!
//! ```
//! use tactomo_protocol::{
//!     BoardMessage, BoardReceiver, Command, Fault, MAX_COMMAND, Request, encode_board, encode_request,
//! };
//!
//! let mut command = [0; MAX_COMMAND];
//! let length = encode_request(&Request { tag: 7, command: Command::Start }, &mut command)?;
//! assert_eq!(command[..length], [0x08, 0x48, 0x07, 0x01, 0x3B, 0xA3, 0x8E, 0xB9, 0x00]);
//!
//! let mut line = *b"ets Jul 29 2019\r\n\0.............";
//! let length = encode_board(&BoardMessage::Fault(Fault::AdcStuck), &mut line[18..])?;
//!
//! let mut receiver = BoardReceiver::default();
//! let mut bytes = &line[..18 + length];
//! let mut messages = Vec::new();
//! while let Some(message) = receiver.receive(&mut bytes) {
//!     messages.extend(message.ok());
//! }
//! assert_eq!(messages, [BoardMessage::Fault(Fault::AdcStuck)]);
//! assert_eq!(receiver.counters().dropped_bytes, 17);
//! # Ok::<(), tactomo_protocol::EncodeError>(())
//! ```
//!
//! The feature `fast-crc` spends 16 kB instead of 1 kB on the checksum's table: decoding twice as fast, for hosts.
#![no_std]

#[cfg(test)]
extern crate std;

mod cobs;
pub mod coded;
mod coding;
pub mod contacts;
pub mod decode;
pub mod encode;
pub mod frame;
pub mod message;
pub mod scope;

pub use coded::Keys;
pub use contacts::{ContactCode, ContactFlags, Contacts, MAX_PIECE, Output, TableId, TablePiece, TableState};
pub use decode::{BoardReceiver, CommandReceiver, Counters, DecodeError, Receiver};
pub use encode::{
    EncodeError, encode_board, encode_contacts, encode_frame, encode_keyed, encode_log, encode_request, encode_rows,
};
pub use frame::{Frame, FrameHead, Status};
pub use message::{
    BoardMessage, Clock, Command, ConverterErrors, Fault, Hello, Kind, Log, MAX_LOG, MAX_RANGES, Range, Request,
    Settings,
};
pub use scope::{MAX_PLAN_ROWS, MAX_ROWS, Plan, Scope};

/// Version of the protocol that this crate speaks: 1 to 15. A board obeys no other; a host takes those from [`OLDEST`] on too.
pub const VERSION: u8 = 4;
/// Oldest version of which a host takes what a board says, and recordings. Before [`CODED_SINCE`] there are no coded frames; all else is the same but for the time of a board.
pub const OLDEST: u8 = 3;
/// First version with [coded frames](coded).
pub const CODED_SINCE: u8 = 4;
/// Most electrodes that a frame can carry.
pub const MAX_ELECTRODES: usize = 32;
/// Fewest electrodes that a frame can carry.
pub const MIN_ELECTRODES: usize = 4;
/// Most readings in a frame: every electrode under every ground.
pub const MAX_READINGS: usize = MAX_ELECTRODES * MAX_ELECTRODES;
/// Longest packet before COBS: head, frame head, the longest scope, 1024 readings of 16 bits, CRC.
pub const MAX_PACKET: usize = 1 + frame::HEAD_BYTES + scope::MAX_SCOPE_BYTES + 2 * MAX_READINGS + CRC_BYTES;
/// Longest packet on the wire, with COBS overhead (one byte in 254, at least one) and the closing zero.
pub const MAX_WIRE: usize = wire_bytes(MAX_PACKET);
/// Longest command on the wire; a board's receive buffer needs no more: head, tag, number of the command, a plan (length and grounds, mask, two
/// bytes), CRC. It fits the receive FIFO of a UART of 128 bytes.
pub const MAX_COMMAND: usize = wire_bytes(1 + 1 + 1 + (1 + MAX_PLAN_ROWS + 5 + 2) + CRC_BYTES);
/// Bytes of the closing checksum.
pub const CRC_BYTES: usize = 4;

/// Wire bytes of a packet of `packet` bytes: COBS overhead and the closing zero included, in the worst case.
pub const fn wire_bytes(packet: usize) -> usize {
    packet + cobs::overhead(packet) + 1
}

/// A table of 1 kB, or of 16 kB that is several times as fast.
#[cfg(not(feature = "fast-crc"))]
type CrcTable = crc::Table<1>;
#[cfg(feature = "fast-crc")]
type CrcTable = crc::Table<16>;

static CRC: crc::Crc<u32, CrcTable> = crc::Crc::<u32, CrcTable>::new(&crc::CRC_32_ISO_HDLC);
