//! Numbers and words in a report.

use serde_json::Value;

/// Everything in a report that a path leads to. Steps are separated by `/`: a field's name, the number of an item, `*` for all items,
/// `field=value` for the items whose field is this, several of which are joined by `&`, or `#2` for the third number in a sentence. A `/` in a value is
/// written `%2F`.
pub fn find(report: &Value, path: &str) -> Vec<Value> {
    let step = |found: Vec<Value>, step: &str| found.iter().flat_map(|value| taken(value, step)).collect();
    path.split('/').fold(vec![report.clone()], step)
}

fn taken(value: &Value, step: &str) -> Vec<Value> {
    match value {
        Value::Object(fields) => fields.get(step).cloned().into_iter().collect(),
        Value::Array(items) if step == "*" => items.clone(),
        Value::Array(items) => match step.parse::<usize>() {
            Ok(index) => items.get(index).cloned().into_iter().collect(),
            Err(_) => {
                items.iter().filter(|item| step.split('&').all(|wanted| is_such(item, wanted))).cloned().collect()
            }
        },
        Value::String(sentence) => {
            let index = step.strip_prefix('#').and_then(|index| index.parse().ok());
            index.and_then(|index: usize| numbers(sentence).nth(index)).map(Value::from).into_iter().collect()
        }
        _ => Vec::new(),
    }
}

/// The numbers of a sentence.
fn numbers(sentence: &str) -> impl Iterator<Item = f64> {
    let words = sentence.split(|c: char| !(c.is_ascii_digit() || "+-.".contains(c)));
    words.filter_map(|word| word.trim_end_matches('.').parse().ok())
}

fn is_such(item: &Value, wanted: &str) -> bool {
    let Some((field, wanted)) = wanted.split_once('=') else { return false };
    match &item[field] {
        Value::String(text) => *text == wanted.replace("%2F", "/"),
        other => wanted.parse::<Value>().is_ok_and(|wanted| *other == wanted),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn paths_lead_to_fields_items_and_those_with_a_value() {
        let report = json!({"rows": [{"name": "a", "n": 1, "v": [3, 4]}, {"name": "b", "n": 2, "v": [5]}]});
        assert_eq!(find(&report, "rows/name=b/v/0"), [json!(5)]);
        assert_eq!(find(&report, "rows/name=a&n=1/v/1"), [json!(4)]);
        assert_eq!(find(&report, "rows/*/v/*"), [json!(3), json!(4), json!(5)]);
        assert!(find(&report, "rows/name=c/v").is_empty());
        assert_eq!(find(&json!([{"claim": "1 S/m", "n": 6}]), "claim=1 S%2Fm/n"), [json!(6)]);
        let report = json!({"claim": "rank correlation -0.53 with 5 x 7 dots."});
        assert_eq!(find(&report, "claim/#0"), [json!(-0.53)]);
        assert_eq!(find(&report, "claim/#2"), [json!(7.0)]);
    }
}
