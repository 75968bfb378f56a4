//! The table that contacts are found by, and room for a new one, in the module's flash.

use esp_hal::peripherals::FLASH;
use esp_storage::FlashStorage;
use tactomo_firmware::{ContactFinder, FlashStore, RamCopy};

use crate::ELECTRODES;

/// Where they lie: the last 256 kB of the 4 MB that all these modules have at least. That is the end of espflash's `factory` partition, whose image is
/// looked at by the boot loader no further than it is long.
const TABLES_AT: [u32; 2] = [0x3E_0000, 0x3C_0000];
/// Room for each (bytes).
const ROOM: usize = 108 * 1024;

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
    ContactFinder::new(FlashStore::new(FlashStorage::new(flash), RamCopy::new(memory()), TABLES_AT))
}

/// The table while the board runs. It is a copy in memory: so nothing has to be mapped, and no line of the flash's cache can be of an older table.
#[cfg(not(feature = "esp32"))]
fn memory() -> &'static mut [u8] {
    static TABLE: static_cell::ConstStaticCell<[u8; ROOM]> = static_cell::ConstStaticCell::new([0; ROOM]);
    &mut TABLE.take()[..]
}

/// As on the other chips, but at the end of the data memory, which esp-hal's linker script leaves to nobody (`dram2_seg`) or to the stack that the ROM sets up
/// for the second core, which never runs. The memory before it is for the stack alone: with a table there, it would be too small.
#[cfg(feature = "esp32")]
fn memory() -> &'static mut [u8] {
    const END: usize = 0x4000_0000;
    let first = core::ptr::with_exposed_provenance_mut::<u8>(END - ROOM);
    // SAFETY: memory from 0x3FFE5000 on, which nothing else uses: behind the ROM's data of both cores (until 0x3FFE4350; ESP-IDF's `memory_layout.c`), and no static is put into
    // `.dram2_uninit`. The driver of the flash exists once, so this comes once.
    unsafe {
        first.write_bytes(0, ROOM);
        core::slice::from_raw_parts_mut(first, ROOM)
    }
}
