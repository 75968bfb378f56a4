//! `tactomo-lab study samples`: the paper's foams and stacks.

use tactomo_design::samples::{self, Plan};

use super::design::{self, OneOutput, Seeded};

/// Simulates the paper's foams A to D and their stacks as it measured them, with its figures beside: tables I and II.
///
/// Nine places, an indenter of 5 mm, 0 to 5 N up and down; curves of output over force with eq.
/// (6) fitted, line profiles, places seen at 2.25 N; and whether the simulation puts the
/// samples in the order that was measured.
///
/// Examples:
///   tactomo-lab study samples --out samples.html
///   tactomo-lab study samples --json
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
    design::one(&args.output, |progress| samples::run(&plan, progress))
}
