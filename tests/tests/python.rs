//! The Python package: its wheel is built, installed into a virtual environment, compared with its types, and tested by pytest.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

/// Set where a missing tool must not pass for a success.
const SKIP_NOTHING: &str = "TACTOMO_SKIP_NOTHING";
/// What builds and tests the package, and what it has views for.
const TOOLS: [&str; 6] = ["maturin>=1.9,<2", "mypy>=1.15", "numpy>=1.23", "pandas>=2", "pytest>=7", "xarray>=2024"];
/// Whether this Python can make virtual environments, and is one that the wheel is for.
const CHECK: &str = "import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 10))";

/// The profile that the tests are built in.
const PROFILE: &str = if cfg!(debug_assertions) { "dev" } else { "release" };

/// Letters of what a command says that are told when it fails: the end, where compilers and pytest say why.
const TOLD: usize = 4000;

/// Runs to its end; the end of what it says is in the error if it fails.
fn run(command: &mut Command) -> Result<()> {
    let output = command.output().with_context(|| format!("{command:?} does not start"))?;
    let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    let end: String = said.chars().skip(said.chars().count().saturating_sub(TOLD)).collect();
    ensure!(output.status.success(), "{command:?} failed ({}):\n{end}", output.status);
    Ok(())
}

/// A virtual environment with the tools; `None` if there cannot be one here and that is allowed.
fn environment() -> Result<Option<PathBuf>> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python");
    let python = folder.join("bin/python");
    let made = run(Command::new("python3").args(["-c", CHECK]))
        .and_then(|()| run(Command::new("python3").args(["-m", "venv"]).arg(&folder)))
        .and_then(|()| run(Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(TOOLS)));
    let Err(error) = made else { return Ok(Some(python)) };
    let why = "the Python package needs Python 3.10 with venv (Debian: python3-venv), and PyPI for the first time";
    ensure!(std::env::var_os(SKIP_NOTHING).is_none(), "{why}: {error:#}");
    // Past the test harness, which keeps the output of tests that pass to itself.
    writeln!(std::io::stderr(), "skipped: {why}")?;
    Ok(None)
}

/// Builds the wheel into an empty folder, in the workspace's own target folder and profile: what is built there already is not built again.
fn wheel(python: &Path, package: &Path) -> Result<PathBuf> {
    let temporary = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let target = temporary.parent().context("the target folder")?;
    let out = temporary.join("wheels");
    if out.exists() {
        std::fs::remove_dir_all(&out)?;
    }
    run(Command::new(python)
        .args(["-m", "maturin", "build", "--locked", "--profile", PROFILE, "--auditwheel", "skip", "--interpreter"])
        .args([python, Path::new("--target-dir"), target, Path::new("--out"), &out])
        .current_dir(package))?;
    let wheel = std::fs::read_dir(&out)?.next().context("maturin made no wheel")??;
    Ok(wheel.path())
}

#[test]
fn the_wheel_installs_and_passes_its_own_tests() -> Result<()> {
    let Some(python) = environment()? else { return Ok(()) };
    let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host/python");
    let wheel = wheel(&python, &package)?;
    let pip = ["-m", "pip", "install", "--quiet", "--no-deps", "--force-reinstall"];
    run(Command::new(&python).args(pip).arg(&wheel))?;
    // Neither in the package's folder, where its sources would be imported in place of what is installed.
    let away = env!("CARGO_TARGET_TMPDIR");
    run(Command::new(&python).args(["-m", "mypy.stubtest", "tactomo"]).current_dir(away))?;
    let pytest = ["-m", "pytest", "-q", "-p", "no:cacheprovider"];
    let tests = ["tests", "adapters"].map(|folder| package.join(folder));
    run(Command::new(&python).args(pytest).args(tests).current_dir(away))
}
