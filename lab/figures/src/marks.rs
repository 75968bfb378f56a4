//! Numbers in the documents that are figures: each is followed by `<!-- figure: ID -->`, or by `<!-- figure: ID to 100 -->` where it is
//! rounded to hundreds.

use std::ops::Range;

use serde_json::Value;

const OPEN: &str = "<!-- figure: ";
const CLOSE: &str = " -->";

/// A marked number or word in a text.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// The figure's.
    pub id: String,
    /// Where the mark begins, and so the number ends.
    pub at: usize,
    /// What the number is rounded to, where that is not its last digit.
    step: Option<f64>,
}

/// What is wrong with a mark.
#[derive(Clone, Debug, PartialEq)]
pub struct Wrong {
    /// Its line, from 1.
    pub line: usize,
    /// What is wrong.
    pub what: String,
}

/// All marks of a text, in order.
///
/// # Errors
/// The first that is not closed, or is rounded to nothing.
pub fn marks(text: &str) -> Result<Vec<Mark>, Wrong> {
    text.match_indices(OPEN).map(|(at, _)| mark(text, at)).collect()
}

fn mark(text: &str, at: usize) -> Result<Mark, Wrong> {
    let wrong = |what: &str| Wrong { line: line_of(text, at), what: what.to_owned() };
    let inside = &text[at + OPEN.len()..];
    let inside = &inside[..inside.find(CLOSE).ok_or_else(|| wrong("a mark that is not closed"))?];
    let (id, step) = match inside.split_once(" to ") {
        None => (inside, None),
        Some((id, step)) => {
            let step = step.parse().ok().filter(|step: &f64| *step > 0.0);
            (id, Some(step.ok_or_else(|| wrong("a mark that is rounded to no number"))?))
        }
    };
    Ok(Mark { id: id.to_owned(), at, step })
}

/// The line that a place is in, from 1.
pub fn line_of(text: &str, at: usize) -> usize {
    text[..at].matches('\n').count() + 1
}

impl Mark {
    /// What stands before the mark in place of the value: where, and what should.
    ///
    /// # Errors
    /// If no number stands there, or another word.
    pub fn shown(&self, text: &str, value: &Value) -> Result<(Range<usize>, String), Wrong> {
        let wrong = |what: String| Wrong { line: line_of(text, self.at), what };
        let before = &text[..self.at];
        if let Value::String(word) = value {
            // A word stands alone in its cell.
            let begin = before.rfind(['|', '\n']).map_or(0, |at| at + 1);
            let begin = begin + before[begin..].len() - before[begin..].trim_start().len();
            return Ok((begin..self.at, word.clone()));
        }
        let number = value.as_f64().ok_or_else(|| wrong(format!("{} has no value", self.id)))?;
        let begin = number_before(before).ok_or_else(|| wrong(format!("no number before the mark of {}", self.id)))?;
        Ok((begin..self.at, like(&before[begin..], number, self.step)))
    }
}

/// Where the number begins that a text ends with: digits, one point, a sign, an exponent, and spaces between groups of three digits.
fn number_before(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let is_digit = |at: usize| bytes.get(at).is_some_and(u8::is_ascii_digit);
    let mut begin = text.len();
    while begin > 0 {
        let at = begin - 1;
        let group = (at + 1..at + 4).all(is_digit) && !is_digit(at + 4);
        let goes_on = match bytes[at] {
            b'0'..=b'9' => true,
            b'.' => is_digit(at + 1),
            b'e' => at > 0 && is_digit(at - 1) && (is_digit(at + 1) || bytes.get(at + 1) == Some(&b'-')),
            b'-' => is_digit(at + 1) && at > 0 && bytes[at - 1] == b'e',
            b' ' => group && at > 0 && is_digit(at - 1),
            _ => false,
        };
        if !goes_on {
            break;
        }
        begin = at;
    }
    if begin == text.len() {
        return None;
    }
    let is_signed = begin > 0
        && matches!(bytes[begin - 1], b'-' | b'+')
        && (begin == 1 || !bytes[begin - 2].is_ascii_alphanumeric());
    Some(begin - usize::from(is_signed))
}

/// A number in the style of another: as many digits after the point, an exponent, a plus, groups of three.
fn like(style: &str, number: f64, step: Option<f64>) -> String {
    if let Some((mantissa, _)) = style.split_once('e') {
        return format!("{number:.*e}", decimals(mantissa));
    }
    let number = step.map_or(number, |step| (number / step).round() * step);
    let digits = format!("{number:.*}", decimals(style));
    // No zero has a sign.
    let digits = match digits.strip_prefix('-') {
        Some(zero) if zero.chars().all(|c| "0.".contains(c)) => zero.to_owned(),
        _ => digits,
    };
    let digits = if style.contains(' ') { grouped(&digits) } else { digits };
    if style.starts_with('+') && !digits.starts_with('-') { format!("+{digits}") } else { digits }
}

fn decimals(number: &str) -> usize {
    number.split_once('.').map_or(0, |(_, decimals)| decimals.len())
}

fn grouped(number: &str) -> String {
    let (whole, rest) = number.split_at(number.find('.').unwrap_or(number.len()));
    let (sign, whole) = whole.strip_prefix('-').map_or(("", whole), |whole| ("-", whole));
    let mut text = String::new();
    for (index, digit) in whole.chars().enumerate() {
        if index > 0 && (whole.len() - index).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    format!("{sign}{text}{rest}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn shown(text: &str, value: Value) -> (String, String) {
        let mark = &marks(text).unwrap()[0];
        let (range, wanted) = mark.shown(text, &value).unwrap();
        (text[range].to_owned(), wanted)
    }

    #[test]
    fn numbers_are_held_to_their_own_digits() {
        for (text, value, there, wanted) in [
            ("error 0.39<!-- figure: a --> mm", json!(0.3849), "0.39", "0.38"),
            ("| 1.98e-5<!-- figure: a --> |", json!(1.976e-5), "1.98e-5", "1.98e-5"),
            ("some 270<!-- figure: a to 10 --> frames", json!(272.5), "270", "270"),
            ("prints 34 975<!-- figure: a -->", json!(1234.4), "34 975", "1 234"),
            ("correlation +0.79<!-- figure: a -->", json!(-0.001), "+0.79", "+0.00"),
            ("range 5-13<!-- figure: a -->", json!(12.0), "13", "12"),
            ("at -0.5<!-- figure: a -->", json!(-0.52), "-0.5", "-0.5"),
            ("in 5 mm 300<!-- figure: a -->", json!(301), "300", "301"),
            (
                "| does not hold<!-- figure: a --> |",
                json!("for the sensor only"),
                "does not hold",
                "for the sensor only",
            ),
        ] {
            assert_eq!(shown(text, value), (there.to_owned(), wanted.to_owned()), "{text}");
        }
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let text = "a\nb <!-- figure: x -->";
        let wrong = marks(text).unwrap()[0].shown(text, &json!(1.0)).unwrap_err();
        assert_eq!(wrong, Wrong { line: 2, what: "no number before the mark of x".to_owned() });
        assert_eq!(marks("1<!-- figure: x").unwrap_err().what, "a mark that is not closed");
    }
}
