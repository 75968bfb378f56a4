//! Contacts as spots of a circuit, fitted to the readings: where fits of discs begin.
//!
//! A [spot](crate::solve::fit::spots) has a place and a resistance `A`, of the contact with the crowded current under it. With the currents `U` at the
//! spots for 1 A into each electrode, a change of the fields `F` at spot `k`, of those `N` to the others, and of its resistance changes
//!
//! ```text
//! dZ = -(w U_k' + U_k w') + dA U_k U_k',   w = dF_k - sum over l of dN_kl U_l
//! ```
//!
//! so that a step takes some ten microseconds, where one of discs takes hundreds. What spots leave out, the current's spread over the contacts, is
//! up to some per cent of the readings. Where discs are fitted already it is known for these, and added: the spots are right there, and wrong only
//! in how that changes on the way (output space mapping: Bandler et al., Space mapping: the state of the art, IEEE Trans. MTT 52, 2004). What one
//! more contact will gain they tell too little where a fit's radii and strengths make up for what it lacks, and hardly ever too much.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::ContactFinder;
use super::discs::DiscFit;
use super::scan::Fitted;
use crate::solve::fit::least_squares::{LeastSquares, NormalEquations, Schedule, minimise};
use crate::solve::fit::policy;
use crate::solve::fit::spots::{LoadedSpot, Solved};
use crate::solve::fit::target::Target;
use tactomo_physics::scene::Contact;
use tactomo_physics::space;

/// Parameters of a spot: its place along two directions in usual radii, and the logarithm of its resistance.
const PARAMETERS: usize = 3;
/// Way over which derivatives by the place are taken, in usual radii.
const DIFFERENCE: f64 = 0.01;
/// Longest way in a step, in usual radii, and longest change of the logarithm of a resistance.
const LONGEST_WAY: f64 = 2.0;
const LONGEST_LOG: f64 = 1.0;
/// Smallest resistance, in that of the crowded current under a contact of the usual radius.
const LEAST_OHM: f64 = 0.2;
/// Steps at most, and the share of what noise does not explain that a step has to gain: spots are some per cent off.
const STEPS: usize = 10;
const LEAST_SHARE: f64 = 0.02;
/// Starts of one more spot, and the share of what is left that it may leave at most.
const STARTS: usize = 3;
const WORTH: f64 = 0.6;
const SCHEDULE: Schedule = Schedule { first: 1e-3, least: 1e-6, tries: 4 };

/// Where discs may begin.
pub(super) struct Start {
    pub contacts: Vec<Contact>,
    /// Sum of squares that spots leave.
    pub cost: f64,
    spots: Vec<LoadedSpot>,
}

/// What spots are fitted to.
pub(super) struct SpotFitter<'a> {
    finder: &'a ContactFinder,
    target: &'a Target,
    /// What discs that were fitted read beyond their spots (V); none without a fit.
    beyond_v: Vec<f64>,
}

/// Spots with what they leave.
pub(super) struct Look {
    spots: Vec<LoadedSpot>,
    solved: Solved,
    /// Readings that they predict, with what discs read beyond spots (V).
    volts: Vec<f64>,
    residuals: DVector<f64>,
}

impl<'a> SpotFitter<'a> {
    /// Fits to a target, near a fit of discs if there is one.
    pub fn new(finder: &'a ContactFinder, near: Option<&DiscFit>, target: &'a Target) -> Self {
        let mut fitter = Self { finder, target, beyond_v: Vec::new() };
        if let Some(near) = near {
            let spots: Vec<_> = near.contacts.iter().map(|contact| finder.spot_of(contact)).collect();
            let solved = finder.spot_model.solve(&spots, &*finder.fields);
            let of_spots_v = solved.map(|solved| fitter.volts(&solved)).unwrap_or_default();
            fitter.beyond_v = near.volts.iter().zip(of_spots_v).map(|(discs, spots)| discs - spots).collect();
        }
        fitter
    }

    /// Contacts moved to where their spots fit best; `None` where spots make no sense.
    pub fn start(&mut self, contacts: &[Contact]) -> Option<Start> {
        let begun: Vec<_> = contacts.iter().map(|contact| self.finder.spot_of(contact)).collect();
        let look = self.look(begun.clone())?;
        let found = minimise(self, look, STEPS, SCHEDULE).at;
        let contacts = self.contacts_of(contacts, &begun, &found.spots);
        Some(Start { contacts, cost: found.residuals.norm_squared(), spots: found.spots })
    }

    /// Logarithm of what the last contact's parameters are worth in the evidence, by what spots tell of them: that of the share of places and
    /// conductances that would do as well. `None` where they are not determined.
    pub fn ln_of_last(&self, start: &Start) -> Option<f64> {
        let at = self.look(start.spots.clone())?;
        let slopes = self.slopes(&at);
        let mut normal = slopes.tr_mul(&slopes);
        let (finder, last) = (self.finder, at.spots.last()?);
        let unit_m = finder.settings.radius_m;
        for i in 0..normal.nrows() {
            let of_place = unit_m * unit_m / finder.prior.place_variance_m2();
            let of_log = policy::CONDUCTANCE_DEVIATION.powi(-2);
            normal[(i, i)] += if i % PARAMETERS < 2 { of_place } else { of_log };
        }
        // The last pivots are those of the last contact's parameters, whatever the others' are.
        let factor = Cholesky::new(normal)?.unpack();
        let pivots = (factor.nrows() - PARAMETERS..factor.nrows()).map(|i| factor[(i, i)].ln());
        let contact_ohm = (last.ohm - last.spot.own_ohm).max(LEAST_OHM * last.spot.own_ohm);
        Some(finder.prior.ln_of_one_more(at.spots.len(), unit_m, last.ohm / contact_ohm) - pivots.sum::<f64>())
    }

    /// More contacts beside those that are fitted, one at a time, as long as each explains much of what is left; `None` if there are none.
    pub fn crowd(&mut self, contacts: &[Contact]) -> Option<Vec<Contact>> {
        let finder = self.finder;
        let begun: Vec<_> = contacts.iter().map(|contact| finder.spot_of(contact)).collect();
        let mut last = self.look(begun.clone())?;
        let enough = policy::WRONG_MEAN_SQUARE * self.target.count() as f64;
        while last.spots.len() < finder.settings.most && self.sum(&last) > enough {
            let looks: Vec<_> = self.one_more(&last).into_iter().filter_map(|start| self.look(start)).collect();
            let fits: Vec<_> = looks.into_iter().map(|look| minimise(self, look, STEPS, SCHEDULE).at).collect();
            let best = fits.into_iter().min_by(|a, b| self.sum(a).total_cmp(&self.sum(b)));
            let is_worth_it = |best: &Look| self.sum(best) < WORTH * self.sum(&last) && self.is_apart(best);
            let Some(best) = best.filter(is_worth_it) else { break };
            last = best;
        }
        (last.spots.len() > contacts.len()).then(|| self.contacts_of(contacts, &begun, &last.spots))
    }

    /// Whether the last spot is no part of a wide contact, which discs have to tell.
    fn is_apart(&self, look: &Look) -> bool {
        let Some((last, others)) = look.spots.split_last() else { return true };
        let near_m = policy::PLAUSIBLE_RADII * self.finder.settings.radius_m;
        others.iter().all(|other| space::distance(last.spot.place_m, other.spot.place_m) > near_m)
    }

    /// Spots with one more, where it would explain most.
    fn one_more(&self, at: &Look) -> Vec<Vec<LoadedSpot>> {
        let finder = self.finder;
        let slopes = self.slopes(at);
        let mut normal = slopes.tr_mul(&slopes);
        (0..normal.nrows()).for_each(|i| normal[(i, i)] *= 1.0 + SCHEDULE.first);
        let fitted = Fitted { spots: &at.spots, slopes, normal: &normal, left: at.residuals.clone() };
        let target = self.target.at(&at.volts);
        let Some(looks) = finder.scan.beside(&finder.spot_model, &*finder.fields, &fitted, &target) else {
            return Vec::new();
        };
        let ones = finder.scan.ones(&looks, STARTS, finder.apart_m());
        let with = |one| at.spots.iter().cloned().chain(finder.scan.start(&looks, one)).collect();
        ones.iter().map(with).collect()
    }

    /// Contacts whose spots have moved, and those of further spots.
    fn contacts_of(&self, contacts: &[Contact], from: &[LoadedSpot], to: &[LoadedSpot]) -> Vec<Contact> {
        let moved = |((contact, from), to): ((&Contact, &LoadedSpot), &LoadedSpot)| {
            let [x_m, y_m, z_m] = to.spot.place_m;
            let ohm = 1.0 / contact.conductance_s + from.spot.share * (to.ohm - from.ohm);
            let conductance_s = 1.0 / ohm.max(f64::MIN_POSITIVE);
            self.finder.disc_fitter().held(Contact { x_m, y_m, z_m, conductance_s, ..*contact })
        };
        let (kept, further) = to.split_at(contacts.len());
        let moved = contacts.iter().zip(from).zip(kept).map(moved);
        moved.chain(self.finder.discs_of(further)).collect()
    }

    fn look(&self, spots: Vec<LoadedSpot>) -> Option<Look> {
        let solved = self.finder.spot_model.solve(&spots, &*self.finder.fields)?;
        let mut volts = self.volts(&solved);
        volts.iter_mut().zip(&self.beyond_v).for_each(|(volts, beyond)| *volts += beyond);
        let residuals = DVector::from_vec(self.target.residuals(&volts));
        residuals.iter().all(|left| left.is_finite()).then_some(Look { spots, solved, volts, residuals })
    }

    /// Readings of the spots (V).
    fn volts(&self, solved: &Solved) -> Vec<f64> {
        let (n, drive_v) = (self.finder.spot_model.electrodes(), self.finder.spot_model.drive_v);
        let volts = |(i, ohm): (usize, &f64)| drive_v * (1.0 - ohm / solved.loads_ohm[i / n]);
        solved.impedance_ohm.iter().enumerate().map(volts).collect()
    }

    /// Derivatives of the readings by all parameters, whitened.
    fn slopes(&self, at: &Look) -> DMatrix<f64> {
        let n = self.finder.spot_model.electrodes();
        let mut all = DMatrix::zeros(n * n, PARAMETERS * at.spots.len());
        for k in 0..at.spots.len() {
            let current = &at.solved.currents[k * n..(k + 1) * n];
            for direction in 0..2 {
                let by_place = self.field_change(at, k, direction);
                let mut column = all.column_mut(PARAMETERS * k + direction);
                let change = |e: usize, g: usize| -(by_place[e] * current[g] + current[e] * by_place[g]);
                self.readings_change(&at.solved, change, column.as_mut_slice());
            }
            let mut column = all.column_mut(PARAMETERS * k + 2);
            self.readings_change(&at.solved, |e, g| at.spots[k].ohm * current[e] * current[g], column.as_mut_slice());
        }
        self.target.at(&at.volts).whiten_columns(&mut all);
        all
    }

    /// By how much the fields at a spot, `w`, change along a direction of its place (ohm in a usual radius).
    fn field_change(&self, at: &Look, k: usize, direction: usize) -> Vec<f64> {
        let fields = &*self.finder.fields;
        let n = self.finder.spot_model.electrodes();
        let from = &at.spots[k].spot;
        let (_, along) = fields.footing(from.place_m);
        let moved =
            |way: f64| fields.spot(space::along(from.place_m, way * self.finder.settings.radius_m, along[direction]));
        let forwards = moved(DIFFERENCE);
        // Backwards if the edge is in the way.
        let (to, way) = match space::distance(forwards.place_m, from.place_m) > 0.0 {
            true => (forwards, DIFFERENCE),
            false => (moved(-DIFFERENCE), -DIFFERENCE),
        };
        let fields_ohm = to.electrodes_ohm.iter().zip(&from.electrodes_ohm);
        let mut change: Vec<_> = fields_ohm.map(|(to, from)| (to - from) / way).collect();
        for (l, other) in at.spots.iter().enumerate().filter(|(l, _)| *l != k) {
            let between = (fields.between_ohm(&to, &other.spot) - fields.between_ohm(from, &other.spot)) / way;
            let current = &at.solved.currents[l * n..(l + 1) * n];
            change.iter_mut().zip(current).for_each(|(change, current)| *change -= between * current);
        }
        change
    }

    /// What a change of the impedances does to the readings (V).
    fn readings_change(&self, solved: &Solved, change_ohm: impl Fn(usize, usize) -> f64, volts: &mut [f64]) {
        let (n, drive_v) = (self.finder.spot_model.electrodes(), self.finder.spot_model.drive_v);
        for (g, row) in volts.chunks_exact_mut(n).enumerate() {
            let (load_ohm, own) = (solved.loads_ohm[g], change_ohm(g, g));
            let impedance_ohm = &solved.impedance_ohm[g * n..(g + 1) * n];
            for (e, (volts, ohm)) in row.iter_mut().zip(impedance_ohm).enumerate() {
                *volts = -drive_v / load_ohm * (change_ohm(e, g) - ohm / load_ohm * own);
            }
        }
    }
}

impl LeastSquares for SpotFitter<'_> {
    type Point = Look;

    fn sum(&self, at: &Look) -> f64 {
        at.residuals.norm_squared()
    }

    fn equations(&self, at: &Look) -> NormalEquations {
        NormalEquations::of(&self.slopes(at), &at.residuals)
    }

    fn moved(&mut self, from: &Look, step: &DVector<f64>) -> Option<Look> {
        let fields = &*self.finder.fields;
        let (steps, _) = step.as_slice().as_chunks::<PARAMETERS>();
        let moved = |(loaded, [first, second, log]): (&LoadedSpot, &[f64; PARAMETERS])| {
            let (from_m, along) = fields.footing(loaded.spot.place_m);
            let unit_m = (LONGEST_WAY / first.hypot(*second)).min(1.0) * self.finder.settings.radius_m;
            let spot = fields.spot(space::moved(from_m, [unit_m * first, unit_m * second], along));
            let most_ohm = 1.0 / (policy::CONDUCTANCES_SHEETS[0] * self.finder.sheet_s);
            let ohm = loaded.ohm * log.clamp(-LONGEST_LOG, LONGEST_LOG).exp();
            LoadedSpot { ohm: ohm.clamp(LEAST_OHM * spot.own_ohm, most_ohm), spot }
        };
        self.look(from.spots.iter().zip(steps).map(moved).collect())
    }

    fn goes_on(&self, before: &Look, after: &Look, _equations: &NormalEquations) -> bool {
        let (before, after) = (self.sum(before), self.sum(after));
        before - after > (LEAST_SHARE * (after - self.target.count() as f64)).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::search::COLD;
    use super::super::tests::{contact, frame, solver};
    use super::*;
    use crate::solve::before::adaptive_mean::Mean;
    use tactomo_physics::simulate::Noise;

    fn target(finder: &ContactFinder, contacts: &[Contact]) -> Target {
        finder.target_of(&Mean::of_frame(&frame(contacts, &mut Noise::new(5))), None).unwrap()
    }

    #[test]
    fn slopes_are_the_readings_differences() {
        let solver = solver();
        let finder = solver.finder();
        // One of them at the wall, where a step backwards is taken.
        let contacts = [contact(0.004, -0.011, 0.3), contact(0.03, 0.012, 1.0), contact(-0.015, 0.008, 3.0)];
        let target = target(finder, &contacts);
        let mut fitter = SpotFitter::new(finder, None, &target);
        let at = fitter.look(contacts.iter().map(|contact| finder.spot_of(contact)).collect()).unwrap();
        let slopes = fitter.slopes(&at);
        for parameter in 0..slopes.ncols() {
            let mut step = DVector::zeros(slopes.ncols());
            // Away from the wall.
            step[parameter] = if parameter == PARAMETERS { -0.02 } else { 0.02 };
            let stepped = LeastSquares::moved(&mut fitter, &at, &step).unwrap();
            // Residuals fall by what readings rise.
            let change = (&at.residuals - &stepped.residuals) / step[parameter];
            let off = (&change - slopes.column(parameter)).norm() / slopes.column(parameter).norm();
            assert!(off < 0.03, "parameter {parameter}: {off}");
        }
    }

    #[test]
    fn spots_lead_discs_to_contacts_from_afar() {
        let solver = solver();
        let finder = solver.finder();
        let truth = [contact(-0.012, 0.006, 0.2), contact(0.014, -0.009, 1.0)];
        let target = target(finder, &truth);
        let away = [contact(-0.008, 0.004, 0.6), contact(0.018, -0.013, 0.4)];
        let start = SpotFitter::new(finder, None, &target).start(&away).unwrap();
        for (contact, start) in truth.iter().zip(&start.contacts) {
            let off_m = (contact.x_m - start.x_m).hypot(contact.y_m - start.y_m);
            assert!(off_m < 1e-3, "{off_m}");
        }
    }

    #[test]
    fn near_a_fit_spots_promise_no_more_than_one_more_disc_gains() {
        let solver = solver();
        let finder = solver.finder();
        for sheets in [0.004, 0.005, 0.006] {
            let truth = [contact(-0.012, 0.006, 0.05), contact(0.014, -0.009, 0.1), contact(0.008, 0.017, sheets)];
            let target = target(finder, &truth);
            let fitter = finder.plausible_fitter();
            let two = fitter.fit(truth[..2].to_vec(), &target, COLD).unwrap();
            let mut spots = SpotFitter::new(finder, Some(&two), &target);
            let start = spots.start(&[&two.contacts[..], &[contact(0.005, 0.019, sheets)]].concat()).unwrap();
            let worth = spots.ln_of_last(&start).unwrap();
            let three = fitter.fit(start.contacts, &target, COLD).unwrap();
            let [told, gained] = [start.cost, three.cost].map(|cost| two.cost - cost);
            assert!(told > 0.15 * gained && told < 1.15 * gained, "{told} {gained}");
            let of_last = finder.evidence(&three) - finder.evidence(&two) - 0.5 * gained;
            assert!((worth - of_last).abs() < 5.0, "{worth} {of_last}");
        }
    }
}
