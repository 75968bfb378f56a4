//! Firmware of the STM32F405 board: sixteen inputs on one ADC, four address lines, the chip's own USB port.
//!
//! The wiring is in `docs/hardware.md`.
#![no_std]
#![no_main]

mod chip;
mod flash;
mod guard;
mod inputs;
mod line;
mod quartz;
#[cfg(feature = "hid")]
mod touch_screen;

use stm32f4xx_hal::otg_fs::USB;
use stm32f4xx_hal::pac::{CorePeripherals, Peripherals};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Config;
use stm32f4xx_hal::watchdog::IndependentWatchdog;
use tactomo_board_common::WATCHDOG_TIMEOUT_MS;
use tactomo_firmware::mux::Transparent;
use tactomo_firmware::{Board16, Identity, Parts};

use crate::chip::{StmChip, boot_fault};
use crate::inputs::{ELECTRODES, Inputs};
use crate::line::UsbLine;

/// Clock of the core (MHz): the chip's fastest.
const CORE_MHZ: u32 = 168;

#[allow(missing_docs, reason = "the macro makes a public symbol of it")]
#[cortex_m_rt::entry]
fn main() -> ! {
    let (Some(device), Some(core)) = (Peripherals::take(), CorePeripherals::take()) else {
        panic!("the peripherals are taken already");
    };
    guard::arm(&core.MPU);
    // Before the clock, on an oscillator of its own: whatever hangs from here on ends in a reset.
    let mut watchdog = IndependentWatchdog::new(device.IWDG);
    watchdog.start(WATCHDOG_TIMEOUT_MS.millis());
    let fault = boot_fault(&device.RCC);
    let Some(quartz_mhz) = quartz::mhz(&device.RCC, &device.TIM11) else {
        panic!("the board's quartz does not swing, or has neither 8, 12, 16 nor 25 MHz");
    };
    let clocks = Config::hse(quartz_mhz.MHz()).sysclk(CORE_MHZ.MHz()).require_pll48clk();
    let mut rcc = device.RCC.freeze(clocks);
    let (a, b, c) = (device.GPIOA.split(&mut rcc), device.GPIOB.split(&mut rcc), device.GPIOC.split(&mut rcc));
    let address = [
        b.pb12.into_push_pull_output().erase(),
        b.pb13.into_push_pull_output().erase(),
        b.pb14.into_push_pull_output().erase(),
        b.pb15.into_push_pull_output().erase(),
    ];
    #[rustfmt::skip]
    let pins = (
        a.pa0.into_analog(), a.pa1.into_analog(), a.pa2.into_analog(), a.pa3.into_analog(),
        a.pa4.into_analog(), a.pa5.into_analog(), a.pa6.into_analog(), a.pa7.into_analog(),
        b.pb0.into_analog(), b.pb1.into_analog(), c.pc0.into_analog(), c.pc1.into_analog(),
        c.pc2.into_analog(), c.pc3.into_analog(), c.pc4.into_analog(), c.pc5.into_analog(),
    );
    let inputs = Inputs::new(device.ADC1, pins, &mut rcc);
    let adc = inputs.adc();
    let usb =
        USB::new((device.OTG_FS_GLOBAL, device.OTG_FS_DEVICE, device.OTG_FS_PWRCLK), (a.pa11, a.pa12), &rcc.clocks);
    let Some(serial) = UsbLine::new(usb) else { panic!("the USB port has no room for its names") };
    let touch = flash::finder(device.FLASH);
    #[cfg(feature = "hid")]
    let touch = tactomo_firmware::Digitizer::new(touch, serial.screen);
    let mut counter = device.TIM2.counter_us(&mut rcc);
    if counter.start(u32::MAX.micros()).is_err() {
        panic!("the clock does not start");
    }
    let delay = core.SYST.delay(&rcc.clocks);
    let parts = Parts {
        mux: Transparent::new(address),
        sampler: inputs,
        serial,
        chip: StmChip::new(delay, counter, watchdog),
        touch,
    };
    let identity = Identity {
        firmware_version: env!("CARGO_PKG_VERSION"),
        board: "stm32f405",
        electrodes: ELECTRODES,
        adc,
        drive_mv: 2000,
    };
    let mut board = match Board16::new(parts, identity) {
        Ok(board) => board,
        Err(_) => panic!("the board's identity does not fit the protocol"),
    };
    defmt::info!("the ADC's supply is {=u16} mV", adc.full_scale_mv);
    fault.into_iter().for_each(|fault| board.report(fault));
    match board.run() {}
}
