//! `tactomo tradeoff`: speed against accuracy of every solver.

use std::fs;
use std::path::PathBuf;

use anyhow::Context;
use tactomo::solve::Method;
use tactomo::study::tradeoff::{self, Plan};

use super::choice::{self, Chosen};
use super::output;
use crate::heap::HEAP;

/// Detectors unless others are asked for: the default, a thin narrow one, a large one of 32 electrodes, and a very thin small one.
const DETECTORS: [&str; 4] = ["square-60", "strip-13x60", "display-140x70", "fingertip-10"];

/// Charts the time a frame takes against the error, for every solver, over scenes from nothing to a hand.
///
/// Readings are simulated on a finer model than any that is inverted, with the converter's noise and steps. Takes some minutes, with
/// --quick about 20 seconds. Let nothing else run meanwhile.
///
/// Examples:
///   tactomo tradeoff --quick --out tradeoff.html
///   tactomo tradeoff --detector square-60 --detector my.toml --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Detector: name of a preset, or a TOML file; give it again for more. Else a set of four, with --quick square-60
    #[arg(long, value_name = "NAME|FILE", value_parser = choice::detector)]
    detector: Vec<Chosen>,
    /// Solver; give it again for more. Else all
    #[arg(long, value_name = "NAME")]
    solver: Vec<Method>,
    /// Few places and frames, one detector
    #[arg(long)]
    quick: bool,
    /// Places of each kind of scene
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1000))]
    places: Option<u16>,
    /// Frames at each place
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1000))]
    frames: Option<u16>,
    /// Seed of places and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Writes the charts as a page that needs nothing else
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Writes the first detector's charts alone
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Prints all figures as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the study.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let (places, frames) = if args.quick { (2, 3) } else { (6, 5) };
    let plan = Plan {
        detectors: choice::detectors(&args.detector, if args.quick { &DETECTORS[..1] } else { &DETECTORS })?,
        methods: choice::methods(&args.solver),
        sweep: true,
        places: args.places.map_or(places, usize::from),
        frames: args.frames.map_or(frames, usize::from),
        seed: args.seed,
        heap: Some(HEAP),
    };
    let report = tradeoff::run(&plan, &output::command_line(), &mut |step| eprintln!("{step}"))?;
    for (path, page) in [(&args.out, tradeoff::page(&report)), (&args.picture, tradeoff::picture(&report))] {
        if let Some(path) = path {
            fs::write(path, page).with_context(|| format!("cannot write the page {}", path.display()))?;
        }
    }
    Ok(output::print(&if args.json { serde_json::to_string(&report)? } else { tradeoff::table(&report) })?)
}
