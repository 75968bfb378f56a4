//! A body, such as a hand: several detectors, each with its board, shown together.
//!
//! A body's file has a table `[[patch]]` for each detector: its `name`, its `place` on the body if it has one, and whatever options of `tactomo live`
//! belong to one board, by their names. So what a patch may be asked for is what the command may be, and is checked by the same rules.
//!
//! A folder of recordings has such a file too, which comes from who knows where. It only says which of the folder's recordings are shown, and where their
//! detectors lie: nothing in it has a file written, a port opened, or a file read that is not the folder's own.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use clap::{CommandFactory, Parser};
use tactomo::causes::with_causes;
use tactomo::sink::place::Place;
use tactomo::table::file::{self, Format};
use tactomo_cli::options;

use super::Args;
use crate::commands::recording::folder;

/// Most detectors that are shown together, of boards that are simulated too.
pub const MOST: usize = 64;
/// A body's file.
pub const FORMAT: Format = Format::new("a body's file", 1 << 20);

/// Options of the program as a whole, which a patch has none of.
const OF_ALL: [&str; 7] = ["body", "http-port", "listen", "allow-origin", "no-open", "json", "seconds"];
/// Arguments of one board, which patches have in place of the command line; `simulated` are those of scenes.
pub const OF_ONE: [&str; 23] = [
    "port",
    "simulate",
    "baud",
    "settle_us",
    "average",
    "max_fps",
    "select_us",
    "discard",
    "replay",
    "detector",
    "material",
    "solver",
    "learned",
    "jacobian",
    "no_learning",
    "pointer",
    "scan",
    "board_sends",
    "elf",
    "board",
    "time_factor",
    "speed",
    "simulated",
];
/// Options whose values are files that are read, beside the body's unless their paths are absolute.
const FILES: [&str; 5] = ["detector", "learned", "jacobian", "replay", "elf"];

/// Why a body cannot be shown.
#[derive(Debug, thiserror::Error)]
pub enum BodyError {
    /// The file cannot be read.
    #[error("cannot read the body {path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// It is no body's file.
    #[error("{path} is no body's file: {what}")]
    Body {
        /// The file.
        path: PathBuf,
        /// Why, and what to do.
        what: String,
    },
    /// A patch of it is none.
    #[error("patch {patch} of {path}: {what}")]
    Patch {
        /// The file.
        path: PathBuf,
        /// The patch's name.
        patch: String,
        /// Why, and what to do.
        what: String,
    },
}

/// One of several detectors.
pub struct Patch {
    /// What it is called.
    pub name: String,
    /// Where it lies on the body, if that is told.
    pub place: Option<Place>,
    /// What it would be shown by if it were alone.
    pub args: Args,
}

/// A body's file.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    patch: Vec<Table>,
}

/// A patch in it.
#[derive(serde::Deserialize)]
struct Table {
    name: String,
    place: Option<toml::Value>,
    #[serde(flatten)]
    options: toml::Table,
}

/// What is read as a command line of its own.
#[derive(Parser)]
#[command(no_binary_name = true, disable_help_flag = true)]
struct Options {
    #[command(flatten)]
    args: Args,
}

/// The detectors of a body's file, or of a folder of recordings.
///
/// # Errors
/// [`BodyError`] if the file is no body, or a patch asks for what cannot be.
pub fn read(path: &Path) -> Result<Vec<Patch>, BodyError> {
    let (path, is_folder) = if path.is_dir() { (folder::body(path), true) } else { (path.to_owned(), false) };
    let checked = if is_folder { folder::check_own(&path) } else { Ok(()) };
    let text = checked.and_then(|()| FORMAT.read_text(&path));
    let text = text.map_err(|source| BodyError::Read { path: path.clone(), source })?;
    let words: Words = if is_folder { of_recording } else { words };
    of_text(&text, &path, words)
}

/// Makes a command line of a patch's options; files that they name are sought in the folder.
type Words = fn(&toml::Table, &Path) -> Result<Vec<String>, String>;

fn of_text(text: &str, path: &Path, words: Words) -> Result<Vec<Patch>, BodyError> {
    let no_body = |what: String| BodyError::Body { path: path.to_owned(), what };
    let File { patch: patches } = toml::from_str(text).map_err(|error| no_body(with_causes(&error)))?;
    match patches.len() {
        0 => return Err(no_body("it has no [[patch]]".to_owned())),
        1..=MOST => {}
        many => return Err(no_body(format!("it has {many} patches, and {MOST} can be shown together"))),
    }
    let mut read: Vec<Patch> = Vec::with_capacity(patches.len());
    for Table { name, place, options } in patches {
        let wrong = |what| BodyError::Patch { path: path.to_owned(), patch: name.clone(), what };
        let is_name = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.is_empty() || !name.chars().all(is_name) {
            return Err(wrong("a name is of letters, digits, - and _, as it is part of an address".to_owned()));
        }
        if read.iter().any(|other| other.name == name) {
            return Err(wrong("another patch has this name: give each its own".to_owned()));
        }
        let place = place.map(placed).transpose().map_err(wrong)?;
        let words = words(&options, path.parent().unwrap_or(Path::new(""))).map_err(wrong)?;
        let parsed = Options::try_parse_from(words).map_err(|error| wrong(said(&error)))?;
        if parsed.args.streams.use_stdout() {
            return Err(wrong("stdout is of all: give --stream - on the command line".to_owned()));
        }
        read.push(Patch { name, place, args: parsed.args });
    }
    Ok(read)
}

/// A place, as it is written.
fn placed(place: toml::Value) -> Result<Place, String> {
    let form = "write it as { xyz_m = [x, y, z], rpy_rad = [roll, pitch, yaw] }";
    let place: Place = place.try_into().map_err(|error| format!("place: {}; {form}", with_causes(&error).trim()))?;
    place.check().map_err(|error| format!("place: {error}"))?;
    Ok(place)
}

/// The recording of a patch in a folder, as a word of a command line: whatever else it asks for is refused.
fn of_recording(options: &toml::Table, folder: &Path) -> Result<Vec<String>, String> {
    if let Some(key) = options.keys().find(|key| *key != "replay") {
        return Err(format!(
            "{key:?} is not obeyed in a folder of recordings: there a patch has name, replay and place only"
        ));
    }
    let name = options.get("replay").and_then(toml::Value::as_str);
    let name = name.ok_or("it needs replay, the name of a recording in the folder")?;
    if name.is_empty() || name == ".." || name.contains(['/', '\\', ':']) {
        return Err(format!("replay is {name:?}, which is not the name of a recording in the folder"));
    }
    let recording = folder.join(name);
    folder::check_own(&recording).map_err(|error| format!("replay {name:?}: {error}"))?;
    Ok(vec![format!("--replay={}", recording.display())])
}

/// Options as words of a command line.
fn words(options: &toml::Table, folder: &Path) -> Result<Vec<String>, String> {
    let command = Options::command();
    let mut words = Vec::new();
    for (key, value) in options {
        let option = key.replace('_', "-");
        if OF_ALL.contains(&option.as_str()) {
            return Err(format!("{key} is of the program as a whole: give --{option} on the command line"));
        }
        // No key is a word of a command line by itself: it might have a value in it, or another option.
        if !command.get_arguments().any(|known| known.get_long() == Some(&*option)) {
            return Err(format!("{key:?} is no option of `tactomo live`; its --help has them all"));
        }
        let word = |value: &toml::Value| match value {
            toml::Value::String(text) if is_file(&option, text) => {
                let path = folder.join(text);
                match file::check_regular(&path) {
                    Err(error) if error.kind() != ErrorKind::NotFound => Err(format!("{key} {text:?}: {error}")),
                    _ => Ok(path.display().to_string()),
                }
            }
            toml::Value::String(text) => Ok(text.clone()),
            toml::Value::Integer(number) => Ok(number.to_string()),
            toml::Value::Float(number) => Ok(number.to_string()),
            _ => Err(format!("{key} has to be a text, a number, true, or a list of texts")),
        };
        match value {
            toml::Value::Boolean(true) => words.push(format!("--{option}")),
            toml::Value::Boolean(false) => {}
            toml::Value::Array(values) => {
                for value in values {
                    words.push(format!("--{option}={}", word(value)?));
                }
            }
            value => words.push(format!("--{option}={}", word(value)?)),
        }
    }
    Ok(words)
}

/// Whether a text is a file: detectors and what is learned may be presets too, which have no dot.
fn is_file(option: &str, text: &str) -> bool {
    FILES.contains(&option) && (option != "detector" || text.contains('.'))
}

/// What a command line's parser says, in a line.
fn said(error: &clap::Error) -> String {
    let text = options::told(error);
    let lines =
        text.lines().map(str::trim).take_while(|line| !line.starts_with("Usage") && !line.starts_with("For more"));
    let all: Vec<_> = lines.filter(|line| !line.is_empty()).collect();
    all.join("; ").trim_start_matches("error: ").to_owned()
}

#[cfg(test)]
mod fuzz;

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Patch>, String> {
        of_text(text, Path::new("bodies/hand.toml"), words).map_err(|error| error.to_string())
    }

    #[test]
    fn a_patch_has_the_options_of_the_command_by_their_names() {
        let text = "[[patch]]\nname = \"thumb\"\nsimulate = true\nboard = \"ideal\"\nforce = 0.5\nfault = [\"open:3\"]\n\
                    [[patch]]\nname = \"palm\"\nport = \"/dev/ttyUSB1\"\nmax_fps = 100\ndetector = \"palm.toml\"\nno_learning = false\n";
        let patches = read(text).unwrap();
        let [Patch { name: thumb, args: of_thumb, .. }, Patch { name: palm, args: of_palm, .. }] = &patches[..] else {
            panic!("two patches")
        };
        assert_eq!([thumb, palm], ["thumb", "palm"]);
        assert!(of_thumb.board.is_simulated() && of_thumb.board.scene.fault.len() == 1 && !of_palm.picture.no_learning);
        assert_eq!(of_palm.board.ports, ["/dev/ttyUSB1"]);
        let chosen = of_palm.picture.detector.detector.as_ref().map(|chosen| format!("{chosen:?}"));
        assert!(chosen.is_some_and(|chosen| chosen.contains("bodies/palm.toml")));
    }

    #[test]
    fn a_patch_may_have_a_place_on_the_body() {
        let text = "[[patch]]\nname = \"thumb\"\nsimulate = true\nplace = { xyz_m = [0.1, 0, -0.02], rpy_rad = [0, 0.5, 0] }\n\
                    [[patch]]\nname = \"index\"\nsimulate = true\n[patch.place]\nxyz_m = [0, 0, 1]\n\
                    [[patch]]\nname = \"palm\"\nsimulate = true\n";
        let places: Vec<_> = read(text).unwrap().into_iter().map(|patch| patch.place).collect();
        let place = |xyz_m, rpy_rad| Some(Place { xyz_m, rpy_rad });
        assert_eq!(places, [place([0.1, 0.0, -0.02], [0.0, 0.5, 0.0]), place([0.0, 0.0, 1.0], [0.0; 3]), None]);
    }

    #[test]
    fn options_of_one_board_are_refused_beside_a_body_and_none_is_ignored() {
        let command = <Options as clap::CommandFactory>::command();
        for option in command.get_arguments().filter_map(clap::Arg::get_long) {
            let of_streams = option.starts_with("stream") || ["foxglove", "mcap", "record"].contains(&option);
            if OF_ALL.contains(&option) || of_streams {
                continue;
            }
            let values = ["", "=1", "=a", "=4", "=rest", "=esp32", "=A", "=auto"];
            let is_taken = |value: &&str| {
                let words = ["--body=hand.toml".to_owned(), format!("--{option}{value}")];
                Options::try_parse_from(words).is_ok()
            };
            assert!(!values.iter().any(is_taken), "--{option} beside --body is ignored");
        }
    }

    #[test]
    fn of_a_folder_only_its_own_recordings_and_their_places_count() {
        let folder = std::env::temp_dir().join(format!("tactomo-{}-body-folder", std::process::id()));
        std::fs::create_dir_all(folder.join("sub")).unwrap();
        std::fs::write(folder.join("thumb.tactomo"), "").unwrap();
        let read = |options: &str| {
            std::fs::write(folder.join(folder::BODY), format!("[[patch]]\nname = \"thumb\"\n{options}\n")).unwrap();
            super::read(&folder).map_err(|error| error.to_string())
        };
        let patches = read("replay = \"thumb.tactomo\"\nplace = { xyz_m = [0, 0, 1] }").unwrap();
        assert_eq!(patches[0].args.replay, Some(folder.join("thumb.tactomo")));
        assert!(patches[0].place.is_some());
        // Every option of the command but the one, and what is none.
        let command = Options::command();
        let keys = command.get_arguments().filter_map(clap::Arg::get_long).filter(|key| *key != "replay");
        for key in keys.chain(["port_", "listen=0.0.0.0:7999"]) {
            for value in ["true", "false", "\"a\"", "1", "[\"a\"]"] {
                let refused = read(&format!("replay = \"thumb.tactomo\"\n{key:?} = {value}")).err().unwrap();
                assert!(refused.contains("patch thumb of ") && refused.contains(&format!("{key:?}")), "{refused}");
            }
        }
        for name in ["../thumb.tactomo", "/dev/zero", "sub", "sub/a", "..", ".", "", "a\\\\b", "none.tactomo", "c:a"] {
            let refused = read(&format!("replay = \"{name}\"")).err().unwrap();
            assert!(refused.contains("patch thumb of ") && refused.contains("replay"), "{name}: {refused}");
        }
        for options in ["", "replay = true", "replay = [\"thumb.tactomo\"]"] {
            assert!(read(options).err().unwrap().contains("it needs replay"), "{options}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("/etc/hostname", folder.join("link.tactomo")).unwrap();
            assert!(read("replay = \"link.tactomo\"").err().unwrap().contains("it is a link"));
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn what_is_wrong_is_named_with_its_patch() {
        let of = |options: &str| read(&format!("[[patch]]\nname = \"thumb\"\n{options}\n")).err().unwrap();
        for (options, what) in [
            (
                "seconds = 3",
                "patch thumb of bodies/hand.toml: seconds is of the program as a whole: give --seconds on the command line",
            ),
            ("sceen = \"ring\"", "\"sceen\" is no option of `tactomo live`"),
            ("\"listen=0.0.0.0:7999\" = true", "\"listen=0.0.0.0:7999\" is no option"),
            ("\"simulate --record\" = \"a\"", "\"simulate --record\" is no option"),
            ("\"\" = true", "\"\" is no option"),
            ("simulate = true\nelf = \"/dev/zero\"", "elf \"/dev/zero\": it is no regular file"),
            ("simulate = true\nforce = \"much\"", "invalid value 'much' for '--force"),
            ("port = 3.5\nsimulate = true", "cannot be used with"),
            ("[[patch]]\nname = \"thumb\"", "another patch has this name"),
            ("[[patch]]\nname = \"a/b\"", "letters, digits"),
            ("fault = [[1]]", "fault has to be a text"),
            ("simulate = true\nstream = \"-\"", "give --stream - on the command line"),
            (
                "place = { xyz_m = [0, 0, 0], rpy_rad = [0, 0, 90] }",
                "patch thumb of bodies/hand.toml: place: 90 in rpy_rad",
            ),
            ("place = { xyz = [0, 0, 0] }", "unknown field `xyz`"),
            ("place = { rpy_rad = [0, 0, 0] }", "missing field `xyz_m`"),
            ("place = [0, 0]", "write it as { xyz_m = [x, y, z], rpy_rad = [roll, pitch, yaw] }"),
        ] {
            assert!(of(options).contains(what), "{options}: {}", of(options));
        }
        let many = "[[patch]]\nname = \"a\"\n".repeat(MOST + 1);
        assert!(read(&many).is_err_and(|error| error.contains("65 patches, and 64")));
        for text in ["", "patch = []", "name = 3", "[[patch]]\nsimulate = true", "\u{0}"] {
            assert!(read(text).is_err_and(|error| error.starts_with("bodies/hand.toml is no body's file: ")), "{text}");
        }
    }
}
