//! What a figure is.

use anyhow::{Context, Result, bail};
use serde_json::Value;

use crate::find::find;

/// One number, or one word, of the documents.
#[derive(Clone, Debug)]
pub struct Figure {
    /// What documents call it by.
    pub id: String,
    /// What it is, for a person.
    pub says: String,
    /// Unit of the value; empty for counts and words.
    pub unit: &'static str,
    /// The run that it is taken from: a name in [`crate::job::JOBS`].
    pub job: &'static str,
    /// Where it stands in the run's report, as [`find`] takes it.
    pub path: String,
    /// What the report's number is multiplied by, to be in the unit.
    pub scale: f64,
    /// Which of the numbers that the path leads to.
    pub fold: Fold,
    /// How far the value may be off when it is taken again.
    pub spread: Spread,
}

/// One of several numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fold {
    /// The only one there is.
    One,
    /// The largest.
    Largest,
}

/// How far a value may be off when it is taken again: by other rounding in another processor's arithmetic, which may turn a close decision
/// of a solver; by another machine's speed or another moment, if it depends on the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spread {
    /// By so much (the figure's unit). 0 for words.
    By(f64),
    /// By this share of the value.
    Share(f64),
}

impl Figure {
    /// Its value in a report, rounded to six digits.
    ///
    /// # Errors
    /// If the path leads nowhere, or to more or other than is wanted.
    pub fn of(&self, report: &Value) -> Result<Value> {
        let found = find(report, &self.path);
        let numbers: Option<Vec<f64>> = found.iter().map(|value| value.as_f64()).collect();
        let number = match (self.fold, numbers.as_deref(), &found[..]) {
            (Fold::One, _, [Value::String(word)]) => return Ok(Value::String(word.clone())),
            (Fold::One, Some([number]), _) => *number,
            (Fold::Largest, Some(numbers @ [_, ..]), _) => numbers.iter().copied().fold(f64::MIN, f64::max),
            _ => bail!("{}: `{}` leads to {} values in the report of {}", self.id, self.path, found.len(), self.job),
        };
        rounded(number * self.scale).with_context(|| format!("{}: {number} is no value", self.id))
    }

    /// How far from `value` it may be.
    pub fn spread_at(&self, value: &Value) -> f64 {
        match self.spread {
            Spread::By(most) => most,
            Spread::Share(share) => share * value.as_f64().unwrap_or_default().abs(),
        }
    }
}

/// A number with six digits.
fn rounded(number: f64) -> Option<Value> {
    let short: f64 = format!("{number:.5e}").parse().ok()?;
    serde_json::Number::from_f64(short).map(Value::Number)
}

/// Whether two values are as near to each other as a spread allows; words have to be the same.
pub fn is_near(one: &Value, other: &Value, spread: f64) -> bool {
    match (one.as_f64(), other.as_f64()) {
        // What rounding to six digits may add.
        (Some(one), Some(other)) => (one - other).abs() <= spread + 1e-5 * one.abs(),
        _ => one == other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn figure(path: &str, fold: Fold) -> Figure {
        Figure {
            id: "a".to_owned(),
            says: String::new(),
            unit: "mm",
            job: "j",
            path: path.to_owned(),
            scale: 1e3,
            fold,
            spread: Spread::Share(0.1),
        }
    }

    #[test]
    fn values_are_scaled_and_folded_and_never_guessed() {
        let report = json!({"a": [{"x": 0.0012345678}, {"x": 0.002}], "word": "does not hold"});
        assert_eq!(figure("a/0/x", Fold::One).of(&report).unwrap(), json!(1.23457));
        assert_eq!(figure("a/*/x", Fold::Largest).of(&report).unwrap(), json!(2.0));
        assert_eq!(figure("word", Fold::One).of(&report).unwrap(), json!("does not hold"));
        assert!(figure("a/*/x", Fold::One).of(&report).is_err(), "two values are not one");
        assert!(figure("b", Fold::Largest).of(&report).is_err());
    }

    #[test]
    fn a_spread_is_what_may_change() {
        let figure = figure("a", Fold::One);
        assert!(is_near(&json!(1.0), &json!(1.09), figure.spread_at(&json!(1.0))));
        assert!(!is_near(&json!(1.0), &json!(1.11), figure.spread_at(&json!(1.0))));
        assert!(!is_near(&json!("holds"), &json!("does not hold"), 0.0));
    }
}
