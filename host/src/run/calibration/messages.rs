//! What a person asks of a calibration, and what other threads answer.

use std::path::PathBuf;
use std::time::Duration;

use tactomo_touch::calibrate::Rub;

/// What a person asks of a calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Calibrate {
    /// Collects frames; after the end, more of them.
    Begin,
    /// Ends collecting, and fits what there is.
    Finish,
    /// Writes what was found to a new file.
    Save,
    /// Goes on with the detector that was found.
    Use,
    /// Forgets it.
    End,
}

/// What comes of work in another thread.
pub(in crate::run) enum Outcome {
    Fitted(Box<Fitted>),
    Saved(Result<PathBuf, String>),
}

/// A fit that has ended.
pub(in crate::run) struct Fitted {
    pub is_last: bool,
    pub fit: Result<Rub, String>,
    pub took: Duration,
}
