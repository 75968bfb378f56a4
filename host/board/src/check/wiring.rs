//! Which pins every electrode of a board is wired to, as docs/hardware.md has it: what a person has to look at.

use serde::Serialize;

/// GPIO of each electrode of the `esp32`, in the order of the ADCs' channels.
const ESP32: [u8; 16] = [36, 39, 32, 33, 34, 35, 4, 0, 2, 15, 13, 12, 14, 27, 25, 26];

/// Pin of each electrode of the `stm32f405`, in the order of the ADC's channels.
const STM32F405: [&str; 16] =
    ["PA0", "PA1", "PA2", "PA3", "PA4", "PA5", "PA6", "PA7", "PB0", "PB1", "PC0", "PC1", "PC2", "PC3", "PC4", "PC5"];

/// Where one electrode is wired to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Pins {
    /// Source of the multiplexer that grounds it, such as `S4A`; of an ADG732 `S4`.
    pub grounded_by: String,
    /// What brings it to the converter: a pin of the chip, or a source of the multiplexer's other half.
    pub read_by: String,
}

/// Pins of an electrode (from 0) of the board of that name; `None` for boards that are not known.
pub fn pins(board: &str, electrode: usize) -> Option<Pins> {
    let source = electrode + 1;
    let pins = |read_by: String| Some(Pins { grounded_by: format!("S{source}A"), read_by });
    // A simulated board is wired as the real one.
    match board.strip_suffix(" (simulated)").unwrap_or(board) {
        "esp32" => ESP32.get(electrode).and_then(|gpio| pins(format!("GPIO {gpio}"))),
        "stm32f405" => STM32F405.get(electrode).and_then(|pin| pins((*pin).to_owned())),
        "esp32c3" | "esp32c6" if electrode < 16 => pins(format!("S{source}B")),
        // Wired as the `esp32`, so that its reports read like a real board's.
        "simulated" if electrode < 16 => pins("its ADC input".to_owned()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pins_are_those_of_the_firmware_and_of_the_page() {
        let firmware = include_str!("../../../../firmware/boards/esp32/src/inputs.rs");
        let page = include_str!("../../../../docs/hardware.md");
        for (electrode, gpio) in ESP32.iter().enumerate() {
            assert!(firmware.contains(&format!("{electrode} gpio{gpio} GPIO{gpio}")), "{electrode}");
            assert!(page.contains(&format!("| {electrode} | GPIO {gpio}")), "{electrode}");
        }
    }

    #[test]
    fn pins_of_the_stm32_are_those_of_its_firmware_and_of_the_page() {
        let firmware = include_str!("../../../../firmware/boards/stm32f405/src/inputs.rs");
        let page = include_str!("../../../../docs/hardware.md");
        for (electrode, pin) in STM32F405.iter().enumerate() {
            assert!(firmware.contains(&format!("{electrode} {pin}")), "{electrode}");
            assert!(page.contains(&format!("| {electrode} | {pin} |")), "{electrode}");
        }
    }

    #[test]
    fn electrodes_beyond_the_board_and_unknown_boards_have_no_pins() {
        assert_eq!(pins("esp32", 16), None);
        assert_eq!(pins("esp32c3", 16), None);
        assert_eq!(pins("some board", 0), None);
        let last = pins("esp32c3", 15).unwrap();
        assert_eq!((last.grounded_by.as_str(), last.read_by.as_str()), ("S16A", "S16B"));
    }
}
