//! What a board has found by itself, in recordings that have no readings.

use tactomo::board::frames::FoundByBoard;
use tactomo::detector::Detector;
use tactomo::run::solution_of_board;
use tactomo::run::table::BoardTable;
use tactomo::solve::Solution;
use tactomo_protocol::ContactFlags;

/// Makes answers of what a board has found.
#[derive(Debug, Default)]
pub struct ByBoard {
    /// The table that newtons are told by.
    table: BoardTable,
    /// Whether it did not know yet what readings are at rest, in the frame before.
    pub is_taking_rest: bool,
}

impl ByBoard {
    /// Contacts and flags, with newtons where the detector has a law of force.
    pub fn solution(&mut self, found: &FoundByBoard, detector: &Detector) -> Solution {
        let mut solution = solution_of_board(found);
        self.is_taking_rest = found.contacts.flags.has(ContactFlags::RESTING);
        if let Some(law) = detector.force.as_ref().filter(|_| !solution.contacts.is_empty()) {
            self.table.compile_once(detector);
            self.table.add_newtons(law, &mut solution.contacts);
        }
        solution
    }
}
