//! `tactomo-lab ablate`: what each threshold is worth.

use serde::Serialize;
use tactomo_cli::output::message;
use tactomo_study::view::{Format, MM, PERCENT, PLAIN, TEXT, Table, View};
use tactomo_touch::solve::{Threshold, thresholds};

use super::shown::Shown;
use crate::ablate::{self, Change, Figures, Plan};

/// Solves the same readings with each threshold of `policy` larger and smaller, and tells what that changes.
///
/// A threshold that changes nothing is not needed for these scenes. Those of rows, of images and of
/// exchanged wires are hardly read by them.
///
/// Examples:
///   tactomo-lab ablate
///   tactomo-lab ablate --threshold fewer_nats --factor 0 --factor 4 --seed 7
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Threshold; give it again for more [default: all]
    #[arg(long, value_name = "NAME", value_parser = threshold)]
    threshold: Vec<&'static Threshold>,
    /// What it is multiplied by; give it again for more
    #[arg(long, default_values_t = [0.5, 2.0], value_parser = tactomo_cli::options::number("a factor", 0.0..=1e6))]
    factor: Vec<f64>,
    /// Random scenes that are found cold
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u32).range(5..=1_000_000))]
    scenes: u32,
    /// Frames of each scene that is followed, at 250 frames/s
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u16).range(2..))]
    frames: u16,
    /// Seed of scenes, noise and the detector as built
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    shown: Shown,
}

fn threshold(name: &str) -> Result<&'static Threshold, String> {
    let found = thresholds().iter().find(|threshold| threshold.name == name);
    let names = || thresholds().iter().map(|threshold| threshold.name).collect::<Vec<_>>().join(", ");
    found.copied().ok_or_else(|| format!("no such threshold; there are {}", names()))
}

#[derive(Serialize)]
struct Report {
    usual: Figures,
    changes: Vec<Change>,
}

/// Tries all changes.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let files = args.shown.files()?;
    let plan = Plan {
        thresholds: if args.threshold.is_empty() { thresholds().to_vec() } else { args.threshold.clone() },
        factors: args.factor.clone(),
        scenes: args.scenes as usize,
        frames: usize::from(args.frames),
        seed: args.seed,
    };
    let (usual, changes) = ablate::run(&plan, &mut |step| message!("{step}"))?;
    let view = view(&usual, &changes);
    args.shown.put_out(files, &Report { usual, changes }, &[view])
}

fn view(usual: &Figures, changes: &[Change]) -> View {
    let as_it_is = Change { threshold: "as they are", found: Some(usual.clone()), ..Change::default() };
    let figure = |get: fn(&Figures) -> f64| move |change: &&Change| change.found.as_ref().map(get);
    let table = Table::of("", std::iter::once(&as_it_is).chain(changes))
        .column("threshold", TEXT, |change| change.threshold)
        .column("value", TEXT, |change| change.value)
        .column("read", PLAIN.digits(0), |change| change.reads as f64)
        .column("times", PLAIN, |change| change.factor)
        .column("others", PERCENT.digits(1), |change| change.others)
        .column("cold", PERCENT.digits(1), figure(|of| of.cold[0]))
        .column("built", PERCENT.digits(1), figure(|of| of.cold[1]))
        .column("over bound", PLAIN, figure(|of| of.over_bound[0]))
        .column("built", PLAIN, figure(|of| of.over_bound[1]))
        .column("followed", PERCENT.digits(1), figure(|of| of.followed[0]))
        .column("built", PERCENT.digits(1), figure(|of| of.followed[1]))
        .column("error", MM, figure(|of| of.error_m[0]))
        .column("built", MM, figure(|of| of.error_m[1]))
        .column("time", Format::new("s", "s").digits(1), figure(|of| of.time_s))
        .note(
            "times: the threshold was so many times as large. others: share of the answers that are not the same to the last bit. cold: random scenes with all visible contacts found and none invented; built: the same \
             on a detector as built of which the description is known. over bound: 90 % of errors of places, cold, are below so many of their bounds. followed: share of the time in which scenes are right; error: mean of \
             their median errors.",
        )
        .data();
    View::new("What thresholds are worth", "").with(table)
}
