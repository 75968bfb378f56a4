//! What a search does with an explanation that it has: its contacts are looked for anew, and others that are alike are tried.

use super::others::{KINDS, is_unsure};
use super::{Awaits, SEARCHING, Search, Wants};
use crate::evidence::{freedom, is_misfit, score};
use crate::fit::{Fit, TRYING};
use crate::normal::{ANY_RADIUS, USUAL_RADIUS};
use crate::real::Real;

/// What the readings say for a contact whose strength they tell to 4 %: that one is there (squared deviations, one over the square of that). Of 120 scenes of five contacts on a
/// detector that is known 94 have the right number with 200, 96 with this; of 60 as many as with this have it with 3000, where searches take half as long again.
const SURE: f32 = 500.0;
/// By how much a contact that was looked for anew has to be better (squared deviations): of two that are alike the first stays.
const BETTER: f32 = 7.0;
/// By how much another explanation may be worse after some steps, as a share of what is a misfit, to be fitted to its end. Of 240 scenes on `built205` as many are
/// right with one, which takes a twentieth longer.
pub(super) const CLOSE: f32 = 0.3;

impl<T: Real, const K: usize, const D: usize> Search<T, K, D> {
    /// Looks for contacts of an explanation anew beside the others, one at a time: one that went astray early is held there by those that came after it. Where much is left,
    /// any; on a detector that is known, which leaves as much as noise seldom, also those that the readings hardly tell. Where it is not, that takes three times as long and
    /// finds nothing more in 360 scenes of one to three. As often as there are contacts at most; and where there are more than can be told, it is not for the search that
    /// they leave too much.
    pub(super) fn exchange(&mut self, readings: T) -> Wants<T, K, D> {
        let Some(kept) = self.kept else { return self.nothing_found() };
        let count = kept.scene.count;
        let is_much = count > 1 && self.terms.is_known && kept.cost > readings - freedom(&kept);
        let is_any = is_much || self.is_to_be_mended(&kept, readings);
        let is_astray = |contact: usize| is_any || self.terms.is_known && is_unsure(&kept, contact, SURE);
        while usize::from(self.anew) < count {
            let contact = usize::from(self.contact) % count;
            (self.contact, self.anew) = (contact as u8, self.anew + 1);
            if is_astray(contact) {
                (self.more_before, self.awaits, self.best) = (self.more, Awaits::Rest, None);
                if count == 1 {
                    self.awaits = Awaits::First;
                    return Wants::First;
                }
                return Wants::Fit(kept.scene.without(contact), T::of(USUAL_RADIUS), SEARCHING);
            }
            self.contact += 1;
        }
        self.try_others_after(None)
    }

    pub(super) fn exchanged(&mut self, readings: T) -> Wants<T, K, D> {
        let is_better = |new: &Fit<T, K, D>| self.kept.is_none_or(|kept| score(new) < score(&kept) - T::of(BETTER));
        match self.best.filter(is_better) {
            Some(new) => self.kept = Some(new),
            None => (self.contact, self.more) = (self.contact + 1, self.more_before),
        }
        self.exchange(readings)
    }

    fn is_to_be_mended(&self, fit: &Fit<T, K, D>, readings: T) -> bool {
        let is_beyond = self.more && fit.scene.count >= self.terms.most;
        !is_beyond && (self.more || is_misfit(fit, readings))
    }

    /// Tries each other explanation after the one with this number, if there is one, that may be as good: one with fewer is, where a second contact was found while the first was too
    /// small, or several narrow ones stand for a wide one. Then the explanation is the best of those that are better, if one is, and is looked through again.
    pub(super) fn try_others_after(&mut self, number: Option<u8>) -> Wants<T, K, D> {
        let Some(kept) = self.kept else { return self.nothing_found() };
        if number.is_none() {
            self.tried = None;
        }
        let next = number.map_or(0, |number| usize::from(number) + 1);
        let mut others =
            (next..KINDS * kept.scene.count).filter_map(|number| Some((number, self.other(&kept, number)?)));
        if let Some((number, scene)) = others.next() {
            self.awaits = Awaits::Other(number as u8);
            return Wants::Fit(scene, T::of(ANY_RADIUS), TRYING);
        }
        match self.tried.filter(|tried| score(tried) < score(&kept)) {
            Some(tried) => {
                self.kept = Some(tried);
                self.try_others_after(None)
            }
            None => Wants::Nothing(Some(kept)),
        }
    }
}
