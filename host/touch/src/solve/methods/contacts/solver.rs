//! Contacts from frame to frame: followed, and searched where following does not explain the readings.

mod by_rows;
mod frame_tracker;

use std::ops::ControlFlow;
use std::sync::Arc;

use self::frame_tracker::FrameTracker;
use super::discs::DiscFit;
use super::doubt::Doubt;
use super::keep::needed;
use super::rows::RowState;
use super::smoother::Smoother;
use super::window::KeyFrames;
use super::{ContactFinder, ContactHypothesis, ContactSettings};
use crate::solve::after::association::Association;
use crate::solve::answer::{Calibrated, FoundContact, Solution, SolveError};
use crate::solve::before::adaptive_mean::Mean;
use crate::solve::before::latest::Latest;
use crate::solve::fit::approximation::ApproximationError;
use crate::solve::fit::evidence::Evidence;
use crate::solve::fit::policy;
use crate::solve::fit::target::Target;
use crate::solve::problem::Problem;
use crate::solve::solver::{Hypothesis, Parts, Search, Solver, Tracker, follow_and_search, follow_rows_and_search};
use tactomo_physics::forward::ForwardError;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;

/// Fits contacts.
pub struct Contacts {
    tracker: FrameTracker,
}

/// Follows contacts from frame to frame.
pub(crate) struct ContactTracker {
    finder: Arc<ContactFinder>,
    last: Option<ContactHypothesis>,
    searched: Searched,
    /// Whether what is followed could not be brought to the newest frame.
    is_stale: bool,
    /// What is known besides by rows, since all readings were explained last.
    rows: Option<Box<RowState>>,
    /// The newest whole frame of a detector that is not known exactly: rows that come next go on from what it is off by.
    whole: Option<Target>,
    /// What whole frames before the newest say of what is followed.
    smoother: Option<Smoother>,
    /// The latest of each reading, while rows come.
    latest: Option<Latest>,
    /// Whether what is followed was found in some of the rows only.
    is_glimpsed: bool,
    /// Time since a search changed the number of contacts (s), until one does not: rows from before were given for other contacts' motion.
    recounted_s: Option<f64>,
    doubt: Doubt,
    /// Whole frames in a row that differed from those before.
    restless: usize,
    /// Time for which no row has said more than that its readings are below the converter's range (s).
    silent_s: f64,
    /// What is followed over a longer time.
    keys: KeyFrames,
    /// Whether a search is to look at these alone.
    is_of_key_frames: bool,
    /// Whether it was found when what the readings may be off by together was not known yet.
    is_provisional: bool,
    /// What a calibration would bring, as all readings showed of what is followed.
    calibrated: Option<Calibrated>,
    /// Contacts that another tracker has found: where it begins when something presses.
    inherited: Vec<Contact>,
    association: Association,
    /// As it was before this frame: a frame that has several answers is one frame.
    before: Association,
}

/// What is inside a [`Hypothesis`](crate::solve::solver::Hypothesis) of this method.
#[derive(Clone, Debug, Default)]
struct FrameHypothesis {
    contacts: Option<Box<ContactHypothesis>>,
    /// The mean of the frames up to it as far as they stood still.
    mean: Option<Mean>,
}

impl FrameHypothesis {
    fn new(contacts: Option<ContactHypothesis>, mean: Option<Mean>) -> Self {
        Self { contacts: contacts.map(Box::new), mean }
    }
}

/// What the last search has left.
#[derive(Clone, Copy, Debug, Default)]
struct Searched {
    /// Sum of squares over what noise leaves.
    excess: f64,
    /// Frames in whose mean it has searched.
    frames: usize,
}

/// Searches contacts.
pub(crate) struct ContactSearch {
    finder: Arc<ContactFinder>,
}

impl Contacts {
    /// Makes it ready for a problem.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if the model has no spots.
    pub fn new(problem: &Problem, settings: ContactSettings) -> Result<Self, ForwardError> {
        let contacts = ContactTracker::new(Arc::new(ContactFinder::new(problem, settings)?));
        Ok(Self { tracker: FrameTracker { average: contacts.finder.adaptive_mean(), contacts } })
    }

    /// Mean square of what one contact leaves of readings, in what noise and model error make; `None` if there is none.
    pub fn left_by_one(&self, readings: &Readings) -> Option<f64> {
        self.tracker.contacts.finder.left_by_one(readings)
    }

    /// Share of readings that one contact leaves, as far as a look at every place tells, in some 10 us; of readings some of which are bounds, in some
    /// 300 us.
    pub(crate) fn roughly_left_by_one(&self, readings: &Readings) -> f64 {
        self.tracker.contacts.finder.roughly_left_by_one(readings)
    }

    #[cfg(test)]
    pub(super) fn finder(&self) -> &ContactFinder {
        &self.tracker.contacts.finder
    }

    #[cfg(test)]
    pub(super) fn found(&self) -> Option<&ContactHypothesis> {
        self.tracker.contacts.last.as_ref()
    }
}

impl ContactTracker {
    /// Follows nothing yet.
    pub fn new(finder: Arc<ContactFinder>) -> Self {
        let association = Association::new(finder.spacing_m);
        let searched = Searched::default();
        let before = association.clone();
        Self {
            finder,
            last: None,
            searched,
            is_stale: false,
            rows: None,
            whole: None,
            smoother: None,
            latest: None,
            is_glimpsed: false,
            recounted_s: None,
            doubt: Doubt::default(),
            restless: 0,
            silent_s: 0.0,
            keys: KeyFrames::default(),
            is_of_key_frames: false,
            is_provisional: false,
            calibrated: None,
            inherited: Vec::new(),
            before,
            association,
        }
    }

    /// Whether a search is to look at key frames that none has seen.
    pub fn has_news(&self) -> bool {
        self.is_of_key_frames
    }

    /// What finds the contacts.
    pub fn finder(&self) -> &Arc<ContactFinder> {
        &self.finder
    }

    /// What is followed.
    pub fn found(&self) -> Option<ContactHypothesis> {
        let keys = self.is_of_key_frames.then(|| self.keys.all());
        self.last.clone().map(|last| ContactHypothesis { keys, ..last })
    }

    /// Derivatives of the readings by the parameters of what is followed (V).
    pub fn slopes_v(&self) -> &[Vec<f64>] {
        self.last.as_ref().map_or(&[], |last| last.fit.slopes_v())
    }

    /// What the readings of what is followed may be off by together.
    pub fn error(&self) -> Option<&Arc<ApproximationError>> {
        self.last.as_ref().and_then(|last| last.error.as_ref())
    }

    /// Brings the contacts to the next frame; whether they have to be searched.
    pub fn follow(&mut self, target: &Target) -> bool {
        let before = self.smoother.take();
        let search = self.step_frame(target);
        let followed = self.last.as_ref().filter(|_| !self.is_stale);
        self.smoother = followed.and_then(|last| self.finder.smoothed(before, &last.fit, target));
        let fits = |last: &ContactHypothesis| !self.finder.is_misfit(&last.fit, target);
        self.doubt.whole(!self.is_stale && self.last.as_ref().map_or(!search, fits));
        search
    }

    fn step_frame(&mut self, target: &Target) -> bool {
        self.before = self.association.clone();
        (self.rows, self.whole, self.latest) = (None, None, None);
        self.restless = if target.frames > 1 { 0 } else { self.restless + 1 };
        self.is_of_key_frames = false;
        let Some(last) = self.last.take() else {
            let search = self.finder.stands_out(target);
            self.last = search.then(|| self.taken_over(target)).flatten();
            self.is_stale = self.last.is_some();
            return search;
        };
        let Some(moved) = self.finder.follow(&last, target) else {
            (self.last, self.is_stale) = (Some(last), true);
            return true;
        };
        self.is_stale = false;
        let Some(found) = self.finder.without_weak(moved, target) else { return self.finder.stands_out(target) };
        let search = found.fit.cost > self.enough(&found.fit, target)
            || target.frames >= policy::MORE_FRAMES * self.searched.frames
            || target.is_stale(&found.fit.volts)
            || self.finder.is_outdated(target);
        self.keys.take(target, &found.fit, &self.finder);
        // What is unknown of the detector is soon known, and asks for a search of its own.
        self.is_of_key_frames = self.keys.are_ripe()
            && !target.is_provisional()
            && self.finder.problem.has_compiled()
            && !self.finder.is_misfit(&found.fit, target);
        (self.last, self.whole) = (Some(found), target.error().map(|_| target.clone()));
        search || self.is_of_key_frames
    }

    /// What contacts that another tracker found are in a frame in which something presses: for the time of a search better than none.
    fn taken_over(&mut self, target: &Target) -> Option<ContactHypothesis> {
        let inherited = std::mem::take(&mut self.inherited);
        (!inherited.is_empty()).then(|| self.finder.roughly_from(inherited, target)).flatten()
    }

    /// Takes what a search has found in the mean of some frames, if it explains this frame better than what is followed; whether the search has to be repeated, because
    /// what it has found does not explain this frame as well as its own.
    pub fn adopt(&mut self, found: Option<ContactHypothesis>, frames: usize, target: &Target) -> bool {
        self.association = self.before.clone();
        self.smoother = None;
        let expected_v = self.expected_v().map(<[f64]>::to_vec);
        let count = |found: &Option<ContactHypothesis>| found.as_ref().map_or(0, |found| found.fit.contacts.len());
        let before = count(&self.last);
        let found = found.map(|found| {
            if found.is_of_key_frames() {
                self.keys.looked_at();
            }
            ContactHypothesis { keys: None, ..found }
        });
        let left = found.as_ref().map_or(0.0, |found| found.fit.cost);
        let caught_up = found.and_then(|found| self.finder.catch_up(found, target));
        self.last = self.last.take().and_then(|last| self.finder.judged(last, target));
        let evidence = |found: &Option<ContactHypothesis>| {
            let of = |found: &ContactHypothesis| self.finder.evidence(&found.fit);
            found.as_ref().map_or_else(|| self.finder.evidence_of_nothing(target), of)
        };
        let are_fewer = count(&caught_up) < count(&self.last);
        let needed = self.last.as_ref().filter(|_| are_fewer).map_or(0.0, |last| needed(&last.fit));
        if self.is_stale || evidence(&caught_up) >= evidence(&self.last) + needed {
            (self.last, self.is_stale) = (caught_up, false);
        }
        self.recounted_s = (count(&self.last) != before).then_some(0.0);
        if before > 0 && self.last.is_some() && self.recounted_s.is_some() {
            self.doubt.recounted();
        }
        // Where whole frames come, rows may never follow.
        let by_rows = self.last.as_ref().filter(|_| self.latest.is_some());
        self.rows = by_rows.map(|last| Box::new(RowState::new(&self.finder, last, target)));
        self.whole = target.error().filter(|_| self.rows.is_none()).map(|_| target.clone());
        if let Some(mut latest) = self.latest.take() {
            latest.change_model(expected_v.as_deref(), self.expected_v());
            self.latest = Some(latest);
        }
        self.is_provisional = target.is_provisional();
        self.calibrated = self.last.as_ref().and_then(|last| self.finder.calibrated(&last.fit, target));
        let Some(last) = &self.last else { return self.finder.stands_out(target) };
        self.searched =
            Searched { excess: (left.min(last.fit.cost) - self.finder.freedom(&last.fit, target)).max(0.0), frames };
        last.fit.cost > self.enough(&last.fit, target) || self.finder.is_outdated(target)
    }

    /// Sum of squares up to which what is followed explains the mean of some frames: what is not noise stands out by their number.
    fn enough(&self, fit: &DiscFit, target: &Target) -> f64 {
        let more = target.frames as f64 / self.searched.frames.max(1) as f64;
        policy::WORSE * (self.finder.freedom(fit, target) + more * self.searched.excess)
    }

    /// What is left of the frames that were followed last, and what that takes; of nothing, all of it.
    pub fn evidence(&self, target: &Target) -> Evidence {
        let nothing = || Evidence::of(target.cost_of_nothing(), 0);
        self.last.as_ref().map_or_else(nothing, |last| self.finder.evidence_of(&last.fit))
    }

    /// Goes on from contacts that were found before, and from their numbers.
    pub fn inherit(&mut self, before: &[FoundContact]) {
        let radius_m = self.finder.settings.radius_m;
        let contact = |found: &FoundContact| {
            let (conductance_s, radius_m) = (found.known_conductance_s()?, found.radius_m.unwrap_or(radius_m));
            Some(Contact { x_m: found.x_m, y_m: found.y_m, z_m: found.z_m, radius_m, conductance_s })
        };
        self.inherited = before.iter().filter_map(contact).collect();
        self.association.inherit(before);
        self.before = self.association.clone();
    }

    /// What is followed, as a solution, with the numbers that contacts keep.
    pub fn solution(&mut self, target: &Target) -> Solution {
        let shown = self.smoother.as_ref().and_then(|smoother| smoother.shown.as_ref());
        let of = |last: &ContactHypothesis| self.finder.solution(shown.unwrap_or(&last.fit), target);
        let mut solution = self.last.as_ref().map_or_else(|| self.finder.nothing(target), of);
        solution.flags.unfinished |= self.is_stale;
        // Among explanations none of which explains the readings, or of which better ones are still sought, the share of one says nothing.
        let certainty = self.last.as_ref().and_then(|found| found.certainty);
        let certainty = certainty.filter(|_| !solution.flags.is_doubtful());
        solution.certainty = certainty.map(|certainty| certainty.share);
        solution.alternative = certainty.and_then(|certainty| certainty.alternative);
        self.association.number(&mut solution.contacts);
        solution
    }

    /// Follows nothing for a time, and keeps the numbers of contacts.
    pub fn let_go(&mut self) {
        (self.last, self.searched, self.is_stale) = (None, Searched::default(), false);
        (self.doubt, self.restless) = (Doubt::default(), 0);
        (self.keys, self.is_of_key_frames) = (KeyFrames::default(), false);
        (self.rows, self.whole, self.smoother, self.recounted_s) = (None, None, None, None);
    }

    /// Forgets all.
    pub fn reset(&mut self) {
        self.let_go();
        self.latest = None;
        self.association.reset();
        self.before = self.association.clone();
    }
}

impl ContactSearch {
    /// Searches with what a tracker follows with.
    pub fn new(finder: Arc<ContactFinder>) -> Self {
        Self { finder }
    }

    /// What contacts are in the mean of some frames, as a solution.
    ///
    /// # Errors
    /// [`SolveError`] if the readings cannot be those of the detector.
    pub fn solution(&self, found: &ContactHypothesis, mean: &Mean) -> Result<Solution, SolveError> {
        let target = self.finder.target_of(mean, found.error())?;
        Ok(self.finder.solution(&found.fit, &target))
    }

    /// The contacts that explain the mean of some frames, and the solution that they are; `None` if nothing touches. Better ones on the way there go
    /// to `found`, which may end the search.
    pub fn contacts(
        &self,
        from: Option<ContactHypothesis>,
        mean: &Mean,
        found: &mut dyn FnMut(ContactHypothesis) -> ControlFlow<()>,
    ) -> Result<Option<(ContactHypothesis, Solution)>, SolveError> {
        let target = self.finder.target_to_search(mean)?;
        let mut better = |better: &ContactHypothesis| found(better.clone());
        let found = self.finder.search(from.as_ref(), &target, &mut better);
        found.map(|found| Ok((found.clone(), self.solution(&found, mean)?))).transpose()
    }
}

impl Search for ContactSearch {
    fn search(
        &mut self,
        from: Hypothesis,
        readings: &Readings,
        found: &mut dyn FnMut(Hypothesis) -> ControlFlow<()>,
    ) -> Result<Hypothesis, SolveError> {
        let from: FrameHypothesis = from.known();
        let mean = from.mean.unwrap_or_else(|| Mean::of_frame(readings));
        let mut better = |better| found(Hypothesis::of(FrameHypothesis::new(Some(better), Some(mean.clone()))));
        let found = self.contacts(from.contacts.map(|found| *found), &mean, &mut better)?.map(|(found, _)| found);
        Ok(Hypothesis::of(FrameHypothesis::new(found, Some(mean))))
    }
}

impl Solver for Contacts {
    fn name(&self) -> &'static str {
        "contacts"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let mut search = ContactSearch::new(Arc::clone(&self.tracker.contacts.finder));
        follow_and_search(&mut self.tracker, &mut search, readings)
    }

    fn solve_rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Solution, SolveError> {
        let mut search = ContactSearch::new(Arc::clone(&self.tracker.contacts.finder));
        follow_rows_and_search(&mut self.tracker, &mut search, (rows, latest), elapsed_s)
    }

    fn reset(&mut self) {
        self.tracker.reset();
    }

    fn split(self: Box<Self>) -> Parts {
        let search = ContactSearch::new(Arc::clone(&self.tracker.contacts.finder));
        Parts { tracker: Box::new(self.tracker), search: Some(Box::new(search)) }
    }
}
