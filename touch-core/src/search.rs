//! The search for what explains a frame.

use crate::beside::beside;
use crate::circuit::MAX_CONTACTS;
use crate::fit::{Fit, Scene, Working};
use crate::normal::{ANY_RADIUS, PARAMETERS, USUAL_RADIUS};
use crate::scan::{CANDIDATES, Candidates, first};
use crate::solver::{PATIENCE, Solver, Task};

/// Price of a parameter (squared deviations): that of the host's search.
const PARAMETER_PRICE: f32 = 7.0;
/// Parameters of a contact that have to be paid: a radius that the readings do not tell says nothing.
const PAID: f32 = 3.0;
/// Gain in the sum of squares, in the linear theory, for there being any contact at all, the host's; also for there being more than were found. Of 120 random
/// scenes of three discs on `square-60` 62 are explained by three contacts: with 60 it is said of 3 that there are more, with 30 of 10. Of 201 scenes in
/// which `auto` finds four or five it is said of 176 and of 188.
pub(crate) const FIRST_GAIN: f32 = 60.0;
/// Standard deviations of the sum of squares beyond which readings do not fit: the host's.
const MISFIT_DEVIATIONS: f32 = 5.0;
/// What the readings say for a contact whose strength they tell to 3 %: that one is there (squared deviations, one over the square of that).
const SURE: f32 = 1000.0;
/// Steps at most where a start is tried, and where the best of them is searched.
const TRYING: usize = 8;
const SEARCHING: usize = 20;

impl Solver {
    /// What explains a frame best, from what was followed, or from where one contact would explain most of it alone, if that is known; notes how well.
    pub(crate) fn search(
        &mut self,
        from: Option<Fit>,
        alone: Option<Candidates>,
        task: Task<'_>,
        work: &mut Working<'_>,
    ) -> Option<Fit> {
        let found = self.explanation(from, alone, task, work).and_then(|fit| self.pruned(fit, task, work));
        let found = found.map(|fit| {
            let fit = self.completed(fit, task, work);
            let fit = self.exchanged(fit, task, work);
            self.reduced(fit, task, work)
        });
        self.more &= found.is_some();
        self.searched = found.map_or(0.0, |fit| fit.normal.cost);
        let fits = found.is_none_or(|fit| !is_misfit(&fit, task.readings()));
        self.patience = if fits { PATIENCE[0] } else { (2 * self.patience).min(PATIENCE[1]) };
        self.wait = if fits { 0 } else { self.patience };
        found
    }

    /// The best explanation that is found step by step.
    fn explanation(
        &mut self,
        from: Option<Fit>,
        alone: Option<Candidates>,
        task: Task<'_>,
        work: &mut Working<'_>,
    ) -> Option<Fit> {
        let best = from.and_then(|from| self.grown(from, task, work));
        // What there was more than is no place to go on from.
        if !self.more && best.is_some_and(|best| !is_misfit(&best, task.readings())) {
            return best;
        }
        let alone = alone.unwrap_or_else(|| first(task, work));
        if alone[0].gain < FIRST_GAIN {
            return best;
        }
        let starts = alone.map(|candidate| (candidate.gain > 0.0).then(|| Scene::default().with(candidate.spot)));
        let one = self.best_of(&starts, USUAL_RADIUS, task, work);
        better(best, one.and_then(|one| self.grown(one, task, work)))
    }

    /// The best fit from some starts.
    fn best_of(
        &mut self,
        starts: &[Option<Scene>; CANDIDATES],
        radius_deviation: f32,
        task: Task<'_>,
        work: &mut Working<'_>,
    ) -> Option<Fit> {
        let mut best = None;
        for start in starts.iter().flatten() {
            best = better(best, self.fit(*start, radius_deviation, TRYING, task, work));
            if best.is_some_and(|best: Fit| !is_misfit(&best, task.readings())) {
                break;
            }
        }
        self.fit(best?.scene, radius_deviation, SEARCHING, task, work)
    }

    /// The likeliest number of contacts from some that are found on, one more at a time.
    fn grown(&mut self, from: Fit, task: Task<'_>, work: &mut Working<'_>) -> Option<Fit> {
        let (mut at, mut best) = (from, None);
        loop {
            best = better(best, self.fit(at.scene, ANY_RADIUS, SEARCHING, task, work));
            if at.scene.count == MAX_CONTACTS {
                return best;
            }
            let candidates = self.beside(&at, task, work);
            if candidates[0].gain <= PAID * PARAMETER_PRICE {
                // With any radii they leave still less.
                return best.map(|best| Fit { is_alone: best.scene.count == at.scene.count, ..best });
            }
            let starts = candidates.map(|one| (one.gain > PAID * PARAMETER_PRICE).then(|| at.scene.with(one.spot)));
            let Some(more) = self.best_of(&starts, USUAL_RADIUS, task, work) else { return best };
            at = more;
        }
    }

    /// Contacts with those that are looked for beside them as long as one would explain much of what they leave; notes whether another one would.
    fn completed(&mut self, mut best: Fit, task: Task<'_>, work: &mut Working<'_>) -> Fit {
        loop {
            let candidates = if best.is_alone { Candidates::default() } else { self.beside(&best, task, work) };
            self.more = candidates[0].gain > FIRST_GAIN;
            if !self.more || best.scene.count == MAX_CONTACTS {
                return best;
            }
            let starts = candidates.map(|one| (one.gain > FIRST_GAIN).then(|| best.scene.with(one.spot)));
            let new = self.best_of(&starts, ANY_RADIUS, task, work);
            match new.filter(|new| score(new) < score(&best)) {
                Some(new) => best = new,
                None => return best,
            }
        }
    }

    /// Contacts that leave too much, with each in turn looked for anew beside the others: one that went astray early is held there by those that came after it.
    /// As often as there are contacts at most; and where there are more than can be told, it is not for the search that they leave too much.
    fn exchanged(&mut self, mut best: Fit, task: Task<'_>, work: &mut Working<'_>) -> Fit {
        let (mut k, mut tried) = (0, 0);
        while tried < best.scene.count && self.is_to_be_mended(&best, task) {
            k %= best.scene.count;
            tried += 1;
            let before = self.more;
            let rest = self.fit(best.scene.without(k), USUAL_RADIUS, SEARCHING, task, work);
            let new = rest.and_then(|rest| self.grown(rest, task, work)).and_then(|new| self.pruned(new, task, work));
            let new = new.map(|new| self.completed(new, task, work));
            match new.filter(|new| score(new) < score(&best) - PARAMETER_PRICE) {
                Some(new) => best = new,
                None => (k, self.more) = (k + 1, before),
            }
        }
        best
    }

    fn is_to_be_mended(&self, fit: &Fit, task: Task<'_>) -> bool {
        let is_beyond = self.more && fit.scene.count == MAX_CONTACTS;
        !is_beyond && (self.more || is_misfit(fit, task.readings()))
    }

    /// Contacts without those that the others do as well without, once they are fitted anew: a second one that was found while the first was too small.
    fn reduced(&mut self, mut best: Fit, task: Task<'_>, work: &mut Working<'_>) -> Fit {
        while best.scene.count > 1 {
            let mut fewer = None;
            let all = information(&best);
            for k in (0..best.scene.count).filter(|k| all[*k] < SURE) {
                fewer = better(fewer, self.fit(best.scene.without(k), ANY_RADIUS, SEARCHING, task, work));
            }
            match fewer.filter(|fewer| score(fewer) < score(&best)) {
                Some(fewer) => best = fewer,
                None => return best,
            }
        }
        best
    }

    /// A fit without the contacts that the readings do not speak for; `None` if none is left.
    pub(crate) fn pruned(&mut self, mut fit: Fit, task: Task<'_>, work: &mut Working<'_>) -> Option<Fit> {
        while let Some(gone) = weakest(&fit) {
            fit = self.fit(fit.scene.without(gone), ANY_RADIUS, SEARCHING, task, work)?;
        }
        Some(fit)
    }

    /// Where one more contact would explain most of what others leave.
    fn beside(&mut self, fit: &Fit, task: Task<'_>, work: &mut Working<'_>) -> Candidates {
        match self.circuit.solve(task.table, fit.scene.spots()) {
            true => beside(task, &self.circuit, &fit.normal, work),
            false => Candidates::default(),
        }
    }
}

pub(crate) fn freedom(fit: &Fit) -> f32 {
    PAID * fit.scene.count as f32
}

/// Sum of squares of so many normal numbers beyond which they are not those of noise.
pub(crate) fn limit(freedom: f32) -> f32 {
    let freedom = freedom.max(1.0);
    freedom + MISFIT_DEVIATIONS * libm::sqrtf(2.0 * freedom)
}

pub(crate) fn is_misfit(fit: &Fit, readings: f32) -> bool {
    fit.normal.cost > limit(readings - freedom(fit))
}

/// The sum of squares with the price of contacts: of two explanations the lower one is believed.
fn score(fit: &Fit) -> f32 {
    fit.normal.objective() + PARAMETER_PRICE * PAID * fit.scene.count as f32
}

fn better(a: Option<Fit>, b: Option<Fit>) -> Option<Fit> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if score(&b) < score(&a) { b } else { a }),
        (a, b) => a.or(b),
    }
}

/// The contact that the readings speak least for, if that is less than its price.
fn weakest(fit: &Fit) -> Option<usize> {
    let all = information(fit);
    let least = (0..fit.scene.count).min_by(|a, b| all[*a].total_cmp(&all[*b]))?;
    (all[least] < PAID * PARAMETER_PRICE).then_some(least)
}

/// What the readings say for each contact (squared deviations): of a light one, whose readings are in proportion to its conductance, the square of them is that
/// of the derivative by its logarithm, or what others leave of that.
fn information(fit: &Fit) -> [f32; MAX_CONTACTS] {
    let covariance = fit.normal.covariance();
    core::array::from_fn(|k| {
        let strength = PARAMETERS * k + 2;
        let left = covariance.as_ref().map_or(f32::INFINITY, |all| 1.0 / all[strength][strength]);
        fit.normal.matrix[strength][strength].min(left)
    })
}
