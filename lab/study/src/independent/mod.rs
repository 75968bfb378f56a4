//! A solution of another program: what patches of contact on a detector do to its electrodes and to each other.
//!
//! Its file is an NPZ of these arrays:
//! - `G`, Green's function (ohm), `unknowns x unknowns`: the electrodes first, then the current densities of each patch. Electrode 0 is joined
//!   to the driving layer by the sheet conductance, so that it is finite where nothing touches.
//! - `g`, the sheet conductance (S).
//! - `n`, how many electrodes there are.
//! - `sizes`, how many densities each patch has. They are normalised: in all of them a patch conducts as much as the whole disc does.
//! - `meta`, a text in JSON, of which `patches` is read: `x`, `y` and `r` (m) of each.

#[cfg(test)]
pub(crate) mod tests;

use std::ops::Range;
use std::path::{Path, PathBuf};

use nalgebra::DMatrix;
use serde::Deserialize;

use tactomo_physics::forward::ForwardError;
use tactomo_physics::geometry::Point;
use tactomo_physics::scene::{Contact, Touch};
use tactomo_table::{Archive, Array, TableError};

/// Most electrodes; a larger number is not one of them.
const MOST_ELECTRODES: usize = 1024;
/// The matrix is symmetric to this share of its largest element: two orders of magnitude beyond what a solution by finite elements leaves.
const SYMMETRIC: f64 = 1e-8;

/// Why a file is no such solution.
#[derive(Debug, thiserror::Error)]
pub enum IndependentError {
    /// It cannot be read, or an array is missing.
    #[error(transparent)]
    Table(#[from] TableError),
    /// An array is not what it has to be.
    #[error("{path}: array {array}: {what}")]
    Array {
        /// The file.
        path: PathBuf,
        /// The array.
        array: &'static str,
        /// What is wrong, and what is needed.
        what: String,
    },
}

/// Impedances between electrodes and patches of contact, by another program than ours: exact readings of every scene of its patches.
#[derive(Clone, Debug, PartialEq)]
pub struct Independent {
    /// Name of its file, without what it ends in.
    pub name: String,
    /// Sheet conductance of the detector that was solved (S).
    pub sheet_s: f64,
    /// How many electrodes it has.
    pub electrodes: usize,
    /// Where contacts can be: discs.
    pub patches: Vec<Patch>,
    /// `unknowns x unknowns` (ohm).
    green_ohm: DMatrix<f64>,
    /// Unknowns of each patch.
    unknowns: Vec<Range<usize>>,
}

/// A disc that can touch.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct Patch {
    /// Its centre (m).
    #[serde(rename = "x")]
    pub x_m: f64,
    /// Its centre (m).
    #[serde(rename = "y")]
    pub y_m: f64,
    /// Its radius (m).
    #[serde(rename = "r")]
    pub radius_m: f64,
}

/// What is read of the description.
#[derive(Deserialize)]
struct Meta {
    patches: Vec<Patch>,
}

impl Patch {
    /// The contact of a conductance (S) that is spread evenly over it.
    pub fn contact(&self, conductance_s: f64) -> Contact {
        Contact::flat(self.x_m, self.y_m, self.radius_m, conductance_s)
    }

    /// Distance of its centre from a place (m).
    pub fn distance_m(&self, [x_m, y_m]: Point) -> f64 {
        (self.x_m - x_m).hypot(self.y_m - y_m)
    }

    fn is_of(&self, contact: &Contact) -> bool {
        *self == Self { x_m: contact.x_m, y_m: contact.y_m, radius_m: contact.radius_m }
    }

    fn is_disc(&self) -> bool {
        self.x_m.is_finite() && self.y_m.is_finite() && is_positive(self.radius_m)
    }
}

impl Independent {
    /// Reads a file.
    ///
    /// # Errors
    /// [`IndependentError`], which names the file and the array.
    pub fn read(path: &Path) -> Result<Self, IndependentError> {
        Self::of(path, Archive::read(path)?)
    }

    /// What an archive holds; `path` is what messages call it.
    fn of(path: &Path, mut archive: Archive) -> Result<Self, IndependentError> {
        let wrong = |array| move |what| IndependentError::Array { path: path.to_owned(), array, what };
        let electrodes = count(archive.array("n")?).map_err(wrong("n"))?;
        let sheet_s = number(archive.array("g")?).map_err(wrong("g"))?;
        let unknowns = unknowns(electrodes, &archive.array("sizes")?).map_err(wrong("sizes"))?;
        let last = unknowns.last().map_or(electrodes, |last| last.end);
        let green_ohm = green_ohm(&archive.array("G")?, last).map_err(wrong("G"))?;
        let patches = patches(&archive.text("meta")?, unknowns.len()).map_err(wrong("meta"))?;
        let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        Ok(Self { name, sheet_s, electrodes, patches, green_ohm, unknowns })
    }

    /// The impedance matrix of the electrodes (ohm) under discs that touch, each of them one of the patches: potentials for 1 A, with the
    /// driving layer as reference.
    ///
    /// # Errors
    /// [`ForwardError`] if a touch is no patch or does not conduct, or nothing touches.
    pub fn impedance_ohm(&self, touches: &[Touch]) -> Result<DMatrix<f64>, ForwardError> {
        if touches.is_empty() {
            return Err(ForwardError::NoContact);
        }
        // The first unknown takes away the conductance that keeps the bare detector's matrix regular.
        let (mut index, mut changes_s) = (vec![0], vec![-self.sheet_s]);
        for (touch, contact) in touches.iter().map(Touch::disc).enumerate() {
            let wrong = |what: &str| ForwardError::Contact { index: touch, what: what.to_owned() };
            let contact = contact.ok_or_else(|| wrong("an independent solution has discs only"))?;
            let patch = self.patches.iter().position(|patch| patch.is_of(&contact));
            let patch = patch.ok_or_else(|| wrong("the independent solution has no such patch"))?;
            if !is_positive(contact.conductance_s) {
                return Err(wrong("it does not conduct"));
            }
            index.extend(self.unknowns[patch].clone());
            changes_s.resize(index.len(), contact.conductance_s);
        }
        self.changed_ohm(&index, &changes_s).ok_or(ForwardError::NoContact)
    }

    /// `Z = G_ee - G_ei (1 + D G_ii)^-1 D G_ie`: by a conductance to the driving layer at each of some unknowns `i`, `D` on its diagonal (S).
    fn changed_ohm(&self, index: &[usize], changes_s: &[f64]) -> Option<DMatrix<f64>> {
        let green_ohm = &self.green_ohm;
        let (size, electrodes) = (index.len(), self.electrodes);
        let changed = |row: usize, column: usize| changes_s[row] * green_ohm[(index[row], column)];
        let inner = DMatrix::from_fn(size, size, |i, j| changed(i, index[j]) + f64::from(u8::from(i == j)));
        let currents = inner.lu().solve(&DMatrix::from_fn(size, electrodes, changed))?;
        let fields_ohm = DMatrix::from_fn(electrodes, size, |e, i| green_ohm[(e, index[i])]);
        Some(green_ohm.view((0, 0), (electrodes, electrodes)) - fields_ohm * currents)
    }
}

fn is_positive(value: f64) -> bool {
    value > 0.0 && value.is_finite()
}

/// A lone number above zero.
fn number(array: Array) -> Result<f64, String> {
    match array.values[..] {
        [value] if is_positive(value) => Ok(value),
        [value] => Err(format!("it is {value}; a number above zero is needed")),
        _ => Err(format!("it is {}; a lone number is needed", array.shape_text())),
    }
}

/// A number of electrodes.
fn count(array: Array) -> Result<usize, String> {
    let value = number(array)?;
    whole(value, MOST_ELECTRODES).ok_or_else(|| format!("it is {value}; 1 to {MOST_ELECTRODES} electrodes are needed"))
}

/// A number from 1 on, if it is one.
fn whole(value: f64, most: usize) -> Option<usize> {
    (value.fract() == 0.0 && (1.0..=most as f64).contains(&value)).then_some(value as usize)
}

/// Unknowns of patches of such sizes, behind those of the electrodes.
fn unknowns(electrodes: usize, sizes: &Array) -> Result<Vec<Range<usize>>, String> {
    let mut first = electrodes;
    let mut next = |size: &f64| {
        // Each is one of some thousand: the matrix has as many columns, and is in memory.
        let size = whole(*size, u32::MAX as usize).ok_or_else(|| format!("{size} is no number of unknowns"))?;
        let range = first..first.checked_add(size).ok_or("more unknowns than there can be")?;
        first = range.end;
        Ok(range)
    };
    sizes.values.iter().map(&mut next).collect()
}

/// Green's function of so many unknowns.
fn green_ohm(array: &Array, unknowns: usize) -> Result<DMatrix<f64>, String> {
    if array.shape != [unknowns, unknowns] {
        let there = array.shape_text();
        return Err(format!("it is {there}, but electrodes and sizes of patches make {unknowns} x {unknowns}"));
    }
    if array.values.iter().any(|value| !value.is_finite()) {
        return Err("it has what is no number".to_owned());
    }
    let matrix = DMatrix::from_row_slice(unknowns, unknowns, &array.values);
    let largest = matrix.amax();
    match (&matrix - matrix.transpose()).amax() <= SYMMETRIC * largest {
        true => Ok(matrix),
        false => Err("it is not symmetric, as Green's function is".to_owned()),
    }
}

/// The patches that a description has, which have to be so many.
fn patches(meta: &str, count: usize) -> Result<Vec<Patch>, String> {
    let Meta { patches } = serde_json::from_str(meta).map_err(|error| error.to_string())?;
    if patches.len() != count {
        return Err(format!("it has {} patches, but sizes has {count}", patches.len()));
    }
    match patches.iter().position(|patch| !patch.is_disc()) {
        Some(index) => Err(format!("patch {index} is no disc: {:?}", patches[index])),
        None => Ok(patches),
    }
}
