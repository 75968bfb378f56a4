//! `tactomo replay`: the live picture of a recording.

use std::path::PathBuf;

use tactomo::board::session::RequestedSettings;
use tactomo::run::scanning::ScanChoice;
use tactomo::run::table::BoardTable;
use tactomo_protocol::Output;

use super::live::{self, PictureArgs, Show};
use super::source;
use super::streams::StreamArgs;

/// Plays a recording, on the detector that it was taken from: the same as `live --replay`.
///
/// Examples:
///   tactomo replay touch.tactomo
///   tactomo replay touch.tactomo --speed 0.25
///   tactomo replay touch.tactomo --speed max --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// The recording
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// How many times faster it is played; `max` for as fast as it can be read
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = source::speed)]
    speed: f64,
    #[command(flatten)]
    picture: PictureArgs,
    #[command(flatten)]
    streams: StreamArgs,
    /// ELF file of the board's firmware, to print its log
    #[arg(long, value_name = "FILE")]
    elf: Option<PathBuf>,
}

/// Plays it.
pub fn run(args: Args) -> anyhow::Result<()> {
    live::show(Show {
        detector: source::recorded_detector(&args.picture.detector, &args.file)?,
        source: source::recording(args.file, args.speed, !args.picture.json),
        place: None,
        finger: None,
        picture: args.picture,
        scan: ScanChoice::Whole,
        table: BoardTable::default(),
        output: Output::default(),
        learning: None,
        settings: RequestedSettings::default(),
        seconds: None,
        record: None,
        streams: args.streams,
        elf: args.elf,
    })
}
