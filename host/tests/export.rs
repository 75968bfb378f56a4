//! What a recording of an ESP32 becomes in files for other programs: the same in each form.
#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use serde_json::Value;
use tactomo::table::{Array, Table};

use tactomo_tests::{Folder, TACTOMO};

fn array(arrays: &[(String, Array)], name: &str) -> Array {
    arrays.iter().find(|(known, _)| known == name).unwrap_or_else(|| panic!("no {name}")).1.clone()
}

#[test]
fn readings_times_and_events_are_the_same_in_every_form() {
    let folder = Folder::new("export");
    let recording = folder.path("esp32.tactomo");
    TACTOMO.succeeds(&[
        "record",
        &recording,
        "--simulate",
        "--board",
        "esp32",
        "--detector",
        "square-60",
        "--scene",
        "pointer",
        "--seconds",
        "6",
    ]);
    let [lines, table, archive] = ["a.jsonl", "a.csv", "a.npz"].map(|name| folder.path(name));
    for (form, out) in [("jsonl", &lines), ("csv", &table), ("npz", &archive)] {
        let fields: &[&str] = if form == "csv" { &[] } else { &["--fields", "all"] };
        TACTOMO.succeeds(
            &[&["export", &recording, "--pointer", "--solver", "contacts", "--to", form, "--out", out], fields]
                .concat(),
        );
    }
    let lines: Vec<Value> =
        std::fs::read_to_string(lines).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let numbers = |line: &Value, name: &str| -> Vec<f64> {
        line[name].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
    };

    // At rest most of an ESP32's readings are within two deviations of the floor: what was measured is below the bound that is used.
    let [measured_v, used_v] = ["readings_v", "used_v"].map(|name| numbers(&lines[0], name));
    let bounds = measured_v.iter().zip(&used_v).filter(|(measured, used)| measured != used);
    let lifted = measured_v.iter().zip(&used_v).filter(|(measured, used)| measured < used).count();
    assert!(bounds.count() == lifted && lifted > 100, "{lifted} of 256");

    let Table::Arrays(arrays) = Table::read(archive.as_ref()).unwrap() else { panic!("no arrays") };
    for name in ["readings_v", "used_v", "touch_v"] {
        let all: Vec<f64> = lines.iter().flat_map(|line| numbers(line, name)).collect();
        assert_eq!(array(&arrays, name).values, all, "{name}");
    }
    let arrived_s: Vec<f64> = lines.iter().map(|line| line["arrived_unix_s"].as_f64().unwrap()).collect();
    assert!(arrived_s[0] > 1.7e9);
    assert_eq!(array(&arrays, "arrived_unix_s").values, arrived_s);
    let events: Vec<&Value> = lines.iter().filter_map(|line| line.get("events")?.as_array()).flatten().collect();
    assert!(!events.is_empty(), "the scene moves a pointer");
    assert_eq!(array(&arrays, "event_kind").values.len(), events.len());

    // What the board says of its converters is in the archive: its frames are solved as the recording's are, with the same detector.
    let solved =
        |file: &str| TACTOMO.lines(&["reconstruct", file, "--solver", "contacts", "--detector", "square-60", "--json"]);
    for (from_recording, from_archive) in solved(&recording).iter().zip(solved(&archive)) {
        assert_eq!(from_recording["contacts"], from_archive["contacts"]);
    }

    let text = std::fs::read_to_string(table).unwrap();
    let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let heads = rows.next().unwrap();
    let at = |name: &str| heads.iter().position(|head| *head == name).unwrap();
    let first = rows.next().unwrap();
    assert_eq!(first[at("arrived_unix_s")].parse(), Ok(arrived_s[0]));
    assert!(
        ["true", "false"].contains(&first[at("misfit")]) && first[at("sequence")].parse::<u64>().is_ok(),
        "{first:?}"
    );
    assert!(text.contains(r#"""kind"":""move"""#), "events are JSON in a cell");
}
