//! Contacts that stay where they are while their strengths change: several frames explained together.
//!
//! Where two fingers are so near that one wide contact explains a frame as well, that contact moves as weight goes from one finger to the other,
//! and no single place of it explains all frames: two that stay do. So [key frames](key_frames) of what is followed are fitted together by the compiled detector, with one
//! place and one radius of each contact for all frames, conductances that are each frame's own, about a common level, and one detector. Their rival is that as many contacts
//! as before move, about a mean place, by as much as they did.

mod key_frames;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix};
use tactomo_touch_core::Motion;

pub(super) use self::key_frames::{KeyFrame, KeyFrames};
use super::discs::{DiscFit, Effort, STAYING, Still, among, place_m};
use super::search::COLD;
use super::{Certainty, ContactFinder, ContactHypothesis, UNKNOWN_DETECTOR_SHARE};
use crate::solve::fit::policy;
use crate::solve::fit::target::Target;
use crate::solve::methods::compiled::{Compiled, NoisyFrame, Together};
use tactomo_physics::scene::Contact;
use tactomo_physics::space;

/// Frames that a baseline is the mean of at first (`host/board/src/baseline`).
const BASELINE_FRAMES: f64 = 32.0;
/// No step.
const AS_IT_IS: Effort = Effort { steps: 0, ..COLD };

/// Key frames, to be explained together.
struct Window<'a> {
    compiled: &'a mut Compiled,
    frames: Vec<NoisyFrame<'a>>,
    /// Most contacts.
    most: usize,
}

impl ContactFinder {
    /// Distance of two usual contacts that lie side by side (m). Nearer ones that stay are not told from one that moves.
    fn side_by_side_m(&self) -> f64 {
        2.0 * self.settings.radius_m
    }

    /// More contacts than are followed, that stay where they are while their strengths change, if key frames together say so.
    pub(super) fn staying(
        &self,
        from: &ContactHypothesis,
        keys: &[KeyFrame],
        target: &Target,
    ) -> Option<ContactHypothesis> {
        let followed: Vec<_> = keys.iter().map(|key| key.contacts.clone()).collect();
        // What a detector or a chip differs by, even what is left of that once it is learned, can make one contact seem two that stay.
        (followed[0].len() > 1).then_some(())?;
        let frames = keys.iter().map(|key| self.noisy(key)).collect();
        let most = self.settings.most;
        let (best, by_count) = self.by_table(|compiled| Window { compiled, frames, most }.grown(&followed))?;
        self.may_be(&best, keys.len()).then_some(())?;
        let contacts = best.contacts(keys.len() - 1);
        let about = self.about_steps(best.steps())?;
        let target = self.informed(target, &contacts, &about).unwrap_or_else(|| target.clone());
        let last = self.disc_fitter().fit(contacts.clone(), &target, AS_IT_IS)?;
        let still = Still::about(&last, self.information(&best, &last)?, levels(&best, keys.len()));
        let fit = self.disc_fitter().fit_still(contacts, Some(Arc::new(still)), &target, COLD)?;
        let certainty = Certainty::of(best.count(), &by_count, target.error().is_none());
        let keys = from.keys.clone();
        let found = ContactHypothesis { certainty, keys, ..ContactHypothesis::of(fit, &target) };
        (!self.is_misfit(&found.fit, &target)).then_some(found)
    }

    /// Whether contacts are what they are called. What are not side by side are one that moves, or that is no disc; and one that is lighter against the firmest than
    /// readings of a detector as built are off by may be what that differs by.
    fn may_be(&self, found: &Together, frames: usize) -> bool {
        let contacts = found.contacts(frames - 1);
        let beside_m = |a: &Contact, b: &Contact| self.side_by_side_m().max(a.radius_m + b.radius_m);
        let is_over = |a: &Contact, b: &Contact| space::distance(place_m(a), place_m(b)) < beside_m(a, b);
        let are_apart = (0..contacts.len()).all(|k| !contacts[..k].iter().any(|other| is_over(&contacts[k], other)));
        let unknown = self.problem.nuisance().map_or(0.0, |_| UNKNOWN_DETECTOR_SHARE);
        let levels = levels(found, frames);
        let [lightest, firmest] = [f64::min, f64::max].map(|of| levels.iter().copied().reduce(of).unwrap_or_default());
        are_apart && lightest - firmest > unknown.ln()
    }

    /// A key frame with its noise, and that of the baseline.
    fn noisy<'a>(&self, key: &'a KeyFrame) -> NoisyFrame<'a> {
        let baseline_v = self.errors.noise_v / BASELINE_FRAMES.sqrt();
        NoisyFrame { readings: &key.mean.readings, noise_v: self.errors.of_mean_v(key.mean.frames).hypot(baseline_v) }
    }

    /// Information about places and radii of contacts that stay, in the parameters of a fit of them.
    fn information(&self, found: &Together, fit: &DiscFit) -> Option<DMatrix<f64>> {
        let count = STAYING * found.count();
        let covariance = DMatrix::from_fn(count, count, |i, j| found.covariance(among(i), among(j)));
        let information = Cholesky::new(covariance)?.inverse();
        let (units_m, mut turned) = (fit.units_m(), DMatrix::identity(count, count));
        for (k, unit_m) in units_m.iter().enumerate() {
            let (along, _) = fit.along(k);
            for (axis, direction) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let usual_radii = unit_m / self.settings.radius_m;
                turned[(STAYING * k + axis, STAYING * k + direction)] = usual_radii * along[direction][axis];
            }
        }
        Some(turned.tr_mul(&(information * &turned)))
    }
}

/// Mean of the logarithm of each contact's conductance (S) over frames.
fn levels(found: &Together, frames: usize) -> Vec<f64> {
    let ln = |frame: usize| found.contacts(frame).into_iter().map(|contact| contact.conductance_s.ln());
    let mut sums = vec![0.0; found.count()];
    (0..frames).for_each(|frame| sums.iter_mut().zip(ln(frame)).for_each(|(sum, ln)| *sum += ln / frames as f64));
    sums
}

/// Contacts at their mean places, with mean radii and conductances, and by how much places of each differ (m).
fn middle<const N: usize>(frames: &[Vec<Contact>]) -> (Vec<Contact>, [f64; N]) {
    let count = frames.len() as f64;
    let mean = |k: usize, of: &dyn Fn(&Contact) -> f64| frames.iter().map(|all| of(&all[k])).sum::<f64>() / count;
    let of = |k: usize| Contact {
        x_m: mean(k, &|contact| contact.x_m),
        y_m: mean(k, &|contact| contact.y_m),
        z_m: mean(k, &|contact| contact.z_m),
        radius_m: mean(k, &|contact| contact.radius_m.ln()).exp(),
        conductance_s: mean(k, &|contact| contact.conductance_s.ln()).exp(),
    };
    let means: Vec<_> = (0..frames[0].len()).map(of).collect();
    let mut spreads_m = [0.0; N];
    for (k, (spread_m, mean_at)) in spreads_m.iter_mut().zip(&means).enumerate() {
        let square_m2 = mean(k, &|contact| space::distance(place_m(contact), place_m(mean_at)).powi(2));
        *spread_m = (0.5 * square_m2).sqrt();
    }
    (means, spreads_m)
}

impl Window<'_> {
    /// The likeliest number of contacts that stay, if that is more than are followed; their rival is that those move, grow or not. Gives the logarithm of the evidence for each
    /// count too.
    fn grown(self, followed: &[Vec<Contact>]) -> Option<(Together, Vec<f64>)> {
        let Self { compiled, frames, most } = self;
        let (middle, spreads_m) = middle(followed);
        let count = middle.len();
        let still = compiled.together(&frames, &vec![middle.clone(); followed.len()], Motion::Still)?;
        let moving = compiled.together(&frames, followed, Motion::Moving(spreads_m));
        let growing = compiled.together(&frames, followed, Motion::Growing(spreads_m));
        let rivals = [Some(&still), moving.as_ref(), growing.as_ref()].into_iter().flatten();
        let rival = rivals.map(Together::ln_evidence).fold(f64::NEG_INFINITY, f64::max);
        let mut by_count = vec![f64::NEG_INFINITY; most + 1];
        by_count[count] = rival;
        let (mut best, mut likeliest, mut last) = (None, rival, still);
        while last.count() < most {
            let Some(more) = compiled.one_more_together(&frames, &last) else { break };
            by_count[more.count()] = more.ln_evidence();
            if more.ln_evidence() > likeliest + policy::GONE_NATS {
                likeliest = more.ln_evidence();
                best = Some(more.clone());
            }
            let is_worse = more.ln_evidence() < last.ln_evidence();
            last = more;
            if is_worse {
                break;
            }
        }
        Some((best.filter(Together::fits)?, by_count))
    }
}
