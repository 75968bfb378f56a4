//! Which explanation of a frame is believed, and when none is good enough.
//!
//! All of them are compared by the same readings, whitened by the same errors ([`super::target::Target`]).

use crate::solve::fit::policy;

/// What an explanation leaves of a frame, and what it takes for that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Evidence {
    /// Sum of squares of the whitened residuals.
    pub cost: f64,
    /// What it costs to say so much, in squares.
    pub price: f64,
    /// Numbers that the readings determine.
    pub parameters: f64,
}

impl Evidence {
    /// Of so many parameters, each of which has the same price.
    pub fn of(cost: f64, parameters: usize) -> Self {
        let parameters = parameters as f64;
        Self { cost, price: policy::PARAMETER_PRICE * parameters, parameters }
    }

    /// The sum of squares with the price: of two explanations the lower one is believed.
    pub fn score(&self) -> f64 {
        self.cost + self.price
    }

    /// Probability of this explanation against another one.
    pub fn share_against(&self, other: &Self) -> f64 {
        1.0 / (1.0 + (0.5 * (self.score() - other.score())).exp())
    }

    /// Whether more is left of so many readings than noise and the model's error make.
    pub fn is_misfit(&self, readings: usize) -> bool {
        self.exceeds(1.0, policy::MISFIT_DEVIATIONS, readings)
    }

    /// Whether more is left than noise alone makes, whose variance is this share of that of the errors: a model that is righter than it claims
    /// could do better.
    pub fn may_be_better(&self, noise_share: f64, readings: usize) -> bool {
        self.exceeds(noise_share, policy::DOUBT_DEVIATIONS, readings)
    }

    fn exceeds(&self, share: f64, deviations: f64, readings: usize) -> bool {
        let freedom = (readings as f64 - self.parameters).max(1.0);
        self.cost > share * freedom * limit(deviations, freedom)
    }
}

/// Mean square of what is left, in what noise and model error make, above which readings do not fit.
pub(crate) fn misfit_limit(freedom: f64) -> f64 {
    limit(policy::MISFIT_DEVIATIONS, freedom)
}

/// The mean of `freedom` squares of normal numbers is 1, and its variance two over their number.
fn limit(deviations: f64, freedom: f64) -> f64 {
    1.0 + deviations * (2.0 / freedom.max(1.0)).sqrt()
}

/// What a search has left, at least what noise makes: what is followed has to leave about as little.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Searched(f64);

impl Searched {
    /// What a search has left of so many readings.
    pub fn new(left: Evidence, readings: usize) -> Self {
        Self(left.cost.max(readings as f64 - left.parameters))
    }

    /// Whether much more is left of a frame.
    pub fn is_worse(&self, now: Evidence, readings: usize) -> bool {
        now.cost > (policy::WORSE * self.0).max(readings as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::simulate::Noise;

    fn evidence(cost: f64, parameters: usize) -> Evidence {
        Evidence::of(cost, parameters)
    }

    #[test]
    fn noise_fits_and_a_little_more_does_not() {
        let mut noise = Noise::new(5);
        let mut cost = |scale: f64| evidence((0..240).map(|_| (scale * noise.normal()).powi(2)).sum(), 0);
        assert!((0..2000).all(|_| !cost(1.0).is_misfit(240)));
        assert!((0..2000).filter(|_| cost(1.35).is_misfit(240)).count() > 1900);
        // Fewer readings say less.
        assert!(misfit_limit(20.0) > 2.0 && misfit_limit(240.0) < 1.5);
    }

    #[test]
    fn a_parameter_has_to_be_worth_its_price() {
        assert!(evidence(240.0, 6).score() < evidence(230.0, 9).score());
        assert!(evidence(240.0, 6).score() > evidence(210.0, 9).score());
        // Two nats are odds of 7.4.
        let shares =
            [[240.0, 236.0], [236.0, 240.0]].map(|[one, other]| evidence(one, 6).share_against(&evidence(other, 6)));
        assert!((shares[1] / shares[0] - 2.0_f64.exp()).abs() < 1e-9 && (shares[0] + shares[1] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn frames_that_are_much_worse_than_the_searched_one_are_lost() {
        let searched = Searched::new(evidence(250.0, 6), 256);
        assert!(!searched.is_worse(evidence(300.0, 6), 256));
        assert!(searched.is_worse(evidence(400.0, 6), 256));
    }
}
