//! What board and host say to each other.

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

use crate::frame::Frame;
use crate::{MAX_ELECTRODES, MIN_ELECTRODES};

/// Most defmt bytes in one [`Log`] packet.
pub const MAX_LOG: usize = 64;

/// What a packet carries: the low four bits of its head.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// [`Hello`], board to host.
    Hello = 0,
    /// [`Frame`], board to host.
    Frame = 1,
    /// [`Log`], board to host.
    Log = 2,
    /// [`Fault`], board to host.
    Fault = 3,
    /// [`Command`], host to board.
    Command = 8,
}

impl Kind {
    pub(crate) fn from_bits(bits: u8) -> Option<Self> {
        [Self::Hello, Self::Frame, Self::Log, Self::Fault, Self::Command].into_iter().find(|kind| *kind as u8 == bits)
    }
}

/// Board to host.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "a frame is the common case, and there is no allocator to box it")]
pub enum BoardMessage {
    /// Who the board is; the answer to [`Command::Hello`], and sent once after a reset.
    Hello(Hello),
    /// One scan.
    Frame(Frame),
    /// Bytes of the board's defmt stream.
    Log(Log),
    /// Something went wrong on the board.
    Fault(Fault),
}

/// Who the board is and what its readings mean. The protocol version is in the head of this and every packet.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// Version of the firmware, such as `0.1.0`.
    pub firmware_version: String<24>,
    /// Name of the board, such as `esp32`.
    pub board: String<24>,
    /// Electrodes scanned; a frame has its square of readings.
    pub electrodes: u8,
    /// Bits of one conversion.
    pub adc_bits: u8,
    /// Reading `2^adc_bits` stands for this many millivolts (mV).
    pub adc_full_scale_mv: u16,
    /// Voltage of the driving layer (mV).
    pub drive_mv: u16,
    /// Settings in force.
    pub settings: Settings,
}

#[cfg(feature = "test-support")]
impl Hello {
    /// What a board with an ESP32 says, of so many electrodes: 12 bits of 3.3 V, a drive of 2 V. For tests.
    pub fn example(electrodes: u8) -> Self {
        Self {
            firmware_version: "0.1.0".try_into().unwrap_or_default(),
            board: "test".try_into().unwrap_or_default(),
            electrodes,
            adc_bits: 12,
            adc_full_scale_mv: 3300,
            drive_mv: 2000,
            settings: Settings::default(),
        }
    }
}

impl Hello {
    /// Whether the values are within the protocol's limits: 4 to 32 electrodes, 1 to 16 bits, voltages above zero,
    /// [settings](Settings::is_valid) that a board may take.
    pub fn is_valid(&self) -> bool {
        (MIN_ELECTRODES..=MAX_ELECTRODES).contains(&usize::from(self.electrodes))
            && (1..=16).contains(&self.adc_bits)
            && self.adc_full_scale_mv > 0
            && self.drive_mv > 0
            && self.settings.is_valid()
    }
}

/// Settings of the scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// Wait between grounding an electrode and its first conversion, in microseconds (us).
    pub settle_us: u16,
    /// Base-2 logarithm of the conversions averaged into one reading: 0 to 8, so 1 to 256 conversions.
    pub average_log2: u8,
    /// Frames a second at most; 0 means as fast as the board can.
    pub max_frames_per_s: u16,
}

impl Settings {
    /// Largest [`average_log2`](Self::average_log2) that a board accepts.
    pub const MAX_AVERAGE_LOG2: u8 = 8;

    /// Whether a board may take these settings.
    pub fn is_valid(&self) -> bool {
        self.average_log2 <= Self::MAX_AVERAGE_LOG2
    }

    /// Conversions averaged into one reading.
    pub fn conversions(&self) -> u32 {
        1 << u32::from(self.average_log2.min(Self::MAX_AVERAGE_LOG2))
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self { settle_us: 20, average_log2: 0, max_frames_per_s: 0 }
    }
}

/// Bytes of the board's defmt stream, in order. A gap is possible when the link is slow.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Log(pub Vec<u8, MAX_LOG>);

/// Something went wrong on the board.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Fault {
    /// The firmware panicked before the last reset, here (file, line).
    Panic(String<96>),
    /// The chip restarted by itself: watchdog, brown-out, and so on.
    Reset(String<24>),
    /// No conversion finished in time in a whole frame: is the ADC stuck?
    AdcStuck,
    /// A command with settings out of range; the old ones stay.
    BadSettings,
    /// A command in another version of the protocol; the board speaks the one in this packet's head.
    UnknownVersion(u8),
}

/// Host to board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Command {
    /// Asks for [`Hello`].
    Hello,
    /// Starts the stream of frames.
    Start,
    /// Stops it.
    Stop,
    /// Changes the settings; the board answers with [`Hello`].
    Configure(Settings),
}
