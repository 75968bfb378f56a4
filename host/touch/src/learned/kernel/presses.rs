//! Presses at known places: what a kernel learns from.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::columns::Columns;
use tactomo_table::{Table, TableError};

/// Fewest presses that anything is learned from.
const FEWEST: usize = 10;
/// Rows whose places are this near (m) are of one press, or of presses at one place: robots repeat to 0.02 to 0.1 mm.
const SAME_M: f64 = 1e-4;
/// Farthest that a place is from the middle of all (m), hardest force of a press (N) and deepest depth (m) that are believed: sensors are smaller than a
/// person, and who presses with all the strength of a finger reaches about 50 N.
const FARTHEST_M: f64 = 1.5;
const HARDEST_N: f64 = 100.0;
const DEEPEST_M: f64 = 0.1;

/// Readings, places and strengths of presses, one contact each.
#[derive(Clone, Debug, PartialEq)]
pub struct Presses {
    /// Readings in each press.
    pub channels: usize,
    /// Their names, in their order; none if the file has no names for them.
    pub names: Vec<String>,
    /// `presses x channels` (V), less those at rest.
    pub readings_v: Vec<f64>,
    /// Middle of each contact (m).
    pub places_m: Vec<[f64; 3]>,
    /// How hard each was, in the unit of `strength`; above zero. None if that was not measured.
    pub strengths: Vec<f64>,
    /// What was measured of it, if anything was.
    pub strength: Option<Strength>,
    /// Which press each row is of, if that is told; rows at the same place are taken as of the same press too.
    pub of: Option<Vec<f64>>,
    /// Names of columns that are neither learned nor channels.
    pub others: Vec<String>,
    /// Drive voltage (V), if the channels are the readings of a detector, row by row; else nothing is taken for granted.
    pub drive_v: Option<f64>,
}

/// How the strength of presses is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strength {
    /// Force (N).
    Force,
    /// Depth (m) that the sensor is pressed in.
    Depth,
    /// Contact conductance (S).
    Conductance,
}

impl Strength {
    /// All of them, the first of which counts where a file has several.
    pub const ALL: [Self; 3] = [Self::Force, Self::Depth, Self::Conductance];

    /// Name of its column, with the unit.
    pub fn name(self) -> &'static str {
        match self {
            Self::Force => "force_n",
            Self::Depth => "depth_m",
            Self::Conductance => "conductance_s",
        }
    }
}

/// Why presses teach nothing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
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

/// Checks that forces of presses can be newtons; `name` is what they are called where they are given.
///
/// # Errors
/// What they may be, and what to do.
pub fn check_newtons(name: &str, forces_n: &[f64]) -> Result<(), String> {
    let largest_n = forces_n.iter().copied().map(f64::abs).fold(0.0, f64::max);
    if largest_n <= HARDEST_N {
        return Ok(());
    }
    Err(format!("{name} goes up to {largest_n} N: are these grams? 1 N is 102 g: divide them by 102"))
}

impl Presses {
    /// Reads a file. CSV: columns named `x_m`, `y_m`, perhaps `z_m`, and perhaps `force_n`, `depth_m` or `conductance_s`; which of the others are
    /// channels (V, less those at rest) is said in `docs/solvers.md`. NPZ: arrays of these names, of a number a press, and `readings_v`, of a
    /// row a press. With the names of a kernel's channels, these are read, in their order.
    ///
    /// # Errors
    /// [`PressesError`], which says what is missing or wrong, and where.
    pub fn read(path: &Path, names: &[String]) -> Result<Self, PressesError> {
        let table = Table::read(path)?;
        Self::of(table, names).map_err(|what| PressesError::Content { path: path.to_owned(), what })
    }

    fn of(table: Table, names: &[String]) -> Result<Self, String> {
        if matches!(&table, Table::Columns { names, .. } if names.is_empty()) {
            return Err("the first line must name the columns: x_m, y_m, perhaps force_n, and the channels".to_owned());
        }
        let Columns { mut known, names, readings, others, presses } = Columns::of(table, names)?;
        let mut take = |name: &str| {
            let index = known.iter().position(|(known, _)| known == name)?;
            Some(known.swap_remove(index).1)
        };
        let needed = || "columns or arrays x_m and y_m are needed: where each press is".to_owned();
        let (Some(x_m), Some(y_m)) = (take("x_m"), take("y_m")) else { return Err(needed()) };
        let z_m = take("z_m").unwrap_or_else(|| vec![0.0; x_m.len()]);
        let strength = Strength::ALL.into_iter().find_map(|strength| Some((strength, take(strength.name())?)));
        let lengths = [Some(&y_m), Some(&z_m), strength.as_ref().map(|(_, strengths)| strengths)];
        if lengths.into_iter().flatten().any(|column| column.len() != x_m.len()) {
            return Err("x_m, y_m, z_m and the strength have different lengths".to_owned());
        }
        if readings.rows() != x_m.len() {
            return Err(format!("{} places, but {} rows of readings", x_m.len(), readings.rows()));
        }
        let presses = Self {
            channels: readings.columns(),
            names,
            readings_v: readings.values,
            places_m: (0..x_m.len()).map(|i| [x_m[i], y_m[i], z_m[i]]).collect(),
            strength: strength.as_ref().map(|(strength, _)| *strength),
            strengths: strength.map_or_else(Vec::new, |(_, strengths)| strengths),
            of: presses,
            others,
            drive_v: None,
        };
        presses.check_each()?;
        presses.check_units()?;
        Ok(presses)
    }

    /// The press that each row is of, by numbers from 0: rows of one press tell of each other, so they are left out together.
    pub fn groups(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.count()).collect();
        order.sort_by(|a, b| self.places_m[*a][0].total_cmp(&self.places_m[*b][0]));
        let mut groups: Vec<usize> = (0..self.count()).collect();
        let square_m2 = |a: usize, b: usize| -> f64 {
            self.places_m[a].iter().zip(&self.places_m[b]).map(|(a, b)| (a - b).powi(2)).sum()
        };
        // The first row of a press stands for it, so that a slow slide is not one.
        let mut firsts: Vec<usize> = Vec::new();
        for row in order {
            let is_near_x = |first: &&usize| self.places_m[row][0] - self.places_m[**first][0] < SAME_M;
            let near =
                firsts.iter().rev().take_while(is_near_x).find(|first| square_m2(row, **first) < SAME_M * SAME_M);
            match near.copied() {
                Some(first) => groups[row] = first,
                None => firsts.push(row),
            }
        }
        if let Some(of) = &self.of {
            let mut told: HashMap<u64, usize> = HashMap::new();
            let mut joined: Vec<usize> = (0..groups.len()).collect();
            for (row, press) in of.iter().enumerate() {
                let other = *told.entry(press.to_bits()).or_insert(groups[row]);
                let [one, other] = [groups[row], other].map(|group| root(&joined, group));
                joined[one] = other;
            }
            groups.iter_mut().for_each(|group| *group = root(&joined, *group));
        }
        let mut numbers = HashMap::new();
        groups
            .iter()
            .map(|group| {
                let next = numbers.len();
                *numbers.entry(*group).or_insert(next)
            })
            .collect()
    }

    /// Checks that places and strengths are such as a press can have.
    fn check_units(&self) -> Result<(), String> {
        let largest = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).fold(0.0, f64::max);
        let count = self.count() as f64;
        for (axis, name) in ["x_m", "y_m", "z_m"].into_iter().enumerate() {
            let mean_m = self.places_m.iter().map(|place_m| place_m[axis]).sum::<f64>() / count;
            let farthest_m = largest(&mut self.places_m.iter().map(|place_m| place_m[axis] - mean_m));
            if farthest_m > FARTHEST_M {
                return Err(format!(
                    "{name} goes {farthest_m:.4} m from the middle of all presses: are these millimetres? Divide them by 1000"
                ));
            }
        }
        let largest = largest(&mut self.strengths.iter().copied());
        match self.strength {
            Some(Strength::Force) => check_newtons("force_n", &self.strengths),
            Some(Strength::Depth) if largest > DEEPEST_M => {
                Err(format!("depth_m goes up to {largest:.4} m: are these millimetres? Divide them by 1000"))
            }
            _ => Ok(()),
        }
    }

    /// Number of rows.
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
        let count = self.groups().iter().max().map_or(0, |last| last + 1);
        if count < FEWEST {
            return Err(format!("{count} presses, but {FEWEST} at least are needed; some hundreds are good"));
        }
        self.check_each()
    }

    /// Whether each of them can be read.
    fn check_each(&self) -> Result<(), String> {
        let count = self.count();
        if self.drive_v.is_some() && self.channels.isqrt().pow(2) != self.channels {
            return Err(format!("{} channels are not the readings of a detector", self.channels));
        }
        if self.channels == 0 || self.readings_v.len() != count * self.channels {
            return Err(format!("{count} places, but readings are not as many"));
        }
        if self.strengths.len() != self.strength.map_or(0, |_| count) {
            return Err(format!("{count} places, but {} strengths", self.strengths.len()));
        }
        for (press, readings) in self.readings().enumerate() {
            if let Some(channel) = readings.iter().position(|volts| !volts.is_finite()) {
                return Err(format!("press {press}: channel {channel} is not a finite number"));
            }
            if readings.iter().all(|volts| *volts == 0.0) {
                return Err(format!("press {press}: all readings are zero"));
            }
            let is_strong = self.strengths.get(press).is_none_or(|strength| strength.is_finite() && *strength > 0.0);
            if !(self.places_m[press].iter().all(|at| at.is_finite()) && is_strong) {
                return Err(format!("press {press}: a finite place and a strength above zero are needed"));
            }
        }
        Ok(())
    }
}

/// The group that stands for those that were joined with one.
fn root(joined: &[usize], mut group: usize) -> usize {
    while joined[group] != group {
        group = joined[group];
    }
    group
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_table::Array;

    fn text(rows: usize) -> String {
        let row = |i: usize| format!("{i}e-3,{},-0.001,0.5,{i}\n", i + 1);
        std::iter::once("x_m,ch0,y_m,force_n,ch1\n".to_owned()).chain((0..rows).map(row)).collect()
    }

    fn parsed(text: &str) -> Result<Presses, String> {
        Presses::of(Table::parse(text.as_bytes())?, &[])
    }

    #[test]
    fn columns_are_found_by_their_names() {
        let presses = parsed(&text(12)).unwrap();
        assert_eq!((presses.count(), presses.channels, presses.strength), (12, 2, Some(Strength::Force)));
        assert_eq!(presses.readings().nth(3), Some(&[4.0, 3.0][..]));
        assert_eq!(presses.places_m[3], [0.003, -0.001, 0.0]);
    }

    #[test]
    fn arrays_are_found_by_their_names() {
        let column = |name: &str, value: f64| (name.to_owned(), Array::flat(vec![value; 10]));
        let readings = ("readings_v".to_owned(), Array { shape: vec![10, 2, 2], values: vec![0.1; 40] });
        let arrays = vec![column("y_m", 1.0), column("conductance_s", 2e-4), readings, column("x_m", 0.5)];
        let presses = Presses::of(Table::Arrays(arrays.clone()), &[]).unwrap();
        assert_eq!((presses.channels, presses.strength), (4, Some(Strength::Conductance)));
        assert_eq!(presses.places_m[9], [0.5, 1.0, 0.0]);
        let without = Presses::of(Table::Arrays(arrays[1..].to_vec()), &[]).unwrap_err();
        assert!(without.contains("x_m and y_m"), "{without}");
    }

    #[test]
    fn what_teaches_nothing_is_told() {
        for (text, told) in [
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
