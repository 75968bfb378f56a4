//! Presses at known places: what a kernel learns from.

use std::path::{Path, PathBuf};

use crate::solve::Problem;
use tactomo_physics::forward::readings_v;
use tactomo_physics::geometry::is_inside;
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::Noise;
use tactomo_table::{Array, Table, TableError};

/// Fewest presses that anything is learned from.
const FEWEST: usize = 10;
/// Conductance of the lightest and of the firmest simulated press, in sheet conductances.
const FIRMNESS: [f64; 2] = [0.015, 10.0];
/// Radius of the narrowest and of the widest simulated press, in mean distances of electrodes.
const RADII: [f64; 2] = [0.1, 0.25];
/// Steps of the additive sequence of Roberts in four dimensions, which fills a cube evenly: powers of 1 over the root of
/// `g^5 = g + 1`.
const EVEN_STEPS: [f64; 4] =
    [0.856_674_883_854_502_9, 0.733_891_856_627_126, 0.628_706_721_037_808_6, 0.538_597_257_274_294];

/// Readings, places and strengths of presses, one contact each.
#[derive(Clone, Debug, PartialEq)]
pub struct Presses {
    /// Readings in each press.
    pub channels: usize,
    /// `presses x channels` (V), less those at rest.
    pub readings_v: Vec<f64>,
    /// Middle of each contact (m).
    pub places_m: Vec<[f64; 3]>,
    /// How hard each was, in the unit of `strength`; above zero.
    pub strengths: Vec<f64>,
    /// What was measured of it.
    pub strength: Strength,
    /// Drive voltage (V), if the channels are the readings of a detector, row by row; else nothing is taken for granted.
    pub drive_v: Option<f64>,
}

/// How the strength of presses is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strength {
    /// Force (N).
    Force,
    /// Contact conductance (S).
    Conductance,
}

/// Why presses teach nothing.
#[derive(Debug, thiserror::Error)]
pub enum PressesError {
    /// The file cannot be read.
    #[error(transparent)]
    Table(#[from] TableError),
    /// It holds something else.
    #[error("{path}: {what}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong and what is needed.
        what: String,
    },
}

impl Presses {
    /// Reads a file. CSV: columns named `x_m`, `y_m`, perhaps `z_m`, and `force_n` or `conductance_s`; all others are channels, in
    /// their order (V, less those at rest). NPZ: arrays of these names, of a number a press, and `readings_v`, of a row a press.
    ///
    /// # Errors
    /// [`PressesError`], which says what is missing or wrong, and where.
    pub fn read(path: &Path) -> Result<Self, PressesError> {
        let table = Table::read(path)?;
        Self::of(table).map_err(|what| PressesError::Content { path: path.to_owned(), what })
    }

    fn of(table: Table) -> Result<Self, String> {
        let (mut known, channels, readings_v) = match table {
            Table::Columns { names, rows } => columns(&names, &rows)?,
            Table::Arrays(arrays) => self::arrays(arrays)?,
        };
        let mut take = |name: &str| {
            let index = known.iter().position(|(known, _)| known == name)?;
            Some(known.swap_remove(index).1)
        };
        let needed = || "columns or arrays x_m and y_m, and force_n or conductance_s, are needed".to_owned();
        let (Some(x_m), Some(y_m)) = (take("x_m"), take("y_m")) else { return Err(needed()) };
        let z_m = take("z_m").unwrap_or_else(|| vec![0.0; x_m.len()]);
        let force = take("force_n").map(|strengths| (Strength::Force, strengths));
        let measured = force.or_else(|| Some((Strength::Conductance, take("conductance_s")?)));
        let (strength, strengths) = measured.ok_or_else(needed)?;
        if [&y_m, &z_m, &strengths].iter().any(|column| column.len() != x_m.len()) {
            return Err("x_m, y_m, z_m and the strength have different lengths".to_owned());
        }
        let places_m = (0..x_m.len()).map(|i| [x_m[i], y_m[i], z_m[i]]).collect();
        let presses = Self { channels, readings_v, places_m, strengths, strength, drive_v: None };
        presses.check()?;
        Ok(presses)
    }

    /// Number of presses.
    pub fn count(&self) -> usize {
        self.places_m.len()
    }

    /// Readings of a press (V).
    pub fn readings(&self) -> impl Iterator<Item = &[f64]> {
        self.readings_v.chunks_exact(self.channels.max(1))
    }

    /// Whether something can be learned from them.
    ///
    /// # Errors
    /// What is wrong, with the number of the press, from 0.
    pub fn check(&self) -> Result<(), String> {
        let count = self.count();
        if count < FEWEST {
            return Err(format!("{count} presses, but {FEWEST} at least are needed; some hundreds are good"));
        }
        if self.drive_v.is_some() && self.channels.isqrt().pow(2) != self.channels {
            return Err(format!("{} channels are not the readings of a detector", self.channels));
        }
        if self.channels == 0 || self.readings_v.len() != count * self.channels || self.strengths.len() != count {
            return Err(format!("{count} places, but readings or strengths are not as many"));
        }
        for (press, readings) in self.readings().enumerate() {
            if let Some(channel) = readings.iter().position(|volts| !volts.is_finite()) {
                return Err(format!("press {press}: channel {channel} is not a finite number"));
            }
            if readings.iter().all(|volts| *volts == 0.0) {
                return Err(format!("press {press}: all readings are zero"));
            }
            let (place_m, strength) = (self.places_m[press], self.strengths[press]);
            if !(place_m.iter().all(|at| at.is_finite()) && strength.is_finite() && strength > 0.0) {
                return Err(format!("press {press}: a finite place and a strength above zero are needed"));
            }
        }
        Ok(())
    }

    /// Presses on the model of a problem, light and firm, narrow and wide, spread evenly, with the converter's noise. Always the same.
    pub fn simulated(problem: &Problem, count: usize) -> Self {
        let detector = problem.detector();
        let mut noise = Noise::new(1);
        let mut presses = Self {
            channels: detector.electrodes.len().pow(2),
            readings_v: Vec::new(),
            places_m: Vec::new(),
            strengths: Vec::new(),
            strength: Strength::Conductance,
            drive_v: Some(detector.drive_v),
        };
        // Most outlines fill more than a quarter of their bounding boxes.
        for contact in (0..4 * count).filter_map(|index| simulated_contact(problem, index)) {
            let Ok(impedance_ohm) = problem.model.impedance_ohm(&[contact]) else { continue };
            if presses.count() == count {
                break;
            }
            let readings = readings_v(&impedance_ohm, detector);
            let noisy = readings.volts().iter().map(|volts| volts + detector.adc.deviation_v() * noise.normal());
            presses.readings_v.extend(noisy);
            presses.places_m.push([contact.x_m, contact.y_m, contact.z_m]);
            presses.strengths.push(contact.conductance_s);
        }
        presses
    }
}

/// A contact of the even sequence, if its place is on the detector.
fn simulated_contact(problem: &Problem, index: usize) -> Option<Contact> {
    let detector = problem.detector();
    let [x, y, firmness, radius] = EVEN_STEPS.map(|step| (0.5 + step * (index + 1) as f64).fract());
    let [low, high] = detector.outline.bounds();
    let map_m = [low[0] + x * (high[0] - low[0]), low[1] + y * (high[1] - low[1])];
    let in_a_hole = detector.outline.holes.iter().any(|hole| is_inside(map_m, hole));
    if in_a_hole || !is_inside(map_m, &detector.outline.outer) {
        return None;
    }
    let [x_m, y_m, z_m] = detector.place_m(map_m)?;
    let radius_m = (RADII[0] + radius * (RADII[1] - RADII[0])) * problem.spacing_m();
    let conductance_s = detector.sheet_conductance_s() * FIRMNESS[0] * (FIRMNESS[1] / FIRMNESS[0]).powf(firmness);
    Some(Contact { z_m, ..Contact::flat(x_m, y_m, radius_m, conductance_s) })
}

/// Columns by their names, the number of channels, and the readings.
type Parts = (Vec<(String, Vec<f64>)>, usize, Vec<f64>);

/// Names of columns that are no channels.
const KNOWN: [&str; 5] = ["x_m", "y_m", "z_m", "force_n", "conductance_s"];

fn columns(names: &[String], rows: &Array) -> Result<Parts, String> {
    if names.is_empty() {
        return Err(
            "the first line must name the columns: x_m, y_m, force_n or conductance_s, and the channels".to_owned()
        );
    }
    let is_known = |index: &usize| KNOWN.contains(&names[*index].as_str());
    let (known, channels): (Vec<usize>, Vec<usize>) = (0..names.len()).partition(is_known);
    let column = |&index: &usize| rows.values.chunks_exact(names.len()).map(move |row| row[index]).collect();
    let readings_v = rows.values.chunks_exact(names.len()).flat_map(|row| channels.iter().map(|&index| row[index]));
    let named = known.iter().map(|index| (names[*index].clone(), column(index))).collect();
    Ok((named, channels.len(), readings_v.collect()))
}

fn arrays(arrays: Vec<(String, Array)>) -> Result<Parts, String> {
    let (mut known, mut readings) = (Vec::new(), None);
    for (name, array) in arrays {
        match name.as_str() {
            "readings_v" => readings = Some(array),
            known_name if KNOWN.contains(&known_name) => known.push((name, array.values)),
            _ => {}
        }
    }
    let readings = readings.ok_or("an array readings_v, a row a press, is needed")?;
    Ok((known, readings.columns(), readings.values))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(rows: usize) -> String {
        let row = |i: usize| format!("{i}e-3,{},-0.001,0.5,{i}\n", i + 1);
        std::iter::once("x_m,ch0,y_m,force_n,ch1\n".to_owned()).chain((0..rows).map(row)).collect()
    }

    fn parsed(text: &str) -> Result<Presses, String> {
        Presses::of(Table::parse(text.as_bytes())?)
    }

    #[test]
    fn columns_are_found_by_their_names() {
        let presses = parsed(&text(12)).unwrap();
        assert_eq!((presses.count(), presses.channels, presses.strength), (12, 2, Strength::Force));
        assert_eq!(presses.readings().nth(3), Some(&[4.0, 3.0][..]));
        assert_eq!(presses.places_m[3], [0.003, -0.001, 0.0]);
    }

    #[test]
    fn arrays_are_found_by_their_names() {
        let column = |name: &str, value: f64| (name.to_owned(), Array::flat(vec![value; 10]));
        let readings = ("readings_v".to_owned(), Array { shape: vec![10, 2, 2], values: vec![0.1; 40] });
        let arrays = vec![column("y_m", 1.0), column("conductance_s", 2e-4), readings, column("x_m", 0.5)];
        let presses = Presses::of(Table::Arrays(arrays.clone())).unwrap();
        assert_eq!((presses.channels, presses.strength), (4, Strength::Conductance));
        assert_eq!(presses.places_m[9], [0.5, 1.0, 0.0]);
        let without = Presses::of(Table::Arrays(arrays[1..].to_vec())).unwrap_err();
        assert!(without.contains("x_m and y_m"), "{without}");
    }

    #[test]
    fn what_teaches_nothing_is_told() {
        for (text, told) in [
            (text(9), "9 presses, but 10 at least"),
            ("1,2,3\n4,5,6".to_owned(), "first line must name the columns"),
            (text(12).replace("x_m", "x_mm"), "x_m and y_m"),
            (text(12).replace(",0.5,", ",0,"), "press 0: a finite place and a strength above zero"),
            (text(12).replace("3e-3,4", "3e-3,nan"), "press 3: channel 0 is not a finite number"),
            (text(12).replace("0e-3,1,", "0e-3,0,"), "press 0: all readings are zero"),
        ] {
            let found = parsed(&text).unwrap_err();
            assert!(found.contains(told), "{found}");
        }
    }
}
