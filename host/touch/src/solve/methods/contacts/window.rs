//! Contacts that stay where they are while their strengths change: several frames explained together.
//!
//! Where two fingers are so near that one wide contact explains a frame as well, that contact moves as weight goes from one finger to the other,
//! and no single place of it explains all frames: two that stay do. So [key frames](key_frames) of what is followed are fitted together, with one place and
//! one radius of each contact for all frames, and conductances that are each frame's own, about a common level. What is not known of the
//! detector is the same in all frames too, and linear ([`frames`], [`together`]).
//!
//! Explanations are compared by the logarithm of their evidence as in [`evidence`](super::evidence), by Laplace's approximation over all
//! parameters. The rival of one contact more that stays are as many contacts as before that move, about a mean place, by as much as they did.

mod frames;
mod key_frames;
#[cfg(test)]
mod tests;
mod together;

use std::sync::Arc;

use self::frames::Window;
pub(super) use self::key_frames::{KeyFrame, KeyFrames};
use self::together::{Motion, Together};
use super::discs::{DiscFit, Effort, STAYING, Still, place_m};
use super::search::{COLD, FINALISTS};
use super::{Certainty, ContactFinder, ContactHypothesis};
use crate::solve::fit::approximation::About;
use crate::solve::fit::evidence::misfit_limit;
use crate::solve::fit::policy;
use crate::solve::fit::target::Target;
use tactomo_physics::scene::Contact;
use tactomo_physics::space;

/// How often the detector that readings are linear near is sought anew.
const RENEWALS: usize = 3;
/// No step.
const AS_IT_IS: Effort = Effort { steps: 0, ..COLD };

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
        let (middle, spread_m) = middle(&followed);
        let (window, still, growing) = self.window_of(keys, from.about(), &middle, spread_m)?;
        let (best, by_count) = window.grown(&middle, (still, growing), spread_m)?;
        (best.count() > followed[0].len() && window.fits(&best)).then_some(())?;
        let last = best.at.fits.last()?;
        let contacts = last.contacts.clone();
        let still = Still::about(last, best.staying()?, best.levels());
        let target = self.informed(target, &contacts, &window.about).unwrap_or_else(|| target.clone());
        let fit = self.disc_fitter().fit_still(contacts, Some(Arc::new(still)), &target, COLD)?;
        let certainty = Certainty::of(best.count(), &by_count, target.error().is_none());
        let keys = from.keys.clone();
        let found = ContactHypothesis { certainty, keys, ..ContactHypothesis::of(fit, &target) };
        (!self.is_misfit(&found.fit, &target)).then_some(found)
    }

    /// Key frames with how the contacts that are followed explain them if these stay and if they move; `None` if staying explains them as well. Where not even
    /// moving explains them, readings are linear near another detector, or no verdict is possible.
    fn window_of(
        &self,
        keys: &[KeyFrame],
        mut about: About,
        middle: &[Contact],
        spread_m: f64,
    ) -> Option<(Window<'_>, Together, Together)> {
        for _ in 0..RENEWALS {
            let window = Window::new(self, keys, about)?;
            let still = window.explained(vec![middle.to_vec(); keys.len()], Motion::Still)?;
            if !window.may_be_more(&still, spread_m) {
                return None;
            }
            let growing = window.explained(still.at.contacts(), Motion::Growing(spread_m))?;
            if window.fits(&growing) {
                return Some((window, still, growing));
            }
            about = window.nearer(&growing)?;
        }
        None
    }
}

/// Contacts in each frame, with the radii of others.
fn of_radii(mut frames: Vec<Vec<Contact>>, others: &[Contact]) -> Vec<Vec<Contact>> {
    let pairs = frames.iter_mut().flat_map(|contacts| contacts.iter_mut().zip(others));
    pairs.for_each(|(contact, other)| contact.radius_m = other.radius_m);
    frames
}

/// Contacts at their mean places, with mean radii and conductances, and by how much places of a contact differ (m).
fn middle(frames: &[Vec<Contact>]) -> (Vec<Contact>, f64) {
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
    let apart = |all: &Vec<Contact>| -> f64 {
        all.iter().zip(&means).map(|(one, mean)| space::distance(place_m(one), place_m(mean)).powi(2)).sum()
    };
    let squares: f64 = frames.iter().map(apart).sum();
    let spread_m = (squares / (2.0 * count * means.len() as f64)).sqrt();
    (means, spread_m)
}

impl Window<'_> {
    /// The likeliest number of contacts that stay, from as many as are followed; their rival is that those move, grow or not. Gives the logarithm of the
    /// evidence for each count too.
    fn grown(
        &self,
        from: &[Contact],
        (still, growing): (Together, Together),
        spread_m: f64,
    ) -> Option<(Together, Vec<f64>)> {
        // What has gone far is not explained by contacts that stay.
        (still.at.cost < policy::WRONG_MEAN_SQUARE * self.count()).then_some(())?;
        let moving = self.explained(of_radii(growing.at.contacts(), from), Motion::Moving(spread_m));
        let rivals = [Some(&growing), moving.as_ref(), Some(&still)].into_iter().flatten();
        let rival = rivals.map(|rival| rival.ln_evidence).fold(f64::NEG_INFINITY, f64::max);
        let mut by_count = vec![f64::NEG_INFINITY; self.finder.settings.most + 1];
        by_count[still.count()] = rival;
        let needed = |found: &Together| rival + policy::GONE_NATS * (found.count() - from.len()) as f64;
        let (mut best, mut last) = (None, still);
        while last.count() < self.finder.settings.most {
            let more = self.one_more(&last, spread_m).filter(|(more, _)| self.may_be(more));
            let Some((more, may_be_more)) = more else { break };
            by_count[more.count()] = more.ln_evidence;
            let is_worse = more.ln_evidence < last.ln_evidence;
            last = more;
            let gain = last.ln_evidence - needed(&last);
            if gain > best.as_ref().map_or(0.0, |best: &Together| best.ln_evidence - needed(best)) {
                best = Some(last.clone());
            }
            if is_worse || !may_be_more {
                break;
            }
        }
        Some((best?, by_count))
    }

    /// Whether contacts are what they are called. What are not side by side are one that moves, or that is no disc; and one that is lighter against the
    /// firmest than readings are unknown may be what the detector differs by.
    fn may_be(&self, found: &Together) -> bool {
        let contacts = &found.at.fits[0].contacts;
        let beside_m = |a: &Contact, b: &Contact| self.finder.side_by_side_m().max(a.radius_m + b.radius_m);
        let is_over = |a: &Contact, b: &Contact| space::distance(place_m(a), place_m(b)) < beside_m(a, b);
        let are_apart = (0..contacts.len()).all(|k| !contacts[..k].iter().any(|other| is_over(&contacts[k], other)));
        let unknown = self.frames.iter().map(|frame| frame.unknown).fold(0.0, f64::max);
        let levels = found.levels();
        let [lightest, firmest] = [f64::min, f64::max].map(|of| levels.iter().copied().reduce(of).unwrap_or_default());
        are_apart && lightest - firmest > unknown.ln()
    }

    /// One contact more that stays, and whether there may be more of them: as the frame that is explained worst has it by itself if that leaves nothing to explain,
    /// else the likeliest of that and of where it would explain most of all. No single frame tells well where it is, and what all tell is linear.
    fn one_more(&self, found: &Together, spread_m: f64) -> Option<(Together, bool)> {
        let alone = found.at.fits.iter().zip(&self.frames);
        let alone =
            alone.map(|(fit, frame)| self.fitter.go_on(fit, &frame.alone, AS_IT_IS)).collect::<Option<Vec<_>>>()?;
        let explained = |start| {
            let found = self.explained(start, Motion::Still)?;
            let may_be_more = self.may_be_more(&found, spread_m);
            Some((found, may_be_more))
        };
        let of_worst = self.start_in_worst(&alone).and_then(explained);
        if let Some((_, false)) = of_worst {
            return of_worst;
        }
        let of_all = self.starts_in_all(&alone).unwrap_or_default();
        let all = of_all.into_iter().filter_map(explained).chain(of_worst);
        all.max_by(|(a, _), (b, _)| a.ln_evidence.total_cmp(&b.ln_evidence))
    }

    /// Contacts in each frame, with one more where it would explain most of all.
    fn starts_in_all(&self, alone: &[DiscFit]) -> Option<Vec<Vec<Vec<Contact>>>> {
        let finder = self.finder;
        let looks = alone.iter().zip(&self.frames).map(|(fit, frame)| finder.looks_beside(fit, &frame.alone));
        let looks: Vec<_> = looks.collect::<Option<_>>()?;
        let places = finder.scan.staying(&looks, FINALISTS, finder.apart_m());
        let start = |place| {
            let more = finder.discs_of(&finder.scan.start(&looks[0], place));
            alone.iter().map(|fit| fit.contacts.iter().chain(&more).copied().collect()).collect()
        };
        Some(places.iter().map(start).collect())
    }

    /// Contacts in each frame, with one more as the frame that is explained worst has it by itself.
    fn start_in_worst(&self, alone: &[DiscFit]) -> Option<Vec<Vec<Contact>>> {
        let (worst, frame) =
            alone.iter().zip(&self.frames).max_by(|(one, _), (other, _)| one.cost.total_cmp(&other.cost))?;
        let more = self.finder.one_more(worst, Vec::new(), &frame.alone).ok()?;
        // What changes is where they are; how much firmer each is in other frames stays as it was.
        let start = alone.iter().map(|fit| {
            let ratios = fit.contacts.iter().zip(&worst.contacts);
            let ratios = ratios.map(|(here, there)| here.conductance_s / there.conductance_s);
            let pairs = more.contacts.iter().zip(ratios.chain(std::iter::repeat(1.0)));
            pairs.map(|(one, ratio)| Contact { conductance_s: ratio * one.conductance_s, ..*one }).collect()
        });
        Some(start.collect())
    }

    /// Whether there may be more contacts than some that stay: frame by frame one more is hardly told from these moving and growing, which explains about as
    /// much.
    fn may_be_more(&self, still: &Together, spread_m: f64) -> bool {
        let gain = || self.gain_by_motion(still, Motion::Growing(spread_m));
        !self.fits(still) || gain().is_some_and(|gain| gain > 2.0 * policy::GONE_NATS)
    }

    /// Readings that count.
    fn count(&self) -> f64 {
        self.frames.iter().map(|frame| frame.target.count()).sum::<usize>() as f64
    }

    /// Whether no more is left than noise and model error leave.
    fn fits(&self, found: &Together) -> bool {
        let parameters = found.count() * (STAYING + self.frames.len());
        let freedom = (self.count() - parameters as f64).max(1.0);
        found.at.cost <= freedom * misfit_limit(freedom)
    }
}
