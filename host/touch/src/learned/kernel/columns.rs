//! Columns of a file of presses, or of readings alone: which are places and strengths, which are channels.
//!
//! In a file with names, `x_m`, `y_m`, `z_m`, `force_n`, `depth_m` and `conductance_s` are learned, and [`channels`] tells which of the others
//! are channels.
//!
//! Where the channels are known by their names, they are found by these, and no other column is looked at.

use tactomo_table::{Array, Channels, Table, channels};

/// Columns that are learned.
const LEARNED: [&str; 6] = ["x_m", "y_m", "z_m", "force_n", "depth_m", "conductance_s"];
/// Names that an array of readings may have in an NPZ file.
const READINGS: [&str; 3] = ["readings_v", "readings", "volts"];
/// Last words of columns that say which press a row is of.
const PRESS: [&str; 2] = ["press", "trial"];
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
    /// Names of columns that are neither channels nor learned, where channels were told by their names.
    pub others: Vec<String>,
    /// Which press each row is of, if a column says so.
    pub presses: Option<Vec<f64>>,
}

impl Columns {
    /// Readings alone.
    fn of_readings(readings: Array) -> Self {
        Self { known: Vec::new(), names: Vec::new(), readings, others: Vec::new(), presses: None }
    }

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

fn named(heads: &[String], rows: Array, wanted: &[String]) -> Result<Columns, String> {
    if heads.is_empty() {
        return Ok(Columns::of_readings(rows));
    }
    if let Some(index) = (1..heads.len()).find(|&index| heads[..index].contains(&heads[index])) {
        return Err(format!("two columns are called {}", heads[index].escape_debug()));
    }
    let Channels { which, others } = match wanted {
        [] => channels(heads),
        _ => Channels { which: by_name(heads, wanted)?, others: Vec::new() },
    };
    let column = |index: usize| rows.of_columns(&[index]).values;
    let is_known = |head: &String| LEARNED.contains(&head.as_str());
    let known = heads.iter().enumerate().filter(|(_, head)| is_known(head));
    Ok(Columns {
        known: known.map(|(index, head)| (head.clone(), column(index))).collect(),
        names: which.iter().map(|&index| heads[index].clone()).collect(),
        readings: rows.of_columns(&which),
        others: others.into_iter().filter(|other| !is_known(other)).collect(),
        presses: heads.iter().position(|head| is_press(head)).map(column),
    })
}

/// Whether a column of such a name says which press a row is of: `press`, `press_id`, `trial number`.
fn is_press(name: &str) -> bool {
    let lower = name.to_ascii_lowercase();
    lower.split(|c: char| !c.is_alphanumeric()).next().is_some_and(|word| PRESS.contains(&word))
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
    Ok(Columns { known, ..Columns::of_readings(readings) })
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
