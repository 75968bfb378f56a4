//! Which pin reads which electrode.
//!
//! esp-hal does not tie a pin to the ADC unit that it is wired to: the wrong unit compiles and reads another pin. So the
//! table below is the one place that says it, and it is checked against the chip's own map when it compiles.

use esp_hal::analog::adc::{AdcCalLine, AdcChannel, AdcConfig};
use esp_hal::peripherals::{
    ADC1, ADC2, GPIO0, GPIO2, GPIO4, GPIO12, GPIO13, GPIO14, GPIO15, GPIO25, GPIO26, GPIO27, GPIO32, GPIO33, GPIO34,
    GPIO35, GPIO36, GPIO39,
};
use tactomo_board_espressif::ELECTRODES;
use tactomo_board_espressif::analog::{ATTENUATION, millivolts, range};
use tactomo_firmware::{Adc, Row, Sampler, TimedOut};

use crate::converters::{Channel, Converters};

/// Electrodes at ADC1, which come first.
const ADC1_ELECTRODES: u8 = 6;
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

        impl<'d> Inputs<'d> {
            /// Takes the ADCs and the pins, and reads the calibration from the chip's fuses.
            pub fn new(adc1: ADC1<'d>, adc2: ADC2<'d>, pins: InputPins<'d>) -> Self {
                let (mut config1, mut config2) = (AdcConfig::new(), AdcConfig::new());
                let channels = [
                    $(Channel(config1.enable_pin(pins.$pin1, ATTENUATION).pin.adc_channel()),)*
                    $(Channel(config2.enable_pin(pins.$pin2, ATTENUATION).pin.adc_channel()),)*
                ];
                Self { converters: Converters::new(adc1, config1, adc2, config2), channels }
            }
        }

        const _: () = {
            $(assert!(has(&ADC1_GPIO, stringify!($gpio1)), "this pin is not an input of ADC1");)*
            $(assert!(has(&ADC2_GPIO, stringify!($gpio2)), "this pin is not an input of ADC2");)*
            assert!([$($electrode1,)*].len() == ADC1_ELECTRODES as usize);
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
pub struct Inputs<'d> {
    converters: Converters<'d>,
    /// Channel of each electrode at its ADC.
    channels: [Channel; ELECTRODES as usize],
}

impl Inputs<'_> {
    /// Converts an electrode of each ADC, or of one of them, side by side.
    fn convert(&mut self, pair: [Option<u8>; 2]) -> [Result<u16, TimedOut>; 2] {
        self.converters.convert(pair.map(|electrode| self.channels.get(usize::from(electrode?)).copied()))
    }
}

impl Sampler for Inputs<'_> {
    fn sample(&mut self, electrode: u8) -> Result<u16, TimedOut> {
        match electrode {
            0..ADC1_ELECTRODES => self.convert([Some(electrode), None])[0],
            _ => self.convert([None, Some(electrode)])[1],
        }
    }

    fn restart(&mut self) {
        self.converters.restart();
    }

    /// An electrode of ADC1 and one of ADC2 at a time, as long as both have some left: ten slots for sixteen electrodes.
    fn sample_row<R: Row>(&mut self, row: &mut R) -> Result<(), R::Error> {
        let electrodes = row.electrodes();
        let among = |range: core::ops::Range<u8>| range.filter(move |electrode| electrodes >> electrode & 1 == 1);
        let (mut first, mut second) = (among(0..ADC1_ELECTRODES), among(ADC1_ELECTRODES..ELECTRODES));
        loop {
            let mut pair = [first.next(), second.next()];
            if pair == [None, None] {
                return Ok(());
            }
            for _ in 0..row.conversions() {
                row.attend();
                let sampled = self.convert(pair);
                for (place, sampled) in pair.iter_mut().zip(sampled) {
                    let Some(electrode) = *place else { continue };
                    row.take(electrode, sampled);
                    // The first that times out is an electrode's last.
                    *place = place.filter(|_| sampled.is_ok());
                }
                if sampled.contains(&Err(TimedOut)) {
                    self.restart();
                }
            }
        }
    }
}

// Electrode and pin, in the order of the ADCs' channels.
inputs! {
    ADC1: 0 gpio36 GPIO36, 1 gpio39 GPIO39, 2 gpio32 GPIO32, 3 gpio33 GPIO33, 4 gpio34 GPIO34, 5 gpio35 GPIO35;
    ADC2: 6 gpio4 GPIO4, 7 gpio0 GPIO0, 8 gpio2 GPIO2, 9 gpio15 GPIO15, 10 gpio13 GPIO13, 11 gpio12 GPIO12,
        12 gpio14 GPIO14, 13 gpio27 GPIO27, 14 gpio25 GPIO25, 15 gpio26 GPIO26;
}

/// What the readings mean: the electrodes of ADC1 come first, those of ADC2 follow.
pub fn adc() -> Adc {
    let second = ELECTRODES - ADC1_ELECTRODES;
    millivolts(&[range::<_, AdcCalLine<ADC1>>(ADC1_ELECTRODES), range::<_, AdcCalLine<ADC2>>(second)])
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
