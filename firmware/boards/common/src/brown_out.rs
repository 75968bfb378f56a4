//! The ESP32's detector of a supply that sags, which esp-hal leaves alone.

/// The first silicon that starts again after such a reset, as major and minor version in hundreds; that of v0 does not (Espressif's errata).
const FIRST_REVISION: u16 = 100;
/// Threshold of the detector: the lowest of eight, 2.43 V.
const LOWEST: u8 = 0;
/// Longest that a reset waits, in cycles of the slow clock: 7 ms at 150 kHz.
const WAIT_CYCLES: u16 = 0x3FF;

/// The registers of the detector.
pub trait Detector {
    /// Revision of the chip's silicon: a hundred times the major one, and the minor one.
    fn revision(&self) -> u16;

    /// Resets the chip from now on when its supply is below the threshold of this number (0 to 7), so many cycles (of ten bits) after it is back;
    /// meanwhile flash and radio are off.
    fn reset_below(&mut self, threshold: u8, wait_cycles: u16);
}

/// Resets the chip when its supply falls below about 2.43 V, before flash and logic do what they like; on silicon that would not start again
/// nothing is done.
pub fn enable(detector: &mut impl Detector) {
    if detector.revision() >= FIRST_REVISION {
        detector.reset_below(LOWEST, WAIT_CYCLES);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Chip(u16, Option<(u8, u16)>);

    impl Detector for Chip {
        fn revision(&self) -> u16 {
            self.0
        }

        fn reset_below(&mut self, threshold: u8, wait_cycles: u16) {
            assert!(threshold < 8 && wait_cycles < 1024, "the registers' fields");
            self.1 = Some((threshold, wait_cycles));
        }
    }

    #[test]
    fn silicon_that_would_not_start_again_is_left_alone() {
        for (revision, is_on) in
            [(0, false), (1, false), (99, false), (100, true), (101, true), (300, true), (301, true)]
        {
            let mut chip = Chip(revision, None);
            enable(&mut chip);
            assert_eq!(chip.1, is_on.then_some((0, 1023)), "revision {revision}");
        }
    }
}
