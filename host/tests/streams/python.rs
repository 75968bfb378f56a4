//! MCAP files as the Python package `mcap` reads them, and NPZ files as this program does.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use tactomo::board::frames::{FileFrame, FrameFile};

use crate::program::{Live, path, tactomo};

/// Prints each message as JSON: topic, log time, schema, and its data; of a file that ends early those before. Of a whole file at last how
/// many messages its statistics count, how many come without the index, and how many the index finds from a time on; and its metadata.
const READ: &str = r#"
import json, sys
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader
with open(sys.argv[1], "rb") as file:
    reader = (make_reader if sys.argv[2] == "whole" else NonSeekingReader)(file, validate_crcs=True)
    try:
        for schema, channel, message in reader.iter_messages(log_time_order=sys.argv[2] == "whole"):
            data = json.loads(message.data)
            print(json.dumps([channel.topic, message.log_time, schema.name, schema.encoding, data]))
    except McapError:
        if sys.argv[2] == "whole":
            raise
    if sys.argv[2] == "whole":
        statistics = reader.get_summary().statistics
        half = (statistics.message_start_time + statistics.message_end_time) // 2
        later = sum(1 for _ in reader.iter_messages(starting_at=half))
        metadata = next(reader.iter_metadata()).metadata
        file.seek(0)
        streamed = sum(1 for _ in NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False))
        print(json.dumps([statistics.message_count, streamed, half, later, metadata]))
"#;

/// Packages that read MCAP files, and what they are imported by.
const PACKAGES: [&str; 3] = ["mcap", "mcap-ros2-support", "rosbags"];
const IMPORTS: &str = "import mcap.reader, mcap_ros2.reader, rosbags.highlevel";

/// A Python with the packages, made once; `None` with a line on stderr where there is no Python or no network.
pub fn python() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-mcap");
    let python = folder.join("bin/python");
    let has_packages =
        |python: &Path| Command::new(python).args(["-c", IMPORTS]).output().is_ok_and(|output| output.status.success());
    if has_packages(&python) {
        return Some(python);
    }
    let made = |command: &mut Command| command.output().is_ok_and(|output| output.status.success());
    let is_made = made(Command::new("python3").arg("-m").arg("venv").arg(&folder))
        && made(Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(PACKAGES));
    if is_made && has_packages(&python) {
        return Some(python);
    }
    let line =
        "skipped: the MCAP test needs python3 with venv and pip, which can install mcap, mcap-ros2-support and rosbags";
    assert!(std::env::var_os("TACTOMO_SKIP_NOTHING").is_none(), "{line}");
    // Past the test harness, which keeps the output of tests that pass to itself.
    drop(writeln!(std::io::stderr(), "{line}"));
    None
}

/// What a script of Python prints of files: a value in each line.
pub fn run(python: &Path, script: &str, args: &[&Path]) -> Vec<Value> {
    let output = Command::new(python).args(["-c", script]).args(args).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// What Python finds in a file, `whole` or `broken`.
pub fn read(python: &Path, file: &Path, state: &str) -> Vec<Value> {
    run(python, READ, &[file, Path::new(state)])
}

fn done(args: &[&str]) -> String {
    let output = tactomo(args).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{args:?}: {said}");
    said
}

/// Numbers of the field of a grid that is `offset` bytes after the first.
pub fn grid(message: &Value, offset: usize) -> Vec<f64> {
    let data = data_encoding::BASE64.decode(message["data"].as_str().unwrap().as_bytes()).unwrap();
    let cells = data.chunks(message["cell_stride"].as_u64().unwrap() as usize);
    cells.map(|cell| f64::from_le_bytes(cell[offset..offset + 8].try_into().unwrap())).collect()
}

/// The same with numbers by their values: where `serde_json` keeps their text, 1e-5 is not 0.00001.
fn numbers(value: &Value) -> Value {
    match value {
        Value::Number(number) => number.as_f64().into(),
        Value::Array(all) => all.iter().map(numbers).collect(),
        Value::Object(all) => all.iter().map(|(name, value)| (name.clone(), numbers(value))).collect(),
        other => other.clone(),
    }
}

fn frames(file: &Path) -> Vec<FileFrame> {
    let mut file = FrameFile::open(file, None).unwrap();
    std::iter::from_fn(|| file.next_frame().unwrap()).collect()
}

#[test]
fn an_exported_recording_is_read_back_bit_for_bit() {
    let [recording, mcap, npz, lines] = ["touch.tactomo", "touch.mcap", "touch.npz", "touch.jsonl"].map(path);
    let [recording_name, mcap_name, npz_name, lines_name] =
        [&recording, &mcap, &npz, &lines].map(|path| path.to_str().unwrap());
    done(&["record", recording_name, "--simulate", "--scene", "five-fingers", "--seconds", "2"]);
    done(&["export", recording_name, "--to", "npz", "--fields", "readings", "--out", npz_name]);
    done(&["export", recording_name, "--to", "jsonl", "--fields", "all", "--out", lines_name]);
    let said = done(&["export", recording_name, "--to", "mcap", "--out", mcap_name]);
    let measured = frames(&recording);
    assert!(measured.len() > 100 && said.contains(&format!("{} frames", measured.len())), "{said}");

    let kept = frames(&npz);
    assert!(kept.iter().map(|frame| &frame.measured_v).eq(measured.iter().map(|frame| &frame.measured_v)));
    let text = std::fs::read_to_string(&lines).unwrap();
    assert_eq!(text.lines().count(), measured.len());

    let refused = tactomo(&["export", recording_name, "--to", "mcap", "--out", mcap_name]).output().unwrap();
    assert_eq!(refused.status.code(), Some(1), "what is there is not replaced");

    if let Some(python) = python() {
        let mut messages = read(&python, &mcap, "whole");
        let about = messages.pop().unwrap();
        let later = messages.iter().filter(|message| message[1].as_u64() >= about[2].as_u64()).count();
        assert!(later > 100 && later < messages.len());
        assert_eq!(about.as_array().unwrap()[..2], [messages.len(), messages.len()]);
        assert_eq!(about[3], later);
        assert!(about[4]["detector_toml"].as_str().unwrap().contains("electrode"), "{about}");
        let of = |topic: &str| messages.iter().filter(|message| message[0] == topic).map(|m| &m[4]).collect::<Vec<_>>();
        let (touches, readings) = (of("/tactomo/touch"), of("/tactomo/readings"));
        assert_eq!((touches.len(), readings.len()), (measured.len(), measured.len()));
        for ((line, touch), (grids, frame)) in text.lines().zip(&touches).zip(readings.iter().zip(&measured)) {
            let line: Value = serde_json::from_str(line).unwrap();
            for field in ["schema", "sequence", "time_s", "contacts", "flags", "choice"] {
                assert_eq!(numbers(&line[field]), numbers(&touch[field]), "{field}");
            }
            assert_eq!(
                (grid(grids, 0), grid(grids, 8)),
                (frame.measured_v.clone(), frame.volts.clone()),
                "bit for bit"
            );
            let solved: Vec<_> = line["touch_v"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
            assert_eq!(grid(grids, 16), solved);
        }
    }
    [recording, mcap, npz, lines].iter().for_each(|file| std::fs::remove_file(file).unwrap());
}

#[test]
fn a_file_of_a_program_that_was_killed_is_read_up_to_its_last_chunk() {
    let Some(python) = python() else { return };
    let file = path("killed.mcap");
    let mut live = Live::start(&["--http-port", "0", "--mcap", file.to_str().unwrap(), "--stream", "-"]);
    let mut last = Value::Null;
    let stdout = live.stdout();
    // Three seconds of board time.
    for line in std::io::BufRead::lines(stdout) {
        last = serde_json::from_str(&line.unwrap()).unwrap();
        if last["time_s"].as_f64().unwrap() > 3.0 {
            break;
        }
    }
    live.child.kill().unwrap();
    live.end();
    let messages = read(&python, &file, "broken");
    let newest = messages.iter().rev().find(|message| message[0] == "/tactomo/touch").unwrap();
    let lost_s = last["time_s"].as_f64().unwrap() - newest[4]["time_s"].as_f64().unwrap();
    assert!(lost_s < 1.0, "{lost_s} s are lost");
    std::fs::remove_file(file).unwrap();
}
