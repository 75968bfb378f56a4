//! What lies between a pad and the converter of each board, and how long its readings have to wait for that.
//!
//! The pad's resistance is the detector's ([`Detector::pad_ohm`](tactomo_physics::detector::Detector::pad_ohm)); the rest is the board's. None of the
//! figures was measured on a board of ours: they are of data sheets, and of what users published.

mod advice;
mod input;
mod need;

pub use self::input::Input;
pub use self::need::{Need, Settling, settling};

/// Resistor between a pad and a pin, against discharges (ohm), and on a strapping pin (`docs/hardware.md`).
const SERIES_OHM: f64 = 1e3;
const STRAPPING_OHM: f64 = 100e3;
/// A pin of the chip with its wire (F), an open switch of the ADG726, and the drain of a half with the closed one (data sheet, 13 and
/// 200 pF).
const PIN_F: f64 = 20e-12;
const SOURCE_OFF_F: f64 = 13e-12;
const DRAIN_ON_F: f64 = 200e-12;
/// The sampling capacitor is not published for Espressif's chips. Sharing with a probe of 18 pF, an STM32's was seen to carry 27 % of the voltage
/// of the channel before (efton.sk, STM32 gotcha 220): 8 pF with the pin's own few.
const SAMPLING_F: f64 = 8e-12;
/// Nine cycles of the ESP32's ADC clock, 8 MHz by 2 (reset values of `SENS_SAR1_SAMPLE_CYCLE` and `SENS_SAR1_CLK_DIV`).
const SAMPLING_S: f64 = 2.25e-6;
/// An STM32F405's: 7 pF at most (data sheet, table of the ADC), for 28 cycles of 21 MHz.
const STM32_SAMPLING_F: f64 = 7e-12;
const STM32_SAMPLING_S: f64 = 28.0 / 21e6;
/// Across the strapping resistors, as `docs/hardware.md` has the wiring, and why.
const ACROSS_F: f64 = 47e-9;

/// The way from a pad to an ADC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputFigures {
    /// What is in series between the pad and the pin (ohm).
    pub series_ohm: f64,
    /// Capacitor across that resistor (F).
    pub across_f: f64,
    /// Capacitance of the pin and of what hangs on it (F).
    pub node_f: f64,
    /// The ADC's sampling capacitor (F).
    pub sampling_f: f64,
    /// For how long that is on the pin (s).
    pub sampling_s: f64,
}

/// An ordinary input of an ESP32.
pub const ESP32: InputFigures = InputFigures {
    series_ohm: SERIES_OHM,
    across_f: 0.0,
    node_f: PIN_F + SOURCE_OFF_F,
    sampling_f: SAMPLING_F,
    sampling_s: SAMPLING_S,
};
/// One on a strapping pin.
pub const ESP32_STRAPPING: InputFigures =
    InputFigures { series_ohm: STRAPPING_OHM, across_f: ACROSS_F, node_f: PIN_F, ..ESP32 };
/// The one input of an ESP32-C3 or C6, behind half B of the multiplexer.
pub const ONE_INPUT: InputFigures = InputFigures { series_ohm: 0.0, node_f: DRAIN_ON_F + PIN_F, ..ESP32 };
/// An input of an STM32F405.
pub const STM32F405: InputFigures =
    InputFigures { sampling_f: STM32_SAMPLING_F, sampling_s: STM32_SAMPLING_S, ..ESP32 };

/// How a board reads its electrodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardInputs {
    /// Its name in Hello, without `(simulated)`.
    pub board: &'static str,
    /// What every electrode's input is like (those on strapping pins are others).
    pub input: InputFigures,
    /// Whether one input reads all electrodes.
    pub is_one: bool,
    /// Time of a conversion, the firmware's share included (s).
    pub conversion_s: f64,
    /// Conversion times of a row of 16.
    pub slots: u32,
}

/// All boards of which something is known.
pub const BOARDS: [BoardInputs; 4] = [
    BoardInputs { board: "esp32", input: ESP32, is_one: false, conversion_s: 10e-6, slots: 10 },
    BoardInputs { board: "esp32c3", input: ONE_INPUT, is_one: true, conversion_s: 38e-6, slots: 16 },
    BoardInputs { board: "esp32c6", input: ONE_INPUT, is_one: true, conversion_s: 38e-6, slots: 16 },
    BoardInputs { board: "stm32f405", input: STM32F405, is_one: false, conversion_s: 1.9e-6, slots: 16 },
];

impl BoardInputs {
    /// The inputs of the board of that name; `None` for boards that are not known, as the ideal one.
    pub fn of(board: &str) -> Option<&'static Self> {
        let name = board.strip_suffix(" (simulated)").unwrap_or(board);
        BOARDS.iter().find(|inputs| inputs.board == name)
    }
}
