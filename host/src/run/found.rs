//! What a board has found by itself, as solvers of this program tell it.

use tactomo_board::frames::FoundByBoard;
use tactomo_physics::readings::Readings;
use tactomo_protocol::{ContactCode, ContactFlags, MAX_ELECTRODES, Status};
use tactomo_touch::solve::{ElectrodeFault, Flags, FoundContact, Solution, SolveError, Solver, Uncertainty};

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
pub(super) fn found(by_board: &FoundByBoard, has_readings: bool) -> Found {
    let is_taking_rest = by_board.contacts.flags.has(ContactFlags::RESTING);
    Found { solution: solution(by_board), is_taking_rest, has_readings }
}

/// What a board has found, as a solution, without newtons.
pub fn solution(FoundByBoard { contacts, broken_wires }: &FoundByBoard) -> Solution {
    let flags = contacts.flags;
    let is_left_out = |e: &usize| flags.has(ContactFlags::FAULT) && broken_wires >> e & 1 == 1;
    let excluded: Vec<_> = (0..MAX_ELECTRODES).filter(is_left_out).collect();
    Solution {
        contacts: contacts.found.iter().map(contact).collect(),
        flags: Flags {
            saturated: flags.has(ContactFlags::SATURATED),
            misfit: flags.has(ContactFlags::MISFIT)
                || flags.has(ContactFlags::MORE)
                || contacts.head.status.contains(Status::TIMED_OUT),
            calibrate: flags.has(ContactFlags::CALIBRATE),
            faults: vec![ElectrodeFault::Open; excluded.len()],
            excluded,
            ..Flags::default()
        },
        ..Solution::default()
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_protocol::{Contacts, FrameHead};

    #[test]
    fn broken_wires_are_told_of_while_the_board_leaves_them_out() {
        let (head, flags) = (FrameHead::default(), ContactFlags::default());
        let mut contacts = Contacts { head, flags, found: Default::default() };
        let excluded = |contacts: &Contacts| {
            let found = FoundByBoard { contacts: contacts.clone(), broken_wires: 1 << 5 | 1 << 9 };
            solution(&found).flags
        };
        assert_eq!(excluded(&contacts), Flags::default());
        contacts.flags.raise(ContactFlags::FAULT);
        let Flags { excluded, faults, .. } = excluded(&contacts);
        assert_eq!((excluded, faults), (vec![5, 9], vec![ElectrodeFault::Open; 2]));
    }
}
