//! A folder of recordings as one MCAP file, as readers find it: what live's own file of the same detectors has.

use std::collections::BTreeMap;

use serde_json::Value;
use tactomo_tests::{Folder, TACTOMO};

use crate::python::{self, python};
use crate::ros2;

/// The topics of a file's messages, each with its messages: log time, and what it says.
fn by_topic(messages: &[Value], says: usize) -> BTreeMap<&str, Vec<(u64, &Value)>> {
    let mut topics = BTreeMap::<_, Vec<_>>::new();
    for message in messages {
        let topic = message[0].as_str().unwrap();
        topics.entry(topic).or_default().push((message[1].as_u64().unwrap(), &message[says]));
    }
    topics
}

/// Numbers of a detector's frames, and what was measured.
fn measured_v(topics: &BTreeMap<&str, Vec<(u64, &Value)>>, name: &str) -> impl Iterator<Item = (u64, Vec<f64>)> {
    let [touches, readings] = ["touch", "readings"].map(|what| topics[&*format!("/tactomo/{name}/{what}")].clone());
    let numbers = touches.into_iter().map(|(_, touch)| touch["sequence"].as_u64().unwrap());
    numbers.zip(readings.into_iter().map(|(_, grid)| python::grid(grid, 0)))
}

#[test]
fn a_folder_of_recordings_is_one_file_with_the_topics_that_live_writes() {
    let folder = Folder::new("streams-folder");
    let [taken, live, all, ros, lines] =
        ["taken", "live.mcap", "all.mcap", "ros2.mcap", "all.jsonl"].map(|name| folder.path(name));
    let body = folder.path("body.toml");
    let patch = |name: &str| format!("[[patch]]\nname = \"{name}\"\nsimulate = true\nscene = \"single\"\n");
    let place = "place = { xyz_m = [0.1, 0.0, 0.0], rpy_rad = [0.0, 0.0, 0.0] }\n";
    std::fs::write(&body, patch("board-1") + place + &patch("board-2")).unwrap();
    let boards = ["live", "--body", &body, "--seconds", "2", "--json"];
    TACTOMO.succeeds(&[&boards[..], &["--record", &taken, "--mcap", &live]].concat());
    let export = ["export", &taken, "--solver", "contacts", "--to"];
    TACTOMO.succeeds(&[&export[..], &["mcap", "--out", &all]].concat());
    TACTOMO.succeeds(&[&export[..], &["mcap", "--profile", "ros2", "--out", &ros]].concat());
    TACTOMO.succeeds(&[&export[..], &["jsonl", "--out", &lines]].concat());

    let text = std::fs::read_to_string(&lines).unwrap();
    let told: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |patch: &str| told.iter().filter(|line| line["patch"] == patch).count();
    let counts = ["board-1", "board-2"].map(of);
    assert!(counts.iter().all(|count| *count > 100) && counts.iter().sum::<usize>() == told.len(), "{counts:?}");
    assert!(told.iter().map(|line| line["arrived_unix_s"].as_f64().unwrap()).is_sorted());

    let Some(python) = python() else { return };
    let [of_live, of_all] = [&live, &all].map(|file| python::read(&python, file.as_ref(), "whole"));
    let [metadata_of_live, metadata] = [&of_live, &of_all].map(|messages| &messages.last().unwrap()[4]);
    let keys = |metadata: &Value| metadata.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(keys(metadata), keys(metadata_of_live));
    let [mut of_live, of_all] = [&of_live, &of_all].map(|messages| by_topic(&messages[..messages.len() - 1], 4));
    // The solver that live has may answer by an image now and then.
    of_live.retain(|topic, _| !topic.ends_with("/image"));
    assert!(of_all.keys().eq(of_live.keys()) && of_all.len() == 7, "{:?} {:?}", of_all.keys(), of_live.keys());
    // Of the one that has a place, once a second.
    let places = &of_all["/tactomo/board-1/tf"];
    assert!((1..=4).contains(&places.len()) && places[0].1["translation"]["x"] == 0.1, "{places:?}");
    for (name, count) in ["board-1", "board-2"].iter().zip(counts) {
        let topic = |what: &str| format!("/tactomo/{name}/{what}");
        let readings = &of_all[&*topic("readings")];
        assert_eq!((readings.len(), of_all[&*topic("touch")].len()), (count, count));
        assert!(readings.iter().all(|(_, grid)| grid["frame_id"] == *name));
        // What live answered is there too: a frame that came while another was solved has no answer of its own.
        let exported: BTreeMap<_, _> = measured_v(&of_all, name).collect();
        assert_eq!(exported.len(), count);
        for (sequence, of_live) in measured_v(&of_live, name) {
            assert!(exported[&sequence] == of_live, "frame {sequence} of {name}");
        }
    }

    let messages = python::run(&python, ros2::READ, &[ros.as_ref()]);
    let of_ros = by_topic(&messages, 2);
    for (name, count) in ["board-1", "board-2"].iter().zip(counts) {
        for what in ["points", "contacts", "frame"] {
            let messages = &of_ros[&*format!("/tactomo/{}/{what}", name.replace('-', "_"))];
            assert_eq!(messages.len(), count);
            assert!(messages.iter().all(|(_, message)| message["header"]["frame_id"] == *name));
        }
    }
    assert_eq!(of_ros.len(), 6, "{:?}", of_ros.keys());
}

#[test]
fn what_a_folder_cannot_become_is_said() {
    let folder = Folder::new("streams-folder-refused");
    let [taken, out] = ["taken", "out"].map(|name| folder.path(name));
    std::fs::create_dir(&taken).unwrap();
    let refused = |args: &[&str]| TACTOMO.refused(&[&["export", &taken, "--out", &out], args].concat());
    assert!(refused(&["--to", "mcap"]).contains("has no recordings"));
    assert!(refused(&["--to", "csv"]).contains("a CSV table is of one detector"));
    assert!(refused(&["--to", "npz"]).contains("an NPZ file is of one detector"));
    assert!(refused(&["--to", "mcap", "--detector", "square-60"]).contains("leave out --detector"));
    for name in ["a-b", "a_b"] {
        std::fs::write(format!("{taken}/{name}.tactomo"), "").unwrap();
    }
    let said = refused(&["--to", "mcap", "--profile", "ros2"]);
    assert!(said.contains("two detectors would be called a_b"), "{said}");
    assert!(refused(&["--to", "mcap"]).contains("a-b.tactomo"));
    assert!(!std::path::Path::new(&out).exists());
}
