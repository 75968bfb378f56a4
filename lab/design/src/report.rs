//! What every study gives: text, a table for other programs, and parts of a page.

use std::time::Instant;

use tactomo_study::Machine;
use tactomo_study::page::{escaped, html, machine};

use super::Claim;

/// What a study is called.
#[derive(Clone, Copy, Debug)]
pub struct Heading {
    /// Name on the command line.
    pub name: &'static str,
    /// Heading of its page.
    pub title: &'static str,
    /// What it is about, in a sentence or two.
    pub lead_in: &'static str,
}

/// What was concluded, and how a study went.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Course {
    /// Whether each claim of the paper holds that the study judges.
    pub claims: Vec<Claim>,
    /// Whether it was ended before all was done.
    pub is_stopped: bool,
    /// What it took (s).
    pub seconds: f64,
}

impl Course {
    /// Of a study that began at a time.
    pub(crate) fn since(start: Instant, is_stopped: bool, claims: Vec<Claim>) -> Self {
        Self { claims, is_stopped, seconds: start.elapsed().as_secs_f64() }
    }
}

/// What a study found.
pub trait Report {
    /// What it is called.
    fn heading(&self) -> Heading;

    /// What was concluded, and how it went.
    fn course(&self) -> &Course;

    /// For a terminal.
    fn table(&self) -> String;

    /// A row for each thing that was computed, with heads; empty where a figure is open.
    fn csv(&self) -> String;

    /// What its page shows below the claims, as HTML.
    fn parts(&self) -> Vec<String>;
}

/// A self-contained HTML page of one study, or of several with a list of them and their claims at the top.
pub fn page(reports: &[&dyn Report], command: &str) -> String {
    let (title, mut parts) = match reports {
        [report] => (report.heading().title, Vec::new()),
        _ => ("Which detector", contents(reports)),
    };
    for report in reports {
        let (heading, course) = (report.heading(), report.course());
        let rank = if reports.len() > 1 { "h2" } else { "h1" };
        parts.push(format!("<{rank} id=\"{}\">{}</{rank}>", heading.name, escaped(heading.title)));
        parts.push(format!("<p class=\"lead-in\">{}</p>", escaped(heading.lead_in)));
        if course.is_stopped {
            parts.push(
                "<p><b>Stopped before the end</b>: what is shown and concluded is of what was done.</p>".to_owned(),
            );
        }
        if reports.len() == 1 && !course.claims.is_empty() {
            parts.push(super::claim::html(&course.claims));
        }
        parts.extend(report.parts());
    }
    let seconds: f64 = reports.iter().map(|report| report.course().seconds).sum();
    let machine = machine(&Machine::this(), command);
    parts.push(format!("<h2>How it was computed</h2>\n<p class=\"note\">In {seconds:.1} s.</p>{machine}"));
    html(&format!("Tactomo: {}", title.to_lowercase()), &parts)
}

/// The studies of a page, with what each says of the paper.
fn contents(reports: &[&dyn Report]) -> Vec<String> {
    let of = |report: &&dyn Report| {
        let (heading, claims) = (report.heading(), &report.course().claims);
        let link = format!("<h3><a href=\"#{}\">{}</a></h3>", heading.name, escaped(heading.title));
        if claims.is_empty() { link } else { link + &super::claim::html(claims) }
    };
    std::iter::once("<h1>Which detector</h1>".to_owned()).chain(reports.iter().map(of)).collect()
}
