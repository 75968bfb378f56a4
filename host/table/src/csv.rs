//! Columns of numbers in text.
//!
//! Numbers are parted by commas, semicolons, tabs or blanks. A first line that is not all numbers names the columns. Empty lines, and
//! lines that begin with `#`, are left out.

use super::Array;

/// Names of the columns, if there are any, and the rows.
///
/// # Errors
/// The line and the column that are wrong.
pub fn parse(text: &str) -> Result<(Vec<String>, Array), String> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let kept = |(_, line): &(usize, &str)| !line.trim().is_empty() && !line.trim_start().starts_with('#');
    let mut lines = text.lines().enumerate().filter(kept).peekable();
    let names = lines.next_if(|(_, line)| fields(line).any(|field| field.parse::<f64>().is_err()));
    let names: Vec<String> = names.map(|(_, line)| fields(line).map(str::to_owned).collect()).unwrap_or_default();
    let (mut columns, mut rows, mut values) = (names.len(), 0, Vec::new());
    for (index, line) in lines {
        let before = values.len();
        for (column, field) in fields(line).enumerate() {
            let number = field.parse().map_err(|_| {
                format!("line {}, column {}: `{}` is not a number", index + 1, column + 1, shortened(field))
            })?;
            values.push(number);
        }
        let count = values.len() - before;
        if columns == 0 {
            columns = count;
        }
        if count != columns {
            return Err(format!("line {}: {count} numbers, but {columns} columns before it", index + 1));
        }
        rows += 1;
    }
    if rows == 0 {
        return Err("there are no numbers".to_owned());
    }
    Ok((names, Array { shape: vec![rows, columns], values }))
}

fn fields(line: &str) -> impl Iterator<Item = &str> {
    let line = line.trim();
    let marks: &[char] = &[',', ';', '\t'];
    // A number must stand between two marks, so that one that is missing is seen; blanks may be many.
    let blanks = !line.contains(marks);
    let parts: Box<dyn Iterator<Item = &str>> =
        if blanks { Box::new(line.split_whitespace()) } else { Box::new(line.split(marks).map(str::trim)) };
    parts.map(|field| field.trim_matches('"'))
}

/// The beginning of a field, for messages.
fn shortened(field: &str) -> String {
    field.chars().take(20).collect::<String>().escape_debug().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn names_comments_and_marks_are_understood() {
        let (names, rows) = parse("# made by hand\n\"x_m\"; force_n\r\n1; 2.5\n\n-3e-3;nan\n").unwrap();
        assert_eq!(names, ["x_m", "force_n"]);
        assert_eq!(rows.shape, [2, 2]);
        assert_eq!(rows.values[..3], [1.0, 2.5, -3e-3]);
        assert!(rows.values[3].is_nan());
        assert_eq!(parse("1  2\t\n 3 4").unwrap().1.shape, [2, 2]);
        assert_eq!(parse("\u{feff}7").unwrap(), (Vec::new(), Array { shape: vec![1, 1], values: vec![7.0] }));
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        assert_eq!(parse("1,2\n3,much").unwrap_err(), "line 2, column 2: `much` is not a number");
        assert_eq!(parse("1,2\n\n3").unwrap_err(), "line 3: 1 numbers, but 2 columns before it");
        assert_eq!(parse("1,2\n3,,4").unwrap_err(), "line 2, column 2: `` is not a number");
        assert_eq!(parse("a,b\n").unwrap_err(), "there are no numbers");
        assert_eq!(parse("").unwrap_err(), "there are no numbers");
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(values in prop::collection::vec(prop::num::f64::NORMAL, 1..40), columns in 1..5usize) {
            let whole = values.len() / columns * columns;
            prop_assume!(whole > 0);
            let line = |row: &[f64]| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
            let text = values[..whole].chunks(columns).map(line).collect::<Vec<_>>().join("\n");
            let (names, rows) = parse(&text).unwrap();
            prop_assert!(names.is_empty());
            prop_assert_eq!(&rows.values[..], &values[..whole]);
        }

        #[test]
        fn any_text_is_read_without_panic(text in "\\PC*|[0-9,;.e\n -]*") {
            if let Ok((names, rows)) = parse(&text) {
                prop_assert_eq!(rows.values.len(), rows.shape[0] * rows.shape[1]);
                prop_assert!(names.is_empty() || names.len() == rows.shape[1]);
            }
        }
    }
}
