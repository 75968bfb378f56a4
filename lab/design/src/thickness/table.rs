//! The study as text and as a table for other programs.

use std::fmt::Write;

use super::super::claim;
use super::super::text::{cells, number};
use super::{Report, SolverRow};

/// What is said of a solver that fails nowhere.
const NOWHERE: &str = "-";

pub(super) fn table(report: &Report) -> String {
    let mut text = format!("Thickness, in {:.1} s\n\n{}", report.course.seconds, claim::table(&report.course.claims));
    text += "\nthickness  correlation  largest, V   of shell  mean absolute error\n";
    for row in &report.rows {
        _ = writeln!(
            text,
            "{:6.0} mm  {:11.4}  {:10.3}  {:9.3}  {:19.4}",
            row.thickness_m * 1e3,
            row.correlation,
            row.largest_v,
            row.shell_largest_v,
            row.mean_absolute_error
        );
    }
    _ = write!(
        text,
        "\nmean error, mm, of solvers that take the detector for a shell / that invert the slab\n{:16}",
        ""
    );
    report.rows.iter().for_each(|row| _ = write!(text, "{:>9.0} mm    ", row.thickness_m * 1e3));
    text += "fails from\n";
    for (name, errors, [shell, slab]) in by_solver(report) {
        let pair =
            |row: &SolverRow| format!("{} / {}", number(Some(row.on_shell_m), 1e3), number(Some(row.on_slab_m), 1e3));
        let errors: String = errors.iter().map(|row| format!("{:>14}  ", pair(row))).collect();
        _ = writeln!(text, "{name:15}{errors}  {shell} / {slab}");
    }
    text
}

/// Each solver with its rows, and from which thickness on it fails, on the shell and on the slab.
pub(super) fn by_solver(report: &Report) -> Vec<(&'static str, Vec<SolverRow>, [String; 2])> {
    let names = report.rows.first().map(|row| row.solvers.iter().map(|row| row.solver).collect::<Vec<_>>());
    let of = |name: &'static str| {
        let rows = report.rows.iter().flat_map(|row| row.solvers.iter().find(|row| row.solver == name).cloned());
        let errors: [fn(&SolverRow) -> f64; 2] = [|row| row.on_shell_m, |row| row.on_slab_m];
        let fails = errors.map(|error_m| {
            let at_m = report.fails_at_m(name, error_m);
            at_m.map_or(NOWHERE.to_owned(), |at_m| format!("{:.0} mm", at_m * 1e3))
        });
        (name, rows.collect(), fails)
    };
    names.unwrap_or_default().into_iter().map(of).collect()
}

pub(super) fn csv(report: &Report) -> String {
    let solvers = by_solver(report);
    let names = solvers.iter().flat_map(|(name, ..)| [format!(",{name}_on_shell_m"), format!(",{name}_on_slab_m")]);
    let mut text = "thickness_m,correlation,largest_v,shell_largest_v,mean_absolute_error".to_owned();
    text.extend(names);
    text.push('\n');
    for row in &report.rows {
        let models = [row.thickness_m, row.correlation, row.largest_v, row.shell_largest_v, row.mean_absolute_error];
        let errors = row.solvers.iter().flat_map(|row| [row.on_shell_m, row.on_slab_m]);
        let figures: Vec<_> = models.into_iter().chain(errors).map(Some).collect();
        text += &(cells(&figures) + "\n");
    }
    text
}
