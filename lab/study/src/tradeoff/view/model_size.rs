//! No more than a scene needs: error and time against the size of the model, and what `auto` chose.

use super::super::{DetectorReport, Group, SceneKind, SolverReport};
use super::precision::{of_what, same_axes, spread};
use crate::score::{ChosenReport, Summary};
use crate::view::{Axis, Chart, Figures, Mark, Series, Unit};
use tactomo_touch::solve::Family;

/// Scenes that have charts of their own: from one contact to what needs an image.
const SCENES: [SceneKind; 8] = [
    SceneKind::Light,
    SceneKind::Firm,
    SceneKind::TwoNear,
    SceneKind::Three,
    SceneKind::FiveFingers,
    SceneKind::Wide,
    SceneKind::Ring,
    SceneKind::Line,
];
/// Those of which there is a chart of time too.
const TIMED: [SceneKind; 4] = [SceneKind::Firm, SceneKind::Three, SceneKind::FiveFingers, SceneKind::Ring];
/// Families with models of several sizes.
const FAMILIES: [Family; 3] = [Family::Contacts, Family::Image, Family::Linear];
/// Width and height of a chart (px): four side by side.
const SIZE: [f64; 2] = [330.0, 270.0];

/// Charts of error for some kinds of scenes, and of time for some of them; `None` where no parameter is swept.
pub(super) fn figures(report: &DetectorReport) -> Option<Figures> {
    let sized = report.solvers.iter().filter(|solver| solver.unknowns.is_some() && solver.parameter.is_some());
    sized.map(|solver| solver.swept(SceneKind::Firm)).next()??;
    let mut errors: Vec<(Group, Chart)> = SCENES.map(|kind| (kind.group(), error(report, kind))).into();
    let mut times: Vec<(Group, Chart)> = TIMED.map(|kind| (Group::Nothing, time(report, kind))).into();
    same_axes(&mut errors.iter_mut().collect::<Vec<_>>());
    same_axes(&mut times.iter_mut().collect::<Vec<_>>());
    let text = "**No more than a scene needs.** Error and time against the unknowns of the model: 4 for each contact that is allowed, 6 of a line, 5 of a ring, one for \
                each node of an image. Where a curve is high on its left, the model is too small for the scene; further right, unknowns cost time. \
                The mark of `auto` says what it chose.";
    Some(Figures::of(text, errors.into_iter().chain(times).map(|(_, chart)| chart)))
}

fn unknowns() -> Axis {
    Axis::log("unknowns", Unit::Plain).reaching([3.0, 3000.0])
}

fn error(report: &DetectorReport, kind: SceneKind) -> Chart {
    let group = kind.group();
    let y = match group {
        Group::Shapes => Axis::log("", Unit::Plain).floor(0.01).decades(0.6),
        _ => Axis::log("", Unit::Metres).floor(1e-5),
    };
    let series = series(report, kind, |summary| Some(spread(group, summary)?.median));
    Chart::new(kind.name(), of_what(group), [unknowns(), y], series).sized(SIZE)
}

fn time(report: &DetectorReport, kind: SceneKind) -> Chart {
    let axis = Axis::log("", Unit::Seconds).floor(1e-7);
    let series = series(report, kind, |summary| Some(summary.time_us.median * 1e-6));
    Chart::new(kind.name(), "time a frame", [unknowns(), axis], series).sized(SIZE)
}

/// A line for each family, and what `auto` chose.
fn series(report: &DetectorReport, kind: SceneKind, value: impl Fn(&Summary) -> Option<f64>) -> Vec<Series> {
    let of = |family: Family| report.solvers.iter().filter(move |solver| solver.family == family);
    let mark = |solver: &SolverReport| {
        let at = [solver.unknowns? as f64, value(solver.swept(kind)?)?];
        Some(Mark { note: super::label(solver), ..Mark::from(at) })
    };
    let line = |family: Family| {
        let mut marks: Vec<Mark> = of(family).filter_map(mark).collect();
        marks.sort_by(|a, b| a.x.total_cmp(&b.x));
        let name = of(family).find(|solver| solver.unknowns.is_some()).map_or("", |solver| solver.solver.as_str());
        Series::line(name, family.class(), marks).labelled_last()
    };
    let chosen = of(Family::Auto).filter_map(|solver| {
        let summary = solver.swept(kind)?;
        let ChosenReport { what, unknowns, .. } = summary.chosen.first()?;
        let mark = Mark::from([(*unknowns).max(1) as f64, value(summary)?]);
        Some(Series::dots(format!("auto: {what}"), Family::Auto.class(), [mark]))
    });
    FAMILIES.map(line).into_iter().chain(chosen).collect()
}
