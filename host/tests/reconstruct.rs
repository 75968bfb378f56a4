//! `tactomo reconstruct` as a user calls it.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use serde_json::Value;
use tactomo::board::identity::identity;
use tactomo::board::record::{Header, RecordWriter};
use tactomo::detector::{Calibration, Detector, Tolerances};
use tactomo::schema::{CONTACT_COLUMNS, Kind, csv_heads};
use tactomo::table::{NpzWriter, Table};
use tactomo_protocol::{BoardMessage, FrameHead, Hello, MAX_WIRE, encode_board, encode_frame};
use tactomo_tests::{Folder, TACTOMO, csv};

const PLACE_MM: [f64; 2] = [9.0, -6.0];

/// Readings that `forward` has (V), row by row.
fn forward(args: &[&str]) -> Vec<f64> {
    let report = TACTOMO.json(&[&["forward", "--json"], args].concat());
    let rows = report["readings_v"].as_array().unwrap();
    rows.iter().flat_map(|row| row.as_array().unwrap()).map(|volts| volts.as_f64().unwrap()).collect()
}

/// Readings of a light contact (V), row by row.
fn readings() -> Vec<f64> {
    forward(&["--contact", &format!("{},{},2,2e-4", PLACE_MM[0], PLACE_MM[1])])
}

/// The objects that the command prints.
fn lines(args: &[&str]) -> Vec<Value> {
    TACTOMO.lines(&[&["reconstruct"], args, &["--json"]].concat())
}

/// The objects that the command prints, and what it says beside them.
fn told(args: &[&str]) -> (Vec<Value>, String) {
    let output = TACTOMO.run(&[&["reconstruct"], args, &["--json"]].concat());
    let [lines, messages] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert_eq!(output.status.code(), Some(0), "{messages}");
    (lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect(), messages)
}

/// Whether all answers are flagged as misfits.
fn are_flagged(lines: &[Value]) -> bool {
    lines.iter().all(|line| line["flags"]["misfit"] == true)
}

/// Four frames at rest and two of a firm press (V).
fn press_after_rest() -> Vec<Vec<f64>> {
    let press = forward(&["--contact", "12,-8,4,1e-3"]);
    [vec![vec![0.0; 256]; 4], vec![press; 2]].concat()
}

fn assert_found(line: &Value) {
    let contact = &line["contacts"][0];
    let [x_mm, y_mm] = ["x_m", "y_m"].map(|key| contact[key].as_f64().unwrap() * 1e3);
    assert!((x_mm - PLACE_MM[0]).hypot(y_mm - PLACE_MM[1]) < 5.0, "{contact}");
}

#[test]
fn tables_of_every_kind_give_the_same_contacts() {
    let folder = Folder::new("tables-of-every-kind-give-the-same-contacts");
    let (readings, nothing) = (readings(), vec![0.0; 256]);
    let frames = [nothing, readings];
    let text = folder.with("frames.csv", csv(&frames));
    let archive = folder.path("frames.npz");
    let mut writer = NpzWriter::new(std::fs::File::create(&archive).unwrap());
    writer.add("other", &[1], &[1.0]).unwrap();
    writer.add("readings_v", &[2, 16, 16], &frames.concat()).unwrap();
    writer.finish().unwrap();
    let [from_text, from_archive] =
        [&text, &archive].map(|file| lines(&[file, "--solver", "tikhonov", "--lambda", "gcv"]));
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
    let folder = Folder::new("frames-at-rest-are-subtracted");
    let offset = |volts: &f64| volts + 0.05;
    let pressed: Vec<f64> = readings().iter().map(offset).collect();
    let file = folder.with("rest.csv", csv(&[vec![0.05; 256], vec![0.05; 256], pressed]));
    let found = lines(&[&file, "--rest", "2"]);
    assert_eq!((found.len(), found[0]["frame"].as_u64()), (1, Some(2)));
    assert_found(&found[0]);
}

#[test]
fn leakage_in_a_table_is_taken_off_under_load_as_live_takes_it_off() {
    let folder = Folder::new("leakage-in-a-table-is-taken-off-under-load-as-live-takes-it-off");
    let (rest, pressed) =
        (forward(&["--fault", "leak:0.01"]), forward(&["--fault", "leak:0.01", "--contact", "9,-6,3,1e-3"]));
    let file = folder.with("leak.csv", csv(&[vec![rest; 40], vec![pressed]].concat()));
    let detector = folder.with("exact.toml", Detector::default().taken_as_exact().to_toml());
    let solver = ["--solver", "contacts", "--detector", &detector];
    for rest in [&["--rest", "40"][..], &[]] {
        let found = lines(&[&[file.as_str()], &solver[..], rest].concat());
        let contacts = &found.last().unwrap()["contacts"];
        let ratio = contacts[0]["conductance_s"].as_f64().unwrap() / 1e-3;
        assert!((0.9..1.1).contains(&ratio) && contacts.as_array().unwrap().len() == 1, "{rest:?}: {contacts}");
        // With the readings at rest alone taken off 0.5 is left.
        assert!(found.last().unwrap()["residual"].as_f64().unwrap() < 0.1, "{rest:?}: {}", found.last().unwrap());
    }
}

#[test]
fn a_driving_sheet_that_nobody_described_is_in_the_standard_error_of_conductances() {
    let folder = Folder::new("a-driving-sheet-that-nobody-described-is-in-the-standard-error-of-conductances");
    // Of a detector that is known but for its driving layer.
    let tolerances = Tolerances { driving_sheet_ohm: 100.0, ..Tolerances::EXACT };
    let detector = folder.with("driven.toml", Detector { tolerances, ..Detector::default() }.to_toml());
    for (contact, conductance_s) in [("9,-6,3,3e-4", 3e-4), ("-14,11,3,1.5e-3", 1.5e-3), ("0,0,3,5e-3", 5e-3)] {
        let readings = forward(&["--fault", "driving-sheet:100", "--contact", contact]);
        let file = folder.with("sheet.csv", csv(&[readings]));
        let found = lines(&[&file, "--solver", "contacts", "--detector", &detector]);
        let contacts = &found[0]["contacts"];
        let of = |name: &str| contacts[0][name].as_f64().unwrap();
        let off = (of("conductance_s") / conductance_s).ln() / (of("sigma_conductance_s") / of("conductance_s"));
        assert!(off.abs() < 2.0 && contacts.as_array().unwrap().len() == 1, "{contact}: {off} {contacts}");
    }
}

#[test]
fn gains_that_the_detectors_file_tells_are_taken_off_the_readings() {
    let folder = Folder::new("gains-that-the-detectors-file-tells-are-taken-off-the-readings");
    let mut detector = Detector::default();
    detector.electrodes.iter_mut().enumerate().for_each(|(e, pad)| pad.gain = [1.0, 1.05, 0.96][e % 3]);
    let file = folder.with("gains.toml", detector.to_toml());
    let amplified = readings().iter().enumerate().map(|(k, volts)| volts * detector.electrodes[k % 16].gain).collect();
    let table = folder.with("gains.csv", csv(&[amplified]));
    let found = |args: &[&str]| lines(&[&[&table, "--solver", "contacts"], args].concat()).remove(0);
    let error_m = |line: &Value| {
        let [x_m, y_m] = ["x_m", "y_m"].map(|name| line["contacts"][0][name].as_f64().unwrap());
        (x_m - 1e-3 * PLACE_MM[0]).hypot(y_m - 1e-3 * PLACE_MM[1])
    };
    let [told, untold] = [&["--detector", &file][..], &[]].map(|args| error_m(&found(args)));
    assert!(told < 2e-4 && untold > 5.0 * told, "{told} {untold}");
}

#[test]
fn a_recording_on_another_board_than_the_calibrated_one_is_reported() {
    let folder = Folder::new("a-recording-on-another-board-than-the-calibrated-one-is-reported");
    let warning = |board: String| {
        let calibration = Calibration { board: Some(board), ..Calibration::default() };
        let detector = Detector { calibration: Some(calibration), ..Detector::default() };
        let file = folder.with("calibrated.toml", detector.to_toml());
        let recording = recording_of(&folder, "calibrated.tactomo", 0..40);
        let output = TACTOMO.run(&["reconstruct", &recording, "--detector", &file, "--json"]);
        assert_eq!(output.status.code(), Some(0));
        String::from_utf8(output.stderr).unwrap().contains("calibrated on another board")
    };
    assert!(warning("esp32".to_owned()));
    assert!(!warning(identity(&Hello::example(16))));
}

#[test]
fn what_is_found_goes_into_files() {
    let folder = Folder::new("what-is-found-goes-into-files");
    let file = folder.with("in.csv", csv(&[vec![0.0; 256], readings()]));
    let [table, archive] = ["out.csv", "out.npz"].map(|name| folder.path(name));
    for out in [&table, &archive] {
        let output = TACTOMO.run(&["reconstruct", &file, "--solver", "tikhonov", "--images", "--out", out]);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(output.stdout.is_empty());
        assert!(String::from_utf8_lossy(&output.stderr).contains("tikhonov: 2 frames, median"));
    }
    let text = std::fs::read_to_string(&table).unwrap();
    let columns: Vec<usize> = text.lines().map(|line| line.split(',').count()).collect();
    assert_eq!(columns, [csv_heads().len(); 3], "{text}");
    let Table::Arrays(arrays) = Table::read(archive.as_ref()).unwrap() else { panic!("no arrays") };
    let array = |name: &str| arrays.iter().find(|(array, _)| array == name).unwrap().1.clone();
    assert_eq!(array("frame").values, [0.0, 1.0]);
    assert_eq!(array("contact_frame").values, [1.0]);
    assert_eq!(array("image_s_per_m2").shape, [array("image_frame").values.len(), array("node_x_y_z_m").shape[0]]);
}

/// A CSV file as rows of cells by the names of their columns.
fn cells(file: &str) -> Vec<Vec<(String, String)>> {
    let text = std::fs::read_to_string(file).unwrap();
    let split = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let mut lines = text.lines().map(split);
    let heads = lines.next().unwrap();
    lines.map(|row| heads.iter().cloned().zip(row).collect()).collect()
}

#[test]
fn json_csv_and_npz_have_every_figure_of_a_contact_and_agree() {
    let folder = Folder::new("json-csv-and-npz-have-every-figure-of-a-contact-and-agree");
    let file = folder.with("figures.csv", csv(&vec![readings(); 3]));
    let [table, archive] = ["figures-out.csv", "figures-out.npz"].map(|name| folder.path(name));
    let arguments = ["--solver", "contacts"];
    let found = lines(&[&[file.as_str()], &arguments[..]].concat());
    for out in [&table, &archive] {
        let arguments = [&["reconstruct", &file], &arguments[..], &["--out", out]].concat();
        assert_eq!(TACTOMO.run(&arguments).status.code(), Some(0));
    }
    let rows = cells(&table);
    let Table::Arrays(arrays) = Table::read(archive.as_ref()).unwrap() else { panic!("no arrays") };
    assert_eq!((found.len(), rows.len()), (3, 3));
    // JSON is read to the last digit but one.
    let near = |one: f64, other: f64| (one - other).abs() <= 1e-12 * other.abs();
    for (line, row) in found.iter().zip(&rows) {
        let index = line["frame"].as_u64().unwrap() as usize;
        for column in &CONTACT_COLUMNS {
            let name = format!("contact_{}", column.name);
            let in_archive = arrays.iter().find(|(array, _)| *array == name).unwrap().1.values[index];
            let in_table = &row.iter().find(|(head, _)| head == column.name).unwrap().1;
            match line["contacts"][0].get(column.name).and_then(Value::as_f64) {
                Some(value) => {
                    let in_table: f64 = in_table.parse().unwrap();
                    assert!(near(in_table, value) && in_table == in_archive, "{name}: {value} {in_table} {in_archive}");
                }
                // A word is its number in arrays.
                None if column.name == "state" => {
                    let state = &line["contacts"][0]["state"];
                    assert_eq!(
                        (in_table.as_str(), in_archive),
                        if index == 0 { ("start", 0.0) } else { ("move", 1.0) }
                    );
                    assert_eq!(state, in_table.as_str());
                }
                None if index > 0 && column.name == "dz_m" || column.name == "z_m" => {
                    assert_eq!((in_table.as_str(), in_archive), ("0", 0.0))
                }
                None => {
                    let is_unknown = match column.kind {
                        Kind::Number => in_archive.is_nan(),
                        Kind::Integer | Kind::Word(_) => in_archive == -1.0,
                        Kind::Flag => in_archive == 0.0,
                    };
                    assert!(in_table.is_empty() && is_unknown, "{name}");
                }
            }
        }
    }
    let contact = &found[2]["contacts"][0];
    for name in ["id", "sigma_x_m", "sigma_y_m", "correlation", "sigma_conductance_s"] {
        assert!(contact[name].is_number(), "{name}: {contact}");
    }
}

#[test]
fn what_breaks_in_the_middle_leaves_nothing() {
    let folder = Folder::new("what-breaks-in-the-middle-leaves-nothing");
    let nan = folder.with("nan.csv", csv(&[readings(), vec![f64::NAN; 256]]));
    let broken = TACTOMO.run(&["reconstruct", &nan, "--out", &folder.path("out.csv")]);
    assert_eq!(broken.status.code(), Some(1));
    assert_eq!(std::fs::read_dir(folder.path("")).unwrap().count(), 1);
}

#[test]
fn millivolts_are_refused_as_volts_and_read_as_what_they_are() {
    let folder = Folder::new("millivolts-are-refused-as-volts-and-read-as-what-they-are");
    let millivolts: Vec<f64> = readings().iter().map(|volts| volts * 1e3).collect();
    let file = folder.with("millivolts.csv", csv(&[vec![0.0; 256], millivolts]));
    let refused = TACTOMO.run(&["reconstruct", &file, "--json"]);
    let message = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1));
    assert!(message.contains("are these millivolts? Give --unit mV"), "{message}");
    assert!(refused.stdout.is_empty(), "no contact is reported of readings that cannot be");
    assert_found(&lines(&[&file, "--unit", "mV"])[1]);
}

#[test]
fn rows_that_are_no_numbers_are_left_out_of_a_log_and_counted_and_presses_by_row_need_all() {
    let folder = Folder::new("rows-that-are-no-numbers");
    let press = readings();
    let text = csv(&[vec![0.0; 256], vec![0.0; 256], vec![0.0; 256], press.clone(), press]);
    let mut rows: Vec<&str> = text.lines().collect();
    rows[1] = "ERROR";
    rows[4] = &rows[4][..700];
    let file = folder.with("log.csv", rows.join("\n"));
    let (lines, messages) = told(&[&file, "--rest", "3"]);
    assert!(messages.contains("2 rows are left out, first: line 2, column 1: `ERROR`"), "{messages}");
    assert_eq!(
        (lines.len(), &lines[0]["frame"]),
        (1, &Value::from(3)),
        "the row that is left out is one of those at rest"
    );
    assert_found(&lines[0]);
    let out = folder.path("cal.toml");
    let refused = TACTOMO.run(&["calibrate", "force", &file, "--rest", "3", "--newtons", "1,2", "--out", &out]);
    let message = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(1) && message.contains("number of their row"), "{message}");
}

#[test]
fn codes_are_asked_for_their_converter_and_no_other_unit_is_silent() {
    let folder = Folder::new("codes-are-asked-for-their-converter");
    let codes = |frame: &Vec<f64>| frame.iter().map(|volts| (volts / 5.0 * 1024.0).round()).collect();
    let file = folder.with("codes.csv", csv(&press_after_rest().iter().map(codes).collect::<Vec<_>>()));
    let refused = TACTOMO.run(&["reconstruct", &file]);
    let message = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(1) && message.contains("--adc 10,5"), "{message}");
    let (lines, messages) = told(&[&file, "--rest", "4", "--adc", "10,5"]);
    let contact = &lines[1]["contacts"][0];
    assert!(
        !messages.contains("warning") && (contact["x_m"].as_f64().unwrap() - 0.012).abs() < 1e-3,
        "{messages}{contact}"
    );
    let (lines, messages) = told(&[&file, "--rest", "4", "--unit", "mV"]);
    assert!(are_flagged(&lines) && messages.contains("a drive of 0.4") && messages.contains("--adc"), "{messages}");
}

#[test]
fn a_wrong_sign_a_press_at_rest_and_exchanged_rows_and_columns_are_told_and_flagged() {
    let folder = Folder::new("what-no-touch-reads");
    let frames = press_after_rest();
    let table = |name: &str, frame: &dyn Fn(&Vec<f64>) -> Vec<f64>| {
        folder.with(name, csv(&frames.iter().map(frame).collect::<Vec<_>>()))
    };
    let right = table("right.csv", &Vec::clone);
    let negated = table("negated.csv", &|frame| frame.iter().map(|volts| -volts).collect());
    let turned = table("turned.csv", &|frame| (0..256).map(|i| frame[i % 16 * 16 + i / 16]).collect());
    let late = folder.with("late.csv", csv(&frames.iter().rev().cloned().collect::<Vec<_>>()));
    for (file, rest, word) in [
        (&negated, "4", "wrong sign?"),
        (&late, "2", "something pressed in the first 2 frames"),
        (&turned, "4", "rows and columns seem to be exchanged"),
    ] {
        let (lines, messages) = told(&[file, "--rest", rest]);
        assert!(are_flagged(&lines) && messages.matches(word).count() == 1, "{word}: {messages}");
    }
    let (lines, messages) = told(&[&right, "--rest", "4"]);
    assert!(!messages.contains("warning") && !are_flagged(&lines), "{messages}");
}

/// A recording of a board's Hello and of still frames with these numbers, one a chunk.
fn recording_of(folder: &Folder, name: &str, numbers: impl Iterator<Item = u16>) -> String {
    let file = folder.path(name);
    let header = Header { detector: "square-60".to_owned(), ..Header::default() };
    let mut writer = RecordWriter::new(std::fs::File::create(&file).unwrap(), &header).unwrap();
    let mut wire = [0; MAX_WIRE];
    let length = encode_board(&BoardMessage::Hello(Hello::example(16)), &mut wire).unwrap();
    writer.write(0, &wire[..length]).unwrap();
    for sequence in numbers {
        let head = FrameHead { sequence, time_us: 1000 * u32::from(sequence), ..FrameHead::default() };
        let length = encode_frame(head, &[3; 256], &mut wire).unwrap();
        writer.write(1000 * u64::from(sequence), &wire[..length]).unwrap();
    }
    writer.flush().unwrap();
    file
}

#[test]
fn frames_missing_in_a_recording_are_reported() {
    let folder = Folder::new("frames-missing-in-a-recording-are-reported");
    let run = |file: &str| told(&[file]);
    let (_, messages) = run(&recording_of(&folder, "whole.tactomo", 0..60));
    assert!(!messages.contains("warning"), "{messages}");
    let (lines, messages) = run(&recording_of(&folder, "gap.tactomo", (0..40).chain(340..360)));
    assert!(messages.contains("warning") && messages.contains("300 frames are missing"), "{messages}");
    let of = |sequence: u64| lines.iter().find(|line| line["sequence"] == sequence).unwrap();
    assert_eq!((&of(340)["lost_before"], of(340)["frame"].as_u64()), (&Value::from(300), Some(40)));
    assert!(of(341).get("lost_before").is_none());
    let file = recording_of(&folder, "damaged.tactomo", 0..60);
    let mut bytes = std::fs::read(&file).unwrap();
    let middle = bytes.len() * 3 / 4;
    bytes[middle] ^= 0x10;
    std::fs::write(&file, bytes).unwrap();
    let (_, messages) = run(&file);
    assert!(messages.contains("warning") && messages.contains("damaged"), "{messages}");
}

#[test]
fn a_recording_is_read_with_its_board() {
    let folder = Folder::new("a-recording-is-read-with-its-board");
    let recording = folder.path("touch.tactomo");
    let live = ["live", "--simulate", "--max-fps", "200", "--seconds", "1", "--json", "--record", &recording];
    assert_eq!(TACTOMO.run(&live).status.code(), Some(0));
    let found = lines(&[&recording]);
    assert!(found.len() > 20, "{} frames", found.len());
    assert_eq!(found[0]["frame"], 0, "frames are solved while the baseline is taken");
    assert!(found.last().unwrap()["time_s"].as_f64().unwrap() > 0.1);
}

#[test]
fn a_kernel_learns_from_presses_on_any_channels() {
    let folder = Folder::new("a-kernel-learns-from-presses-on-any-channels");
    let heard = |x: f64, y: f64, force: f64| {
        [[0.0, 0.0], [1.0, 0.1], [0.4, 1.0]].map(|[a, b]: [f64; 2]| force / (0.2 + (x - a).powi(2) + (y - b).powi(2)))
    };
    let press = |i: usize| {
        let [x, y, z] = [0.8191, 0.6710, 0.5497].map(|step| (step * (i + 1) as f64).fract());
        (x, y, 1.0 + z)
    };
    let taught: String = (0..120)
        .map(press)
        .map(|(x, y, force)| {
            let [a, b, c] = heard(x, y, force);
            format!("{x},{y},{force},{a},{b},{c}\n")
        })
        .collect();
    let presses = folder.with("presses.csv", format!("x_m,y_m,force_n,a,b,c\n{taught}"));
    let file = folder.with("sensor.csv", csv(&[heard(0.4, 0.6, 1.5).to_vec()]));
    let found = lines(&[&file, "--presses", &presses]);
    let contact = &found[0]["contacts"][0];
    for (key, truth) in [("x_m", 0.4), ("y_m", 0.6), ("force_n", 1.5)] {
        assert!((contact[key].as_f64().unwrap() - truth).abs() < 0.05, "{key}: {contact}");
    }
    let other = TACTOMO.run(&["reconstruct", &file, "--presses", &presses, "--solver", "noser"]);
    assert!(String::from_utf8_lossy(&other.stderr).contains("leave out --solver"));
}

#[test]
fn wrong_files_are_told() {
    let folder = Folder::new("wrong-files-are-told");
    let some = |frame: Vec<f64>| csv(&[vec![0.0; frame.len()], frame]);
    let mut nan = vec![0.1; 256];
    nan[3 * 16 + 5] = f64::NAN;
    let few = folder.with("few.csv", some(vec![0.1; 255]));
    let good = folder.with("good.csv", some(readings()));
    let nan = folder.with("nan.csv", some(nan));
    let text = folder.with("letter.csv", "Dear reader,\nhow are you?");
    let typo =
        folder.with("typo.csv", csv(&[vec![0.1; 256], vec![0.1; 256]]).replacen("0.1,0.1,0.1", "0.1,0.1,O.1", 1));
    let broken = folder.with("broken.npz", b"PK\x03\x04 and no more");
    let recording = folder.with("cut.tactomo", b"\x89TCTO\r\n\x1a\x02");
    let told = |file: &str, more: &[&str]| {
        let output = TACTOMO.run(&[&["reconstruct", file], more].concat());
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8(output.stderr).unwrap()
    };
    for (file, expected) in [
        (few.as_str(), "has 255 readings a frame, but the detector square-60 with its 16 electrodes needs 256"),
        (&nan, "1 of 2 rows are no readings: row 2, column 54 is not a finite number"),
        (&text, "line 2, column 1: `how are you?` is not a number"),
        (&typo, "line 1, column 3: `O.1` is not a number; to name the columns"),
        (&broken, "not an NPZ file"),
        (&recording, "is not a recording of tactomo, or too damaged"),
        ("no/such.csv", "cannot read no/such.csv: No such file"),
    ] {
        let message = told(file, &[]);
        assert!(message.contains(expected), "{message}");
    }
    assert!(told(&folder.path(""), &[]).contains("cannot read"));
    assert!(told(&few, &["--out", "contacts.xls"]).contains("needs 256"));
    assert!(told(&good, &["--out", "contacts.xls"]).contains(".csv, .npz, .json or .jsonl"));
    assert!(told(&good, &["--solver", "contacts", "--lambda", "0.1"]).contains("has no lambda: leave out --lambda"));
}
