//! Of which class the answers at a point are, and where a method breaks.

use crate::score::{Score, Summary};

/// Time explodes from this time (us), and this many times that at the harmless point: a person sees that an answer lags from 0.1 s (Miller,
/// 1968, "Response time in man-computer conversational transactions"). It is processor time: four busy loops on two cores made it 1.06 times
/// as long in the median of 518 cells and 1.8 times in one of twenty, where by the wall clock it was 2.3 and 7.4, and 600 at most.
const SLOW_US: f64 = 100_000.0;
const SLOW_FACTOR: f64 = 10.0;
/// Errors up to such shares of the mean distance of electrodes are of level 0, 1, 2, 3; above, 4.
const LEVELS: [f64; 4] = [0.03, 0.1, 0.3, 0.6];
/// A method breaks where more than this share of its answers is wrong: most of them.
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
    /// Places are too far off.
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
    /// Whether the solver reports it itself: most of the wrong answers there have a flag, or were refused.
    pub is_reported: bool,
    /// Share of the points that it survives.
    pub survives: f64,
}

/// Shares of answers; they add up to one.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Classes {
    /// Not [wrong](Score::is_wrong).
    pub right: f64,
    /// Wrong, and a flag says so, or the readings were refused.
    pub flagged: f64,
    /// Wrong without a flag, but [within](crate::judge::Judged::is_covered) the standard errors that are claimed.
    pub covered: f64,
    /// Neither, and without what is varied the method is as far off at that place: what is varied adds less than what makes an answer wrong.
    pub from_start: f64,
    /// Wrong, and nothing says so: whoever uses the answer is misled.
    pub silent: f64,
}

impl Classes {
    /// Of answers, each beside the one at the same place of the harmless point; an error that grows by less than `wrong_m` (m) is no other.
    fn of(scores: &[Score], harmless: &[Score], wrong_m: f64) -> Self {
        let each = 1.0 / scores.len().max(1) as f64;
        let mut all = Self::default();
        for (index, score) in scores.iter().enumerate() {
            let is_from_start = harmless.get(index).is_some_and(|before| {
                let grown_m = score.error_m.zip(before.error_m).map(|(now_m, before_m)| now_m - before_m);
                before.is_wrong && !score.not_finite && grown_m.is_some_and(|grown_m| grown_m < wrong_m)
            });
            let class = match score {
                score if !score.is_wrong => &mut all.right,
                score if is_flagged(score) => &mut all.flagged,
                score if score.is_covered => &mut all.covered,
                _ if is_from_start => &mut all.from_start,
                _ => &mut all.silent,
            };
            *class += each;
        }
        all
    }

    /// Share of wrong answers of whatever class.
    pub fn wrong(&self) -> f64 {
        self.flagged + self.covered + self.from_start + self.silent
    }

    /// Means of some; all right of none.
    pub fn mean(all: &[Self]) -> Self {
        let of = |share: fn(&Self) -> f64| all.iter().map(share).sum::<f64>() / all.len().max(1) as f64;
        Self {
            right: if all.is_empty() { 1.0 } else { of(|c| c.right) },
            flagged: of(|c| c.flagged),
            covered: of(|c| c.covered),
            from_start: of(|c| c.from_start),
            silent: of(|c| c.silent),
        }
    }
}

fn is_flagged(score: &Score) -> bool {
    let flags = &score.flags;
    score.failed || flags.misfit || flags.saturated || flags.unfinished || !flags.excluded.is_empty()
}

/// How much of what a good build has a solver bears.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Margin {
    /// The most that it bears, of what was tried below its first break.
    pub holds: Option<f64>,
    /// The least that breaks it, if anything does.
    pub breaks: Option<f64>,
}

/// What a solver made of a point.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct CellReport {
    /// Mean error with contacts missed and invented (m).
    pub error_m: Option<f64>,
    /// Contacts that nothing was found near to, a frame.
    pub missed: f64,
    /// Contacts found that nothing is near to, a frame.
    pub invented: f64,
    /// Relative error of conductance.
    pub conductance_error: Option<f64>,
    /// Longest time of a frame but for one in a hundred (us).
    pub p99_us: f64,
    /// Share of frames with something that is no finite number.
    pub not_finite: f64,
    /// Share of frames that it refused.
    pub failed: f64,
    /// 0 good to 4 useless.
    pub level: u8,
    /// How it is broken, if it is.
    pub broken: Option<Breakdown>,
    /// Of which classes its answers are.
    pub classes: Classes,
}

impl CellReport {
    /// Of answers at a point and those at the harmless point, with the mean distance of electrodes and the distance from which on an answer is wrong (m).
    pub fn of(scores: &[Score], harmless: &[Score], [reach_m, wrong_m]: [f64; 2]) -> Self {
        let summary = Summary::of(scores);
        let share = summary.error_m.map_or(f64::INFINITY, |error_m| error_m / reach_m);
        let is_useless = summary.not_finite > 0.0 || summary.failed > MOST;
        Self {
            error_m: summary.error_m,
            missed: summary.missed.unwrap_or(0.0),
            invented: summary.invented.unwrap_or(0.0),
            conductance_error: summary.conductance_error,
            p99_us: summary.time_us.p99,
            not_finite: summary.not_finite,
            failed: summary.failed,
            level: if is_useless { 4 } else { LEVELS.iter().filter(|limit| share > **limit).count() as u8 },
            broken: None,
            classes: Classes::of(scores, harmless, wrong_m),
        }
    }

    fn is_wrong(&self) -> bool {
        self.classes.wrong() > MOST
    }

    /// How it breaks where the harmless point is another.
    fn broken(&self, harmless: &Self) -> Option<Breakdown> {
        let is_more = |one: f64, other: f64| one - other >= MOST;
        let how = [
            (harmless.is_wrong(), Breakdown::Never),
            (self.not_finite > 0.0, Breakdown::NotFinite),
            (self.failed > MOST, Breakdown::Refused),
            (self.is_wrong() && is_more(self.missed, self.invented), Breakdown::Missed),
            (self.is_wrong() && is_more(self.invented, self.missed), Breakdown::Invented),
            (self.is_wrong(), Breakdown::Error),
            (self.p99_us > SLOW_US.max(SLOW_FACTOR * harmless.p99_us), Breakdown::Slow),
        ];
        how.into_iter().find_map(|(is, how)| is.then_some(how))
    }
}

/// Tried points of a sweep from the mildest on.
fn in_order(severities: &[f64], cells: &[Option<CellReport>]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..cells.len()).filter(|index| cells[*index].is_some()).collect();
    order.sort_by(|a, b| severities[*a].total_cmp(&severities[*b]));
    order
}

/// Between which amounts a judged row first breaks, in the order of severities; `None` of one that is never right or has no amounts.
pub(super) fn margin(severities: &[f64], amounts: &[Option<f64>], cells: &[Option<CellReport>]) -> Option<Margin> {
    let order = in_order(severities, cells);
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
    let order = in_order(severities, cells);
    let harmless = cells[*order.first()?].clone()?;
    for cell in cells.iter_mut().flatten() {
        cell.broken = cell.broken(&harmless);
    }
    let whole = cells.iter().flatten().filter(|cell| cell.broken.is_none()).count();
    let survives = whole as f64 / order.len() as f64;
    let broken = |index: &usize| Some((*index, cells[*index].as_ref().filter(|cell| cell.broken.is_some())?));
    let (first, cell) = order.iter().find_map(broken)?;
    // Points that are as bad as that one: a fault at one electrode after the other.
    let alike: Vec<usize> = order.iter().copied().filter(|index| severities[*index] == severities[first]).collect();
    let broken: Vec<_> = alike.iter().filter_map(broken).collect();
    let is_reported = |cell: &CellReport| cell.classes.flagged > 0.5 * cell.classes.wrong();
    let reported = broken.iter().filter(|(_, cell)| is_reported(cell)).count();
    let at = match alike.len() {
        1 => labels[first].to_owned(),
        count => format!("{} of {count}", broken.len()),
    };
    Some(Break { at, how: cell.broken?, is_reported: 2 * reported > broken.len(), survives })
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use tactomo_touch::solve::Flags;

    const REACH_AND_WRONG_M: [f64; 2] = [0.015, 2.25e-3];

    /// A frame with an error (mm), which is wrong from 2.25 mm on.
    fn score(error_mm: f64) -> Score {
        let time = Duration::from_micros(20);
        Score { time, error_m: Some(1e-3 * error_mm), is_wrong: error_mm > 2.25, ..Score::default() }
    }

    fn flagged(error_mm: f64) -> Score {
        Score { flags: Flags { misfit: true, ..Flags::default() }, ..score(error_mm) }
    }

    fn cell(scores: &[Score], harmless: &[Score]) -> CellReport {
        CellReport::of(scores, harmless, REACH_AND_WRONG_M)
    }

    /// A row of a frame a point, in the order of severities, and where it breaks.
    fn row(scores: &[Score]) -> (Vec<Option<CellReport>>, Option<Break>) {
        let mut cells: Vec<_> = scores.iter().map(|one| Some(cell(std::slice::from_ref(one), &scores[..1]))).collect();
        let labels: Vec<String> = (0..scores.len()).map(|index| index.to_string()).collect();
        let severities: Vec<f64> = (0..scores.len()).map(|index| index as f64).collect();
        let found = breaks(&labels.iter().map(String::as_str).collect::<Vec<_>>(), &severities, &mut cells);
        (cells, found)
    }

    #[test]
    fn every_answer_is_of_one_class() {
        let covered = Score { is_covered: true, ..score(5.0) };
        let refused = Score { failed: true, is_wrong: true, ..Score::default() };
        let missed = Score { is_wrong: true, missed: Some(1), ..score(0.1) };
        // At its harmless point a method is off by 0.1, 3.6, 0.1, 3.6, ... mm.
        let before: Vec<Score> = (0..4).flat_map(|_| [score(0.1), score(3.6)]).collect();
        let now = [score(2.2), score(3.9), covered, score(7.7), flagged(9.0), refused, missed, flagged(0.1)];
        let classes = cell(&now, &before).classes;
        let of = |count: f64| count / 8.0;
        let expected =
            Classes { right: of(2.0), flagged: of(2.0), covered: of(1.0), from_start: of(1.0), silent: of(2.0) };
        assert_eq!(classes, expected);
        assert!((classes.right + classes.wrong() - 1.0).abs() < 1e-12);
        let mean = Classes::mean(&[classes, Classes { right: 1.0, ..Classes::default() }]);
        assert_eq!((mean.right, mean.silent), (of(5.0), of(1.0)));
    }

    #[test]
    fn what_is_far_off_is_right_nowhere_however_far_off_it_was_before() {
        for before_mm in [0.1, 2.2, 3.6, 9.0] {
            for now_mm in [2.3, 3.0, 4.4, 7.2, 15.0] {
                let classes = cell(&[score(now_mm)], &[score(before_mm)]).classes;
                assert_eq!(classes.right, 0.0, "{before_mm} {now_mm}");
                assert_eq!(
                    classes.from_start > 0.0,
                    before_mm > 2.25 && now_mm - before_mm < 2.25,
                    "{before_mm} {now_mm}"
                );
            }
        }
    }

    #[test]
    fn a_method_breaks_where_most_of_its_answers_are_wrong() {
        let (_, found) = row(&[score(0.1), score(2.2), score(2.3), score(0.1)]);
        let expected = Break { at: "2".to_owned(), how: Breakdown::Error, is_reported: false, survives: 0.75 };
        assert_eq!(found, Some(expected));
        assert_eq!(row(&[score(0.1), score(2.0)]).1, None);
        let (_, never) = row(&[score(10.0), score(0.1)]);
        assert_eq!(never.map(|at| (at.how, at.survives)), Some((Breakdown::Never, 0.0)));
    }

    #[test]
    fn the_margin_is_between_what_holds_and_what_breaks() {
        let (mut cells, _) = row(&[score(0.1), score(0.2), score(9.0), score(9.0)]);
        let (severities, amounts) = ([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 4.0, 9.0].map(Some));
        let found = margin(&severities, &amounts, &cells);
        assert_eq!(found, Some(Margin { holds: Some(1.0), breaks: Some(4.0) }));
        assert_eq!(margin(&severities, &[None; 4], &cells), None);
        cells.iter_mut().flatten().for_each(|cell| cell.broken = None);
        assert_eq!(margin(&severities, &amounts, &cells), Some(Margin { holds: Some(9.0), breaks: None }));
    }

    #[test]
    fn of_points_alike_it_counts_how_many_break() {
        let before = [score(0.1)];
        let mut cells =
            [score(0.1), score(9.0), score(0.2), flagged(9.0), flagged(9.0)].map(|now| Some(cell(&[now], &before)));
        let found = breaks(&["none", "0", "1", "2", "3"], &[0.0, 1.0, 1.0, 1.0, 1.0], &mut cells);
        let expected = Break { at: "3 of 4".to_owned(), how: Breakdown::Error, is_reported: true, survives: 0.4 };
        assert_eq!(found, Some(expected));
    }

    #[test]
    fn what_is_worst_is_named() {
        let how = |worse: Score| row(&[score(0.1), worse]).1.map(|at| (at.how, at.is_reported));
        let missed = |count| Score { missed: Some(count), invented: Some(0), ..score(9.0) };
        let invented = Score { missed: Some(1), invented: Some(2), ..score(9.0) };
        assert_eq!(how(Score { not_finite: true, ..flagged(9.0) }), Some((Breakdown::NotFinite, true)));
        assert_eq!(how(Score { failed: true, is_wrong: true, ..Score::default() }), Some((Breakdown::Refused, true)));
        assert_eq!(how(missed(1)), Some((Breakdown::Missed, false)));
        assert_eq!(how(invented), Some((Breakdown::Invented, false)));
        let far = Score { missed: Some(1), invented: Some(1), ..score(5.0) };
        assert_eq!(how(far), Some((Breakdown::Error, false)), "as many as there are, one of them far off");
        assert_eq!(how(Score { time: Duration::from_millis(150), ..score(0.1) }), Some((Breakdown::Slow, false)));
        assert_eq!(how(Score { time: Duration::from_millis(50), ..score(0.1) }), None, "nobody sees that it lags");
    }
}
