//! `tactomo-lab score`: how right what was learned is, on presses that it was not taught.

mod map;
mod report;

use std::path::PathBuf;

use anyhow::{Context, anyhow, bail, ensure};
use tactomo_study::stopwatch::timed;
use tactomo_study::view::{self, View};
use tactomo_touch::learned::Learned;
use tactomo_touch::solve::{Kernel, Press, Presses};

use self::map::Map;
use self::report::{Report, Scored};
use tactomo_cli::output::{self, NewFile, command_line, message};

/// Tells how right what `tactomo-lab learn` has learned is, on presses that it was not taught: over all, and by place as a map.
///
/// PRESSES is a file as `tactomo-lab learn` takes it, with the same channels: by their names, if they
/// have some, else in their order.
///
/// Examples:
///   tactomo-lab score sensor.safetensors unseen.csv
///   tactomo-lab score sensor.safetensors unseen.csv --out score.html
///   tactomo-lab score sensor.safetensors unseen.npz --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// What `tactomo-lab learn` has written
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Presses at known places
    #[arg(value_name = "PRESSES")]
    presses: PathBuf,
    /// Prints `{presses, unread, flagged, mean_m, median_m, p90_m, root_mean_square_m, strength?, strength_median_share?, press_us, map}` as JSON
    #[arg(long)]
    json: bool,
    /// Writes the map: a page (.html), or the drawing alone (.svg)
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Reads each press, and tells how far off it is.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let extension = args.out.as_deref().and_then(|out| out.extension()?.to_str());
    ensure!(
        args.out.is_none() || matches!(extension, Some("html" | "svg")),
        "--out needs a name that ends in .html or .svg"
    );
    let Learned::Kernel(kernel) = Learned::read(&args.model)? else {
        bail!(
            "{} is a network, which learned from no presses: `tactomo-lab study built --solver network` scores it",
            args.model.display()
        );
    };
    let presses = Presses::read(&args.presses, kernel.names())?;
    let out = NewFile::optional(args.out.as_ref())?;
    let scored = scored(&kernel, &presses).with_context(|| args.presses.display().to_string())?;
    let map = Map::of(&scored.errors());
    let report = Report::of(&scored, &map);
    let title = format!("{} on {}", args.model.display(), args.presses.display());
    let shown = [View::new(title, "").with(report.table()).figures("", [map.drawn()])];
    if let Some(out) = out {
        out.write(match extension {
            Some("svg") => view::standalone(&map.drawn()),
            _ => view::page(&shown, &command_line()),
        })?;
    }
    Ok(output::print(&if args.json { serde_json::to_string(&report)? } else { view::text(&shown) })?)
}

/// What the kernel reads of all presses.
fn scored<'a>(kernel: &Kernel, presses: &'a Presses) -> anyhow::Result<Scored<'a>> {
    ensure!(
        presses.channels == kernel.channels(),
        "{} channels, but it was taught by {}",
        presses.channels,
        kernel.channels()
    );
    if presses.strength != kernel.strength() && kernel.strength().is_some() {
        message!("warning: the strength was not measured as it was taught, so that it is not scored");
    }
    let all = presses.readings().enumerate().map(|(index, readings_v)| {
        kernel.press(readings_v).map_err(|channel| anyhow!("press {index}: channel {channel:?} is not a finite number"))
    });
    let (read, taken) = timed(|| all.collect::<anyhow::Result<Vec<Option<Press>>>>());
    let press_us = taken.as_secs_f64() * 1e6 / presses.count().max(1) as f64;
    let strength = kernel.strength().filter(|strength| presses.strength == Some(*strength));
    Ok(Scored { presses, read: read?, press_us, strength })
}
