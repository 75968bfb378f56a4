//! Detectors as built that another program has solved: a description, and readings of what was made of it.

use std::io;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::json_file;
use tactomo_physics::detector::{Detector, Electrode, Layer, Outline};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;

/// A description, and what was read where its detector was pressed.
#[derive(Clone, Debug)]
pub struct BuiltFile {
    /// The detector as it is described, with the tolerances of a preset.
    pub nominal: Detector,
    /// Contacts, and the exact readings of the detector as built (V).
    pub scenes: Vec<(Vec<Contact>, Readings)>,
}

/// Why a file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum BuiltFileError {
    /// It cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Not JSON, or a field is missing or of the wrong type; the message names it with line and column.
    #[error("{}: not a detector as built", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong and where.
        source: serde_json::Error,
    },
    /// Readings of another number of electrodes, or that are no numbers.
    #[error("{}: scene {scene}: readings_v has to be {electrodes} x {electrodes} finite numbers", path.display())]
    Readings {
        /// The file.
        path: PathBuf,
        /// The scene, from 0.
        scene: usize,
        /// The description's electrodes.
        electrodes: usize,
    },
}

#[derive(Deserialize)]
struct File {
    nominal: Nominal,
    scenes: Vec<Scene>,
}

#[derive(Deserialize)]
struct Nominal {
    name: String,
    size_m: [f64; 3],
    conductivity_s_per_m: f64,
    electrode_diameter_m: f64,
    electrodes_m: Vec<[f64; 2]>,
    electrode_contact_impedance_ohm_m2: f64,
    drive_v: f64,
    multiplexer_on_resistance_ohm: f64,
}

#[derive(Deserialize)]
struct Scene {
    contacts: Vec<Contact>,
    readings_v: Vec<Vec<f64>>,
}

impl BuiltFile {
    /// Reads it from a JSON file, which may be compressed by gzip.
    ///
    /// # Errors
    /// [`BuiltFileError`], which names the file and what is wrong.
    pub fn read(path: &Path) -> Result<Self, BuiltFileError> {
        let text = json_file::text(path).map_err(|source| BuiltFileError::Read { path: path.to_owned(), source })?;
        let file: File =
            serde_json::from_str(&text).map_err(|source| BuiltFileError::Parse { path: path.to_owned(), source })?;
        let electrodes = file.nominal.electrodes_m.len();
        let scene = |(scene, Scene { contacts, readings_v: rows }): (usize, Scene)| {
            let is_square = rows.len() == electrodes && rows.iter().all(|row| row.len() == electrodes);
            if !is_square || rows.iter().flatten().any(|volts| !volts.is_finite()) {
                return Err(BuiltFileError::Readings { path: path.to_owned(), scene, electrodes });
            }
            Ok((contacts, Readings::from_fn(electrodes, |g, e| rows[g][e])))
        };
        let scenes = file.scenes.into_iter().enumerate().map(scene).collect::<Result<_, _>>()?;
        Ok(Self { nominal: file.nominal.into_detector(), scenes })
    }
}

impl Nominal {
    fn into_detector(self) -> Detector {
        let [width_m, height_m, thickness_m] = self.size_m;
        let pad = |[x_m, y_m]: &[f64; 2]| Electrode::flat(*x_m, *y_m, 0.5 * self.electrode_diameter_m);
        Detector {
            outline: Outline::rectangle(width_m, height_m),
            layers: vec![Layer::uniform(thickness_m, self.conductivity_s_per_m)],
            electrodes: self.electrodes_m.iter().map(pad).collect(),
            contact_impedance_ohm_m2: self.electrode_contact_impedance_ohm_m2,
            drive_v: self.drive_v,
            on_resistance_ohm: self.multiplexer_on_resistance_ohm,
            name: self.name,
            ..Detector::default()
        }
    }
}
