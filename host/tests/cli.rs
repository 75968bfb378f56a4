//! The program as a user calls it: exit codes and messages.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

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
    let begun = std::time::Instant::now();
    while std::fs::metadata(&file).map_or(0, |file| file.len()) < 100_000 {
        assert!(begun.elapsed() < std::time::Duration::from_secs(60), "nothing is recorded");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let kill = |signal: &str| std::process::Command::new("kill").args([signal, &child.id().to_string()]).status();
    // A shell and the system may both tell of one terminal.
    assert!(kill("-HUP").unwrap().success());
    drop(kill("-HUP"));
    assert_eq!(child.wait().unwrap().code(), Some(0));
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

#[test]
fn a_detector_goes_through_its_file_into_the_model() {
    let folder = Folder::new("detector");
    let shown = TACTOMO.succeeds(&["detector", "show", "fingertip-10", "--material", "BC", "--toml"]);
    let file = folder.with("detector.toml", &shown);
    let read = |detector: &[&str]| {
        TACTOMO.succeeds(&[&["forward", "--contact", "1,0,1,1e-3", "--json", "--detector"], detector].concat())
    };
    assert_eq!(read(&[&file]), read(&["fingertip-10", "--material", "BC"]));
    assert_eq!(TACTOMO.succeeds(&["detector", "show", &file, "--toml"]), shown);
}

#[test]
fn a_file_says_how_soft_it_is_and_arguments_win() {
    let folder = Folder::new("skin");
    let bare = "[outline]\nsize_m = [0.06, 0.06]\n[[layers]]\nthickness_m = 0.005\nconductivity_s_per_m = 0.2273\n\
        [electrodes]\ngrid = [4, 4]\ndiameter_m = 0.004\n";
    let silent = folder.with("silent.toml", bare);
    let film = folder.with("film.toml", format!("{bare}[skin]\nyoung_pa = 0.35e6\nfilm_unit_pa = 40e3\n"));
    let ideal = folder.with("ideal.toml", format!("{bare}[skin]\nyoung_pa = 0.35e6\nideal_depth_m = 0.2e-3\n"));
    let conductance_s = |file: &str, arguments: &[&str]| {
        let press = ["forward", "--nodes", "500", "--press", "2,3,8,1", "--json", "--detector", file];
        TACTOMO.json(&[&press[..], arguments].concat())["touches"][0]["conductance_s"].as_f64().unwrap()
    };
    // Of the ball of 1 N on foam A: 6.6273 uS on its film of 80.90 kPa, 8.9165 mS on an ideal surface of 0.5 mm (by hand, tests of the contact mechanics).
    let near =
        |found_s: f64, by_hand_s: f64| assert!((found_s / by_hand_s - 1.0).abs() < 2e-4, "{found_s} {by_hand_s}");
    near(conductance_s(&film, &[]), 6.6273e-6 * (80.901f64 / 40.0).powi(3));
    near(conductance_s(&ideal, &[]), 8.9165e-3 * 2.5);
    near(conductance_s(&film, &["--surface", "measured"]), 6.6273e-6 * (80.901f64 / 40.0).powi(3));
    for wins in [&["--surface", "measured"][..], &["--elasticity", "0.35"], &["--material", "A"]] {
        near(conductance_s(&ideal, wins), 6.6273e-6);
    }
    near(conductance_s(&film, &["--surface", "ideal"]), 8.9165e-3);
    near(conductance_s(&silent, &["--material", "A"]), 6.6273e-6);
    for command in [&["forward", "--press", "2,3,8,1"][..], &["live", "--simulate", "--force", "1", "--seconds", "1"]] {
        let message = TACTOMO.refused(&[command, &["--detector", &silent]].concat());
        assert!(message.contains("how soft silent is") && message.contains("[skin]"), "{message}");
    }
    let live = TACTOMO.json(&["live", "--simulate", "--detector", &film, "--force", "3", "--seconds", "0.5", "--json"]);
    assert!(live["frames"].as_u64().is_some_and(|frames| frames > 0), "{live}");
}

#[test]
fn scenes_faults_and_noise_repeat_with_their_seed() {
    let measured = |seed| {
        let faults = ["--fault", "open:3", "--fault", "contact-spread:0.3", "--fault", "uneven:0.2"];
        let scene = ["forward", "--scene", "several", "--force", "2", "--measured", "--json", "--seed", seed];
        TACTOMO.succeeds(&[&scene[..], &faults].concat())
    };
    assert_eq!(measured("5"), measured("5"));
    assert_ne!(measured("5"), measured("6"));
}

#[test]
fn foam_creeps_and_drifts_up_to_the_time_asked_for() {
    let report = |more: &[&str]| TACTOMO.json(&[&["forward", "--contact", "0,0,3,1e-3", "--json"], more].concat());
    let conductance_s = |report: &serde_json::Value| report["touches"][0]["conductance_s"].as_f64().unwrap();
    let crept = report(&["--fault", "creep:0.2:3", "--time", "3"]);
    let expected_s = 1e-3 * (1.0 + 0.2 * (1.0 - (-1.0f64).exp()));
    assert!((conductance_s(&crept) / expected_s - 1.0).abs() < 1e-5, "{}", conductance_s(&crept));
    let drifted = report(&["--fault", "drift:0.2:86400", "--time", "86400"]);
    assert_eq!(conductance_s(&drifted), 1e-3);
    let [drifted, told] =
        [drifted, report(&["--fault", "conductivity:1.2"])].map(|report| report["readings_v"][5][10].as_f64().unwrap());
    assert!((drifted / told - 1.0).abs() < 2e-3, "{drifted} {told}");
}

#[test]
fn what_was_built_is_told_and_can_be_simulated_again() {
    let contact = ["forward", "--contact", "3,-4,2.5,0.001", "--json", "--as-built"];
    let report = |args: &[&str]| TACTOMO.json(args);
    let built = report(&[&contact[..], &["7"]].concat());
    let shown = TACTOMO.run(&["detector", "show", "square-60", "--as-built", "7"]);
    let toml = String::from_utf8(shown.stdout).unwrap();
    assert_eq!(built["as_built"].as_str().unwrap().trim_end(), toml.trim_end());
    assert_eq!(built["detector"], "square-60");
    let folder = Folder::new("as-built");
    let file = folder.with("as-built.toml", toml);
    assert_eq!(report(&[&contact[..], &[&file]].concat())["readings_v"], built["readings_v"]);
    let exact = ["forward", "--contact", "0,0,1,1e-3", "--detector", &file, "--as-built", "1"];
    assert!(TACTOMO.refused(&exact).contains("nothing to draw"));
    let described = report(&contact[..4]);
    assert!(described.get("as_built").is_none() && described["readings_v"] != built["readings_v"]);
    assert_ne!(report(&[&contact[..], &["8"]].concat())["readings_v"], built["readings_v"]);
}

#[test]
fn a_flat_detector_is_compiled_into_a_table() {
    let folder = Folder::new("compile");
    let file = folder.path("square.table");
    let compile = ["detector", "compile", "square-60", "--json", "--out", &file];
    let told = TACTOMO.json(&compile);
    let table = std::fs::read(&file).unwrap();
    assert_eq!((told["bytes"].as_u64(), told["electrodes"].as_u64()), (Some(table.len() as u64), Some(16)));
    assert!(table.starts_with(b"TCtb"), "{:?}", &table[..4]);
    let curved = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/detectors/fingertip.toml");
    let none = folder.path("curved.table");
    let why = TACTOMO.refused(&["detector", "compile", curved, "--out", &none]);
    assert!(why.contains("it is curved") && why.contains("`auto`"), "{why}");
    assert!(!std::path::Path::new(&none).exists());
}

#[test]
fn touches_go_through_their_file() {
    let folder = Folder::new("touches");
    let ring = r#"[{"centre_m": [0.002, 0.0], "shape": {"ring": {"radius_m": 0.01, "width_m": 0.002}}, "conductance_s": 0.001}]"#;
    let touches = folder.with("touches.json", ring);
    let report = TACTOMO.json(&["forward", "--nodes", "500", "--json", "--touches", &touches]);
    assert_eq!(report["touches"], serde_json::from_str::<serde_json::Value>(ring).unwrap());
    assert_eq!(report["readings_v"].as_array().unwrap().len(), 16);
    let wrong = folder.with("wrong.json", ring.replace("width_m", "breadth_m"));
    let message = TACTOMO.refused(&["forward", "--nodes", "500", "--touches", &wrong]);
    assert!(message.contains("is no list of touches: missing field `width_m`"), "{message}");
}

#[test]
fn a_press_in_newtons_is_the_contact_that_hertz_tells() {
    // As computed by hand in the tests of the contact mechanics.
    let told = ["--contact", "2,3,2.498666,8.916526e-3"];
    let pressed = ["--press", "2,3,8,1", "--surface", "ideal"];
    let rows = |arguments: &[&str]| {
        let output = TACTOMO.run(&[&["forward", "--nodes", "500"], arguments].concat());
        String::from_utf8(output.stdout).unwrap()
    };
    assert!(rows(&told).contains("readings (mV)"));
    assert_eq!(rows(&told), rows(&pressed));
    // As measured: 76.48 kPa in the middle conduct (76.476 / 80.901)^3 S/m2, of which two fifths are left over the disc of 19.614 mm2; its radius is sqrt(4 / 7) of Hertz's.
    assert_eq!(rows(&["--contact", "2,3,1.888814,6.627302e-6"]), rows(&["--press", "2,3,8,1"]));
}

/// Names of the patches that a body's detectors were told by, in their order, and how it ended.
fn patches_of(body: &str) -> (Vec<String>, Option<i32>, String) {
    let output = TACTOMO.run(&["live", "--body", body, "--seconds", "0.5", "--json"]);
    let text = String::from_utf8(output.stdout).unwrap();
    let of = |line: &str| serde_json::from_str::<serde_json::Value>(line).unwrap();
    let told = text.lines().map(of).filter(|line| line["frames"].as_u64() > Some(50));
    let mut names: Vec<_> = told.map(|line| line["patch"].as_str().unwrap().to_owned()).collect();
    names.sort_unstable();
    (names, output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn the_detectors_of_a_body_are_shown_each_by_its_name() {
    let (names, code, messages) = patches_of(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/bodies/hand.toml"));
    assert_eq!((names.join(" "), code), ("index little middle ring thumb".to_owned(), Some(0)), "{messages}");
    let (names, code, messages) = patches_of(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/bodies/gripper.toml"));
    assert_eq!((names.join(" "), code), ("left right".to_owned(), Some(0)), "{messages}");
}

#[test]
fn contacts_that_the_board_finds_are_streamed_recorded_and_shown_again() {
    let folder = Folder::new("board-sends");
    let [first, again, slowly, both, solved] =
        ["first", "again", "slowly", "both", "solved"].map(|name| folder.path(&format!("{name}.jsonl")));
    let (recording, detector) = (folder.path("contacts.tactomo"), folder.path("forces.toml"));
    let law = "[force]\nconductance_at_1_n_s = 0.00204\nexponent = 0.471\nseries_ohm = 85.8\n\
               covariance = [[1.07e-3, 3.1e-4, 0.522], [3.1e-4, 9.2e-5, 0.149], [0.522, 0.149, 260.0]]\n\
               scatter = 0.0069\nhysteresis = 0.0\nrange_n = [0.05, 2.6]\npresses = 10\n";
    std::fs::write(
        &detector,
        [&TACTOMO.succeeds(&["detector", "show", "square-60", "--toml"])[..], law.as_bytes()].concat(),
    )
    .unwrap();
    let live = ["live", "--json", "--stream"];
    let scene = ["--simulate", "--board", "ideal", "--scene", "single", "--detector", &detector];
    let board = [&scene[..], &["--seconds", "4", "--board-sends"]].concat();
    let found = |file: &str, options: &[&str]| {
        let output = TACTOMO.run(&[&live, &[file][..], options].concat());
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let text = std::fs::read_to_string(file).unwrap();
        let lines: Vec<serde_json::Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert!(lines.len() > 50, "{} lines", lines.len());
        (lines.len(), of_last(&lines))
    };
    let (count, told) = found(&first, &[&board[..], &["contacts", "--record", &recording]].concat());
    let (played, answer) = found(&again, &["--replay", &recording, "--speed", "max"]);
    assert!(played >= count, "{played} of {count}");
    assert_eq!(answer, told);
    // Longer than a board is waited for that does not answer.
    found(&slowly, &["--replay", &recording, "--speed", "0.5"]);
    let ([x_m, y_m, _], (_, [both_x_m, both_y_m, _])) = (told, found(&both, &[&board[..], &["both"]].concat()));
    assert!((both_x_m - x_m).hypot(both_y_m - y_m) < 5e-4, "{both_x_m} {both_y_m} {told:?}");
    // Without a board: what it found, with the newtons that live made of it, of every frame.
    let info = TACTOMO.succeeds(&["recording", "info", "--json", &recording]);
    let info: serde_json::Value = serde_json::from_slice(&info).unwrap();
    assert!(info["without_readings"] == info["frames"] && info["missing_frames"] == 0, "{info}");
    TACTOMO.succeeds(&["export", &recording, "--to", "jsonl", "--out", &solved]);
    let text = std::fs::read_to_string(&solved).unwrap();
    let lines: Vec<serde_json::Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((lines.len() as u64, of_last(&lines)), (info["frames"].as_u64().unwrap(), told));
}

/// Place (m) and force (N) of the first contact of the last answer.
fn of_last(answers: &[serde_json::Value]) -> [f64; 3] {
    let contact = &answers.last().unwrap()["contacts"][0];
    ["x_m", "y_m", "force_n"].map(|name| contact[name].as_f64().unwrap())
}

#[test]
fn a_stream_of_several_detectors_names_each_and_keeps_the_order_of_its_times() {
    let (folder, body) = (Folder::new("several"), concat!(env!("CARGO_MANIFEST_DIR"), "/examples/bodies/hand.toml"));
    let stream = folder.path("hand.jsonl");
    let output = TACTOMO.run(&["live", "--body", body, "--seconds", "2", "--json", "--stream", &stream]);
    assert_eq!(output.status.code(), Some(0));
    let text = std::fs::read_to_string(&stream).unwrap();
    let mut times = std::collections::BTreeMap::<String, Vec<f64>>::new();
    for line in text.lines() {
        let line: serde_json::Value = serde_json::from_str(line).unwrap();
        let patch = line["patch"].as_str().unwrap().to_owned();
        times.entry(patch).or_default().push(line["time_s"].as_f64().unwrap());
    }
    let names: Vec<_> = times.keys().map(String::as_str).collect();
    assert_eq!(names, ["index", "little", "middle", "ring", "thumb"]);
    assert!(times.values().all(|times| times.len() > 50 && times.is_sorted()));
}

#[test]
fn boards_that_are_recorded_in_a_folder_are_cut_and_shown_again_as_one() {
    let folder = Folder::new("boards");
    let [taken, piece, mcap] = ["taken", "piece", "all.mcap"].map(|name| folder.path(name));
    let args = ["live", "--simulate", "2", "--seconds", "1", "--json", "--record", &taken, "--mcap", &mcap];
    let output = TACTOMO.run(&args);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let bytes = std::fs::read(&mcap).unwrap();
    let has = |topic: &str| bytes.windows(topic.len()).any(|at| at == topic.as_bytes());
    assert!(has("/tactomo/board-1/touch") && has("/tactomo/board-2/readings") && !has("/tactomo/touch"));
    let again = TACTOMO.run(&args);
    assert!(again.status.code() == Some(1) && String::from_utf8_lossy(&again.stderr).contains("taken"));
    let output = TACTOMO.run(&["recording", "cut", &taken, "--from", "0.4", "--out", &piece]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let frames = |folder: &str| -> Vec<u64> {
        ["board-1", "board-2"]
            .map(|name| format!("{folder}/{name}.tactomo"))
            .map(|file| {
                let info = TACTOMO.json(&["recording", "info", &file, "--json"]);
                info["frames"].as_u64().unwrap()
            })
            .to_vec()
    };
    let (all, cut) = (frames(&taken), frames(&piece));
    assert!(all.iter().zip(&cut).all(|(all, cut)| *cut > 20 && cut < all), "{all:?} {cut:?}");
    let (names, code, messages) = patches_of(&piece);
    assert_eq!((names.join(" "), code), ("board-1 board-2".to_owned(), Some(0)), "{messages}");
}

#[cfg(unix)]
#[test]
fn of_a_folder_of_recordings_no_link_is_followed_and_nothing_acts() {
    use std::os::unix::fs::symlink;

    let folder = Folder::new("foreign");
    let [taken, piece, out] = ["taken", "piece", "out.tactomo"].map(|name| folder.path(name));
    TACTOMO.succeeds(&["live", "--simulate", "2", "--seconds", "0.5", "--json", "--record", &taken]);
    let body = format!("{taken}/body.toml");
    let sound = std::fs::read_to_string(&body).unwrap();
    let acting = sound.replacen("[[patch]]", &format!("[[patch]]\nrecord = \"{out}\""), 1);
    std::fs::write(&body, acting).unwrap();
    let refused = TACTOMO.refused(&["live", "--body", &taken, "--seconds", "0.5", "--json"]);
    assert!(refused.contains("patch board-1 of ") && refused.contains("\"record\""), "{refused}");
    assert!(!std::path::Path::new(&out).exists());
    let secret = folder.with("secret", &sound);
    let cut = ["recording", "cut", &taken, "--out", &piece];
    std::fs::remove_file(&body).unwrap();
    symlink(&secret, &body).unwrap();
    assert!(TACTOMO.refused(&cut).contains("it is a link"));
    std::fs::remove_file(&body).unwrap();
    let recording = format!("{taken}/board-1.tactomo");
    std::fs::rename(&recording, &out).unwrap();
    symlink(&out, &recording).unwrap();
    assert!(TACTOMO.refused(&cut).contains("it is a link"));
    assert!(!std::path::Path::new(&piece).exists());
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

#[test]
fn a_table_is_checked_before_a_board_hears_of_it() {
    let folder = Folder::new("table");
    let [whole, small] = ["whole.table", "small.table"].map(|name| folder.path(name));
    TACTOMO.succeeds(&["detector", "compile", "square-60", "--out", &whole]);
    TACTOMO.succeeds(&["detector", "compile", "display-140x70", "--out", &small]);
    let bytes = std::fs::read(&whole).unwrap();
    let changed = |at: usize| [&bytes[..at], &[bytes[at] ^ 1], &bytes[at + 1..]].concat();
    // A port that is none: nothing is said there.
    let given = |file: &str, to: &[&str]| TACTOMO.run(&[&["board", "table", "--file", file], to].concat());
    for (bytes, told) in [
        (changed(0), "no table of a detector"),
        (changed(4), "version"),
        (changed(bytes.len() / 2), "checksum"),
        (bytes[..bytes.len() - 9].to_vec(), "bytes where"),
        ([&bytes[..], &[0]].concat(), "bytes"),
        (Vec::new(), "no table of a detector"),
    ] {
        let output = given(&folder.with("damaged.table", bytes), &["--port", "/no/such/port"]);
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(1) && message.contains("damaged.table"), "{message}");
        assert!(message.contains(told) && !message.contains("/no/such/port"), "{told}: {message}");
    }
    let output = given(&small, &["--simulate", "--board", "ideal"]);
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(1) && message.contains("the table is of"), "{message}");
    let output = given(&whole, &["--simulate", "--board", "ideal"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn places_on_a_body_stay_with_a_folder_of_recordings() {
    let folder = Folder::new("body");
    let [taken, piece, both, again, mcap] =
        ["taken", "piece", "both", "again", "all.mcap"].map(|name| folder.path(name));
    let place = "place = { xyz_m = [0.1, 0.0, -0.02], rpy_rad = [0.0, 0.5, 0.0] }";
    let text =
        format!("[[patch]]\nname = \"left\"\nsimulate = true\n{place}\n[[patch]]\nname = \"right\"\nsimulate = true\n");
    let body = folder.with("body.toml", text);
    let runs = |args: &[&str]| {
        let output = TACTOMO.run(args);
        assert_eq!(output.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    };
    runs(&["live", "--body", &body, "--seconds", "0.5", "--json", "--record", &taken]);
    runs(&["recording", "cut", &taken, "--to", "0.4", "--out", &piece]);
    runs(&["recording", "merge", &piece, &taken, "--out", &both]);
    runs(&["recording", "check", &both]);
    let kept = std::fs::read_to_string(format!("{both}/body.toml")).unwrap();
    assert!(
        kept.contains(&format!("replay = \"left.tactomo\"\n{place}\n")) && kept.matches("place").count() == 1,
        "{kept}"
    );
    runs(&["live", "--body", &both, "--seconds", "0.5", "--json", "--mcap", &mcap]);
    // Folders and commands of before have another word.
    std::fs::rename(format!("{both}/body.toml"), format!("{both}/skin.toml")).unwrap();
    runs(&["recording", "cut", &both, "--out", &again]);
    assert_eq!(std::fs::read_to_string(format!("{again}/body.toml")).unwrap(), kept);
    runs(&["live", "--skin", &both, "--seconds", "0.5", "--json"]);
    let bytes = std::fs::read(&mcap).unwrap();
    let has = |text: &str| bytes.windows(text.len()).any(|at| at == text.as_bytes());
    assert!(has("/tactomo/left/tf") && has("foxglove.FrameTransform") && !has("/tactomo/right/tf"));
    assert!(has(place.trim_start_matches("place = ")), "the file says where the detector was");
}

#[test]
fn a_patch_that_fails_is_named_and_harms_no_other() {
    let folder = Folder::new("lame");
    let text = "[[patch]]\nname = \"lame\"\nport = \"/dev/null\"\n[[patch]]\nname = \"sound\"\nsimulate = true\n";
    let (names, code, messages) = patches_of(&folder.with("body.toml", text));
    assert_eq!((names, code), (vec!["sound".to_owned()], Some(1)), "{messages}");
    assert!(messages.contains("patch lame") && messages.contains("/dev/null"), "{messages}");
    let (_, code, messages) = patches_of("no/such.toml");
    assert!(code == Some(1) && messages.contains("no/such.toml"), "{messages}");
}
