//! The report as a table.

use super::report::ErrorCurve;
use super::{ErrorRange, Report, SolverRow};

/// Errors up to which the points are counted at the end (m).
const WITHIN_M: [f64; 4] = [2e-4, 1e-3, 2e-3, 5e-3];

/// Lines for a terminal: for each sweep, each solver's errors, where it breaks, and how.
pub fn table(report: &Report) -> String {
    let mut lines = vec![
        format!("{}{}: where solvers break, and whether they flag it themselves", report.detector, report.whose()),
        format!("{:<27}error, mm: harmless, median, largest", ""),
    ];
    for sweep in &report.sweeps {
        lines.push(format!("\n{}", sweep.title));
        for (index, solver) in sweep.solvers.iter().enumerate() {
            lines.push(row(&solver.solver, solver));
            lines.extend(sweep.calibrated.get(index).map(|calibrated| row("  calibrated", calibrated)));
        }
    }
    let limits = WITHIN_M.map(|limit_m| format!("{:>6}", 1e3 * limit_m)).concat();
    lines.push(format!("\n{:<16} {limits}", "Error up to, mm"));
    lines.extend(report.errors.iter().map(within));
    lines.push(String::new());
    lines.push(
        "A solver holds as long as its error is below 15 % of the mean distance of electrodes or twice its own harmless one: see what that is. \
         The last lines: at how many per cent of all points the error is at most so large."
            .to_owned(),
    );
    lines.push(
        "Light and firm contacts are 0.03 and 0.3 sheet conductances. --json and --out have every point.".to_owned(),
    );
    lines.join("\n")
}

fn row(name: &str, row: &SolverRow) -> String {
    let verdict = match &row.breaks {
        None => "holds".to_owned(),
        Some(found) => format!(
            "breaks at {:<10} {:<11} {:<12} holds at {:.0} % of the points",
            found.at,
            found.how.name(),
            if found.is_reported { "with a flag" } else { "silently" },
            100.0 * found.survives
        ),
    };
    let ErrorRange { harmless_m, median_m, largest_m } = row.errors;
    let errors = [harmless_m, median_m, largest_m].map(|error_m| match error_m {
        Some(error_m) => format!("{:>7}", millimetres(error_m)),
        None => format!("{:>7}", "-"),
    });
    format!("  {name:<16} {}   {verdict}", errors.concat())
}

fn within(curve: &ErrorCurve) -> String {
    let shares =
        WITHIN_M.map(|limit_m| curve.within(limit_m).map_or(String::new(), |share| format!("{:>6.0}", 100.0 * share)));
    format!("{:<16} {}", curve.solver, shares.concat())
}

/// A distance (m) in millimetres, without the unit.
pub(super) fn millimetres(metres: f64) -> String {
    if metres < 9.95e-4 { format!("{:.2}", metres * 1e3) } else { format!("{:.1}", metres * 1e3) }
}
