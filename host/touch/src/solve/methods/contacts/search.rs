//! How many contacts, and where each fit starts.
//!
//! One contact more at a time: what each place would explain that the contacts so far cannot ([`scan`](super::scan)), a fit of
//! discs from the best of them, and the evidence for the answer ([`evidence`](super::evidence)). Then one fewer at a time, as long as
//! that is more likely.

use std::f64::consts::TAU;

use super::discs::{DiscFit, DiscFitter, Effort, PARAMETERS, place_m};
use super::on_detector::OnDetector;
use super::scan::Looks;
use super::{Better, ContactFinder, ContactHypothesis};
use crate::solve::fit::policy;
use crate::solve::fit::spots::LoadedSpot;
use crate::solve::fit::target::Target;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_physics::space::{self, Place};

/// A few steps from each start, and the way to the minimum from the best.
const FIRST: Effort = Effort { steps: 3, gain: 1.0, share: 0.02 };
const ROUGH: Effort = Effort { steps: 10, gain: 1.0, share: 0.02 };
pub(super) const COLD: Effort = Effort { steps: 20, gain: 0.02, share: 0.02 };
/// With radii free: each step of a wide disc costs as much as ten of a fingertip's.
const RELEASED: Effort = Effort { steps: 6, gain: 0.2, share: 0.02 };
/// Starts of one more contact, and how many of them go on.
const STARTS: usize = 4;
const FINALISTS: usize = 2;
/// Starts around a single contact.
const BESIDE: usize = 8;
/// Directions along which a contact that may be two is split.
const DIRECTIONS: [[f64; 2]; 4] = [[1.0, 0.0], [0.0, 1.0], [0.7, 0.7], [0.7, -0.7]];
/// Places of two fits that are so near, in radii, are taken for one.
const ALIKE: f64 = 0.3;

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

    /// What explains a frame of a detector that is as described, from what explains it so far if that leads there, else from nothing. Each better
    /// explanation on the way goes to `better`; to the end, as it takes little.
    pub(super) fn search_exact(
        &self,
        from: Option<&ContactHypothesis>,
        target: &Target,
        better: &mut Better<'_>,
    ) -> Option<ContactHypothesis> {
        let grown = from.and_then(|from| self.disc_fitter().go_on(&from.fit, target, COLD));
        let grown = grown.map(|fit| self.grow(fit, Vec::new(), target, better));
        if let Some(grown) = grown.as_ref().filter(|grown| !self.is_misfit(&grown.fit, target)) {
            return Some(grown.clone());
        }
        let anew = self.one(target).map(|one| {
            let starts = self.pairs(&one, target);
            self.grow(one, starts, target, better)
        });
        [grown, anew].into_iter().flatten().max_by(|a, b| self.evidence(&a.fit).total_cmp(&self.evidence(&b.fit)))
    }

    /// Starts of two contacts at once, where one leaves a little more than it should.
    pub(super) fn pairs(&self, one: &DiscFit, target: &Target) -> Vec<Vec<Contact>> {
        if one.contacts.len() > 1 || !self.is_doubtful(one, target) {
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
        let starts = ones.iter().map(|candidate| self.discs_of(&self.scan.start(&looks, candidate)));
        let best = self.best_of(starts.collect(), target)?;
        if best.cost > policy::WRONG_MEAN_SQUARE * target.count() as f64 {
            return Some(best);
        }
        let beside = self.best_of(self.beside(&best.contacts[0], best.along(0).0), target);
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
        while last.contacts.len() < self.settings.most {
            let Some(more) = self.one_more(&last, std::mem::take(&mut starts), target) else { break };
            let more = self.noted(more, &mut by_count);
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

    /// The best fit with one more contact, from some starts or from where it would explain most; `None` if the readings ask for none.
    pub(super) fn one_more(&self, fit: &DiscFit, mut starts: Vec<Vec<Contact>>, target: &Target) -> Option<DiscFit> {
        let spots: Vec<_> = fit.contacts.iter().map(|contact| self.spot_of(contact)).collect();
        let looks = self.scan.beside(&self.spot_model, &*self.fields, &spots, fit, target);
        let ones = looks.as_ref().map_or_else(Vec::new, |looks| self.scan.ones(looks, STARTS, self.apart_m()));
        let is_worth_a_try = ones.first().is_some_and(|best| best.gain > policy::ONE_MORE_GAIN)
            || self.may_hide_more(fit.contacts.len());
        if !is_worth_a_try && !self.is_doubtful(fit, target) {
            return None;
        }
        for (looks, one) in looks.iter().flat_map(|looks| ones.iter().map(move |one| (looks, one))) {
            let more = self.discs_of(&self.scan.start(looks, one));
            starts.push(fit.contacts.iter().copied().chain(more).collect());
        }
        starts.extend(self.splits(fit));
        self.best_of(starts, target)
    }

    /// Whether beside so many contacts another may be where the linear theory cannot tell it. What light contacts do to balanced readings has as
    /// many dimensions as there are electrodes, and each contact takes those of its parameters.
    fn may_hide_more(&self, count: usize) -> bool {
        PARAMETERS * (count + 1) >= self.spot_model.electrodes()
    }

    /// Starts with a wide contact taken for two beside each other, in some directions.
    fn splits(&self, fit: &DiscFit) -> Vec<Vec<Contact>> {
        let widest =
            (0..fit.contacts.len()).max_by(|a, b| fit.contacts[*a].radius_m.total_cmp(&fit.contacts[*b].radius_m));
        let is_wide = |k: &usize| fit.contacts[*k].radius_m > policy::TWO_RADII * self.settings.radius_m;
        let Some(k) = widest.filter(is_wide) else { return Vec::new() };
        let wide = fit.contacts[k];
        let (along, _) = fit.along(k);
        let split = |[a, b]: [f64; 2]| {
            let half = |sign: f64| {
                let way_m = sign * wide.radius_m;
                let to_m = space::moved(place_m(&wide), [way_m * a, way_m * b], along);
                let [x_m, y_m, z_m] = self.fields.footing(to_m).0;
                let radius_m = self.settings.radius_m;
                Contact { x_m, y_m, z_m, radius_m, conductance_s: 0.5 * wide.conductance_s }
            };
            let mut contacts = fit.contacts.clone();
            contacts[k] = half(1.0);
            contacts.push(half(-1.0));
            contacts
        };
        DIRECTIONS.map(split).into()
    }

    /// Whether a fit leaves a little more than noise should, or needs a contact as wide as may be.
    pub(super) fn is_doubtful(&self, fit: &DiscFit, target: &Target) -> bool {
        let freedom = self.freedom(fit, target);
        let widest_m = 0.95 * policy::PLAUSIBLE_RADII * self.settings.radius_m;
        let is_wide = fit.contacts.len() > 1 && fit.contacts.iter().any(|contact| contact.radius_m > widest_m);
        fit.cost > freedom + policy::OTHER_SET_DEVIATIONS * (2.0 * freedom).sqrt() || is_wide
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
            let other = self.one_more(&fewer, Vec::new(), target)?;
            (self.evidence(&other) > evidence + policy::OTHER_SET_NATS).then_some(other)
        })
    }

    /// Starts around a contact: near edges and pads there may be another minimum that is nearly as deep.
    fn beside(&self, one: &Contact, along: [Place; 2]) -> Vec<Vec<Contact>> {
        let start = |turn: usize| {
            let (sin, cos) = (TAU * turn as f64 / BESIDE as f64).sin_cos();
            let away_m = self.apart_m();
            let to_m = space::moved(place_m(one), [away_m * cos, away_m * sin], along);
            let [x_m, y_m, z_m] = self.fields.footing(to_m).0;
            vec![Contact { x_m, y_m, z_m, radius_m: self.settings.radius_m, ..*one }]
        };
        (0..BESIDE).map(start).collect()
    }

    /// The best fit with one contact fewer: without each weak one, and with two that nearly touch taken for one.
    fn one_fewer(&self, fit: &DiscFit, target: &Target) -> Option<DiscFit> {
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
            let near_m = policy::TOUCHING_SUMS * (one.radius_m + other.radius_m);
            (space::distance(place_m(&one), place_m(&other)) < near_m).then(|| {
                let mut merged = without(a);
                merged[b] = self.merged(&one, &other);
                merged
            })
        });
        let fewer =
            self.best_of(self.dispensable(fit, target).into_iter().map(without).chain(merged).collect(), target)?;
        Some(self.released(fewer, target))
    }

    /// Contacts that a fit may do without: weak ones, and of a detector that is not known exactly any, as they may stand for what it differs by.
    fn dispensable(&self, fit: &DiscFit, target: &Target) -> Vec<usize> {
        if target.error().is_some() { (0..fit.contacts.len()).collect() } else { self.weak(fit) }
    }

    fn merged(&self, a: &Contact, b: &Contact) -> Contact {
        let conductance_s = a.conductance_s + b.conductance_s;
        let share = b.conductance_s / conductance_s;
        let between = |a: f64, b: f64| a + share * (b - a);
        let place_m = [between(a.x_m, b.x_m), between(a.y_m, b.y_m), between(a.z_m, b.z_m)];
        let [x_m, y_m, z_m] = self.fields.footing(place_m).0;
        Contact { x_m, y_m, z_m, conductance_s, radius_m: a.radius_m.hypot(b.radius_m) }
    }

    /// The best fit from some starts: with the rough model a few steps from each, then more from the best; last with the full one.
    fn best_of(&self, starts: Vec<Vec<Contact>>, target: &Target) -> Option<DiscFit> {
        let full = self.plausible_fitter();
        let rough = DiscFitter { model: &*self.rough, ..full };
        let objective = |fit: &DiscFit| fit.cost + fit.known;
        let by_objective = |a: &DiscFit, b: &DiscFit| objective(a).total_cmp(&objective(b));
        let mut fits = Vec::with_capacity(starts.len());
        for fit in starts.into_iter().filter_map(|start| rough.fit(start, target, FIRST)) {
            let explains = fit.cost < policy::EXPLAINED_MEAN_SQUARE * target.count() as f64;
            fits.push(fit);
            if explains {
                break;
            }
        }
        fits.sort_unstable_by(by_objective);
        // Starts often lead to one minimum.
        fits.dedup_by(|later, first| self.is_alike(first, later));
        fits.truncate(FINALISTS);
        let fits = fits.into_iter().filter_map(|fit| rough.go_on(&fit, target, ROUGH));
        let best = fits.min_by(by_objective)?;
        full.fit(best.contacts, target, COLD)
    }

    /// Whether each contact of one fit is where one of the other is.
    fn is_alike(&self, a: &DiscFit, b: &DiscFit) -> bool {
        let near =
            |a: &Contact, b: &Contact| space::distance(place_m(a), place_m(b)) < ALIKE * a.radius_m.min(b.radius_m);
        a.contacts.iter().all(|a| b.contacts.iter().any(|b| near(a, b)))
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

    /// Starts nearer to each other are one (m).
    fn apart_m(&self) -> f64 {
        self.spacing_m / 3.0
    }

    /// Discs of the usual radius where spots are.
    fn discs_of(&self, spots: &[LoadedSpot]) -> Vec<Contact> {
        let disc = |spot: &LoadedSpot| {
            let [x_m, y_m, z_m] = spot.spot.place_m;
            // What is better than its own spreading allows is nearly perfect.
            let ohm = (spot.ohm - spot.spot.own_ohm).max(0.2 * spot.spot.own_ohm);
            let contact = Contact::flat(x_m, y_m, self.settings.radius_m, 1.0 / (ohm * spot.spot.share));
            self.disc_fitter().held(Contact { z_m, ..contact })
        };
        spots.iter().map(disc).collect()
    }

    /// The spot that a disc acts as from afar: a wider one meets less of its own spreading resistance.
    fn spot_of(&self, contact: &Contact) -> LoadedSpot {
        let spot = self.fields.spot(place_m(contact));
        let own_ohm = spot.own_ohm * self.settings.radius_m / contact.radius_m;
        LoadedSpot { ohm: own_ohm + 1.0 / (spot.share * contact.conductance_s), spot }
    }

    fn plausible_fitter(&self) -> DiscFitter<'_> {
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
