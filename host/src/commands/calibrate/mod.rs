//! `tactomo calibrate`: makes a detector on paper the one that was built.

mod force;
mod known;
mod rub;

use std::path::Path;

use anyhow::Context;
use tactomo::detector::Detector;

use super::output::NewFile;

/// Fits a detector's description to the detector that was built.
///
/// Each way of calibrating writes a new detector file, for every --detector; none replaces a
/// file.
///
/// Examples:
///   tactomo calibrate rub --port /dev/ttyUSB0 --detector my.toml --out my-cal.toml
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
    Force(force::Args),
}

/// Calibrates.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.way {
        Way::Rub(args) => rub::run(args),
        Way::Force(args) => force::run(args),
    }
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
