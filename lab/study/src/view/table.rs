//! Tables with typed columns.

use super::figure::Chart;

/// A table.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Table {
    /// What it shows; may be empty.
    pub title: String,
    /// What its figures are, below it.
    pub note: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// A cell for each column, row by row.
    pub rows: Vec<Vec<Cell>>,
    /// How it looks.
    pub style: Style,
    /// Whether it has a row for each thing that was computed: what [`csv`](super::csv) writes.
    pub is_data: bool,
}

/// How a table looks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Style {
    /// Numbers in columns.
    #[default]
    Plain,
    /// Sentences, which are wrapped; in a terminal each cell is a line.
    Prose,
    /// Cells are colours, as wide as they need.
    Heat,
    /// Cells are colours, over the width of the page.
    WholeHeat,
}

/// A column.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Column {
    /// What it has.
    pub name: String,
    /// In what unit, and with how many digits.
    pub format: Format,
    /// Whether a terminal has no room for it.
    pub is_detail: bool,
    /// Whether its value heads the rows that share it.
    pub is_group: bool,
}

/// Unit and digits of numbers. Values are in SI units.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Format {
    /// The unit as people read it.
    pub unit: &'static str,
    /// The SI unit in heads for other programs.
    pub si: &'static str,
    /// The one over the other.
    pub factor: f64,
    /// Digits after the point; `None` for three digits that count.
    pub digits: Option<usize>,
}

/// Words and names.
pub const TEXT: Format = Format::new("", "");
/// Plain numbers.
pub const PLAIN: Format = Format::new("", "");
/// Lengths, in millimetres.
pub const MM: Format = Format { unit: "mm", si: "m", factor: 1e3, digits: None };
/// Shares, in per cent.
pub const PERCENT: Format = Format { unit: "%", si: "", factor: 100.0, digits: Some(0) };
/// Microseconds, which the studies' times are in.
pub const US: Format = Format { digits: Some(1), ..Format::new("µs", "us") };
/// Conductivities.
pub const S_PER_M: Format = Format::new("S/m", "s_per_m");

impl Format {
    /// In a unit that is SI, with three digits.
    pub const fn new(unit: &'static str, si: &'static str) -> Self {
        Self { unit, si, factor: 1.0, digits: None }
    }

    /// With so many digits after the point.
    #[must_use]
    pub const fn digits(self, digits: usize) -> Self {
        Self { digits: Some(digits), ..self }
    }

    /// A number without its unit, or a dash.
    pub fn text(self, value: Option<f64>) -> String {
        let Some(value) = value.map(|value| value * self.factor) else { return "-".to_owned() };
        let decade = if value == 0.0 { 0.0 } else { value.abs().log10().floor() };
        match self.digits {
            Some(digits) => format!("{value:.digits$}"),
            None if (-4.0..5.0).contains(&decade) => format!("{value:.*}", (2.0 - decade).max(0.0) as usize),
            None => tactomo_physics::detector::short(value),
        }
    }
}

/// A cell.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Cell {
    /// What it says.
    pub value: Value,
    /// How bad that is: 0 good to 4 useless; none where it has no colour.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub level: Option<u8>,
    /// What it says below that, smaller.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub detail: String,
    /// How a method fails there, in place of a level.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outcome: Option<Outcome>,
    /// What it opens.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub opens: Option<Box<Chart>>,
    /// Shown when the mouse is over it.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub tooltip: String,
}

/// How a method fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It does not.
    Right,
    /// It is as far off without what is varied.
    FromStart,
    /// It says so where it is wrong.
    Flagged,
    /// It is wrong within a few of the standard errors that it claims.
    Covered,
    /// It is wrong at times and says nothing.
    SometimesSilent,
    /// It is often wrong and says nothing.
    Silent,
}

impl Outcome {
    /// All of them, with what they stand for.
    pub const ALL: [(Self, &str); 6] = [
        (Self::Right, "right"),
        (Self::FromStart, "far off from the start"),
        (Self::Flagged, "wrong, and flagged"),
        (Self::Covered, "wrong, within 3 standard errors"),
        (Self::SometimesSilent, "wrong at times, silently"),
        (Self::Silent, "often wrong, silently: the danger"),
    ];

    /// Class that gives it its colour and pattern.
    pub fn class(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::FromStart => "from-start",
            Self::Flagged => "flagged",
            Self::Covered => "covered",
            Self::SometimesSilent => "silent-few",
            Self::Silent => "silent",
        }
    }

    /// What stands behind a value, for those who see no colours, with its name.
    pub(super) fn mark(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Right => None,
            Self::FromStart => Some(("○", "from the start")),
            Self::Flagged => Some(("⚑", "flagged")),
            Self::Covered => Some(("±", "within 3 standard errors")),
            Self::SometimesSilent => Some(("✕", "silent at times")),
            Self::Silent => Some(("✕", "silent")),
        }
    }
}

/// What a cell says.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
#[serde(untagged)]
pub enum Value {
    /// Nothing: the figure is open.
    #[default]
    Open,
    /// A number, in the SI unit of its column.
    Number(f64),
    /// Words.
    Text(String),
}

impl From<Option<f64>> for Value {
    fn from(value: Option<f64>) -> Self {
        value.map_or(Self::Open, Self::Number)
    }
}

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<usize> for Value {
    fn from(value: usize) -> Self {
        Self::Number(value as f64)
    }
}

impl From<bool> for Value {
    fn from(value: bool) -> Self {
        Self::Number(f64::from(u8::from(value)))
    }
}

impl From<&str> for Value {
    fn from(value: &str) -> Self {
        Self::Text(value.to_owned())
    }
}

impl From<String> for Value {
    fn from(value: String) -> Self {
        Self::Text(value)
    }
}

/// A table that is being made, column by column, of some things.
#[derive(Clone, Debug)]
pub struct Rows<R> {
    things: Vec<R>,
    table: Table,
}

impl Table {
    /// A table with a row for each of some things.
    pub fn of<R>(title: impl Into<String>, things: impl IntoIterator<Item = R>) -> Rows<R> {
        let things: Vec<R> = things.into_iter().collect();
        let rows = vec![Vec::new(); things.len()];
        Rows { things, table: Self { title: title.into(), rows, ..Self::default() } }
    }

    /// For other programs.
    pub(super) fn csv(&self) -> String {
        let quoted = |text: &str| match text.contains([',', '"', '\n']) {
            true => format!("\"{}\"", text.replace('"', "\"\"")),
            false => text.to_owned(),
        };
        let cell = |cell: &Cell| match &cell.value {
            Value::Open => String::new(),
            Value::Number(number) => format!("{number:e}"),
            Value::Text(text) => quoted(text),
        };
        let heads = self.columns.iter().map(Column::key).collect::<Vec<_>>().join(",");
        let rows = self.rows.iter().map(|row| row.iter().map(cell).collect::<Vec<_>>().join(","));
        std::iter::once(heads).chain(rows).map(|line| line + "\n").collect()
    }
}

impl<R> Rows<R> {
    /// With a column more.
    #[must_use]
    pub fn column<V: Into<Value>>(self, name: impl Into<String>, format: Format, value: impl Fn(&R) -> V) -> Self {
        self.cells(name, format, |thing| Cell { value: value(thing).into(), ..Cell::default() })
    }

    /// The same where a terminal has no room for it.
    #[must_use]
    pub fn detail<V: Into<Value>>(self, name: impl Into<String>, format: Format, value: impl Fn(&R) -> V) -> Self {
        self.column(name, format, value).last(|column| column.is_detail = true)
    }

    /// The same where it heads the rows that share its value.
    #[must_use]
    pub fn group<V: Into<Value>>(self, name: impl Into<String>, value: impl Fn(&R) -> V) -> Self {
        self.column(name, TEXT, value).last(|column| column.is_group = true)
    }

    /// The same of cells that have colours and the like.
    #[must_use]
    pub fn cells(mut self, name: impl Into<String>, format: Format, cell: impl Fn(&R) -> Cell) -> Self {
        self.table.columns.push(Column { name: name.into(), format, is_detail: false, is_group: false });
        self.table.rows.iter_mut().zip(&self.things).for_each(|(row, thing)| row.push(cell(thing)));
        self
    }

    /// With what its figures are.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.table.note = note.into();
        self
    }

    /// Looking like this.
    #[must_use]
    pub fn style(mut self, style: Style) -> Self {
        self.table.style = style;
        self
    }

    /// As the data of its view.
    #[must_use]
    pub fn data(mut self) -> Self {
        self.table.is_data = true;
        self
    }

    fn last(mut self, change: impl FnOnce(&mut Column)) -> Self {
        self.table.columns.last_mut().map(change);
        self
    }
}

impl<R> From<Rows<R>> for Table {
    fn from(rows: Rows<R>) -> Self {
        rows.table
    }
}

impl Column {
    /// Its head for people.
    pub(super) fn head(&self) -> String {
        match self.format.unit {
            "" => self.name.clone(),
            unit if self.name.is_empty() => unit.to_owned(),
            unit => format!("{}, {unit}", self.name),
        }
    }

    /// Its head for other programs.
    fn key(&self) -> String {
        let name = format!("{} {}", self.name, self.format.si).to_lowercase();
        name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty()).collect::<Vec<_>>().join("_")
    }

    /// A cell of it for people.
    pub(super) fn text(&self, cell: &Cell) -> String {
        match &cell.value {
            Value::Open => self.format.text(None),
            Value::Number(number) => self.format.text(Some(*number)),
            Value::Text(text) => text.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_or_those_that_are_asked_for() {
        for (value, text) in [(0.5, "0.500"), (12.345, "12.3"), (1234.5, "1234"), (1.5e-6, "1.50e-6"), (0.0, "0.00")] {
            assert_eq!(PLAIN.text(Some(value)), text);
        }
        assert_eq!((PLAIN.text(None), MM.digits(1).text(Some(0.0123))), ("-".to_owned(), "12.3".to_owned()));
    }
}
