//! The emulated board: built, started, reached through its pseudo-terminal.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use anyhow::{Context, Result, ensure};

const QEMU: &str = "qemu-system-riscv32";
const TARGET: &str = "riscv32imc-unknown-none-elf";
/// Set where a missing tool must not pass for a success.
const SKIP_NOTHING: &str = "TACTOMO_SKIP_NOTHING";

/// What the board is asked to do at its start, as in `firmware/boards/virt/src/machine.rs`.
#[derive(Clone, Copy)]
pub enum Request {
    Run = 0,
    Panic = 1,
    ExitOnStop = 2,
    Measure = 3,
    MeasureContacts = 4,
    Press = 5,
}

/// Whether the tools are there; says what to install if they are not.
///
/// # Errors
/// If they are missing and nothing may be skipped.
pub fn available() -> Result<bool> {
    let missing = [
        (runs(QEMU, &["--version"]), "apt-get install qemu-system-misc"),
        (has_target(), "rustup target add riscv32imc-unknown-none-elf"),
    ];
    let advice: Vec<&str> = missing.iter().filter(|(there, _)| !there).map(|(_, advice)| *advice).collect();
    if advice.is_empty() {
        return Ok(true);
    }
    let advice = advice.join(" && ");
    ensure!(std::env::var_os(SKIP_NOTHING).is_none(), "the emulated board needs: {advice}");
    // Past the test harness, which keeps the output of tests that pass to itself.
    writeln!(std::io::stderr(), "skipped: the emulated board needs: {advice}")?;
    Ok(false)
}

fn runs(program: &str, arguments: &[&str]) -> bool {
    let status = Command::new(program).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

fn has_target() -> bool {
    let output = Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]).output();
    output.is_ok_and(|output| Path::new(String::from_utf8_lossy(&output.stdout).trim()).is_dir())
}

/// Builds the firmware, with a feature or without; returns its ELF file.
///
/// # Errors
/// If it does not build.
pub fn build(feature: Option<&str>) -> Result<PathBuf> {
    let boards = Path::new(env!("CARGO_MANIFEST_DIR")).join("../firmware/boards");
    let built = Command::new(env!("CARGO"))
        .args(["build", "--release"])
        .args(feature.iter().flat_map(|feature| ["--features", *feature]))
        .current_dir(boards.join("virt"))
        // That workspace has a target folder of its own.
        .env_remove("CARGO_TARGET_DIR")
        .status()
        .context("cargo does not start")?;
    ensure!(built.success(), "the firmware in {} does not build", boards.display());
    // The next build may be one with another feature.
    let kept = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("tactomo-virt-{}", feature.unwrap_or("plain")));
    let elf = boards.join("target").join(TARGET).join("release/tactomo-virt");
    std::fs::copy(&elf, &kept).with_context(|| format!("cannot copy {}", elf.display()))?;
    Ok(kept)
}

/// The machine with the firmware in it. An instruction takes a nanosecond of its time, so that counts are the same in every
/// run.
fn machine(elf: &Path, request: Request) -> Command {
    let mut command = Command::new(QEMU);
    command
        .args(["-machine", "virt", "-m", "8M", "-bios", "none", "-display", "none", "-monitor", "none"])
        .args(["-icount", "shift=0,sleep=off"])
        .args(["-device", &format!("loader,addr=0x80120000,data-len=4,data={}", request as u32)])
        .arg("-kernel")
        .arg(elf);
    command
}

/// A running QEMU; ends when dropped.
pub struct Qemu {
    child: Child,
    pty: String,
}

impl Qemu {
    /// Starts the board.
    ///
    /// # Errors
    /// If QEMU does not start or names no pseudo-terminal.
    pub fn start(elf: &Path, request: Request) -> Result<Self> {
        let mut child = machine(elf, request)
            .args(["-serial", "pty"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .context("QEMU does not start")?;
        let mut line = String::new();
        let stdout = child.stdout.take().context("QEMU has no output")?;
        let mut board = Self { child, pty: String::new() };
        BufReader::new(stdout).read_line(&mut line)?;
        let pty = line.split_whitespace().find(|word| word.starts_with("/dev/"));
        board.pty = pty.with_context(|| format!("no pseudo-terminal in QEMU's words: {line}"))?.to_owned();
        Ok(board)
    }

    /// Path of the pseudo-terminal that the board's UART is at.
    pub fn pty(&self) -> &str {
        &self.pty
    }

    /// Waits until the board leaves by itself; returns QEMU's exit code.
    ///
    /// # Errors
    /// If QEMU was ended by a signal.
    pub fn exit_code(mut self) -> Result<i32> {
        self.child.wait()?.code().context("QEMU was ended by a signal")
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        // It may have left already; there is nothing to do about either failure.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Lets the board measure what a frame costs; returns its report.
///
/// # Errors
/// If QEMU does not start or the board fails.
pub fn measure(elf: &Path) -> Result<String> {
    report(&mut machine(elf, Request::Measure))
}

/// Lets it do something with contacts, by the table in one file, in the readings in another; returns its report.
///
/// # Errors
/// If QEMU does not start or the board fails.
pub fn press(elf: &Path, request: Request, table: &Path, readings: &Path) -> Result<String> {
    let mut machine = machine(elf, request);
    for (file, place) in [(table, "0x80200000"), (readings, "0x80220000")] {
        machine.arg("-device").arg(format!("loader,file={},addr={place},force-raw=on", file.display()));
    }
    report(&mut machine)
}

fn report(machine: &mut Command) -> Result<String> {
    let output = machine.args(["-serial", "stdio"]).output().context("QEMU does not start")?;
    ensure!(output.status.success(), "QEMU failed: {}", String::from_utf8_lossy(&output.stderr));
    Ok(String::from_utf8(output.stdout)?)
}
