//! `tactomo calibrate rub`: a detector as it was built, from a finger rubbed over it.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use tactomo::board::identity;
use tactomo::calibrate::{Frame, HeldOut, Rub, RubSettings, rub};
use tactomo::date::today;
use tactomo::detector::Detector;
use tactomo::readings::{Readings, Rounds};
use tactomo::solve::Method;

use super::known::{KnownPlace, check_places, check_used, places};
use super::{Reading, Source};
use crate::commands::reconstruct::reader::{Input, Reader};
use tactomo_cli::choice::Model;
use tactomo_cli::output::{self, NewFile, message};

/// Finds the detector that was built, from one finger rubbed over it: half a minute, everywhere, now light and now firm.
///
/// Nobody needs to know where the finger was: each press shows the detector, wherever it is. FILE
/// is a recording, or a table of readings with a press a row (see `reconstruct`); without it, the
/// board on --port or the simulated one is recorded first, and the recording is kept beside the
/// result. Frames of several fingers, and electrodes that are broken, are left out. Presses at
/// known places fix what rubbing cannot tell: which way round the sensor lies.
///
/// Examples:
///   tactomo calibrate rub --port /dev/ttyUSB0 --detector my.toml --out my-cal.toml
///   tactomo calibrate rub --simulate --as-built 3 --seconds 30 --out cal.toml
///   tactomo calibrate rub rub.tactomo --out my-cal.toml --json
///   tactomo calibrate rub presses.csv --known 1:-20,-20 --known 2:20,-20 --known 3:20,20 --out my-cal.toml
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(flatten)]
    source: Source,
    /// A press at a known place: the row of a table, from 1, or the time in a recording (s); x and y from the sensor's middle (mm)
    #[arg(long, value_name = "ROW:X,Y", allow_hyphen_values = true)]
    known: Vec<KnownPlace>,
    /// Presses at known places from a table: columns `row`, from 1, or `time_s`, and `x_m` and `y_m`
    #[arg(long, value_name = "FILE")]
    places: Option<PathBuf>,
    /// Most presses that are fitted
    #[arg(long, value_name = "PRESSES", default_value_t = RubSettings::default().presses, value_parser = most)]
    presses: usize,
    #[command(flatten)]
    reading: Reading,
    /// The detector file to write; a file that exists is not replaced
    #[arg(long, value_name = "CAL.toml")]
    out: PathBuf,
    /// Prints `{detector, out, presses, place_error_m, held_out, helped, missing, parameters, wires, left_out, ...}` as JSON
    #[arg(long)]
    json: bool,
}

/// Fits the detector and writes it.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let out = NewFile::new(&args.out)?;
    let what = "rub one fingertip over the whole sensor, now light and now firm";
    let file = args.source.file(&args.out, what)?;
    let (nominal, board, frames) = frames(args, &file)?;
    let begin = Instant::now();
    let settings = RubSettings { presses: args.presses, ..RubSettings::default() };
    let found = rub(&nominal, &frames, &settings, &mut |step| {
        message!(
            "fitting detector and presses: step {}, residual {:.2} x noise",
            step.iteration,
            step.chi_square.sqrt()
        );
        true
    });
    let mut found = found.with_context(|| file.display().to_string())?;
    if let Some(calibration) = &mut found.detector.calibration {
        calibration.board = board;
        calibration.date = today();
    }
    super::write(&found.detector, &args.out, out)?;
    let report = Report::of(&found, args, frames.len(), begin.elapsed());
    message!("{}", report.table(&found));
    if args.json {
        output::print(&serde_json::to_string(&report)?)?;
    }
    Ok(())
}

/// The description, the board's identity, and the frames of a file.
fn frames(args: &Args, file: &std::path::Path) -> anyhow::Result<(Detector, Option<String>, Vec<Frame>)> {
    let mut reader = Reader::open(&Input {
        file,
        detector: &args.source.detector,
        model: Model::Auto,
        solver: Some(Method::Tikhonov),
        lambda: None,
        taught: None,
        rest: args.reading.rest,
        unit: args.reading.unit.given(),
        force: None,
        uncorrected: true,
        keeps_found: false,
    })?;
    let nominal = reader.measured().cloned().context("a rub needs a detector")?;
    let board = reader.board().map(identity::identity);
    let (electrodes, is_recording) = (nominal.electrodes.len(), reader.is_recording());
    let mut known = args.known.clone();
    if let Some(path) = &args.places {
        known.extend(places(path, is_recording)?);
    }
    if !known.is_empty() {
        reader.ensure_every_row()?;
    }
    let (mut frames, mut rounds) = (Vec::new(), Rounds::default());
    let mut used = vec![false; known.len()];
    while let Some(frame) = reader.next_frame()? {
        let at = if is_recording { frame.time_s.unwrap_or(0.0) } else { (frames.len() + 1) as f64 };
        let is_at = |known: &&(usize, &KnownPlace)| known.1.is_at(at, is_recording);
        let place = known.iter().enumerate().collect::<Vec<_>>().iter().find(is_at).map(|(index, place)| {
            used[*index] = true;
            place.at_m
        });
        let readings = frame.readings().filter(|readings| readings.electrodes() == electrodes);
        let readings = readings.with_context(|| reader.place())?;
        let whole = rounds.add(&readings, frame.time_s.unwrap_or_default()).filter(Readings::is_whole);
        frames.extend(whole.map(|readings| Frame { readings, known_m: place }));
    }
    let left_out = rounds.waiting();
    if left_out as usize > frames.len() {
        bail!(
            "{}: {left_out} frames hold some grounds only, and a rub needs all: record whole frames, without `--scan`",
            file.display()
        );
    }
    if left_out > 0 {
        message!("{left_out} frames of some grounds are left out, which make no whole one");
    }
    reader.warn();
    let unused = known.iter().zip(&used).find(|(_, used)| !**used).map(|(known, _)| known);
    check_used(file, unused, is_recording)?;
    check_places(&known, &nominal)?;
    Ok((nominal, board, frames))
}

fn most(text: &str) -> Result<usize, String> {
    let count = text.parse::<usize>().ok().filter(|count| (4..=2000).contains(count));
    count.ok_or_else(|| "a number from 4 to 2000".to_owned())
}

/// What is told of a calibration.
#[derive(serde::Serialize)]
struct Report {
    detector: String,
    out: String,
    frames: usize,
    touched: usize,
    single: usize,
    presses: usize,
    known: usize,
    /// Residual over noise and model error, root mean square.
    residual: f64,
    /// Expected standard error of places (m).
    place_error_m: f64,
    /// Places and their standard errors (m).
    place_errors_m: Vec<[f64; 3]>,
    /// Of presses that were not used, before and after; none where there are too few.
    held_out: Option<ReportedHeldOut>,
    /// Whether they say that it has helped.
    helped: bool,
    /// What the rub is missing.
    missing: Vec<String>,
    wires: Option<Vec<usize>>,
    left_out: Vec<usize>,
    parameters: Vec<ReportedParameter>,
    seconds: f64,
}

#[derive(serde::Serialize)]
struct ReportedHeldOut {
    presses: usize,
    /// Over the noise of a frame, median.
    residual_before: f64,
    residual_after: f64,
    /// Expected standard error of places (m).
    place_error_before_m: f64,
    place_error_after_m: f64,
}

impl From<HeldOut> for ReportedHeldOut {
    fn from(HeldOut { presses, residuals, place_errors_m, .. }: HeldOut) -> Self {
        let ([residual_before, residual_after], [place_error_before_m, place_error_after_m]) =
            (residuals, place_errors_m);
        Self { presses, residual_before, residual_after, place_error_before_m, place_error_after_m }
    }
}

#[derive(serde::Serialize)]
struct ReportedParameter {
    parameter: String,
    standard_error: f64,
    left_at_prior: bool,
}

impl Report {
    fn of(found: &Rub, args: &Args, frames: usize, took: Duration) -> Self {
        let known = found.detector.calibration.iter().flat_map(|calibration| &calibration.parameters);
        Self {
            detector: found.detector.name.clone(),
            out: args.out.display().to_string(),
            frames,
            touched: found.touched,
            single: found.single,
            presses: found.presses,
            known: found.known,
            residual: found.chi_square[1].sqrt(),
            place_error_m: found.place_error_m(),
            place_errors_m: found.place_errors_m.iter().map(|([x, y], error_m)| [*x, *y, *error_m]).collect(),
            held_out: found.held_out.map(ReportedHeldOut::from),
            helped: found.helped(),
            missing: found.missing.iter().map(ToString::to_string).collect(),
            wires: found.wires.clone(),
            left_out: found.left_out.clone(),
            parameters: known
                .map(|known| ReportedParameter {
                    parameter: known.parameter.to_string(),
                    standard_error: known.standard_error,
                    left_at_prior: known.is_prior,
                })
                .collect(),
            seconds: took.as_secs_f64(),
        }
    }

    /// What presses that were not used say of it, what is missing, and whether to use it.
    fn worth(&self) -> Vec<String> {
        let mut lines = Vec::new();
        if let Some(held_out) = &self.held_out {
            lines.push(format!(
                "{} presses that were not used: residual {:.2} x noise before, {:.2} after; places known to {:.2} mm before, {:.2} after",
                held_out.presses,
                held_out.residual_before,
                held_out.residual_after,
                1e3 * held_out.place_error_before_m,
                1e3 * held_out.place_error_after_m
            ));
        }
        if !self.missing.is_empty() {
            lines.push(format!("it would be better still: {}", self.missing.join("; ")));
        }
        lines.push(match (self.helped, &self.held_out) {
            (true, _) => format!("written to {0}: use it with --detector {0}", self.out),
            (false, Some(_)) => format!(
                "warning: that has not helped, so it is not recommended: keep the description, and rub again; written to {} all the same",
                self.out
            ),
            (false, None) => format!(
                "warning: there are too few presses to hold some out, so nothing says whether it helps: rub for longer; written to {}",
                self.out
            ),
        });
        lines
    }

    /// For a person.
    fn table(&self, found: &Rub) -> String {
        let detector = &found.detector;
        let error = |name: &str| self.parameters.iter().find(|known| known.parameter == name);
        let share = |name: &str| match error(name) {
            Some(known) if known.left_at_prior => "as described: the readings do not tell".to_owned(),
            Some(known) => format!("+- {:.0} %", 100.0 * known.standard_error),
            None => "taken as exact".to_owned(),
        };
        let [first, last] = [detector.layers.first(), detector.layers.last()];
        let ratio = first.zip(last).map_or(1.0, |(bottom, top)| top.top_s_per_m / bottom.bottom_s_per_m);
        let mut lines = vec![
            format!(
                "{} of {} touched frames have a single contact; {} presses were fitted in {:.1} s, residual {:.2} x noise",
                self.single, self.touched, self.presses, self.seconds, self.residual
            ),
            format!("thickness {:.2} mm {}", 1e3 * detector.thickness_m(), share("thickness")),
            format!("top over bottom {ratio:.2} {}", share("top-over-bottom")),
            format!(
                "places of a press are expected within {:.2} mm (one standard error, median over the sensor)",
                1e3 * self.place_error_m
            ),
        ];
        if let Some(wires) = &self.wires {
            let moved = wires.iter().enumerate().filter(|(channel, electrode)| channel != *electrode);
            let told: Vec<_> =
                moved.map(|(channel, electrode)| format!("{channel} is at electrode {electrode}")).collect();
            lines.push(format!("wires are exchanged, and taken as they are: channel {}", told.join(", ")));
        }
        if !self.left_out.is_empty() {
            lines
                .push(format!("electrodes {:?} are broken or contradict the others, and were left out", self.left_out));
        }
        if self.known == 0 {
            lines.push(
                "no press at a known place: the sensor may be taken for turned or mirrored; --known fixes that"
                    .to_owned(),
            );
        }
        lines.extend(self.worth());
        lines.join("\n")
    }
}
