//! `tactomo calibrate force`: newtons from presses of known force.

pub mod gather;
pub mod known;
pub mod report;

use std::path::PathBuf;

use anyhow::Context;
use tactomo::calibrate::force::{Law, fit_force};
use tactomo::detector::Detector;

use self::gather::gather;
use self::known::Known;
use self::report::Report;
use super::Reading;
use tactomo_cli::choice::DetectorArgs;
use tactomo_cli::options;
use tactomo_cli::output::{self, NewFile, message};

/// Finds which force is behind a contact's conductance, from presses of known force.
///
/// FILE is a recording of presses on a kitchen scale, each held for a second and lifted before
/// the next, or a table of readings with a press a row. Ten presses from light to firm are good,
/// all of them with the tip that will be used. The result is the detector with a law of force:
/// with it, contacts of every solver carry newtons and their standard error.
///
/// Examples:
///   tactomo calibrate force scale.tactomo --newtons 0.5,1,2,3,5,4,2.5,1.5,0.7,0.3 --out my-newtons.toml
///   tactomo calibrate force presses.csv --detector my.toml --newtons 1,2,3,5,8 --out my-newtons.toml --json
///   tactomo calibrate force ramp.tactomo --forces sensor.csv --out my-newtons.toml
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
#[command(group(clap::ArgGroup::new("known").args(["newtons", "forces"]).required(true)))]
pub struct Args {
    #[command(flatten)]
    presses: PressArgs,
    /// Law of force: `power`, or `saturating`, the paper's eq. (6) [default: the one that the presses need]
    #[arg(long, value_name = "power|saturating", value_parser = law)]
    law: Option<Law>,
    /// The detector file to write; a file that exists is not replaced
    #[arg(long, value_name = "CAL.toml")]
    out: PathBuf,
    /// Prints `{detector, out, law, parameters, maximum_force, maximum_force_n, scatter, hysteresis, presses, ...}` as JSON
    #[arg(long)]
    json: bool,
}

/// Presses of known force.
#[derive(Debug, clap::Args)]
pub struct PressArgs {
    /// A recording, or a table of readings with a press a row (see `reconstruct`)
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    #[command(flatten)]
    pub detector: DetectorArgs,
    /// Force of each press (N): of each row of a table, of each press of a recording
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', value_parser = options::force())]
    newtons: Vec<f64>,
    /// The same from a table with a column `force_n`, and `unloading` if that is known: 1 where the force was falling, else 0; or a force
    /// sensor's: columns `time_s`, since the recording's first frame, and `force_n`
    #[arg(long, value_name = "FILE", conflicts_with = "newtons")]
    forces: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

impl PressArgs {
    /// The forces that are given, if any are.
    pub fn known(&self) -> anyhow::Result<Option<Known>> {
        let is_given = !self.newtons.is_empty() || self.forces.is_some();
        is_given.then(|| Known::of(&self.newtons, self.forces.as_deref())).transpose()
    }
}

/// Fits a law and writes the detector with it.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let out = NewFile::new(&args.out)?;
    let known = args.presses.known()?.context("give --newtons or --forces: which forces were the presses?")?;
    let gathered = gather(&args.presses, &known)?;
    let presses: Vec<_> = gathered.presses.iter().map(|press| press.press).collect();
    let fit = fit_force(&presses, args.law).with_context(|| args.presses.file.display().to_string())?;
    let calibrated = Detector { force: Some(fit.law.clone()), ..gathered.detector };
    super::write(&calibrated, &args.out, out)?;
    let report = Report::of(&calibrated.name, &args.out, &gathered.presses, &fit);
    message!("{}", report.table());
    if args.json {
        output::print(&serde_json::to_string(&report)?)?;
    }
    Ok(())
}

fn law(text: &str) -> Result<Law, String> {
    match text {
        "power" => Ok(Law::Power),
        "saturating" => Ok(Law::Saturating),
        _ => Err("power or saturating is needed".to_owned()),
    }
}
