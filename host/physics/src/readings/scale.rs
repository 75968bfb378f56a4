//! Whether numbers can be volts of a detector.

use std::fmt;

use crate::detector::Detector;

/// Readings above this many times what the drive can give or the converter can read are not volts: no pad of a passive detector is
/// above the drive voltage. The rest is room for noise and for a drive that is off by as much as supplies are, 5 %.
const ROOM: f64 = 1.1;

/// Readings that cannot be volts of the detector. Whoever took them in says how to tell their unit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "readings go up to {largest_v} V, but the detector {detector} is driven with {drive_v} V and read up to {full_scale_v} V: \
     are these {likely}?"
)]
pub struct NotVolts {
    /// The largest of them, taken as volts (V).
    pub largest_v: f64,
    /// What they may be instead.
    pub likely: Likely,
    /// Name of the detector.
    detector: String,
    drive_v: f64,
    full_scale_v: f64,
}

/// What readings may be that are no volts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Likely {
    /// Thousandths of a volt.
    Millivolts,
    /// Codes of the converter.
    Codes,
}

impl fmt::Display for Likely {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Millivolts => "millivolts",
            Self::Codes => "codes of the converter",
        })
    }
}

/// Checks that readings (V) are such as a detector can give, as it is driven and read. What is not finite is another's business.
///
/// # Errors
/// [`NotVolts`], which says what they may be in.
pub fn check_volts(volts: impl IntoIterator<Item = f64>, detector: &Detector) -> Result<(), NotVolts> {
    let sizes_v = volts.into_iter().map(f64::abs).filter(|size_v| size_v.is_finite());
    let largest_v = sizes_v.fold(0.0, f64::max);
    let limit_v = ROOM * detector.drive_v.max(detector.adc.full_scale_v);
    if largest_v <= limit_v {
        return Ok(());
    }
    Err(NotVolts {
        largest_v,
        likely: if largest_v * 1e-3 <= limit_v { Likely::Millivolts } else { Likely::Codes },
        detector: detector.name.clone(),
        drive_v: detector.drive_v,
        full_scale_v: detector.adc.full_scale_v,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_above_what_can_be_are_refused_with_what_they_may_be() {
        let detector = Detector::default();
        let likely = |volts: f64| check_volts([0.1, -volts, f64::NAN], &detector).map_err(|refused| refused.likely);
        assert_eq!(likely(1.99), Ok(()));
        assert_eq!(likely(3.4), Ok(()), "a converter at its end");
        assert_eq!(likely(8.0), Err(Likely::Millivolts), "a light touch");
        assert_eq!(likely(1500.0), Err(Likely::Millivolts));
        assert_eq!(likely(4095.0), Err(Likely::Codes));
        let refused = check_volts([1500.0], &detector).err().map(|refused| refused.to_string());
        let words = "readings go up to 1500 V, but the detector square-60 is driven with 2 V and read up to 3.3 V: are these millivolts?";
        assert_eq!(refused.as_deref(), Some(words));
    }
}
