//! `tactomo board table`: what a board needs to find contacts by itself.

use std::path::PathBuf;

use serde::Serialize;
use tactomo::detector::Detector;
use tactomo::run::table::{Given, What, give};
use tactomo::solve::CompiledTable;

use crate::commands::source::{self, BoardArgs};
use tactomo_cli::choice::DetectorArgs;
use tactomo_cli::output::{self, ProgressBar, message};

/// Gives a board the table by which it finds contacts by itself, which it keeps: `live --board-sends contacts` does so too.
///
/// Examples:
///   tactomo board table --detector my.toml           as this board measures it
///   tactomo board table --file my.table              compiled before, by `detector compile`
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(flatten)]
    board: BoardArgs,
    #[command(flatten)]
    detector: DetectorArgs,
    /// A table from `detector compile`, instead of compiling the detector as the board measures it
    #[arg(long, value_name = "FILE", conflicts_with_all = ["detector", "material"])]
    file: Option<PathBuf>,
    /// Prints `{source, board, bytes, layout, checksum, sent}` as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Told<'a> {
    source: &'a str,
    board: &'a str,
    bytes: usize,
    layout: u32,
    checksum: u32,
    sent: bool,
}

/// Sends the table.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let detector: Detector = source::described(&args.board, args.detector.get_or(args.board.scene.preset())?);
    let what = match &args.file {
        Some(path) => What::Table(CompiledTable::read(path)?),
        None => What::Detector(Box::new(detector.clone())),
    };
    let (mut source, _) = source::board(&args.board, &detector)?;
    let mut link = source.open()?;
    let name = link.name();
    let mut bar = None;
    let progress = |at: usize, bytes: usize| {
        bar.get_or_insert_with(|| ProgressBar::new("bytes", bytes as u64)).tell(at as u64);
    };
    let Given { hello, bytes, table, is_sent } = give(&mut *link, &what, progress)?;
    bar.into_iter().for_each(ProgressBar::end);
    let bytes = bytes.len();
    let told = Told {
        source: &name,
        board: &hello.board,
        bytes,
        layout: table.layout,
        checksum: table.checksum,
        sent: is_sent,
    };
    if args.json {
        return Ok(output::print(&serde_json::to_string(&told)?)?);
    }
    let did = if is_sent { "was given" } else { "has already" };
    message!("{name}: board {} {did} this table of {bytes} bytes, checksum {:#010x}", told.board, told.checksum);
    Ok(())
}
