//! The report as a table.

use super::{AsBuiltReport, Group, Report, SceneKind, SolverReport};

/// Lines for a terminal: a solver each.
pub fn table(report: &Report) -> String {
    let mut lines = Vec::new();
    for detector in &report.detectors {
        let truth = report.as_built.map_or_else(String::new, |seed| format!(" as built with seed {seed}"));
        lines.push(format!(
            "{}{truth}: {} model, {:.0} ms; a contact missed or invented counts {:.0} mm",
            detector.detector,
            detector.model,
            detector.model_ms,
            detector.reach_m * 1e3
        ));
        lines.push(format!(
            "{:<32} {:>9} {:>9} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9} {:>6}",
            "solver",
            "median us",
            "p99 us",
            "set-up ms",
            "MB",
            "one mm",
            "several",
            "count %",
            "missed",
            "invented",
            "conduct.",
            "correl.",
            "Dice"
        ));
        lines.extend(detector.solvers.iter().map(|solver| line(&label(solver), solver)));
        lines.extend(detector.unavailable.iter().map(|why| format!("not tried: {why}")));
        lines.extend(as_built(&detector.as_built));
        lines.push(String::new());
    }
    lines.push("one, several: mean error with contacts missed and invented; count: frames of several with none of either; conduct.: relative error of one contact's; correl., Dice: images of".to_owned());
    lines.push(format!("{}. --json has every figure of every scene.", names(Group::Shapes)));
    lines.join("\n")
}

/// The kinds of a group, for people.
pub(super) fn names(group: Group) -> String {
    group.kinds().map(SceneKind::name).collect::<Vec<_>>().join(", ")
}

/// Name of a solver with its parameter.
pub(super) fn label(solver: &SolverReport) -> String {
    match &solver.parameter {
        Some(parameter) => format!("{} {parameter}", solver.solver),
        None => solver.solver.clone(),
    }
}

/// A number with so many digits after the point, or a dash.
pub(super) fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
}

/// Each solver on detectors as built, and below it the same after a calibration.
fn as_built(reports: &[AsBuiltReport]) -> Vec<String> {
    let Some((described, calibrated)) = reports.split_first() else { return Vec::new() };
    let mut lines = vec![as_built_title(reports) + ":"];
    for solver in &described.solvers {
        lines.push(line(&label(solver), solver));
        let same = calibrated.iter().filter_map(|report| report.of(&solver.solver));
        lines.extend(same.map(|solver| line("  calibrated", solver)));
    }
    lines
}

/// What is known of detectors as built, for people.
pub(super) fn as_built_title(reports: &[AsBuiltReport]) -> String {
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

fn line(name: &str, solver: &SolverReport) -> String {
    let of = |group| solver.group(group);
    let error_mm = |group| number(of(group).and_then(|summary| Some(summary.error_m? * 1e3)), 2);
    let (one, shapes) = (of(Group::One), of(Group::Shapes));
    let memory = solver.memory.map(|memory| memory.peak_bytes as f64 / 1e6);
    format!(
        "{:<32} {:>9.1} {:>9.1} {:>9.2} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9} {:>6}",
        name,
        solver.all.time_us.median,
        solver.all.time_us.p99,
        solver.set_up_ms,
        number(memory, 2),
        error_mm(Group::One),
        error_mm(Group::Several),
        number(of(Group::Several).and_then(|summary| Some(100.0 * summary.count_right?)), 0),
        number(solver.all.missed, 2),
        number(solver.all.invented, 2),
        number(one.and_then(|summary| summary.conductance_error), 2),
        number(shapes.and_then(|summary| summary.correlation), 2),
        number(shapes.and_then(|summary| summary.dice), 2),
    )
}
