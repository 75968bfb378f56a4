//! Maps of where methods break: a table whose cells are coloured by how bad they are.

use std::fmt::Write;

use super::escaped;

/// A map: a row for each method, a column for each value.
#[derive(Clone, Debug, Default)]
pub struct Heat {
    /// What is varied.
    pub title: String,
    /// What a cell's number is, and what to look at.
    pub note: String,
    /// Heads of the columns.
    pub columns: Vec<String>,
    /// The rows.
    pub rows: Vec<Row>,
    /// Whether it takes the width of the page, with all its columns in it.
    pub is_whole: bool,
}

/// A row of a map.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// Its name.
    pub name: String,
    /// Its cells.
    pub cells: Vec<Cell>,
}

/// A cell of a map.
#[derive(Clone, Debug, Default)]
pub struct Cell {
    /// How bad: 0 good to 4 useless; `None` where there is no figure.
    pub level: Option<u8>,
    /// What it says.
    pub text: String,
    /// What it says below that, smaller.
    pub detail: String,
    /// Whether the method itself flagged that something is wrong.
    pub is_flagged: bool,
    /// Shown when the mouse is over it.
    pub tooltip: String,
}

impl Heat {
    /// The map as HTML.
    pub fn html(&self) -> String {
        let class = if self.is_whole { "heat whole" } else { "heat" };
        let mut html =
            format!("<section class=\"{class}\"><h3>{}</h3><p>{}</p>\n", escaped(&self.title), escaped(&self.note));
        html += "<div class=\"wide\"><table><thead><tr><th></th>";
        for column in &self.columns {
            _ = write!(html, "<th>{}</th>", escaped(column));
        }
        html += "</tr></thead><tbody>\n";
        for row in &self.rows {
            _ = write!(html, "<tr><th>{}</th>", escaped(&row.name));
            row.cells.iter().for_each(|cell| cell.write(&mut html));
            html += "</tr>\n";
        }
        html + "</tbody></table></div></section>"
    }
}

impl Cell {
    fn write(&self, html: &mut String) {
        let class = self.level.map_or_else(|| "empty".to_owned(), |level| format!("h{}", level.min(4)));
        let flag = if self.is_flagged { "<b class=\"flag\" aria-label=\"flagged\">⚑</b>" } else { "" };
        let detail = match self.detail.is_empty() {
            true => String::new(),
            false => format!("<small>{}</small>", escaped(&self.detail)),
        };
        _ = write!(
            html,
            "<td class=\"{class}\" title=\"{}\">{}{flag}{detail}</td>",
            escaped(&self.tooltip),
            escaped(&self.text)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_have_their_level_and_flag() {
        let cell = |level, is_flagged| Cell {
            level,
            text: "3 <".to_owned(),
            detail: "m&n".to_owned(),
            is_flagged,
            ..Cell::default()
        };
        let row = Row {
            name: "tikhonov".to_owned(),
            cells: vec![cell(Some(0), false), cell(Some(9), true), cell(None, false)],
        };
        let html = Heat { columns: vec!["a".to_owned()], rows: vec![row], ..Heat::default() }.html();
        for part in ["class=\"h0\"", "class=\"h4\"", "class=\"empty\"", "3 &lt;", "<small>m&amp;n</small>"] {
            assert!(html.contains(part), "{part}");
        }
        assert_eq!(html.matches("⚑").count(), 1);
    }
}
