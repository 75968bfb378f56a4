//! Which electrodes are grounded, row after row.

use tactomo_physics::detector::Detector;
use tactomo_touch::scanning::{Attention, FOCUS, spread, with_others};

/// How grounds are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Choice {
    /// All of them, in frames that are whole.
    Whole,
    /// As in live: all in turn for what stands; those that tell most of what moves, and every fourth row one of all in turn.
    Adaptive,
    /// All of them in turn, of which those that follow each other are apart.
    InTurn,
    /// The four at the corners, as in the paper's second demonstration.
    Corners,
}

impl Choice {
    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Whole => "whole",
            Self::Adaptive => "adaptive",
            Self::InTurn => "in turn",
            Self::Corners => "corners",
        }
    }
}

/// Grounds row after row, without an end.
pub(super) struct Grounds {
    round: Vec<usize>,
    next: usize,
    electrodes: usize,
    /// Of an adaptive choice.
    attention: Option<Attention>,
}

impl Grounds {
    /// For frames of so many rows of a detector; `watching` are those that an adaptive choice begins with, before anything touches.
    pub fn new(choice: Choice, rows: usize, detector: &Detector, watching: impl FnOnce(usize) -> Vec<usize>) -> Self {
        let electrodes = detector.electrodes.len();
        // Longer frames take more grounds, or they would hold one many times.
        let attention = || Attention::new(FOCUS.max(rows * 3 / 4));
        let (round, attention) = match choice {
            Choice::Whole => ((0..electrodes).collect(), None),
            Choice::InTurn => (in_turn(electrodes), None),
            Choice::Corners => (spread(detector, 4), None),
            Choice::Adaptive => (Vec::new(), Some(attention())),
        };
        let mut grounds = Self { round, next: 0, electrodes, attention };
        grounds.consider(f64::NEG_INFINITY, false, watching);
        grounds
    }

    /// Those of the next rows.
    pub fn take(&mut self, rows: usize) -> Vec<usize> {
        let taken = (0..rows).map(|row| self.round[(self.next + row) % self.round.len()]).collect();
        self.next += rows;
        taken
    }

    /// Chooses anew, if that is adaptive and it is time: `telling` are the grounds that tell most, so many of them. Whether the plan is another.
    pub fn consider(&mut self, now_s: f64, touches: bool, telling: impl FnOnce(usize) -> Vec<usize>) -> bool {
        let Some(attention) = &mut self.attention else { return false };
        let is_new = attention.consider(now_s, touches, |count| Some(telling(count)));
        if is_new {
            let focus = attention.grounds().unwrap_or_default();
            (self.round, self.next) = (with_others(focus, self.electrodes, usize::MAX), 0);
        }
        is_new
    }
}

/// All grounds, each seven sixteenths of all from the one before: on a square of 16 any four in a row are in four rows or columns.
fn in_turn(electrodes: usize) -> Vec<usize> {
    let common = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let step = (7 * electrodes / 16..).find(|step| common(*step, electrodes) == 1).unwrap_or(1);
    (0..electrodes).map(|index| index * step % electrodes).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grounds(choice: Choice, rows: usize) -> Grounds {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        Grounds::new(choice, rows, &detector, |count| [10, 5, 6, 9, 0, 15][..count].to_vec())
    }

    #[test]
    fn fixed_grounds_go_round_and_round() {
        let mut in_turn = grounds(Choice::InTurn, 3);
        let mut round: Vec<_> = (0..16).flat_map(|_| in_turn.take(3)).collect();
        assert_eq!(round[..4], [0, 7, 14, 5]);
        round.sort_unstable();
        assert!((0..16).all(|g| round[3 * g..3 * g + 3] == [g; 3]), "{round:?}");
        let mut four = grounds(Choice::Corners, 4).take(4);
        four.sort_unstable();
        assert_eq!(four, [0, 3, 12, 15]);
    }

    #[test]
    fn an_adaptive_choice_goes_on_with_another_plan() {
        let mut adaptive = grounds(Choice::Adaptive, 2);
        assert_eq!(adaptive.take(8), [10, 5, 6, 0, 10, 5, 6, 1]);
        assert!(adaptive.consider(0.0, true, |_| vec![3, 2, 1]));
        assert_eq!(adaptive.take(4), [3, 2, 1, 0]);
        assert!(!adaptive.consider(0.01, true, |_| vec![4, 5, 6]), "too soon");
        assert_eq!(adaptive.take(4), [3, 2, 1, 1]);
        assert_eq!(grounds(Choice::Adaptive, 8).take(7), [10, 5, 6, 0, 9, 0, 15], "longer frames have more of them");
    }
}
