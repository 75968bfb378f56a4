//! Contacts from one frame to the next, and which of them are still there.

use std::sync::Arc;

use super::discs::{DiscFit, Effort, PARAMETERS};
use super::{ContactFinder, ContactHypothesis};
use crate::solve::fit::policy;
use crate::solve::fit::target::Target;
use tactomo_physics::scene::Contact;

/// From the frame before.
const WARM: Effort = Effort { steps: 2, gain: 0.2, share: 0.0 };
/// From some frames ago.
const CAUGHT_UP: Effort = Effort { steps: 6, gain: 0.2, share: 0.0 };

impl ContactFinder {
    /// An explanation of some frames ago, brought to this one.
    pub(super) fn catch_up(&self, found: ContactHypothesis, target: &Target) -> Option<ContactHypothesis> {
        let fit = self.disc_fitter().go_on(&found.fit, target, CAUGHT_UP)?;
        Some(ContactHypothesis { fit, error: target.error().cloned(), ..found })
    }

    /// An explanation of this frame, by what another target says of the readings' errors.
    pub(super) fn judged(&self, found: ContactHypothesis, target: &Target) -> Option<ContactHypothesis> {
        let fit = self.disc_fitter().go_on(&found.fit, target, Effort { steps: 0, ..WARM })?;
        Some(ContactHypothesis { fit, error: target.error().cloned(), ..found })
    }

    /// The explanation, or what is left of it without the contacts that may not be there if that is more likely; `None` if nothing is.
    pub(super) fn without_weak(&self, found: ContactHypothesis, target: &Target) -> Option<ContactHypothesis> {
        if target.is_silent() {
            return None;
        }
        let weak = self.weak(&found.fit);
        if weak.is_empty() && !self.is_misfit(&found.fit, target) {
            return Some(found);
        }
        let evidence = self.evidence(&found.fit) + needed(&found.fit);
        if self.evidence_of_nothing(target) > evidence {
            return None;
        }
        let kept: Vec<_> = (0..found.fit.contacts.len()).filter(|k| !weak.contains(k)).collect();
        if weak.is_empty() || kept.is_empty() {
            return Some(found);
        }
        match self.some_of(&found.fit, &kept, target) {
            Some(fit) if self.evidence(&fit) > evidence => Some(ContactHypothesis { fit, certainty: None, ..found }),
            _ => Some(found),
        }
    }

    /// Contacts brought to the next frame, less those that were let go; `None` if that makes no sense.
    pub(super) fn follow(&self, last: &ContactHypothesis, target: &Target) -> Option<ContactHypothesis> {
        let fit = self.disc_fitter().go_on(&last.fit, target, WARM)?;
        let fit = match last.fit.letting_move(&fit.contacts) {
            Some(freer) => self.disc_fitter().go_on(&freer, target, WARM)?,
            None => fit,
        };
        let fit = if self.is_misfit(&fit, target) { self.without_lifted(&last.fit, fit, target) } else { fit };
        let certainty = last.certainty.filter(|_| fit.contacts.len() == last.fit.contacts.len());
        Some(ContactHypothesis { fit, certainty, ..last.clone() })
    }

    /// A fit without the contacts that have become much lighter, if these are gone: the logarithm of a conductance falls by one in each
    /// step, however light the contact is to become.
    fn without_lifted(&self, before: &DiscFit, fit: DiscFit, target: &Target) -> DiscFit {
        let is_lighter =
            |(now, before): &(&Contact, &Contact)| now.conductance_s < policy::LIFTED_SHARE * before.conductance_s;
        let pairs = fit.contacts.iter().zip(&before.contacts).enumerate();
        let kept: Vec<_> = pairs.filter(|(_, pair)| !is_lighter(pair)).map(|(k, _)| k).collect();
        if kept.is_empty() || kept.len() == fit.contacts.len() {
            return fit;
        }
        match self.some_of(&fit, &kept, target) {
            Some(fewer) if self.evidence(&fewer) > self.evidence(&fit) + needed(&fit) => fewer,
            _ => fit,
        }
    }

    /// A fit of some of the contacts of another one.
    fn some_of(&self, fit: &DiscFit, kept: &[usize], target: &Target) -> Option<DiscFit> {
        let still = fit.still.as_ref().and_then(|still| still.of(kept)).map(Arc::new);
        self.disc_fitter().fit_still(kept.iter().map(|k| fit.contacts[*k]).collect(), still, target, WARM)
    }

    /// Contacts so weak that they may not be there. The conductance of a firm one is not known well either: more of it would change
    /// little.
    fn weak(&self, fit: &DiscFit) -> Vec<usize> {
        let covariance = fit.covariance();
        let is_weak = |k: &usize| {
            let log = PARAMETERS * k + 2;
            let is_unsure =
                covariance.as_ref().is_none_or(|all| all[(log, log)] > policy::WEAK_DEVIATION * policy::WEAK_DEVIATION);
            is_unsure && fit.contacts[*k].conductance_s < self.sheet_s
        };
        (0..fit.contacts.len()).filter(is_weak).collect()
    }
}

/// Nats by which contacts of a fit have to be less likely than fewer to be let go: what several frames say is not forgotten for what one of them does not
/// need.
pub(super) fn needed(fit: &DiscFit) -> f64 {
    if fit.still.is_some() { policy::GONE_NATS } else { 0.0 }
}
