//! `tactomo-lab study picard`: how many unknowns the readings of a detector tell.

use tactomo_physics::detector::Chosen;
use tactomo_study::picard::{self, Plan};

use super::super::shown::Shown;
use tactomo_cli::choice;
use tactomo_cli::output::{self, message};

/// Detectors unless others are asked for.
const DETECTORS: [&str; 4] = ["square-60", "strip-13x60", "display-140x70", "fingertip-10"];

/// Shows how many unknowns the readings of a detector tell: a Picard plot of each.
///
/// Singular values of the readings' derivatives by an image of conductance, and coefficients of
/// the readings of light presses (0.03 sheet conductances), both as multiples of the noise: where
/// nothing else touches, and beside a firm press (0.3). Readings are of a finer model than the one
/// that is linearised. Takes some seconds for each detector.
///
/// Examples:
///   tactomo-lab study picard --out picard.html
///   tactomo-lab study picard --detector square-60 --detector my.toml --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Detector, a flat one: name of a preset, or a TOML file; give it again for more [default: four presets]
    #[arg(long, value_name = "NAME|FILE")]
    detector: Vec<Chosen>,
    /// Light presses on each, at random places
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u16).range(1..=10_000))]
    presses: u16,
    /// Seed of places and noise: the same seed gives the same figures
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    shown: Shown,
}

/// Runs the study.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let files = args.shown.files()?;
    let plan = Plan {
        detectors: choice::detectors(&args.detector, &DETECTORS)?,
        presses: usize::from(args.presses),
        seed: args.seed,
    };
    let report = picard::run(&plan, &output::command_line(), &mut |step| message!("{step}"))?;
    args.shown.put_out(files, &report, &[picard::view(&report)])
}
