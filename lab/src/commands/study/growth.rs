//! `tactomo-lab study growth`: how cost grows.

use tactomo_study::growth::{self, Plan};

use super::super::shown::{Shown, watched, whole};
use crate::heap::HEAP;
use tactomo_cli::output;

/// Places at each size: in a quick look, and else.
const PLACES: [usize; 2] = [3, 12];

/// Charts how time and memory grow with electrodes, nodes, contacts and frames.
///
/// Set-up, first answer, following and memory against 8 to 64 electrodes, 500 to 8000 nodes of
/// the image, 1 to 6 contacts and up to 256 frames, with the powers that were fitted and their
/// standard errors. Ctrl-C keeps what is done. Let nothing else run meanwhile.
///
/// Examples:
///   tactomo-lab study growth --quick --out growth.html
///   tactomo-lab study growth --seed 2 --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// A quick look, with few places
    #[arg(long)]
    quick: bool,
    /// Seed of places and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    shown: Shown,
}

/// Runs the study.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let files = args.shown.files()?;
    let plan = Plan { places: if args.quick { PLACES[0] } else { PLACES[1] }, seed: args.seed, heap: HEAP };
    let report = watched(|progress| growth::run(&plan, &output::command_line(), progress))?;
    args.shown.put_out(files, &report, &[growth::view(&report)])?;
    whole(&report.missing)
}
