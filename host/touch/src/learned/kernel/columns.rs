//! Columns of a file of presses, or of readings alone: which are places and strengths, which are channels.
//!
//! In a file with names, a column is no channel if it
//! - is one of `x_m`, `y_m`, `z_m`, `force_n`, `depth_m`, `conductance_s`, which a kernel learns;
//! - counts or tells the time: its name is empty, or is, or ends after a `_` in, `id`, `index`, `number`, `row`, `frame`, `sequence`, `press`,
//!   `trial`, `time`, `timestamp` or `date`, in any case, also with a unit of time after it (`time_s`, `press_id`); or begins with `Unnamed`, as
//!   pandas calls an index;
//! - ends in a unit that no reading has: `_m`, `_mm`, `_um`, `_n`, `_mn`, `_g`, `_kg`, `_pa`, `_kpa`, `_deg`, `_rad`, `_s`, `_ms`, `_us`, `_ns`.
//!
//! All others are channels, in their order. Where the channels are known by their names, they are found by these, and no other column is looked at.

use tactomo_table::{Array, Table};

/// Columns that are learned.
const LEARNED: [&str; 6] = ["x_m", "y_m", "z_m", "force_n", "depth_m", "conductance_s"];
/// Words of names that count or tell the time.
const COUNTS: [&str; 12] =
    ["", "id", "index", "number", "row", "frame", "sequence", "press", "trial", "time", "timestamp", "date"];
/// Units of time.
const TIMES: [&str; 4] = ["s", "ms", "us", "ns"];
/// Further units that no reading has.
const UNITS: [&str; 11] = ["m", "mm", "um", "n", "mn", "g", "kg", "pa", "kpa", "deg", "rad"];
/// Names that an array of readings may have in an NPZ file.
const READINGS: [&str; 3] = ["readings_v", "readings", "volts"];
/// Names that a message lists.
const LISTED: usize = 5;

/// What is in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns {
    /// Columns that are learned, by their names.
    pub known: Vec<(String, Vec<f64>)>,
    /// Names of the channels, if they have some.
    pub names: Vec<String>,
    /// Readings: `rows x channels`.
    pub readings: Array,
}

impl Columns {
    /// Those of a table, with channels of these names if there are any.
    ///
    /// # Errors
    /// What is missing.
    pub fn of(table: Table, names: &[String]) -> Result<Self, String> {
        match table {
            Table::Columns { names: heads, rows } => named(&heads, rows, names),
            Table::Arrays(arrays) => self::arrays(arrays),
        }
    }
}

/// Whether a column of such a name is a channel.
fn is_channel(name: &str) -> bool {
    let lower = name.trim().to_ascii_lowercase();
    if LEARNED.contains(&lower.as_str()) || lower.starts_with("unnamed") {
        return false;
    }
    let words: Vec<&str> = lower.split(['_', ' ', '-']).collect();
    let last = words.last().copied().unwrap_or_default();
    if words.len() > 1 && (TIMES.contains(&last) || UNITS.contains(&last)) {
        return false;
    }
    let word = last.split(['[', '(']).next().unwrap_or_default();
    !COUNTS.contains(&word)
}

fn named(heads: &[String], rows: Array, wanted: &[String]) -> Result<Columns, String> {
    if heads.is_empty() {
        return Ok(Columns { known: Vec::new(), names: Vec::new(), readings: rows });
    }
    if let Some(index) = (1..heads.len()).find(|&index| heads[..index].contains(&heads[index])) {
        return Err(format!("two columns are called {}", heads[index].escape_debug()));
    }
    let channels = match wanted {
        [] => (0..heads.len()).filter(|&index| is_channel(&heads[index])).collect(),
        _ => by_name(heads, wanted)?,
    };
    let column = |index: usize| rows.values.chunks_exact(heads.len()).map(move |row| row[index]).collect();
    let known = heads.iter().enumerate().filter(|(_, head)| LEARNED.contains(&head.as_str()));
    let known = known.map(|(index, head)| (head.clone(), column(index))).collect();
    let values = rows.values.chunks_exact(heads.len()).flat_map(|row| channels.iter().map(|&index| row[index]));
    let readings = Array { shape: vec![rows.rows(), channels.len()], values: values.collect() };
    Ok(Columns { known, names: channels.iter().map(|&index| heads[index].clone()).collect(), readings })
}

/// Where the channels of these names are.
fn by_name(heads: &[String], wanted: &[String]) -> Result<Vec<usize>, String> {
    let found = |name: &String| heads.iter().position(|head| head == name);
    let missing: Vec<&String> = wanted.iter().filter(|name| found(name).is_none()).collect();
    if missing.is_empty() {
        return Ok(wanted.iter().filter_map(found).collect());
    }
    let listed: Vec<String> = missing.iter().take(LISTED).map(|name| name.escape_debug().to_string()).collect();
    let more = if missing.len() > LISTED { format!(" and {} more", missing.len() - LISTED) } else { String::new() };
    Err(format!("channels that were learned from are missing: {}{more}", listed.join(", ")))
}

fn arrays(arrays: Vec<(String, Array)>) -> Result<Columns, String> {
    let is_alone = arrays.len() == 1;
    let (mut known, mut readings) = (Vec::new(), None);
    for (name, array) in arrays {
        match name.as_str() {
            name if READINGS.contains(&name) || is_alone => readings = Some(array),
            learned if LEARNED.contains(&learned) => known.push((name, array.values)),
            _ => {}
        }
    }
    let readings = readings.ok_or("an array readings_v, a row a press, is needed")?;
    Ok(Columns { known, names: Vec::new(), readings })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(text: &str, names: &[&str]) -> Result<Columns, String> {
        Columns::of(Table::parse(text.as_bytes())?, &names.map_owned())
    }

    trait Owned {
        fn map_owned(&self) -> Vec<String>;
    }

    impl Owned for [&str] {
        fn map_owned(&self) -> Vec<String> {
            self.iter().map(|name| (*name).to_owned()).collect()
        }
    }

    #[test]
    fn what_counts_is_timed_or_has_another_unit_is_no_channel() {
        for name in [
            "",
            "id",
            "ID",
            "press_id",
            "Unnamed: 0",
            "index",
            "time",
            "time_s",
            "time(s)",
            "t_ms",
            "Timestamp",
            "x_m",
            "depth_m",
            "robot_x_mm",
            "torque_n",
            "frame",
            "press number",
        ] {
            assert!(!is_channel(name), "{name}");
        }
        for name in ["ch0", "0", "e3_g4", "row0_col3", "v", "reading_v", "a_mv", "grid", "s", "m", "times", "id_3"] {
            assert!(is_channel(name), "{name}");
        }
    }

    #[test]
    fn channels_that_were_learned_from_are_found_by_their_names() {
        let found = columns("id,b,x_m,a,c\n7,2,0.5,1,3\n", &["a", "b"]).unwrap();
        assert_eq!((found.readings.values, found.names), (vec![1.0, 2.0], ["a", "b"].map_owned()));
        assert_eq!(found.known, [("x_m".to_owned(), vec![0.5])]);
        let missing = columns("b,c\n1,2\n", &["a", "b", "d"]).unwrap_err();
        assert!(missing.contains("are missing: a, d"), "{missing}");
        assert!(columns("a,b,a\n1,2,3\n", &[]).unwrap_err().contains("two columns are called a"));
    }

    #[test]
    fn without_names_the_order_counts() {
        let found = columns("1,2,3\n4,5,6\n", &["a", "b", "c"]).unwrap();
        assert_eq!((found.readings.shape, found.known.len()), (vec![2, 3], 0));
    }
}
