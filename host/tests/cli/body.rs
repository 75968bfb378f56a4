//! Several boards shown together, recorded in a folder, and shown again.

use tactomo_tests::{Folder, TACTOMO};

/// Names of the patches that a body's detectors were told by, in their order, and how it ended.
fn patches_of(body: &str) -> (Vec<String>, Option<i32>, String) {
    let output = TACTOMO.run(&["live", "--body", body, "--seconds", "1", "--json"]);
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
    assert!(times.values().all(|times| times.len() > 20 && times.is_sorted()));
}

#[test]
fn boards_that_are_recorded_in_a_folder_are_cut_and_shown_again_as_one() {
    let folder = Folder::new("boards");
    let [taken, piece, mcap] = ["taken", "piece", "all.mcap"].map(|name| folder.path(name));
    let args = ["live", "--simulate", "2", "--seconds", "2", "--json", "--record", &taken, "--mcap", &mcap];
    let output = TACTOMO.run(&args);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let bytes = std::fs::read(&mcap).unwrap();
    let has = |topic: &str| bytes.windows(topic.len()).any(|at| at == topic.as_bytes());
    assert!(has("/tactomo/board-1/touch") && has("/tactomo/board-2/readings") && !has("/tactomo/touch"));
    let again = TACTOMO.run(&args);
    assert!(again.status.code() == Some(1) && String::from_utf8_lossy(&again.stderr).contains("taken"));
    let output = TACTOMO.run(&["recording", "cut", &taken, "--from", "1.4", "--out", &piece]);
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
    // All of it, however long the machine took to begin.
    runs(&["recording", "cut", &taken, "--to", "60", "--out", &piece]);
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
