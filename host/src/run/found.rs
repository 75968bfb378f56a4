//! What a board has found by itself, as solvers of this program tell it.

use tactomo_physics::readings::Readings;
use tactomo_protocol::{ContactCode, ContactFlags, Contacts, Status};
use tactomo_touch::solve::{Flags, FoundContact, Solution, SolveError, Solver, Uncertainty};

use super::inbox::Found;

/// Where the board solves: no readings come here.
pub(super) struct OnBoard;

impl Solver for OnBoard {
    fn name(&self) -> &'static str {
        "core"
    }

    fn solve(&mut self, _readings: &Readings) -> Result<Solution, SolveError> {
        Ok(Solution::default())
    }

    fn reset(&mut self) {}
}

/// The contacts of a packet, whose readings came too or did not.
pub(super) fn found(contacts: &Contacts, has_readings: bool) -> Found {
    let flags = contacts.flags;
    let solution = Solution {
        contacts: contacts.found.iter().map(contact).collect(),
        flags: Flags {
            saturated: flags.has(ContactFlags::SATURATED),
            misfit: flags.has(ContactFlags::MISFIT)
                || flags.has(ContactFlags::MORE)
                || contacts.head.status.contains(Status::TIMED_OUT),
            ..Flags::default()
        },
        ..Solution::default()
    };
    Found { solution, is_taking_rest: flags.has(ContactFlags::RESTING), has_readings }
}

/// A contact. The board tells the conductance that readings determine, and the larger standard error of the place.
fn contact(code: &ContactCode) -> FoundContact {
    let [x_m, y_m] = code.at_m().map(f64::from);
    let conductance_s = f64::from(code.conductance_s());
    let uncertainty = |sigma_m: f32| {
        let sigma_m = f64::from(sigma_m);
        Uncertainty { x_m: sigma_m, y_m: sigma_m, correlation: 0.0, conductance_s: f64::NAN }
    };
    FoundContact {
        id: Some(code.id.into()),
        apparent_conductance_s: Some(conductance_s),
        uncertainty: code.sigma_m().map(uncertainty),
        ..FoundContact::flat(x_m, y_m, conductance_s)
    }
}
