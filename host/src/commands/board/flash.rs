//! `tactomo board flash`: puts the firmware on a board.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, bail, ensure};

use super::elf;
use super::firmware::{self, Board, Tool};
use tactomo_cli::output::message;

/// Puts the firmware on a board, with the tool for its chip: espflash or probe-rs.
///
/// Looks first whether the image is one for this board. Says what to install or to build if something is missing, and shows the command that it
/// runs.
///
/// Examples:
///   tactomo board flash esp32 --port /dev/ttyUSB0
///   tactomo board flash esp32c3 --image tactomo-esp32c3
///   tactomo board flash stm32f405                   through a debug probe
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Which board
    #[arg(value_name = "BOARD")]
    board: Board,
    /// Serial port of the board [default: the one that the tool finds]
    #[arg(long, value_name = "PORT")]
    port: Option<String>,
    /// Image to flash: an ELF file [default: the one that was built in this repository]
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
}

/// Flashes.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let Tool { program, install, advice } = args.board.tool();
    ensure!(
        args.port.is_none() || args.board.is_flashed_by_port(),
        "{} is flashed by {program} through its debug pins, not through a serial port: leave out --port",
        args.board.name()
    );
    let image = image(args.board, args.image.as_deref())?;
    elf::check(&image, args.board)?;
    let found = on_path(program)
        .with_context(|| format!("{program} is not installed, and it is what flashes this board: {install}"))?;
    let arguments = args.board.arguments(&image, args.port.as_deref());
    message!("{program} {}", arguments.join(" "));
    let status = Command::new(&found).args(&arguments).status();
    let status = status.with_context(|| format!("{} cannot be started", found.display()))?;
    if !status.success() {
        bail!("{program} failed ({status}): what it says is above. {advice}");
    }
    message!(
        "flashed. Now `tactomo board check{}`",
        args.port.iter().map(|port| format!(" --port {port}")).collect::<String>()
    );
    Ok(())
}

/// The image that is named, or the one that was built.
fn image(board: Board, named: Option<&Path>) -> anyhow::Result<PathBuf> {
    if let Some(named) = named {
        ensure!(named.is_file(), "there is no image {}", named.display());
        return Ok(named.to_owned());
    }
    let here = env::current_dir().context("the working folder is gone")?;
    let workspace = firmware::workspace(&here).with_context(|| {
        format!("{} is not in this program's repository, so the image has to be named: --image FILE", here.display())
    })?;
    let image = workspace.join(board.image());
    ensure!(
        image.is_file(),
        "the firmware is not built yet: there is no {}. Build it with {}, or name another image with --image",
        image.display(),
        board.build()
    );
    Ok(image)
}

/// A program on the search path.
fn on_path(program: &str) -> Option<PathBuf> {
    let name = format!("{program}{}", env::consts::EXE_SUFFIX);
    env::split_paths(&env::var_os("PATH")?).map(|folder| folder.join(&name)).find(|file| file.is_file())
}
