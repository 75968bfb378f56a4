//! Contacts that move, in whole frames: each frame is fitted by itself, and what frames before say of it is added here.
//!
//! Where a fit ends is linear in the readings: with derivatives `J`, the readings' covariance `R` (of noise and of what model, pads and detector
//! are off by) and the fit's covariance `C = (J^T R^-1 J + prior)^-1`, noise of the deviation `s` gives its parameters the covariance
//!
//! ```text
//! N = s^2 G G^T,   G = C J^T R^-1
//! ```
//!
//! That is new in every frame, and a [filter](super::multiple_models) that takes fits as measurements lessens it to some `P`. The rest of `C`
//! stays as it is, as the same is off in every frame: the contacts that are shown have the covariance `C - N + P`.
//!
//! Limits: the mean of several frames is taken as one frame, which it brings anew. Where contacts stand still, so that the mean is of many, the
//! fit by itself is as good, and is shown. Near edges a fit's place is no normal variable, and it is shown as well.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::ContactFinder;
use super::discs::{DiscFit, PARAMETERS};
use super::multiple_models::{MultipleModels, Rows};
use super::systematic_error::pulls;
use crate::solve::fit::target::Target;
use tactomo_physics::scene::Contact;

/// Time from one whole frame to the next (s): the ESP32's scans take so long, those of faster boards a third. Speeds are in proportion to it, and
/// those of [motions](super::multiple_models) are five times apart.
const FRAME_S: f64 = 2.4e-3;
/// A mean of so many frames is as good as what frames before add: of a contact that glides by 0.9 standard errors a frame, that leaves 0.44 of
/// a frame's error.
const STILL_FRAMES: usize = 5;

/// What frames before say of contacts.
#[derive(Clone, Debug)]
pub(super) struct Smoother {
    filters: MultipleModels,
    /// The contacts that are believed, and the units of their places' parameters (m).
    contacts: Vec<Contact>,
    units_m: Vec<f64>,
    /// Readings of the newest frame (V): the very same again are one observation.
    volts: Vec<f64>,
    /// The fit to the newest frame with what frames before say, if they say something.
    pub shown: Option<DiscFit>,
}

impl ContactFinder {
    /// Adds what frames `before` say to a fit to the next; `None` where they add nothing, as its contacts stand still, or are not determined.
    pub(super) fn smoothed(&self, before: Option<Smoother>, fit: &DiscFit, target: &Target) -> Option<Smoother> {
        if target.frames >= STILL_FRAMES {
            return None;
        }
        if before.as_ref().is_some_and(|before| before.volts == target.volts) {
            return before;
        }
        let [all_v, fixed_v] = [1, usize::MAX].map(|frames| self.errors.of_mean_v(frames));
        let covariance = fit.covariance()?;
        let gains = &covariance * pulls(fit, target, &vec![1.0; covariance.nrows()]);
        let noise = (all_v * all_v - fixed_v * fixed_v) * &gains * gains.transpose();
        let information = Cholesky::new(noise.clone())?.inverse();
        let mean_noise = noise / target.frames as f64;
        let before = before.filter(|before| PARAMETERS * before.contacts.len() == information.nrows());
        let Some(mut smoother) = before else { return Some(Smoother::new(fit, target, information)) };
        smoother.step(self, fit, information)?;
        smoother.volts.clone_from(&target.volts);
        let known = Cholesky::new(smoother.filters.information().clone())?;
        let is_better = known.ln_determinant() > -Cholesky::new(mean_noise.clone())?.ln_determinant();
        let is_near_edge = fit.place_costs.iter().any(Option::is_some);
        smoother.shown = None;
        if is_better && !is_near_edge {
            let mut shown = fit.clone();
            shown.contacts.clone_from(&smoother.contacts);
            shown.normal = Cholesky::new(covariance - mean_noise + known.inverse())?.inverse();
            smoother.shown = Some(shown);
        }
        Some(smoother)
    }
}

impl Smoother {
    /// Begins with a fit; `information` on its parameters is that of each frame of `target`.
    fn new(fit: &DiscFit, target: &Target, information: DMatrix<f64>) -> Self {
        let filters = MultipleModels::new(target.frames as f64 * information);
        let (contacts, units_m, volts) = (fit.contacts.clone(), fit.units_m(), target.volts.clone());
        Self { filters, contacts, units_m, volts, shown: None }
    }

    /// Takes a fit as a measurement with such information on its parameters.
    fn step(&mut self, finder: &ContactFinder, fit: &DiscFit, information: DMatrix<f64>) -> Option<()> {
        let units_m = fit.units_m();
        self.filters.rescale(&self.units_m, &units_m);
        self.filters.predict(FRAME_S, &units_m)?;
        let to_believed = DVector::from_vec(fit.way_to(&self.contacts));
        let pull = -(&information * &to_believed);
        let cost = -pull.dot(&to_believed);
        let way = to_believed + self.filters.update(&Rows { information, pull, cost })?;
        self.contacts = finder.disc_fitter().moved(fit, way.as_slice());
        // What makes no sense was cut: the filters know what is left.
        self.filters.shift(&(DVector::from_vec(fit.way_to(&self.contacts)) - way));
        self.units_m = units_m;
        Some(())
    }
}
