//! Contacts that hardly move, from one frame to the next by the gain of a frame before.
//!
//! Readings of the next frame differ by noise and by a small step. As long as they are linear over that, the derivatives of contacts, the detector's patterns and the normal
//! matrix are what they were, and the detector's best steps change nothing that is told: a frame costs the readings of the contacts where they are now, and products with
//! what is kept. What is told is checked: where the step that is left at the new place would gain anything, or the contacts have come away from where the derivatives were
//! taken, the frame is fitted anew.

use crate::evidence::known;
use crate::fit::{Fit, Fitting, LEAST_GAIN, Scene, Working};
use crate::normal::Normal;
use crate::real::Real;
use crate::round::{NEAR, On};
use crate::solver::Task;

/// Steps at most: where so many do not end, full fits with damping take over.
const STEPS: usize = 3;
/// How far what is told badly may come from where derivatives were taken, in standard errors. Of 240 scenes on `built205` as many are right without, where two contacts take half as
/// long again, and three eight times as long.
const WITHIN: f32 = 2.0;

impl<T: Real, const K: usize, const D: usize> Fitting<T, K, D> {
    /// The fit of a frame by the gain that is kept; `None` where there is none, or it does not serve.
    pub(crate) fn by_kept_gain(
        &mut self,
        on: &mut On<'_, '_, T, K, D>,
        work: &mut Working<'_, K>,
    ) -> Option<Fit<T, K, D>> {
        let table = on.task.table;
        let is_for_these = self.on.has_gain && self.on.is_held && self.ended.radius_deviation == self.radius_deviation;
        if !is_for_these || self.ended.scene.count != self.scene.count {
            return None;
        }
        (self.on.has_gain, on.is_moved) = (false, true);
        let (mut scene, mut normal) = (self.scene, self.normal);
        self.leave(on, &mut normal);
        for left in (0..=STEPS).rev() {
            let (step, gain) = scene.step(&normal, T::ZERO, table)?;
            if gain < T::of(LEAST_GAIN) {
                break;
            }
            scene = scene.moved(&step, table);
            if left == 0 || !self.has_gain_near(&scene, on) || !on.read(&scene) {
                return None;
            }
            work.worked_out(scene.count);
            self.leave(on, &mut normal);
        }
        (self.scene, self.normal, self.on.has_gain) = (scene, normal, true);
        let objective = self.ended_objective;
        let evidence = self.ended.evidence + objective - normal.objective();
        Some(Fit { scene, cost: normal.cost, evidence, ..self.ended })
    }

    /// Whether derivatives are those of contacts of a scene, near enough: where patterns serve too, or within what is known of them.
    fn has_gain_near(&self, scene: &Scene<T, K, D>, on: &On<'_, '_, T, K, D>) -> bool {
        let table = on.task.table;
        if scene.is_near(&self.ended.scene, T::of(NEAR), table) {
            return true;
        }
        let Some(posterior) = self.normal.posterior(&known(table, on.circuit)) else { return false };
        let ways = scene.ways_from(&self.ended.scene, table);
        let is_within = |i: usize| ways[i] * ways[i] < T::of(WITHIN * WITHIN) * posterior.covariance[i][i];
        (0..self.normal.count).all(|i| ways[i].abs() < T::of(NEAR) || is_within(i))
    }

    /// Sums up what the contacts that were read last leave of a frame.
    fn leave(&self, on: &mut On<'_, '_, T, K, D>, normal: &mut Normal<T, K>) {
        let Task { table, frame, errors, .. } = on.task;
        let held = &mut on.parts.held;
        held.leave(frame, T::of(table.head().full_v), errors.variance_v2.sqrt());
        normal.sum_up_left(on.circuit, self.radius_deviation, held);
    }
}
