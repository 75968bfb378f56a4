//! How many contacts, and where each fit starts.

use std::f64::consts::TAU;

use nalgebra::DMatrix;

use super::discs::{DiscFit, DiscFitter, PARAMETERS};
use super::fit::{Fit, Fitter};
use super::network::FitSpot;
use super::radii::Radii;
use super::scan::{Candidate, Looks};
use super::target::Target;
use super::{ContactFinder, Explanation};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_physics::space::{self, Place};

/// Steps from each of some starts, how many of them go on, steps of those, and steps from the frame before.
const FIRST_STEPS: usize = 5;
const FINALISTS: usize = 2;
const COLD_STEPS: usize = 12;
const WARM_STEPS: usize = 4;
/// Steps after the readings were corrected, and how often they are at most: in corners, where spots are worst, five times do.
const CORRECTED_STEPS: usize = 3;
const CORRECTIONS: usize = 8;
/// Steps of discs from spots, and from the frame before.
const COLD_DISC_STEPS: usize = 12;
const WARM_DISC_STEPS: usize = 3;
/// Places that a fit starts from.
const STARTS: usize = 3;
/// By how much each parameter has to lower the sum of squares: the Bayesian information criterion for 256 readings asks for
/// 5.5; this leaves room for the many places that are looked at.
pub(in crate::solve) const WORTH: f64 = 7.0;
/// The same for there being any contact at all.
pub(super) const WORTH_FIRST: f64 = 60.0;
/// Starts around a single contact, and the cost over its, or over what noise makes, up to which a minimum there is looked at.
const BESIDE: usize = 8;
const OTHER: f64 = 5.0;
/// Half the distance of two contacts that one is split into, in mean distances of electrodes.
const SPLIT: f64 = 0.25;
/// Mean square of what is left below which a fit is nearly right.
const NEARLY: f64 = 100.0;
/// The same below which several contacts may only have to be wider.
const HOPEFUL: f64 = 20.0;
/// The same below which the search for more ends with the first one that does not pay.
const ENOUGH: f64 = 2.0;
/// The sum of squares may be this times that of the frame before.
pub(super) const WORSE: f64 = 1.3;
/// Standard errors that spots may move before the forward model is asked again.
const NEAR: f64 = 3.0;
/// A contact is lost when the logarithm of its resistance is known no better than this.
const WEAK: f64 = 0.2;

impl ContactFinder {
    /// Mean square of what one contact leaves of readings, in what noise and model error make; `None` if there is none.
    pub fn left_by_one(&self, readings: &Readings) -> Option<f64> {
        let target = Target::new(readings, &self.errors);
        let looks = self.scan.at_first(&self.network, &target);
        let first = self.scan.ones(&looks, STARTS, self.apart_m());
        Some(self.lowest_of(&looks, &first, &target)?.cost / target.count().max(1) as f64)
    }

    /// One contact corrected; or one beside it, which near edges and pads may be another minimum that is as deep until it is corrected.
    fn or_beside(&self, one: Fit, target: &Target) -> (Fit, Explanation) {
        let fitter = self.fitter();
        let from = &one.spots[0];
        let beside = (0..BESIDE).filter_map(|turn| {
            let (sin, cos) = (TAU * turn as f64 / BESIDE as f64).sin_cos();
            let way = space::along(scaled(cos, from.spot.along[0]), sin, from.spot.along[1]);
            let place_m = space::along(from.spot.place_m, self.apart_m(), way);
            let start = fitter.spot(self.fields.spot(place_m), from.ohm);
            fitter.fit(vec![start], target, FIRST_STEPS)
        });
        let is_another = |fit: &Fit| {
            space::distance(fit.spots[0].spot.place_m, from.spot.place_m) > 0.25 * self.apart_m()
                && fit.cost < OTHER * one.cost.max(target.count() as f64)
        };
        let mut others: Vec<_> = beside.filter(is_another).collect();
        others.sort_unstable_by(|a, b| a.cost.total_cmp(&b.cost));
        others.truncate(FINALISTS);
        let corrected = |fit: Fit| {
            let explanation = self.correct(fit.clone(), &self.usual(1), target, CORRECTIONS);
            (fit, explanation)
        };
        let first = corrected(one);
        let others = others.into_iter().map(corrected);
        others.fold(first, |best, other| if other.1.cost() < best.1.cost() { other } else { best })
    }

    /// The best fit from some candidates.
    fn lowest_of(&self, looks: &Looks<'_>, candidates: &[Candidate], target: &Target) -> Option<Fit> {
        let fitter = self.fitter();
        let starts = candidates.iter().map(|candidate| self.scan.start(&fitter, looks, candidate)).collect();
        lowest(&fitter, starts, target)
    }

    /// Whether there is any contact at all, as far as single ones tell.
    pub fn stands_out(&self, target: &Target) -> bool {
        let looks = self.scan.at_first(&self.network, target);
        self.scan.ones(&looks, 1, self.apart_m()).first().is_some_and(|best| best.gain >= WORTH_FIRST)
    }

    /// What explains a frame, from what explains it so far: one contact more if that is all it takes, else from
    /// nothing. Each better explanation on the way goes to `better`.
    pub(super) fn search(
        &self,
        from: Option<&Explanation>,
        target: &Target,
        better: &mut dyn FnMut(&Explanation),
    ) -> Option<Explanation> {
        let grown = from.and_then(|from| self.with_one_more(from, target));
        let found = grown.or_else(|| self.explanation(target, better));
        found.map(|found| self.with_radii(found, target))
    }

    /// The contacts of an explanation and one more, if these explain all.
    fn with_one_more(&self, from: &Explanation, target: &Target) -> Option<Explanation> {
        let Explanation::Spots(fit, ..) = from else { return None };
        let is_room = !fit.spots.is_empty() && fit.spots.len() < self.settings.most;
        let is_short = is_room && !explains(from, target);
        let more = is_short.then(|| self.one_more(&self.fitter(), std::slice::from_ref(fit), Vec::new(), target))??;
        (explains(&more, target) && !self.is_weak(&more)).then_some(more)
    }

    /// An explanation of some frames ago, brought to this one.
    pub(super) fn catch_up(&self, found: Explanation, target: &Target) -> Option<Explanation> {
        match found {
            Explanation::Spots(fit, correction_v, radii) => {
                let moved = self.fitter().fit(fit.spots, &target.less(&correction_v), COLD_STEPS)?;
                Some(self.correct(moved, &radii, target, CORRECTIONS))
            }
            Explanation::Discs(fit) => {
                self.disc_fitter().fit(fit.contacts, target, COLD_DISC_STEPS).map(Explanation::Discs)
            }
        }
    }

    /// The explanation without the contacts that may not be there, fitted again, if the readings ask for no more.
    pub(super) fn without_weak(&self, found: &Explanation, target: &Target) -> Option<Explanation> {
        let Explanation::Spots(fit, correction_v, radii) = found else { return None };
        let is_sure = |k: &usize| !is_uncertain(fit.covariance.as_ref(), 3 * k + 2);
        let sure: Vec<_> = (0..fit.spots.len()).filter(is_sure).collect();
        if sure.is_empty() {
            return None;
        }
        let spots = sure.iter().map(|k| fit.spots[*k].clone()).collect();
        let fewer = self.fitter().fit(spots, &target.less(correction_v), WARM_STEPS)?;
        let fewer = self.correct(fewer, &radii.of(&sure), target, 1);
        (score(&fewer) < score(found)).then_some(fewer)
    }

    /// The same contacts in the next frame; `None` if that makes no sense.
    pub(super) fn follow(&self, last: Explanation, target: &Target) -> Option<Explanation> {
        Some(match last {
            Explanation::Spots(fit, correction_v, radii) => {
                let moved = self.fitter().fit(fit.spots.clone(), &target.less(&correction_v), WARM_STEPS)?;
                if is_near(&fit.spots, &moved, self.settings.radius_m) {
                    Explanation::Spots(moved, correction_v, radii)
                } else {
                    self.correct(moved, &radii, target, 1)
                }
            }
            Explanation::Discs(fit) => {
                Explanation::Discs(self.disc_fitter().fit(fit.contacts, target, WARM_DISC_STEPS)?)
            }
        })
    }

    /// What explains a frame, from nothing.
    fn explanation(&self, target: &Target, found: &mut dyn FnMut(&Explanation)) -> Option<Explanation> {
        let fitter = self.fitter();
        let looks = self.scan.at_first(&self.network, target);
        let first = self.scan.ones(&looks, STARTS, self.apart_m());
        if first.first().is_none_or(|best| best.gain < WORTH_FIRST) {
            return None;
        }
        let one = self.lowest_of(&looks, &first, target)?;
        let (one, mut best) = self.or_beside(one, target);
        let mut fits = vec![one];
        let mut starts: Vec<Vec<FitSpot>> = match explains(&best, target) {
            true => Vec::new(),
            false => {
                let pairs = self.scan.pairs(&looks, STARTS, self.apart_m());
                pairs.iter().map(|pair| self.scan.start(&fitter, &looks, pair)).collect()
            }
        };
        while fits.len() < self.settings.most && !explains(&best, target) {
            found(&best);
            let Some(more) = self.one_more(&fitter, &fits, starts, target) else { break };
            let Explanation::Spots(fit, ..) = &more else { break };
            let fit = fit.clone();
            let is_hopeful = |fewer: &Fit| fits.len() == 1 || fewer.cost < HOPEFUL * target.count() as f64;
            if score(&more) < score(&best)
                && let Some(fewer) = fits.last().filter(|fewer| is_hopeful(fewer))
            {
                // Before one more is believed, those that there are may be wider.
                best = better(best, self.discs(fewer, target).map(Explanation::Discs));
            }
            fits.push(fit);
            let is_better = score(&more) < score(&best);
            if !is_better && fits.len() > 2 && best.cost() < ENOUGH * target.count() as f64 {
                break;
            }
            best = better(best, Some(more));
            starts = Vec::new();
        }
        Some(best)
    }

    /// One more contact than the last of some fits has: from starts, from that fit, and from two more than the fit before it has.
    fn one_more(
        &self,
        fitter: &Fitter<'_>,
        fits: &[Fit],
        mut starts: Vec<Vec<FitSpot>>,
        target: &Target,
    ) -> Option<Explanation> {
        let (last, before) = fits.split_last()?;
        // What spots leave out of a wrong fit is of no use.
        let is_near = last.cost < NEARLY * target.count() as f64;
        let correction_v = is_near.then(|| self.correction_v(last, &self.usual(last.spots.len()))).flatten();
        let corrected = correction_v.map_or_else(|| target.clone(), |correction_v| target.less(&correction_v));
        let mut add = |fit: &Fit, of: &dyn Fn(&Looks<'_>) -> Vec<Candidate>| {
            let looks = self.scan.beside(fitter, fit, &corrected);
            for candidate in of(&looks) {
                starts.push(fit.spots.iter().cloned().chain(self.scan.start(fitter, &looks, &candidate)).collect());
            }
        };
        add(last, &|looks| self.scan.ones(looks, STARTS, self.apart_m()));
        if let Some(before) = before.last() {
            add(before, &|looks| self.scan.pairs(looks, STARTS, self.apart_m()));
        }
        starts.extend((0..last.spots.len()).flat_map(|k| self.split(fitter, &last.spots, k)));
        let fit = lowest(fitter, starts, &corrected)?;
        let radii = self.usual(fit.spots.len());
        Some(self.correct(fit, &radii, target, CORRECTIONS))
    }

    /// Starts nearer to each other are one (m).
    fn apart_m(&self) -> f64 {
        self.spacing_m / 3.0
    }

    /// Starts with one contact taken for two beside each other, in some directions.
    fn split(&self, fitter: &Fitter<'_>, spots: &[FitSpot], k: usize) -> Vec<Vec<FitSpot>> {
        let half_m = SPLIT * self.spacing_m;
        let directions = [[1.0, 0.0], [0.0, 1.0], [0.7, 0.7], [0.7, -0.7]];
        let start = |[a, b]: [f64; 2]| {
            let spot = &spots[k];
            let way = space::along(scaled(a, spot.spot.along[0]), b, spot.spot.along[1]);
            let halves = [-half_m, half_m].map(|way_m| {
                let place_m = space::along(spot.spot.place_m, way_m, way);
                fitter.spot(self.fields.spot(place_m), 2.0 * spot.ohm)
            });
            let others = spots.iter().enumerate().filter(|(other, _)| *other != k).map(|(_, spot)| spot.clone());
            others.chain(halves).collect()
        };
        directions.map(start).into()
    }

    /// Repeats a fit with the forward model's readings, so many times or until they settle.
    pub(super) fn correct(&self, mut fit: Fit, radii: &Radii, target: &Target, times: usize) -> Explanation {
        let mut used_v = vec![0.0; fit.volts.len()];
        for _ in 0..times {
            let Some(correction_v) = self.correction_v(&fit, radii) else { break };
            let changed_v = correction_v.iter().zip(&used_v).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let corrected = target.less(&correction_v);
            let Some(next) = self.fitter().fit(fit.spots.clone(), &corrected, CORRECTED_STEPS) else { break };
            (fit, used_v) = (next, correction_v);
            if changed_v < 0.3 * self.errors.noise_v {
                break;
            }
        }
        Explanation::Spots(fit, used_v, radii.clone())
    }

    /// Readings of the forward model over those of the spots (V).
    fn correction_v(&self, fit: &Fit, radii: &Radii) -> Option<Vec<f64>> {
        let contact = |(k, spot)| self.contact(spot, radii.radius_m(k));
        let exact_v = self.exact_v(&fit.spots.iter().enumerate().map(contact).collect::<Vec<_>>())?;
        Some(exact_v.iter().zip(&fit.volts).map(|(exact, spots)| exact - spots).collect())
    }

    /// Radii as is usual.
    fn usual(&self, count: usize) -> Radii {
        Radii::usual(self.settings.radius_m, count)
    }

    /// Discs with radii of their own, from where spots are.
    fn discs(&self, fit: &Fit, target: &Target) -> Option<DiscFit> {
        let start = fit.spots.iter().map(|spot| {
            let contact = self.contact(spot, self.settings.radius_m);
            // A contact that is better than perfect is a wider one.
            let wider = (spot.spot.own_ohm / spot.ohm).max(1.0);
            let conductance_s = contact.conductance_s.min(10.0 * self.sheet_s);
            Contact { radius_m: wider * contact.radius_m, conductance_s, ..contact }
        });
        self.disc_fitter().fit(start.collect(), target, COLD_DISC_STEPS)
    }

    /// Whether a contact is so weak that it may not be there.
    pub(super) fn is_weak(&self, found: &Explanation) -> bool {
        match found {
            Explanation::Spots(fit, ..) => {
                (0..fit.spots.len()).any(|k| is_uncertain(fit.covariance.as_ref(), 3 * k + 2))
            }
            // That of a firm disc is not known well either: more of it would change little.
            Explanation::Discs(fit) => fit.contacts.iter().enumerate().any(|(k, contact)| {
                contact.conductance_s < self.sheet_s && is_uncertain(fit.covariance.as_ref(), PARAMETERS * k + 2)
            }),
        }
    }

    fn fitter(&self) -> Fitter<'_> {
        Fitter {
            network: &self.network,
            fields: &*self.fields,
            longest_m: self.spacing_m / 3.0,
            sheet_ohm: 1.0 / self.sheet_s,
        }
    }

    fn disc_fitter(&self) -> DiscFitter<'_> {
        let detector = self.problem.detector();
        DiscFitter {
            model: &*self.problem.model,
            usual_radius_m: self.settings.radius_m,
            sheet_s: self.sheet_s,
            fields: &*self.fields,
            widest_m: self.widest_m,
            detector,
        }
    }
}

/// The fit of lowest cost over some starts: a few steps from each, then more from the best.
fn lowest(fitter: &Fitter<'_>, starts: Vec<Vec<FitSpot>>, target: &Target) -> Option<Fit> {
    let mut fits: Vec<_> = starts.into_iter().filter_map(|start| fitter.fit(start, target, FIRST_STEPS)).collect();
    fits.sort_unstable_by(|a, b| a.cost.total_cmp(&b.cost));
    fits.truncate(FINALISTS);
    fits.into_iter()
        .filter_map(|fit| fitter.fit(fit.spots, target, COLD_STEPS))
        .min_by(|a, b| a.cost.total_cmp(&b.cost))
}

/// Sum of squares with a price on each parameter: what is lower is believed.
pub(super) fn score(found: &Explanation) -> f64 {
    found.cost() + WORTH * found.parameters() as f64
}

/// Which of two is believed.
fn better(best: Explanation, other: Option<Explanation>) -> Explanation {
    match other {
        Some(other) if score(&other) < score(&best) => other,
        _ => best,
    }
}

/// Whether a logarithm is hardly known; without a covariance, a contact does nothing that the readings show.
fn is_uncertain(covariance: Option<&DMatrix<f64>>, log: usize) -> bool {
    covariance.is_none_or(|all| all[(log, log)] > WEAK * WEAK)
}

fn scaled(share: f64, a: Place) -> Place {
    space::along([0.0; 3], share, a)
}

/// Whether no more than noise and model error is left.
fn explains(found: &Explanation, target: &Target) -> bool {
    found.cost() < 0.75 * target.count() as f64
}

/// Whether spots have moved so little that the forward model's correction still holds: it is some per cent of the readings, so it
/// changes by as much of what the spots have moved.
fn is_near(before: &[FitSpot], fit: &Fit, radius_m: f64) -> bool {
    let error = |parameter: usize| {
        fit.covariance.as_ref().map_or(0.0, |covariance| NEAR * covariance[(parameter, parameter)].max(0.0).sqrt())
    };
    before.iter().zip(&fit.spots).enumerate().all(|(k, (before, after))| {
        let moved_m = space::distance(before.spot.place_m, after.spot.place_m);
        let log = (before.ohm / after.ohm).ln().abs();
        moved_m < error(3 * k).hypot(error(3 * k + 1)).max(0.02 * radius_m) && log < error(3 * k + 2).max(0.005)
    })
}
