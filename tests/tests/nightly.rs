//! One file names the nightly compiler, by its date: no script, page or other file takes whichever is newest.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::{Path, PathBuf};

/// What is looked at, from the repository's root on.
const LOOKED_AT: [&str; 14] = [
    ".cargo",
    ".ci",
    ".github",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "README.md",
    "docs",
    "firmware",
    "host",
    "lab",
    "protocol",
    "rust-toolchain.toml",
    "tests",
    "tools",
];
/// What a toolchain's name follows, in scripts and in TOML.
const BEFORE_A_NAME: [&str; 7] = ["+", "\"", "'", "install ", "toolchain ", "toolchain=", "channel: "];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Text files below `path`, but for what was built.
fn texts(path: &Path, found: &mut Vec<(PathBuf, String)>) {
    if path.is_dir() {
        let is_built = ["target", "__pycache__", ".venv"].iter().any(|built| path.ends_with(built));
        let entries = if is_built { None } else { fs::read_dir(path).ok() };
        entries.into_iter().flatten().flatten().for_each(|entry| texts(&entry.path(), found));
    } else if let Ok(text) = fs::read_to_string(path) {
        found.push((path.to_owned(), text));
    }
}

/// Names of toolchains in a text that begin with the word, in two parts so that this file does not hold it.
fn names(text: &str) -> impl Iterator<Item = &str> {
    let word = concat!("night", "ly");
    text.match_indices(word).filter_map(move |(at, _)| {
        let (before, name) = text.split_at(at);
        let end = name.find(|letter: char| !(letter.is_ascii_alphanumeric() || letter == '-')).unwrap_or(name.len());
        BEFORE_A_NAME.iter().any(|named| before.ends_with(named)).then_some(&name[..end])
    })
}

#[test]
fn the_compiler_of_the_tools_has_a_date_and_one_file_names_it() {
    let named_in = Path::new("tools/xtensa-check/rust-toolchain.toml");
    let mut found = Vec::new();
    LOOKED_AT.iter().for_each(|path| texts(&root().join(path), &mut found));
    assert!(found.len() > 300, "{} files", found.len());
    let named: Vec<_> = found.iter().flat_map(|(path, text)| names(text).map(move |name| (path, name))).collect();
    let [(path, name)] = named[..] else { panic!("it should be named once, in {}: {named:?}", named_in.display()) };
    assert!(path.ends_with(named_in), "{}", path.display());
    let date: Vec<_> = name.split('-').skip(1).map(|part| part.len()).collect();
    assert_eq!(date, [4, 2, 2], "{name}");
}

#[test]
fn names_without_a_date_are_found() {
    let word = concat!("night", "ly");
    for bare in
        [format!("cargo +{word} fuzz"), format!("channel = \"{word}\""), format!("rustup toolchain install {word}")]
    {
        assert_eq!(names(&bare).collect::<Vec<_>>(), [word], "{bare}");
    }
    assert_eq!(names(&format!("a {word} compiler")).count(), 0);
}
