//! What the report shows.

use super::{Report, Row};
use crate::view::{Format, MM, PERCENT, PLAIN, TEXT, Table, View};

const MILLISECONDS: Format = Format { factor: 1e3, ..Format::new("ms", "s").digits(1) };

/// A row for each solver and number of contacts.
pub fn view(report: &Report) -> View {
    let mm = MM.digits(2);
    let table = Table::of("", &report.rows)
        .group("detector", |row: &&Row| row.detector.clone().unwrap_or_else(|| "all detectors".to_owned()))
        .column("solver", TEXT, |row| row.solver)
        .column("contacts", PLAIN.digits(0), |row| row.contacts)
        .column("scenes", PLAIN.digits(0), |row| row.figures.scenes)
        .column("error", mm, |row| row.figures.error_m)
        .column("p95", mm, |row| row.figures.p95_m)
        .column("count", PERCENT, |row| row.figures.count_right)
        .column("misfit", PERCENT, |row| row.figures.misfit)
        .column("xy, 1 s", PERCENT, |row| row.figures.within.map(|[one, _]| one))
        .column("2 s", PERCENT, |row| row.figures.within.map(|[_, two]| two))
        .column("C, 1 s", PERCENT, |row| row.figures.within_conductance.map(|[one, _]| one))
        .column("2 s", PERCENT, |row| row.figures.within_conductance.map(|[_, two]| two))
        .column("claims", mm, |row| row.figures.claimed_m)
        .column("time", MILLISECONDS, |row| row.figures.time_s[0])
        .column("p95 of it", MILLISECONDS, |row| row.figures.time_s[1])
        .note(
            "count: as many found as touch; xy, C: coordinates and logarithms of conductances within 1 and 2 claimed standard errors",
        )
        .data();
    let (refused, all) = (report.refused.len(), report.detectors.len());
    let view = View::new(format!("{all} detectors as built"), "").with(table);
    match refused {
        0 => view,
        _ => report.refused.iter().fold(
            view.text(format!("{refused} of {all} calibrations were refused; there solvers know the description:")),
            |view, why| view.text(why.as_str()),
        ),
    }
}
