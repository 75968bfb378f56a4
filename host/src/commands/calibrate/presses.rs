//! `tactomo calibrate presses`: what no parameter of a detector explains, from presses at known places.

mod gather;
mod report;

use std::path::PathBuf;

use anyhow::{Context, ensure};
use tactomo::calibrate::known::correction;
use tactomo::detector::Detector;

use self::gather::{Known, gather};
use self::report::Report;
use super::known::{KnownPlace, check_places, places_or_order};
use super::{Reading, Source};
use tactomo_cli::output::{self, NewFile, message};

/// Corrects places by presses at known ones, as far as these show errors that run smoothly over the sensor: 16 to 25 are good.
///
/// FILE is a recording, or a table of readings with a press a row (see `reconstruct`). Places
/// are marked on a printed sheet, or a robot's; a table of them without `row` or `time_s` is in
/// the order of the presses, each held for a second and lifted before the next. Where forces are
/// known too (a column `force_n`) and the detector has a law of force, conductances are corrected
/// alike. If the presses show nothing but noise, nothing is corrected. Presses that the detector's
/// file holds already count with the new ones. Best after `calibrate rub`.
///
/// Examples:
///   tactomo calibrate presses sheet.tactomo --detector my-cal.toml --places sheet.csv --out my-places.toml
///   tactomo calibrate presses --port /dev/ttyUSB0 --detector my-cal.toml --places sheet.csv --out my-places.toml
///   tactomo calibrate presses rows.csv --known 1:-20,-20 --known 2:20,-20 --known 3:0,20 --out my-places.toml --json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
#[command(group(clap::ArgGroup::new("wanted").args(["known", "places"]).required(true).multiple(true)))]
pub struct Args {
    #[command(flatten)]
    source: Source,
    /// Where a press is: the row of a table, from 1, or the time in a recording (s); x and y from the sensor's middle (mm)
    #[arg(long, value_name = "ROW:X,Y", allow_hyphen_values = true)]
    known: Vec<KnownPlace>,
    /// The same from a table: columns `x_m` and `y_m`, `row`, from 1, or `time_s`, or else in the order of the presses; and `force_n` if that is known
    #[arg(long, value_name = "FILE")]
    places: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    /// The detector file to write; a file that exists is not replaced
    #[arg(long, value_name = "CAL.toml")]
    out: PathBuf,
    /// Prints `{detector, out, before_m, left_out_m, place, conductance, as_presses_come, presses, skipped, ...}` as JSON
    #[arg(long)]
    json: bool,
}

/// Finds the correction and writes the detector with it.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let out = NewFile::new(&args.out)?;
    ensure!(
        !args.source.board.is_simulated(),
        "the scenes of the simulated board press no known places: give a FILE of presses (`tactomo forward --measured` simulates rows), or --port"
    );
    let what = "press the known places one after the other, each for a second, and lift the tip between them";
    let file = args.source.file(&args.out, what)?;
    let gathered = gather(args, &file)?;
    for skipped in &gathered.skipped {
        message!("{} is left out: {}", skipped.place, skipped.why());
    }
    if let Some(notice) = &gathered.notice {
        message!("{notice}");
    }
    let mut told_head = false;
    let found = correction(&gathered.detector, &gathered.all(), &mut |progress| {
        if !told_head {
            message!("{:>7}  mean error of the rest", "presses");
        }
        told_head = true;
        message!(
            "{:>7}  {:.2} mm as found, {:.2} mm corrected",
            progress.presses,
            1e3 * progress.before_m,
            1e3 * progress.after_m
        );
    });
    let found = found.with_context(|| file.display().to_string())?;
    let detector = Detector { correction: found.correction.clone(), ..gathered.detector.clone() };
    super::write(&detector, &args.out, out)?;
    let report = Report::of(&gathered, &found, &args.out);
    message!("{}", report.table());
    if args.json {
        output::print(&serde_json::to_string(&report)?)?;
    }
    Ok(())
}

/// The places that are told for the presses of a file.
fn known(args: &Args, is_recording: bool, detector: &Detector) -> anyhow::Result<Known> {
    let mut places = args.known.clone();
    let mut is_in_order = false;
    if let Some(path) = &args.places {
        let (told, is_order) = places_or_order(path, is_recording)?;
        ensure!(
            !is_order || places.is_empty(),
            "{}: its places are in the order of the presses, so that --known has none left: leave out --known, or give it a column {}",
            path.display(),
            if is_recording { "time_s" } else { "row" }
        );
        (places, is_in_order) = ([places, told].concat(), is_order);
    }
    check_places(&places, detector)?;
    let mut sorted: Vec<f64> = places.iter().map(|place| place.at).collect();
    sorted.sort_by(f64::total_cmp);
    if let Some(twice) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        anyhow::bail!("two places are told for the press at {}: give each row or time once", twice[0]);
    }
    Ok(Known { places, is_in_order })
}
