//! `tactomo calibrate`: makes a detector on paper the one that was built.

pub mod force;
mod known;
mod presses;
mod rub;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, ensure};
use tactomo::calibrate::pressed::Solved;
use tactomo::detector::Detector;

use super::reconstruct::reader::Reader;
use super::reconstruct::units::UnitArgs;
use super::record;
use super::source::BoardArgs;
use tactomo_cli::choice::DetectorArgs;
use tactomo_cli::options;
use tactomo_cli::output::{NewFile, message};

/// Fits a detector's description to the detector that was built.
///
/// Each way of calibrating writes a new detector file, for every --detector; none replaces a
/// file.
///
/// Examples:
///   tactomo calibrate rub --port /dev/ttyUSB0 --detector my.toml --out my-cal.toml
///   tactomo calibrate presses sheet.tactomo --detector my-cal.toml --places sheet.csv --out my-places.toml
///   tactomo calibrate force scale.csv --detector my.toml --newtons 0.5,1,2,3,5 --out my-newtons.toml
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(subcommand)]
    way: Way,
}

#[derive(Debug, clap::Subcommand)]
enum Way {
    Rub(Box<rub::Args>),
    Presses(Box<presses::Args>),
    Force(Box<force::Args>),
}

/// Calibrates.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.way {
        Way::Rub(args) => rub::run(args),
        Way::Presses(args) => presses::run(args),
        Way::Force(args) => force::run(args),
    }
}

/// Where readings come from: a file, or a board that is recorded first.
#[derive(Debug, clap::Args)]
struct Source {
    /// A recording, or a table of readings with a press a row
    #[arg(value_name = "FILE", conflicts_with_all = ["port", "simulate"])]
    file: Option<PathBuf>,
    #[command(flatten)]
    board: BoardArgs,
    #[command(flatten)]
    detector: DetectorArgs,
    /// How long a board is recorded (s)
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = options::seconds)]
    seconds: Duration,
}

impl Source {
    /// The file that is given, or a new recording of a board beside the result; `what` to do meanwhile.
    fn file(&self, out: &Path, what: &str) -> anyhow::Result<PathBuf> {
        if let Some(file) = &self.file {
            return Ok(file.clone());
        }
        ensure!(
            !self.board.ports.is_empty() || self.board.is_simulated(),
            "give a FILE, or --port PORT for a board, or --simulate: which readings shall the detector be fitted to?"
        );
        let file = out.with_extension("tactomo");
        message!("{what}, for {:.0} s; the recording is kept in {}", self.seconds.as_secs_f64(), file.display());
        record::record(&file, &self.board, &self.detector, Some(self.seconds))?;
        Ok(file)
    }
}

/// How the readings of a file are to be read.
#[derive(Debug, clap::Args)]
pub struct Reading {
    /// Frames at the start whose mean is the baseline, and which are no presses [default: as `reconstruct`]
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(0..=100_000))]
    rest: Option<u32>,
    #[command(flatten)]
    unit: UnitArgs,
}

/// What the solver finds in all frames of a recording.
fn solved(reader: &mut Reader) -> anyhow::Result<Vec<Solved>> {
    let (mut frames, mut excluded) = (Vec::new(), Vec::new());
    while let Some(frame) = reader.next_frame()? {
        let time_s = frame.time_s.with_context(|| format!("{} has no time", reader.place()))?;
        let solution = reader.solve(&frame).with_context(|| reader.place())?;
        frames.push(Solved { time_s, contacts: solution.contacts });
        excluded = solution.flags.excluded;
    }
    if !excluded.is_empty() {
        let electrodes: Vec<_> = excluded.iter().map(usize::to_string).collect();
        message!("warning: electrodes {} were left out, since they contradict the others", electrodes.join(", "));
    }
    Ok(frames)
}

/// Writes a detector, and beside it the surface of a curved one.
pub fn write(detector: &Detector, path: &Path, out: NewFile) -> anyhow::Result<()> {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let (text, surface) = detector.to_files(&stem);
    if let Some((name, obj)) = surface {
        let beside = path.with_file_name(name);
        // The one that an earlier calibration of the same name wrote.
        let is_there = fs::metadata(&beside).is_ok_and(|data| data.is_file() && data.len() == obj.len() as u64)
            && fs::read(&beside).is_ok_and(|there| there == obj.as_bytes());
        if !is_there {
            NewFile::new(&beside)?.write(&obj)?;
            message!("its surface: {}", beside.display());
        }
    }
    Ok(out.write(&text)?)
}
