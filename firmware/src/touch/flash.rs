//! A table in flash.

use embedded_storage::nor_flash::NorFlash;

use super::TableStore;

/// Bytes that are written, and read back, at once: as many as a piece of a table has.
const CHUNK: usize = 64;

/// Where the bytes of a region of flash are read: flash that is part of the address space, where they lie; other flash from a [`RamCopy`].
pub trait View<F> {
    /// The bytes of the region.
    fn bytes<'a>(&'a self, flash: &'a F) -> &'a [u8];

    /// Makes the region, from `base` on, be seen as it is; returns whether it could. Comes once, before all else.
    fn open(&mut self, _flash: &mut F, _base: u32) -> bool {
        true
    }

    /// These bytes come next to those that are seen. The last may not be in flash yet, if flash is written in words of several bytes.
    fn put(&mut self, _at: usize, _bytes: &[u8]) {}
}

/// A copy in memory of a region of flash, which it is read into when the board starts.
#[derive(Debug)]
pub struct RamCopy<B>(B);

impl<B: AsRef<[u8]> + AsMut<[u8]>> RamCopy<B> {
    /// In this memory, as long as the region.
    pub fn new(memory: B) -> Self {
        Self(memory)
    }
}

impl<F: NorFlash, B: AsRef<[u8]> + AsMut<[u8]>> View<F> for RamCopy<B> {
    fn bytes<'a>(&'a self, _flash: &'a F) -> &'a [u8] {
        self.0.as_ref()
    }

    fn open(&mut self, flash: &mut F, base: u32) -> bool {
        flash.read(base, self.0.as_mut()).is_ok()
    }

    fn put(&mut self, at: usize, bytes: &[u8]) {
        if let Some(place) = self.0.as_mut().get_mut(at..).and_then(|rest| rest.get_mut(..bytes.len())) {
            place.copy_from_slice(bytes);
        }
    }
}

/// A table in a region of NOR flash, which a reset leaves alone.
///
/// Sectors are erased when the first of their bytes comes, so that no call takes longer than one sector. Bytes that are there already are not written
/// again: the same table a second time wears nothing. A table that was cut off is not sound after a reset, by its own checksum at its end.
#[derive(Debug)]
pub struct FlashStore<F, V> {
    flash: F,
    view: V,
    /// Where the region begins, and its length; none if it does not fit this flash.
    base: u32,
    room: usize,
    /// Bytes, from the first on, that are in flash as they are seen, but for the beginning of a word.
    written: usize,
    /// What follows them is erased, up to here.
    blank: usize,
}

impl<F: NorFlash, V: View<F>> FlashStore<F, V> {
    /// In the region of `flash` that begins at `base` and is as long as what `view` shows. Keeps nothing if these are no sectors of this flash.
    pub fn new(mut flash: F, mut view: V, base: u32) -> Self {
        const {
            assert!(CHUNK.is_multiple_of(F::WRITE_SIZE) && F::WRITE_SIZE.is_multiple_of(F::READ_SIZE));
            assert!(F::ERASE_SIZE.is_multiple_of(CHUNK));
        }
        let (begin, length) = (base as usize, view.bytes(&flash).len());
        let is_sectors = begin.is_multiple_of(F::ERASE_SIZE) && length.is_multiple_of(F::ERASE_SIZE);
        let fits = begin.checked_add(length).is_some_and(|end| end <= flash.capacity());
        let room = if is_sectors && fits { length } else { 0 };
        // What could not be read is taken for nothing.
        let written = if room > 0 && view.open(&mut flash, base) { room } else { 0 };
        Self { flash, view, base, room, written, blank: written }
    }

    /// Whether these bytes are there.
    fn has(&self, at: usize, bytes: &[u8]) -> bool {
        at + bytes.len() <= self.written && self.bytes().get(at..at + bytes.len()) == Some(bytes)
    }

    /// Nothing of what is there counts: its sectors will be erased.
    fn forget(&mut self) {
        (self.written, self.blank) = (0, 0);
    }

    /// Appends bytes to what is written, as far as they fill words; what is left waits for those that follow.
    fn append(&mut self, bytes: &[u8]) -> Result<(), Failed> {
        let (start, end) = (self.written, self.written + bytes.len());
        while self.blank < end {
            let sector = self.base + self.blank as u32;
            self.flash.erase(sector, sector + F::ERASE_SIZE as u32).map_err(|_| Failed)?;
            self.blank += F::ERASE_SIZE;
        }
        let (mut from, to) = (start - start % F::WRITE_SIZE, end - end % F::WRITE_SIZE);
        while from < to {
            let mut words = Words([0xFF; CHUNK]);
            let words = &mut words.0[..CHUNK.min(to - from)];
            // The beginning of the first word came before.
            let began = start.saturating_sub(from).min(words.len());
            words[..began].copy_from_slice(self.bytes().get(from..from + began).ok_or(Failed)?);
            let new = bytes.get((from + began).saturating_sub(start)..).unwrap_or_default();
            words[began..].iter_mut().zip(new).for_each(|(place, byte)| *place = *byte);
            self.program(from, words)?;
            from += words.len();
        }
        self.view.put(start, bytes);
        self.written = end;
        Ok(())
    }

    /// Writes whole words to erased flash, and looks whether they are there.
    fn program(&mut self, at: usize, words: &[u8]) -> Result<(), Failed> {
        let place = self.base + at as u32;
        self.flash.write(place, words).map_err(|_| Failed)?;
        let mut found = Words([0; CHUNK]);
        let found = &mut found.0[..words.len()];
        self.flash.read(place, found).map_err(|_| Failed)?;
        if found == words { Ok(()) } else { Err(Failed) }
    }
}

impl<F: NorFlash, V: View<F>> TableStore for FlashStore<F, V> {
    fn bytes(&self) -> &[u8] {
        self.view.bytes(&self.flash).get(..self.room).unwrap_or_default()
    }

    fn write(&mut self, at: usize, bytes: &[u8]) -> Option<usize> {
        let end = at.checked_add(bytes.len()).filter(|end| *end <= self.room)?;
        if self.has(at, bytes) {
            return Some(end);
        }
        if at < self.written {
            self.forget();
        }
        if at == self.written && self.append(bytes).is_err() {
            self.forget();
            return None;
        }
        Some(self.written)
    }

    fn keep(&mut self, length: usize) -> bool {
        let padding = self.written.next_multiple_of(F::WRITE_SIZE) - self.written;
        let is_kept = length <= self.written && self.append(&[0xFF; CHUNK][..padding]).is_ok();
        if !is_kept {
            self.forget();
        }
        is_kept
    }
}

/// Flash did not do as it was told.
struct Failed;

/// Some drivers want words at addresses of words.
#[repr(align(8))]
struct Words([u8; CHUNK]);
