//! What a board has found by itself, in recordings that have no readings.

use tactomo::board::frames::FoundByBoard;
use tactomo::detector::Detector;
use tactomo::run::solution_of_board;
use tactomo::solve::{Problem, Solution, add_newtons, compile};
use tactomo_protocol::ContactFlags;

/// Makes answers of what a board has found.
#[derive(Debug, Default)]
pub struct ByBoard {
    /// The table that newtons are told by, once it is compiled; empty where there is none.
    table: Option<Vec<u8>>,
    /// Whether it did not know yet what readings are at rest, in the frame before.
    pub is_taking_rest: bool,
}

impl ByBoard {
    /// Contacts and flags, with newtons where the detector has a law of force.
    pub fn solution(&mut self, found: &FoundByBoard, detector: &Detector) -> Solution {
        let mut solution = solution_of_board(found);
        self.is_taking_rest = found.contacts.flags.has(ContactFlags::RESTING);
        if let Some(law) = detector.force.as_ref().filter(|_| !solution.contacts.is_empty()) {
            // A board that finds contacts had a table of this detector, or of one that does not belong to it.
            let compiled = || Problem::of(detector).ok().and_then(|problem| compile(&problem).ok()).unwrap_or_default();
            add_newtons(self.table.get_or_insert_with(compiled), law, &mut solution.contacts);
        }
        solution
    }
}
