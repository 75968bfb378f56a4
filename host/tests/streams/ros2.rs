//! MCAP files of the profile `ros2`, as PyPI's readers of them do: `mcap-ros2-support` and `rosbags`, which know nothing of each other.

use serde_json::Value;

use crate::program::{path, tactomo};
use crate::python::{python, run};

/// Prints each message of a file as JSON: topic, log time, and its fields, as both packages have them, which have to agree.
pub const READ: &str = r#"
import json, math, sys
from pathlib import Path
import numpy as np
from mcap_ros2.reader import read_ros2_messages
from rosbags.highlevel import AnyReader

def plain(value):
    if isinstance(value, (np.ndarray, list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (bytes, bytearray)):
        return list(value)
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return None if math.isnan(value) else value
    if isinstance(value, (str, int, bool)):
        return value
    fields = value.__slots__ if hasattr(value, "__slots__") else vars(value)
    return {name: plain(getattr(value, name)) for name in fields if not name.startswith("_") and not name.isupper()}

def order(message):
    return message[:2]

one = [[m.channel.topic, m.log_time_ns, plain(m.ros_msg)] for m in read_ros2_messages(sys.argv[1])]
with AnyReader([Path(sys.argv[1])]) as reader:
    messages = list(reader.messages())
    other = [[c.topic, time, plain(reader.deserialize(raw, c.msgtype))] for c, time, raw in messages]
one.sort(key=order)
other.sort(key=order)

def same(a, b):
    if isinstance(a, dict):
        return all(same(a[name], b[name]) for name in a.keys() & b.keys())
    if isinstance(a, list):
        return len(a) == len(b) and all(map(same, a, b))
    return a == b

assert len(one) == len(other) and all(map(same, one, other)), "the packages differ"
for message in one:
    print(json.dumps(message))
"#;

#[test]
fn readers_of_ros_2_find_what_the_stream_says() {
    let [recording, mcap, lines] = ["ros2.tactomo", "ros2.mcap", "ros2.jsonl"].map(path);
    let [recording_name, mcap_name, lines_name] = [&recording, &mcap, &lines].map(|path| path.to_str().unwrap());
    let done = |args: &[&str]| {
        let output = tactomo(args).output().unwrap();
        assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    };
    done(&["record", recording_name, "--simulate", "--scene", "single", "--seconds", "2"]);
    done(&["export", recording_name, "--to", "jsonl", "--fields", "all", "--solver", "contacts", "--out", lines_name]);
    let profile = ["export", recording_name, "--to", "mcap", "--profile", "ros2", "--solver", "contacts"];
    done(&[&profile[..], &["--out", mcap_name]].concat());
    let refused =
        tactomo(&["export", recording_name, "--to", "csv", "--profile", "ros2", "--out", "x"]).output().unwrap();
    assert!(String::from_utf8_lossy(&refused.stderr).contains("only an MCAP file has one"));

    if let Some(python) = python() {
        let messages = run(&python, READ, &[&mcap]);
        let of = |topic: &str| messages.iter().filter(|message| message[0] == topic).collect::<Vec<_>>();
        let (points, contacts, frames) = (of("/tactomo/points"), of("/tactomo/contacts"), of("/tactomo/frame"));
        let text = std::fs::read_to_string(&lines).unwrap();
        let told: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert!(told.iter().any(|line| line["contacts"][0]["sigma_x_m"].is_f64()));
        assert_eq!([points.len(), contacts.len(), frames.len()], [told.len(); 3]);
        assert!(of("/tactomo/wrench").is_empty(), "forces are not known");
        for (i, line) in told.iter().enumerate() {
            let (message, at_ns) = (&contacts[i][2], contacts[i][1].as_u64().unwrap());
            let stamp = &message["header"]["stamp"];
            let stamp_ns = stamp["sec"].as_u64().unwrap() * 1_000_000_000 + stamp["nanosec"].as_u64().unwrap();
            assert_eq!(stamp_ns, line["host_time_ns"].as_u64().unwrap(), "when it was scanned");
            assert!((line["arrived_unix_s"].as_f64().unwrap() - at_ns as f64 * 1e-9).abs() < 1e-6);
            assert_eq!(message["sequence"], line["sequence"]);
            let found = line["contacts"].as_array().unwrap();
            assert_eq!(message["contacts"].as_array().unwrap().len(), found.len());
            for (told, found) in message["contacts"].as_array().unwrap().iter().zip(found) {
                for name in ["id", "x_m", "y_m", "conductance_s", "sigma_x_m", "radius_m", "force_n", "dx_m"] {
                    assert_eq!(told[name].as_f64(), found[name].as_f64(), "{name} of {i}");
                }
            }
            assert_eq!(points[i][2]["width"], found.len());
            assert_eq!(points[i][2]["data"].as_array().unwrap().len(), 28 * found.len());
            for name in ["readings_v", "used_v", "touch_v"] {
                assert_eq!(frames[i][2][name], line[name], "{name} of {i}");
            }
        }
    }
    [recording, mcap, lines].iter().for_each(|file| std::fs::remove_file(file).unwrap());
}
