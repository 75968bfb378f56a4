//! What the ADCs of Espressif's chips have in common.

use esp_hal::analog::adc::{AdcCalScheme, Attenuation};
use tactomo_protocol::{ConverterErrors, Range};

/// Range of the inputs: up to about 3.1 V (ESP32) or 2.5 V (ESP32-C3), which holds the 2 V of the driving layer.
pub const ATTENUATION: Attenuation = Attenuation::_11dB;

/// Bits of a conversion.
const BITS: u8 = 12;
/// Largest code of a conversion.
pub const MAX_CODE: u16 = (1 << BITS) - 1;
/// Looks at the ADC before a conversion is given up: 0.2 ms at least, some ten times what a conversion takes.
pub const MAX_POLLS: u32 = 4_000;

/// How far calibrated readings are from the voltages, from chip to chip: noise as a user of an ESP32 published nine conversions; gain and bow
/// share the total error of the chip's data sheet after calibration. The figures of the simulated boards are the same, and their sources
/// are beside those (`host/board/src/simulated/model.rs`).
#[cfg(feature = "esp32")]
const ERRORS: ConverterErrors = ConverterErrors { noise_uv: 5000, gain_ppm: 10_000, bow_uv: 12_000 };
#[cfg(not(feature = "esp32"))]
const ERRORS: ConverterErrors = ConverterErrors { noise_uv: 5000, gain_ppm: 5000, bow_uv: 5000 };

/// What calibrated readings mean: they are millivolts, so `2^BITS` of them are full scale, and each ADC sees its range.
pub fn millivolts(ranges: &[Range]) -> tactomo_firmware::Adc {
    tactomo_firmware::Adc::new(BITS, 1 << BITS).with_ranges(ranges)
}

/// What an ADC sees, which `electrodes` share: the readings that its calibration makes of its lowest and its highest code (mV).
pub fn range<Unit, Calibration: AdcCalScheme<Unit>>(electrodes: u8) -> Range {
    let calibration = Calibration::new_cal(ATTENUATION);
    // A calibration that lies outside the scale says nothing of the scale's ends.
    let ceiling = calibration.adc_val(MAX_CODE).clamp(1, MAX_CODE);
    Range { electrodes, floor: calibration.adc_val(0).min(ceiling - 1), ceiling, errors: ERRORS }
}
