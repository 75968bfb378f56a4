//! What counts as broken.

use crate::score::Summary;

/// Error from which a method is broken, in mean distances of electrodes, and in errors at the harmless point.
const BROKEN_SHARE: f64 = 0.15;
const BROKEN_FACTOR: f64 = 2.0;
/// Error at the harmless point from which it never works, in mean distances of electrodes.
const NEVER_SHARE: f64 = 0.6;
/// Contacts missed or invented a frame from which it is broken.
const MISCOUNT: f64 = 0.5;
/// Time explodes from this time (us), and this many times that at the harmless point: a person sees that an answer lags from 0.1 s (Miller,
/// 1968, "Response time in man-computer conversational transactions"). It is processor time: four busy loops on two cores made it 1.06 times
/// as long in the median of 518 cells and 1.8 times in one of twenty, where by the wall clock it was 2.3 and 7.4, and 600 at most.
const SLOW_US: f64 = 100_000.0;
const SLOW_FACTOR: f64 = 10.0;
/// Errors up to such shares of the mean distance of electrodes are of level 0, 1, 2, 3; above, 4.
const LEVELS: [f64; 4] = [0.03, 0.1, 0.3, 0.6];
/// Share of frames from which a solver counts as refusing, or as flagging: most of them.
const MOST: f64 = 0.5;

/// How a method breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Breakdown {
    /// It does not work at the harmless point either.
    Never,
    /// Something of the answer is no finite number.
    NotFinite,
    /// It refuses the readings.
    Refused,
    /// Contacts are missed.
    Missed,
    /// Contacts are invented.
    Invented,
    /// The error grows.
    Error,
    /// A frame takes far longer.
    Slow,
}

impl Breakdown {
    /// In a word or two.
    pub fn name(self) -> &'static str {
        match self {
            Self::Never => "never right",
            Self::NotFinite => "not finite",
            Self::Refused => "refused",
            Self::Missed => "missed",
            Self::Invented => "invented",
            Self::Error => "error",
            Self::Slow => "slow",
        }
    }
}

/// Where a method breaks first.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Break {
    /// The mildest point that broke it; of points alike, how many of how many did.
    pub at: String,
    /// How.
    pub how: Breakdown,
    /// Whether the solver reports it itself, by a flag in most frames of that point or of most points alike, or by refusing.
    pub is_reported: bool,
    /// Share of the points that it survives.
    pub survives: f64,
}

/// What a solver made of a point.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct CellReport {
    /// Mean error with contacts missed and invented (m).
    pub error_m: Option<f64>,
    /// Mean distance of contacts found (m).
    pub position_error_m: Option<f64>,
    /// Share of frames with no contact missed and none invented.
    pub count_right: Option<f64>,
    /// Contacts missed, a frame.
    pub missed: f64,
    /// Contacts invented, a frame.
    pub invented: f64,
    /// Relative error of conductance.
    pub conductance_error: Option<f64>,
    /// Longest time of a frame but for one in a hundred (us).
    pub p99_us: f64,
    /// Share of frames with something that is no finite number.
    pub not_finite: f64,
    /// Share of frames that it refused.
    pub failed: f64,
    /// Share of frames with a flag: misfit, saturated, unfinished or excluded.
    pub flagged: f64,
    /// 0 good to 4 useless.
    pub level: u8,
    /// How it is broken, if it is.
    pub broken: Option<Breakdown>,
    /// The mean distance of electrodes (m).
    pub reach_m: f64,
}

impl CellReport {
    /// Of a summary; not yet judged against the harmless point.
    pub fn of(summary: &Summary, reach_m: f64) -> Self {
        let flags = [summary.misfit, summary.saturated, summary.unfinished, summary.excluded];
        let share = summary.error_m.map_or(f64::INFINITY, |error_m| error_m / reach_m);
        let useless = summary.not_finite > 0.0 || summary.failed >= MOST;
        Self {
            error_m: summary.error_m,
            position_error_m: summary.position_error_m,
            count_right: summary.count_right,
            missed: summary.missed.unwrap_or(0.0),
            invented: summary.invented.unwrap_or(0.0),
            conductance_error: summary.conductance_error,
            p99_us: summary.time_us.p99,
            not_finite: summary.not_finite,
            failed: summary.failed,
            flagged: flags.into_iter().fold(0.0, f64::max),
            level: if useless { 4 } else { LEVELS.iter().filter(|limit| share > **limit).count() as u8 },
            broken: None,
            reach_m,
        }
    }

    /// Whether the solver itself says that something is wrong.
    pub fn is_reported(&self) -> bool {
        self.flagged >= MOST || self.failed >= MOST
    }

    /// Whether it does not work here, whatever it does elsewhere.
    fn is_useless(&self) -> bool {
        let is_far = self.error_m.is_none_or(|error_m| error_m > NEVER_SHARE * self.reach_m);
        is_far || self.missed >= MISCOUNT || self.invented >= MISCOUNT || self.level == 4
    }

    fn judged(&self, harmless: &Self) -> Option<Breakdown> {
        let limit_m = (BROKEN_SHARE * self.reach_m).max(BROKEN_FACTOR * harmless.error_m.unwrap_or(0.0));
        let slow_us = SLOW_US.max(SLOW_FACTOR * harmless.p99_us);
        [
            (self.not_finite > 0.0, Breakdown::NotFinite),
            (self.failed >= MOST, Breakdown::Refused),
            (self.missed >= MISCOUNT, Breakdown::Missed),
            (self.invented >= MISCOUNT, Breakdown::Invented),
            (self.error_m.is_some_and(|error_m| error_m > limit_m), Breakdown::Error),
            (self.p99_us > slow_us, Breakdown::Slow),
        ]
        .into_iter()
        .find_map(|(is, how)| is.then_some(how))
    }
}

/// Judges the cells of a row, and finds where it breaks first.
pub(super) fn breaks(labels: &[&str], severities: &[f64], cells: &mut [Option<CellReport>]) -> Option<Break> {
    let mut order: Vec<usize> = (0..cells.len()).filter(|index| cells[*index].is_some()).collect();
    order.sort_by(|a, b| severities[*a].total_cmp(&severities[*b]));
    let harmless = cells[*order.first()?].clone()?;
    for cell in cells.iter_mut().flatten() {
        cell.broken = if harmless.is_useless() { Some(Breakdown::Never) } else { cell.judged(&harmless) };
    }
    let whole = cells.iter().flatten().filter(|cell| cell.broken.is_none()).count();
    let survives = whole as f64 / order.len() as f64;
    let broken = |index: &usize| Some((*index, cells[*index].as_ref().filter(|cell| cell.broken.is_some())?));
    let (first, cell) = order.iter().find_map(broken)?;
    // Points that are as bad as that one: a fault at one electrode after the other.
    let alike: Vec<usize> = order.iter().copied().filter(|index| severities[*index] == severities[first]).collect();
    let broken: Vec<_> = alike.iter().filter_map(broken).collect();
    let reported = broken.iter().filter(|(_, cell)| cell.is_reported()).count();
    let at = match alike.len() {
        1 => labels[first].to_owned(),
        count => format!("{} of {count}", broken.len()),
    };
    Some(Break { at, how: cell.broken?, is_reported: 2 * reported > broken.len(), survives })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Times;

    fn cell(error_mm: f64) -> CellReport {
        let time_us = Times { median: 10.0, p99: 20.0, max: 30.0 };
        CellReport::of(&Summary { error_m: Some(error_mm * 1e-3), time_us, ..Summary::default() }, 0.015)
    }

    #[test]
    fn a_method_breaks_where_its_error_first_grows_beyond_twice_the_harmless_one() {
        let mut cells = [9.0, 3.0, 7.0, 5.0].map(|mm| Some(cell(mm)));
        let found = breaks(&["a", "b", "c", "d"], &[3.0, 0.0, 2.0, 1.0], &mut cells);
        let expected = Break { at: "c".to_owned(), how: Breakdown::Error, is_reported: false, survives: 0.5 };
        assert_eq!(found, Some(expected));
        assert_eq!(
            breaks(&["a", "b"], &[0.0, 1.0], &mut [Some(cell(0.1)), Some(cell(2.0))]),
            None,
            "within 0.15 of a distance"
        );
    }

    #[test]
    fn of_points_alike_it_counts_how_many_break() {
        let flagged = CellReport { flagged: 1.0, ..cell(9.0) };
        let mut cells = [cell(0.1), cell(9.0), cell(0.2), flagged.clone(), flagged].map(Some);
        let found = breaks(&["none", "0", "1", "2", "3"], &[0.0, 1.0, 1.0, 1.0, 1.0], &mut cells);
        let expected = Break { at: "3 of 4".to_owned(), how: Breakdown::Error, is_reported: true, survives: 0.4 };
        assert_eq!(found, Some(expected));
    }

    #[test]
    fn what_is_wrong_at_the_harmless_point_is_never_right() {
        let found = breaks(&["a", "b"], &[0.0, 1.0], &mut [Some(cell(10.0)), Some(cell(0.1))]);
        assert_eq!(found.map(|at| (at.how, at.survives)), Some((Breakdown::Never, 0.0)));
    }

    #[test]
    fn what_is_worst_is_named() {
        let broken = |worse: CellReport| {
            breaks(&["a", "", "b"], &[0.0, -1.0, 1.0], &mut [Some(cell(0.1)), None, Some(worse)])
                .map(|at| (at.how, at.is_reported))
        };
        let flagged = CellReport { not_finite: 0.1, missed: 1.0, flagged: 0.9, ..cell(9.0) };
        assert_eq!(broken(flagged), Some((Breakdown::NotFinite, true)));
        assert_eq!(broken(CellReport { failed: 1.0, ..cell(9.0) }), Some((Breakdown::Refused, true)));
        assert_eq!(broken(CellReport { missed: 0.6, ..cell(9.0) }), Some((Breakdown::Missed, false)));
        assert_eq!(broken(CellReport { invented: 0.6, ..cell(1.0) }), Some((Breakdown::Invented, false)));
        assert_eq!(broken(CellReport { p99_us: 1e6, ..cell(1.0) }), Some((Breakdown::Slow, false)));
        assert_eq!(broken(CellReport { p99_us: 9e4, ..cell(1.0) }), None, "a long search, which nobody notices");
    }

    #[test]
    fn levels_are_shares_of_the_electrodes_distance() {
        let levels = [0.3, 1.0, 3.0, 7.0, 12.0].map(|mm| cell(mm).level);
        assert_eq!(levels, [0, 1, 2, 3, 4]);
        let refused = Summary { failed: 1.0, ..Summary::default() };
        assert_eq!(CellReport::of(&refused, 0.015).level, 4);
    }
}
