//! Where fits of discs begin, and which of these starts are worth it.

use std::f64::consts::TAU;

use super::ContactFinder;
use super::discs::{DiscFit, DiscFitter, place_m};
use super::search::{COLD, FINALISTS, FIRST, ROUGH};
use super::spot_fit::{SpotFitter, Start};
use crate::solve::fit::policy;
use crate::solve::fit::spots::LoadedSpot;
use crate::solve::fit::target::Target;
use tactomo_physics::scene::Contact;
use tactomo_physics::space::{self, Place};

/// Starts around a single contact.
const BESIDE: usize = 8;
/// Directions along which a contact that may be two is split.
const DIRECTIONS: [[f64; 2]; 4] = [[1.0, 0.0], [0.0, 1.0], [0.7, 0.7], [0.7, -0.7]];
/// Resistance of a contact that is nearly perfect, as a share of that of the crowded current under it.
const PERFECT: f64 = 0.2;
/// Places that are so near, in usual radii, are one.
const ALIKE: f64 = 0.3;

impl ContactFinder {
    /// The widest contact, if it is so wide that it may be two.
    pub(super) fn may_be_two(&self, fit: &DiscFit) -> Option<usize> {
        let radius_m = |k: usize| fit.contacts[k].radius_m;
        let widest = (0..fit.contacts.len()).max_by(|a, b| radius_m(*a).total_cmp(&radius_m(*b)));
        widest.filter(|k| radius_m(*k) > policy::TWO_RADII * self.settings.radius_m)
    }

    /// Starts with a wide contact taken for two beside each other, in some directions.
    pub(super) fn splits(&self, fit: &DiscFit) -> Vec<Vec<Contact>> {
        let Some(k) = self.may_be_two(fit) else { return Vec::new() };
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

    /// Starts around a contact: near edges and pads there may be another minimum that is nearly as deep.
    pub(super) fn beside(&self, one: &Contact, along: [Place; 2]) -> Vec<Vec<Contact>> {
        let start = |turn: usize| {
            let (sin, cos) = (TAU * turn as f64 / BESIDE as f64).sin_cos();
            let away_m = self.apart_m();
            let to_m = space::moved(place_m(one), [away_m * cos, away_m * sin], along);
            let [x_m, y_m, z_m] = self.fields.footing(to_m).0;
            vec![Contact { x_m, y_m, z_m, radius_m: self.settings.radius_m, ..*one }]
        };
        (0..BESIDE).map(start).collect()
    }

    /// One contact for two.
    pub(super) fn merged(&self, a: &Contact, b: &Contact) -> Contact {
        let conductance_s = a.conductance_s + b.conductance_s;
        let share = b.conductance_s / conductance_s;
        let between = |a: f64, b: f64| a + share * (b - a);
        let place_m = [between(a.x_m, b.x_m), between(a.y_m, b.y_m), between(a.z_m, b.z_m)];
        let [x_m, y_m, z_m] = self.fields.footing(place_m).0;
        Contact { x_m, y_m, z_m, conductance_s, radius_m: a.radius_m.hypot(b.radius_m) }
    }

    /// Where fits of discs begin, the most promising first: some starts, brought to where their spots fit best.
    pub(super) fn begun_by(&self, spots: &mut SpotFitter<'_>, starts: &[Vec<Contact>]) -> Vec<Start> {
        let mut begun: Vec<_> = starts.iter().filter_map(|start| spots.start(start)).collect();
        begun.sort_unstable_by(|a, b| a.cost.total_cmp(&b.cost));
        // Starts often lead to one minimum.
        begun.dedup_by(|later, first| self.is_alike(&first.contacts, &later.contacts));
        begun
    }

    /// The best single disc from some starts: a few steps from each and more from the best with the rough model, which tells how wide it is as spots
    /// do not; last with the full one.
    pub(super) fn best_alone(&self, starts: Vec<Vec<Contact>>, target: &Target) -> Option<DiscFit> {
        let full = self.plausible_fitter();
        let rough = DiscFitter { model: &*self.rough, ..full };
        let objective = |fit: &DiscFit| fit.cost + fit.known;
        let by_objective = |a: &DiscFit, b: &DiscFit| objective(a).total_cmp(&objective(b));
        let mut fits = Vec::with_capacity(starts.len());
        for fit in starts.into_iter().filter_map(|start| rough.fit(start, target, FIRST)) {
            let explains = fit.cost < policy::WRONG_MEAN_SQUARE * target.count() as f64;
            fits.push(fit);
            if explains {
                break;
            }
        }
        fits.sort_unstable_by(by_objective);
        // Starts often lead to one minimum.
        fits.dedup_by(|later, first| self.is_alike(&first.contacts, &later.contacts));
        fits.truncate(FINALISTS);
        let fits = fits.into_iter().filter_map(|fit| rough.go_on(&fit, target, ROUGH));
        full.fit(fits.min_by(by_objective)?.contacts, target, COLD)
    }

    /// The best fit from some starts.
    pub(super) fn best_of(&self, begun: Vec<Start>, target: &Target) -> Option<DiscFit> {
        let fitter = self.plausible_fitter();
        let objective = |fit: &DiscFit| fit.cost + fit.known;
        let fits = begun.into_iter().filter_map(|start| fitter.fit(start.contacts, target, COLD));
        fits.min_by(|a, b| objective(a).total_cmp(&objective(b)))
    }

    /// The fit from the start whose spots fit best, near a fit, if that `is_worth_it`.
    pub(super) fn best_near(
        &self,
        fit: &DiscFit,
        starts: &[Vec<Contact>],
        is_worth_it: impl Fn(&Start) -> bool,
        target: &Target,
    ) -> Option<DiscFit> {
        let mut begun = self.begun_by(&mut SpotFitter::new(self, Some(fit), target), starts);
        begun.truncate(1);
        begun.retain(is_worth_it);
        self.best_of(begun, target)
    }

    /// Whether discs that begin there may be as likely as a fit that is near, of as many contacts or one more.
    pub(super) fn may_be_as_good(&self, start: &Start, near: &DiscFit) -> bool {
        start.cost < near.cost + policy::LOST_SQUARES
    }

    /// Whether each of some contacts is where one of the others is.
    pub(super) fn is_alike(&self, a: &[Contact], b: &[Contact]) -> bool {
        let near_m = ALIKE * self.settings.radius_m;
        let near = |a: &Contact, b: &Contact| space::distance(place_m(a), place_m(b)) < near_m;
        a.iter().all(|a| b.iter().any(|b| near(a, b)))
    }

    /// Starts nearer to each other are one (m).
    pub(super) fn apart_m(&self) -> f64 {
        self.spacing_m / 3.0
    }

    /// Discs of the usual radius where spots are.
    pub(super) fn discs_of(&self, spots: &[LoadedSpot]) -> Vec<Contact> {
        let disc = |spot: &LoadedSpot| {
            let [x_m, y_m, z_m] = spot.spot.place_m;
            // What is better than its own spreading allows is nearly perfect.
            let ohm = (spot.ohm - spot.spot.own_ohm).max(PERFECT * spot.spot.own_ohm);
            let contact = Contact::flat(x_m, y_m, self.settings.radius_m, 1.0 / (ohm * spot.spot.share));
            self.disc_fitter().held(Contact { z_m, ..contact })
        };
        spots.iter().map(disc).collect()
    }

    /// The spot that a disc acts as from afar: a wider one meets less of its own spreading resistance.
    pub(super) fn spot_of(&self, contact: &Contact) -> LoadedSpot {
        let spot = self.fields.spot(place_m(contact));
        let own_ohm = spot.own_ohm * self.settings.radius_m / contact.radius_m;
        LoadedSpot { ohm: own_ohm + 1.0 / (spot.share * contact.conductance_s), spot }
    }
}
