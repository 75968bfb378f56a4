//! What the boards' sources say of pins, baud rate and watchdog, against `docs/hardware.md`, from which people wire.
//!
//! The sources are read as text: they are for other chips.

use std::collections::BTreeMap;

const PAGE: &str = include_str!("../../../docs/hardware.md");
const ESP32_INPUTS: &str = include_str!("../../../firmware/boards/esp32/src/inputs.rs");
const ESP32_MAIN: &str = include_str!("../../../firmware/boards/esp32/src/main.rs");
const ESP32_LINE: &str = include_str!("../../../firmware/boards/esp32/src/line.rs");
const ESP32_CONFIG: &str = include_str!("../../../firmware/boards/esp32/.cargo/config.toml");
const ESP32C3_MAIN: &str = include_str!("../../../firmware/boards/esp32c3/src/main.rs");
const ESP32C6_MAIN: &str = include_str!("../../../firmware/boards/esp32c6/src/main.rs");
const STM32_MAIN: &str = include_str!("../../../firmware/boards/stm32f405/src/main.rs");
const ONE_INPUT: &str = include_str!("../../../firmware/boards/espressif/src/one_input.rs");
const ESPRESSIF_CHIP: &str = include_str!("../../../firmware/boards/espressif/src/chip.rs");
const COMMON: &str = include_str!("../../../firmware/boards/common/src/lib.rs");
const ESPRESSIF_TABLE: &str = include_str!("../../../firmware/boards/espressif/src/table.rs");
const STM32_FLASH: &str = include_str!("../../../firmware/boards/stm32f405/src/flash.rs");
const STM32_MEMORY: &str = include_str!("../../../firmware/boards/stm32f405/memory.x");
const IMAGES: &str = include_str!("../../../host/src/commands/board/elf.rs");
const FIRMWARE_PAGE: &str = include_str!("../../../docs/firmware.md");

/// Cells of the page's table rows, without ends and quotes.
fn rows() -> Vec<Vec<String>> {
    let cells =
        |line: &str| line.trim_matches('|').split('|').map(|cell| cell.replace('`', "").trim().to_owned()).collect();
    PAGE.lines().filter(|line| line.starts_with('|')).map(cells).collect()
}

/// The first row that begins so.
fn row(first: &str) -> Vec<String> {
    rows().into_iter().find(|row| row[0] == first).unwrap_or_else(|| panic!("no row begins with {first}"))
}

/// The numbers in a text.
fn numbers(text: &str) -> Vec<u32> {
    text.split(|letter: char| !letter.is_ascii_digit()).filter_map(|digits| digits.parse().ok()).collect()
}

/// What stands in `text` behind `before` and ahead of `after`.
fn between<'a>(text: &'a str, before: &str, after: &str) -> &'a str {
    let begin = text.find(before).unwrap_or_else(|| panic!("{before} is missing")) + before.len();
    let length = text[begin..].find(after).unwrap_or_else(|| panic!("{after} is missing"));
    &text[begin..begin + length]
}

/// GPIOs of the outputs in a piece of a board's main.
fn outputs(text: &str) -> Vec<u32> {
    text.split("output(chip.GPIO").skip(1).map(|pin| numbers(pin)[0]).collect()
}

#[test]
fn the_esp32_reads_each_electrode_at_the_pin_that_the_page_says() {
    // `0 gpio36 GPIO36, ...`
    let table = between(ESP32_INPUTS, "\ninputs! {", "}");
    let (adc1, adc2) = table.split_once("ADC2:").unwrap();
    let mut code = BTreeMap::new();
    for (unit, list) in [(1, adc1.trim_start().trim_start_matches("ADC1:")), (2, adc2)] {
        for entry in list.split([',', ';']).filter(|entry| !entry.trim().is_empty()) {
            let [electrode, name, gpio] = numbers(entry)[..] else { panic!("{entry}") };
            assert_eq!(name, gpio);
            code.insert(electrode, (gpio, unit));
        }
    }
    assert_eq!(code.len(), 16);
    // `| 0 | GPIO 36 (VP) | 1, channel 0 | | 8 | GPIO 2, strapping | 2, channel 2 |`
    let channels =
        |name| numbers(between(ESP32_INPUTS, name, "];").split_once('[').unwrap().1.split_once('[').unwrap().1);
    let (channels1, channels2) = (channels("const ADC1_GPIO"), channels("const ADC2_GPIO"));
    let mut page = BTreeMap::new();
    for row in rows().iter().filter(|row| row.len() == 7 && row[1].starts_with("GPIO")) {
        for cells in [&row[..3], &row[4..]] {
            let [unit, channel] = numbers(&cells[2])[..] else { panic!("{row:?}") };
            let gpio = numbers(&cells[1])[0];
            let wired = if unit == 1 { &channels1 } else { &channels2 };
            assert_eq!(wired[channel as usize], gpio, "channel {channel} of ADC{unit}");
            page.insert(cells[0].parse::<u32>().unwrap(), (gpio, unit));
        }
    }
    assert_eq!(page, code);
}

#[test]
fn the_multiplexer_is_wired_as_the_page_says() {
    let address = row("A0, A1, A2, A3");
    assert_eq!(outputs(between(ESP32_MAIN, "let address = [", "];")), numbers(&address[1]));
    let ports = between(STM32_MAIN, "let address = [", "];").split("b.pb").skip(1).map(|pin| numbers(pin)[0]);
    assert_eq!(ports.collect::<Vec<_>>(), numbers(&address[2]));
    assert_eq!(outputs(between(ESP32_MAIN, "Enabled::new(", ";")), [numbers(&row("EN")[1])[0]]);
    for (main, column) in [(ESP32C3_MAIN, 3), (ESP32C6_MAIN, 4)] {
        assert_eq!(outputs(between(main, "let address = [", "];")), numbers(&address[column]));
        for (pin, field) in [("WR", "wr: "), ("CSA", "csa: "), ("CSB", "csb: ")] {
            assert_eq!(outputs(between(main, field, ")")), numbers(&row(pin)[column]), "{pin}");
            assert!(row(pin)[1].starts_with("ground"), "{pin} of the transparent wiring");
        }
        let input = numbers(between(main, "Input::new(chip.ADC1, chip.GPIO", ")"));
        assert_eq!(input, [numbers(&row("DB")[column])[0]]);
        assert!(ONE_INPUT.contains(&format!("AdcPin<GPIO{}<", input[0])));
    }
}

#[test]
fn the_line_has_the_pins_and_the_baud_rate_that_the_page_says() {
    let baud = between(ESP32_LINE, "RATES: [u32; 4] = [", ",").replace('_', "");
    assert!(row("esp32")[4].contains(&format!("{baud} baud")), "{baud}");
    assert_eq!(baud, tactomo::board::link::serial::DEFAULT_BAUD.to_string(), "the host's is the same");
    let pins = numbers(between(ESP32_MAIN, "UartLine::new(chip.UART0, ", ")"));
    assert!(PAGE.contains(&format!("GPIO {} and {} are the UART", pins[0], pins[1])));
}

#[test]
fn the_watchdog_and_the_oldest_silicon_are_those_of_the_page() {
    assert_eq!(between(COMMON, "pub const WATCHDOG_TIMEOUT_MS: u32 = ", ";"), "1000");
    assert!([ESPRESSIF_CHIP, STM32_MAIN].iter().all(|user| user.contains("(WATCHDOG_TIMEOUT_MS.")), "both take it");
    assert!(row("Fault: Reset(watchdog)")[1].contains("for a second"));
    assert!(ESP32_CONFIG.contains("\nESP_HAL_CONFIG_MIN_CHIP_REVISION = \"0\"\n"), "as a line of its own");
}

/// The number behind this in a source, in hexadecimal digits.
fn address(text: &str, before: &str) -> u32 {
    let digits = between(text, before, ";").replace('_', "");
    u32::from_str_radix(digits.trim_start_matches("0x"), 16).unwrap()
}

/// The two places of a board's tables, from the end of flash downwards.
fn places(text: &str, before: &str) -> [u32; 2] {
    let digits = between(text, before, "];").replace('_', "");
    let at = |digits: &str| u32::from_str_radix(digits.trim().trim_start_matches("0x"), 16).unwrap();
    let (first, second) = digits.split_once(',').unwrap();
    [at(first), at(second)]
}

#[test]
fn tables_lie_where_no_image_reaches() {
    let espressif = places(ESPRESSIF_TABLE, "const TABLES_AT: [u32; 2] = [");
    assert_eq!(espressif[1], 0x1_0000 + address(IMAGES, "const ESP_FLASH: u64 = "), "behind the longest image");
    assert!(
        FIRMWARE_PAGE.contains(&format!("| {:#08X} and {:#08X} of the module's flash", espressif[0], espressif[1]))
    );
    let stm32 = places(STM32_FLASH, "const SECTORS_AT: [u32; 2] = [");
    assert!(IMAGES.contains("0x0800_0000..0x080c_0000") && stm32 == [0xE_0000, 0xC_0000]);
    assert!(STM32_MEMORY.contains("LENGTH = 1024K - 256K") && stm32[1] == (1024 - 256) * 1024);
    assert!(FIRMWARE_PAGE.contains(&format!("| 0x080{:X} and 0x080{:X}, sectors 11 and 10 |", stm32[0], stm32[1])));
}
