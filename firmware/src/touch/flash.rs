//! Tables in flash.

use embedded_storage::nor_flash::MultiwriteNorFlash;

use super::TableStore;
use super::store::CHUNK;

/// Where the bytes of a place in flash are read: flash that is part of the address space, where they lie; other flash from a [`RamCopy`].
pub trait View<F> {
    /// The bytes of the place that is seen: always as many.
    fn bytes<'a>(&'a self, flash: &'a F) -> &'a [u8];

    /// Makes the place that begins at `base` be seen as it is; returns whether it could.
    fn open(&mut self, flash: &mut F, base: u32) -> bool;
}

/// A copy in memory of a place in flash.
#[derive(Debug)]
pub struct RamCopy<B>(B);

impl<B: AsRef<[u8]> + AsMut<[u8]>> RamCopy<B> {
    /// In this memory, as long as the place.
    pub fn new(memory: B) -> Self {
        Self(memory)
    }
}

impl<F: MultiwriteNorFlash, B: AsRef<[u8]> + AsMut<[u8]>> View<F> for RamCopy<B> {
    fn bytes<'a>(&'a self, _flash: &'a F) -> &'a [u8] {
        self.0.as_ref()
    }

    fn open(&mut self, flash: &mut F, base: u32) -> bool {
        flash.read(base, self.0.as_mut()).is_ok()
    }
}

/// Tables in two places of NOR flash, which a reset leaves alone.
///
/// Sectors are erased when the first of their bytes comes, so that no call takes longer than one sector. A place whose table was replaced, or whose writing
/// was cut off, has none: the one by its first word, which is zeros, the other by the checksum at its end.
#[derive(Debug)]
pub struct FlashStore<F, V> {
    flash: F,
    view: V,
    /// Where the place that is seen begins, and the other.
    seen: u32,
    other: u32,
    /// Length of each; none if they do not fit this flash.
    room: usize,
    /// The other is erased up to here.
    blank: usize,
}

impl<F: MultiwriteNorFlash, V: View<F>> FlashStore<F, V> {
    /// In the places of `flash` that begin at `bases` and are as long as what `view` shows. Keeps nothing if these are no sectors of this flash, or the same.
    pub fn new(mut flash: F, mut view: V, bases: [u32; 2]) -> Self {
        const {
            assert!(CHUNK.is_multiple_of(F::WRITE_SIZE) && F::WRITE_SIZE.is_multiple_of(F::READ_SIZE));
            assert!(F::ERASE_SIZE.is_multiple_of(CHUNK));
        }
        let length = view.bytes(&flash).len();
        let is_place = |begin: u32| {
            let end = (begin as usize).checked_add(length);
            (begin as usize).is_multiple_of(F::ERASE_SIZE) && end.is_some_and(|end| end <= flash.capacity())
        };
        let [seen, other] = bases;
        let are_apart = seen.abs_diff(other) as usize >= length;
        let fits = length.is_multiple_of(F::ERASE_SIZE) && are_apart && bases.into_iter().all(is_place);
        // What cannot be read is no place for a table.
        let room = if fits && view.open(&mut flash, seen) { length } else { 0 };
        Self { flash, view, seen, other, room, blank: 0 }
    }

    /// Writes whole words to erased flash, or zeros to any; returns whether they are there.
    fn program(&mut self, place: u32, words: &[u8]) -> bool {
        let mut found = Words([0xFF; CHUNK]);
        let found = &mut found.0[..words.len()];
        self.flash.write(place, words).is_ok() && self.flash.read(place, found).is_ok() && found == words
    }
}

impl<F: MultiwriteNorFlash, V: View<F>> TableStore for FlashStore<F, V> {
    fn bytes(&self) -> &[u8] {
        self.view.bytes(&self.flash).get(..self.room).unwrap_or_default()
    }

    fn write(&mut self, at: usize, bytes: &[u8]) -> bool {
        if at.checked_add(bytes.len()).is_none_or(|end| end > self.room) {
            return false;
        }
        if at == 0 {
            self.blank = 0;
        }
        for (number, bytes) in bytes.chunks(CHUNK).enumerate() {
            let at = at + number * CHUNK;
            if self.blank <= at {
                let sector = self.other + self.blank as u32;
                if self.flash.erase(sector, sector + F::ERASE_SIZE as u32).is_err() {
                    return false;
                }
                self.blank += F::ERASE_SIZE;
            }
            // The last word is filled up.
            let mut words = Words([0xFF; CHUNK]);
            words.0[..bytes.len()].copy_from_slice(bytes);
            if !self.program(self.other + at as u32, &words.0[..bytes.len().next_multiple_of(F::WRITE_SIZE)]) {
                return false;
            }
        }
        true
    }

    fn swap(&mut self) -> bool {
        (self.seen, self.other) = (self.other, self.seen);
        self.blank = 0;
        self.room > 0 && self.view.open(&mut self.flash, self.seen)
    }

    fn keep(&mut self) -> bool {
        let (mut found, zeros) = (Words([0xFF; CHUNK]), Words([0; CHUNK]));
        let (found, zeros) = (&mut found.0[..F::WRITE_SIZE], &zeros.0[..F::WRITE_SIZE]);
        // One that is zeros already is not worn.
        (self.flash.read(self.other, found).is_ok() && found == zeros) || self.program(self.other, zeros)
    }
}

/// Some drivers want words at addresses of words.
#[repr(align(8))]
struct Words([u8; CHUNK]);
