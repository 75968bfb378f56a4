//! The table that a detector is compiled to, and how it is read.
//!
//! All numbers are little endian; `f32` is IEEE 754. Lengths in m, resistances in ohm, voltages in V. Electrodes are `n`, coefficients of
//! splines over the detector `nx` by `ny`, of the one over distances `k`.
//!
//! | offset | type | what |
//! |---|---|---|
//! | 0 | 4 bytes | [`MAGIC`] |
//! | 4 | u16 | [`VERSION`] |
//! | 6 | u16 | `n`, 2 to [`MAX_ELECTRODES`] |
//! | 8 | u16 | `nx`, 4 to [`MAX_SIDE`] |
//! | 10 | u16 | `ny`, likewise |
//! | 12 | u16 | `k`, 4 to [`MAX_KNOTS`] |
//! | 14 | u16 | zero |
//! | 16 | u32 | bytes of the whole table |
//! | 20 | u32 | CRC-32 of the electrodes' places, three `f32` each (m): tables of another layout have another |
//! | 24 | 24 f32 | [`Head`], in the order of its fields |
//! | 120 | n (n + 1) / 2 f32 | fields between the electrodes `N(e, g)` (ohm): rows `e`, of each those `g` up to `e` |
//! | | 2 n f32 | of each channel the gain, and what it reads too much though at rest it does not show (V) |
//! | | k f32 | coefficients of the spline `d` of `N` by lengths of ways (ohm), over `ln r` |
//! | | (n + 1)(n + 2) / 2 f32 | `Q`, symmetric, as the fields above (1/ohm, none, ohm) |
//! | | 2 (n + 2) x 2 f32 | of each quantity, its value at code 0 and the step of a code |
//! | | ceil((nx - 3)(ny - 3) / 8) bytes | which cells are on the detector: bit `i % 8` of byte `i / 8`, rows of `y`, that of the lowest `x` first |
//! | | 2 nx ny (n + 2) i16 | codes of the coefficients: rows of `y`, in them of `x`, for each all quantities |
//! | last 4 | u32 | CRC-32 (ISO HDLC) of all before |
//!
//! Quantities are the fields of the electrodes `u_e(x) = N(e, x)` (ohm) as means over a small disc about `x`, the disc's own field (ohm) less `8 / (3 pi^2 s R)`
//! that it has on a deep layer of the top's conductivity `s`, and the share of it that is on the detector; then all of these for a wide disc. They are linear in the
//! square of the radius. Fields are in the gauge in which the electrodes' mean is zero everywhere. A quantity at a
//! place is a uniform cubic B-spline: the cell `(i, j)` between coefficients `i + 1` and `i + 2` of `x` begins at `left_m + i step_m`.
//!
//! Fields between two places are `N(x, y) = sum of d over ways + b(x)' Q b(y)` with `b = (u, 1)`: a part that goes by the lengths of the [ways](crate::ways) between
//! them, of which walls make eight where all cells are on the detector, and one that pads and all else make, which is smooth.

use crate::crc::crc32;
use crate::head::NUMBERS;
pub use crate::head::{EVEN_SPREADING, Head};
use crate::real::Real;
use crate::spline::interval;

/// First bytes of a table.
pub const MAGIC: [u8; 4] = *b"TCtb";
/// Version of the format.
pub const VERSION: u16 = 4;
/// Most electrodes.
pub const MAX_ELECTRODES: usize = 32;
/// Most coefficients along a side.
pub const MAX_SIDE: usize = 128;
/// Most coefficients over distances.
pub const MAX_KNOTS: usize = 32;
/// Quantities beside the fields of the electrodes: a disc's own field, and its share on the detector.
pub const OTHERS: usize = 2;
/// Radii that quantities are stored for.
pub const RADII: usize = 2;

/// Largest number of a table, apart from its head's: ohm, or what makes such.
pub(crate) const MOST: f32 = 1e9;

/// Where the table's length stands, and the numbers of its [`Head`].
const LENGTH_AT: usize = 16;
const NUMBERS_AT: usize = 24;
/// Bytes of a table that tell what it is to be: [`Table::announced`].
pub const HEAD_BYTES: usize = NUMBERS_AT + 4 * NUMBERS;
/// Least share of a disc that is on the detector: a quarter has the middle in a corner.
pub(crate) const LEAST_SHARE: f32 = 0.2;
pub(crate) const QUANTITIES: usize = MAX_ELECTRODES + OTHERS;

/// Why bytes are no table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// They begin with something else.
    #[error("these bytes are no table of a detector; `tactomo detector compile` writes one")]
    Magic,
    /// Another version.
    #[error("the table has version {found}, this program reads {VERSION}; compile the detector again")]
    Version {
        /// Of the table.
        found: u16,
    },
    /// There are more or fewer than the table says, or than its counts need.
    #[error("the table has {found} bytes where {expected} are needed; it was cut or is damaged")]
    Length {
        /// There are.
        found: usize,
        /// Needed.
        expected: usize,
    },
    /// Damaged.
    #[error("the table's checksum is {found:#010x}, that of its bytes {expected:#010x}; it is damaged")]
    Checksum {
        /// In the table.
        found: u32,
        /// Of the bytes.
        expected: u32,
    },
    /// A count that is out of range.
    #[error("the table says {found} for {what}, which is not from {least} to {most}")]
    Count {
        /// What is counted.
        what: &'static str,
        /// In the table.
        found: usize,
        /// At least.
        least: usize,
        /// At most.
        most: usize,
    },
    /// A number that makes no sense.
    #[error("the table's {what} makes no sense")]
    Number {
        /// Its name.
        what: &'static str,
    },
}

/// A table, borrowed from flash or a file.
#[derive(Clone, Copy, Debug)]
pub struct Table<'a> {
    pub(crate) head: Head,
    pub(crate) layout: u32,
    pub(crate) electrodes: usize,
    pub(crate) sides: [usize; 2],
    pub(crate) pads: Floats<'a>,
    pub(crate) channels: Floats<'a>,
    pub(crate) distances: Floats<'a>,
    pub(crate) walls: Floats<'a>,
    pub(crate) codes: Floats<'a>,
    pub(crate) mask: &'a [u8],
    pub(crate) is_rectangle: bool,
    pub(crate) coefficients: &'a [u8],
}

/// What a table says of itself in its first bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Announced {
    /// Bytes of the whole table.
    pub bytes: usize,
    /// How many electrodes it has.
    pub electrodes: usize,
    /// The detector's and the board's numbers.
    pub head: Head,
    layout: u32,
    sides: [usize; 2],
    knots: usize,
}

/// Numbers as they are stored.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Floats<'a>(pub &'a [[u8; 4]]);

impl Floats<'_> {
    pub fn at(self, index: usize) -> f32 {
        self.0.get(index).map_or(0.0, |bytes| f32::from_le_bytes(*bytes))
    }

    /// An element of a symmetric matrix.
    pub fn of_pair(self, a: usize, b: usize) -> f32 {
        let (high, low) = if a < b { (b, a) } else { (a, b) };
        self.at(high * (high + 1) / 2 + low)
    }

    fn are_within(self, most: f32) -> bool {
        // As numbers without their signs these have the order of their bits; what is none has more. A board without floating point looks at each frame.
        self.0.iter().all(|bytes| u32::from_le_bytes(*bytes) & !(1 << 31) <= most.to_bits())
    }
}

/// Takes parts off the front of the bytes that are left.
struct Parts<'a>(&'a [u8]);

impl<'a> Parts<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (part, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(part)
    }

    fn floats(&mut self, count: usize) -> Option<Floats<'a>> {
        Some(Floats(self.bytes(4 * count)?.as_chunks().0))
    }
}

/// Bytes of a table with such counts.
pub const fn bytes_of(electrodes: usize, sides: [usize; 2], knots: usize) -> usize {
    let pairs = electrodes * (electrodes + 1) / 2 + (electrodes + 1) * (electrodes + 2) / 2;
    let quantities = RADII * (electrodes + OTHERS);
    let floats = pairs + 2 * electrodes + knots + 2 * quantities;
    let cells = (sides[0] - 3) * (sides[1] - 3);
    HEAD_BYTES + 4 * floats + cells.div_ceil(8) + 2 * sides[0] * sides[1] * quantities + 4
}

impl<'a> Table<'a> {
    /// Reads a table, and checks all that it says of itself.
    ///
    /// # Errors
    /// [`TableError`] if the bytes are no whole, sound table of this version.
    pub fn read(bytes: &'a [u8]) -> Result<Self, TableError> {
        let table = Self::read_again(bytes)?;
        let (content, last) = bytes.split_last_chunk().unwrap_or((bytes, &[0; 4]));
        match (u32::from_le_bytes(*last), crc32(content)) {
            (found, expected) if found == expected => Ok(table),
            (found, expected) => Err(TableError::Checksum { found, expected }),
        }
    }

    /// What the table that begins so is to be, checked as far as its [head](HEAD_BYTES) tells: before the rest of it has come.
    ///
    /// # Errors
    /// [`TableError`] if these are the first bytes of no table of this version, or not [so many](HEAD_BYTES).
    pub fn announced(first: &[u8]) -> Result<Announced, TableError> {
        let u16_at = |at: usize| first.get(at..at + 2).map_or(0, |two| u16::from_le_bytes([two[0], two[1]]));
        let u32_at = |at: usize| Floats(first.as_chunks().0).at(at / 4).to_bits();
        if first.first_chunk() != Some(&MAGIC) {
            return Err(TableError::Magic);
        }
        if u16_at(4) != VERSION {
            return Err(TableError::Version { found: u16_at(4) });
        }
        let counted = |what, at, least, most| match usize::from(u16_at(at)) {
            found if (least..=most).contains(&found) => Ok(found),
            found => Err(TableError::Count { what, found, least, most }),
        };
        let electrodes = counted("electrodes", 6, 2, MAX_ELECTRODES)?;
        let sides =
            [counted("coefficients along x", 8, 4, MAX_SIDE)?, counted("coefficients along y", 10, 4, MAX_SIDE)?];
        let knots = counted("coefficients over distances", 12, 4, MAX_KNOTS)?;
        let (expected, found) = (bytes_of(electrodes, sides, knots), u32_at(LENGTH_AT) as usize);
        if found != expected {
            return Err(TableError::Length { found, expected });
        }
        let cut = TableError::Length { found: first.len(), expected: HEAD_BYTES };
        let numbers = first.get(NUMBERS_AT..HEAD_BYTES).ok_or(cut)?;
        let head = Head::read(Floats(numbers.as_chunks().0))?;
        Ok(Announced { bytes: expected, electrodes, head, layout: u32_at(20), sides, knots })
    }

    /// Reads a table that was read before, without its checksum, which takes as long as some frames.
    ///
    /// # Errors
    /// As for [`read`](Self::read), but for the checksum.
    pub fn read_again(bytes: &'a [u8]) -> Result<Self, TableError> {
        let Announced { bytes: expected, electrodes, head, layout, sides, knots } = Self::announced(bytes)?;
        let cut = || TableError::Length { found: bytes.len(), expected };
        if bytes.len() != expected {
            return Err(cut());
        }
        let mut parts = Parts(bytes);
        parts.bytes(HEAD_BYTES).ok_or_else(cut)?;
        let cells = (sides[0] - 3) * (sides[1] - 3);
        let mut table = Self {
            head,
            layout,
            electrodes,
            sides,
            pads: parts.floats(electrodes * (electrodes + 1) / 2).ok_or_else(cut)?,
            channels: parts.floats(2 * electrodes).ok_or_else(cut)?,
            distances: parts.floats(knots).ok_or_else(cut)?,
            walls: parts.floats((electrodes + 1) * (electrodes + 2) / 2).ok_or_else(cut)?,
            codes: parts.floats(2 * RADII * (electrodes + OTHERS)).ok_or_else(cut)?,
            mask: parts.bytes(cells.div_ceil(8)).ok_or_else(cut)?,
            is_rectangle: false,
            coefficients: parts.bytes(2 * RADII * sides[0] * sides[1] * (electrodes + OTHERS)).ok_or_else(cut)?,
        };
        let on_detector: u32 = table.mask.iter().map(|byte| byte.count_ones()).sum();
        table.is_rectangle = on_detector as usize == cells;
        table.check()
    }

    /// Checks that all numbers are numbers of a detector.
    fn check(self) -> Result<Self, TableError> {
        let all = [
            ("fields between electrodes", self.pads),
            ("gains and offsets", self.channels),
            ("fields by distance", self.distances),
            ("fields of walls", self.walls),
            ("steps of codes", self.codes),
        ];
        let gains_are_sound = (0..self.electrodes).all(|e| (1e-3..=1e3).contains(&self.channels.at(2 * e)));
        match all.into_iter().find(|(_, floats)| !floats.are_within(MOST)) {
            Some((what, _)) => Err(TableError::Number { what }),
            None if !gains_are_sound => Err(TableError::Number { what: "gains" }),
            None => Ok(self),
        }
    }

    /// The detector's and the board's numbers.
    pub fn head(&self) -> &Head {
        &self.head
    }

    /// What stands for the electrodes' places: the same for all tables of a layout.
    pub fn layout(&self) -> u32 {
        self.layout
    }

    /// How many electrodes.
    pub fn electrodes(&self) -> usize {
        self.electrodes
    }

    /// A voltage less the baseline as its channel should have read it (V): an offset below zero is cut off where there is nothing, so that the smallest
    /// readings are lifted by what they are at most.
    pub fn corrected_v(&self, e: usize, volts: f32) -> f32 {
        let (gain, offset_v) = (self.channels.at(2 * e), self.channels.at(2 * e + 1));
        (volts - offset_v.max(-volts.max(0.0))) / gain
    }

    /// Field between two electrodes (ohm).
    pub(crate) fn pads_ohm(&self, e: usize, g: usize) -> f32 {
        self.pads.of_pair(e, g)
    }

    /// Cells along x and y.
    pub(crate) fn cells(&self) -> [usize; 2] {
        self.sides.map(|side| side - 3)
    }

    /// Whether a place is on the detector (m).
    pub fn holds<T: Real>(&self, x_m: T, y_m: T) -> bool {
        let ([i, j], _) = self.cell(x_m, y_m);
        let index = j * self.cells()[0] + i;
        self.mask.get(index / 8).is_some_and(|byte| byte >> (index % 8) & 1 == 1)
    }

    /// Lowest and highest corner of the rectangle that the grid covers, which is the detector's own (m).
    pub fn bounds_m(&self) -> [[f32; 2]; 2] {
        let ([columns, rows], Head { left_m, bottom_m, step_x_m, step_y_m, .. }) = (self.cells(), self.head);
        [[left_m, bottom_m], [left_m + columns as f32 * step_x_m, bottom_m + rows as f32 * step_y_m]]
    }

    /// Lowest and highest corner of the rectangle whose edges are its walls (m); `None` if the middle of a cell is not on the detector.
    pub fn walls_m<T: Real>(&self) -> Option<[[T; 2]; 2]> {
        self.is_rectangle.then(|| self.bounds_m().map(|corner_m| corner_m.map(T::of)))
    }

    /// The cell of a place, and the shares of the ways through it.
    pub(crate) fn cell<T: Real>(&self, x_m: T, y_m: T) -> ([usize; 2], [T; 2]) {
        let [columns, rows] = self.cells();
        let (i, x) = interval((x_m - T::of(self.head.left_m)) / T::of(self.head.step_x_m), columns);
        let (j, y) = interval((y_m - T::of(self.head.bottom_m)) / T::of(self.head.step_y_m), rows);
        ([i, j], [x, y])
    }
}
