//! The program as a user calls it: exit codes and messages.

use tactomo_tests::LAB;

#[test]
fn every_command_has_a_help_with_an_example() {
    for command in ["tradeoff", "stability", "bank", "study", "validate", "design", "learn", "score"] {
        let output = LAB.run(&[command, "--help"]);
        let text = String::from_utf8_lossy(&output.stdout);
        assert_eq!(output.status.code(), Some(0));
        assert!(text.contains("Example") && text.contains(&format!("tactomo-lab {command}")), "{command}: {text}");
    }
}

#[test]
fn wrong_use_exits_with_2_and_names_the_argument() {
    for (args, named) in [
        (&["bank", "--count", "0"][..], "--count"),
        (&["bank", "--scenes", "rows"], "there are no scenes `rows`; there are random, single, corner, row"),
        (&["tradeoff", "--scan", "--solver", "auto"], "--solver"),
        (&["live", "--seconds", "-1"], "invalid value '-1' for '--seconds <SECONDS>': a time (s) from"),
        (&["design", "--smallest", "1e308"], "a force (N) from 0.000001 to 10000"),
        (&["dance"], "dance"),
    ] {
        let (code, message) = LAB.failure(args);
        assert_eq!(code, Some(2), "{args:?}: {message}");
        assert!(message.contains(named), "{args:?}: {message}");
    }
}

#[test]
fn what_fails_exits_with_1_and_says_what_to_do() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    let exists = "exists already, and no file is replaced: give another name, or remove it first";
    for (args, named) in [
        (&["tradeoff", "--quick", "--out", file][..], exists),
        (&["tradeoff", "--quick", "--picture", file], exists),
        (&["stability", "--quick", "--out", file], exists),
        (
            &["stability", "--quick", "--out", "no/such/a.html"],
            "cannot write no/such/a.html: there is no folder no/such; make it first",
        ),
        (&["stability", "--quick", "--csv", file], exists),
        (&["live", "--csv", file], exists),
        (&["bank", "--case", "exakt"], "the bank has no case `exakt`; it has `exact`, `exact corners`"),
        (&["bank", "--independent", "no/such.npz"], "cannot read no/such.npz"),
        (&["bank", "--independent", file], "/Cargo.toml: not an NPZ file"),
        (&["live", "--scene", "single", "--scan", "99"], "--scan 99, scene single: there is no electrode 99"),
    ] {
        let message = LAB.refused(args);
        assert!(message.contains(named), "{args:?}: {message}");
    }
}

#[test]
fn a_case_that_is_asked_for_has_a_row_for_each_class_and_shows_the_worst_scene() {
    let args = ["bank", "--scenes", "random", "--detector", "square-60", "--count", "5", "--worst", "1"];
    let output = LAB.run(&args);
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{text}");
    for class in ["1 contact ", "5 contacts ", "all "] {
        let is_row = |line: &&str| line.starts_with("random") && line.contains(&format!(" {class}"));
        assert_eq!(text.lines().filter(is_row).count(), 1, "{class}: {text}");
    }
    assert!(text.contains("auto, random, scene ") && text.contains(" visible, "), "{text}");
    let report = LAB.json(&[&args[..], &["--json"]].concat());
    let all = report["rows"].as_array().and_then(|rows| rows.iter().find(|row| row["class"] == "all")).unwrap();
    assert_eq!((&all["case"], &all["solver"], &all["scenes"]["scenes"]), (&"random".into(), &"auto".into(), &5.into()));
    assert_eq!(report["worst"].as_array().map(Vec::len), Some(1));
}
