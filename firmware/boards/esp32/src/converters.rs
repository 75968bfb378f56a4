//! The registers of the chip's two ADCs.

use esp_hal::Blocking;
use esp_hal::analog::adc::{Adc, AdcCalLine, AdcCalScheme, AdcConfig, RegisterAccess};
use esp_hal::peripherals::{ADC1, ADC2, SENS};
use tactomo_board_common::converters::Units;
use tactomo_board_common::range::MAX_CODE;
use tactomo_board_espressif::analog::ATTENUATION;

/// `force_xpd_sar` of the register `SENS_SAR_MEAS_WAIT2`: both ADCs' analogue side off, and on.
const POWER_OFF: u8 = 0b10;
const POWER_ON: u8 = 0b11;

/// ADC1 and ADC2, set up and calibrated.
pub struct Registers<'d> {
    // Held for what they have set up, and so that nobody else uses them.
    _adc1: Adc<'d, ADC1<'d>, Blocking>,
    _adc2: Adc<'d, ADC2<'d>, Blocking>,
    calibration1: AdcCalLine<ADC1<'d>>,
    calibration2: AdcCalLine<ADC2<'d>>,
}

impl<'d> Registers<'d> {
    /// Sets the ADCs up with the pins that were enabled, and reads the calibration from the chip's fuses.
    pub fn new(adc1: ADC1<'d>, config1: AdcConfig<ADC1<'d>>, adc2: ADC2<'d>, config2: AdcConfig<ADC2<'d>>) -> Self {
        Self {
            _adc1: Adc::new(adc1, config1),
            _adc2: Adc::new(adc2, config2),
            calibration1: AdcCalScheme::new_cal(ATTENUATION),
            calibration2: AdcCalScheme::new_cal(ATTENUATION),
        }
    }
}

impl Units for Registers<'_> {
    fn are_at_rest(&mut self) -> bool {
        SENS::regs().sar_slave_addr1().read().meas_status().bits() == 0
    }

    fn start(&mut self, unit: usize, channel: u8) {
        if unit == 0 { start::<ADC1>(channel) } else { start::<ADC2>(channel) }
    }

    fn reading(&mut self, unit: usize) -> Option<u16> {
        if unit == 0 {
            code::<ADC1>().map(|code| self.calibration1.adc_val(code))
        } else {
            code::<ADC2>().map(|code| self.calibration2.adc_val(code))
        }
    }

    fn stop(&mut self, unit: usize) {
        if unit == 0 { ADC1::clear_start_sar() } else { ADC2::clear_start_sar() }
    }

    fn power(&mut self, on: bool) {
        let power = if on { POWER_ON } else { POWER_OFF };
        // SAFETY: a value of two bits, which the field has.
        SENS::regs().sar_meas_wait2().modify(|_, w| unsafe { w.force_xpd_sar().bits(power) });
    }
}

fn start<Unit: RegisterAccess>(channel: u8) {
    Unit::set_en_pad(channel);
    Unit::clear_start_sar();
    Unit::set_start_sar();
}

fn code<Unit: RegisterAccess>() -> Option<u16> {
    Unit::read_done_sar().then(|| Unit::read_data_sar().min(MAX_CODE))
}
