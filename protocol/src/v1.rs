//! Version 1 of the protocol, as far as hosts still need it: recordings of then, and boards whose firmware is older.
//!
//! Its commands had no tag and its answers named none, its frames were whole ones without a scope, its Hello had no ranges, and its settings were
//! those of version 2.
//! Head, framing, checksum, log, and the coding of values were the same.

use heapless::String;
use serde::{Deserialize, Serialize};

use crate::decode::{DecodeError, from_postcard, log};
use crate::encode::{EncodeError, encode_body};
use crate::frame::{self, Frame, FrameHead, HEAD_BYTES};
use crate::message::{self, BoardMessage, Kind, Range};
use crate::v2::Settings;
use crate::{MAX_ELECTRODES, MIN_ELECTRODES, Scope, coding};

/// The number of this version.
pub(crate) const VERSION: u8 = 1;

#[derive(Serialize, Deserialize)]
struct Hello {
    #[serde(deserialize_with = "coding::text")]
    firmware_version: String<24>,
    #[serde(deserialize_with = "coding::text")]
    board: String<24>,
    electrodes: u8,
    adc_bits: u8,
    adc_full_scale_mv: u16,
    drive_mv: u16,
    settings: Settings,
}

#[derive(Deserialize)]
enum Fault {
    Panic(#[serde(deserialize_with = "coding::text")] String<96>),
    Reset(#[serde(deserialize_with = "coding::text")] String<24>),
    AdcStuck,
    BadSettings,
    UnknownVersion(u8),
}

#[derive(Serialize)]
enum Command {
    Hello,
    Start,
    Stop,
    Configure(Settings),
}

pub(crate) fn board_message(kind: Kind, body: &[u8]) -> Result<BoardMessage, DecodeError> {
    Ok(match kind {
        Kind::Hello => BoardMessage::Hello(hello(from_postcard(body)?)?),
        Kind::Frame => BoardMessage::Frame(whole_frame(body).ok_or(DecodeError::Body)?),
        Kind::Log => BoardMessage::Log(log(body)?),
        Kind::Fault => BoardMessage::Fault(fault(from_postcard(body)?)),
        Kind::Command => return Err(DecodeError::Body),
    })
}

/// One converter reads all electrodes, and says nothing of where its scale ends before its codes do.
fn hello(old: Hello) -> Result<message::Hello, DecodeError> {
    let Hello { firmware_version, board, electrodes, adc_bits, adc_full_scale_mv, drive_mv, settings } = old;
    if !(1..=16).contains(&adc_bits) {
        return Err(DecodeError::Body);
    }
    let hello = message::Hello {
        version: VERSION,
        answers: 0,
        firmware_version,
        board,
        electrodes,
        adc_bits,
        adc_full_scale_mv,
        drive_mv,
        settings: settings.into(),
        is_streaming: false,
        ranges: [Range::of_codes(electrodes, adc_bits)].into_iter().collect(),
    };
    if hello.is_valid() { Ok(hello) } else { Err(DecodeError::Body) }
}

fn fault(old: Fault) -> message::Fault {
    match old {
        Fault::Panic(place) => message::Fault::Panic(place),
        Fault::Reset(cause) => message::Fault::Reset(cause),
        Fault::AdcStuck => message::Fault::AdcStuck,
        Fault::BadSettings => message::Fault::BadSettings { answers: 0 },
        Fault::UnknownVersion(version) => message::Fault::UnknownVersion(version),
    }
}

/// The electrode count follows from the length, which for each width fits one count only.
fn whole_frame(body: &[u8]) -> Option<Frame> {
    let (head, packed) = body.split_first_chunk::<HEAD_BYTES>()?;
    let (head, width) = FrameHead::from_bytes(*head);
    let electrodes = electrodes(width, packed.len())?;
    let readings = frame::unpack(packed, width, electrodes * electrodes)?;
    Some(Frame { head, scope: Scope::whole(electrodes as u8)?, readings })
}

/// Electrode count whose readings of `width` bits fill exactly `bytes`, if there is one.
fn electrodes(width: u32, bytes: usize) -> Option<usize> {
    (MIN_ELECTRODES..=MAX_ELECTRODES).find(|n| frame::packed_bytes(width, n * n) == bytes)
}

/// Encodes a Hello of a board of this version, for recordings.
pub(crate) fn encode_hello(hello: &message::Hello, out: &mut [u8]) -> Result<usize, EncodeError> {
    let message::Hello { electrodes, adc_bits, adc_full_scale_mv, drive_mv, .. } = *hello;
    let settings = Settings::of(&hello.settings, VERSION)?;
    let (firmware_version, board) = (hello.firmware_version.clone(), hello.board.clone());
    let old = Hello { firmware_version, board, electrodes, adc_bits, adc_full_scale_mv, drive_mv, settings };
    encode_body(VERSION, Kind::Hello, &old, out)
}

/// Encodes a command, which has no tag here.
pub(crate) fn encode_command(command: &message::Command, out: &mut [u8]) -> Result<usize, EncodeError> {
    let old = match command {
        message::Command::Hello => Command::Hello,
        message::Command::Start => Command::Start,
        message::Command::Stop => Command::Stop,
        message::Command::Configure(settings) => Command::Configure(Settings::of(settings, VERSION)?),
        message::Command::Scan(_) => return Err(EncodeError::NotInVersion(VERSION)),
    };
    encode_body(VERSION, Kind::Command, &old, out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::packed_bytes;

    #[test]
    fn a_length_fits_one_electrode_count_only() {
        for width in 1..=16 {
            for n in MIN_ELECTRODES..=MAX_ELECTRODES {
                assert_eq!(electrodes(width, packed_bytes(width, n * n)), Some(n), "width {width}");
            }
        }
    }
}
