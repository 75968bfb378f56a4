//! `tactomo-lab study electrodes`: number, pattern, diameter and pitch.

use tactomo_design::electrodes::{self, Plan};

use super::design::{self, OneOutput, Seeded};

/// Compares electrodes: 4 to 32 of them, grids, a ring around the edge, diameters and pitches.
///
/// What the sensor itself can tell with them of places, two points and strengths, with one frame and in the
/// same time, and what `auto` reaches, on the paper's sample A of 60 x 60 x 5 mm.
///
/// Examples:
///   tactomo-lab study electrodes --out electrodes.html
///   tactomo-lab study electrodes --csv electrodes.csv
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(flatten)]
    noise: Seeded,
    #[command(flatten)]
    output: OneOutput,
}

/// Runs the study.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let plan = Plan { seed: args.noise.seed };
    design::one(&args.output, |progress| electrodes::run(&plan, progress))
}
