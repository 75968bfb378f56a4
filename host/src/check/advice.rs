//! What is wrong and what to do, in words.

use tactomo_board::check::wiring::Pins;
use tactomo_touch::solve::ContactSettings;
use tactomo_touch::solve::Contacts;

use super::course::{Check, FINGERS};
use super::report::{Report, State};

/// Mean square of what one contact may leave of a fingertip's readings, in what noise and what is not known of the detector make: as for
/// exchanged wires, see [`Look`](tactomo_touch::solve::Look).
const FITS: f64 = 6.0;

/// An electrode, and what was found of it.
pub struct Case<'a> {
    /// What it is.
    pub state: State,
    /// Others that are in it.
    pub with: &'a [usize],
    /// Where it is wired to.
    pub pins: Option<&'a Pins>,
    /// Whether its input follows what presses.
    pub is_read: bool,
}

/// What is wrong with an electrode, and what to do; nothing if nothing is wrong.
pub fn electrode(case: &Case) -> Option<String> {
    let (switch, input) = places(case.pins);
    Some(match case.state {
        State::Ok => return None,
        State::Untested => "Nothing has pressed, so nothing is known of it.".to_owned(),
        State::Open if case.is_read => {
            format!(
                "It is read, but not grounded: the wire from the electrode to {switch} is broken there. Check that joint."
            )
        }
        State::Open => format!(
            "It is neither grounded nor read: its wire is broken near the electrode, before it parts to {switch} and to {input}. Check the \
             joint at the electrode, then the wire, with an ohmmeter."
        ),
        State::Unread => {
            format!(
                "It is grounded, but its input follows nothing that presses: the wire to {input} is broken, or on another pin."
            )
        }
        State::AtEnd => format!(
            "Its input stays above the voltage of the driving layer, where nothing of the foam can be: {input} is shorted to a supply, or \
             driven by something else on the board."
        ),
        State::Shorted => format!(
            "It reads the same as {}: their wires touch, at the electrodes, along the wires, or at {switch} and {input}. Part them.",
            list(case.with)
        ),
        State::Exchanged => format!(
            "Its wire and that of {} are exchanged: exchange them, at the electrodes or at {switch} and {input}; or exchange the two places in \
             the detector's file.",
            list(case.with)
        ),
        State::Contradicting => format!(
            "Its readings contradict those of all others: look for a bad joint, a resistor of a wrong value, or something else on {input}."
        ),
    })
}

/// What a person would call the two ends of its wire.
fn places(pins: Option<&Pins>) -> (String, String) {
    match pins {
        Some(pins) => (format!("the multiplexer's pin {}", pins.grounded_by), pins.read_by.clone()),
        None => ("its pin of the multiplexer".to_owned(), "its ADC input".to_owned()),
    }
}

fn list(electrodes: &[usize]) -> String {
    match electrodes {
        [] => "another one".to_owned(),
        [one] => format!("electrode {one}"),
        [others @ .., last] => {
            let others: Vec<String> = others.iter().map(ToString::to_string).collect();
            format!("electrodes {} and {last}", others.join(", "))
        }
    }
}

/// What else a person should know.
pub fn notes(check: &Check, report: &Report) -> Vec<String> {
    let mut notes = Vec::new();
    if check.rest.is_none() {
        notes.push(
            "The foam did not come to rest: something presses, or its layers are pressed together. Lift what lies there and loosen the layers."
                .to_owned(),
        );
    } else if report.presses == 0 {
        notes.push(
            "No press was felt. Is the driving layer at its voltage (measure it, about 2 V), is it on top of the foam with its conducting side \
             down, and is the multiplexer's drain at ground?"
                .to_owned(),
        );
    } else if report.presses < 1 + FINGERS {
        notes.push("Not every fingertip was pressed, so exchanged wires may have been missed.".to_owned());
    }
    if report.faulty().next().is_none() && fits_no_finger(check) {
        notes.push(format!(
            "The fingertips do not look like fingertips on {}: is it the detector that is connected (--detector)? If it is, more than two of its \
             wires may be exchanged, or its foam is another one: see docs/detector.md, and calibrate it.",
            check.detector.name
        ));
    }
    notes
}

/// Whether no press of a fingertip is one contact on this detector.
fn fits_no_finger(check: &Check) -> bool {
    let fingers = check.presses.get(1..).unwrap_or_default();
    let settings = ContactSettings { most: 1, ..ContactSettings::of(&check.problem) };
    let Ok(contacts) = Contacts::new(&check.problem, settings) else { return false };
    !fingers.is_empty() && fingers.iter().all(|finger| contacts.left_by_one(finger).is_none_or(|left| left > FITS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_board::check::wiring;

    fn advice(state: State, with: &[usize], is_read: bool) -> String {
        let pins = wiring::pins("esp32", 3);
        electrode(&Case { state, with, pins: pins.as_ref(), is_read }).unwrap_or_default()
    }

    #[test]
    fn advice_names_the_pins_and_the_others() {
        assert!(advice(State::Open, &[], true).contains("S4A"));
        let both = advice(State::Open, &[], false);
        assert!(both.contains("S4A") && both.contains("GPIO 33"), "{both}");
        assert!(advice(State::Unread, &[], false).contains("GPIO 33"));
        assert!(advice(State::Shorted, &[7], true).contains("the same as electrode 7:"));
        assert!(advice(State::Shorted, &[2, 5, 7], true).contains("electrodes 2, 5 and 7"));
        assert!(advice(State::Exchanged, &[5], true).contains("electrode 5"));
        assert_eq!(advice(State::Ok, &[], true), "");
    }
}
