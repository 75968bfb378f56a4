//! `tactomo-lab study bonding`: two layers joined by dots of glue.

use tactomo_design::bonding;

use super::design::{self, OneOutput};

/// Joins two layers of sample B by 5 x 5 and 7 x 7 dots of conductive glue, from 1 mm to dots that touch: figure 7.
///
/// Errors of places with the paper's solver and the limit of the sensor itself over the dots'
/// diameter, and the current through each dot.
///
/// Examples:
///   tactomo-lab study bonding --out bonding.html
///   tactomo-lab study bonding --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(flatten)]
    output: OneOutput,
}

/// Runs the study.
pub fn run(args: &Args) -> anyhow::Result<()> {
    design::one(&args.output, bonding::run)
}
