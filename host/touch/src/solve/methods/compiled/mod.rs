//! `core`: the contacts that a board finds by itself, from a table that the detector was compiled to.
//!
//! On a computer it works in `f64`, and finds up to [`MOST_CONTACTS`].

mod between;
mod changes;
mod file;
mod splines;
mod table;
#[cfg(test)]
mod tests;
mod unknown;

use std::sync::Arc;

use tactomo_touch_core::{
    Answer, Contact, Flags as CoreFlags, Frame, FrameError, Room, Says as CoreSays, Solver as Core, Table,
};

use self::changes::Changes;
pub use self::file::{CompiledTable, TableFileError};
use self::table::Fitted;
pub use self::table::{CompileError, compile};
use crate::solve::answer::{Alternative, Flags, FoundContact, Solution, SolveError, Uncertainty, check_count};
use crate::solve::fit::policy;
use crate::solve::problem::Problem;
use crate::solve::solver::Solver;
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::ForceLaw;
use tactomo_physics::forward::ForwardError;
use tactomo_physics::readings::{Readings, Says};
use tactomo_physics::threads;

/// Most contacts that it looks for.
const MOST_CONTACTS: usize = 8;
/// Most directions in which a detector may differ.
const MOST_DIRECTIONS: usize = 256;

/// `core`: contacts by the board's own search, by a table.
pub struct Compiled {
    bytes: Arc<[u8]>,
    electrodes: usize,
    drive_v: f64,
    core: Box<Core<f64, MOST_CONTACTS, MOST_DIRECTIONS>>,
    changes: Option<Changes>,
    /// Where the core works on them.
    numbers: Vec<f64>,
    floats: Vec<f32>,
}

impl Compiled {
    /// Compiles the problem's detector.
    ///
    /// # Errors
    /// [`ForwardError`] if it is curved, or there are too many electrodes for a table.
    pub fn new(problem: &Problem) -> Result<Self, ForwardError> {
        let detector = problem.detector();
        let refused = |what: String| ForwardError::Detector { detector: detector.name.clone(), what };
        let wrong = |error| match error {
            CompileError::Model(error) => error,
            error => refused(with_causes(&error)),
        };
        let fitted = Fitted::of(problem).map_err(wrong)?;
        let bytes = fitted.table_apart(problem).map_err(wrong)?;
        let table = Table::read(&bytes).map_err(|error| refused(with_causes(&error)))?;
        let (electrodes, drive_v) = (detector.electrodes.len(), detector.drive_v);
        let changes = Changes::of(problem, &fitted, threads::cores()).map_err(wrong)?;
        let (mut numbers, mut floats) = (Vec::new(), Vec::new());
        if let Some(changes) = &changes {
            let unknown = changes.unknown();
            if unknown.directions.len() > MOST_DIRECTIONS {
                let count = unknown.directions.len();
                return Err(refused(format!(
                    "it may differ in {count} directions; `core` takes {MOST_DIRECTIONS} at most"
                )));
            }
            numbers = vec![0.0; Room::<f64>::numbers(&table, &unknown, MOST_CONTACTS)];
            floats = vec![0.0; Room::<f64>::floats(&table, &unknown, MOST_CONTACTS)];
        }
        Ok(Self { bytes: bytes.into(), electrodes, drive_v, core: Box::default(), changes, numbers, floats })
    }

    /// A reading as a board can give it (V): none is far beyond its drive.
    fn held(&self, volts: f64) -> f64 {
        let most_v = 2.0 * self.drive_v;
        if volts.is_finite() { volts.clamp(-most_v, most_v) } else { volts }
    }
}

impl Solver for Compiled {
    fn name(&self) -> &'static str {
        "core"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        check_count(readings, self.electrodes)?;
        let volts: Vec<_> = readings.volts().iter().map(|volts| self.held(*volts)).collect();
        let says: Vec<_> = readings.all_say().iter().map(|says| core_says(*says)).collect();
        let wrong = SolveError::Electrodes { found: readings.electrodes(), expected: self.electrodes };
        // It was read, and checked, when it was compiled.
        let table = Table::read_again(&self.bytes).map_err(|_| wrong.clone())?;
        let frame = Frame::new(&volts, &says);
        let answer = match &self.changes {
            Some(changes) => {
                let mut room = Room { numbers: &mut self.numbers, floats: &mut self.floats };
                self.core.solve_unknown(&table, &changes.unknown(), &mut room, &frame)
            }
            None => self.core.solve(&table, &frame),
        };
        match answer {
            Ok(answer) => Ok(solution(&answer)),
            Err(FrameError::NotFinite { g, e }) => Err(SolveError::NotFinite { g, e }),
            Err(_) => Err(wrong),
        }
    }

    fn reset(&mut self) {
        self.core.reset();
    }
}

/// Adds newtons to contacts that a board has found by a table, and none if these bytes are no table.
pub fn add_newtons(table: &[u8], law: &ForceLaw, contacts: &mut [FoundContact]) {
    let Ok(table) = Table::read_again(table) else { return };
    for contact in contacts {
        let at_m = [contact.x_m, contact.y_m].map(|m| m as f32);
        let apparent_s = contact.apparent_conductance_s.unwrap_or(contact.conductance_s) as f32;
        contact.set_force(law.force_n(table.constricted_conductance_s(at_m, apparent_s).into(), 0.0));
    }
}

fn core_says(says: Says) -> CoreSays {
    match says {
        Says::Voltage => CoreSays::Voltage,
        Says::AtMost => CoreSays::AtMost,
        Says::AtLeast => CoreSays::AtLeast,
        Says::Nothing => CoreSays::Nothing,
    }
}

fn solution(answer: &Answer<f64, MOST_CONTACTS>) -> Solution {
    let flags = answer.flags;
    let other = answer.certainty.and_then(|certainty| certainty.other);
    let alternative = other.map(|(contacts, certainty)| Alternative { contacts, certainty });
    Solution {
        contacts: answer.contacts().iter().map(found).collect(),
        residual: Some(answer.residual),
        certainty: answer.certainty.map(|certainty| certainty.share),
        alternative: alternative.filter(|other| other.certainty >= policy::named_share()),
        flags: Flags {
            saturated: flags.has(CoreFlags::SATURATED),
            misfit: flags.has(CoreFlags::MISFIT) || flags.has(CoreFlags::MORE),
            calibrate: flags.has(CoreFlags::CALIBRATE),
            ..Flags::default()
        },
        ..Solution::default()
    }
}

fn found(contact: &Contact<f64>) -> FoundContact {
    let [x_m, y_m] = contact.sigma_m.map(f64::from);
    let uncertainty =
        Uncertainty { x_m, y_m, correlation: contact.correlation, conductance_s: contact.conductance_sigma_s };
    let is_known = contact.radius_sigma_m / contact.radius_m < policy::known_radius_deviation();
    FoundContact {
        apparent_conductance_s: Some(contact.apparent_conductance_s),
        radius_m: is_known.then_some(contact.radius_m),
        uncertainty: Some(uncertainty).filter(|errors| errors.x_m.is_finite() && errors.y_m.is_finite()),
        id: Some(contact.id),
        ..FoundContact::flat(contact.x_m, contact.y_m, contact.conductance_s)
    }
}
