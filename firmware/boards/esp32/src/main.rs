//! Firmware of the ESP32 board (ESP-WROOM-32), the paper's: sixteen ADC inputs, four address lines, UART0.
//!
//! The wiring is in `docs/hardware.md`.
#![no_std]
#![no_main]

mod converters;
mod inputs;
mod line;

use esp_hal::clock::CpuClock;
use esp_hal::timer::timg::TimerGroup;
use tactomo_board_espressif::{EspChip, brown_out, finder, output, run};
use tactomo_firmware::Parts;
use tactomo_firmware::mux::{Enabled, Transparent};

use crate::inputs::InputPins;
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
        sampler: inputs::new(chip.ADC1, chip.ADC2, pins),
        serial: UartLine::new(chip.UART0, chip.GPIO1, chip.GPIO3),
        chip: EspChip::new(TimerGroup::new(chip.TIMG0)),
        touch: finder(chip.FLASH),
    };
    run("esp32", inputs::adc(), parts)
}
