//! Work against precision: time a frame against error, each solver with its spread, how often it is wrong, and what noise allows.

use super::super::{AsBuiltReport, Course, DetectorReport, Floor, Group, SceneKind, SolverReport};
use super::{TWO, label};
use crate::score::{Spread, Summary};
use crate::view::{Axis, Chart, Figures, MM, Mark, PERCENT, Series, Unit, same_axis};
use tactomo_touch::solve::Family;

/// Of 1 less the correlation, what is below this shows there.
const FLOOR_CORRELATION: f64 = 0.01;

/// Groups that have charts of their own.
pub(super) const GROUPS: [(Group, &str); 3] =
    [(Group::One, "One contact"), (Group::Several, "Two or three contacts"), (Group::Shapes, "Hands and shapes")];
/// Which frames have charts of their own.
const COURSES: [(Course, &str); 2] = [(Course::First, "first frame"), (Course::Following, "frames that follow")];

/// What marks are, beside their colours.
const MARKS: [(&str, &str); 5] = [
    ("", "right in all frames"),
    ("partly-right", "in half of them"),
    ("never-right", "in none"),
    ("spread", "from the 10th to the 90th percentile"),
    ("leads", "no other is better in both"),
];

/// Solvers that know the same of their detectors.
#[derive(Clone, Copy)]
struct Known<'a> {
    name: &'static str,
    solvers: &'a [SolverReport],
    floors: &'a [Floor],
}

/// Charts of the detector as described, and of such as they were built, on the same axes.
pub(super) fn figures(report: &DetectorReport, built_text: String) -> [Figures; 2] {
    let described = [Known { name: "", solvers: &report.solvers, floors: &report.floors }];
    let of = |built: &'_ AsBuiltReport| built.known.name();
    let built: Vec<Known> = report
        .as_built
        .iter()
        .map(|built| Known { name: of(built), solvers: &built.solvers, floors: &built.floors })
        .collect();
    let scenes = report.as_built.first().map_or(&SceneKind::ALL[..], |built| &built.scenes);
    let mut exact = charts(&described, &SceneKind::ALL);
    let mut built = charts(&built, scenes);
    let mut all: Vec<&mut (Group, Chart)> = exact.iter_mut().chain(&mut built).collect();
    // One axis of time for all, and one of error for those of a group: so they can be compared.
    same_axes(&mut all);
    let charts = |charts: Vec<(Group, Chart)>| charts.into_iter().map(|(_, chart)| chart);
    let exact = Figures { legend: legend(report), ..Figures::of("", charts(exact)) };
    [exact, Figures::of(built_text, charts(built))]
}

/// Gives charts one axis of time, and those of a group one of error.
pub(super) fn same_axes(charts: &mut [&mut (Group, Chart)]) {
    same_axis(charts.iter_mut().map(|(_, chart)| chart), 0);
    for group in Group::ALL {
        same_axis(charts.iter_mut().filter(|(of, _)| *of == group).map(|(_, chart)| chart), 1);
    }
}

fn legend(report: &DetectorReport) -> Vec<(&'static str, String)> {
    let is_there = |family: &Family| report.solvers.iter().any(|solver| solver.family == *family);
    let families = Family::ALL.into_iter().filter(is_there).map(|family| (family.class(), family.title()));
    families.chain(MARKS).map(|(class, what)| (class, what.to_owned())).collect()
}

/// A chart for the first frames and one for those that follow, of each group.
fn charts(known: &[Known], scenes: &[SceneKind]) -> Vec<(Group, Chart)> {
    let Some(last) = known.last() else { return Vec::new() };
    let all = COURSES.into_iter().flat_map(|course| GROUPS.map(|group| (course, group)));
    all.map(|((course, when), (group, title))| {
        let frames = last.solvers.iter().find_map(|solver| Some(solver.course(group, course)?.frames));
        let names: Vec<_> =
            scenes.iter().filter(|kind| kind.group() == group).map(|kind| SceneKind::name(*kind)).collect();
        let subtitle = format!("{}, n = {}: {}", of_what(group), frames.unwrap_or(0), names.join(", "));
        let chart = chart(group, &format!("{title}, {when}"), &subtitle, series(known, group, course));
        let chart = Chart { guide: Some((1e-3, "1000 frames/s".to_owned())), ..chart };
        (group, with_floor(chart, last.floors, group, course))
    })
    .collect()
}

/// With what noise allows, and an axis that reaches there.
fn with_floor(mut chart: Chart, floors: &[Floor], group: Group, course: Course) -> Chart {
    let floor = floors.iter().find(|floor| floor.group == group);
    let floor_m = floor.and_then(|floor| match course {
        Course::First => floor.first_m,
        Course::Following => floor.following_m,
    });
    chart.axes[1].reaches.extend(floor_m.map(|errors_m| errors_m.median));
    chart.level = floor_m.map(|errors_m| (errors_m.median, "noise alone (Cramer-Rao bound)".to_owned()));
    chart
}

/// Time a frame against the error of a group.
pub(super) fn chart(group: Group, title: &str, subtitle: &str, series: Vec<Series>) -> Chart {
    let time = Axis::log("time a frame", Unit::Seconds).floor(1e-7).decades(1.5);
    let error = match group {
        Group::Shapes => Axis::log("", Unit::Plain).floor(FLOOR_CORRELATION).decades(0.6),
        _ => Axis::log("", Unit::Metres).floor(1e-5),
    };
    Chart { has_front: true, ..Chart::new(title, subtitle, [time, error], series) }
}

/// What the error of a group is.
pub(super) fn of_what(group: Group) -> &'static str {
    if group == Group::Shapes { "1 - correlation with the truth" } else { "error" }
}

/// A series for each solver: its defaults have the label, from what it reaches with the description to what it reaches calibrated.
fn series(known: &[Known], group: Group, course: Course) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for (index, Known { name, solvers, .. }) in known.iter().enumerate() {
        for solver in *solvers {
            let Some(summary) = solver.course(group, course) else { continue };
            let Some(mut mark) = mark(solver, summary, group) else { continue };
            if index + 1 < known.len() {
                mark.spread = None;
            }
            if !name.is_empty() {
                mark.note = format!("{name}: {}", mark.note);
            }
            match all.iter_mut().find(|series| series.name == solver.solver) {
                Some(series) if solver.parameter.is_none() => {
                    series.marks.push(mark);
                    (series.main, series.is_joined) = (Some(series.marks.len() - 1), true);
                }
                Some(series) => series.marks.push(mark),
                None => all.push(Series::dots(solver.solver.as_str(), solver.family.class(), [mark])),
            }
        }
    }
    all
}

/// Median time and error of a solver in a group's scenes; with its spread, and how often it was right, if its parameter is the default.
fn mark(solver: &SolverReport, summary: &Summary, group: Group) -> Option<Mark> {
    let error = spread(group, summary)?;
    let time_s = summary.time_us.spread().map(|us| us * 1e-6);
    let wrong = if group == Group::Shapes { summary.wrong_image? } else { summary.wrong };
    let is_default = solver.parameter.is_none();
    Some(Mark {
        note: format!("{}, wrong in {} %", note(solver, summary), PERCENT.text(Some(wrong))),
        spread: is_default.then_some([[time_s.p10, time_s.p90], [error.p10, error.p90]]),
        filled: is_default.then_some(1.0 - wrong),
        ..Mark::from([time_s.median, error.median])
    })
}

/// How the error of a group is spread.
pub(super) fn spread(group: Group, summary: &Summary) -> Option<Spread> {
    match group {
        Group::Shapes => summary.correlation_spread.map(|correlation| correlation.turned(|of| 1.0 - of)),
        _ => summary.error_spread_m,
    }
}

/// A solver's means, for those who ask.
pub(super) fn note(solver: &SolverReport, summary: &Summary) -> String {
    let [mm, two] = [MM.digits(2), TWO].map(|format| move |value: Option<f64>| format.text(value));
    format!(
        "{}: of {} frames mean error {} mm (position {} mm, missed {}, invented {}); correlation {}, Dice {}",
        label(solver),
        summary.frames,
        mm(summary.error_m),
        mm(summary.position_error_m),
        two(summary.missed),
        two(summary.invented),
        two(summary.correlation),
        two(summary.dice)
    )
}
