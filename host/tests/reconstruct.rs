//! `tactomo reconstruct` as a user calls it.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tactomo::table::{NpzWriter, Table};

const PLACE_MM: [f64; 2] = [9.0, -6.0];

fn tactomo(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tactomo")).args(args).output().unwrap()
}

/// A file that goes when the test ends.
struct Temporary(PathBuf);

impl Temporary {
    fn new(name: &str) -> Self {
        Self(std::env::temp_dir().join(format!("tactomo-{}-{name}", std::process::id())))
    }

    fn with(name: &str, bytes: impl AsRef<[u8]>) -> Self {
        let file = Self::new(name);
        std::fs::write(&file.0, bytes).unwrap();
        file
    }

    fn name(&self) -> &str {
        self.0.to_str().unwrap()
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _gone = std::fs::remove_file(&self.0);
    }
}

/// Readings of a light contact (V), row by row.
fn readings() -> Vec<f64> {
    let contact = format!("{},{},2,2e-4", PLACE_MM[0], PLACE_MM[1]);
    let output = tactomo(&["forward", "--contact", &contact, "--json"]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let rows = report["readings_v"].as_array().unwrap();
    rows.iter().flat_map(|row| row.as_array().unwrap()).map(|volts| volts.as_f64().unwrap()).collect()
}

fn csv(frames: &[Vec<f64>]) -> String {
    let line = |frame: &Vec<f64>| frame.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    frames.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// The objects that the command prints.
fn lines(args: &[&str]) -> Vec<Value> {
    let output = tactomo(&[&["reconstruct"], args, &["--json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn assert_found(line: &Value) {
    let contact = &line["contacts"][0];
    let [x_mm, y_mm] = ["x_m", "y_m"].map(|key| contact[key].as_f64().unwrap() * 1e3);
    assert!((x_mm - PLACE_MM[0]).hypot(y_mm - PLACE_MM[1]) < 5.0, "{contact}");
}

#[test]
fn tables_of_every_kind_give_the_same_contacts() {
    let (readings, nothing) = (readings(), vec![0.0; 256]);
    let frames = [nothing, readings];
    let text = Temporary::with("frames.csv", csv(&frames));
    let archive = Temporary::new("frames.npz");
    let mut writer = NpzWriter::new(std::fs::File::create(&archive.0).unwrap());
    writer.add("other", &[1], &[1.0]).unwrap();
    writer.add("readings_v", &[2, 16, 16], &frames.concat()).unwrap();
    writer.finish().unwrap();
    let [from_text, from_archive] = [&text, &archive].map(|file| lines(&[file.name(), "--lambda", "gcv"]));
    assert_eq!(from_text.len(), 2);
    assert_eq!(from_text[0]["contacts"], Value::Array(Vec::new()));
    assert_found(&from_text[1]);
    assert!(from_text[1]["choice"]["why"].as_str().unwrap().contains("cross validation"));
    assert!(from_text[1]["frame_us"].as_f64().unwrap() > 0.0);
    for (one, other) in from_text.iter().zip(&from_archive) {
        assert_eq!(one["contacts"], other["contacts"]);
    }
}

#[test]
fn frames_at_rest_are_subtracted() {
    let offset = |volts: &f64| volts + 0.05;
    let pressed: Vec<f64> = readings().iter().map(offset).collect();
    let file = Temporary::with("rest.csv", csv(&[vec![0.05; 256], vec![0.05; 256], pressed]));
    let found = lines(&[file.name(), "--rest", "2"]);
    assert_eq!((found.len(), found[0]["frame"].as_u64()), (1, Some(2)));
    assert_found(&found[0]);
}

#[test]
fn what_is_found_goes_into_files() {
    let file = Temporary::with("in.csv", csv(&[vec![0.0; 256], readings()]));
    let [table, archive] = ["out.csv", "out.npz"].map(Temporary::new);
    for out in [&table, &archive] {
        let output = tactomo(&["reconstruct", file.name(), "--images", "--out", out.name()]);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(output.stdout.is_empty());
        assert!(String::from_utf8_lossy(&output.stderr).contains("tikhonov: 2 frames, median"));
    }
    let text = std::fs::read_to_string(&table.0).unwrap();
    let columns: Vec<usize> = text.lines().map(|line| line.split(',').count()).collect();
    assert_eq!(columns, [18; 3], "{text}");
    let Table::Arrays(arrays) = Table::read(&archive.0).unwrap() else { panic!("no arrays") };
    let shape = |name: &str| arrays.iter().find(|(array, _)| array == name).unwrap().1.shape.clone();
    assert_eq!(shape("frame"), [2]);
    assert_eq!(shape("contact_frame_x_y_z_m_conductance_s_force_n"), [1, 6]);
    assert_eq!(shape("image_s_per_m2"), [2, shape("node_x_y_z_m")[0]]);
}

#[test]
fn a_recording_is_read_with_its_board() {
    let recording = Temporary::new("touch.tactomo");
    let live = ["live", "--simulate", "--max-fps", "200", "--seconds", "1", "--json", "--record", recording.name()];
    assert_eq!(tactomo(&live).status.code(), Some(0));
    let found = lines(&[recording.name()]);
    assert!(found.len() > 20, "{} frames", found.len());
    assert_eq!(found[0]["frame"], 32, "the first frames are those at rest");
    assert!(found.last().unwrap()["time_s"].as_f64().unwrap() > 0.1);
}

#[test]
fn a_kernel_learns_from_presses_on_any_channels() {
    let heard = |x: f64, y: f64, force: f64| {
        [0.2, 0.5, 0.9].map(|ear| force / (0.2 + (x - ear).powi(2) + (y - ear * ear).powi(2)))
    };
    let press = |i: usize| {
        let [x, y, z] = [0.7549, 0.5698, 0.3247].map(|step| (step * (i + 1) as f64).fract());
        (x, y, 1.0 + z)
    };
    let taught: String = (0..120)
        .map(press)
        .map(|(x, y, force)| {
            let [a, b, c] = heard(x, y, force);
            format!("{x},{y},{force},{a},{b},{c}\n")
        })
        .collect();
    let presses = Temporary::with("presses.csv", format!("x_m,y_m,force_n,a,b,c\n{taught}"));
    let file = Temporary::with("skin.csv", csv(&[heard(0.4, 0.6, 1.5).to_vec()]));
    let found = lines(&[file.name(), "--solver", "kernel", "--presses", presses.name()]);
    let contact = &found[0]["contacts"][0];
    for (key, truth) in [("x_m", 0.4), ("y_m", 0.6), ("force_n", 1.5)] {
        assert!((contact[key].as_f64().unwrap() - truth).abs() < 0.05, "{key}: {contact}");
    }
    let other = tactomo(&["reconstruct", file.name(), "--presses", presses.name()]);
    assert!(String::from_utf8_lossy(&other.stderr).contains("choose `--solver kernel`"));
}

#[test]
fn wrong_files_are_told() {
    let some = |frame: Vec<f64>| csv(&[vec![0.0; frame.len()], frame]);
    let mut nan = vec![0.1; 256];
    nan[3 * 16 + 5] = f64::NAN;
    let few = Temporary::with("few.csv", some(vec![0.1; 255]));
    let nan = Temporary::with("nan.csv", some(nan));
    let text = Temporary::with("letter.csv", "Dear reader,\nhow are you?");
    let broken = Temporary::with("broken.npz", b"PK\x03\x04 and no more");
    let recording = Temporary::with("cut.tactomo", b"\x89TCTO\r\n\x1a\x01");
    let told = |file: &str, more: &[&str]| {
        let output = tactomo(&[&["reconstruct", file], more].concat());
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8(output.stderr).unwrap()
    };
    for (file, expected) in [
        (few.name(), "has frames of 255 numbers, but the detector square-60 has 16 electrodes: 256 are needed"),
        (nan.name(), "frame 1: the reading of electrode 5 with electrode 3 grounded is not a finite number"),
        (text.name(), "line 2, column 1: `how` is not a number"),
        (broken.name(), "no NPZ file"),
        (recording.name(), "is not a recording of tactomo, or its header is damaged"),
        ("no/such.csv", "cannot read no/such.csv: No such file"),
    ] {
        let message = told(file, &[]);
        assert!(message.contains(expected), "{message}");
    }
    let folder = Path::new(few.name()).parent().unwrap().to_str().unwrap();
    assert!(told(folder, &[]).contains("cannot read"));
    assert!(told(few.name(), &["--out", "contacts.xls"]).contains("256 are needed"));
    assert!(told(nan.name(), &["--out", "contacts.xls"]).contains(".csv, .npz, .json or .jsonl"));
    assert!(told(nan.name(), &["--solver", "contacts", "--lambda", "0.1"]).contains("has no lambda"));
}
