//! What is damaged or missing in a recording.

use std::fmt;

use crate::record::Loss;

/// What is damaged or missing in a recording, as far as it was read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordingLoss {
    /// What is damaged in the file.
    pub file: Loss,
    /// Stretches of bytes that are no message of the board.
    pub corrupt: u64,
    /// Frames that are missing by their numbers: lost in the file, on the line, or by the board.
    pub missing_frames: u64,
    /// Time that they would have taken, by the board's clock (us).
    pub missing_us: u64,
    /// Frames of a board with another number of electrodes than the first one, which are left out.
    pub other_frames: u64,
    /// How often the board started anew.
    pub restarts: u64,
    /// When it did so first, since the first frame (us).
    pub restarted_us: u64,
}

impl RecordingLoss {
    /// Whether anything is damaged or missing.
    pub fn is_any(&self) -> bool {
        *self != Self::default()
    }

    /// Whether the file is damaged. In one that is whole, frames may be missing and messages corrupt all the same: lost by the board or on its
    /// line, before they were kept.
    pub fn is_damage(&self) -> bool {
        self.file.is_any()
    }
}

impl fmt::Display for RecordingLoss {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let count = |count: u64, one: &str, many: &str| {
            (count > 0).then(|| format!("{count} {}", if count == 1 { one } else { many }))
        };
        let parts = [
            count(self.missing_frames, "frame is missing", "frames are missing")
                .map(|frames| format!("{frames} ({:.3} s)", self.missing_us as f64 * 1e-6)),
            self.file.is_any().then(|| self.file.to_string()),
            count(self.corrupt, "message is corrupt", "messages are corrupt"),
            count(self.other_frames, "frame is of another board", "frames are of another board"),
            count(self.restarts, "restart of the board", "restarts of the board, the first").map(|restarts| {
                format!(
                    "{restarts} at {:.3} s, from where times go on by when frames came",
                    self.restarted_us as f64 * 1e-6
                )
            }),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        if parts.is_empty() { write!(f, "nothing is missing") } else { write!(f, "{}", parts.join("; ")) }
    }
}
