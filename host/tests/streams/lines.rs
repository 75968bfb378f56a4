//! JSON Lines: through a pipe, to who connects, in datagrams.

use std::io::{BufRead, BufReader};
use std::net::{TcpListener, TcpStream, UdpSocket};

use serde_json::Value;

use crate::program::{Live, path, tactomo};

fn parsed(line: &str) -> Value {
    serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"))
}

/// Lines that a stream says were missed.
fn missed(lines: &[Value]) -> u64 {
    lines.iter().filter_map(|line| line["missed_before"].as_u64()).sum()
}

#[test]
fn a_reader_that_has_enough_ends_the_program_quietly() {
    let mut live = Live::start(&["--http-port", "0", "--stream", "-", "--stream-fields", "contacts"]);
    let mut stdout = live.stdout();
    for _ in 0..3 {
        let mut line = String::new();
        stdout.read_line(&mut line).unwrap();
        let line = parsed(&line);
        assert!(line["schema"] == 1 && line["contacts"].is_array() && line.get("flags").is_none(), "{line}");
    }
    drop(stdout);
    let (code, said) = live.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(!said.contains("error") && !said.contains("frames"), "{said}");
}

#[test]
fn a_reader_that_stalls_loses_its_own_lines_and_nobody_elses() {
    let file = path("beside.jsonl");
    let args = ["--json", "--seconds", "6", "--solver", "tikhonov", "--stream-fields", "all", "--stream", "tcp:0"];
    let mut live = Live::start(&[&args[..], &["--stream", file.to_str().unwrap()]].concat());
    let at = live.told("stream: tcp:");
    let _stalled = TcpStream::connect(&at).unwrap();
    let reader = BufReader::new(TcpStream::connect(&at).unwrap());
    let lines: Vec<_> = reader.lines().map(|line| parsed(&line.unwrap())).collect();
    let (code, said) = live.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("is too slow: it loses answers"), "the stalled reader is told of: {said}");
    assert_eq!(missed(&lines), 0, "of {} lines", lines.len());
    let text = std::fs::read_to_string(&file).unwrap();
    let kept: Vec<_> = text.lines().map(parsed).collect();
    assert_eq!(missed(&kept), 0);
    // Who connects later gets what comes then, and both get the same.
    assert!(lines.len() > 500 && lines == kept[kept.len() - lines.len()..], "{} of {}", lines.len(), kept.len());
    assert_eq!(lines[0]["readings_v"].as_array().map(Vec::len), Some(256));
    std::fs::remove_file(file).unwrap();
}

#[test]
fn datagrams_are_lines_and_fewer_come_where_fewer_are_wanted() {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let to = format!("udp:{}", socket.local_addr().unwrap());
    let live = Live::start(&["--json", "--seconds", "3", "--stream", &to, "--stream-hz", "20"]);
    let mut buffer = [0; 65_536];
    let mut times_s = Vec::new();
    for _ in 0..20 {
        let count = socket.recv(&mut buffer).unwrap();
        let line = parsed(std::str::from_utf8(&buffer[..count]).unwrap());
        assert!(line["flags"].is_object() && line.get("readings_v").is_none(), "{line}");
        times_s.push(line["time_s"].as_f64().unwrap());
    }
    // In board time lines are never closer than 50 ms, but for a frame of 5 ms at either end; further apart where answers were skipped.
    let apart_s = (times_s[19] - times_s[4]) / 15.0;
    assert!(apart_s > 0.05 - 2.0 * 0.005 / 15.0 && apart_s < 0.1, "{times_s:?}");
    assert_eq!(live.end().0, Some(0));
}

#[test]
fn ports_that_are_busy_and_files_that_exist_are_said_before_anything_begins() {
    let busy = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = busy.local_addr().unwrap().port().to_string();
    let file = path("there.jsonl");
    std::fs::write(&file, "kept").unwrap();
    let there = file.to_str().unwrap();
    for (args, said) in [
        (["--stream", &format!("tcp:{port}")], "is busy"),
        (["--foxglove", &port], "is busy"),
        (["--stream", "tcp:192.0.2.1:9000"], "192.0.2.1:9000"),
        (["--stream", "udp:no-such-host.invalid:9000"], "no-such-host.invalid:9000"),
        (["--stream", there], "exists already, and no file is replaced"),
        (["--mcap", there], "exists already, and no file is replaced"),
    ] {
        let output = tactomo(&["live", "--simulate", "--seconds", "1", "--json"]).args(args).output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{args:?}: {error}");
        assert!(error.contains(said), "{args:?}: {error}");
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "kept");
    std::fs::remove_file(file).unwrap();
}

#[test]
fn wrong_streams_are_wrong_use() {
    for (args, said) in [
        (&["--stream", "tcp:nine"][..], "127.0.0.1:9000"),
        (&["--stream", "-", "--stream-fields", "forces"], "`forces`"),
        (&["--stream-hz", "10"], "--stream"),
        (&["--stream", "-", "--stream-hz", "0"], "a rate (lines a second) from 0.001 to 1000000"),
    ] {
        let output = tactomo(&["live", "--simulate"]).args(args).output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{args:?}: {error}");
        assert!(error.contains(said), "{args:?}: {error}");
    }
}
