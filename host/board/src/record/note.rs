//! What is set down in a recording while it is made.

use std::path::Path;

use serde::{Deserialize, Serialize};
use tactomo_physics::detector::Detector;

use super::{Header, RecordError};

/// Something set down in a recording, at a time of its own: JSON with its `kind`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Note {
    /// A moment that a person has marked.
    Mark {
        /// What was said of it; may be empty.
        #[serde(default)]
        text: String,
    },
    /// The detector as a calibration has found it: it holds for the whole recording. Written again at the end, where it is found without
    /// reading everything.
    Detector {
        /// The detector, as a [`Header`] has it.
        detector: String,
        /// Itself as TOML.
        detector_toml: String,
        /// Its surface as the text of an OBJ file, if it is curved.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        surface_obj: Option<String>,
    },
    /// The board was sent a command: what its clock showed when it obeyed is among its bytes.
    Asked {
        /// The command's tag.
        tag: u8,
    },
    /// Here another recording was joined on: its board counts anew.
    Joined {
        /// Seconds since 1970 at its start (s).
        started_unix_s: u64,
        /// Its notes.
        #[serde(default)]
        notes: String,
    },
    /// A kind that this version of the program does not know.
    #[serde(other)]
    Unknown,
}

impl Note {
    /// A mark.
    pub fn mark(text: impl Into<String>) -> Self {
        Self::Mark { text: text.into() }
    }

    /// A detector that was found by a calibration.
    pub fn detector_found(detector: &Detector) -> Self {
        let Header { detector, detector_toml, surface_obj, .. } = Header::of(detector, String::new(), 0);
        Self::Detector { detector, detector_toml: detector_toml.unwrap_or_default(), surface_obj }
    }

    /// The detector, if that is what it holds. `path` is the recording, for errors.
    ///
    /// # Errors
    /// [`RecordError::Detector`] if it holds something that is no detector.
    pub fn detector(&self, path: &Path) -> Result<Option<Detector>, RecordError> {
        let Self::Detector { detector, detector_toml, surface_obj } = self.clone() else { return Ok(None) };
        let header = Header { detector, detector_toml: Some(detector_toml), surface_obj, ..Header::default() };
        header.detector(path)
    }
}
