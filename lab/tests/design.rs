//! `study materials` and the other studies of detectors, and `design`, as a person runs them.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use tactomo_tests::{Folder, LAB, TACTOMO};

fn refused(arguments: &[&str]) -> String {
    let output = LAB.run(arguments);
    assert!(!output.status.success(), "{arguments:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn materials_give_json_csv_and_a_page() {
    let folder = Folder::new("materials");
    let [page, csv] = ["materials.html", "materials.csv"].map(|name| folder.path(name));
    let found = LAB.json(&["study", "materials", "--side", "2", "--json", "--out", &page, "--csv", &csv]);
    assert_eq!(found["conditions"].as_array().map(Vec::len), Some(4));
    assert!(found["seconds"].as_f64().is_some_and(|seconds| seconds > 0.0));
    let names: Vec<&str> =
        found["samples"].as_array().into_iter().flatten().filter_map(|one| one["name"].as_str()).collect();
    assert_eq!(names, ["A", "B", "C", "D", "BA", "AD", "BC", "AB", "DA", "BB"]);
    assert!(found["claims"].as_array().is_some_and(|claims| claims.len() >= 7));
    let written = std::fs::read_to_string(&page).unwrap();
    assert!(written.contains("<svg") && written.contains("the paper says") && !written.contains("http"));
    assert_eq!(std::fs::read_to_string(&csv).unwrap().lines().count(), 1 + 10 + 4);
}

#[test]
fn what_is_compared_has_to_be_of_the_size_that_is_wished() {
    let message = refused(&["design", "--size", "30x30", "--compare", "square-50"]);
    assert!(
        message.contains("--compare square-50: it is 50x50 mm, and 30x30 mm is wished: give --size 50x50"),
        "{message}"
    );
}

#[test]
fn a_design_is_not_written_as_a_page_by_its_name() {
    let message = refused(&["design", "--size", "30x30", "--out", "mine.html"]);
    assert!(message.contains("for a page, --page mine.html"), "{message}");
}

#[test]
fn a_design_is_a_detector_that_live_takes() {
    let folder = Folder::new("design");
    let path = folder.path("chosen.toml");
    let asked = [
        "design",
        "--size",
        "50x50",
        "--foam",
        "A",
        "--foam",
        "B",
        "--electrodes",
        "6",
        "--two-points",
        "20",
        "--try",
        "40",
        "--compare",
        "square-50",
        "--json",
        "--out",
        &path,
    ];
    let answer = LAB.json(&asked);
    assert!(answer["choices"].as_array().is_some_and(|choices| !choices.is_empty()));
    assert!(answer["compared"]["rating"]["electrodes"] == 16);
    // How the boards suit the pads of each choice: foams A and B suit all of them.
    let settling = answer["settling"].as_array().unwrap();
    assert_eq!(Some(settling.len()), answer["choices"].as_array().map(Vec::len));
    let boards: Vec<_> = settling[0].as_array().unwrap().iter().map(|one| one["board"].as_str().unwrap()).collect();
    assert_eq!(boards, ["esp32", "esp32c3", "esp32c6", "stm32f405"]);
    assert!(settling[0][0]["pad_ohm"].as_f64().is_some_and(|ohm| ohm > 100.0));
    // The file says how soft it is: forces need no --material.
    let live = TACTOMO.json(&["live", "--simulate", "--detector", &path, "--force", "2", "--seconds", "0.5", "--json"]);
    assert!(live["frames"].as_u64().is_some_and(|frames| frames > 0), "{live}");
}

#[test]
fn wrong_wishes_and_foams_say_what_is_allowed() {
    let folder = Folder::new("foams");
    let path = folder.with("foams.toml", "[[foam]]\nname = \"X\"\nconductivity_s_per_m = 0.1\n");
    for (arguments, named) in [
        (vec!["design", "--foams", &path], "elasticity_pa"),
        (vec!["design", "--foams", "no/foams.toml"], "cannot read no/foams.toml"),
        (vec!["design", "--foam", "E"], "A, B, C and D"),
        (vec!["design", "--size", "0x60"], "a side (mm) from 0.001 to 10000 is needed"),
        (vec!["design", "--size", "60x1e308"], "a side (mm) from 0.001 to 10000 is needed"),
        (vec!["design", "--size", "60"], "60x60"),
        (vec!["design", "--smallest", "3", "--largest", "1"], "not below --largest"),
        (vec!["design", "--electrodes", "64"], "4 to 32"),
        (vec!["design", "--electrodes", "20", "--board", "esp32"], "inputs for 16"),
        (vec!["design", "--board", "esp64"], "esp32c3"),
        (vec!["design", "--two-points", "90"], "shorter side"),
        (vec!["design", "--compare", "square-60", "--material", "AX"], "A, B, C or D"),
        (vec!["study", "materials", "--side", "1"], "2..=301"),
        (vec!["study", "nothing"], "nothing"),
    ] {
        let said = refused(&arguments);
        assert!(said.contains(named), "{arguments:?}: {said}");
    }
}
