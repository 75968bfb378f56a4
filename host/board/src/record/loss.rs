//! What is damaged in a recording.

use std::fmt;

/// What is damaged in a recording, as far as it was read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Loss {
    /// The header.
    pub header: HeaderDamage,
    /// Places where it is damaged: a chunk each, or several in a row where it cannot be said how many they are.
    pub damaged_places: u64,
    /// Bytes of the file that were left out because of that. Those of damaged chunks that were handed out all the same are not among them.
    pub left_out_bytes: u64,
    /// Bytes before the recording that are not its own.
    pub junk_bytes: u64,
    /// Bytes at the end that are no whole chunk: the recording was cut off there.
    pub tail_bytes: u64,
}

/// How the header fares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum HeaderDamage {
    /// It is whole.
    #[default]
    None,
    /// It is damaged, and another copy of it, or a rule of the format, has made up for that.
    Repaired,
    /// It is lost, and with it what the recording said about itself.
    Lost,
}

impl Loss {
    /// Whether anything is damaged.
    pub fn is_any(&self) -> bool {
        *self != Self::default()
    }
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let mut parts = Vec::new();
        if self.junk_bytes > 0 {
            parts.push(format!("{} bytes before its start do not belong to it", self.junk_bytes));
        }
        match self.header {
            HeaderDamage::None => {}
            HeaderDamage::Repaired => parts.push("its header is damaged, but nothing of it is lost".to_owned()),
            HeaderDamage::Lost => parts.push("its header is lost, and with it the detector".to_owned()),
        }
        match self.damaged_places {
            0 => {}
            places => {
                let plural = if places == 1 { "" } else { "s" };
                parts.push(format!("it is damaged in {places} place{plural} ({} bytes left out)", self.left_out_bytes));
            }
        }
        if self.tail_bytes > 0 {
            parts.push(format!("it was cut off, {} bytes into an unfinished chunk", self.tail_bytes));
        }
        if parts.is_empty() { write!(f, "nothing is damaged") } else { write!(f, "{}", parts.join("; ")) }
    }
}
