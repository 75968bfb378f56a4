//! The unit of readings in a table.

use tactomo::detector::Detector;
use tactomo::readings::{Likely, check_volts};

/// Unit of readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Volts.
    Volt,
    /// Thousandths of a volt.
    Millivolt,
}

impl Unit {
    /// Volts in it.
    pub fn volts(self) -> f64 {
        match self {
            Self::Volt => 1.0,
            Self::Millivolt => 1e-3,
        }
    }
}

impl std::str::FromStr for Unit {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match name {
            "V" | "v" => Ok(Self::Volt),
            "mV" | "mv" => Ok(Self::Millivolt),
            _ => Err("V or mV is needed".to_owned()),
        }
    }
}

/// Checks that the readings of a table, made volts of its unit (V), are such as a detector can give.
///
/// # Errors
/// What the readings may be in, and what to do.
pub fn check(volts: impl IntoIterator<Item = f64>, unit: Unit, detector: &Detector) -> Result<(), String> {
    check_volts(volts, detector).map_err(|mut refused| match (refused.likely, unit) {
        (Likely::Millivolts, Unit::Volt) => format!("{refused} Give --unit mV"),
        _ => {
            // Thousandths of millivolts are not measured.
            refused.likely = Likely::Codes;
            format!("{refused} Convert them to volts")
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_above_what_can_be_are_refused_with_a_hint() {
        let detector = Detector::default();
        assert_eq!(check([1.99], Unit::Volt, &detector), Ok(()));
        let refused = |largest_v, unit| check([0.0, largest_v], unit, &detector).err().unwrap_or_default();
        assert!(refused(1500.0, Unit::Volt).contains("up to 1500 V"), "{}", refused(1500.0, Unit::Volt));
        assert!(
            refused(8.0, Unit::Volt).ends_with("are these millivolts? Give --unit mV"),
            "a light touch in millivolts"
        );
        assert!(refused(4095.0, Unit::Volt).ends_with("codes of the converter? Convert them to volts"));
        assert!(refused(5.0, Unit::Millivolt).contains("codes of the converter"));
    }
}
