//! `tactomo-lab live`: what live shows of every scene.

use std::time::Duration;

use serde::Serialize;
use tactomo::run::scanning::ScanChoice;
use tactomo_board::simulated::BoardModel;
use tactomo_cli::choice;
use tactomo_cli::options;
use tactomo_cli::output::message;
use tactomo_physics::scene::SceneName;
use tactomo_study::view::{Format, MM, PERCENT, PLAIN, TEXT, Table, US, View};
use tactomo_touch::solve::Method;

use super::shown::Shown;
use crate::live::{Case, Found};

/// Runs scenes live behind a simulated board, and holds every answer against what truly touches.
///
/// Scenes press from the first frame on. Each runs in real time; let nothing else run meanwhile. What comes of a run is told when it ends, and a run
/// that fails does not end the others.
///
/// Examples:
///   tactomo-lab live
///   tactomo-lab live --scene ring --scene hand --as-built 3 --as-built 7 --seconds 10
///   tactomo-lab live --scene several --scan whole --scan adaptive --busy 3 --json
///   tactomo-lab live --scene single --as-built 1 --as-built 2 --top-over-bottom 2.5 --no-learning
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// What touches; give it again for more [default: all scenes but rest]
    #[arg(long, value_name = "NAME")]
    scene: Vec<SceneName>,
    /// Which board is simulated; give it again for more [default: esp32; of more than 16 electrodes ideal]
    #[arg(long, value_name = "NAME")]
    board: Vec<BoardModel>,
    /// Which rows the board scans: whole, four, adaptive, or grounds; give it again for more [default: whole]
    #[arg(long, value_name = "SCAN")]
    scan: Vec<ScanChoice>,
    /// Simulates detectors as built, drawn with this seed, besides the one described; give it again for more
    #[arg(long, value_name = "SEED")]
    as_built: Vec<u64>,
    /// Draws those with the top conducting better than the bottom by so many standard deviations of that tolerance, below 0 worse:
    /// where a single contact was taken for two, it was by 1.4 to 2.9
    #[arg(long, value_name = "DEVIATIONS", requires = "as_built", allow_negative_numbers = true, value_parser = options::number("standard deviations", -5.0..=5.0))]
    top_over_bottom: Option<f64>,
    /// Leaves out the detector as it is described
    #[arg(long, requires = "as_built")]
    only_built: bool,
    /// Solver
    #[arg(long, value_name = "NAME", value_parser = choice::method(), hide_possible_values = true, default_value = "auto")]
    solver: Method,
    /// How long each runs (s)
    #[arg(long, value_name = "SECONDS", default_value = "6", value_parser = options::seconds)]
    seconds: Duration,
    /// Threads beside it that do nothing but keep cores busy
    #[arg(long, default_value_t = 0, value_name = "COUNT")]
    busy: u8,
    /// Takes the detector as it is described, learning nothing from what presses
    #[arg(long)]
    no_learning: bool,
    /// Answers the same bytes once more, frame by frame, however long that takes: then how often that is right stands beside
    #[arg(long)]
    offline: bool,
    /// Seed of places and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    shown: Shown,
}

#[derive(Serialize)]
struct Report {
    runs: Vec<Found>,
}

/// Runs all cases, one after the other.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let files = args.shown.files()?;
    let cases = cases(args);
    cases.iter().try_for_each(Case::check)?;
    let (mut runs, mut failed) = (Vec::with_capacity(cases.len()), 0);
    for (index, case) in cases.iter().enumerate() {
        let what = match case.run() {
            Ok(found) => {
                let right = format!("right {:.0} %", 100.0 * found.scored.right);
                runs.push(found);
                right
            }
            // An hour of runs is not lost by one of them.
            Err(error) => {
                failed += 1;
                format!("failed: {error:#}")
            }
        };
        message!("{} of {}: {case}: {what}", index + 1, cases.len());
    }
    let view = view(&runs);
    args.shown.put_out(files, &Report { runs }, &[view])?;
    anyhow::ensure!(failed == 0, "{failed} of {} runs failed; what they ended with is said above", cases.len());
    Ok(())
}

fn cases(args: &Args) -> Vec<Case> {
    let all = || SceneName::ALL.into_iter().filter(|scene| *scene != SceneName::Rest).collect();
    let scenes: Vec<_> = if args.scene.is_empty() { all() } else { args.scene.clone() };
    let boards = if args.board.is_empty() { vec![None] } else { args.board.iter().copied().map(Some).collect() };
    let scans = if args.scan.is_empty() { vec![ScanChoice::Whole] } else { args.scan.clone() };
    let described = (!args.only_built).then_some(None);
    let detectors: Vec<_> = described.into_iter().chain(args.as_built.iter().copied().map(Some)).collect();
    let mut cases = Vec::new();
    for scene in scenes {
        for board in &boards {
            for scan in &scans {
                cases.extend(detectors.iter().map(|built| Case {
                    scene,
                    board: *board,
                    scan: scan.clone(),
                    built: *built,
                    top_over_bottom: args.top_over_bottom,
                    method: args.solver,
                    seed: args.seed,
                    time: args.seconds,
                    busy: args.busy,
                    learns: !args.no_learning,
                    offline: args.offline,
                }));
            }
        }
    }
    cases
}

fn view(runs: &[Found]) -> View {
    let seconds = Format::new("s", "s").digits(2);
    let table = Table::of("", runs.iter())
        .column("scene", TEXT, |run| run.scene.as_str())
        .column("detector", TEXT, |run| run.detector.as_str())
        .column("board", TEXT, |run| run.board)
        .column("scan", TEXT, |run| run.scan.as_str())
        .column("right", PERCENT.digits(0), |run| run.scored.right)
        .column("offline", PERCENT.digits(0), |run| run.offline_right)
        .column("or named", PERCENT.digits(0), |run| run.scored.named)
        .column("first right", seconds, |run| run.scored.first_right_s)
        .column("error", MM.digits(2), |run| run.scored.error_m)
        .column("p95", MM.digits(2), |run| run.scored.error_p95_m)
        .column("late", MM.digits(2), |run| run.scored.late_error_m)
        .column("invented", PERCENT.digits(0), |run| run.scored.invented)
        .column("doubtful", PERCENT.digits(0), |run| run.scored.doubtful)
        .column("ids lost", PLAIN.digits(0), |run| run.scored.id_changes as f64)
        .column("gap", seconds, |run| run.scored.gap_s)
        .column("age p99", US, |run| run.age_p99_us)
        .column("learned", seconds, |run| run.learned_s)
        .note(
            "right: share of the time with as many contacts as touch, none off by more than 15 % of the distance of electrodes, or the right shape; offline: where the same bytes are answered frame by frame. or named: and with an answer that names that number as one it may be. error: of places, median; late: in the last third. \
             invented, doubtful: shares of the answers. gap: longest time without an answer. learned: when what presses taught was first used.",
        )
        .data();
    View::new("What live shows", "").with(table)
}
