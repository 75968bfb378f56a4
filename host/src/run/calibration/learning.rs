//! What is learned of a sensor, and kept from one run to the next.
//!
//! It belongs to one sensor: a file says whose it is, and of several sensors with one description each has a file of its own.

use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use crc::{CRC_32_ISO_HDLC, Crc};
use tactomo_board::identity::Sensor;
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::{Calibration, Detector, Surface};
use tactomo_table::file::{self, Format, Unfinished};

/// Most files of one name, of sensors that a name does not tell apart.
const MOST: usize = 100;
/// The surface of a curved detector.
const SURFACE: Format = Format::new("a detector's surface", 64 << 20);
const CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// How a detector is learned from what presses.
#[derive(Clone, Debug)]
pub struct Learning {
    /// The detector as it is described, from which every fit begins.
    pub description: Detector,
    /// Where what was learned is kept for the next run.
    pub keeping: Keeping,
}

/// Where what is learned is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Keeping {
    /// Nowhere: it holds until the run ends.
    Nowhere,
    /// In this file, which a person has named.
    In(PathBuf),
    /// Beside the file of the description: of `my.toml` in `my.SENSOR.learned.toml`.
    Beside {
        /// The description's file.
        description: PathBuf,
        /// Name of the sensor among several; empty if it is alone.
        patch: String,
    },
}

/// What was kept of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Kept {
    /// The file.
    pub file: PathBuf,
    /// The detector as it was learned.
    pub detector: Detector,
}

/// Whether a file is of a sensor.
enum Found {
    /// There is none.
    None,
    /// It is.
    Its(Box<Detector>),
    /// It is not, for the reason given.
    Other(String),
    /// It cannot be read, for the reason given.
    Unreadable(String),
}

impl Learning {
    /// Of a detector that is described so. `None` of one that is calibrated, or taken as exact.
    pub fn of(description: &Detector, keeping: Keeping) -> Option<Self> {
        let is_known = description.calibration.is_some() || description.tolerances.is_exact();
        (!is_known).then(|| Self { description: description.clone(), keeping })
    }

    /// What was kept of a sensor by a run before, and sentences on what was not taken, and why.
    pub fn kept(&self, sensor: &Sensor) -> (Option<Kept>, Vec<String>) {
        let mut refused = Vec::new();
        for file in self.files(sensor) {
            match self.look(&file, sensor) {
                Found::None => break,
                Found::Its(detector) => return (Some(Kept { file, detector: *detector }), refused),
                Found::Other(why) | Found::Unreadable(why) => {
                    refused.push(format!("{} is not used: {why}", file.display()))
                }
            }
        }
        // What versions before kept says which kind of board it is of, and not which one: of several it might be any.
        if let Keeping::Beside { description, patch } = &self.keeping {
            let file = description.with_extension("learned.toml");
            match self.look(&file, sensor) {
                Found::Its(detector) if patch.is_empty() => return (Some(Kept { file, detector: *detector }), refused),
                Found::None => {}
                Found::Its(_) => {
                    refused.push(format!("{} is not used: it does not say of which board it is", file.display()))
                }
                Found::Other(why) | Found::Unreadable(why) => {
                    refused.push(format!("{} is not used: {why}", file.display()))
                }
            }
        }
        (None, refused)
    }

    /// Checks a file that a person has named: where there is one, it has to be of this detector.
    ///
    /// # Errors
    /// As a sentence for a person.
    pub fn check(&self) -> Result<(), String> {
        let Keeping::In(file) = &self.keeping else { return Ok(()) };
        match self.read(file) {
            Found::Other(why) | Found::Unreadable(why) => Err(format!("{} cannot be used: {why}", file.display())),
            Found::None | Found::Its(_) => Ok(()),
        }
    }

    /// Keeps what was learned of a sensor, in place of what was kept of it. No other file is harmed: one that cannot be read is set aside. Returns the file.
    ///
    /// # Errors
    /// As a sentence for a person, if it cannot be written.
    pub(super) fn keep(&self, learned: &Detector, sensor: &Sensor) -> Result<Option<PathBuf>, String> {
        let calibration = Calibration {
            sensor: Some(self.name(sensor)),
            description: Some(checksum(&self.description)),
            ..learned.calibration.clone().unwrap_or_default()
        };
        let learned = Detector { calibration: Some(calibration), ..learned.clone() };
        let mut refused = None;
        for file in self.files(sensor) {
            let failed = |error: io::Error| {
                format!("what was learned cannot be kept in {}: {}", file.display(), with_causes(&error))
            };
            let is_its = match self.look(&file, sensor) {
                Found::Its(_) => true,
                Found::None => false,
                Found::Other(why) => {
                    refused = Some(format!("what was learned is not kept in {}: {why}", file.display()));
                    continue;
                }
                Found::Unreadable(why) => {
                    let aside = file::set_aside(&file).map_err(failed)?;
                    tracing::warn!("{} cannot be used, and is {} now: {why}", file.display(), aside.display());
                    false
                }
            };
            match write(&learned, &file, is_its) {
                // Another run was faster.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                written => return written.map(|()| Some(file.clone())).map_err(failed),
            }
        }
        refused.map_or(Ok(None), Err)
    }

    /// Files that may be of a sensor, the likeliest first.
    fn files(&self, sensor: &Sensor) -> Vec<PathBuf> {
        match &self.keeping {
            Keeping::Nowhere => Vec::new(),
            Keeping::In(file) => vec![file.clone()],
            Keeping::Beside { description, patch } => {
                let label = sensor.label(patch);
                let named = |number: usize| match number {
                    1 => description.with_extension(format!("{label}.learned.toml")),
                    _ => description.with_extension(format!("{label}-{number}.learned.toml")),
                };
                (1..=MOST).map(named).collect()
            }
        }
    }

    /// The sensor's name, as files have it.
    fn name(&self, sensor: &Sensor) -> String {
        match &self.keeping {
            Keeping::Beside { patch, .. } => sensor.name(patch),
            Keeping::Nowhere | Keeping::In(_) => sensor.name(""),
        }
    }

    /// What a file is to a sensor.
    fn look(&self, file: &Path, sensor: &Sensor) -> Found {
        let mut detector = match self.read(file) {
            Found::Its(detector) => detector,
            other => return other,
        };
        // Whose it is concerns the file alone: recordings carry what is in use.
        let calibration = detector.calibration.as_mut();
        let told = calibration.map(|known| (known.sensor.take(), known.description.take(), known.board.clone()));
        let (of, _, board) = told.unwrap_or_default();
        let (name, here) = (self.name(sensor), &sensor.board);
        match (of, board) {
            (Some(of), _) if of != name => {
                Found::Other(format!("it is of another sensor ({of}) than this one ({name})"))
            }
            (_, Some(board)) if board != *here => {
                Found::Other(format!("it was learned with another board ({board}) than this one ({here})"))
            }
            (None, None) => Found::Other("it does not say of which board it is".to_owned()),
            _ => Found::Its(detector),
        }
    }

    /// Whether a detector was learned from this description. Files of versions before say less of theirs.
    fn may_be_of(&self, kept: &Detector) -> bool {
        let Some(calibration) = &kept.calibration else { return false };
        let is_same = calibration.description.as_ref().is_none_or(|began| *began == checksum(&self.description));
        is_same && kept.may_be_of(&self.description)
    }

    /// What a file is to this detector, of whichever sensor.
    fn read(&self, file: &Path) -> Found {
        match file::check_regular(file) {
            Err(_) if file.symlink_metadata().is_err() => return Found::None,
            // It may be anybody's, and is no file that was kept.
            Err(error) => return Found::Other(with_causes(&error)),
            Ok(()) => {}
        }
        match Detector::read(file) {
            Err(error) => Found::Unreadable(with_causes(&error)),
            Ok(kept) if !self.may_be_of(&kept) => {
                Found::Other(format!("it is not of {} as it is described now", self.description.name))
            }
            // Newtons and what they need are not learned.
            Ok(kept) => Found::Its(Box::new(Detector {
                force: self.description.force.clone(),
                skin: self.description.skin,
                ..kept
            })),
        }
    }
}

/// What stands for a description: all that a fit begins from.
fn checksum(description: &Detector) -> String {
    let begun = Detector { force: None, skin: None, correction: None, calibration: None, ..description.clone() };
    let surface = begun.surface.as_ref().map(Surface::to_obj).unwrap_or_default();
    format!("{:08x}", CHECKSUM.checksum((begun.to_toml() + &surface).as_bytes()))
}

/// Writes a detector to a file; its surface first, so that there is no detector without it. What is there is replaced only if that `is_its`.
fn write(learned: &Detector, file: &Path, is_its: bool) -> io::Result<()> {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let named = |number: usize| if number == 1 { stem.clone() } else { format!("{stem}-{number}") };
    for (text, surface) in (1..=MOST).map(|number| learned.to_files(&named(number))) {
        let surface = surface.map_or(Ok(()), |(name, obj)| surface_beside(&file.with_file_name(name), &obj));
        match surface {
            // Something else has its name.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
            Ok(()) => return new(file, &text, is_its),
        }
    }
    Err(io::Error::other(format!("{MOST} surfaces of such names are enough: remove some")))
}

/// Writes a surface, unless that very one is there.
fn surface_beside(path: &Path, obj: &str) -> io::Result<()> {
    let is_there = file::check_regular(path).is_ok() && SURFACE.read_text(path).is_ok_and(|there| there == obj);
    if is_there { Ok(()) } else { new(path, obj, false) }
}

/// Writes a file in one step.
fn new(path: &Path, text: &str, is_replaced: bool) -> io::Result<()> {
    let (unfinished, mut file) = Unfinished::beside(path)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()?;
    unfinished.name(path, is_replaced)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// A folder with a detector that is described in a file, and what is learned of it.
    struct Bench {
        folder: PathBuf,
        description: Detector,
    }

    impl Bench {
        fn new(test: &str) -> Self {
            let folder = std::env::temp_dir().join(format!("tactomo-learned-{}-{test}", std::process::id()));
            fs::create_dir_all(&folder).unwrap();
            Self { folder, description: Detector { name: "mine".to_owned(), ..Detector::default() } }
        }

        fn learning(&self, patch: &str) -> Learning {
            let description = self.folder.join("mine.toml");
            Learning::of(&self.description, Keeping::Beside { description, patch: patch.to_owned() }).unwrap()
        }

        /// As a fit finds it, this much thicker.
        fn learned(&self, thicker: f64) -> Detector {
            let board = Some("test".to_owned());
            let calibration = Calibration { board, presses: 12, place_error_m: Some(2e-4), ..Calibration::default() };
            let mut learned = Detector { calibration: Some(calibration), ..self.description.clone() };
            learned.layers[0].thickness_m *= thicker;
            learned
        }

        fn path(&self, name: &str) -> PathBuf {
            self.folder.join(name)
        }

        fn files(&self) -> Vec<String> {
            let names = fs::read_dir(&self.folder).unwrap().map(|entry| entry.unwrap().file_name());
            let mut names: Vec<_> = names.map(|name| name.into_string().unwrap()).collect();
            names.sort();
            names
        }
    }

    impl Drop for Bench {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.folder);
        }
    }

    fn sensor(serial: Option<&str>, port: &str) -> Sensor {
        Sensor { board: "test".to_owned(), serial_number: serial.map(str::to_owned), port: port.to_owned() }
    }

    /// File and thickness of what is kept.
    fn kept(learning: &Learning, sensor: &Sensor) -> Option<(String, f64)> {
        let kept = learning.kept(sensor).0?;
        let name = kept.file.file_name().unwrap().to_string_lossy().into_owned();
        Some((name, kept.detector.layers[0].thickness_m / learning.description.layers[0].thickness_m))
    }

    #[test]
    fn sensors_of_one_description_keep_what_is_theirs() {
        let bench = Bench::new("several");
        let sensors = [
            (sensor(Some("A7"), "/dev/ttyUSB0"), "", "mine.A7.learned.toml"),
            (sensor(None, "/dev/ttyUSB0"), "", "mine.ttyUSB0.learned.toml"),
            (sensor(None, "/dev/ttyUSB1"), "ttyUSB1", "mine.ttyUSB1.learned.toml"),
            (sensor(None, "/dev/ttyUSB0"), "thumb", "mine.thumb-ttyUSB0.learned.toml"),
            // Names that end alike.
            (sensor(None, "/tmp/b/ttyUSB0"), "", "mine.ttyUSB0-2.learned.toml"),
            (sensor(Some("A/7"), "/dev/ttyUSB3"), "", "mine.A_7.learned.toml"),
            (sensor(Some("A_7"), "/dev/ttyUSB4"), "", "mine.A_7-2.learned.toml"),
        ];
        for round in [1.0, 1.1] {
            for (i, (sensor, patch, file)) in sensors.iter().enumerate() {
                let learned = bench.learned(round + 0.01 * i as f64);
                assert_eq!(bench.learning(patch).keep(&learned, sensor), Ok(Some(bench.path(file))));
            }
            for (i, (sensor, patch, file)) in sensors.iter().enumerate() {
                let (name, thicker) = kept(&bench.learning(patch), sensor).unwrap();
                assert!(name == *file && (thicker - round - 0.01 * i as f64).abs() < 1e-9, "{name} {thicker}");
            }
        }
        assert_eq!(bench.files().len(), sensors.len(), "{:?}", bench.files());
    }

    #[test]
    fn what_is_of_another_board_or_description_is_refused_and_left() {
        let mut bench = Bench::new("refused");
        let (here, file) = (sensor(Some("A7"), "COM3"), bench.path("mine.A7.learned.toml"));
        bench.learning("").keep(&bench.learned(1.1), &here).unwrap();
        let before = fs::read(&file).unwrap();
        let refused = |learning: &Learning, sensor: &Sensor| match learning.kept(sensor) {
            (None, refused) => refused.join("; "),
            (Some(kept), _) => panic!("{kept:?}"),
        };
        let other_board = Sensor { board: "another".to_owned(), ..here.clone() };
        assert!(
            refused(&bench.learning(""), &other_board).contains("with another board (test) than this one (another)")
        );
        fs::copy(&file, bench.path("mine.B8.learned.toml")).unwrap();
        let said = refused(&bench.learning(""), &sensor(Some("B8"), "COM4"));
        assert!(said.contains("another sensor (serial number A7) than this one (serial number B8)"), "{said}");
        type Change = fn(&mut Detector);
        let changes: [Change; 4] = [
            |detector| detector.electrodes[3].x_m += 1e-3,
            |detector| detector.layers[0].top_s_per_m *= 1.01,
            |detector| detector.contact_impedance_ohm_m2 *= 2.0,
            |detector| detector.tolerances.electrodes_m *= 2.0,
        ];
        for change in changes {
            let described = bench.description.clone();
            change(&mut bench.description);
            assert!(refused(&bench.learning(""), &here).contains("not of mine as it is described now"));
            bench.description = described;
        }
        change_electrodes(&mut bench.description);
        bench.learning("").keep(&bench.learned(1.2), &here).unwrap();
        assert_eq!(fs::read(&file).unwrap(), before);
        assert_eq!(kept(&bench.learning(""), &here).unwrap().0, "mine.A7-2.learned.toml");
    }

    fn change_electrodes(detector: &mut Detector) {
        detector.electrodes[0].y_m += 1e-3;
    }

    #[test]
    fn what_a_version_before_has_kept_is_used_by_a_board_alone_that_it_names_and_stays() {
        let bench = Bench::new("before");
        let (old, here) = (bench.path("mine.learned.toml"), sensor(Some("A7"), "COM3"));
        fs::write(&old, bench.learned(1.3).to_toml()).unwrap();
        assert_eq!(kept(&bench.learning(""), &here).unwrap().0, "mine.learned.toml");
        assert_eq!(kept(&bench.learning(""), &Sensor { board: "another".to_owned(), ..here.clone() }), None);
        assert_eq!(kept(&bench.learning("thumb"), &here), None, "of several it might be any");
        bench.learning("").keep(&bench.learned(1.1), &here).unwrap();
        assert_eq!(kept(&bench.learning(""), &here).unwrap().0, "mine.A7.learned.toml");
        assert_eq!(fs::read_to_string(&old).unwrap(), bench.learned(1.3).to_toml());
    }

    #[test]
    fn files_that_cannot_be_read_are_set_aside_and_none_is_written_through() {
        let bench = Bench::new("unreadable");
        let (file, here) = (bench.path("mine.A7.learned.toml"), sensor(Some("A7"), "COM3"));
        let foreign = bench.path("foreign");
        fs::write(&foreign, "foreign").unwrap();
        for name in ["mine.A7.learned.toml.part", "mine.A7.learned.toml.unfinished"] {
            #[cfg(unix)]
            std::os::unix::fs::symlink(&foreign, bench.path(name)).unwrap();
        }
        for count in 1..3 {
            fs::write(&file, "nonsense").unwrap();
            assert!(bench.learning("").kept(&here).1[0].contains("mine.A7.learned.toml is not used"));
            bench.learning("").keep(&bench.learned(1.1), &here).unwrap();
            assert!(kept(&bench.learning(""), &here).is_some());
            let aside = bench.files().iter().filter(|name| name.contains(".unreadable")).count();
            assert_eq!((aside, fs::read_to_string(&foreign).unwrap()), (count, "foreign".to_owned()));
        }
        let named = Learning { keeping: Keeping::In(foreign.clone()), ..bench.learning("") };
        assert!(named.check().is_err_and(|why| why.contains("foreign")));
        // A folder in its place is not moved.
        fs::remove_file(&file).unwrap();
        fs::create_dir(&file).unwrap();
        assert_eq!(bench.learning("").keep(&bench.learned(1.1), &here), Ok(Some(bench.path("mine.A7-2.learned.toml"))));
        let missing = Learning { keeping: Keeping::In(bench.path("no/such.toml")), ..bench.learning("") };
        assert!(missing.keep(&bench.learned(1.1), &here).is_err_and(|what| what.contains("such.toml")));
    }

    #[test]
    fn a_curved_detector_takes_its_surface_along_and_harms_no_other() {
        let mut bench = Bench::new("curved");
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/detectors/fingertip.toml");
        bench.description = Detector::read(&example).unwrap();
        let here = sensor(Some("A7"), "COM3");
        let foreign = bench.path("mine.A7.learned.obj");
        fs::write(&foreign, "foreign").unwrap();
        for _ in 0..2 {
            bench.learning("").keep(&bench.learned(1.1), &here).unwrap();
            assert!(kept(&bench.learning(""), &here).is_some());
        }
        assert_eq!(fs::read_to_string(&foreign).unwrap(), "foreign");
        assert_eq!(bench.files(), ["mine.A7.learned-2.obj", "mine.A7.learned.obj", "mine.A7.learned.toml"]);
    }
}
