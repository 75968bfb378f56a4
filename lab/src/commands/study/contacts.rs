//! `tactomo-lab study contacts`: contacts of any size, strength and number.

use tactomo_physics::detector::Chosen;
use tactomo_study::contacts::{self, Plan};
use tactomo_touch::solve::Method;

use super::super::shown::Shown;
use tactomo_cli::choice;
use tactomo_cli::output::{self, message};

/// Tries a solver on random contacts, one to five, each scene from a cold start.
///
/// Radii are 1 to 6 mm for electrodes at 15 mm, in proportion for others; conductances 1e-5 to
/// 1e-1 S; both even in the logarithm. Readings are of the finest model with the converter's noise.
/// Errors are compared with the Cramer-Rao bound and with the standard errors that the solver claims.
///
/// Examples:
///   tactomo-lab study contacts --scenes 60 --worst 3
///   tactomo-lab study contacts --solver contacts --frames 16 --seed 11 --detector square-60 --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Solver to try
    #[arg(long, value_name = "NAME", value_parser = choice::method(), hide_possible_values = true, default_value = "auto")]
    solver: Method,
    /// Detector: name of a preset, or a TOML file; give it again for more [default: square-60, the same with foam
    /// that conducts ten times better at the bottom than at the top, and display-140x70]
    #[arg(long, value_name = "NAME|FILE")]
    detector: Vec<Chosen>,
    /// How many scenes
    #[arg(long, default_value_t = 180, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    scenes: u32,
    /// Frames of each scene, with new noise each; the answer to the last one is judged
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=10_000))]
    frames: u16,
    /// Seed of scenes and noise: the same seed gives the same figures, but for times
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Simulates detectors as they were built: drawn with this seed from the tolerances around their descriptions, which is all that
    /// the solver knows
    #[arg(long, value_name = "SEED")]
    as_built: Option<u64>,
    /// Calibrates each detector as built before, with so many single presses at unknown places
    #[arg(long, value_name = "PRESSES", default_value_t = 0, requires = "as_built")]
    rub: usize,
    /// Scenes tried at a time; times are right with one only
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..))]
    threads: u8,
    /// Prints this many of the worst scenes, with what was found of each contact
    #[arg(long, value_name = "COUNT", default_value_t = 0)]
    worst: u16,
    #[command(flatten)]
    shown: Shown,
}

/// Runs the study.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let detectors = match args.detector[..] {
        [] => contacts::detectors(),
        _ => choice::detectors(&args.detector, &[])?,
    };
    let plan = Plan {
        detectors,
        method: args.solver,
        scenes: args.scenes as usize,
        frames: usize::from(args.frames),
        threads: usize::from(args.threads),
        worst: usize::from(args.worst),
        seed: args.seed,
        as_built: args.as_built,
        rub: args.rub,
    };
    let files = args.shown.files()?;
    let report = contacts::run(&plan, &output::command_line(), &mut |step| message!("{step}"))?;
    args.shown.put_out(files, &report, &[contacts::view(&report)])
}
