//! The table that contacts are found by, and room for a new one, in the last two sectors of the chip's flash.

use core::sync::atomic::{Ordering, compiler_fence};

use embedded_storage::nor_flash::{ErrorType, MultiwriteNorFlash, NorFlash, ReadNorFlash};
use stm32f4xx_hal::flash::{Error, FlashExt, UnlockedFlash};
use stm32f4xx_hal::pac::{FLASH, IWDG};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::watchdog::IndependentWatchdog;
use tactomo_board_common::WATCHDOG_TIMEOUT_MS;
use tactomo_board_common::bounded::within;
use tactomo_firmware::{ContactFinder, FlashStore, View};

use crate::inputs::ELECTRODES;

/// Where the sectors begin in flash, and their length: sectors 11 and 10 of 12, which `memory.x` keeps free of code.
const SECTORS_AT: [u32; 2] = [0xE_0000, 0xC_0000];
const SECTOR_BYTES: usize = 128 * 1024;
/// The watchdog's time while a sector is erased (ms). By the data sheet that takes 2 s and at most 4 s, with bytes written one at a time as the driver does,
/// and the watchdog's clock of 32 kHz may have 47: these are 5.4 s at least. No code runs meanwhile, as it is in the same flash.
const ERASE_TIMEOUT_MS: u32 = 8000;
/// Looks at the watchdog before its new time counts as taken, which is after five of its clock's cycles: ten times that, at some 5 cycles of 168 MHz a look.
const MAX_LOOKS: u32 = 100_000;
/// Marks of operations that failed (`OPERR`, `WRPERR`, `PGAERR`, `PGPERR`, `PGSERR` of `FLASH_SR`), which whoever flashed the chip may have left too.
const FAILURES: u32 = 0xF2;

/// Finds contacts by a table in flash.
pub type Finder = ContactFinder<FlashStore<Flash, Mapped>, { ELECTRODES as usize * ELECTRODES as usize }>;

/// Finds contacts by the table that is in flash, or will be.
pub fn finder(flash: FLASH) -> Finder {
    ContactFinder::new(FlashStore::new(Flash(flash), Mapped { at: SECTORS_AT[0] }, SECTORS_AT))
}

/// The chip's flash, locked but while it is erased or written.
pub struct Flash(FLASH);

impl Flash {
    /// Erases or writes.
    fn change(&mut self, change: impl FnOnce(&mut UnlockedFlash) -> Result<(), Error>) -> Result<(), Error> {
        // SAFETY: marks that are cleared by writing a 1, and no others.
        self.0.sr().write(|w| unsafe { w.bits(FAILURES) });
        let result = change(&mut self.0.unlocked());
        // The data cache may hold what was there before. It is only emptied while it is off.
        self.0.acr().modify(|_, w| w.dcen().clear_bit());
        self.0.acr().modify(|_, w| w.dcrst().set_bit());
        self.0.acr().modify(|_, w| w.dcrst().clear_bit());
        self.0.acr().modify(|_, w| w.dcen().set_bit());
        compiler_fence(Ordering::SeqCst);
        result
    }
}

impl ErrorType for Flash {
    type Error = Error;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        let place = self.0.read().get(offset as usize..).and_then(|rest| rest.get(..bytes.len()));
        place.map(|place| bytes.copy_from_slice(place)).ok_or(Error::Operation)
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for Flash {
    // So that bytes can be read where they lie as they come.
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        set_watchdog(ERASE_TIMEOUT_MS);
        let result = self.change(|flash| NorFlash::erase(flash, from, to));
        set_watchdog(WATCHDOG_TIMEOUT_MS);
        result
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        self.change(|flash| flash.write(offset, bytes))
    }
}

/// Bits that are ones may be cleared in words that were written ("Flash memory programming" of the reference manual RM0090).
impl MultiwriteNorFlash for Flash {}

/// Sets the watchdog's time anew and begins it.
fn set_watchdog(timeout_ms: u32) {
    // SAFETY: the board's own is not used meanwhile, and keeps nothing but such a handle.
    let [registers, handle] = [(), ()].map(|()| unsafe { IWDG::steal() });
    let mut watchdog = IndependentWatchdog::new(handle);
    watchdog.start(timeout_ms.millis());
    // The time that it begins with is the old one until the new one has come over into its clock.
    let _ = within(MAX_LOOKS, || {
        let status = registers.sr().read();
        (status.pvu().bit_is_clear() && status.rvu().bit_is_clear()).then_some(())
    });
    watchdog.feed();
}

/// A sector, where it lies.
pub struct Mapped {
    at: u32,
}

impl View<Flash> for Mapped {
    fn bytes<'a>(&'a self, flash: &'a Flash) -> &'a [u8] {
        flash.0.read().get(self.at as usize..).and_then(|rest| rest.get(..SECTOR_BYTES)).unwrap_or_default()
    }

    fn open(&mut self, _flash: &mut Flash, base: u32) -> bool {
        self.at = base;
        true
    }
}
