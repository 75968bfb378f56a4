//! `tactomo calibrate rub` as a user calls it, with files that are no rub of that detector: each is refused with what is wrong and what to do.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use tactomo::detector::Detector;
use tactomo::forward::ForwardModel;
use tactomo::scene::Contact;
use tactomo::simulate::{Fault, Measurement, drawn, finer_model};
use tactomo_tests::{Folder, TACTOMO, csv};

/// What is said where nothing is calibrated: exit code 1, nothing on stdout, and no file more than before.
fn refused(folder: &Folder, table: &[Vec<f64>], more: &[&str]) -> String {
    let file = folder.with("rub.csv", csv(table));
    let (out, files) = (folder.path("cal.toml"), folder.names().len());
    let output =
        TACTOMO.run(&[&["calibrate", "rub", &file, "--presses", "12", "--out", &out, "--json"], more].concat());
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(output.stdout.is_empty(), "{message}");
    assert_eq!(folder.names().len(), files, "{message}");
    message
}

/// A detector as built, and its board.
struct Bench {
    built: Detector,
    model: Box<dyn ForwardModel>,
    board: Measurement,
    random: fastrand::Rng,
}

impl Bench {
    fn new(preset: &str, faults: &[&str]) -> Self {
        let built = drawn(&Detector::preset(preset).unwrap(), 11);
        let faults: Vec<Fault> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
        let board = Measurement::new(&built, &faults, 11).unwrap();
        Self { model: finer_model(&built, &[], 11).unwrap(), built, board, random: fastrand::Rng::with_seed(11) }
    }

    /// Places all over the detector (m).
    fn places(&mut self, count: usize) -> Vec<[f64; 2]> {
        let [width_m, height_m] = self.built.outline.size_m();
        (0..count).map(|_| [width_m, height_m].map(|side_m| 0.75 * side_m * (self.random.f64() - 0.5))).collect()
    }

    /// A frame in which fingers press at such places.
    fn frame(&mut self, places: &[[f64; 2]]) -> Vec<f64> {
        let conductance_s = 0.5 * self.built.sheet_conductance_s();
        let contact = |[x_m, y_m]: &[f64; 2]| Contact::flat(*x_m, *y_m, 0.0025, conductance_s);
        let contacts: Vec<_> = places.iter().map(contact).collect();
        let impedance_ohm = self.model.impedance_ohm(&contacts).ok();
        self.board.readings_v(impedance_ohm.as_ref()).volts().to_vec()
    }

    /// A press of so many fingers in each of so many frames.
    fn frames(&mut self, count: usize, fingers: usize) -> Vec<Vec<f64>> {
        (0..count)
            .map(|_| {
                let places = self.places(fingers);
                self.frame(&places)
            })
            .collect()
    }
}

#[test]
fn only_what_helped_on_presses_that_were_not_used_is_recommended() {
    let folder = Folder::new("worth");
    let mut bench = Bench::new("square-60", &[]);
    for (count, is_helped) in [(10, false), (30, true)] {
        let table = [bench.frames(32, 0), bench.frames(count, 1)].concat();
        let line = |frame: &Vec<f64>| frame.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let file = folder.with("rub.csv", table.iter().map(line).collect::<Vec<_>>().join("\n"));
        let out = folder.path(&format!("cal-{count}.toml"));
        let output = TACTOMO.run(&["calibrate", "rub", &file, "--out", &out, "--json"]);
        let told = String::from_utf8(output.stderr).unwrap();
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(report["helped"], is_helped, "{told}");
        assert_eq!(told.contains("use it with --detector"), is_helped, "{told}");
        assert_eq!(report["held_out"].is_object(), is_helped, "{report}");
        // All presses are of one firmness.
        let missing = report["missing"].as_array().unwrap();
        assert!(missing.iter().any(|missing| missing.as_str().unwrap().starts_with("press lighter")), "{told}");
    }
}

#[test]
fn where_nobody_or_a_whole_hand_presses_one_fingertip_is_asked_for() {
    let folder = Folder::new("fingers");
    let mut bench = Bench::new("square-60", &[]);
    let rest = refused(&folder, &bench.frames(30, 0), &[]);
    assert!(rest.contains("rub.csv: nothing presses in any of 30 frames: rub one fingertip"), "{rest}");
    let hand = refused(&folder, &bench.frames(24, 3), &[]);
    assert!(hand.contains("rub with one fingertip alone"), "{hand}");
}

#[test]
fn readings_of_another_detector_are_not_fitted_to_this_one() {
    let folder = Folder::new("detector");
    let many = refused(&folder, &Bench::new("display-140x70", &[]).frames(4, 1), &[]);
    assert!(many.contains("1024 readings a frame") && many.contains("needs 256: give the right one with"), "{many}");
    let strip = refused(&folder, &Bench::new("strip-13x60", &[]).frames(12, 1), &[]);
    assert!(strip.contains("not those of square-60 within its tolerances") && strip.contains("choose the"), "{strip}");
}

#[test]
fn broken_wires_are_to_be_mended_where_too_few_are_left() {
    let folder = Folder::new("wires");
    for broken in [vec![0, 2, 4, 6, 8, 10, 12], (0..12).collect()] {
        let faults: Vec<_> = broken.iter().map(|e| format!("open:{e}")).collect();
        let faults: Vec<_> = faults.iter().map(String::as_str).collect();
        let message = refused(&folder, &Bench::new("square-60", &faults).frames(12, 1), &[]);
        let told = format!("electrodes {broken:?} are broken, shorted or contradict the others: mend their wires");
        assert!(message.contains(&told), "{message}");
    }
}

#[test]
fn known_places_in_the_wrong_order_or_beside_the_sensor_are_told() {
    let folder = Folder::new("places");
    let mut bench = Bench::new("square-60", &[]);
    let told = [[-0.02, -0.02], [0.02, -0.02], [0.02, 0.015], [-0.01, 0.02]];
    let mut frames: Vec<_> = told.iter().map(|at_m| bench.frame(&[*at_m])).collect();
    frames.extend(bench.frames(20, 1));
    let refused = |places: [&str; 4]| {
        let known: Vec<_> = places.iter().flat_map(|place| ["--known", place]).collect();
        refused(&folder, &frames, &known)
    };
    let order = refused(["1:20,15", "2:-20,-20", "3:-10,20", "4:20,-20"]);
    assert!(order.contains("presses at known places do not fit") && order.contains("belongs to its row"), "{order}");
    let beside = refused(["1:-20,-20", "2:20,-20", "3:20,15", "4:-10,200"]);
    assert!(beside.contains("the known place -10.0, 200.0 mm is not on the sensor"), "{beside}");
    let absent = refused(["1:-20,-20", "2:20,-20", "3:20,15", "40:-10,20"]);
    assert!(absent.contains("there is no row 40 for a known place"), "{absent}");
}

#[test]
fn a_file_that_exists_stays_as_it_is() {
    let folder = Folder::new("exists");
    let precious = folder.with("cal.toml", "precious");
    let message = refused(&folder, &[vec![0.0; 256]], &[]);
    assert!(message.contains("cal.toml exists already"), "{message}");
    assert_eq!(std::fs::read_to_string(precious).unwrap(), "precious");
}
