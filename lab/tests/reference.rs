//! Forward models and solvers against readings that another program has computed: `tests/reference`.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardModel, Slab};
use tactomo_study::built::{self, Plan};
use tactomo_study::case::Case;
use tactomo_study::validate::{SolverReport, Trials, forward_errors, try_solver};
use tactomo_touch::solve::{Method, Problem};

/// Largest difference of a reading, over the largest reading, that the slab may have. It is 1.14 % where it is largest; the references' own
/// two meshes differ by up to 0.97 %.
const FORWARD_ERROR: f64 = 0.012;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("tests/reference")
}

fn cases() -> Vec<Case> {
    let mut files: Vec<_> = folder().join("slab").read_dir().unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.iter().map(|file| Case::read(file).unwrap()).collect()
}

/// What a solver makes of a case on the slab, from cold starts.
fn tried(case: &Case, method: Method, noise_lsb: Option<f64>, count: usize) -> SolverReport {
    let slab: Arc<dyn ForwardModel> = Arc::new(Slab::new(&case.detector).unwrap());
    let problem = Problem::new(slab);
    let mut solver = method.build(&problem).unwrap();
    try_solver(case, &mut *solver, &Trials { noise_lsb, seed: 1, count }).unwrap()
}

#[test]
fn the_slab_reads_as_the_reference_does() {
    let cases = cases();
    assert_eq!(cases.len(), 12);
    for case in &cases {
        let [reading, _] = forward_errors(case, &Slab::new(&case.detector).unwrap()).unwrap();
        let name = &case.detector.name;
        assert!(reading <= FORWARD_ERROR, "{name}: readings differ by {:.2} % of the largest", 100.0 * reading);
    }
}

#[test]
fn contacts_are_where_the_reference_has_them() {
    for case in &cases() {
        for method in [Method::Contacts, Method::Auto] {
            let (exact, noisy) = (tried(case, method, None, 1), tried(case, method, Some(1.5), 5));
            for (report, limit_m) in [(exact, 0.3e-3), (noisy, 0.6e-3)] {
                let (name, what) = (&case.detector.name, method.name());
                assert_eq!(report.count_found, report.count_true as f64, "{what} on {name}");
                let error_m = report.position_error_m.unwrap();
                assert!(error_m < limit_m, "{what} on {name}: {:.2} mm", 1e3 * error_m);
            }
        }
    }
}

/// The linear image is far off, and no further than it is: 1 to 7.5 mm, and 29 mm where the bottom hardly conducts.
#[test]
fn the_linear_image_is_no_worse_than_it_was() {
    for case in &cases() {
        let report = tried(case, Method::Tikhonov, None, 1);
        let limit_m = if case.detector.name.ends_with("sensitive_gradient") { 32e-3 } else { 8e-3 };
        let error_m = report.position_error_m.unwrap();
        assert!(error_m < limit_m, "{}: {:.2} mm", case.detector.name, 1e3 * error_m);
    }
}

#[test]
fn a_detector_as_built_is_read_by_its_description() {
    let plan = Plan {
        detector: Detector::default(),
        files: vec![folder().join("built/built101.json.gz")],
        methods: vec![Method::Contacts],
        detectors: 1,
        presses: 0,
        rub: 0,
        known: 0,
        threads: 1,
        seed: 1,
    };
    let report = built::run(&plan, "", &|_| ()).unwrap();
    let singles = report.rows.iter().find(|row| row.detector.is_some() && row.contacts == 1).unwrap();
    assert_eq!(singles.figures.scenes, 36);
    // 0.59 mm, and all are counted as one.
    assert!(singles.figures.error_m.unwrap() < 0.8e-3, "{:?}", singles.figures);
    assert!(singles.figures.count_right > 0.95, "{:?}", singles.figures);
}
