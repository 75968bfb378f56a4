//! `tactomo-lab learn`: places and strengths of presses, learned from presses at known places.

use std::path::PathBuf;

use anyhow::{Context, ensure};
use serde::Serialize;
use tactomo_physics::detector::{Chosen, Detector};
use tactomo_study::stopwatch::timed;
use tactomo_touch::learned::Learned;
use tactomo_touch::solve::{Kernel, Presses, Strength};

use tactomo_cli::output::{self, NewFile, message};

/// Learns where and how hard something presses, from presses at known places: on any sensor, with any number of channels and any
/// pattern of drive and read.
///
/// PRESSES is CSV with named columns: `x_m`, `y_m`, perhaps `z_m`, and perhaps `force_n`, `depth_m` or
/// `conductance_s`, the first of which is learned too. All other columns are channels (V, less
/// those at rest), but for those that count or tell the time (such as `id`, `press_id`, `frame`,
/// `time_s`), those in a unit that no reading has (such as `..._mm`, `..._n`, `..._deg`), and forces and poses (`Fz`, `roll`). Or NPZ, with arrays of
/// these names, a number a press, and `readings_v`, a row a press. Some hundreds of presses are good.
///
/// Rows at one place, or with one number in a column `press`, are of one press. What is learned is told with its error on presses that are left out whole, one
/// after the other, and
/// with that of guessing the middle of all presses each time; where it is no better, it says so.
///
/// Examples:
///   tactomo-lab learn presses.csv --out sensor.safetensors
///   tactomo-lab learn presses.npz --detector my-cal.toml --out mine.safetensors --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Presses at known places
    #[arg(value_name = "PRESSES")]
    presses: PathBuf,
    /// The file to write, for --learned and `score`; a file that exists is not replaced
    #[arg(long, value_name = "MODEL")]
    out: PathBuf,
    /// The detector, if the channels are its readings, row by row: then the force is taken out of them before places are learned
    #[arg(long, value_name = "NAME|FILE")]
    detector: Option<Chosen>,
    /// Prints `{presses, rows, channels, description, components, left_out_m, middle_m, no_better_than_middle, strength, left_out_strength_share, seconds, out}` as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report {
    presses: usize,
    rows: usize,
    channels: usize,
    description: &'static str,
    components: usize,
    left_out_m: f64,
    middle_m: Option<f64>,
    no_better_than_middle: bool,
    strength: Option<&'static str>,
    left_out_strength_share: Option<f64>,
    seconds: f64,
    out: PathBuf,
}

/// Learns, and writes what was learned.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let out = NewFile::new(&args.out)?;
    let mut presses = Presses::read(&args.presses, &[])?;
    if let Some(chosen) = &args.detector {
        presses.drive_v = Some(drive_v(&chosen.get()?, presses.channels)?);
    }
    let (kernel, taken) = timed(|| Kernel::train(&presses));
    let (kernel, seconds) = (kernel.with_context(|| args.presses.display().to_string())?, taken.as_secs_f64());
    out.write(Learned::bytes_of(&kernel)?)?;
    if !presses.others.is_empty() {
        let others: Vec<_> = presses.others.iter().map(|name| name.escape_debug().to_string()).collect();
        message!("columns that are taken for no channels: {}", others.join(", "));
    }
    message!("{}", kernel.sentence());
    message!("{} written, after {seconds:.1} s of processor time", args.out.display());
    if args.json {
        output::print(&serde_json::to_string(&Report {
            presses: kernel.presses(),
            rows: kernel.rows(),
            channels: kernel.channels(),
            description: kernel.description().name(),
            components: kernel.components(),
            left_out_m: kernel.left_out_m(),
            middle_m: kernel.middle_m(),
            no_better_than_middle: kernel.is_no_better_than_middle(),
            strength: kernel.strength().map(Strength::name),
            left_out_strength_share: kernel.left_out_strength(),
            seconds,
            out: args.out.clone(),
        })?)?;
    }
    Ok(())
}

/// Drive voltage of a detector with so many readings (V).
fn drive_v(detector: &Detector, channels: usize) -> anyhow::Result<f64> {
    let electrodes = detector.electrodes.len();
    ensure!(
        channels == electrodes * electrodes,
        "the presses have {channels} channels, but the detector {} with its {electrodes} electrodes gives {} readings: leave out --detector, \
         or give all of them",
        detector.name,
        electrodes * electrodes
    );
    Ok(detector.drive_v)
}
