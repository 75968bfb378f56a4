//! What every study gives: text, a table for other programs, and parts of a page.

use tactomo_study::Machine;
use tactomo_study::page::{escaped, html, machine};

use super::Claim;

/// What a study found.
pub trait Report {
    /// Name on the command line.
    fn name(&self) -> &'static str;

    /// Heading of its page.
    fn title(&self) -> &'static str;

    /// What it is about, in a sentence or two.
    fn lead_in(&self) -> &'static str;

    /// Whether it was ended before all was done.
    fn is_stopped(&self) -> bool;

    /// What it took (s).
    fn seconds(&self) -> f64;

    /// What of the paper it judges.
    fn claims(&self) -> &[Claim];

    /// For a terminal.
    fn table(&self) -> String;

    /// A row for each thing that was computed, with heads; empty where a figure is open.
    fn csv(&self) -> String;

    /// What its page shows below the claims, as HTML.
    fn parts(&self) -> Vec<String>;
}

/// A self-contained HTML page of one study, or of several with a list of them at the top.
pub fn page(reports: &[&dyn Report], command: &str) -> String {
    let title = match reports {
        [report] => report.title(),
        _ => "Which detector",
    };
    let mut parts = Vec::new();
    if let [_, _, ..] = reports {
        parts.push(format!("<h1>{title}</h1>"));
        let verdicts = |report: &&dyn Report| {
            let link = format!("<h3><a href=\"#{}\">{}</a></h3>", report.name(), escaped(report.title()));
            if report.claims().is_empty() { link } else { link + &super::claim::html(report.claims()) }
        };
        parts.extend(reports.iter().map(verdicts));
    }
    for report in reports {
        let rank = if reports.len() > 1 { "h2" } else { "h1" };
        parts.push(format!("<{rank} id=\"{}\">{}</{rank}>", report.name(), escaped(report.title())));
        parts.push(format!("<p class=\"lead-in\">{}</p>", escaped(report.lead_in())));
        if report.is_stopped() {
            parts.push(
                "<p><b>Stopped before the end</b>: what is shown and concluded is of what was done.</p>".to_owned(),
            );
        }
        if reports.len() == 1 && !report.claims().is_empty() {
            parts.push(super::claim::html(report.claims()));
        }
        parts.extend(report.parts());
    }
    let seconds: f64 = reports.iter().map(|report| report.seconds()).sum();
    parts.push(format!(
        "<h2>How it was computed</h2>\n<p class=\"note\">In {seconds:.1} s.</p>{}",
        machine(&Machine::this(), command)
    ));
    html(&format!("Tactomo: {}", title.to_lowercase()), &parts)
}
