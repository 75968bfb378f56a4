//! What a study shows, as data, and one renderer each for a [terminal](text), a self-contained [page] and [other programs](csv).
//!
//! Every study fills a [`View`]: texts, [tables](Table) with typed columns, and figures. None writes markup or aligns columns itself.

mod figure;
mod html;
mod svg;
mod table;
mod text;

pub use self::figure::{Axis, Chart, Map, Mark, Series, Unit, same_axis};
pub use self::html::{page, picture};
pub use self::svg::standalone;
pub use self::table::{
    Cell, Column, Format, MM, Outcome, PERCENT, PLAIN, Rows, S_PER_M, Style, TEXT, Table, US, Value,
};
pub use self::text::text;

/// What a study shows.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct View {
    /// Its heading.
    pub title: String,
    /// What it is about and how to read it, in a sentence or two: of the page alone.
    pub lead: String,
    /// Texts, tables and figures in their order.
    pub parts: Vec<Part>,
    /// How it was measured: of the page alone.
    pub method: String,
}

/// A part of a view. In texts, `**` on both sides makes a word bold.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// A heading of what follows.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// A table.
    Table(Table),
    /// Figures side by side: of the page alone.
    Figures(Figures),
    /// What is folded away under a line until it is asked for: of the page alone.
    Folded(String, Vec<Part>),
}

/// Figures side by side.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Figures {
    /// What they show, above them.
    pub text: String,
    /// Classes of colours, and what they stand for.
    pub legend: Vec<(&'static str, String)>,
    /// The figures.
    pub all: Vec<Figure>,
}

/// A figure.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Figure {
    /// Marks between two axes.
    Chart(Chart),
    /// Values over a grid, as colours.
    Map(Map),
    /// A table whose cells are coloured by how bad they are.
    Heat(Table),
}

impl View {
    /// A heading, and what it is about.
    pub fn new(title: impl Into<String>, lead: impl Into<String>) -> Self {
        Self { title: title.into(), lead: lead.into(), ..Self::default() }
    }

    /// With a part more.
    #[must_use]
    pub fn with(mut self, part: impl Into<Part>) -> Self {
        self.parts.push(part.into());
        self
    }

    /// With a heading more.
    #[must_use]
    pub fn heading(self, heading: impl Into<String>) -> Self {
        self.with(Part::Heading(heading.into()))
    }

    /// With a paragraph more.
    #[must_use]
    pub fn text(self, text: impl Into<String>) -> Self {
        self.with(Part::Text(text.into()))
    }

    /// With figures more, under a text.
    #[must_use]
    pub fn figures<F: Into<Figure>>(self, text: impl Into<String>, all: impl IntoIterator<Item = F>) -> Self {
        self.with(Figures::of(text, all))
    }

    /// With parts more that are folded away.
    #[must_use]
    pub fn folded(self, summary: impl Into<String>, parts: impl IntoIterator<Item = impl Into<Part>>) -> Self {
        self.with(Part::Folded(summary.into(), parts.into_iter().map(Into::into).collect()))
    }

    /// With what is missing because it was stopped, if anything is: before all other parts.
    #[must_use]
    pub fn without(mut self, missing: &[String]) -> Self {
        if !missing.is_empty() {
            let text = format!("**Partial: it was stopped before it was done.** Missing: {}.", missing.join("; "));
            self.parts.insert(0, Part::Text(text));
        }
        self
    }

    /// All tables, those that are folded away too.
    fn tables(&self) -> Vec<&Table> {
        fn of(part: &Part) -> Vec<&Table> {
            match part {
                Part::Table(table) => vec![table],
                Part::Folded(_, parts) => parts.iter().flat_map(of).collect(),
                _ => Vec::new(),
            }
        }
        self.parts.iter().flat_map(of).collect()
    }
}

impl Figures {
    /// Some under a text.
    pub fn of<F: Into<Figure>>(text: impl Into<String>, all: impl IntoIterator<Item = F>) -> Self {
        Self { text: text.into(), legend: Vec::new(), all: all.into_iter().map(Into::into).collect() }
    }
}

/// Comma-separated values: the table of each view that is its [data](Table::is_data), in SI units, with heads; empty where a figure is open.
pub fn csv(views: &[View]) -> String {
    let data = views.iter().flat_map(View::tables).filter(|table| table.is_data);
    data.map(Table::csv).collect::<Vec<_>>().join("\n")
}

macro_rules! wrapped {
    ($($inner:ident as $variant:ident in $outer:ident),*) => {$(
        impl From<$inner> for $outer {
            fn from(inner: $inner) -> Self {
                Self::$variant(inner)
            }
        }
    )*};
}
wrapped!(Table as Table in Part, Figures as Figures in Part, Chart as Chart in Figure, Map as Map in Figure, Table as Heat in Figure);

impl<R> From<Rows<R>> for Part {
    fn from(rows: Rows<R>) -> Self {
        Self::Table(rows.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view() -> View {
        let rows = [("a, \"b\"", Some(0.0012), 3), ("<b>&", None, 40)];
        let table = Table::of("Errors <", rows)
            .column("name", TEXT, |row| row.0)
            .column("error", MM, |row| row.1)
            .detail("count", PLAIN.digits(0), |row| row.2)
            .note("What **they** are.")
            .data();
        let series = Series::line("l<", "linear", [(1.0, 2.0), (10.0, 3.0)]);
        let chart = Chart::new("C", "", [Axis::log("x", Unit::Plain), Axis::linear("", Unit::Plain)], [series]);
        View::new("<script>", "Lead.").with(table).figures("Caption", [chart])
    }

    #[test]
    fn one_view_is_text_page_and_data() {
        let (text, page) = (text(&[view()]), page(&[view()], "tactomo <view>"));
        assert!(text.contains("error,\n") || text.contains("error, mm"), "{text}");
        assert!(text.contains(" 1.20") && text.contains("What they are.") && !text.contains("Caption"), "{text}");
        assert!(!text.contains("count") && page.contains("count"), "details are not for the terminal");
        assert!(page.contains("<b>they</b>") && page.contains("Caption") && page.contains("tactomo &lt;view&gt;"));
        assert_eq!(csv(&[view()]), "name,error_m,count\n\"a, \"\"b\"\"\",1.2e-3,3e0\n<b>&,,4e1\n");
        let json = serde_json::to_value(view()).unwrap();
        assert_eq!(json["parts"][0]["table"]["rows"][0][1]["value"], 0.0012);
    }

    #[test]
    fn names_cannot_become_markup_and_a_page_needs_nothing_else() {
        let page = page(&[view()], "");
        assert!(page.contains("&lt;b&gt;&amp;") && page.contains("l&lt;") && !page.contains("<script>"), "{page}");
        for outside in ["http://", "https://", "src=", "@import", "url("] {
            assert!(!page.contains(outside), "{outside}");
        }
    }

    #[test]
    fn a_picture_has_the_first_figures_alone() {
        let picture = picture(&view());
        assert!(picture.contains("<svg") && !picture.contains("Lead.") && !picture.contains("<td"));
    }
}
