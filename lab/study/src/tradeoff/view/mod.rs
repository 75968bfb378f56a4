//! What the report shows.

mod model_size;
mod precision;
mod tables;

use super::{AsBuiltReport, DetectorReport, Group, Report, SceneKind, SolverReport};
use crate::view::{Chart, Format, Mark, PLAIN, Series, View};

const TWO: Format = PLAIN.digits(2);

/// Charts of time against error, and every figure of every scene.
pub fn view(report: &Report) -> View {
    let lead = "Each mark is a solver: further **left is faster**, further **down is more accurate**. Marks are medians over frames, and bars reach from the \
                10th to the 90th percentile. The missing slice of a mark is the share of **wrong answers**. The dashed line joins the solvers that no other \
                beats in both; what is behind it is paler. Small dots are the same solver with another value of its main parameter.";
    let mut view = View::new("Time against error", lead);
    view.method = format!(
        "Error: mean distance of contacts found from those that are there, where one missed or invented (none within the mean distance of \
         electrodes) counts that distance: OSPA of order 1. An answer is wrong with a contact missed, invented or off by more than 15 % of that distance, if it is \
         of another kind than what touches, or was refused; an image, if it explains less than half of the truth's variance. The dotted line across is the median of normal errors with the covariance of the Cramer-Rao \
         bound, over the same frames: the converter's noise alone, the number of contacts known, radii known to a factor of two; for frames that follow, \
         from all frames until then. Correlation: of the image with the true conductance, both smoothed by a \
         thirtieth of the shorter side; of a solver without an image, its contacts are drawn as one. Readings come from a finer model than any that is \
         inverted, with the converter's noise and steps. {} places of each kind of scene, {} frames at each, which solvers read one after the other; \
         the first is a cold start. Seed {}. Times are of the processor time of one thread. Memory is what is allocated beyond the model, counted by the \
         allocator.",
        report.places, report.frames, report.seed
    );
    let view = report.detectors.iter().fold(view, |view, detector| of_detector(view, detector, report.as_built));
    view.without(&report.missing)
}

fn of_detector(view: View, report: &DetectorReport, as_built: Option<u64>) -> View {
    let truth = as_built.map_or_else(String::new, |seed| format!(", as built with seed {seed}"));
    let [width_mm, height_mm] = report.size_m.map(|side_m| side_m * 1e3);
    let [exact, built] = precision::figures(report, as_built_text(&report.as_built));
    let view = view
        .heading(format!("{}, {width_mm:.0} x {height_mm:.0} mm{truth}", report.detector))
        .text(format!(
            "Inverted on the {} model, made in {:.0} ms. A contact missed or invented counts {:.1} mm.",
            report.model,
            report.model_ms,
            report.reach_m * 1e3
        ))
        .with(exact)
        .text(nothing(report));
    let view = if report.as_built.is_empty() { view } else { view.with(built) };
    let view = model_size::figures(report).into_iter().fold(view, View::with);
    view.with(tables::costs(report))
        .figures("Scene by scene, all frames, mean error", scene_by_scene(report))
        .folded("All figures", [tables::figures(report)])
}

/// A small chart of each kind of scene.
fn scene_by_scene(report: &DetectorReport) -> impl Iterator<Item = Chart> {
    let of = |kind: SceneKind| {
        let group = kind.group();
        let chart = precision::chart(group, kind.name(), precision::of_what(group), means(report, kind));
        (group, chart.sized([330.0, 270.0]))
    };
    let mut all: Vec<(Group, Chart)> =
        SceneKind::ALL.into_iter().filter(|kind| kind.group() != Group::Nothing).map(of).collect();
    precision::same_axes(&mut all.iter_mut().collect::<Vec<_>>());
    all.into_iter().map(|(_, chart)| chart)
}

/// A series for each solver, from its means over a kind of scene; the first mark is that of its defaults.
fn means(report: &DetectorReport, kind: SceneKind) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for solver in &report.solvers {
        let Some(summary) = solver.scene(kind) else { continue };
        let error = match kind.group() {
            Group::Shapes => summary.correlation.map(|correlation| 1.0 - correlation),
            _ => summary.error_m,
        };
        let Some(error) = error else { continue };
        let mark =
            Mark { note: precision::note(solver, summary), ..Mark::from([summary.time_us.median * 1e-6, error]) };
        match all.iter_mut().find(|series| series.name == solver.solver) {
            Some(series) => series.marks.push(mark),
            None => all.push(Series::dots(solver.solver.as_str(), solver.family.class(), [mark])),
        }
    }
    all
}

fn as_built_text(reports: &[AsBuiltReport]) -> String {
    let dots = match reports.len() {
        1 => "Solvers know the description only",
        _ => {
            "Small marks: solvers know the description only; large ones, joined to them: what the calibration has found of each"
        }
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
