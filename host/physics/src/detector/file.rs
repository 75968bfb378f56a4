//! Detectors as TOML files.

mod calibration;
mod electrodes;
mod layers;
mod skin;

use std::fmt::Write as _;
use std::io;
use std::path::Path;

use serde::Deserialize;
use tactomo_table::file::Format;
use toml::de::{DeTable, DeValue};

use self::calibration::CalibrationTable;
use self::electrodes::ElectrodeTable;
use self::layers::LayerTable;
use self::skin::SkinTable;
use super::check::{LENGTH_M, Problem, within};
use super::pad::CONTACT_IMPEDANCE_OHM_M2;
use super::preset::{DRIVE_V, ON_RESISTANCE_OHM};
use super::{Adc, Correction, Detector, ForceLaw, Outline, Surface, SurfaceError, Tolerances, Unevenness};
use crate::geometry::area;

/// A detector's file.
const FORMAT: Format = Format::new("a detector's file", 1 << 20);
/// An outline whose middle is nearer to the origin stays where it is (m).
pub(super) const CENTRED_M: f64 = 1e-9;

/// Why a file is no detector.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// It cannot be read.
    #[error("cannot read the detector {path}: {error}")]
    Read {
        /// The file.
        path: String,
        /// What the system says.
        error: io::Error,
    },
    /// It does not say what a detector is.
    #[error("{path}: {error}")]
    Wrong {
        /// The file.
        path: String,
        /// What is wrong.
        error: TomlError,
    },
}

/// Why a text is no detector.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TomlError {
    /// It is not TOML, or has a field that is missing, unknown or of another type.
    #[error("{}", .0.to_string().trim_end())]
    Toml(toml::de::Error),
    /// A field has a value that is not allowed.
    #[error("{}{problem}", line.map_or_else(String::new, |line| format!("line {line}: ")))]
    Field {
        /// Where it stands, from 1.
        line: Option<usize>,
        /// What is wrong.
        problem: Problem,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    name: Option<String>,
    contact_impedance_ohm_m2: Option<f64>,
    drive_v: Option<f64>,
    ground_v: Option<f64>,
    on_resistance_ohm: Option<f64>,
    surface: Option<String>,
    surface_unit: Option<String>,
    outline: Option<OutlineTable>,
    #[serde(default)]
    uneven_log_amplitudes: Vec<Vec<f64>>,
    layers: Vec<LayerTable>,
    electrodes: ElectrodeTable,
    #[serde(default)]
    adc: AdcTable,
    #[serde(default)]
    tolerances: Tolerances,
    calibration: Option<CalibrationTable>,
    force: Option<ForceLaw>,
    skin: Option<SkinTable>,
    correction: Option<Correction>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OutlineTable {
    size_m: Option<[f64; 2]>,
    corners_m: Option<Vec<[f64; 2]>>,
    #[serde(default)]
    holes_m: Vec<Vec<[f64; 2]>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct AdcTable {
    bits: Option<u8>,
    full_scale_v: Option<f64>,
    noise_lsb: Option<f64>,
}

impl Detector {
    /// Reads a TOML file; without a name in it, the detector is named as the file.
    ///
    /// # Errors
    /// [`FileError`] if it cannot be read, or says nothing that could be built.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let named = || path.display().to_string();
        let text = FORMAT.read_text(path).map_err(|error| FileError::Read { path: named(), error })?;
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::from_toml_in(folder, &text, &stem).map_err(|error| FileError::Wrong { path: named(), error })
    }

    /// Reads a detector from TOML, named `name` unless the text has a name. No file is opened: text that names one is from who knows where,
    /// a recording or a message. [`read`](Self::read) and [`from_toml_in`](Self::from_toml_in) open a surface's file, and
    /// [`from_toml_and_obj`](Self::from_toml_and_obj) is given it.
    ///
    /// # Errors
    /// [`TomlError`] with field, line and what is allowed.
    pub fn from_toml(text: &str, name: &str) -> Result<Self, TomlError> {
        Self::from_toml_with(text, name, &|file, _| {
            let expected = format!(
                "in the text itself, not in a file {}: only a detector's own file may name another one, so save the text as one",
                quoted(file)
            );
            Err(Problem::new("surface", expected))
        })
    }

    /// Reads a detector from TOML, with the text of an OBJ file ([`Surface::to_obj`]) in place of the file that the TOML names.
    ///
    /// # Errors
    /// [`TomlError`] with field, line and what is allowed.
    pub fn from_toml_and_obj(text: &str, obj: &str, name: &str) -> Result<Self, TomlError> {
        Self::from_toml_with(text, name, &|file, unit| {
            let surface = Surface::parse(obj.as_bytes(), "surface.obj", unit);
            let mut surface = surface.map_err(|error| surface_problem(file, error))?;
            file.clone_into(&mut surface.file);
            Ok(surface)
        })
    }

    /// Reads a detector from TOML, as from a file in `folder`: a surface's file is sought there.
    ///
    /// # Errors
    /// [`TomlError`] with field, line and what is allowed.
    pub fn from_toml_in(folder: &Path, text: &str, name: &str) -> Result<Self, TomlError> {
        Self::from_toml_with(text, name, &|file, unit| {
            let path = folder.join(file);
            Surface::read(&path, file, unit).map_err(|error| surface_problem(&path.display().to_string(), error))
        })
    }

    fn from_toml_with(text: &str, name: &str, surface: &ReadSurface) -> Result<Self, TomlError> {
        let document: Document = toml::from_str(text).map_err(TomlError::Toml)?;
        let checked = document.into_detector(surface, name).and_then(|detector| detector.check().map(|()| detector));
        checked.map_err(|problem| TomlError::Field { line: line_of(text, &problem.field), problem })
    }

    /// This detector as TOML, for [`from_toml`](Self::from_toml).
    pub fn to_toml(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.write_toml(&mut text);
        text
    }

    /// This detector as files of its own: the TOML, and of a curved one the OBJ file of its surface, with the name `STEM.obj` by which the TOML
    /// names it. The name that the surface had is not kept: it may be of another folder, or come from a recording.
    pub fn to_files(&self, stem: &str) -> (String, Option<(String, String)>) {
        let Some(surface) = &self.surface else { return (self.to_toml(), None) };
        let file = format!("{stem}.obj");
        let obj = surface.to_obj();
        let mut named = self.clone();
        named.surface.iter_mut().for_each(|surface| surface.file.clone_from(&file));
        (named.to_toml(), Some((file, obj)))
    }

    fn write_toml(&self, text: &mut String) -> std::fmt::Result {
        writeln!(text, "name = {}", quoted(&self.name))?;
        writeln!(text, "contact_impedance_ohm_m2 = {:?}", self.contact_impedance_ohm_m2)?;
        // In the file both are above the converter's zero, as a meter shows them.
        writeln!(text, "drive_v = {:?}", self.drive_v + self.ground_v)?;
        if self.ground_v != 0.0 {
            writeln!(text, "ground_v = {:?}", self.ground_v)?;
        }
        writeln!(text, "on_resistance_ohm = {:?}", self.on_resistance_ohm)?;
        if !self.unevenness.is_even() {
            writeln!(text, "uneven_log_amplitudes = {:?}", self.unevenness.log_amplitudes)?;
        }
        match &self.surface {
            Some(surface) => surface.write_toml(text)?,
            None => self.outline.write_toml(text)?,
        }
        self.layers.iter().try_for_each(|layer| layer.write_toml(text))?;
        self.write_electrodes(text)?;
        writeln!(text, "\n[adc]\nbits = {}", self.adc.bits)?;
        writeln!(text, "full_scale_v = {:?}", self.adc.full_scale_v)?;
        writeln!(text, "noise_lsb = {:?}", self.adc.noise_lsb)?;
        if self.tolerances != Tolerances::default() {
            self.tolerances.write_toml(text)?;
        }
        if let Some(law) = &self.force {
            law.write_toml(text)?;
        }
        if let Some(skin) = &self.skin {
            skin.write_toml(text)?;
        }
        if let Some(correction) = &self.correction {
            correction.write_toml(text)?;
        }
        match &self.calibration {
            Some(calibration) => calibration.write_toml(text),
            None => Ok(()),
        }
    }
}

impl Tolerances {
    fn write_toml(&self, text: &mut String) -> std::fmt::Result {
        writeln!(text, "\n[tolerances]")?;
        self.named().iter().try_for_each(|(name, value)| writeln!(text, "{name} = {value:?}"))
    }
}

impl Surface {
    fn write_toml(&self, text: &mut String) -> std::fmt::Result {
        writeln!(text, "surface = {}", quoted(&self.file))?;
        writeln!(text, "surface_unit = {}", quoted(&self.unit))
    }
}

impl Outline {
    fn write_toml(&self, text: &mut String) -> std::fmt::Result {
        writeln!(text, "\n[outline]")?;
        match self.as_rectangle() {
            Some(size_m) => writeln!(text, "size_m = {size_m:?}"),
            None => {
                writeln!(text, "corners_m = {:?}", self.outer)?;
                if self.holes.is_empty() { Ok(()) } else { writeln!(text, "holes_m = {:?}", self.holes) }
            }
        }
    }

    /// Moves it so that the middle of its bounding box is the origin; returns how far (m).
    fn centre(&mut self) -> [f64; 2] {
        let [low, high] = self.bounds();
        let mut shift_m = [0, 1].map(|axis| -(low[axis] + high[axis]) / 2.0);
        if shift_m.iter().all(|shift_m| shift_m.abs() < CENTRED_M) {
            shift_m = [0.0; 2];
        }
        let corners = self.outer.iter_mut().chain(self.holes.iter_mut().flatten());
        corners.for_each(|corner| (0..2).for_each(|axis| corner[axis] += shift_m[axis]));
        shift_m
    }

    /// Turns the outer edge counter-clockwise and holes clockwise, and a rectangle into one that is recognised as such.
    fn tidy(mut self) -> Self {
        if area(&self.outer) < 0.0 {
            self.outer.reverse();
        }
        self.holes.iter_mut().filter(|hole| area(hole) > 0.0).for_each(|hole| hole.reverse());
        let [width_m, height_m] = self.size_m();
        let rectangle = Self::rectangle(width_m, height_m);
        let is_rectangle = self.holes.is_empty()
            && self.outer.len() == 4
            && rectangle.outer.iter().all(|corner| self.outer.contains(corner));
        if is_rectangle { rectangle } else { self }
    }
}

impl Document {
    fn into_detector(self, read_surface: &ReadSurface, name: &str) -> Result<Detector, Problem> {
        let (outline, surface, shift_m) = match (self.outline, self.surface) {
            (Some(outline), None) if self.surface_unit.is_none() => {
                let (outline, shift_m) = outline.into_outline()?;
                (outline, None, shift_m)
            }
            (None, Some(file)) => {
                let surface = read_surface(&file, self.surface_unit.as_deref().unwrap_or("mm"))?;
                let moved_m = surface.moved_m;
                (surface.outline(), Some(surface), moved_m)
            }
            _ => {
                return Err(Problem::new(
                    "outline",
                    "or surface has to be there, and only one of them; surface_unit goes with surface",
                ));
            }
        };
        let layer = |(index, layer): (usize, LayerTable)| layer.into_layer(&format!("layers[{index}]"));
        let layers: Vec<_> = self.layers.into_iter().enumerate().map(layer).collect::<Result<_, _>>()?;
        Ok(Detector {
            skin: self.skin.map(SkinTable::into_skin).transpose()?.or_else(|| skin::of_foams(&layers)),
            name: self.name.unwrap_or_else(|| name.to_owned()),
            layers: layers.into_iter().map(|(layer, _)| layer).collect(),
            electrodes: self.electrodes.into_list(&outline, surface.as_ref(), shift_m)?,
            outline,
            surface,
            unevenness: Unevenness { log_amplitudes: self.uneven_log_amplitudes },
            contact_impedance_ohm_m2: self.contact_impedance_ohm_m2.unwrap_or(CONTACT_IMPEDANCE_OHM_M2),
            drive_v: self.drive_v.unwrap_or(DRIVE_V) - self.ground_v.unwrap_or_default(),
            ground_v: self.ground_v.unwrap_or_default(),
            on_resistance_ohm: self.on_resistance_ohm.unwrap_or(ON_RESISTANCE_OHM),
            adc: self.adc.into_adc(),
            tolerances: self.tolerances.settled(),
            converters: Vec::new(),
            calibration: self.calibration.map(CalibrationTable::into_calibration).transpose()?,
            force: self.force,
            correction: self.correction,
        })
    }
}

impl OutlineTable {
    /// The outline about the origin, and how far it was moved to get there (m).
    fn into_outline(self) -> Result<(Outline, [f64; 2]), Problem> {
        match (self.size_m, self.corners_m) {
            (Some([width_m, height_m]), None) if self.holes_m.is_empty() => {
                within("outline.size_m[0]", width_m, LENGTH_M)?;
                within("outline.size_m[1]", height_m, LENGTH_M)?;
                Ok((Outline::rectangle(width_m, height_m), [0.0; 2]))
            }
            (None, Some(outer)) => {
                let mut outline = Outline { outer, holes: self.holes_m };
                let shift_m = outline.centre();
                Ok((outline.tidy(), shift_m))
            }
            _ => Err(Problem::new("outline", "has to have either size_m, or corners_m with holes_m if there are any")),
        }
    }
}

impl AdcTable {
    fn into_adc(self) -> Adc {
        let usual = Adc::default();
        Adc {
            bits: self.bits.unwrap_or(usual.bits),
            full_scale_v: self.full_scale_v.unwrap_or(usual.full_scale_v),
            noise_lsb: self.noise_lsb.unwrap_or(usual.noise_lsb),
        }
    }
}

/// Gives the surface of a file's name and unit.
type ReadSurface<'a> = dyn Fn(&str, &str) -> Result<Surface, Problem> + 'a;

fn surface_problem(path: &str, error: SurfaceError) -> Problem {
    let field = if matches!(error, SurfaceError::Unit(_)) { "surface_unit" } else { "surface" };
    Problem::new(field, format!("{path}: {error}"))
}

/// A basic string of TOML.
fn quoted(text: &str) -> String {
    let mut quoted = String::from('"');
    for character in text.chars() {
        match character {
            '"' | '\\' => quoted.extend(['\\', character]),
            _ if character.is_control() => quoted.push_str(&format!("\\u{:04X}", u32::from(character))),
            _ => quoted.push(character),
        }
    }
    quoted.push('"');
    quoted
}

/// The line, from 1, of a field such as `layers[0].thickness_m`, or of what holds it.
fn line_of(text: &str, field: &str) -> Option<usize> {
    let mut value = DeValue::Table(DeTable::parse(text).ok()?.into_inner());
    let mut start = None;
    for step in field.split(['.', '[']).map(|step| step.trim_end_matches(']')) {
        let next = match value {
            DeValue::Table(table) => table
                .into_iter()
                .find(|(key, _)| key.get_ref() == step)
                .map(|(key, value)| (key.span().start, value.into_inner())),
            DeValue::Array(array) => {
                let index = step.parse().unwrap_or(usize::MAX);
                array.into_iter().nth(index).map(|value| (value.span().start, value.into_inner()))
            }
            _ => None,
        };
        let Some((at, inner)) = next else { break };
        (start, value) = (Some(at), inner);
    }
    start.map(|start| 1 + text.bytes().take(start).filter(|byte| *byte == b'\n').count())
}

#[cfg(test)]
mod as_built_tests;
#[cfg(test)]
mod tests;
