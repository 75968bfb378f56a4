//! Presses of a file with their forces: what the solver `contacts` finds in it.

use anyhow::{Context, bail, ensure};
use tactomo::calibrate::force::{Moment, pairs};
use tactomo::calibrate::pressed::{Pressed, Solved, pressed};
use tactomo::detector::{Detector, ForceLaw};
use tactomo::solve::Method;

use super::PressArgs;
use super::known::{Known, KnownForce};
use super::report::ReportedPress;
use crate::commands::calibrate::solved;
use crate::commands::reconstruct::reader::{Input, Reader};
use tactomo_cli::choice::Model;

/// What to do where several contacts are found.
const ONE_TIP: &str =
    "press with one tip; or the detector is not as it is described: `tactomo detector show` says how that is";

/// Presses, and the detector that they were made on.
pub struct Gathered {
    /// The detector as it was chosen.
    pub detector: Detector,
    /// The presses.
    pub presses: Vec<ReportedPress>,
}

/// Reads a file and gives its presses their forces.
pub fn gather(args: &PressArgs, known: &Known) -> anyhow::Result<Gathered> {
    let mut reader = Reader::open(&Input {
        file: &args.file,
        detector: &args.detector,
        model: Model::Auto,
        solver: Some(Method::Contacts),
        lambda: None,
        taught: None,
        rest: args.reading.rest,
        unit: args.reading.unit.given(),
        force: Some(ForceLaw::siemens()),
        uncorrected: false,
        keeps_found: false,
    })?;
    let presses = match (reader.is_recording(), known) {
        (true, Known::Presses(forces)) => of_plateaus(&mut reader, forces)?,
        (true, Known::Sensor(forces)) => of_sensor(&mut reader, forces)?,
        (false, Known::Presses(forces)) => of_rows(&mut reader, forces)?,
        (false, Known::Sensor(_)) => bail!(
            "{}: a table of readings has no times that a force sensor's could belong to: give --forces a file without time_s, \
             with a force a row, or record the readings",
            args.file.display()
        ),
    };
    let detector = reader.detector().cloned().context("presses need a detector")?;
    Ok(Gathered { detector, presses })
}

/// Solves all frames of a recording.
fn frames(reader: &mut Reader) -> anyhow::Result<Vec<Solved>> {
    let frames = solved(reader)?;
    reader.warn();
    ensure!(
        frames.iter().any(|frame| !frame.contacts.is_empty()),
        "{}: no press in any of its {} frames: press firmer, each press for a second{}",
        reader.path().display(),
        reader.count(),
        reader.notice().map_or_else(String::new, |notice| format!(". {notice}"))
    );
    Ok(frames)
}

fn of_plateaus(reader: &mut Reader, forces: &[KnownForce]) -> anyhow::Result<Vec<ReportedPress>> {
    let frames = frames(reader)?;
    let path = reader.path().display();
    let found = pressed(&frames, forces.len(), "forces").with_context(|| path.to_string())?;
    let press = |(index, (Pressed { plateau, .. }, known)): (usize, (&Pressed, &KnownForce))| {
        let [from_s, to_s] = plateau.time_s;
        ensure!(
            plateau.contacts == 1 && plateau.conductance_s > 0.0,
            "{path}: press {} ({from_s:.1} to {to_s:.1} s) has {} contacts: {ONE_TIP}",
            index + 1,
            plateau.contacts
        );
        let place = format!("{from_s:.1} to {to_s:.1} s");
        Ok(ReportedPress { press: known.press(plateau.conductance_s, plateau.deviation_s), place })
    };
    found.iter().zip(forces).enumerate().map(press).collect()
}

fn of_sensor(reader: &mut Reader, forces: &[[f64; 2]]) -> anyhow::Result<Vec<ReportedPress>> {
    let moments: Vec<Moment> = frames(reader)?.iter().map(Solved::moment).collect();
    let found = pairs(&moments, forces);
    let span = |times: &mut dyn Iterator<Item = f64>| {
        let [from_s, to_s] =
            times.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], time_s| [low.min(time_s), high.max(time_s)]);
        format!("{from_s:.1} to {to_s:.1} s")
    };
    ensure!(
        !found.is_empty(),
        "{}: no single contact while the force sensor was pressed: contacts are from {}, the sensor is from {}; time_s counts from \
         the recording's first frame",
        reader.path().display(),
        span(&mut moments.iter().filter(|moment| moment.contacts > 0).map(|moment| moment.time_s)),
        span(&mut forces.iter().map(|[time_s, _]| *time_s))
    );
    Ok(found.into_iter().map(|press| ReportedPress { press, place: "force sensor".to_owned() }).collect())
}

fn of_rows(reader: &mut Reader, forces: &[KnownForce]) -> anyhow::Result<Vec<ReportedPress>> {
    reader.ensure_every_row()?;
    let (mut presses, mut empty) = (Vec::new(), Vec::new());
    let mut rows = 0;
    while let Some(frame) = reader.next_frame()? {
        // Rows are presses of their own, wherever and whenever they were made.
        reader.reset();
        rows += 1;
        let solution = reader.solve(&frame).with_context(|| reader.place())?;
        let place = format!("row {}", reader.count());
        match &solution.contacts[..] {
            [] => empty.push(rows),
            [contact] => {
                let [conductance_s, deviation_s] =
                    [contact.force_n, contact.force_deviation_n].map(Option::unwrap_or_default);
                let known = forces.get(rows - 1);
                presses
                    .extend(known.map(|known| ReportedPress { press: known.press(conductance_s, deviation_s), place }));
            }
            several => bail!("{}: {place} has {} contacts: {ONE_TIP}", reader.path().display(), several.len()),
        }
    }
    let path = reader.path().display();
    ensure!(
        rows == forces.len(),
        "{path}: {rows} rows of readings, but {} forces are given: one for each row, in their order; rows at rest belong to --rest",
        forces.len()
    );
    ensure!(
        empty.len() < rows,
        "{path}: no press in any of its {rows} rows: are they presses, and is the baseline taken with nothing on the detector? See --rest"
    );
    if let Some(row) = empty.first() {
        bail!(
            "{path}: press {row} ({} N) is too light to be found: leave out its row and its force, and begin with a firmer one",
            forces[row - 1].force_n
        );
    }
    reader.warn();
    Ok(presses)
}
