//! Which columns of a table are channels, by their names.
//!
//! A column is no channel if its name, in any case,
//! - counts or tells the time: it is empty, or its last word is `id`, `index`, `number`, `row`, `frame`, `sequence`, `press`, `trial`, `time`,
//!   `timestamp`, `date` or `datetime`; or it begins with `Unnamed`, as pandas calls an index;
//! - ends in a unit that no reading has, behind another word: `time_s`, `x_mm`, `Fz [N]`;
//! - tells a pose or a force in a word without a number: `Fz`, `rx`, `roll`, `robot_pose_x`.
//!
//! Where most of the rest have numbers, as `ch0` to `ch191`, one without a number is none either, nor are a few with a stem of their own (`joint1` to
//! `joint6`).

/// Words of names that count or tell the time.
const COUNTS: [&str; 12] =
    ["id", "index", "number", "row", "frame", "sequence", "press", "trial", "time", "timestamp", "date", "datetime"];
/// Words of names whose column has dates or times of day, which need not be numbers.
const DATES: [&str; 7] = ["time", "timestamp", "date", "datetime", "zeit", "uhrzeit", "datum"];
/// Units that no reading has: of time, length, force, pressure, angle and temperature.
const UNITS: [&str; 16] =
    ["s", "ms", "us", "ns", "m", "mm", "um", "n", "mn", "g", "kg", "pa", "kpa", "deg", "rad", "degc"];
/// Words of poses and forces.
const ELSE: [&str; 37] = [
    "x",
    "y",
    "z",
    "rx",
    "ry",
    "rz",
    "qx",
    "qy",
    "qz",
    "qw",
    "fx",
    "fy",
    "fz",
    "mx",
    "my",
    "mz",
    "tx",
    "ty",
    "tz",
    "roll",
    "pitch",
    "yaw",
    "pose",
    "position",
    "orientation",
    "quaternion",
    "force",
    "torque",
    "moment",
    "joint",
    "robot",
    "tcp",
    "depth",
    "speed",
    "velocity",
    "temperature",
    "weight",
];
/// A stem with fewer than this share of the columns of the most frequent one is of something else.
const FEW: usize = 4;

/// Channels among columns.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Channels {
    /// Columns that are channels, in their order.
    pub which: Vec<usize>,
    /// Names of the others.
    pub others: Vec<String>,
}

/// The channels among columns of such names.
pub fn channels(names: &[String]) -> Channels {
    let may_be: Vec<usize> = (0..names.len()).filter(|&column| may_be_channel(&names[column])).collect();
    let stems: Vec<Option<String>> = may_be.iter().map(|&column| stem(&names[column])).collect();
    let of_stem = |stem: &Option<String>| stems.iter().filter(|other| *other == stem).count();
    let numbered = stems.iter().filter(|stem| stem.is_some()).count();
    let most = stems.iter().filter(|stem| stem.is_some()).map(of_stem).max().unwrap_or_default();
    let are_numbered = 2 * numbered > stems.len() && most > 1;
    let is_channel = |stem: &Option<String>| !are_numbered || stem.is_some() && FEW * of_stem(stem) >= most;
    let which: Vec<usize> =
        may_be.iter().zip(&stems).filter(|(_, stem)| is_channel(stem)).map(|(&column, _)| column).collect();
    let others =
        (0..names.len()).filter(|column| !which.contains(column)).map(|column| names[column].clone()).collect();
    Channels { which, others }
}

/// Whether a name by itself may be that of a channel.
fn may_be_channel(name: &str) -> bool {
    let lower = name.trim().to_ascii_lowercase();
    let words: Vec<&str> = lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let Some(last) = words.last() else { return false };
    let has_unit = words.len() > 1 && UNITS.contains(last);
    let is_else = stem(name).is_none() && words.iter().any(|word| ELSE.contains(word));
    !(lower.starts_with("unnamed") || has_unit || COUNTS.contains(last) || is_else)
}

/// Whether a column of such a name has dates or times of day.
pub fn is_date(name: &str) -> bool {
    let lower = name.to_ascii_lowercase();
    lower.split(|c: char| !c.is_alphanumeric()).any(|word| DATES.contains(&word))
}

/// A name without its numbers, if it has some.
fn stem(name: &str) -> Option<String> {
    let stem: String = name.chars().filter(|c| !c.is_ascii_digit()).collect();
    (stem.len() < name.len()).then_some(stem)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(names: &[&str]) -> Vec<usize> {
        channels(&names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>()).which
    }

    #[test]
    fn what_counts_is_timed_has_another_unit_or_is_a_pose_is_no_channel() {
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
            "Fz",
            "fz",
            "Fz [N]",
            "Force (N)",
            "rx",
            "qw",
            "tcp_pose_z",
            "roll",
            "x",
        ] {
            assert_eq!(of(&[name]), [] as [usize; 0], "{name}");
        }
        for name in [
            "ch0",
            "0",
            "e3_g4",
            "row0_col3",
            "v",
            "reading_v",
            "a_mv",
            "grid",
            "s",
            "m",
            "times",
            "id_3",
            "force_3",
            "V1 [mV]",
        ] {
            assert_eq!(of(&[name]), [0], "{name}");
        }
    }

    #[test]
    fn what_has_no_number_or_a_stem_of_its_own_among_numbered_ones_is_none() {
        let names = |more: &[&str]| -> Vec<String> {
            (0..32).map(|i| format!("ch{i}")).chain(more.iter().map(|&name| name.to_owned())).collect()
        };
        let all = channels(&names(&["gripper", "A1", "A2", "A3", "A4", "A5", "A6", "label"]));
        assert_eq!((all.which.len(), all.others.len()), (32, 8));
        let halves: Vec<String> =
            ["left", "right"].iter().flat_map(|side| (0..8).map(move |i| format!("{side}_{i}"))).collect();
        assert_eq!(channels(&halves).which.len(), 16);
        assert_eq!(of(&["a", "b", "c"]), [0, 1, 2]);
        assert_eq!(of(&["0", "1", "2", "label"]), [0, 1, 2]);
    }
}
