//! Whole frames of a board that scans rows: a calibration needs every reading, and each of them once.

use tactomo_physics::readings::{Readings, Says};

use crate::solve::Latest;

/// Longest time from the first row of a round to its last (s): twice what a round of an adaptive plan takes on a wire of 921600 baud. A finger that
/// moves meanwhile makes a frame that agrees with no single contact.
const LONGEST_S: f64 = 0.05;

/// Gathers rows to whole frames.
#[derive(Clone, Debug)]
pub struct Rounds {
    latest: Latest,
    time_s: f64,
    waiting: u64,
}

impl Rounds {
    /// Of so many electrodes.
    pub fn new(electrodes: usize) -> Self {
        Self { latest: Latest::new(electrodes), time_s: 0.0, waiting: 0 }
    }

    /// Takes readings (V) of a time (s), and gives those of a whole frame: as they are if they are whole, or else once each was read since the
    /// last frame.
    pub fn add(&mut self, readings: &Readings, time_s: f64) -> Option<Readings> {
        if !readings.all_say().contains(&Says::Nothing) {
            self.forget();
            return Some(readings.clone());
        }
        self.latest.add(readings, time_s - std::mem::replace(&mut self.time_s, time_s), None);
        self.waiting += 1;
        if !self.latest.is_whole(LONGEST_S) {
            return None;
        }
        let whole = self.latest.readings(LONGEST_S, None);
        self.forget();
        Some(whole)
    }

    /// Frames of rows since the last whole one: of a plan that leaves grounds out, all of them.
    pub fn waiting(&self) -> u64 {
        self.waiting
    }

    fn forget(&mut self) {
        self.latest.forget();
        self.waiting = 0;
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
        let mut rounds = Rounds::new(3);
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
    fn rows_that_are_long_apart_make_none_and_whole_frames_are_taken_as_they_are() {
        let mut rounds = Rounds::new(3);
        let late = (0..9).filter_map(|step| rounds.add(&row(step % 3, 1.0), 0.04 * step as f64)).count();
        assert_eq!((late, rounds.waiting()), (0, 9));
        let whole = Readings::from_fn(3, |g, e| (g + e) as f64);
        assert_eq!(rounds.add(&whole, 1.0), Some(whole));
        assert_eq!(rounds.waiting(), 0);
    }
}
