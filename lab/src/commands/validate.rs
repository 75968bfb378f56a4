//! `tactomo-lab validate`: models and solvers against reference cases.

use std::path::PathBuf;

use anyhow::Context;
use serde::Serialize;
use tactomo_physics::causes::with_causes;
use tactomo_physics::forward::ForwardModel;
use tactomo_physics::forward::shell::Shell;
use tactomo_study::case::Case;
use tactomo_study::validate::{CaseReport, SolverReport, Trials, forward_errors, try_solver};
use tactomo_study::view::{Format, MM, PERCENT, PLAIN, TEXT, Table, US, View};
use tactomo_touch::solve::{Lambda, Method, Parameter, Problem};

use super::shown::Shown;
use tactomo_cli::choice::{self, Model};
use tactomo_cli::options;
use tactomo_cli::output::message;

/// Compares models and solvers with reference cases.
///
/// The forward model computes the readings of each case, to compare with the ones in the file;
/// the solvers find contacts from the readings in the file.
///
/// Cases are JSON files, compressed by gzip or not; twelve are in tests/reference/slab (see the README there).
///
/// Examples, from the repository's root:
///   tactomo-lab validate tests/reference/slab/*.json.gz --solver contacts --noise-lsb 1.5 --trials 20
///   tactomo-lab validate tests/reference/slab/*.json.gz --model slab --solver tikhonov
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Case files
    #[arg(required = true, value_name = "CASE")]
    cases: Vec<PathBuf>,
    /// Forward model
    #[arg(long, value_enum, default_value = "auto")]
    model: Model,
    /// Approximate number of nodes of the shell's mesh, to compare readings
    #[arg(long, default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    nodes: u32,
    /// Quantises the readings and adds noise of this standard deviation (LSB)
    #[arg(long, value_name = "LSB", value_parser = options::number("noise (LSB)", 0.0..=1e6))]
    noise_lsb: Option<f64>,
    /// Seed of the noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Trials of each solver, with new noise each
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    trials: u32,
    /// Solver to try; give it again for more [default: all]
    #[arg(long, value_name = "NAME", value_parser = choice::method(), hide_possible_values = true)]
    solver: Vec<Method>,
    /// Lambda of the solvers that have one, as a share of the largest singular value
    #[arg(long, value_name = "SHARE", value_parser = options::number("a share", 1e-12..=1e3))]
    lambda: Option<f64>,
    #[command(flatten)]
    shown: Shown,
}

#[derive(Serialize)]
struct Report {
    cases: Vec<CaseReport>,
}

/// Runs all cases and prints a table or JSON.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let files = args.shown.files()?;
    let mut report = Report { cases: Vec::with_capacity(args.cases.len()) };
    for path in &args.cases {
        let case = Case::read(path)?;
        report.cases.push(report_case(args, &case).with_context(|| path.display().to_string())?);
    }
    args.shown.put_out(files, &report, &[view(&report.cases)])
}

fn report_case(args: &Args, case: &Case) -> anyhow::Result<CaseReport> {
    let forward = args.model.build(&case.detector, Some(args.nodes as usize))?;
    let [forward_error, impedance_error] = forward_errors(case, &*forward)?;
    // The slab has no mesh to be finer for the comparison.
    let model: Box<dyn ForwardModel> = match forward.name() {
        "shell" => Box::new(Shell::new(&case.detector)?),
        _ => forward,
    };
    let lambda = args.lambda.map(|share| Parameter::Lambda(Lambda::Relative(share)));
    let trials = Trials { noise_lsb: args.noise_lsb, seed: args.seed, count: args.trials as usize };
    let problem = Problem::new(model);
    let mut solvers = Vec::new();
    for method in Method::ALL.iter().filter(|method| args.solver.is_empty() || args.solver.contains(method)) {
        match method.build_with(&problem, lambda) {
            Ok(mut solver) => solvers.push(try_solver(case, &mut *solver, &trials)?),
            // Of all solvers, those that there are for this detector.
            Err(error) if args.solver.is_empty() => message!("{}: not tried: {}", method.name(), with_causes(&error)),
            Err(error) => return Err(error.into()),
        }
    }
    Ok(CaseReport {
        case: case.detector.name.clone(),
        model: problem.model.name().to_owned(),
        forward_error,
        impedance_error,
        reference_error: case.mesh_error_v / case.readings.largest_v(),
        solvers,
    })
}

/// A row for each case and solver.
fn view(cases: &[CaseReport]) -> View {
    let rows = cases.iter().flat_map(|case| case.solvers.iter().map(move |solver| (case, solver)));
    let percent = PERCENT.digits(2);
    let case = |(case, _): &(&CaseReport, &SolverReport)| {
        let [readings, impedance, own] =
            [case.forward_error, case.impedance_error, case.reference_error].map(|share| percent.text(Some(share)));
        format!(
            "{} ({} model): readings differ by {readings} %, Z by {impedance} %; the reference's own {own} %",
            case.case, case.model
        )
    };
    let conductance_s = |(_, solver): &(&CaseReport, &SolverReport)| {
        solver.contacts.iter().map(|contact| contact.conductance_s).sum::<f64>()
    };
    let table = Table::of("", rows)
        .group("compared", case)
        .detail("case", TEXT, |(case, _)| case.case.as_str())
        .detail("model", TEXT, |(case, _)| case.model.as_str())
        .detail("readings", percent, |(case, _)| case.forward_error)
        .detail("Z", percent, |(case, _)| case.impedance_error)
        .detail("reference", percent, |(case, _)| case.reference_error)
        .column("solver", TEXT, |(_, solver)| solver.solver.as_str())
        .column("found", PLAIN.digits(1), |(_, solver)| solver.count_found)
        .column("true", PLAIN.digits(0), |(_, solver)| solver.count_true)
        .column("error", MM.digits(2), |(_, solver)| solver.position_error_m)
        .column("conductance", Format::new("S", "s"), conductance_s)
        .column("time", US, |(_, solver)| solver.frame_us)
        .note("Differences are over the largest reading or impedance.")
        .data();
    View::new("Models and solvers against reference cases", "").with(table)
}
