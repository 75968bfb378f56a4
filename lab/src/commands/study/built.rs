//! `tactomo-lab study built`: detectors that are not as they are described.

use std::path::PathBuf;

use tactomo_study::built::{self, Plan};
use tactomo_touch::solve::Method;

use super::super::shown::Shown;
use tactomo_cli::choice::{self, DetectorArgs};
use tactomo_cli::options;
use tactomo_cli::output::{self, message};

/// Tries solvers on detectors as built, of which they know the description only.
///
/// Detectors are drawn from the tolerances of the description, or come from files of another
/// program (JSON: `nominal`, `scenes`). Each is pressed by single contacts and by pairs, with
/// the converter's noise; each press is a cold start.
///
/// Examples:
///   tactomo-lab study built --detectors 20 --presses 12
///   tactomo-lab study built --tolerances 0.1 --solver auto --json
///   tactomo-lab study built --rub 300 --known 3
///   tactomo-lab study built --rub 24 --solver contacts tests/reference/built/*.json.gz
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Files of detectors as built
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    detector: DetectorArgs,
    /// Solver to try; give it again for more [default: auto, contacts and tikhonov]
    #[arg(long, value_name = "NAME", value_parser = choice::method(), hide_possible_values = true)]
    solver: Vec<Method>,
    /// How many detectors are drawn
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000), conflicts_with = "files")]
    detectors: u32,
    /// Single presses on each; a quarter as many pairs
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..=100_000), conflicts_with = "files")]
    presses: u32,
    /// Takes this share of the description's tolerances
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, value_parser = options::number("a share", 0.0..=10.0))]
    tolerances: f64,
    /// Calibrates each detector before, with so many single presses at unknown places; of a file with its first ones, and tries the rest
    #[arg(long, value_name = "PRESSES", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=10_000))]
    rub: u32,
    /// So many of them are at known places
    #[arg(long, value_name = "PRESSES", default_value_t = 0, requires = "rub", value_parser = clap::value_parser!(u32).range(0..=10_000))]
    known: u32,
    /// First of the seeds of detectors, presses and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Detectors tried at a time; times are right with one only
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..))]
    threads: u8,
    #[command(flatten)]
    shown: Shown,
}

/// Runs the study.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let mut detector = args.detector.get()?;
    detector.tolerances = detector.tolerances.times(args.tolerances);
    let methods = match args.solver[..] {
        [] => vec![Method::Auto, Method::Contacts, Method::Tikhonov],
        _ => args.solver.clone(),
    };
    let plan = Plan {
        detector,
        files: args.files.clone(),
        methods,
        detectors: args.detectors as usize,
        presses: args.presses as usize,
        rub: args.rub as usize,
        known: args.known as usize,
        threads: usize::from(args.threads),
        seed: args.seed,
    };
    let files = args.shown.files()?;
    let report = built::run(&plan, &output::command_line(), &|step| message!("{step}"))?;
    args.shown.put_out(files, &report, &[built::view(&report)])
}
