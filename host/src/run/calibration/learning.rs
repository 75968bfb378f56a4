//! What is learned of a detector, and kept from one run to the next.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;

/// How a detector is learned from what presses.
#[derive(Clone, Debug)]
pub struct Learning {
    /// The detector as it is described, from which every fit begins.
    pub description: Detector,
    /// Where what was learned is kept for the next run; `None` if it is not.
    pub file: Option<PathBuf>,
}

impl Learning {
    /// Of a detector that is described so, in a file or else only until the run ends: what is learned of `my.toml` is kept in `my.learned.toml`
    /// beside it. `None` of one that is calibrated, or taken as exact.
    pub fn of(description: &Detector, file: Option<&Path>) -> Option<Self> {
        let is_known = description.calibration.is_some() || description.tolerances.is_exact();
        let file = file.map(|file| file.with_extension("learned.toml"));
        (!is_known).then(|| Self { description: description.clone(), file })
    }

    /// What was kept by a run before; `None` if nothing was.
    ///
    /// # Errors
    /// As a sentence for a person, if there is a file and it cannot be used.
    pub fn kept(&self) -> Result<Option<Detector>, String> {
        let Some(path) = self.file.as_ref().filter(|path| path.exists()) else { return Ok(None) };
        let kept = Detector::read(path).map_err(|error| with_causes(&error))?;
        if kept.calibration.is_none() || !kept.may_be_of(&self.description) {
            return Err(format!("{} is not of {} as it is described now", path.display(), self.description.name));
        }
        // Newtons and what they need are not learned.
        Ok(Some(Detector { force: self.description.force.clone(), skin: self.description.skin, ..kept }))
    }
}

/// Keeps what was learned, in place of what was there.
///
/// # Errors
/// As a sentence for a person, if it cannot be written.
pub(super) fn keep(learned: &Detector, path: &Path) -> Result<(), String> {
    let (text, surface) = learned.to_files(&path.file_stem().unwrap_or_default().to_string_lossy());
    let surface = surface.map_or(Ok(()), |(file, obj)| replace(&path.with_file_name(file), &obj));
    let written = surface.and_then(|()| replace(path, &text));
    written.map_err(|error| format!("what was learned cannot be kept in {}: {error}", path.display()))
}

/// Writes a file in one step: whoever reads meanwhile, or after a loss of power, finds it whole, as it was or as it is.
fn replace(path: &Path, text: &str) -> io::Result<()> {
    let mut unfinished = OsString::from(path);
    unfinished.push(".part");
    fs::write(&unfinished, text)?;
    fs::rename(&unfinished, path)
}

#[cfg(test)]
mod tests {
    use tactomo_physics::detector::Calibration;

    use super::*;

    #[test]
    fn what_is_kept_is_found_again_as_long_as_it_fits_the_description() {
        let folder = std::env::temp_dir().join(format!("tactomo-learned-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let described = Detector { name: "mine".to_owned(), ..Detector::default() };
        let learning = Learning::of(&described, Some(&folder.join("mine.toml"))).unwrap();
        let path = folder.join("mine.learned.toml");
        assert_eq!((learning.file.as_deref(), learning.kept()), (Some(&*path), Ok(None)), "nothing is learned yet");
        let calibration = Calibration { presses: 12, place_error_m: Some(2e-4), ..Calibration::default() };
        let mut learned = Detector { calibration: Some(calibration), ..described.clone() };
        learned.layers[0].thickness_m *= 1.1;
        for _ in 0..2 {
            keep(&learned, &path).unwrap();
            assert_eq!(learning.kept(), Ok(Some(learned.clone())));
        }
        assert!(Learning::of(&learned, None).is_none() && Learning::of(&described.taken_as_exact(), None).is_none());
        let other = Detector { tolerances: described.taken_as_exact().tolerances, ..described };
        let other = Learning { description: other, ..learning.clone() };
        assert!(other.kept().is_err_and(|what| what.contains("mine.learned.toml")), "the description has changed");
        fs::write(&path, "nonsense").unwrap();
        assert!(learning.kept().is_err_and(|what| what.contains("mine.learned.toml")));
        fs::remove_dir_all(&folder).unwrap();
        assert!(keep(&learned, &path).is_err_and(|what| what.contains("mine.learned.toml")));
    }
}
