//! NOR flash that holds its user to its rules, and goes wrong when it is told to.

use embedded_storage::nor_flash::{ErrorType, MultiwriteNorFlash, NorFlash, NorFlashErrorKind, ReadNorFlash};

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// An operation does some of its work and says so.
    Fails,
    /// Power goes in an operation: nothing works from then on.
    PowerLoss,
    /// A bit is not written, and nothing is said.
    Weak,
}

/// Flash that is written in words of `WORD` bytes and erased in sectors of `SECTOR`.
pub struct Chip<const WORD: usize, const SECTOR: usize> {
    /// What it holds.
    pub bytes: Vec<u8>,
    /// Operations that wrote or erased.
    pub operations: usize,
    /// Whether each word may be written.
    blank: Vec<bool>,
    erased: Vec<u32>,
    /// What goes wrong after so many operations.
    plan: Option<(Trouble, usize)>,
    has_happened: bool,
    is_off: bool,
    random: fastrand::Rng,
}

impl<const WORD: usize, const SECTOR: usize> Chip<WORD, SECTOR> {
    /// Of so many bytes, which hold anything.
    pub fn new(length: usize, seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        Self {
            bytes: (0..length).map(|_| random.u8(..)).collect(),
            operations: 0,
            blank: vec![false; length / WORD],
            erased: vec![0; length / SECTOR],
            plan: None,
            has_happened: false,
            is_off: false,
            random,
        }
    }

    /// Goes wrong after so many operations.
    pub fn plan(&mut self, trouble: Trouble, after: usize) {
        self.plan = Some((trouble, after));
    }

    /// Works again; returns whether something went wrong.
    pub fn end_trouble(&mut self) -> bool {
        (self.plan, self.is_off) = (None, false);
        std::mem::take(&mut self.has_happened)
    }

    /// How often each sector was erased, from one on.
    pub fn erased(&self, from: usize) -> Vec<u32> {
        self.erased[from / SECTOR..].iter().copied().take(128 * 1024 / SECTOR).collect()
    }

    /// What goes wrong in this operation; `can_be_weak` where one bit less can be told.
    fn trouble(&mut self, can_be_weak: bool) -> Option<Trouble> {
        self.operations += 1;
        if self.is_off {
            return Some(Trouble::PowerLoss);
        }
        let (trouble, left) = self.plan?;
        if left > 0 || (trouble == Trouble::Weak && !can_be_weak) {
            self.plan = Some((trouble, left.saturating_sub(1)));
            return None;
        }
        self.plan = None;
        self.has_happened = true;
        self.is_off = trouble == Trouble::PowerLoss;
        Some(trouble)
    }
}

impl<const WORD: usize, const SECTOR: usize> ErrorType for Chip<WORD, SECTOR> {
    type Error = NorFlashErrorKind;
}

impl<const WORD: usize, const SECTOR: usize> ReadNorFlash for Chip<WORD, SECTOR> {
    const READ_SIZE: usize = WORD;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        let at = offset as usize;
        assert!(at.is_multiple_of(WORD) && bytes.len().is_multiple_of(WORD));
        bytes.copy_from_slice(&self.bytes[at..at + bytes.len()]);
        if self.is_off { Err(NorFlashErrorKind::Other) } else { Ok(()) }
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const WORD: usize, const SECTOR: usize> NorFlash for Chip<WORD, SECTOR> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        let (from, to) = (from as usize, to as usize);
        assert!(from.is_multiple_of(SECTOR) && to == from + SECTOR, "one sector at a time, for the watchdog");
        let was_off = self.is_off;
        if self.trouble(false).is_some() {
            if !was_off {
                for byte in &mut self.bytes[from..to] {
                    *byte |= self.random.u8(..);
                }
                self.blank[from / WORD..to / WORD].fill(false);
            }
            return Err(NorFlashErrorKind::Other);
        }
        self.erased[from / SECTOR] += 1;
        self.bytes[from..to].fill(0xFF);
        self.blank[from / WORD..to / WORD].fill(true);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        let (at, end) = (offset as usize, offset as usize + bytes.len());
        assert!(at.is_multiple_of(WORD) && end.is_multiple_of(WORD));
        assert!(bytes.as_ptr().addr().is_multiple_of(4), "some drivers want words in memory too");
        let blank = &mut self.blank[at / WORD..end / WORD];
        let clears = bytes.iter().all(|byte| *byte == 0);
        assert!(self.is_off || clears || blank.iter().all(|blank| *blank), "written twice, or not erased");
        blank.fill(false);
        let was_off = self.is_off;
        // The first byte of which a bit is to be cleared.
        let weak = bytes.iter().zip(&self.bytes[at..end]).position(|(byte, place)| place & !byte != 0);
        let trouble = self.trouble(weak.is_some());
        for (number, (place, byte)) in self.bytes[at..end].iter_mut().zip(bytes).enumerate() {
            match trouble {
                None => *place &= byte,
                Some(Trouble::Weak) if Some(number) == weak => *place &= byte | 1 << (*place & !byte).trailing_zeros(),
                Some(Trouble::Weak) => *place &= byte,
                Some(_) if !was_off => *place &= byte | self.random.u8(..),
                Some(_) => {}
            }
        }
        match trouble {
            None | Some(Trouble::Weak) => Ok(()),
            Some(_) => Err(NorFlashErrorKind::Other),
        }
    }
}

/// Words that were written may be cleared.
impl<const WORD: usize, const SECTOR: usize> MultiwriteNorFlash for Chip<WORD, SECTOR> {}
