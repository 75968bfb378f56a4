//! The frames of a rub, spread over the detector, and where it has been rubbed.

use std::collections::VecDeque;

use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_touch::calibrate::Frame;
use tactomo_touch::solve::FoundContact;

/// Cells along the longer side: 5 mm on a detector of 60 mm, about half a fingertip.
const CELLS: usize = 12;
/// A contact covers the cells whose middle is within so many of its cell's sides: what a fingertip feels.
const COVERS: f64 = 1.0;
/// Sheet conductances from which on a press is firm.
const FIRM: f64 = 0.3;
/// Frames that are kept of each cell and firmness, the newest: 3456 at most on a square detector, 7 MB of 16 electrodes.
const KEPT: usize = 12;
/// What is felt in a cell: a light press, a firm one, or both.
pub(super) const FELT_LIGHT: u8 = 1;
pub(super) const FELT_FIRM: u8 = 2;

/// Cells of the detector, and which have been rubbed.
#[derive(Clone, Debug, PartialEq)]
pub struct Coverage {
    /// Cells along x and y.
    pub cells: [usize; 2],
    /// Corners of the detector (m).
    pub bounds_m: [[f64; 2]; 2],
    /// What was felt in each cell, row by row from the smallest y: 1 a light press, 2 a firm one, 3 both; `None` beside the detector.
    pub felt: Vec<Option<u8>>,
}

/// Frames of a rub.
pub(super) struct Collected {
    pub coverage: Coverage,
    /// The newest frames of each cell, light ones and firm ones, with their numbers.
    bins: Vec<VecDeque<(u64, Frame)>>,
    firm_s: f64,
    /// Frames that something touched in.
    pub touched: u64,
}

impl Coverage {
    pub(super) fn new(detector: &Detector) -> Self {
        let bounds_m = detector.outline.bounds();
        let [low, high] = bounds_m;
        let size_m = [high[0] - low[0], high[1] - low[1]];
        let cell_m = size_m[0].max(size_m[1]) / CELLS as f64;
        let cells = size_m.map(|size_m| ((size_m / cell_m).round() as usize).max(1));
        let mut coverage = Self { cells, bounds_m, felt: Vec::new() };
        let all = 0..cells[0] * cells[1];
        coverage.felt = all.map(|cell| detector.outline.holds(coverage.middle_m(cell)).then_some(0)).collect();
        coverage
    }

    /// Share of the detector's cells that have been rubbed, however firmly.
    pub fn share(&self) -> f64 {
        let on = self.felt.iter().flatten();
        on.clone().filter(|felt| **felt > 0).count() as f64 / on.count().max(1) as f64
    }

    /// The middle of the detector (m).
    pub(super) fn centre_m(&self) -> [f64; 2] {
        [0, 1].map(|axis| (self.bounds_m[0][axis] + self.bounds_m[1][axis]) / 2.0)
    }

    /// Whether the detector ends beside the cell along x, and along y.
    fn ends_beside(&self, cell: usize) -> [bool; 2] {
        let [columns, rows] = self.cells;
        let is_on = |along: usize, step: isize, cells: usize, stride: isize| {
            let is_inside = along.checked_add_signed(step).is_some_and(|next| next < cells);
            is_inside && self.felt[cell.wrapping_add_signed(step * stride)].is_some()
        };
        let across = [-1, 1].into_iter().all(|step| is_on(cell % columns, step, columns, 1));
        let down = [-1, 1].into_iter().all(|step| is_on(cell / columns, step, rows, columns as isize));
        [!across, !down]
    }

    /// Whether it is a corner, where contacts are found millimetres off.
    pub(super) fn is_corner(&self, cell: usize) -> bool {
        self.ends_beside(cell) == [true; 2]
    }

    /// Where to press for this cell (m): its middle, or half a cell further in where the detector ends, for a fingertip does not reach it there.
    pub(super) fn pressed_at_m(&self, cell: usize) -> [f64; 2] {
        let (middle_m, centre_m, ends) = (self.middle_m(cell), self.centre_m(), self.ends_beside(cell));
        [0, 1].map(|axis| {
            let inwards_m = (centre_m[axis] - middle_m[axis]).clamp(-0.5 * self.side_m(axis), 0.5 * self.side_m(axis));
            middle_m[axis] + if ends[axis] { inwards_m } else { 0.0 }
        })
    }

    /// Cells that a contact here covers, beside the detector too.
    pub(super) fn covered(&self, at_m: [f64; 2]) -> impl Iterator<Item = usize> {
        let reach_m = COVERS * self.side_m(0).max(self.side_m(1));
        (0..self.felt.len()).filter(move |cell| {
            let middle_m = self.middle_m(*cell);
            // The next cell's middle is within reach, however it is rounded.
            (middle_m[0] - at_m[0]).hypot(middle_m[1] - at_m[1]) <= reach_m * (1.0 + 1e-9)
        })
    }

    pub(super) fn side_m(&self, axis: usize) -> f64 {
        (self.bounds_m[1][axis] - self.bounds_m[0][axis]) / self.cells[axis] as f64
    }

    pub(super) fn middle_m(&self, cell: usize) -> [f64; 2] {
        let index = [cell % self.cells[0], cell / self.cells[0]];
        [0, 1].map(|axis| self.bounds_m[0][axis] + (index[axis] as f64 + 0.5) * self.side_m(axis))
    }

    fn cell_at(&self, at_m: [f64; 2]) -> usize {
        let index = |axis: usize| {
            let cell = ((at_m[axis] - self.bounds_m[0][axis]) / self.side_m(axis)).floor();
            (cell.max(0.0) as usize).min(self.cells[axis] - 1)
        };
        index(1) * self.cells[0] + index(0)
    }

    pub(super) fn cover(&mut self, at_m: [f64; 2], felt: u8) {
        let covered: Vec<usize> = self.covered(at_m).collect();
        for cell in covered {
            self.felt[cell] = self.felt[cell].map(|before| before | felt);
        }
    }
}

impl Collected {
    pub fn new(detector: &Detector) -> Self {
        let coverage = Coverage::new(detector);
        let bins = vec![VecDeque::new(); 2 * coverage.felt.len()];
        Self { coverage, bins, firm_s: FIRM * detector.sheet_conductance_s(), touched: 0 }
    }

    /// Takes a frame: readings (V) less the baseline, and what was found in it, on the detector's map. Where there are several contacts the
    /// strongest tells which cell it is: frames of several are sorted out by the fit.
    pub fn take(&mut self, readings: &Readings, contacts: &[FoundContact], detector: &Detector) {
        let strongest = contacts.iter().max_by(|a, b| a.conductance_s.total_cmp(&b.conductance_s));
        let Some(contact) = strongest.filter(|contact| contact.conductance_s > 0.0) else { return };
        let at_m = detector.map_m([contact.x_m, contact.y_m, contact.z_m]);
        if !at_m.iter().all(|m| m.is_finite()) {
            return;
        }
        let is_firm = contact.conductance_s >= self.firm_s;
        self.coverage.cover(at_m, if is_firm { FELT_FIRM } else { FELT_LIGHT });
        let bin = &mut self.bins[2 * self.coverage.cell_at(at_m) + usize::from(is_firm)];
        if bin.len() == KEPT {
            bin.pop_front();
        }
        self.touched += 1;
        bin.push_back((self.touched, Frame { readings: readings.clone(), known_m: None }));
    }

    /// The frames that are kept, in the order in which they came: those that stood still follow each other.
    pub fn frames(&self) -> Vec<Frame> {
        let mut all: Vec<_> = self.bins.iter().flatten().collect();
        all.sort_by_key(|(number, _)| *number);
        all.into_iter().map(|(_, frame)| frame.clone()).collect()
    }

    /// Cells with frames, light and firm ones counted apart.
    pub fn filled(&self) -> usize {
        self.bins.iter().filter(|bin| !bin.is_empty()).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_spread_and_bounded_however_long_one_rubs() {
        let detector = Detector::default();
        let mut collected = Collected::new(&detector);
        let readings = Readings::from_fn(16, |_, _| 0.1);
        let press = |x_m, share: f64| FoundContact::flat(x_m, 0.0, share * detector.sheet_conductance_s());
        for _ in 0..1000 {
            collected.take(&readings, &[press(0.01, 0.1), press(-0.01, 0.05)], &detector);
            collected.take(&readings, &[press(0.01, 1.0)], &detector);
            collected.take(&readings, &[], &detector);
        }
        assert_eq!((collected.frames().len(), collected.filled(), collected.touched), (2 * KEPT, 2, 2000));
        let Coverage { cells, felt, .. } = &collected.coverage;
        assert_eq!(*cells, [CELLS; 2]);
        assert_eq!(felt[collected.coverage.cell_at([0.01, 0.0])], Some(3));
        assert_eq!(felt[collected.coverage.cell_at([-0.01, 0.0])], Some(0), "the weaker contact is not counted");
        assert!(collected.coverage.share() > 0.0 && collected.coverage.share() < 0.1);
    }
}
