//! The report as a table.

use super::Report;

/// Lines for a terminal: for each sweep, where each solver breaks, and how.
pub fn table(report: &Report) -> String {
    let mut lines = vec![format!("{}: where solvers break, and whether they flag it themselves", report.detector)];
    for sweep in &report.sweeps {
        lines.push(format!("\n{}", sweep.title));
        for row in &sweep.solvers {
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
            lines.push(format!("  {:<16} {verdict}", row.solver));
        }
    }
    lines.push(String::new());
    lines.push(
        "Light and firm contacts are 0.03 and 0.3 sheet conductances. --json and --out have every point.".to_owned(),
    );
    lines.join("\n")
}
