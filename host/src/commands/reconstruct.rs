//! `tactomo reconstruct`: touch from readings in a file.

mod by_board;
mod checks;
mod opened;
pub mod reader;
pub mod units;
pub mod writer;

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use tactomo::changes::Changes;
use tactomo::schema::FrameReport;
use tactomo::solve::{Lambda, Method};

use self::reader::{Input, Reader, Taught};
use self::units::UnitArgs;
use self::writer::Writer;
use tactomo_cli::choice::{self, DetectorArgs, Model};
use tactomo_cli::output::message;

/// Finds contacts and images in a recording, or in a table of readings (CSV, NPY or NPZ).
///
/// A table has one frame per row: the readings in volts, electrode by electrode for each
/// grounded electrode, 256 for 16 electrodes. An array may also be frames x 16 x 16; in an NPZ
/// file it is called readings_v. The baseline, the mean of the first frames, is subtracted: see
/// --rest.
///
/// Examples:
///   tactomo reconstruct touch.tactomo --solver nonlinear --json
///   tactomo reconstruct readings.csv --unit mV --detector square-60 --solver tikhonov --lambda gcv
///   tactomo reconstruct arduino.csv --adc 10,5 --rest 10
///   tactomo reconstruct readings.npz --rest 10 --out contacts.csv
///   tactomo reconstruct touch.tactomo --solver tikhonov --images --out images.npz
///   tactomo reconstruct touch.csv --learned mine.safetensors --json
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
    /// Solver [default: auto; with --presses or --learned, what they teach]
    #[arg(long, value_name = "NAME", value_parser = choice::method())]
    solver: Option<Method>,
    /// Lambda of tikhonov, tikhonov-paper, noser or laplace: a share of the largest singular value, or a rule that chooses it for
    /// each frame
    #[arg(long, value_name = "SHARE|discrepancy|l-curve|gcv")]
    lambda: Option<Lambda>,
    /// Presses at known places to learn from first, of any sensor: a file as `tactomo-lab learn` takes it
    #[arg(long, value_name = "FILE", conflicts_with_all = ["detector", "material", "model", "lambda", "images"])]
    presses: Option<PathBuf>,
    /// What `tactomo-lab learn` has learned, of any sensor, or a network that was trained for the detector
    #[arg(long, value_name = "MODEL", conflicts_with_all = ["presses", "lambda"])]
    learned: Option<PathBuf>,
    /// Frames at the start whose mean is the baseline, whatever they are, and which are not solved [default: of a recording, the baseline that live takes; of a
    /// table, none]
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(0..=100_000))]
    rest: Option<u32>,
    #[command(flatten)]
    unit: UnitArgs,
    /// Writes images too, of solvers that make images
    #[arg(long)]
    images: bool,
    /// Prints each frame as a JSON object: `{frame, sequence, time_s, lost_before, frame_us, contacts, shape?, residual, flags, choice}`
    #[arg(long)]
    json: bool,
    /// Writes a file: one contact a row (.csv), arrays (.npz), or one frame a line (.json, .jsonl)
    #[arg(long, value_name = "FILE", conflicts_with = "json")]
    out: Option<PathBuf>,
}

impl Args {
    fn input(&self) -> Input<'_> {
        let presses = self.presses.as_deref().map(Taught::Presses);
        let taught = presses.or(self.learned.as_deref().map(Taught::Learned));
        Input {
            file: &self.file,
            detector: &self.detector,
            model: self.model,
            solver: self.solver,
            lambda: self.lambda,
            taught,
            rest: self.rest,
            unit: self.unit.given(),
            force: None,
            uncorrected: false,
            keeps_found: true,
        }
    }
}

/// Solves all frames.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let mut reader = Reader::open(&args.input())?;
    let mut writer = Writer::new(args)?;
    let (mut times_us, mut changes) = (Vec::new(), Changes::default());
    while let Some(frame) = reader.next_frame()? {
        let begin = Instant::now();
        let solved = reader.solve(&frame);
        let frame_us = begin.elapsed().as_secs_f64() * 1e6;
        let solution = solved.with_context(|| reader.place())?;
        times_us.push(frame_us);
        let changed = changes.take(&solution.contacts);
        let report = FrameReport {
            contacts: &changed.contacts,
            ended: &changed.ended,
            frame: Some(reader.frame() as u64),
            sequence: frame.sequence,
            time_s: frame.time_s,
            lost_before: Some(frame.lost_before),
            frame_us: Some(frame_us),
            image_s_per_m2: solution.image_s_per_m2.as_deref().filter(|_| args.images),
            ..FrameReport::of(&solution)
        };
        if !writer.write(&report)? {
            // Whoever read this has seen enough.
            return Ok(());
        }
    }
    writer.finish(reader.mesh(), None)?;
    message!("{}", sentence(&reader, &mut times_us));
    if let Some(notice) = reader.notice() {
        message!("{notice}");
    }
    reader.warn();
    Ok(())
}

/// What was done, in a line.
fn sentence(reader: &Reader, times_us: &mut [f64]) -> String {
    times_us.sort_by(f64::total_cmp);
    let name = reader.name();
    match times_us {
        [] => format!("no frames to solve: all {} are baseline (see --rest)", reader.count()),
        _ => {
            let at = |share: usize| times_us[(times_us.len() - 1) * share / 100];
            format!("{name}: {} frames, median {:.1} us a frame, p99 {:.1} us", times_us.len(), at(50), at(99))
        }
    }
}
