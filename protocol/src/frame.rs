//! A frame's body: a fixed head of eight bytes, what it holds, then the readings packed at the width of the largest.
//!
//! | bytes | what |
//! |---|---|
//! | 2 | sequence number, little-endian, wraps |
//! | 4 | board time in the middle of the scan in microseconds, little-endian, wraps |
//! | 1 | [status bits](Status) (low four), scans that are [folded](FrameHead::folded) in (high four) |
//! | 1 | width of a reading in bits less one (low four), fraction bits (high four) |
//! | 2 and up | which readings it holds: its [scope](crate::Scope) |
//! | rest | readings, row by row, least significant bit first, no gaps; the last byte is filled with zeros |
//!
//! A whole frame of 16 x 16 readings of 12 bits takes at most 402 bytes on the wire.

use heapless::Vec;

use crate::{MAX_READINGS, Scope};

/// Bytes before the scope.
pub const HEAD_BYTES: usize = 8;

/// One scan, or the rows of a [plan](crate::Plan) that make a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Everything but the scope and the readings.
    pub head: FrameHead,
    /// Which readings these are; its [cells](Scope::cells) are in their order.
    pub scope: Scope,
    /// Row by row; a unit is `adc_full_scale / 2^(adc_bits + fraction_bits)`.
    pub readings: Vec<u16, MAX_READINGS>,
}

/// Everything of a frame but its scope and its readings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameHead {
    /// Number of the frame among those that were sent, modulo 65536: what is missing was lost on the way.
    pub sequence: u16,
    /// Board time in the middle of the scan, or of all that are [folded](Self::folded) into it, in microseconds (us), modulo 2^32.
    pub time_us: u32,
    /// What happened during the scan.
    pub status: Status,
    /// The readings are the mean of this scan and of so many more, that had no place on the line: 0 to 15.
    pub folded: u8,
    /// Bits below one ADC code that averaging has won: 0 to 15.
    pub fraction_bits: u8,
}

/// Status bits of a scan. Bits without a name are sent as zero, and a receiver drops them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status(pub u8);

impl Status {
    /// A conversion was at the ceiling of its electrode's [range](crate::Range), or above.
    pub const SATURATED: Self = Self(1);
    /// A conversion did not finish in time; its reading is zero.
    pub const TIMED_OUT: Self = Self(2);
    /// The bits that have a name.
    const NAMED: u8 = Self::SATURATED.0 | Self::TIMED_OUT.0;

    /// Whether all bits of `other` are set.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Sets the bits of `other`.
    pub fn insert(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

impl FrameHead {
    /// Most scans that can be [folded](Self::folded) into another.
    pub const MOST_FOLDED: u8 = 15;

    /// The head as bytes; `bits` tells how readings are packed or coded, 0 to 15.
    pub(crate) fn to_bytes(self, bits: u32) -> [u8; HEAD_BYTES] {
        let [s0, s1] = self.sequence.to_le_bytes();
        let [t0, t1, t2, t3] = self.time_us.to_le_bytes();
        let shape = bits as u8 | self.fraction_bits << 4;
        let status = self.status.0 & Status::NAMED | self.folded.min(FrameHead::MOST_FOLDED) << 4;
        [s0, s1, t0, t1, t2, t3, status, shape]
    }

    /// The head, and how readings are packed or coded.
    pub(crate) fn from_bytes([s0, s1, t0, t1, t2, t3, status, shape]: [u8; HEAD_BYTES]) -> (Self, u32) {
        let head = Self {
            sequence: u16::from_le_bytes([s0, s1]),
            time_us: u32::from_le_bytes([t0, t1, t2, t3]),
            status: Status(status & Status::NAMED),
            folded: status >> 4,
            fraction_bits: shape >> 4,
        };
        (head, u32::from(shape & 15))
    }
}

/// Bits that the largest reading needs, at least one.
pub(crate) fn width(readings: &[u16]) -> u32 {
    let all = readings.iter().fold(1, |bits, reading| bits | reading);
    u16::BITS - all.leading_zeros()
}

/// Bytes that `count` readings of `width` bits take.
pub(crate) fn packed_bytes(width: u32, count: usize) -> usize {
    (count * width as usize).div_ceil(8)
}

/// Packs the readings at `width` bits into `packed`, which has just room for them.
pub(crate) fn pack(readings: &[u16], width: u32, packed: &mut [u8]) {
    let mut readings = readings.iter();
    let (mut bits, mut held) = (0u32, 0);
    for byte in packed {
        while held < 8
            && let Some(&reading) = readings.next()
        {
            bits |= u32::from(reading) << held;
            held += width;
        }
        *byte = bits as u8;
        bits >>= 8;
        held = held.saturating_sub(8);
    }
}

/// Unpacks `count` readings of `width` bits; `None` unless this is the one form that [`pack`] gives them: the width is that
/// of the largest, the spare bits at the end are zero.
pub(crate) fn unpack(packed: &[u8], width: u32, count: usize) -> Option<Vec<u16, MAX_READINGS>> {
    let mask = (1u32 << width) - 1;
    let mut readings = Vec::new();
    readings.resize_default(count.next_multiple_of(4)).ok()?;
    // Four readings start at a whole byte or at half of one: eight bytes hold them at any width.
    for (group, readings) in readings.as_chunks_mut::<4>().0.iter_mut().enumerate() {
        let mut bits = bits_from(packed, 4 * group * width as usize);
        for reading in readings {
            *reading = (bits as u32 & mask) as u16;
            bits >>= width;
        }
    }
    readings.truncate(count);
    let spare = bits_from(packed, count * width as usize);
    (spare == 0 && self::width(&readings) == width).then_some(readings)
}

/// The bits from number `bit` to the end of the eighth byte from there, zeros after the end of `bytes`.
fn bits_from(bytes: &[u8], bit: usize) -> u64 {
    let bytes = bytes.get(bit / 8..).unwrap_or_default();
    let word = match bytes.first_chunk() {
        Some(eight) => u64::from_le_bytes(*eight),
        None => bytes.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte)),
    };
    word >> (bit % 8)
}
