//! The unit of readings in a table, and whether readings can be in it.

use tactomo::detector::Detector;

/// Readings above this many times what the drive can give or the converter can read are not volts: no pad of a passive detector is
/// above the drive voltage. The rest is room for noise and for a drive that is off by as much as supplies are, 5 %.
const ROOM: f64 = 1.1;

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

/// Checks that the largest reading of a table (V) is one that a detector can give.
///
/// # Errors
/// What the readings may be in, and what to do.
pub fn check(largest_v: f64, unit: Unit, detector: &Detector) -> Result<(), String> {
    let limit_v = detector.drive_v.max(detector.adc.full_scale_v);
    if largest_v <= ROOM * limit_v {
        return Ok(());
    }
    let hint = match unit {
        Unit::Volt if largest_v * 1e-3 <= ROOM * limit_v => "are these millivolts? Give --unit mV",
        _ => "are these codes of the converter? Convert them to volts",
    };
    Err(format!(
        "readings go up to {largest_v} V, but the detector {} is driven with {} V and read up to {} V: {hint}",
        detector.name, detector.drive_v, detector.adc.full_scale_v
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_above_what_can_be_are_refused_with_a_hint() {
        let detector = Detector::default();
        assert_eq!(check(1.99, Unit::Volt, &detector), Ok(()));
        assert_eq!(check(3.4, Unit::Volt, &detector), Ok(()), "a converter at its end");
        let refused = |largest_v, unit| check(largest_v, unit, &detector).err().unwrap_or_default();
        assert!(refused(1500.0, Unit::Volt).contains("up to 1500 V"), "{}", refused(1500.0, Unit::Volt));
        assert!(refused(8.0, Unit::Volt).contains("--unit mV"), "a light touch in millivolts");
        assert!(refused(4095.0, Unit::Volt).contains("codes of the converter"));
        assert!(refused(5.0, Unit::Millivolt).contains("codes of the converter"));
    }
}
