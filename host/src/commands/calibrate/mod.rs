//! `tactomo calibrate`: makes a detector on paper the one that was built.

mod force;
mod known;
mod presses;
mod rub;

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, ensure};
use tactomo::detector::Detector;

use super::choice::DetectorArgs;
use super::output::{NewFile, message};
use super::record;
use super::source::BoardArgs;

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
    Force(force::Args),
}

/// Calibrates.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.way {
        Way::Rub(args) => rub::run(args),
        Way::Presses(args) => presses::run(args),
        Way::Force(args) => force::run(args),
    }
}

/// The file that is given, or a new recording of a board beside the result; `what` to do meanwhile.
fn given_or_recorded(
    file: Option<&PathBuf>,
    (board, detector): (&BoardArgs, &DetectorArgs),
    seconds: Duration,
    out: &Path,
    what: &str,
) -> anyhow::Result<PathBuf> {
    if let Some(file) = file {
        return Ok(file.clone());
    }
    ensure!(
        board.port.is_some() || board.simulate,
        "give a FILE, or --port PORT for a board, or --simulate: which readings shall the detector be fitted to?"
    );
    let file = out.with_extension("tactomo");
    message!("{what}, for {:.0} s; the recording is kept in {}", seconds.as_secs_f64(), file.display());
    record::record(&file, board, detector, Some(seconds))?;
    Ok(file)
}

/// Writes a detector that can be read back from where it will be: a curved one names the file of its surface.
fn write(detector: &Detector, path: &Path, out: NewFile) -> anyhow::Result<()> {
    let text = detector.to_toml();
    let folder = path.parent().unwrap_or(Path::new(""));
    Detector::from_toml_in(folder, &text, "").with_context(|| {
        format!(
            "{} could not be read as a detector: write it into the folder of the surface that it names",
            path.display()
        )
    })?;
    out.write(&text)
}
