//! Presses of a file with their places: what the solver `contacts` finds in it.

use std::path::Path;

use anyhow::{Context, ensure};
use tactomo::calibrate::known::KnownPress;
use tactomo::calibrate::pressed::{Found, Pressed, pressed, single, standing};
use tactomo::detector::{Detector, ForceLaw};
use tactomo::solve::{FoundContact, Method};

use super::Args;
use crate::commands::calibrate::known::{KnownPlace, NEAR_S, check_used};
use crate::commands::calibrate::solved;
use crate::commands::reconstruct::reader::{Input, Reader};
use tactomo_cli::choice::Model;

/// Known places, and whether they are in the order of the presses.
pub struct Known {
    /// The places.
    pub places: Vec<KnownPlace>,
    /// Whether they are in the order of the presses; else their rows or times are told.
    pub is_in_order: bool,
}

/// Presses, and the detector that they were made on.
pub struct Gathered {
    /// The detector as it was chosen.
    pub detector: Detector,
    /// Presses that it holds already.
    pub kept: Vec<KnownPress>,
    /// New ones, with where in the file they are.
    pub presses: Vec<(String, KnownPress)>,
    /// What was left out.
    pub skipped: Vec<Skipped>,
    /// What a person should know of forces.
    pub notice: Option<String>,
}

/// A known place with no single contact.
#[derive(serde::Serialize)]
pub struct Skipped {
    /// Where in the file.
    pub place: String,
    /// How many contacts there are.
    pub contacts: usize,
}

impl Gathered {
    /// All presses.
    pub fn all(&self) -> Vec<KnownPress> {
        self.kept.iter().copied().chain(self.presses.iter().map(|(_, press)| *press)).collect()
    }
}

impl Skipped {
    /// Why, for people.
    pub fn why(&self) -> String {
        match self.contacts {
            0 => "nothing touches there".to_owned(),
            contacts => format!("it has {contacts} contacts, and only one can be at the known place"),
        }
    }
}

/// Reads a file and gives its presses their places.
pub fn gather(args: &Args, file: &Path) -> anyhow::Result<Gathered> {
    let mut reader = Reader::open(&Input {
        file,
        detector: &args.source.detector,
        model: Model::Auto,
        solver: Some(Method::Contacts),
        lambda: None,
        taught: None,
        rest: args.reading.rest,
        unit: args.reading.unit.given(),
        // Conductances with their constriction, as laws of force have them.
        force: Some(ForceLaw::siemens()),
        uncorrected: true,
        keeps_found: false,
    })?;
    let detector = reader.detector().cloned().context("presses need a detector")?;
    let known = super::known(args, reader.is_recording(), &detector)?;
    let found = match (reader.is_recording(), known.is_in_order) {
        (false, _) => of_rows(&mut reader, &known)?,
        (true, false) => of_times(&mut reader, &known)?,
        (true, true) => of_plateaus(&mut reader, &known)?,
    };
    reader.warn();
    let (mut presses, mut skipped) = (Vec::new(), Vec::new());
    for ((place, found), known) in found.into_iter().zip(&known.places) {
        match found {
            Ok(contact) => {
                let press = KnownPress::of(&contact, known.at_m, detector.force.as_ref(), known.force_n);
                presses.push((place, press));
            }
            Err(contacts) => skipped.push(Skipped { place, contacts }),
        }
    }
    let is_pressed = known.places.iter().any(|place| place.force_n.is_some());
    let notice = match (&detector.force, is_pressed) {
        (None, true) => Some(
            "forces are told, but the detector has no law of force (`calibrate force`): conductances are left alone",
        ),
        (Some(_), false) => Some("no forces are told (a column force_n): conductances are left alone"),
        _ => None,
    };
    let kept = detector.correction.as_ref().map(KnownPress::kept).unwrap_or_default();
    Ok(Gathered { detector, kept, presses, skipped, notice: notice.map(str::to_owned) })
}

/// Presses of a table, in the order of the places.
fn of_rows(reader: &mut Reader, known: &Known) -> anyhow::Result<Vec<(String, Found)>> {
    reader.ensure_every_row()?;
    let mut found: Vec<Option<Found>> = vec![None; known.places.len()];
    let mut rows = 0;
    while let Some(frame) = reader.next_frame()? {
        rows += 1;
        let at = known.places.iter().position(|place| place.at == f64::from(rows));
        if let Some(index) = at {
            // Rows are presses of their own, wherever and whenever they were made.
            reader.reset();
            let contacts = reader.solve(&frame).with_context(|| reader.place())?.contacts;
            found[index] = Some(single(&contacts));
        }
    }
    let path = reader.path();
    ensure!(
        !known.is_in_order || known.places.len() == rows as usize,
        "{}: {rows} rows of readings, but {} places are given: one for each row, in their order; rows at rest belong to --rest",
        path.display(),
        known.places.len()
    );
    let unused = known.places.iter().zip(&found).find(|(_, found)| found.is_none()).map(|(place, _)| place);
    check_used(path, unused, false)?;
    let named = |(place, found): (&KnownPlace, Option<Found>)| Some((format!("row {}", place.at), found?));
    Ok(known.places.iter().zip(found).filter_map(named).collect())
}

/// Presses of a recording at known times.
fn of_times(reader: &mut Reader, known: &Known) -> anyhow::Result<Vec<(String, Found)>> {
    let mut frames: Vec<Vec<Vec<FoundContact>>> = vec![Vec::new(); known.places.len()];
    let mut current = None;
    while let Some(frame) = reader.next_frame()? {
        let time_s = frame.time_s.with_context(|| format!("{} has no time", reader.place()))?;
        let Some(index) = known.places.iter().position(|place| place.is_at(time_s, true)) else { continue };
        if current.replace(index) != Some(index) {
            reader.reset();
        }
        frames[index].push(reader.solve(&frame).with_context(|| reader.place())?.contacts);
    }
    let unused = known.places.iter().zip(&frames).find(|(_, frames)| frames.is_empty()).map(|(place, _)| place);
    check_used(reader.path(), unused, true)?;
    let named = |(place, frames): (&KnownPlace, &Vec<Vec<FoundContact>>)| {
        (format!("{:.1} to {:.1} s", place.at - NEAR_S, place.at + NEAR_S), standing(frames.iter().map(Vec::as_slice)))
    };
    Ok(known.places.iter().zip(&frames).map(named).collect())
}

/// Presses of a recording in their order.
fn of_plateaus(reader: &mut Reader, known: &Known) -> anyhow::Result<Vec<(String, Found)>> {
    let frames = solved(reader)?;
    let presses = pressed(&frames, known.places.len(), "places");
    let presses = presses.with_context(|| reader.path().display().to_string())?;
    let named = |press: Pressed| {
        let [from_s, to_s] = press.plateau.time_s;
        (format!("{from_s:.1} to {to_s:.1} s"), press.found)
    };
    Ok(presses.into_iter().map(named).collect())
}
