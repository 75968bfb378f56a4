//! Calibrated conversions that cannot hang.

use esp_hal::Blocking;
use esp_hal::analog::adc::{Adc, AdcCalScheme, AdcChannel, AdcConfig, AdcPin, Attenuation, RegisterAccess};
use tactomo_firmware::TimedOut;

/// Range of the inputs: up to about 3.1 V (ESP32) or 2.5 V (ESP32-C3), which holds the 2 V of the driving layer.
pub const ATTENUATION: Attenuation = Attenuation::_11dB;

/// Bits of a conversion.
const BITS: u8 = 12;
/// Largest code of a conversion.
const MAX_CODE: u16 = (1 << BITS) - 1;
/// Looks at the ADC before a conversion is given up: 0.2 ms at least, some ten times what a conversion takes.
const MAX_POLLS: u32 = 4_000;

/// What calibrated readings mean: they are millivolts, so `2^BITS` of them are full scale, and the end of the ADC's scale
/// lies at `ceiling_mv`.
pub const fn millivolts(ceiling_mv: u16) -> tactomo_firmware::Adc {
    tactomo_firmware::Adc { bits: BITS, full_scale_mv: 1 << BITS, saturated_from: ceiling_mv }
}

/// Reading at the end of the ADC's scale (mV), by its calibration.
pub fn ceiling_mv<Unit, Calibration: AdcCalScheme<Unit>>() -> u16 {
    Calibration::new_cal(ATTENUATION).adc_val(MAX_CODE)
}

/// An ADC.
pub struct AnalogUnit<'d, Unit>(Adc<'d, Unit, Blocking>);

impl<'d, Unit: RegisterAccess + 'd> AnalogUnit<'d, Unit> {
    /// Starts the ADC.
    pub fn new(unit: Unit, config: AdcConfig<Unit>) -> Self {
        Self(Adc::new(unit, config))
    }

    /// Converts the voltage at a pin that was enabled in the configuration (mV).
    ///
    /// # Errors
    /// [`TimedOut`] if that took too long. Another pin of the same unit then times out too, until the conversion is done.
    pub fn convert<Pin: AdcChannel>(
        &mut self,
        pin: &mut AdcPin<Pin, Unit, impl AdcCalScheme<Unit>>,
    ) -> Result<u16, TimedOut> {
        (0..MAX_POLLS).find_map(|_| self.0.read_oneshot(pin).ok()).ok_or(TimedOut)
    }
}
