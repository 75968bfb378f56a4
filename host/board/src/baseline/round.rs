//! Rows of readings gathered until all were read: what rests can be told of them together.

use tactomo_physics::readings::{Readings, Says};

/// Longest time for which rows are gathered (s): a plan that leaves readings out has rounds all the same.
const ROUND_S: f64 = 0.05;
/// Standard deviations of its noise by which each reading may differ between rounds of a scene that stands still.
const STILL: f64 = 6.0;

/// Rows until all were read once: as a frame, which came together over a time.
#[derive(Clone, Debug)]
pub(super) struct Round {
    gathered: Readings,
    begun_s: Option<f64>,
    /// The whole one before, and the last.
    before: Option<Readings>,
    last: Option<Readings>,
}

impl Round {
    pub fn new(electrodes: usize) -> Self {
        Self { gathered: unread(electrodes), begun_s: None, before: None, last: None }
    }

    /// Adds rows; the round, if that makes it whole or it takes too long. What was not read until then is as `rest_v` (V).
    pub fn add(&mut self, rows: &Readings, rest_v: &[f64], time_s: f64) -> Option<Readings> {
        let n = rows.electrodes();
        if n != self.gathered.electrodes() {
            *self = Self::new(n);
        }
        let begun_s = *self.begun_s.get_or_insert(time_s);
        let gathered = std::mem::replace(&mut self.gathered, unread(n));
        let is_new = |g: usize, e: usize| rows.says(g, e) != Says::Nothing;
        let volts = |g: usize, e: usize| if is_new(g, e) { rows.at(g, e) } else { gathered.at(g, e) };
        let says = |g: usize, e: usize| if is_new(g, e) { rows.says(g, e) } else { gathered.says(g, e) };
        let gathered = Readings::from_fn(n, volts).saying(says);
        let is_whole = !gathered.all_say().contains(&Says::Nothing);
        if !is_whole && (time_s - begun_s).abs() < ROUND_S {
            self.gathered = gathered;
            return None;
        }
        self.begun_s = None;
        let at_rest = |g: usize, e: usize| match gathered.says(g, e) {
            Says::Nothing => (rest_v.get(g * n + e).copied().unwrap_or_default(), Says::Voltage),
            says => (gathered.at(g, e), says),
        };
        let round = Readings::from_fn(n, |g, e| at_rest(g, e).0).saying(|g, e| at_rest(g, e).1);
        // What was not read cannot be seen to stand still.
        self.before = self.last.take().filter(|_| is_whole);
        self.last = is_whole.then(|| round.clone());
        Some(round)
    }

    /// Whether the last round differs from the one before by no more than noise (V).
    pub fn is_still(&self, noise_v: f64) -> bool {
        let (Some(before), Some(last)) = (&self.before, &self.last) else { return false };
        let pairs = before.volts().iter().zip(last.volts());
        pairs.map(|(before, last)| (last - before).abs()).all(|change| change < STILL * noise_v)
    }
}

fn unread(electrodes: usize) -> Readings {
    Readings::from_fn(electrodes, |_, _| 0.0).hiding(|_, _| true)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(g: usize, volts: f64) -> Readings {
        Readings::from_fn(4, |_, _| volts).hiding(|ground, _| ground != g)
    }

    #[test]
    fn a_round_is_whole_once_every_row_came() {
        let mut round = Round::new(4);
        let rest_v = [0.01; 16];
        assert!((0..3).all(|g| round.add(&row(g, 0.1), &rest_v, 1e-3 * g as f64).is_none()));
        let whole = round.add(&row(3, 0.2), &rest_v, 3e-3).unwrap();
        assert!(whole.all_say().is_empty() && whole.at(3, 0) == 0.2 && whole.at(1, 2) == 0.1);
        assert!(!round.is_still(1e-3), "there is none before");
        (0..4).for_each(|g| _ = round.add(&row(g, if g == 3 { 0.2 } else { 0.1 }), &rest_v, 4e-3));
        assert!(round.is_still(1e-3));
        (0..4).for_each(|g| _ = round.add(&row(g, 0.1), &rest_v, 5e-3));
        assert!(!round.is_still(1e-3));
    }

    #[test]
    fn what_a_plan_leaves_out_is_as_at_rest() {
        let mut round = Round::new(4);
        assert!((0..6).all(|step| round.add(&row(step % 2, 0.1), &[0.01; 16], 8e-3 * step as f64).is_none()));
        let late = round.add(&row(0, 0.1), &[0.01; 16], 0.051).unwrap();
        assert_eq!([late.at(0, 1), late.at(1, 1), late.at(2, 1)], [0.1, 0.1, 0.01]);
        assert!(late.all_say().is_empty());
    }
}
