//! The forces that are known: typed, or of a file.

use std::path::Path;

use anyhow::{anyhow, ensure};
use tactomo::calibrate::force::{Direction, ForcePress};
use tactomo::hertz::FORCE_N;
use tactomo::solve::check_newtons;
use tactomo::table::{Array, Table};

/// So many columns are named in errors.
const NAMED: usize = 8;

/// Forces, and where they belong.
pub enum Known {
    /// One for each press, in their order.
    Presses(Vec<KnownForce>),
    /// Of a force sensor: times since the recording's first frame (s), rising, and forces (N).
    Sensor(Vec<[f64; 2]>),
}

/// Force of a press.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownForce {
    /// Force (N).
    pub force_n: f64,
    /// Which way it went, if that is told.
    pub direction: Option<Direction>,
}

impl KnownForce {
    /// A press of this force that conducts so much (S).
    pub fn press(self, conductance_s: f64, deviation_s: f64) -> ForcePress {
        ForcePress { force_n: self.force_n, conductance_s, deviation_s, direction: self.direction }
    }
}

impl Known {
    /// Forces that were typed, or those of a file.
    pub fn of(newtons: &[f64], file: Option<&Path>) -> anyhow::Result<Self> {
        let Some(path) = file else {
            check_newtons("--newtons", newtons).map_err(anyhow::Error::msg)?;
            let known = |force_n: &f64| KnownForce { force_n: *force_n, direction: None };
            return Ok(Self::Presses(newtons.iter().map(known).collect()));
        };
        Self::of_table(Table::read(path)?).map_err(|what| anyhow!("{}: {what}", path.display()))
    }

    fn of_table(table: Table) -> anyhow::Result<Self> {
        let columns = Columns::of(table);
        let forces_n = columns.named("force_n").or_else(|| match &columns.0[..] {
            [(name, lone)] if name.is_empty() => Some(lone),
            _ => None,
        });
        let forces_n = forces_n.ok_or_else(|| {
            anyhow!("a column named force_n is needed, and time_s for a force sensor; there are {}", columns.names())
        })?;
        if let Some(times_s) = columns.named("time_s") {
            return sensor(times_s, forces_n);
        }
        columns.check_length(forces_n.len())?;
        Ok(Self::Presses(columns.forces(forces_n)?))
    }
}

/// Presses from a table of what they conduct: columns `force_n`, `conductance_s`, and if they are known `conductance_deviation_s` and `unloading`.
pub fn measured(path: &Path) -> anyhow::Result<Vec<ForcePress>> {
    of_measured(Table::read(path)?).map_err(|what| anyhow!("{}: {what}", path.display()))
}

fn of_measured(table: Table) -> anyhow::Result<Vec<ForcePress>> {
    let columns = Columns::of(table);
    let (Some(forces_n), Some(conductances_s)) = (columns.named("force_n"), columns.named("conductance_s")) else {
        return Err(anyhow!(
            "columns named force_n and conductance_s are needed, but there are {}; of a recording, or a table of readings, give --newtons or --forces",
            columns.names()
        ));
    };
    let deviations_s = columns.named("conductance_deviation_s");
    let press = |(row, known): (usize, &KnownForce)| {
        known.press(conductances_s[row], deviations_s.map_or(0.0, |deviations_s| deviations_s[row]))
    };
    columns.check_length(forces_n.len())?;
    Ok(columns.forces(forces_n)?.iter().enumerate().map(press).collect())
}

/// Columns with their names; without a name of a table that has none.
struct Columns(Vec<(String, Vec<f64>)>);

impl Columns {
    fn named(&self, name: &str) -> Option<&[f64]> {
        self.0.iter().find(|(known, _)| known == name).map(|(_, values)| &values[..])
    }

    /// Checks that all columns have so many rows, which arrays of a file need not.
    fn check_length(&self, rows: usize) -> anyhow::Result<()> {
        match self.0.iter().find(|(_, values)| values.len() != rows) {
            Some((name, values)) => Err(anyhow!("{name} has {} rows, but force_n has {rows}", values.len())),
            None => Ok(()),
        }
    }

    /// Their names, the first of them if there are many.
    fn names(&self) -> String {
        let named: Vec<_> = self.0.iter().map(|(name, _)| name.as_str()).filter(|name| !name.is_empty()).collect();
        match named.len() {
            0 => format!("{} without names", self.0.len()),
            many if many > NAMED => format!("{} and {} others", named[..NAMED].join(", "), many - NAMED),
            _ => named.join(", "),
        }
    }

    /// The forces of a column, with their direction if there is a column for that.
    fn forces(&self, forces_n: &[f64]) -> anyhow::Result<Vec<KnownForce>> {
        let direction = |row: usize| self.named("unloading").map(|unloading| direction(unloading[row])).transpose();
        let known = |(row, force_n): (usize, &f64)| {
            ensure!(
                FORCE_N.contains(force_n),
                "row {}: the force is {force_n:?} N, but has to be from {:?} to {:?} N",
                row + 1,
                FORCE_N.start(),
                FORCE_N.end()
            );
            let direction = direction(row).map_err(|what| anyhow!("row {}: {what}", row + 1))?;
            Ok(KnownForce { force_n: *force_n, direction })
        };
        let known = forces_n.iter().enumerate().map(known).collect::<anyhow::Result<_>>()?;
        check_newtons("force_n", forces_n).map_err(anyhow::Error::msg)?;
        Ok(known)
    }

    fn of(table: Table) -> Self {
        let of_rows = |names: Vec<String>, rows: Array| {
            let count = rows.columns().max(1);
            let column = |index: usize| rows.values.iter().skip(index).step_by(count).copied().collect();
            (0..count).map(|index| (names.get(index).cloned().unwrap_or_default(), column(index))).collect()
        };
        Self(match table {
            Table::Columns { names, rows } => of_rows(names, rows),
            Table::Arrays(arrays) => arrays.into_iter().map(|(name, array)| (name, array.values)).collect(),
        })
    }
}

fn sensor(times_s: &[f64], forces_n: &[f64]) -> anyhow::Result<Known> {
    ensure!(times_s.iter().all(|time_s| time_s.is_finite()), "times have to be finite numbers, but some are not");
    // A sensor at rest tells nothing, or a little less.
    if let Some(row) = forces_n.iter().position(|force_n| !(0.0..=*FORCE_N.end()).contains(&force_n.abs())) {
        return Err(anyhow!(
            "row {}: the force is {:?} N, but presses have up to {:?} N",
            row + 1,
            forces_n[row],
            FORCE_N.end()
        ));
    }
    if let Some(row) = times_s.windows(2).position(|pair| pair[1] <= pair[0]) {
        return Err(anyhow!("row {}: time_s has to rise from row to row", row + 2));
    }
    check_newtons("force_n", forces_n).map_err(anyhow::Error::msg)?;
    Ok(Known::Sensor(times_s.iter().zip(forces_n).map(|(time_s, force_n)| [*time_s, *force_n]).collect()))
}

fn direction(unloading: f64) -> Result<Direction, String> {
    match unloading {
        0.0 => Ok(Direction::Loading),
        1.0 => Ok(Direction::Unloading),
        other => Err(format!("unloading is {other}, but has to be 1 where the force was falling, else 0")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Known, String> {
        Known::of_table(Table::parse(text.as_bytes())?).map_err(|error| error.to_string())
    }

    #[test]
    fn forces_of_presses_and_of_a_sensor_are_told_by_their_columns() {
        for (text, direction) in [
            ("force_n\n1\n2.5\n", None),
            ("1\n2.5\n", None),
            ("note,force_n,unloading\n7,1,0\n8,2.5,0\n", Some(Direction::Loading)),
        ] {
            let Ok(Known::Presses(presses)) = read(text) else { panic!("{text}") };
            assert_eq!(presses, [1.0, 2.5].map(|force_n| KnownForce { force_n, direction }), "{text}");
        }
        let Ok(Known::Sensor(forces)) = read("time_s,force_n\n0,-0.01\n0.5,2\n") else { panic!("no sensor") };
        assert_eq!(forces, [[0.0, -0.01], [0.5, 2.0]]);
    }

    #[test]
    fn presses_that_were_measured_are_read_by_their_columns() {
        let read = |text: &str| {
            Table::parse(text.as_bytes()).and_then(|table| of_measured(table).map_err(|error| error.to_string()))
        };
        let [light, firm] = read("force_n,conductance_s,unloading\n1,1e-5,0\n2,3e-5,1\n").unwrap()[..] else {
            panic!()
        };
        assert_eq!((light.force_n, light.conductance_s, light.deviation_s), (1.0, 1e-5, 0.0));
        assert_eq!((firm.conductance_s, firm.direction), (3e-5, Some(Direction::Unloading)));
        let known = read("conductance_deviation_s,force_n,conductance_s\n1e-6,1,1e-5\n").unwrap();
        assert_eq!((known[0].deviation_s, known[0].direction), (1e-6, None));
        let error = read("force_n,ohm\n1,2\n").unwrap_err();
        assert!(
            error.contains("force_n and conductance_s are needed, but there are force_n, ohm; of a recording"),
            "{error}"
        );
        let error = read(&format!("{}\n", vec!["1"; 256].join(","))).unwrap_err();
        assert!(error.contains("there are 256 without names"), "{error}");
    }

    #[test]
    fn what_is_wrong_with_forces_is_told() {
        for (text, told) in [
            ("time,force\n1,2\n", "a column named force_n is needed"),
            ("force_n\n1\n0\n", "row 2: the force is 0.0 N, but has to be from 1e-6 to 10000.0 N"),
            ("force_n\n1\n1e308\n", "row 2: the force is 1e308 N"),
            ("time_s,force_n\n0,1\n1,-1e308\n", "row 2: the force is -1e308 N, but presses have up to 10000.0 N"),
            ("force_n,unloading\n1,0\n2,2\n", "row 2: unloading is 2"),
            ("time_s,force_n\n1,1\n1,2\n", "row 2: time_s has to rise"),
            ("time_s,force_n\n1,nan\n2,2\n", "row 1: the force is NaN N"),
            ("time_s,force_n\nnan,1\n2,2\n", "have to be finite"),
            ("time_s,force_n\n1,50\n2,300\n", "force_n goes up to 300 N: are these grams?"),
            ("force_n\n50\n500\n", "force_n goes up to 500 N: are these grams?"),
        ] {
            assert!(read(text).is_err_and(|what| what.contains(told)), "{text}");
        }
    }
}
