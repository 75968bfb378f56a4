//! `tactomo-lab study all`: all studies of detectors on one page.

use tactomo_design::{DesignError, Progress, Report, bonding, electrodes, materials, samples, thickness};

use super::design::{Output, Seeded, several};

/// All studies of detectors, on one page: what of the paper holds, and what of it belongs to its solver.
///
/// Examples:
///   tactomo-lab study all --out detectors.html
///   tactomo-lab study all --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(flatten)]
    noise: Seeded,
    #[command(flatten)]
    output: Output,
}

/// What all of them found, by their names.
#[derive(serde::Serialize)]
struct All {
    materials: materials::Report,
    thickness: thickness::Report,
    samples: samples::Report,
    bonding: bonding::Report,
    electrodes: electrodes::Report,
}

/// Runs the studies.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let seed = args.noise.seed;
    let run = |progress: Progress| -> Result<All, DesignError> {
        Ok(All {
            materials: materials::run(&materials::Plan { side: 11, reached: false, seed }, progress)?,
            thickness: thickness::run(&thickness::Plan { methods: thickness::methods(), seed }, progress)?,
            samples: samples::run(&samples::Plan { seed }, progress)?,
            bonding: bonding::run(progress)?,
            electrodes: electrodes::run(&electrodes::Plan { seed }, progress)?,
        })
    };
    several(&args.output, run, |all: &All| -> Vec<&dyn Report> {
        vec![&all.materials, &all.thickness, &all.samples, &all.bonding, &all.electrodes]
    })
}
