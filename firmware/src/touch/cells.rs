//! What touches, of the readings of frames: all cells as they were read last, above the detector at rest.

use tactomo_protocol::{Scope, Status};
use tactomo_touch_core::{Answer, Flags, Frame, Says, Table};

use super::input::Input;
use super::rest::Rest;
use crate::scan::Scanned;

/// Conductance of a contact that may be in readings at rest (sheet conductances), the host's (`host/board/src/baseline/rest_test.rs`): offsets and leakage of 8
/// detectors as built look like contacts of 0.0003 to 0.0018.
const LIGHT_SHEETS: f32 = 0.003;

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

    /// Takes a frame.
    pub fn take(&mut self, table: &Table<'_>, input: &Input, (scanned, scope, readings): (&Scanned, &Scope, &[u16])) {
        let (n, noise_v) = (table.electrodes(), table.head().noise_v);
        let ground_v = (input.drive_v - table.head().drive_v).max(0.0);
        for ((g, e), reading) in scope.cells().zip(readings) {
            let cell = usize::from(g) * n + usize::from(e);
            let (Some(touch_v), Some(says)) = (self.touch_v.get_mut(cell), self.says.get_mut(cell)) else { continue };
            // One that timed out is zero.
            if *reading == 0 && scanned.status.contains(Status::TIMED_OUT) {
                *says = Says::Nothing;
                continue;
            }
            let (volts, read) = input.used_v(e, *reading, scanned.fraction_bits, ground_v);
            if !self.rest.is_known() {
                // What is below the floor is nothing, as the host has it.
                self.rest.add(cell, if read == Says::AtMost { 0.0 } else { volts }, noise_v);
            }
            (*touch_v, *says) = (table.corrected_v(usize::from(e), self.rest.above(cell, volts)), read);
        }
        if self.rest.was_touched(&self.touch_v, noise_v, n) {
            self.rest.restart();
        }
    }

    /// What touches.
    pub fn touch(&self, table: &Table<'_>) -> Option<Frame<'_>> {
        let readings = table.electrodes() * table.electrodes();
        Some(Frame::new(self.touch_v.get(..readings)?, self.says.get(..readings)?))
    }

    /// What touches of one cell (V).
    #[cfg(test)]
    pub fn touch_v(&self, cell: usize) -> f32 {
        self.touch_v.get(cell).copied().unwrap_or(f32::NAN)
    }

    /// Whether readings at rest are known.
    pub fn knows_rest(&self) -> bool {
        self.rest.is_known()
    }

    /// Learns of rest by the answer to the last frame; returns whether rest has become known. Contacts are no rest, however long they stand still, unless they are
    /// as light as what offsets and leakage look like.
    pub fn learn(&mut self, answer: &Answer, table: &Table<'_>) -> bool {
        let contacts = answer.contacts();
        if self.rest.is_known() {
            if contacts.is_empty() && !answer.flags.has(Flags::MISFIT) {
                // What is left is drift.
                self.rest.follow(&self.touch_v, &self.says);
            }
            return false;
        }
        let light_s = LIGHT_SHEETS * table.head().sheet_s;
        let is_touched = contacts.iter().any(|contact| contact.apparent_conductance_s > light_s);
        let is_rest = self.rest.has_stood_still() && !is_touched;
        if is_rest {
            self.rest.take();
        }
        is_rest
    }
}
