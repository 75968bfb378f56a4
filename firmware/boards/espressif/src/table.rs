//! The table that contacts are found by, in the module's flash.

use esp_hal::peripherals::FLASH;
use esp_storage::FlashStorage;
use static_cell::ConstStaticCell;
use tactomo_firmware::{ContactFinder, FlashStore, RamCopy};

use crate::ELECTRODES;

/// Where it lies: the last 128 kB of the 4 MB that all these modules have at least. That is the end of espflash's `factory` partition, whose image is
/// looked at by the boot loader no further than it is long.
const TABLE_AT: u32 = 0x3E_0000;
/// Room for it (bytes). An ESP32 has 192 kB of memory for this and a stack of 67 kB.
const ROOM: usize = 112 * 1024;

/// The table while the board runs. It is a copy in memory: so nothing has to be mapped, and no line of the flash's cache can be of an older table.
static TABLE: ConstStaticCell<[u8; ROOM]> = ConstStaticCell::new([0; ROOM]);

/// Finds contacts by a table in flash.
pub type Finder = ContactFinder<
    FlashStore<FlashStorage<'static>, RamCopy<&'static mut [u8]>>,
    { ELECTRODES as usize * ELECTRODES as usize },
>;

/// Finds contacts by the table that is in flash, or will be. To be called once.
///
/// The driver erases and writes by functions of the chip's ROM with interrupts off, which this firmware has none of; the second core of an ESP32 does not
/// run. The longest, erasing a sector of 4 kB, takes 45 ms, and by the flash's data sheet (W25Q32JV) 400 ms at most: the watchdog waits longer.
pub fn finder(flash: FLASH<'static>) -> Finder {
    let copy = RamCopy::new(&mut TABLE.take()[..]);
    ContactFinder::new(FlashStore::new(FlashStorage::new(flash), copy, TABLE_AT))
}
