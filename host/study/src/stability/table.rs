//! The report as a table.

use super::Report;

/// Lines for a terminal: for each sweep, where each solver breaks, and how.
pub fn table(report: &Report) -> String {
    let mut lines = vec![format!("{}: where solvers break, and whether they say so themselves", report.detector)];
    for sweep in &report.sweeps {
        lines.push(format!("\n{}", sweep.title));
        for row in &sweep.solvers {
            let told = match &row.breaks {
                None => "holds".to_owned(),
                Some(found) => format!(
                    "breaks at {:<10} {:<10} {:<14} holds at {:.0} % of the points",
                    found.at,
                    found.how.name(),
                    if found.is_reported { "and says so" } else { "and is silent" },
                    100.0 * found.survives
                ),
            };
            lines.push(format!("  {:<16} {told}", row.solver));
        }
    }
    lines.push(String::new());
    lines.push(
        "Light and firm contacts are 0.03 and 0.3 sheet conductances. --json and --out have every point.".to_owned(),
    );
    lines.join("\n")
}
