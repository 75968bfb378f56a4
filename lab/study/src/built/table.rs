//! The report as a table.

use super::{Curve, OverFrames, Point, Report, Row};

/// Lines for a terminal: a row for each solver and number of contacts.
pub fn table(report: &Report) -> String {
    let head = format!(
        "{:<20} {:<12} {:>8} {:>6} {:>8} {:>7} {:>6} {:>7} {:>10} {:>9} {:>9} {:>8} {:>8}",
        "detector",
        "solver",
        "contacts",
        "scenes",
        "error mm",
        "p95 mm",
        "count",
        "misfit",
        "xy 1s, 2s",
        "C 1s, 2s",
        "claims mm",
        "ms",
        "p95 ms"
    );
    let about = "count: as many found as touch; xy, C: coordinates and logarithms of conductances within 1 and 2 claimed \
         standard errors; shares in per cent.";
    let mut lines = vec![format!("{} detectors", report.detectors.len()), head];
    lines.extend(report.rows.iter().map(line));
    lines.push(about.to_owned());
    if !report.refused.is_empty() {
        let (refused, all) = (report.refused.len(), report.detectors.len());
        lines.push(format!(
            "{refused} of {all} calibrations were refused; there solvers know the description:\n{}",
            report.refused.join("\n")
        ));
    }
    lines.join("\n")
}

/// Lines for a terminal: a row for each solver and noise, a column for each number of presses.
pub fn frames_table(report: &OverFrames) -> String {
    let counts: String = report.frames.iter().map(|frames| format!(" {frames:>15}")).collect();
    let mut lines = vec![
        format!("{} detectors as built, {} single presses on each", report.detectors, report.presses),
        format!("{:<12} {:>9} {counts}", "solver", "noise LSB"),
    ];
    let cell = |point: &Point| {
        let figures = &point.figures;
        let mm = figures.error_m.map_or_else(|| "-".to_owned(), |metres| format!("{:.2}", 1e3 * metres));
        let refused = if point.refused > 0 { format!("({})", point.refused) } else { String::new() };
        format!(" {refused:>4}{mm:>7}{:>4.0}", 100.0 * figures.count_right)
    };
    let row = |curve: &Curve| {
        let cells: String = curve.points.iter().map(cell).collect();
        format!("{:<12} {:>9} {cells}", curve.solver, curve.noise_lsb)
    };
    lines.extend(report.curves.iter().map(row));
    lines.push(
        "Columns: rubbed presses, 0 for none; in each the mean error of single presses, mm, and the share of right counts, per cent.\n\
         In brackets: calibrations that were refused; there solvers know the description."
            .to_owned(),
    );
    lines.join("\n")
}

fn line(row: &Row) -> String {
    let figures = &row.figures;
    let mm = |metres: Option<f64>| metres.map_or_else(|| "-".to_owned(), |metres| format!("{:.2}", 1e3 * metres));
    let percent = |share: f64| format!("{:.0}", 100.0 * share);
    let within = |shares: Option<[f64; 2]>| {
        shares.map_or_else(|| "-".to_owned(), |[one, two]| format!("{} {}", percent(one), percent(two)))
    };
    format!(
        "{:<20} {:<12} {:>8} {:>6} {:>8} {:>7} {:>6} {:>7} {:>10} {:>9} {:>9} {:>8.1} {:>8.1}",
        row.detector.as_deref().unwrap_or("all"),
        row.solver,
        row.contacts,
        figures.scenes,
        mm(figures.error_m),
        mm(figures.p95_m),
        percent(figures.count_right),
        percent(figures.misfit),
        within(figures.within),
        within(figures.within_conductance),
        mm(figures.claimed_m),
        1e3 * figures.time_s[0],
        1e3 * figures.time_s[1]
    )
}
