//! Which module may use which: the plan of the package, held by a look at the sources.
//!
//! A room is a module with all that is in it. What is used is read from the paths that begin with `crate::` and `super::`, in `use` lines and elsewhere.
//! Modules of tests may use anything.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Each room with those that it may use, all of which stand above it: so there are no cycles.
const PLAN: [(&str, &[&str]); 28] = [
    ("gaussian", &[]),
    ("scanning", &[]),
    ("student", &[]),
    ("vibration", &[]),
    ("solve::answer", &[]),
    ("solve::fit", &["solve::answer"]),
    ("learned", &["solve::answer", "solve::fit"]),
    ("solve::before", &["solve::fit"]),
    ("solve::compiled", &["solve::fit"]),
    ("solve::problem", &["learned", "solve::before", "solve::compiled"]),
    ("solve::solver", &["solve::answer"]),
    ("solve::after", &["gaussian", "solve::answer", "solve::fit", "solve::problem"]),
    ("solve::health", &["solve::answer"]),
    (
        "solve::methods::compiled",
        &["solve::answer", "solve::compiled", "solve::fit", "solve::problem", "solve::solver"],
    ),
    // Contacts begin with those that a table tells; they average frames and number contacts by themselves.
    (
        "solve::methods::contacts",
        &[
            "scanning",
            "solve::answer",
            "solve::fit",
            "solve::before",
            "solve::problem",
            "solve::solver",
            "solve::after",
            "solve::methods::compiled",
        ],
    ),
    ("solve::methods::shapes", &["solve::answer", "solve::fit", "solve::problem"]),
    ("solve::methods::image", &["solve::answer", "solve::fit", "solve::problem", "solve::solver"]),
    ("solve::methods::linear", &["solve::answer", "solve::fit", "solve::solver"]),
    ("solve::methods::comparisons", &["solve::answer", "solve::fit", "solve::problem", "solve::solver"]),
    ("solve::methods::kernel", &["learned", "solve::answer", "solve::fit", "solve::problem", "solve::solver"]),
    ("solve::methods::network", &["learned", "solve::answer", "solve::fit", "solve::problem", "solve::solver"]),
    // The method that chooses among others.
    (
        "solve::methods::auto",
        &[
            "solve::answer",
            "solve::fit",
            "solve::before",
            "solve::problem",
            "solve::solver",
            "solve::methods::contacts",
            "solve::methods::shapes",
            "solve::methods::image",
            "solve::methods::linear",
        ],
    ),
    (
        "solve::pipeline",
        &[
            "learned",
            "solve::answer",
            "solve::fit",
            "solve::problem",
            "solve::solver",
            "solve::after",
            "solve::health",
            "solve::methods::compiled",
            "solve::methods::contacts",
            "solve::methods::image",
            "solve::methods::linear",
            "solve::methods::comparisons",
            "solve::methods::kernel",
            "solve::methods::network",
            "solve::methods::auto",
        ],
    ),
    // `solve` by itself is what it shows to others.
    ("pointer", &["solve"]),
    ("changes", &["solve"]),
    ("metrics", &["solve"]),
    ("schema", &["pointer", "solve"]),
    ("calibrate", &["gaussian", "student", "solve::fit", "solve"]),
];

/// Modules that hold rooms, and show what is in these.
const HALLS: [&str; 3] = ["", "solve", "solve::methods"];

/// The room or hall that a path leads to.
fn room(path: &[String]) -> String {
    let is_hall = |depth: &usize| HALLS.contains(&path[..*depth].join("::").as_str());
    let is_room = |depth: &usize| PLAN.iter().any(|(room, _)| *room == path[..*depth].join("::"));
    let depth = (0..=path.len()).rev().find(|depth| is_hall(depth) || is_room(depth));
    path[..depth.unwrap_or_default()].join("::")
}

/// The paths that a tree of a `use` line, or a path elsewhere, leads to, and what is left of the text.
fn paths<'a>(from: &[String], text: &'a str, found: &mut Vec<Vec<String>>) -> &'a str {
    let text = text.trim_start();
    if let Some(mut rest) = text.strip_prefix('{') {
        while !rest.trim_start().starts_with('}') {
            let after = paths(from, rest, found).trim_start().trim_start_matches(',');
            assert!(after.len() < rest.len(), "no tree of paths: {text}");
            rest = after;
        }
        return rest.trim_start().strip_prefix('}').unwrap_or(rest);
    }
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == '*')).unwrap_or(text.len());
    let (name, rest) = text.split_at(end);
    let mut to = from.to_vec();
    match name {
        "super" => drop(to.pop()),
        "self" | "*" | "crate" => {}
        _ => to.push(name.to_owned()),
    }
    if let Some(rest) = rest.strip_prefix("::") {
        return paths(&to, rest, found);
    }
    found.push(to);
    // Another name after `as` leads nowhere else.
    let skipped = rest.find([',', '}', ';', '\n']).unwrap_or(rest.len());
    if rest.trim_start().starts_with("as ") { &rest[skipped..] } else { rest }
}

/// What the source of a module uses, but for its tests and comments.
fn used(module: &[String], source: &str) -> BTreeSet<String> {
    let code = source.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    let code = lines.collect::<Vec<_>>().join("\n");
    let mut found = Vec::new();
    for (begin, at) in [("crate::", &[][..]), ("super::", module)] {
        for (start, _) in code.match_indices(begin) {
            let is_whole = !code[..start].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':');
            if is_whole {
                paths(at, &code[start..], &mut found);
            }
        }
    }
    found.iter().map(|path| room(path)).collect()
}

/// Sources below a folder, with the paths of their modules.
fn sources(folder: &Path, module: &[String], all: &mut BTreeMap<Vec<String>, PathBuf>) {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    for path in entries {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let within = |name: &str| [module, &[name.to_owned()]].concat();
        if path.is_dir() {
            sources(&path, &within(&name), all);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let is_test = name == "tests" || name.ends_with("_tests") || name == "samples";
            let of = if name == "mod" || name == "lib" { module.to_vec() } else { within(&name) };
            if !is_test {
                all.insert(of, path);
            }
        }
    }
}

#[test]
fn every_room_uses_only_those_that_the_plan_says() {
    let mut all = BTreeMap::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &[], &mut all);
    let mut wrong = Vec::new();
    let mut seen = BTreeSet::new();
    for (module, path) in &all {
        let of = room(module);
        if HALLS.contains(&of.as_str()) {
            // The hall of all rooms has none of its own.
            assert!(module.join("::") == of, "{} is in no room", path.display());
            continue;
        }
        let allowed = PLAN.iter().find(|(room, _)| *room == of).unwrap().1;
        for other in used(module, &fs::read_to_string(path).unwrap()) {
            if other != of && !allowed.contains(&other.as_str()) {
                wrong.push(format!("{}: {of} must not use {other}", path.display()));
            }
            seen.insert((of.clone(), other));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for (of, allowed) in PLAN {
        for other in allowed {
            assert!(seen.contains(&(of.to_owned(), (*other).to_owned())), "{of} no longer uses {other}");
        }
    }
}

#[test]
fn the_plan_has_no_cycles() {
    for (index, (of, allowed)) in PLAN.iter().enumerate() {
        let above = |other: &&str| HALLS.contains(other) || PLAN[..index].iter().any(|(room, _)| room == other);
        assert!(allowed.iter().all(above), "{of} uses what does not stand above it");
    }
    // What `solve` shows is made of its rooms and of what is learned: none of these may use it.
    let inner = PLAN.iter().filter(|(room, _)| room.starts_with("solve::") || *room == "learned");
    assert!(inner.clone().all(|(_, allowed)| !allowed.contains(&"solve")));
}

#[test]
fn paths_are_read_from_trees_and_from_code() {
    let module = ["solve", "before", "adaptive_mean"].map(str::to_owned);
    let source = "#[cfg(test)]\nmod tests;\nuse super::{latest::Latest, super::fit::{self, target::dot}};\nuse crate::solve::{Problem as P, answer};\n\
                  // crate::pointer\nfn f() { crate::scanning::spread() }\n#[cfg(test)]\nmod tests { use crate::calibrate; }";
    let found: Vec<_> = used(&module, source).into_iter().collect();
    assert_eq!(found, ["scanning", "solve", "solve::answer", "solve::before", "solve::fit"]);
}
