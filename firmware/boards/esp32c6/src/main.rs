//! Firmware of the ESP32-C6 board: one ADC input behind half B of the multiplexer, the chip's own USB port.
//!
//! The wiring is in `docs/hardware.md`.
#![no_std]
#![no_main]

use esp_hal::clock::CpuClock;
use esp_hal::gpio::{Level, Output, OutputConfig, OutputPin};
use esp_hal::timer::timg::TimerGroup;
use tactomo_board_espressif::one_input::{ELECTRODES, OneInput};
use tactomo_board_espressif::usb_line::UsbLine;
use tactomo_board_espressif::{EspChip, boot_fault};
use tactomo_firmware::mux::{LatchLines, Latched};
use tactomo_firmware::{Board16, Identity, Parts};

esp_bootloader_esp_idf::esp_app_desc!();

#[esp_hal::main]
fn main() -> ! {
    let chip = esp_hal::init(esp_hal::Config::default().with_cpu_clock(CpuClock::max()));
    let address = [output(chip.GPIO18), output(chip.GPIO19), output(chip.GPIO20), output(chip.GPIO21)];
    let latches = LatchLines { wr: output(chip.GPIO22), csa: output(chip.GPIO23), csb: output(chip.GPIO2) };
    let Ok(mux) = Latched::new(address, latches);
    let parts = Parts {
        mux,
        sampler: OneInput::new(chip.ADC1, chip.GPIO0),
        serial: UsbLine::new(chip.USB_DEVICE),
        chip: EspChip::new(TimerGroup::new(chip.TIMG0)),
    };
    let adc = OneInput::adc();
    let identity = Identity {
        firmware_version: env!("CARGO_PKG_VERSION"),
        board: "esp32c6",
        electrodes: ELECTRODES,
        adc,
        drive_mv: 2000,
    };
    let mut board = match Board16::new(parts, identity) {
        Ok(board) => board,
        Err(_) => panic!("the board's identity does not fit the protocol"),
    };
    let range = adc.ranges[0];
    defmt::info!("the ADC sees {=u16} to {=u16} mV", range.floor, range.ceiling);
    boot_fault().into_iter().for_each(|fault| board.report(fault));
    match board.run() {}
}

/// An output that is high at first, so that the latches stay closed.
fn output<'d>(pin: impl OutputPin + 'd) -> Output<'d> {
    Output::new(pin, Level::High, OutputConfig::default())
}
