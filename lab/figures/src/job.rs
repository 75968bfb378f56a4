//! Runs of the programs that figures are taken from.

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
    /// Program and arguments, as a shell takes them in the repository's root. `--json` is added.
    pub line: &'static str,
    /// Whether its figures depend on the machine: times, rates, and what live answers make of them.
    pub is_of_machine: bool,
    /// Whether `--check` takes it again without `--all`.
    pub is_quick: bool,
}

const fn job(name: &'static str, line: &'static str) -> Job {
    Job { name, line, is_of_machine: false, is_quick: true }
}

const fn slow(name: &'static str, line: &'static str) -> Job {
    Job { is_quick: false, ..job(name, line) }
}

const fn of_machine(name: &'static str, line: &'static str) -> Job {
    Job { is_of_machine: true, is_quick: false, ..job(name, line) }
}

/// All runs. Seeds are in their arguments, or the command's own default.
pub const JOBS: &[Job] = &[
    job(
        "validate-slab",
        "tactomo-lab validate tests/reference/slab/*.json.gz --model slab --solver tikhonov --solver tikhonov-paper --trials 1",
    ),
    job(
        "validate-shell",
        "tactomo-lab validate tests/reference/slab/*.json.gz --model shell --solver tikhonov --solver tikhonov-paper --trials 1",
    ),
    job(
        "validate-noise",
        "tactomo-lab validate tests/reference/slab/*.json.gz --solver auto --noise-lsb 1.5 --trials 20 --seed 1",
    ),
    job(
        "built",
        "tactomo-lab study built tests/reference/built/built101.json.gz --solver auto --solver network --solver tikhonov --seed 1",
    ),
    job("drawn", "tactomo-lab study built --detectors 4 --presses 8 --seed 1001 --solver auto"),
    job(
        "built-rubbed",
        "tactomo-lab study built tests/reference/built/built101.json.gz --rub 24 --solver auto --seed 1",
    ),
    slow("drawn-rubbed", "tactomo-lab study built --detectors 4 --presses 8 --seed 1001 --rub 60 --solver auto"),
    job("contacts", "tactomo-lab bank --scenes random --solver auto --count 180 --seed 21"),
    slow(
        "contacts-built",
        "tactomo-lab bank --scenes random --solver auto --count 60 --seed 40 --detector square-60 --as-built 20",
    ),
    slow(
        "contacts-built-5",
        "tactomo-lab bank --scenes random --solver auto --count 60 --seed 40 --detector square-60 --as-built 20 --rub 5",
    ),
    slow(
        "contacts-built-20",
        "tactomo-lab bank --scenes random --solver auto --count 60 --seed 40 --detector square-60 --as-built 20 --rub 20",
    ),
    job("contacts-core", "tactomo-lab bank --scenes random --solver core --detector square-60 --count 120 --seed 55"),
    job(
        "contacts-core-auto",
        "tactomo-lab bank --scenes random --solver auto --detector square-60 --count 120 --seed 55",
    ),
    job("materials", "tactomo-lab study materials --seed 1"),
    job("explain", "tactomo-lab study explain --seed 1"),
    job("samples", "tactomo-lab study samples --seed 1"),
    job("bonding", "tactomo-lab study bonding"),
    job("electrodes", "tactomo-lab study electrodes --seed 1"),
    job("picard", "tactomo-lab study picard --seed 1"),
    job("surface", "tactomo-lab study surface --seed 1"),
    slow("thickness", "tactomo-lab study thickness"),
    slow("scan", "tactomo-lab tradeoff --scan --places 6 --seed 21"),
    of_machine("tradeoff", "tactomo-lab tradeoff --quick --places 10 --seed 1"),
    of_machine("live-ideal", "tactomo live --simulate --board ideal --scene single --seconds 5 --no-open"),
    of_machine("live-esp32", "tactomo live --simulate --board esp32 --scene single --seconds 5 --no-open"),
    of_machine("live-esp32-firm", "tactomo live --simulate --board esp32 --scene five-fingers --seconds 5 --no-open"),
    of_machine("live-esp32c3", "tactomo live --simulate --board esp32c3 --scene single --seconds 5 --no-open"),
    of_machine(
        "live-adaptive",
        "tactomo live --simulate --board esp32 --scan adaptive --scene moving --seconds 5 --no-open",
    ),
];

impl Job {
    /// What a person types to repeat it.
    pub fn command(&self) -> String {
        format!("{} --json", self.line)
    }

    /// Runs it, with further arguments that its report does not depend on, and gives its report. `seconds` is added to the report: the time
    /// that it took.
    ///
    /// # Errors
    /// If it fails, or prints no JSON.
    pub fn run(&self, tools: &Tools, further: &str) -> Result<Value> {
        eprintln!("{}: {} {further}", self.name, self.line);
        let begun = Instant::now();
        let (program, args) = self.line.split_once(' ').unwrap_or((self.line, ""));
        let line = format!("'{}' {args} {further} --json", tools.programs.join(program).display());
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
    /// The folder of the programs, built for speed.
    pub programs: PathBuf,
}

impl Tools {
    /// Finds the repository, and builds the programs as they are there now, beside this one.
    ///
    /// # Errors
    /// If it cannot be built.
    pub fn build() -> Result<Self> {
        let root = root()?;
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let mut args = vec!["build", "--release", "--locked", "--message-format", "json-render-diagnostics"];
        args.extend(["--package", "tactomo", "--package", "tactomo-lab"]);
        let built = Command::new(cargo).args(args).current_dir(&root).stderr(Stdio::inherit()).output()?;
        ensure!(built.status.success(), "the programs cannot be built");
        let messages = String::from_utf8(built.stdout).context("cargo's messages")?;
        let program = messages.lines().filter_map(executable).next_back().context("cargo names no program")?;
        let programs = program.parent().map(Path::to_owned).context("the program is in no folder")?;
        Ok(Self { root, programs })
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
