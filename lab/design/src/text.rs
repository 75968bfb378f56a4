//! Numbers as text.

use tactomo_physics::detector::short;

/// A number in another unit with three digits, or a dash.
pub(crate) fn number(value: Option<f64>, factor: f64) -> String {
    value.map_or("-".to_owned(), |value| {
        let value = value * factor;
        let decade = if value == 0.0 { 0.0 } else { value.abs().log10().floor() };
        if (-4.0..5.0).contains(&decade) {
            format!("{value:.*}", (2.0 - decade).max(0.0) as usize)
        } else {
            short(value)
        }
    })
}

/// A length or the like that was chosen, without digits that say nothing.
pub(crate) fn plain(value: f64) -> String {
    short((value * 1e3).round() / 1e3)
}

/// Cells of a row for other programs: empty where a figure is open.
pub(crate) fn cells(figures: &[Option<f64>]) -> String {
    let cell = |figure: &Option<f64>| figure.map_or(String::new(), |value| format!("{value:e}"));
    figures.iter().map(cell).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_what_is_open_has_none() {
        for (value, text) in [(0.5, "0.500"), (12.345, "12.3"), (1234.5, "1234"), (1.5e-6, "1.50e-6"), (0.0, "0.00")] {
            assert_eq!(number(Some(value), 1.0), text);
        }
        assert_eq!((number(None, 1.0), cells(&[Some(0.5), None])), ("-".to_owned(), "5e-1,".to_owned()));
    }
}
