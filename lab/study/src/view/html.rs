//! Views as a self-contained page, light or dark as the reader's system is.

use std::fmt::Write;

use super::table::{Cell, Column, Outcome, Style, Table};
use super::{Chart, Figure, Figures, Part, View, svg, text};
use crate::machine::Machine;

/// The style sheet.
pub(super) const STYLE: &str = include_str!("style.css");
/// A table with more rows is folded away.
const LONGEST: usize = 60;
/// How narrow a figure may become, as a share of its width, before fewer stand side by side.
const NARROWEST: f64 = 0.88;

/// A page of some views, under the first one's title, with the command that makes it again.
pub fn page(views: &[View], command: &str) -> String {
    let machine = Machine::this();
    let built = if machine.optimised { "" } else { ", **built without optimisation: times mean nothing**" };
    let Machine { processor, cores, system, version, .. } = &machine;
    let mut body: String = views.iter().map(of_view).collect();
    _ = write!(
        body,
        "<p class=\"note\">{}<br><code>{}</code></p>",
        marked(&format!("{processor} ({cores} cores, {system}), {version}{built}.")),
        escaped(command)
    );
    html(views.first().map_or("", |view| &view.title), &body)
}

/// A page with the first figures alone, for a document.
pub fn picture(view: &View) -> String {
    let first = view.parts.iter().find_map(|part| match part {
        Part::Figures(all) => Some(Figures { text: String::new(), ..all.clone() }),
        _ => None,
    });
    html(&view.title, &first.as_ref().map(figures).unwrap_or_default())
}

fn html(title: &str, body: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>Tactomo: {}</title>\n\
         <style>\n{STYLE}</style>\n<main>\n{body}\n</main>\n</html>\n",
        escaped(&title.to_lowercase())
    )
}

/// Text with what HTML gives a meaning to made harmless.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A text with its bold words, in which `code` is code.
fn marked(text: &str) -> String {
    let between = |text: &str, mark: &str, tag: &str| -> String {
        let parts = text.split(mark).enumerate();
        parts
            .map(|(index, part)| if index % 2 == 1 { format!("<{tag}>{part}</{tag}>") } else { part.to_owned() })
            .collect()
    };
    between(&between(&escaped(text), "**", "b"), "`", "code")
}

fn of_view(view: &View) -> String {
    let mut body = format!("<h1>{}</h1>\n<p class=\"lead-in\">{}</p>\n", escaped(&view.title), marked(&view.lead));
    view.parts.iter().for_each(|part| body += &of_part(part));
    if !view.method.is_empty() {
        _ = writeln!(body, "<h2>How it was measured</h2>\n<p class=\"note\">{}</p>", marked(&view.method));
    }
    body
}

fn of_part(part: &Part) -> String {
    match part {
        Part::Heading(heading) => format!("<h2>{}</h2>\n", escaped(heading)),
        Part::Text(text) => format!("<p>{}</p>\n", marked(text)),
        Part::Table(all) if all.rows.len() > LONGEST => folded("All figures", &table(all)),
        Part::Table(all) => table(all),
        Part::Figures(all) => figures(all),
        Part::Folded(summary, parts) => folded(summary, &parts.iter().map(of_part).collect::<String>()),
    }
}

fn folded(summary: &str, content: &str) -> String {
    format!("<details><summary>{}</summary>\n{content}</details>\n", escaped(summary))
}

fn figures(figures: &Figures) -> String {
    let mut html = match figures.text.as_str() {
        "" => String::new(),
        text => format!("<p class=\"quiet\">{}</p>\n", marked(text)),
    };
    if !figures.legend.is_empty() {
        let item = |(class, what): &(&str, String)| format!("<li class=\"{class}\">{}</li>", escaped(what));
        _ = writeln!(html, "<ul class=\"legend\">{}</ul>", figures.legend.iter().map(item).collect::<String>());
    }
    let (class, width) = match figures.all.first() {
        Some(Figure::Chart(chart)) => ("charts", chart.size[0] * NARROWEST),
        Some(Figure::Map(_)) => ("maps", 270.0),
        _ => ("heats", 0.0),
    };
    let all: String = figures.all.iter().map(figure).collect();
    html + &format!("<div class=\"{class}\" style=\"--least:{width:.0}px\">\n{all}</div>\n")
}

fn figure(figure: &Figure) -> String {
    match figure {
        Figure::Chart(chart) => svg::of_chart(chart) + "\n",
        Figure::Map(map) => svg::of_map(map) + "\n",
        Figure::Heat(heat) => table(heat),
    }
}

fn table(table: &Table) -> String {
    if table.rows.is_empty() {
        return String::new();
    }
    let class = match table.style {
        Style::Plain => "plain",
        Style::Prose => "prose",
        Style::Heat => "heat",
        Style::WholeHeat => "heat whole",
    };
    let is_heat = class.starts_with("heat");
    let mut html = format!("<section class=\"{class}\">");
    if !table.title.is_empty() {
        _ = writeln!(html, "<h3>{}</h3>", escaped(&table.title));
    }
    let note =
        if table.note.is_empty() { String::new() } else { format!("<p class=\"note\">{}</p>\n", marked(&table.note)) };
    html += if is_heat { &note } else { "" };
    let columns: Vec<(usize, &Column)> =
        table.columns.iter().enumerate().filter(|(_, column)| !column.is_group).collect();
    let heads: String = columns.iter().map(|(_, column)| format!("<th>{}</th>", escaped(&column.head()))).collect();
    _ = writeln!(html, "<div class=\"wide\"><table><thead><tr>{heads}</tr></thead><tbody>");
    let (mut last, mut opened) = (None, String::new());
    for (at_row, row) in table.rows.iter().enumerate() {
        let group = text::group(table, row);
        if group.is_some() && group != last {
            let name = escaped(group.as_deref().unwrap_or_default());
            _ = writeln!(html, "<tr class=\"group\"><th colspan=\"{}\">{name}</th></tr>", columns.len());
            last = group;
        }
        let mut cells = String::new();
        for (at, (index, column)) in columns.iter().enumerate() {
            let id = format!("{}-{at_row}-{index}", slug(&table.title));
            cells += &cell(column, &row[*index], is_heat && at == 0, &id);
            opened += &row[*index].opens.as_deref().map_or_else(String::new, |chart| popover(&id, chart));
        }
        _ = writeln!(html, "<tr>{cells}</tr>");
    }
    html + "</tbody></table></div>" + if is_heat { "" } else { &note } + &opened + "</section>\n"
}

/// A title as part of an id.
fn slug(title: &str) -> String {
    title.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect()
}

/// What a button opens over the page; a click elsewhere or Escape closes it. Browsers do that by themselves, without a script.
fn popover(id: &str, chart: &Chart) -> String {
    format!("<div popover id=\"{id}\" class=\"opened\">{}</div>\n", svg::of_chart(chart))
}

fn cell(column: &Column, cell: &Cell, is_head: bool, id: &str) -> String {
    let text = marked(&column.text(cell));
    if is_head {
        return format!("<th>{text}</th>");
    }
    let class = cell.outcome.map(|outcome| outcome.class().to_owned());
    let class = class.or(cell.level.map(|level| format!("h{}", level.min(4))));
    let class = class.map_or(String::new(), |class| format!(" class=\"{class}\""));
    let title = if cell.tooltip.is_empty() { String::new() } else { format!(" title=\"{}\"", escaped(&cell.tooltip)) };
    let mark = cell.outcome.and_then(Outcome::mark).map_or(String::new(), |(mark, name)| {
        format!("<b class=\"mark\" role=\"img\" aria-label=\"{name}\">{mark}</b>")
    });
    let detail =
        if cell.detail.is_empty() { String::new() } else { format!("<small>{}</small>", marked(&cell.detail)) };
    let content = format!("{text}{mark}{detail}");
    match cell.opens {
        Some(_) => format!("<td{class}{title}><button type=\"button\" popovertarget=\"{id}\">{content}</button></td>"),
        None => format!("<td{class}{title}>{content}</td>"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::table::TEXT;
    use super::super::{Axis, Unit};
    use super::*;

    #[test]
    fn cells_have_their_level_detail_and_mark() {
        let cell =
            |level, outcome| Cell { level, outcome, value: "3 <".into(), detail: "m&n".to_owned(), ..Cell::default() };
        let cells = [cell(Some(0), None), cell(Some(9), None), cell(None, None), cell(None, Some(Outcome::Silent))];
        let heat = Table::of("T", cells).style(Style::Heat).column("", TEXT, |_| "x").cells("a", TEXT, Cell::clone);
        let html = table(&heat.into());
        let silent = "class=\"silent\"";
        for part in ["class=\"h0\"", "class=\"h4\"", silent, "<td>3 &lt;", "<small>m&amp;n</small>", "<th>x</th>"] {
            assert!(html.contains(part), "{part}");
        }
        assert_eq!(html.matches("✕").count(), 1);
    }

    #[test]
    fn a_cell_opens_its_chart_and_no_other() {
        let axes = [Axis::linear("", Unit::Plain), Axis::linear("", Unit::Plain)];
        let cell = |title: &&str| Cell {
            value: "1".into(),
            opens: Some(Box::new(Chart::new(*title, "", axes.clone(), []))),
            ..Cell::default()
        };
        let table: Table = Table::of("A <T>", ["one", "two"]).cells("a", TEXT, cell).into();
        let html = super::table(&table);
        for (id, title) in [("a--t--0-0", "one"), ("a--t--1-0", "two")] {
            assert_eq!(html.matches(&format!("popovertarget=\"{id}\"")).count(), 1, "{html}");
            assert!(
                html.contains(&format!("<div popover id=\"{id}\" class=\"opened\"><svg class=\"chart\"")),
                "{html}"
            );
            assert!(html.contains(&format!("aria-label=\"{title}\"")));
        }
    }
}
