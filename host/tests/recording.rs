//! Recordings as a person makes them: killed, on a full disk, cut, joined, and kept in a ring.
#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;
use tactomo::board::record::{RecordReader, RecordWriter};

use tactomo_tests::{Folder, TACTOMO};

/// Longest wait for a program that has begun.
const PATIENCE: Duration = Duration::from_secs(60);

fn file(folder: &Folder, name: &str) -> PathBuf {
    folder.path(name).into()
}

fn run(args: &[&str], files: &[&Path]) -> Output {
    TACTOMO.command().args(args).args(files).output().unwrap()
}

fn info(file: &Path) -> Value {
    let output = run(&["recording", "info", "--json"], &[file]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn seconds(info: &Value) -> f64 {
    info["seconds"].as_f64().unwrap()
}

fn record(file: &Path, more: &[&str]) -> Child {
    let mut command = TACTOMO.command();
    command.arg("record").arg(file).args(["--simulate", "--board", "ideal"]).args(more);
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

/// A recording of so many seconds.
fn recorded(file: &Path, seconds: &str) {
    assert!(record(file, &["--seconds", seconds, "--notes", "new foam"]).wait().unwrap().success());
}

fn wait_for(what: impl Fn() -> bool) {
    let begin = Instant::now();
    while !what() {
        assert!(begin.elapsed() < PATIENCE, "nothing has come for a minute");
        sleep(Duration::from_millis(5));
    }
}

fn length(file: &Path) -> u64 {
    std::fs::metadata(file).map_or(0, |file| file.len())
}

#[test]
fn a_program_that_is_killed_loses_a_second_at_most() {
    let folder = Folder::new("killed");
    let recording = file(&folder, "killed.tactomo");
    let mut program = record(&recording, &[]);
    let header = {
        wait_for(|| length(&recording) > 0);
        length(&recording)
    };
    // The first frames are in the file, so they came before this.
    wait_for(|| length(&recording) > header + 1000);
    let begin = Instant::now();
    sleep(Duration::from_millis(2500));
    let recorded_s = begin.elapsed().as_secs_f64();
    program.kill().unwrap();
    program.wait().unwrap();
    let info = info(&recording);
    assert!(seconds(&info) > recorded_s - 1.0, "{recorded_s} s: {info}");
    // A chunk that was cut is all that may be missing.
    assert!(info["corrupt"] == 0 && info["missing_frames"] == 0, "{info}");
}

#[test]
#[cfg(unix)]
fn a_full_disk_ends_the_recording_with_a_word_and_keeps_what_came_before() {
    let folder = Folder::new("full");
    let recording = file(&folder, "full.tactomo");
    // No file may be longer than 300 blocks: what a full disk does to the program, without one.
    let script = "trap '' XFSZ; ulimit -f 300; exec \"$0\" record \"$1\" --simulate --board ideal --seconds 60";
    let output =
        Command::new("sh").args(["-c", script, TACTOMO.path().to_str().unwrap()]).arg(&recording).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("what came before is kept") && said.contains("full.tactomo"), "{said}");
    assert!(info(&recording)["frames"].as_u64().unwrap() > 100);
}

#[test]
fn pieces_are_cut_joined_checked_and_solved() {
    let folder = Folder::new("cut");
    let [whole, piece, sum] = ["whole.tactomo", "piece.tactomo", "sum.tactomo"].map(|name| file(&folder, name));
    recorded(&whole, "2");
    let out = piece.to_str().unwrap();
    assert!(run(&["recording", "cut", "--from", "0.5", "--to", "1.5", "--out", out], &[&whole]).status.success());
    let (long, short) = (info(&whole), info(&piece));
    assert!((seconds(&short) - 1.0).abs() < 0.1, "{short}");
    assert_eq!((&short["notes"], &short["is_damaged"]), (&"new foam".into(), &false.into()));
    assert!((short["started_unix_s"].as_f64().unwrap() - long["started_unix_s"].as_f64().unwrap() - 0.5).abs() < 1e-5);

    let out = sum.to_str().unwrap();
    assert!(run(&["recording", "merge", "--out", out], &[&whole, &piece]).status.success());
    let joined = info(&sum);
    let frames = |info: &Value| info["frames"].as_u64().unwrap();
    assert_eq!(frames(&joined), frames(&long) + frames(&short));
    assert_eq!((joined["joined_at_s"].as_array().map(Vec::len), &joined["missing_frames"]), (Some(1), &0.into()));
    assert_eq!(run(&["recording", "check"], &[&whole, &piece, &sum]).status.code(), Some(0));
    let solved = run(&["reconstruct", "--json"], &[&sum]);
    assert!(solved.status.success(), "{}", String::from_utf8_lossy(&solved.stderr));

    let again = run(&["recording", "cut", "--out", out], &[&whole]);
    assert_eq!(again.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&again.stderr).contains("sum.tactomo exists already"));

    let mut bytes = std::fs::read(&whole).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    let damaged = file(&folder, "damaged.tactomo");
    std::fs::write(&damaged, [b"a line of a log\n", &bytes[..]].concat()).unwrap();
    let checked = run(&["recording", "check"], &[&whole, &damaged]);
    assert_eq!(checked.status.code(), Some(1));
    let said = String::from_utf8_lossy(&checked.stdout);
    assert!(said.contains("damaged in 1 place") && said.contains("16 bytes before its start do not belong"), "{said}");
}

/// The same recording, but that a byte was changed on the line, before the recording was written.
fn changed_on_the_line(from: &Path, to: &Path) {
    let mut reader = RecordReader::open(from).unwrap();
    let mut writer = RecordWriter::new(std::fs::File::create_new(to).unwrap(), reader.header()).unwrap();
    let (mut bytes, mut chunks) = (Vec::new(), 0);
    while let Some(time_us) = reader.next_into(&mut bytes).unwrap() {
        chunks += 1;
        if chunks == 30 {
            let middle = bytes.len() / 2;
            bytes[middle] ^= 0x10;
        }
        writer.write(time_us, &bytes).unwrap();
    }
    writer.flush().unwrap();
    assert!(chunks > 30, "{chunks}");
}

#[test]
fn what_was_lost_on_the_line_damages_no_file_and_what_is_not_there_is_not_damaged() {
    let folder = Folder::new("lost");
    let [whole, noisy] = ["whole.tactomo", "noisy.tactomo"].map(|name| file(&folder, name));
    recorded(&whole, "1");
    changed_on_the_line(&whole, &noisy);
    let checked = run(&["recording", "check"], &[&whole, &noisy]);
    let said = String::from_utf8_lossy(&checked.stdout);
    assert_eq!(checked.status.code(), Some(0), "{said}");
    assert!(said.contains("corrupt, lost on the line; the file is whole"), "{said}");
    let noisy = info(&noisy);
    assert!(noisy["is_damaged"] == false && noisy["corrupt"].as_u64() > Some(0), "{noisy}");
    let checked = run(&["recording", "check"], &[&whole, &file(&folder, "none.tactomo")]);
    let [told, error] = [&checked.stdout, &checked.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert_eq!(checked.status.code(), Some(1));
    assert!(told.contains("none.tactomo: No such file") && error.contains("1 of 2 cannot be read"), "{told} {error}");
    assert!(!told.contains("damaged") && !error.contains("damaged"), "{told} {error}");
}

#[test]
fn the_last_seconds_are_saved_when_a_line_comes_and_when_something_touches() {
    let folder = Folder::new("ring");
    let mut program = record(
        &file(&folder, "line.tactomo"),
        &["--last", "1", "--after", "0.5", "--save-on", "enter", "--seconds", "3.5"],
    );
    sleep(Duration::from_millis(1500));
    program.stdin.as_mut().unwrap().write_all(b"\n").unwrap();
    assert!(program.wait().unwrap().success());
    let saved = info(&file(&folder, "line-1.tactomo"));
    // However late the board came, there is half a second after the line, to a chunk, and no more than a second before it.
    assert!((0.4..=1.6).contains(&seconds(&saved)), "{saved}");
    assert_eq!(saved["marks"].as_array().map(Vec::len), Some(1));
    assert!(!file(&folder, "line-2.tactomo").exists() && !file(&folder, "line.tactomo").exists());

    let on_touch = ["--scene", "pointer", "--last", "1", "--save-on", "touch", "--seconds", "4"];
    assert!(record(&file(&folder, "touch.tactomo"), &on_touch).wait().unwrap().success());
    let saved = info(&file(&folder, "touch-1.tactomo"));
    assert!(!saved["marks"].as_array().unwrap().is_empty(), "{saved}");
}
