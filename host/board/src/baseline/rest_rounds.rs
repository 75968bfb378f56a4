//! Rows of readings gathered until all were read: whether they are at rest shows in them together.

use tactomo_physics::readings::{Readings, Rounds, Says};

/// Standard deviations of its noise by which each reading may differ between rounds of a scene that stands still.
const STILL: f64 = 6.0;

/// Rounds of rows, the last of which is compared with the one before.
#[derive(Clone, Debug, Default)]
pub(super) struct RestRounds {
    rounds: Rounds,
    /// The whole one before, and the last.
    before: Option<Readings>,
    last: Option<Readings>,
}

impl RestRounds {
    /// Adds rows; the round, if they end one. What was not read in it is as `rest_v` (V).
    pub fn add(&mut self, rows: &Readings, rest_v: &[f64], time_s: f64) -> Option<Readings> {
        let round = self.rounds.add(rows, time_s)?;
        // What was not read cannot be seen to stand still.
        self.before = self.last.take().filter(|before| before.electrodes() == round.electrodes() && round.is_whole());
        self.last = round.is_whole().then(|| round.clone());
        if round.is_whole() {
            return Some(round);
        }
        let n = round.electrodes();
        let at_rest = |g: usize, e: usize| match round.says(g, e) {
            Says::Nothing => (rest_v.get(g * n + e).copied().unwrap_or_default(), Says::Voltage),
            says => (round.at(g, e), says),
        };
        Some(Readings::from_fn(n, |g, e| at_rest(g, e).0).saying(|g, e| at_rest(g, e).1))
    }

    /// Whether the last round differs from the one before by no more than noise (V).
    pub fn is_still(&self, noise_v: f64) -> bool {
        let (Some(before), Some(last)) = (&self.before, &self.last) else { return false };
        let pairs = before.volts().iter().zip(last.volts());
        pairs.map(|(before, last)| (last - before).abs()).all(|change| change < STILL * noise_v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(g: usize, volts: f64) -> Readings {
        Readings::from_fn(4, |_, _| volts).hiding(|ground, _| ground != g)
    }

    #[test]
    fn a_round_is_whole_once_every_row_came() {
        let mut round = RestRounds::default();
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
        let mut round = RestRounds::default();
        assert!((0..6).all(|step| round.add(&row(step % 2, 0.1), &[0.01; 16], 8e-3 * step as f64).is_none()));
        let late = round.add(&row(0, 0.1), &[0.01; 16], 0.051).unwrap();
        assert_eq!([late.at(0, 1), late.at(1, 1), late.at(2, 1)], [0.1, 0.1, 0.01]);
        assert!(late.all_say().is_empty());
    }
}
