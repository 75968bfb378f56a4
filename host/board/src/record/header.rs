//! What a recording says about itself.

use std::fmt;
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use tactomo_physics::detector::Detector;

use super::RecordError;

/// What a recording says about itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Name of the detector it was taken from; empty if that is not known.
    pub detector: String,
    /// That detector as TOML; `None` in place of a header that is lost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detector_toml: Option<String>,
    /// The surface of a curved detector as the text of an OBJ file, in place of the file that the TOML names.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface_obj: Option<String>,
    /// Where the bytes came from.
    pub source: String,
    /// Seconds since 1970 at its start (s).
    pub started_unix_s: u64,
    /// Microseconds since 1970 at its start (us), to line recordings up with others.
    pub started_unix_us: u64,
    /// Whatever else a person wants to remember.
    #[serde(default)]
    pub notes: String,
}

impl Header {
    /// For a recording of a detector, from a source of such a name, that begins at that time (s since 1970).
    pub fn of(detector: &Detector, source: String, started_unix_s: u64) -> Self {
        Self {
            detector: detector.name.clone(),
            detector_toml: Some(detector.to_toml()),
            surface_obj: detector.surface.as_ref().map(|surface| surface.to_obj()),
            source,
            started_unix_s,
            started_unix_us: started_unix_s * 1_000_000,
            notes: String::new(),
        }
    }

    /// The header of a recording that begins now.
    pub fn now(detector: &Detector, source: String) -> Self {
        Self::of(detector, source, 0).started_ago(Duration::ZERO)
    }

    /// The header, of a recording that began so long ago.
    pub fn started_ago(self, ago: Duration) -> Self {
        let started = SystemTime::now().checked_sub(ago).and_then(|start| start.duration_since(UNIX_EPOCH).ok());
        self.started_at(started.unwrap_or_default())
    }

    /// The header, of a recording that begins so much later.
    pub fn started_later(self, by: Duration) -> Self {
        let started = self.started();
        self.started_at(started + by)
    }

    /// Time from 1970 to its start.
    pub fn started(&self) -> Duration {
        Duration::from_micros(self.started_unix_us)
    }

    fn started_at(self, since_1970: Duration) -> Self {
        Self { started_unix_s: since_1970.as_secs(), started_unix_us: since_1970.as_micros() as u64, ..self }
    }

    /// The detector that the recording was taken from; `None` if the header does not hold it. `path` is the recording, for errors.
    ///
    /// # Errors
    /// [`RecordError::Detector`] if it holds something that is no detector.
    pub fn detector(&self, path: &Path) -> Result<Option<Detector>, RecordError> {
        let Some(toml) = &self.detector_toml else { return Ok(None) };
        let detector = match &self.surface_obj {
            Some(obj) => Detector::from_toml_and_obj(toml, obj, &self.detector),
            None => Detector::from_toml(toml, &self.detector),
        };
        detector.map(Some).map_err(|source| RecordError::Detector { path: path.to_owned(), source })
    }

    /// Whether `detector` is the one of the recording, whatever is known of its forces and its softness, and corrected in its answers.
    pub fn is_of(&self, detector: &Detector) -> bool {
        let bare = |detector: &Detector| {
            let header =
                Self::of(&Detector { force: None, skin: None, correction: None, ..detector.clone() }, String::new(), 0);
            (header.detector_toml, header.surface_obj)
        };
        let recorded = self.detector(Path::new("")).ok().flatten();
        recorded.is_some_and(|recorded| bare(&recorded) == bare(detector))
    }
}

impl fmt::Display for Header {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self == &Self::default() {
            return write!(f, "it does not say where it was recorded");
        }
        write!(f, "detector {}, recorded from {}", self.detector, self.source)?;
        if self.notes.is_empty() { Ok(()) } else { write!(f, " ({})", self.notes) }
    }
}
