//! How far a study is, and where what it finds goes: the same for all.

use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use serde::Serialize;
use tactomo_cli::interrupt;
use tactomo_cli::output::{self, NewFile, message};
use tactomo_study::view::{self, View};
use tactomo_study::{Progress, Step};

/// Steps are told so often at most.
const TOLD_EVERY: Duration = Duration::from_secs(1);

/// Where what is found goes.
#[derive(Debug, clap::Args)]
pub struct Shown {
    /// Writes a page with maps and charts, which needs nothing else; or, if the name ends in .json, what it shows as data
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Writes all figures as comma-separated values, a row for each thing that was computed
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Prints all figures as JSON
    #[arg(long)]
    json: bool,
}

/// Files that are to be written.
pub struct Files {
    out: Option<NewFile>,
    csv: Option<NewFile>,
}

impl Shown {
    /// The files, before anything is computed.
    pub fn files(&self) -> anyhow::Result<Files> {
        Ok(Files { out: NewFile::optional(self.out.as_ref())?, csv: NewFile::optional(self.csv.as_ref())? })
    }

    /// Puts out what was found, and how it is shown.
    pub fn put_out(&self, files: Files, found: &impl Serialize, views: &[View]) -> anyhow::Result<()> {
        if let (Some(out), Some(path)) = (files.out, &self.out) {
            out.write(match path.extension() {
                Some(extension) if extension == "json" => serde_json::to_string(views)?,
                _ => view::page(views, &output::command_line()),
            })?;
            message!("page written to {}", path.display());
        }
        files.csv.map(|csv| csv.write(view::csv(views))).transpose()?;
        Ok(output::print(&if self.json { serde_json::to_string(found)? } else { view::text(views) })?)
    }
}

/// Runs something that tells how far it is, until Ctrl-C or SIGTERM.
pub fn watched<R, E: std::error::Error + Send + Sync + 'static>(
    run: impl FnOnce(Progress) -> Result<R, E>,
) -> anyhow::Result<R> {
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

/// An error where something is missing because the study was stopped.
pub fn whole(missing: &[String]) -> anyhow::Result<()> {
    let Some(first) = missing.first() else { return Ok(()) };
    let more = match missing.len() {
        1 => String::new(),
        count => format!(" and {} more", count - 1),
    };
    anyhow::bail!("stopped before it was done: {first}{more} missing; what was measured is written")
}
