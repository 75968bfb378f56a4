//! A calibrated detector in a new file.

use std::fs::OpenOptions;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;

/// Most files of one name.
const MOST: usize = 1000;

/// Writes a detector to a new file `NAME-cal.toml` of a folder, or `NAME-cal-2.toml` and so on where there is one; none is replaced.
///
/// # Errors
/// As a sentence for a person, if it cannot be written or not be read back from there.
pub(super) fn save(detector: &Detector, folder: &Path) -> Result<PathBuf, String> {
    let text = detector.to_toml();
    let read = Detector::from_toml_in(folder, &text, "");
    read.map_err(|error| {
        format!("the detector could not be read back from {}: {}", folder.display(), with_causes(&error))
    })?;
    let name: String =
        detector.name.chars().map(|c| if c.is_alphanumeric() || "-_".contains(c) { c } else { '-' }).collect();
    for number in 1..=MOST {
        let count = if number == 1 { String::new() } else { format!("-{number}") };
        let path = folder.join(format!("{name}-cal{count}.toml"));
        match written(&path, &text) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            written => {
                return written
                    .map(|()| path.clone())
                    .map_err(|error| format!("cannot write {}: {error}", path.display()));
            }
        }
    }
    Err(format!("{MOST} files {name}-cal in {} are enough: remove some", folder.display()))
}

fn written(path: &Path, text: &str) -> io::Result<()> {
    OpenOptions::new().write(true).create_new(true).open(path)?.write_all(text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_file_is_replaced_and_names_stay_in_the_folder() {
        let folder = std::env::temp_dir().join(format!("tactomo-save-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let detector = Detector { name: "../my pad".to_owned(), ..Detector::default() };
        let files = [save(&detector, &folder), save(&detector, &folder)].map(Result::unwrap);
        let read = Detector::read(&files[1]);
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(files, ["---my-pad-cal.toml", "---my-pad-cal-2.toml"].map(|name| folder.join(name)));
        assert_eq!(read.unwrap().electrodes, detector.electrodes);
    }
}
