//! The registers of the detector of a supply that sags.

use esp_hal::efuse::chip_revision;
use esp_hal::peripherals::LPWR;
use tactomo_board_common::brown_out::Detector;

struct Registers;

impl Detector for Registers {
    fn revision(&self) -> u16 {
        chip_revision().combined()
    }

    fn reset_below(&mut self, threshold: u8, wait_cycles: u16) {
        // SAFETY: values within their fields of three and of ten bits.
        LPWR::regs().brown_out().modify(|_, w| unsafe {
            w.close_flash_ena().set_bit();
            w.pd_rf_ena().set_bit();
            w.dbrown_out_thres().bits(threshold);
            w.rst_wait().bits(wait_cycles);
            w.rst_ena().set_bit();
            w.ena().set_bit()
        });
    }
}

/// Resets the chip when its supply falls below about 2.43 V, where its silicon allows it.
pub fn enable() {
    tactomo_board_common::brown_out::enable(&mut Registers);
}
