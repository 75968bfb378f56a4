//! Whatever a body's file has in it, reading ends: with patches, or with an error that names the file.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::{fs, process};

use clap::CommandFactory;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};

use super::*;

/// A body with each kind of value, and one that is in use.
const BODIES: [&str; 2] = [
    "# Five\n[[patch]]\nname = \"thumb\"\nsimulate = true\nforce = 0.5\nfault = [\"open:3\", \"short:4,5\"]\n\n\
     [[patch]]\nname = 'palm'\nport = \"/dev/ttyUSB1\"\nmax_fps = 100\ndetector = \"palm.toml\"\nno_learning = false\n",
    include_str!("../../../../examples/bodies/hand.toml"),
];

/// Change of a text, at places that are shares of its length.
#[derive(Clone, Debug)]
enum Edit {
    /// These bytes come here.
    Insert(Index, Vec<u8>),
    /// The bytes between go.
    Remove(Index, Index),
    /// They come once more.
    Repeat(Index, Index),
    /// A bit is another.
    Flip(Index, u8),
}

impl Edit {
    fn apply(self, bytes: &mut Vec<u8>) {
        let places = bytes.len() + 1;
        let at = |index: Index| index.index(places);
        let between = |one: Index, other: Index| at(one).min(at(other))..at(one).max(at(other));
        match self {
            Self::Insert(here, new) => drop(bytes.splice(at(here)..at(here), new)),
            Self::Remove(from, to) => drop(bytes.drain(between(from, to))),
            Self::Repeat(from, to) => bytes.extend_from_within(between(from, to)),
            Self::Flip(here, bit) => {
                let at = at(here);
                bytes.get_mut(at).into_iter().for_each(|byte| *byte ^= 1 << bit);
            }
        }
    }
}

fn edit() -> impl Strategy<Value = Edit> {
    let place = any::<Index>;
    prop_oneof![
        (place(), vec(any::<u8>(), 0..8)).prop_map(|(here, new)| Edit::Insert(here, new)),
        (place(), select(b"[]{}\"'\\=#\n\0.,-".to_vec())).prop_map(|(here, one)| Edit::Insert(here, vec![one])),
        (place(), place()).prop_map(|(from, to)| Edit::Remove(from, to)),
        (place(), place()).prop_map(|(from, to)| Edit::Repeat(from, to)),
        (place(), 0..8_u8).prop_map(|(here, bit)| Edit::Flip(here, bit)),
    ]
}

/// An option that there is or is not, as a key.
fn key() -> impl Strategy<Value = String> {
    let options = Options::command();
    let known: Vec<_> = options.get_arguments().filter_map(clap::Arg::get_long).map(str::to_owned).collect();
    prop_oneof![9 => select(known), 1 => ".{0,12}"]
}

/// A text in TOML, whose basic strings are JSON's.
fn quoted(text: impl Into<serde_json::Value>) -> String {
    text.into().to_string()
}

/// A value, as TOML has it after `=`.
fn value() -> impl Strategy<Value = String> {
    let text = "[ -~]{0,12}|.{0,6}|tcp:[0-9]{0,6}|open:[0-9]{1,3}|-|all|max|auto";
    let one = prop_oneof![
        any::<bool>().prop_map(|flag| flag.to_string()),
        any::<i64>().prop_map(|number| number.to_string()),
        any::<f64>().prop_map(|number| format!("{number:?}")),
        text.prop_map(quoted),
    ];
    one.prop_recursive(2, 8, 4, |inner| {
        prop_oneof![
            vec(inner.clone(), 0..4).prop_map(|all| format!("[{}]", all.join(","))),
            (".{0,4}", inner).prop_map(|(key, value)| format!("{{ {} = {value} }}", quoted(key))),
        ]
    })
}

/// A table `[[patch]]`.
fn patch() -> impl Strategy<Value = String> {
    let name = prop_oneof![9 => "[a-z]{1,2}|.{0,6}".prop_map(quoted), 1 => value()];
    (name, vec((key(), value()), 0..4)).prop_map(|(name, options)| {
        let lines = options.into_iter().map(|(key, value)| format!("{} = {value}\n", quoted(key)));
        format!("[[patch]]\nname = {name}\n{}", lines.collect::<String>())
    })
}

/// Checks what becomes of a file of these bytes; `test` has it for itself.
fn check(test: &str, bytes: &[u8]) -> Result<(), TestCaseError> {
    let path = std::env::temp_dir().join(format!("tactomo-{}-{test}-body.toml", process::id()));
    fs::write(&path, bytes).map_err(|error| TestCaseError::fail(error.to_string()))?;
    match read(&path) {
        Ok(patches) => {
            let names: BTreeSet<_> = patches.iter().map(|patch| patch.name.as_str()).collect();
            prop_assert!(!names.is_empty() && names.len() == patches.len(), "{:?}", names);
            let are_names = names.iter().flat_map(|name| name.chars()).all(|c| c.is_ascii() && c != '/');
            prop_assert!(are_names && !names.contains(""), "{:?}", names);
        }
        Err(error) => prop_assert!(error.to_string().contains("-body.toml"), "{error}"),
    }
    Ok(())
}

proptest! {
    #[test]
    fn any_bytes_are_patches_or_an_error(bytes in vec(any::<u8>(), 0..300)) {
        check("bytes", &bytes)?;
    }

    #[test]
    fn a_body_that_is_damaged_is_patches_or_an_error(body in select(BODIES.to_vec()), edits in vec(edit(), 1..6)) {
        let mut bytes = body.as_bytes().to_vec();
        edits.into_iter().for_each(|edit| edit.apply(&mut bytes));
        check("damaged", &bytes)?;
    }

    #[test]
    fn patches_of_any_options_are_patches_or_an_error(patches in vec(patch(), 0..4)) {
        check("options", patches.concat().as_bytes())?;
    }
}

#[test]
fn whole_bodies_are_patches_and_deep_ones_end() {
    for body in BODIES {
        assert!(of_text(body, &PathBuf::from("body.toml"), words).is_ok());
    }
    for deep in ["[", "patch = [", "[[patch]]\nname = \"a\"\nport = [", "a.", "{a="] {
        let (first, rest) = deep.split_at(deep.len() - 1);
        assert!(
            of_text(&format!("{first}{}", rest.repeat(100_000)), &PathBuf::from("body.toml"), words).is_err(),
            "{deep}"
        );
    }
}
