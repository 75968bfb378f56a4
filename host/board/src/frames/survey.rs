//! What is in a recording, read from one end to the other.

use std::path::Path;

use tactomo_protocol::Hello;

use super::{FramesError, Recorded, RecordingLoss};
use crate::record::{Header, Note};

/// What is in a recording.
#[derive(Clone, Debug)]
pub struct Survey {
    /// What it says about itself.
    pub header: Header,
    /// The board, as it said who it is first.
    pub board: Hello,
    /// Frames that are whole.
    pub frames: u64,
    /// How many of them have no readings, but what the board has found.
    pub without_readings: u64,
    /// Time from the first to the last of them (s).
    pub seconds: f64,
    /// Longest time between two of them (s).
    pub longest_pause_s: f64,
    /// Marks, calibrations and joints, with their times (s since the recording's start).
    pub notes: Vec<(f64, Note)>,
    /// What is damaged or missing.
    pub loss: RecordingLoss,
}

impl Survey {
    /// Reads a whole recording.
    ///
    /// # Errors
    /// [`FramesError`] if it cannot be read, is no recording, or does not say of which board it is.
    pub fn of(path: &Path) -> Result<Self, FramesError> {
        let mut recorded = Recorded::open(path)?;
        recorded.keep_found();
        let (mut without_readings, mut frames, mut last_s, mut longest_pause_s) = (0, 0, 0.0, 0.0_f64);
        while let Some(frame) = recorded.next_frame()? {
            let time_s = frame.time_s.unwrap_or(last_s);
            longest_pause_s = longest_pause_s.max(time_s - last_s);
            (frames, last_s) = (frames + 1, time_s);
            without_readings += u64::from(frame.found_alone().is_some());
        }
        Ok(Self {
            header: recorded.header().clone(),
            board: recorded.board().clone(),
            frames,
            without_readings,
            seconds: last_s,
            longest_pause_s,
            notes: recorded.notes().to_vec(),
            loss: recorded.loss(),
        })
    }

    /// Frames a second; 0 where there are not two.
    pub fn frames_per_s(&self) -> f64 {
        if self.seconds > 0.0 { (self.frames - 1) as f64 / self.seconds } else { 0.0 }
    }

    /// Marks, with their times (s since the recording's start).
    pub fn marks(&self) -> impl Iterator<Item = (f64, &str)> {
        self.notes.iter().filter_map(|(time_s, note)| match note {
            Note::Mark { text } => Some((*time_s, text.as_str())),
            _ => None,
        })
    }
}
