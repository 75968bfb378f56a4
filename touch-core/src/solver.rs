//! Contacts from frame to frame.
//!
//! What was found last is fitted again. Where that no longer explains a frame, more contacts are looked for beside it, and without it. One more
//! is believed if it lowers the sum of squares by more than its parameters' price.

use crate::answer::{Answer, Contact, Flags};
use crate::circuit::{Circuit, MAX_CONTACTS};
use crate::fit::{Fit, Fitter, Scene, Work, Working};
use crate::frame::{Errors, Frame, FrameError, Says};
use crate::normal::{ANY_RADIUS, MOST, PARAMETERS, USUAL_RADIUS, Vector};
use crate::scan::{Beside, CANDIDATES, Candidates, first};
use crate::table::Table;

/// Price of a parameter (squared deviations): that of the host's search.
const PARAMETER_PRICE: f32 = 7.0;
/// Parameters of a contact that have to be paid: a radius that the readings do not tell says nothing.
const PAID: f32 = 3.0;
/// Gain in the sum of squares, in the linear theory, for there being any contact at all, the host's; also for there being more than were found. Of 120 random
/// scenes of three discs on `square-60` 62 are explained by three contacts: with 60 it is said of 3 that there are more, with 30 of 10. Of 201 scenes in
/// which `auto` finds four or five it is said of 176 and of 188.
const FIRST_GAIN: f32 = 60.0;
/// Standard deviations of the sum of squares beyond which readings do not fit: the host's.
const MISFIT_DEVIATIONS: f32 = 5.0;
/// What is followed explains a frame as long as its sum of squares is below this times what the search left: the host's.
const WORSE: f32 = 1.3;
/// Steps at most where a contact is followed, and where it is searched.
const FOLLOWING: usize = 4;
const SEARCHING: usize = 20;
/// Conductance (sheet conductances) above which more would change nothing.
const SATURATED_SHEETS: f32 = 100.0;
/// Frames without a better answer after which one that does not fit is searched again; doubled each time, up to the second.
const PATIENCE: [u32; 2] = [1, 64];

/// A frame to be explained.
#[derive(Clone, Copy)]
struct Task<'a> {
    table: &'a Table<'a>,
    frame: &'a Frame<'a>,
    errors: &'a Errors,
}

impl Task<'_> {
    fn readings(&self) -> f32 {
        self.errors.count as f32
    }
}

/// Finds contacts in frames, one after the other: those of one table.
#[derive(Clone, Debug)]
pub struct Solver {
    circuit: Circuit,
    scene: Scene,
    ids: [u32; MAX_CONTACTS],
    /// Numbers begin at 1.
    next_id: u32,
    /// What the last search left of a reading, and the frames that one that did not end well is not repeated for.
    searched: f32,
    /// Whether it left enough for another contact.
    more: bool,
    patience: u32,
    wait: u32,
}

impl Default for Solver {
    fn default() -> Self {
        Self::new()
    }
}

impl Solver {
    /// A solver that has seen nothing.
    pub const fn new() -> Self {
        Self {
            circuit: Circuit::EMPTY,
            scene: Scene::EMPTY,
            ids: [0; MAX_CONTACTS],
            next_id: 1,
            searched: 0.0,
            more: false,
            patience: PATIENCE[0],
            wait: 0,
        }
    }

    /// Forgets the frames before.
    pub fn reset(&mut self) {
        *self = Self::new();
    }

    /// The contacts of a frame.
    ///
    /// # Errors
    /// [`FrameError`] if it cannot be a frame of the table's detector.
    pub fn solve(&mut self, table: &Table<'_>, frame: &Frame<'_>) -> Result<Answer, FrameError> {
        self.solve_while(table, frame, &mut || {})
    }

    /// The contacts of a frame, where there is something else to attend to meanwhile: `attend` is called at least after every look at three contacts, or at
    /// one place (some 100 000 floating-point operations).
    ///
    /// # Errors
    /// As for [`solve`](Self::solve).
    pub fn solve_while(
        &mut self,
        table: &Table<'_>,
        frame: &Frame<'_>,
        attend: &mut dyn FnMut(),
    ) -> Result<Answer, FrameError> {
        frame.check(table)?;
        let task = Task { table, frame, errors: &Errors::of(frame, table) };
        let mut work = Working::new(attend);
        let before = self.scene;
        let mut found = self.followed(task, &mut work);
        let readings = task.readings();
        // Nothing is left, or far less unexplained: what did not fit is gone.
        let has_changed = found.is_none_or(|fit| self.more && WORSE * fit.normal.cost < self.searched);
        if has_changed {
            self.wait = 0;
        }
        let most = |fit: &Fit| (WORSE * self.searched).max(limit(readings - freedom(fit)));
        let is_lost = has_changed || found.is_some_and(|fit| fit.normal.cost > most(&fit));
        if is_lost && self.may_search() {
            found = self.search(found, task, &mut work);
            found = found.and_then(|fit| self.pruned(fit, task, &mut work));
            found = found.map(|fit| self.completed(fit, task, &mut work));
            found = found.map(|fit| self.exchanged(fit, task, &mut work));
            found = found.map(|fit| self.reduced(fit, task, &mut work));
            self.more &= found.is_some();
            self.searched = found.map_or(0.0, |fit| fit.normal.cost);
            let fits = found.is_none_or(|fit| !is_misfit(&fit, readings));
            self.patience = if fits { PATIENCE[0] } else { (2 * self.patience).min(PATIENCE[1]) };
            self.wait = if fits { 0 } else { self.patience };
        }
        self.scene = found.map_or_else(Scene::default, |fit| fit.scene);
        self.number(&before);
        Ok(self.answer(found, task, work.done))
    }

    fn may_search(&mut self) -> bool {
        let may = self.wait == 0;
        self.wait = self.wait.saturating_sub(1);
        may
    }

    /// What was found last, fitted to this frame, without what is no longer there.
    fn followed(&mut self, task: Task<'_>, work: &mut Working<'_>) -> Option<Fit> {
        let fit = self.fit(self.scene, ANY_RADIUS, FOLLOWING, task, work)?;
        self.pruned(fit, task, work)
    }

    /// A fit without the contacts that the readings do not speak for; `None` if none is left.
    fn pruned(&mut self, mut fit: Fit, task: Task<'_>, work: &mut Working<'_>) -> Option<Fit> {
        while let Some(gone) = weakest(&fit) {
            fit = self.fit(fit.scene.without(gone), ANY_RADIUS, SEARCHING, task, work)?;
        }
        Some(fit)
    }

    fn fit(
        &mut self,
        scene: Scene,
        radius_deviation: f32,
        steps: usize,
        task: Task<'_>,
        work: &mut Working<'_>,
    ) -> Option<Fit> {
        let Task { table, frame, errors } = task;
        Fitter { table, frame, errors, circuit: &mut self.circuit, work, radius_deviation }.fit(scene, steps)
    }

    /// The best explanation that is found, from what was followed or from nothing.
    fn search(&mut self, from: Option<Fit>, task: Task<'_>, work: &mut Working<'_>) -> Option<Fit> {
        let best = from.and_then(|from| self.grown(from, task, work));
        // What there was more than is no place to go on from.
        if !self.more && best.is_some_and(|best| !is_misfit(&best, task.readings())) {
            return best;
        }
        let candidates = first(task.table, task.frame, task.errors, work);
        if candidates[0].gain < FIRST_GAIN {
            return best;
        }
        let starts = candidates.map(|candidate| (candidate.gain > 0.0).then(|| Scene::default().with(candidate.spot)));
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
            best = better(best, self.fit(*start, radius_deviation, SEARCHING, task, work));
            if best.is_some_and(|best: Fit| !is_misfit(&best, task.readings())) {
                break;
            }
        }
        best
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
            let starts = candidates.map(|one| (one.gain > PAID * PARAMETER_PRICE).then(|| at.scene.with(one.spot)));
            let Some(more) = self.best_of(&starts, USUAL_RADIUS, task, work) else { return best };
            at = more;
        }
    }

    /// Contacts with those that are looked for beside them as long as one would explain much of what they leave; notes whether another one would.
    fn completed(&mut self, mut best: Fit, task: Task<'_>, work: &mut Working<'_>) -> Fit {
        loop {
            let candidates = self.beside(&best, task, work);
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
    fn exchanged(&mut self, mut best: Fit, task: Task<'_>, work: &mut Working<'_>) -> Fit {
        let (mut k, mut kept) = (0, 0);
        while kept < best.scene.count && (self.more || is_misfit(&best, task.readings())) {
            k %= best.scene.count;
            let rest = self.fit(best.scene.without(k), USUAL_RADIUS, SEARCHING, task, work);
            let new = rest.and_then(|rest| self.grown(rest, task, work)).and_then(|new| self.pruned(new, task, work));
            let before = self.more;
            let new = new.map(|new| self.completed(new, task, work));
            match new.filter(|new| score(new) < score(&best) - PARAMETER_PRICE) {
                Some(new) => (best, kept) = (new, 0),
                None => (k, kept, self.more) = (k + 1, kept + 1, before),
            }
        }
        best
    }

    /// Contacts without those that the others do as well without, once they are fitted anew: a second one that was found while the first was too small.
    fn reduced(&mut self, mut best: Fit, task: Task<'_>, work: &mut Working<'_>) -> Fit {
        while best.scene.count > 1 {
            let mut fewer = None;
            for k in 0..best.scene.count {
                fewer = better(fewer, self.fit(best.scene.without(k), ANY_RADIUS, SEARCHING, task, work));
            }
            match fewer.filter(|fewer| score(fewer) < score(&best)) {
                Some(fewer) => best = fewer,
                None => return best,
            }
        }
        best
    }

    /// Where one more contact would explain most of what others leave.
    fn beside(&mut self, fit: &Fit, task: Task<'_>, work: &mut Working<'_>) -> Candidates {
        let Task { table, frame, errors } = task;
        let is_solved = self.circuit.solve(table, fit.scene.spots());
        let beside = is_solved.then(|| Beside::new(table, &self.circuit, frame, errors, &fit.normal)).flatten();
        beside.map_or_else(Candidates::default, |beside| beside.candidates(errors, work))
    }

    /// Gives contacts the numbers of the nearest ones before.
    fn number(&mut self, before: &Scene) {
        let old = self.ids;
        let (mut given, mut taken) = ([false; MAX_CONTACTS], [false; MAX_CONTACTS]);
        let count = self.scene.count;
        for _ in 0..count.min(before.count) {
            let mut nearest = (f32::INFINITY, 0, 0);
            for k in (0..count).filter(|k| !given[*k]) {
                for l in (0..before.count).filter(|l| !taken[*l]) {
                    let [x, y] = [0, 1].map(|d| self.scene.spots[k].at_m[d] - before.spots[l].at_m[d]);
                    if x * x + y * y < nearest.0 {
                        nearest = (x * x + y * y, k, l);
                    }
                }
            }
            let (_, k, l) = nearest;
            (given[k], taken[l]) = (true, true);
            self.ids[k] = old[l];
        }
        for k in (0..count).filter(|k| !given[*k]) {
            self.ids[k] = self.next_id;
            self.next_id = self.next_id.checked_add(1).unwrap_or(1);
        }
    }

    fn answer(&mut self, found: Option<Fit>, task: Task<'_>, work: Work) -> Answer {
        let mut answer = Answer::of(work);
        answer.flags.raise(Flags::SATURATED, task.errors.is_full);
        answer.flags.raise(Flags::MORE, self.more);
        let Task { table, frame, errors } = task;
        let readings = task.readings();
        let Some(fit) = found.filter(|fit| self.circuit.solve(task.table, fit.scene.spots())) else {
            let voltages = (0..frame.volts.len()).filter(|i| frame.says_at(*i) == Says::Voltage);
            let squares: f32 = voltages.map(|i| frame.volts[i] * frame.volts[i]).sum();
            answer.residual = libm::sqrtf(squares / errors.variance_v2 / readings.max(1.0));
            return answer;
        };
        answer.flags.raise(Flags::MISFIT, is_misfit(&fit, readings));
        answer.residual = libm::sqrtf(fit.normal.cost / readings.max(1.0));
        let covariance = fit.normal.covariance();
        let firmest_s = SATURATED_SHEETS * table.head().sheet_s;
        for k in 0..self.circuit.count {
            let contact = self.contact(k, table, covariance.as_ref());
            answer.flags.raise(Flags::SATURATED, contact.conductance_s > firmest_s);
            answer.add(contact);
        }
        answer
    }

    fn contact(&self, k: usize, table: &Table<'_>, covariance: Option<&[Vector; MOST]>) -> Contact {
        let (loaded, radius_m) = (&self.circuit.loaded[k], table.head().radius_m);
        let first = PARAMETERS * k;
        let of = |i: usize, j: usize| covariance.map_or(f32::INFINITY, |all| all[first + i][first + j]);
        let [x, y, log_radius] = [0, 1, 3].map(|i| libm::sqrtf(of(i, i).max(0.0)));
        let variance = loaded.conductance_variance(table, radius_m, of);
        let conductance_s = loaded.conductance_s();
        Contact {
            id: self.ids[k],
            x_m: loaded.spot.at_m[0],
            y_m: loaded.spot.at_m[1],
            conductance_s,
            conductance_sigma_s: conductance_s * libm::sqrtf(variance),
            apparent_conductance_s: 1.0 / (loaded.share * loaded.ohm),
            radius_m: loaded.radius_m,
            radius_sigma_m: loaded.radius_m * log_radius,
            sigma_m: [radius_m * x, radius_m * y],
            correlation: if x * y > 0.0 { of(0, 1) / (x * y) } else { 0.0 },
        }
    }
}

fn freedom(fit: &Fit) -> f32 {
    PAID * fit.scene.count as f32
}

/// Sum of squares of so many normal numbers beyond which they are not those of noise.
fn limit(freedom: f32) -> f32 {
    let freedom = freedom.max(1.0);
    freedom + MISFIT_DEVIATIONS * libm::sqrtf(2.0 * freedom)
}

fn is_misfit(fit: &Fit, readings: f32) -> bool {
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

/// The contact that the readings speak least for, if that is less than its price: of a light one, whose readings are in proportion to its conductance, the
/// square of them is that of the derivative by its logarithm, or what others leave of that.
fn weakest(fit: &Fit) -> Option<usize> {
    let covariance = fit.normal.covariance();
    let information = |k: usize| {
        let strength = PARAMETERS * k + 2;
        let left = covariance.as_ref().map_or(f32::INFINITY, |all| 1.0 / all[strength][strength]);
        fit.normal.matrix[strength][strength].min(left)
    };
    let least = (0..fit.scene.count).min_by(|a, b| information(*a).total_cmp(&information(*b)))?;
    (information(least) < PAID * PARAMETER_PRICE).then_some(least)
}
