//! Presses of a recording in their order: what a solver finds while each of them stands.

use super::force::{Moment, Plateau, plateaus};
use crate::solve::FoundContact;

/// Of a press in a recording, so much of its time in the middle is looked at: it comes before, and goes after.
const MIDDLE: f64 = 0.5;

/// What a solver found in a frame of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Solved {
    /// Time of the frame (s).
    pub time_s: f64,
    /// The contacts.
    pub contacts: Vec<FoundContact>,
}

impl Solved {
    /// What it conducts, on a detector with [`ForceLaw::siemens`](tactomo_physics::detector::ForceLaw::siemens): newtons are conductances then.
    pub fn moment(&self) -> Moment {
        let first = self.contacts.first();
        Moment {
            time_s: self.time_s,
            contacts: self.contacts.len(),
            conductance_s: first.and_then(|contact| contact.force_n).unwrap_or_default(),
            deviation_s: first.and_then(|contact| contact.force_deviation_n).unwrap_or_default(),
        }
    }
}

/// What was found of a press: its only contact, or how many there are.
pub type Found = Result<FoundContact, usize>;

/// A press of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pressed {
    /// When, and what it conducts where it stands stillest.
    pub plateau: Plateau,
    /// Its contact.
    pub found: Found,
}

/// Another number of presses than was told.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "{} presses are found, but {told} {what} are given: one for each press, in their order; presses begin at {} s, and one ends where nothing \
     touches for a tenth of a second", begin_s.len(), seconds(begin_s)
)]
pub struct OtherCount {
    /// When those begin that are found (s).
    pub begin_s: Vec<f64>,
    /// How many were told.
    pub told: usize,
    /// What was told of them, such as `places`.
    pub what: &'static str,
}

/// The presses of a recording in their order, `told` of them.
///
/// # Errors
/// [`OtherCount`] if there are more or fewer; `what` is told of them.
pub fn pressed(frames: &[Solved], told: usize, what: &'static str) -> Result<Vec<Pressed>, OtherCount> {
    let moments: Vec<Moment> = frames.iter().map(Solved::moment).collect();
    let found = plateaus(&moments);
    if found.len() != told {
        return Err(OtherCount { begin_s: found.iter().map(|plateau| plateau.time_s[0]).collect(), told, what });
    }
    let press = |plateau: Plateau| {
        let [from_s, to_s] = plateau.time_s;
        let margin_s = 0.5 * (1.0 - MIDDLE) * (to_s - from_s);
        let middle = from_s + margin_s..=to_s - margin_s;
        let within = frames.iter().filter(|frame| middle.contains(&frame.time_s));
        Pressed { plateau, found: standing(within.map(|frame| &frame.contacts[..])) }
    };
    Ok(found.into_iter().map(press).collect())
}

/// The contact of a press in one frame.
pub fn single(contacts: &[FoundContact]) -> Found {
    match contacts {
        [contact] => Ok(*contact),
        other => Err(other.len()),
    }
}

/// The contact of frames in which something stands: the last one, which the solver knows best, if most frames have it alone.
pub fn standing<'a>(frames: impl Iterator<Item = &'a [FoundContact]>) -> Found {
    let found: Vec<Found> = frames.map(single).collect();
    let alone: Vec<&FoundContact> = found.iter().flatten().collect();
    match alone.last() {
        Some(contact) if 2 * alone.len() >= found.len() => Ok(**contact),
        _ => Err(found.iter().filter_map(|found| found.err()).max().unwrap_or(0)),
    }
}

fn seconds(begin_s: &[f64]) -> String {
    begin_s.iter().map(|time_s| format!("{time_s:.1}")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two presses of half a second, the second of two contacts, 50 frames a second.
    fn frames() -> Vec<Solved> {
        let contact = |x_m: f64| FoundContact {
            force_n: Some(1e-3),
            force_deviation_n: Some(1e-5),
            ..FoundContact::flat(x_m, 0.0, 1e-3)
        };
        let contacts = |index: usize| match index {
            // The tip slides to its place first.
            10..15 => vec![contact(0.02)],
            15..35 => vec![contact(0.01)],
            60..85 => vec![contact(0.01), contact(-0.01)],
            _ => Vec::new(),
        };
        (0..100).map(|index| Solved { time_s: 0.02 * index as f64, contacts: contacts(index) }).collect()
    }

    #[test]
    fn a_press_is_what_stands_in_its_middle() {
        let [first, second] = pressed(&frames(), 2, "places").unwrap()[..] else { panic!() };
        assert!(first.found.is_ok_and(|contact| contact.x_m == 0.01) && first.plateau.contacts == 1);
        assert_eq!((second.found, second.plateau.contacts), (Err(2), 2));
    }

    #[test]
    fn another_number_of_presses_says_when_they_begin() {
        let error = pressed(&frames(), 3, "places").unwrap_err().to_string();
        assert!(error.starts_with("2 presses are found, but 3 places are given"), "{error}");
        assert!(error.contains("presses begin at 0.2, 1.2 s"), "{error}");
    }

    #[test]
    fn what_hardly_stands_alone_is_no_single_contact() {
        let (one, two) = (vec![FoundContact::flat(0.0, 0.0, 1e-3)], vec![FoundContact::flat(0.0, 0.0, 1e-3); 2]);
        assert_eq!(standing([&two[..], &two, &one].into_iter()), Err(2));
        assert!(standing([&two[..], &one, &one].into_iter()).is_ok());
        assert_eq!(standing([&[][..]].into_iter()), Err(0));
    }
}
