//! `tactomo reconstruct`: touch from readings in a file.

mod reader;
mod writer;

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use tactomo::solve::{Lambda, Method};

use self::reader::Reader;
use self::writer::{Found, Writer};
use super::choice::{DetectorArgs, Model};

/// Reads touch from the readings in a file: a recording, or a table of numbers (CSV, NPY or NPZ).
///
/// A table has a frame a row: readings in volts, electrode by electrode for each grounded one, 256 for 16 electrodes; an array may
/// also be frames x 16 x 16. In an NPZ file it is called readings_v. From the readings, those at rest are subtracted: the mean
/// of the first frames.
///
/// Examples:
///   tactomo reconstruct touch.tactomo --solver nonlinear --json
///   tactomo reconstruct readings.csv --detector square-60 --solver tikhonov --lambda gcv
///   tactomo reconstruct readings.npz --rest 10 --out contacts.csv
///   tactomo reconstruct touch.tactomo --images --out images.npz
///   tactomo reconstruct skin.csv --solver kernel --presses taught.csv --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// A recording, or a table of readings
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    detector: DetectorArgs,
    /// Forward model
    #[arg(long, value_enum, default_value = "auto")]
    model: Model,
    /// Solver that reads the touch
    #[arg(long, value_name = "NAME", default_value = "tikhonov")]
    solver: Method,
    /// Lambda of tikhonov, tikhonov-paper, noser or laplace: a share of the largest singular value, or chosen for each frame
    #[arg(long, value_name = "SHARE|discrepancy|l-curve|gcv")]
    lambda: Option<Lambda>,
    /// Presses at known places that the solver kernel learns from, instead of simulated ones: CSV with named columns x_m, y_m,
    /// force_n or conductance_s and the channels, any number of them, or NPZ with arrays of these names and readings_v
    #[arg(long, value_name = "FILE", conflicts_with_all = ["detector", "material", "model", "lambda", "images"])]
    presses: Option<PathBuf>,
    /// Frames at the start that are the readings at rest; 32 for a recording, none for a table, unless told
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(0..=100_000))]
    rest: Option<u32>,
    /// Writes images too, where the solver makes them
    #[arg(long)]
    images: bool,
    /// Prints an object a frame as JSON: `{frame, time_s, frame_us, contacts, residual, flags, choice}`
    #[arg(long)]
    json: bool,
    /// Writes a file instead: a contact a line (.csv), arrays (.npz), or an object a frame (.json, .jsonl)
    #[arg(long, value_name = "FILE", conflicts_with = "json")]
    out: Option<PathBuf>,
}

/// Solves all frames.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let mut reader = Reader::open(args)?;
    let mut writer = Writer::new(args.out.as_deref(), args.json, args.images)?;
    let mut times_us = Vec::new();
    while let Some((time_s, readings)) = reader.next_frame()? {
        let frame = reader.frame();
        let begin = Instant::now();
        let solved = reader.solve(readings);
        let frame_us = begin.elapsed().as_secs_f64() * 1e6;
        let solution = solved.with_context(|| reader.place())?;
        times_us.push(frame_us);
        writer.write(&Found { frame, time_s, frame_us, solution })?;
    }
    writer.finish(reader.mesh())?;
    eprintln!("{}", sentence(&reader, &mut times_us));
    Ok(())
}

/// What was done, in a line.
fn sentence(reader: &Reader, times_us: &mut [f64]) -> String {
    times_us.sort_by(f64::total_cmp);
    let name = reader.name();
    match times_us {
        [] => format!("no frame to solve after {} at rest", reader.frame()),
        _ => {
            let at = |share: usize| times_us[(times_us.len() - 1) * share / 100];
            format!("{name}: {} frames, median {:.1} us a frame, p99 {:.1} us", times_us.len(), at(50), at(99))
        }
    }
}
