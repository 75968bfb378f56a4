//! Which rows the board scans, as its frames say.

use std::collections::VecDeque;

use tactomo_protocol::{MAX_PLAN_ROWS, Scope};

use super::scanning::ScanChoice;

/// Share of the rows of the ground that is scanned most, below which a ground only has its turn now and then.
const OFTEN: f64 = 1.0 / 3.0;

/// Which rows are scanned at the moment.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Scan {
    /// What was asked for.
    pub choice: ScanChoice,
    /// The grounds of the rows that come most, in ascending order; none if whole frames come.
    pub grounds: Vec<u8>,
    /// Whether others have their turn between these.
    pub others: bool,
}

/// The grounds of the newest rows.
#[derive(Debug, Default)]
pub(super) struct Scanned {
    choice: ScanChoice,
    /// As many as a plan has at most; none of whole frames.
    grounds: VecDeque<u8>,
}

impl Scanned {
    /// Nothing has come yet of what was asked for.
    pub fn new(choice: ScanChoice) -> Self {
        Self { choice, grounds: VecDeque::with_capacity(MAX_PLAN_ROWS) }
    }

    /// Takes note of a frame.
    pub fn add(&mut self, scope: &Scope) {
        if scope.is_whole() {
            self.grounds.clear();
            return;
        }
        for row in 0..scope.rows() {
            if self.grounds.len() == MAX_PLAN_ROWS {
                self.grounds.pop_front();
            }
            self.grounds.push_back(scope.ground(row));
        }
    }

    /// What is scanned.
    pub fn scan(&self) -> Scan {
        let mut counts = [0_usize; u8::MAX as usize + 1];
        self.grounds.iter().for_each(|ground| counts[usize::from(*ground)] += 1);
        let most = counts.iter().copied().max().unwrap_or_default();
        let (often, others): (Vec<u8>, Vec<u8>) = (0..=u8::MAX)
            .filter(|ground| counts[usize::from(*ground)] > 0)
            .partition(|ground| counts[usize::from(*ground)] as f64 >= OFTEN * most as f64);
        Scan { choice: self.choice.clone(), grounds: often, others: !others.is_empty() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scanned(grounds: &[u8]) -> Scanned {
        let mut scanned = Scanned::new(ScanChoice::Adaptive);
        for rows in grounds.chunks(2) {
            scanned.add(&Scope::of_rows(16, rows, 0xffff).expect("rows of 16 electrodes"));
        }
        scanned
    }

    #[test]
    fn grounds_that_come_most_are_told_apart_from_those_that_have_their_turn() {
        let turns: Vec<u8> = (0..16).flat_map(|other| [10, 5, 10, 5, other, 5, 10, 5]).collect();
        let scan = Scan { choice: ScanChoice::Adaptive, grounds: vec![5, 10], others: true };
        assert_eq!(scanned(&turns).scan(), scan);
        let four: Vec<u8> = [15, 0, 12, 3].repeat(10);
        assert_eq!(scanned(&four).scan(), Scan { grounds: vec![0, 3, 12, 15], others: false, ..scan });
    }

    #[test]
    fn the_newest_rows_count_and_whole_frames_have_no_grounds() {
        let mut scanned = scanned(&[[1, 2].repeat(100), [7, 8].repeat(48)].concat());
        assert_eq!(scanned.scan().grounds, [7, 8]);
        scanned.add(&Scope::whole(16).expect("16 electrodes"));
        assert_eq!(scanned.scan(), Scan { choice: ScanChoice::Adaptive, ..Scan::default() });
    }
}
