//! The report as a table.

use super::{Group, Report, SceneKind, SolverReport};

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
        lines.extend(detector.solvers.iter().map(line));
        lines.extend(detector.unavailable.iter().map(|why| format!("not tried: {why}")));
        for built in &detector.as_built {
            lines.push(format!("{} detectors as built, {}:", built.detectors, built.known.name()));
            lines.extend(built.solvers.iter().map(line));
        }
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

fn line(solver: &SolverReport) -> String {
    let of = |group| solver.group(group);
    let error_mm = |group| number(of(group).and_then(|summary| Some(summary.error_m? * 1e3)), 2);
    let (one, shapes) = (of(Group::One), of(Group::Shapes));
    let memory = solver.memory.map(|memory| memory.peak_bytes as f64 / 1e6);
    format!(
        "{:<32} {:>9.1} {:>9.1} {:>9.2} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9} {:>6}",
        label(solver),
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
