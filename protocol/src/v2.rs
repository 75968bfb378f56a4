//! Version 2 of the protocol, as far as hosts still need it: recordings of then, and boards whose firmware is older.
//!
//! Its settings ended with the frame rate: a board's wait after it had brought an electrode to its converter was a constant, and every conversion
//! counted. All else was the same.

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

use crate::decode::{DecodeError, from_postcard};
use crate::encode::{EncodeError, encode_body};
use crate::message::{self, Kind, MAX_RANGES, Range};
use crate::{Plan, Request, coding};

/// The number of this version.
pub(crate) const VERSION: u8 = 2;

/// Settings of versions 1 and 2.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Settings {
    settle_us: u16,
    average_log2: u8,
    max_frames_per_s: u16,
}

impl From<Settings> for message::Settings {
    fn from(Settings { settle_us, average_log2, max_frames_per_s }: Settings) -> Self {
        Self { settle_us, average_log2, max_frames_per_s, select_us: 0, discarded: 0 }
    }
}

impl Settings {
    /// # Errors
    /// [`EncodeError::NotInVersion`] if the settings say what this `version` has no word for.
    pub(crate) fn of(settings: &message::Settings, version: u8) -> Result<Self, EncodeError> {
        let message::Settings { settle_us, average_log2, max_frames_per_s, select_us, discarded } = *settings;
        if (select_us, discarded) != (0, 0) {
            return Err(EncodeError::NotInVersion(version));
        }
        Ok(Self { settle_us, average_log2, max_frames_per_s })
    }
}

#[derive(Serialize, Deserialize)]
struct Hello {
    answers: u8,
    #[serde(deserialize_with = "coding::text")]
    firmware_version: String<24>,
    #[serde(deserialize_with = "coding::text")]
    board: String<24>,
    electrodes: u8,
    adc_bits: u8,
    adc_full_scale_mv: u16,
    drive_mv: u16,
    settings: Settings,
    is_streaming: bool,
    #[serde(deserialize_with = "coding::list")]
    ranges: Vec<Range, MAX_RANGES>,
}

#[derive(Serialize)]
struct Tagged<'a> {
    tag: u8,
    command: Command<'a>,
}

#[derive(Serialize)]
enum Command<'a> {
    Hello,
    Start,
    Stop,
    Configure(Settings),
    Scan(&'a Plan),
}

/// Reads a Hello, whose values are still to be checked.
pub(crate) fn hello(body: &[u8]) -> Result<message::Hello, DecodeError> {
    let old: Hello = from_postcard(body)?;
    Ok(message::Hello {
        version: VERSION,
        answers: old.answers,
        firmware_version: old.firmware_version,
        board: old.board,
        electrodes: old.electrodes,
        adc_bits: old.adc_bits,
        adc_full_scale_mv: old.adc_full_scale_mv,
        drive_mv: old.drive_mv,
        settings: old.settings.into(),
        is_streaming: old.is_streaming,
        ranges: old.ranges,
    })
}

/// Encodes a Hello of a board of this version, for recordings.
pub(crate) fn encode_hello(hello: &message::Hello, out: &mut [u8]) -> Result<usize, EncodeError> {
    let settings = Settings::of(&hello.settings, VERSION)?;
    let message::Hello { answers, firmware_version, board, electrodes, adc_bits, ranges, is_streaming, .. } =
        hello.clone();
    let (adc_full_scale_mv, drive_mv) = (hello.adc_full_scale_mv, hello.drive_mv);
    let old = Hello {
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
    };
    encode_body(VERSION, Kind::Hello, &old, out)
}

/// Encodes a command and its tag.
pub(crate) fn encode_request(request: &Request, out: &mut [u8]) -> Result<usize, EncodeError> {
    let command = match &request.command {
        message::Command::Hello => Command::Hello,
        message::Command::Start => Command::Start,
        message::Command::Stop => Command::Stop,
        message::Command::Configure(settings) => Command::Configure(Settings::of(settings, VERSION)?),
        message::Command::Scan(plan) => Command::Scan(plan),
    };
    encode_body(VERSION, Kind::Command, &Tagged { tag: request.tag, command }, out)
}
