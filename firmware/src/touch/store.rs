//! Where tables are kept.

/// Bytes that are written at once: as many as a piece of a table has.
pub const CHUNK: usize = 64;

/// Two places for a table: one is shown, so that the table in it can be read where it lies, while a new one is written into the other.
pub trait TableStore {
    /// All bytes of the place that is shown: those of a table that was kept, or of anything.
    fn bytes(&self) -> &[u8];

    /// Writes bytes of a new table into the place that is not shown, [`CHUNK`]s but for the last: the first at 0, each where the one before ended. Returns
    /// whether they are there. The first may take as long as flash takes to be erased.
    fn write(&mut self, at: usize, bytes: &[u8]) -> bool;

    /// Shows the other place; returns whether it can be read. Twice is back again.
    fn swap(&mut self) -> bool;

    /// The place that is shown has a sound table, which is to be found after a reset: whatever is in the other one is no table any more. Returns whether it
    /// is so.
    fn keep(&mut self) -> bool;
}

/// Tables in memory, which a reset forgets: for tests, and for the simulated boards.
#[derive(Debug)]
pub struct RamStore<B> {
    shown: B,
    other: B,
}

impl<B: AsRef<[u8]> + AsMut<[u8]>> RamStore<B> {
    /// In these two stretches of memory, which are as long as each other; the first is shown.
    pub fn new([shown, other]: [B; 2]) -> Self {
        Self { shown, other }
    }
}

impl<B: AsRef<[u8]> + AsMut<[u8]>> TableStore for RamStore<B> {
    fn bytes(&self) -> &[u8] {
        self.shown.as_ref()
    }

    fn write(&mut self, at: usize, bytes: &[u8]) -> bool {
        let place = self.other.as_mut().get_mut(at..).and_then(|rest| rest.get_mut(..bytes.len()));
        place.map(|place| place.copy_from_slice(bytes)).is_some()
    }

    fn swap(&mut self) -> bool {
        core::mem::swap(&mut self.shown, &mut self.other);
        true
    }

    fn keep(&mut self) -> bool {
        self.other.as_mut().iter_mut().take(CHUNK).for_each(|byte| *byte = 0);
        true
    }
}
