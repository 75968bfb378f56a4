//! `tactomo calibrate force` and `tactomo material fit` as a user calls them: presses of known force in, a detector with newtons or with its skin out.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use std::path::Path;
use std::sync::LazyLock;

use serde_json::Value;
use tactomo::detector::{Detector, Foam};
use tactomo::forward::{ForwardModel, readings_v};
use tactomo::hertz::{Hertz, Skin, Surface};
use tactomo::readings::Readings;
use tactomo::scene::Contact;
use tactomo::simulate::{Noise, finer_model, measured};
use tactomo_physics::threads;
use tactomo_tests::{Folder, TACTOMO, csv, recording};

/// Ten presses on a kitchen scale (N).
const TEN_N: [f64; 10] = [0.7, 1.0, 1.4, 2.0, 2.7, 3.5, 4.6, 6.0, 8.0, 10.5];
/// Quantile of the normal distribution below which 95 % are.
const BAND: f64 = 1.645;

/// A finer model of `square-60` than the one that is inverted.
static FINER: LazyLock<Box<dyn ForwardModel>> = LazyLock::new(|| finer_model(&Detector::default(), &[], 0).unwrap());

/// Radius of the ball that presses on `square-60` (m).
const BALL_M: f64 = 0.005;

/// A ball that presses on `square-60`.
struct Bench {
    detector: Detector,
    hertz: Hertz,
    noise: Noise,
    random: fastrand::Rng,
}

impl Bench {
    fn new(seed: u64) -> Self {
        let detector = Detector::default();
        Self {
            hertz: Hertz::new(&detector, Foam::of('A').unwrap().into()).unwrap(),
            noise: Noise::new(seed),
            random: fastrand::Rng::with_seed(seed),
            detector,
        }
    }

    /// A press anywhere but next to the wall.
    fn ball(&mut self, force_n: f64) -> Contact {
        let [x_m, y_m] = [0, 1].map(|_| 0.05 * (self.random.f64() - 0.5));
        self.ball_at([x_m, y_m], force_n)
    }

    fn ball_at(&self, [x_m, y_m]: [f64; 2], force_n: f64) -> Contact {
        let imprint = self.hertz.ball(BALL_M, force_n);
        Contact::flat(x_m, y_m, imprint.half_width_m, imprint.conductance_s)
    }

    fn exact(&self, contacts: &[Contact]) -> Readings {
        match contacts {
            [] => Readings::from_fn(16, |_, _| 0.0),
            _ => readings_v(&FINER.impedance_ohm(contacts).unwrap(), &self.detector),
        }
    }

    fn row(&mut self, contacts: &[Contact]) -> Vec<f64> {
        measured(&self.exact(contacts), &self.detector.adc, &mut self.noise).volts().to_vec()
    }

    /// Rows of presses with these forces. The foam presses back with so much more or less, as a logarithm, while it is let go or loaded.
    fn rows(&mut self, forces_n: &[f64], hysteresis: f64) -> Vec<Vec<f64>> {
        let of = |force_n: &f64| {
            let side = if self.random.bool() { hysteresis } else { -hysteresis };
            let ball = self.ball(force_n * side.exp());
            self.row(&[ball])
        };
        forces_n.iter().map(of).collect()
    }
}

fn list(forces_n: &[f64]) -> String {
    forces_n.iter().map(f64::to_string).collect::<Vec<_>>().join(",")
}

fn calibrated(args: &[&str]) -> Value {
    let output = TACTOMO.run(&[&["calibrate", "force"], args, &["--json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// What stands on stderr of a calibration that fails and writes nothing.
fn refused(folder: &Folder, args: &[&str]) -> String {
    let before = folder.names();
    let out = folder.path("never.toml");
    let output = TACTOMO.run(&[&["calibrate", "force"], args, &["--out", &out]].concat());
    assert_eq!((output.status.code(), output.stdout.len()), (Some(1), 0));
    assert_eq!(folder.names(), before, "nothing is written");
    String::from_utf8(output.stderr).unwrap()
}

/// Force, its standard error and the flag of the only contact of each frame.
fn forces(file: &str, detector: &str, solver: &str) -> Vec<(f64, f64, bool)> {
    let output = TACTOMO.run(&["reconstruct", file, "--detector", detector, "--solver", solver, "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let of = |line: &str| {
        let frame: Value = serde_json::from_str(line).unwrap();
        let contact = &frame["contacts"][0];
        let number = |name: &str| contact[name].as_f64().unwrap_or_else(|| panic!("{solver} has no {name}: {frame}"));
        (number("force_n"), number("force_deviation_n"), contact["force_beyond_maximum"].as_bool().unwrap())
    };
    String::from_utf8(output.stdout).unwrap().lines().map(of).collect()
}

/// How ten presses tell the forces of others.
struct Told {
    /// Each as a share, as a logarithm, of foam that presses back with more or less.
    off: Vec<f64>,
    /// Of these, within bands of 90 %.
    within: usize,
    /// Mean of foam that does not (as `off`).
    middle: f64,
}

/// Calibrates with ten presses, and tells others.
fn told_by_ten_presses(folder: &Folder, seed: u64, hysteresis: f64) -> Told {
    let mut bench = Bench::new(seed);
    let presses = folder.with(&format!("presses-{seed}.csv"), csv(&bench.rows(&TEN_N, hysteresis)));
    let out = folder.path(&format!("cal-{seed}.toml"));
    let report = calibrated(&[&presses, "--newtons", &list(&TEN_N), "--out", &out]);
    assert_eq!(report["presses"].as_array().map(Vec::len), Some(10));
    assert_eq!(report["left_out"], serde_json::json!([]), "{report}");
    let truth_n: Vec<f64> = (0..16).map(|k| 0.7 * 15f64.powf(f64::from(k) / 15.0)).collect();
    let others = [hysteresis, 0.0].map(|hysteresis| bench.rows(&truth_n, hysteresis)).concat();
    let others = folder.with(&format!("others-{seed}.csv"), csv(&others));
    let found = forces(&others, &out, "auto");
    assert_eq!(found.len(), 2 * truth_n.len());
    let (pressing_back, still) = found.split_at(truth_n.len());
    let off = |found: &[(f64, f64, bool)]| -> Vec<f64> {
        truth_n.iter().zip(found).map(|(force_n, (found_n, ..))| (found_n / force_n).ln().abs()).collect()
    };
    let is_within = |(force_n, (found_n, deviation_n, _)): &(&f64, &(f64, f64, bool))| {
        (found_n - **force_n).abs() < BAND * deviation_n
    };
    Told {
        off: off(pressing_back),
        within: truth_n.iter().zip(pressing_back).filter(is_within).count(),
        middle: off(still).iter().sum::<f64>() / still.len() as f64,
    }
}

#[test]
fn ten_presses_give_newtons_within_their_hysteresis() {
    const HYSTERESIS: f64 = 0.1;
    let folder = Folder::new("force-round");
    let seeds: Vec<u64> = (0..10).collect();
    let told = threads::map(&seeds, |seed| told_by_ten_presses(&folder, *seed, HYSTERESIS));
    let mut middle: Vec<f64> = told.iter().map(|told| told.middle).collect();
    middle.sort_by(f64::total_cmp);
    let off: Vec<f64> = told.iter().flat_map(|told| told.off.clone()).collect();
    let (mean, within) =
        (off.iter().sum::<f64>() / off.len() as f64, told.iter().map(|told| told.within).sum::<usize>());
    assert!(middle[8] < HYSTERESIS, "the middle of both curves is missed by {middle:?}");
    // A press is off by the hysteresis to either side, whoever tells it, and by what the middle is off.
    assert!(mean < 1.1 * HYSTERESIS, "{mean}");
    assert!(within * 10 >= 9 * off.len(), "{within} of {} in bands of 90 %", off.len());
}

#[test]
fn every_solver_tells_the_force_that_was_calibrated_and_the_flag_beyond() {
    let folder = Folder::new("force-solvers");
    let mut bench = Bench::new(7);
    let presses = folder.with("presses.csv", csv(&bench.rows(&TEN_N, 0.0)));
    let out = folder.path("cal.toml");
    let report = calibrated(&[&presses, "--newtons", &list(&TEN_N), "--out", &out]);
    // A fit of eq. (6) to presses up to 10.5 N has some maximum, at thousands of newtons: it is not told.
    assert_eq!(
        (&report["law"], &report["maximum_force"]),
        (&"saturating".into(), &"not determined".into()),
        "{report}"
    );
    assert!(report["maximum_force_n"].is_null() && report["range_n"] == serde_json::json!([0.7, 10.5]), "{report}");
    let detector = Detector::read(Path::new(&out)).unwrap();
    assert_eq!(Detector { force: None, ..detector.clone() }, Detector::default());
    assert_eq!(detector.force.as_ref().map(|law| (law.presses, law.maximum_n)), Some((10, None)));
    let truth = [1.2, 3.0, 7.0, 12.0];
    let places = [[0.004, 0.009], [-0.012, 0.003], [0.0, -0.008], [0.011, 0.012]];
    let contacts: Vec<_> = places.iter().zip(truth).map(|(at, force_n)| bench.ball_at(*at, force_n)).collect();
    let rows: Vec<_> = contacts.into_iter().map(|contact| bench.row(&[contact])).collect();
    let file = folder.with("others.csv", csv(&rows));
    for (solver, factor) in
        [("auto", 1.05), ("contacts", 1.05), ("kernel", 1.05), ("nonlinear", 1.1), ("bsbl", 1.1), ("tikhonov", 1.6)]
    {
        let found = forces(&file, &out, solver);
        for (truth_n, (found_n, deviation_n, beyond)) in truth.iter().zip(&found) {
            assert!((found_n / truth_n).ln().abs() < f64::ln(factor), "{solver}: {found_n} N, {truth_n} N");
            assert!(*deviation_n > 0.0 && *deviation_n < *found_n, "{solver}: {deviation_n} N");
            assert!(factor > 1.5 || *beyond == (*truth_n > 10.5), "{solver}: {truth_n} N");
        }
    }
    let told = TACTOMO.run(&["reconstruct", &file, "--detector", &out, "--solver", "contacts"]);
    let told = String::from_utf8(told.stdout).unwrap();
    assert!(
        told.lines().all(|line| line.contains(" N")) && told.contains("N (beyond the largest that can be told)"),
        "{told}"
    );
}

#[test]
fn a_file_is_never_replaced_and_bad_presses_write_none() {
    let folder = Folder::new("force-bad");
    let mut bench = Bench::new(3);
    let rows = bench.rows(&TEN_N, 0.0);
    let good = folder.with("good.csv", csv(&rows));
    let precious = folder.with("precious.toml", "precious");
    let output = TACTOMO.run(&["calibrate", "force", &good, "--newtons", &list(&TEN_N), "--out", &precious]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("exists already, and no file is replaced"));
    assert_eq!(std::fs::read_to_string(&precious).unwrap(), "precious");

    let backwards: Vec<f64> = TEN_N.iter().rev().copied().collect();
    let mut exchanged = TEN_N;
    exchanged.swap(1, 6);
    let mut two = rows.clone();
    let pair = [bench.ball_at([-0.015, 0.0], 3.0), bench.ball_at([0.015, 0.0], 3.0)];
    two[3] = bench.row(&pair);
    let mut light = rows.clone();
    light[0] = bench.row(&[]);
    let two = folder.with("two.csv", csv(&two));
    let light = folder.with("light.csv", csv(&light));
    let nothing = folder.with("nothing.csv", csv(&(0..10).map(|_| bench.row(&[])).collect::<Vec<_>>()));
    let few = folder.with("few.csv", csv(&rows[..3]));
    let sensor = folder.with("sensor.csv", "time_s,force_n\n0,1\n1,2\n");
    let no_force = folder.with("no-force.csv", "newtons\n1\n2\n");
    for (file, known, told) in [
        (&good, ["--newtons", &list(&backwards)], "They would fit in the reverse order"),
        (
            &good,
            ["--newtons", &list(&exchanged)],
            "presses 2 and 7 do not agree with the others, but would if their forces",
        ),
        (&good, ["--newtons", "1,2,3"], "10 rows of readings, but 3 forces are given"),
        (&two, ["--newtons", &list(&TEN_N)], "row 4 has 2 contacts: press with one tip"),
        (&light, ["--newtons", &list(&TEN_N)], "press 1 (0.7 N) is too light to be found"),
        (&nothing, ["--newtons", &list(&TEN_N)], "no press in any of its 10 rows"),
        (&few, ["--newtons", &list(&TEN_N[..3])], "3 presses, but 4 at least are needed"),
        (&good, ["--newtons", "1,1.1,1.2,1.3,1.4,1.5,1.6,1.7,1.8,1.9"], "the forces go from 1 N to 1.9 N only"),
        (&good, ["--forces", &sensor], "a table of readings has no times"),
        (&good, ["--forces", &no_force], "a column named force_n is needed"),
    ] {
        let message = refused(&folder, &[file, known[0], known[1]]);
        assert!(message.contains(told), "{known:?}: {message}");
    }
    let seven = Detector::preset("strip-13x60").unwrap().to_toml().replace("grid = [2, 8]", "grid = [2, 7]");
    let other = folder.with("other.toml", seven);
    let message = refused(&folder, &[&good, "--detector", &other, "--newtons", &list(&TEN_N)]);
    assert!(
        message.contains(
            "has 256 readings a frame (these are of 16 electrodes), but the detector strip-13x60 with its 14 electrodes"
        ),
        "{message}"
    );
    for wrong in [
        &[&good, "--out", "x.toml"][..],
        &[&good, "--newtons", "1,-2", "--out", "x.toml"],
        &[&good, "--newtons", "1", "--law", "5"],
    ] {
        assert_eq!(TACTOMO.run(&[&["calibrate", "force"], wrong].concat()).status.code(), Some(2), "{wrong:?}");
    }
}

#[test]
fn presses_of_a_recording_are_found_and_counted() {
    const FORCES_N: [f64; 6] = [1.2, 6.0, 2.0, 9.0, 3.6, 1.5];
    let folder = Folder::new("force-recording");
    let mut bench = Bench::new(5);
    let file = folder.path("scale.tactomo");
    // A press a second from 0.5 s on, each 0.6 s long with 0.1 s to come and to go.
    let detector = bench.detector.clone();
    recording(&file, &detector, 6.8, |time_s| {
        let press = |bench: &Bench| {
            let (k, at_s) = ((time_s - 0.5).div_euclid(1.0), (time_s - 0.5).rem_euclid(1.0));
            let full_n = FORCES_N.get(k as usize).filter(|_| k >= 0.0)?;
            let force_n = full_n * (at_s / 0.1).min((0.6 - at_s) / 0.1).min(1.0);
            let place_m = [0.004 * k - 0.01, 0.012 - 0.005 * k];
            (force_n > 0.0).then(|| bench.ball_at(place_m, force_n))
        };
        let contact = press(&bench);
        bench.row(contact.as_slice())
    });
    let out = folder.path("cal.toml");
    let report = calibrated(&[&file, "--newtons", &list(&FORCES_N), "--out", &out]);
    for (press, force_n) in report["presses"].as_array().unwrap().iter().zip(FORCES_N) {
        let found_n = press["fitted_force_n"].as_f64().unwrap();
        assert!((found_n / force_n).ln().abs() < 0.04, "{press}");
    }
    let message = refused(&folder, &[&file, "--newtons", "1,2,3,4,5"]);
    assert!(message.contains("6 presses are found, but 5 forces are given"), "{message}");
    assert!(message.contains("presses begin at 0.5, 1.5, 2.5, 3.5, 4.5, 5.5 s"), "{message}");
    // The recording is still one of this detector, whatever is known of its forces.
    let again = TACTOMO.run(&["reconstruct", &file, "--detector", &out, "--solver", "contacts", "--json"]);
    assert!(
        !String::from_utf8_lossy(&again.stderr).contains("was recorded on"),
        "{}",
        String::from_utf8_lossy(&again.stderr)
    );
}

#[test]
fn a_force_sensor_tells_loading_from_unloading() {
    const HALF: f64 = 0.08;
    let folder = Folder::new("force-sensor");
    let mut bench = Bench::new(6);
    let force_n = |time_s: f64| (9.0 * (1.0 - ((time_s - 0.3).rem_euclid(2.0) - 0.9).abs() / 0.9)).max(0.0);
    let file = folder.path("ramp.tactomo");
    let detector = bench.detector.clone();
    recording(&file, &detector, 6.3, |time_s| {
        let press = |bench: &Bench| {
            if time_s < 0.3 {
                return None;
            }
            let (k, at_s) = ((time_s - 0.3).div_euclid(2.0), (time_s - 0.3).rem_euclid(2.0));
            // Let go, the foam touches as if it were pressed harder.
            let side = if at_s < 0.9 { -HALF } else { HALF };
            (force_n(time_s) > 0.01).then(|| bench.ball_at([0.006 * k - 0.006, 0.003], force_n(time_s) * side.exp()))
        };
        let contact = press(&bench);
        bench.row(contact.as_slice())
    });
    let sensor: String = (0..640)
        .map(|k| 0.01 * f64::from(k))
        .map(|s| format!("{s},{}\n", if s < 0.3 { 0.0 } else { force_n(s) }))
        .collect();
    let sensor = folder.with("sensor.csv", format!("time_s,force_n\n{sensor}"));
    let out = folder.path("cal.toml");
    let report = calibrated(&[&file, "--forces", &sensor, "--out", &out]);
    let count = |direction: &str| {
        report["presses"].as_array().unwrap().iter().filter(|press| press["direction"] == direction).count()
    };
    assert!(count("loading") > 15 && count("unloading") > 15, "{report}");
    let law = Detector::read(Path::new(&out)).unwrap().force.unwrap();
    // Half the width is 0.08 of the force, and of the conductance its power of the force.
    let of_force = (law.force_n(law.conductance_s(1.0) * (1.0 + law.hysteresis), 0.0).force_n).ln();
    assert!((of_force / HALF - 1.0).abs() < 0.25, "{of_force}: {law:?}");
    assert!(law.scatter < 0.04, "{law:?}");
    // The uppermost press is a mean over a quarter.
    assert!((7.0..9.0).contains(&law.range_n[1]), "{law:?}");
    let late = folder.with("late.csv", "time_s,force_n\n100,1\n101,2\n");
    let message = refused(&folder, &[&file, "--forces", &late]);
    assert!(message.contains("the sensor is from 100.0 to 101.0 s"), "{message}");
}

#[test]
fn a_wanted_law_that_is_open_is_not_determined() {
    let folder = Folder::new("force-open");
    let mut bench = Bench::new(9);
    // So light that the constriction hardly counts.
    let forces_n = [0.6, 0.8, 1.0, 1.3, 1.6, 2.0];
    let file = folder.with("light.csv", csv(&bench.rows(&forces_n, 0.05)));
    let report =
        calibrated(&[&file, "--newtons", &list(&forces_n), "--law", "saturating", "--out", &folder.path("cal.toml")]);
    assert_eq!((&report["law"], &report["maximum_force"]), (&"saturating".into(), &"not determined".into()));
    assert_eq!(report["parameters"][2]["name"], "series_ohm");
    assert!(report["parameters"][2]["value"].is_null() && report["maximum_force_n"].is_null(), "{report}");
    assert!(report["maximum_force_as_printed_n"].is_null());
}

#[test]
fn presses_tell_the_film_of_a_foam() {
    let folder = Folder::new("material-fit");
    let (mut within, mut follows, mut all) = (0, 0, 0);
    for seed in 100..108 {
        let mut bench = Bench::new(seed);
        // Another film than the paper's foams have.
        bench.hertz = bench.hertz.with(Surface::Film { unit_pa: 6e4 });
        let file = folder.with(&format!("presses-{seed}.csv"), csv(&bench.rows(&TEN_N, 0.05)));
        let out = folder.path(&format!("foam-{seed}.toml"));
        let fit = ["material", "fit", &file, "--newtons", &list(&TEN_N), "--tip", "5", "--out", &out, "--json"];
        let report = TACTOMO.json(&fit);
        let number = |name: &str| report[name].as_f64().unwrap_or_else(|| panic!("no {name}: {report}"));
        let (unit_pa, deviation_pa) = (number("film_unit_pa"), number("film_unit_deviation_pa"));
        assert!((unit_pa / 6e4 - 1.0).abs() < 0.05, "{seed}: {unit_pa} {deviation_pa}");
        within += usize::from((unit_pa - 6e4).abs() < BAND * deviation_pa);
        all += 1;
        assert!((number("exponent") - 5.0 / 3.0).abs() < 1e-12);
        follows += usize::from(report["follows_law"] == true);
        let skin = Skin::from(Foam::of('A').unwrap()).with(Surface::Film { unit_pa });
        assert_eq!(Detector::read(Path::new(&out)).unwrap(), Detector { skin: Some(skin), ..Detector::default() });

        // What was measured, as a table: the same film.
        let rows = report["presses"].as_array().unwrap().iter().map(|press| {
            let [force_n, conductance_s, deviation_s] =
                ["force_n", "conductance_with_constriction_s", "sigma_conductance_with_constriction_s"]
                    .map(|name| press[name].to_string());
            format!("{force_n},{conductance_s},{deviation_s}\n")
        });
        let table = format!("force_n,conductance_s,conductance_deviation_s\n{}", rows.collect::<String>());
        let table = folder.with("forces.csv", table);
        let again = TACTOMO.json(&["material", "fit", &table, "--tip", "5", "--json"]);
        assert_eq!(again["film_unit_pa"], report["film_unit_pa"]);
    }
    assert!(within >= all - 2 && follows >= all - 1, "{within} of {all} in bands of 90 %, {follows} follow the law");
}

#[test]
fn presses_that_tell_no_film_say_what_to_do() {
    let folder = Folder::new("material-bad");
    let mut bench = Bench::new(3);
    let good = folder.with("good.csv", csv(&bench.rows(&TEN_N, 0.0)));
    let table = "force_n,conductance_s\n0.5,2e-6\n1,6e-6\n2,2e-5\n4,6e-5\n8,2e-4\n";
    let forces = folder.with("forces.csv", table);
    let few = folder.with("few.csv", "force_n,conductance_s\n0.5,2e-6\n1,6e-6\n");
    let narrow = folder.with("narrow.csv", "force_n,conductance_s\n1,2e-6\n1.1,3e-6\n1.2,4e-6\n1.3,5e-6\n1.4,6e-6\n");
    let silent: String = Detector::default().to_toml().split("\n[skin]").next().unwrap().to_owned();
    let silent = folder.with("silent.toml", silent);
    fn fit<'a>(arguments: &[&'a str]) -> Vec<&'a str> {
        [&["material", "fit", "--tip", "5"][..], arguments].concat()
    }
    for (arguments, told) in [
        (
            fit(&[&good]),
            "there are 256 without names; of a recording, or a table of readings, give --newtons or --forces",
        ),
        (fit(&[&few]), "2 presses, but 4 at least are needed"),
        (fit(&[&narrow]), "press with forces that differ 2 times at least"),
        (fit(&[&forces, "--detector", &silent]), "give --elasticity"),
        (fit(&[&good, "--newtons", "1,2,3"]), "10 rows of readings, but 3 forces are given"),
    ] {
        let message = TACTOMO.refused(&arguments);
        assert!(message.contains(told), "{arguments:?}: {message}");
    }
    let shown = TACTOMO.succeeds(&fit(&[&forces, "--detector", &silent, "--elasticity", "0.2"]));
    let shown = String::from_utf8(shown).unwrap();
    assert!(shown.starts_with("[skin]\nyoung_pa = 200000.0\npoisson = 0.3\nfilm_unit_pa = "), "{shown}");
    let warned = TACTOMO.run(&fit(&[&forces, "--flat"]));
    let warned = String::from_utf8_lossy(&warned.stderr).into_owned();
    assert!(warned.contains("warning: the presses do not follow the law of a film"), "{warned}");
}
