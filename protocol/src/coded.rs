//! A coded frame's body: how its readings differ from those of a key frame, by Rice's code.
//!
//! Where nothing moves, readings differ by noise alone, and their differences take half the bits that they take themselves. A *key frame* is any
//! [frame](crate::frame) that is not coded: board and host remember of each row the last one. A coded frame names its key, so one that is lost
//! costs itself alone, unless it was a key.
//!
//! Numbers of frames begin anew after 65535. So a key is forgotten as soon as frames have gone by that it is too old for, and never looked at later,
//! when its number might be that of another one.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | as of a [frame](crate::frame), but with `k` in place of the width less one |
//! | 1 | its number less that of its key frame, 1 to 255 |
//! | 2 and up | which readings it holds: its [scope](crate::Scope) |
//! | rest | differences from the readings of the same ground and electrode in the key, in order, least significant bit first, no gaps; the last byte is filled with zeros |
//!
//! A difference `d` is sent as `z`, which is `2 d` from zero on, and `-2 d - 1` below: `z >> k` ones, a zero, and the low `k` bits of `z`
//! (Golomb 1966, Rice 1979). If those were 8 ones or more, there are 8, no zero, and all 17 bits of `z`.

use heapless::Vec;

use crate::frame::FrameHead;
use crate::scope::electrodes_of;
use crate::{MAX_ELECTRODES, MAX_READINGS, Scope};

/// Bytes of the age of a key.
pub(crate) const AGE_BYTES: usize = 1;
/// Longest time between two frames after which keys still count (us): 65536 frames, after which numbers begin anew, would have 61 us each in it, and
/// the fastest board takes longer than that for a row (docs/firmware.md).
const LONGEST_GAP_US: u32 = 4_000_000;
/// So many ones tell that the whole number follows.
const ESCAPE: u32 = 8;
/// Bits of a `z`: those of a difference of two readings of 16 bits.
const WIDEST: u32 = 17;

/// Each reading is sent as it is once in so many whole frames: whoever joins waits so long at most, and a key that is lost costs no more.
const KEY_EVERY: usize = 32;
/// Of so many differences one is in the mean that `k` follows.
const MEANT: u32 = 3;
/// Most low bits that are sent as they are: its field has four bits.
const MOST_K: u32 = 15;

/// The rows of the last key frames; room for the readings of a whole frame.
#[derive(Clone, Debug)]
pub struct Keys<const READINGS: usize> {
    electrodes: u8,
    /// Number and board time (us) of the last frame, coded or not.
    last: Option<(u16, u32)>,
    /// Ground by ground, every electrode.
    readings: [u16; READINGS],
    rows: [Option<Row>; MAX_ELECTRODES],
}

/// Of which key frame a row is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Row {
    sequence: u16,
    fraction_bits: u8,
    reads: u32,
}

/// The differences of a frame, as they were written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Written {
    /// Low bits of a difference that are sent as they are.
    pub k: u32,
    /// Bytes of all differences.
    pub bytes: usize,
    /// Bits that the largest reading needs.
    pub width: u32,
}

impl<const READINGS: usize> Default for Keys<READINGS> {
    fn default() -> Self {
        Self { electrodes: 0, last: None, readings: [0; READINGS], rows: [None; MAX_ELECTRODES] }
    }
}

impl<const READINGS: usize> Keys<READINGS> {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.rows = [None; MAX_ELECTRODES];
    }

    /// Takes note of a frame that is sent, or came: keys that are too old for it are forgotten, all of them where nobody can tell how many frames have
    /// gone by. To be called with each frame, coded or not.
    pub(crate) fn pass(&mut self, head: &FrameHead) {
        let follows = |(sequence, time_us): (u16, u32)| {
            age_of(head, sequence).is_some() && head.time_us.wrapping_sub(time_us) <= LONGEST_GAP_US
        };
        let counts = self.last.is_none_or(follows);
        self.last = Some((head.sequence, head.time_us));
        self.rows.iter_mut().for_each(|row| *row = row.filter(|key| counts && age_of(head, key.sequence).is_some()));
    }

    /// Remembers a frame that is sent, or came, as it is. One of another number of electrodes makes all before it be forgotten; one of more readings
    /// than there is room for is no key.
    pub fn remember(&mut self, head: &FrameHead, scope: &Scope, readings: &[u16]) {
        self.pass(head);
        if scope.electrodes() != self.electrodes {
            self.clear();
            self.electrodes = scope.electrodes();
        }
        if usize::from(self.electrodes).pow(2) > READINGS {
            return;
        }
        let row = Row { sequence: head.sequence, fraction_bits: head.fraction_bits, reads: scope.reads() };
        for ground in (0..scope.rows()).map(|at| usize::from(scope.ground(at))) {
            self.rows.get_mut(ground).into_iter().for_each(|of| *of = Some(row));
        }
        let electrodes = usize::from(self.electrodes);
        for (row, readings) in rows(scope, readings) {
            let keys = self.readings.iter_mut().skip(row * electrodes);
            match starts_at_zero(scope.reads()) {
                true => keys.zip(readings).for_each(|(key, reading)| *key = *reading),
                false => {
                    let keys =
                        keys.take(electrodes).enumerate().filter(|(electrode, _)| scope.reads() >> electrode & 1 == 1);
                    keys.zip(readings).for_each(|((_, key), reading)| *key = *reading);
                }
            }
        }
    }

    /// The number of a frame that [passes](Self::pass) less that of its key; `None` if its rows are not all of one key frame, of the same readings and
    /// fraction bits, 1 to 255 frames before.
    pub(crate) fn age(&self, head: &FrameHead, scope: &Scope) -> Option<u8> {
        let of = |at: usize| *self.rows.get(usize::from(scope.ground(at)))?;
        let key = of(0)?;
        let fits = scope.electrodes() == self.electrodes
            && (key.reads, key.fraction_bits) == (scope.reads(), head.fraction_bits)
            && (1..scope.rows()).all(|at| of(at) == Some(key));
        age_of(head, key.sequence).filter(|age| fits && *age > 0)
    }

    /// The age of the key by which a frame is to be coded; `None` if it has none, or is to be a key again: of whole frames each 32nd is, and of frames of
    /// some rows the readings of each come as they are as often.
    pub(crate) fn age_to_code(&self, head: &FrameHead, scope: &Scope) -> Option<u8> {
        let oldest = KEY_EVERY * usize::from(scope.electrodes()) / scope.rows().max(1);
        self.age(head, scope).filter(|age| usize::from(*age) < oldest)
    }

    /// Writes the differences to the front of `bytes`; `None` if there is not room for all.
    pub(crate) fn write(&self, scope: &Scope, readings: &[u16], bytes: &mut [u8]) -> Option<Written> {
        // The mean of `z` is near to where one more low bit saves as much as it costs.
        let (mut sum, mut count, mut at) = (0, 0, 0);
        self.with_keys(scope, readings, |key, reading| {
            if at == 0 {
                (sum, count, at) = (sum + zigzag(key, reading), count + 1, MEANT);
            }
            at -= 1;
        });
        let k = (sum / count.max(1)).checked_ilog2().unwrap_or(0).min(MOST_K);
        let mut to = BitWriter { bytes, written: 0, held: 0, count: 0 };
        let mut all = 1;
        self.with_keys(scope, readings, |key, reading| {
            all |= reading;
            to.number(zigzag(key, reading), k);
        });
        Some(Written { k, bytes: to.end()?, width: u16::BITS - all.leading_zeros() })
    }

    /// Reads the differences of a frame whose key is known; `None` unless they are there in their one form.
    pub(crate) fn read(&self, k: u32, scope: &Scope, bytes: &[u8]) -> Option<Vec<u16, MAX_READINGS>> {
        let mut bits = Bits { bytes, held: 0, count: 0 };
        let mut readings = Vec::new();
        let electrodes = usize::from(self.electrodes);
        for (ground, electrode) in scope.cells() {
            let key = *self.readings.get(usize::from(ground) * electrodes + usize::from(electrode))?;
            let z = bits.z(k)?;
            let difference = (z >> 1) as i32 ^ -((z & 1) as i32);
            readings.push(u16::try_from(i32::from(key) + difference).ok()?).ok()?;
        }
        (bits.bytes.is_empty() && bits.count < 8 && bits.held == 0).then_some(readings)
    }

    /// Calls something with each reading's key and the reading.
    fn with_keys(&self, scope: &Scope, readings: &[u16], mut each: impl FnMut(u16, u16)) {
        let electrodes = usize::from(self.electrodes);
        for (row, readings) in rows(scope, readings) {
            let keys = self.readings.get(row * electrodes..).unwrap_or_default();
            match starts_at_zero(scope.reads()) {
                true => keys.iter().zip(readings).for_each(|(key, reading)| each(*key, *reading)),
                false => electrodes_of(scope.reads()).zip(readings).for_each(|(electrode, reading)| {
                    each(keys.get(usize::from(electrode)).copied().unwrap_or_default(), *reading);
                }),
            }
        }
    }
}

/// How many frames before this one the frame of this number was, modulo 65536; `None` if more than 255.
fn age_of(head: &FrameHead, sequence: u16) -> Option<u8> {
    u8::try_from(head.sequence.wrapping_sub(sequence)).ok()
}

/// The readings of each row, with the electrode that is grounded.
fn rows<'a>(scope: &'a Scope, readings: &'a [u16]) -> impl Iterator<Item = (usize, &'a [u16])> {
    let rows = readings.chunks(scope.row_readings().max(1)).enumerate();
    rows.map(|(row, readings)| (usize::from(scope.ground(row)), readings))
}

/// Whether all electrodes up to the last one that is read are.
fn starts_at_zero(reads: u32) -> bool {
    reads & reads.wrapping_add(1) == 0
}

/// What stands for a difference: 0, -1, 1, -2 and so on as 0, 1, 2, 3.
fn zigzag(key: u16, reading: u16) -> u32 {
    let difference = i32::from(reading) - i32::from(key);
    (difference << 1 ^ difference >> 31) as u32
}

/// Bytes that bits are put into, the least significant first.
struct BitWriter<'a> {
    bytes: &'a mut [u8],
    /// Bytes that are full; more than there are if there was no room.
    written: usize,
    held: u32,
    count: u32,
}

impl BitWriter<'_> {
    #[inline]
    fn number(&mut self, z: u32, k: u32) {
        let ones = z >> k;
        let (word, bits) = match ones < ESCAPE {
            true => ((z & ((1 << k) - 1)) << (ones + 1) | ((1 << ones) - 1), ones + 1 + k),
            false => (z << ESCAPE | ((1 << ESCAPE) - 1), ESCAPE + WIDEST),
        };
        // 25 bits at most, after 7 that wait.
        self.held |= word << self.count;
        self.count += bits;
        while self.count >= 8 {
            self.byte();
            self.held >>= 8;
            self.count -= 8;
        }
    }

    #[inline]
    fn byte(&mut self) {
        if let Some(byte) = self.bytes.get_mut(self.written) {
            *byte = self.held as u8;
        }
        self.written += 1;
    }

    /// Fills the last byte with zeros; returns how many there are, `None` if there was no room for all.
    fn end(mut self) -> Option<usize> {
        if self.count > 0 {
            self.byte();
        }
        (self.written <= self.bytes.len()).then_some(self.written)
    }
}

/// Bits that are taken from bytes, the least significant first.
struct Bits<'a> {
    bytes: &'a [u8],
    held: u64,
    count: u32,
}

impl Bits<'_> {
    fn z(&mut self, k: u32) -> Option<u32> {
        self.fill();
        let ones = self.held.trailing_ones().min(ESCAPE);
        if ones == ESCAPE {
            self.take(ESCAPE)?;
            let z = self.take(WIDEST)?;
            return (z >> k >= ESCAPE).then_some(z);
        }
        self.take(ones + 1)?;
        Some(ones << k | self.take(k)?)
    }

    /// Holds the bits of the longest number, if there are so many.
    fn fill(&mut self) {
        while self.count <= 56
            && let Some((byte, rest)) = self.bytes.split_first()
        {
            self.held |= u64::from(*byte) << self.count;
            self.count += 8;
            self.bytes = rest;
        }
    }

    fn take(&mut self, count: u32) -> Option<u32> {
        let low = self.held & ((1 << count) - 1);
        self.count = self.count.checked_sub(count)?;
        self.held >>= count;
        Some(low as u32)
    }
}
