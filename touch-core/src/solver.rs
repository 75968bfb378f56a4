//! Contacts from frame to frame.
//!
//! What was found last is fitted again. Where that explains neither a frame nor the one before, more contacts are looked for beside it, and without it. One
//! more is believed if it lowers the sum of squares by more than its parameters' price. What leaves too much is mended: one more where that would explain much,
//! each in turn looked for anew beside the others, and one fewer where those that stay do as well.

use crate::answer::{Answer, Contact, Flags};
use crate::circuit::{Circuit, MAX_CONTACTS};
use crate::fit::{Fit, Fitter, Scene, Work, Working};
use crate::frame::{Errors, Frame, FrameError, Says};
use crate::normal::{ANY_RADIUS, MOST, PARAMETERS, Vector};
use crate::scan::first;
use crate::search::{FIRST_GAIN, freedom, is_misfit, limit};
use crate::table::Table;

/// What is followed explains a frame as long as its sum of squares is below this times what the search left: the host's.
const WORSE: f32 = 1.3;
/// Steps at most where contacts are followed.
const FOLLOWING: usize = 4;
/// Conductance (sheet conductances) above which more would change nothing.
const SATURATED_SHEETS: f32 = 100.0;
/// Frames without a better answer after which one that does not fit is searched again; doubled each time, up to the second.
pub(crate) const PATIENCE: [u32; 2] = [1, 64];

/// Standard errors have to be above this times those by noise alone for a calibration to be worth it: the host's.
const CALIBRATION_WORTH: f32 = 2.0;
/// What a fit may have left to gain (squared deviations), ten times what a step is not taken for.
const UNFINISHED: f32 = 1.0;

/// A frame to be explained.
#[derive(Clone, Copy)]
pub(crate) struct Task<'a> {
    pub table: &'a Table<'a>,
    pub frame: &'a Frame<'a>,
    pub errors: &'a Errors,
}

impl Task<'_> {
    pub fn readings(&self) -> f32 {
        self.errors.count as f32
    }
}

/// Finds contacts in frames, one after the other: those of one table.
#[derive(Clone, Debug)]
pub struct Solver {
    pub(crate) circuit: Circuit,
    scene: Scene,
    ids: [u32; MAX_CONTACTS],
    /// Numbers begin at 1.
    next_id: u32,
    /// What the last search left of a reading, and the frames that one that did not end well is not repeated for.
    pub(crate) searched: f32,
    /// Whether it left enough for another contact.
    pub(crate) more: bool,
    pub(crate) patience: u32,
    pub(crate) wait: u32,
    /// Whether the last frame was not explained by what was followed, or there was none.
    was_lost: bool,
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
            was_lost: true,
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
        let (frame, left_out) = frame.without_broken(table);
        let frame = &frame;
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
        let alone = found.is_none().then(|| first(task, &mut work));
        let is_lost = match (&found, &alone) {
            (Some(fit), _) => has_changed || fit.normal.cost > most(fit),
            (None, alone) => alone.is_some_and(|alone| alone[0].gain >= FIRST_GAIN),
        };
        self.more &= found.is_some();
        let is_searched = is_lost && self.was_lost && self.may_search();
        if is_searched {
            found = self.search(found, alone, task, &mut work);
        } else if is_lost && !self.was_lost {
            // While something lands or lifts, rows are not those of one scene: what there was stays, and the next frame tells.
            found = self.fit(before, ANY_RADIUS, 0, task, &mut work);
        }
        // A search that ends well has nothing to wait for.
        self.was_lost = is_lost && !(is_searched && self.wait == 0);
        self.scene = found.map_or_else(Scene::default, |fit| fit.scene);
        self.number(&before);
        let mut answer = self.answer(found, task, work.done);
        answer.left_out = left_out;
        answer.flags.raise(Flags::FAULT, left_out != 0);
        answer.flags.raise(Flags::MISFIT, is_lost && !is_searched);
        Ok(answer)
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

    pub(crate) fn fit(
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
        answer.flags.raise(Flags::CALIBRATE, is_to_be_calibrated(&fit, task));
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
        let log_radius = libm::sqrtf(of(3, 3).max(0.0));
        let shift = table.head().shift_m / radius_m;
        let [x, y] = [0, 1].map(|i| libm::sqrtf(of(i, i).max(0.0) + shift * shift));
        let of_detector = table.head().ln_conductance_error;
        let variance = loaded.conductance_variance(table, radius_m, of) + of_detector * of_detector;
        let conductance_s = loaded.conductance_s();
        let apparent_conductance_s = 1.0 / (loaded.share * loaded.ohm);
        Contact {
            id: self.ids[k],
            x_m: loaded.spot.at_m[0],
            y_m: loaded.spot.at_m[1],
            conductance_s,
            conductance_sigma_s: conductance_s * libm::sqrtf(variance),
            apparent_conductance_s,
            force_n: table.force_n(loaded.spot.at_m, apparent_conductance_s),
            radius_m: loaded.radius_m,
            radius_sigma_m: loaded.radius_m * log_radius,
            sigma_m: [radius_m * x, radius_m * y],
            correlation: if x * y > 0.0 { of(0, 1) / (x * y) } else { 0.0 },
        }
    }
}

/// Whether a fit leaves more than noise does, and the table takes that for an error of the detector.
fn is_to_be_calibrated(fit: &Fit, Task { table, errors, .. }: Task<'_>) -> bool {
    let noise_v = table.head().noise_v;
    let of_noise = errors.variance_v2 / (noise_v * noise_v);
    let is_worth_it = of_noise > CALIBRATION_WORTH * CALIBRATION_WORTH;
    is_worth_it && of_noise * (fit.normal.cost - UNFINISHED) > limit(errors.count as f32 - freedom(fit))
}
