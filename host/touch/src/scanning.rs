//! Which grounds to scan.
//!
//! A wire carries so many rows a second, whatever they are. Most of them are best spent on the few grounds that tell most of what touches
//! ([`Tracker::telling_grounds`](crate::solve::Tracker::telling_grounds)), some on all others in turn, for what is new.

use tactomo_physics::detector::Detector;

/// Grounds that are distinguished. More hardly say more of one to three contacts, and each is then older
/// (`tactomo-lab tradeoff --scan` compares).
pub const FOCUS: usize = 3;
/// Rows from one of the others to the next: what is new is seen within 25 ms on a wire of 921600 baud.
const OTHERS: usize = 4;
/// Time between two choices (s), at least: to take another plan over costs a board a millisecond or two.
pub const PAUSE_S: f64 = 0.04;
/// Time between two choices (s), at least, where a touch comes or goes.
pub const SHORT_PAUSE_S: f64 = 0.005;
/// Time for which whole frames are scanned at least (s) where rows do not tell what touches. It doubles up to the longest each time that rows, tried
/// again, do not tell it soon after.
const WHOLE_S: [f64; 2] = [0.5, 4.0];

/// What is attended to, chosen anew from time to time.
#[derive(Clone, Debug)]
pub struct Attention {
    /// Grounds that are distinguished.
    count: usize,
    last: Option<Last>,
    whole: Whole,
}

#[derive(Clone, Debug)]
struct Last {
    /// None: whole frames.
    grounds: Option<Vec<usize>>,
    touches: bool,
    at_s: f64,
}

/// When rows did not tell what touches.
#[derive(Clone, Copy, Debug)]
struct Whole {
    /// Until when they are not tried again, and how long that was (s).
    until_s: f64,
    time_s: f64,
}

impl Whole {
    /// Rows do not tell it (s).
    fn ask(&mut self, now_s: f64) {
        let is_soon = now_s - self.until_s < self.time_s;
        self.time_s = if is_soon { (2.0 * self.time_s).min(WHOLE_S[1]) } else { WHOLE_S[0] };
        self.until_s = now_s + self.time_s;
    }
}

impl Attention {
    /// To so many grounds at a time; [`FOCUS`] for frames of up to four rows.
    pub fn new(count: usize) -> Self {
        Self { count, last: None, whole: Whole { until_s: f64::NEG_INFINITY, time_s: 0.0 } }
    }

    /// Chooses anew, if it is time for that at `now_s` (s): `telling` gives the grounds that tell most, so many as it is asked for, or none where
    /// whole frames are needed, and `touches` is whether anything touches. Whether the choice is another one.
    pub fn consider(&mut self, now_s: f64, touches: bool, telling: impl FnOnce(usize) -> Option<Vec<usize>>) -> bool {
        let is_due = |last: &Last| {
            let pause_s = if last.touches == touches { PAUSE_S } else { SHORT_PAUSE_S };
            now_s - last.at_s >= pause_s
        };
        if !self.last.as_ref().is_none_or(is_due) {
            return false;
        }
        let mut grounds = None;
        if !touches || now_s >= self.whole.until_s {
            grounds = telling(self.count);
            if touches && grounds.is_none() {
                self.whole.ask(now_s);
            }
        }
        let is_new = self.last.as_ref().is_none_or(|last| !are_same(&last.grounds, &grounds));
        let grounds = if is_new { grounds } else { self.last.take().and_then(|last| last.grounds) };
        self.last = Some(Last { grounds, touches, at_s: now_s });
        is_new
    }

    /// The grounds that are attended to; none where whole frames are, or nothing was chosen yet.
    pub fn grounds(&self) -> Option<&[usize]> {
        self.last.as_ref()?.grounds.as_deref()
    }
}

/// Whether two choices are alike: grounds in another order are the same choice.
fn are_same(some: &Option<Vec<usize>>, others: &Option<Vec<usize>>) -> bool {
    let sorted = |grounds: &Option<Vec<usize>>| {
        let mut grounds = grounds.clone();
        grounds.iter_mut().for_each(|grounds| grounds.sort_unstable());
        grounds
    };
    sorted(some) == sorted(others)
}

/// One round of rows of a detector of so many electrodes: `focus` again and again, and after each few one of all, in turn, in `longest` rows at
/// most if that can be. Without any `focus` all have their turn alone.
pub fn with_others(focus: &[usize], electrodes: usize, longest: usize) -> Vec<usize> {
    if focus.len() >= electrodes {
        return focus.to_vec();
    }
    let between = OTHERS.min(longest / electrodes.max(1)).max(2);
    let mut next = focus.iter().copied().cycle();
    let row = |row: usize| match row % between {
        last if last + 1 == between => Some(row / between),
        _ => next.next(),
    };
    (0..electrodes * between).filter_map(row).collect()
}

/// Electrodes that are far apart: each the one farthest from those before, from the one farthest from the middle on.
pub fn spread(detector: &Detector, count: usize) -> Vec<usize> {
    let pads = &detector.electrodes;
    let apart_m = |a: usize, b: usize| (pads[a].x_m - pads[b].x_m).hypot(pads[a].y_m - pads[b].y_m);
    let from_middle_m = |pad: usize| pads[pad].x_m.hypot(pads[pad].y_m);
    let first = (0..pads.len()).max_by(|a, b| from_middle_m(*a).total_cmp(&from_middle_m(*b)));
    let mut chosen: Vec<usize> = first.into_iter().collect();
    while chosen.len() < count.min(pads.len()) {
        let nearest_m = |pad: &usize| chosen.iter().map(|other| apart_m(*pad, *other)).fold(f64::INFINITY, f64::min);
        let Some(next) = (0..pads.len()).max_by(|a, b| nearest_m(a).total_cmp(&nearest_m(b))) else { break };
        chosen.push(next);
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_holds_for_a_while_unless_a_touch_comes_or_goes() {
        let mut attention = Attention::new(FOCUS);
        assert_eq!(attention.grounds(), None);
        assert!(attention.consider(0.0, true, |count| Some(vec![7; count])));
        assert_eq!(attention.grounds(), Some(&[7; FOCUS][..]));
        assert!(!attention.consider(0.03, true, |_| unreachable!("too soon")));
        assert!(attention.consider(0.045, true, |_| Some(vec![3, 1, 2])));
        assert!(!attention.consider(0.09, true, |_| Some(vec![2, 3, 1])), "the same");
        assert!(!attention.consider(0.094, false, |_| unreachable!("too soon for a touch that goes")));
        assert!(attention.consider(0.096, false, |_| Some(vec![5, 10])));
    }

    #[test]
    fn rows_that_do_not_tell_what_touches_are_tried_again_later_and_later() {
        let mut attention = Attention::new(FOCUS);
        let (mut tried_s, mut now_s) = (Vec::new(), 0.0);
        let some = |_| Some(vec![1, 2, 3]);
        while now_s < 20.0 {
            let mut none = |_| {
                tried_s.push(now_s);
                None
            };
            // Nothing touches now and then, which shows in rows all the same.
            match (now_s % 0.3) < 0.05 {
                true => _ = attention.consider(now_s, false, some),
                false => _ = attention.consider(now_s, true, &mut none),
            }
            now_s += 0.01;
        }
        let apart_s: Vec<_> = tried_s.windows(2).map(|pair| (pair[1] - pair[0]).round()).collect();
        assert_eq!(apart_s, [1.0, 1.0, 2.0, 4.0, 4.0, 4.0, 4.0], "{tried_s:?}");
        assert!(attention.consider(30.0, true, some), "and then they do");
        assert_eq!(attention.grounds(), Some(&[1, 2, 3][..]));
        assert!(attention.consider(40.0, true, |_| None) && attention.consider(40.6, true, some), "anew");
    }

    #[test]
    fn all_others_have_their_turn_between_those_that_are_attended_to() {
        assert_eq!(with_others(&[2, 0, 1], 3, 64), [2, 0, 1], "there are no others");
        assert_eq!(with_others(&[5, 10], 16, 64)[..8], [5, 10, 5, 0, 10, 5, 10, 1]);
        for (electrodes, longest) in [(4, 64), (9, 64), (16, 64), (25, 64), (32, 64), (32, 1)] {
            let rows = with_others(&[0, 1, 3], electrodes, longest);
            assert!((0..electrodes).all(|ground| rows.contains(&ground)), "{electrodes}");
            assert!(rows.len() <= longest.max(2 * electrodes), "{electrodes}");
        }
    }

    #[test]
    fn four_that_are_far_apart_are_the_corners() {
        let mut four = spread(&Detector::preset(Detector::DEFAULT).unwrap(), 4);
        assert!(
            four[..2] == [0, 15] || four[..2] == [15, 0] || four[..2] == [3, 12] || four[..2] == [12, 3],
            "{four:?}"
        );
        four.sort_unstable();
        assert_eq!(four, [0, 3, 12, 15]);
    }
}
