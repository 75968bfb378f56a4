//! The wire between a tomographic tactile sensor board and its host.
//!
//! A *packet* is one message. On the wire it is COBS-encoded and ends with a zero byte, so a receiver that joins in the
//! middle, or gets noise or boot text, waits for the next zero and goes on. Inside:
//!
//! | bytes | what |
//! |---|---|
//! | 1 | head: protocol version in the high four bits, [kind](Kind) in the low four |
//! | n | body: postcard, or for a frame the layout of [`frame`] |
//! | 4 | CRC-32 (ISO-HDLC, as in zlib) of head and body, little-endian |
//!
//! Only head, CRC and COBS are promised to every future version: that is enough for a receiver to recognise a newer peer
//! and to refuse it by name instead of misreading it.
#![no_std]

#[cfg(test)]
extern crate std;

mod cobs;
pub mod decode;
pub mod encode;
pub mod frame;
pub mod message;

pub use decode::{BoardReceiver, CommandReceiver, Counters, DecodeError, Receiver};
pub use encode::{EncodeError, encode_board, encode_command, encode_frame, encode_log};
pub use frame::{Frame, FrameHead, Status};
pub use message::{BoardMessage, Command, Fault, Hello, Kind, Log, MAX_LOG, Settings};

/// Version of the protocol that this crate speaks: 1 to 15.
pub const VERSION: u8 = 1;
/// Most electrodes that a frame can carry.
pub const MAX_ELECTRODES: usize = 32;
/// Fewest electrodes that a frame can carry (fewer would make a frame's length ambiguous).
pub const MIN_ELECTRODES: usize = 4;
/// Most readings in a frame: every electrode under every ground.
pub const MAX_READINGS: usize = MAX_ELECTRODES * MAX_ELECTRODES;
/// Longest packet before COBS: head, frame head, 1024 readings of 16 bits, CRC.
pub const MAX_PACKET: usize = 1 + frame::HEAD_BYTES + 2 * MAX_READINGS + CRC_BYTES;
/// Longest packet on the wire, with COBS overhead (one byte in 254, at least one) and the closing zero.
pub const MAX_WIRE: usize = wire_bytes(MAX_PACKET);
/// Longest command on the wire; a board's receive buffer needs no more.
pub const MAX_COMMAND: usize = 32;
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
