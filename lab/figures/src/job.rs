//! Runs of the program that figures are taken from.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

/// A run whose report has figures.
#[derive(Clone, Copy, Debug)]
pub struct Job {
    /// Its name.
    pub name: &'static str,
    /// Arguments of `tactomo`, as a shell takes them in the repository's root. `--json` is added.
    pub args: &'static str,
    /// Whether its figures depend on the machine: times, rates, and what live answers make of them.
    pub is_of_machine: bool,
    /// Whether `--check` takes it again without `--all`.
    pub is_quick: bool,
}

const fn job(name: &'static str, args: &'static str) -> Job {
    Job { name, args, is_of_machine: false, is_quick: true }
}

const fn slow(name: &'static str, args: &'static str) -> Job {
    Job { is_quick: false, ..job(name, args) }
}

const fn of_machine(name: &'static str, args: &'static str) -> Job {
    Job { is_of_machine: true, is_quick: false, ..job(name, args) }
}

/// All runs. Seeds are in their arguments, or the command's own default.
pub const JOBS: &[Job] = &[
    job(
        "validate-slab",
        "validate tests/reference/slab/*.json.gz --model slab --solver tikhonov --solver tikhonov-paper --trials 1",
    ),
    job(
        "validate-shell",
        "validate tests/reference/slab/*.json.gz --model shell --solver tikhonov --solver tikhonov-paper --trials 1",
    ),
    job("validate-noise", "validate tests/reference/slab/*.json.gz --solver auto --noise-lsb 1.5 --trials 20 --seed 1"),
    job(
        "built",
        "study built tests/reference/built/built101.json.gz --solver auto --solver network --solver tikhonov --seed 1",
    ),
    job("drawn", "study built --detectors 4 --presses 8 --seed 1001 --solver auto"),
    job("built-rubbed", "study built tests/reference/built/built101.json.gz --rub 24 --solver auto --seed 1"),
    slow("drawn-rubbed", "study built --detectors 4 --presses 8 --seed 1001 --rub 60 --solver auto"),
    job("contacts", "study contacts --solver auto --scenes 180 --seed 21"),
    job("materials", "study materials --seed 1"),
    job("samples", "study samples --seed 1"),
    job("bonding", "study bonding"),
    job("electrodes", "study electrodes --seed 1"),
    slow("thickness", "study thickness"),
    slow("scan", "tradeoff --scan --places 6 --seed 21"),
    of_machine("tradeoff", "tradeoff --quick --seed 1"),
    of_machine("live-ideal", "live --simulate --board ideal --scene single --seconds 5 --no-open"),
    of_machine("live-esp32", "live --simulate --board esp32 --scene single --seconds 5 --no-open"),
    of_machine("live-esp32-firm", "live --simulate --board esp32 --scene five-fingers --seconds 5 --no-open"),
    of_machine("live-esp32c3", "live --simulate --board esp32c3 --scene single --seconds 5 --no-open"),
    of_machine("live-adaptive", "live --simulate --board esp32 --scan adaptive --scene single --seconds 5 --no-open"),
];

impl Job {
    /// What a person types to repeat it.
    pub fn command(&self) -> String {
        format!("tactomo {} --json", self.args)
    }

    /// Runs it, with further arguments that its report does not depend on, and gives its report. `seconds` is added to the report: the time
    /// that it took.
    ///
    /// # Errors
    /// If it fails, or prints no JSON.
    pub fn run(&self, tools: &Tools, further: &str) -> Result<Value> {
        eprintln!("{}: tactomo {} {further}", self.name, self.args);
        let begun = Instant::now();
        let line = format!("'{}' {} {further} --json", tools.program.display(), self.args);
        let run = Command::new("sh").args(["-c", &line]).current_dir(&tools.root).stderr(Stdio::inherit()).output()?;
        ensure!(run.status.success(), "`{}` has failed", self.command());
        let report = serde_json::from_slice(&run.stdout).with_context(|| format!("the report of {}", self.name))?;
        let seconds = begun.elapsed().as_secs_f64();
        Ok(match report {
            Value::Object(mut fields) => {
                fields.entry("seconds").or_insert(seconds.into());
                Value::Object(fields)
            }
            other => other,
        })
    }
}

/// Where the repository and its program are.
#[derive(Clone, Debug)]
pub struct Tools {
    /// The repository's root.
    pub root: PathBuf,
    /// The program, built for speed.
    pub program: PathBuf,
}

impl Tools {
    /// Finds the repository, and builds the program as it is there now, beside this one.
    ///
    /// # Errors
    /// If it cannot be built.
    pub fn build() -> Result<Self> {
        let root = root()?;
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let args =
            ["build", "--release", "--locked", "--package", "tactomo", "--message-format", "json-render-diagnostics"];
        let built = Command::new(cargo).args(args).current_dir(&root).stderr(Stdio::inherit()).output()?;
        ensure!(built.status.success(), "the program cannot be built");
        let messages = String::from_utf8(built.stdout).context("cargo's messages")?;
        let program = messages.lines().filter_map(executable).next_back().context("cargo names no program")?;
        Ok(Self { root, program })
    }
}

/// The repository's root.
///
/// # Errors
/// If this program's own folder was moved since it was built.
pub fn root() -> Result<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.join("../..").canonicalize().with_context(|| format!("{} has gone", own.display()))
}

fn executable(message: &str) -> Option<PathBuf> {
    let message: Value = serde_json::from_str(message).ok()?;
    let is_program = message["target"]["name"] == "tactomo" && message["target"]["kind"][0] == "bin";
    is_program.then(|| message["executable"].as_str().map(PathBuf::from)).flatten()
}
