//! `tactomo-lab stability`: where solvers break.

use tactomo_study::stability::{self, Plan};

use super::shown::{watched, whole};
use super::study::StudyArgs;
use tactomo_cli::choice::DetectorArgs;
use tactomo_cli::output;

/// Finds where each solver breaks, how, and whether it reports it.
///
/// Varied are noise, converter, force, the distance of two contacts and of edges, thickness and
/// conductivity, each tolerance of the detector, the baseline, faulty electrodes and more; and errors are compared with the
/// Cramer-Rao bound. Takes a quarter of an hour or so of processor time, with --quick some minutes. Ctrl-C keeps what is done.
///
/// Examples:
///   tactomo-lab stability --quick --out stability.html
///   tactomo-lab stability --detector strip-13x60 --solver contacts --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(flatten)]
    detector: DetectorArgs,
    #[command(flatten)]
    study: StudyArgs,
}

/// Runs the study.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let Args { detector, study } = args;
    let files = study.shown.files()?;
    let [places, frames] = study.places_and_frames(if study.quick { [5, 1] } else { [5, 2] });
    let plan = Plan {
        detector: detector.get()?,
        methods: study.methods(),
        places,
        frames,
        seed: study.seed,
        quick: study.quick,
        as_built: study.as_built,
        calibrate: study.calibrate(),
    };
    let report = watched(|progress| stability::run(&plan, &output::command_line(), progress))?;
    study.shown.put_out(files, &report, &[stability::view(&report)])?;
    whole(&report.missing)
}
