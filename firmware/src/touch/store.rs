//! Where a table is kept.

/// Keeps a table, so that it can be read where it lies.
pub trait TableStore {
    /// All bytes of the store: those of a table that was kept, or of anything.
    fn bytes(&self) -> &[u8];

    /// Writes bytes of a new table, the first at 0, each where the one before ended; returns how many bytes of it are there: where to go on, which is 0 if it has
    /// to come anew. `None` if it cannot be written. The first may take as long as flash takes to be erased.
    fn write(&mut self, at: usize, bytes: &[u8]) -> Option<usize>;

    /// The table is whole and sound, and has so many bytes: it is to be found here after a reset; returns whether it will.
    fn keep(&mut self, length: usize) -> bool;
}

/// A table in memory, which a reset forgets: for boards that have no flash to spare, for tests, and for the simulated board.
#[derive(Debug)]
pub struct RamStore<B>(B);

impl<B: AsRef<[u8]> + AsMut<[u8]>> RamStore<B> {
    /// In this memory.
    pub fn new(memory: B) -> Self {
        Self(memory)
    }
}

impl<B: AsRef<[u8]> + AsMut<[u8]>> TableStore for RamStore<B> {
    fn bytes(&self) -> &[u8] {
        self.0.as_ref()
    }

    fn write(&mut self, at: usize, bytes: &[u8]) -> Option<usize> {
        self.0.as_mut().get_mut(at..)?.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(at + bytes.len())
    }

    fn keep(&mut self, _length: usize) -> bool {
        true
    }
}
