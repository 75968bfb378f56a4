//! The chip's two ADCs, which convert side by side.
//!
//! esp-hal's driver sets them up, but it waits for a conversion that it has begun before it begins another, for ever if that hangs. So what
//! starts, reads and restarts a conversion is here: the driver's own steps, with a bound.

use esp_hal::Blocking;
use esp_hal::analog::adc::{Adc, AdcCalLine, AdcCalScheme, AdcConfig, RegisterAccess};
use esp_hal::peripherals::{ADC1, ADC2, SENS};
use tactomo_board_espressif::analog::{ATTENUATION, MAX_CODE, MAX_POLLS};
use tactomo_firmware::TimedOut;

/// `force_xpd_sar` of the register `SENS_SAR_MEAS_WAIT2`: both ADCs' analogue side off, and on.
const POWER_OFF: u8 = 0b10;
const POWER_ON: u8 = 0b11;

/// Channel of a pin at its ADC.
#[derive(Clone, Copy)]
pub struct Channel(pub u8);

/// ADC1 and ADC2, set up and calibrated.
pub struct Converters<'d> {
    // Held for what they have set up, and so that nobody else uses them.
    _adc1: Adc<'d, ADC1<'d>, Blocking>,
    _adc2: Adc<'d, ADC2<'d>, Blocking>,
    calibration1: AdcCalLine<ADC1<'d>>,
    calibration2: AdcCalLine<ADC2<'d>>,
}

impl<'d> Converters<'d> {
    /// Sets the ADCs up with the pins that were enabled, and reads the calibration from the chip's fuses.
    pub fn new(adc1: ADC1<'d>, config1: AdcConfig<ADC1<'d>>, adc2: ADC2<'d>, config2: AdcConfig<ADC2<'d>>) -> Self {
        Self {
            _adc1: Adc::new(adc1, config1),
            _adc2: Adc::new(adc2, config2),
            calibration1: AdcCalScheme::new_cal(ATTENUATION),
            calibration2: AdcCalScheme::new_cal(ATTENUATION),
        }
    }

    /// Converts a channel of ADC1, one of ADC2, or both at once (mV). What comes of the one that was not asked for means nothing.
    pub fn convert(&mut self, [channel1, channel2]: [Option<Channel>; 2]) -> [Result<u16, TimedOut>; 2] {
        wait_until_idle();
        channel1.into_iter().for_each(start::<ADC1>);
        channel2.into_iter().for_each(start::<ADC2>);
        let (mut code1, mut code2) = (channel1.is_none().then_some(0), channel2.is_none().then_some(0));
        for _ in 0..MAX_POLLS {
            code1 = code1.or_else(code::<ADC1>);
            code2 = code2.or_else(code::<ADC2>);
            if code1.is_some() && code2.is_some() {
                break;
            }
        }
        let millivolts1 = code1.map(|code| self.calibration1.adc_val(code));
        let millivolts2 = code2.map(|code| self.calibration2.adc_val(code));
        [millivolts1.ok_or(TimedOut), millivolts2.ok_or(TimedOut)]
    }

    /// Takes the power from both ADCs and gives it back. A conversion that comes late after all is thrown away, in place of one that nobody
    /// wants.
    pub fn restart(&mut self) {
        ADC1::clear_start_sar();
        ADC2::clear_start_sar();
        for power in [POWER_OFF, POWER_ON] {
            // SAFETY: a value of two bits, which the field has.
            SENS::regs().sar_meas_wait2().modify(|_, w| unsafe { w.force_xpd_sar().bits(power) });
        }
        // Both have a pin at channel 0.
        let _ = self.convert([Some(Channel(0)), Some(Channel(0))]);
    }
}

/// Waits, with a bound, until the state machine of the last conversion is at rest, as a start needs it.
fn wait_until_idle() {
    let mut status = (0..MAX_POLLS).map(|_| SENS::regs().sar_slave_addr1().read().meas_status().bits());
    let _ = status.find(|status| *status == 0);
}

/// Starts a conversion. The start bit falls first, with which an earlier one is done with.
fn start<Unit: RegisterAccess>(channel: Channel) {
    Unit::set_en_pad(channel.0);
    Unit::clear_start_sar();
    Unit::set_start_sar();
}

/// The code of the conversion under way, once it is done.
fn code<Unit: RegisterAccess>() -> Option<u16> {
    Unit::read_done_sar().then(|| Unit::read_data_sar().min(MAX_CODE))
}
