//! The report as a page.

use super::table::{as_built_title, label, names, number};
use super::{AsBuiltReport, DetectorReport, Group, Report, SceneKind, SolverReport};
use crate::page::{Axis, Chart, Mark, Series, Unit, escaped, folded, html, machine, table};
use crate::score::Summary;
use tactomo_touch::solve::Family;

/// Errors below this show there (m).
const FLOOR_M: f64 = 1e-5;
/// Panels up to this width have no room for more than their marks (px).
const SMALL_PX: f64 = 330.0;
/// Of 1 less the correlation, what is below this shows there.
const FLOOR_CORRELATION: f64 = 0.01;

/// A self-contained HTML page.
pub fn page(report: &Report) -> String {
    let mut parts = vec![
        "<h1>Time against error</h1>".to_owned(),
        "<p class=\"lead-in\">Each dot is a solver: further <b>left is faster</b>, further <b>down is more accurate</b>. \
         The dashed line joins those that no other beats in both; what is behind it is paler. Small dots are the same solver with \
         another value of its main parameter.</p>"
            .to_owned(),
        legend(report),
    ];
    parts.extend(report.detectors.iter().map(|detector| of_detector(detector, report.as_built)));
    parts.push(footer(report));
    html("Tactomo: time against error", &parts)
}

/// The charts of the first detector alone, for a document.
pub fn picture(report: &Report) -> String {
    let charts = report.detectors.first().and_then(|detector| group_charts(detector).into_iter().next());
    html("Tactomo: time against error", &[legend(report), charts.unwrap_or_default()])
}

fn legend(report: &Report) -> String {
    let solvers = || report.detectors.iter().flat_map(|detector| &detector.solvers);
    let mut items = String::new();
    for family in Family::ALL {
        if solvers().any(|solver| solver.family == family) {
            items += &format!("<li class=\"{}\">{}</li>", family.class(), family.title());
        }
    }
    format!("<ul class=\"legend\">{items}</ul>")
}

fn of_detector(report: &DetectorReport, as_built: Option<u64>) -> String {
    let truth = as_built.map_or_else(String::new, |seed| format!(", as built with seed {seed}"));
    let mut charts = group_charts(report).into_iter();
    let on_paper = charts.next().unwrap_or_default();
    let [width_mm, height_mm] = report.size_m.map(|side_m| side_m * 1e3);
    [
        format!(
            "<h2>{}, {width_mm:.0} x {height_mm:.0} mm{truth}</h2>\n<p class=\"quiet\">Inverted on the {} model, made in {:.0} ms. \
             A contact missed or invented counts {:.1} mm.</p>",
            escaped(&report.detector),
            report.model,
            report.model_ms,
            report.reach_m * 1e3
        ),
        on_paper,
        nothing(report),
        charts.map(|charts| as_built_row(&report.as_built, &charts)).collect(),
        format!("<h3>Scene by scene</h3>\n{}", scene_charts(report)),
        folded("All figures", &(costs(report) + &figures(report))),
    ]
    .join("\n")
}

/// A row of charts of the detector on paper, and one of detectors as built, on the same axes.
fn group_charts(report: &DetectorReport) -> Vec<String> {
    let groups =
        [(Group::One, "One contact"), (Group::Several, "Two or three contacts"), (Group::Shapes, "Hands and shapes")];
    let panel = |(group, title): (Group, &'static str), series: Vec<Series>| Panel {
        title,
        subtitle: format!("{} · {}", of_what(group), names(group)),
        group,
        size: [430.0, 380.0],
        series,
    };
    let of = |solvers, group| series(solvers, group, |solver: &SolverReport| solver.group(group));
    let mut panels: Vec<_> = groups.map(|group| panel(group, of(&report.solvers, group.0))).into();
    if !report.as_built.is_empty() {
        panels.extend(groups.map(|group| panel(group, as_built_series(&report.as_built, group.0))));
    }
    let row = |charts: &[String]| format!("<div class=\"charts\">{}</div>", charts.concat());
    drawn(&panels).chunks(groups.len()).map(row).collect()
}

/// A series for each solver: from what it reaches with the description to what it reaches calibrated, which has the label.
fn as_built_series(reports: &[AsBuiltReport], group: Group) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for report in reports {
        for mut more in series(&report.solvers, group, |solver: &SolverReport| solver.group(group)) {
            for mark in &mut more.marks {
                mark.tooltip = format!("{}: {}", report.known.name(), mark.tooltip);
            }
            match all.iter_mut().find(|series| series.name == more.name) {
                Some(series) => {
                    series.marks.extend(more.marks);
                    (series.main, series.is_joined) = (series.marks.len() - 1, true);
                }
                None => all.push(more),
            }
        }
    }
    all
}

fn as_built_row(reports: &[AsBuiltReport], charts: &str) -> String {
    let dots = match reports.len() {
        1 => "Solvers know the description only",
        _ => "Small dots: solvers know the description only; large ones: what the calibration has found of each",
    };
    format!(
        "<h3>{}</h3>\n<p class=\"quiet\">Drawn from the tolerances around the description. {dots}. One place of each kind of scene on each; \
         solvers with their defaults. Axes are those of the charts above.</p>\n{charts}",
        as_built_title(reports)
    )
}

fn scene_charts(report: &DetectorReport) -> String {
    let kinds = SceneKind::ALL.into_iter().filter(|kind| kind.group() != Group::Nothing);
    let of = kinds.map(|kind| Panel {
        title: kind.name(),
        subtitle: of_what(kind.group()).to_owned(),
        group: kind.group(),
        size: [330.0, 270.0],
        series: series(&report.solvers, kind.group(), |solver| solver.scene(kind)),
    });
    format!("<div class=\"charts small\">{}</div>", drawn(&of.collect::<Vec<_>>()).concat())
}

/// A chart whose axes are still to be found.
struct Panel {
    title: &'static str,
    subtitle: String,
    group: Group,
    size: [f64; 2],
    series: Vec<Series>,
}

/// All panels, with one axis of time for all and one of error for those of a group: so they can be compared.
fn drawn(panels: &[Panel]) -> Vec<String> {
    let marks = |group: Option<Group>| {
        let wanted = move |panel: &&Panel| group.is_none_or(|group| panel.group == group);
        panels.iter().filter(wanted).flat_map(|panel| &panel.series).flat_map(|series| &series.marks)
    };
    let chart = |panel: &Panel| {
        let errors = marks(Some(panel.group)).map(|mark| mark.y);
        let chart = Chart {
            title: panel.title.to_owned(),
            subtitle: panel.subtitle.clone(),
            x: Axis::over("time a frame", Unit::Seconds, marks(None).map(|mark| mark.x), 1e-7, 1.5),
            y: match panel.group {
                Group::Shapes => Axis::over("", Unit::Plain, errors, FLOOR_CORRELATION, 0.6),
                _ => Axis::over("", Unit::Metres, errors, FLOOR_M, 1.0),
            },
            series: panel.series.clone(),
            has_front: true,
            guide: (panel.size[0] > SMALL_PX).then_some((1e-3, "1000 frames/s")),
            level: None,
            size: panel.size,
        };
        chart.svg() + "\n"
    };
    panels.iter().map(chart).collect()
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
        let mark = Mark { x: summary.time_us.median * 1e-6, y: error, tooltip: tooltip(solver, summary) };
        match all.iter_mut().find(|series| series.name == solver.solver) {
            Some(series) => series.marks.push(mark),
            None => all.push(Series {
                name: solver.solver.clone(),
                class: solver.family.class(),
                marks: vec![mark],
                main: 0,
                is_joined: false,
            }),
        }
    }
    all
}

fn tooltip(solver: &SolverReport, summary: &Summary) -> String {
    let mm = |value: Option<f64>| number(value.map(|metres| metres * 1e3), 2);
    format!(
        "{}: {} a frame; error {} mm (position {} mm, missed {}, invented {}); correlation {}, Dice {}",
        label(solver),
        Unit::Seconds.text(summary.time_us.median * 1e-6),
        mm(summary.error_m),
        mm(summary.position_error_m),
        number(summary.missed, 2),
        number(summary.invented, 2),
        number(summary.correlation, 2),
        number(summary.dice, 2)
    )
}

/// Which solvers find contacts where nothing touches.
fn nothing(report: &DetectorReport) -> String {
    let rate = |solver: &SolverReport| solver.scene(SceneKind::None)?.invented;
    let inventors: Vec<_> = report
        .solvers
        .iter()
        .filter_map(|solver| Some((label(solver), rate(solver)?)))
        .filter(|(_, rate)| *rate > 0.0)
        .map(|(name, rate)| format!("{} ({rate:.2} a frame)", escaped(&name)))
        .collect();
    let verdict = match inventors.is_empty() {
        true => "no solver finds a contact".to_owned(),
        false => format!("contacts are invented by {}", inventors.join(", ")),
    };
    let untried: String = report.unavailable.iter().map(|why| format!(" Not tried: {}.", escaped(why))).collect();
    format!("<p><b>Where nothing touches</b>, {verdict}.{untried}</p>")
}

fn costs(report: &DetectorReport) -> String {
    let megabytes = |bytes: Option<usize>| number(bytes.map(|bytes| bytes as f64 / 1e6), 2);
    let rows: Vec<_> = report
        .solvers
        .iter()
        .map(|solver| {
            let Summary { time_us, misfit, saturated, unfinished, excluded, failed, .. } = &solver.all;
            let mut row = vec![label(solver), number(Some(solver.set_up_ms), 2)];
            row.extend([time_us.median, time_us.p99, time_us.max].map(|us| number(Some(us), 1)));
            row.push(megabytes(solver.memory.map(|memory| memory.kept_bytes)));
            row.push(megabytes(solver.memory.map(|memory| memory.peak_bytes)));
            row.extend(
                [misfit, saturated, unfinished, excluded, failed].map(|share| format!("{:.0} %", 100.0 * share)),
            );
            row
        })
        .collect();
    let heads = [
        "all scenes",
        "set-up, ms",
        "median, µs",
        "p99, µs",
        "max, µs",
        "MB kept",
        "MB at most",
        "misfit",
        "saturated",
        "unfinished",
        "excluded",
        "refused",
    ];
    table(&heads, &rows)
}

fn figures(report: &DetectorReport) -> String {
    let heads = [
        "",
        "solver",
        "µs",
        "error, mm",
        "position, mm",
        "missed",
        "invented",
        "conduct. error",
        "correlation",
        "Dice",
        "IoU",
        "SR",
        "PA",
        "AR",
        "PE, mm",
        "RES",
        "SD",
        "RNG",
    ];
    let mut rows = Vec::new();
    for kind in SceneKind::ALL {
        for (solver, s) in report.solvers.iter().filter_map(|solver| Some((solver, solver.scene(kind)?))) {
            let mm = |value: Option<f64>| number(value.map(|metres| metres * 1e3), 2);
            let mut row = vec![kind.name().to_owned(), label(solver), number(Some(s.time_us.median), 1)];
            row.extend([mm(s.error_m), mm(s.position_error_m)]);
            row.extend(
                [
                    s.missed,
                    s.invented,
                    s.conductance_error,
                    s.correlation,
                    s.dice,
                    s.iou,
                    s.spatial_resolution,
                    s.position_accuracy,
                    s.amplitude_response,
                ]
                .map(|value| number(value, 2)),
            );
            row.push(mm(s.greit_position_error_m));
            row.extend([s.resolution, s.shape_deformation, s.ringing].map(|value| number(value, 2)));
            rows.push(row);
        }
    }
    "<p class=\"note\">SR, PA: the paper's spatial resolution and position accuracy. AR, PE, RES, SD, RNG: GREIT's amplitude response, position \
     error towards the middle, resolution, shape deformation, ringing. Of one contact's image.</p>"
        .to_owned()
        + &table(&heads, &rows)
}

fn footer(report: &Report) -> String {
    let text = format!(
        "Error: mean distance of contacts found from those that are there, where one missed or invented (none within the mean distance of \
         electrodes) counts that distance: OSPA of order 1. Correlation: of the image with the true conductance, both smoothed by a \
         thirtieth of the shorter side; of a solver without an image, its contacts are drawn as one. Readings come from a finer model than any that is inverted, with \
         the converter's noise and steps. {} places of each kind of scene, {} frames at each, which solvers read one after the other; seed {}. Times are medians of the processor time of one thread. Memory is what is allocated beyond the model, counted by the allocator.",
        report.places, report.frames, report.seed
    );
    format!("<h2>How it was measured</h2>\n<p class=\"note\">{text}</p>\n{}", machine(&report.machine, &report.command))
}
