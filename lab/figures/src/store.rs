//! `docs/figures.json`: what was taken, when and where.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::job::Job;

/// Where it is, from the repository's root.
pub const FILE: &str = "docs/figures.json";

/// The file.
#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Store {
    /// The command that writes it.
    pub written_by: String,
    /// Figures by their ids.
    pub figures: BTreeMap<String, Taken>,
    /// The runs that they were taken from, by their names.
    pub runs: BTreeMap<String, Run>,
    /// Pictures by their files.
    pub pictures: BTreeMap<String, Pictured>,
}

/// A figure as it was taken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Taken {
    /// A number, or a word.
    pub value: Value,
    /// Its unit.
    pub unit: String,
    /// How far it may be off when it is taken again (the same unit).
    pub spread: f64,
    /// What it is.
    pub says: String,
    /// Whether it depends on the machine.
    pub depends_on_machine: bool,
    /// The run that it was taken from: one of [`Store::runs`].
    pub run: String,
    /// The command that takes it again.
    pub command: String,
}

/// A run as it was.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// What ran.
    pub command: String,
    /// Where and when.
    #[serde(flatten)]
    pub place: Place,
    /// How long it took (s).
    pub seconds: f64,
}

/// A picture as it was taken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pictured {
    /// What it shows, as the page itself told where it can.
    pub shows: String,
    /// The command that takes it again.
    pub command: String,
    /// Hash of what it depends on: sources, how it is taken, and values that are drawn.
    pub made_of: String,
    /// Hash of the file.
    pub file: String,
    /// Where and when.
    #[serde(flatten)]
    pub place: Place,
}

/// Where and when something was taken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// The commit; `+` behind it if files differed from it.
    pub commit: String,
    /// The day (UTC).
    pub date: String,
    /// Processor, cores, system.
    pub machine: String,
    /// Mean number of processes that ran in the minute before; none where the system does not tell. Times want a quiet machine, below 0.3.
    pub load: Option<f64>,
}

impl Place {
    /// Here and now.
    pub fn now(root: &Path) -> Self {
        let git = |args: &[&str]| output("git", args, root);
        // Pictures and figures themselves are being written.
        let changed = git(&["status", "--porcelain", "--untracked-files=no", "--", ".", ":!docs", ":!README.md"]);
        let is_changed = changed.is_some_and(|changed| !changed.is_empty());
        Self {
            commit: git(&["rev-parse", "--short=12", "HEAD"]).unwrap_or_default() + if is_changed { "+" } else { "" },
            date: output("date", &["-u", "+%Y-%m-%d"], root).unwrap_or_default(),
            machine: machine(),
            load: load(),
        }
    }
}

/// Processor, cores and system. Nothing of the workspace is needed for it, so that this command is compiled in seconds.
fn machine() -> String {
    let processors = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = processors.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let name = name.map_or(std::env::consts::ARCH, |(_, name)| name.trim());
    format!("{name}, {cores} cores, {} {}", std::env::consts::OS, std::env::consts::ARCH)
}

/// What a program prints; none if there is no such program, or it fails.
fn output(program: &str, args: &[&str], folder: &Path) -> Option<String> {
    let output = Command::new(program).args(args).current_dir(folder).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// The load of the last minute.
pub fn load() -> Option<f64> {
    fs::read_to_string("/proc/loadavg").ok()?.split(' ').next()?.parse().ok()
}

impl Store {
    /// Reads it; empty if it is not there yet.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(root: &Path) -> Result<Self> {
        let path = root.join(FILE);
        if !path.exists() {
            return Ok(Self::default());
        }
        let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        serde_json::from_str(&text).with_context(|| path.display().to_string())
    }

    /// Writes it.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&mut self, root: &Path) -> Result<()> {
        self.written_by = crate::COMMAND.to_owned();
        let path = root.join(FILE);
        let text = serde_json::to_string_pretty(self)? + "\n";
        fs::write(&path, text).with_context(|| path.display().to_string())
    }

    /// Keeps a run and what was taken from it.
    pub fn keep(&mut self, job: &Job, place: Place, seconds: f64) {
        let seconds = (seconds * 10.0).round() / 10.0;
        self.runs.insert(job.name.to_owned(), Run { command: job.command(), place, seconds });
    }
}
