//! Used rightly or wrongly: help, exit codes, messages, files that are there or full, pipes that are closed.

use tactomo_tests::{Folder, TACTOMO};

#[test]
fn every_command_has_a_help_with_an_example() {
    for command in [
        "live",
        "ports",
        "record",
        "recording",
        "replay",
        "export",
        "forward",
        "reconstruct",
        "detector",
        "calibrate",
        "board",
    ] {
        let output = TACTOMO.run(&[command, "--help"]);
        let text = String::from_utf8(output.stdout).unwrap();
        assert_eq!(output.status.code(), Some(0));
        assert!(text.contains("Example") && text.contains(&format!("tactomo {command}")), "{command}: {text}");
    }
}

#[test]
fn wrong_use_exits_with_2_and_names_the_argument() {
    for (args, named) in [
        (&["live", "--detector", "round-9"][..], "square-60"),
        (&["live", "--average", "3"], "--average"),
        (&["live", "--port", "/dev/ttyUSB0", "--replay", "some.file"], "--replay"),
        (&["live", "--port", "/dev/ttyUSB0", "--simulate"], "--simulate"),
        (&["live", "--speed", "2"], "--replay"),
        (&["replay", "some.file", "--speed", "0"], "max"),
        (&["record", "some.file", "--material", "AX"], "A, B, C or D"),
        (&["record"], "FILE"),
        (&["live", "--scene", "ring"], "--simulate"),
        (&["record", "some.file", "--fault", "open:3"], "--simulate"),
        (&["live", "--as-built", "7"], "--simulate"),
        (&["record", "some.file", "--board", "esp32"], "--simulate"),
        (&["live", "--simulate", "--board", "esp8266"], "ideal, esp32, esp32c3"),
        (&["forward", "--as-built", "7", "--save-jacobian", "some.file"], "--save-jacobian"),
        (&["forward", "--as-built", "seven"], "a seed, or a detector"),
        (&["forward", "--scene", "jazz"], "rolling-ball"),
        (&["forward", "--fault", "open"], "open:3, short:2,7"),
        (&["forward", "--press", "0,0,2.5"], "tip_radius_mm,force_n"),
        (&["forward", "--contact", "0,0,1,1e-3", "--time", "-2"], "a time (s) from 0 to"),
        (&["forward", "--contact", "1,1,1,1e308"], "conductance_s is 1e308, but has to be from 1e-12"),
        (&["forward", "--press", "1,1,1,1e308"], "a force from 1e-6 N to 10000.0 N: 0.001 m and 1e308 N are given"),
        (&["forward", "--scene", "single", "--force", "1", "--poisson", "0.6"], "a ratio from -0.99 to 0.5"),
        (&["live", "--simulate", "--force", "-3"], "invalid value '-3' for '--force <NEWTONS>': a force (N) from"),
        (&["record", "some.file", "--seconds", "-1"], "invalid value '-1' for '--seconds <SECONDS>': a time (s) from"),
        (&["forward", "--fault", "driving-sheet:100:3"], "1 or 2 points"),
        (&["live", "--time-factor", "10"], "--simulate"),
        (&["live", "--simulate", "--time-factor", "1e300"], "a factor from 0.001 to 1000000"),
        (&["calibrate", "force", "some.csv", "--out", "cal.toml"], "--newtons <N,N,...>|--forces <FILE>"),
        (&["dance"], "dance"),
    ] {
        let (code, message) = TACTOMO.failure(args);
        assert_eq!(code, Some(2), "{args:?}: {message}");
        assert!(message.contains(named), "{args:?}: {message}");
    }
}

#[test]
fn what_fails_exits_with_1_and_says_what_to_do() {
    let text = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    let elf = if cfg!(feature = "log") { "is not the ELF file of a firmware" } else { "--features log" };
    for (args, told) in [
        (&["live", "--port", "/dev/ttyNOT7", "--json"][..], "there is no serial port /dev/ttyNOT7"),
        (&["live", "--port", "/dev/null", "--json"], "/dev/null is not a serial port; `tactomo ports`"),
        (&["replay", "no/such.tactomo", "--json"], "cannot open the recording no/such.tactomo: No such file"),
        (&["replay", text, "--json"], "is not a recording of tactomo"),
        (&["detector", "check", "no/such.toml"], "cannot read the detector no/such.toml: No such file"),
        (&["forward", "--detector", text, "--contact", "0,0,1,1e-3"], "unknown field `"),
        (&["forward", "--scene", "rest"], "nothing to compute"),
        (&["forward", "--scene", "single", "--fault", "swap:3,16"], "swap:3,16: there is no electrode 16"),
        (
            &["forward", "--model", "shell", "--scene", "single", "--fault", "driving-sheet:100"],
            "its driving layer has a sheet resistance, which only the slab can have",
        ),
        (&["forward", "--fault", "leak:0.01", "--save-jacobian", "no.jacobian"], "leave out --fault leak"),
        (&["live", "--port", "/dev/null", "--elf", text, "--json"], elf),
        (&["replay", "/tmp", "--json"], "/tmp is a folder, not a recording: name one of the recordings in it"),
        (&["recording", "info", "/tmp"], "/tmp is a folder, not a recording: name one of the recordings in it"),
    ] {
        let (code, message) = TACTOMO.failure(args);
        assert_eq!(code, Some(1), "{args:?}: {message}");
        assert!(message.contains(told), "{args:?}: {message}");
    }
}

/// Commands that write a file, but for its name.
const OUTPUTS: [&[&str]; 13] = [
    &["live", "--port", "/dev/null", "--json", "--record"],
    &["live", "--simulate", "--seconds", "1", "--json", "--stream"],
    &["live", "--simulate", "--seconds", "1", "--json", "--mcap"],
    &["live", "--simulate", "2", "--seconds", "1", "--json", "--record"],
    &["record", "--simulate", "--seconds", "1"],
    &["recording", "cut", RECORDING, "--out"],
    &["recording", "merge", RECORDING, RECORDING, "--out"],
    &["export", RECORDING, "--to", "csv", "--out"],
    &["reconstruct", RECORDING, "--out"],
    &["detector", "show", "--svg"],
    &["detector", "compile", "--out"],
    &["forward", "--save-jacobian"],
    &["calibrate", "rub", "--simulate", "--out"],
];

/// A recording of some frames.
const RECORDING: &str = "taken.tactomo";

#[test]
fn no_output_replaces_a_file_and_each_says_so_with_the_same_words() {
    let folder = Folder::new("outputs");
    let run = |args: &[&str], out: &str| {
        let output = TACTOMO.command().current_dir(folder.path("")).args(args).arg(out).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    assert_eq!(run(&["record", "--simulate", "--seconds", "0.2"], RECORDING).0, Some(0));
    folder.with("there.csv", "precious");
    for args in OUTPUTS {
        for (out, told) in [
            ("there.csv", "there.csv exists already, and no file is replaced: give another name, or remove it first"),
            ("none/a.csv", "cannot write none/a.csv: there is no folder none; make it first"),
        ] {
            let (code, message) = run(args, out);
            assert_eq!(code, Some(1), "{args:?} {out}: {message}");
            assert!(message.contains(told), "{args:?} {out}: {message}");
            assert_eq!(message.matches("exists").count(), usize::from(told.contains("exists")), "{args:?}: {message}");
        }
    }
    assert_eq!(std::fs::read_to_string(folder.path("there.csv")).unwrap(), "precious");
    let left = std::fs::read_dir(folder.path("")).unwrap().count();
    assert_eq!(left, 2, "nothing but what was there");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_told_with_the_file_and_what_to_do() {
    let folder = Folder::new("full");
    let taken = folder.path(RECORDING);
    TACTOMO.succeeds(&["record", &taken, "--simulate", "--seconds", "0.5"]);
    let export = |form| vec!["export", &taken, "--solver", "contacts", "--to", form];
    for args in [
        export("csv"),
        export("jsonl"),
        export("npz"),
        export("mcap"),
        [export("mcap"), vec!["--profile", "ros2"]].concat(),
        vec!["recording", "merge", &taken, &taken],
        vec!["recording", "cut", &taken],
    ] {
        let (code, message) = TACTOMO.failure(&[&args[..], &["--out", "/dev/full"]].concat());
        assert_eq!(code, Some(1), "{args:?}: {message}");
        let told = "error: cannot write /dev/full: the disk is full; make room on it, or write to another one";
        assert!(message.lines().last() == Some(told), "{args:?}: {message}");
    }
}

#[cfg(unix)]
#[test]
fn a_terminal_that_is_closed_ends_a_recording_in_good_order() {
    let folder = Folder::new("hangup");
    let file = folder.path(RECORDING);
    let mut child = TACTOMO.command().args(["record", &file, "--simulate"]).spawn().unwrap();
    let wait_for = |what: &str, is_there: &mut dyn FnMut() -> bool| {
        let begun = std::time::Instant::now();
        while !is_there() {
            assert!(begun.elapsed() < std::time::Duration::from_secs(60), "{what}");
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
    };
    wait_for("nothing is recorded", &mut || std::fs::metadata(&file).map_or(0, |file| file.len()) >= 100_000);
    let kill = |signal: &str| std::process::Command::new("kill").args([signal, &child.id().to_string()]).status();
    // A shell and the system may both tell of one terminal.
    assert!(kill("-HUP").unwrap().success());
    drop(kill("-HUP"));
    let mut ended = None;
    wait_for("it goes on; if these tests run under nohup, it is told to", &mut || {
        ended = child.try_wait().unwrap();
        ended.is_some()
    });
    assert_eq!(ended.and_then(|status| status.code()), Some(0));
    assert!(
        String::from_utf8(TACTOMO.succeeds(&["recording", "check", &file])).unwrap().contains("nothing is missing")
    );
}

/// Runs a command whose stdout, or stderr, or both are pipes that nobody reads any more.
fn with_closed(args: &[&str], [stdout, stderr]: [bool; 2]) -> (Option<i32>, String) {
    let pipe = |is_closed: bool| {
        let (reader, writer) = std::io::pipe().unwrap();
        (if is_closed { None } else { Some(reader) }, writer)
    };
    let (stdout_reader, stdout) = pipe(stdout);
    let (stderr_reader, stderr) = pipe(stderr);
    let mut child = TACTOMO.command().args(args).stdout(stdout).stderr(stderr).spawn().unwrap();
    let drained = std::thread::spawn(move || stdout_reader.map(std::io::read_to_string));
    let messages = stderr_reader.map_or_else(String::new, |reader| std::io::read_to_string(reader).unwrap());
    drop(drained.join().unwrap());
    (child.wait().unwrap().code(), messages)
}

#[test]
fn pipes_that_are_closed_end_the_program_without_a_panic() {
    const PANICKED: i32 = 101;
    let commands: [&[&str]; 6] = [
        &["detector", "list"],
        &["forward", "--contact", "0,0,2,1e-3"],
        &["live", "--simulate", "--seconds", "0.3", "--json"],
        &["replay", "no/such.tactomo", "--json"],
        &["reconstruct", "no/such.csv"],
        &["live", "--port", "/dev/null", "--json"],
    ];
    for args in commands {
        let (unread, _) = with_closed(args, [false, false]);
        for closed in [[true, false], [false, true], [true, true]] {
            let (code, messages) = with_closed(args, closed);
            assert_eq!(code, unread, "{args:?} with stdout and stderr closed: {closed:?}");
            assert!(code != Some(PANICKED) && !messages.contains("panicked"), "{args:?}: {messages}");
        }
    }
}

#[test]
fn reconstruct_ends_quietly_when_nobody_reads_on() {
    let frame = ["0.001"; 256].join(",") + "\n";
    let folder = Folder::new("unread");
    let table = folder.with("unread.csv", frame.repeat(2000));
    let (code, messages) = with_closed(&["reconstruct", &table, "--json"], [true, false]);
    assert_eq!(code, Some(0), "{messages}");
    assert!(!messages.contains("2000 frames"), "it went on for nobody: {messages}");
}

#[cfg(unix)]
#[test]
fn a_pipe_is_no_recording_and_nobody_waits_for_it() {
    let folder = Folder::new("pipe");
    let [pipe, out] = ["pipe.tactomo", "out"].map(|name| folder.path(name));
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    // Whoever waits for it is let go, with nothing in it.
    let writer = pipe.clone();
    std::thread::spawn(move || while std::fs::OpenOptions::new().write(true).open(&writer).is_ok() {});
    let recording = |before: &[&'static str]| [before, &["PIPE"]].concat();
    for args in [
        recording(&["live", "--json", "--replay"]),
        recording(&["live", "--json", "--detector", "square-60", "--replay"]),
        recording(&["replay", "--json"]),
        recording(&["recording", "info"]),
        recording(&["recording", "check"]),
        recording(&["recording", "cut", "--out", "OUT"]),
        recording(&["recording", "merge", "--out", "OUT", "PIPE"]),
        recording(&["export", "--to", "csv", "--out", "OUT"]),
        recording(&["reconstruct"]),
        recording(&["calibrate", "rub", "--out", "OUT"]),
        recording(&["calibrate", "presses", "--known", "1:0,0", "--out", "OUT"]),
        recording(&["calibrate", "force", "--newtons", "1,2,3,4", "--out", "OUT"]),
    ] {
        let named = |arg: &&str| match *arg {
            "PIPE" => pipe.clone(),
            "OUT" => out.clone(),
            other => other.to_owned(),
        };
        let args: Vec<String> = args.iter().map(named).collect();
        // What a check finds is its output.
        let output = TACTOMO.run(&args.iter().map(String::as_str).collect::<Vec<_>>());
        let (code, message) =
            (output.status.code(), String::from_utf8([output.stdout, output.stderr].concat()).unwrap());
        assert!(message.contains("pipe.tactomo: it is no regular file"), "{args:?}: {message}");
        assert_eq!(code, Some(1), "{args:?}: {message}");
    }
}

#[cfg(unix)]
#[test]
fn files_without_end_are_refused_by_their_formats_limit() {
    let zeros = "/dev/zero";
    let live = ["live", "--simulate", "--json", "--seconds", "0.5"];
    for (args, told) in [
        (&["live", "--json", "--body", zeros][..], "a body's file"),
        (&[&live[..], &["--jacobian", zeros]].concat(), "a Jacobian"),
        (&[&live[..], &["--learned", zeros]].concat(), "`tactomo-lab learn`"),
        (&["forward", "--touches", zeros], "a list of touches"),
        (&["board", "table", "--simulate", "--file", zeros], "a table of a detector"),
    ] {
        let (code, message) = TACTOMO.failure(args);
        assert!(code != Some(0) && message.contains(told) && message.contains("zero"), "{args:?}: {message}");
    }
}
