//! Which quartz an STM32 board has, told by the oscillator inside the chip.

/// Quartzes that boards with this chip have (MHz).
const USUAL_MHZ: [u32; 4] = [8, 12, 16, 25];
/// The oscillator inside (MHz): within 8 % over all temperatures (STM32F405 data sheet, "High-speed internal (HSI) RC oscillator").
const INSIDE_MHZ: u32 = 16;
/// So far from a usual one a measurement may be (percent): that, and a step of the count.
const WITHIN_PERCENT: u32 = 10;

/// The quartz (MHz) of which so many cycles take so many of the oscillator inside; `None` if it is no usual one.
pub fn usual_mhz(cycles: u32, inside_cycles: u32) -> Option<u32> {
    // Of the quartz at its own frequency the oscillator inside makes so many meanwhile.
    let expected = |mhz: u32| cycles * INSIDE_MHZ / mhz;
    USUAL_MHZ.into_iter().find(|mhz| 100 * expected(*mhz).abs_diff(inside_cycles) <= WITHIN_PERCENT * expected(*mhz))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_usual_quartz_is_told_by_an_oscillator_that_is_8_percent_off_and_others_are_none() {
        for mhz in 1..60 {
            for percent in [92, 100, 104, 108] {
                let found = usual_mhz(248, 248 * 16 * percent / 100 / mhz);
                if USUAL_MHZ.contains(&mhz) {
                    assert_eq!(found, Some(mhz), "{mhz} MHz at {percent} %");
                }
                // Never one that is a quarter off: the chip would run too fast.
                assert!(found.is_none_or(|found| 4 * found.abs_diff(mhz) < mhz), "{mhz} MHz at {percent} %: {found:?}");
            }
        }
        assert_eq!([4, 10, 20, 32, 50].map(|mhz| usual_mhz(248, 248 * 16 / mhz)), [None; 5]);
        assert_eq!(usual_mhz(248, 0), None);
    }
}
