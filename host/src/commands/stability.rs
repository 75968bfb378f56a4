//! `tactomo stability`: where solvers break.

use std::fs;
use std::path::PathBuf;

use anyhow::Context;
use tactomo::solve::Method;
use tactomo::study::stability::{self, Plan};

use super::choice::{self, DetectorArgs};
use super::output;

/// Sweeps what can go wrong, from harmless to hopeless, and tells where each solver breaks, how, and whether it says so itself.
///
/// Noise, converter, force, near contacts, edges, wrong thickness and conductivity, baselines under load, dead and exchanged
/// electrodes, and more; and the Cramer-Rao bound beside what solvers reach. Takes some minutes, with --quick about one.
///
/// Examples:
///   tactomo stability --quick --out stability.html
///   tactomo stability --detector strip-13x60 --solver contacts --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(flatten)]
    detector: DetectorArgs,
    /// Solver; give it again for more. Else all
    #[arg(long, value_name = "NAME")]
    solver: Vec<Method>,
    /// A third of the points, one place, few frames
    #[arg(long)]
    quick: bool,
    /// Places of the contacts at each point
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1000))]
    places: Option<u16>,
    /// Frames at each place
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1000))]
    frames: Option<u16>,
    /// Seed of places and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Writes the maps as a page that needs nothing else
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Prints every point as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the study.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let (places, frames) = if args.quick { (1, 2) } else { (3, 2) };
    let plan = Plan {
        detector: args.detector.get()?,
        methods: choice::methods(&args.solver),
        places: args.places.map_or(places, usize::from),
        frames: args.frames.map_or(frames, usize::from),
        seed: args.seed,
        quick: args.quick,
    };
    let report = stability::run(&plan, &output::command_line(), &mut |step| eprintln!("{step}"))?;
    if let Some(path) = &args.out {
        fs::write(path, stability::page(&report))
            .with_context(|| format!("cannot write the page {}", path.display()))?;
    }
    Ok(output::print(&if args.json { serde_json::to_string(&report)? } else { stability::table(&report) })?)
}
