//! The demonstrations, live, as a user starts them.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use serde_json::Value;
use tactomo::scene::TEXTURE_HZ;
use tactomo_tests::{Folder, TACTOMO};

/// What `live --simulate --scene` says of a scene at the end.
fn live(scene: &str, others: &[&str]) -> Value {
    let fixed = ["live", "--simulate", "--json", "--scene", scene];
    TACTOMO.json(&[&fixed, others].concat())
}

#[test]
fn the_frequency_of_the_texture_is_found_exact_and_as_built_and_on_another_detector() {
    for others in [&[][..], &["--as-built", "3"], &["--detector", "square-60"]] {
        let summary = live("texture", &[&["--seconds", "4"], others].concat());
        let found_hz = summary["vibration"]["frequency_hz"].as_f64().unwrap();
        assert!((found_hz / TEXTURE_HZ - 1.0).abs() < 0.02, "{summary}");
        assert!(summary["vibration"]["amplitude_v"].as_f64() > Some(1e-3), "{summary}");
    }
    assert!(live("rest", &["--seconds", "2"]).get("vibration").is_none(), "nothing swings at rest");
}

/// Time after which a contact that nobody looked at is another one (s): one that went on meanwhile is out of reach.
const LOST_S: f64 = 0.1;

/// A line of the stream for each answer in a run of the scene.
fn pointer_lines(folder: &Folder, run: usize) -> Vec<Value> {
    let file = folder.path(&format!("touch-{run}.jsonl"));
    live("pointer", &["--seconds", "3.5", "--stream", &file]);
    let text = std::fs::read_to_string(&file).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// The longest time for which a busy machine answered no frame (s).
fn longest_gap_s(lines: &[Value]) -> f64 {
    let time_s = |line: &Value| line["time_s"].as_f64().unwrap();
    lines.windows(2).map(|two| time_s(&two[1]) - time_s(&two[0])).fold(0.0, f64::max)
}

#[test]
fn the_pointer_moves_and_clicks_in_the_stream() {
    let folder = Folder::new("pointer");
    let lines = (0..5).map(|run| pointer_lines(&folder, run)).find(|lines| longest_gap_s(lines) < LOST_S);
    let lines = lines.expect("a machine that does not stand still in one of five runs");
    let events: Vec<&Value> = lines.iter().filter_map(|line| line.get("events")?.as_array()).flatten().collect();
    let of = |kind: &str| events.iter().filter(|event| event["kind"] == kind).collect::<Vec<_>>();
    let [clicks, moves] = [of("click"), of("move")];
    assert_eq!(clicks.len(), 1, "{events:?}");
    // The second target of the scene: 0.45 and 0.35 of half the pad's sides, within what the seed may put it off.
    for (axis, expected_m) in [("x_m", 0.0578), ("y_m", 0.0319)] {
        assert!((clicks[0][axis].as_f64().unwrap() - expected_m).abs() < 2.5e-3, "{clicks:?}");
    }
    // All the way since its first step, whatever frames a busy machine passes over, but for one that stands still until the contact is lost.
    let moves_at = |line: &&Value| line.get("events").is_some_and(|events| events[0]["kind"] == "move");
    let place_m = |line: &Value| line["contacts"][0]["x_m"].as_f64();
    let [first, last] =
        [lines.iter().find(moves_at), lines.iter().rfind(moves_at)].map(|line| place_m(line.unwrap()).unwrap());
    let way_m: f64 = moves.iter().map(|event| event["dx_m"].as_f64().unwrap()).sum();
    assert!((way_m - (last - first)).abs() < 2e-3, "{way_m} m in {} steps from {first} m to {last} m", moves.len());
    assert!(way_m > 0.05, "{way_m} m");
}
