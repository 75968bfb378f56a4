//! The forces that are known: typed, or of a file.

use std::path::Path;

use anyhow::{anyhow, ensure};
use tactomo::calibrate::force::Direction;
use tactomo::table::{Array, Table};

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

impl Known {
    /// Forces that were typed, or those of a file.
    pub fn of(newtons: &[f64], file: Option<&Path>) -> anyhow::Result<Self> {
        let Some(path) = file else {
            let known = |force_n: &f64| KnownForce { force_n: *force_n, direction: None };
            return Ok(Self::Presses(newtons.iter().map(known).collect()));
        };
        Self::of_table(Table::read(path)?).map_err(|what| anyhow!("{}: {what}", path.display()))
    }

    fn of_table(table: Table) -> anyhow::Result<Self> {
        let columns = columns(table);
        let column = |name: &str| columns.iter().find(|(known, _)| known == name).map(|(_, values)| &values[..]);
        let names = || columns.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
        let forces_n = column("force_n").or_else(|| match &columns[..] {
            [(name, lone)] if name.is_empty() => Some(lone),
            _ => None,
        });
        let forces_n = forces_n.ok_or_else(|| {
            anyhow!("a column named force_n is needed, and time_s for a force sensor; there are {}", names())
        })?;
        if let Some(times_s) = column("time_s") {
            return sensor(times_s, forces_n);
        }
        let direction = |row: usize| column("unloading").map(|unloading| direction(unloading[row])).transpose();
        let known = |(row, force_n): (usize, &f64)| {
            ensure!(
                *force_n > 0.0 && force_n.is_finite(),
                "row {}: the force is {force_n} N, but has to be above zero",
                row + 1
            );
            let direction = direction(row).map_err(|what| anyhow!("row {}: {what}", row + 1))?;
            Ok(KnownForce { force_n: *force_n, direction })
        };
        forces_n.iter().enumerate().map(known).collect::<Result<_, _>>().map(Self::Presses)
    }
}

fn sensor(times_s: &[f64], forces_n: &[f64]) -> anyhow::Result<Known> {
    ensure!(
        times_s.iter().chain(forces_n).all(|value| value.is_finite()),
        "times and forces have to be finite numbers, but some are not"
    );
    if let Some(row) = times_s.windows(2).position(|pair| pair[1] <= pair[0]) {
        return Err(anyhow!("row {}: time_s has to rise from row to row", row + 2));
    }
    Ok(Known::Sensor(times_s.iter().zip(forces_n).map(|(time_s, force_n)| [*time_s, *force_n]).collect()))
}

fn direction(unloading: f64) -> Result<Direction, String> {
    match unloading {
        0.0 => Ok(Direction::Loading),
        1.0 => Ok(Direction::Unloading),
        other => Err(format!("unloading is {other}, but has to be 1 where the force was falling, else 0")),
    }
}

/// Columns with their names; without a name of a table that has none.
fn columns(table: Table) -> Vec<(String, Vec<f64>)> {
    let of_rows = |names: Vec<String>, rows: Array| {
        let count = rows.columns().max(1);
        let column = |index: usize| rows.values.iter().skip(index).step_by(count).copied().collect();
        (0..count).map(|index| (names.get(index).cloned().unwrap_or_default(), column(index))).collect()
    };
    match table {
        Table::Columns { names, rows } => of_rows(names, rows),
        Table::Arrays(arrays) => arrays.into_iter().map(|(name, array)| (name, array.values)).collect(),
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
    fn what_is_wrong_with_forces_is_told() {
        for (text, told) in [
            ("time,force\n1,2\n", "a column named force_n is needed"),
            ("force_n\n1\n0\n", "row 2: the force is 0 N"),
            ("force_n,unloading\n1,0\n2,2\n", "row 2: unloading is 2"),
            ("time_s,force_n\n1,1\n1,2\n", "row 2: time_s has to rise"),
            ("time_s,force_n\n1,nan\n2,2\n", "have to be finite"),
        ] {
            assert!(read(text).is_err_and(|what| what.contains(told)), "{text}");
        }
    }
}
