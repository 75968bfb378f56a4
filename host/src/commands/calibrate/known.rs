//! Presses at places that a person knows.

use std::path::Path;
use std::str::FromStr;

use anyhow::{Context, bail, ensure};
use tactomo::detector::Detector;
use tactomo::hertz::FORCE_N;
use tactomo::table::Table;

/// How near in time a frame of a recording has to be to a known press (s).
pub const NEAR_S: f64 = 0.1;

/// A press at a known place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownPlace {
    /// Row of a table, from 1, or time in a recording (s); or which press of a recording it is, from 1.
    pub at: f64,
    /// Where it is, from the middle (m).
    pub at_m: [f64; 2],
    /// Its force (N), where that is known.
    pub force_n: Option<f64>,
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
        Ok(Self { at: number(at)?, at_m: [1e-3 * number(x)?, 1e-3 * number(y)?], force_n: None })
    }
}

/// Those of a table, with columns `row` or `time_s`, `x_m` and `y_m`.
pub fn places(path: &Path, is_time: bool) -> anyhow::Result<Vec<KnownPlace>> {
    let (places, is_in_order) = places_or_order(path, is_time)?;
    let wanted = if is_time { "time_s" } else { "row" };
    ensure!(!is_in_order, "{}: it has no column `{wanted}`; {wanted}, x_m, y_m are needed", path.display());
    Ok(places)
}

/// Those of a table, with columns `x_m` and `y_m`, `row` or `time_s`, and `force_n` if that is known; whether they are in the order of the presses,
/// because nothing says which they are.
pub fn places_or_order(path: &Path, is_time: bool) -> anyhow::Result<(Vec<KnownPlace>, bool)> {
    let file = path.display();
    let Table::Columns { names, rows } = Table::read(path)? else {
        bail!("{file}: a table with columns x_m, y_m is needed, not arrays");
    };
    let [wanted, other] = if is_time { ["time_s", "row"] } else { ["row", "time_s"] };
    let column = |name: &str| names.iter().position(|known| known == name);
    let needed = |name: &str| {
        column(name).with_context(|| format!("{file}: it has no column `{name}`; {wanted}, x_m, y_m are needed"))
    };
    let (at, x, y, force) = (column(wanted), needed("x_m")?, needed("y_m")?, column("force_n"));
    ensure!(
        at.is_some() || column(other).is_none(),
        "{file}: it has no column `{wanted}` but `{other}`, which is of {}",
        if is_time { "tables, and the readings are a recording" } else { "recordings, and the readings are a table" }
    );
    ensure!(!rows.values.is_empty(), "{file}: it has no row");
    let place = |(index, row): (usize, &[f64])| {
        let known = KnownPlace {
            at: at.map_or((index + 1) as f64, |at| row[at]),
            at_m: [row[x], row[y]],
            force_n: force.map(|force| row[force]).filter(|force_n| !force_n.is_nan()),
        };
        let is_pressed = known.force_n.is_none_or(|force_n| FORCE_N.contains(&force_n));
        ensure!(
            is_pressed && [known.at, known.at_m[0], known.at_m[1]].iter().all(|number| number.is_finite()),
            "{file}, row {}: places have to be finite numbers, and forces from {:?} to {:?} N",
            index + 1,
            FORCE_N.start(),
            FORCE_N.end()
        );
        Ok(known)
    };
    let places = rows.values.chunks_exact(names.len().max(1)).enumerate().map(place).collect::<Result<_, _>>()?;
    Ok((places, at.is_none()))
}

/// Checks that a known place has a press: `unused` is the first that has none.
pub fn check_used(file: &Path, unused: Option<&KnownPlace>, is_time: bool) -> anyhow::Result<()> {
    let Some(missing) = unused else { return Ok(()) };
    let (what, last) = if is_time { ("second", "time") } else { ("row", "row") };
    bail!(
        "{}: there is no {what} {} for a known place: see that each {last} is in the file",
        file.display(),
        missing.at
    )
}

/// Checks that known places are on a detector.
pub fn check_places(known: &[KnownPlace], detector: &Detector) -> anyhow::Result<()> {
    match known.iter().find(|known| !detector.outline.holds(known.at_m)) {
        Some(wrong) => bail!(
            "the known place {:.1}, {:.1} mm is not on the sensor: x and y count from its middle, in millimetres, but in metres in a table",
            1e3 * wrong.at_m[0],
            1e3 * wrong.at_m[1]
        ),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_told_in_millimetres() {
        assert_eq!("3:-20,15.5".parse(), Ok(KnownPlace { at: 3.0, at_m: [-0.02, 0.0155], force_n: None }));
        for wrong in ["3", "3:1", "x:1,2", "3:1,nan", ":1,2"] {
            assert!(wrong.parse::<KnownPlace>().is_err_and(|error| error.contains("3:-20,15.5")), "{wrong}");
        }
    }
}
