//! Contacts brought to rows of readings as they come.

use super::ContactTracker;
use crate::solve::answer::SolveError;
use crate::solve::before::adaptive_mean::Mean;
use crate::solve::before::latest::Latest;
use crate::solve::fit::target::Target;
use crate::solve::methods::contacts::doubt::Doubt;
use crate::solve::methods::contacts::rows::{RowState, Step};
use crate::solve::solver::Followed;
use tactomo_physics::readings::Readings;

/// Frames in a row that differ from those before, of what moves: what stands still is averaged after ten.
const RESTLESS: usize = 16;
/// Rows older than this say nothing to a search (s): all grounds of 32 electrodes are read within.
const OLDEST_S: f64 = 0.06;

impl ContactTracker {
    /// The answer for rows of readings, `elapsed_s` (s) after those before.
    ///
    /// # Errors
    /// [`SolveError`] if the readings cannot be those of the detector.
    pub fn follow_rows(&mut self, rows: &Readings, elapsed_s: f64) -> Result<Followed, SolveError> {
        self.finder.check(rows)?;
        let (target, search) = self.step(rows, elapsed_s);
        match &self.rows {
            Some(state) => self.doubt.rows(state.fits(), elapsed_s),
            // Of nothing there is no doubt, however it was with what has gone.
            None if !search => self.doubt = Doubt::default(),
            None => self.doubt.rows(false, elapsed_s),
        }
        self.silent_s = if target.is_silent() { self.silent_s + elapsed_s } else { 0.0 };
        if self.silent_s > OLDEST_S {
            // The lightest contact that was seen would not be seen any more either.
            (self.last, self.rows, self.is_stale) = (None, None, false);
        }
        let mut latest = self.latest.take().unwrap_or_else(|| Latest::new(rows.electrodes()));
        if !search && self.last.is_none() {
            // What presses next begins with its first rows.
            latest.forget();
        }
        latest.add(rows, elapsed_s, self.expected_v());
        if self.rows.as_ref().and_then(|rows| rows.moves()) == Some(false) {
            self.restless = 0;
        }
        let is_outdated = self.last.is_some() && self.is_provisional && self.finder.knows_unknowns();
        self.recounted_s = self.recounted_s.map(|time_s| time_s + elapsed_s);
        let is_renewed = self.recounted_s.is_some_and(|time_s| latest.is_whole(time_s));
        let search = search || is_outdated || is_renewed || self.is_glimpsed && latest.is_whole(OLDEST_S);
        self.latest = Some(latest);
        let mut solution = self.solution(&target);
        // A few rows do not tell it: what all readings are off by was taken off them.
        solution.calibrated = self.calibrated.filter(|_| self.last.is_some());
        solution.flags.calibrate = solution.calibrated.is_some();
        Ok(Followed { solution, search })
    }

    /// Takes note of what a search has looked at.
    pub fn searched_in(&mut self, mean: Option<&Mean>) {
        self.is_glimpsed = mean.is_some_and(|mean| !mean.readings.is_whole());
    }

    /// The grounds whose rows tell most of what moves, so many of them. All, of what stands or has just come: no number of rows takes away what the model
    /// of a reading is off by, and a new contact is seen by all; and once contacts have changed so much that it has to be found anew what readings
    /// are off by. Of nothing, those that see a contact come. None where rows do not tell it, as where contacts are too many to be followed by few.
    pub fn telling_grounds(&self, count: usize) -> Option<Vec<usize>> {
        let is_stale =
            self.rows.as_ref().zip(self.last.as_ref()).is_some_and(|(rows, last)| rows.is_stale(&last.fit.volts));
        match &self.last {
            _ if self.doubt.needs_whole() => None,
            Some(last) if self.moves() && !is_stale => Some(self.finder.telling_grounds(&last.fit, count)),
            Some(_) => Some(self.finder.all_grounds()),
            None => Some(self.finder.watching_grounds()),
        }
    }

    /// Whether what is followed moves, as rows tell it once they have come for a while, and whole frames before.
    fn moves(&self) -> bool {
        self.rows.as_ref().and_then(|rows| rows.moves()).unwrap_or(self.restless >= RESTLESS)
    }

    /// The latest readings, as they would be for the contacts now; none while whole frames come.
    pub fn latest(&self) -> Option<Mean> {
        let readings = self.latest.as_ref()?.readings(OLDEST_S, self.expected_v());
        Some(Mean { readings, frames: 1 })
    }

    /// Brings the contacts to rows of readings; the rows as they were fitted, and whether the contacts have to be searched.
    fn step(&mut self, rows: &Readings, elapsed_s: f64) -> (Target, bool) {
        (self.before, self.smoother) = (self.association.clone(), None);
        if let Some((last, whole)) = self.last.as_ref().zip(self.whole.take()) {
            self.rows = Some(Box::new(RowState::new(&self.finder, last, &whole)));
        }
        let discrepancy = self.rows.as_ref().map(|state| state.discrepancy());
        let target = self.finder.target_of_rows(rows, discrepancy);
        let Some(last) = self.last.take() else {
            self.rows = None;
            // A rough contact is better than none for the time of a search.
            let glimpsed = self.finder.glimpsed(&target);
            let search = glimpsed.is_some();
            if let Some(begun) = glimpsed.map(|glimpsed| self.taken_over(&target).unwrap_or(glimpsed)) {
                self.rows = Some(Box::new(RowState::new(&self.finder, &begun, &target)));
                self.is_provisional = target.is_provisional();
                (self.last, self.is_stale, self.is_glimpsed) = (Some(begun), true, true);
            }
            return (target, search);
        };
        let state = self.rows.take().unwrap_or_else(|| Box::new(RowState::new(&self.finder, &last, &target)));
        match self.finder.step(last.clone(), *state, &target, elapsed_s) {
            Step::Followed(found, state, search) => {
                (self.last, self.rows, self.is_stale) = (Some(*found), Some(state), false);
                (target, search)
            }
            Step::Gone => {
                self.is_stale = false;
                (target, false)
            }
            Step::Lost => {
                (self.last, self.is_stale) = (Some(last), true);
                (target, true)
            }
        }
    }

    /// Readings that what is followed predicts (V), as long as it fits the rows. On a detector that is not known exactly, what was found in some rows
    /// alone predicts no others: as more rows come it changes without that anything moves.
    pub(super) fn expected_v(&self) -> Option<&[f64]> {
        let is_rough = self.is_glimpsed && self.finder.errors.detector.is_some();
        let fits = !is_rough && self.rows.as_ref().is_some_and(|state| state.fits());
        self.last.as_ref().filter(|_| fits).map(|last| &last.fit.volts[..])
    }
}
