//! A frame of a detector that is not known, and where it is worked out.

use crate::circuit::Circuit;
use crate::detector::Detector;
use crate::fit::Scene;
use crate::frame::left_v;
use crate::held::{Held, Parts};
use crate::moved::Layout;
use crate::real::Real;
use crate::solver::Task;
use crate::unknown::Unknown;

/// What rounds are gone with.
pub(crate) struct On<'a, 't, T, const K: usize, const D: usize> {
    pub task: Task<'t, T>,
    pub unknown: &'t Unknown<'t>,
    pub circuit: &'a mut Circuit<T, K>,
    pub parts: Parts<'a, T, D>,
    /// Whether the detector stays as it was worked out last.
    pub is_moved: bool,
}

impl<'a, T: Real, const K: usize, const D: usize> On<'a, '_, T, K, D> {
    /// The detector, circuit and readings as they were worked out last.
    pub fn there(&mut self) -> (Detector<'_, T>, &mut Circuit<T, K>, &mut Held<'a, T, D>) {
        let table = self.task.table;
        let Parts { moved, shares, held } = &mut self.parts;
        let moved = Layout::of(table, self.unknown).as_moved(moved, shares);
        (Detector { table, moved: Some((self.unknown, moved)) }, &mut *self.circuit, held)
    }

    /// Solves a scene on its detector and notes what is there to be read, and what channels make of it, unless that was done last; `false` if it makes no sense.
    pub fn read(&mut self, scene: &Scene<T, K, D>) -> bool {
        let table = self.task.table;
        let Parts { moved, shares, .. } = &mut self.parts;
        let layout = Layout::of(table, self.unknown);
        let is_there = self.is_moved || self.circuit.is_solved && layout.is_moved_by(&scene.steps, moved);
        if !is_there {
            layout.moved(table, self.unknown, &scene.steps, moved, shares);
        }
        if is_there && self.circuit.is_solved_for(scene.spots()) {
            return true;
        }
        let (detector, circuit, held) = self.there();
        if !circuit.solve(&detector, scene.spots()) {
            return false;
        }
        held.read(&detector, circuit);
        true
    }

    /// Squares of what a scene leaves of the readings, in noise.
    pub fn left(&mut self, scene: &Scene<T, K, D>) -> Option<T> {
        if !self.read(scene) {
            return None;
        }
        let Task { table, frame, errors, .. } = self.task;
        let full_v = T::of(table.head().full_v);
        let all = self.parts.held.read_v().iter().enumerate();
        let left_v = all.filter_map(|(index, read_v)| left_v(frame, index, full_v, *read_v));
        let sum: T = left_v.map(|left_v| left_v * left_v).sum();
        Some(sum / errors.variance_v2).filter(|sum| sum.is_finite())
    }
}
