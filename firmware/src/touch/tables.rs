//! The table in use, and a new one that comes in pieces.

use tactomo_protocol::{MAX_PIECE, TableId, TablePiece, TableState};
use tactomo_touch_core::Table;
use tactomo_touch_core::table::HEAD_BYTES;

use super::TableStore;
use super::input::Input;
use super::store::CHUNK;

/// A table's drive may be above the board's by so much (V), as rounding to millivolts makes it; what it is below is how far the ground is lifted.
const DRIVE_ROUNDING_V: f32 = 1e-3;

/// Tables that are kept in `S`, for a board of up to `READINGS` readings. One is in use until a new one is whole and sound: nothing of it is written over, and
/// nothing is erased for a new one whose head is none of this board.
#[derive(Debug)]
pub(super) struct Tables<S, const READINGS: usize> {
    store: S,
    /// The table in use, which the store shows, and how many bytes it has.
    used: Option<(TableId, usize)>,
    incoming: Option<Incoming>,
    /// Whether a table that begins like the one in use is taken for that: one that was and turned out to be another comes once more.
    compares: bool,
}

/// A table that comes.
#[derive(Clone, Copy, Debug)]
struct Incoming {
    /// Bytes that have come.
    held: usize,
    /// Bytes that it says that it has, once its head has come.
    length: Option<usize>,
    /// Whether it is the one in use as far as it has come: nothing is written then.
    is_same: bool,
    /// The last that came, and are not written yet: the head, then what is left of [`CHUNK`]s.
    waiting: [u8; WAITING],
    count: usize,
}

/// The head is looked at before anything is written; a piece more may come with its end.
const WAITING: usize = HEAD_BYTES + MAX_PIECE;

impl Incoming {
    fn new(is_same: bool) -> Self {
        Self { held: 0, length: None, is_same, waiting: [0; WAITING], count: 0 }
    }

    fn waiting(&self) -> &[u8] {
        self.waiting.get(..self.count).unwrap_or_default()
    }

    /// Takes bytes; returns whether there is room.
    fn put(&mut self, bytes: &[u8]) -> bool {
        let place = self.waiting.get_mut(self.count..).and_then(|rest| rest.get_mut(..bytes.len()));
        let fits = place.map(|place| place.copy_from_slice(bytes)).is_some();
        self.count += bytes.len();
        self.held += bytes.len();
        fits
    }
}

impl<S: TableStore, const READINGS: usize> Tables<S, READINGS> {
    pub const fn new(store: S) -> Self {
        Self { store, used: None, incoming: None, compares: true }
    }

    /// Looks for a table of this board that was kept.
    pub fn look(&mut self, input: &Input) {
        self.used = self.sound(input);
        if self.used.is_none() && self.store.swap() {
            self.used = self.sound(input);
        }
    }

    /// Which table is in use.
    pub fn used(&self) -> Option<TableId> {
        self.used.map(|(table, _)| table)
    }

    /// The table in use, which was checked when it came.
    pub fn table(&self) -> Option<Table<'_>> {
        let (_, length) = self.used?;
        Table::read_again(self.store.bytes().get(..length)?).ok()
    }

    /// What there is of tables: while one comes, of that.
    pub fn state(&self) -> TableState {
        let (held, usable) = match (&self.incoming, self.used) {
            (Some(incoming), _) => (incoming.held, None),
            (None, Some((table, length))) => (length, Some(table)),
            (None, None) => (0, None),
        };
        let [room, held] = [self.store.bytes().len(), held].map(|bytes| bytes as u32);
        TableState { answers: 0, room, held, usable }
    }

    /// Takes a piece; returns whether it can be part of a table of this board. If not, the one in use stays.
    pub fn take(&mut self, piece: &TablePiece, input: &Input) -> bool {
        let (at, bytes) = (piece.at as usize, &piece.bytes[..]);
        if bytes.is_empty() {
            return true;
        }
        if at == 0 {
            let is_same = self.compares && self.used.is_some();
            (self.incoming, self.compares) = (Some(Incoming::new(is_same)), true);
        }
        // A piece that came twice, or after one that was lost: the state says where to go on.
        let Some(mut incoming) = self.incoming.filter(|incoming| incoming.held == at) else { return true };
        let fits = match incoming.is_same {
            true => self.compare(&mut incoming, bytes, input),
            false => self.put(&mut incoming, bytes, input),
        };
        fits.unwrap_or_else(|| {
            self.incoming = Some(incoming);
            true
        })
    }

    /// Compares a piece with the table in use. Returns whether that is the whole of it and is kept; `None` if the table goes on.
    fn compare(&mut self, incoming: &mut Incoming, bytes: &[u8], input: &Input) -> Option<bool> {
        let (_, length) = self.used?;
        let (at, end) = (incoming.held, incoming.held + bytes.len());
        let is_same = self.store.bytes().get(..length).and_then(|table| table.get(at..end)) == Some(bytes);
        if is_same {
            incoming.held = end;
            return (end == length).then(|| {
                self.incoming = None;
                self.store.keep()
            });
        }
        *incoming = Incoming::new(false);
        if at == 0 {
            return self.put(incoming, bytes, input);
        }
        // Another one after all: what is to be written of it has gone by.
        self.compares = false;
        None
    }

    /// Takes a piece of a new table. Returns whether it is whole and used, or, if it cannot be, not; `None` if it goes on.
    fn put(&mut self, incoming: &mut Incoming, bytes: &[u8], input: &Input) -> Option<bool> {
        if !incoming.put(bytes) {
            return Some(self.refuse());
        }
        if incoming.length.is_none() && incoming.held >= HEAD_BYTES {
            incoming.length = self.announced(incoming.waiting(), input);
            if incoming.length.is_none() {
                return Some(self.refuse());
            }
        }
        let length = incoming.length?;
        if incoming.held > length || !self.write(incoming, incoming.held == length) {
            return Some(self.refuse());
        }
        (incoming.held == length).then(|| self.finish(length, input))
    }

    /// How many bytes a table has whose head this is; `None` if it cannot be used here.
    fn announced(&self, head: &[u8], input: &Input) -> Option<usize> {
        let announced = Table::announced(head).ok()?;
        let fits = announced.electrodes == usize::from(input.electrodes)
            && announced.electrodes * announced.electrodes <= READINGS
            && announced.head.drive_v <= input.drive_v + DRIVE_ROUNDING_V
            && announced.bytes <= self.store.bytes().len();
        fits.then_some(announced.bytes)
    }

    /// Writes what waits, as far as it fills chunks or is the last; returns whether it is there.
    fn write(&mut self, incoming: &mut Incoming, is_last: bool) -> bool {
        let count = if is_last { incoming.count } else { incoming.count - incoming.count % CHUNK };
        let Some(bytes) = incoming.waiting.get(..count) else { return false };
        let is_there = count == 0 || self.store.write(incoming.held - incoming.count, bytes);
        incoming.waiting.copy_within(count.., 0);
        incoming.count -= count;
        is_there
    }

    /// Goes over to a table that is whole, if it is sound.
    fn finish(&mut self, length: usize, input: &Input) -> bool {
        self.incoming = None;
        let is_seen = self.store.swap();
        match self.sound(input) {
            Some((table, bytes)) if is_seen && bytes == length => {
                self.used = Some((table, length));
                self.store.keep()
            }
            _ => {
                // Back to the one before.
                self.store.swap();
                self.used = self.sound(input);
                false
            }
        }
    }

    fn refuse(&mut self) -> bool {
        self.incoming = None;
        false
    }

    /// The table that the store shows, and how many bytes it has, if it is sound and one of this board.
    fn sound(&self, input: &Input) -> Option<(TableId, usize)> {
        let length = self.announced(self.store.bytes(), input)?;
        let bytes = self.store.bytes().get(..length)?;
        let table = Table::read(bytes).ok()?;
        let checksum = u32::from_le_bytes(*bytes.last_chunk()?);
        Some((TableId { layout: table.layout(), checksum }, length))
    }
}
