//! Presses of a file with their places: what the solver `contacts` finds in it.

use std::path::Path;

use anyhow::{Context, ensure};
use tactomo::calibrate::force::{Moment, plateaus};
use tactomo::calibrate::known::KnownPress;
use tactomo::detector::{Detector, ForceLaw};
use tactomo::solve::{FoundContact, Method};

use super::Args;
use crate::commands::calibrate::known::{KnownPlace, NEAR_S, check_used};
use crate::commands::reconstruct::reader::{Input, Reader};
use tactomo_cli::choice::Model;
use tactomo_cli::output::message;

/// Of a press in a recording, so much of its time in the middle is looked at: it comes before, and goes after.
const MIDDLE: f64 = 0.5;

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

/// What a solver found of a press: its only contact, or how many there are.
type Found = Result<FoundContact, usize>;

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
        unit: args.reading.unit,
        // Conductances with their constriction, as laws of force have them.
        force: Some(ForceLaw::siemens()),
        uncorrected: true,
    })?;
    let detector = reader.detector().cloned().context("presses need a detector")?;
    let known = super::known(args, reader.is_recording(), &detector)?;
    let found = match (reader.is_recording(), known.is_in_order) {
        (false, _) => of_rows(&mut reader, &known)?,
        (true, false) => of_times(&mut reader, &known)?,
        (true, true) => of_plateaus(&mut reader, &known)?,
    };
    if let Some(losses) = reader.losses() {
        message!("warning: {losses}");
    }
    let (mut presses, mut skipped) = (Vec::new(), Vec::new());
    for ((place, found), known) in found.into_iter().zip(&known.places) {
        match found {
            Ok(contact) => presses.push((place, press(&contact, known, detector.force.as_ref()))),
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

/// A contact at a known place, and what the law of force says of its conductance.
fn press(contact: &FoundContact, known: &KnownPlace, law: Option<&ForceLaw>) -> KnownPress {
    let log_conductance = || {
        let (law, force_n) = law.zip(known.force_n)?;
        let (found_s, deviation_s) = contact.force_n.zip(contact.force_deviation_n)?;
        (found_s > 0.0).then(|| [(found_s / law.conductance_s(force_n)).ln(), deviation_s / found_s])
    };
    KnownPress {
        found_m: [contact.x_m, contact.y_m],
        standard_errors_m: contact.uncertainty.map_or([0.0; 2], |claimed| [claimed.x_m, claimed.y_m]),
        known_m: known.at_m,
        log_conductance: log_conductance(),
    }
}

/// Presses of a table, in the order of the places.
fn of_rows(reader: &mut Reader, known: &Known) -> anyhow::Result<Vec<(String, Found)>> {
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

fn single(contacts: &[FoundContact]) -> Found {
    match contacts {
        [contact] => Ok(*contact),
        other => Err(other.len()),
    }
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
        (format!("{:.1} to {:.1} s", place.at - NEAR_S, place.at + NEAR_S), standing(frames))
    };
    Ok(known.places.iter().zip(&frames).map(named).collect())
}

/// The contact of frames in which something stands: the last one, which the solver knows best, if most frames have it alone.
fn standing(frames: &[Vec<FoundContact>]) -> Found {
    let alone: Vec<&FoundContact> =
        frames.iter().filter_map(|contacts| contacts.first().filter(|_| contacts.len() == 1)).collect();
    match alone.last() {
        Some(contact) if 2 * alone.len() >= frames.len() => Ok(**contact),
        _ => Err(frames.iter().map(Vec::len).filter(|contacts| *contacts != 1).max().unwrap_or(0)),
    }
}

/// Presses of a recording in their order.
fn of_plateaus(reader: &mut Reader, known: &Known) -> anyhow::Result<Vec<(String, Found)>> {
    let (mut moments, mut frames) = (Vec::new(), Vec::new());
    while let Some(frame) = reader.next_frame()? {
        let time_s = frame.time_s.with_context(|| format!("{} has no time", reader.place()))?;
        let contacts = reader.solve(&frame).with_context(|| reader.place())?.contacts;
        let first = contacts.first();
        moments.push(Moment {
            time_s,
            contacts: contacts.len(),
            conductance_s: first.and_then(|contact| contact.force_n).unwrap_or(0.0),
            deviation_s: first.and_then(|contact| contact.force_deviation_n).unwrap_or(0.0),
        });
        frames.push(contacts);
    }
    let found = plateaus(&moments);
    let times = || found.iter().map(|plateau| format!("{:.1}", plateau.time_s[0])).collect::<Vec<_>>().join(", ");
    ensure!(
        found.len() == known.places.len(),
        "{}: {} presses are found, but {} places are given: one for each press, in their order; presses begin at {} s, and one ends where \
         nothing touches for a tenth of a second",
        reader.path().display(),
        found.len(),
        known.places.len(),
        times()
    );
    let press = |plateau: &tactomo::calibrate::force::Plateau| {
        let [from_s, to_s] = plateau.time_s;
        let margin_s = 0.5 * (1.0 - MIDDLE) * (to_s - from_s);
        let middle = from_s + margin_s..=to_s - margin_s;
        let within = moments.iter().zip(&frames).filter(|(moment, _)| middle.contains(&moment.time_s));
        let within: Vec<_> = within.map(|(_, contacts)| contacts.clone()).collect();
        (format!("{from_s:.1} to {to_s:.1} s"), standing(&within))
    };
    Ok(found.iter().map(press).collect())
}
