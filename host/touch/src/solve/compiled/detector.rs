//! A detector compiled, with what is not known of it.

use tactomo_touch_core::{Room, Table};

use super::Modelled;
use super::changes::Changes;
use super::table::{CompileError, Fitted};
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::ForwardError;

/// Most contacts that are looked for on a computer.
pub(crate) const MOST_CONTACTS: usize = 8;
/// Most directions in which a detector may differ.
pub(crate) const MOST_DIRECTIONS: usize = 256;

/// Fields of a detector and of what is not known of it, which take long: the same whatever board measures it.
pub(crate) struct CompiledFields {
    fitted: Fitted,
    changes: Changes,
}

/// A detector's table, and what it may differ by, as a board measures it.
#[derive(Debug)]
pub(crate) struct CompiledDetector {
    pub bytes: Vec<u8>,
    pub electrodes: usize,
    pub drive_v: f64,
    pub changes: Changes,
    /// Numbers and floats that work on it takes room for.
    pub room: [usize; 2],
}

impl CompiledFields {
    /// Of a detector, in so many threads.
    ///
    /// # Errors
    /// [`ForwardError`] if it is curved, or there are too many electrodes for a table.
    pub fn of(modelled: Modelled<'_>, cores: usize) -> Result<Self, ForwardError> {
        let fitted = Fitted::of(modelled).map_err(|error| forward_error(error, modelled.detector))?;
        let changes = Changes::of(modelled, &fitted, cores)?;
        Ok(Self { fitted, changes })
    }

    /// The detector as it is measured.
    ///
    /// # Errors
    /// [`ForwardError`] if it may differ in too many directions.
    pub fn measured(&self, modelled: Modelled<'_>) -> Result<CompiledDetector, ForwardError> {
        let detector = modelled.detector;
        let refused = |what: String| ForwardError::Detector { detector: detector.name.clone(), what };
        let bytes = self.fitted.table_apart(modelled);
        let table = Table::read(&bytes).map_err(|error| refused(with_causes(&error)))?;
        let changes = self.changes.measured(detector);
        let unknown = changes.unknown();
        let count = unknown.directions.len();
        if count > MOST_DIRECTIONS {
            let what = format!("it may differ in {count} directions; `core` takes {MOST_DIRECTIONS} at most");
            return Err(refused(what));
        }
        let [numbers, floats] = [Room::<f64>::numbers, Room::<f64>::floats];
        let room = [numbers(&table, &unknown, MOST_CONTACTS), floats(&table, &unknown, MOST_CONTACTS)];
        Ok(CompiledDetector { electrodes: detector.electrodes.len(), drive_v: detector.drive_v, bytes, changes, room })
    }
}

fn forward_error(error: CompileError, detector: &Detector) -> ForwardError {
    match error {
        CompileError::Model(error) => error,
        error => ForwardError::Detector { detector: detector.name.clone(), what: with_causes(&error) },
    }
}
