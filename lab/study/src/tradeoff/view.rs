//! What the report shows.

use super::{AsBuiltReport, DetectorReport, Group, Report, SceneKind, SolverReport};
use crate::score::Summary;
use crate::view::{
    Axis, Chart, Figures, Format, MM, Mark, PERCENT, PLAIN, Series, TEXT, Table, US, Unit, Value, View, same_axis,
};
use tactomo_touch::solve::Family;

/// Of 1 less the correlation, what is below this shows there.
const FLOOR_CORRELATION: f64 = 0.01;
const MEGABYTES: Format = Format { factor: 1e-6, ..Format::new("MB", "bytes").digits(2) };
const MILLISECONDS: Format = Format::new("ms", "ms").digits(2);
const TWO: Format = PLAIN.digits(2);

/// Groups that have charts of their own.
const GROUPS: [(Group, &str); 3] =
    [(Group::One, "One contact"), (Group::Several, "Two or three contacts"), (Group::Shapes, "Hands and shapes")];

/// Charts of time against error, and every figure of every scene.
pub fn view(report: &Report) -> View {
    let lead = "Each dot is a solver: further **left is faster**, further **down is more accurate**. The dashed line joins those that no other beats in \
                both; what is behind it is paler. Small dots are the same solver with another value of its main parameter.";
    let mut view = View::new("Time against error", lead);
    view.method = format!(
        "Error: mean distance of contacts found from those that are there, where one missed or invented (none within the mean distance of \
         electrodes) counts that distance: OSPA of order 1. Correlation: of the image with the true conductance, both smoothed by a \
         thirtieth of the shorter side; of a solver without an image, its contacts are drawn as one. Readings come from a finer model than any that is \
         inverted, with the converter's noise and steps. {} places of each kind of scene, {} frames at each, which solvers read one after the other; \
         seed {}. Times are medians of the processor time of one thread. Memory is what is allocated beyond the model, counted by the allocator.",
        report.places, report.frames, report.seed
    );
    let view = report.detectors.iter().fold(view, |view, detector| of_detector(view, detector, report.as_built));
    view.without(&report.missing)
}

fn of_detector(view: View, report: &DetectorReport, as_built: Option<u64>) -> View {
    let truth = as_built.map_or_else(String::new, |seed| format!(", as built with seed {seed}"));
    let [width_mm, height_mm] = report.size_m.map(|side_m| side_m * 1e3);
    let mut on_paper = charts(|group| series(&report.solvers, group, |solver: &SolverReport| solver.group(group)));
    let mut built = charts(|group| as_built_series(&report.as_built, group));
    let mut scenes: Vec<(Group, Chart)> = SceneKind::ALL
        .into_iter()
        .filter(|kind| kind.group() != Group::Nothing)
        .map(|kind| {
            let series = series(&report.solvers, kind.group(), |solver| solver.scene(kind));
            (kind.group(), chart(kind.group(), kind.name(), of_what(kind.group()), series).sized([330.0, 270.0]))
        })
        .collect();
    // One axis of time for all, and one of error for those of a group: so they can be compared.
    for set in [on_paper.iter_mut().chain(&mut built).collect::<Vec<_>>(), scenes.iter_mut().collect()] {
        let mut set = set;
        same_axis(set.iter_mut().map(|(_, chart)| chart), 0);
        for (group, _) in GROUPS {
            same_axis(set.iter_mut().filter(|(of, _)| *of == group).map(|(_, chart)| chart), 1);
        }
    }
    let all = |charts: Vec<(Group, Chart)>| charts.into_iter().map(|(_, chart)| chart);
    let is_there = |family: &Family| report.solvers.iter().any(|solver| solver.family == *family);
    let legend = Family::ALL.into_iter().filter(is_there).map(|family| (family.class(), family.title().to_owned()));
    let view = view
        .heading(format!("{}, {width_mm:.0} x {height_mm:.0} mm{truth}", report.detector))
        .text(format!(
            "Inverted on the {} model, made in {:.0} ms. A contact missed or invented counts {:.1} mm.",
            report.model,
            report.model_ms,
            report.reach_m * 1e3
        ))
        .with(Figures { legend: legend.collect(), ..Figures::of("", all(on_paper)) })
        .text(nothing(report));
    let view = match report.as_built[..] {
        [] => view,
        _ => view.figures(as_built_text(&report.as_built), all(built)),
    };
    view.with(costs(report)).figures("Scene by scene", all(scenes)).folded("All figures", [figures(report)])
}

/// A chart for each group.
fn charts(series: impl Fn(Group) -> Vec<Series>) -> Vec<(Group, Chart)> {
    let of = |(group, title): (Group, &str)| {
        let subtitle = format!("{} · {}", of_what(group), names(group));
        let chart = chart(group, title, &subtitle, series(group));
        (group, Chart { guide: Some((1e-3, "1000 frames/s".to_owned())), ..chart })
    };
    GROUPS.map(of).into()
}

fn chart(group: Group, title: &str, subtitle: &str, series: Vec<Series>) -> Chart {
    let time = Axis::log("time a frame", Unit::Seconds).floor(1e-7).decades(1.5);
    let error = match group {
        Group::Shapes => Axis::log("", Unit::Plain).floor(FLOOR_CORRELATION).decades(0.6),
        _ => Axis::log("", Unit::Metres).floor(1e-5),
    };
    Chart { has_front: true, ..Chart::new(title, subtitle, [time, error], series) }
}

/// The kinds of a group, for people.
fn names(group: Group) -> String {
    group.kinds().map(SceneKind::name).collect::<Vec<_>>().join(", ")
}

fn of_what(group: Group) -> &'static str {
    if group == Group::Shapes { "1 - correlation with the truth" } else { "error" }
}

fn error(group: Group, summary: &Summary) -> Option<f64> {
    if group == Group::Shapes { summary.correlation.map(|correlation| 1.0 - correlation) } else { summary.error_m }
}

/// A series for each solver, from its means over some scenes; the first mark is that of its defaults.
fn series<'a>(
    solvers: &'a [SolverReport],
    group: Group,
    of: impl Fn(&'a SolverReport) -> Option<&'a Summary>,
) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for solver in solvers {
        let Some(summary) = of(solver) else { continue };
        let Some(error) = error(group, summary) else { continue };
        let mark = Mark { x: summary.time_us.median * 1e-6, y: error, note: note(solver, summary) };
        match all.iter_mut().find(|series| series.name == solver.solver) {
            Some(series) => series.marks.push(mark),
            None => all.push(Series::dots(solver.solver.as_str(), solver.family.class(), [mark])),
        }
    }
    all
}

/// A series for each solver: from what it reaches with the description to what it reaches calibrated, which has the label.
fn as_built_series(reports: &[AsBuiltReport], group: Group) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for report in reports {
        for mut more in series(&report.solvers, group, |solver: &SolverReport| solver.group(group)) {
            more.marks.iter_mut().for_each(|mark| mark.note = format!("{}: {}", report.known.name(), mark.note));
            match all.iter_mut().find(|series| series.name == more.name) {
                Some(series) => {
                    series.marks.extend(more.marks);
                    (series.main, series.is_joined) = (Some(series.marks.len() - 1), true);
                }
                None => all.push(more),
            }
        }
    }
    all
}

fn note(solver: &SolverReport, summary: &Summary) -> String {
    let [mm, two] = [MM.digits(2), TWO].map(|format| move |value: Option<f64>| format.text(value));
    format!(
        "{} error {} mm (position {} mm, missed {}, invented {}); correlation {}, Dice {}",
        solver.parameter.as_deref().unwrap_or_default(),
        mm(summary.error_m),
        mm(summary.position_error_m),
        two(summary.missed),
        two(summary.invented),
        two(summary.correlation),
        two(summary.dice)
    )
    .trim_start()
    .to_owned()
}

fn as_built_text(reports: &[AsBuiltReport]) -> String {
    let dots = match reports.len() {
        1 => "Solvers know the description only",
        _ => "Small dots: solvers know the description only; large ones: what the calibration has found of each",
    };
    format!(
        "**{}**, drawn from the tolerances around the description. {dots}. One place of each kind of scene on each; \
         solvers with their defaults. Axes are those of the charts above.",
        as_built_title(reports)
    )
}

/// What is known of detectors as built, for people.
fn as_built_title(reports: &[AsBuiltReport]) -> String {
    let Some(first) = reports.first() else { return String::new() };
    let mut title = format!("{} detectors as built, {}", first.detectors, first.known.name());
    for report in &reports[1..] {
        title += &format!(", and {}", report.calibration.as_deref().unwrap_or(report.known.name()));
        if report.refused > 0 {
            title += &format!(" ({} of {} were refused)", report.refused, report.detectors);
        }
    }
    title
}

/// Which solvers find contacts where nothing touches.
fn nothing(report: &DetectorReport) -> String {
    let rate = |solver: &SolverReport| solver.scene(SceneKind::None)?.invented.filter(|rate| *rate > 0.0);
    let inventors = report.solvers.iter().filter_map(|solver| Some((label(solver), rate(solver)?)));
    let inventors: Vec<_> = inventors.map(|(name, rate)| format!("{name} ({rate:.2} a frame)")).collect();
    let verdict = match inventors.is_empty() {
        true => "no solver finds a contact".to_owned(),
        false => format!("contacts are invented by {}", inventors.join(", ")),
    };
    let untried: String = report.unavailable.iter().map(|why| format!(" Not tried: {why}.")).collect();
    format!("**Where nothing touches**, {verdict}.{untried}")
}

/// Name of a solver with its parameter.
fn label(solver: &SolverReport) -> String {
    format!("{} {}", solver.solver, solver.parameter.as_deref().unwrap_or_default()).trim_end().to_owned()
}

/// What each solver costs and reaches over all scenes, on the detector as described, and on detectors as built.
fn costs(report: &DetectorReport) -> Table {
    let own = report.solvers.iter().map(|solver| ("on the detector as described".to_owned(), solver));
    let built = report.as_built.iter().flat_map(|known| {
        let title = format!("{} detectors as built, {}", known.detectors, known.known.name());
        known.solvers.iter().map(move |solver| (title.clone(), solver))
    });
    type Row<'a> = (String, &'a SolverReport);
    let of =
        |group: Group, value: fn(&Summary) -> Option<f64>| move |(_, solver): &Row| solver.group(group).and_then(value);
    let all = |value: fn(&Summary) -> f64| move |(_, solver): &Row| value(&solver.all);
    let note = format!(
        "one, several: mean error with contacts missed and invented; count: frames of several with none of either; conductance: relative error of one \
         contact's; correlation, Dice: images of {}. --json has every figure of every scene.",
        names(Group::Shapes)
    );
    Table::of("", own.chain(built))
        .group("detectors", |(group, _)| group.clone())
        .column("solver", TEXT, |(_, solver)| label(solver))
        .column("median", US, all(|all| all.time_us.median))
        .column("p99", US, all(|all| all.time_us.p99))
        .detail("max", US, all(|all| all.time_us.max))
        .column("set-up", MILLISECONDS, |(_, solver)| solver.set_up_ms)
        .detail("kept", MEGABYTES, |(_, solver)| solver.memory.map(|memory| memory.kept_bytes as f64))
        .column("at most", MEGABYTES, |(_, solver)| solver.memory.map(|memory| memory.peak_bytes as f64))
        .column("one", MM.digits(2), of(Group::One, |one| one.error_m))
        .column("several", MM.digits(2), of(Group::Several, |several| several.error_m))
        .column("count", PERCENT, of(Group::Several, |several| several.count_right))
        .column("missed", TWO, |(_, solver)| solver.all.missed)
        .column("invented", TWO, |(_, solver)| solver.all.invented)
        .column("conduct- ance", TWO, of(Group::One, |one| one.conductance_error))
        .column("corre- lation", TWO, of(Group::Shapes, |shapes| shapes.correlation))
        .column("Dice", TWO, of(Group::Shapes, |shapes| shapes.dice))
        .detail("misfit", PERCENT, all(|all| all.misfit))
        .detail("saturated", PERCENT, all(|all| all.saturated))
        .detail("unfinished", PERCENT, all(|all| all.unfinished))
        .detail("excluded", PERCENT, all(|all| all.excluded))
        .detail("refused", PERCENT, all(|all| all.failed))
        .note(note)
        .into()
}

fn figures(report: &DetectorReport) -> Table {
    let rows = SceneKind::ALL
        .into_iter()
        .flat_map(|kind| report.solvers.iter().filter_map(move |solver| Some((kind, solver, solver.scene(kind)?))));
    let of = |value: fn(&Summary) -> Option<f64>| {
        move |(_, _, summary): &(SceneKind, &SolverReport, &Summary)| Value::from(value(summary))
    };
    let mm = MM.digits(2);
    Table::of("", rows)
        .group("scene", |(kind, ..)| kind.name())
        .column("solver", TEXT, |(_, solver, _)| label(solver))
        .column("time", US, of(|s| Some(s.time_us.median)))
        .column("error", mm, of(|s| s.error_m))
        .column("position", mm, of(|s| s.position_error_m))
        .column("missed", TWO, of(|s| s.missed))
        .column("invented", TWO, of(|s| s.invented))
        .column("conductance error", TWO, of(|s| s.conductance_error))
        .column("correlation", TWO, of(|s| s.correlation))
        .column("Dice", TWO, of(|s| s.dice))
        .column("IoU", TWO, of(|s| s.iou))
        .column("SR", TWO, of(|s| s.spatial_resolution))
        .column("PA", TWO, of(|s| s.position_accuracy))
        .column("AR", TWO, of(|s| s.amplitude_response))
        .column("PE", mm, of(|s| s.greit_position_error_m))
        .column("RES", TWO, of(|s| s.resolution))
        .column("SD", TWO, of(|s| s.shape_deformation))
        .column("RNG", TWO, of(|s| s.ringing))
        .note(
            "SR, PA: the paper's spatial resolution and position accuracy. AR, PE, RES, SD, RNG: GREIT's amplitude response, position error towards \
             the middle, resolution, shape deformation, ringing. Of one contact's image.",
        )
        .data()
        .into()
}
