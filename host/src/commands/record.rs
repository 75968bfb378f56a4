//! `tactomo record`: keeps what a board sends, without a picture.

use std::path::{Path, PathBuf};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use tactomo::run::Snapshot;
use tactomo::run::plan::{Ends, Plan};
use tokio::sync::watch;

use super::choice::DetectorArgs;
use super::output::message;
use super::source::{self, BoardArgs};
use super::{interrupt, live, recording};

/// Keeps the bytes of a board in a new file, with the detector that they came from.
///
/// Examples:
///   tactomo record touch.tactomo --seconds 30
///   tactomo record touch.tactomo --port /dev/ttyUSB0 --detector my.toml --average 4
///   tactomo record touch.tactomo --simulate --scene five-fingers --seconds 10
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// The new file
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    board: BoardArgs,
    #[command(flatten)]
    detector: DetectorArgs,
    /// Ends this many seconds after the board said Hello; otherwise with Ctrl-C
    #[arg(long, value_parser = source::seconds)]
    seconds: Option<Duration>,
}

/// Records until the end.
pub fn run(args: &Args) -> anyhow::Result<()> {
    record(&args.file, &args.board, &args.detector, args.seconds)
}

/// Records a board in a new file, for so long or until Ctrl-C.
pub fn record(
    file: &Path,
    board: &BoardArgs,
    detector_args: &DetectorArgs,
    seconds: Option<Duration>,
) -> anyhow::Result<()> {
    let detector = source::described(board, detector_args.get_or(board.scene.preset())?);
    let (mut source, _) = source::board(board, detector_args, &detector)?;
    let plan = Plan {
        settings: board.settings.requested(),
        recorder: recording::begin(Some(file), &detector, source.name())?,
        seconds,
        ..Plan::new(detector)
    };
    let (snapshots, _) = watch::channel(Arc::new(Snapshot::default()));
    let (_, requests) = mpsc::sync_channel(1);
    let ends = Ends { snapshots, requests, stop: interrupt::flag()? };
    let summary = tactomo::run::run(&mut *source, plan, ends)?;
    message!("{}; kept in {}", live::sentence(&summary), file.display());
    Ok(())
}
