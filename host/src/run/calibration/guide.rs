//! Where to press next, and how hard.

use super::collected::{Coverage, FELT_FIRM, FELT_LIGHT};

/// Targets of one firmness before those of the other: a person need not change with every press.
const IN_A_ROW: usize = 8;
/// Looks, of which there are some twelve a second, at a target that is pressed at and not reached: six seconds.
const PATIENCE: u32 = 75;

/// Where to press next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// The place (m).
    pub at_m: [f64; 2],
    /// Whether to press firmly, else lightly.
    pub firm: bool,
}

/// Chooses targets, one after the other: the next is near, and covers much that has not been felt.
#[derive(Debug, Default)]
pub(super) struct Guide {
    /// The cell that is to be felt, and how.
    wanted: Option<(usize, u8)>,
    /// Targets that were reached.
    reached: usize,
    /// Looks at this target while something pressed, and frames pressed at the last of them.
    looks: u32,
    touched: u64,
    /// What was asked for long and not felt: a place where nothing can press, or a finger that cannot press so hard.
    given_up: Vec<(usize, u8)>,
}

impl Guide {
    /// The target of now, after so many frames that something touched in; `None` once there is nothing left to ask for.
    pub fn target(&mut self, coverage: &Coverage, touched: u64) -> Option<Target> {
        self.looks += u32::from(touched > self.touched);
        self.touched = touched;
        let given_up = self.wanted.filter(|_| self.looks > PATIENCE);
        self.given_up.extend(given_up);
        if given_up.is_some() || self.wanted.is_none_or(|(cell, felt)| has_felt(coverage, cell, felt)) {
            self.reached += usize::from(self.wanted.is_some());
            self.looks = 0;
            self.wanted = self.next(coverage);
        }
        self.wanted.map(|(cell, felt)| Target { at_m: coverage.pressed_at_m(cell), firm: felt == FELT_FIRM })
    }

    /// The best cell for the firmness whose turn it is, or else for the other: first everywhere once, then everywhere the other way too.
    fn next(&self, coverage: &Coverage) -> Option<(usize, u8)> {
        let turn = if (self.reached / IN_A_ROW).is_multiple_of(2) { FELT_FIRM } else { FELT_LIGHT };
        let other = (FELT_FIRM | FELT_LIGHT) & !turn;
        let wishes = [(turn, true), (turn, false), (other, false)];
        wishes.into_iter().find_map(|(felt, is_new)| Some((self.best(coverage, felt, is_new)?, felt)))
    }

    /// The cell that a press of this firmness gives most for a short way; if asked, of those cells only that nothing has touched.
    fn best(&self, coverage: &Coverage, felt: u8, is_new: bool) -> Option<usize> {
        let from_m = self.wanted.map_or_else(|| coverage.centre_m(), |(cell, _)| coverage.middle_m(cell));
        let gains = |cell: usize| !has_felt(coverage, cell, felt) && (!is_new || coverage.felt[cell] == Some(0));
        let side_m = coverage.side_m(0).max(coverage.side_m(1));
        let worth = |cell: usize| {
            let at_m = coverage.pressed_at_m(cell);
            let covered = coverage.covered(at_m).filter(|covered| gains(*covered)).count() as f64;
            // A new cell is worth a way of two cells.
            covered - 0.5 * (at_m[0] - from_m[0]).hypot(at_m[1] - from_m[1]) / side_m
        };
        let is_askable =
            |cell: &usize| gains(*cell) && !coverage.is_corner(*cell) && !self.given_up.contains(&(*cell, felt));
        (0..coverage.felt.len()).filter(is_askable).max_by(|a, b| worth(*a).total_cmp(&worth(*b)))
    }
}

fn has_felt(coverage: &Coverage, cell: usize, felt: u8) -> bool {
    coverage.felt[cell].is_none_or(|before| before & felt != 0)
}

#[cfg(test)]
mod tests {
    use tactomo_physics::detector::Detector;

    use super::*;

    #[test]
    fn who_follows_it_feels_the_whole_detector_lightly_and_firmly() {
        let mut coverage = Coverage::new(&Detector::default());
        let mut guide = Guide::default();
        let (mut way_m, mut at_m, mut presses) = (0.0, [0.0; 2], Vec::new());
        while let Some(target) = guide.target(&coverage, 0) {
            assert_eq!(guide.target(&coverage, 0), Some(target), "it stays until it is reached");
            // Where a fingertip gets: its middle a few millimetres from the wall.
            assert!(target.at_m.iter().all(|m| m.abs() < 0.026), "{target:?}");
            coverage.cover(target.at_m, if target.firm { FELT_FIRM } else { FELT_LIGHT });
            way_m += (target.at_m[0] - at_m[0]).hypot(target.at_m[1] - at_m[1]);
            at_m = target.at_m;
            presses.push(target.firm);
            assert!(presses.len() < 200, "it has no end");
        }
        let both = coverage.felt.iter().flatten().filter(|felt| **felt == 3).count();
        assert!(both as f64 > 0.95 * coverage.felt.len() as f64, "{both} cells both ways");
        // A minute of two presses a second, with a change of firmness every few seconds.
        let turns = presses.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert!(presses.len() <= 120 && turns <= 16, "{} presses, {turns} turns", presses.len());
        assert!(way_m / (presses.len() as f64) < 0.02, "{way_m} m for {} presses", presses.len());
    }

    #[test]
    fn what_cannot_be_felt_is_given_up_after_long_pressing_and_not_asked_for_again() {
        let coverage = Coverage::new(&Detector::default());
        let mut guide = Guide::default();
        let first = guide.target(&coverage, 0);
        for _ in 0..1000 {
            assert_eq!(guide.target(&coverage, 0), first, "nothing presses");
        }
        let mut asked = Vec::new();
        for touched in 1..=100_000 {
            let target = guide.target(&coverage, touched);
            if asked.last() != Some(&target) {
                asked.push(target);
            }
        }
        assert!(asked.len() > 100 && asked.last() == Some(&None), "{} targets", asked.len());
        let mut places: Vec<_> = asked.iter().map(|target| format!("{target:?}")).collect();
        places.sort();
        places.dedup();
        assert_eq!(places.len(), asked.len(), "none twice");
    }
}
