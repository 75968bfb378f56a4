//! What is said of a detector and of what touches it goes through files and options into the model and back.

use tactomo_tests::{Folder, TACTOMO};

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
