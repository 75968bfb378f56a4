//! What board and host say to each other.

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

use crate::contacts::{Contacts, Output, TablePiece, TableState};
use crate::frame::Frame;
use crate::{MAX_ELECTRODES, MIN_ELECTRODES, Plan, coding};

/// Most [ranges](Range) of a board.
pub const MAX_RANGES: usize = 4;

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
    /// [`Frame`], board to host, as the [differences](crate::coded) from another.
    CodedFrame = 4,
    /// [`Contacts`], board to host.
    Contacts = 5,
    /// [`Clock`], board to host.
    Clock = 6,
    /// [`TableState`], board to host.
    Table = 7,
    /// [`Request`], host to board.
    Command = 8,
}

impl Kind {
    pub(crate) fn from_bits(bits: u8) -> Option<Self> {
        let all = [
            Self::Hello,
            Self::Frame,
            Self::Log,
            Self::Fault,
            Self::CodedFrame,
            Self::Contacts,
            Self::Clock,
            Self::Table,
            Self::Command,
        ];
        all.into_iter().find(|kind| *kind as u8 == bits)
    }
}

/// Board to host.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "a frame is the common case, and there is no allocator to box it")]
pub enum BoardMessage {
    /// Who the board is; the answer to every command, and sent once after a reset.
    Hello(Hello),
    /// One scan.
    Frame(Frame),
    /// Bytes of the board's defmt stream.
    Log(Log),
    /// Something went wrong on the board.
    Fault(Fault),
    /// What the board's clock showed when it obeyed a command.
    Clock(Clock),
    /// The contacts of one scan.
    Contacts(Contacts),
    /// What the board has of a table.
    Table(TableState),
}

/// Who the board is, what its readings mean, and what it does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// Tag of the command that this answers; 0 if nobody asked: the board has just started.
    pub answers: u8,
    /// Version of the firmware, such as `0.1.0`.
    #[serde(deserialize_with = "coding::text")]
    pub firmware_version: String<24>,
    /// Name of the board, such as `esp32`.
    #[serde(deserialize_with = "coding::text")]
    pub board: String<24>,
    /// Electrodes scanned; a whole frame has its square of readings.
    pub electrodes: u8,
    /// Bits of one conversion.
    pub adc_bits: u8,
    /// Reading `2^adc_bits` stands for this many millivolts (mV).
    pub adc_full_scale_mv: u16,
    /// Voltage of the driving layer (mV).
    pub drive_mv: u16,
    /// Settings in force.
    pub settings: Settings,
    /// Whether the board sends frames.
    pub is_streaming: bool,
    /// What the converters can see, from electrode 0 on.
    #[serde(deserialize_with = "coding::list")]
    pub ranges: Vec<Range, MAX_RANGES>,
}

/// What a converter can see: a run of electrodes that share one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Range {
    /// Electrodes of the run.
    pub electrodes: u8,
    /// At this code of one conversion, or below, a reading says only that the voltage is at most that. A converter that sees down to zero
    /// has 0.
    pub floor: u16,
    /// At this code, or above, it says only that the voltage is at least that.
    pub ceiling: u16,
    /// How far its readings are from the voltages.
    pub errors: ConverterErrors,
}

/// How far a converter's readings are from the voltages, as standard deviations; 0 is not known, or little.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ConverterErrors {
    /// Of one conversion, by noise (uV).
    pub noise_uv: u16,
    /// Of its gain, from chip to chip, after calibration (millionths).
    pub gain_ppm: u16,
    /// Of its non-linearity, from chip to chip, after calibration: the height of a bow over its range (uV).
    pub bow_uv: u16,
}

impl Range {
    /// The range of a converter of `adc_bits` (1 to 16) all of whose codes count.
    pub const fn of_codes(electrodes: u8, adc_bits: u8) -> Self {
        let errors = ConverterErrors { noise_uv: 0, gain_ppm: 0, bow_uv: 0 };
        Self { electrodes, floor: 0, ceiling: ((1u32 << adc_bits) - 1) as u16, errors }
    }
}

#[cfg(feature = "test-support")]
impl Hello {
    /// What a board with an ESP32 says, of so many electrodes: 12 bits of 3.3 V, a drive of 2 V. For tests.
    pub fn example(electrodes: u8) -> Self {
        Self {
            answers: 0,
            firmware_version: "0.1.0".try_into().unwrap_or_default(),
            board: "test".try_into().unwrap_or_default(),
            electrodes,
            adc_bits: 12,
            adc_full_scale_mv: 3300,
            drive_mv: 2000,
            settings: Settings::default(),
            is_streaming: false,
            ranges: [Range::of_codes(electrodes, 12)].into_iter().collect(),
        }
    }
}

impl Hello {
    /// Whether the values are within the protocol's limits: 4 to 32 electrodes, 1 to 16 bits, voltages above zero,
    /// [settings](Settings::is_valid) that a board may take, and ranges of at least one electrode that sum up to all of them, each with its
    /// floor below its ceiling and that among the codes.
    pub fn is_valid(&self) -> bool {
        (MIN_ELECTRODES..=MAX_ELECTRODES).contains(&usize::from(self.electrodes))
            && (1..=16).contains(&self.adc_bits)
            && self.adc_full_scale_mv > 0
            && self.drive_mv > 0
            && self.settings.is_valid()
            && self.has_valid_ranges()
    }

    fn has_valid_ranges(&self) -> bool {
        let codes = 1u32 << self.adc_bits;
        let is_valid =
            |range: &Range| range.electrodes > 0 && range.floor < range.ceiling && u32::from(range.ceiling) < codes;
        let electrodes: u32 = self.ranges.iter().map(|range| u32::from(range.electrodes)).sum();
        electrodes == u32::from(self.electrodes) && self.ranges.iter().all(is_valid)
    }

    /// What the converter of an electrode can see; `None` if there is no such electrode.
    pub fn range_of(&self, electrode: u8) -> Option<Range> {
        let mut end = 0u32;
        let holds = |range: &&Range| {
            end += u32::from(range.electrodes);
            u32::from(electrode) < end
        };
        self.ranges.iter().find(holds).copied()
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
    /// Wait between bringing an electrode to the converter and its first conversion, in microseconds (us). A board on which every electrode has
    /// an input of its own does not wait. 0 to 10000.
    pub select_us: u16,
    /// Conversions of each electrode in each row that are thrown away before those that count: 0 to 15.
    pub discarded: u8,
}

impl Settings {
    /// Largest [`average_log2`](Self::average_log2) that a board accepts.
    pub const MAX_AVERAGE_LOG2: u8 = 8;
    /// Largest [`discarded`](Self::discarded) that a board accepts.
    pub const MAX_DISCARDED: u8 = 15;
    /// Longest [`select_us`](Self::select_us) that a board accepts (us): nine time constants of 228 pF behind 5 megohm.
    pub const MAX_SELECT_US: u16 = 10_000;

    /// Whether a board may take these settings.
    pub fn is_valid(&self) -> bool {
        self.average_log2 <= Self::MAX_AVERAGE_LOG2
            && self.select_us <= Self::MAX_SELECT_US
            && self.discarded <= Self::MAX_DISCARDED
    }

    /// Conversions averaged into one reading.
    pub fn conversions(&self) -> u32 {
        1 << u32::from(self.average_log2.min(Self::MAX_AVERAGE_LOG2))
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self { settle_us: 20, average_log2: 0, max_frames_per_s: 0, select_us: 0, discarded: 0 }
    }
}

/// Bytes of the board's defmt stream, in order. A gap is possible when the link is slow.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Log(pub Vec<u8, MAX_LOG>);

/// What the board's clock showed between the arrival of a command and its [`Hello`]: so its host, which knows when it sent the one and got the other,
/// knows what its own clock showed then. It comes just before the Hello that answers the command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clock {
    /// Tag of the command.
    pub answers: u8,
    /// Board time, as [frames](crate::FrameHead) have it, in microseconds (us), modulo 2^32.
    pub time_us: u32,
}

/// Something went wrong on the board.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Fault {
    /// The firmware panicked before the last reset, here (file, line, message).
    Panic(#[serde(deserialize_with = "coding::text")] String<96>),
    /// The chip restarted by itself: watchdog, brown-out, and so on.
    Reset(#[serde(deserialize_with = "coding::text")] String<24>),
    /// No conversion finished in time in a whole frame: is the ADC stuck?
    AdcStuck,
    /// A command with settings out of range; the old ones stay.
    BadSettings {
        /// Tag of the command.
        answers: u8,
    },
    /// A command in another version of the protocol; the board speaks the one in this packet's head.
    UnknownVersion(u8),
    /// A command with a plan that this board cannot scan; the old one stays.
    BadPlan {
        /// Tag of the command.
        answers: u8,
    },
    /// A command with a rate that the board's line cannot be set to; the old one stays.
    BadRate {
        /// Tag of the command.
        answers: u8,
    },
    /// A command that takes a table which the board does not have, or a piece of one that it cannot take.
    NoTable {
        /// Tag of the command.
        answers: u8,
    },
    /// Wires of these electrodes are broken: contacts are found without them.
    BrokenWires {
        /// A bit each, the lowest for electrode 0.
        electrodes: u32,
    },
}

/// Host to board: a command, and a tag by which the answer names it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Request {
    /// 1 to 255, as the host likes.
    pub tag: u8,
    /// What the board is to do.
    pub command: Command,
}

/// What a board is to do. It answers each with [`Hello`], which names the tag, or with [`Fault::BadSettings`], [`Fault::BadPlan`],
/// [`Fault::BadRate`] or [`Fault::NoTable`]; so a host can repeat a command until it is answered, and the repetition changes nothing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Command {
    /// Asks for [`Hello`].
    Hello,
    /// Starts the stream of frames.
    Start,
    /// Stops it, and abandons the frame under way.
    Stop,
    /// Changes the settings, and abandons the frame under way.
    Configure(Settings),
    /// Changes the rows that are scanned, and abandons the frame under way.
    Scan(Plan),
    /// Sets the line to another rate on trial, or confirms the one that is on trial, as `docs/protocol.md` has it.
    Rate {
        /// Bits a second on the line.
        baud: u32,
    },
    /// Chooses what is streamed. Contacts take a table.
    Output(Output),
    /// Takes a piece of a table.
    Table(TablePiece),
}
