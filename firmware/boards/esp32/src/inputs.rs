//! Which pin reads which electrode.
//!
//! esp-hal does not tie a pin to the ADC unit that it is wired to: the wrong unit compiles and reads another pin. So the
//! table below is the one place that says it, and it is checked against the chip's own map when it compiles.

use esp_hal::analog::adc::{AdcCalLine, AdcCalScheme, AdcChannel, AdcConfig};
use esp_hal::peripherals::{
    ADC1, ADC2, GPIO0, GPIO2, GPIO4, GPIO12, GPIO13, GPIO14, GPIO15, GPIO25, GPIO26, GPIO27, GPIO32, GPIO33, GPIO34,
    GPIO35, GPIO36, GPIO39,
};
use tactomo_board_common::converters::Converters;
use tactomo_board_common::range::{self, ESP32_ELECTRODES};
use tactomo_board_espressif::ELECTRODES;
use tactomo_board_espressif::analog::ATTENUATION;
use tactomo_firmware::{Adc, SideBySide};

use crate::converters::Registers;

/// GPIO of each channel of ADC1 (37 and 38 are not on the module), from the chip's data sheet.
const ADC1_GPIO: [u8; 8] = [36, 37, 38, 39, 32, 33, 34, 35];
/// GPIO of each channel of ADC2.
const ADC2_GPIO: [u8; 10] = [4, 0, 2, 15, 13, 12, 14, 27, 25, 26];

macro_rules! inputs {
    (ADC1: $($electrode1:literal $pin1:ident $gpio1:ident),*; ADC2: $($electrode2:literal $pin2:ident $gpio2:ident),*;) => {
        /// The pins that the inputs take.
        #[allow(missing_docs, reason = "the fields are called like the pins")]
        pub struct InputPins<'d> {
            $(pub $pin1: $gpio1<'d>,)*
            $(pub $pin2: $gpio2<'d>,)*
        }

        /// Takes the ADCs and the pins, and reads the calibration from the chip's fuses.
        pub fn new<'d>(adc1: ADC1<'d>, adc2: ADC2<'d>, pins: InputPins<'d>) -> Inputs<'d> {
            let (mut config1, mut config2) = (AdcConfig::new(), AdcConfig::new());
            let channels = [
                $(config1.enable_pin(pins.$pin1, ATTENUATION).pin.adc_channel(),)*
                $(config2.enable_pin(pins.$pin2, ATTENUATION).pin.adc_channel(),)*
            ];
            let registers = Registers::new(adc1, config1, adc2, config2);
            SideBySide::new(Converters::new(registers, channels), ESP32_ELECTRODES[0])
        }

        const _: () = {
            $(assert!(has(&ADC1_GPIO, stringify!($gpio1)), "this pin is not an input of ADC1");)*
            $(assert!(has(&ADC2_GPIO, stringify!($gpio2)), "this pin is not an input of ADC2");)*
            assert!([$($electrode1,)*].len() == ESP32_ELECTRODES[0] as usize);
            assert!([$($electrode2,)*].len() == ESP32_ELECTRODES[1] as usize);
            let electrodes = [$($electrode1,)* $($electrode2,)*];
            let mut next = 0;
            while next < electrodes.len() {
                assert!(electrodes[next] == next, "the electrodes are not in order");
                next += 1;
            }
            assert!(electrodes.len() == ELECTRODES as usize);
        };
    };
}

/// The two ADCs and their sixteen inputs, one for each electrode.
pub type Inputs<'d> = SideBySide<Converters<Registers<'d>, { ELECTRODES as usize }>>;

// Electrode and pin, in the order of the ADCs' channels.
inputs! {
    ADC1: 0 gpio36 GPIO36, 1 gpio39 GPIO39, 2 gpio32 GPIO32, 3 gpio33 GPIO33, 4 gpio34 GPIO34, 5 gpio35 GPIO35;
    ADC2: 6 gpio4 GPIO4, 7 gpio0 GPIO0, 8 gpio2 GPIO2, 9 gpio15 GPIO15, 10 gpio13 GPIO13, 11 gpio12 GPIO12,
        12 gpio14 GPIO14, 13 gpio27 GPIO27, 14 gpio25 GPIO25, 15 gpio26 GPIO26;
}

/// What the readings mean: the electrodes of ADC1 come first, those of ADC2 follow.
pub fn adc() -> Adc {
    let first = <AdcCalLine<ADC1> as AdcCalScheme<ADC1>>::new_cal(ATTENUATION);
    let second = <AdcCalLine<ADC2> as AdcCalScheme<ADC2>>::new_cal(ATTENUATION);
    range::esp32([&|code| first.adc_val(code), &|code| second.adc_val(code)])
}

/// Whether an ADC with these GPIOs has the pin called `name`, such as `GPIO36`.
const fn has(gpios: &[u8], name: &str) -> bool {
    let mut digits = name.as_bytes();
    let mut number = 0;
    while let [first, rest @ ..] = digits {
        if first.is_ascii_digit() {
            number = number * 10 + (*first - b'0');
        }
        digits = rest;
    }
    let mut next = 0;
    while next < gpios.len() {
        if gpios[next] == number {
            return true;
        }
        next += 1;
    }
    false
}
