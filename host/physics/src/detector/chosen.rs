//! What a person names as a detector: a preset, or a file.

use std::path::PathBuf;
use std::str::FromStr;

use super::{Detector, FileError};

/// A preset, or a file that is still to be read.
///
/// ```
/// use tactomo_physics::detector::Chosen;
///
/// let detector = "display-140x70".parse::<Chosen>()?.get()?;
/// assert_eq!(detector.electrodes.len(), 32);
/// assert!("round".parse::<Chosen>().is_err_and(|error| error.to_string().contains("choose one of square-60")));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub enum Chosen {
    /// A preset.
    Preset(Box<Detector>),
    /// A TOML file.
    File(PathBuf),
}

/// A name that is neither a preset's nor a file's.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "there is no preset of that name; choose one of {names}, or a file such as my.toml",
    names = Detector::preset_names().collect::<Vec<_>>().join(", ")
)]
pub struct UnknownDetector;

impl Chosen {
    /// The detector.
    ///
    /// # Errors
    /// [`FileError`] if it is a file that cannot be read or is no detector.
    pub fn get(&self) -> Result<Detector, FileError> {
        match self {
            Self::Preset(detector) => Ok((**detector).clone()),
            Self::File(path) => Detector::read(path),
        }
    }
}

impl FromStr for Chosen {
    type Err = UnknownDetector;

    fn from_str(name: &str) -> Result<Self, UnknownDetector> {
        if let Some(preset) = Detector::preset(name) {
            return Ok(Self::Preset(Box::new(preset)));
        }
        let path = PathBuf::from(name);
        if path.extension().is_some() || path.is_file() { Ok(Self::File(path)) } else { Err(UnknownDetector) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_a_preset_or_a_file_or_says_what_there_is() {
        assert!(matches!("square-50".parse(), Ok(Chosen::Preset(detector)) if detector.name == "square-50"));
        assert!(matches!("my.toml".parse(), Ok(Chosen::File(path)) if path.as_os_str() == "my.toml"));
        let error = "round".parse::<Chosen>().map_err(|error| error.to_string());
        assert!(error.is_err_and(|error| error.contains("square-60, square-50")));
    }
}
