//! What the numbers of a table are: volts, millivolts, or codes of a converter.

use std::str::FromStr;

use tactomo::board::frames::FileFrame;
use tactomo::detector::{Adc, Detector};
use tactomo::readings::{Likely, check_volts};

/// Most bits that a converter has.
const MOST_BITS: u8 = 24;

/// How the numbers of a table are told to be volts.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct UnitArgs {
    /// Unit of the readings in a table [default: V]
    #[arg(long, value_name = "V|mV")]
    unit: Option<Unit>,
    /// The readings in a table are codes of a converter of so many bits, whose full scale is so many volts: 10,5 of an Arduino
    #[arg(long, value_name = "BITS,FULL_SCALE_V", conflicts_with = "unit")]
    adc: Option<Codes>,
}

impl UnitArgs {
    /// The unit that is given, if one is.
    pub fn given(&self) -> Option<Unit> {
        self.adc.map(Unit::Codes).or(self.unit)
    }
}

/// Unit of readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unit {
    /// Volts.
    Volt,
    /// Thousandths of a volt.
    Millivolt,
    /// Codes of a converter.
    Codes(Codes),
}

/// Codes of a converter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Codes {
    bits: u8,
    full_scale_v: f64,
}

impl Unit {
    /// Volts in it.
    fn volts(self) -> f64 {
        match self {
            Self::Volt => 1.0,
            Self::Millivolt => 1e-3,
            Self::Codes(codes) => codes.full_scale_v / codes.count(),
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Volt => "volts",
            Self::Millivolt => "millivolts",
            Self::Codes(_) => "codes of that converter",
        }
    }

    /// A detector as it is read where readings are in this unit.
    pub fn read(self, detector: Detector) -> Detector {
        match self {
            Self::Volt | Self::Millivolt => detector,
            Self::Codes(Codes { bits, full_scale_v }) => {
                let adc = Adc { bits, full_scale_v, ..detector.adc };
                Detector { adc, ..detector }
            }
        }
    }
}

impl Codes {
    fn count(self) -> f64 {
        f64::from(1u32 << self.bits)
    }
}

impl FromStr for Unit {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match name {
            "V" | "v" => Ok(Self::Volt),
            "mV" | "mv" => Ok(Self::Millivolt),
            _ => Err("V or mV is needed; codes of a converter are told with --adc".to_owned()),
        }
    }
}

impl FromStr for Codes {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "the converter's bits, 1 to {MOST_BITS}, and its full scale in volts are needed, as in 10,5 of an Arduino of 5 V"
            )
        };
        let (bits, full_scale) = text.split_once(',').ok_or_else(wrong)?;
        let bits = bits.trim().parse().ok().filter(|bits| (1..=MOST_BITS).contains(bits));
        let full_scale_v = full_scale.trim().parse().ok().filter(|volts: &f64| (1e-3..=1e3).contains(volts));
        Ok(Self { bits: bits.ok_or_else(wrong)?, full_scale_v: full_scale_v.ok_or_else(wrong)? })
    }
}

/// Makes volts of the readings of a table, and checks that they are such as a detector can give.
///
/// # Errors
/// What the readings may be in, and what to do.
pub fn make_volts(frames: &mut [FileFrame], unit: Unit, detector: Option<&Detector>) -> Result<(), String> {
    let given = || frames.iter().flat_map(|frame| frame.volts.iter().copied());
    let are_whole = given().all(|number| number.fract() == 0.0);
    let largest = given().fold(0.0, f64::max);
    if let Unit::Codes(codes) = unit
        && largest >= codes.count()
    {
        return Err(format!(
            "codes go up to {largest}, but a converter of {} bits has {} codes: give --adc its bits",
            codes.bits,
            codes.count()
        ));
    }
    let all = frames.iter_mut().flat_map(|frame| frame.volts.iter_mut().chain(&mut frame.measured_v));
    all.for_each(|value| *value *= unit.volts());
    let Some(detector) = detector else { return Ok(()) };
    let volts = frames.iter().flat_map(|frame| frame.volts.iter().copied());
    check(volts, unit, are_whole, detector)
}

/// Checks that readings (V), which were whole numbers in their unit or not, are such as a detector can give.
fn check(volts: impl IntoIterator<Item = f64>, unit: Unit, are_whole: bool, detector: &Detector) -> Result<(), String> {
    const CODES: &str = "--adc BITS,FULL_SCALE_V for codes, such as --adc 10,5 of an Arduino of 5 V";
    check_volts(volts, detector).map_err(|mut refused| match (refused.likely, unit) {
        (Likely::Millivolts, Unit::Volt) if are_whole => {
            format!("{refused} Or codes of the converter? Give --unit mV for millivolts, or {CODES}")
        }
        (Likely::Millivolts, Unit::Volt) => format!("{refused} Give --unit mV"),
        (_, Unit::Codes(_)) => format!(
            "readings go up to {} V, above the drive and full scale of the detector {}: is --adc the converter's, or has the detector another drive_v?",
            refused.largest_v, detector.name
        ),
        _ => {
            refused.likely = Likely::Codes;
            let microvolts = if are_whole { "" } else { "; microvolts divided by 1000 are --unit mV" };
            format!("{refused} Give {CODES}{microvolts}")
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_above_what_can_be_are_refused_with_a_hint() {
        let detector = Detector::default();
        assert_eq!(check([1.99], Unit::Volt, false, &detector), Ok(()));
        let refused =
            |largest_v, unit, are_whole| check([0.0, largest_v], unit, are_whole, &detector).err().unwrap_or_default();
        let of_volts = |largest_v, are_whole| refused(largest_v, Unit::Volt, are_whole);
        assert!(of_volts(1500.5, false).contains("up to 1500.5 V"), "{}", of_volts(1500.5, false));
        assert!(of_volts(8.5, false).ends_with("are these millivolts? Give --unit mV"), "a light touch in millivolts");
        for words in ["--unit mV", "--adc 10,5"] {
            assert!(of_volts(171.0, true).contains(words), "{}", of_volts(171.0, true));
        }
        for told in [of_volts(4095.0, true), refused(5.0, Unit::Millivolt, false)] {
            assert!(told.contains("codes of the converter? Give --adc"), "{told}");
        }
    }

    #[test]
    fn a_converter_is_its_bits_and_its_full_scale() {
        let codes: Codes = "10, 5".parse().unwrap();
        assert_eq!(
            (Unit::Codes(codes).volts(), Unit::Codes(codes).read(Detector::default()).adc.bits),
            (5.0 / 1024.0, 10)
        );
        for wrong in ["10", "0,5", "10,0", "25,5", "10,nan", "ten,5", "10,5,1"] {
            assert!(wrong.parse::<Codes>().is_err_and(|error| error.contains("10,5")), "{wrong}");
        }
    }
}
