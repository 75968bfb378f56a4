//! A calibrated detector in a new file.

use std::fs::OpenOptions;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use tactomo_physics::detector::Detector;

/// Most files of one name.
const MOST: usize = 1000;

/// Writes a detector to a new file `NAME-cal.toml` of a folder, and the surface of a curved one to `NAME-cal.obj`; `NAME-cal-2.toml` and so on
/// where there is one: none is replaced.
///
/// # Errors
/// As a sentence for a person, if it cannot be written.
pub(super) fn save(detector: &Detector, folder: &Path) -> Result<PathBuf, String> {
    let name: String =
        detector.name.chars().map(|c| if c.is_alphanumeric() || "-_".contains(c) { c } else { '-' }).collect();
    for number in 1..=MOST {
        let count = if number == 1 { String::new() } else { format!("-{number}") };
        let stem = format!("{name}-cal{count}");
        let path = folder.join(format!("{stem}.toml"));
        let (text, surface) = detector.to_files(&stem);
        match written(&path, &text, surface.map(|(file, obj)| (folder.join(file), obj))) {
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

/// Writes the surface first, so that there is no detector without it.
fn written(path: &Path, text: &str, surface: Option<(PathBuf, String)>) -> io::Result<()> {
    let new = |path: &Path, text: &str| {
        OpenOptions::new().write(true).create_new(true).open(path)?.write_all(text.as_bytes())
    };
    if path.exists() {
        return Err(ErrorKind::AlreadyExists.into());
    }
    surface.map_or(Ok(()), |(path, obj)| new(&path, &obj))?;
    new(path, text)
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

    #[test]
    fn a_curved_detector_takes_its_surface_along_whatever_file_that_was() {
        let folder = std::env::temp_dir().join(format!("tactomo-save-curved-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/detectors/fingertip.toml");
        let mut detector = Detector::read(&example).unwrap();
        if let Some(surface) = &mut detector.surface {
            surface.file = "/dev/zero".to_owned();
        }
        let files = [save(&detector, &folder), save(&detector, &folder)].map(Result::unwrap);
        let read = files.each_ref().map(|file| Detector::read(file).unwrap());
        std::fs::remove_dir_all(&folder).unwrap();
        for (read, name) in read.iter().zip(["cal.obj", "cal-2.obj"]) {
            let surface = read.surface.as_ref().unwrap();
            assert!(surface.file.ends_with(name), "{}", surface.file);
            assert_eq!(surface.triangles, detector.surface.as_ref().unwrap().triangles);
        }
    }
}
