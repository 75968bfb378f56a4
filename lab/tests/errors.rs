//! Errors say each of their causes once: what an error says is its own part, and what caused it is its source.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_study::built::BuiltFile;
use tactomo_study::case::Case;
use tactomo_tests::{LAB, TACTOMO};
use tactomo_touch::solve::Method;

/// All Rust sources of these folders.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        match entry.file_type().unwrap() {
            kind if kind.is_dir() && entry.file_name() != "target" => sources(&path, found),
            _ if path.extension().is_some_and(|extension| extension == "rs") => found.push(path),
            _ => {}
        }
    }
}

/// What stands in the brackets that open before `text`, and what comes after them. Brackets in strings do not count.
fn bracketed(text: &str) -> (&str, &str) {
    let (mut depth, mut quoted, mut escaped) = (1, false, false);
    for (at, c) in text.char_indices() {
        match c {
            _ if escaped => escaped = false,
            '\\' if quoted => escaped = true,
            '"' => quoted = !quoted,
            '(' | '[' | '{' if !quoted => depth += 1,
            ')' | ']' | '}' if !quoted => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return (&text[..at], &text[at + 1..]);
        }
    }
    (text, "")
}

/// Each `#[error(...)]` with the fields of its variant or struct.
fn errors(source: &str) -> Vec<(&str, &str)> {
    let mut found = Vec::new();
    for (at, mark) in source.match_indices("#[error(") {
        let (says, after) = bracketed(&source[at + mark.len()..]);
        // Up to the fields, or to the end of a variant that has none.
        let opens = after.find(['(', '{', ',']).unwrap_or(after.len());
        let fields = match after.as_bytes().get(opens) {
            Some(b'(' | b'{') => bracketed(&after[opens + 1..]).0,
            _ => "",
        };
        found.push((says, fields));
    }
    found
}

/// Whether what an error says has its source in it, which whoever shows it adds.
fn says_its_source(says: &str, fields: &str) -> bool {
    let names = |marked: &str| {
        let after = fields.split_once(marked).map(|(_, after)| after.trim_start().trim_start_matches("pub "));
        after.and_then(|after| after.split_once(':')).map(|(name, _)| name.trim().to_owned())
    };
    let is_named = |name: &str| says.contains(&format!("{{{name}}}")) || says.contains(&format!("{{{name}:"));
    let is_tuple = !fields.contains(": ") && (fields.contains("#[from]") || fields.contains("#[source]"));
    let has_source = fields.split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == "source");
    is_tuple && is_named("0")
        || has_source && is_named("source")
        || ["#[source]", "#[from]"].into_iter().filter_map(names).any(|name| is_named(&name))
}

#[test]
fn the_search_finds_what_it_is_for() {
    for (source, is_wrong) in [
        ("#[error(\"{path}: {source}\")] A { path: String, source: io::Error },", true),
        ("#[error(\"cannot read {path}\")] A { path: String, source: io::Error },", false),
        ("#[error(\"{0}\")] A(#[from] io::Error),", true),
        ("#[error(\"no {0}\")] A(String),", false),
        ("#[error(transparent)] A(#[from] io::Error),", false),
        ("#[error(\"{}: {why}\", path.display())] A { path: PathBuf, #[source] why: io::Error },", true),
    ] {
        let found = errors(source);
        assert_eq!(found.len(), 1, "{source}");
        assert_eq!(says_its_source(found[0].0, found[0].1), is_wrong, "{source}");
    }
}

#[test]
fn no_error_says_its_source() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut files = Vec::new();
    for folder in ["protocol", "firmware", "host", "lab", "tests"] {
        let folder = root.join(folder);
        if folder.is_dir() {
            sources(&folder, &mut files);
        }
    }
    files.retain(|file| !file.ends_with("lab/tests/errors.rs"));
    let (mut count, mut wrong) = (0, Vec::new());
    for file in files {
        let source = fs::read_to_string(&file).unwrap();
        let errors = errors(&source);
        count += errors.len();
        let named = |(says, _): (&str, &str)| format!("{}: {says}", file.display());
        wrong.extend(errors.into_iter().filter(|(says, fields)| says_its_source(says, fields)).map(named));
        // A line of the log has the causes too.
        let logs = ["error", "warn", "info", "debug"].map(|level| format!("tracing::{level}!("));
        for (at, mark) in logs.iter().flat_map(|log| source.match_indices(log.as_str())) {
            let (line, _) = bracketed(&source[at + mark.len()..]);
            if line.contains("{error}") || line.contains("{source}") {
                wrong.push(format!("{}: without `with_causes`: {line}", file.display()));
            }
        }
    }
    assert!(count > 150, "only {count} errors were found");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// What is shown of an error, and that each of its causes is in it once.
fn shown(error: &(dyn Error + 'static)) -> String {
    let line = with_causes(error);
    let mut cause = error.source();
    while let Some(error) = cause {
        let says = error.to_string();
        assert_eq!(line.matches(&says).count(), 1, "{says:?} in {line:?}");
        cause = error.source();
    }
    line
}

#[test]
fn chains_say_each_cause_once() {
    let nowhere = Path::new("/no such folder/file");
    let lines = [
        shown(&Case::read(nowhere).unwrap_err()),
        shown(&Case::parse("{}", nowhere).unwrap_err()),
        shown(&BuiltFile::read(nowhere).unwrap_err()),
        shown(&Jacobian::load(nowhere, &Detector::default()).unwrap_err()),
        shown(&tactomo_touch::learned::Learned::read(nowhere).err().unwrap()),
    ];
    for line in lines {
        assert!(line.contains("No such file") || line.contains("missing field `name`"), "{line}");
        assert!(line.contains("/no such folder/file"), "{line}");
    }
}

#[test]
fn the_programs_say_each_cause_once() {
    let nowhere = "/no such folder/file";
    for (program, args) in [
        (LAB, vec!["validate", nowhere]),
        (LAB, vec!["study", "built", "--solver", Method::Contacts.name(), nowhere]),
        (TACTOMO, vec!["live", "--simulate", "--seconds", "1", "--json", "--no-open", "--stream", nowhere]),
        (TACTOMO, vec!["live", "--simulate", "--seconds", "1", "--json", "--no-open", "--mcap", nowhere]),
    ] {
        let said = program.refused(&args);
        let line = said.lines().find(|line| line.starts_with("error: ")).unwrap();
        let causes = ["No such file", "there is no folder"].map(|cause| line.matches(cause).count());
        assert_eq!(causes.iter().sum::<usize>(), 1, "{line}");
        assert_eq!(line.matches(nowhere).count(), 1, "{line}");
    }
}
