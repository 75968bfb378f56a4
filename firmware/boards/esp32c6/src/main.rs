//! Firmware of the ESP32-C6 board: one ADC input behind half B of the multiplexer, the chip's own USB port.
//!
//! The wiring is in `docs/hardware.md`.
#![no_std]
#![no_main]

use esp_hal::clock::CpuClock;
use esp_hal::timer::timg::TimerGroup;
use tactomo_board_espressif::one_input::OneInput;
use tactomo_board_espressif::usb_line::UsbLine;
use tactomo_board_espressif::{EspChip, finder, output, run};
use tactomo_firmware::Parts;
use tactomo_firmware::mux::{LatchLines, Latched};

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
        touch: finder(chip.FLASH),
    };
    run("esp32c6", OneInput::adc(), parts)
}
