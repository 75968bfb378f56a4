//! The one ADC input, at the drain of the multiplexer's half B: GPIO 0 on both chips.

use esp_hal::analog::adc::{AdcCalCurve, AdcConfig, AdcPin};
use esp_hal::peripherals::{ADC1, GPIO0};
use tactomo_firmware::{Adc, Sampler, TimedOut};

use crate::analog::{ATTENUATION, AnalogUnit, millivolts, range};

/// Electrodes of the board.
pub const ELECTRODES: u8 = 16;

/// ADC1 and its calibrated pin.
pub struct OneInput<'d> {
    adc: AnalogUnit<'d, ADC1<'d>>,
    pin: AdcPin<GPIO0<'d>, ADC1<'d>, AdcCalCurve<ADC1<'d>>>,
}

impl<'d> OneInput<'d> {
    /// Takes the ADC and its pin, and reads the calibration from the chip's fuses.
    pub fn new(adc: ADC1<'d>, pin: GPIO0<'d>) -> Self {
        let mut config = AdcConfig::new();
        let pin = config.enable_pin_with_cal(pin, ATTENUATION);
        Self { adc: AnalogUnit::new(adc, config), pin }
    }

    /// What the readings mean.
    pub fn adc() -> Adc {
        millivolts(&[range::<_, AdcCalCurve<ADC1>>(ELECTRODES)])
    }
}

impl Sampler for OneInput<'_> {
    /// The multiplexer has brought the electrode to the pin.
    fn sample(&mut self, _electrode: u8) -> Result<u16, TimedOut> {
        self.adc.convert(&mut self.pin)
    }
}
