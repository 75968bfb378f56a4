//! Views in a terminal: tables and texts; charts and what is folded are of the page.

use super::table::{Cell, Column, Style, Table};
use super::{Part, View};

/// Longest line of a text.
const WIDTH: usize = 118;
/// Narrowest column whose head is broken into lines.
const NARROW: usize = 7;

/// Some views, one below the other.
pub fn text(views: &[View]) -> String {
    views.iter().map(of_view).collect::<Vec<_>>().join("\n\n")
}

fn of_view(view: &View) -> String {
    let mut lines = vec![plain(&view.title)];
    for part in &view.parts {
        match part {
            Part::Heading(heading) => lines.extend([String::new(), plain(heading)]),
            Part::Text(text) => lines.extend(std::iter::once(String::new()).chain(wrapped(text, WIDTH))),
            Part::Table(table) if !table.rows.is_empty() => lines.extend(of_table(table)),
            _ => {}
        }
    }
    lines.join("\n")
}

fn plain(text: &str) -> String {
    text.replace("**", "")
}

/// A text in lines of at most so many characters.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in plain(text).split_whitespace() {
        let line =
            lines.last_mut().filter(|line| line.is_empty() || line.chars().count() + 1 + word.chars().count() <= width);
        match line {
            Some(line) if line.is_empty() => *line = word.to_owned(),
            Some(line) => *line += &format!(" {word}"),
            None => lines.push(word.to_owned()),
        }
    }
    lines
}

fn of_table(table: &Table) -> Vec<String> {
    let mut lines = vec![String::new()];
    lines.extend((!table.title.is_empty()).then(|| plain(&table.title)));
    lines.extend(if table.style == Style::Prose { sentences(table) } else { columns(table) });
    if !table.note.is_empty() {
        lines.extend(wrapped(&table.note, WIDTH));
    }
    lines
}

/// A line for each cell, below that of its row's first.
fn sentences(table: &Table) -> Vec<String> {
    let row = |row: &Vec<Cell>| {
        let mut cells = table.columns.iter().zip(row).map(|(column, cell)| (column.head(), column.text(cell)));
        let first = cells.next().map(|(_, text)| text);
        let more = cells
            .map(|(head, text)| if head.is_empty() { format!("    {text}") } else { format!("    {head}: {text}") });
        first.into_iter().chain(more).collect::<Vec<_>>()
    };
    table.rows.iter().flat_map(row).collect()
}

fn columns(table: &Table) -> Vec<String> {
    let shown: Vec<(usize, &Column)> =
        table.columns.iter().enumerate().filter(|(_, column)| !column.is_detail && !column.is_group).collect();
    let texts: Vec<Vec<String>> =
        table.rows.iter().map(|row| shown.iter().map(|(index, column)| column.text(&row[*index])).collect()).collect();
    let length = |text: &str| text.chars().count();
    let width = |index: usize| {
        let cells = texts.iter().map(|row| length(&row[index])).max().unwrap_or(0);
        let head = shown[index].1.head();
        let word = head.split_whitespace().map(length).max().unwrap_or(0);
        cells.max(word).max(NARROW.min(length(&head)))
    };
    let widths: Vec<usize> = (0..shown.len()).map(width).collect();
    let line = |cells: &[String]| {
        let padded = cells.iter().zip(&widths).enumerate().map(|(index, (cell, width))| match index {
            0 => format!("{cell:<width$}"),
            _ => format!("{cell:>width$}"),
        });
        padded.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    let heads: Vec<Vec<String>> =
        shown.iter().zip(&widths).map(|((_, column), width)| wrapped(&column.head(), *width)).collect();
    let height = heads.iter().map(Vec::len).max().unwrap_or(0);
    // Heads end on one line, right above the cells.
    let head_line = |row: usize| {
        let cell =
            |head: &Vec<String>| (row + head.len()).checked_sub(height).map_or(String::new(), |at| head[at].clone());
        line(&heads.iter().map(cell).collect::<Vec<_>>())
    };
    let mut lines: Vec<String> = (0..height).map(head_line).collect();
    let mut last = None;
    for (row, texts) in table.rows.iter().zip(&texts) {
        let group = group(table, row);
        if group.is_some() && group != last {
            lines.extend(group.iter().map(|group| format!("- {group}")));
            last = group;
        }
        lines.push(line(texts));
    }
    lines
}

/// What heads a row and those that share it.
pub(super) fn group(table: &Table, row: &[Cell]) -> Option<String> {
    let column = table.columns.iter().position(|column| column.is_group)?;
    Some(table.columns[column].text(&row[column]))
}

#[cfg(test)]
mod tests {
    use super::super::table::{PLAIN, TEXT};
    use super::*;

    #[test]
    fn columns_are_as_wide_as_they_need_and_groups_have_a_line() {
        let table: Table = Table::of("T", [("a", "x", 1.0), ("a", "long name", 20.0), ("b", "y", 3.0)])
            .group("group", |row| row.0)
            .column("", TEXT, |row| row.1)
            .column("two words", PLAIN.digits(1), |row| row.2)
            .into();
        assert_eq!(
            of_table(&table),
            [
                "",
                "T",
                "               two",
                "             words",
                "- a",
                "x              1.0",
                "long name     20.0",
                "- b",
                "y              3.0"
            ]
        );
    }

    #[test]
    fn texts_are_wrapped_between_words() {
        assert_eq!(wrapped("one **two** three", 7), ["one two", "three"]);
    }
}
