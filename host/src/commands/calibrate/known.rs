//! Presses at places that a person knows.

use std::path::Path;
use std::str::FromStr;

use anyhow::{Context, ensure};
use tactomo::table::Table;

/// How near in time a frame of a recording has to be to a known press (s).
const NEAR_S: f64 = 0.1;

/// A press at a known place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownPlace {
    /// Row of a table, from 1, or time in a recording (s).
    pub at: f64,
    /// Where it is, from the middle (m).
    pub at_m: [f64; 2],
}

impl KnownPlace {
    /// Whether a frame, by its row or time, is of this press.
    pub fn is_at(&self, at: f64, is_time: bool) -> bool {
        if is_time { (at - self.at).abs() < NEAR_S } else { at == self.at }
    }
}

impl FromStr for KnownPlace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is no known place: give the row, or the time in seconds, and x and y in mm, as in 3:-20,15.5"
            )
        };
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(wrong);
        let (at, place) = text.split_once(':').ok_or_else(wrong)?;
        let (x, y) = place.split_once(',').ok_or_else(wrong)?;
        Ok(Self { at: number(at)?, at_m: [1e-3 * number(x)?, 1e-3 * number(y)?] })
    }
}

/// Those of a table, with columns `row` or `time_s`, `x_m` and `y_m`.
pub fn places(path: &Path, is_time: bool) -> anyhow::Result<Vec<KnownPlace>> {
    let wanted = if is_time { "time_s" } else { "row" };
    let named = [wanted, "x_m", "y_m"];
    let Table::Columns { names, rows } = Table::read(path)? else {
        anyhow::bail!("{}: a table with columns {} is needed, not arrays", path.display(), named.join(", "));
    };
    let column = |name: &str| {
        let at = names.iter().position(|other| other == name);
        at.with_context(|| format!("{}: it has no column `{name}`; {} are needed", path.display(), named.join(", ")))
    };
    let [at, x, y] = [column(named[0])?, column(named[1])?, column(named[2])?];
    ensure!(!rows.values.is_empty(), "{}: it has no row", path.display());
    Ok(rows.values.chunks_exact(names.len()).map(|row| KnownPlace { at: row[at], at_m: [row[x], row[y]] }).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_told_in_millimetres() {
        assert_eq!("3:-20,15.5".parse(), Ok(KnownPlace { at: 3.0, at_m: [-0.02, 0.0155] }));
        for wrong in ["3", "3:1", "x:1,2", "3:1,nan", ":1,2"] {
            assert!(wrong.parse::<KnownPlace>().is_err_and(|error| error.contains("3:-20,15.5")), "{wrong}");
        }
    }
}
