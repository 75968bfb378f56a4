//! Messages to wire bytes.
//!
//! A packet is laid out at the back of the output, closed with its checksum, and stuffed towards the front: three passes,
//! no second buffer. An output of [`wire_bytes`] of the packet's length always suffices, and [`MAX_WIRE`](crate::MAX_WIRE)
//! for any message.

use serde::Serialize;

use crate::coded::{AGE_BYTES, Keys};
use crate::contacts::Contacts;
use crate::frame::{self, FrameHead, HEAD_BYTES};
use crate::message::{BoardMessage, Kind, Request};
use crate::{CRC, CRC_BYTES, MAX_ELECTRODES, MAX_LOG, MIN_ELECTRODES, Scope, VERSION, cobs, wire_bytes};

/// Longest postcard body with room to spare; a [`Fault`](crate::Fault) with the longest text takes 98 bytes, a request 106.
const MAX_BODY: usize = 160;

/// A message that cannot be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The output is too short for the message.
    #[error("the output buffer is too short for the message")]
    Full,
    /// The readings are not the square of 4 to 32 electrodes.
    #[error("{0} readings are not the square of 4 to 32 electrodes")]
    ReadingCount(usize),
    /// The scope holds another number of readings.
    #[error("{found} readings, but the frame's scope holds {expected}")]
    ScopeReadings {
        /// Readings given.
        found: usize,
        /// Readings that the scope holds.
        expected: usize,
    },
    /// More than 15 fraction bits.
    #[error("{0} fraction bits, but a frame has room for 15 at most")]
    FractionBits(u8),
    /// More than [`MAX_LOG`] bytes of log in one packet.
    #[error("{0} bytes of log do not fit one packet")]
    LogLength(usize),
    /// A [`Hello`](crate::Hello) that [is not valid](crate::Hello::is_valid).
    #[error("a value of Hello is out of range")]
    Hello,
    /// The tag 0, which means that nobody asked.
    #[error("a command needs a tag other than 0")]
    Tag,
    /// A contact with the number 0.
    #[error("a contact needs a number other than 0")]
    ContactNumber,
}

/// Encodes a board's message into `out`, the closing zero included; returns its length in bytes.
///
/// # Errors
/// [`EncodeError`] if `out` is too short or the message breaks a limit of the protocol.
pub fn encode_board(message: &BoardMessage, out: &mut [u8]) -> Result<usize, EncodeError> {
    match message {
        BoardMessage::Hello(hello) if !hello.is_valid() => Err(EncodeError::Hello),
        BoardMessage::Hello(hello) => encode_body(Kind::Hello, hello, out),
        BoardMessage::Frame(frame) => encode_rows(frame.head, &frame.scope, &frame.readings, out),
        BoardMessage::Log(log) => encode_log(&log.0, out),
        BoardMessage::Clock(clock) => encode_body(Kind::Clock, clock, out),
        BoardMessage::Contacts(contacts) => encode_contacts(contacts, out),
        BoardMessage::Table(state) => encode_body(Kind::Table, state, out),
        BoardMessage::Fault(fault) => encode_body(Kind::Fault, fault, out),
    }
}

/// Encodes a command into `out` ([`MAX_COMMAND`](crate::MAX_COMMAND) bytes suffice); returns its length in bytes.
///
/// # Errors
/// [`EncodeError::Full`] if `out` is too short, [`EncodeError::Tag`] if the tag is 0.
pub fn encode_request(request: &Request, out: &mut [u8]) -> Result<usize, EncodeError> {
    if request.tag == 0 {
        return Err(EncodeError::Tag);
    }
    encode_body(Kind::Command, request, out)
}

/// Encodes a whole frame into `out` straight from its readings; returns its length in bytes.
///
/// # Errors
/// [`EncodeError`] if `out` is too short, the readings are not a square, or there are too many fraction bits.
pub fn encode_frame(head: FrameHead, readings: &[u16], out: &mut [u8]) -> Result<usize, EncodeError> {
    let electrodes = (MIN_ELECTRODES..=MAX_ELECTRODES).find(|n| n * n == readings.len());
    let scope = electrodes.and_then(|electrodes| Scope::whole(electrodes as u8));
    encode_rows(head, &scope.ok_or(EncodeError::ReadingCount(readings.len()))?, readings, out)
}

/// Encodes a frame that holds what `scope` says into `out`; returns its length in bytes.
///
/// # Errors
/// [`EncodeError`] if `out` is too short, there are more or fewer readings, or too many fraction bits.
pub fn encode_rows(head: FrameHead, scope: &Scope, readings: &[u16], out: &mut [u8]) -> Result<usize, EncodeError> {
    check(head, scope, readings)?;
    let width = frame::width(readings);
    let length = HEAD_BYTES + scope.byte_count() + frame::packed_bytes(width, readings.len());
    write(Kind::Frame, length, out, |body| {
        let (start, rest) = body.split_at_mut(HEAD_BYTES);
        start.copy_from_slice(&head.to_bytes(width - 1));
        frame::pack(readings, width, scope.write(rest));
    })
}

/// Encodes a frame into `out` as its differences from its [key](crate::coded), if that takes less than three quarters of what it is packed; else as
/// [`encode_rows`], and remembers it as a key. Returns the packet's length in bytes.
///
/// # Errors
/// As of [`encode_rows`].
pub fn encode_keyed<const READINGS: usize>(
    head: FrameHead,
    scope: &Scope,
    readings: &[u16],
    keys: &mut Keys<READINGS>,
    out: &mut [u8],
) -> Result<usize, EncodeError> {
    check(head, scope, readings)?;
    keys.pass(&head);
    if let Some(length) = encode_coded(head, scope, readings, keys, out) {
        return Ok(length);
    }
    keys.remember(&head, scope, readings);
    encode_rows(head, scope, readings, out)
}

/// Encodes a frame as its differences; `None` if it has no key, or does not gain by them.
fn encode_coded<const READINGS: usize>(
    head: FrameHead,
    scope: &Scope,
    readings: &[u16],
    keys: &Keys<READINGS>,
    out: &mut [u8],
) -> Option<usize> {
    let age = keys.age_to_code(&head, scope)?;
    let start = cobs::overhead(out.len());
    let end = out.len().checked_sub(CRC_BYTES + 1)?;
    let (head_bytes, rest) = out.get_mut(start + 1..end)?.split_at_mut_checked(HEAD_BYTES)?;
    let (age_byte, rest) = rest.split_at_mut_checked(AGE_BYTES)?;
    let scope_bytes = scope.byte_count();
    let written = keys.write(scope, readings, rest.get_mut(scope_bytes..)?)?;
    if 4 * written.bytes >= 3 * frame::packed_bytes(written.width, readings.len()) {
        return None;
    }
    head_bytes.copy_from_slice(&head.to_bytes(written.k));
    age_byte.fill(age);
    scope.write(rest);
    Some(seal(Kind::CodedFrame, start, HEAD_BYTES + AGE_BYTES + scope_bytes + written.bytes, out))
}

/// Checks that a frame can be sent.
fn check(head: FrameHead, scope: &Scope, readings: &[u16]) -> Result<(), EncodeError> {
    let (found, expected) = (readings.len(), scope.readings());
    if found != expected {
        return Err(EncodeError::ScopeReadings { found, expected });
    }
    if head.fraction_bits > 15 {
        return Err(EncodeError::FractionBits(head.fraction_bits));
    }
    Ok(())
}

/// Encodes contacts into `out`; returns the packet's length in bytes.
///
/// # Errors
/// [`EncodeError::Full`] if `out` is too short, [`EncodeError::ContactNumber`] if a contact has the number 0.
pub fn encode_contacts(contacts: &Contacts, out: &mut [u8]) -> Result<usize, EncodeError> {
    if contacts.found.iter().any(|contact| contact.id == 0) {
        return Err(EncodeError::ContactNumber);
    }
    write(Kind::Contacts, contacts.byte_count(), out, |body| contacts.write(body))
}

/// Encodes bytes of the defmt stream into `out`; returns the packet's length in bytes.
///
/// # Errors
/// [`EncodeError`] if `out` is too short or `bytes` too long.
pub fn encode_log(bytes: &[u8], out: &mut [u8]) -> Result<usize, EncodeError> {
    if bytes.len() > MAX_LOG {
        return Err(EncodeError::LogLength(bytes.len()));
    }
    write(Kind::Log, bytes.len(), out, |body| body.copy_from_slice(bytes))
}

/// Encodes a message whose body is in postcard.
fn encode_body(kind: Kind, body: &impl Serialize, out: &mut [u8]) -> Result<usize, EncodeError> {
    let mut buffer = [0; MAX_BODY];
    let bytes = postcard::to_slice(body, &mut buffer).map_err(|_| EncodeError::Full)?;
    write(kind, bytes.len(), out, |body| body.copy_from_slice(bytes))
}

/// Writes a whole packet, whose `body` bytes `fill` writes; returns its length in bytes, the closing zero included.
fn write(kind: Kind, body: usize, out: &mut [u8], fill: impl FnOnce(&mut [u8])) -> Result<usize, EncodeError> {
    let packet = 1 + body + CRC_BYTES;
    let out = out.get_mut(..wire_bytes(packet)).ok_or(EncodeError::Full)?;
    let start = cobs::overhead(packet);
    fill(&mut out[start + 1..start + 1 + body]);
    Ok(seal(kind, start, body, out))
}

/// Makes a whole packet of the `body` bytes behind `start` and a byte more, with room for a checksum and a zero behind them; returns its length in bytes.
fn seal(kind: Kind, start: usize, body: usize, out: &mut [u8]) -> usize {
    let end = start + 1 + body + CRC_BYTES;
    let (content, crc) = out[start..end].split_at_mut(1 + body);
    content[0] = VERSION << 4 | kind as u8;
    crc.copy_from_slice(&CRC.checksum(content).to_le_bytes());
    let length = cobs::stuff(&mut out[..end], start);
    out[length] = 0;
    length + 1
}
