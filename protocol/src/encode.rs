//! Messages to wire bytes.

use cobs::CobsEncoder;
use serde::Serialize;

use crate::frame::{self, FrameHead};
use crate::message::{BoardMessage, Command, Kind};
use crate::{CRC, MAX_ELECTRODES, MAX_LOG, MIN_ELECTRODES, VERSION};

/// Longest postcard body: a [`Fault`](crate::Fault) with the longest text, with room to spare.
const MAX_BODY: usize = 128;

/// A message that cannot be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EncodeError {
    /// The output is too short for the message.
    #[error("the output buffer is too short for the message")]
    Full,
    /// The readings are not the square of 4 to 32 electrodes.
    #[error("{0} readings are not the square of 4 to 32 electrodes")]
    ReadingCount(usize),
    /// More than [`MAX_LOG`] bytes of log in one packet.
    #[error("{0} bytes of log do not fit one packet")]
    LogLength(usize),
}

/// Encodes a board's message into `out`, the closing zero included; returns its length in bytes.
///
/// # Errors
/// [`EncodeError`] if `out` is too short or the message breaks a limit of the protocol.
pub fn encode_board(message: &BoardMessage, out: &mut [u8]) -> Result<usize, EncodeError> {
    match message {
        BoardMessage::Hello(hello) => encode_body(Kind::Hello, hello, out),
        BoardMessage::Frame(frame) => encode_frame(frame.head, &frame.readings, out),
        BoardMessage::Log(log) => encode_log(&log.0, out),
        BoardMessage::Fault(fault) => encode_body(Kind::Fault, fault, out),
    }
}

/// Encodes a command into `out` ([`MAX_COMMAND`](crate::MAX_COMMAND) bytes suffice); returns its length in bytes.
///
/// # Errors
/// [`EncodeError::Full`] if `out` is too short.
pub fn encode_command(command: &Command, out: &mut [u8]) -> Result<usize, EncodeError> {
    encode_body(Kind::Command, command, out)
}

/// Encodes a frame into `out` straight from its readings; returns its length in bytes.
///
/// # Errors
/// [`EncodeError`] if `out` is too short or the readings are not a square.
pub fn encode_frame(head: FrameHead, readings: &[u16], out: &mut [u8]) -> Result<usize, EncodeError> {
    if !(MIN_ELECTRODES..=MAX_ELECTRODES).any(|n| n * n == readings.len()) {
        return Err(EncodeError::ReadingCount(readings.len()));
    }
    let width = frame::width(readings);
    write(Kind::Frame, out, |packet| {
        packet.put(&head.to_bytes(width));
        frame::pack(readings, width, |byte| packet.put(&[byte]));
    })
}

/// Encodes bytes of the defmt stream into `out`; returns the packet's length in bytes.
///
/// # Errors
/// [`EncodeError`] if `out` is too short or `bytes` too long.
pub fn encode_log(bytes: &[u8], out: &mut [u8]) -> Result<usize, EncodeError> {
    if bytes.len() > MAX_LOG {
        return Err(EncodeError::LogLength(bytes.len()));
    }
    write(Kind::Log, out, |packet| packet.put(bytes))
}

fn encode_body(kind: Kind, body: &impl Serialize, out: &mut [u8]) -> Result<usize, EncodeError> {
    let mut buffer = [0; MAX_BODY];
    let body = postcard::to_slice(body, &mut buffer).map_err(|_| EncodeError::Full)?;
    write(kind, out, |packet| packet.put(body))
}

/// Writes a whole packet, whose body `fill` puts; returns its length in bytes, the closing zero included.
fn write(kind: Kind, out: &mut [u8], fill: impl FnOnce(&mut Packet)) -> Result<usize, EncodeError> {
    let mut packet = Packet { cobs: CobsEncoder::new(out), crc: CRC.digest(), fits: true };
    packet.put(&[VERSION << 4 | kind as u8]);
    fill(&mut packet);
    let length = packet.finish()?;
    *out.get_mut(length).ok_or(EncodeError::Full)? = 0;
    Ok(length + 1)
}

/// A packet being written: COBS and CRC on the fly, so that no second buffer is needed.
struct Packet<'a> {
    cobs: CobsEncoder<'a>,
    crc: crc::Digest<'static, u32>,
    fits: bool,
}

impl Packet<'_> {
    fn put(&mut self, bytes: &[u8]) {
        self.crc.update(bytes);
        self.push(bytes);
    }

    fn push(&mut self, bytes: &[u8]) {
        self.fits = self.fits && self.cobs.push(bytes).is_ok();
    }

    /// Adds the checksum; returns the length in bytes without the closing zero.
    fn finish(mut self) -> Result<usize, EncodeError> {
        let crc = self.crc.clone().finalize().to_le_bytes();
        self.push(&crc);
        if self.fits { Ok(self.cobs.finalize()) } else { Err(EncodeError::Full) }
    }
}
