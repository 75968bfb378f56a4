//! Contacts that are given: where a search begins, and how much a frame speaks for them.

use super::{Solver, Task};
use crate::answer::Contact;
use crate::fit::{Bench, Scene, Went, Working};
use crate::frame::{Frame, FrameError};
use crate::held::Room;
use crate::loaded::Spot;
use crate::normal::ANY_RADIUS;
use crate::real::Real;
use crate::table::Table;
use crate::unknown::Unknown;

/// Steps at most where contacts are given.
const TO_THE_END: u8 = 60;

impl<T: Real, const K: usize, const D: usize> Solver<T, K, D> {
    /// Forgets the frames before, and looks in the next one for what explains it from these contacts, whether or not they do.
    pub fn begin_from(&mut self, contacts: &[Contact<T>], table: &Table<'_>) {
        self.reset();
        self.scene = contacts.iter().fold(Scene::EMPTY, |scene, contact| scene.with(Spot::of(contact, table)));
        self.is_begun = true;
    }

    /// Twice the logarithm of the evidence for the contacts of the last answer, but for what is the same for all explanations of a frame; `None` if there are none.
    pub fn answer_evidence(&self) -> Option<T> {
        self.evidence
    }

    /// The same for contacts that are fitted to a frame from where some are; `None` if they make no sense. It tells whether an answer explains a frame less well than what is
    /// there. The frames before are forgotten.
    ///
    /// # Errors
    /// [`FrameError`] if it cannot be a frame of the table's detector.
    ///
    /// # Panics
    /// As [`solve_unknown`](Self::solve_unknown).
    pub fn evidence(
        &mut self,
        table: &Table<'_>,
        unknown: &Unknown<'_>,
        room: &mut Room<'_, T>,
        frame: &Frame<'_, T>,
        contacts: &[Contact<T>],
    ) -> Result<Option<T>, FrameError> {
        frame.check(table)?;
        self.reset();
        let (frame, _) = frame.without_broken(table);
        let errors = self.errors_of(&frame, table, true);
        let task = Task { table, frame: &frame, errors: &errors, unknown: Some(unknown) };
        let scene = contacts.iter().fold(Scene::EMPTY, |scene, contact| scene.with(Spot::of(contact, table)));
        self.fit(scene, T::of(ANY_RADIUS), TO_THE_END);
        let mut bench = Bench { circuit: &mut self.circuit, room: Some(room) };
        let mut work = Working { done: &mut self.work, attend: &mut || {} };
        loop {
            if let Went::ToEnd(found) = self.fitting.go_on(task, &mut bench, &mut work) {
                return Ok(found.map(|fit| fit.evidence));
            }
        }
    }
}
