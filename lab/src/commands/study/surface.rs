//! `tactomo-lab study surface`: how a press is shown, place by place.

use tactomo_study::surface::{self, Plan};
use tactomo_touch::solve::Method;

use super::super::shown::{Shown, watched, whole};
use tactomo_cli::choice::{self, DetectorArgs};
use tactomo_cli::options;
use tactomo_cli::output;

/// Places along the longer side: in a quick look, and else.
const ACROSS: [u8; 2] = [8, 20];

/// Shows how each solver shows one press, place by place: GREIT's figures of merit, and maps of error and amplitude.
///
/// GREIT's figures (Adler et al., 2009) are amplitude response, position error, resolution, shape
/// deformation and ringing of the image of a small press. Each press is a cold start, in simulated
/// readings with noise. Takes half a minute of processor time, with --quick some seconds. Ctrl-C keeps
/// what is done.
///
/// Examples:
///   tactomo-lab study surface --quick --out surface.html
///   tactomo-lab study surface --detector strip-13x60 --solver tikhonov --solver contacts --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(flatten)]
    detector: DetectorArgs,
    /// Solver to try; give it again for more [default: those that make images, and auto]
    #[arg(long, value_name = "NAME", value_parser = choice::method(), hide_possible_values = true)]
    solver: Vec<Method>,
    /// A quick look, at few places
    #[arg(long, conflicts_with = "across")]
    quick: bool,
    /// Places along the longer side [default: 20, with --quick 8]
    #[arg(long, value_name = "PLACES", value_parser = clap::value_parser!(u8).range(2..))]
    across: Option<u8>,
    /// Conductance of the press, in sheet conductances: 0.03 is light, 0.3 firm
    #[arg(long, default_value_t = 0.3, value_parser = options::number("a number of sheet conductances", 1e-4..=100.0))]
    sheets: f64,
    /// Seed of the noise: the same seed gives the same figures
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Simulates the detector as it was built: drawn with this seed from the tolerances around its description, which is all that solvers
    /// know
    #[arg(long, value_name = "SEED")]
    as_built: Option<u64>,
    #[command(flatten)]
    shown: Shown,
}

/// Runs the study.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let files = args.shown.files()?;
    let plan = Plan {
        detector: args.detector.get()?,
        methods: if args.solver.is_empty() { surface::methods() } else { args.solver.clone() },
        across: usize::from(args.across.unwrap_or(if args.quick { ACROSS[0] } else { ACROSS[1] })),
        sheets: args.sheets,
        seed: args.seed,
        as_built: args.as_built,
    };
    let report = watched(|progress| surface::run(&plan, &output::command_line(), progress))?;
    args.shown.put_out(files, &report, &[surface::view(&report)])?;
    whole(&report.missing)
}
