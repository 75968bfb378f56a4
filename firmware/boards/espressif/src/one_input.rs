//! The one ADC input, at the drain of the multiplexer's half B: GPIO 0 on both chips.

use esp_hal::Blocking;
use esp_hal::analog::adc::{Adc as Driver, AdcCalCurve, AdcCalScheme, AdcConfig, AdcPin, RegisterAccess};
use esp_hal::peripherals::{ADC1, GPIO0};
use tactomo_board_common::bounded::within;
use tactomo_board_common::converters::MAX_LOOKS;
use tactomo_board_common::range;
use tactomo_firmware::{Adc, Sampler, TimedOut};

use crate::ELECTRODES;
use crate::analog::ATTENUATION;

/// ADC1 and its calibrated pin.
pub struct OneInput<'d> {
    adc: Driver<'d, ADC1<'d>, Blocking>,
    pin: AdcPin<GPIO0<'d>, ADC1<'d>, AdcCalCurve<ADC1<'d>>>,
}

impl<'d> OneInput<'d> {
    /// Takes the ADC and its pin, and reads the calibration from the chip's fuses.
    pub fn new(adc: ADC1<'d>, pin: GPIO0<'d>) -> Self {
        let mut config = AdcConfig::new();
        let pin = config.enable_pin_with_cal(pin, ATTENUATION);
        Self { adc: Driver::new(adc, config), pin }
    }

    /// What the readings mean.
    pub fn adc() -> Adc {
        let calibration = <AdcCalCurve<ADC1> as AdcCalScheme<ADC1>>::new_cal(ATTENUATION);
        range::curve(ELECTRODES, &|code| calibration.adc_val(code))
    }
}

impl Sampler for OneInput<'_> {
    /// The multiplexer has brought the electrode to the pin.
    fn sample(&mut self, _electrode: u8) -> Result<u16, TimedOut> {
        // Takes back the mark of a conversion that came too late.
        ADC1::reset();
        within(MAX_LOOKS, || self.adc.read_oneshot(&mut self.pin).ok())
    }

    /// Sets the ADC up anew: the driver waits for ever for a conversion that it has begun.
    fn restart(&mut self) {
        // SAFETY: in place of the ones that this sampler owns, which go with its old value.
        let (adc, pin) = unsafe { (ADC1::steal(), GPIO0::steal()) };
        *self = Self::new(adc, pin);
    }
}
