//! The search, on detectors that are known exactly and others.
//!
//! What readings of the others may be off by together depends on the scene, and a little on the detector that it makes likely
//! ([`ApproximationError`]). So a fit and its target are brought to agree, for a single contact first: a second one would stand for
//! what the detector differs by. Explanations with targets of their own are compared by the evidence with the determinant of
//! their readings' error.

use std::ops::ControlFlow;
use std::sync::{Arc, PoisonError};

use nalgebra::DMatrix;

use super::discs::{DiscFit, place_m};
use super::search::{COLD, FIRST};
use super::{Better, Certainty, ContactFinder, ContactHypothesis};
use crate::solve::before::adaptive_mean::Mean;
use crate::solve::fit::approximation::{About, ApproximationError, Linearised};
use crate::solve::fit::policy;
use crate::solve::fit::target::Target;
use crate::solve::methods::compiled::{Compiled, FoundAlone};
use tactomo_physics::baseline::Leakage;
use tactomo_physics::forward::readings_v;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_physics::space;

/// How often a fit and what its readings may be off by are brought nearer to each other, at most.
const RENEWALS: usize = 6;
/// Factor by which leakage's standard deviation is changed at least.
const LEAKAGE_FACTOR: f64 = 2.0;
/// Contacts side by side, at least, that are tried as a single one: two are by [`ContactFinder::one_fewer`].
const SIDE_BY_SIDE: usize = 3;
/// How often more contacts are looked for, at most.
const GROWTHS: usize = 3;

/// An explanation with the target that it was found by.
#[derive(Clone)]
pub(super) struct Informed {
    pub hypothesis: ContactHypothesis,
    pub target: Target,
}

impl Informed {
    fn count(&self) -> usize {
        self.hypothesis.count()
    }
}

/// Tells of a better explanation; it breaks if that ends the search.
fn told(found: &Informed, better: &mut Better<'_>) -> ControlFlow<Informed> {
    better(&found.hypothesis).map_break(|()| found.clone())
}

impl ContactFinder {
    /// What explains a frame, from what explains it so far if that leads there, else from nothing. Each better explanation on the way
    /// goes to `better`, which may end the search.
    pub(super) fn search(
        &self,
        from: Option<&ContactHypothesis>,
        target: &Target,
        better: &mut Better<'_>,
    ) -> Option<ContactHypothesis> {
        if let Some((from, keys)) = from.and_then(|from| Some((from, from.keys.as_ref()?))) {
            return Some(self.staying(from, keys, target).unwrap_or_else(|| from.clone()));
        }
        let found = self.search_anew(from, target, better);
        let (ControlFlow::Break(found) | ControlFlow::Continue(found)) = found.map_break(Some);
        Some(found?.hypothesis)
    }

    /// What explains a frame: what explained the one before, or what the compiled detector finds from there. What leaves more than noise does is gone on from, contact by
    /// contact. What ended the search breaks.
    fn search_anew(
        &self,
        from: Option<&ContactHypothesis>,
        target: &Target,
        better: &mut Better<'_>,
    ) -> ControlFlow<Informed, Option<Informed>> {
        let followed = from.and_then(|from| self.caught_up(from, target));
        let begun = followed.as_ref().map_or(&[][..], |followed| &followed.hypothesis.fit.contacts);
        let Some(alone) = self.found_by_table(target, begun) else {
            return self.search_by_discs(followed, target, better);
        };
        let Some(best) = self.likelier(followed, alone) else { return ControlFlow::Continue(None) };
        let all = self.or_one_wide(best);
        let is_misfit = self.is_misfit(&all.hypothesis.fit, &all.target);
        if is_misfit {
            told(&all, better)?;
        }
        let count = all.count();
        let best = self.without_needless(all);
        if !is_misfit || best.count() != count {
            told(&best, better)?;
        }
        let fit = &best.hypothesis.fit;
        // In how wide one is another one may be hidden, far from it.
        let may_be_two = best.target.error().is_none() && best.count() == 1 && self.may_be_two(fit).is_some();
        if may_be_two || self.is_misfit(fit, &best.target) {
            return self.grown(best, better).map_continue(Some);
        }
        ControlFlow::Continue(Some(best))
    }

    /// What explains a frame, where the detector has no table: from what explained the one before, if that leads there, else from nothing, contact by contact. On a
    /// detector that is not known exactly, a few that are found roughly are given first.
    pub(super) fn search_by_discs(
        &self,
        followed: Option<Informed>,
        target: &Target,
        better: &mut Better<'_>,
    ) -> ControlFlow<Informed, Option<Informed>> {
        let followed = match followed {
            Some(followed) => Some(self.grown(followed, better)?),
            None => {
                let begun = self.problem.nuisance().and_then(|_| self.begun_roughly(target));
                begun.map_or(ControlFlow::Continue(()), |begun| told(&begun, better))?;
                None
            }
        };
        if followed.as_ref().is_some_and(|grown| !self.is_misfit(&grown.hypothesis.fit, &grown.target)) {
            return ControlFlow::Continue(followed);
        }
        let anew = match self.alone(target) {
            Some(one) => Some(self.grown(one, better)?),
            None => None,
        };
        ControlFlow::Continue(self.more_likely(followed, anew))
    }

    /// What the compiled detector finds in a frame from contacts and from nothing, if anything; `None` if there is no table, or not yet, or what is found makes no sense to the model itself.
    fn found_by_table(&self, target: &Target, begun: &[Contact]) -> Option<Option<Informed>> {
        let most = self.settings.most;
        let found = self.by_table(|compiled| compiled.alone(&target.readings(), target.noise_v, most, begun).ok())?;
        if found.contacts.is_empty() {
            return Some(None);
        }
        self.informed_of(found, target).map(Some)
    }

    /// What the compiled detector finds; `None` if there is none, or not yet, or it finds nothing.
    pub(super) fn by_table<R>(&self, find: impl FnOnce(&mut Compiled) -> Option<R>) -> Option<R> {
        let mut compiled = self.compiled.lock().unwrap_or_else(PoisonError::into_inner);
        if compiled.is_none() {
            *compiled = self.problem.compiled().map(Compiled::on);
        }
        find(compiled.as_mut()?)
    }

    /// About the detector after steps, in all directions in which it may differ; `None` if there is none such.
    pub(super) fn about_steps(&self, steps: &[f64]) -> Option<About> {
        let near = match self.problem.nuisance() {
            Some(nuisance) => {
                let steps = steps[..nuisance.directions()].to_vec();
                Some(Arc::new(Linearised { detector: nuisance.similar(&steps).ok()?, steps }))
            }
            None => None,
        };
        Some(About { near, ..About::default() })
    }

    /// What a table tells, by what the readings may be off by together near the detector that it makes likely.
    fn informed_of(&self, found: FoundAlone, target: &Target) -> Option<Informed> {
        let about = self.about_steps(&found.steps)?;
        let target = self.informed(target, &found.contacts, &about)?;
        let fit = self.disc_fitter().fit(found.contacts, &target, COLD)?;
        let certainty = found.certainty.map(|(share, alternative)| Certainty { share, alternative });
        let hypothesis = ContactHypothesis { certainty, ..ContactHypothesis::of(fit, &target) };
        Some(self.settled(Informed { hypothesis, target }))
    }

    /// An explanation without contacts that stand for what a table is off by: by the model itself it is likelier without them.
    fn without_needless(&self, mut found: Informed) -> Informed {
        let count = found.count();
        let mut by_count = vec![f64::NEG_INFINITY; count + 1];
        by_count[count] = self.evidence(&found.hypothesis.fit);
        while let Some(fewer) = self.one_fewer(&found.hypothesis.fit, &found.target) {
            let [before, without] = [found.count(), fewer.contacts.len()];
            by_count[without] = self.evidence(&fewer);
            if by_count[without] <= by_count[before] {
                break;
            }
            let certainty = Certainty::of(without, &by_count, found.target.error().is_none());
            found.hypothesis = ContactHypothesis { certainty, ..ContactHypothesis::of(fewer, &found.target) };
        }
        found
    }

    /// One wide contact in place of several side by side, where it is likelier: a table has contacts of three times the usual radius at most.
    fn or_one_wide(&self, found: Informed) -> Informed {
        let contacts = &found.hypothesis.fit.contacts;
        let Some(one) = contacts.iter().copied().reduce(|a, b| self.merged(&a, &b)) else { return found };
        let is_far = |contact: &Contact| space::distance(place_m(contact), place_m(&one)) > self.widest_m;
        if contacts.len() < SIDE_BY_SIDE || contacts.iter().any(is_far) {
            return found;
        }
        let fitted = self.informed(&found.target, &[one], &found.hypothesis.about()).and_then(|target| {
            let fit = self.disc_fitter().fit(vec![one], &target, COLD)?;
            Some(self.settled(Informed { hypothesis: ContactHypothesis::of(fit, &target), target }))
        });
        match fitted.filter(|one| self.whole_evidence(one) > self.whole_evidence(&found)) {
            Some(one) => self.likelier(Some(found.clone()), Some(one)).unwrap_or(found),
            None => found,
        }
    }

    /// The likelier of two explanations; as sure of its count as the second one is, where that has as many contacts, else as far as the other one is less likely.
    fn likelier(&self, followed: Option<Informed>, alone: Option<Informed>) -> Option<Informed> {
        let (Some(followed), Some(alone)) = (&followed, &alone) else { return followed.or(alone) };
        let [old, new] = [followed, alone].map(|found| self.whole_evidence(found));
        let mut best = if new > old { alone.clone() } else { followed.clone() };
        best.hypothesis.certainty = match followed.count() == alone.count() {
            true => alone.hypothesis.certainty,
            false => {
                let mut by_count = vec![f64::NEG_INFINITY; followed.count().max(alone.count()) + 1];
                (by_count[followed.count()], by_count[alone.count()]) = (old, new);
                Certainty::of(best.count(), &by_count, best.target.error().is_none())
            }
        };
        Some(best)
    }

    /// Contacts that stand for something else, with what the readings of that may be off by together, beginning with the detector that `error`
    /// is about; `None` if they make no sense.
    pub(crate) fn standing(
        &self,
        contacts: Vec<Contact>,
        error: Option<&Arc<ApproximationError>>,
        mean: &Mean,
    ) -> Option<ContactHypothesis> {
        let about = error.map_or_else(About::default, |error| error.about.clone());
        let target = self.informed(&self.target_to_search(mean).ok()?, &contacts, &about)?;
        let hypothesis = ContactHypothesis::of(self.disc_fitter().fit(contacts, &target, FIRST)?, &target);
        Some(self.settled(Informed { hypothesis, target }).hypothesis)
    }

    /// A few contacts, found as if nothing were known of the readings' errors but their size, which is soonest. More may stand for something
    /// else.
    fn begun_roughly(&self, target: &Target) -> Option<Informed> {
        let rough = Target::provisional(&target.readings(), target.frames, &self.errors);
        let one = self.one(&rough)?;
        let pairs = self.pairs(&one, &rough);
        let begun = self.grow(one, pairs, &rough, &mut |_| ControlFlow::Continue(()));
        if begun.fit.contacts.len() > policy::SUSPICIOUS_CONTACTS {
            return None;
        }
        let target = self.informed(target, &begun.fit.contacts, &About::default())?;
        Some(Informed { hypothesis: self.judged(begun, &target)?, target })
    }

    /// The best single contact, if anything stands out.
    pub(super) fn alone(&self, target: &Target) -> Option<Informed> {
        let target = self.informed(target, &self.begun(target)?, &About::default())?;
        let one = self.one(&target)?;
        let settled = self.settled(Informed { hypothesis: ContactHypothesis::of(one, &target), target });
        if settled.target.error().is_none() {
            return Some(settled);
        }
        // Places that seemed worse with another detector may now be better.
        let again = self.one(&settled.target)?;
        let again =
            Informed { hypothesis: ContactHypothesis::of(again, &settled.target), target: settled.target.clone() };
        self.more_likely(Some(settled), Some(again))
    }

    fn caught_up(&self, from: &ContactHypothesis, target: &Target) -> Option<Informed> {
        let target = self.informed(target, &from.fit.contacts, &from.about())?;
        let fit = self.disc_fitter().go_on(&from.fit, &target, COLD)?;
        Some(self.settled(Informed { hypothesis: ContactHypothesis::of(fit, &target), target }))
    }

    /// Brings a fit and what its readings may be off by to agree.
    fn settled(&self, mut found: Informed) -> Informed {
        for renewal in 0..RENEWALS {
            let Informed { hypothesis, target } = &found;
            // What contacts are missing for says nothing of the detector.
            let is_hopeless = hypothesis.fit.cost > policy::WRONG_MEAN_SQUARE * target.count() as f64
                || self.is_misfit(&hypothesis.fit, target) && self.is_widest(hypothesis);
            let nearer = self.nearer(&hypothesis.fit, target, is_hopeless);
            let is_settled = target.error().is_none_or(|error| error.is_settled(&hypothesis.fit.volts));
            if nearer.is_none() && (is_settled || is_hopeless && renewal > 0) {
                break;
            }
            let about = nearer.unwrap_or_else(|| hypothesis.about());
            let contacts = &hypothesis.fit.contacts;
            let renewed = self.informed(target, contacts, &about);
            let fitted = renewed.and_then(|target| {
                let fit = self.disc_fitter().fit(contacts.clone(), &target, COLD)?;
                let error = target.error().cloned();
                let hypothesis = ContactHypothesis { fit, error, ..hypothesis.clone() };
                Some(Informed { hypothesis, target })
            });
            let Some(fitted) = fitted else { break };
            found = fitted;
        }
        found
    }

    /// More contacts as long as the evidence for them grows, then whatever other set of them is more likely.
    fn grown(&self, first: Informed, better: &mut Better<'_>) -> ControlFlow<Informed, Informed> {
        let mut best = self.one_by_one(first, better)?;
        for _ in 0..GROWTHS {
            let fit = &best.hypothesis.fit;
            let starts = self.pairs(fit, &best.target);
            let grown = self.grow(fit.clone(), starts, &best.target, &mut |_| ControlFlow::Continue(()));
            let is_other = grown.fit.contacts.len() != fit.contacts.len();
            let grown = self.settled(Informed { hypothesis: grown, target: best.target.clone() });
            let is_better = self.whole_evidence(&grown) > self.whole_evidence(&best);
            if is_better {
                best = grown;
                told(&best, better)?;
            } else if !is_other {
                // The same contacts, with what is known of their count.
                best.hypothesis.certainty = grown.hypothesis.certainty;
            }
            if !(is_better && is_other) {
                break;
            }
        }
        ControlFlow::Continue(best)
    }

    /// As many contacts as their spots ask for, then one more at a time, each with what its readings may be off by, while there are too few.
    fn one_by_one(&self, first: Informed, better: &mut Better<'_>) -> ControlFlow<Informed, Informed> {
        told(&first, better)?;
        let crowd = self.crowd(&first.hypothesis.fit, &first.target).map(|crowd| {
            let (hypothesis, target) = (ContactHypothesis::of(crowd, &first.target), first.target.clone());
            self.settled(Informed { hypothesis, target })
        });
        let is_likelier = |crowd: &Informed| self.whole_evidence(crowd) > self.whole_evidence(&first);
        let mut best = match crowd.filter(is_likelier) {
            Some(crowd) => {
                told(&crowd, better)?;
                crowd
            }
            None => first,
        };
        let mut last = best.clone();
        while self.is_misfit(&best.hypothesis.fit, &best.target) {
            let Informed { hypothesis: ContactHypothesis { fit, .. }, target } = last;
            if fit.contacts.len() >= self.settings.most {
                break;
            }
            let starts = self.pairs(&fit, &target);
            let Ok(more) = self.one_more(&fit, starts, &target) else { break };
            last = self.settled(Informed { hypothesis: ContactHypothesis::of(more, &target), target });
            if self.whole_evidence(&last) > self.whole_evidence(&best) {
                best = last.clone();
                told(&best, better)?;
            } else if last.hypothesis.fit.contacts.len() > best.hypothesis.fit.contacts.len() + 1 {
                break;
            }
        }
        ControlFlow::Continue(best)
    }

    fn more_likely(&self, one: Option<Informed>, other: Option<Informed>) -> Option<Informed> {
        let all = [one, other].into_iter().flatten();
        all.max_by(|a, b| self.whole_evidence(a).total_cmp(&self.whole_evidence(b)))
    }

    /// Logarithm of the evidence, with the determinant that explanations of one target have in common.
    fn whole_evidence(&self, found: &Informed) -> f64 {
        self.evidence(&found.hypothesis.fit) - 0.5 * found.target.ln_determinant()
    }

    /// The target with what the readings of such contacts may be off by together, linear near a detector or else the described one, and as it is where that is not known or
    /// nothing; `None` if contacts make no sense.
    pub(super) fn informed(&self, target: &Target, contacts: &[Contact], about: &About) -> Option<Target> {
        if self.problem.nuisance().is_none() {
            return Some(target.clone());
        }
        Some(self.informed_with_patterns(target, contacts, about)?.0)
    }

    /// The same with what unknown things change in the readings (V), each by its standard deviation, a column each.
    pub(super) fn informed_with_patterns(
        &self,
        target: &Target,
        contacts: &[Contact],
        about: &About,
    ) -> Option<(Target, DMatrix<f64>)> {
        let (mut patterns_v, made_for) = self.patterns_v(contacts, about)?;
        target.mask(&mut patterns_v);
        let least_v = self.errors.least_v(made_for.largest_v());
        let steps = self.problem.nuisance()?.directions();
        let error = ApproximationError::of(&patterns_v, steps, made_for.volts().to_vec(), least_v);
        let leakage_v = patterns_v.column(patterns_v.ncols() - 1).as_slice().to_vec();
        let of_near = |near: &Arc<Linearised>| near.detector.readings_v(contacts, self.problem.detector());
        let volts = about.near.as_ref().map(of_near).transpose().ok()?;
        let informed = target.with(error.about(about, leakage_v, volts.as_ref().map(Readings::volts)));
        Some((informed, patterns_v))
    }

    /// What unknown things of detector, board and, last, leakage change in the readings of contacts (V), each by its standard deviation, a column
    /// each, and these readings; `None` if the detector is known exactly, or contacts make no sense.
    pub(super) fn patterns_v(&self, contacts: &[Contact], about: &About) -> Option<(DMatrix<f64>, Readings)> {
        let detector = self.problem.detector();
        let mut patterns_v = self.problem.nuisance()?.patterns_v(contacts, detector).ok()?;
        let impedance_ohm = self.problem.model.impedance_ohm(contacts).ok()?;
        let readings = readings_v(&impedance_ohm, detector);
        let of_board = self.errors.patterns_v(&readings);
        let columns = patterns_v.ncols();
        patterns_v = patterns_v.resize_horizontally(columns + of_board.ncols() + 1, 0.0);
        patterns_v.columns_mut(columns, of_board.ncols()).copy_from(&of_board);
        let by_leakage_v = self.leakage().change_v(&impedance_ohm, about.leakage_sheets);
        patterns_v.column_mut(columns + of_board.ncols()).copy_from_slice(&by_leakage_v);
        Some((patterns_v, readings))
    }

    fn leakage(&self) -> &Leakage {
        self.leakage.get_or_init(|| {
            let electrodes: Vec<_> = (0..self.problem.detector().electrodes.len()).collect();
            Leakage::new(&self.problem.jacobian, &electrodes)
        })
    }

    /// What a fit makes of the detector, if that is far from what the target is about. Contacts that do not explain the readings say nothing
    /// of it, unless leakage does.
    fn nearer(&self, fit: &DiscFit, target: &Target, is_hopeless: bool) -> Option<About> {
        let about = &target.error()?.about;
        let near = if is_hopeless { None } else { self.nearer_detector(fit, target) };
        let seen = target.leakage(&fit.volts)?;
        let says = !is_hopeless || seen.squares > policy::LEAKAGE_SHARE * fit.cost;
        let sheets = seen.sheets.max(policy::LEAKAGE_SHEETS);
        let is_other = says && (sheets / about.leakage_sheets).ln().abs() > LEAKAGE_FACTOR.ln();
        let leakage_sheets = if is_other { sheets } else { about.leakage_sheets };
        (near.is_some() || is_other).then(|| About { near: near.or_else(|| about.near.clone()), leakage_sheets })
    }

    /// The detector that a fit makes most likely, if it is far from where the target is linear.
    fn nearer_detector(&self, fit: &DiscFit, target: &Target) -> Option<Arc<Linearised>> {
        let (nuisance, error) = (self.problem.nuisance()?, target.error()?);
        let steps = target.steps(&fit.volts);
        if !error.is_far(&steps, target.deviation_v()) {
            return None;
        }
        let detector = nuisance.similar(&steps).ok()?;
        Some(Arc::new(Linearised { steps, detector }))
    }
}
