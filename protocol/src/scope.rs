//! Which readings a frame holds, and which ones a board is asked for.
//!
//! A frame says itself what it holds, so that each can be read alone:
//!
//! | bytes | what |
//! |---|---|
//! | 1 | electrodes of the board, `n` |
//! | 1 | rows: 0 for a whole frame (every electrode under every ground, in order), else 1 to 32 |
//! | rows | which electrode is grounded in each row |
//! | n / 8, rounded up; none in a whole frame | which electrodes are read in every row: a bit each, electrode 0 the lowest, little-endian |

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::{MAX_ELECTRODES, MIN_ELECTRODES, Settings, coding};

/// Most rows that one frame holds.
pub const MAX_ROWS: usize = 32;
/// Most rows of a [`Plan`].
pub const MAX_PLAN_ROWS: usize = 96;
/// Longest scope on the wire, in bytes.
pub const MAX_SCOPE_BYTES: usize = 2 + MAX_ROWS + MAX_ELECTRODES / 8;

/// Which readings a frame holds, and in which order: row by row, the electrodes that are read in ascending order.
///
/// There is one form for each: a scope of all electrodes, grounded in order and read under each, is whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scope {
    electrodes: u8,
    /// Empty if whole.
    grounds: Vec<u8, MAX_ROWS>,
    reads: u32,
}

/// A bit for each of `electrodes`, which are 1 to 32.
const fn all(electrodes: u8) -> u32 {
    u32::MAX >> (MAX_ELECTRODES as u32 - electrodes as u32)
}

fn is_count(electrodes: u8) -> bool {
    (MIN_ELECTRODES..=MAX_ELECTRODES).contains(&usize::from(electrodes))
}

/// Whether rows can be asked of so many electrodes: none grounded or read that is not there, something read, and no more readings in `rows`
/// rows than in a whole frame, so that a board needs room for that only.
fn can_be(electrodes: u8, rows: usize, grounds: &[u8], reads: u32) -> bool {
    let readings = rows * reads.count_ones() as usize;
    is_count(electrodes)
        && (1..=MAX_ROWS).contains(&rows)
        && grounds.iter().all(|ground| *ground < electrodes)
        && reads != 0
        && reads & !all(electrodes) == 0
        && readings <= usize::from(electrodes).pow(2)
}

impl Scope {
    /// Every electrode read under every ground, in order; `None` unless there are 4 to 32.
    pub fn whole(electrodes: u8) -> Option<Self> {
        is_count(electrodes).then(|| Self { electrodes, grounds: Vec::new(), reads: all(electrodes) })
    }

    /// Rows with these electrodes grounded, of 4 to 32, in each of which the electrodes whose bits are set in `reads` are read.
    ///
    /// `None` if there are no rows or more than 32, if an electrode is not there, if nothing is read, or if these are more readings than
    /// a whole frame has.
    pub fn of_rows(electrodes: u8, grounds: &[u8], reads: u32) -> Option<Self> {
        if !can_be(electrodes, grounds.len(), grounds, reads) {
            return None;
        }
        if reads == all(electrodes) && grounds.iter().copied().eq(0..electrodes) {
            return Self::whole(electrodes);
        }
        Some(Self { electrodes, grounds: Vec::from_slice(grounds).ok()?, reads })
    }

    /// Electrodes of the board.
    pub fn electrodes(&self) -> u8 {
        self.electrodes
    }

    /// Whether every electrode is read under every ground, in order: `readings[g * electrodes + e]`.
    pub fn is_whole(&self) -> bool {
        self.grounds.is_empty()
    }

    /// Rows: grounds, one after the other.
    pub fn rows(&self) -> usize {
        if self.is_whole() { usize::from(self.electrodes) } else { self.grounds.len() }
    }

    /// The electrode that is grounded in a row below [`rows`](Self::rows).
    pub fn ground(&self, row: usize) -> u8 {
        self.grounds.get(row).copied().unwrap_or(row as u8)
    }

    /// The electrodes that are read in every row, a bit each.
    pub fn reads(&self) -> u32 {
        self.reads
    }

    /// Readings in a row.
    pub fn row_readings(&self) -> usize {
        self.reads.count_ones() as usize
    }

    /// Readings in all.
    pub fn readings(&self) -> usize {
        self.rows() * self.row_readings()
    }

    /// Ground and electrode of every reading, in their order.
    pub fn cells(&self) -> impl Iterator<Item = (u8, u8)> + '_ {
        (0..self.rows())
            .flat_map(move |row| electrodes_of(self.reads).map(move |electrode| (self.ground(row), electrode)))
    }

    /// Bytes that the scope takes in a frame.
    pub(crate) fn byte_count(&self) -> usize {
        match self.grounds.len() {
            0 => 2,
            rows => 2 + rows + mask_bytes(self.electrodes),
        }
    }

    /// Writes the scope to the front of `bytes`, which has room for it; returns the rest.
    pub(crate) fn write<'a>(&self, bytes: &'a mut [u8]) -> &'a mut [u8] {
        let (scope, rest) = bytes.split_at_mut(self.byte_count());
        let mask = self.reads.to_le_bytes();
        let content = [self.electrodes, self.grounds.len() as u8].into_iter().chain(self.grounds.iter().copied());
        scope.iter_mut().zip(content.chain(mask)).for_each(|(to, byte)| *to = byte);
        rest
    }

    /// Takes a scope from the front of `bytes`; returns it and the rest. `None` unless it is there in its one form.
    pub(crate) fn read(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let (&[electrodes, rows], rest) = bytes.split_first_chunk()?;
        if rows == 0 {
            return Some((Self::whole(electrodes)?, rest));
        }
        let (grounds, rest) = rest.split_at_checked(rows.into())?;
        let (mask, rest) = rest.split_at_checked(mask_bytes(electrodes))?;
        let reads = mask.iter().rev().fold(0, |mask, byte| mask << 8 | u32::from(*byte));
        let scope = Self::of_rows(electrodes, grounds, reads)?;
        (!scope.is_whole()).then_some((scope, rest))
    }
}

/// Bytes of a bit for each of `electrodes`.
fn mask_bytes(electrodes: u8) -> usize {
    usize::from(electrodes).div_ceil(8)
}

/// The numbers of the bits that are set, in ascending order.
pub fn electrodes_of(mut mask: u32) -> impl Iterator<Item = u8> {
    core::iter::from_fn(move || {
        let next = mask.trailing_zeros();
        mask &= mask.wrapping_sub(1);
        (next < u32::BITS).then_some(next as u8)
    })
}

/// The rows that a board scans, round and round.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Plan {
    /// Which electrode is grounded in each row; repeats are how often each is. None at all: whole frames at the settings' average, the
    /// other fields being zero.
    #[serde(deserialize_with = "coding::list")]
    pub grounds: Vec<u8, MAX_PLAN_ROWS>,
    /// The electrodes that are read in every row, a bit each, electrode 0 the lowest.
    pub reads: u32,
    /// Rows of a frame, 1 to 32; the rows of the plan are so many or a multiple.
    pub rows_a_frame: u8,
    /// Base-2 logarithm of the conversions averaged into one reading, in place of the settings': 0 to 8.
    pub average_log2: u8,
}

impl Plan {
    /// Whether a plan asks for whole frames at the settings' average.
    pub fn is_whole(&self) -> bool {
        self.grounds.is_empty()
    }

    /// Whether a board with so many electrodes can scan so: 4 to 32 electrodes, grounds and reads among them, something read, whole frames
    /// of 1 to 32 rows with no more readings than a whole scan has, and an average over 256 conversions at most.
    pub fn is_valid(&self, electrodes: u8) -> bool {
        if self.is_whole() {
            return is_count(electrodes) && *self == Self::default();
        }
        let rows = usize::from(self.rows_a_frame);
        can_be(electrodes, rows, &self.grounds, self.reads)
            && self.grounds.len().is_multiple_of(rows)
            && self.average_log2 <= Settings::MAX_AVERAGE_LOG2
    }

    /// Frames in which all of the plan's rows come once.
    pub fn frames(&self) -> usize {
        self.grounds.len().checked_div(self.rows_a_frame.into()).unwrap_or(1)
    }

    /// What frame number `frame` of [`frames`](Self::frames) holds; `None` if there is no such frame, or the plan does not fit so many
    /// electrodes.
    pub fn scope(&self, frame: usize, electrodes: u8) -> Option<Scope> {
        if self.is_whole() {
            return Scope::whole(electrodes);
        }
        let grounds = self.grounds.chunks_exact(usize::from(self.rows_a_frame).max(1)).nth(frame)?;
        Scope::of_rows(electrodes, grounds, self.reads)
    }
}
