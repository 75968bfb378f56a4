//! `tactomo study all`: all studies of detectors on one page.

use tactomo::design::{DesignError, Progress, Report, electrodes, materials, samples, thickness};

use super::design::{Output, several};

/// All studies of detectors, on one page: what of the paper holds, and what of it belongs to its solver.
///
/// Examples:
///   tactomo study all --out detectors.html
///   tactomo study all --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(flatten)]
    output: Output,
    /// Seed of the noise: the same seed gives the same figures
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// What all of them found, by their names.
#[derive(serde::Serialize)]
struct All {
    materials: materials::Report,
    thickness: thickness::Report,
    samples: samples::Report,
    electrodes: electrodes::Report,
}

/// Runs the studies.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let seed = args.seed;
    let run = |progress: Progress| -> Result<All, DesignError> {
        Ok(All {
            materials: materials::run(&materials::Plan { side: 11, reached: false, seed }, progress)?,
            thickness: thickness::run(&thickness::Plan { methods: thickness::methods(), seed }, progress)?,
            samples: samples::run(&samples::Plan { seed }, progress)?,
            electrodes: electrodes::run(&electrodes::Plan { seed }, progress)?,
        })
    };
    several(&args.output, run, |all: &All| -> Vec<&dyn Report> {
        vec![&all.materials, &all.thickness, &all.samples, &all.electrodes]
    })
}
