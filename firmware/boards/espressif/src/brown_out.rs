//! The detector of a supply that sags, which esp-hal leaves alone.

use esp_hal::efuse::{ChipRevision, chip_revision};
use esp_hal::peripherals::LPWR;

/// The first silicon that starts again after such a reset; that of v0 does not (Espressif's errata).
const FIRST_REVISION: ChipRevision = ChipRevision::from_combined(100);
/// Threshold of the detector: the lowest of eight, 2.43 V.
const LOWEST: u8 = 0;
/// Longest that a reset waits, in cycles of the slow clock: 7 ms at 150 kHz.
const WAIT_CYCLES: u16 = 0x3FF;

/// Resets the chip when its supply falls below about 2.43 V, before flash and logic do what they like.
pub fn enable() {
    if chip_revision() < FIRST_REVISION {
        return;
    }
    // SAFETY: values within their fields.
    LPWR::regs().brown_out().modify(|_, w| unsafe {
        w.close_flash_ena().set_bit();
        w.pd_rf_ena().set_bit();
        w.dbrown_out_thres().bits(LOWEST);
        w.rst_wait().bits(WAIT_CYCLES);
        w.rst_ena().set_bit();
        w.ena().set_bit()
    });
}
