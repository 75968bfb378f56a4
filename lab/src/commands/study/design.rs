//! `tactomo-lab study materials` and the other studies of detectors.

use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use serde::Serialize;
use tactomo_design::{DesignError, Progress, Report, Step};

use tactomo_cli::interrupt;
use tactomo_cli::output::{self, NewFile, message};

/// Steps are told so often at most.
const TOLD_EVERY: Duration = Duration::from_secs(1);

/// Where what is found goes.
#[derive(Debug, clap::Args)]
pub struct Output {
    /// Writes a page with maps and charts, which needs nothing else
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replaces files that exist
    #[arg(long, visible_alias = "force")]
    overwrite: bool,
    /// Prints all figures as JSON
    #[arg(long)]
    json: bool,
}

/// Where the figures of one study go.
#[derive(Debug, clap::Args)]
pub struct OneOutput {
    #[command(flatten)]
    output: Output,
    /// Writes all figures as comma-separated values, a row for each thing that was computed
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

/// What noise there is.
#[derive(Debug, clap::Args)]
pub struct Seeded {
    /// Seed of the noise: the same seed gives the same figures
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// Runs one study on all cores, tells how far it is, and puts out what it found; Ctrl-C keeps what is done.
pub fn one<R: Report + Serialize>(
    args: &OneOutput,
    run: impl FnOnce(Progress) -> Result<R, DesignError>,
) -> anyhow::Result<()> {
    let csv = NewFile::optional(args.csv.as_ref(), args.output.overwrite)?;
    let page = NewFile::optional(args.output.out.as_ref(), args.output.overwrite)?;
    let report = watched(run)?;
    csv.map(|csv| csv.write(report.csv())).transpose()?;
    put_out(&args.output, page, &[&report], &report)
}

/// The same of several studies, on one page.
pub fn several<R: Serialize>(
    args: &Output,
    run: impl FnOnce(Progress) -> Result<R, DesignError>,
    reports: impl FnOnce(&R) -> Vec<&dyn Report>,
) -> anyhow::Result<()> {
    let page = NewFile::optional(args.out.as_ref(), args.overwrite)?;
    let all = watched(run)?;
    put_out(args, page, &reports(&all), &all)
}

/// Runs something that tells how far it is, until Ctrl-C.
pub fn watched<R>(run: impl FnOnce(Progress) -> Result<R, DesignError>) -> anyhow::Result<R> {
    let stop = interrupt::flag()?;
    let last = Mutex::new(Instant::now());
    let say = |step: &Step| {
        let Ok(mut last) = last.try_lock() else { return };
        if last.elapsed() >= TOLD_EVERY && step.done < step.all {
            *last = Instant::now();
            let left_s = step.left.as_secs_f64().ceil();
            message!(
                "{}: {} of {}, about {left_s:.0} s left; Ctrl-C keeps what is done",
                step.what,
                step.done,
                step.all
            );
        }
    };
    Ok(run(Progress::new(&stop, &say))?)
}

fn put_out(args: &Output, page: Option<NewFile>, reports: &[&dyn Report], json: &impl Serialize) -> anyhow::Result<()> {
    page.map(|page| page.write(tactomo_design::page(reports, &output::command_line()))).transpose()?;
    if let Some(path) = &args.out {
        message!("page written to {}", path.display());
    }
    let text = || reports.iter().map(|report| report.table()).collect::<Vec<_>>().join("\n");
    Ok(output::print(&if args.json { serde_json::to_string(json)? } else { text() })?)
}
