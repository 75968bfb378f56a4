//! How much the readings speak for some contacts, against others or more of them.
//!
//! The marginal likelihood, `p(readings | K contacts)`, is the integral of likelihood times prior over places, conductances and
//! radii. By Laplace's approximation about the best fit, with `S` the sum of squares of residuals and priors and `H` half its second
//! derivative,
//!
//! ```text
//! ln p = -S / 2 + sum of ln(prior densities' peaks) + P / 2 ln(2 pi) - 1/2 ln det H + ln K!
//! ```
//!
//! plus, as the fit's parameters are not the logarithms that the prior is of but the resistance `A` of contact and crowded current, the
//! logarithms of `d(ln C) / d(ln A) = 1 + S C` (see [`PARAMETERS`](super::discs::PARAMETERS)).
//!
//! (Kass and Raftery, Bayes factors, 1995). Places are alike likely all over the detector, logarithms of conductance and radius
//! normal; contacts have no order, so that `K!` fits are the same. What one more contact costs follows: the share of the places
//! and conductances that would do as well.

use std::f64::consts::TAU;

use nalgebra::Cholesky;

use super::discs::{DiscFit, PARAMETERS};
use crate::solve::fit::policy;

/// What is known of contacts before anything is read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prior {
    /// Area that they can be on (m2).
    pub area_m2: f64,
    /// Standard deviation of the logarithm of a radius.
    pub radius_deviation: f64,
}

impl Prior {
    /// Variance of each coordinate of a place that is anywhere on a square of the area (m2).
    pub fn place_variance_m2(&self) -> f64 {
        self.area_m2 / 12.0
    }

    /// What one contact more, the one of such a number, adds to the logarithm of the evidence but for the readings' determinant: with places in a
    /// unit (m), and the logarithm of the resistance of contact and crowded current, `over_contact` times the contact's own. Its radius is
    /// what it was before anything was read.
    pub fn ln_of_one_more(&self, number: usize, unit_m: f64, over_contact: f64) -> f64 {
        -self.area_m2.ln() - policy::CONDUCTANCE_DEVIATION.ln() + TAU.ln() - policy::FEWER_NATS
            + 2.0 * unit_m.ln()
            + over_contact.ln()
            + (number as f64).ln()
    }

    /// Logarithm of the density of places and radii at its peak, with places in these units (m), a contact each.
    pub fn ln_peak_of_staying(&self, units_m: &[f64]) -> f64 {
        let of_one = -self.area_m2.ln() - (self.radius_deviation * TAU.sqrt()).ln();
        units_m.iter().map(|unit_m| of_one + 2.0 * unit_m.ln()).sum()
    }

    /// Logarithm of the evidence for a fit; nothing speaks for one that is not determined.
    pub fn ln_evidence(&self, fit: &DiscFit) -> f64 {
        let Some(factor) = Cholesky::new(fit.normal.clone()) else { return f64::NEG_INFINITY };
        let count = fit.contacts.len();
        let deviation = if fit.still.is_some() { policy::STRENGTH_DEVIATION } else { policy::CONDUCTANCE_DEVIATION };
        let peak = -(deviation * TAU.sqrt()).ln();
        let peak_of_staying = match &fit.still {
            Some(still) => still.ln_peak(&fit.units_m()),
            None => self.ln_peak_of_staying(&fit.units_m()),
        };
        let from_logs: f64 = (0..count).map(|k| fit.constriction(k).ln_1p()).sum();
        let orders: f64 = (1..=count).map(|k| (k as f64).ln()).sum();
        -0.5 * (fit.cost + fit.known)
            + count as f64 * (peak - policy::FEWER_NATS)
            + peak_of_staying
            + from_logs
            + orders
            + 0.5 * (PARAMETERS * count) as f64 * TAU.ln()
            - 0.5 * factor.ln_determinant()
    }
}
