//! `tactomo calibrate presses` as a user calls it: presses at known places in, a detector with a correction out.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use std::path::Path;

use serde_json::Value;
use tactomo::detector::{Detector, ForceLaw, Outline, Tolerances};
use tactomo::forward::{ForwardModel, readings_v};
use tactomo::readings::Readings;
use tactomo::scene::Contact;
use tactomo::simulate::{Noise, finer_model, measured};

use tactomo_tests::{Folder, TACTOMO, csv, recording};

/// How much larger the sensor is than its description says. Readings are those of what is described, at places that are as much nearer to the
/// middle: no parameter of a calibration tells it.
const LARGER: f64 = 1.04;

/// A sensor that is larger than it is described, and presses on it by a finer model than the one that is inverted.
struct Bench {
    described: Detector,
    built: Detector,
    finer: Box<dyn ForwardModel>,
    noise: Noise,
    random: fastrand::Rng,
}

impl Bench {
    fn new(larger: f64) -> Self {
        let described = Detector { tolerances: Tolerances::EXACT, ..Detector::default() };
        let mut built = described.clone();
        built.outline = Outline::rectangle(0.06 * larger, 0.06 * larger);
        built.layers.iter_mut().for_each(|layer| layer.thickness_m *= larger);
        for pad in &mut built.electrodes {
            (pad.x_m, pad.y_m, pad.radius_m) = (larger * pad.x_m, larger * pad.y_m, larger * pad.radius_m);
        }
        let finer = finer_model(&built, &[], 0).unwrap();
        Self { described, built, finer, noise: Noise::new(4), random: fastrand::Rng::with_seed(4) }
    }

    fn row(&mut self, contacts: &[Contact]) -> Vec<f64> {
        let exact = match contacts {
            [] => Readings::from_fn(16, |_, _| 0.0),
            _ => readings_v(&self.finer.impedance_ohm(contacts).unwrap(), &self.built),
        };
        measured(&exact, &self.built.adc, &mut self.noise).volts().to_vec()
    }

    fn rows(&mut self, places_m: &[[f64; 2]]) -> Vec<Vec<f64>> {
        places_m.iter().map(|at_m| self.row(&[press(*at_m)])).collect()
    }

    fn places(&mut self, count: usize) -> Vec<[f64; 2]> {
        (0..count).map(|_| [0, 1].map(|_| 0.044 * (self.random.f64() - 0.5))).collect()
    }
}

fn press([x_m, y_m]: [f64; 2]) -> Contact {
    Contact::flat(x_m, y_m, 0.0025, 1e-3)
}

/// Marks of a sheet, in no symmetric order.
fn sheet() -> Vec<[f64; 2]> {
    let order = [6, 0, 11, 3, 14, 8, 1, 13, 5, 10, 2, 15, 7, 4, 12, 9];
    let at = |k: usize| 0.014 * k as f64 - 0.021;
    order.iter().map(|k| [at(k % 4), at(k / 4)]).collect()
}

fn table(places_m: &[[f64; 2]]) -> String {
    let line = |[x_m, y_m]: &[f64; 2]| format!("{x_m},{y_m}\n");
    format!("x_m,y_m\n{}", places_m.iter().map(line).collect::<String>())
}

fn calibrated(args: &[&str]) -> (Value, String) {
    let output = TACTOMO.run(&[&["calibrate", "presses"], args, &["--json"]].concat());
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{told}");
    (serde_json::from_slice(&output.stdout).unwrap(), told)
}

/// What stands on stderr of a calibration that fails and writes nothing.
fn refused(folder: &Folder, args: &[&str]) -> String {
    let before = folder.names();
    let out = folder.path("never.toml");
    let output = TACTOMO.run(&[&["calibrate", "presses"], args, &["--out", &out]].concat());
    assert_eq!((output.status.code(), output.stdout.len()), (Some(1), 0), "{args:?}");
    assert_eq!(folder.names(), before, "nothing is written");
    String::from_utf8(output.stderr).unwrap()
}

/// Mean distance (m) of the single contacts of a table from where they are, and the share of coordinates within one and two standard errors.
fn off_m(file: &str, detector: &str, truth_m: &[[f64; 2]]) -> (f64, [f64; 2]) {
    let output = TACTOMO.run(&["reconstruct", file, "--detector", detector, "--solver", "contacts", "--json"]);
    let lines = String::from_utf8(output.stdout).unwrap();
    let (mut sum, mut within) = (0.0, [0.0; 2]);
    assert_eq!(lines.lines().count(), truth_m.len());
    for (line, at_m) in lines.lines().zip(truth_m) {
        let frame: Value = serde_json::from_str(line).unwrap();
        let contact = &frame["contacts"][0];
        let number = |name: &str| contact[name].as_f64().unwrap_or_else(|| panic!("{name}: {frame}"));
        let error_m = [number("x_m") - at_m[0], number("y_m") - at_m[1]];
        sum += error_m[0].hypot(error_m[1]);
        let sigmas = [error_m[0].abs() / number("sigma_x_m"), error_m[1].abs() / number("sigma_y_m")];
        for (k, within) in within.iter_mut().enumerate() {
            *within += sigmas.iter().filter(|sigmas| **sigmas < (k + 1) as f64).count() as f64;
        }
    }
    (sum / truth_m.len() as f64, within.map(|within| within / (2 * truth_m.len()) as f64))
}

#[test]
fn a_sheet_of_sixteen_marks_corrects_what_no_parameter_tells() {
    let folder = Folder::new("presses-sheet");
    let mut bench = Bench::new(LARGER);
    let described = folder.with("described.toml", bench.described.to_toml());
    let presses = folder.with("presses.csv", csv(&bench.rows(&sheet())));
    let places = folder.with("places.csv", table(&sheet()));
    let out = folder.path("corrected.toml");
    let (report, told) = calibrated(&[&presses, "--detector", &described, "--places", &places, "--out", &out]);
    let number = |name: &str| report[name].as_f64().unwrap();
    assert!(number("before_m") > 5e-4 && number("left_out_m") < 1.5e-4, "{report}");
    assert_eq!((&report["place"]["is_corrected"], &report["conductance"]), (&true.into(), &Value::Null), "{report}");
    let come: Vec<_> = report["as_presses_come"].as_array().unwrap().iter().collect();
    assert_eq!(come.iter().map(|row| row["presses"].as_u64().unwrap()).collect::<Vec<_>>(), [1, 2, 4, 8]);
    let after_m = |k: usize| come[k]["after_m"].as_f64().unwrap();
    assert!(after_m(3) < 0.5 * after_m(0), "{come:?}");
    assert!(told.contains("mean error of the rest") && told.contains("mm as found"), "{told}");

    let truth_m = bench.places(60);
    let others = folder.with("others.csv", csv(&bench.rows(&truth_m)));
    let (before_m, _) = off_m(&others, &described, &truth_m);
    let (corrected_m, [one, two]) = off_m(&others, &out, &truth_m);
    assert!(before_m > 5e-4 && corrected_m < 1e-4, "{before_m} to {corrected_m}");
    assert!((0.5..0.9).contains(&one) && two > 0.88, "{one}, {two}");

    // More presses count with those that the file holds, and are themselves found without its correction.
    let more = bench.places(8);
    let rows = folder.with("more.csv", csv(&bench.rows(&more)));
    let places = folder.with("more-places.csv", table(&more));
    let again = folder.path("again.toml");
    let (second, _) = calibrated(&[&rows, "--detector", &out, "--places", &places, "--out", &again]);
    assert_eq!((&second["kept"], second["presses"].as_array().unwrap().len()), (&16.into(), 24));
    assert!(second["before_m"].as_f64().unwrap() > 5e-4, "{second}");
    assert_eq!(Detector::read(Path::new(&again)).unwrap().correction.unwrap().presses(), 24);
}

#[test]
fn presses_that_show_nothing_but_noise_correct_nothing() {
    let folder = Folder::new("presses-noise");
    let mut bench = Bench::new(1.0);
    let described = folder.with("described.toml", bench.described.to_toml());
    let presses = folder.with("presses.csv", csv(&bench.rows(&sheet())));
    // A hand finds marks to a third of a millimetre.
    let mut hand = fastrand::Rng::with_seed(8);
    let marks: Vec<[f64; 2]> = sheet().iter().map(|at_m| at_m.map(|m| m + 1e-3 * (hand.f64() - 0.5))).collect();
    let places = folder.with("places.csv", table(&marks));
    let out = folder.path("same.toml");
    let (report, told) = calibrated(&[&presses, "--detector", &described, "--places", &places, "--out", &out]);
    assert_eq!(report["place"]["is_corrected"], false, "{report}");
    assert!(told.contains("no correction of places"), "{told}");
    assert_eq!(Detector::read(Path::new(&out)).unwrap(), Detector::read(Path::new(&described)).unwrap());
}

#[test]
fn conductances_follow_the_law_where_forces_are_told() {
    let folder = Folder::new("presses-force");
    let mut bench = Bench::new(LARGER);
    let law = ForceLaw { conductance_at_1_n_s: 1.5e-3, exponent: 0.5, range_n: [0.01, 10.0], ..ForceLaw::siemens() };
    let described = folder.with("d.toml", Detector { force: Some(law), ..bench.described.clone() }.to_toml());
    let presses = folder.with("presses.csv", csv(&bench.rows(&sheet())));
    let plain = folder.with("places.csv", table(&sheet()));
    let (_, told) =
        calibrated(&[&presses, "--detector", &described, "--places", &plain, "--out", &folder.path("a.toml")]);
    assert!(told.contains("no forces are told"), "{told}");
    // The same press everywhere takes a force that rises by half from side to side.
    let line = |[x_m, y_m]: &[f64; 2]| format!("{x_m},{y_m},{}\n", 0.4 * (1.0 + x_m / 0.042).powi(2));
    let rising = format!("x_m,y_m,force_n\n{}", sheet().iter().map(line).collect::<String>());
    let rising = folder.with("forces.csv", rising);
    let out = folder.path("b.toml");
    let (report, _) = calibrated(&[&presses, "--detector", &described, "--places", &rising, "--out", &out]);
    assert_eq!(report["conductance"]["is_corrected"], true, "{report}");
    let others = folder.with("others.csv", csv(&bench.rows(&[[-0.012, 0.003], [0.012, 0.003]])));
    let output = TACTOMO.run(&["reconstruct", &others, "--detector", &out, "--solver", "contacts", "--json"]);
    let force_n = |line: &str| serde_json::from_str::<Value>(line).unwrap()["contacts"][0]["force_n"].as_f64().unwrap();
    let found: Vec<f64> = String::from_utf8(output.stdout).unwrap().lines().map(force_n).collect();
    for (found_n, x_m) in found.iter().zip([-0.012, 0.012]) {
        let truth_n = 0.4 * (1.0f64 + x_m / 0.042).powi(2);
        assert!((found_n / truth_n).ln().abs() < 0.05, "{found_n} N of {truth_n} N");
    }
    let (_, told) = calibrated(&[&presses, "--places", &rising, "--out", &folder.path("c.toml")]);
    assert!(told.contains("the detector has no law of force"), "{told}");
}

#[test]
fn presses_of_a_recording_are_taken_in_their_order_or_at_their_times() {
    let folder = Folder::new("presses-recording");
    let mut bench = Bench::new(LARGER);
    let described = folder.with("described.toml", bench.described.to_toml());
    let marks: Vec<[f64; 2]> = sheet().into_iter().take(12).collect();
    let file = folder.path("sheet.tactomo");
    let detector = bench.described.clone();
    // A press a second from 0.5 s on, each 0.6 s long.
    recording(&file, &detector, 12.6, |time_s| {
        let (k, at_s) = ((time_s - 0.5).div_euclid(1.0), (time_s - 0.5).rem_euclid(1.0));
        let at_m = marks.get(k as usize).filter(|_| k >= 0.0 && at_s < 0.6);
        let contact = at_m.map(|at_m| press(*at_m));
        bench.row(contact.as_slice())
    });
    let places = folder.with("places.csv", table(&marks));
    let out = folder.path("order.toml");
    let (report, _) = calibrated(&[&file, "--detector", &described, "--places", &places, "--out", &out]);
    assert!(report["place"]["is_corrected"] == true && report["presses"].as_array().unwrap().len() == 12, "{report}");
    let line = |(k, [x_m, y_m]): (usize, &[f64; 2])| format!("{},{x_m},{y_m}\n", 0.8 + k as f64);
    let timed = format!("time_s,x_m,y_m\n{}", marks.iter().enumerate().map(line).collect::<String>());
    let timed = folder.with("timed.csv", timed);
    let out = folder.path("times.toml");
    let (by_time, _) = calibrated(&[&file, "--detector", &described, "--places", &timed, "--out", &out]);
    let left_out_m = |report: &Value| report["left_out_m"].as_f64().unwrap();
    assert!((left_out_m(&by_time) - left_out_m(&report)).abs() < 5e-5, "{by_time} {report}");
    let fewer = folder.with("fewer.csv", table(&marks[..11]));
    let message = refused(&folder, &[&file, "--detector", &described, "--places", &fewer]);
    assert!(message.contains("12 presses are found, but 11 places are given"), "{message}");
    let message = refused(&folder, &[&file, "--detector", &described, "--known", "90:1,2"]);
    assert!(message.contains("there is no second 90 for a known place"), "{message}");
}

#[test]
fn bad_presses_say_what_to_do_and_write_nothing() {
    let folder = Folder::new("presses-bad");
    let mut bench = Bench::new(LARGER);
    let mut rows = bench.rows(&sheet());
    let good = folder.with("good.csv", csv(&rows));
    let places = folder.with("places.csv", table(&sheet()));
    rows[2] = bench.row(&[press([-0.015, 0.0]), press([0.015, 0.0])]);
    rows[5] = bench.row(&[]);
    let spoilt = folder.with("spoilt.csv", csv(&rows));
    let out = folder.path("without.toml");
    let (report, told) = calibrated(&[&spoilt, "--places", &places, "--out", &out]);
    assert!(told.contains("row 3 is left out: it has 2 contacts"), "{told}");
    assert!(told.contains("row 6 is left out: nothing touches there"), "{told}");
    assert_eq!((report["presses"].as_array().unwrap().len(), report["skipped"].as_array().unwrap().len()), (14, 2));

    let with = |name: &str, change: &dyn Fn(&mut Vec<[f64; 2]>)| {
        let mut marks = sheet();
        change(&mut marks);
        folder.with(name, table(&marks))
    };
    let reversed = with("reversed.csv", &|marks| marks.reverse());
    let exchanged = with("exchanged.csv", &|marks| marks.swap(1, 10));
    let mirrored = with("mirrored.csv", &|marks| marks.iter_mut().for_each(|at_m| at_m[0] = -at_m[0]));
    let beside = with("beside.csv", &|marks| marks[3] = [0.05, 0.0]);
    let fewer = with("fewer.csv", &|marks| marks.truncate(9));
    let nameless = folder.with("nameless.csv", "x,y\n1,2\n");
    let timed = folder.with("timed.csv", "time_s,x_m,y_m\n1,0.01,0.02\n");
    for (known, told) in [
        (&["--places", &reversed][..], "they would fit in the reverse order"),
        (&["--places", &exchanged], "with the places of presses 2 and 11 exchanged"),
        (&["--places", &mirrored], "they would fit with x mirrored"),
        (&["--places", &beside], "the known place 50.0, 0.0 mm is not on the sensor"),
        (&["--places", &fewer], "16 rows of readings, but 9 places are given"),
        (&["--places", &nameless], "it has no column `x_m`"),
        (&["--places", &timed], "`time_s`, which is of recordings"),
        (&["--places", &places, "--known", "1:2,3"], "leave out --known"),
        (&["--known", "1:-7,-7", "--known", "1:2,3"], "two places are told for the press at 1"),
        (&["--known", "1:-7,-7", "--known", "2:-21,-21"], "2 presses at known places, but 3 at least are needed"),
        (&["--known", "17:0,0"], "there is no row 17 for a known place"),
    ] {
        let message = refused(&folder, &[&[&good[..]], known].concat());
        assert!(message.contains(told), "{known:?}: {message}");
    }
    let message = refused(&folder, &["--simulate", "--places", &places]);
    assert!(message.contains("press no known places"), "{message}");
    let seven = Detector::preset("strip-13x60").unwrap().to_toml().replace("grid = [2, 8]", "grid = [2, 7]");
    let other = folder.with("other.toml", seven);
    let message = refused(&folder, &[&good, "--detector", &other, "--places", &places]);
    assert!(
        message.contains("has 256 readings a frame (these are of 16 electrodes), but the detector strip-13x60"),
        "{message}"
    );
    let precious = folder.with("precious.toml", "precious");
    let output = TACTOMO.run(&["calibrate", "presses", &good, "--places", &places, "--out", &precious]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("exists already, and no file is replaced"));
    assert_eq!((output.status.code(), std::fs::read_to_string(&precious).unwrap()), (Some(1), "precious".to_owned()));
    assert_eq!(TACTOMO.run(&["calibrate", "presses", &good, "--out", "x.toml"]).status.code(), Some(2));
}
