//! Columns of numbers in text.
//!
//! Cells are separated by commas, semicolons, tabs or blanks, whichever makes numbers of the first lines; but for commas, decimals may have
//! commas too. A column that is called a date or a time may have text, which is no number. A first line without any number names the columns. Empty lines, lines that begin with `#`, a line `sep=;` as Excel writes it, and a
//! separator at the end of every line are left out.

use std::io::{self, Write};

use ::csv::{ErrorKind, ReaderBuilder, StringRecord, Trim};

use super::Array;
use super::channels::is_date;

/// Separators, in the order in which they are tried: where commas are decimal points, lines have both.
const MARKS: [u8; 4] = [b';', b'\t', b',', b' '];

/// What is in a text.
#[derive(Debug, PartialEq)]
pub struct Text {
    /// Names of the columns, or none.
    pub names: Vec<String>,
    /// The rows; those that are no row of numbers are not numbers throughout.
    pub rows: Array,
    /// What is wrong with the first of those, with its line and column.
    pub wrong: Option<String>,
}

/// Reads a text of which some rows may be wrong, but fewer than are right.
///
/// # Errors
/// The line and the column that are wrong.
pub fn parse(text: &str) -> Result<Text, String> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mark = declared(text).unwrap_or_else(|| separator(text));
    let is_trailing = ends_with_separators(text, mark);
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(Trim::All)
        .comment(Some(b'#'))
        .delimiter(mark)
        .from_reader(text.as_bytes());
    let mut rows = Rows { has_decimal_commas: mark != b',', ..Rows::default() };
    for record in reader.records() {
        let record = record.map_err(|error| error.to_string())?;
        let line = record.position().map_or(0, |position| line_at(text, position));
        if line == 1 && declared(text).is_some() {
            continue;
        }
        let mut cells = cells(&record, mark);
        if is_trailing && cells.len() > 1 && cells.last() == Some(&"") {
            cells.pop();
        }
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

/// The separator that a first line declares, as Excel has it.
fn declared(text: &str) -> Option<u8> {
    let first = text.lines().next()?.trim_matches('"');
    match first.strip_prefix("sep=")?.as_bytes() {
        [mark] => Some(*mark),
        _ => None,
    }
}

/// Lines that are neither empty nor comments, nor declare the separator.
fn lines(text: &str) -> impl Iterator<Item = &str> {
    let lines = text.lines().skip(usize::from(declared(text).is_some()));
    lines.filter(|line| !line.trim().is_empty() && !line.starts_with('#'))
}

/// The separator that makes several numbers of one of the first two lines, of which one may name the columns; else one that the first has.
fn separator(text: &str) -> u8 {
    let is_parted = |mark: u8, line: &str| {
        let cells: Vec<&str> = line.split(char::from(mark)).map(str::trim).collect();
        let cells = cells.strip_suffix(&[""]).unwrap_or(&cells);
        let cells = cells.iter().filter(|cell| mark != b' ' || !cell.is_empty());
        let are_numbers = cells.clone().all(|cell| number(cell.trim_matches('"'), mark != b',').is_some());
        are_numbers && cells.count() > 1
    };
    let first = lines(text).next().unwrap_or_default();
    let parted = MARKS.into_iter().find(|mark| lines(text).take(2).any(|line| is_parted(*mark, line)));
    let has = || [b';', b',', b'\t'].into_iter().find(|mark| first.as_bytes().contains(mark));
    parted.or_else(has).unwrap_or(b' ')
}

/// Whether lines end with a separator, behind which is no cell: all but two at most, one of names and one that is cut.
fn ends_with_separators(text: &str, mark: u8) -> bool {
    let ends = |line: &str| line.trim_end_matches(' ').as_bytes().last() == Some(&mark);
    let (all, short) = lines(text).fold((0, 0), |(all, short), line| (all + 1, short + usize::from(!ends(line))));
    mark != b' ' && short <= 2 && all > 2 * short
}

/// The cells of a line. Between two marks there must be a cell, so that one that is missing is seen; blanks may be many.
fn cells(record: &StringRecord, separator: u8) -> Vec<&str> {
    record.iter().filter(|cell| separator != b' ' || !cell.is_empty()).collect()
}

/// The number in a cell, whose decimals may have a comma, and whose exponent Fortran's `D`.
fn number(cell: &str, has_decimal_commas: bool) -> Option<f64> {
    let with_point = || cell.replacen(',', ".", 1).parse().ok();
    let with_exponent = || cell.replacen(['D', 'd'], "e", 1).parse().ok();
    let is_comma = has_decimal_commas && !cell.contains('.');
    cell.parse().ok().or_else(|| is_comma.then(with_point)?).or_else(with_exponent)
}

/// What has been read.
#[derive(Default)]
struct Rows {
    has_decimal_commas: bool,
    names: Vec<String>,
    columns: usize,
    count: usize,
    values: Vec<f64>,
    /// Rows that are wrong, and what is with the first of them.
    wrong: (usize, Option<String>),
    /// Whether the first row is.
    begins_wrong: bool,
    /// The first cells whose decimals have a point, and a comma.
    decimals: [Option<String>; 2],
}

impl Rows {
    fn add(&mut self, line: u64, cells: &[&str]) -> Result<(), String> {
        if self.columns == 0 {
            self.columns = cells.len();
            if self.is_header(line, cells)? {
                self.names = cells.iter().map(|&cell| cell.to_owned()).collect();
                return Ok(());
            }
        }
        let before = self.values.len();
        if let Err(what) = self.add_numbers(line, cells) {
            self.values.truncate(before);
            self.values.resize(before + self.columns, f64::NAN);
            self.wrong.0 += 1;
            self.begins_wrong |= self.count == 0;
            self.wrong.1.get_or_insert(what);
        }
        self.count += 1;
        Ok(())
    }

    fn add_numbers(&mut self, line: u64, cells: &[&str]) -> Result<(), String> {
        for (column, cell) in cells.iter().enumerate() {
            let is_date = self.names.get(column).is_some_and(|name| is_date(name));
            let number = number(cell, self.has_decimal_commas)
                .or_else(|| is_date.then_some(f64::NAN))
                .ok_or_else(|| format!("line {line}, column {}: {}", column + 1, no_number(cell)))?;
            for (decimals, mark) in self.decimals.iter_mut().zip(['.', ',']) {
                if decimals.is_none() && !is_date && cell.contains(mark) {
                    *decimals = Some(format!("{} in line {line}", shortened(cell)));
                }
            }
            self.values.push(number);
        }
        if cells.len() != self.columns {
            return Err(format!("line {line}: {} numbers, but {} columns before it", cells.len(), self.columns));
        }
        Ok(())
    }

    /// Whether the first line names the columns: no cell of it is a number, nor begins as one does. A line of both is one of
    /// numbers with a mistake in it, or a header that would swallow a frame without a word.
    fn is_header(&self, line: u64, cells: &[&str]) -> Result<bool, String> {
        let is_number = |cell: &&str| number(cell, self.has_decimal_commas).is_some();
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
            "line {line}, column {}: {}; to name the columns, the first line must hold names only",
            wrong + 1,
            no_number(cells[wrong])
        ))
    }

    fn finish(self) -> Result<Text, String> {
        if self.count == 0 {
            return Err("there are no numbers".to_owned());
        }
        if let [Some(point), Some(comma)] = &self.decimals {
            return Err(format!(
                "decimals have points ({point}) and commas ({comma}): write them in one way, and no separators of thousands"
            ));
        }
        let (wrong, what) = self.wrong;
        if let Some(what) = what.clone().filter(|_| 2 * wrong >= self.count) {
            let has_head = self.begins_wrong && !self.names.is_empty();
            let head = if has_head { "; begin lines that are no part of the table with #" } else { "" };
            return Err(what + head);
        }
        Ok(Text {
            names: self.names,
            rows: Array { shape: vec![self.count, self.columns], values: self.values },
            wrong: what,
        })
    }
}

/// Why a cell is no number.
fn no_number(cell: &str) -> String {
    let without: String = cell.chars().filter(|c| !",.' ".contains(*c)).collect();
    let has_thousands = without.len() + 1 < cell.len() && without.parse::<f64>().is_ok();
    let thousands = if has_thousands { ": write it without separators of thousands" } else { "" };
    format!("`{}` is not a number{thousands}", shortened(cell))
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

    /// Names and rows of a text that is right throughout.
    fn parse(text: &str) -> Result<(Vec<String>, Array), String> {
        let Text { names, rows, wrong } = super::parse(text)?;
        wrong.map_or(Ok((names, rows)), Err)
    }

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
        for text in ["Operator: me\n1,2\n3,4", "Operator: me\nDate: today\n1,2\n3,4"] {
            assert!(parse(text).unwrap_err().ends_with("begin lines that are no part of the table with #"), "{text}");
        }
        for text in ["\"1,030.5\",\"2,000.0\"\n", "1.030,5;2.000,0\n", "1'030.5;2\n"] {
            assert!(parse(text).unwrap_err().contains("separators of thousands"), "{text}");
        }
        assert_eq!(parse("a,b\n").unwrap_err(), "there are no numbers");
        assert_eq!(parse("").unwrap_err(), "there are no numbers");
    }

    #[test]
    fn dialects_of_other_programs_are_read() {
        for text in [
            "0,5\t1,25\n-2e-3\t3\n",
            "0,5 1,25\n-2e-3 3\n",
            "0,5;1,25\r\n-2e-3;3\r\n",
            "sep=;\n0.5;1.25\n-2e-3;3\n",
            "\"sep=;\"\na;b\n0,5;1,25\n-2e-3;3\n",
            "sep=\t\n0,5\t1,25\n-2e-3\t3\n",
            "0.5,1.25,\n-2e-3,3,\n",
            "a,b\n0.5,1.25,\n-2e-3,3,\n",
            "0,5;1,25;\n-2e-3;3;\n",
            "\"0,5\";\"1,25\"\n-2e-3;3\n",
            "0.5D0,1.25D+00\n-2.0D-03,3\n",
        ] {
            assert_eq!(parse(text).map(|(_, rows)| rows.values), Ok(vec![0.5, 1.25, -2e-3, 3.0]), "{text:?}");
        }
        let both = parse("0.5;1,234\n1;2\n").unwrap_err();
        assert!(both.contains("points (0.5 in line 1) and commas (1,234 in line 1)"), "{both}");
    }

    #[test]
    fn rows_that_are_no_numbers_and_a_cut_last_line_are_no_numbers_where_others_are_right() {
        let text = super::parse("a,b\n1,2\n3,ERROR\n5,6\n7,8\n9").unwrap();
        assert_eq!(text.rows.shape, [5, 2]);
        let is_wrong: Vec<bool> =
            text.rows.values.chunks(2).map(|row| row.iter().all(|value| value.is_nan())).collect();
        assert_eq!(is_wrong, [false, true, false, false, true]);
        assert_eq!(text.wrong.as_deref(), Some("line 3, column 2: `ERROR` is not a number"));
        assert!(super::parse("1,2\nx,y\n3,z\n").is_err(), "most are wrong");
    }

    #[test]
    fn dates_are_no_numbers_and_no_mistakes() {
        let (names, rows) = parse("Datum/Zeit;ch0\n2026-11-28 12:00:01;0,5\n2026-11-28 12:00:02;0,25\n").unwrap();
        assert_eq!((&*names[0], rows.values[1], rows.values[3]), ("Datum/Zeit", 0.5, 0.25));
        assert!(rows.values[0].is_nan() && parse("ch0;ch1\n12:00:01;0,5\n").is_err());
        let (_, rows) = parse("Datum;ch0\n28.11.2026;0,5\n28.11.2026;0,25\n").unwrap();
        assert_eq!((rows.values[1], rows.values[3]), (0.5, 0.25));
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
            if let Ok(Text { names, rows, .. }) = super::parse(&text) {
                prop_assert_eq!(rows.values.len(), rows.shape[0] * rows.shape[1]);
                prop_assert!(names.is_empty() || names.len() == rows.shape[1]);
            }
        }
    }
}
