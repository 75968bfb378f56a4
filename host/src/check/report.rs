//! What a check has found.

use serde::Serialize;
use tactomo_board::check::wiring::Pins;

/// What an electrode is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// As it should be.
    Ok,
    /// Grounding it grounds nothing.
    Open,
    /// It is grounded, and its input follows nothing that presses.
    Unread,
    /// It is grounded, and its input stays at a voltage beyond the drive's.
    AtEnd,
    /// It reads the same as others: their wires touch.
    Shorted,
    /// Its wire is exchanged with another's.
    Exchanged,
    /// Its readings contradict those of all others.
    Contradicting,
    /// Nothing has pressed, so nothing is known.
    Untested,
}

impl State {
    /// Its mark in the picture.
    pub fn mark(self) -> char {
        match self {
            Self::Ok => '.',
            Self::Open => 'o',
            Self::Unread => 'u',
            Self::AtEnd => 'e',
            Self::Shorted => 's',
            Self::Exchanged => 'x',
            Self::Contradicting => '!',
            Self::Untested => '?',
        }
    }

    /// What the mark means.
    pub fn legend(self) -> &'static str {
        match self {
            Self::Ok => "right",
            Self::Open => "not grounded: open",
            Self::Unread => "not read",
            Self::AtEnd => "stuck at the end of the scale",
            Self::Shorted => "shorted to another",
            Self::Exchanged => "exchanged with another",
            Self::Contradicting => "contradicts the others",
            Self::Untested => "not tested",
        }
    }
}

/// What was found of one electrode.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ElectrodeReport {
    /// The electrode, from 0.
    pub electrode: usize,
    /// What it is.
    pub state: State,
    /// Electrodes that it is shorted to, or exchanged with.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub with: Vec<usize>,
    /// Where it is wired to, on a board that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pins: Option<Pins>,
    /// What is wrong and what to do, in a sentence or two; nothing if nothing is wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub advice: Option<String>,
}

/// What a check has found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// All electrodes, in order.
    pub electrodes: Vec<ElectrodeReport>,
    /// Presses that were felt: a hand and some fingertips.
    pub presses: usize,
    /// What else a person should know.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Whether everything is as it should be.
    pub sound: bool,
}

impl Report {
    /// Electrodes that are not as they should be.
    pub fn faulty(&self) -> impl Iterator<Item = &ElectrodeReport> {
        self.electrodes.iter().filter(|report| report.state != State::Ok)
    }

    /// The verdict, in a sentence.
    pub fn verdict(&self) -> String {
        let count = self.faulty().count();
        match (self.sound, count) {
            (true, _) => format!("all {} electrodes are connected as they should be", self.electrodes.len()),
            (_, _) if self.presses == 0 => {
                "nothing has pressed on the foam, so no electrode could be tested".to_owned()
            }
            (_, 0) => "no electrode is wrong, but not everything could be tested: see above".to_owned(),
            (_, 1) => "one electrode is not as it should be: see above what to do".to_owned(),
            (_, count) => format!("{count} electrodes are not as they should be: see above what to do"),
        }
    }
}
