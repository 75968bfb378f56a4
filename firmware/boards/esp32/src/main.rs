//! Firmware of the ESP32 board (ESP-WROOM-32), the paper's: sixteen ADC inputs, four address lines, UART0.
//!
//! The wiring is in `docs/hardware.md`.
#![no_std]
#![no_main]

mod converters;
mod inputs;
mod line;

use esp_hal::clock::CpuClock;
use esp_hal::gpio::{Level, Output, OutputConfig, OutputPin};
use esp_hal::timer::timg::TimerGroup;
use tactomo_board_espressif::{EspChip, boot_fault, brown_out};
use tactomo_firmware::mux::{Enabled, Transparent};
use tactomo_firmware::{Board16, Identity, Parts};

use crate::inputs::{ELECTRODES, InputPins, Inputs};
use crate::line::UartLine;

esp_bootloader_esp_idf::esp_app_desc!();

#[esp_hal::main]
fn main() -> ! {
    let chip = esp_hal::init(esp_hal::Config::default().with_cpu_clock(CpuClock::max()));
    brown_out::enable();
    let address = [output(chip.GPIO18), output(chip.GPIO19), output(chip.GPIO21), output(chip.GPIO22)];
    let Ok(mux) = Enabled::new(Transparent::new(address), output(chip.GPIO23));
    let pins = InputPins {
        gpio36: chip.GPIO36,
        gpio39: chip.GPIO39,
        gpio32: chip.GPIO32,
        gpio33: chip.GPIO33,
        gpio34: chip.GPIO34,
        gpio35: chip.GPIO35,
        gpio4: chip.GPIO4,
        gpio0: chip.GPIO0,
        gpio2: chip.GPIO2,
        gpio15: chip.GPIO15,
        gpio13: chip.GPIO13,
        gpio12: chip.GPIO12,
        gpio14: chip.GPIO14,
        gpio27: chip.GPIO27,
        gpio25: chip.GPIO25,
        gpio26: chip.GPIO26,
    };
    let parts = Parts {
        mux,
        sampler: Inputs::new(chip.ADC1, chip.ADC2, pins),
        serial: UartLine::new(chip.UART0, chip.GPIO1, chip.GPIO3),
        chip: EspChip::new(TimerGroup::new(chip.TIMG0)),
    };
    let adc = inputs::adc();
    let identity = Identity {
        firmware_version: env!("CARGO_PKG_VERSION"),
        board: "esp32",
        electrodes: ELECTRODES,
        adc,
        drive_mv: 2000,
    };
    let mut board = match Board16::new(parts, identity) {
        Ok(board) => board,
        Err(_) => panic!("the board's identity does not fit the protocol"),
    };
    adc.ranges.iter().filter(|range| range.electrodes > 0).for_each(|range| {
        defmt::info!("{=u8} electrodes from {=u16} to {=u16} mV", range.electrodes, range.floor, range.ceiling);
    });
    boot_fault().into_iter().for_each(|fault| board.report(fault));
    match board.run() {}
}

/// An output that is high at first, so that the multiplexer's EN stays off.
fn output<'d>(pin: impl OutputPin + 'd) -> Output<'d> {
    Output::new(pin, Level::High, OutputConfig::default())
}
