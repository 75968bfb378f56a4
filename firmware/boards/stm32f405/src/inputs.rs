//! Sixteen inputs on one ADC: electrode `e` is its channel `e`.

use stm32f4xx_hal::adc::Adc as HalAdc;
use stm32f4xx_hal::adc::config::{AdcConfig, Clock, SampleTime};
use stm32f4xx_hal::gpio::{Analog, PA0, PA1, PA2, PA3, PA4, PA5, PA6, PA7, PB0, PB1, PC0, PC1, PC2, PC3, PC4, PC5};
use stm32f4xx_hal::hal_02::adc::Channel;
use stm32f4xx_hal::pac::ADC1;
use stm32f4xx_hal::rcc::Rcc;
use tactomo_board_common::bounded::within;
use tactomo_firmware::{Adc, Sampler, TimedOut};

/// Electrodes of the board.
pub const ELECTRODES: u8 = 16;
/// Bits of a conversion.
const BITS: u8 = 12;
/// Time that the converter's capacitor charges, in cycles of its clock: 28 at 21 MHz, which is 1.3 us. By the data sheet that is enough behind
/// 27 kOhm; an electrode has its series resistor of 1 kOhm and some foam. A conversion takes 12 cycles more, 1.9 us in all. Set in the registers as a 2.
const SAMPLE_TIME: u32 = 2;
/// The reference inside takes 10 us to start: twice that, in cycles of 168 MHz.
const REFERENCE_CYCLES: u32 = 2 * 10 * 168;
/// The converter takes 3 us to start: twice that, in cycles of 168 MHz.
const START_CYCLES: u32 = 2 * 3 * 168;
/// Looks at the ADC before a conversion is given up: about ten times what a conversion takes, at some 5 cycles of 168 MHz a look.
const MAX_LOOKS: u32 = 600;

macro_rules! inputs {
    ($($electrode:literal $pin:ident),*) => {
        /// The pins, in the order of the electrodes.
        pub type Pins = ($($pin<Analog>,)*);

        /// Channel of each electrode's pin, by the chip's map.
        fn channels() -> [u8; ELECTRODES as usize] {
            [$(<$pin<Analog> as Channel<ADC1>>::channel(),)*]
        }

        const _: () = {
            let electrodes = [$($electrode,)*];
            let mut next = 0;
            while next < electrodes.len() {
                assert!(electrodes[next] == next, "the electrodes are not in order");
                next += 1;
            }
            assert!(electrodes.len() == ELECTRODES as usize);
        };
    };
}

inputs! {
    0 PA0, 1 PA1, 2 PA2, 3 PA3, 4 PA4, 5 PA5, 6 PA6, 7 PA7, 8 PB0, 9 PB1, 10 PC0, 11 PC1, 12 PC2, 13 PC3, 14 PC4, 15 PC5
}

/// The ADC, and what it is supplied with.
pub struct Inputs {
    registers: ADC1,
    channels: [u8; ELECTRODES as usize],
    supply_mv: u16,
}

impl Inputs {
    /// Starts the ADC and measures its reference, which is the chip's supply, against the one inside that the factory has measured.
    pub fn new(adc: ADC1, _pins: Pins, rcc: &mut Rcc) -> Self {
        let config = AdcConfig::default().clock(Clock::Pclk2_div_4).default_sample_time(SampleTime::Cycles_480);
        let mut driver = HalAdc::new(adc, true, config, rcc);
        driver.enable_temperature_and_vref();
        cortex_m::asm::delay(REFERENCE_CYCLES);
        driver.calibrate();
        driver.disable_temperature_and_vref();
        driver.enable();
        let supply_mv = driver.reference_voltage() as u16;
        // SAFETY: the driver ends here, so this is the one handle; the driver's own conversions would wait without a bound.
        let registers = unsafe { ADC1::steal() };
        registers.cr1().modify(|_, w| w.scan().clear_bit());
        registers.cr2().modify(|_, w| w.dma().clear_bit().cont().clear_bit());
        // SAFETY: three bits for each channel, of which 2 stands for 28 cycles; zero in the length is one conversion.
        unsafe {
            registers.smpr1().write(|w| w.bits(sample_times(9)));
            registers.smpr2().write(|w| w.bits(sample_times(10)));
            registers.sqr1().write(|w| w.bits(0));
        }
        Self { registers, channels: channels(), supply_mv }
    }

    /// What the readings mean.
    pub fn adc(&self) -> Adc {
        Adc::new(BITS, self.supply_mv)
    }
}

/// The register with the sample times of so many channels.
const fn sample_times(channels: u32) -> u32 {
    let mut bits = 0;
    let mut channel = 0;
    while channel < channels {
        bits |= SAMPLE_TIME << (3 * channel);
        channel += 1;
    }
    bits
}

impl Sampler for Inputs {
    fn sample(&mut self, electrode: u8) -> Result<u16, TimedOut> {
        let channel = *self.channels.get(usize::from(electrode)).ok_or(TimedOut)?;
        let adc = &self.registers;
        // SAFETY: a channel of the chip's map fits the five bits of the first place in the sequence.
        adc.sqr3().write(|w| unsafe { w.bits(u32::from(channel)) });
        adc.sr().modify(|_, w| w.eoc().clear_bit());
        adc.cr2().modify(|_, w| w.swstart().set_bit());
        within(MAX_LOOKS, || adc.sr().read().eoc().bit_is_set().then_some(()))?;
        Ok(adc.dr().read().data().bits())
    }

    /// Switches the converter off and on, which gives up a conversion.
    fn restart(&mut self) {
        self.registers.cr2().modify(|_, w| w.adon().clear_bit());
        self.registers.cr2().modify(|_, w| w.adon().set_bit());
        cortex_m::asm::delay(START_CYCLES);
        self.registers.sr().modify(|_, w| w.eoc().clear_bit());
    }
}
