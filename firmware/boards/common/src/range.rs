//! What the calibrated ADCs of Espressif's chips see: readings in millivolts, from what code 0 reads to what the largest reads.

use tactomo_firmware::Adc;
use tactomo_protocol::{ConverterErrors, Range};

/// Bits of a conversion.
const BITS: u8 = 12;
/// Largest code of a conversion.
pub const MAX_CODE: u16 = (1 << BITS) - 1;
/// Electrodes at the ESP32's ADC1, which come first, and at its ADC2.
pub const ESP32_ELECTRODES: [u8; 2] = [6, 10];

/// How far calibrated readings are from the voltages, from chip to chip: noise as a user of an ESP32 published nine conversions; gain and bow
/// share the total error of the chip's data sheet after calibration. The figures of the simulated boards are the same, and their sources
/// are beside those (`host/board/src/simulated/model.rs`).
const ESP32_ERRORS: ConverterErrors = ConverterErrors { noise_uv: 5000, gain_ppm: 10_000, bow_uv: 12_000 };
/// How far calibrated readings are from the voltages of chips whose calibration is a curve: ESP32-C3 and C6.
const CURVE_ERRORS: ConverterErrors = ConverterErrors { noise_uv: 5000, gain_ppm: 5000, bow_uv: 5000 };

/// What the ESP32's two ADCs read, each by its own calibration, which makes millivolts of a code.
pub fn esp32(calibrated: [&dyn Fn(u16) -> u16; 2]) -> Adc {
    let [first, second] = [0, 1].map(|unit| range(ESP32_ELECTRODES[unit], ESP32_ERRORS, calibrated[unit]));
    millivolts(&[first, second])
}

/// What the one ADC of an ESP32-C3 or C6 reads of so many electrodes, by its calibration.
pub fn curve(electrodes: u8, calibrated: &dyn Fn(u16) -> u16) -> Adc {
    millivolts(&[range(electrodes, CURVE_ERRORS, calibrated)])
}

/// Calibrated readings are millivolts, so `2^BITS` of them are full scale.
fn millivolts(ranges: &[Range]) -> Adc {
    Adc::new(BITS, 1 << BITS).with_ranges(ranges)
}

/// What an ADC sees: the readings that its calibration makes of its lowest and its highest code (mV).
fn range(electrodes: u8, errors: ConverterErrors, calibrated: &dyn Fn(u16) -> u16) -> Range {
    // A calibration that lies outside the scale says nothing of the scale's ends.
    let ceiling = calibrated(MAX_CODE).clamp(1, MAX_CODE);
    Range { electrodes, floor: calibrated(0).min(ceiling - 1), ceiling, errors }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends(adc: &Adc) -> [(u8, u16, u16); 2] {
        [0, 1].map(|at| (adc.ranges[at].electrodes, adc.ranges[at].floor, adc.ranges[at].ceiling))
    }

    #[test]
    fn each_adc_of_an_esp32_has_its_own_floor_and_electrodes() {
        let line = |floor: u16, slope: u32| move |code: u16| floor + (u32::from(code) * slope / 1000) as u16;
        let adc = esp32([&line(142, 723), &line(128, 721)]);
        assert_eq!((adc.bits, adc.full_scale_mv), (12, 4096));
        assert_eq!(ends(&adc), [(6, 142, 3102), (10, 128, 3080)], "ADC1 first, the floors are what code 0 reads");
        assert_eq!(adc.ranges[1].errors, ESP32_ERRORS);
        assert_eq!(adc.ranges[2].electrodes, 0, "and there is no third");
    }

    #[test]
    fn the_one_adc_of_a_c3_has_all_electrodes() {
        let adc = curve(16, &|code| code / 2 + code / 10);
        assert_eq!(ends(&adc)[0], (16, 0, 2047 + 409));
        assert_eq!((adc.ranges[0].errors, adc.ranges[1].electrodes), (CURVE_ERRORS, 0));
    }

    #[test]
    fn a_calibration_beyond_the_scale_leaves_a_range_that_a_hello_may_have() {
        let wild: [&dyn Fn(u16) -> u16; 3] = [&|_| u16::MAX, &|_| 0, &|code| u16::MAX - code];
        for calibrated in wild {
            let (_, floor, ceiling) = ends(&curve(16, calibrated))[0];
            assert!(floor < ceiling && ceiling <= MAX_CODE, "{floor} to {ceiling}");
        }
        assert_eq!(ends(&curve(16, &|_| 0))[0], (16, 0, 1));
    }
}
