//! Whole frames of a board that scans rows: for what needs every reading, and each of them once.

use super::{Readings, Says};

/// Longest time from the first rows of a round to its last (s): twice what a round of an adaptive plan takes on a wire of 921600 baud. A finger
/// that moves meanwhile makes a frame that agrees with no single contact; and a plan that leaves grounds out has rounds all the same.
const LONGEST_S: f64 = 0.05;

/// Gathers rows to rounds.
#[derive(Clone, Debug, Default)]
pub struct Rounds {
    gathered: Option<(Readings, f64)>,
    waiting: u64,
}

impl Rounds {
    /// Takes readings (V) of a time (s), and gives those of a round: once each was read since the last round, or else, with what was read,
    /// when its time is up. Readings that are whole are a round as they are.
    pub fn add(&mut self, readings: &Readings, time_s: f64) -> Option<Readings> {
        self.waiting += 1;
        let fits = |(gathered, begun_s): &(Readings, f64)| {
            gathered.electrodes() == readings.electrodes() && (time_s - begun_s).abs() < LONGEST_S
        };
        let (gathered, over) = match self.gathered.take() {
            Some(gathered) if !readings.is_whole() && !fits(&gathered) => (None, Some(gathered.0)),
            gathered => (gathered.filter(fits), None),
        };
        let (gathered, begun_s) = match gathered {
            Some((gathered, begun_s)) => (readings.over(&gathered), begun_s),
            None => (readings.clone(), time_s),
        };
        if gathered.is_whole() {
            self.waiting = 0;
            return Some(gathered);
        }
        self.gathered = Some((gathered, begun_s));
        over
    }

    /// Frames of rows since the last round that was whole: of a plan that leaves grounds out, all of them.
    pub fn waiting(&self) -> u64 {
        self.waiting
    }
}

impl Readings {
    /// These, and those before where these say [nothing](Says::Nothing).
    ///
    /// # Panics
    /// Unless both are of as many electrodes.
    fn over(&self, before: &Self) -> Self {
        assert_eq!(self.electrodes(), before.electrodes());
        let newest = |g: usize, e: usize| if self.says(g, e) == Says::Nothing { before } else { self };
        Self::from_fn(self.electrodes(), |g, e| newest(g, e).at(g, e)).saying(|g, e| newest(g, e).says(g, e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(g: usize, volts: f64) -> Readings {
        Readings::from_fn(3, |_, _| volts).saying(|other, e| match other == g {
            true if e == g => Says::AtMost,
            true => Says::Voltage,
            false => Says::Nothing,
        })
    }

    #[test]
    fn rows_make_a_frame_once_all_were_read_and_none_twice() {
        let mut rounds = Rounds::default();
        let frames: Vec<_> =
            (0..9).map(|step| rounds.add(&row([0, 1, 0, 2][step % 4], step as f64), 1e-3 * step as f64)).collect();
        let whole: Vec<_> = frames.iter().flatten().map(|frame| [0, 1, 2].map(|g| frame.at(g, 0))).collect();
        assert_eq!(whole, [[2.0, 1.0, 3.0], [6.0, 5.0, 7.0]]);
        assert_eq!(
            frames[3].as_ref().map(|frame| [frame.says(1, 1), frame.says(1, 2)]),
            Some([Says::AtMost, Says::Voltage])
        );
        assert_eq!(rounds.waiting(), 1);
    }

    #[test]
    fn what_a_plan_leaves_out_says_nothing_when_the_time_of_a_round_is_up() {
        let mut rounds = Rounds::default();
        assert!((0..6).all(|step| rounds.add(&row(step % 2, step as f64), 8e-3 * step as f64).is_none()));
        let late = rounds.add(&row(0, 9.0), 0.051).unwrap();
        assert_eq!([late.at(0, 1), late.at(1, 2)], [4.0, 5.0]);
        assert!(late.says(2, 0) == Says::Nothing && rounds.waiting() == 7);
        let long_apart: Vec<_> =
            (0..9).filter_map(|step| rounds.add(&row(step % 3, 1.0), 1.0 + 0.04 * step as f64)).collect();
        assert!(long_apart.iter().all(|round| !round.is_whole()) && rounds.waiting() == 16);
    }

    #[test]
    fn whole_frames_are_rounds_as_they_are() {
        let mut rounds = Rounds::default();
        let whole = Readings::from_fn(3, |g, e| (g + e) as f64);
        assert_eq!(rounds.add(&whole, 1.0), Some(whole.clone()));
        assert_eq!(rounds.add(&row(0, 9.0), 1.001), None);
        assert_eq!(rounds.add(&whole, 1.002), Some(whole.clone()));
        assert_eq!((rounds.add(&row(0, 9.0), 1.003), rounds.waiting()), (None, 1));
        let other = Readings::from_fn(4, |_, _| 1.0);
        assert_eq!(rounds.add(&other, 1.004), Some(other), "of another detector");
    }
}
