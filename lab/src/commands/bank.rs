//! `tactomo-lab bank`: how right, how sure and how fast solvers are, side by side.

use std::path::PathBuf;

use tactomo_cli::choice;
use tactomo_cli::options;
use tactomo_cli::output::{self, message};
use tactomo_physics::detector::{Chosen, Detector};
use tactomo_study::Independent;
use tactomo_study::bank::{self, Case, Plan, Scenes};
use tactomo_touch::solve::Method;

use super::shown::Shown;

/// Tries solvers on scenes of contacts and shapes, on detectors that are known and as built, each scene from a cold start.
///
/// Without --scenes, all cases of the bank. Random contacts have radii of 1 to 6 mm for electrodes at 15 mm, in proportion for others,
/// and conductances of 1e-5 to 1e-1 S, both even in the logarithm. Readings are of the finest model with the converter's noise.
/// With --independent, readings are of another program's solution of a detector, and contacts are of its patches.
/// Errors are compared with the Cramer-Rao bound and with the standard errors that the solver claims, times with those of tikhonov.
///
/// Examples:
///   tactomo-lab bank --solver auto --solver core --count 40
///   tactomo-lab bank --case "built, near" --seed 7 --worst 3
///   tactomo-lab bank --scenes random --detector square-60 --as-built 20 --rub 20 --count 60 --json
///   tactomo-lab bank --independent solved.npz --described square-60 --solver auto --count 20
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Solver; give it again for more [default: auto]
    #[arg(long, value_name = "NAME", value_parser = choice::method(), hide_possible_values = true)]
    solver: Vec<Method>,
    /// A case of the bank; give it again for more [default: all]
    #[arg(long, value_name = "NAME", conflicts_with = "scenes")]
    case: Vec<String>,
    /// How many detectors as built a case of the bank has, drawn with this seed and those after it
    #[arg(long, default_value_t = 4, conflicts_with_all = ["scenes", "independent"], value_parser = clap::value_parser!(u64).range(1..=1000))]
    builds: u64,
    /// What touches, in place of the cases of the bank: random, single, corner, row, near, hand, or shape
    #[arg(long, value_name = "KIND")]
    scenes: Option<Scenes>,
    /// Detector of such scenes: name of a preset, or a TOML file; give it again for more [default: square-60, the same with foam
    /// that conducts ten times better at the bottom than at the top, and display-140x70]
    #[arg(long, value_name = "NAME|FILE", requires = "scenes")]
    detector: Vec<Chosen>,
    /// Simulates detectors as they were built: drawn with this seed from the tolerances around their descriptions, which is all that
    /// the solver knows; give it again for more
    #[arg(long, value_name = "SEED", requires = "scenes")]
    as_built: Vec<u64>,
    /// Draws those with the top conducting better than the bottom by so many standard deviations of that tolerance
    #[arg(long, value_name = "DEVIATIONS", requires = "as_built", allow_negative_numbers = true, value_parser = options::number("standard deviations", -5.0..=5.0))]
    top_over_bottom: Option<f64>,
    /// Calibrates each detector as built before, with so many single presses at unknown places
    #[arg(long, value_name = "PRESSES", default_value_t = 0, requires = "as_built")]
    rub: usize,
    /// Solution of another program (NPZ), for validation: in place of the cases of the bank, single presses, pairs, triples and hands on its
    /// patches; give it again for more
    #[arg(long, value_name = "FILE", conflicts_with = "scenes")]
    independent: Vec<PathBuf>,
    /// What solvers know of the detector that was solved, with its tolerances: name of a preset, or a TOML file [default: square-60]
    #[arg(long, value_name = "NAME|FILE", requires = "independent")]
    described: Option<Chosen>,
    /// How many scenes of each case
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    count: u32,
    /// Frames of each scene, with new noise each; the answer to the last one is judged
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=10_000))]
    frames: u16,
    /// Seed of scenes, noise and detectors as built: the same seed gives the same figures, but for times
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Scenes tried at a time; times are right with one only
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..))]
    threads: u8,
    /// Prints this many of the worst scenes, with what was found of each contact
    #[arg(long, value_name = "COUNT", default_value_t = 0)]
    worst: u16,
    #[command(flatten)]
    shown: Shown,
}

impl Args {
    /// The cases that are asked for.
    fn cases(&self) -> anyhow::Result<Vec<Case>> {
        let Some(scenes) = self.scenes else {
            let all = match self.independent[..] {
                [] => Case::bank(self.seed, self.builds),
                _ => self.on_patches()?,
            };
            return named(&self.case, all);
        };
        let detectors = match self.detector[..] {
            [] => bank::detectors(),
            _ => choice::detectors(&self.detector, &[])?,
        };
        let case = Case::of(scenes.name(), scenes, detectors);
        let (built, top_over_bottom) = (self.as_built.clone(), self.top_over_bottom);
        Ok(vec![Case { built, top_over_bottom, rub: self.rub, ..case }])
    }

    /// The cases of independent solutions.
    fn on_patches(&self) -> anyhow::Result<Vec<Case>> {
        let described = self.described.as_ref().map_or_else(|| Ok(Detector::default()), Chosen::get)?;
        let of = |file: &PathBuf| Ok(Case::independent(Independent::read(file)?, &described));
        let cases: anyhow::Result<Vec<_>> = self.independent.iter().map(of).collect();
        Ok(cases?.concat())
    }
}

/// Those of the bank with such names; all if there are none.
fn named(names: &[String], mut bank: Vec<Case>) -> anyhow::Result<Vec<Case>> {
    if let Some(unknown) = names.iter().find(|name| bank.iter().all(|case| case.name != **name)) {
        let all: Vec<_> = bank.iter().map(|case| format!("`{}`", case.name)).collect();
        anyhow::bail!("--case: the bank has no case `{unknown}`; it has {}", all.join(", "));
    }
    bank.retain(|case| names.is_empty() || names.contains(&case.name));
    Ok(bank)
}

/// Tries them.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let plan = Plan {
        cases: args.cases()?,
        methods: if args.solver.is_empty() { vec![Method::Auto] } else { args.solver.clone() },
        scenes: args.count as usize,
        frames: usize::from(args.frames),
        threads: usize::from(args.threads),
        worst: usize::from(args.worst),
        seed: args.seed,
    };
    let files = args.shown.files()?;
    let report = bank::run(&plan, &output::command_line(), &mut |step| message!("{step}"))?;
    args.shown.put_out(files, &report, &[bank::view(&report)])
}
