//! What a simulated board has of a real one: its times, its line and its analogue side, in figures with their sources.
//!
//! None of them was measured on a board of ours: they are of data sheets, of Espressif's own pages, and of what users published.

use std::str::FromStr;

use tactomo_firmware::Adc as FirmwareAdc;
use tactomo_firmware::mux::ONE_INPUT_SELECT_US;
use tactomo_physics::detector::{self, Adc, Detector};
use tactomo_protocol::{ConverterErrors, Range, Settings};

use crate::inputs::{self, InputFigures};

/// Which board is simulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum BoardModel {
    /// The detector's own converter behind a fast multiplexer, a line without end, and a scene that stands still for a scan.
    #[default]
    Ideal,
    /// An ESP-WROOM-32: two ADCs with a floor, 16 inputs of which four are behind strapping resistors, UART at 921600 to 3 million baud.
    Esp32,
    /// An ESP32-C3: one ADC behind the multiplexer's second half, USB.
    Esp32c3,
}

/// A name that no simulated board has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no simulated board `{0}`; there are {names}", names = BoardModel::ALL.map(BoardModel::name).join(", "))]
pub struct UnknownBoard(String);

impl FromStr for BoardModel {
    type Err = UnknownBoard;

    fn from_str(name: &str) -> Result<Self, UnknownBoard> {
        Self::ALL.into_iter().find(|model| model.name() == name).ok_or_else(|| UnknownBoard(name.to_owned()))
    }
}

/// How electrodes reach ground and converter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wiring {
    /// Half A grounds, every electrode has an input of its own.
    Transparent,
    /// Half A grounds, half B brings the electrode to the only input.
    Latched,
}

/// Figures of a board.
#[derive(Debug)]
pub(super) struct Figures {
    /// Its name in Hello.
    pub(super) name: &'static str,
    /// Its name as a link.
    pub(super) link: &'static str,
    pub(super) wiring: Wiring,
    /// Time of one conversion, the firmware's share included (ns).
    pub(super) conversion_ns: u64,
    /// The firmware's own work for a row (ns): packing, checksum, framing, commands.
    pub(super) row_work_ns: u64,
    /// `None`: as fast as the host reads.
    pub(super) line: Option<LineFigures>,
    /// `None`: the converter that the detector's description has.
    pub(super) analog: Option<Analog>,
}

/// The transmitter of a board.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineFigures {
    pub(super) bytes_per_s: f64,
    pub(super) fifo_bytes: f64,
    /// Rates of a UART (bits a second), the first of which it begins with: ten bits a byte.
    pub(super) rates: &'static [u32],
}

/// The analogue side of a board.
#[derive(Debug)]
pub(super) struct Analog {
    /// Runs of electrodes that share an ADC.
    pub(super) converters: &'static [ConverterFigures],
    /// What every electrode's input is like, unless it is one of `strapping`.
    pub(super) input: InputFigures,
    /// The inputs on strapping pins, and their electrodes.
    pub(super) strapping: (&'static [usize], InputFigures),
}

/// One ADC, calibrated by its factory's figures: its codes are millivolts.
#[derive(Debug)]
pub(super) struct ConverterFigures {
    /// Electrodes on it.
    pub(super) electrodes: usize,
    /// What its lowest and highest raw codes read (mV).
    pub(super) floor_mv: f64,
    pub(super) ceiling_mv: f64,
    /// Standard deviation of one conversion (mV).
    pub(super) noise_mv: f64,
    /// Standard deviation, from chip to chip, of the gain that calibration leaves.
    pub(super) gain_deviation: f64,
    /// Standard deviation, from chip to chip, of the height of the bow that calibration leaves in the middle of the range (mV).
    pub(super) bow_mv: f64,
}

/// Calibrated codes are millivolts: 12 bits of 4096 mV, as `firmware/boards/common/src/range.rs` has them.
const BITS: u8 = 12;
const FULL_SCALE_MV: u16 = 1 << BITS;

/// Standard deviation of one conversion (mV): nine of 721 mV behind a divider of 100 and 4.7 kilohm, published by the user of a Pycom board
/// with an ESP32 ("ADC woes"), have 4.9 mV. The C3's is not published and taken as the same.
const NOISE_MV: f64 = 5.0;
/// The firmware's instructions outside conversions and waits, for a frame of 16 electrodes: measured on the emulated board by the test
/// `a_frame_costs_the_same_in_every_run` of `tests/tests/emulated_board`, which holds this figure too.
pub const FRAME_INSTRUCTIONS: u64 = 65_284;
/// Cycles of a row of 16 of them, at one and a half for an instruction.
const ROW_CYCLES: u64 = FRAME_INSTRUCTIONS * 3 / 2 / 16;
const ROW_ELECTRODES: f64 = 16.0;

/// Bytes of a coded frame beside the readings, and of a reading.
const FRAME_BYTES: f64 = 18.0;
const BYTES_PER_READING: f64 = 0.75;

/// Integral non-linearity 12 LSB of 0.76 mV by the data sheet, and 60 mV of total error from 150 to 2450 mV after calibration at this
/// attenuation: a bow of 12 mV and a gain of 1 % make 60 mV at 2450 mV about twice their deviation together.
const ESP32_ADC1: ConverterFigures = ConverterFigures {
    electrodes: 6,
    floor_mv: 142.0,
    ceiling_mv: 3100.0,
    noise_mv: NOISE_MV,
    gain_deviation: 0.01,
    bow_mv: 12.0,
};

static IDEAL: Figures = Figures {
    name: "simulated",
    link: "simulated board",
    wiring: Wiring::Transparent,
    // A fast SAR converter.
    conversion_ns: 2_000,
    row_work_ns: 0,
    line: None,
    analog: None,
};

static ESP32: Figures = Figures {
    name: "esp32 (simulated)",
    link: "simulated ESP32",
    wiring: Wiring::Transparent,
    // 5 us is the data sheet's limit (200 000 a second); users' loops of single conversions take about 10, the software's share in it.
    conversion_ns: 10_000,
    // At 240 MHz.
    row_work_ns: ROW_CYCLES * 1000 / 240,
    // The rates of `firmware/boards/esp32/src/line.rs`; FIFO of 128 bytes.
    line: Some(LineFigures {
        bytes_per_s: 92_160.0,
        fifo_bytes: 128.0,
        rates: &[921_600, 1_500_000, 2_000_000, 3_000_000],
    }),
    analog: Some(Analog {
        // The floors are what code 0 of either ADC reads after calibration.
        converters: &[ESP32_ADC1, ConverterFigures { electrodes: 10, floor_mv: 128.0, ..ESP32_ADC1 }],
        input: inputs::ESP32,
        // GPIO 0, 2, 15 and 12.
        strapping: (&[7, 8, 9, 11], inputs::ESP32_STRAPPING),
    }),
};

static ESP32C3: Figures = Figures {
    name: "esp32c3 (simulated)",
    link: "simulated ESP32-C3",
    wiring: Wiring::Latched,
    // The wait after each change of half B comes on top of it (`docs/firmware.md`).
    conversion_ns: 38_000,
    // At 160 MHz.
    row_work_ns: ROW_CYCLES * 1000 / 160,
    // Nineteen packets of 64 bytes a millisecond (USB 2.0, 5.8.4: bulk transfers at full speed).
    line: Some(LineFigures { bytes_per_s: 1_216_000.0, fifo_bytes: 64.0, rates: &[] }),
    analog: Some(Analog {
        // 35 mV of total error from 0 to 2500 mV by the data sheet, after a curve that takes most of the bow away.
        converters: &[ConverterFigures {
            electrodes: 16,
            floor_mv: 0.0,
            ceiling_mv: 2500.0,
            noise_mv: NOISE_MV,
            gain_deviation: 0.005,
            bow_mv: 5.0,
        }],
        input: inputs::ONE_INPUT,
        strapping: (&[], inputs::ESP32_STRAPPING),
    }),
};

impl BoardModel {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Ideal, Self::Esp32, Self::Esp32c3];

    pub(super) fn figures(self) -> &'static Figures {
        match self {
            Self::Ideal => &IDEAL,
            Self::Esp32 => &ESP32,
            Self::Esp32c3 => &ESP32C3,
        }
    }

    /// Most electrodes that it has inputs for.
    pub fn most_electrodes(self) -> usize {
        match &self.figures().analog {
            Some(analog) => analog.converters.iter().map(|converter| converter.electrodes).sum(),
            None => tactomo_protocol::MAX_ELECTRODES,
        }
    }

    /// The one that is simulated for a detector unless another is chosen: the paper's, where it has inputs for all electrodes.
    pub fn usual(detector: &Detector) -> Self {
        let fits = detector.electrodes.len() <= Self::Esp32.most_electrodes();
        if fits { Self::Esp32 } else { Self::Ideal }
    }

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ideal => "ideal",
            Self::Esp32 => "esp32",
            Self::Esp32c3 => "esp32c3",
        }
    }

    /// What it is, in a line.
    pub fn explanation(self) -> &'static str {
        match self {
            Self::Ideal => "The converter of the detector's description, at 2 us a conversion, on a line without end",
            Self::Esp32 => "ESP-WROOM-32: two ADCs with a floor at 0.14 V, UART of up to 3 million baud",
            Self::Esp32c3 => "ESP32-C3: one ADC behind the multiplexer's second half, USB",
        }
    }

    /// The description of a detector that this board simulates: with its converter, and exact unless it is one as built.
    pub fn described(self, detector: Detector, is_as_built: bool) -> Detector {
        let detector = Detector { adc: self.adc(detector.adc), ..detector };
        if is_as_built { detector } else { detector.taken_as_exact() }
    }

    /// The converter of a detector on this board: the board's own, where it has one.
    pub fn adc(self, described: Adc) -> Adc {
        match &self.figures().analog {
            Some(analog) => Adc {
                bits: BITS,
                full_scale_v: f64::from(FULL_SCALE_MV) * 1e-3,
                noise_lsb: analog.converters.iter().map(|converter| converter.noise_mv).fold(0.0, f64::max),
            },
            None => described,
        }
    }

    /// What is known of its converters' errors, and the converter of each electrode that it has an input for.
    pub fn converters(self) -> (Vec<detector::ConverterErrors>, Vec<usize>) {
        let Some(analog) = &self.figures().analog else { return (Vec::new(), vec![0; self.most_electrodes()]) };
        let errors = |of: &ConverterFigures| detector::ConverterErrors {
            gain_share: of.gain_deviation,
            bow_v: 1e-3 * of.bow_mv,
            range_v: [of.floor_mv, of.ceiling_mv].map(|mv| mv / 1e3),
        };
        let inputs = analog.converters.iter().enumerate();
        let inputs = inputs.flat_map(|(which, converter)| std::iter::repeat_n(which, converter.electrodes));
        (analog.converters.iter().map(errors).collect(), inputs.collect())
    }

    /// Frames a second of so many electrodes at the settings after a reset: what the scan or the line allows, whichever is less (`docs/firmware.md`).
    pub fn frames_per_s(self, electrodes: usize) -> f64 {
        let Figures { wiring, conversion_ns, row_work_ns, line, analog, .. } = self.figures();
        let settings = Settings::default();
        let select_us: u16 = if *wiring == Wiring::Latched { ONE_INPUT_SELECT_US } else { 0 };
        // Converters work side by side.
        let in_turn = |converters: &[ConverterFigures]| {
            let before =
                converters.iter().scan(0, |sum, converter| Some(std::mem::replace(sum, *sum + converter.electrodes)));
            let on_it =
                converters.iter().zip(before).map(|(of, before)| of.electrodes.min(electrodes.saturating_sub(before)));
            on_it.max().unwrap_or(electrodes)
        };
        let in_turn = analog.as_ref().map_or(electrodes, |analog| in_turn(analog.converters)) as f64;
        let row_s = in_turn * (1e-9 * *conversion_ns as f64 + 1e-6 * f64::from(select_us))
            + 1e-6 * f64::from(settings.settle_us)
            + 1e-9 * *row_work_ns as f64 * electrodes as f64 / ROW_ELECTRODES;
        let line_s =
            line.map_or(0.0, |line| (FRAME_BYTES + BYTES_PER_READING * electrodes.pow(2) as f64) / line.bytes_per_s);
        1.0 / (electrodes as f64 * row_s).max(line_s)
    }

    /// What the firmware knows of its converters, where the board has some of its own.
    pub(super) fn firmware_adc(self) -> Option<FirmwareAdc> {
        let analog = self.figures().analog.as_ref()?;
        let ranges: Vec<Range> = analog.converters.iter().map(ConverterFigures::range).collect();
        Some(FirmwareAdc::new(BITS, FULL_SCALE_MV).with_ranges(&ranges))
    }
}

impl ConverterFigures {
    /// What it can see, in codes, which are millivolts.
    fn range(&self) -> Range {
        let [floor, ceiling] = [self.floor_mv, self.ceiling_mv].map(|mv| mv as u16);
        let [noise_uv, bow_uv] = [self.noise_mv, self.bow_mv].map(|mv| (1e3 * mv) as u16);
        let errors = ConverterErrors { noise_uv, gain_ppm: (1e6 * self.gain_deviation) as u16, bow_uv };
        Range { electrodes: self.electrodes as u8, floor, ceiling, errors }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As `docs/firmware.md` works them out.
    #[test]
    fn frames_a_second_are_those_of_the_documents() {
        for (model, electrodes, frames_per_s) in [
            (BoardModel::Esp32, 16, 428.0),
            (BoardModel::Esp32c3, 16, 66.0),
            // 16 of (20 + 16 x 2) us.
            (BoardModel::Ideal, 16, 1e6 / 832.0),
            // Six on the first converter, three on the second: 9 of (60 + 20) us and nine sixteenths of a row's work each.
            (BoardModel::Esp32, 9, 1e6 / (9.0 * 80.0 + 81.0 / 256.0 * 417.9)),
        ] {
            let found = model.frames_per_s(electrodes);
            assert!((found / frames_per_s - 1.0).abs() < 0.01, "{} {electrodes}: {found}", model.name());
        }
    }

    #[test]
    fn floors_are_those_of_each_electrodes_converter() {
        let (converters, inputs) = BoardModel::Esp32.converters();
        let known = converters.iter().map(|of| (of.gain_share, of.bow_v));
        assert!(known.eq([(0.01, 0.012); 2]), "{converters:?}");
        let floor_v = |input: usize| converters[inputs[input]].range_v[0];
        assert_eq!((inputs.len(), floor_v(0), floor_v(5), floor_v(6)), (16, 0.142, 0.142, 0.128));
        let (ideal, c3) = (BoardModel::Ideal.converters(), BoardModel::Esp32c3.converters());
        assert!(ideal.0.is_empty() && ideal.1.len() == 32 && c3.0[0].range_v[0] == 0.0 && c3.1.len() == 16);
    }
}
