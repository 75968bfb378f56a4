//! `tactomo-lab study materials`: conductivities of top and bottom.

use tactomo_design::materials::{self, Plan};

use super::design::{self, OneOutput, Seeded};

/// Maps what the conductivities of a detector's bottom and top do: the paper's figures 2 and 3.
///
/// A slab of 60 x 60 x 10 mm with 16 electrodes, conductivities from 0.001 to 100 S/m at the
/// bottom and at the top, and the paper's foams and stacks among them: sensitivity, maximum
/// force, spatial resolution and position accuracy with the paper's solver, and beside them the
/// limits of the sensor itself. Says of each of the paper's conclusions whether it holds.
///
/// Examples:
///   tactomo-lab study materials --out materials.html
///   tactomo-lab study materials --side 101 --csv materials.csv
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Conductivities on each side of the map: 11 are the paper's
    #[arg(long, default_value_t = 11, value_parser = clap::value_parser!(u16).range(2..=301))]
    side: u16,
    /// Has `auto` find presses on all of the map, not on the foams alone; takes some ten seconds more
    #[arg(long)]
    auto: bool,
    #[command(flatten)]
    noise: Seeded,
    #[command(flatten)]
    output: OneOutput,
}

/// Runs the study.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let plan = Plan { side: usize::from(args.side), reached: args.auto, seed: args.noise.seed };
    design::one(&args.output, |progress| materials::run(&plan, progress))
}
