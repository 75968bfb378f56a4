//! `learn`, `score`, and `reconstruct` and `live` with what was learned.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use serde_json::Value;
use tactomo_tests::{Folder, LAB, TACTOMO};

fn heard(x: f64, y: f64, force: f64) -> [f64; 3] {
    [[0.0, 0.0], [1.0, 0.1], [0.4, 1.0]].map(|[a, b]| force / (0.2 + (x - a).powi(2) + (y - b).powi(2)))
}

/// Presses with their places and what three channels, in this order, hear of them.
fn csv(range: std::ops::Range<usize>, channels: [usize; 3]) -> String {
    let names = channels.map(|channel| ["a", "b", "c"][channel]).join(",");
    let row = |i: usize| {
        let [x, y, z] = [0.8191, 0.6710, 0.5497].map(|step| (step * (i + 1) as f64).fract());
        let volts = channels.map(|channel| heard(x, y, 1.0 + z)[channel].to_string()).join(",");
        format!("{i},{x},{y},{},{volts}\n", 0.001 * (1.0 + z))
    };
    format!("id,x_m,y_m,depth_m,{names}\n") + &range.map(row).collect::<String>()
}

#[test]
fn what_is_learned_is_kept_scored_and_used() {
    let folder = Folder::new("learn");
    let presses = folder.with("presses.csv", csv(0..150, [0, 1, 2]));
    let model = folder.path("sensor.safetensors");
    let learned = LAB.json(&["learn", &presses, "--out", &model, "--json"]);
    assert_eq!((&learned["channels"], &learned["strength"]), (&Value::from(3), &Value::from("depth_m")));
    // In another order of the columns.
    let unseen = folder.with("unseen.csv", csv(150..210, [2, 0, 1]));
    let page = folder.path("score.html");
    let scored = LAB.json(&["score", &model, &unseen, "--json", "--out", &page]);
    let [left_out_m, off_m] =
        [&learned["left_out_m"], &scored["root_mean_square_m"]].map(|error| error.as_f64().unwrap());
    assert!(left_out_m < 0.05 && off_m < 2.0 * left_out_m + 0.005, "{learned} {scored}");
    assert_eq!(scored["presses"], 60);
    assert!(std::fs::read_to_string(&page).unwrap().contains("Mean error by place"));
    // The file of presses itself is read too.
    let output = TACTOMO.run(&["reconstruct", &unseen, "--learned", &model, "--json"]);
    let lines: Vec<Value> =
        String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |name: &str| lines[7]["contacts"][0][name].as_f64().unwrap();
    let truth = [0.8191, 0.6710, 0.5497].map(|step| (step * 158.0_f64).fract());
    assert!((of("x_m") - truth[0]).hypot(of("y_m") - truth[1]) < 0.05, "{}", lines[7]);
    assert!((of("depth_m") / (0.001 * (1.0 + truth[2])) - 1.0).abs() < 0.1, "{}", lines[7]);
    assert!(lines[7]["contacts"][0].get("conductance_s").is_none(), "depths were taught: {}", lines[7]);
    let before = std::fs::read(&model).unwrap();
    assert!(LAB.refused(&["learn", &presses, "--out", &model]).contains("no file is replaced"));
    assert_eq!(std::fs::read(&model).unwrap(), before);
}

#[test]
fn presses_at_places_of_others_are_told_to_teach_nothing() {
    let folder = Folder::new("learn-middle");
    let right = csv(0..60, [0, 1, 2]);
    // Of each row the place of any other.
    let rows: Vec<Vec<&str>> = right.lines().skip(1).map(|row| row.split(',').collect()).collect();
    let mut others: Vec<usize> = (0..60).collect();
    fastrand::Rng::with_seed(3).shuffle(&mut others);
    let row = |i: usize| [&rows[i][..1], &rows[others[i]][1..3], &rows[i][3..]].concat().join(",");
    let head = right.lines().next().unwrap().to_owned();
    let wrong = [vec![head], (0..60).map(row).collect()].concat().join("\n");
    for (name, table, is_warned) in [("right", right.clone(), false), ("wrong", wrong, true)] {
        let presses = folder.with(&format!("{name}.csv"), table);
        let output = LAB.run(&["learn", &presses, "--out", &folder.path(name), "--json"]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(told.contains("no better than guessing the middle"), is_warned, "{name}: {told}");
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(report["no_better_than_middle"], is_warned, "{report}");
    }
}

#[test]
fn what_cannot_be_is_told() {
    let folder = Folder::new("learn-wrong");
    let presses = folder.with("presses.csv", csv(0..60, [0, 1, 2]));
    let model = folder.path("sensor.safetensors");
    LAB.json(&["learn", &presses, "--out", &model, "--json"]);
    let other = folder.with("other.csv", csv(0..60, [0, 1, 2]).replacen("a,b,c", "a,left,c", 1));
    assert!(LAB.refused(&["score", &model, &other]).contains("are missing: b"));
    assert!(TACTOMO.refused(&["reconstruct", &other, "--learned", &model]).contains("are missing: b"));
    assert!(LAB.refused(&["score", &presses, &presses]).contains("no safetensors file"));
    assert!(
        TACTOMO
            .refused(&["live", "--simulate", "--seconds", "1", "--json", "--learned", &model])
            .contains("of another sensor")
    );
    let few = folder.with("few.csv", csv(0..5, [0, 1, 2]));
    let nothing = folder.path("nothing.safetensors");
    assert!(LAB.refused(&["learn", &few, "--out", &nothing]).contains("5 presses, but 10 at least"));
    assert!(
        LAB.refused(&["learn", &presses, "--detector", "square-60", "--out", &nothing])
            .contains("3 channels, but the detector square-60")
    );
    assert!(!std::path::Path::new(&nothing).exists());
    assert!(LAB.refused(&["score", &model, &presses, "--out", &folder.path("map.png")]).contains(".html or .svg"));
}

#[test]
fn live_reads_by_what_was_learned_on_its_detector() {
    use tactomo_physics::detector::Detector;
    use tactomo_touch::learned::Learned;
    use tactomo_touch::solve::{Kernel, Presses, Problem};
    let folder = Folder::new("learn-live");
    let presses = Presses::simulated(&Problem::of(&Detector::default()).unwrap(), 60);
    let bytes = Learned::bytes_of(&Kernel::train(&presses).unwrap()).unwrap();
    let model = folder.with("mine.safetensors", bytes);
    let summary =
        TACTOMO.json(&["live", "--simulate", "--board", "ideal", "--seconds", "1", "--json", "--learned", &model]);
    assert_eq!(summary["solver"], "kernel");
    assert!(summary["solved"].as_u64().unwrap() > 10, "{summary}");
}
