//! Columns of numbers in text.
//!
//! Cells are separated by commas, semicolons, tabs or blanks, whichever the first line has. A first line without any number names the
//! columns. Empty lines, and lines that begin with `#`, are left out.

use std::io::{self, Write};

use ::csv::{ErrorKind, ReaderBuilder, StringRecord, Trim};

use super::Array;

/// Names of the columns, if there are any, and the rows.
///
/// # Errors
/// The line and the column that are wrong.
pub fn parse(text: &str) -> Result<(Vec<String>, Array), String> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let separator = separator(text);
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(Trim::All)
        .comment(Some(b'#'))
        .delimiter(separator)
        .from_reader(text.as_bytes());
    let mut rows = Rows::default();
    for record in reader.records() {
        let record = record.map_err(|error| error.to_string())?;
        let line = record.position().map_or(0, |position| line_at(text, position));
        let cells = cells(&record, separator);
        match cells[..] {
            [] | [""] => {}
            [first, ..] if first.starts_with('#') => {}
            _ => rows.add(line, &cells)?,
        }
    }
    rows.finish()
}

/// Number of the line of a record that begins at or after a position, with empty lines and comments before it.
fn line_at(text: &str, position: &::csv::Position) -> u64 {
    let lines = text.get(position.byte() as usize..).unwrap_or_default().lines();
    let skipped = lines.take_while(|line| line.trim().is_empty() || line.starts_with('#')).count();
    position.line() + skipped as u64
}

/// The separator of the first line that is neither empty nor a comment.
fn separator(text: &str) -> u8 {
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
    let first = lines.next().unwrap_or_default();
    // Semicolons first: where commas are decimal points, the cells have both.
    [b';', b',', b'\t'].into_iter().find(|mark| first.as_bytes().contains(mark)).unwrap_or(b' ')
}

/// The cells of a line. Between two marks there must be a cell, so that one that is missing is seen; blanks may be many.
fn cells(record: &StringRecord, separator: u8) -> Vec<&str> {
    record.iter().filter(|cell| separator != b' ' || !cell.is_empty()).collect()
}

/// What has been read.
#[derive(Default)]
struct Rows {
    names: Vec<String>,
    columns: usize,
    count: usize,
    values: Vec<f64>,
}

impl Rows {
    fn add(&mut self, line: u64, cells: &[&str]) -> Result<(), String> {
        if self.columns == 0 {
            self.columns = cells.len();
            if is_header(line, cells)? {
                self.names = cells.iter().map(|&cell| cell.to_owned()).collect();
                return Ok(());
            }
        }
        for (column, cell) in cells.iter().enumerate() {
            let number = cell.parse().map_err(|_| {
                format!("line {line}, column {}: `{}` is not a number{}", column + 1, shortened(cell), hint(cell))
            })?;
            self.values.push(number);
        }
        if cells.len() != self.columns {
            return Err(format!("line {line}: {} numbers, but {} columns before it", cells.len(), self.columns));
        }
        self.count += 1;
        Ok(())
    }

    fn finish(self) -> Result<(Vec<String>, Array), String> {
        if self.count == 0 {
            return Err("there are no numbers".to_owned());
        }
        Ok((self.names, Array { shape: vec![self.count, self.columns], values: self.values }))
    }
}

/// Whether the first line names the columns: no cell of it is a number, nor begins as one does. A line of both is one of
/// numbers with a mistake in it, or a header that would swallow a frame without a word.
fn is_header(line: u64, cells: &[&str]) -> Result<bool, String> {
    let is_number = |cell: &&str| cell.parse::<f64>().is_ok();
    let is_name =
        |cell: &&str| !is_number(cell) && !cell.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    if cells.iter().all(is_number) {
        return Ok(false);
    }
    if cells.iter().all(is_name) {
        return Ok(true);
    }
    let wrong = cells.iter().position(|cell| !is_number(cell)).unwrap_or_default();
    Err(format!(
        "line {line}, column {}: `{}` is not a number{}; to name the columns, the first line must hold names only",
        wrong + 1,
        shortened(cells[wrong]),
        hint(cells[wrong])
    ))
}

/// What may have been meant.
fn hint(cell: &str) -> &'static str {
    let with_point = cell.replacen(',', ".", 1);
    if cell.contains(',') && with_point.parse::<f64>().is_ok() { " (decimals need a point)" } else { "" }
}

/// The beginning of a cell, for messages.
fn shortened(cell: &str) -> String {
    cell.chars().take(20).collect::<String>().escape_debug().to_string()
}

/// Writes a table of text.
pub struct CsvWriter<W: Write> {
    writer: ::csv::Writer<W>,
}

impl<W: Write> CsvWriter<W> {
    /// Begins it.
    pub fn new(out: W) -> Self {
        Self { writer: ::csv::Writer::from_writer(out) }
    }

    /// Writes a row; cells are quoted where they need to be.
    ///
    /// # Errors
    /// If it cannot be written, or is not as long as the rows before it.
    pub fn row<C: AsRef<[u8]>>(&mut self, cells: impl IntoIterator<Item = C>) -> io::Result<()> {
        self.writer.write_record(cells).map_err(|error| {
            let told = error.to_string();
            match error.into_kind() {
                // As the system says it: its kind tells what to do.
                ErrorKind::Io(error) => error,
                _ => io::Error::other(told),
            }
        })
    }

    /// Writes what waits in memory.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn names_comments_and_separators_are_understood() {
        let (names, rows) = parse("# made by hand, \"today\n\"x_m\"; force_n\r\n1; 2.5\n\n-3e-3;nan\n").unwrap();
        assert_eq!(names, ["x_m", "force_n"]);
        assert_eq!(rows.shape, [2, 2]);
        assert_eq!(rows.values[..3], [1.0, 2.5, -3e-3]);
        assert!(rows.values[3].is_nan());
        assert_eq!(parse("1  2\t\n 3 4").unwrap().1.shape, [2, 2]);
        assert_eq!(parse("1\t2\n3\t4").unwrap().1.values, [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(parse("\u{feff}7").unwrap(), (Vec::new(), Array { shape: vec![1, 1], values: vec![7.0] }));
        assert_eq!(parse("\"a, b\",c\n1,2").unwrap().0, ["a, b", "c"]);
    }

    #[test]
    fn what_is_wrong_is_reported_with_its_place() {
        assert_eq!(parse("1,2\n3,much").unwrap_err(), "line 2, column 2: `much` is not a number");
        assert_eq!(parse("1,2\n\n3").unwrap_err(), "line 3: 1 numbers, but 2 columns before it");
        assert_eq!(parse("1,2\n3,,4").unwrap_err(), "line 2, column 2: `` is not a number");
        assert_eq!(parse("1;2\n3;4,5").unwrap_err(), "line 2, column 2: `4,5` is not a number (decimals need a point)");
        assert_eq!(parse("a,b\n").unwrap_err(), "there are no numbers");
        assert_eq!(parse("").unwrap_err(), "there are no numbers");
    }

    #[test]
    fn a_typing_mistake_in_the_first_line_does_not_make_it_a_header() {
        for (text, place) in [
            ("0.1,O.2,0.3\n1,2,3", "line 1, column 2: `O.2`"),
            ("# volts\n0.1,0.2,\n1,2,3", "line 2, column 3: ``"),
            ("x_m,y_m,0\n1,2,3", "line 1, column 1: `x_m`"),
            ("0.1x\n0.2", "line 1, column 1: `0.1x`"),
            ("1.2.3,-\n1,2", "line 1, column 1: `1.2.3`"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.starts_with(place) && error.contains("must hold names only"), "{text:?}: {error}");
        }
        assert_eq!(parse(",x_m\n0,1").unwrap().0, ["", "x_m"], "an index without a name, as some programs write it");
    }

    #[test]
    fn what_is_written_is_quoted_where_it_must_be() {
        let mut bytes = Vec::new();
        let mut writer = CsvWriter::new(&mut bytes);
        writer.row(["a", "b"]).unwrap();
        writer.row(["1", "two, or \"three\""]).unwrap();
        writer.flush().unwrap();
        drop(writer);
        assert_eq!(bytes, b"a,b\n1,\"two, or \"\"three\"\"\"\n");
        let mut writer = CsvWriter::new(Vec::new());
        writer.row(["a", "b"]).unwrap();
        assert!(writer.row(["short"]).is_err());
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(values in prop::collection::vec(prop::num::f64::NORMAL, 1..40), columns in 1..5usize) {
            let whole = values.len() / columns * columns;
            prop_assume!(whole > 0);
            let mut bytes = Vec::new();
            let mut writer = CsvWriter::new(&mut bytes);
            for row in values[..whole].chunks(columns) {
                writer.row(row.iter().map(f64::to_string)).unwrap();
            }
            writer.flush().unwrap();
            drop(writer);
            let (names, rows) = parse(str::from_utf8(&bytes).unwrap()).unwrap();
            prop_assert!(names.is_empty());
            prop_assert_eq!(&rows.values[..], &values[..whole]);
        }

        #[test]
        fn any_text_is_read_without_panic(text in "\\PC*|[0-9,;.e\n\"# -]*") {
            if let Ok((names, rows)) = parse(&text) {
                prop_assert_eq!(rows.values.len(), rows.shape[0] * rows.shape[1]);
                prop_assert!(names.is_empty() || names.len() == rows.shape[1]);
            }
        }
    }
}
