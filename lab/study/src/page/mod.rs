//! Pages of a study: self-contained HTML, with charts as SVG drawn here, light or dark as the reader's system is.

mod axis;
mod chart;
pub mod colour;
mod heat;
mod label;
mod map;

pub use self::axis::{Axis, Unit};
pub use self::chart::{Chart, Mark, Series};
pub use self::heat::{Cell, Heat, Row};
pub use self::map::Map;

use super::machine::Machine;

const STYLE: &str = include_str!("style.css");

/// A page under a title, with parts of HTML.
pub fn html(title: &str, parts: &[String]) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{}</title>\n\
         <style>\n{STYLE}</style>\n<main>\n{}\n</main>\n</html>\n",
        escaped(title),
        parts.join("\n")
    )
}

/// Text with what HTML gives a meaning to made harmless.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A table: heads, then rows of cells, which are text. The first column is left-aligned.
pub fn table(heads: &[&str], rows: &[Vec<String>]) -> String {
    let cells = |tag: &str, row: &mut dyn Iterator<Item = &str>| {
        let cells: String = row.map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell))).collect();
        format!("<tr>{cells}</tr>\n")
    };
    let head = cells("th", &mut heads.iter().copied());
    let body: String = rows.iter().map(|row| cells("td", &mut row.iter().map(String::as_str))).collect();
    format!("<div class=\"wide\"><table>\n<thead>{head}</thead><tbody>\n{body}</tbody></table></div>")
}

/// What is folded away under a line until it is asked for.
pub fn folded(summary: &str, content: &str) -> String {
    format!("<details><summary>{}</summary>\n{content}\n</details>", escaped(summary))
}

/// Where and how a study ran, in a few lines.
pub fn machine(machine: &Machine, command: &str) -> String {
    let built = if machine.optimised { "" } else { ", <b>built without optimisation: times mean nothing</b>" };
    format!(
        "<p class=\"note\">{} ({} cores, {}), {}{built}.<br><code>{}</code></p>",
        escaped(&machine.processor),
        machine.cores,
        escaped(&machine.system),
        escaped(&machine.version),
        escaped(command)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_become_markup() {
        let page = html("<script>", &[table(&["a"], &[vec!["<b>&\"".to_owned()]])]);
        assert!(page.contains("&lt;b&gt;&amp;&quot;") && !page.contains("<script>"), "{page}");
    }

    #[test]
    fn a_page_needs_nothing_else() {
        let page = html("a", &[]);
        for outside in ["http://", "https://", "src=", "@import", "url("] {
            assert!(!page.contains(outside), "{outside}");
        }
    }
}
