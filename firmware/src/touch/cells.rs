//! What touches, of the readings of frames: all cells as they were read last, above the detector at rest.

use tactomo_protocol::{Scope, Status};
use tactomo_touch_core::{Frame, Says, Table};

use super::input::Input;
use super::rest::Rest;
use crate::scan::Scanned;

/// Cells of a detector: electrode `e` while `g` is grounded is `g n + e`.
#[derive(Debug)]
pub(super) struct Cells<const READINGS: usize> {
    rest: Rest<READINGS>,
    /// What was read last of each above rest (V), as no channel differs from others.
    touch_v: [f32; READINGS],
    says: [Says; READINGS],
}

impl<const READINGS: usize> Cells<READINGS> {
    pub const NONE: Self = Self { rest: Rest::NONE, touch_v: [0.0; READINGS], says: [Says::Nothing; READINGS] };

    /// Begins anew: the detector is at rest.
    pub fn restart(&mut self) {
        self.rest.restart();
        self.touch_v.fill(0.0);
        self.says.fill(Says::Nothing);
    }

    /// Takes a frame; returns what touches, or `None` while rest is being taken.
    pub fn touch(
        &mut self,
        table: &Table<'_>,
        input: &Input,
        (scanned, scope, readings): (&Scanned, &Scope, &[u16]),
    ) -> Option<Frame<'_>> {
        let (n, noise_v) = (table.electrodes(), table.head().noise_v);
        let ground_v = (input.drive_v - table.head().drive_v).max(0.0);
        let is_at_rest = !self.rest.is_taken();
        for ((g, e), reading) in scope.cells().zip(readings) {
            let cell = usize::from(g) * n + usize::from(e);
            let (Some(touch_v), Some(says)) = (self.touch_v.get_mut(cell), self.says.get_mut(cell)) else { continue };
            // One that timed out is zero.
            if *reading == 0 && scanned.status.contains(Status::TIMED_OUT) {
                *says = Says::Nothing;
                continue;
            }
            let (volts, read) = input.used_v(e, *reading, scanned.fraction_bits, ground_v);
            if is_at_rest {
                // What is below the floor is nothing, as the host has it.
                self.rest.add(cell, if read == Says::AtMost { 0.0 } else { volts }, noise_v);
            } else if self.rest.knows(cell) {
                (*touch_v, *says) = (table.corrected_v(usize::from(e), self.rest.above(cell, volts)), read);
            }
        }
        if is_at_rest {
            self.rest.look();
            return None;
        }
        if Rest::<READINGS>::was_touched(&self.touch_v, noise_v, n) {
            self.restart();
            return None;
        }
        let (volts, says) = (self.touch_v.get(..n * n)?, self.says.get(..n * n)?);
        Some(Frame { volts, says })
    }

    /// Nothing touches: what is left is drift.
    pub fn follow(&mut self) {
        self.rest.follow(&self.touch_v, &self.says);
    }
}
