//! Which electrodes are grounded, row after row.

use tactomo_physics::detector::Detector;

/// How grounds are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Choice {
    /// All of them, in frames that are whole.
    Whole,
    /// Those that tell most of what touches, and every fourth row one of all in turn, as in live.
    Adaptive,
    /// All of them in turn, of which those that follow each other are apart.
    InTurn,
    /// The four at the corners, as in the paper's second demonstration.
    Corners,
}

/// Grounds that are told apart, as in live, of frames of up to four rows. Longer ones take more of them, or hold one ground many times.
const FOCUS: usize = 3;
/// Rows from one of the others to the next, as in live.
const OTHERS: usize = 4;
/// Time between two plans (s), and where a touch comes or goes, as in live.
const PAUSE_S: f64 = 40e-3;
const SHORT_PAUSE_S: f64 = 5e-3;

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
    adaptive: Option<Adaptive>,
}

/// What an adaptive choice is about.
struct Adaptive {
    count: usize,
    electrodes: usize,
    focus: Vec<usize>,
    touches: bool,
    /// Time of the last choice (s).
    at_s: f64,
}

impl Grounds {
    /// For frames of so many rows of a detector; `watching` are those that an adaptive choice begins with, before anything touches.
    pub fn new(choice: Choice, rows: usize, detector: &Detector, watching: impl FnOnce(usize) -> Vec<usize>) -> Self {
        let electrodes = detector.electrodes.len();
        let (round, adaptive) = match choice {
            Choice::Whole => ((0..electrodes).collect(), None),
            Choice::InTurn => (in_turn(electrodes), None),
            Choice::Corners => (corners(detector), None),
            Choice::Adaptive => {
                let count = FOCUS.max(rows * (OTHERS - 1) / OTHERS);
                let focus = sorted(watching(count));
                let round = with_others(&focus, electrodes);
                (round, Some(Adaptive { count, electrodes, focus, touches: false, at_s: f64::NEG_INFINITY }))
            }
        };
        Self { round, next: 0, adaptive }
    }

    /// Those of the next rows.
    pub fn take(&mut self, rows: usize) -> Vec<usize> {
        let taken = (0..rows).map(|row| self.round[(self.next + row) % self.round.len()]).collect();
        self.next += rows;
        taken
    }

    /// Chooses anew, if that is adaptive and it is time: `telling` are the grounds that tell most, so many of them. Whether the plan is another.
    pub fn consider(&mut self, now_s: f64, touches: bool, telling: impl FnOnce(usize) -> Vec<usize>) -> bool {
        let Some(adaptive) = &mut self.adaptive else { return false };
        let pause_s = if adaptive.touches == touches { PAUSE_S } else { SHORT_PAUSE_S };
        if now_s - adaptive.at_s < pause_s {
            return false;
        }
        (adaptive.at_s, adaptive.touches) = (now_s, touches);
        let focus = sorted(telling(adaptive.count));
        let is_new = focus != adaptive.focus;
        if is_new {
            (self.round, self.next) = (with_others(&focus, adaptive.electrodes), 0);
            adaptive.focus = focus;
        }
        is_new
    }
}

fn sorted(mut grounds: Vec<usize>) -> Vec<usize> {
    grounds.sort_unstable();
    grounds
}

/// Some grounds round and round, and all in turn between them.
fn with_others(focus: &[usize], electrodes: usize) -> Vec<usize> {
    let mut next = focus.iter().copied().cycle();
    let row = |row: usize| match row % OTHERS {
        last if last + 1 == OTHERS => Some(row / OTHERS),
        _ => next.next(),
    };
    (0..electrodes * OTHERS).filter_map(row).collect()
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

/// The electrodes nearest to the corners of the outline's box.
fn corners(detector: &Detector) -> Vec<usize> {
    let [low_m, high_m] = detector.outline.bounds();
    let nearest = |x_m: f64, y_m: f64| {
        let apart_m = |pad: &usize| {
            let pad = &detector.electrodes[*pad];
            (pad.x_m - x_m).hypot(pad.y_m - y_m)
        };
        (0..detector.electrodes.len()).min_by(|a, b| apart_m(a).total_cmp(&apart_m(b)))
    };
    let at = [[low_m[0], low_m[1]], [high_m[0], high_m[1]], [high_m[0], low_m[1]], [low_m[0], high_m[1]]];
    at.into_iter().filter_map(|[x_m, y_m]| nearest(x_m, y_m)).collect()
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
    fn an_adaptive_choice_has_all_others_and_waits_between_plans() {
        let mut adaptive = grounds(Choice::Adaptive, 2);
        assert_eq!(adaptive.take(8), [5, 6, 10, 0, 5, 6, 10, 1]);
        assert!(adaptive.consider(0.0, true, |_| vec![1, 2, 3]));
        assert!(!adaptive.consider(0.03, true, |_| vec![4, 5, 6]), "too soon");
        assert!(!adaptive.consider(0.05, true, |_| vec![3, 2, 1]), "the same");
        assert!(adaptive.consider(0.1, true, |_| vec![4, 5, 6]));
        assert_eq!(adaptive.take(4), [4, 5, 6, 0]);
        assert!(!adaptive.consider(0.104, false, |_| vec![5, 10]) && adaptive.consider(0.106, false, |_| vec![5, 10]));
        assert_eq!(grounds(Choice::Adaptive, 8).take(7), [0, 5, 6, 0, 9, 10, 15], "longer frames have more of them");
    }
}
