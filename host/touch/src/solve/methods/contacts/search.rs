//! How many contacts.
//!
//! As many at once as explain much each, as spots ([`spot_fit`](super::spot_fit)); then one more at a time: what each place would explain that the
//! contacts so far cannot ([`scan`](super::scan)), spots there, discs from the best of these, and the evidence for the answer
//! ([`evidence`](super::evidence)). Then one fewer at a time, as long as that is more likely.

use super::discs::{DiscFit, DiscFitter, Effort, PARAMETERS, place_m};
use super::on_detector::OnDetector;
use super::scan::{Fitted, Looks};
use super::spot_fit::SpotFitter;
use super::{Better, ContactFinder, ContactHypothesis};
use crate::solve::fit::policy;
use crate::solve::fit::target::Target;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_physics::space;

/// A few steps, more of them with the rough model, and all the way to the minimum.
pub(super) const FIRST: Effort = Effort { steps: 3, gain: 1.0, share: 0.02 };
pub(super) const ROUGH: Effort = Effort { steps: 10, gain: 1.0, share: 0.02 };
pub(super) const COLD: Effort = Effort { steps: 20, gain: 0.02, share: 0.1 };
/// With radii free: each step of a wide disc costs as much as ten of a fingertip's.
const RELEASED: Effort = Effort { steps: 6, gain: 0.2, share: 0.02 };
/// Starts of contacts, and how many of them go on.
const STARTS: usize = 4;
pub(super) const FINALISTS: usize = 2;

impl ContactFinder {
    /// Mean square of what one contact leaves of readings, in what noise and model error make; `None` if there is none.
    pub fn left_by_one(&self, readings: &Readings) -> Option<f64> {
        let target = Target::of_mean(readings, 1, &self.errors, None);
        let (cost, count) = match self.alone(&target) {
            Some(one) => (one.hypothesis.fit.cost, one.target.count()),
            None => (self.one(&target)?.cost, target.count()),
        };
        Some(cost / count.max(1) as f64)
    }

    /// Share of readings that one contact leaves, as far as a look at every place tells: next to no time, and no standard errors.
    pub fn roughly_left_by_one(&self, readings: &Readings) -> f64 {
        self.scan.left_by_one(&self.spot_model, &self.problem.completed(readings))
    }

    /// A look for contacts where there are none yet.
    fn looks(&self, target: &Target) -> Looks<'_> {
        self.scan.at_first(&self.spot_model, target, &self.problem.completed(&target.readings()))
    }

    /// Whether there is any contact at all, as far as single ones tell.
    pub fn stands_out(&self, target: &Target) -> bool {
        let looks = self.looks(target);
        self.scan.ones(&looks, 1, self.apart_m()).first().is_some_and(|best| best.gain >= policy::FIRST_GAIN)
    }

    /// Starts of two contacts at once, where one leaves a little more than it should, or is wide: then another one far from it may be hidden in how wide it is.
    pub(super) fn pairs(&self, one: &DiscFit, target: &Target) -> Vec<Vec<Contact>> {
        let may_be_two = self.is_doubtful(one, target) || self.may_be_two(one).is_some();
        if one.contacts.len() > 1 || self.settings.most < 2 || !may_be_two {
            return Vec::new();
        }
        let looks = self.looks(target);
        let pairs = self.scan.pairs(&looks, STARTS, self.apart_m());
        pairs.iter().map(|pair| self.discs_of(&self.scan.start(&looks, pair))).collect()
    }

    /// A first guess of a single contact; `None` if nothing stands out.
    pub(super) fn begun(&self, target: &Target) -> Option<Vec<Contact>> {
        let looks = self.looks(target);
        let best = self.scan.ones(&looks, 1, self.apart_m()).into_iter().next()?;
        (best.gain >= policy::FIRST_GAIN).then(|| self.discs_of(&self.scan.start(&looks, &best)))
    }

    /// The best single contact, if anything stands out.
    pub(super) fn one(&self, target: &Target) -> Option<DiscFit> {
        let looks = self.looks(target);
        let ones = self.scan.ones(&looks, STARTS, self.apart_m());
        if ones.first().is_none_or(|best| best.gain < policy::FIRST_GAIN) {
            return None;
        }
        let starts = ones.iter().map(|one| self.discs_of(&self.scan.start(&looks, one)));
        let best = self.best_alone(starts.collect(), target)?;
        if best.cost > policy::WRONG_MEAN_SQUARE * target.count() as f64 {
            return Some(best);
        }
        let beside = self.best_alone(self.beside(&best.contacts[0], best.along(0).0), target);
        Some(beside.filter(|beside| self.evidence(beside) > self.evidence(&best)).unwrap_or(best))
    }

    /// A fit with radii free, if it is at the widest that is plausible; else what it is.
    fn released(&self, fit: DiscFit, target: &Target) -> DiscFit {
        let is_wide = |contact: &Contact| contact.radius_m > 0.99 * policy::PLAUSIBLE_RADII * self.settings.radius_m;
        if !fit.contacts.iter().any(is_wide) {
            return fit;
        }
        let full = self.disc_fitter();
        let rough = DiscFitter { model: &*self.rough, ..full };
        let free = rough.fit(fit.contacts.clone(), target, ROUGH);
        let free = free.filter(|free| free.cost < policy::WRONG_WIDE_MEAN_SQUARE * target.count() as f64);
        let free = free.and_then(|free| full.fit(free.contacts, target, RELEASED));
        free.unwrap_or(fit)
    }

    /// More contacts as long as the evidence for them grows, then fewer. `starts` are tried for the second one.
    pub(super) fn grow(
        &self,
        first: DiscFit,
        mut starts: Vec<Vec<Contact>>,
        target: &Target,
        better: &mut Better<'_>,
    ) -> ContactHypothesis {
        let mut by_count = vec![f64::NEG_INFINITY; self.settings.most + 1];
        let mut last = first.clone();
        let mut best = self.noted(first.clone(), &mut by_count);
        let _ = better(&ContactHypothesis::new(first.clone(), &by_count, target));
        best = Self::better_of(best, self.noted(self.released(first, target), &mut by_count));
        // One that is wide and explains all would be the end of it. Spots tell little of it: pairs are fitted as they are.
        let would_end = self.may_be_two(&best.0).is_some() && !self.is_doubtful(&best.0, target);
        let pairs = starts.iter().filter(|_| would_end);
        let pairs = pairs.filter_map(|pair| self.plausible_fitter().fit(pair.clone(), target, COLD));
        let pair = pairs.max_by(|a, b| self.evidence(a).total_cmp(&self.evidence(b)));
        for several in [self.crowd(&best.0, target), pair].into_iter().flatten() {
            let several = self.noted(several, &mut by_count);
            if several.1 > best.1 {
                last = several.0.clone();
                best = several;
                let _ = better(&ContactHypothesis::new(best.0.clone(), &by_count, target));
            }
        }
        while last.contacts.len() < self.settings.most {
            let more = match self.one_more(&last, std::mem::take(&mut starts), target) {
                Ok(more) => self.noted(more, &mut by_count),
                Err(evidence) => {
                    let count = &mut by_count[last.contacts.len() + 1];
                    *count = count.max(evidence);
                    break;
                }
            };
            last = more.0.clone();
            if more.1 > best.1 {
                best = more;
                let _ = better(&ContactHypothesis::new(best.0.clone(), &by_count, target));
            } else if !self.is_misfit(&best.0, target) || last.contacts.len() > best.0.contacts.len() + 1 {
                break;
            }
        }
        for _ in 0..self.settings.most {
            if !self.is_doubtful(&best.0, target) {
                break;
            }
            let Some(other) = self.swapped(&best, target).map(|other| self.noted(other, &mut by_count)) else { break };
            best = other;
            let _ = better(&ContactHypothesis::new(best.0.clone(), &by_count, target));
        }
        if self.is_misfit(&best.0, target) {
            best = self.noted(self.released(best.0, target), &mut by_count);
        }
        while let Some(fewer) = self.one_fewer(&best.0, target).map(|fewer| self.noted(fewer, &mut by_count)) {
            if fewer.1 <= best.1 {
                break;
            }
            best = fewer;
        }
        ContactHypothesis::new(best.0, &by_count, target)
    }

    /// As many contacts at once as their spots ask for, where those of a fit leave far more than noise.
    pub(super) fn crowd(&self, fit: &DiscFit, target: &Target) -> Option<DiscFit> {
        if fit.cost < policy::WRONG_MEAN_SQUARE * target.count() as f64 {
            return None;
        }
        // A fit that is far off is as wide as it may be, which tells nothing of the contacts that it stands for.
        let usual = |contact: &Contact| Contact { radius_m: self.settings.radius_m, ..*contact };
        let begun: Vec<_> = fit.contacts.iter().map(usual).collect();
        let mut spots = SpotFitter::new(self, None, target);
        let begun = spots.start(&begun)?;
        let crowd = spots.crowd(&begun.contacts)?;
        self.plausible_fitter().fit(crowd, target, COLD)
    }

    /// The more likely one.
    fn better_of(one: (DiscFit, f64), other: (DiscFit, f64)) -> (DiscFit, f64) {
        if other.1 > one.1 { other } else { one }
    }

    /// A fit with its evidence, which is noted as that of its count if it is the best of it.
    fn noted(&self, fit: DiscFit, by_count: &mut [f64]) -> (DiscFit, f64) {
        let evidence = self.evidence(&fit);
        if let Some(best) = by_count.get_mut(fit.contacts.len()) {
            *best = best.max(evidence);
        }
        (fit, evidence)
    }

    /// The best fit with one more contact, from some starts or from where it would explain most; the logarithm of the evidence for one, as their spots
    /// tell it, if it is not worth a fit of discs.
    pub(super) fn one_more(
        &self,
        fit: &DiscFit,
        mut starts: Vec<Vec<Contact>>,
        target: &Target,
    ) -> Result<DiscFit, f64> {
        let looks = self.looks_beside(fit, target);
        let ones = looks.as_ref().map_or_else(Vec::new, |looks| self.scan.ones(looks, STARTS, self.apart_m()));
        let is_worth_a_try = ones.first().is_some_and(|best| best.gain > policy::PARAMETER_PRICE)
            || self.may_hide_more(fit.contacts.len());
        if !is_worth_a_try && !self.is_doubtful(fit, target) {
            return Err(f64::NEG_INFINITY);
        }
        for (looks, one) in looks.iter().flat_map(|looks| ones.iter().map(move |one| (looks, one))) {
            let more = self.discs_of(&self.scan.start(looks, one));
            starts.push(fit.contacts.iter().copied().chain(more).collect());
        }
        starts.extend(self.splits(fit));
        let mut spots = SpotFitter::new(self, Some(fit), target);
        let mut begun = self.begun_by(&mut spots, &starts);
        let best = begun.first().ok_or(f64::NEG_INFINITY)?;
        let gain = 0.5 * (fit.cost - best.cost) + spots.ln_of_last(best).unwrap_or(f64::NEG_INFINITY);
        // Of what contacts are not, as a ring, spots tell little.
        if gain < -policy::MODES_NATS && !self.is_misfit(fit, target) {
            return Err(self.evidence(fit) + gain);
        }
        let most = best.cost + 2.0 * policy::MODES_NATS;
        begun.retain(|start| start.cost <= most);
        begun.truncate(if gain > 0.0 { FINALISTS } else { 1 });
        self.best_of(begun, target).ok_or(f64::NEG_INFINITY)
    }

    /// A look for more contacts beside those of a fit.
    pub(super) fn looks_beside(&self, fit: &DiscFit, target: &Target) -> Option<Looks<'_>> {
        let spots: Vec<_> = fit.contacts.iter().map(|contact| self.spot_of(contact)).collect();
        let at = target.at(&fit.volts);
        let slopes = at.whitened_columns(fit.slopes_v());
        let left = target.residuals(&fit.volts).into();
        let fitted = Fitted { spots: &spots, slopes, normal: &fit.normal, left };
        self.scan.beside(&self.spot_model, &*self.fields, &fitted, &at)
    }

    /// Whether beside so many contacts another may be where the linear theory cannot tell it. What light contacts do to balanced readings has as
    /// many dimensions as there are electrodes, and each contact takes those of its parameters.
    fn may_hide_more(&self, count: usize) -> bool {
        PARAMETERS * (count + 1) >= self.spot_model.electrodes()
    }

    /// Whether a fit leaves a little more than noise should, or needs a contact as wide as may be.
    pub(super) fn is_doubtful(&self, fit: &DiscFit, target: &Target) -> bool {
        let freedom = self.freedom(fit, target);
        let widest_m = 0.95 * policy::PLAUSIBLE_RADII * self.settings.radius_m;
        let is_wide = fit.contacts.len() > 1 && fit.contacts.iter().any(|contact| contact.radius_m > widest_m);
        fit.cost > freedom + policy::DOUBT_DEVIATIONS * (2.0 * freedom).sqrt() || is_wide
    }

    /// A more likely fit with one of the contacts taken away and put where it explains most.
    fn swapped(&self, (best, evidence): &(DiscFit, f64), target: &Target) -> Option<DiscFit> {
        if best.contacts.len() < 2 {
            return None;
        }
        let mut order: Vec<_> = (0..best.contacts.len()).collect();
        order.sort_unstable_by(|a, b| best.contacts[*b].radius_m.total_cmp(&best.contacts[*a].radius_m));
        order.into_iter().find_map(|k| {
            let mut others = best.contacts.clone();
            others.remove(k);
            let rough = DiscFitter { model: &*self.rough, ..self.plausible_fitter() };
            let fewer = rough.fit(others, target, FIRST)?;
            let other = self.one_more(&fewer, Vec::new(), target).ok()?;
            (self.evidence(&other) > *evidence).then_some(other)
        })
    }

    /// The best fit with one contact fewer: without any of them, and with two that nearly touch taken for one.
    pub(super) fn one_fewer(&self, fit: &DiscFit, target: &Target) -> Option<DiscFit> {
        let count = fit.contacts.len();
        if count < 2 {
            return None;
        }
        let without = |k: usize| -> Vec<_> {
            fit.contacts.iter().enumerate().filter(|(other, _)| *other != k).map(|(_, contact)| *contact).collect()
        };
        let pairs = (0..count).flat_map(|a| (0..a).map(move |b| (a, b)));
        let merged = pairs.filter_map(|(a, b)| {
            let [one, other] = [a, b].map(|k| fit.contacts[k]);
            let near_m = policy::TWO_RADII * (one.radius_m + other.radius_m);
            (space::distance(place_m(&one), place_m(&other)) < near_m).then(|| {
                let mut merged = without(a);
                merged[b] = self.merged(&one, &other);
                merged
            })
        });
        let fewer: Vec<_> = (0..count).map(without).collect();
        let fewer = self.best_near(fit, &fewer, |start| self.may_be_as_good(start, fit), target);
        // Two that are one wide contact are far from what spots tell.
        let merged = self.best_near(fit, &merged.collect::<Vec<_>>(), |_| true, target);
        let objective = |fit: &DiscFit| fit.cost + fit.known;
        let all = [fewer, merged].into_iter().flatten();
        let fewer = all.min_by(|a, b| objective(a).total_cmp(&objective(b)))?;
        Some(self.released(fewer, target))
    }

    /// Logarithm of the evidence for a fit.
    pub(super) fn evidence(&self, fit: &DiscFit) -> f64 {
        let inside = fit.covariance().map_or(0.0, |covariance| {
            let of = |k: usize| OnDetector::of(fit, k, &covariance, &self.disc_fitter());
            (0..fit.contacts.len()).filter_map(of).map(|place| place.ln_share).sum()
        });
        self.prior.ln_evidence(fit) + inside
    }

    /// Logarithm of the evidence for there being no contact.
    pub(super) fn evidence_of_nothing(&self, target: &Target) -> f64 {
        -0.5 * target.cost_of_nothing()
    }

    pub(super) fn plausible_fitter(&self) -> DiscFitter<'_> {
        let fitter = self.disc_fitter();
        DiscFitter { widest_m: fitter.widest_m.min(policy::PLAUSIBLE_RADII * self.settings.radius_m), ..fitter }
    }

    pub(super) fn disc_fitter(&self) -> DiscFitter<'_> {
        DiscFitter {
            model: &*self.problem.model,
            usual_radius_m: self.settings.radius_m,
            radius_deviation: self.settings.radius_deviation,
            sheet_s: self.sheet_s,
            place_variance_m2: self.prior.place_variance_m2(),
            fields: &*self.fields,
            widest_m: self.widest_m,
            detector: self.problem.detector(),
        }
    }
}
