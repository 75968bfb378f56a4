//! A Jacobian in a file.
//!
//! `TACTOJAC`, the format's version as four bytes (little-endian), the [`Jacobian`] in postcard, and the CRC-32 (ISO-HDLC)
//! of all bytes before as four bytes (little-endian). The detector is in it, so that it is never used for another.

use std::io;
use std::path::{Path, PathBuf};

use crc::{CRC_32_ISO_HDLC, Crc};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use tactomo_table::file::Format;

use super::ImageMesh;
use super::jacobian::Jacobian;
use crate::detector::{Detector, Surface};

const MAGIC: &[u8; 8] = b"TACTOJAC";
const VERSION: u32 = 4;
/// Fields of 16384 nodes for 32 electrodes take 4 MiB.
const FORMAT: Format = Format::new("a Jacobian", 64 << 20);
const CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Why a Jacobian cannot be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JacobianFileError {
    /// The file cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Something else, or cut short, or changed.
    #[error("{}: not a whole Jacobian file ({what}); make it again with `tactomo forward --save-jacobian`", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: &'static str,
    },
    /// Of another version of this program.
    #[error(
        "{}: Jacobian file of format {found}, but this program reads format {VERSION}; make it again with `tactomo forward --save-jacobian`",
        path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Its format.
        found: u32,
    },
    /// Made for another detector.
    #[error("{}: made for another detector: {difference}; make it again with `tactomo forward --save-jacobian`", path.display())]
    OtherDetector {
        /// The file.
        path: PathBuf,
        /// What differs.
        difference: String,
    },
}

impl Jacobian {
    /// The content of its file.
    ///
    /// # Errors
    /// If memory ends.
    pub fn to_bytes(&self) -> io::Result<Vec<u8>> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        let mut bytes = postcard::to_extend(&Stored::from(self), bytes).map_err(io::Error::other)?;
        bytes.extend(CHECKSUM.checksum(&bytes).to_le_bytes());
        Ok(bytes)
    }

    /// Reads the file of a detector. Its name and its analogue-to-digital converter may differ: they change nothing here.
    ///
    /// # Errors
    /// [`JacobianFileError`] if it is no whole file of this format or was made for another detector.
    pub fn load(path: &Path, detector: &Detector) -> Result<Self, JacobianFileError> {
        let bytes = FORMAT.read(path).map_err(|source| JacobianFileError::Read { path: path.to_owned(), source })?;
        let jacobian = parse(&bytes, path)?;
        match difference(&jacobian.detector, detector) {
            Some(difference) => Err(JacobianFileError::OtherDetector { path: path.to_owned(), difference }),
            None => Ok(Self { detector: detector.clone(), ..jacobian }),
        }
    }
}

fn parse(bytes: &[u8], path: &Path) -> Result<Jacobian, JacobianFileError> {
    let damaged = |what| JacobianFileError::Damaged { path: path.to_owned(), what };
    let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| damaged("it does not begin with TACTOJAC"))?;
    let (version, rest) = rest.split_first_chunk::<4>().ok_or_else(|| damaged("it is cut short"))?;
    let found = u32::from_le_bytes(*version);
    if found != VERSION {
        return Err(JacobianFileError::Version { path: path.to_owned(), found });
    }
    let (body, checksum) = rest.split_last_chunk::<4>().ok_or_else(|| damaged("it is cut short"))?;
    if CHECKSUM.checksum(&bytes[..bytes.len() - 4]) != u32::from_le_bytes(*checksum) {
        return Err(damaged("its checksum is wrong"));
    }
    let stored: Stored = postcard::from_bytes(body).map_err(|_| damaged("its contents cannot be decoded"))?;
    stored.into_jacobian().ok_or_else(|| damaged("its parts do not fit together"))
}

/// What differs between two detectors that matters to a Jacobian.
fn difference(saved: &Detector, asked: &Detector) -> Option<String> {
    let differs = |what: &str, saved: &dyn std::fmt::Debug, asked: &dyn std::fmt::Debug| {
        Some(format!("{what} {saved:?} in the file, {asked:?} in the detector"))
    };
    if saved.outline != asked.outline {
        return match (saved.outline.as_rectangle(), asked.outline.as_rectangle()) {
            (Some(saved), Some(asked)) => differs("size (m)", &saved, &asked),
            _ => Some("the outline".to_owned()),
        };
    }
    if saved.surface.as_ref().map(Surface::shape) != asked.surface.as_ref().map(Surface::shape) {
        return Some("the surface".to_owned());
    }
    if saved.electrodes.len() != asked.electrodes.len() {
        return differs("electrodes:", &saved.electrodes.len(), &asked.electrodes.len());
    }
    if let Some(i) = (0..saved.electrodes.len()).find(|&i| saved.electrodes[i] != asked.electrodes[i]) {
        return differs(&format!("electrode {i}:"), &saved.electrodes[i], &asked.electrodes[i]);
    }
    if saved.layers != asked.layers {
        return differs("layers", &saved.layers, &asked.layers);
    }
    let numbers = |detector: &Detector| {
        [
            ("contact impedance (ohm m2)", detector.contact_impedance_ohm_m2),
            ("drive (V)", detector.drive_v),
            ("on-resistance (ohm)", detector.on_resistance_ohm),
        ]
    };
    let (saved, asked) = (numbers(saved), numbers(asked));
    (0..3).find(|&i| saved[i] != asked[i]).and_then(|i| differs(saved[i].0, &saved[i].1, &asked[i].1))
}

/// What is in the file.
#[derive(Serialize, Deserialize)]
struct Stored {
    model: String,
    detector: Detector,
    image_mesh: ImageMesh,
    fields_ohm: Vec<f64>,
    electrode_fields_ohm: Vec<f64>,
}

impl From<&Jacobian> for Stored {
    fn from(jacobian: &Jacobian) -> Self {
        Self {
            model: jacobian.model.clone(),
            detector: jacobian.detector.clone(),
            image_mesh: jacobian.image_mesh.clone(),
            fields_ohm: jacobian.fields_ohm.as_slice().to_vec(),
            electrode_fields_ohm: jacobian.electrode_fields_ohm.as_slice().to_vec(),
        }
    }
}

impl Stored {
    fn into_jacobian(self) -> Option<Jacobian> {
        let (nodes, electrodes) = (self.image_mesh.nodes_m.len(), self.detector.electrodes.len());
        let places = self.image_mesh.places_m.len();
        let fits = self.image_mesh.node_areas_m2.len() == nodes
            && (places == nodes || places == 0)
            && self.image_mesh.triangles.iter().flatten().all(|&node| (node as usize) < nodes)
            && self.fields_ohm.len() == nodes * electrodes
            && self.electrode_fields_ohm.len() == electrodes * electrodes;
        fits.then(|| Jacobian {
            model: self.model,
            detector: self.detector,
            image_mesh: self.image_mesh,
            fields_ohm: DMatrix::from_vec(nodes, electrodes, self.fields_ohm),
            electrode_fields_ohm: DMatrix::from_vec(electrodes, electrodes, self.electrode_fields_ohm),
        })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::forward::shell::Shell;

    fn preset(name: &str) -> Detector {
        Detector::preset(name).unwrap_or_else(|| panic!("no preset {name}"))
    }

    fn jacobian() -> Jacobian {
        match Shell::with_nodes(&preset("fingertip-10"), 600) {
            Ok(shell) => Jacobian::of(&shell),
            Err(error) => panic!("{error}"),
        }
    }

    #[test]
    fn comes_back_as_it_was_and_only_for_its_detector() -> Result<(), Box<dyn std::error::Error>> {
        let path = std::env::temp_dir().join(format!("tactomo-{}.jacobian", std::process::id()));
        let saved = jacobian();
        fs::write(&path, saved.to_bytes()?)?;
        assert_eq!(Jacobian::load(&path, &saved.detector)?, saved);
        let mut other = saved.detector.clone();
        other.electrodes[3].x_m += 1e-5;
        let refused = Jacobian::load(&path, &other).map_or_else(|error| error.to_string(), |_| String::new());
        fs::remove_file(&path)?;
        assert!(refused.contains(".jacobian: made for another detector: electrode 3:"), "{refused}");
        let missing = Jacobian::load(&path, &saved.detector).map_or_else(|error| error.to_string(), |_| String::new());
        assert!(missing.contains(".jacobian"), "{missing}");
        Ok(())
    }

    #[test]
    fn every_difference_is_named() {
        let saved = preset("square-60");
        type Change = fn(&mut Detector);
        let changes: [(&str, Change); 5] = [
            ("size (m)", |detector| detector.outline = crate::detector::Outline::rectangle(0.061, 0.06)),
            ("electrodes: 16", |detector| detector.electrodes.truncate(8)),
            ("layers", |detector| detector.layers[0].thickness_m = 0.004),
            ("drive (V) 2.0", |detector| detector.drive_v = 1.5),
            ("on-resistance", |detector| detector.on_resistance_ohm = 5.0),
        ];
        for (name, change) in changes {
            let mut asked = saved.clone();
            change(&mut asked);
            let found = difference(&saved, &asked).unwrap_or_default();
            assert!(found.contains(name), "{found}");
        }
        assert_eq!(difference(&saved, &Detector { name: "mine".to_owned(), ..saved.clone() }), None);
    }

    #[test]
    fn damage_is_found() -> Result<(), Box<dyn std::error::Error>> {
        let (whole, path) = (jacobian().to_bytes()?, Path::new("my.jacobian"));
        let message = |bytes: &[u8]| parse(bytes, path).map_or_else(|error| error.to_string(), |_| String::new());
        let changed = |at: usize| {
            whole.iter().enumerate().map(|(i, &byte)| if i == at { byte ^ 1 } else { byte }).collect::<Vec<_>>()
        };
        assert_eq!(message(&whole), "");
        assert!(message(&whole[..whole.len() - 1]).contains("checksum"));
        assert!(message(&whole[..9]).contains("cut short"));
        assert!(message(&changed(whole.len() / 2)).contains("checksum"));
        assert!(message(&changed(0)).contains("TACTOJAC"));
        assert!(message(&changed(9)).contains("format 260"));
        Ok(())
    }
}
