//! `tactomo-lab study thickness`: thick detectors against the thin shell.

use tactomo_design::thickness::{self, Plan};
use tactomo_touch::solve::Method;

use super::design::{self, OneOutput, Seeded};
use tactomo_cli::choice;

/// Compares detectors of 1 to 16 mm with the thin shell that the paper's solver takes them for: its figure 4.
///
/// Correlation of the readings, largest reading, mean absolute error; and of each solver the
/// error where it takes the detector for a shell, and where it inverts the slab.
///
/// Examples:
///   tactomo-lab study thickness --out thickness.html
///   tactomo-lab study thickness --solver contacts --solver tikhonov --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Solver to try; give it again for more [default: all but auto, which makes of single contacts what `contacts` does]
    #[arg(long, value_name = "NAME", value_parser = choice::method(), hide_possible_values = true)]
    solver: Vec<Method>,
    #[command(flatten)]
    noise: Seeded,
    #[command(flatten)]
    output: OneOutput,
}

/// Runs the study.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let methods = if args.solver.is_empty() { thickness::methods() } else { args.solver.clone() };
    let plan = Plan { methods, seed: args.noise.seed };
    design::one(&args.output, |progress| thickness::run(&plan, progress))
}
