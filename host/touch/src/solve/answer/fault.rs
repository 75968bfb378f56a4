//! What is wrong with an electrode.

use std::fmt;

/// What frames say of electrodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ElectrodeFault {
    /// Grounding it grounds nothing: its wire is broken.
    Open,
    /// It reads what another one reads.
    Shorted,
    /// Its wire is exchanged with another's.
    Exchanged,
    /// Its readings contradict those of all others.
    Contradicting,
}

impl ElectrodeFault {
    /// Its name in machine output.
    pub fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Shorted => "shorted",
            Self::Exchanged => "exchanged",
            Self::Contradicting => "contradicting",
        }
    }
}

impl fmt::Display for ElectrodeFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Open => "its wire is broken",
            Self::Shorted => "it reads the same as another: their wires touch",
            Self::Exchanged => "its wire is exchanged with another's",
            Self::Contradicting => "its readings contradict those of all others",
        })
    }
}
