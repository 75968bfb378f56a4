//! What counts as broken.

use crate::score::{Score, Summary};

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

/// In which share of frames a solver is wrong: further off than the limit that breaks it, with a contact missed or invented, refused, or not
/// finite.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Wrong {
    /// And says nothing of it: whoever uses the answer is misled.
    pub silent: f64,
    /// And says so, by a flag or by refusing.
    pub flagged: f64,
}

impl Wrong {
    /// Means of some, none of none.
    pub fn mean(all: impl IntoIterator<Item = Self>) -> Self {
        let (mut sum, mut count) = (Self::default(), 0.0_f64);
        for Self { silent, flagged } in all {
            (sum.silent, sum.flagged, count) = (sum.silent + silent, sum.flagged + flagged, count + 1.0);
        }
        Self { silent: sum.silent / count.max(1.0), flagged: sum.flagged / count.max(1.0) }
    }
}

/// How much of what a good build has a solver bears.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Margin {
    /// The most that it bears, of what was tried below its first break.
    pub holds: Option<f64>,
    /// The least that breaks it, if anything does.
    pub breaks: Option<f64>,
}

/// What of a frame tells whether it is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Answer {
    error_m: Option<f64>,
    /// Whatever its error is.
    is_wrong: bool,
    is_flagged: bool,
}

impl Answer {
    fn of(score: &Score) -> Self {
        let flags = &score.flags;
        let is_flagged = flags.misfit || flags.saturated || flags.unfinished || !flags.excluded.is_empty();
        Self { error_m: score.error_m, is_wrong: score.is_wrong(), is_flagged: is_flagged || score.failed }
    }
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
    /// In which share of frames it is wrong.
    pub wrong: Wrong,
    #[serde(skip)]
    pub(super) answers: Vec<Answer>,
    /// The mean distance of electrodes (m).
    pub reach_m: f64,
}

impl CellReport {
    /// Of some frames; not yet judged against the harmless point.
    pub fn of(scores: &[Score], reach_m: f64) -> Self {
        Self { answers: scores.iter().map(Answer::of).collect(), ..Self::summed(&Summary::of(scores), reach_m) }
    }

    fn summed(summary: &Summary, reach_m: f64) -> Self {
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
            wrong: Wrong::default(),
            answers: Vec::new(),
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

    /// The error (m) from which it is wrong, if the harmless point is this one.
    pub fn limit_m(&self) -> f64 {
        let own_m = if self.is_useless() { 0.0 } else { BROKEN_FACTOR * self.error_m.unwrap_or(0.0) };
        own_m.max(BROKEN_SHARE * self.reach_m)
    }

    fn wrong(&self, limit_m: f64) -> Wrong {
        let share = |is_flagged: bool| {
            let is_wrong =
                |answer: &&Answer| answer.is_wrong || answer.error_m.is_some_and(|error_m| error_m > limit_m);
            let count = self.answers.iter().filter(|answer| answer.is_flagged == is_flagged).filter(is_wrong).count();
            count as f64 / self.answers.len().max(1) as f64
        };
        Wrong { silent: share(false), flagged: share(true) }
    }

    fn judged(&self, harmless: &Self) -> Option<Breakdown> {
        let limit_m = harmless.limit_m();
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

/// Between which amounts a judged row first breaks, in the order of severities; `None` of one that is never right or has no amounts.
pub(super) fn margin(severities: &[f64], amounts: &[Option<f64>], cells: &[Option<CellReport>]) -> Option<Margin> {
    let mut order: Vec<usize> = (0..cells.len()).filter(|index| cells[*index].is_some()).collect();
    order.sort_by(|a, b| severities[*a].total_cmp(&severities[*b]));
    let is_broken = |index: &usize| cells[*index].as_ref().is_some_and(|cell| cell.broken.is_some());
    let first = order.iter().position(is_broken);
    if first == Some(0) || order.iter().any(|index| amounts[*index].is_none()) {
        return None;
    }
    let breaks = first.and_then(|first| amounts[order[first]]);
    let below = order[..first.unwrap_or(order.len())].iter().filter_map(|index| amounts[*index]);
    Some(Margin { holds: below.max_by(f64::total_cmp), breaks })
}

/// Judges the cells of a row, and finds where it breaks first.
pub(super) fn breaks(labels: &[&str], severities: &[f64], cells: &mut [Option<CellReport>]) -> Option<Break> {
    let mut order: Vec<usize> = (0..cells.len()).filter(|index| cells[*index].is_some()).collect();
    order.sort_by(|a, b| severities[*a].total_cmp(&severities[*b]));
    let harmless = cells[*order.first()?].clone()?;
    for cell in cells.iter_mut().flatten() {
        cell.broken = if harmless.is_useless() { Some(Breakdown::Never) } else { cell.judged(&harmless) };
        cell.wrong = cell.wrong(harmless.limit_m());
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
    use tactomo_touch::solve::Flags;

    fn cell(error_mm: f64) -> CellReport {
        let time_us = Times { median: 10.0, p99: 20.0, max: 30.0, ..Times::default() };
        CellReport::summed(&Summary { error_m: Some(error_mm * 1e-3), time_us, ..Summary::default() }, 0.015)
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
    fn frames_that_are_wrong_are_silent_or_flagged() {
        let score = |error_mm: f64, misfit: bool| Score {
            error_m: Some(1e-3 * error_mm),
            flags: Flags { misfit, ..Flags::default() },
            ..Score::default()
        };
        let refused = Score { failed: true, ..Score::default() };
        let missed = Score { missed: Some(1), ..score(0.1, true) };
        let all = [score(9.0, false), score(9.0, true), refused, missed, score(0.1, true), score(0.1, false)];
        let mut cells = [vec![score(0.1, false)], all.into()].map(|scores| Some(CellReport::of(&scores, 0.015)));
        breaks(&["a", "b"], &[0.0, 1.0], &mut cells);
        let wrong = cells.map(|cell| cell.unwrap().wrong);
        assert_eq!(wrong, [Wrong::default(), Wrong { silent: 1.0 / 6.0, flagged: 0.5 }]);
        assert_eq!(Wrong::mean(wrong), Wrong { silent: 1.0 / 12.0, flagged: 0.25 });
    }

    #[test]
    fn the_margin_is_between_what_holds_and_what_breaks() {
        let mut cells = [9.0, 0.1, 0.2, 9.0].map(|mm| Some(cell(mm)));
        let (severities, amounts) = ([2.0, 0.0, 1.0, 3.0], [4.0, 0.0, 1.0, 9.0].map(Some));
        breaks(&["", "", "", ""], &severities, &mut cells);
        let found = margin(&severities, &amounts, &cells);
        assert_eq!(found, Some(Margin { holds: Some(1.0), breaks: Some(4.0) }));
        assert_eq!(margin(&severities, &[None; 4], &cells), None);
        cells.iter_mut().flatten().for_each(|cell| cell.broken = None);
        let all = margin(&severities, &amounts, &cells);
        assert_eq!(all, Some(Margin { holds: Some(9.0), breaks: None }));
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
        assert_eq!(CellReport::summed(&refused, 0.015).level, 4);
    }
}
